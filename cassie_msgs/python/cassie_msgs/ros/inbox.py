"""A subscription's messages without rclpy: announced on a file descriptor, taken as plain bytes.

rclpy takes a message in 15 us. A wait for one costs it 20 to 50 us, mostly because it tells the
middleware each time which subscriptions it waits for. Below rclpy, ROS itself calls a C function
when a message has come. The function here, in `src/inbox.c`, writes to a file descriptor. So the
receiving thread needs no Python to wake the waiting thread, and a wait is one system call.
Where even that takes too long, the receiving thread answers itself: see `Inbox.served`.

Source:
    rcl/subscription.h: `rcl_subscription_set_on_new_message_callback`,
    `rcl_take_serialized_message`.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import threading
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from cassie_msgs.sample import Sample

_LOADED, _LOOK = 1, 2  # answers of `inbox_take`
_UNKNOWN = 2**64 - 1
_CAPACITY = 2048  # bytes; grows when a message is longer


class _Taken(ctypes.Structure):
    """The message taken last: the beginning of `inbox_t`."""

    _fields_ = (
        ("bytes", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("number", ctypes.c_uint64),
        ("sent", ctypes.c_int64),
        ("received", ctypes.c_int64),
        ("writer", ctypes.c_uint8 * 16),
    )


_LIBRARY = str(Path(__file__).with_name("libcassie_inbox.so"))
# These calls return at once; releasing the interpreter lock for them would cost more than they do.
_library = ctypes.PyDLL(_LIBRARY)
_Callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_size_t)
_library.inbox_open.argtypes = (ctypes.c_size_t, ctypes.c_int)
_library.inbox_open.restype = ctypes.c_void_p
_library.inbox_close.argtypes = (ctypes.c_void_p,)
_library.inbox_error.restype = ctypes.c_char_p
_take, _load = _library.inbox_take, _library.inbox_load
# These calls may wait for the receiving thread, which may wait for the interpreter lock.
_patient = ctypes.CDLL(_LIBRARY)
_take_patiently, _load_patiently = _patient.inbox_take, _patient.inbox_load
_ring, _announce_to = _patient.inbox_ring, _patient.inbox_call
_ADDRESS, _SIZE = ctypes.c_void_p, ctypes.c_size_t
for _two in (_take, _take_patiently, _ring, _announce_to):
    _two.argtypes = (_ADDRESS, _ADDRESS)
_load.argtypes = _load_patiently.argtypes = (*(_ADDRESS,) * 4, _SIZE)
_ring.restype = _announce_to.restype = ctypes.c_bool


class Inbox:
    """The messages that have come for one subscription.

    Args:
        handle: Handle of an rclpy subscription that no executor serves.

    Attributes:
        descriptor: File descriptor that becomes readable when a message comes. Call `clear`, which
            makes it unreadable again, and then take all messages.
    """

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self._pointer = handle.pointer
        self.descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._inbox = _library.inbox_open(_CAPACITY, self.descriptor)
        if not self._inbox:
            raise MemoryError
        self._taken = _Taken.from_address(self._inbox)
        self._writer = memoryview(self._taken.writer).cast("B")
        self._capacity = 0
        self._receiver = 0  # thread that answers; 0: none, -1: not known yet
        self._callback: Any = None
        self._error: BaseException | None = None
        self._view = memoryview(b"")
        weakref.finalize(self, _close, handle, self.descriptor, self._inbox)
        _check(_ring(self._inbox, self._pointer))

    @contextlib.contextmanager
    def served(self, answer: Callable[[], bool]) -> Iterator[None]:
        """Have messages answered by the receiving thread, without waking another thread.

        Args:
            answer: Called in the receiving thread when a message has come. If it returns False,
                or raises, the descriptor becomes readable as usual. It must not wait for another
                message: no other thread would receive it.
        """
        here = threading.get_ident()

        def call(_: int | None, count: int) -> None:
            # This thread announces earlier messages; it holds the lock the other thread waits for.
            if threading.get_ident() != here:
                if self._receiver == -1:
                    ctypes.pythonapi.PyGILState_Ensure()  # Python keeps its state for this thread
                    self._receiver = threading.get_ident()
                try:
                    if answer():
                        return
                except BaseException as error:
                    self._error = error
            os.eventfd_write(self.descriptor, count)

        self._callback = _Callback(call)
        with self._handle:
            self._receiver = -1
            _check(_announce_to(self._pointer, self._callback))
            try:
                yield
            finally:
                _ring(self._inbox, self._pointer)
                self._receiver = 0

    def clear(self) -> None:
        """Make the descriptor unreadable until the next message comes.

        Raises:
            BaseException: what `answer` raised in the receiving thread.
        """
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self.descriptor)
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def take(self) -> memoryview | None:
        """The oldest message not yet taken, valid until the next call; None if there is none.

        Raises:
            InvalidHandle: if the subscription is destroyed.
            RCLError: if the middleware fails.
        """
        with self._handle:
            take = _take_patiently if self._receiver and not self.receiving else _take
            code = take(self._inbox, self._pointer)
        _check(code <= _LOOK)
        return self._message() if code == _LOOK else None

    def load(self, sample: Sample, accepted: int | None = None) -> memoryview | bool:
        """Take the oldest message and load it into a sample, if it needs no closer look.

        Args:
            sample: Result.
            accepted: Address of the `Accepted` of a guard; None if every message is accepted.

        Returns:
            True if the sample is loaded, False if there was no message. Otherwise the message is
            not an expected one: its bytes, valid until the next call.

        Raises:
            InvalidHandle, RCLError: as `take`.
        """
        inbox, pointer, address, size = self._inbox, self._pointer, sample.address, sample.SIZE
        if self._receiver == threading.get_ident():  # this thread holds the handle
            code = _load(inbox, pointer, accepted, address, size)
        else:
            load = _load_patiently if self._receiver else _load
            with self._handle:
                code = load(inbox, pointer, accepted, address, size)
        _check(code <= _LOOK)
        return self._message() if code == _LOOK else code == _LOADED

    def _message(self) -> memoryview:
        taken = self._taken
        if taken.capacity != self._capacity:
            self._capacity = taken.capacity
            buffer = (ctypes.c_uint8 * self._capacity).from_address(taken.bytes)
            self._view = memoryview(buffer).cast("B")
        return self._view[: taken.length]

    @property
    def receiving(self) -> bool:
        """Whether this thread receives; then no message can have come since the one it answers."""
        return self._receiver == threading.get_ident()

    @property
    def writer(self) -> bytes:
        """DDS identity of the writer of the message taken last."""
        return self._writer.tobytes()

    @property
    def number(self) -> int | None:
        """Sequence number, by its writer, of the message taken last; None if DDS has none."""
        number = int(self._taken.number)
        return None if number == _UNKNOWN else number

    @property
    def times(self) -> tuple[int, int]:
        """When the message taken last was sent, by its writer's clock, and received. In ns."""
        return int(self._taken.sent), int(self._taken.received)


def _close(handle: Any, descriptor: int, inbox: int) -> None:
    # A subscription that is destroyed already makes no more calls.
    with contextlib.suppress(_rclpy.InvalidHandle), handle:
        _announce_to(handle.pointer, None)
    os.close(descriptor)
    _library.inbox_close(inbox)


def _check(done: bool) -> None:
    if not done:
        reason = _library.inbox_error().decode(errors="replace")
        raise _rclpy.RCLError(reason or "the middleware failed")
