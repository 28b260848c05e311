"""Feed-forward torques that are learned over repeated steps, which the paper names as future work.

`torque_table` has the table and its file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cassie_control.config import ControllerConfig
from cassie_control.control.robot import Readings, Robot
from cassie_control.learning.torque_table import (
    JOINTS,
    LearnedTorques,
    zero_torques,
)
from cassie_control.planner.timing import RIGHT, StepTiming, backward_share
from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.names import DRIVE_IN_Q, HIP_YAW, LEG_DRIVE_COUNT
from cassie_gaits.records import FloatArray, RecordArray, Records
from cassie_msgs.layout import Mode, MotorCommand, RobotMode

_STANCE_HIP_PITCH, _SWING_HIP_PITCH = (
    JOINTS.index("stance_hip_pitch"),
    JOINTS.index("swing_hip_pitch"),
)
_MIN_TICKS = 0.5  # sum of weights from which a phase was seen in single support


class Cell(NamedTuple):
    """Where a value lies on a grid: between two points.

    Attributes:
        low, high: Indices of the two points; equal on a grid of one point.
        weight: Interpolation weight of the point `high`, 0..1.
    """

    low: int
    high: int
    weight: float


@compiled
def _speed_cell(speeds: FloatArray, speed: float) -> Cell:
    """Cell of a speed; clamped to the grid."""
    last = speeds.size - 1
    if last == 0 or speed <= speeds[0]:
        return Cell(0, min(1, last), 0.0)
    i = 0
    while i < last and speeds[i + 1] <= speed:
        i += 1
    if i == last:
        return Cell(last - 1, last, 1.0)
    return Cell(i, i + 1, (speed - speeds[i]) / (speeds[i + 1] - speeds[i]))


@compiled
def _phase_cell(points: int, phase: float) -> Cell:
    """Cell of a phase on an even grid from 0 to 1; clamped to the grid."""
    x = max(0.0, min(1.0, phase)) * (points - 1)
    i = min(points - 2, int(x))
    return Cell(i, i + 1, x - i)


@compiled
def _interpolated(table: FloatArray, j: int, speed: Cell, phase: Cell) -> float:
    """Torque of joint `j` in a cell of speed and phase. In Nm."""
    p, next_p = phase.low, phase.high
    at_low = table[speed.low, j, p] + phase.weight * (
        table[speed.low, j, next_p] - table[speed.low, j, p]
    )
    at_high = table[speed.high, j, p] + phase.weight * (
        table[speed.high, j, next_p] - table[speed.high, j, p]
    )
    value: float = at_low + speed.weight * (at_high - at_low)
    return value


@compiled
def _mirrored(j: int, stance: int) -> tuple[int, float]:
    """Drive of joint `j` of the table, and the sign of its torque, in a step on a leg.

    A step on the right leg is the mirror image of the table's: hip roll and yaw change their sign.
    """
    if stance != RIGHT:
        return j, 1.0
    return (j + LEG_DRIVE_COUNT) % 10, -1.0 if j % LEG_DRIVE_COUNT <= HIP_YAW else 1.0


@compiled
def add_torques(
    table: FloatArray,
    speeds: FloatArray,
    phase: float,
    speed: float,
    last_step_weight: float,
    weight: float,
    robots: Records[Robot],
    stance: int,
    new_step: bool,
    added: FloatArray,
    touchdown_jumps: FloatArray,
    torque: FloatArray,
) -> None:
    """Add the table's torques.

    Args:
        table: Learned torques. Shape (s, 10, n), in Nm.
        speeds: Speeds of the table. Shape (s,), in m/s.
        phase: Phase of the step.
        speed: Speed at which the table is read. In m/s.
        last_step_weight: Weight of the last step's torques, 0..1.
        weight: Weight of all torques, 0..1.
        robots: The robot now. Shape (1,).
        stance: Number of the stance leg.
        new_step: Whether a step begins.
        added: Torques added at the last tick, by drive; updated. Shape (10,), in Nm.
        touchdown_jumps: Difference of the last step's and this step's torques at touchdown;
            updated. Shape (10,), in Nm.
        torque: Torques of the command; changed. Shape (10,), in Nm.
    """
    speed_cell, phase_cell = _speed_cell(speeds, speed), _phase_cell(table.shape[2], phase)
    stance_load, swing_free = robots[0].load[stance], 1.0 - robots[0].contact[1 - stance]
    reaction = swing_free * backward_share(speed)
    for j in range(10):
        value = _interpolated(table, j, speed_cell, phase_cell)
        if j == _STANCE_HIP_PITCH:  # transmits the swing torque's reaction to the ground
            value -= reaction * _interpolated(table, _SWING_HIP_PITCH, speed_cell, phase_cell)
        drive, sign = _mirrored(j, stance)
        value *= sign * (stance_load if j < LEG_DRIVE_COUNT else swing_free)
        if new_step:
            touchdown_jumps[drive] = added[drive] - value
        value += last_step_weight * touchdown_jumps[drive]
        added[drive] = value
        torque[drive] += weight * value


@compiled
def accumulate_feedback(
    torque_sums: FloatArray,
    phase_weights: FloatArray,
    speed_weights: FloatArray,
    speeds: FloatArray,
    phase: float,
    speed: float,
    weight: float,
    stance: int,
    states: RecordArray,
    commands: RecordArray,
    limits: FloatArray,
) -> None:
    """Sum the torques of the drives' position and velocity loops at a phase and speed.

    Args:
        torque_sums: Sums of torques; updated. Shape (s, 10, n), in Nm.
        phase_weights: Sums of weights by phase; updated. Shape (n,).
        speed_weights: Sums of weights by speed; updated. Shape (s,).
        speeds: Speeds of the table. Shape (s,), in m/s.
        phase: Phase to which the torques belong.
        speed: Speed at which the table is read. In m/s.
        weight: Weight of this tick: how far the swing foot is free, 0..1.
        stance: Number of the stance leg.
        states: `RobotState.record`. Shape (1,).
        commands: `MotorCommand.record`. Shape (1,).
        limits: Saturation of the loops' torques. Shape (10,), in Nm.
    """
    state, command = states[0], commands[0]
    speed_cell, phase_cell = _speed_cell(speeds, speed), _phase_cell(phase_weights.size, phase)
    s, next_s = speed_cell.low, speed_cell.high
    p, next_p = phase_cell.low, phase_cell.high
    weight_p, weight_next_p = weight * (1.0 - phase_cell.weight), weight * phase_cell.weight
    speed_weights[s] += weight * (1.0 - speed_cell.weight)
    speed_weights[next_s] += weight * speed_cell.weight
    phase_weights[p] += weight_p
    phase_weights[next_p] += weight_next_p
    for j in range(10):
        drive, sign = _mirrored(j, stance)
        k = DRIVE_IN_Q[drive]
        torque = command.kp[drive] * (command.position[drive] - state.q[k])
        torque += command.kd[drive] * (command.velocity[drive] - state.v[k])
        torque = sign * max(-limits[j], min(limits[j], torque))
        torque_sums[s, j, p] += torque * (1.0 - speed_cell.weight) * weight_p
        torque_sums[s, j, next_p] += torque * (1.0 - speed_cell.weight) * weight_next_p
        torque_sums[next_s, j, p] += torque * speed_cell.weight * weight_p
        torque_sums[next_s, j, next_p] += torque * speed_cell.weight * weight_next_p


@compiled
def update_table(
    table: FloatArray,
    torque_sums: FloatArray,
    phase_weights: FloatArray,
    speed_weights: FloatArray,
    limits: FloatArray,
    gains: FloatArray,
    leak: float,
    smoothing: float,
) -> None:
    """Update the table after a step.

    Args:
        table: Learned torques; changed. Shape (s, 10, n), in Nm.
        torque_sums, phase_weights, speed_weights: Sums from `accumulate_feedback`.
        limits: Saturation of the table. Shape (10,), in Nm.
        gains: Share of the loops' torque that is learned. Shape (10,).
        leak, smoothing: See `config.LearningConfig`.
    """
    first, last = _single_support(phase_weights)
    if first < 0:
        return
    points = phase_weights.size
    for s in range(table.shape[0]):
        speed_share = speed_weights[s] / speed_weights.sum()
        for j in range(10):
            row, gain = table[s, j], gains[j]
            previous = row[0]
            for p in range(points):
                value = row[p]
                curvature = previous - 2.0 * value + row[min(p + 1, points - 1)]
                change = speed_share * (0.25 * smoothing * curvature - leak * value)
                if p < first or p > last:  # double support: nearest phase of single support
                    nearest = row[first if p < first else last]
                    change += speed_share * gain * (nearest - value)
                elif phase_weights[p] > _MIN_TICKS:
                    change += gain * torque_sums[s, j, p] / phase_weights[p]
                previous = value
                row[p] = max(-limits[j], min(limits[j], value + change))


@compiled
def _single_support(phase_weights: FloatArray) -> tuple[int, int]:
    """First and last point of the phase in single support; -1 if there is none."""
    first, last = -1, -1
    for p in range(phase_weights.size):
        if phase_weights[p] > _MIN_TICKS:
            first = p if first < 0 else first
            last = p
    return first, last


_TOUCHDOWN_BLEND_TIME = 0.03  # s, in which the torques of one step become those of the next
_SWITCH_TIME = 0.5  # s, in which all learned torques appear or vanish with the switch
_FAULT_TIME = 0.05  # s, in which all learned torques vanish once a sensor has failed
_SKIPPED_STEPS = 4  # steps after the beginning of walking that are not used for learning
_MAX_FINAL_PHASE = 1.15  # of a step that is used for learning
_MAX_SPEED_ERROR = 0.15  # m/s, of a step that is used for learning
_MAX_TILT = 0.15  # rad, torso roll and pitch of a step that is used for learning
_BALANCE_JOINTS = [
    JOINTS.index(name)
    for name in (
        "stance_hip_roll",
        "stance_hip_pitch",
        "stance_knee",
        "stance_toe",
        "swing_hip_roll",
    )
]


class TorqueLearning:
    """Torques by phase, joint and speed, added to the gait's feed-forward and learned from it.

    With u_j(phase, speed) the table, mirrored for steps on the right leg, and

        e_j = kp (position - q) + kd (velocity - v)

    the tracking torque of the drive's own loop. Each step straight ahead at the commanded speed
    updates the table. Error e changes the phase p that was `lead` before (the drives' delay and the
    loop's response time):

        u(p) <- (1 - leak) u(p) + smoothing / 4 (u(p-) - 2 u(p) + u(p+)) + gain e(p + lead),

    within +-limit of the drive's torque, with p- and p+ the neighbouring points. Between two speeds
    of the table, each takes its share of the change. gain / (gain + leak) of the repeating error is
    learned.
    Nothing is learned for the stance hip's roll and pitch, the stance knee and the swing hip's
    roll, since their errors are part of the balance, and for the stance toe, which is torque-free.
    Only single support is used: in double support the legs press against each other, which no
    torque removes; there the table is continued from the nearest phase of single support.

    The torque of the swing hip's pitch has a reaction on the torso. Walking backward, the stance
    hip transmits it to the ground, as for the swing leg's inertia (`control.drives`):

        u_stance -= load (1 - contact of the swing foot) sat(-3 s/m speed) u_swing.

    DECISIONS.md has what was measured of both.

    Between its points and speeds the table is linear; beyond phase 1 and the outermost speeds it is
    constant. At a touchdown the torques become those of the new step within 30 ms. A stance leg
    gets them in proportion to its load, a swing leg as far as its foot is free. With a failed
    sensor the torques vanish within 50 ms: they were learned with healthy sensors of the joints.

    Under the paper's own law nothing is added.

    Attributes:
        torques: The table. Shape (s, 10, n), in Nm, of a step on the left leg.
        taught: Number of steps that were used for learning.

    Args:
        config: Switch and parameters of learning.
        learned: Initial table; None: zeros.
        period: Control period. In s.

    Source:
        Section "Conclusions" names torques learned over repeated steps; the law is iterative
        learning from the feedback's own torque (Kawato's feedback-error learning by phase).
    """

    def __init__(
        self, config: ControllerConfig, learned: LearnedTorques | None, period: float
    ) -> None:
        self._added = np.zeros(len(JOINTS))
        self._touchdown_jumps = np.zeros(len(JOINTS))
        self._step_is_ordinary = True
        self._period = period
        self.configure(config)
        self.begin(zero_torques() if learned is None else learned)

    def begin(self, learned: LearnedTorques) -> None:
        """Begin anew from other torques."""
        self.speeds = np.ascontiguousarray(learned.speeds)
        self.torques = np.array(learned.torques)
        self._torque_sums = np.zeros_like(self.torques)
        self._phase_weights = np.zeros(self.torques.shape[2])
        self._speed_weights = np.zeros(len(self.speeds))
        self.taught = 0
        self.start()

    def configure(self, config: ControllerConfig) -> None:
        """Use new parameters of learning."""
        self._config = config.learning
        self._adds = config.learned_torques != "none" and not config.walk.as_in_paper
        self._learns = self._adds and config.learned_torques == "learn"
        self._gains = np.full(len(JOINTS), config.learning.gain)
        self._gains[_BALANCE_JOINTS] = 0.0
        self._limits = TORQUE_LIMITS * config.learning.limit
        self._lead_ticks = round(config.learning.lead / self._period)

    def start(self) -> None:
        """Begin walking, with no torques added yet."""
        self._added[:] = 0.0
        self._weight = 1.0 if self._adds else 0.0
        self._steps = 0
        self._last_phase = 0.0
        self._clear()

    def step(
        self,
        timing: StepTiming,
        speed: float,
        readings: Readings,
        mode: Mode,
        command: MotorCommand,
    ) -> None:
        """Add the torques of this tick to the command's, and learn from it where that is on.

        Args:
            timing: Phase and stance leg.
            speed: Speed at which the gait library is read. In m/s.
            readings: The robot now.
            mode: Commanded mode and set-points.
            command: Set-points of this tick, complete.
        """
        self._update_weight(sensor_failed=int(readings.state.sensor_faults) != 0)
        if self._weight == 0.0:
            return
        new_step = timing.steps != self._steps
        if new_step:
            if self._learns:
                self._end_step(timing, mode)
            self._steps = timing.steps
        last_step_weight = max(0.0, 1.0 - timing.elapsed / _TOUCHDOWN_BLEND_TIME)
        if self._learns:
            self._observe(timing, speed, last_step_weight, readings, mode, command)
        add_torques(
            self.torques,
            self.speeds,
            timing.phase,
            speed,
            last_step_weight,
            self._weight,
            readings.records,
            timing.stance,
            new_step,
            self._added,
            self._touchdown_jumps,
            command.torque,
        )

    def _update_weight(self, *, sensor_failed: bool) -> None:
        """Move the weight of all torques, 0..1, with a rate limit."""
        if self._weight == 1.0 and self._adds and not sensor_failed:
            return
        max_change = self._period / (_FAULT_TIME if sensor_failed else _SWITCH_TIME)
        wanted = 1.0 if self._adds and not sensor_failed else 0.0
        self._step_is_ordinary = self._step_is_ordinary and not sensor_failed
        self._weight += max(-max_change, min(max_change, wanted - self._weight))

    def _observe(
        self,
        timing: StepTiming,
        speed: float,
        last_step_weight: float,
        readings: Readings,
        mode: Mode,
        command: MotorCommand,
    ) -> None:
        """Add the torques of the drives' loops at this tick to the sums of the step."""
        upright = max(abs(readings.roll), abs(readings.pitch)) <= _MAX_TILT
        straight = mode.mode == RobotMode.WALK and mode.vy == 0.0 == mode.yaw_rate
        self._step_is_ordinary = self._step_is_ordinary and upright and bool(straight)
        self._last_phase = timing.phase
        self._phases.append(float(timing.phase))
        if len(self._phases) > self._lead_ticks:
            free = 1.0 - readings.legs[1 - timing.stance].contact
            accumulate_feedback(
                self._torque_sums,
                self._phase_weights,
                self._speed_weights,
                self.speeds,
                self._phases[-1 - self._lead_ticks],
                speed,
                0.0 if last_step_weight else free,
                timing.stance,
                readings.state.record,
                command.record,
                self._limits,
            )

    def _end_step(self, timing: StepTiming, mode: Mode) -> None:
        """Learn from the step that ended, if it was an ordinary one."""
        kept_speed = abs(timing.velocity[0] - float(mode.vx)) <= _MAX_SPEED_ERROR
        in_time = self._last_phase <= _MAX_FINAL_PHASE
        if self._step_is_ordinary and kept_speed and in_time and timing.steps > _SKIPPED_STEPS:
            update_table(
                self.torques,
                self._torque_sums,
                self._phase_weights,
                self._speed_weights,
                self._limits,
                self._gains,
                self._config.leak,
                self._config.smoothing,
            )
            self.taught += 1
        self._clear()

    def _clear(self) -> None:
        """Empty the sums of a step."""
        self._phases: list[float] = []
        self._step_is_ordinary = True
        self._torque_sums[:] = 0.0
        self._phase_weights[:] = 0.0
        self._speed_weights[:] = 0.0
