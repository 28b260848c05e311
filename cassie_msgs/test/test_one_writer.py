"""One writer per topic: strangers are dropped and named, and follow when the first is gone."""

import time

import pytest
import rclpy
from std_msgs.msg import Int32

from cassie_msgs.layout import LayoutError, Mode, OperatorCommand
from cassie_msgs.ros import one_writer
from cassie_msgs.ros.fast_lane import (
    EVERY,
    LanePublisher,
    LaneSubscription,
    RawSubscription,
    take_from_each,
)
from cassie_msgs.ros.one_writer import (
    MOST_UNUSED,
    RETURN_TIME,
    OneWriter,
    WriterWatch,
    identity,
    writers,
)


def until(holds, timeout=90.0):
    deadline = time.monotonic() + timeout
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


class Lane:
    """A receiver of modes that listens to one writer, and two writers."""

    def __init__(self, node, others):
        self.guard = OneWriter(Mode)
        self.subscription = LaneSubscription(node, Mode, qos=EVERY, guard=self.guard)
        self.first, self.second = (LanePublisher(other, Mode) for other in others)
        self.reports = {}
        self.watch = WriterWatch(node, [self.guard], [], self.reports.__setitem__)
        until(lambda: self.first.matched and self.second.matched)
        until(lambda: {*writers(node, Mode.TOPIC).values()} == {"first", "second"})

    def send(self, publisher, seq):
        mode = Mode()
        mode.seq[...] = seq
        publisher.publish(mode)

    def heard(self):
        """What counts of what comes within 0.2 s."""
        time.sleep(0.2)
        mode, seqs = Mode(), []
        while self.subscription.take_next(mode):
            seqs.append(int(mode.seq))
        return seqs


@pytest.fixture
def others():
    contexts = [rclpy.Context() for _ in range(2)]
    for context in contexts:
        rclpy.init(context=context)
    nodes = [
        rclpy.create_node(name, context=context)
        for name, context in zip(("first", "second"), contexts, strict=True)
    ]
    yield nodes
    for context in contexts:
        rclpy.try_shutdown(context=context)


def test_the_second_writer_is_dropped_and_named(node, others):
    lane = Lane(node, others)
    lane.send(lane.first, 1)
    assert lane.heard() == [1]
    for seq in range(2, 12):
        lane.send(lane.second, seq)
    lane.send(lane.first, 2)
    assert lane.heard() == [2]
    lane.watch.look()
    assert lane.reports[Mode.TOPIC] == "second ignored: first writes it already"


def test_nodes_of_the_same_name_and_of_a_namespace_are_told_apart(node, others):
    LanePublisher(others[0], Mode)
    twins = [
        rclpy.create_node("first", namespace=space, context=others[1].context)
        for space in ("", "/robot_2")
    ]
    for twin in twins:
        LanePublisher(twin, Mode)
    names = ["first", "first", "robot_2/first"]
    until(lambda: sorted(writers(node, Mode.TOPIC).values()) == names)
    guard, reports = OneWriter(Mode), {}
    watch = WriterWatch(node, [guard], [], reports.__setitem__)
    guard.writer = next(gid for gid, name in writers(node, Mode.TOPIC).items() if name == "first")
    watch.look()
    words = "another first, robot_2/first ignored: first writes it already"
    assert reports[Mode.TOPIC] == words


def test_other_topics_have_one_writer_too(node, others):
    guard = OneWriter("/count")
    subscription = RawSubscription(node, Int32, "/count", EVERY, guard=guard)
    first, second = (other.create_publisher(Int32, "/count", 10) for other in others)
    until(lambda: all(each.get_subscription_count() for each in (first, second)))
    for number, publisher in enumerate((first, second, first)):
        publisher.publish(Int32(data=number))
        time.sleep(0.1)
    heard = []
    while (message := subscription.take_message()) is not None:
        heard.append(message.data)
    assert heard == [0, 2]


def test_it_counts_once_the_first_is_gone(node, others):
    lane = Lane(node, others)
    lane.send(lane.first, 100)
    assert lane.heard() == [100]
    others[0].destroy_node()
    until(lambda: len(writers(node, Mode.TOPIC)) == 1)
    lane.watch.look()
    lane.send(lane.second, 3)  # a stream of its own
    assert lane.heard() == [3]
    lane.watch.look()
    assert lane.reports[Mode.TOPIC] == ""


def test_a_writer_that_seemed_gone_returns_to_its_place(monkeypatch):
    """The machine had stood still for longer than the lease; a stranger's modes threw it down."""
    now = [10.0]
    monkeypatch.setattr(one_writer.time, "monotonic", lambda: now[0])
    guard, (first, stranger, another) = OneWriter(Mode), (bytes([k] * 16) for k in range(3))
    mode = memoryview(Mode().to_bytes())
    assert guard.admits(first, mode) and not guard.admits(stranger, mode)
    guard.release()
    assert not guard.admits(stranger, mode)
    assert guard.admits(first, mode) and not guard.admits(stranger, mode)
    guard.release()
    assert guard.admits(another, mode)  # a node that starts anew
    guard.release()
    now[0] += RETURN_TIME
    assert guard.admits(stranger, mode)
    now[0] += 1.0
    assert not guard.admits(another, mode)  # started in place of a silent one, which is known yet
    guard.release()
    assert guard.admits(another, mode)


def test_a_writer_of_noise_loses_its_place_to_the_node(node, others):
    """It spoke before the nodes were there, and they listened to it until it was gone."""
    lane = Lane(node, others)
    lane.send(lane.second, 2**40)
    assert lane.heard() == [2**40]
    lane.send(lane.second, 5)
    assert lane.heard() == []
    for seq in (7, 8):
        lane.send(lane.first, seq)
    lane.send(lane.second, 9)
    lane.send(lane.first, 9)
    assert lane.heard() == [7, 8, 9]
    lane.watch.look()
    assert lane.reports[Mode.TOPIC] == "second ignored: first writes it already"


@pytest.mark.parametrize("size", [28, Mode.SIZE - 1])
def test_a_message_of_another_size_wins_no_place(node, others, size):
    lane = Lane(node, others)
    lane.second.publish_raw(Mode().to_bytes()[:28] + bytes(size - 28))
    time.sleep(0.2)
    with pytest.raises(LayoutError, match=f"received {size}"):
        lane.subscription.take_next(Mode())
    lane.send(lane.first, 1)
    lane.send(lane.second, 2)
    assert lane.heard() == [1]


def test_a_reader_that_refuses_gives_the_place_away_but_not_at_a_reset():
    guard = OneWriter(Mode, in_order=False)
    stranger, node = bytes(16), bytes([1] * 16)
    mode = memoryview(Mode().to_bytes())
    assert guard.admits(stranger, mode)
    for _ in range(MOST_UNUSED - 1):
        guard.used(False)
        assert not guard.admits(node, mode)
    guard.used(False)
    assert guard.admits(node, mode)
    for used in (False, False, True) * MOST_UNUSED:
        guard.used(used)
    assert not guard.admits(stranger, mode)
    guard.doubt()
    assert guard.admits(node, mode)  # it went on before another spoke
    assert not guard.admits(stranger, mode)


@pytest.mark.parametrize("size", [0, 4, 12, 27])
def test_a_message_without_a_header_is_dropped(node, others, size):
    lane = Lane(node, others)
    lane.second.publish_raw(bytes(size))
    time.sleep(0.2)
    assert not lane.subscription.take_last(5)
    lane.second.publish_raw(bytes(size))
    lane.send(lane.first, 1)
    assert lane.heard() == [1]


def test_a_refused_message_is_told_until_the_writer_goes_on(node, others):
    lane = Lane(node, others)
    for seq, told in ((1, ""), (2, ""), (1 << 62, "refused"), (3, ""), (4, "")):
        lane.send(lane.first, seq)
        assert lane.heard() == ([] if told else [seq])
        assert bool(lane.guard.refused) == bool(told)


def test_a_number_from_the_future_of_the_writer_itself_is_refused_and_reported(node, others):
    lane = Lane(node, others)
    for seq in (1, 2**62, 2):
        lane.send(lane.first, seq)
    lane.send(lane.first, 2**62)
    assert lane.heard() == [1, 2]
    others[1].destroy_node()
    until(lambda: len(writers(node, Mode.TOPIC)) == 1)
    lane.watch.look()
    assert lane.reports[Mode.TOPIC].startswith("message refused: seq = 4611686018427387904")


def test_another_writer_of_ones_own_topic_is_named(node, others):
    mine = LanePublisher(node, Mode)
    reports = {}
    watch = WriterWatch(node, [], [mine.publisher], reports.__setitem__)
    assert identity(mine.publisher) in writers(node, Mode.TOPIC)
    watch.look()
    assert reports == {"writing /cassie/mode": ""}
    LanePublisher(others[1], Mode)
    until(lambda: "second" in writers(node, Mode.TOPIC).values())
    watch.look()
    assert reports == {"writing /cassie/mode": "second writes /cassie/mode, too: only one node may"}


def test_of_many_writers_a_flood_of_one_leaves_the_others_theirs(node, others):
    subscription = LaneSubscription(node, OperatorCommand, qos=EVERY)
    quiet, loud = (LanePublisher(other, OperatorCommand) for other in others)
    until(lambda: quiet.matched and loud.matched)
    command = OperatorCommand()
    quiet.publish(command)
    for seq in range(300):
        command.seq[...] = seq
        loud.publish(command)
    time.sleep(0.5)
    taken = take_from_each(subscription, most=5)
    by = {writer: [raw for who, raw in taken if who == writer] for writer, _ in taken}
    assert sorted(map(len, by.values())) == [1, 5]
    command.load(taken[-1][1])
    assert command.seq == 299  # the newest is there
