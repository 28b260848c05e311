"""Estimate of how late the drives act, from the torques that they report."""

from __future__ import annotations

import math

import numpy as np

from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.names import DRIVE_IN_Q
from cassie_gaits.records import FloatArray, IntArray, Record, RecordArray, Records, array, whole
from cassie_gaits.robot import DRIVE_DELAY, ENCODER_RATE
from cassie_msgs.layout import MotorCommand, RobotState

REPORT_DELAY = DRIVE_DELAY + 1.0 / ENCODER_RATE
"""Time from a drive's torque set-point to the sample that reports the torque. In s."""

MAX_LATENCY = 0.08
"""Largest latency that is tested. In s."""

TORQUE_DELAYS = (0.0, 0.001, 0.002, 0.003, 0.004)
"""Delays of torques beyond `DRIVE_DELAY` that are tested. In s."""

_LOW_PASS_TIME = 0.25  # s, time constant of the residuals of all delays
_MIN_RESIDUAL = 0.01  # of the present delays, before others are taken; 1 is full torque
_MAX_RESIDUAL_RATIO = 0.3  # of other delays' residual to that of the present ones
_MAX_UNEXPLAINED = 0.1  # ratio of other delays' residual to all squared torques


class Search(Record):
    """State of the search for the delays.

    Attributes:
        seq: `seq` of the last observed state.
        newest: Row of the newest command, which answered the state before this one.
        count: Number of commands stored since the ring was emptied.
        latency: Latency found, in commands: the age of the command that explains the torques.
        torque_delay: Place of the torques' delay that was found in `TORQUE_DELAYS`.
        tested: Place of the delay that is tested at this tick.
        likeliest: Latency with the least residual for each of `TORQUE_DELAYS`, in commands.
        least: These residuals.
        before: Row of `joint_history` before each delayed torque was computed.
        interpolation: Time from that row to the computation. In ticks.
        low_pass_weight: Low-pass weight of a new value, once in as many ticks as there are
            `TORQUE_DELAYS`.
        scale: 1 over the largest torque of each drive. In 1/Nm.
    """

    seq: int = whole()
    newest: int = whole()
    count: int = whole()
    latency: int = whole()
    torque_delay: int = whole()
    tested: int = whole()
    likeliest: IntArray = whole(len(TORQUE_DELAYS))
    least: FloatArray = array(len(TORQUE_DELAYS))
    before: IntArray = whole(len(TORQUE_DELAYS))
    interpolation: FloatArray = array(len(TORQUE_DELAYS))
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
    """Low-pass the residuals of all latencies and one delay of torques; True if a find changed.

    The delays take turns, a tick each.

    Args:
        states: `RobotState.record`: the drives and their reported torques. Shape (1,).
        commands: Ring of the commands sent, `MotorCommand.record`. Shape (n,).
        joint_history: Angles and rates of the drives at the last ticks, the oldest first; updated.
            Shape (m, 2, 10).
        residuals: Averages of the squared residuals for each of `TORQUE_DELAYS`, and, last in each
            row, of the squared reported torques; updated. Shape (5, n + 1).
        searches: Changed in place. Shape (1,).
    """
    state, search = states[0], searches[0]
    seq = int(state.seq)
    if seq != search.seq + 1 or state.power < 0.5:
        residuals[:] = 0.0
        search.least[:] = 0.0
        search.newest = search.count = 0
    search.seq = seq
    reported, scale = state.drive_torque, search.scale
    _store_joints(state, joint_history)
    rows = commands.shape[0]
    if search.count < rows + joint_history.shape[0] - 1:
        return False
    search.tested = (search.tested + 1) % len(residuals)
    averages = residuals[search.tested]
    total = 0.0
    for i in range(10):
        total += (scale[i] * reported[i]) ** 2
    averages[rows] += search.low_pass_weight * (total - averages[rows])
    best = 0
    for row in range(rows):
        command = commands[(search.newest - row) % rows]
        residual = _residual(command, reported, joint_history, search)
        averages[row] += search.low_pass_weight * (residual - averages[row])
        if averages[row] < averages[best]:
            best = row
    search.likeliest[search.tested], search.least[search.tested] = best, averages[best]
    delay = int(search.least.argmin())
    present, least = residuals[search.torque_delay, search.latency], search.least[delay]
    explains = least < _MAX_RESIDUAL_RATIO * present and least < _MAX_UNEXPLAINED * averages[rows]
    if not (present > _MIN_RESIDUAL and explains):
        return False
    found = search.likeliest[delay]
    changed = found != search.latency or delay != search.torque_delay
    search.latency, search.torque_delay = found, delay
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
    command: MotorCommand,
    reported: FloatArray,
    joint_history: FloatArray,
    search: Search,
) -> float:
    """Squared difference of a command's torques and the reported ones, over the largest torques.

    Args:
        command: A command of the ring.
        reported: Torques that the drives report. Shape (10,), in Nm.
        joint_history: See `find_latency`.
        search: The search.
    """
    row = search.before[search.tested]
    before, after = joint_history[row], joint_history[row + 1]
    scale, s, residual = search.scale, search.interpolation[search.tested], 0.0
    for i in range(10):
        angle = (1.0 - s) * before[0, i] + s * after[0, i]
        rate = (1.0 - s) * before[1, i] + s * after[1, i]
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
    """Estimates how late the drives act: compares reported torques with those of past commands.

    A drive that computes torques from the command of D ticks ago, which act d s late, reports
    3.5 ms + d later

        u = torque + kp (position - q) + kd (velocity - v).

    For each D and each d the residual is the squared difference from the reported torque, over the
    drive's largest one. It is summed over the drives and low-passed over a quarter of a second. The
    delays found become those with the least residual where the present ones leave a large residual.
    While the robot stands still, all delays explain the same torques and nothing changes. The first
    steps, or an oscillation of the springs, reveal them.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        ticks = math.ceil(REPORT_DELAY / period)
        self._usual_latency = ticks - 1
        rows = ticks + round(MAX_LATENCY / period)
        ages = (REPORT_DELAY + np.array(TORQUE_DELAYS)) / period
        oldest = math.ceil(ages.max())
        self._commands = np.zeros(rows, MotorCommand.RECORD)
        self._joint_history = np.zeros((oldest + 1, 2, 10))
        self._residuals = np.zeros((len(TORQUE_DELAYS), rows + 1))
        self._search = Search(
            before=oldest - np.ceil(ages),
            interpolation=np.ceil(ages) - ages,
            low_pass_weight=1.0 - math.exp(-period * len(TORQUE_DELAYS) / _LOW_PASS_TIME),
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

    @property
    def torque_delay(self) -> float:
        """The part of it after the drives have computed their torques. In s."""
        return TORQUE_DELAYS[self._search.torque_delay]

    def reset(self) -> None:
        """Begin anew without delays."""
        search = self._search
        search.latency, search.torque_delay, search.seq = self._usual_latency, 0, -1
        search.newest = search.count = search.tested = 0
        self._residuals[:] = search.least[:] = 0.0

    def observe(self, state: RobotState) -> bool:
        """Update with a state and its reported torques; True if a delay found has changed."""
        changed: bool = find_latency(
            state.record, self._commands, self._joint_history, self._residuals, self._search.records
        )
        return changed

    def sent(self, command: MotorCommand) -> None:
        """Store the command that answers the state observed last."""
        store_command(command.record, self._commands, self._search.records)
