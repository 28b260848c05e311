"""The mode that is valid at a tick, by the supervisor's answers and time-outs."""

from __future__ import annotations

import time
from dataclasses import dataclass

from rclpy.node import Node

from cassie_control.ros.common import Conditions
from cassie_control.schedule import ModeInForce, refusal
from cassie_msgs.layout import Mode, RobotState, header
from cassie_msgs.ros.fast_lane import EVERY, LaneSubscription, LaneWaiter, LocalTopic
from cassie_msgs.ros.one_writer import OneWriter
from cassie_msgs.ros.process import Stop
from cassie_msgs.schedule import START_TIMEOUT, effective_seq, period_of


@dataclass(frozen=True)
class SubstituteMode:
    """A mode that is used at a tick in place of the mode made for this tick, which has not come.

    Attributes:
        effective_seq: `effective_seq` of this mode, or of the last mode of a lost supervisor.
        supervisor_lost: Whether the supervisor is lost, so that the robot stops and stands.
    """

    effective_seq: int
    supervisor_lost: bool


class ModeSource:
    """The mode for each tick: waits for it in lock-step, takes the newest one otherwise.

    If a newer state comes while one is being answered, the plant does not wait for answers: it
    runs on the wall clock. From then on, until the next episode, this class does not wait either.

    Attributes:
        supervisor: Guard that accepts the modes of one supervisor.
        newer_state: The newer state that came during a wait, serialized; the loop takes it.
        substitute: The mode used in place of the mode made for the last tick; None if none was.

    Args:
        node: The controller.
        stop: Request to end.
        states: States that the controller answers; a wait takes newer ones from here.
        conditions: Gets reports of problems.
        period: Time between states. In s.
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
        self._modes_in_force = ModeInForce(period)
        self._table = self._modes_in_force.table
        self._mode = Mode()
        self.newer_state: bytes | None = None
        self.substitute: SubstituteMode | None = None
        self._reported_lost = False
        self._plant_waits = True
        self._heard = False
        self._episode = -1
        self._tick = 0
        self._current = self._table.newest
        self._span = range(0)  # ticks for which the current mode is known to be valid

    def reset(self, episode: int) -> None:
        """Begin a new episode."""
        self._modes_in_force.reset(episode)
        self._episode = episode
        self._plant_waits = True
        self._span = range(0)
        self.substitute = None
        self._report()

    @property
    def lost(self) -> bool:
        """Whether the supervisor counts as lost; the robot then stops and stands."""
        return self._modes_in_force.lost

    def is_ready(self, tick: int) -> bool:
        """Whether `at` answers without waiting."""
        if tick in self._span:
            return True
        self._tick = tick
        self._take()
        return self.lost or not self._plant_waits or self._table.may_begin(tick)

    def at(self, tick: int) -> Mode:
        """The mode for a tick; may wait for it."""
        if tick in self._span:
            return self._current
        self._tick = tick
        self._take()
        if not self.lost and self._plant_waits and not self._table.may_begin(tick):
            self._wait(tick)
        mode = self._modes_in_force.at(tick)
        self._report()
        if mode is self._table.at(tick):
            self._current = mode
            self._span = range(tick, effective_seq(period_of(tick)))
            self.substitute = None
        else:
            forces = self._modes_in_force
            since = forces.lost_after if forces.lost else int(mode.effective_seq)
            self.substitute = SubstituteMode(since, forces.lost)
        return mode

    def _wait(self, tick: int) -> None:
        timeout = ModeInForce.TIMEOUT if self._heard else START_TIMEOUT
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0.0:
            self._waiter.wait(left)
            self._take()
            if self._table.may_begin(tick):
                return
            if self._newer_state_came(tick):
                self._plant_waits = False
                return
            if self._stop.requested:
                return
        self._modes_in_force.give_up()

    def _newer_state_came(self, tick: int) -> bool:
        """Whether a newer state has come; it is kept in `newer_state`."""
        while (raw := self._states.take_raw()) is not None:
            _, _, episode, seq = header(raw)
            if (episode, seq) != (self._episode, tick):
                self.newer_state = raw
        return self.newer_state is not None

    def _take(self) -> None:
        while (raw := self._modes.take_raw()) is not None:
            try:
                self._mode.load(raw)
            except ValueError as error:
                self._conditions.set("mode", str(error))
                continue
            same = int(self._mode.episode) == self._episode
            self.supervisor.used(same)
            if not same:
                continue
            refused = refusal(self._mode, self._tick)
            self._conditions.set("mode", refused)
            if refused:
                self.supervisor.doubt()
            else:
                self._table.add(self._mode)
                self._heard = True

    def _report(self) -> None:
        if self.lost != self._reported_lost:
            self._reported_lost = self.lost
            problem = "no modes from mode_supervisor: stopping and standing" if self.lost else ""
            self._conditions.set("supervisor", problem)
