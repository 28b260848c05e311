"""One writer per topic of the control lane.

DDS delivers the messages of every node in the domain. A receiver therefore binds to the writer of
the first message that it accepts, by the identity that DDS gives with each message. Messages of
other writers are dropped and reported with the names of their nodes. When the first writer has left
the graph, the receiver binds to the next. A writer whose last message was refused, such as one that
sends noise from before the nodes start, loses its place to the next writer that speaks.

On a machine that stands still for longer than the lease of a DDS participant, every writer seems to
have left, and returns. So for `RETURN_TIME` a writer that was dropped beside a live one does not
get its place. A node that was started in place of a silent one gets the place at once.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

from cassie_msgs.bounds import LEAD, Place, Progress
from cassie_msgs.ros.periodic import Periodic
from cassie_msgs.sample import HEADER_SIZE, PADDING, Sample, place

LOOK_PERIOD = 0.5
"""Wall time between two checks of the graph. In s."""

RETURN_TIME = 3.0
"""Wall time in which a writer that left the graph may return to its place. In s."""

MOST_UNUSED = 10
"""Messages in a row for other episodes from which on a writer is in doubt. Around a reset a writer
that works sends a few."""

Report = Callable[[str, str], Any]
"""Takes a subject and its problem, which is empty when there is none."""

UNKNOWN = "an unknown node"

_GID_SIZE = 16
_MOST_DROPPED = 100  # writers that are remembered
_ALIVE = 0.5  # s after its last message for which a writer counts as live
_NAMELESS = "_NODE_NAME_UNKNOWN_"  # just discovered, or no ROS node
_rcl = ctypes.PyDLL("librcl.so")
_rmw = ctypes.PyDLL(f"lib{get_rmw_implementation_identifier()}.so")
_rcl.rcl_publisher_get_rmw_handle.argtypes = (ctypes.c_void_p,)
_rcl.rcl_publisher_get_rmw_handle.restype = ctypes.c_void_p
_rmw.rmw_get_gid_for_publisher.argtypes = (ctypes.c_void_p, ctypes.c_void_p)


class _Gid(ctypes.Structure):
    """`rmw_gid_t`."""

    _fields_ = (("implementation", ctypes.c_char_p), ("data", ctypes.c_uint8 * _GID_SIZE))


class Accepted(ctypes.Structure):
    """What a `OneWriter` accepts without a closer look: `accepted_t` of src/inbox.c.

    Attributes:
        writer: Identity of the accepted writer.
        usual: Whether there is a writer and its last message was accepted. Only then has it a
            right to its place.
        heard: Time of its last message. In s.
        lead: Most ticks by which a message may be ahead of the last one; 0 if any order is.
        last: Place of that message.
    """

    _fields_ = (
        ("writer", ctypes.c_uint8 * _GID_SIZE),
        ("usual", ctypes.c_bool),
        ("heard", ctypes.c_double),
        ("lead", ctypes.c_uint64),
        ("last", Place),
    )


class OneWriter:
    """Admits the messages of one writer.

    Args:
        source: Type of the messages, or the topic of messages without episode and seq.
        in_order: Whether episode and seq must stay within the bounds of `Progress`.

    Attributes:
        writer: Identity of the accepted writer; empty before the first.
        refused: Why the newest message of that writer was refused; empty if it was not.
        accepted: Address of the `Accepted` with what needs no closer look.
    """

    def __init__(self, source: type[Sample] | str, *, in_order: bool = True) -> None:
        self.topic, self._size = (
            (source, 0) if isinstance(source, str) else (source.TOPIC, source.SIZE)
        )
        self.writer = b""
        self.refused = ""
        self._unused = 0
        self._dropped: set[bytes] = set()
        self._free_from = 0.0
        in_order = in_order and self._size > 0
        self._known = Accepted(lead=LEAD if in_order else 0)
        self._progress = Progress(self._known.last) if in_order else None
        self.accepted = ctypes.addressof(self._known)

    def admits(self, writer: bytes, raw: memoryview) -> bool:
        """Whether a message is accepted. One of another length is: its reader refuses it, too."""
        known, now = self._known, time.monotonic()
        other = writer != self.writer
        if other:
            if known.usual:
                if now < known.heard + _ALIVE and len(self._dropped) < _MOST_DROPPED:
                    self._dropped.add(writer)
                return False
            if not self.writer and writer in self._dropped and now < self._free_from:
                return False
        if self._size and not 0 <= len(raw) - self._size <= PADDING:
            known.usual = False
            return len(raw) >= HEADER_SIZE
        if self._progress is not None:
            if other:
                self._progress.restart()
            self.refused = self._progress.refusal(*place(raw))
            if self.refused:
                known.usual = False
                return False
        if other:
            self.writer, self._unused = writer, 0
            known.writer[:] = writer
        known.usual, known.heard = True, now
        return True

    def change_topic(self, topic: str) -> None:
        """Listen to another topic of the same type: the next message binds."""
        self.topic = topic
        self.release()
        self._free_from = 0.0

    def doubt(self) -> None:
        """Take in that the reader refused the last message: the next writer gets the place."""
        self._known.usual = False

    def used(self, used: bool) -> None:
        """Take in whether the reader could use the last message, or it was for another episode."""
        self._unused = 0 if used else self._unused + 1
        if self._unused >= MOST_UNUSED:
            self.doubt()

    def release(self) -> None:
        """Forget the writer, which is gone: the next message of another one binds."""
        self.writer = b""
        self._known.usual = False
        self._free_from = time.monotonic() + RETURN_TIME
        if self._progress is not None:
            self._progress.restart()


class WriterWatch:
    """Checks the graph twice a second for writers that are gone and for second writers.

    Args:
        node: Node whose topics are checked.
        guards: Guards of the node's subscriptions.
        publishers: The node's rclpy publishers on the control lane.
        report: Called with the problem of each topic.
    """

    def __init__(
        self, node: Node, guards: Iterable[OneWriter], publishers: Iterable[Any], report: Report
    ) -> None:
        self._node = node
        self._guards = tuple(guards)
        self._own = {publisher.topic_name: identity(publisher) for publisher in publishers}
        self._report = report
        self._nameless: set[bytes] = set()
        Periodic(node, LOOK_PERIOD, self.look)

    def look(self) -> None:
        """Release guards whose writer is gone, and report second writers."""
        nameless: set[bytes] = set()
        for guard in self._guards:
            names = writers(self._node, guard.topic)
            if guard.writer and guard.writer not in names:
                guard.release()
                continue
            self._report(guard.topic, _problem(guard, self._known(names, nameless)))
        for topic, own in self._own.items():
            names = self._known(writers(self._node, topic), nameless)
            others = ", ".join(sorted({name for gid, name in names.items() if gid != own}))
            problem = f"{others} writes {topic}, too: only one node may" if others else ""
            self._report(f"writing {topic}", problem)
        self._nameless = nameless

    def _known(self, names: Mapping[bytes, str], nameless: set[bytes]) -> dict[bytes, str]:
        """`names` without writers that were just discovered and whose node's name is not known."""
        nameless |= {gid for gid, name in names.items() if name == UNKNOWN}
        return {gid: name for gid, name in names.items() if gid not in nameless - self._nameless}


def _problem(guard: OneWriter, names: Mapping[bytes, str]) -> str:
    """Problem with the writers of a topic; empty if there is none."""
    if not guard.writer:
        return ""
    first = names.get(guard.writer, UNKNOWN)
    if others := [
        f"another {name}" if name == first else name
        for gid, name in names.items()
        if gid != guard.writer
    ]:
        return f"{', '.join(sorted(others))} ignored: {first} writes it already"
    return f"message refused: {guard.refused}" if guard.refused else ""


def writers(node: Node, topic: str) -> dict[bytes, str]:
    """Name of the node of each writer of a topic, with its namespace, by the writer's identity."""
    return {
        bytes(info.endpoint_gid[:_GID_SIZE]): _full_name(info.node_namespace, info.node_name)
        for info in node.get_publishers_info_by_topic(topic)
    }


def _full_name(namespace: str, name: str) -> str:
    if name == _NAMELESS:
        return UNKNOWN
    return f"{namespace}/{name}".lstrip("/")


def identity(publisher: Any) -> bytes:
    """Identity that receivers see with the messages of an rclpy publisher."""
    gid = _Gid()
    with publisher.handle:
        handle = _rcl.rcl_publisher_get_rmw_handle(publisher.handle.pointer)
        _rmw.rmw_get_gid_for_publisher(handle, ctypes.addressof(gid))
    return bytes(gid.data)
