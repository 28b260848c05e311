// Takes messages of a subscription as bytes; the Python side is cassie_msgs/ros/inbox.py.
//
// A message that a receiver expects, which is nearly every one, is checked and copied to its sample
// here, in one call. Python looks at all others.

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>

#include "rcl/subscription.h"
#include "rcutils/error_handling.h"

// Answers of `inbox_take`.
enum { NOTHING, LOADED, LOOK, FAILED };

// Offsets in a message of the control lane (CDR): encapsulation, stamp, episode, seq.
enum { EPISODE = 12, SEQ = 20 };
static const uint8_t PLAIN_LITTLE_ENDIAN[] = {0, 1};

static uint32_t episode_of(const uint8_t * raw)
{
  uint32_t episode;
  memcpy(&episode, raw + EPISODE, sizeof(episode));
  return episode;
}

static uint64_t seq_of(const uint8_t * raw)
{
  uint64_t seq;
  memcpy(&seq, raw + SEQ, sizeof(seq));
  return seq;
}

// Episode and seq of the message accepted last: `cassie_msgs.bounds.Place`.
typedef struct
{
  uint64_t seq;
  uint32_t episode;
  bool known;
} place_t;

// What is accepted without a closer look: `cassie_msgs.ros.one_writer.Accepted`.
typedef struct
{
  uint8_t writer[RMW_GID_STORAGE_SIZE];
  bool usual;       // whether there is a writer and its last message was accepted
  double heard;     // time of its last message, in s
  uint64_t lead;    // most ticks by which a message may be ahead; 0: in any order
  place_t last;     // place of that message
} accepted_t;

// The message taken last: `cassie_msgs.ros.inbox._Taken`, and what only this file reads.
typedef struct
{
  uint8_t * bytes;
  size_t length;
  size_t capacity;
  uint64_t number;
  int64_t sent;      // by its writer's clock, in ns
  int64_t received;  // in ns of wall time
  uint8_t writer[RMW_GID_STORAGE_SIZE];
  rcl_serialized_message_t message;
  int descriptor;  // becomes readable when a message comes
} inbox_t;

inbox_t * inbox_open(size_t capacity, int descriptor)
{
  inbox_t * inbox = calloc(1, sizeof(*inbox));
  if (inbox == NULL) {
    return NULL;
  }
  rcutils_allocator_t allocator = rcutils_get_default_allocator();
  if (rcutils_uint8_array_init(&inbox->message, capacity, &allocator) != RCUTILS_RET_OK) {
    free(inbox);
    return NULL;
  }
  inbox->descriptor = descriptor;
  return inbox;
}

void inbox_close(inbox_t * inbox)
{
  rcutils_ret_t code = rcutils_uint8_array_fini(&inbox->message);
  (void)code;  // it fails for no array only
  free(inbox);
}

static void ring(const void * inbox_, size_t count)
{
  const inbox_t * inbox = inbox_;
  eventfd_write(inbox->descriptor, count);
}

// Makes the descriptor readable when messages come.
bool inbox_ring(inbox_t * inbox, const rcl_subscription_t * subscription)
{
  return rcl_subscription_set_on_new_message_callback(subscription, ring, inbox) == RCL_RET_OK;
}

// Has another function called when messages come; NULL for none.
bool inbox_call(const rcl_subscription_t * subscription, rcl_event_callback_t callback)
{
  return rcl_subscription_set_on_new_message_callback(subscription, callback, NULL) == RCL_RET_OK;
}

const char * inbox_error(void)
{
  static rcutils_error_string_t error;  // callers hold the interpreter lock
  error = rcutils_get_error_string();
  rcutils_reset_error();
  return error.str;
}

// Whether a message is from the accepted writer and follows its last one.
static bool is_expected(const inbox_t * inbox, const uint8_t * raw, const accepted_t * accepted)
{
  if (!accepted->usual || memcmp(accepted->writer, inbox->writer, RMW_GID_STORAGE_SIZE) != 0) {
    return false;
  }
  const place_t * last = &accepted->last;
  return accepted->lead == 0 ||
    (last->known && episode_of(raw) == last->episode && seq_of(raw) >= last->seq &&
    seq_of(raw) - last->seq <= accepted->lead);
}

static double now(void)
{
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

// Takes the oldest message, for a closer look.
int inbox_take(inbox_t * inbox, const rcl_subscription_t * subscription)
{
  rmw_message_info_t info;
  rcl_ret_t code = rcl_take_serialized_message(subscription, &inbox->message, &info, NULL);
  if (code != RCL_RET_OK) {
    return code == RCL_RET_SUBSCRIPTION_TAKE_FAILED ? NOTHING : FAILED;
  }
  inbox->bytes = inbox->message.buffer;
  inbox->length = inbox->message.buffer_length;
  inbox->capacity = inbox->message.buffer_capacity;
  inbox->number = info.publication_sequence_number;
  inbox->sent = info.source_timestamp;
  inbox->received = info.received_timestamp;
  memcpy(inbox->writer, info.publisher_gid.data, RMW_GID_STORAGE_SIZE);
  return LOOK;
}

// Takes the oldest message and copies it to a sample, if it has its size and is expected.
//
// `accepted` may be NULL: every message is expected.
int inbox_load(
  inbox_t * inbox, const rcl_subscription_t * subscription, accepted_t * accepted,
  uint8_t * sample, size_t size)
{
  int code = inbox_take(inbox, subscription);
  if (code != LOOK) {
    return code;
  }
  const uint8_t * raw = inbox->bytes;
  bool fits = inbox->length == size && size >= SEQ + sizeof(uint64_t) &&
    memcmp(raw, PLAIN_LITTLE_ENDIAN, sizeof(PLAIN_LITTLE_ENDIAN)) == 0;
  if (!fits || (accepted != NULL && !is_expected(inbox, raw, accepted))) {
    return LOOK;
  }
  if (accepted != NULL) {
    accepted->heard = now();
    if (accepted->lead > 0) {
      accepted->last.seq = seq_of(raw);
    }
  }
  memcpy(sample, raw, size);
  return LOADED;
}
