"""Which sensors can be believed: each channel is held against another that must agree with it.

A position and a velocity that belong together are a pair: ten drives, six joints, three axes of the
IMU's orientation with those of its gyro. `SensorMonitor` has the reasoning.
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
"""What `inspect` finds: all of the sample can be believed; it has come to rest without power."""

_TILTED = 0.02  # rad, of the IMU's orientation against its gyro: turning then seems to tilt it
_MOST_TORQUE = 1.5  # by the drive's limit: with a torque constant that is off it gives less


class Watch(Record):
    """What the monitor remembers.

    Attributes:
        pairs: Drives, joints and axes of the IMU.
        accelerometer: Its axes.
        ticks: Since the start.
        last_orientation: Measured, x y z w.
        orientation: To go on with, x y z w.
        turned: By the gyro, fading over `APART_TIME`. In rad.
        bad_torque: Time for which each drive's is not believed yet. In s.
        rest: Time for which it has hung or lain still without power. In s.
        powered: Whether it has power.
        used: Whether it has had power since the start.
        moved: Whether, once used, it has moved since the estimate began anew.
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
    """What is normal.

    Attributes:
        pairs: Of the drives, joints and axes of the IMU.
        accelerometer: Of its axes.
        period: Between samples. In s.
        hold: Time that a channel stays unbelieved after it last was wrong. In s.
        torque: Of each drive. In Nm.
    """

    pairs: Records[PairLimits] = part(PairLimits, PAIRS)
    accelerometer: AccelerometerLimits = part(AccelerometerLimits)
    period: float
    hold: float
    torque: FloatArray = array(10)

    def __init__(self, period: float, attitude_delay: float, hold: float) -> None:
        """Of Cassie.

        Args:
            period: Between samples. In s.
            attitude_delay: Of the IMU's orientation. In s.
            hold: How long a channel stays unbelieved after it last was wrong. In s.
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
    """Take in a sample; afterwards `bad` and `trusted` are those of this sample.

    Args:
        samples: `Sensors.record`. Shape (1,).
        watches: Changed in place. Shape (1,).
        limits: What is normal. Shape (1,).
        push: Acceleration of the last sample after `push_of_legs`. Shape (3,), in m/s^2.
        force: Of both feet at the last sample. In N.

    Returns:
        `BELIEVED` if all of it can be believed, plus `RESTED` at the moment from which on the
        robot has rested without power for `REST_TIME`, and at which a channel is believed again
        later in that rest.
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
    """All that is measured but the orientation."""
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
    """Those that are believed, of drives and gyro, for what they do to the pelvis."""
    v = watch.accelerometer.velocities
    for j in range(13):
        pair = watch.pairs[j if j < 10 else FIRST_AXIS + j - 10]
        now = pair.trusted[V] if math.isfinite(pair.trusted[V]) else v[0, j]
        v[2, j] = v[1, j] if watch.ticks > 0 else now
        v[1, j] = v[0, j] if watch.ticks > 0 else now
        v[0, j] = now


@compiled
def _turn(q: FloatArray, watch: Watch) -> None:
    """Take in the orientation (4,), x y z w: by its turn, NaN where it is none."""
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
    """For how long it has had no power and hung or lain still, as far as its sensors tell."""
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
    """Nothing tells a wrong torque, except where the drive cannot give it."""
    for i in range(10):
        watch.bad_torque[i] = max(0.0, watch.bad_torque[i] - limit.period)
        if not abs(drive_torque[i]) <= limit.torque[i]:  # NaN compares false
            watch.bad_torque[i] = limit.hold


@compiled
def _compare_pairs(watch: Watch, limit: Limits) -> None:
    """Find what is bad of each pair, and what to go on with. The IMU has one orientation."""
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
            watch.moved = watch.used  # the estimate begins anew with what is believed again
    _orient(watch, limit.period, bad > 0.0)


@compiled
def _orient(watch: Watch, period: float, bad: bool) -> None:
    """The orientation to go on with: the measured one, or the last one turned by the gyro."""
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


_GAP = 0.02  # s, without an estimate, after which what it was tells nothing
_TOE_DRIVES, _TOE_JOINTS = (4, 9), (12, 15)


class SensorMonitor:
    """Finds channels that fail, and says what to go on with.

    - A value that is no number or that the robot cannot have, such as a torque beyond the drive's
      limit, a position that jumps: at once. Of a torque this is all.
    - A channel whose bits stay the same while its partner moves: stuck, or off.
    - A velocity of one tick off its neighbours' curve, an acceleration off their line: spikes. A
      pillar at the hip, a harness that chatters shakes all axes of the accelerometer, and is none.
    - Position and integrated velocity do not go together: the one that moves now as the other did
      20 to 100 ms ago is late. With other delays they grow apart, and the sign of their difference
      by the velocity tells which of them it is. What the velocity filters of drives and joints
      answer is expected. The IMU's orientation and gyro are such a pair.
    - The accelerometer follows what forces, torques and the legs' own motion gave the pelvis 20, 30
      or 40 ms ago, for longer than what they give now: it is late. A push from outside is not among
      these forces; it fits neither. After a blow, which fits no delay at all, the legs
      give way as late as that: for a while nothing speaks for a delay. In the gantry nothing is
      compared.

    A position goes on as the integral of its velocity, a velocity as the difference of its
    position, the orientation with the gyro and the gyro with the orientation, the accelerometer
    with gravity alone, a torque that the drive cannot give as 0. Where both of a pair fail there is
    nothing to go on with, except for the toes, which have two encoders each.

    A violent fall can make good sensors contradict each other, and what a channel is replaced by
    drifts off meanwhile. So without power a channel is believed again that has changed its bits and
    that nothing else speaks against for `REST_TIME`: while its partner, which is believed, agrees
    with it, or, where both are lost, once the robot hangs or lies still. Dead ones do not change.

    Args:
        period: Between samples. In s.
        attitude_delay: Of the IMU's orientation. In s.
        hold: How long a channel stays unbelieved after it last was wrong. In s.
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
        """Channels that are not believed, see `channels`."""
        self.lost = 0
        """Those of them without which there is no estimate."""
        self.rested = False
        """Whether it has come to rest without power: to be cleared by who begins anew."""

    def reset(self) -> None:
        """Believe everything."""
        self._watch.clear()
        self._trusted[:] = math.nan  # nothing to go on with yet
        self._seq = -1
        self.mask = self.lost = 0
        self.rested = False

    def _start_over(self) -> None:
        """Samples are missing: compare from this one on; what is not believed stays so."""
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
        """The sample to go on with: the same, or one in which bad channels are replaced.

        Args:
            sensors: One sample.
            rotation: Pelvis to world, last known. Shape (3, 3).
            push: What the legs' forces gave the pelvis at the last sample. Shape (3,), in m/s^2.
            force: Of both feet at the last sample. In N.
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
    """An estimator that gets what the monitor lets through.

    It begins anew where nothing could be estimated for more than `_GAP`, and once the robot has
    come to rest without power: after a fall, or when it was lifted, attitude and height are off.

    Args:
        core: The estimator.
        period: Between samples. In s.
    """

    def __init__(self, core: LegEstimator, period: float) -> None:
        self.core = core
        self._longest_gap = round(_GAP / period)
        self._unanswered = 0  # samples in a row
        self.starts = 0
        """How often it has begun anew since the reset."""
        self._names: tuple[str, ...] = ()
        self._named = 0
        self._push, self._force = np.zeros(3), 0.0
        self._monitor = SensorMonitor(
            period, core.config.filter.attitude_delay, core.config.distrust_time
        )

    @property
    def config(self) -> EstimatorConfig:
        """Figures in force; may be set while it runs."""
        return self.core.config

    @config.setter
    def config(self, config: EstimatorConfig) -> None:
        self.core.config = config

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the channels that are not believed now."""
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
            SensorError: if channels fail that nothing can replace; the message names them.
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
        core.coast(bool(monitor.mask >> channels.ACCELEROMETER & 7))
        state = core.step(sample)
        self._unanswered = 0
        push_of_legs(sample.drive_torque, state.foot_force, core.feet, self._push)
        left, right = state.foot_force.tolist()
        self._force = left + right
        state.sensor_faults[...] = monitor.mask
        return state
