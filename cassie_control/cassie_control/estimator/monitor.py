"""Which sensors can be believed: each channel is held against another that must agree with it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator import channels
from cassie_control.estimator.acceleration_kernels import expect_acceleration
from cassie_control.estimator.base import LegEstimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.delay_kernels import DELAYS, KEPT_TICKS, RESPONSE_TICKS
from cassie_control.estimator.monitor_kernels import BELIEVED, RESTED, inspect
from cassie_control.estimator.monitor_records import LIMITS_TYPE, WATCH_TYPE
from cassie_gaits import robot
from cassie_gaits.names import LEG_DRIVES, LEG_SENSED_JOINTS, LEGS
from cassie_msgs.layout import RobotState, Sensors

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

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
    normal["weight"] = robot.total_mass() * 9.81
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
    drifts off meanwhile. So once the robot has hung or lain still without power for `REST_TIME`, a
    channel is believed again that has changed its bits since the power went off and that nothing
    else speaks against: all but dead ones, which seem to be right at rest.

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
        gravity = 9.81 * rotation[2]
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
