"""Code that the nodes of this package share."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from rclpy.node import Node

from cassie_control.ros.node_events import NodeEvents
from cassie_msgs.bounds import CONFIRMED
from cassie_msgs.layout import Sample
from cassie_msgs.ros.diagnostics import ERROR, OK, Diagnostics
from cassie_msgs.ros.parameters import on_change
from cassie_msgs.ros.process import Stop
from cassie_msgs.schedule import CONTROL_RATE
from cassie_msgs.tunables import tunable

ConfigT = TypeVar("ConfigT")

LOOK_PERIOD = 0.1
"""Wall time between checks for silent nodes. In s."""


@dataclass(frozen=True, kw_only=True)
class LaneConfig:
    """Parameters of every node of this package."""

    control_rate: int = tunable(
        CONTROL_RATE,
        "Hz",
        50,
        4000,
        "Rate of sensor samples, the same as the simulator's",
        live=False,
    )

    @property
    def period(self) -> float:
        """Time between samples. In s."""
        return 1.0 / self.control_rate


class LiveConfig(Generic[ConfigT]):
    """Parameters of a node's core that may change while the node runs, between two answers.

    Args:
        node: Node that declared the parameters.
        config: Parameters with which the core was made.
        apply: Gives changed parameters to the core.
        events: Publishes each change.
    """

    def __init__(
        self, node: Node, config: ConfigT, apply: Callable[[ConfigT], None], events: NodeEvents
    ) -> None:
        self._apply, self._events = apply, events
        self._applied = self._newest = config
        on_change(node, lambda: self._newest, self._set)

    def update(self, sample: Sample) -> None:
        """Apply a change before the answer to a sample."""
        config = self._newest
        if config is not self._applied:
            self._applied = config
            self._apply(config)
            self._events.changed(sample, config)

    def _set(self, config: ConfigT) -> None:
        self._newest = config


class Conditions:
    """Reports on /diagnostics and in the log: problems, and their end."""

    def __init__(self, node: Node) -> None:
        self._diagnostics = Diagnostics(node)
        self._wrong: set[str] = set()
        self._diagnostics.set("node", OK, "running")

    def set(self, subject: str, problem: str, **values: Any) -> bool:
        """Set the problem of `subject`; empty for none. Cheap while that does not change.

        While there is a problem, further problems of the same subject are not reported.

        Returns:
            Whether a problem has just begun or ended.
        """
        if bool(problem) == (subject in self._wrong):
            return False
        if problem:
            self._wrong.add(subject)
            self._diagnostics.set(subject, ERROR, problem, **values)
        else:
            self._wrong.discard(subject)
            self._diagnostics.set(subject, OK, "ok", **values)
        return True

    def follow(self, subject: str, problem: str) -> None:
        """Set the problem of `subject`, and report each change of its text."""
        if not self.set(subject, problem) and problem:
            self._diagnostics.set(subject, ERROR, problem)


_RATE_SHOWS = 55
"""Ticks after which times at a rate 1 % off differ by more than half a period, several times."""

_SAME_PERIOD = 1000.0  # ns by which periods between samples of one rate differ at most


class RateCheck:
    """Ends a node whose samples do not come at the rate for which its core was made.

    A single sample with another time is no proof, as any node may send one: `CONFIRMED` samples
    must come at one other rate.

    Args:
        node: Node that the samples reach.
        stop: Request to end.
        control_rate: Rate for which the core was made. In Hz.
    """

    def __init__(self, node: Node, stop: Stop, control_rate: int) -> None:
        self._logger = node.get_logger()
        self._stop = stop
        self._rate = control_rate
        self._checked = -1
        self._begin(-1)

    def _begin(self, episode: int) -> None:
        self._episode, self._last = episode, (-1, 0)
        self._period, self._proofs = math.nan, 0

    def check(self, episode: int, seq: int, sample: Sample) -> None:
        """Check samples until a rate 1 % off would show; cheap for later samples.

        Args:
            episode: Episode of the sample.
            seq: Control tick of the sample.
            sample: The sample, with its time stamp.
        """
        if episode == self._checked:
            return
        if episode != self._episode:
            self._begin(episode)
        (last_seq, last_stamp), stamp = self._last, sample.stamp_ns
        if seq <= last_seq:
            return
        before, self._last = self._period, (seq, stamp)
        self._period = (stamp - last_stamp) / (seq - last_seq) if last_seq >= 0 else math.nan
        if abs(stamp - seq * 1_000_000_000 // self._rate) <= 500_000_000 // self._rate:
            self._proofs = 0
            if seq >= _RATE_SHOWS:
                self._checked = episode
            return
        steady = not abs(self._period - before) > _SAME_PERIOD  # or too few samples to tell
        self._proofs = self._proofs + 1 if steady else 0
        if self._proofs >= CONFIRMED:
            come = f"come at {1e9 / self._period:.6g} Hz" if self._period > 0.0 else "carry no time"
            self._logger.fatal(f"control_rate = {self._rate} Hz, but samples {come}")
            self._stop.request(exit_code=2)


class Turns:
    """Lets one thread at a time answer a node's messages: the receiving or the main thread.

    Args:
        answer: Takes and answers received messages, if any. Its argument is whether it may wait for
            other messages. It returns whether a message is left to be answered.
    """

    def __init__(self, answer: Callable[[bool], bool]) -> None:
        self._answer = answer
        self._lock = threading.Lock()

    def at_once(self) -> bool:
        """Answer in the receiving thread, for `LaneSubscription.served`.

        Returns:
            False if the main thread must go on.
        """
        # This thread must not wait for the main thread, which may be taking messages.
        if not self._lock.acquire(blocking=False):
            return False
        try:
            return not self._answer(False)
        finally:
            self._lock.release()

    def in_turn(self) -> None:
        """Answer in the main thread."""
        with self._lock:
            self._answer(True)
