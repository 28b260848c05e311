"""Estimate of the drives' latency from the torques that they report."""

from __future__ import annotations

import math

import numpy as np

from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.names import DRIVE_IN_Q
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array, whole
from cassie_gaits.robot import DRIVE_DELAY, ENCODER_RATE
from cassie_msgs.layout import MotorCommand, RobotState

REPORT_DELAY = DRIVE_DELAY + 1.0 / ENCODER_RATE
"""Time from a drive's torque set-point to the sample that reports the torque. In s."""

MAX_LATENCY = 0.08
"""Largest latency that is tested. In s."""

_LOW_PASS_TIME = 0.25  # s, time constant of the residuals of all latencies
_MIN_RESIDUAL = 0.01  # of the present latency, before another one is taken; 1 is full torque
_MAX_RESIDUAL_RATIO = 0.3  # of another latency's residual to that of the present one
_MAX_UNEXPLAINED = 0.1  # ratio of another latency's residual to all squared torques


class Search(Record):
    """State of the search for the latency.

    Attributes:
        seq: `seq` of the last observed state.
        newest: Row of the newest command, which answered the state before this one.
        count: Number of commands stored since the ring was emptied.
        latency: Latency found, in commands: the age of the command that explains the torques.
        interpolation: Time from the oldest of `joint_history` to the setting of the reported
            torques. In ticks.
        low_pass_weight: Low-pass weight of a new value.
        scale: 1 over the largest torque of each drive. In 1/Nm.
    """

    seq: int = whole()
    newest: int = whole()
    count: int = whole()
    latency: int = whole()
    interpolation: float
    low_pass_weight: float
    scale: FloatArray = array(10)


@compiled
def find_latency(
    states: RecordArray,
    commands: RecordArray,
    joint_history: FloatArray,
    residuals: FloatArray,
    searches: Records[Search],
) -> bool:
    """Low-pass the residual of each latency; True if the latency found has changed.

    Args:
        states: `RobotState.record`: the drives and their reported torques. Shape (1,).
        commands: Ring of the commands sent, `MotorCommand.record`. Shape (n,).
        joint_history: Angles and rates of the drives at the last ticks, the oldest first; updated.
            Shape (m, 2, 10).
        residuals: Averages of the squared residuals, and, last, of the squared reported torques;
            updated. Shape (n + 1,).
        searches: Changed in place. Shape (1,).
    """
    state, search = states[0], searches[0]
    seq = int(state.seq)
    if seq != search.seq + 1 or state.power < 0.5:
        residuals[:] = 0.0
        search.newest = search.count = 0
    search.seq = seq
    reported, scale = state.drive_torque, search.scale
    _store_joints(state, joint_history)
    rows = commands.shape[0]
    if search.count < rows + joint_history.shape[0] - 1:
        return False
    total = 0.0
    for i in range(10):
        total += (scale[i] * reported[i]) ** 2
    residuals[rows] += search.low_pass_weight * (total - residuals[rows])
    best = 0
    for row in range(rows):
        command = commands[(search.newest - row) % rows]
        residual = _residual(command, reported, joint_history, search)
        residuals[row] += search.low_pass_weight * (residual - residuals[row])
        if residuals[row] < residuals[best]:
            best = row
    present, least, all_torques = residuals[search.latency], residuals[best], residuals[rows]
    explains = least < _MAX_RESIDUAL_RATIO * present and least < _MAX_UNEXPLAINED * all_torques
    if not (present > _MIN_RESIDUAL and explains):
        return False
    changed, search.latency = best != search.latency, best
    return bool(changed)


@compiled
def _store_joints(state: RobotState, joint_history: FloatArray) -> None:
    """Append the drives' angles and rates to the history."""
    last = joint_history.shape[0] - 1
    for k in range(last):
        joint_history[k] = joint_history[k + 1]
    for i in range(10):
        joint = DRIVE_IN_Q[i]
        joint_history[last, 0, i], joint_history[last, 1, i] = state.q[joint], state.v[joint]


@compiled
def _residual(
    command: MotorCommand, reported: FloatArray, joint_history: FloatArray, search: Search
) -> float:
    """Squared difference of a command's torques and the reported ones, over the largest torques.

    Args:
        command: A command of the ring.
        reported: Torques that the drives report. Shape (10,), in Nm.
        joint_history: See `find_latency`.
        search: The search.
    """
    oldest, next_oldest = joint_history[0], joint_history[1]
    scale, s, residual = search.scale, search.interpolation, 0.0
    for i in range(10):
        angle = (1.0 - s) * oldest[0, i] + s * next_oldest[0, i]
        rate = (1.0 - s) * oldest[1, i] + s * next_oldest[1, i]
        torque = command.torque[i] + command.kp[i] * (command.position[i] - angle)
        torque += command.kd[i] * (command.velocity[i] - rate)
        torque = scale[i] * torque
        difference = max(-1.0, min(1.0, torque)) - scale[i] * reported[i]
        residual += difference * difference
    return residual


@compiled
def store_command(sent: RecordArray, commands: RecordArray, searches: Records[Search]) -> None:
    """Store a command in the ring.

    Args:
        sent: `MotorCommand.record`. Shape (1,).
        commands: The ring; changed in place.
        searches: Place of the newest command; changed in place. Shape (1,).
    """
    search = searches[0]
    search.newest = (search.newest + 1) % commands.shape[0]
    commands[search.newest] = sent[0]
    search.count += 1


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
        ticks = math.ceil(REPORT_DELAY / period)
        self._usual_latency = ticks - 1
        rows = ticks + round(MAX_LATENCY / period)
        self._commands = np.zeros(rows, MotorCommand.RECORD)
        self._joint_history = np.zeros((ticks + 1, 2, 10))
        self._residuals = np.zeros(rows + 1)
        self._search = Search(
            interpolation=ticks - REPORT_DELAY / period,
            low_pass_weight=1.0 - math.exp(-period / _LOW_PASS_TIME),
            scale=1.0 / TORQUE_LIMITS,
        )
        self.reset()
        # The first calls load the compiled functions, or compile them.
        self.observe(RobotState())
        self.sent(MotorCommand())
        self.reset()

    @property
    def latency(self) -> float:
        """Time from a command until the drives act on it, beyond their own delay. In s."""
        return (self._search.latency - self._usual_latency) * self._period

    def reset(self) -> None:
        """Begin anew with the latency 0."""
        search = self._search
        search.latency, search.seq = self._usual_latency, -1
        search.newest = search.count = 0
        self._residuals[:] = 0.0

    def observe(self, state: RobotState) -> bool:
        """Update with a state and its reported torques; True if the latency found has changed."""
        changed: bool = find_latency(
            state.record, self._commands, self._joint_history, self._residuals, self._search.records
        )
        return changed

    def sent(self, command: MotorCommand) -> None:
        """Store the command that answers the state observed last."""
        store_command(command.record, self._commands, self._search.records)
