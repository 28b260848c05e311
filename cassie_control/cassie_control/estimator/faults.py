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
    AccelerometerLimits,
    expect_acceleration,
    look_at_acceleration,
    push_of_legs,
)
from cassie_control.estimator.base import LegEstimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.pairs import (
    APART_TIME,
    DRIVE,
    FIRST_AXIS,
    IMU,
    JOINT,
    PAIRS,
    REST_TIME,
    P,
    Pair,
    PairLimits,
    V,
    go_on,
    look_at_pair,
    set_pair_limits,
    start_pair,
)
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array, part, whole
from cassie_msgs.layout import RobotState, Sensors

BoolArray = npt.NDArray[np.bool_]

BELIEVED, RESTED = 1, 2
"""Result bits of `inspect`: the whole sample is accepted; the robot rests without power."""

_TILTED = 0.02  # rad, misalignment of orientation and gyro: a turn then shows on the other axes
_MOST_TORQUE = 1.5  # ratio to the drive's limit, which a wrong torque constant does not reach


class Watch(Record):
    """State of the monitor.

    Attributes:
        pairs: Drives, joints and axes of the IMU.
        accelerometer: Axes of the accelerometer.
        ticks: Ticks since the start.
        last_orientation: Last measured orientation, x y z w.
        orientation: Measured orientation or its replacement, for the estimator, x y z w.
        turned: Integrated gyro, decaying with `APART_TIME`. In rad.
        bad_torque: Remaining time for which each drive's torque is rejected. In s.
        rest: Time for which the robot has hung or lain still without power. In s.
        powered: Whether the robot has power.
        used: Whether the robot has had power since the start.
        moved: Whether the robot, once used, has moved since the estimate began anew.
    """

    pairs: Records[Pair] = part(Pair, PAIRS)
    accelerometer: Accelerometer = part(Accelerometer)
    ticks: int = whole()
    last_orientation: FloatArray = array(4)
    orientation: FloatArray = array(4)
    turned: FloatArray = array(3)
    bad_torque: FloatArray = array(10)
    rest: float
    powered: int = whole()
    used: int = whole()
    moved: int = whole()


class Limits(Record):
    """Limits of healthy sensors.

    Attributes:
        pairs: Limits of the drives, joints and axes of the IMU.
        accelerometer: Limits of the accelerometer's axes.
        period: Time between samples. In s.
        hold: Time for which a channel stays rejected after its last fault. In s.
        torque: Largest torque of each drive. In Nm.
    """

    pairs: Records[PairLimits] = part(PairLimits, PAIRS)
    accelerometer: AccelerometerLimits = part(AccelerometerLimits)
    period: float
    hold: float
    torque: FloatArray = array(10)

    def __init__(self, period: float, attitude_delay: float, hold: float) -> None:
        """Limits of Cassie.

        Args:
            period: Time between samples. In s.
            attitude_delay: Delay of the IMU's orientation. In s.
            hold: Time for which a channel stays rejected after its last fault. In s.
        """
        super().__init__(period=period, hold=hold)
        set_pair_limits(period, attitude_delay, hold, self.records["pairs"][0])
        self.records["accelerometer"] = AccelerometerLimits(period, hold).records
        limits = [robot.DRIVES[name].torque_limit for name in LEG_DRIVES]
        self.torque[:] = _MOST_TORQUE * np.tile(limits, 2)


@compiled
def inspect(
    samples: RecordArray,
    watches: Records[Watch],
    limits: Records[Limits],
    push: FloatArray,
    force: float,
) -> int:
    """Check a sample; afterwards every `bad` and `trusted` is that of this sample.

    Args:
        samples: `Sensors.record`. Shape (1,).
        watches: Changed in place. Shape (1,).
        limits: Limits of healthy sensors. Shape (1,).
        push: Acceleration at the last sample from `push_of_legs`. Shape (3,), in m/s^2.
        force: Sum of both feet's forces at the last sample. In N.

    Returns:
        `BELIEVED` if the whole sample is accepted. `RESTED` is added when the robot has rested
        without power for `REST_TIME`, and again when a channel is accepted later in that rest.
    """
    sample, watch, limit = samples[0], watches[0], limits[0]
    _take_in(sample, watch)
    _turn(sample.orientation, watch)
    _look_at_torques(sample.drive_torque, watch, limit)
    _rest(watch, limit, sample.power)
    if watch.ticks == 0:
        for pair in watch.pairs:
            start_pair(pair)
        watch.accelerometer.measured[1:] = watch.accelerometer.measured[0]
    _compare_pairs(watch, limit)
    believed = watch.bad_torque.max() <= 0.0
    for pair in watch.pairs:
        believed = believed and pair.bad.max() <= 0.0
    axes = watch.accelerometer
    _take_in_velocities(watch)
    expect_acceleration(axes, push, limit.period)
    look_at_acceleration(axes, limit.accelerometer, watch.ticks, force, believed)
    watch.ticks += 1
    found = BELIEVED if believed and axes.bad.max() <= 0.0 else 0
    if watch.moved > 0 and watch.rest >= REST_TIME:
        watch.moved = 0
        found += RESTED
    return found


@compiled
def _take_in(sample: Sensors, watch: Watch) -> None:
    """Copy all measurements but the orientation."""
    pairs, acceleration = watch.pairs, watch.accelerometer.measured
    for i in range(10):
        pairs[i].position, pairs[i].velocity = sample.drive_position[i], sample.drive_velocity[i]
    for i in range(6):
        pair = pairs[10 + i]
        pair.position, pair.velocity = sample.joint_position[i], sample.joint_velocity[i]
    for k in range(3):
        pairs[FIRST_AXIS + k].velocity = sample.angular_velocity[k]
        acceleration[2, k] = acceleration[1, k]
        acceleration[1, k] = acceleration[0, k]
        acceleration[0, k] = sample.linear_acceleration[k]


@compiled
def _take_in_velocities(watch: Watch) -> None:
    """Store the trusted velocities of drives and gyro, for the pelvis's expected acceleration."""
    v = watch.accelerometer.velocities
    for j in range(13):
        pair = watch.pairs[j if j < 10 else FIRST_AXIS + j - 10]
        now = pair.trusted[V] if math.isfinite(pair.trusted[V]) else v[0, j]
        v[2, j] = v[1, j] if watch.ticks > 0 else now
        v[1, j] = v[0, j] if watch.ticks > 0 else now
        v[0, j] = now


@compiled
def _turn(q: FloatArray, watch: Watch) -> None:
    """Add the turn of the quaternion (4,), x y z w, to the IMU's axes; NaN if its norm is wrong."""
    p, axes = watch.last_orientation, watch.pairs[FIRST_AXIS:]
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    if not 0.9 < square < 1.1:  # NaN compares false
        for axis in axes:
            axis.position = math.nan
        return
    if watch.ticks == 0:
        for k in range(4):
            p[k] = q[k]
            if axes[0].bad[P] <= 0.0:
                watch.orientation[k] = q[k]
    sign = 2.0 if q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3] > 0.0 else -2.0
    x = p[3] * q[0] - p[0] * q[3] - p[1] * q[2] + p[2] * q[1]
    y = p[3] * q[1] - p[1] * q[3] - p[2] * q[0] + p[0] * q[2]
    z = p[3] * q[2] - p[2] * q[3] - p[0] * q[1] + p[1] * q[0]
    turn = (x, y, z)
    for k in range(3):
        axes[k].position = axes[k].last_position + sign * turn[k]
    for k in range(4):
        p[k] = q[k]


@compiled
def _rest(watch: Watch, limit: Limits, power: float) -> None:
    """Count for how long the robot, by its sensors, has hung or lain still without power."""
    still = power < 0.5
    watch.powered = 0 if still else 1
    if not still:
        watch.used = 1
    else:
        for i in range(PAIRS):
            pair = watch.pairs[i]
            if pair.bad[V] <= 0.0 and not abs(pair.velocity) < limit.pairs[i].still:
                still = False
    if still:
        watch.rest += limit.period
    else:
        watch.rest, watch.moved = 0.0, watch.used


@compiled
def _look_at_torques(drive_torque: FloatArray, watch: Watch, limit: Limits) -> None:
    """Reject torques that a drive cannot give; no other test of a torque exists."""
    for i in range(10):
        watch.bad_torque[i] = max(0.0, watch.bad_torque[i] - limit.period)
        if not abs(drive_torque[i]) <= limit.torque[i]:  # NaN compares false
            watch.bad_torque[i] = limit.hold


@compiled
def _compare_pairs(watch: Watch, limit: Limits) -> None:
    """Find the bad channels of all pairs, and replace them. The IMU has one orientation."""
    pairs, turned = watch.pairs, watch.turned
    axes = pairs[FIRST_AXIS:]
    for k in range(3):
        rate = axes[k].velocity
        turned[k] *= math.exp(-limit.period / APART_TIME)
        turned[k] += limit.period * rate if math.isfinite(rate) else 0.0
    for i in range(PAIRS):
        tilt = 0.0
        if i >= FIRST_AXIS:
            tilt = _TILTED * (np.abs(turned).sum() - abs(turned[i - FIRST_AXIS]))
        withdrawn = look_at_pair(pairs[i], limit.pairs[i], watch.ticks, tilt)
        if withdrawn and i >= FIRST_AXIS:
            for axis in axes:
                axis.bad[P] = 0.0
    bad = max(axes[0].bad[P], axes[1].bad[P], axes[2].bad[P])
    for axis in axes:
        axis.bad[P] = bad
    for i in range(PAIRS):
        if go_on(pairs[i], limit.pairs[i], watch.powered, watch.rest):
            watch.moved = watch.used  # the estimate begins anew with the accepted channel
    _orient(watch, limit.period, bad > 0.0)


@compiled
def _orient(watch: Watch, period: float, bad: bool) -> None:
    """Orientation for the estimator: the measured one, or the last one turned by the gyro."""
    q, axes = watch.orientation, watch.pairs[FIRST_AXIS:]
    if not bad:
        for k in range(4):
            q[k] = watch.last_orientation[k]
        return
    half = 0.5 * period
    x, y, z = half * axes[0].trusted[V], half * axes[1].trusted[V], half * axes[2].trusted[V]
    a, b, c, w = q[0], q[1], q[2], q[3]
    q[0] = a + w * x + b * z - c * y
    q[1] = b + w * y + c * x - a * z
    q[2] = c + w * z + a * y - b * x
    q[3] = w - a * x - b * y - c * z
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0  # 0 before the first orientation
    for k in range(4):
        q[k] *= scale


_GAP = 0.02  # s without an estimate, after which the last estimate is useless
_TOE_DRIVES, _TOE_JOINTS = (4, 9), (12, 15)


class SensorMonitor:
    """Detects channels that fail, and replaces them.

    - A value that is not a number or that the robot cannot have, such as a torque beyond the
      drive's limit or a position that jumps: rejected at once. A torque has no other test.
    - A channel whose bits stay the same while its partner moves: stuck, or off.
    - A velocity of one tick off its neighbours' curve, or an acceleration off their line: a spike.
      A pillar at the hip or a harness that chatters shakes all axes of the accelerometer, which is
      no spike.
    - Position and integrated velocity disagree: the channel that moves now as the other one did 20
      to 100 ms ago is late. With other delays they grow apart, and the sign of the covariance of
      their difference and the velocity shows which one is late. The response of the velocity
      filters of drives and joints is modelled. The IMU's orientation and gyro are such a pair.
    - The accelerometer is late if it fits the acceleration of the pelvis 20, 30 or 40 ms ago, for
      longer than it fits the present one. That acceleration comes from forces, torques and the
      legs' own motion. A push from outside is not among them; it fits neither. After a blow, which
      fits no delay at all, the legs yield with such a delay; for a while no evidence for a delay is
      added. In the gantry nothing is compared.

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
        hold: Time for which a channel stays rejected after its last fault. In s.
    """

    def __init__(self, period: float, attitude_delay: float, hold: float) -> None:
        self._watch = Watch()
        self._limits = Limits(period, attitude_delay, hold)
        pairs = self._watch.records["pairs"][0]
        self._bad: FloatArray = pairs["bad"].T
        self._trusted: FloatArray = pairs["trusted"].T
        self._beliefs: list[npt.NDArray[np.float64 | np.int64]] = [
            self._bad,
            self._trusted,
            pairs["life"],
            self._watch.accelerometer.bad,
            self._watch.bad_torque,
            self._watch.orientation,
        ]
        self._repaired = Sensors()
        self._seq = -1
        self._trusted[:] = math.nan
        self.mask = 0
        """Rejected channels, a bit each; see `channels`."""
        self.lost = 0
        """Rejected channels without which there is no estimate, a bit each."""
        self.rested = False
        """Whether the robot has come to rest without power. Who begins anew clears this flag."""

    def reset(self) -> None:
        """Accept all channels."""
        self._watch.clear()
        self._trusted[:] = math.nan  # no replacement yet
        self._seq = -1
        self.mask = self.lost = 0
        self.rested = False

    def _start_over(self) -> None:
        """Begin the comparisons anew, as samples are missing; rejected channels stay rejected."""
        watch, beliefs = self._watch, [belief.copy() for belief in self._beliefs]
        rest, used, moved = watch.rest, watch.used, watch.moved
        watch.clear()
        watch.rest, watch.used, watch.moved = rest, used, moved
        for belief, before in zip(self._beliefs, beliefs, strict=True):
            belief[...] = before

    def step(
        self,
        sensors: Sensors,
        rotation: FloatArray,
        push: FloatArray,
        force: float,
    ) -> Sensors:
        """Sample for the estimator: the same, or one in which bad channels are replaced.

        Args:
            sensors: One sample.
            rotation: Pelvis to world, last known. Shape (3, 3).
            push: Acceleration at the last sample from `push_of_legs`. Shape (3,), in m/s^2.
            force: Sum of both feet's forces at the last sample. In N.
        """
        seq = int(sensors.seq)
        if seq != self._seq + 1:
            self._start_over()
        self._seq = seq
        found = inspect(sensors.record, self._watch.records, self._limits.records, push, force)
        if found & RESTED:
            self.rested = True
        if found & BELIEVED:
            self.mask = self.lost = 0
            return sensors
        return self._repair(sensors, rotation)

    def _repair(self, sensors: Sensors, rotation: FloatArray) -> Sensors:
        result, (position, velocity) = self._repaired, self._trusted
        bad_position, bad_velocity = self._bad > 0.0
        bad_acceleration = self._watch.accelerometer.bad > 0.0
        bad_torque = self._watch.bad_torque > 0.0
        self.mask = _mask(bad_position, bad_velocity, bad_acceleration)
        self.mask |= _bits(bad_torque) << channels.DRIVE_TORQUE
        both = bad_position & bad_velocity
        result.copy_from(sensors)
        for drive, joint in zip(_TOE_DRIVES, _TOE_JOINTS, strict=True):
            if both[drive] and not both[joint]:
                position[drive], velocity[drive] = position[joint], velocity[joint]
                both[drive] = False
            both[joint] = False
        self.lost = _mask(both, both, np.zeros(3, bool))
        result.drive_position[:], result.drive_velocity[:] = position[DRIVE], velocity[DRIVE]
        result.joint_position[:], result.joint_velocity[:] = position[JOINT], velocity[JOINT]
        result.angular_velocity[:] = velocity[IMU]
        result.orientation[:] = self._watch.orientation
        gravity = robot.GRAVITY * rotation[2]
        result.linear_acceleration[bad_acceleration] = gravity[bad_acceleration]
        result.drive_torque[bad_torque] = 0.0
        return result


def _mask(position: BoolArray, velocity: BoolArray, acceleration: BoolArray) -> int:
    flags = np.concatenate(
        [
            position[FIRST_AXIS : FIRST_AXIS + 1],
            velocity[IMU],
            acceleration,
            position[DRIVE],
            velocity[DRIVE],
            position[JOINT],
            velocity[JOINT],
        ]
    )
    return _bits(flags)


def _bits(flags: BoolArray) -> int:
    return sum(1 << k for k in np.flatnonzero(flags).tolist())


class MonitoredEstimator:
    """An estimator behind the sensor monitor.

    The estimate begins anew after more than `_GAP` without one, and once the robot has come to rest
    without power: after a fall or after it was lifted, attitude and height are off.

    Args:
        core: The estimator.
        period: Time between samples. In s.
    """

    def __init__(self, core: LegEstimator, period: float) -> None:
        self.core = core
        self._longest_gap = round(_GAP / period)
        self._unanswered = 0  # samples in a row
        self.starts = 0
        """How often the estimate has begun anew since the reset."""
        self._names: tuple[str, ...] = ()
        self._named = 0
        self._push, self._force = np.zeros(3), 0.0
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
        if mask != self._named:
            self._names, self._named = channels.names(mask), mask
        return self._names

    def reset(self) -> None:
        """Start afresh."""
        self._monitor.reset()
        self._push[:], self._force = 0.0, 0.0
        self._unanswered = self.starts = 0
        self.core.reset()

    def step(self, sensors: Sensors) -> RobotState:
        """Estimate from one sample.

        Returns:
            The state; reused by the next step.

        Raises:
            SensorError: if channels fail that have no replacement; the message names them.
        """
        monitor, core = self._monitor, self.core
        sample = monitor.step(sensors, core.rotation, self._push, self._force)
        self._unanswered += 1
        if monitor.lost:
            raise SensorError(channels.no_estimate(monitor.lost), monitor.lost)
        if monitor.rested or self._unanswered > self._longest_gap:
            monitor.rested = False
            self.starts += 1
            core.restart()
        core.set_accelerometer_rejected(bool(monitor.mask >> channels.ACCELEROMETER & 7))
        state = core.step(sample)
        self._unanswered = 0
        push_of_legs(sample.drive_torque, state.foot_force, core.feet, self._push)
        left, right = state.foot_force.tolist()
        self._force = left + right
        state.sensor_faults[...] = monitor.mask
        return state
