"""Riding a Segway: the operator, or Cassie itself, leans to go, to stop and to turn.

`MovingBalance` holds the CoM on ground that may accelerate, and `RidingController` leans.
`vehicle` estimates the vertical and the vehicle's speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from cassie_control.config import SegwayConfig, StandConfig
from cassie_control.control.balance import MIN_COM_HEIGHT, Balance, bending_ramp
from cassie_control.control.compliance import compliance
from cassie_control.control.robot import HIP_DOWN, TOE_JOINT_HEIGHT, Readings
from cassie_control.control.standing import StandingController
from cassie_control.control.vehicle import VehicleSpeedFilter, VerticalFilter
from cassie_gaits.robot import GRAVITY, SOLE_RADIUS, WEIGHT
from cassie_msgs.layout import Mode, MotorCommand

_SLOW_SPEED = 2.0  # m/s, largest speed of the usual gains; 1 m/s faster those for fast bumps hold
_MAX_ACCELERATION = 2.5  # m/s^2, saturation of the ground's estimated acceleration
_DOUBT = 2.0  # standard deviations by which the estimated speed may be off
_BENDING_FROM = 0.35  # ratio of capture point to reach: sooner than on fixed ground


class MovingBalance(Balance):
    """The balance law with compensation of the ground's acceleration.

    With c the CoM from the feet, v its velocity relative to the feet, p the centre of pressure and
    h the CoM's height, the ground's acceleration is

        a = g (c - p) / h - dv/dt,   low-passed with the time constant `moving_time`,

    which is 0 on fixed ground. On ground that accelerates, c rests ahead of p by h a / g, so

        p = c - h a / g + (kp (c - c*) + kd v) / W.

    A Segway's acceleration follows the centre of pressure on its platform, W p / (r M). There this
    law holds c at c* with the same stiffness as on fixed ground, without a model of the vehicle.
    Feedback of c alone would be 4 times as stiff. The error of c is that found while standing
    before: on moving ground it cannot be distinguished from an acceleration.

    From 2 to 3 m/s the law becomes that for fast riding: stiff hips, a smaller weight shift by
    sideways velocity (`fast_kd_com_y`), and legs that take the load off no foot to regulate the
    roll. Both feet then stay loaded while the platform rolls and the steering bar presses against
    the robot's knees.

    Attributes:
        acceleration: Acceleration of the ground, forward and to the left. In m/s^2.
        speed_change: Change of the ground's forward speed in the last tick, without low-pass. In
            m/s.
        vehicle: Estimate of the vehicle's speed.
        riding: Gains of riding.

    Args:
        riding: Gains of riding.
        stand: Gains of standing, for all other fields.
        period: Control period. In s.
    """

    def __init__(self, riding: SegwayConfig, stand: StandConfig, period: float) -> None:
        super().__init__(riding.standing(stand), period)
        self.riding = riding
        self.vehicle = VehicleSpeedFilter(period)
        self._reset()

    def configure(self, riding: SegwayConfig, stand: StandConfig) -> None:
        """Use new gains at once."""
        self.riding, self.config = riding, riding.standing(stand)

    @property
    def lean_length(self) -> float:
        """Leg length difference by the desired roll. In m/rad."""
        return self.riding.lean_length

    def bounded_difference(self, readings: Readings, difference: float) -> float:
        """Leg length difference that takes the load off no foot when bumps come fast.

        With d the difference, d0 that of the legs as they stand, springs bent, and C their
        `compliance`, the left foot is to carry the share

            left_share - (d - d0) / (2 W C)

        of the weight W, which is kept within 0..1. Below `_SLOW_SPEED` d is not bounded: a leg that
        pushes by more than the weight for a moment helps in turns and after pushes.

        Args:
            readings: The robot now.
            difference: Desired difference, right less left. In m.
        """
        (_, left_y, left_z), (_, right_y, right_z) = (leg.toe_joint for leg in readings.legs)
        present = left_z - right_z - readings.roll * (left_y - right_y)
        length = readings.height - HIP_DOWN - TOE_JOINT_HEIGHT
        share, per_share = self.left_share, 2.0 * WEIGHT * compliance(length)
        low, high = present - (1.0 - share) * per_share, present + share * per_share
        return self._by_speed(difference, max(low, min(high, difference)))

    def _reset(self) -> None:
        self.acceleration = [0.0, 0.0]
        self.speed_change = 0.0
        self._mean_acceleration = [0.0, 0.0]
        self._slow_velocity = list(self._velocity)

    def start(self, readings: Readings) -> None:
        """Begin on ground at rest."""
        super().start(readings)
        self._reset()
        self.vehicle.start(self.riding.axle_x, max(MIN_COM_HEIGHT, readings.com_from_feet[2]))

    def equilibrium(self, readings: Readings) -> tuple[float, float]:
        """Equilibrium of the CoM, ahead and to the left of the centre of pressure. In m."""
        per_acceleration = _equilibrium_per_acceleration(readings)
        ahead, left = self.acceleration
        return per_acceleration * ahead, per_acceleration * left

    def step(
        self,
        readings: Readings,
        mode: Mode,
        com_y: float,
        contact: Sequence[float],
        leans: bool = False,
    ) -> None:
        """Compute the attributes for one tick; arguments as in `Balance.step`."""
        per_acceleration = _equilibrium_per_acceleration(readings)
        self._equilibrium = self.equilibrium(readings)
        before = self._velocity[0]
        super().step(readings, mode, com_y, contact, leans)
        self._update_acceleration(readings, min(contact), per_acceleration)
        self.speed_change -= self._velocity[0] - before

    def _update_acceleration(
        self, readings: Readings, both: float, per_acceleration: float
    ) -> None:
        """Update `acceleration` and the pendulum's part of `speed_change`."""
        time_constant = self.riding.moving_time
        weight = self._period / time_constant
        for k, cop in enumerate((self.cop_x, self._measured_cop_y(readings))):
            com_from_cop = readings.com_from_feet[k] - cop
            pendulum = both * com_from_cop / per_acceleration
            if k == 0:
                self.speed_change = self._period * pendulum
            mean, slow = self._mean_acceleration, self._slow_velocity
            mean[k] += weight * (pendulum - mean[k])
            slow[k] += weight * (self._velocity[k] - slow[k])
            com_acceleration = (self._velocity[k] - slow[k]) / time_constant
            acceleration = mean[k] - com_acceleration
            self.acceleration[k] = max(-_MAX_ACCELERATION, min(_MAX_ACCELERATION, acceleration))

    def _com_velocity(self, readings: Readings) -> tuple[float, float]:
        return readings.com_velocity[0], readings.com_velocity[1]

    def _by_speed(self, slow: float, fast: float) -> float:
        """Value at the present speed, from those of slow and of fast riding."""
        weight = max(0.0, min(1.0, abs(self.vehicle.speed) - _SLOW_SPEED))
        return slow + weight * (fast - slow)

    def _damping_y(self) -> float:
        return self._by_speed(super()._damping_y(), self.riding.fast_kd_com_y)

    def _min_roll_regulation(self) -> float:
        return self._by_speed(self.riding.roll_give, 1.0)

    def _bending_weight(self, axis: int, reach: float) -> float:
        # Sideways the torso bends at once: the foot bars are narrow.
        if axis == 1:
            return 1.0
        return bending_ramp(abs(self.capture_point[axis]) / reach, _BENDING_FROM)

    def _update_com_error(self, readings: Readings, acceleration: Sequence[float]) -> None:
        return

    def _update_settled(self, readings: Readings, contact: Sequence[float]) -> None:
        """Settled at once: a platform always moves, and its gains do not depend on settling."""
        self.settled = 1.0


def _equilibrium_per_acceleration(readings: Readings) -> float:
    """Distance of the CoM from the centre of pressure over the ground's acceleration. In s^2."""
    return max(MIN_COM_HEIGHT, readings.com_from_feet[2]) / GRAVITY


_STEADY_LEAN = 0.01  # m, distance of the CoM from its set-point beyond which a lean is transient
_CONSTANT_VX_TIME = 5.0  # s of constant commanded speed, after which the vehicle has this speed
_REST_SPEED = 0.4  # m/s, speed up to which the vehicle may be at rest
_FULL_PRESSURE_ACCELERATION = 0.3  # m/s^2 along a lean, at which `press_more` is added in full
_FULL_BACKWARD_SPEED = 0.8  # m/s backward, at which the sideways limit is the least
_BACKWARD_LIMIT_RATIO = 0.25  # of the sideways limit there to `press_limit_y`
_LIMIT_PER_WIDTH = 0.8  # m of sideways limit less per m that feet are closer than `press_distance`
_MIN_LEAN = 0.03  # m, lean back or to a side that is always permitted
_UNLOADED_TIME = 0.3  # s, low-pass of the share of the weight that the feet do not carry
_UNLOADED_RAMP = (0.05, 0.15)  # of that share: a lean is reduced above the first, 0 at the second
_MAX_HEADING_ERROR = 0.3  # rad, saturation of the heading error


class Interval(NamedTuple):
    """Range of a value."""

    low: float
    high: float

    def clamp(self, value: float) -> float:
        """The nearest value in the range."""
        return max(self.low, min(self.high, value))

    def within(self, low: float, high: float) -> Interval:
        """Range of a value that is kept within this range first, and then in low .. high."""
        return Interval(max(low, min(high, self.low)), max(low, min(high, self.high)))


_ANY = Interval(-math.inf, math.inf)


class RidingController:
    """Standing in a crouch on a vehicle that may move.

    The body is held as in standing, with gains of its own and with `MovingBalance`. In addition:

        c_x* = com_x,  c_y* = com_y            while the operator leans (com_x or com_y not 0),
        c_x* = n + f s + kp_speed (vx - v)     otherwise: the robot holds vx by its own estimate,
        c_y* = kp_yaw_rate (yaw_rate + heading_gain e - r)    and keeps the heading,

    with e the error of the heading, which turns by yaw_rate, r the yaw rate and n, v, f s of
    `VehicleSpeedFilter`. For vx = 0 f s is left out, so that rolling resistance stops the Segway;
    c_y* is 0 while vx and yaw_rate are 0. c_x* keeps the centre of pressure, c_x* - h a / g, within
    `press_limit`. All laws read a state whose vertical is that of `VerticalFilter`, and whose CoM
    moves relative to the feet.

    Attributes:
        vehicle: Filter of the vehicle's speed.

    Args:
        config: Gains of riding.
        stand: Gains of standing, for all other fields.
        period: Control period. In s.

    Source:
        Section "Riding a Segway": speed by CoM x, direction by CoM y against the bar, gains of the
        feet turned down.
    """

    def __init__(self, config: SegwayConfig, stand: StandConfig, period: float) -> None:
        self._period = period
        self._balance = MovingBalance(config, stand, period)
        self._standing = StandingController(self._balance, period)
        self._set_points = Mode()
        self._vertical = VerticalFilter(period)
        self.vehicle = self._balance.vehicle
        self._readings = Readings()
        self._reset()

    def _reset(self) -> None:
        self._last_vx = self._constant_vx_time = 0.0
        self._yaw_rate = self._unloaded_share = 0.0
        self._heading = math.nan
        self._com_error = (0.0, 0.0)

    @property
    def config(self) -> SegwayConfig:
        """Gains of riding."""
        return self._balance.riding

    def configure(self, config: SegwayConfig, stand: StandConfig) -> None:
        """Use new gains at once."""
        self._balance.configure(config, stand)

    def start(self, readings: Readings, com_error: tuple[float, float] = (0.0, 0.0)) -> None:
        """Begin at rest, from the present pose.

        Args:
            readings: The robot now.
            com_error: Offset of the CoM from the estimate, found while standing. In m.
        """
        self._standing.start(readings)
        self._vertical.start(readings.state)
        self._reset()
        self._com_error = com_error

    def step(self, readings: Readings, mode: Mode, command: MotorCommand) -> None:
        """Fill in the set-points.

        Args:
            readings: The robot now.
            mode: Set-points for vx, yaw_rate, height, CoM shift, roll and pitch.
            command: Result.
        """
        state = self._vertical.corrected(
            readings.state, self.config.level_time, self._balance.acceleration
        )
        readings = self._readings
        readings.update(state, self._com_error)
        readings.height = height_above_soles(readings)
        holds_speed = float(mode.com_x) == 0.0 == float(mode.com_y)
        self._update_vehicle(readings, mode, holds_speed)
        set_points = self._set_points
        set_points.copy_from(mode)
        if holds_speed:
            self._lean_for_speed(readings, mode, set_points)
        else:
            self._heading = math.nan
        ahead, left = self._balance.equilibrium(readings)
        com_x = self._com_x_range(readings, holds_speed, ahead).clamp(float(set_points.com_x))
        com_y = self._com_y_range(readings, left).clamp(float(set_points.com_y))
        weight = self._lean_weight(readings)
        set_points.com_x[...] = weight * com_x
        set_points.com_y[...] = weight * com_y
        self._standing.step(readings, set_points, command, 0.0)

    def _update_vehicle(self, readings: Readings, mode: Mode, holds_speed: bool) -> None:
        """Update the filter of the vehicle's speed."""
        vehicle, balance, vx = self.vehicle, self._balance, float(mode.vx)
        vehicle.predict(balance.speed_change)
        # Low-passed like the acceleration.
        weight = self._period / self.config.moving_time
        self._yaw_rate += weight * (readings.yaw_rate - self._yaw_rate)
        vehicle.correct_by_turn(self._yaw_rate, balance.acceleration[1])
        com_x, _, height = readings.com_from_feet
        near_set_point = abs(com_x - float(self._set_points.com_x)) < _STEADY_LEAN
        if self._unloaded_share < _UNLOADED_RAMP[0] and near_set_point:
            height = max(MIN_COM_HEIGHT, height)
            vehicle.correct_by_lean(balance.acceleration[0], com_x, height)
        constant = vx == self._last_vx
        self._constant_vx_time = self._constant_vx_time + self._period if constant else 0.0
        self._last_vx = vx
        if holds_speed:
            if vx == 0.0 and abs(vehicle.speed) < _REST_SPEED:
                vehicle.correct_by_speed(0.0)
        elif vx != 0.0 and self._constant_vx_time >= _CONSTANT_VX_TIME:
            vehicle.correct_by_speed(vx)

    def _lean_for_speed(self, readings: Readings, mode: Mode, set_points: Mode) -> None:
        """Set the lean in `set_points` that keeps the commanded speed and yaw rate."""
        c, vehicle = self.config, self.vehicle
        vx, yaw_rate = float(mode.vx), float(mode.yaw_rate)
        resistance = vehicle.resistance if vx != 0.0 else 0.0
        feedback = c.kp_speed * (vx - vehicle.speed)
        set_points.com_x[...] = vehicle.neutral + resistance + feedback
        if vx == 0.0 == yaw_rate:
            self._heading = math.nan
            return
        turn = yaw_rate + c.heading_gain * self._heading_error(readings.yaw, yaw_rate)
        set_points.com_y[...] = c.kp_yaw_rate * (turn - readings.yaw_rate)

    def _heading_error(self, yaw: float, yaw_rate: float) -> float:
        """Saturated heading error, positive to the left; all in rad and rad/s."""
        if math.isnan(self._heading):
            self._heading = yaw
        error = math.remainder(self._heading + self._period * yaw_rate - yaw, 2.0 * math.pi)
        error = max(-_MAX_HEADING_ERROR, min(_MAX_HEADING_ERROR, error))
        self._heading = yaw + error
        return error

    def _com_x_range(self, readings: Readings, holds_speed: bool, equilibrium: float) -> Interval:
        """Range of the CoM's set-point, forward; of ranges that contradict, the later one counts.

        - Speed: no lean of the operator increases a speed that is too high for the motors.
        - Pressure: the feet can hold it for long. Ground that accelerates with a lean is a vehicle,
          and needs a larger pressure.
        - Corner: far back and to a side the outer shin touches the pad of the bar. The bar carries
          the robot instead of the foot, which slips; when the bar comes free the robot falls.

        Args:
            readings: The robot now.
            holds_speed: Whether the robot holds its speed, instead of a lean of the operator.
            equilibrium: Equilibrium of the CoM, ahead of the centre of pressure. In m.
        """
        c = self.config
        com_x = _ANY if holds_speed else self._speed_range()
        forward = self._balance.acceleration[0] / _FULL_PRESSURE_ACCELERATION
        ahead = c.press_limit + c.press_more * max(0.0, min(1.0, forward))
        back = c.press_limit + c.press_more * max(0.0, min(1.0, -forward))
        com_x = com_x.within(equilibrium - back, equilibrium + ahead)
        corner = max(_MIN_LEAN, c.corner - abs(readings.com_from_feet[1]))
        return com_x.within(-corner, math.inf)

    def _com_y_range(self, readings: Readings, equilibrium: float) -> Interval:
        """Range of the CoM's set-point, to the left; of ranges that contradict, the later counts.

        - Backward: a lean to a side makes the robot fall off while it rolls backward.
        - Pressure: as forward. Feet that are close together permit less to a side.
        - Corner: as forward.

        Args:
            readings: The robot now.
            equilibrium: Equilibrium of the CoM, to the left of the centre of pressure. In m.
        """
        c, speed, com_y = self.config, self.vehicle.speed, _ANY
        if speed < 0.0:
            backward = min(1.0, -speed / _FULL_BACKWARD_SPEED)
            limit = c.press_limit_y * (1.0 - backward * (1.0 - _BACKWARD_LIMIT_RATIO))
            com_y = Interval(-limit, limit)
        width = readings.legs[0].foot[1] - readings.legs[1].foot[1]
        narrow = max(0.0, c.press_distance - width)
        limit = max(_MIN_LEAN, c.press_limit_y - _LIMIT_PER_WIDTH * narrow)
        com_y = com_y.within(equilibrium - limit, equilibrium + limit)
        corner = max(_MIN_LEAN, c.corner - max(0.0, -readings.com_from_feet[0]))
        return com_y.within(-corner, corner)

    def _speed_range(self) -> Interval:
        """Range of com_x in which an operator's lean does not increase a speed too high.

        The speed counts as far as it is certain: who sees that it rolls forward may brake. The
        range has the neutral lean, which keeps the speed.
        """
        c, speed, doubt = self.config, self.vehicle.speed, _DOUBT * self.vehicle.deviation
        faster = max(0.0, c.top_speed - (speed - doubt))
        slower = max(0.0, c.back_speed + (speed + doubt))
        neutral = self.vehicle.neutral
        return Interval(neutral - c.kp_speed * slower, neutral + c.kp_speed * faster)

    def _lean_weight(self, readings: Readings) -> float:
        """Factor on a lean while more than the feet carries the robot, 0..1.

        With a shin on the bar's pad the centre of pressure shows neither the ground's acceleration
        nor the speed, and the foot below that shin slips.
        """
        force = float(readings.legs[0].force) + float(readings.legs[1].force)
        unloaded = 1.0 - force / WEIGHT
        weight = self._period / _UNLOADED_TIME
        self._unloaded_share += weight * (unloaded - self._unloaded_share)
        low, high = _UNLOADED_RAMP
        return 1.0 - max(0.0, min(1.0, (self._unloaded_share - low) / (high - low)))


def height_above_soles(readings: Readings) -> float:
    """Pelvis height from the legs alone, as the estimate may drift on a vehicle. In m."""
    weights = [leg.contact + 0.01 for leg in readings.legs]
    below = sum(weight * leg.foot[2] for weight, leg in zip(weights, readings.legs, strict=True))
    return SOLE_RADIUS - below / sum(weights)
