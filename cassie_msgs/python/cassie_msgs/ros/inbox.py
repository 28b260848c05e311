"""A subscription's messages without rclpy: announced on a file descriptor, taken as plain bytes.

rclpy takes a message in 15 us. A wait for one costs it 20 to 50 us, mostly because it tells the
middleware each time which subscriptions it waits for. Below rclpy, ROS itself calls a C function
when a message has come. Here that function is the C library's `eventfd_write`. So the receiving
thread needs no Python to wake the waiting thread, and a wait is one system call.
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
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

_OK = 0
_NOTHING_TO_TAKE = 401
_UNKNOWN = 2**64 - 1
_CAPACITY = 2048  # bytes; grows when a message is longer


class _Allocator(ctypes.Structure):
    """`rcutils_allocator_t`: four functions and a state."""

    _fields_ = tuple(
        (name, ctypes.c_void_p) for name in ("new", "free", "resize", "zeroed", "state")
    )


class _Bytes(ctypes.Structure):
    """`rcutils_uint8_array_t`, a serialized message."""

    _fields_ = (
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    )


class _Info(ctypes.Structure):
    """`rmw_message_info_t`, the metadata of a message."""

    _fields_ = (
        ("sent", ctypes.c_int64),
        ("received", ctypes.c_int64),
        ("number_sent", ctypes.c_uint64),
        ("number_received", ctypes.c_uint64),
        ("implementation", ctypes.c_char_p),
        ("writer", ctypes.c_uint8 * 16),
        ("from_own_process", ctypes.c_bool),
    )


class _Text(ctypes.Structure):
    """`rcutils_error_string_t`."""

    _fields_ = (("text", ctypes.c_char * 1024),)


# These calls return at once; releasing the interpreter lock for them would cost more than they do.
_rcutils = ctypes.PyDLL("librcutils.so")
_take = ctypes.PyDLL("librcl.so").rcl_take_serialized_message
_take.argtypes = (ctypes.c_void_p,) * 4
# These calls may wait for the receiving thread, which may wait for the interpreter lock.
_rcl = ctypes.CDLL("librcl.so")
_take_patiently = _rcl.rcl_take_serialized_message
_take_patiently.argtypes = (ctypes.c_void_p,) * 4
_call_on_message = _rcl.rcl_subscription_set_on_new_message_callback
_call_on_message.argtypes = (ctypes.c_void_p,) * 3
_Callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_size_t)
_rcutils.rcutils_get_default_allocator.restype = _Allocator
_rcutils.rcutils_get_error_string.restype = _Text
# ROS calls it with the registered pointer and the number of messages. For `eventfd_write` these are
# the descriptor and the number to add.
_RING = ctypes.cast(ctypes.CDLL(None).eventfd_write, ctypes.c_void_p)


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
        self._bytes = _Bytes()
        self._bytes_pointer = ctypes.addressof(self._bytes)
        self._info = _Info()
        self._info_pointer = ctypes.addressof(self._info)
        self._writer = memoryview(self._info.writer).cast("B")
        allocator = _rcutils.rcutils_get_default_allocator()
        _check(
            _rcutils.rcutils_uint8_array_init(
                ctypes.byref(self._bytes), ctypes.c_size_t(_CAPACITY), ctypes.byref(allocator)
            )
        )
        self._capacity = 0
        self._receiver = 0  # thread that answers; 0: none, -1: not known yet
        self._callback: Any = None
        self._error: BaseException | None = None
        self._view = memoryview(b"")
        weakref.finalize(self, _close, handle, self.descriptor, self._bytes)
        _check(_call_on_message(self._pointer, _RING, self.descriptor))

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
            if threading.get_ident() == here or not self._answered(answer):
                os.eventfd_write(self.descriptor, count)

        self._callback = _Callback(call)
        self._receiver = -1
        with self._handle:
            _check(_call_on_message(self._pointer, self._callback, None))
        try:
            yield
        finally:
            with contextlib.suppress(_rclpy.InvalidHandle), self._handle:
                _call_on_message(self._pointer, _RING, self.descriptor)
            self._receiver = 0

    def _answered(self, answer: Callable[[], bool]) -> bool:
        if self._receiver == -1:
            ctypes.pythonapi.PyGILState_Ensure()  # Python keeps its state for this thread
            self._receiver = threading.get_ident()
        try:
            return answer()
        except BaseException as error:
            self._error = error
            return False

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
        take = _take
        if self._receiver and self._receiver != threading.get_ident():
            take = _take_patiently
        with self._handle:
            code = take(self._pointer, self._bytes_pointer, self._info_pointer, None)
        if code == _NOTHING_TO_TAKE:
            return None
        _check(code)
        if self._bytes.capacity != self._capacity:
            self._look_at_buffer()
        return self._view[: self._bytes.length]

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
        number = int(self._info.number_sent)
        return None if number == _UNKNOWN else number

    def _look_at_buffer(self) -> None:
        self._capacity = self._bytes.capacity
        buffer = (ctypes.c_uint8 * self._capacity).from_address(self._bytes.buffer)
        self._view = memoryview(buffer).cast("B")


def _close(handle: Any, descriptor: int, content: _Bytes) -> None:
    # A subscription that is destroyed already makes no more calls.
    with contextlib.suppress(_rclpy.InvalidHandle), handle:
        _call_on_message(handle.pointer, None, None)
    os.close(descriptor)
    _rcutils.rcutils_uint8_array_fini(ctypes.byref(content))


def _check(code: int) -> None:
    if code != _OK:
        reason = _rcutils.rcutils_get_error_string().text.decode(errors="replace")
        _rcutils.rcutils_reset_error()
        raise _rclpy.RCLError(f"{reason or 'the middleware failed'} (code {code})")
