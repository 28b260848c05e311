"""Fault detection of the sensors: each channel is compared with one that must agree with it.

A position and its velocity are a pair: ten drives, six joints, and three axes of the IMU's
orientation with those of its gyro. `SensorMonitor` has the reasoning.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator import channels
from cassie_control.estimator.acceleration import (
    Accelerometer,
    acceleration_by_legs,
    check_accelerometer,
    predict_acceleration,
)
from cassie_control.estimator.base import LegEstimator, is_orientation, squared_norm
from cassie_control.estimator.config import BRIDGED, EstimatorConfig
from cassie_control.estimator.pairs import (
    DRIVE_PAIRS,
    FIRST_IMU_AXIS,
    FIRST_JOINT,
    IMU_PAIRS,
    JOINT_PAIRS,
    PAIRS,
    REST_TIME,
    P,
    Pair,
    PairLimits,
    V,
    check_pair,
    initialise_pair,
    set_pair_limits,
    substitute_rejected,
)
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.names import DRIVES, LEGS, SENSED_JOINTS
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array, part, whole
from cassie_msgs.layout import RobotState, Sensors

BoolArray = npt.NDArray[np.bool_]

ALL_ACCEPTED, CAME_TO_REST = 1, 2
"""Result bits of `check_sample`: all channels are accepted; the robot rests without power."""


class MonitorState(Record):
    """State of the monitor.

    Attributes:
        pairs: Drives, joints and axes of the IMU.
        accelerometer: Axes of the accelerometer.
        ticks: Ticks since the start.
        measured_orientation: Last measured orientation, x y z w.
        orientation: Measured orientation or its substitute, for the estimator, x y z w.
        gyro_rotation: Integrated gyro, decaying with `pairs.RESIDUAL_TIME`. In rad.
        torque_rejected_for: Remaining time for which each drive's torque is rejected. In s.
        rest_time: Time for which the robot has hung or lain still without power. In s.
        powered: Whether the robot has power.
        was_powered: Whether the robot has had power since the start.
        restart_due: Whether the estimate begins anew at the next rest: once powered, the robot has
            moved, or a channel was accepted again.
    """

    pairs: Records[Pair] = part(Pair, PAIRS)
    accelerometer: Accelerometer = part(Accelerometer)
    ticks: int = whole()
    measured_orientation: FloatArray = array(4)
    orientation: FloatArray = array(4)
    gyro_rotation: FloatArray = array(3)
    torque_rejected_for: FloatArray = array(len(DRIVES))
    rest_time: float
    powered: int = whole()
    was_powered: int = whole()
    restart_due: int = whole()


_TORQUE_RATIO = 1.5  # to the drive's limit, which a wrong torque constant does not reach


class MonitorLimits(Record):
    """Limits of healthy sensors.

    Attributes:
        pairs: Limits of the drives, joints and axes of the IMU.
        period: Time between samples. In s.
        hold_time: Time for which a channel stays rejected after its last fault. In s.
        torque: Largest torque of each drive. In Nm.
    """

    pairs: Records[PairLimits] = part(PairLimits, PAIRS)
    period: float
    hold_time: float
    torque: FloatArray = array(len(DRIVES))

    def __init__(self, period: float, attitude_delay: float, hold_time: float) -> None:
        """Limits of Cassie.

        Args:
            period: Time between samples. In s.
            attitude_delay: Delay of the IMU's orientation. In s.
            hold_time: Time for which a channel stays rejected after its last fault. In s.
        """
        super().__init__(period=period, hold_time=hold_time)
        set_pair_limits(period, attitude_delay, hold_time, self.records["pairs"][0])
        self.torque[:] = _TORQUE_RATIO * TORQUE_LIMITS


@compiled
def check_sample(
    samples: RecordArray,
    monitors: Records[MonitorState],
    all_limits: Records[MonitorLimits],
    leg_acceleration: FloatArray,
    force: float,
) -> int:
    """Check a sample; afterwards every `rejected_for` and `output` is that of this sample.

    Args:
        samples: `Sensors.record`. Shape (1,).
        monitors: Changed in place. Shape (1,).
        all_limits: Limits of healthy sensors. Shape (1,).
        leg_acceleration: From `acceleration_by_legs` at the last sample. Shape (3,), in m/s^2.
        force: Sum of both feet's forces at the last sample. In N.

    Returns:
        `ALL_ACCEPTED` if the whole sample is accepted. `CAME_TO_REST` is added when the robot has
        rested without power for `REST_TIME`, and again when a channel is accepted later in that
        rest.
    """
    sample, monitor, limits = samples[0], monitors[0], all_limits[0]
    accelerometer = monitor.accelerometer
    _read_measurements(sample, monitor)
    _read_orientation(sample.orientation, monitor)
    _check_torques(sample.drive_torque, monitor, limits)
    _update_rest_time(monitor, limits, sample.power)
    if monitor.ticks == 0:
        for pair in monitor.pairs:
            initialise_pair(pair)
        accelerometer.measured[1:] = accelerometer.measured[0]
    _check_pairs(monitor, limits)
    others_accepted = monitor.torque_rejected_for.max() <= 0.0
    for pair in monitor.pairs:
        others_accepted = others_accepted and pair.rejected_for.max() <= 0.0
    _store_velocities(monitor)
    predict_acceleration(accelerometer, leg_acceleration, limits.period)
    check_accelerometer(
        accelerometer, limits.period, limits.hold_time, monitor.ticks, force, others_accepted
    )
    monitor.ticks += 1
    all_accepted = others_accepted and accelerometer.rejected_for.max() <= 0.0
    result = ALL_ACCEPTED if all_accepted else 0
    if monitor.restart_due > 0 and monitor.rest_time >= REST_TIME:
        monitor.restart_due = 0
        result += CAME_TO_REST
    return result


@compiled
def _read_measurements(sample: Sensors, monitor: MonitorState) -> None:
    """Copy all measurements but the orientation."""
    pairs, acceleration = monitor.pairs, monitor.accelerometer.measured
    for i in range(len(sample.drive_position)):
        pairs[i].position, pairs[i].velocity = sample.drive_position[i], sample.drive_velocity[i]
    for i in range(len(sample.joint_position)):
        pair = pairs[FIRST_JOINT + i]
        pair.position, pair.velocity = sample.joint_position[i], sample.joint_velocity[i]
    for k in range(3):
        pairs[FIRST_IMU_AXIS + k].velocity = sample.angular_velocity[k]
        acceleration[2, k] = acceleration[1, k]
        acceleration[1, k] = acceleration[0, k]
        acceleration[0, k] = sample.linear_acceleration[k]


@compiled
def _store_velocities(monitor: MonitorState) -> None:
    """Store the outputs for drives and gyro, for the pelvis's expected acceleration."""
    v = monitor.accelerometer.velocities
    for j in range(v.shape[1]):
        pair = monitor.pairs[j if j < FIRST_JOINT else FIRST_IMU_AXIS + j - FIRST_JOINT]
        velocity = pair.output[V] if math.isfinite(pair.output[V]) else v[0, j]
        v[2, j] = v[1, j] if monitor.ticks > 0 else velocity
        v[1, j] = v[0, j] if monitor.ticks > 0 else velocity
        v[0, j] = velocity


@compiled
def _read_orientation(q: FloatArray, monitor: MonitorState) -> None:
    """Set the positions of the IMU's axes: the rotation since the start, NaN if the norm is wrong.

    The rotation since the last sample, in axes of the IMU, is twice the vector part of
    (last quaternion)^-1 x (this one), to first order in its angle.

    Args:
        q: Measured quaternion, x y z w. Shape (4,).
        monitor: Changed in place.
    """
    last, axes = monitor.measured_orientation, monitor.pairs[FIRST_IMU_AXIS:]
    if not is_orientation(q):
        for axis in axes:
            axis.position = math.nan
        return
    if monitor.ticks == 0:
        for k in range(4):
            last[k] = q[k]
            if axes[0].rejected_for[P] <= 0.0:
                monitor.orientation[k] = q[k]
    cosine = q[0] * last[0] + q[1] * last[1] + q[2] * last[2] + q[3] * last[3]
    factor = 2.0 if cosine > 0.0 else -2.0  # q and -q are the same orientation
    x = last[3] * q[0] - last[0] * q[3] - last[1] * q[2] + last[2] * q[1]
    y = last[3] * q[1] - last[1] * q[3] - last[2] * q[0] + last[0] * q[2]
    z = last[3] * q[2] - last[2] * q[3] - last[0] * q[1] + last[1] * q[0]
    half_rotation = (x, y, z)
    for k in range(3):
        axes[k].position = axes[k].last_position + factor * half_rotation[k]
    for k in range(4):
        last[k] = q[k]


@compiled
def _update_rest_time(monitor: MonitorState, limits: MonitorLimits, power: float) -> None:
    """Count for how long the robot, by its sensors, has hung or lain still without power."""
    resting = power < 0.5
    monitor.powered = 0 if resting else 1
    if monitor.powered:
        monitor.was_powered = 1
    else:
        for i in range(PAIRS):
            pair, still_speed = monitor.pairs[i], limits.pairs[i].still_speed
            if pair.rejected_for[V] <= 0.0 and not abs(pair.velocity) < still_speed:
                resting = False
    if resting:
        monitor.rest_time += limits.period
    else:
        monitor.rest_time, monitor.restart_due = 0.0, monitor.was_powered


@compiled
def _check_torques(drive_torque: FloatArray, monitor: MonitorState, limits: MonitorLimits) -> None:
    """Reject torques that a drive cannot give; no other test of a torque exists."""
    rejected_for = monitor.torque_rejected_for
    for i in range(len(rejected_for)):
        rejected_for[i] = max(0.0, rejected_for[i] - limits.period)
        if not abs(drive_torque[i]) <= limits.torque[i]:  # NaN compares false
            rejected_for[i] = limits.hold_time


_MISALIGNMENT = 0.02  # rad, of orientation and gyro: a rotation then shows on the other axes


@compiled
def _check_pairs(monitor: MonitorState, limits: MonitorLimits) -> None:
    """Find the faulty channels of all pairs, and substitute them."""
    pairs, gyro_rotation = monitor.pairs, monitor.gyro_rotation
    axes = pairs[FIRST_IMU_AXIS:]
    for k in range(3):
        rate = axes[k].velocity
        gyro_rotation[k] *= limits.pairs[FIRST_IMU_AXIS + k].residual_decay
        gyro_rotation[k] += limits.period * rate if math.isfinite(rate) else 0.0
    for i in range(PAIRS):
        tolerance = 0.0
        if i >= FIRST_IMU_AXIS:
            of_this_axis = abs(gyro_rotation[i - FIRST_IMU_AXIS])
            tolerance = _MISALIGNMENT * (np.abs(gyro_rotation).sum() - of_this_axis)
        position_reaccepted = check_pair(pairs[i], limits.pairs[i], monitor.ticks, tolerance)
        if position_reaccepted and i >= FIRST_IMU_AXIS:
            for axis in axes:
                axis.rejected_for[P] = 0.0
    # The three axes have one orientation, which is rejected as a whole.
    rejected_for = max(axes[0].rejected_for[P], axes[1].rejected_for[P], axes[2].rejected_for[P])
    for axis in axes:
        axis.rejected_for[P] = rejected_for
    for i in range(PAIRS):
        if substitute_rejected(pairs[i], limits.pairs[i], monitor.powered, monitor.rest_time):
            monitor.restart_due = monitor.was_powered  # with the channel that is accepted again
    _update_orientation(monitor, limits.period, rejected_for > 0.0)


@compiled
def _update_orientation(monitor: MonitorState, period: float, rejected: bool) -> None:
    """Orientation for the estimator: the measured one, or the last one turned by the gyro."""
    q, axes = monitor.orientation, monitor.pairs[FIRST_IMU_AXIS:]
    if not rejected:
        for k in range(4):
            q[k] = monitor.measured_orientation[k]
        return
    half = 0.5 * period
    x, y, z = half * axes[0].output[V], half * axes[1].output[V], half * axes[2].output[V]
    a, b, c, w = q[0], q[1], q[2], q[3]
    q[0] = a + w * x + b * z - c * y
    q[1] = b + w * y + c * x - a * z
    q[2] = c + w * z + a * y - b * x
    q[3] = w - a * x - b * y - c * z
    square = squared_norm(q)
    # The norm is 0 before the first orientation.
    scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
    for k in range(4):
        q[k] *= scale


_TOES = tuple(
    (DRIVES.index(f"{leg}_toe"), FIRST_JOINT + SENSED_JOINTS.index(f"{leg}_toe")) for leg in LEGS
)
"""Pairs of the drive and the joint of each toe."""


class SensorMonitor:
    """Detects channels that fail, and substitutes them.

    - A value that is not a number or that the robot cannot have, such as a torque beyond the
      drive's limit or a position that jumps: rejected at once. A torque has no other test.
    - A channel whose bits stay the same while its partner moves: stuck, or off.
    - A velocity of one tick off its neighbours' curve, or an acceleration off their line: a spike.
      A pillar at the hip or a harness that chatters shakes all axes of the accelerometer, which is
      no spike.
    - Position and integrated velocity disagree: the channel that moves now as the other one did 10
      to 100 ms ago is delayed. The response of the velocity filters of drives and joints is
      modelled. The IMU's orientation and gyro are such a pair.
    - The accelerometer is delayed if it fits the acceleration of the pelvis 20, 30 or 40 ms ago,
      for longer than it fits the present one. That acceleration comes from forces, torques and the
      legs' own motion. A push from outside is not among them; what it leaves of the residual is
      known, and counts as healthy. Torques may act some milliseconds after they are reported, which
      is no delay of the accelerometer. In the gantry nothing is compared and no spikes count, as a
      cable that goes slack and taut looks like them.

    A position (or the orientation) is replaced by the integral of its velocity (or the gyro). A
    velocity (or the gyro) is replaced by the difference of its position (or the orientation). The
    accelerometer is replaced by gravity, a torque by 0. Where both channels of a pair fail there is
    no replacement, except for the toes, which have two encoders each.

    A violent fall can make healthy sensors contradict each other, and a replacement drifts
    meanwhile. So without power a channel is accepted again if its bits change and nothing else
    contradicts it for `REST_TIME`: while its accepted partner agrees with it, or, where both are
    rejected, once the robot hangs or lies still. The bits of a dead channel do not change.

    Args:
        period: Time between samples. In s.
        attitude_delay: Delay of the IMU's orientation. In s.
        hold_time: Time for which a channel stays rejected after its last fault. In s.
    """

    def __init__(self, period: float, attitude_delay: float, hold_time: float) -> None:
        self._state = MonitorState()
        self._limits = MonitorLimits(period, attitude_delay, hold_time)
        pairs = self._state.records["pairs"][0]
        self._rejected_for: FloatArray = pairs["rejected_for"].T
        self._output: FloatArray = pairs["output"].T
        self._kept_over_gaps: list[npt.NDArray[np.float64 | np.int64]] = [
            self._rejected_for,
            self._output,
            pairs["status"],
            self._state.accelerometer.rejected_for,
            self._state.torque_rejected_for,
            self._state.orientation,
        ]
        self._substituted = Sensors()
        self._seq = -1
        self._output[:] = math.nan
        self.mask = 0
        """Rejected channels, a bit each; see `channels`."""
        self.missing = 0
        """Rejected channels without which there is no estimate, a bit each."""
        self.came_to_rest = False
        """Whether the robot has come to rest without power. Who begins anew clears this flag."""

    def reset(self) -> None:
        """Accept all channels."""
        self._state.clear()
        self._output[:] = math.nan  # no substitute yet
        self._seq = -1
        self.mask = self.missing = 0
        self.came_to_rest = False

    def _restart_comparisons(self) -> None:
        """Begin the comparisons anew, as samples are missing; rejected channels stay rejected."""
        state, kept = self._state, [values.copy() for values in self._kept_over_gaps]
        rest_time, was_powered = state.rest_time, state.was_powered
        restart_due = state.restart_due
        state.clear()
        state.rest_time, state.was_powered = rest_time, was_powered
        state.restart_due = restart_due
        for values, before in zip(self._kept_over_gaps, kept, strict=True):
            values[...] = before

    def step(
        self,
        sensors: Sensors,
        rotation: FloatArray,
        leg_acceleration: FloatArray,
        force: float,
    ) -> Sensors:
        """Sample for the estimator: the same, or one with substitutes for rejected channels.

        Args:
            sensors: One sample.
            rotation: Pelvis to world, last known. Shape (3, 3).
            leg_acceleration: From `acceleration_by_legs` at the last sample. Shape (3,), in m/s^2.
            force: Sum of both feet's forces at the last sample. In N.
        """
        seq = int(sensors.seq)
        if seq != self._seq + 1:
            self._restart_comparisons()
        self._seq = seq
        result = check_sample(
            sensors.record, self._state.records, self._limits.records, leg_acceleration, force
        )
        if result & CAME_TO_REST:
            self.came_to_rest = True
        if result & ALL_ACCEPTED:
            self.mask = self.missing = 0
            return sensors
        return self._substitute(sensors, rotation)

    def _substitute(self, sensors: Sensors, rotation: FloatArray) -> Sensors:
        """Sample with substitutes for rejected channels; sets `mask` and `missing`."""
        result, (position, velocity) = self._substituted, self._output
        position_rejected, velocity_rejected = self._rejected_for > 0.0
        acceleration_rejected = self._state.accelerometer.rejected_for > 0.0
        torque_rejected = self._state.torque_rejected_for > 0.0
        self.mask = (
            _pair_bits(position_rejected, velocity_rejected)
            | _bits(acceleration_rejected, channels.ACCELEROMETER)
            | _bits(torque_rejected, channels.DRIVE_TORQUE)
        )
        both_rejected = position_rejected & velocity_rejected
        result.copy_from(sensors)
        for drive, joint in _TOES:
            if both_rejected[drive] and not both_rejected[joint]:
                position[drive], velocity[drive] = position[joint], velocity[joint]
                both_rejected[drive] = False
            both_rejected[joint] = False
        self.missing = _pair_bits(both_rejected, both_rejected)
        result.drive_position[:] = position[DRIVE_PAIRS]
        result.drive_velocity[:] = velocity[DRIVE_PAIRS]
        result.joint_position[:] = position[JOINT_PAIRS]
        result.joint_velocity[:] = velocity[JOINT_PAIRS]
        result.angular_velocity[:] = velocity[IMU_PAIRS]
        result.orientation[:] = self._state.orientation
        gravity = robot.GRAVITY * rotation[2]
        result.linear_acceleration[acceleration_rejected] = gravity[acceleration_rejected]
        result.drive_torque[torque_rejected] = 0.0
        return result


def _pair_bits(position: BoolArray, velocity: BoolArray) -> int:
    """Bits of the channels of pairs; the orientation counts with any of its axes.

    Args:
        position, velocity: Whether these channels of each pair count. Shape (19,).
    """
    return (
        int(position[IMU_PAIRS].any()) << channels.ORIENTATION
        | _bits(velocity[IMU_PAIRS], channels.GYRO)
        | _bits(position[DRIVE_PAIRS], channels.DRIVE_POSITION)
        | _bits(velocity[DRIVE_PAIRS], channels.DRIVE_VELOCITY)
        | _bits(position[JOINT_PAIRS], channels.JOINT_POSITION)
        | _bits(velocity[JOINT_PAIRS], channels.JOINT_VELOCITY)
    )


def _bits(flags: BoolArray, first: int) -> int:
    """Number whose bits are the flags, from bit `first` on."""
    return sum(1 << first + k for k in np.flatnonzero(flags).tolist())


class MonitoredEstimator:
    """An estimator behind the sensor monitor.

    The estimate begins anew after more than `BRIDGED` without one, and once the robot has come to
    rest without power: after a fall or after it was lifted, attitude and height are off.

    Args:
        core: The estimator.
        period: Time between samples. In s.
    """

    def __init__(self, core: LegEstimator, period: float) -> None:
        self.core = core
        self._max_gap_samples = round(BRIDGED / period)
        self._samples_without_estimate = 0  # in a row
        self.starts = 0
        """How often the estimate has begun anew since the reset."""
        self._names: tuple[str, ...] = ()
        self._named_mask = 0
        self._leg_acceleration, self._force = np.zeros(3), 0.0
        self._monitor = SensorMonitor(
            period, core.config.filter.attitude_delay, core.config.distrust_time
        )

    @property
    def config(self) -> EstimatorConfig:
        """Parameters in force; may be set while the estimator runs."""
        return self.core.config

    @config.setter
    def config(self, config: EstimatorConfig) -> None:
        self.core.config = config

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the channels that are rejected now."""
        mask = self._monitor.mask
        if mask != self._named_mask:
            self._names, self._named_mask = channels.names(mask), mask
        return self._names

    def reset(self) -> None:
        """Start afresh."""
        self._monitor.reset()
        self._leg_acceleration[:], self._force = 0.0, 0.0
        self._samples_without_estimate = self.starts = 0
        self.core.reset()

    def step(self, sensors: Sensors) -> RobotState:
        """Estimate from one sample.

        Returns:
            The state; reused by the next step.

        Raises:
            SensorError: if channels fail that have no replacement; the message names them.
        """
        monitor, core = self._monitor, self.core
        sample = monitor.step(sensors, core.rotation, self._leg_acceleration, self._force)
        self._samples_without_estimate += 1
        if monitor.missing:
            raise SensorError(channels.no_estimate(monitor.missing), monitor.missing)
        if monitor.came_to_rest or self._samples_without_estimate > self._max_gap_samples:
            monitor.came_to_rest = False
            self.starts += 1
            core.restart()
        core.set_accelerometer_rejected(bool(monitor.mask & channels.ACCELEROMETER_BITS))
        state = core.step(sample)
        self._samples_without_estimate = 0
        acceleration_by_legs(
            sample.drive_torque, state.foot_force, core.feet, self._leg_acceleration
        )
        left, right = state.foot_force.tolist()
        self._force = left + right
        state.sensor_faults[...] = monitor.mask
        return state
