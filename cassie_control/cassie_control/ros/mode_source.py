"""Which mode holds for a tick, as the supervisor's answers come in or stay away."""

from __future__ import annotations

import time

from rclpy.node import Node

from cassie_control.ros.common import START_PATIENCE, Conditions
from cassie_control.schedule import ModeTable, StopAndStand, refusal
from cassie_control.supervisor.mode_supervisor import PERIOD_TICKS
from cassie_msgs.layout import Mode, RobotState, header
from cassie_msgs.ros.fast_lane import EVERY, LaneSubscription, LaneWaiter, LocalTopic
from cassie_msgs.ros.one_writer import OneWriter
from cassie_msgs.ros.process import Stop

PATIENCE = 0.4
"""Time without an answer after which the supervisor counts as lost: wall time while the loop
waits for it, robot time otherwise. In s."""


class ModeSource:
    """Waits for the mode made for a tick while the loop waits for us, takes the newest else.

    A state that overtakes the one being answered shows that nobody waits: the plant runs on
    the wall clock. From then on, until the next episode, nothing waits here either.

    Attributes:
        supervisor: Whose modes count.
        lost: Whether the supervisor counts as lost; Cassie then stops and stands.
        overtaking: The newer state that came while waiting, serialized; for the loop to take.
    """

    def __init__(
        self,
        node: Node,
        stop: Stop,
        states: LaneSubscription[RobotState] | LocalTopic[RobotState],
        conditions: Conditions,
        period: float,
    ) -> None:
        self._stop = stop
        self.supervisor = OneWriter(Mode, in_order=False)
        self._modes = LaneSubscription(node, Mode, qos=EVERY, guard=self.supervisor)
        self._states = states
        self._waiter = LaneWaiter(node, [self._modes, states])
        stop.on_request(self._waiter.wake)
        self._conditions = conditions
        self._period = period
        self._table = ModeTable()
        self._fallback = StopAndStand(period)
        self._mode = Mode()
        self.overtaking: bytes | None = None
        self.lost = False
        self._lost_after = -1
        self._waited_for = True
        self._heard = False
        self._episode = -1
        self._tick = 0
        self._current = self._table.newest
        self._span = range(0)  # ticks for which the current mode is known to hold

    def reset(self, episode: int) -> None:
        """A new episode."""
        self._table.reset(episode)
        self._episode = episode
        self._waited_for = True
        self._span = range(0)
        self._set_lost(False)

    def is_there(self, tick: int) -> bool:
        """Whether `at` answers without waiting."""
        if tick in self._span:
            return True
        self._tick = tick
        self._take()
        return self.lost or not self._waited_for or self._table.may_begin(tick)

    def at(self, tick: int) -> Mode:
        """The mode for a tick; may wait for it."""
        if tick in self._span:
            return self._current
        self._tick = tick
        self._take()
        if not self.lost and self._waited_for and not self._table.may_begin(tick):
            self._wait(tick)
        newest = int(self._table.newest.effective_seq)
        if self.lost and newest > self._lost_after:
            self._set_lost(False)
        mode = self._table.at(tick)
        if mode is not None and not self.lost:
            self._current = mode
            self._span = range(tick, tick - tick % PERIOD_TICKS + PERIOD_TICKS)
            return mode
        if not self.lost and (tick - newest) * self._period > PATIENCE:
            self._set_lost(True)
        return self._fallback.step() if self.lost else self._table.newest

    def _wait(self, tick: int) -> None:
        patience = PATIENCE if self._heard else START_PATIENCE
        deadline = time.monotonic() + patience
        while (left := deadline - time.monotonic()) > 0.0:
            self._waiter.wait(left)
            self._take()
            if self._table.may_begin(tick):
                return
            if self._overtaken(tick):
                self._waited_for = False
                return
            if self._stop.requested:
                return
        self._set_lost(True)

    def _overtaken(self, tick: int) -> bool:
        """Whether a newer state is there; it is kept in `overtaking`."""
        while (raw := self._states.take_raw()) is not None:
            _, _, episode, seq = header(raw)
            if (episode, seq) != (self._episode, tick):
                self.overtaking = raw
        return self.overtaking is not None

    def _take(self) -> None:
        while (raw := self._modes.take_raw()) is not None:
            try:
                self._mode.load(raw)
            except ValueError as error:
                self._conditions.set("mode", str(error))
                continue
            if int(self._mode.episode) != self._episode:
                continue
            refused = refusal(self._mode, self._tick)
            self._conditions.set("mode", refused)
            if not refused:
                self._table.add(self._mode)
                self._heard = True

    def _set_lost(self, lost: bool) -> None:
        if lost and not self.lost:
            self._lost_after = int(self._table.newest.effective_seq)
            self._fallback.start(self._table.newest)
        self.lost = lost
        problem = "no modes from mode_supervisor: stopping and standing" if lost else ""
        self._conditions.set("supervisor", problem)
