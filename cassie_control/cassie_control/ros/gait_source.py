"""Gaits that gait_optimizer makes while the robot walks: requests, waits and time-outs."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node

from cassie_control.ros.common import Conditions
from cassie_control.schedule import gait_refusal
from cassie_msgs.layout import Gait, GaitRequest, GaitResult
from cassie_msgs.ros.fast_lane import EVERY, LanePublisher, LaneSubscription, LaneWaiter
from cassie_msgs.ros.one_writer import OneWriter
from cassie_msgs.ros.process import Stop

LONGEST_WAIT = 4.0
"""Time-out for an answer in lock-step, in wall time; the simulator's time-out is 5 s. In s."""

_HEARTBEAT_PERIOD = 0.3  # s of wall time between heartbeats in a wait, below `ANSWER_AFTER`

_RESULTS = {
    GaitResult.REFUSED: "no such gait can be asked for",
    GaitResult.NOT_FOUND: "the optimizer found none",
    GaitResult.NOT_CERTIFIED: "it was not certified",
}


class GaitSource:
    """Requests gaits and passes each on at the tick that it names.

    In lock-step that tick waits for its answer, so that a run does not depend on the machine. On
    the wall clock an answer that comes later is not used. The controller stops waiting for an
    optimizer that is missing, or does not answer within `LONGEST_WAIT`, until its next message.

    Attributes:
        optimizer: Guard that accepts the gaits of one optimizer.

    Args:
        node: The controller.
        stop: Request to end.
        conditions: Gets reports of problems.
        heartbeat: Called during a wait, so that the controller does not count as lost.
    """

    def __init__(
        self, node: Node, stop: Stop, conditions: Conditions, heartbeat: Callable[[], None]
    ) -> None:
        self._stop, self._conditions, self._heartbeat = stop, conditions, heartbeat
        self.optimizer = OneWriter(Gait, in_order=False)
        self._gaits = LaneSubscription(node, Gait, qos=EVERY, guard=self.optimizer)
        self._requests = LanePublisher(node, GaitRequest)
        self._waiter = LaneWaiter(node, [self._gaits])
        stop.on_request(self._waiter.wake)
        self._received, self._next = Gait(), Gait()
        self._episode = self._asked = -1
        self._answered = -1
        self._lost = False
        self._wall_paced = False

    @property
    def publisher(self) -> object:
        """The rclpy publisher of the requests."""
        return self._requests.publisher

    def reset(self, episode: int) -> None:
        """Begin a new episode."""
        self._episode, self._asked, self._answered = episode, -1, -1
        self._lost = False

    def ask(self, request: GaitRequest) -> None:
        """Send a request."""
        self._asked = int(request.effective_seq)
        self._requests.publish(request)

    def is_ready(self, tick: int) -> bool:
        """Whether `at` answers without waiting."""
        if tick != self._asked or self._wall_paced or self._lost:
            return True
        self._take(tick)
        return self._answered == tick

    def at(self, tick: int, *, wall_paced: bool) -> Gait | None:
        """The gait that begins at a tick; None at most ticks. The object is reused."""
        self._wall_paced = wall_paced
        if tick != self._asked:
            if tick > self._asked >= 0:
                self._take(tick)  # an answer that comes now is late, and is reported
            return None
        self._take(tick)
        if self._answered != tick and not wall_paced and not self._lost:
            self._wait(tick)
        self._asked = -1 if self._answered == tick else self._asked
        if self._answered != tick:
            problem = "no answer: is gait_optimizer running?" if self._lost else "late"
            self._conditions.set("gait_optimizer", problem)
            return None
        self._conditions.set("gait_optimizer", "")
        result = int(self._next.result)
        self._conditions.set("gait", _RESULTS.get(GaitResult(result), ""))
        return self._next

    def _wait(self, tick: int) -> None:
        deadline = time.monotonic() + LONGEST_WAIT
        while self._gaits.matched and time.monotonic() < deadline and not self._stop.requested:
            self._waiter.wait(_HEARTBEAT_PERIOD)
            self._take(tick)
            if self._answered == tick:
                return
            self._heartbeat()
        self._lost = True

    def _take(self, tick: int) -> None:
        gait = self._received
        while (raw := self._gaits.take_raw()) is not None:
            try:
                gait.load(raw)
            except ValueError as error:
                self._conditions.set("gait message", str(error))
                continue
            same = int(gait.episode) == self._episode
            self.optimizer.used(same)
            if not same:
                continue
            self._lost = False
            refused = gait_refusal(gait, tick)
            self._conditions.set("gait message", refused)
            if refused:
                self.optimizer.doubt()
            if not refused and int(gait.effective_seq) == self._asked:
                self._next.copy_from(gait)
                self._answered = self._asked
