"""Estimate of the drives' latency from the torques that they report."""

from __future__ import annotations

import math

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array, whole
from cassie_msgs.layout import MotorCommand, RobotState

REPORTED_AFTER = 0.0035
"""Time from a drive's set torque to the sample: 3 ms to the torque's effect, 0.5 ms more. In s."""

LONGEST = 0.08
"""Largest latency that is tested. In s."""

_AVERAGED_OVER = 0.25  # s, time constant
_ENOUGH = 0.01  # threshold of the squared residual, torques over the drives' largest, for a search
_BETTER = 0.3  # largest ratio of the residuals with another and with the present latency
_EXPLAINED = 0.1  # largest ratio of the residual with another latency to all squared torques


class Search(Record):
    """State of the search for the latency.

    Attributes:
        seq: `seq` of the last observed state.
        head: Row of the newest command, which answered the state before this one.
        known: Number of commands sent since the record began.
        row: Latency found, in commands: the age of the command that explains the torques.
        later: Time from the oldest of `seen` to the setting of the reported torques. In ticks.
        share: Low-pass weight of a new value.
        scale: 1 over the largest torque of each drive. In 1/Nm.
    """

    seq: int = whole()
    head: int = whole()
    known: int = whole()
    row: int = whole()
    later: float
    share: float
    scale: FloatArray = array(10)


@compiled
def observe(
    states: RecordArray,
    sent: FloatArray,
    seen: FloatArray,
    errors: FloatArray,
    searches: Records[Search],
) -> bool:
    """Low-pass the residual of each latency; True if the latency found has changed.

    Args:
        states: `RobotState.record`: the drives and their reported torques. Shape (1,).
        sent: Ring of commands: torque, position, velocity, kp, kd of the ten drives. Shape (n, 50).
        seen: Angles and rates of the drives at the last ticks, the oldest first; updated. Shape
            (m, 2, 10).
        errors: Averages of the squared residuals, and, last, of the squared reported torques;
            updated. Shape (n + 1,).
        searches: Changed in place. Shape (1,).
    """
    state, search = states[0], searches[0]
    seq = int(state.seq)
    if seq != search.seq + 1 or state.power < 0.5:
        errors[:] = 0.0
        search.head = search.known = 0
    search.seq = seq
    reported, scale = state.drive_torque, search.scale
    last = seen.shape[0] - 1
    for k in range(last):
        seen[k] = seen[k + 1]
    for i in range(10):
        leg, drive = i // 5, i % 5
        joint = 6 + 7 * leg + (6 if drive == 4 else drive)
        seen[last, 0, i], seen[last, 1, i] = state.q[joint], state.v[joint]
    rows = sent.shape[0]
    if search.known < rows + last:
        return False
    total = 0.0
    for i in range(10):
        total += (scale[i] * reported[i]) ** 2
    errors[rows] += search.share * (total - errors[rows])
    best = 0
    for row in range(rows):
        command, error = sent[(search.head - row) % rows], 0.0
        for i in range(10):
            angle = (1.0 - search.later) * seen[0, 0, i] + search.later * seen[1, 0, i]
            rate = (1.0 - search.later) * seen[0, 1, i] + search.later * seen[1, 1, i]
            u = command[i] + command[30 + i] * (command[10 + i] - angle)
            u += command[40 + i] * (command[20 + i] - rate)
            u = scale[i] * u
            difference = max(-1.0, min(1.0, u)) - scale[i] * reported[i]
            error += difference * difference
        errors[row] += search.share * (error - errors[row])
        if errors[row] < errors[best]:
            best = row
    now, then, all_torques = errors[search.row], errors[best], errors[rows]
    if not (now > _ENOUGH and then < _BETTER * now and then < _EXPLAINED * all_torques):
        return False
    changed, search.row = best != search.row, best
    return bool(changed)


@compiled
def keep(command: FloatArray, sent: FloatArray, searches: Records[Search]) -> None:
    """Keep a command (50,) in the ring of those sent."""
    search = searches[0]
    search.head = (search.head + 1) % sent.shape[0]
    sent[search.head] = command
    search.known += 1


class CommandLatency:
    """Estimates the drives' latency: compares reported torques with those of past commands.

    A drive that acts on the command of D ticks ago reports, 3.5 ms later,

        u = torque + kp (position - q) + kd (velocity - v).

    For each D the residual is the squared difference from the reported torque, over the drive's
    largest one. It is summed over the drives and low-passed over a quarter of a second. The latency
    found becomes the D with the least residual where the present one leaves a large residual. While
    the robot stands still, every D explains the same torques and nothing changes; the first steps
    reveal the latency.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        ticks = math.ceil(REPORTED_AFTER / period)
        self._usual = ticks - 1
        rows = ticks + round(LONGEST / period)
        self._sent = np.zeros((rows, 50))
        self._seen = np.zeros((ticks + 1, 2, 10))
        self._errors = np.zeros(rows + 1)
        limits = [robot.DRIVES[name].torque_limit for name in LEG_DRIVES] * 2
        self._search = Search(
            later=ticks - REPORTED_AFTER / period,
            share=1.0 - math.exp(-period / _AVERAGED_OVER),
            scale=1.0 / np.array(limits),
        )
        self.reset()
        # The first calls load the compiled functions, or compile them.
        self.observe(RobotState())
        self.sent(MotorCommand())
        self.reset()

    @property
    def latency(self) -> float:
        """Time from a command until the drives act on it, beyond their own delay. In s."""
        return (self._search.row - self._usual) * self._period

    def reset(self) -> None:
        """Begin anew with the latency 0."""
        search = self._search
        search.row, search.seq = self._usual, -1
        search.head = search.known = 0
        self._errors[:] = 0.0

    def observe(self, state: RobotState) -> bool:
        """Update with a state and its reported torques; True if the latency found has changed."""
        changed: bool = observe(
            state.record, self._sent, self._seen, self._errors, self._search.records
        )
        return changed

    def sent(self, command: MotorCommand) -> None:
        """Keep the command that answers the state observed last."""
        keep(command.floats, self._sent, self._search.records)
