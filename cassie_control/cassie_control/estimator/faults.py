"""Which sensors can be believed: each channel is held against another that must agree with it.

A position and a velocity that belong together are a pair: ten drives, six joints, three axes of the
IMU's orientation with those of its gyro. `SensorMonitor` has the reasoning.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator import acceleration, channels, delays
from cassie_control.estimator.acceleration import KEPT, expect_acceleration, look_at_acceleration
from cassie_control.estimator.base import LegEstimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.delays import DELAYS, KEPT_TICKS, RESPONSE_TICKS, P, V
from cassie_control.estimator.pairs import APART_TIME, IMU, PAIRS, REST_TIME, go_on, look_at_pair
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES, LEG_SENSED_JOINTS, LEGS
from cassie_msgs.layout import RobotState, Sensors

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]
BoolArray = npt.NDArray[np.bool_]

BELIEVED, RESTED = 1, 2
"""What `inspect` finds: all of the sample can be believed; it has come to rest without power."""


@compiled
def arrange(
    orientation: FloatArray,
    angular_velocity: FloatArray,
    linear_acceleration: FloatArray,
    drive_position: FloatArray,
    drive_velocity: FloatArray,
    joint_position: FloatArray,
    joint_velocity: FloatArray,
    watches: RecordArray,
) -> bool:
    """Take in a sample; whether the orientation is one.

    Args:
        orientation to joint_velocity: Fields of Sensors.
        watches: Of `WATCH_TYPE`. Shape (1,).
    """
    watch = watches[0]
    for i in range(10):
        watch.position[i], watch.velocity[i] = drive_position[i], drive_velocity[i]
    for i in range(6):
        watch.position[10 + i], watch.velocity[10 + i] = joint_position[i], joint_velocity[i]
    for k in range(3):
        watch.velocity[IMU + k] = angular_velocity[k]
        watch.acceleration[2, k] = watch.acceleration[1, k]
        watch.acceleration[1, k] = watch.acceleration[0, k]
        watch.acceleration[0, k] = linear_acceleration[k]
    q, p = orientation, watch.last_orientation
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    valid = 0.9 < square < 1.1  # NaN compares false
    if not valid:
        for k in range(3):
            watch.position[IMU + k] = math.nan
        return False
    if watch.ticks == 0:
        for k in range(4):
            p[k] = q[k]
            if watch.bad[P, IMU] <= 0.0:
                watch.orientation[k] = q[k]
    sign = 2.0 if q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3] > 0.0 else -2.0
    x = p[3] * q[0] - p[0] * q[3] - p[1] * q[2] + p[2] * q[1]
    y = p[3] * q[1] - p[1] * q[3] - p[2] * q[0] + p[0] * q[2]
    z = p[3] * q[2] - p[2] * q[3] - p[0] * q[1] + p[1] * q[0]
    watch.position[IMU] = watch.last_position[IMU] + sign * x
    watch.position[IMU + 1] = watch.last_position[IMU + 1] + sign * y
    watch.position[IMU + 2] = watch.last_position[IMU + 2] + sign * z
    for k in range(4):
        p[k] = q[k]
    return True


@compiled
def inspect(
    samples: RecordArray,
    watches: RecordArray,
    limits: RecordArray,
    expected: FloatArray,
    force: float,
) -> int:
    """Take in a sample and `look`.

    Returns:
        `BELIEVED` if all of it can be believed, plus `RESTED` at the moment from which on the
        robot has rested without power for `REST_TIME`, and at which a channel is believed again
        later in that rest.

    Args:
        samples: `Sensors.record`. Shape (1,).
        watches: Of `WATCH_TYPE`. Shape (1,).
        limits, expected, force: See `look`.
    """
    sample, watch = samples[0], watches[0]
    arrange(
        sample.orientation,
        sample.angular_velocity,
        sample.linear_acceleration,
        sample.drive_position,
        sample.drive_velocity,
        sample.joint_position,
        sample.joint_velocity,
        watches,
    )
    _look_at_torques(sample.drive_torque, watch, limits[0])
    _rest(watch, limits[0], sample.power)
    look(watches, limits, expected, force)
    found = 0
    if watch.bad.max() <= 0.0 and watch.bad_acceleration.max() <= 0.0:
        found = BELIEVED if watch.bad_torque.max() <= 0.0 else 0
    if watch.moved > 0 and watch.rest >= REST_TIME:
        watch.moved = 0
        found += RESTED
    return found


@compiled
def _rest(watch: Any, limit: Any, power: float) -> None:
    """For how long it has had no power and hung or lain still, as far as its sensors tell."""
    still = power < 0.5
    watch.powered = 0 if still else 1
    if not still:
        watch.used = 1
    else:
        for i in range(PAIRS):
            if watch.bad[V, i] <= 0.0 and not abs(watch.velocity[i]) < limit.still[i]:
                still = False
    if still:
        watch.rest += limit.period
    else:
        watch.rest, watch.moved = 0.0, watch.used


@compiled
def _look_at_torques(drive_torque: FloatArray, watch: Any, limit: Any) -> None:
    """Nothing tells a wrong torque, except where the drive cannot give it."""
    for i in range(10):
        watch.bad_torque[i] = max(0.0, watch.bad_torque[i] - limit.period)
        if not abs(drive_torque[i]) <= limit.torque[i]:  # NaN compares false
            watch.bad_torque[i] = limit.hold


@compiled
def look(
    watches: RecordArray,
    limits: RecordArray,
    expected: FloatArray,
    force: float,
) -> None:
    """Compare what belongs together; afterwards `bad` and `trusted` are those of this sample.

    Args:
        watches: Of `WATCH_TYPE`. Shape (1,).
        limits: Of `LIMITS_TYPE`. Shape (1,).
        expected: Acceleration of the last sample after `expect_acceleration`. Shape (3,), in m/s^2.
        force: Of both feet at the last sample. In N.
    """
    watch, limit = watches[0], limits[0]
    if watch.ticks == 0:
        for i in range(PAIRS):
            p, v = watch.position[i], watch.velocity[i]
            watch.last_position[i] = p if math.isfinite(p) else 0.0
            watch.last_velocity[:, i] = v if math.isfinite(v) else 0.0
            if watch.bad[P, i] == 0.0 and math.isfinite(p):
                watch.trusted[P, i] = p
            if watch.bad[V, i] == 0.0 and math.isfinite(v):
                watch.trusted[V, i] = v
        watch.acceleration[1:] = watch.acceleration[0]
    for k in range(3):
        rate = watch.velocity[IMU + k]
        watch.turned[k] *= math.exp(-limit.period / APART_TIME)
        watch.turned[k] += limit.period * rate if math.isfinite(rate) else 0.0
    for i in range(PAIRS):
        look_at_pair(watch, limit, i)
    turned = max(watch.bad[P, IMU], watch.bad[P, IMU + 1], watch.bad[P, IMU + 2])
    for i in range(IMU, PAIRS):
        watch.bad[P, i] = turned
    for i in range(PAIRS):
        go_on(watch, limit, i)
    _turn(watch, limit, turned > 0.0)
    look_at_acceleration(watch, limit, expected, force)
    watch.ticks += 1


@compiled
def _turn(watch: Any, limit: Any, bad: bool) -> None:
    """The orientation to go on with: the measured one, or the last one turned by the gyro."""
    q = watch.orientation
    if not bad:
        for k in range(4):
            q[k] = watch.last_orientation[k]
        return
    half = 0.5 * limit.period
    x, y, z = (
        half * watch.trusted[V, 16],
        half * watch.trusted[V, 17],
        half * watch.trusted[V, 18],
    )
    a, b, c, w = q[0], q[1], q[2], q[3]
    q[0] = a + w * x + b * z - c * y
    q[1] = b + w * y + c * x - a * z
    q[2] = c + w * z + a * y - b * x
    q[3] = w - a * x - b * y - c * z
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0  # 0 before the first orientation
    for k in range(4):
        q[k] *= scale


_DELAYS, _PAIR_DELAYS = len(acceleration.DELAYS), len(delays.DELAYS)

WATCH_TYPE = np.dtype(
    [
        ("ticks", int),  # since the start
        ("position", float, PAIRS),  # measured, rad; the IMU's: its turn since the start
        ("velocity", float, PAIRS),  # measured, rad/s
        ("last_position", float, PAIRS),
        ("last_velocity", float, (4, PAIRS)),  # newest first
        ("last_orientation", float, 4),
        ("steps", float, (RESPONSE_TICKS, PAIRS)),  # changes of position, newest first, rad
        ("turns", float, (3, PAIRS)),  # what the velocities say, newest first, rad
        ("same", int, (2, PAIRS)),  # ticks for which position and velocity had the same bits
        ("unseen", float, (2, PAIRS)),  # rad, by which the other one says that it moved meanwhile
        ("apart", float, PAIRS),  # rad, of position from integrated velocity, fading
        ("turned", float, 3),  # rad, of the IMU, fading as fast
        ("late", float, (4, PAIRS)),  # fading: means of apart and velocity, covariance, variance
        ("past", float, (2, PAIRS, KEPT_TICKS)),  # ring: steps and turns compared, rad
        ("evidence", float, (2, PAIRS, _PAIR_DELAYS)),  # rad^2: position is late, velocity is
        ("doubt", float, (2, PAIRS)),  # rad^2, the most of it
        ("unclear", float, PAIRS),  # s, for which they have been apart without a cause
        ("guessed", int, PAIRS),  # 1 where that was all there was to blame one of them by
        ("last_step", float, PAIRS),  # rad, compared last
        ("leap", float, PAIRS),  # rad, largest sudden one of the position, fading
        ("peak", float, PAIRS),  # rad/s, fading
        ("spikes", float, (2, PAIRS)),  # of the velocity, fading counts of clear and of small ones
        ("bad", float, (2, PAIRS)),  # s, for which position or velocity is not believed yet
        ("life", int, (2, PAIRS)),  # 0 believed, 1 not, 2 not but its bits change without power
        ("trusted", float, (2, PAIRS)),  # position (rad) and velocity (rad/s) to go on with
        ("orientation", float, 4),  # to go on with, x y z w
        ("acceleration", float, (3, 3)),  # measured, newest first, m/s^2
        ("same_acceleration", int, 3),
        ("acceleration_spikes", float, 3),
        ("carried", float),  # share of late in which the feet carried it
        ("smooth", float, (4, 3)),  # m/s^2, measured smoothed fast and slow, expected likewise
        ("expected", float, (KEPT, 3)),  # ring: m/s^2, what changes within a step
        ("power", float, 3),  # (m/s^2)^2, of that
        ("blow", float),  # s, for which the echo of one may go on
        ("late_acceleration", float, (_DELAYS, 3)),  # s, for which it fitted a delay better
        ("bad_acceleration", float, 3),  # s
        ("bad_torque", float, 10),  # s
        ("rest", float),  # s, for which it has hung or lain still without power
        ("powered", int),  # whether it has power
        ("used", int),  # whether it has had power since the start
        ("moved", int),  # whether, once used, it has moved since the estimate began anew
    ]
)
"""What the monitor remembers."""

LIMITS_TYPE = np.dtype(
    [
        ("period", float),  # s
        ("low", float, PAIRS),  # rad
        ("high", float, PAIRS),
        ("speed", float, PAIRS),  # rad/s
        ("still", float, PAIRS),  # rad/s, below which it counts as still
        ("jump", float, PAIRS),  # rad in one tick
        ("apart", float, PAIRS),  # rad
        ("apart_at_speed", float, PAIRS),  # s
        ("spike", float, PAIRS),  # rad/s
        ("excited", float, PAIRS),  # (rad/s)^2, from which a delay shows
        ("delay_ticks", int, _PAIR_DELAYS),  # at which motions are compared
        ("evidence", float, PAIRS),  # rad^2, enough for one of a pair to be late
        ("response_ticks", int, PAIRS),  # for which a velocity answers a step of the position
        ("response", float, (RESPONSE_TICKS, PAIRS)),  # of the velocity, by steps, newest first
        ("position_lag", int, PAIRS),  # ticks by which the position is later than the velocity
        ("velocity_lag", int, PAIRS),  # and the other way round
        ("acceleration", float),  # m/s^2
        ("acceleration_spike", float),  # m/s^2
        ("weight", float),  # of the robot, N
        ("torque", float, 10),  # of each drive, Nm
        ("late_acceleration", float, (_DELAYS, 3)),  # s, for which it must fit a delay better
        ("hold", float),  # s, that a channel stays unbelieved after it last was wrong
    ]
)
"""What is normal."""


_MARGIN = 0.2  # rad beyond the stops
_MOST_TORQUE = 1.5  # by the drive's limit: with a torque constant that is off it gives less
_JOINT_DELAY = 0.0045  # s, of the joints' velocity filter
_FASTEST = 100.0  # Hz, of the motions by which it is known what a velocity filter answers
_SAMPLED = 0.2  # of the rate of the samples, beyond which they do not show them
_EVEN = 1e3  # weight of an even motion, by one of these
_DRIVE_NOISE, _JOINT_NOISE = 0.2, 2.5  # weights of the encoders' noise
_GAP = 0.02  # s, without an estimate, after which what it was tells nothing
_DRIVE, _JOINT, _IMU = slice(0, 10), slice(10, 16), slice(16, 19)
_TOE_DRIVES, _TOE_JOINTS = (4, 9), (12, 15)


def limits(period: float, attitude_delay: float, hold: float) -> npt.NDArray[np.void]:
    """What is normal, of `LIMITS_TYPE`. Shape (1,).

    Args:
        period: Between samples. In s.
        attitude_delay: Of the IMU's orientation. In s.
        hold: How long a channel stays unbelieved after it last was wrong. In s.
    """
    record = np.zeros(1, LIMITS_TYPE)
    normal = record[0]
    normal["period"], normal["hold"] = period, hold
    normal["low"], normal["high"] = -math.inf, math.inf
    for i, leg in enumerate(LEGS):
        links = {link.name: link for link in robot.leg_links(leg)}
        for first, names in ((5 * i, LEG_DRIVES), (10 + 3 * i, LEG_SENSED_JOINTS)):
            for k, name in enumerate(names):
                low, high = links[name].joint.limits or (-math.inf, math.inf)
                normal["low"][first + k] = low - _MARGIN
                normal["high"][first + k] = high + _MARGIN
    # Speeds that nothing on the robot reaches, and what healthy sensors keep, with a margin.
    normal["speed"] = 50.0
    normal["still"][:16], normal["still"][_IMU] = 1.0, 0.1  # legs may swing while it hangs
    normal["jump"][:] = 0.02
    normal["apart"][_DRIVE] = np.tile([0.004, 0.004, 0.006, 0.008, 0.008], 2)
    normal["apart"][_JOINT], normal["apart"][_IMU] = np.tile([0.008, 0.008, 0.01], 2), 0.005
    normal["apart_at_speed"] = 0.001
    normal["apart_at_speed"][_JOINT] = 0.0045  # also where no filter delays the velocity
    normal["apart_at_speed"][_IMU] = 0.002
    normal["spike"][_DRIVE] = np.tile([0.5, 0.5, 0.6, 1.2, 5.5], 2)
    normal["spike"][_JOINT], normal["spike"][_IMU] = np.tile([0.9, 0.9, 1.5], 2), 0.25
    normal["excited"][:16], normal["excited"][_IMU] = 0.3**2, 0.15**2
    normal["delay_ticks"] = [max(1, min(KEPT_TICKS - 1, round(delay / period))) for delay in DELAYS]
    normal["evidence"][_DRIVE] = np.tile([4e-7, 4e-7, 6e-7, 6e-7, 1.2e-6], 2)
    normal["evidence"][_JOINT], normal["evidence"][_IMU] = np.tile([4e-7, 8e-7, 5e-7], 2), 1e-6
    normal["response"][0], normal["response_ticks"] = 1.0, 1  # a gyro needs no filter
    for part, filters in (
        (_DRIVE, (_DRIVE_NOISE, robot.DRIVE_VELOCITY_FILTER)),
        (_JOINT, (_JOINT_NOISE, *robot.JOINT_VELOCITY_FILTER)),
    ):
        answer = velocity_response(period, *filters)
        normal["response"][: len(answer), part] = answer[:, None]
        normal["response_ticks"][part] = len(answer)
    normal["velocity_lag"][_JOINT] = min(2, round(_JOINT_DELAY / period))
    normal["position_lag"][_IMU] = min(2, round(attitude_delay / period))
    normal["acceleration"], normal["acceleration_spike"] = 300.0, 6.0
    normal["weight"] = robot.WEIGHT
    limits = [robot.DRIVES[name].torque_limit for name in LEG_DRIVES]
    normal["torque"] = _MOST_TORQUE * np.tile(limits, 2)
    normal["late_acceleration"] = (
        (0.0205, 0.0205, 0.0165),
        (0.0275, 0.0225, 0.0175),
        (0.030, 0.0205, 0.0195),
    )
    return record


def velocity_response(
    period: float, noise: float, forward: Sequence[float], back: Sequence[float] = ()
) -> FloatArray:
    """What the steps of a position say that the filtered velocity is.

    Fitted to the filter's answer to all motions up to `_FASTEST`, such as the legs' springs ring
    with; an even motion is expected as it is.

    Args:
        period: Between samples. In s.
        noise: Of the angles, by the size of motions of which any frequency must be expected.
        forward: Filter by positions, newest first. In 1/s.
        back: By velocities, to be taken off.

    Returns:
        Shares of the last steps, newest first, of which the sum is what the newest velocity and the
        one before it say together (trapezoidal rule). Shape (n,).
    """
    ticks = max(1, round(period * robot.ENCODER_RATE))
    samples = max(2, RESPONSE_TICKS // ticks if back else 1 - (-len(forward) // ticks))
    frequency = np.linspace(0.0, min(_FASTEST, _SAMPLED / period), 200)[1:]
    late = np.exp(-2j * math.pi * frequency / robot.ENCODER_RATE)  # by a tick of the encoders
    velocity = sum(b * late**k for k, b in enumerate(forward))
    velocity /= 1.0 + sum(a * late**k for k, a in enumerate(back, 1))
    step = late**ticks  # by a sample
    answer = 0.5 * period * (1.0 + step) * velocity / (1.0 - step)
    shares = step[:, None] ** np.arange(samples)
    moments = -sum(k * b for k, b in enumerate(forward)) / robot.ENCODER_RATE
    even = moments / (1.0 + sum(back))
    between = np.diff(np.eye(samples), axis=0, prepend=0.0, append=0.0)  # two steps, each angle
    rows = [shares.real, shares.imag, np.full((1, samples), _EVEN), noise * between]
    values = [answer.real, answer.imag, [_EVEN * even], np.zeros(samples + 1)]
    fitted: FloatArray = np.linalg.lstsq(np.vstack(rows), np.hstack(values))[0]
    return fitted


class SensorMonitor:
    """Finds channels that fail, and says what to go on with.

    - A value that is no number or that the robot cannot have, such as a torque beyond the drive's
      limit, a position that jumps: at once. Of a torque this is all.
    - A channel whose bits stay the same while its partner moves: stuck, or off.
    - A velocity of one tick off its neighbours' curve, an acceleration off their line: spikes.
    - Position and integrated velocity do not go together: the one that moves now as the other did
      20 to 100 ms ago is late. With other delays they grow apart, and the sign of their difference
      by the velocity tells which of them it is. What the velocity filters of drives and joints
      answer is expected. The IMU's orientation and gyro are such a pair.
    - The accelerometer follows what the legs' forces and drives' torques gave the pelvis 20, 30 or
      40 ms ago, for longer than it follows what they give now: it is late. A push from outside is
      not among these forces; it fits neither. After a blow, which fits no delay at all, the legs
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
        self._watch = np.zeros(1, WATCH_TYPE)
        self._limits = limits(period, attitude_delay, hold)
        self._bad: FloatArray = self._watch[0]["bad"]
        self._bad_acceleration: FloatArray = self._watch[0]["bad_acceleration"]
        self._bad_torque: FloatArray = self._watch[0]["bad_torque"]
        self._trusted: FloatArray = self._watch[0]["trusted"]
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
        self._watch[:] = np.zeros(1, WATCH_TYPE)
        self._trusted[:] = math.nan  # nothing to go on with yet
        self._seq = -1
        self.mask = self.lost = 0
        self.rested = False

    def _start_over(self) -> None:
        """Samples are missing: compare from this one on; what is not believed stays so."""
        watch = self._watch[0]
        beliefs = ("bad", "bad_acceleration", "bad_torque", "trusted", "orientation")
        kept = (*beliefs, "life", "rest", "used", "moved")
        values = [watch[name].copy() for name in kept]
        self._watch[:] = np.zeros(1, WATCH_TYPE)
        for name, value in zip(kept, values, strict=True):
            watch[name] = value

    def step(
        self,
        sensors: Sensors,
        rotation: FloatArray,
        expected: FloatArray,
        force: float,
    ) -> Sensors:
        """The sample to go on with: the same, or one in which bad channels are replaced.

        Args:
            sensors: One sample.
            rotation: Pelvis to world, last known. Shape (3, 3).
            expected: Acceleration of the last sample as forces have it. Shape (3,), in m/s^2.
            force: Of both feet at the last sample. In N.
        """
        seq = int(sensors.seq)
        if seq != self._seq + 1:
            self._start_over()
        self._seq = seq
        found = inspect(sensors.record, self._watch, self._limits, expected, force)
        if found & RESTED:
            self.rested = True
        if found & BELIEVED:
            self.mask = self.lost = 0
            return sensors
        return self._repair(sensors, rotation)

    def _repair(self, sensors: Sensors, rotation: FloatArray) -> Sensors:
        result, (position, velocity) = self._repaired, self._trusted
        bad_position, bad_velocity = self._bad > 0.0
        bad_acceleration, bad_torque = self._bad_acceleration > 0.0, self._bad_torque > 0.0
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
        result.drive_position[:], result.drive_velocity[:] = position[_DRIVE], velocity[_DRIVE]
        result.joint_position[:], result.joint_velocity[:] = position[_JOINT], velocity[_JOINT]
        result.angular_velocity[:] = velocity[_IMU]
        result.orientation[:] = self._watch[0]["orientation"]
        gravity = robot.GRAVITY * rotation[2]
        result.linear_acceleration[bad_acceleration] = gravity[bad_acceleration]
        result.drive_torque[bad_torque] = 0.0
        return result


def _mask(position: BoolArray, velocity: BoolArray, acceleration: BoolArray) -> int:
    flags = np.concatenate(
        [
            position[16:17],
            velocity[_IMU],
            acceleration,
            position[_DRIVE],
            velocity[_DRIVE],
            position[_JOINT],
            velocity[_JOINT],
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
        self._expected, self._force = np.zeros(3), 0.0
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
        self._expected[:], self._force = 0.0, 0.0
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
        sample = monitor.step(sensors, core.rotation, self._expected, self._force)
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
        expect_acceleration(sample.drive_torque, state.foot_force, core.feet, self._expected)
        left, right = state.foot_force.tolist()
        self._force = left + right
        state.sensor_faults[...] = monitor.mask
        return state
