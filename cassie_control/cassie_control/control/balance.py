"""Balance while standing: the centre of pressure that keeps the CoM at its set-point."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_control.config import StandConfig
from cassie_control.control.robot import SOLE_HALF_LENGTH, Readings
from cassie_gaits.robot import GRAVITY, WEIGHT
from cassie_msgs.layout import Mode

BOTH_FEET = 0.7
"""Contact probability of the less loaded foot above which both feet carry the robot."""

MIN_COM_HEIGHT = 0.3
"""Least height of the CoM above the feet as the length of a pendulum. In m."""


def pendulum_time(height: float) -> float:
    """Time constant of the CoM at a height (m) above the feet, as a pendulum. In s."""
    return math.sqrt(max(MIN_COM_HEIGHT, height) / GRAVITY)


HANGING_CONTACT = 0.3
"""Contact probability of the more loaded foot below which the robot hangs."""

STANDING_CONTACT = 0.9
"""Contact probability of the less loaded foot above which the robot has landed on both feet."""

_SOLE_REACH = SOLE_HALF_LENGTH - 0.001  # m, largest centre of pressure from the middle of the sole
_SETTLE_SPEED = 0.1  # m/s, speed of the pelvis up to which the robot settles
_UNSETTLE_TIME = 0.2  # s, in which gains return to those before settling
_RISE_SETTLED = 0.9  # threshold of `Balance.settled` for a rise
_RISE_VELOCITY = 0.016  # m of the capture point by its velocity: more than the robot's own motions
_MAX_TICKS_BETWEEN = 1.5  # periods between estimates from which their difference is no rate
_STANDING_BENDING_FROM = 0.75  # ratio of capture point to reach: at 0.35 robots with a load fell
_BENDING_SPAN = 0.15  # further ratio at which bending is full
_MAX_COM_ERROR = 0.08  # m, saturation of the CoM's error: 8 kg, 0.05 m ahead, shift it by 0.04 m
_MAX_INNOVATION = 0.02  # m, saturation of the CoM's innovation, so that a push has little effect
_INITIAL_BIAS_TIME = 0.7  # s, of the CoM's error before settling; Segways stop worse at 0.5, 1 s
_MAX_SIDE_FORCE = 0.5  # of the sideways force over the weight: less than a dry floor's friction
_MIN_FOOT_DISTANCE = 0.1  # m, least distance sideways for which the loads are computed


class Balance:
    """The centre of pressure from the CoM, and a hip strategy where the feet do not suffice.

    With c the CoM from the middle of the feet that carry, c* its set-point, v its velocity and W
    the weight:

        p        = c + (kp (c - c*) + kd v) / W, saturated at the edges of each sole and both feet,
        residual = p before saturation - p,
        bending  = bend_gain W residual, up to `bend_torque`.

    - CoM: at rest it is above the centre of pressure, whatever the error of the IMU's tilt and
      whatever the robot carries. So the feet's forces correct the estimate, with the time constant
      `bias_time`. A robot that has just been set down may fall before that. A pendulum's equation
      corrects sooner:

          c = p + (1 - settled) h / g c'',   with 0.7 s at first.

      `Readings` adds the correction to every CoM, for all laws.
    - The ground's force points from p towards the CoM, so that it turns the torso by no more than
      the torso's regulation commands.
    - Residual: the torso bends towards the fall, which pushes the CoM back (hip strategy), and is
      held upright the less, the larger that torque is. The torso does not bend while the capture
      point is well inside: to straighten up again costs what bending has gained.
    - Gains that react to a push at once, and the bending fore and aft, increase as the robot
      settles. Ground contact bounces at first, and with late commands these would excite that.

    Attributes:
        cop_x: Centre of pressure of each foot, ahead of the middle of its sole. In m.
        left_share: Share of the weight on the left foot, 0..1.
        force_ratio: Horizontal over vertical ground force, forward and to the left.
        bending_torque: Torque that bends the torso forward. In Nm.
        torso_regulation: Factor on the torso's regulation, pitch and roll, 0..1.
        settled: How far the robot has settled on its feet, 0..1.
        capture_point: Capture point, forward from the middle of the feet that carry, to the left
            from the middle of both. In m.
        rise_helps: Whether a push moves the capture point forward to the toes, so that a rise
            helps.
        outside_support: Distance of the capture point outside the support, forward and sideways. In
            m.
        com_error: Offset of the CoM from the estimate, forward and to the left, in m. A start keeps
            it: a payload is still there.

    Args:
        config: Gains.
        period: Control period. In s.

    Source:
        Capture point and its feedback to the centre of pressure: Englsberger et al., IROS 2011.
    """

    def __init__(self, config: StandConfig, period: float) -> None:
        self.config = config
        self._period = period
        self.com_error = (0.0, 0.0)
        self._velocity = [0.0, 0.0]
        self.cop_x = self.settled = 0.0
        self._equilibrium = (0.0, 0.0)
        self._last_time, self._last_com = -math.inf, (0.0, 0.0)
        self.left_share = 0.5
        self.force_ratio = (0.0, 0.0)
        self.bending_torque = 0.0
        self.torso_regulation = (1.0, 1.0)
        self.capture_point = self.outside_support = (0.0, 0.0)
        self.rise_helps = False

    @property
    def lean_length(self) -> float:
        """Leg length difference by the desired roll. In m/rad."""
        return 0.0

    def bounded_difference(self, readings: Readings, difference: float) -> float:
        """Leg length difference, right less left, that regulates the roll; here unbounded. In m."""
        return difference

    def start(self, readings: Readings) -> None:
        """Begin with the robot's present velocity."""
        self._velocity = list(readings.com_velocity[:2])
        self.cop_x = self.settled = 0.0
        self.capture_point = self.outside_support = (0.0, 0.0)
        self.rise_helps = False

    def step(
        self,
        readings: Readings,
        mode: Mode,
        com_y: float,
        contact: Sequence[float],
        leans: bool = False,
    ) -> None:
        """Compute the attributes for one tick.

        Args:
            readings: The robot now.
            mode: Set-points for CoM x, pitch and roll.
            com_y: Set-point of the CoM, to the left of the feet's midpoint. In m.
            contact: Contact of each foot, 0..1.
            leans: Whether the robot leans onto one foot; it then unsettles, and `com_error` stays.
        """
        both = min(contact)
        if leans:
            self.settled = max(0.0, self.settled - self._period / _UNSETTLE_TIME)
        self._update_settled(readings, contact)
        self._update_velocity(readings, learns=both > BOTH_FEET and not leans)
        # The robot stands on the foot that carries it, wherever a lifted foot swings.
        x = readings.com[0] - self._support_x(readings, contact)
        y = readings.com_from_feet[1]
        height = max(MIN_COM_HEIGHT, readings.com_from_feet[2])
        width = readings.legs[0].foot[1] - readings.legs[1].foot[1]
        width = max(_MIN_FOOT_DISTANCE, width)
        self._update_capture_point(x, y, pendulum_time(height), 0.5 * width)
        residual_x = self._update_cop_x(x - float(mode.com_x), x)
        residual_y = self._update_left_share(y - com_y, y, width)
        cop_y = (self.left_share - 0.5) * width
        bending_y, roll_regulation = self._bending(residual_y, readings.roll - float(mode.roll))
        ratio_y = (y - cop_y - bending_y / WEIGHT) / height
        self.force_ratio = (
            both * (x - self.cop_x) / height,
            max(-_MAX_SIDE_FORCE, min(_MAX_SIDE_FORCE, ratio_y)),
        )
        self.bending_torque, pitch_regulation = self._bending(
            residual_x, float(mode.pitch) - readings.pitch
        )
        self.torso_regulation = (
            pitch_regulation,
            max(self._min_roll_regulation(), roll_regulation),
        )

    def _update_settled(self, readings: Readings, contact: Sequence[float]) -> None:
        """Update `settled`, 0..1, as gains that react to a push would shake a landing."""
        if max(contact) < HANGING_CONTACT:
            self.settled = 0.0
        elif min(contact) > STANDING_CONTACT and max(map(abs, readings.velocity)) < _SETTLE_SPEED:
            self.settled = min(1.0, self.settled + self._period / self.config.settle_time)

    def _by_settling(self, before: float, after: float) -> float:
        """A gain now, from those before and after settling."""
        return before + self.settled * (after - before)

    def _update_velocity(self, readings: Readings, *, learns: bool) -> None:
        """Low-pass the CoM's velocity; `learns`: also correct `com_error`."""
        c = self.config
        bandwidth = self._by_settling(c.velocity_bandwidth, c.settled_bandwidth)
        weight = 1.0 - math.exp(-self._period * bandwidth)
        before = tuple(self._velocity)
        for k, speed in enumerate(self._com_velocity(readings)):
            self._velocity[k] += weight * (speed - self._velocity[k])
        if learns:
            acceleration = [(self._velocity[k] - before[k]) / self._period for k in (0, 1)]
            self._update_com_error(readings, acceleration)

    def _com_velocity(self, readings: Readings) -> tuple[float, float]:
        """CoM velocity, forward and to the left; after settling from joint positions. In m/s.

        The rates of the shins lag those of the knees by 4 ms. In the 42 Hz mode of knees and leaf
        springs the two nearly cancel. So the estimate by rates is 3 times too large there, and with
        late commands toe torques from it would excite the mode.
        """
        elapsed, before = readings.time - self._last_time, self._last_com
        # Without its error, as a correction of the CoM is no motion.
        (x, y, _), (error_x, error_y) = readings.com, self.com_error
        com = (x - error_x, y - error_y)
        self._last_time, self._last_com = readings.time, com
        estimated = readings.com_velocity
        if not 0.0 < elapsed < _MAX_TICKS_BETWEEN * self._period:
            return estimated[0], estimated[1]
        vx, vy = (
            self._by_settling(estimated[k], readings.velocity[k] + (com[k] - before[k]) / elapsed)
            for k in (0, 1)
        )
        return vx, vy

    def _update_com_error(self, readings: Readings, acceleration: Sequence[float]) -> None:
        """Correct `com_error` by the centre of pressure and the CoM's `acceleration` (m/s^2)."""
        time_constant = self._by_settling(_INITIAL_BIAS_TIME, self.config.bias_time)
        weight = self._period / time_constant
        # Time constant of the pendulum, squared; 0 once settled.
        time_squared = (1.0 - self.settled) * readings.com_from_feet[2] / GRAVITY
        cop = (self.cop_x, self._measured_cop_y(readings))

        def updated(k: int) -> float:
            innovation = cop[k] + time_squared * acceleration[k] - readings.com_from_feet[k]
            innovation = max(-_MAX_INNOVATION, min(_MAX_INNOVATION, innovation))
            error = self.com_error[k] + weight * innovation
            return max(-_MAX_COM_ERROR, min(_MAX_COM_ERROR, error))

        self.com_error = (updated(0), updated(1))

    @staticmethod
    def _measured_cop_y(readings: Readings) -> float:
        """Measured centre of pressure, to the left of the feet's midpoint. In m."""
        left, right = readings.legs
        middle = 0.5 * (left.foot[1] + right.foot[1])
        force = max(1.0, left.force + right.force)
        return (left.force * left.foot[1] + right.force * right.foot[1]) / force - middle

    @staticmethod
    def _support_x(readings: Readings, contact: Sequence[float]) -> float:
        """Middle of the feet that carry the robot, ahead of the pelvis origin. In m."""
        left, right = (leg.foot[0] for leg in readings.legs)
        total = contact[0] + contact[1]
        if total < 0.1:
            return 0.5 * (left + right)
        return (contact[0] * left + contact[1] * right) / total

    def _update_capture_point(self, x: float, y: float, time: float, half_width: float) -> None:
        """Compute `capture_point`, `outside_support` and `rise_helps`.

        Args:
            x, y: Position of the CoM. In m.
            time: Time constant of the pendulum, sqrt(height / g). In s.
            half_width: Half of the sideways distance of the feet. In m.
        """
        dx, dy = (time * v for v in self._velocity)
        self.capture_point = (x + dx, y + dy)
        self.outside_support = (
            max(0.0, abs(x + dx) - _SOLE_REACH),
            max(0.0, abs(y + dy) - half_width),
        )
        edge = _SOLE_REACH - self.config.rise_margin
        forward = dx > max(_RISE_VELOCITY, 2.0 * abs(dy))
        self.rise_helps = self.settled > _RISE_SETTLED and forward and x + dx > edge

    def _update_cop_x(self, error: float, x: float) -> float:
        """Set `cop_x`; returns the residual of its saturation that may bend the torso, in m."""
        c = self.config
        kd = self._by_settling(c.kd_com_x, c.settled_kd_com_x)
        cop = x - self._equilibrium[0] + (c.kp_com_x * error + kd * self._velocity[0]) / WEIGHT
        self.cop_x = max(-_SOLE_REACH, min(_SOLE_REACH, cop))
        return self.settled * self._bending_weight(0, _SOLE_REACH) * (cop - self.cop_x)

    def _update_left_share(self, error: float, y: float, width: float) -> float:
        """Set `left_share`; returns the sideways residual that may bend the torso, in m."""
        c = self.config
        damping = self._damping_y() * self._velocity[1]
        cop = y - self._equilibrium[1] + (c.kp_com_y * error + damping) / WEIGHT
        self.left_share = max(0.0, min(1.0, 0.5 + cop / width))
        residual = cop - (self.left_share - 0.5) * width
        return self._bending_weight(1, 0.5 * width) * residual

    def _damping_y(self) -> float:
        """Sideways force by CoM y velocity. In Ns/m."""
        return self._by_settling(self.config.kd_com_y, self.config.settled_kd_com_y)

    def _min_roll_regulation(self) -> float:
        """Least factor on the hip roll stiffness, 0..1."""
        return 0.0

    def _bending_weight(self, axis: int, reach: float) -> float:
        """Share of the residual by which the torso bends, 0..1; `reach` of the feet in m.

        It is 0 as long as the capture point is safely inside, where the feet suffice.
        """
        return bending_ramp(abs(self.capture_point[axis]) / reach, _STANDING_BENDING_FROM)

    def _bending(self, residual: float, angle_error: float) -> tuple[float, float]:
        """Torque that bends the torso, in Nm, and the factor on its regulation meanwhile, 0..1.

        Args:
            residual: Residual of the centre of pressure's saturation. In m.
            angle_error: How far the torso is bent; its sign differs from the residual's when the
                torso is bent as the torque bends it. In rad.
        """
        c = self.config
        torque = max(-c.bend_torque, min(c.bend_torque, c.bend_gain * WEIGHT * residual))
        regulation = 1.0 - abs(torque) / c.bend_torque if torque else 1.0
        if angle_error * residual < 0.0:
            torque *= max(0.0, 1.0 - abs(angle_error) / c.bend_limit)
        return torque, regulation


def bending_ramp(ratio: float, start: float) -> float:
    """Factor of the torso's bending, 0..1, at a ratio of capture point to reach; 0 to `start`."""
    return max(0.0, min(1.0, (ratio - start) / _BENDING_SPAN))
