"""A node as a process: start, stop and errors work in the same way for all nodes."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from cassie_msgs.processes import end_within
from cassie_msgs.ros.about import About, help_text
from cassie_msgs.ros.parameters import refuse_unknown
from cassie_msgs.ros.scheduling import step_back
from cassie_msgs.ros.transport import use_loopback

LEAVE_TIMEOUT = 2
"""Time-out for a node to shut DDS down, in wall time. In s.

Fast DDS 2.14 can deadlock, in a busy wait: it waits for a callback that waits for it, if another
node leaves at the same time. Everything that other nodes must know is sent before.
"""

_SWITCH_INTERVAL = 5e-4  # s; longest time for which the executor's thread holds the interpreter
_ARGUMENT_ERRORS = (_rclpy.UnknownROSArgsError, _rclpy.RCLInvalidROSArgsError)
_SHUTDOWN_ERRORS = (_rclpy.RCLError, _rclpy.InvalidHandle, ExternalShutdownException)


class Stop:
    """Request to end the process, and the function to call then."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self._wakers: list[Callable[[], None]] = []
        self.exit_code = 0

    @property
    def requested(self) -> bool:
        """True once the process shall end."""
        return self._event.is_set()

    def request(self, exit_code: int = 0) -> None:
        """Ask the process to end, from any thread; the first exit code above 0 is kept."""
        self.exit_code = self.exit_code or exit_code
        self._event.set()
        for wake in self._wakers:
            with contextlib.suppress(*_SHUTDOWN_ERRORS):
                wake()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Whether the process shall end; sleeps until then, at most `timeout_s`."""
        return self._event.wait(timeout_s)

    def on_request(self, wake: Callable[[], None]) -> None:
        """Call `wake` when the process shall end, e.g. `LaneWaiter.wake`."""
        self._wakers.append(wake)
        if self.requested:
            wake()


def run(name: str, build: Callable[[Stop], Any], about: About | None = None) -> None:
    """Run one node until Ctrl-C, SIGTERM or the end of its loop; does not return.

    With `about`, `--help` prints the node's description and ends the process, and arguments that
    are not for ROS are refused. Without `about`, the caller handles the arguments.

    `build(stop)` makes the node, an rclpy `Node`, or several as an object with `nodes`. Their
    parameters, services and timers are served by an executor in another thread. A method `loop()`
    of the result runs on the main thread and should return soon after `stop.requested`. Its method
    `close()` is called at the end, when nothing else is published any more. A node that may run
    once in a domain has a `claim.Claim` as `claim`.

    Exit status: 0 at the end or when stopped; 2 with one line on stderr if `build` raises
    ValueError or OSError, such as for a wrong parameter; 1 after an exception in any thread.
    """
    if about is not None:
        _read_arguments(name, about)
    stop = Stop()
    follow_signals(stop)
    _end_on_errors(stop)
    try:
        status = _run(name, build, stop)
    except Exception:
        sys.excepthook(*sys.exc_info())
        status = 1
        end_within(LEAVE_TIMEOUT, status)
    finally:
        with contextlib.suppress(*_SHUTDOWN_ERRORS):
            rclpy.try_shutdown()
    sys.stdout.flush()
    sys.exit(status)


def own_arguments(name: str) -> list[str]:
    """Arguments of the program without those of ROS.

    Malformed ones of ROS end the process with one line and status 2.
    """
    try:
        return list(remove_ros_args(sys.argv)[1:])
    except _ARGUMENT_ERRORS as error:
        print(f"{name}: error: {_argument_error(error)}", file=sys.stderr)
        sys.exit(2)


def _argument_error(error: Exception) -> str:
    """What is wrong with the arguments of ROS, without its place in the sources of ROS."""
    parts = (part.partition(", at ")[0] for part in str(error).split(". Error:", 1))
    text, *reason = (" ".join(part.split()).rstrip(".") for part in parts)
    if "params file" in text:
        return ": ".join([text, *reason])
    if isinstance(error, _rclpy.UnknownROSArgsError):
        text = f"unknown argument {text.strip('[]')}"
    braces = "; braces need quotes within quotes: NAME:=\"'{...}'\"" if ":={" in text else ""
    return f"{text}: ROS takes --ros-args -p NAME:=VALUE, or -r FROM:=TO{braces}"


def _read_arguments(name: str, about: About) -> None:
    """Answer `--help`, and refuse arguments that the node would not read."""
    words = own_arguments(name)
    if {"-h", "--help"} & set(sys.argv[1:]):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # a pager may close before the end
        print(help_text(name, about))
        sys.exit(0)
    if words:
        print(f"{name}: error: unknown argument {words[0]!r}: see --help", file=sys.stderr)
        sys.exit(2)


def _run(name: str, build: Callable[[Stop], Any], stop: Stop) -> int:
    try:
        use_loopback()
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        node = build(stop)
        nodes = tuple(getattr(node, "nodes", (node,)))
        refuse_unknown(*nodes)
        for each in nodes:
            if claim := getattr(each, "claim", None):
                claim.take()
    except _ARGUMENT_ERRORS as error:
        print(f"{name}: error: {_argument_error(error)}", file=sys.stderr)
        end_within(LEAVE_TIMEOUT, 2)
        return 2
    except (ValueError, OSError, ParameterException, _rclpy.RCLError) as error:
        print(f"{name}: error: {' '.join(str(error).split())}", file=sys.stderr)
        end_within(LEAVE_TIMEOUT, 2)
        return 2
    try:
        with executor_thread(stop, *nodes):
            gc.collect()
            gc.freeze()  # objects that exist by now live as long as the process
            sys.setswitchinterval(_SWITCH_INTERVAL)
            getattr(node, "loop", stop.wait)()
    except _SHUTDOWN_ERRORS:
        if not stop.requested:
            raise
    finally:
        # Only now, when no timer and no subscription can publish any more.
        if hasattr(node, "close"):
            node.close()
    sys.stdout.flush()
    end_within(LEAVE_TIMEOUT, stop.exit_code)
    step_back()
    with contextlib.suppress(*_SHUTDOWN_ERRORS):
        for each in nodes:
            each.destroy_node()
    return stop.exit_code


@contextlib.contextmanager
def executor_thread(stop: Stop, *nodes: Node) -> Iterator[None]:
    """Serve the nodes' parameters, services and timers in their own thread.

    The thread sleeps until there is something to serve: to wake up costs half a millisecond of the
    interpreter's time.
    """
    executor = SingleThreadedExecutor()
    ended: Future[None] = Future()
    for node in nodes:
        executor.add_node(node)

    def serve() -> None:
        with contextlib.suppress(*_SHUTDOWN_ERRORS):
            executor.spin_until_future_complete(ended)

    thread = threading.Thread(target=serve, name="executor", daemon=True)
    stop.on_request(lambda: ended.set_result(None))
    thread.start()
    try:
        yield
    finally:
        stop.request()
        thread.join(timeout=1.0)
        executor.shutdown(timeout_sec=0.2)


def _end_on_errors(stop: Stop) -> None:
    """End the process after an exception in any thread, with its traceback and status 1."""

    def end(error: threading.ExceptHookArgs) -> None:
        sys.__excepthook__(error.exc_type, error.exc_value or error.exc_type(), error.exc_traceback)
        stop.request(exit_code=1)

    threading.excepthook = end


def follow_signals(stop: Stop, *more: signal.Signals) -> None:
    """Have SIGINT and SIGTERM request the stop at once, also while the main thread waits in C.

    Python runs its signal handlers between bytecodes only, and a wait set does not return
    for a signal. The C handler itself writes the wake-up descriptor, which a thread here reads. A
    Python handler that sets the stop's event could deadlock: if the main thread is about to wait
    for the event, both take the event's lock.

    Args:
        stop: The stop that is requested.
        *more: Further signals that request the stop.
    """
    ends = {signal.SIGINT, signal.SIGTERM, *more}
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    for number in ends:
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)

    def listen() -> None:
        while not ends.intersection(os.read(reader, 16)):
            pass
        stop.request()

    threading.Thread(target=listen, name="signals", daemon=True).start()
