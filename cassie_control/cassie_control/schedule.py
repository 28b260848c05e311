"""For which ticks the supervisor's answers hold, and what holds when they do not arrive.

On every 10th state k the supervisor publishes the mode for tick k + 10 and the nine after it.
In lock-step the controller computes a tick only with the mode made for it. So the supervisor adds
no latency to the loop, and the result does not depend on the machine.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_control.finite import fault
from cassie_msgs.bounds import outside
from cassie_msgs.layout import Gait, GaitResult, Mode, RobotMode
from cassie_msgs.schedule import GAIT_TICKS, PERIOD_TICKS, effective_seq, period_of

LEAD = 1000
"""Control ticks by which a mode, or a script's answer, may be ahead of its receiver."""

_KEPT = 4  # modes that wait for their tick at most; in lock-step one does

_STEP_TIMES = 0.2, 1.0  # s, range of an accepted gait's step time


def refusal(mode: Mode, tick: int) -> str:
    """Why a mode is refused at a control tick; empty if it is accepted.

    A mode answers a state at most `LEAD` ticks ahead of the controller, which may be held up. It
    holds from a tick at most `PERIOD_TICKS` after that state on.
    """
    seq = int(mode.seq)
    return outside("mode seq", seq, 0, tick + LEAD) or outside(
        "effective_seq", int(mode.effective_seq), seq, effective_seq(seq)
    )


def gait_refusal(gait: Gait, tick: int) -> str:
    """Why an answer of the gait optimizer is refused; empty if it is accepted.

    An answer belongs to a state with a request, and must arrive before the tick at which it begins.

    Args:
        gait: The answer.
        tick: Next tick that the controller computes.
    """
    seq, effective = int(gait.seq), int(gait.effective_seq)
    wrong = (
        outside("gait seq", seq, 0, tick)
        or outside("effective_seq", effective, seq + GAIT_TICKS, seq + GAIT_TICKS)
        or outside("result", int(gait.result), 0, len(GaitResult) - 1)
    )
    if wrong:
        return wrong
    if effective < tick:
        return f"late: for tick {effective}, came before tick {tick}"
    low, high = _STEP_TIMES
    if int(gait.result) == GaitResult.FOUND and not low <= float(gait.step_time) <= high:
        return f"step_time is {float(gait.step_time):g} s, expected {low} .. {high} s"
    return fault(gait)


class ModeTable:
    """The modes that have arrived, by the first tick for which they hold."""

    def __init__(self) -> None:
        self._modes: dict[int, Mode] = {}
        self._spare: list[Mode] = []  # a message costs a tenth of a millisecond to make
        self._off = Mode()

    def reset(self, episode: int) -> None:
        """Begin a new episode: off until the first answer holds."""
        self._modes.clear()
        self._off = Mode()
        self._off.episode[...] = episode

    def add(self, mode: Mode) -> None:
        """Store a copy of a mode; it takes the place of one that is too old."""
        copy = self._spare.pop() if self._spare else Mode()
        copy.copy_from(mode)
        self._modes[int(mode.effective_seq)] = copy
        while len(self._modes) > _KEPT:
            self._spare.append(self._modes.pop(min(self._modes)))

    def may_begin(self, tick: int) -> bool:
        """Whether the answer that this tick needs has arrived.

        Tick 0 needs the answer to state 0, although off holds until tick 10. So the supervisor
        must run before robot time passes.
        """
        first = PERIOD_TICKS if tick == 0 else period_of(tick)
        return first == 0 or first in self._modes

    def at(self, tick: int) -> Mode | None:
        """The mode made for a tick, or None if it has not arrived."""
        if tick < PERIOD_TICKS:
            return self._off
        return self._modes.get(period_of(tick))

    @property
    def newest(self) -> Mode:
        """The mode that holds for the latest ticks; off before the first."""
        return self._modes[max(self._modes)] if self._modes else self._off


class ModeInForce:
    """The mode for each tick; while the supervisor is lost, modes that stop and stand.

    Args:
        period: Control period. In s.

    Attributes:
        table: The modes that have arrived.
        lost: Whether the supervisor counts as lost.
        lost_after: `effective_seq` of the supervisor's last mode before it was lost.
    """

    TIMEOUT = 0.4
    """Robot time after the last mode at which the supervisor counts as lost. In s."""

    def __init__(self, period: float) -> None:
        self._period = period
        self.table = ModeTable()
        self._fallback = StopAndStand(period)
        self.lost_after = -1
        self.lost = False

    def reset(self, episode: int) -> None:
        """Begin a new episode."""
        self.table.reset(episode)
        self.lost = False

    def give_up(self) -> None:
        """Treat the supervisor as lost."""
        if not self.lost:
            self.lost = True
            self.lost_after = int(self.table.newest.effective_seq)
            self._fallback.start(self.table.newest)

    def at(self, tick: int) -> Mode:
        """The mode for a tick; while the supervisor is lost, it is reused by the next call."""
        newest = int(self.table.newest.effective_seq)
        if self.lost and newest > self.lost_after:
            self.lost = False
        mode = self.table.at(tick)
        if mode is not None and not self.lost:
            return mode
        if (tick - newest) * self._period > self.TIMEOUT:
            self.give_up()
        return self._fallback.step() if self.lost else self.table.newest


class StopAndStand:
    """Modes in place of a lost supervisor's: velocities go to zero, then Cassie stands.

    The modes off and damp are kept; other set-points keep their values. On a Segway riding goes on,
    and the CoM shift returns to zero as well, since it would drive the Segway on.

    Args:
        period: Control period. In s.
    """

    DECELERATION = 0.4
    """Deceleration of the commanded velocities. In m/s^2, for the turn rate in rad/s^2."""

    SHIFT_RATE = 0.2
    """Rate at which the commanded CoM shift on a Segway returns to zero. In m/s."""

    STEPPING_TIME = 1.5
    """Time of stepping in place between slowing down and standing. In s."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._mode = Mode()
        self._stepping_time = 0.0
        self._time_in_mode = 0.0

    def start(self, last: Mode) -> None:
        """Begin from the last mode in force."""
        self._mode.copy_from(last)
        self._stepping_time = self._time_in_mode = 0.0

    def step(self) -> Mode:
        """The mode of the next tick; reused by the next step."""
        mode = self._mode
        change = self.DECELERATION * self._period
        moving = False
        for value in (mode.vx, mode.vy, mode.yaw_rate):
            moving = _step_to_zero(value, change) or moving
        if mode.mode == RobotMode.SEGWAY:
            for value in (mode.com_x, mode.com_y):
                _step_to_zero(value, self.SHIFT_RATE * self._period)
        self._stepping_time = 0.0 if moving else self._stepping_time + self._period
        if mode.mode == RobotMode.WALK and self._stepping_time >= self.STEPPING_TIME:
            mode.mode[...] = int(RobotMode.STAND)
            self._time_in_mode = 0.0
        self._time_in_mode += self._period
        mode.transition[...] = min(1.0, max(float(mode.transition), self._time_in_mode))
        return mode


def _step_to_zero(value: npt.NDArray[np.float64], change: float) -> bool:
    """Move a set-point towards zero by at most `change`, in place; True if it was not zero."""
    now = float(value)
    value[...] = max(0.0, now - change) if now > 0.0 else min(0.0, now + change)
    return now != 0.0
