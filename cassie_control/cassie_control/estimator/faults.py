"""Which sensors can be believed: each channel is held against another that must agree with it.

A position and a velocity that belong together are a pair: ten drives, six joints, three axes of the
IMU's orientation with those of its gyro. `SensorMonitor` has the reasoning.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator import acceleration, channels, hypotheses
from cassie_control.estimator.acceleration import expect_acceleration, look_at_acceleration
from cassie_control.estimator.base import LegEstimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.hypotheses import (
    IMU,
    KEPT,
    PAIRS,
    RESPONSE_TICKS,
    WAIT_TICKS,
    P,
    V,
    look_at_pair,
)
from cassie_control.estimator.noise import encoder_error, residual_gain, velocity_response
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES, LEG_SENSED_JOINTS, LEGS
from cassie_msgs.layout import RobotState, Sensors

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]
BoolArray = npt.NDArray[np.bool_]

REST_TIME = 1.0
"""At rest without power, after which all is learned anew. In s."""

_FOLLOW_TIME = 0.004  # s, over which differences of a position are smoothed to a velocity
_WRONG_SPEED, _WRONG_ANGLE = 0.5, 0.02  # rad/s, rad, from the replacement
_FROZEN_TICKS = 15  # with the same bits, after which a position must be that much nearer
_FROZEN_ANGLE = 0.002  # rad
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
            watch.velocities[:, i] = v if math.isfinite(v) else 0.0
            if watch.bad[P, i] == 0.0 and math.isfinite(p):
                watch.trusted[P, i] = p
            if watch.bad[V, i] == 0.0 and math.isfinite(v):
                watch.trusted[V, i] = v
        watch.acceleration[1:] = watch.acceleration[0]
    for i in range(PAIRS):
        look_at_pair(watch, limit, i)
    turned = max(watch.bad[P, IMU], watch.bad[P, IMU + 1], watch.bad[P, IMU + 2])
    for i in range(IMU, PAIRS):
        watch.bad[P, i] = turned
    for i in range(PAIRS):
        _go_on(watch, limit, i)
    _turn(watch, limit, turned > 0.0)
    look_at_acceleration(watch, limit, expected, force)
    watch.ticks += 1


@compiled
def _go_on(watch: Any, limit: Any, i: int) -> None:
    """Replace what is bad: a position by the integrated velocity, a velocity by differences."""
    dt = limit.period
    if watch.bad[P, i] > 0.0 and watch.bad[V, i] > 0.0:
        # Without a position to go on from, a velocity alone is of no use.
        watch.bad[V, i] = max(watch.bad[P, i], watch.bad[V, i])
    bad_p, bad_v = watch.bad[P, i] > 0.0, watch.bad[V, i] > 0.0
    for kind in range(2):
        _look_for_life(watch, i, kind)
    if bad_v:
        follow = 1.0 - math.exp(-dt / _FOLLOW_TIME)
        rate = watch.steps[0, i] / dt
        if not bad_p:
            last = watch.trusted[V, i] if math.isfinite(watch.trusted[V, i]) else rate
            watch.trusted[V, i] = last + follow * (rate - last)
        wrong = abs(watch.velocity[i] - watch.trusted[V, i]) >= _WRONG_SPEED
        _hold(watch, limit, i, V, wrong)
    else:
        watch.trusted[V, i] = watch.velocity[i]
    if bad_p:
        near = _WRONG_ANGLE if watch.same[P, i] < _FROZEN_TICKS else _FROZEN_ANGLE
        watch.trusted[P, i] += dt * watch.trusted[V, i] if bad_v else watch.turn[i]
        wrong = abs(watch.position[i] - watch.trusted[P, i]) >= near  # not where that is NaN
        _hold(watch, limit, i, P, wrong)
    else:
        watch.trusted[P, i] = watch.position[i]


@compiled
def _look_for_life(watch: Any, i: int, kind: int) -> None:
    """Note whether an unbelieved channel changes while a robot without power is moved."""
    if watch.bad[kind, i] > 0.0:
        if watch.life[kind, i] == 0:
            watch.life[kind, i] = 1
        elif watch.same[kind, i] == 0 and watch.powered == 0:
            watch.life[kind, i] = 2
    elif watch.life[kind, i] > 0:
        watch.life[kind, i] = 0
        watch.moved = watch.used  # the estimate begins anew with it


@compiled
def _hold(watch: Any, limit: Any, i: int, kind: int, wrong: bool) -> None:
    """Keep a channel unbelieved while it differs from its replacement.

    After a fall the replacement may be far off, for good. So at rest without power a channel that
    is alive counts as right unless something else speaks against it.
    """
    if watch.rest > 0.0 and watch.life[kind, i] == 2:
        watch.bad[kind, i] = min(watch.bad[kind, i], REST_TIME)
    elif wrong:
        watch.bad[kind, i] = limit.hold


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


_DELAYS, _PAIR_DELAYS = len(acceleration.DELAYS), len(hypotheses.DELAYS)

WATCH_TYPE = np.dtype(
    [
        ("ticks", int),  # since the start
        ("position", float, PAIRS),  # measured, rad; the IMU's: its turn since the start
        ("velocity", float, PAIRS),  # measured, rad/s
        ("last_position", float, PAIRS),
        ("last_orientation", float, 4),
        ("steps", float, (RESPONSE_TICKS, PAIRS)),  # changes of position, newest first, rad
        ("velocities", float, (WAIT_TICKS + 2, PAIRS)),  # newest first, rad/s
        ("same", int, (2, PAIRS)),  # ticks for which position and velocity had the same bits
        ("said", float, (2, PAIRS, KEPT)),  # ring: turns by position and by velocity, rad
        ("rough", float, (2, PAIRS)),  # rad, of their latest sudden change, fading
        ("turn", float, PAIRS),  # rad, by the velocity, newest
        ("residual", float, (WAIT_TICKS + 1, PAIRS)),  # newest first, rad
        ("apart", float, PAIRS),  # rad, of position from integrated velocity, fading
        ("missed", float, (3, 2, PAIRS)),  # rad, rad^2, nats: while the bits were the same
        ("spikes", float, (2, PAIRS)),  # nats, for spikes
        ("evidence", float, (2, PAIRS, _PAIR_DELAYS - 1)),  # nats, for each delay
        ("late", float, (2, PAIRS)),  # nats, the most of that
        ("bad", float, (2, PAIRS)),  # s, for which position or velocity is not believed yet
        ("life", int, (2, PAIRS)),  # 0 believed, 1 not, 2 not but its bits change without power
        ("trusted", float, (2, PAIRS)),  # position (rad) and velocity (rad/s) to go on with
        ("orientation", float, 4),  # to go on with, x y z w
        ("acceleration", float, (3, 3)),  # measured, newest first, m/s^2
        ("same_acceleration", int, 3),
        ("acceleration_spikes", float, 3),  # how many, fading
        ("carried", float),  # share of late in which the feet carried it
        ("smooth", float, (4, 3)),  # m/s^2, measured smoothed fast and slow, expected likewise
        ("expected", float, (KEPT, 3)),  # ring: m/s^2, what changes within a step
        ("power", float, 3),  # (m/s^2)^2, of that
        ("blow", float),  # s, for which the echo of one may go on
        ("late_acceleration", float, (_DELAYS, 3)),  # s, for which it fits a delay better
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
        ("response_ticks", int, PAIRS),  # for which a velocity answers a step of the position
        ("response", float, (RESPONSE_TICKS, PAIRS)),  # of the velocity, by steps, newest first
        ("position_lag", int, PAIRS),  # ticks by which the position is later than the velocity
        ("wait_ticks", int, PAIRS),  # until both have shown what they will of a sudden change
        ("kept_ticks", int, PAIRS),  # for which steps are needed
        ("noise", float, PAIRS),  # rad, of the residual
        ("tilt", float),  # rad, of the IMU's orientation, at most
        ("uneven", float, (2, PAIRS)),  # rad, noise of a sample against its neighbours
        ("delay_ticks", int, _PAIR_DELAYS),  # at which motions are compared
        ("enough", float),  # nats, of evidence
        ("acceleration", float),  # m/s^2
        ("acceleration_spike", float),  # m/s^2
        ("late_acceleration", float, (_DELAYS, 3)),  # s, for which it must fit a delay better
        ("weight", float),  # of the robot, N
        ("torque", float, 10),  # of each drive, Nm
        ("hold", float),  # s, that a channel stays unbelieved after it last was wrong
    ]
)
"""What is normal."""


_MARGIN = 0.2  # rad beyond the stops
_MOST_TORQUE = 1.5  # by the drive's limit: with a torque constant that is off it gives less
_FASTEST = 50.0  # rad/s, that nothing on the robot reaches
_HARDEST = 300.0  # m/s^2, likewise
_SPIKE = 6.0  # m/s^2, of the accelerometer off its neighbours' line
_LATE = (  # s, for which it must fit each delay better, ahead, aside and upwards
    (0.0205, 0.0205, 0.0165),
    (0.0275, 0.0225, 0.0175),
    (0.030, 0.0205, 0.0195),
)
_STILL_JOINT, _STILL_PELVIS = 1.0, 0.1  # rad/s; legs may swing while it hangs
_JOINT_NOISE = 2e-4  # rad, of the encoders of shin and tarsus
_DRIVE_DELAY, _JOINT_DELAY = 0.0005, 0.0045  # s, of the filters of velocities
_DRIVE_MOTION, _JOINT_MOTION = 0.2, 2.5  # weights of the encoders' noise by that of motions
_VIBRATION = 0.05  # rad/s, of what rattles too fast for the samples
_TOE_VIBRATION = 0.3  # rad/s, likewise, of the toes' drives when the foot lands
_TILT = 0.015  # rad, of the IMU's orientation: three standard deviations
_TILT_NOISE, _TILT_TIME = 0.00175, 10.0  # rad, s: error of the IMU's orientation, and its memory
_GYRO_NOISE = 0.005  # rad/s, with what its axes are off
_YAW = IMU + 2
_GAP = 0.02  # s, without an estimate, after which what it was tells nothing
_DRIVE, _JOINT, _IMU = slice(0, 10), slice(10, 16), slice(16, 19)
_TOE_DRIVES, _TOE_JOINTS = (4, 9), (12, 15)


def limits(
    period: float, attitude_delay: float, hold: float, false_alarms: float
) -> npt.NDArray[np.void]:
    """What is normal, of `LIMITS_TYPE`. Shape (1,).

    Args:
        period: Between samples. In s.
        attitude_delay: Of the IMU's orientation. In s.
        hold: How long a channel stays unbelieved after it last was wrong. In s.
        false_alarms: How many the noise of healthy sensors may raise. In 1/h.
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
    normal["speed"], normal["acceleration"] = _FASTEST, _HARDEST
    normal["still"], normal["still"][_IMU] = _STILL_JOINT, _STILL_PELVIS
    normal["acceleration_spike"], normal["late_acceleration"] = _SPIKE, _LATE
    normal["weight"] = robot.WEIGHT
    torques = [robot.DRIVES[name].torque_limit for name in LEG_DRIVES]
    normal["torque"] = _MOST_TORQUE * np.tile(torques, 2)
    longest = KEPT - WAIT_TICKS - 1
    ticks = [max(1, min(longest, round(delay / period))) for delay in hypotheses.DELAYS]
    normal["delay_ticks"] = ticks
    tests = 2 * PAIRS * (len(ticks) + 1)
    normal["enough"] = math.log(tests * 3600.0 / period / false_alarms)
    drives = [robot.DRIVES[name] for name in LEG_DRIVES]
    errors = [encoder_error(drive.encoder_bits, drive.gear) for drive in drives]
    _expect_pairs(normal, _DRIVE, np.tile(errors, 2), _DRIVE_DELAY, _DRIVE_MOTION)
    bits = robot.JOINT_ENCODER_BITS
    errors = [encoder_error(bits[name], noise=_JOINT_NOISE) for name in LEG_SENSED_JOINTS]
    _expect_pairs(normal, _JOINT, np.tile(errors, 2), _JOINT_DELAY, _JOINT_MOTION)
    _expect_imu(normal, attitude_delay)
    normal["kept_ticks"] = np.maximum(normal["response_ticks"], normal["wait_ticks"] + 2)
    return record


def _expect_pairs(
    normal: Any, part: slice, errors: FloatArray, delay: float, motion: float
) -> None:
    """Answer and noise of encoders and the filters of their velocities.

    Args:
        normal: Result, of `LIMITS_TYPE`.
        part: Pairs.
        errors: Of their encoders. Shape (n,), in rad.
        delay: Of the filter. In s.
        motion: Weight of the encoder's noise by that of motions, see `velocity_response`.
    """
    period = float(normal["period"])
    filters: tuple[Any, ...] = (robot.DRIVE_VELOCITY_FILTER,)
    if part is _JOINT:
        filters = robot.JOINT_VELOCITY_FILTER
    answer = velocity_response(period, motion, *filters)
    normal["response"][: len(answer), part] = answer[:, None]
    normal["response_ticks"][part] = len(answer)
    normal["wait_ticks"][part] = 1 + math.ceil(delay / period)
    white = residual_gain(period, answer, *filters)
    normal["noise"][part] = np.hypot(white * errors, period * _VIBRATION)
    rattling = np.full(len(errors), period * _VIBRATION)
    if part is _DRIVE:
        rattling[list(_TOE_DRIVES)] = period * _TOE_VIBRATION
    normal["uneven"][P, part] = np.hypot(math.sqrt(6.0) * errors, rattling)  # p - 2 p + p
    normal["uneven"][V, part] = np.hypot(2.0 * white * errors, rattling)


def _expect_imu(normal: Any, attitude_delay: float) -> None:
    """Noise of orientation and gyro, which agree up to a tick of the encoders."""
    period = float(normal["period"])
    normal["response"][0, _IMU], normal["response_ticks"][_IMU] = 1.0, 1
    lag = min(WAIT_TICKS - 1, round(attitude_delay / period))
    normal["position_lag"][_IMU], normal["wait_ticks"][_IMU] = lag, lag + 1
    normal["noise"][_IMU] = _TILT_NOISE * math.sqrt(2.0 * period / _TILT_TIME)
    normal["noise"][_YAW] = period * _GYRO_NOISE  # the heading's error does not wander
    normal["tilt"] = _TILT
    normal["uneven"][:, _IMU] = 2.0 * normal["noise"][_IMU]


class SensorMonitor:
    """Finds channels that fail, and says what to go on with.

    - A value that is no number or that the robot cannot have, such as a torque beyond the drive's
      limit or a position that moves at more than 50 rad/s: at once. Of a torque this is all.
    - Of a position and its velocity the residual is the turn by the velocity, less what the
      velocity's filter must answer to the positions (`noise`). That one of the two is stuck, has
      spikes or is late has as evidence its likelihood ratio to both being healthy (`hypotheses`).
      The IMU's orientation and gyro are such pairs.
    - The accelerometer has no partner: what the legs' forces and drives' torques give the pelvis is
      held against it (`acceleration`). A push from outside is not among these forces; it fits no
      delay. After a blow the legs give way late: for a while nothing speaks for a delay. In the
      gantry nothing is compared.

    A channel is named when its likeliest hypothesis has enough evidence: the logarithm of tests per
    hour by false alarms per hour. Its partner's must have less by half of that.

    A position goes on as the integral of its velocity, a velocity as the difference of its
    position, the orientation with the gyro and the gyro with the orientation, the accelerometer
    with gravity alone, a torque that the drive cannot give as 0. Where both of a pair fail there is
    nothing to go on with, except for the toes, which have two encoders each.

    A violent fall can make good sensors contradict each other, and what a channel is replaced by
    drifts off meanwhile. So once the robot has hung or lain still without power for `REST_TIME`, a
    channel is believed again that has changed its bits since the power went off and that nothing
    else speaks against: all but dead ones, which seem to be right at rest.

    Args:
        period: Between samples. In s.
        attitude_delay: Of the IMU's orientation. In s.
        hold: How long a channel stays unbelieved after it last was wrong. In s.
        false_alarms: How many the noise of healthy sensors may raise. In 1/h.
    """

    def __init__(
        self, period: float, attitude_delay: float, hold: float, false_alarms: float
    ) -> None:
        self._watch = np.zeros(1, WATCH_TYPE)
        self._limits = limits(period, attitude_delay, hold, false_alarms)
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
            period,
            core.config.filter.attitude_delay,
            core.config.distrust_time,
            core.config.false_alarms,
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
