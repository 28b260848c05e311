"""How late the drives act on commands, found from the torques that they report."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.controller.latency_kernels import weigh_rows
from cassie_gaits import robot
from cassie_gaits.names import LEG_DRIVES
from cassie_msgs.layout import MotorCommand, RobotState

FloatArray = npt.NDArray[np.float64]

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
