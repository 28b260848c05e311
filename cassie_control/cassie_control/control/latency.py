"""How late the drives act on commands, found from the torques that they report."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.control.robot import RecordArray
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES
from cassie_msgs.layout import MotorCommand, RobotState

FloatArray = npt.NDArray[np.float64]


@compiled
def weigh_rows(
    states: RecordArray,
    sent: FloatArray,
    head: int,
    known: int,
    seen: FloatArray,
    later: float,
    scale: FloatArray,
    share: float,
    errors: FloatArray,
) -> int:
    """Average what each latency leaves unexplained.

    Args:
        states: `RobotState.record`: the drives and what they report now. Shape (1,).
        sent: Ring of commands: torque, position, velocity, kp, kd of the ten drives. Shape (n, 50).
        head: Row of the newest, which answered the state before this one.
        known: How many have been sent since the record began.
        seen: Angles and rates of the drives at the last ticks, the oldest first; brought up to
            date. Shape (m, 2, 10).
        later: How much later than the oldest of them the reported torques were set. In ticks.
        scale: 1 by the largest torque of each drive. Shape (10,), in 1/Nm.
        share: Of a new value in the averages.
        errors: Averages, the last one of the reported torques themselves; changed. Shape (n + 1,).

    Returns:
        How many commands ago is explained best, or -1 while less is known than they look back.
    """
    state = states[0]
    reported = state.drive_torque
    last = seen.shape[0] - 1
    for k in range(last):
        seen[k] = seen[k + 1]
    for i in range(10):
        leg, drive = i // 5, i % 5
        joint = 6 + 7 * leg + (6 if drive == 4 else drive)
        seen[last, 0, i], seen[last, 1, i] = state.q[joint], state.v[joint]
    rows = sent.shape[0]
    if known < rows + last:
        return -1
    total = 0.0
    for i in range(10):
        total += (scale[i] * reported[i]) ** 2
    errors[rows] += share * (total - errors[rows])
    best = 0
    for row in range(rows):
        command, error = sent[(head - row) % rows], 0.0
        for i in range(10):
            angle = (1.0 - later) * seen[0, 0, i] + later * seen[1, 0, i]
            rate = (1.0 - later) * seen[0, 1, i] + later * seen[1, 1, i]
            u = command[i] + command[30 + i] * (command[10 + i] - angle)
            u += command[40 + i] * (command[20 + i] - rate)
            u = scale[i] * u
            difference = max(-1.0, min(1.0, u)) - scale[i] * reported[i]
            error += difference * difference
        errors[row] += share * (error - errors[row])
        if errors[row] < errors[best]:
            best = row
    return best


REPORTED_AFTER = 0.0035
"""From when a drive sets a torque until a sample has it: 3 ms to its effect, 0.5 ms more. In s."""

LONGEST = 0.08
"""Latency up to which it is looked for. In s."""

_AVERAGED_OVER = 0.25  # s
_ENOUGH = 0.01  # sum of squares of unexplained torques, by the drives' largest, that is looked into
_BETTER = 0.3  # share of them that another latency has to leave, or less
_EXPLAINED = 0.1  # share of all torques that it may leave


class CommandLatency:
    """Compares reported torques with what commands of the past would have made the drives do.

    A drive that took over the command of D ticks ago reports, 3.5 ms
    later,

        u = torque + kp (position - q) + kd (velocity - v).

    For each D the squared differences from the reported torques, each by its drive's largest, are
    summed over the drives and averaged over a quarter of a second. The latency found changes to the
    D that explains most where the present one leaves much unexplained. Standing still, every D
    explains the same torques and nothing changes; the first steps show it.

    Args:
        period: Of control. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        ticks = math.ceil(REPORTED_AFTER / period)
        self._usual = ticks - 1
        rows = ticks + round(LONGEST / period)
        self._sent = np.zeros((rows, 50))
        self._seen = np.zeros((ticks + 1, 2, 10))
        self._later = ticks - REPORTED_AFTER / period
        self._errors = np.zeros(rows + 1)
        self._share = 1.0 - math.exp(-period / _AVERAGED_OVER)
        limits = [robot.DRIVES[name].torque_limit for name in LEG_DRIVES] * 2
        self._scale = 1.0 / np.array(limits)
        self._seq = -1
        self.reset()
        self.observe(RobotState())  # the first call loads the compiled function, or makes it
        self.reset()

    @property
    def latency(self) -> float:
        """From the answer to a state until the drives act on it, beyond their own delay. In s."""
        return (self._row - self._usual) * self._period

    def reset(self) -> None:
        """Forget everything: commands act at once."""
        self._row = self._usual
        self._begin()

    def _begin(self) -> None:
        """Start a record of commands; what was found stays."""
        self._errors[:] = 0.0
        self._head = self._known = 0

    def observe(self, state: RobotState) -> bool:
        """Take in a state, with what the drives report; says whether the latency found changed."""
        seq = int(state.seq)
        if seq != self._seq + 1 or float(state.power) < 0.5:
            self._begin()
        self._seq = seq
        best = weigh_rows(
            state.record,
            self._sent,
            self._head,
            self._known,
            self._seen,
            self._later,
            self._scale,
            self._share,
            self._errors,
        )
        if best < 0 or not self._is_better(best):
            return False
        changed, self._row = best != self._row, best
        return changed

    def _is_better(self, row: int) -> bool:
        """Whether what the present latency leaves unexplained asks for another, and this is it."""
        now, then, all_torques = self._errors[self._row], self._errors[row], self._errors[-1]
        return bool(now > _ENOUGH and then < _BETTER * now and then < _EXPLAINED * all_torques)

    def sent(self, command: MotorCommand) -> None:
        """Keep the command that answers the state observed last."""
        self._head = (self._head + 1) % len(self._sent)
        self._sent[self._head] = command.floats
        self._known += 1
