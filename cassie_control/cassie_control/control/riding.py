"""Riding a Segway: the operator, or Cassie itself, leans to go, to stop and to turn.

`Level` estimates the vertical on a vehicle that accelerates, `MovingBalance` holds the CoM on
ground that may accelerate, and `RidingController` leans.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_control.config import SegwayConfig, StandConfig
from cassie_control.control.balance import Balance, fades_in
from cassie_control.control.robot import Readings
from cassie_control.control.standing import StandingController
from cassie_gaits.robot import GRAVITY, SOLE_RADIUS, WEIGHT
from cassie_msgs.layout import Mode, MotorCommand, RobotState

_CALM = 0.1  # m/s^2


class Level:
    """Roll and pitch from the gyro, corrected by the estimate with a long time constant.

    The estimator assumes that standing feet are at rest. On a vehicle with the acceleration a its
    vertical tilts towards that of a pendulum, by up to a / g. The gyro is not affected, and drifts
    by some milliradians in a minute. With w the torso's angular velocity and t the estimated angle:

        pitch' = w_y cos(roll) - w_z sin(roll)                      - (pitch - t) / T,
        roll'  = w_x + tan(pitch) (w_y sin(roll) + w_z cos(roll))   - (roll - t) / T,
        T      = time (1 + |a|^2 / (0.1 m/s^2)^2).

    The estimated velocity is wrong, too: it includes the vehicle's acceleration. So the CoM's
    velocity relative to the feet is computed by the difference of its positions.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._state = RobotState()
        self.start(self._state)

    def start(self, state: RobotState) -> None:
        """Begin with the estimated angles."""
        self._pitch, self._roll = state.q[4:6].tolist()
        self._com: list[float] | None = None

    def corrected(
        self, state: RobotState, time: float, acceleration: Sequence[float]
    ) -> RobotState:
        """State with the corrected vertical and the CoM's velocity relative to the feet; reused.

        Args:
            state: The state estimate.
            time: Time constant of the correction by the estimate. In s.
            acceleration: Acceleration of the ground, forward and to the left. In m/s^2.
        """
        pitch, roll = state.q[4:6].tolist()
        wx, wy, wz = state.angular_velocity.tolist()
        cos, sin = math.cos(self._roll), math.sin(self._roll)
        share = self._period / (time * (1.0 + (math.hypot(*acceleration) / _CALM) ** 2))
        pitch_rate = wy * cos - wz * sin
        roll_rate = wx + math.tan(self._pitch) * (wy * sin + wz * cos)
        self._pitch += self._period * pitch_rate + share * (pitch - self._pitch)
        self._roll += self._period * roll_rate + share * (roll - self._roll)
        self._state.copy_from(state)
        self._state.q[4], self._state.q[5] = self._pitch, self._roll
        self._state.v[4], self._state.v[5] = pitch_rate, roll_rate
        com = self._state.com_position
        com[0] += (self._pitch - pitch) * com[2]
        com[1] -= (self._roll - roll) * com[2]
        now = com.tolist()
        if self._com is not None:
            for k in (0, 1):
                self._state.com_velocity[k] = (now[k] - self._com[k]) / self._period
        self._com = now
        return self._state


_SLOW = 2.0  # m/s, largest speed of the usual gains; 1 m/s faster those for fast bumps hold
_FASTEST = 2.5  # m/s^2, saturation of the ground's estimated acceleration
_SAFE = 0.35  # capture point over reach at which the torso may bend: sooner than on fixed ground


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

    When the platform rolls on uneven ground, the steering bar presses against the robot's knees.
    The Segway then turns by itself, and the robot is thrown to a side until one foot carries it.
    Hips that yield, as in standing, let the torso swing from side to side until a foot slips. So
    from 2 to 3 m/s the gains become those for fast riding: stiff hips, and a smaller weight shift
    by sideways velocity (`fast_kd_com_y`).

    Attributes:
        acceleration: Acceleration of the ground, forward and to the left. In m/s^2.
        gained: Change of the ground's forward speed in the last tick, without low-pass. In m/s.
        speed: Forward speed of the ground, as estimated by `RollingFilter`. In m/s.
        riding: Gains of riding.

    Args:
        riding: Gains of riding.
        stand: Gains of standing, for all other fields.
        period: Control period. In s.
    """

    def __init__(self, riding: SegwayConfig, stand: StandConfig, period: float) -> None:
        super().__init__(riding.standing(stand), period)
        self.riding = riding
        self._forget()

    def configure(self, riding: SegwayConfig, stand: StandConfig) -> None:
        """Use new gains at once."""
        self.riding, self.config = riding, riding.standing(stand)

    @property
    def lean_length(self) -> float:
        """Leg length difference by the desired roll. In m/rad."""
        return self.riding.lean_length

    def _forget(self) -> None:
        self.acceleration = [0.0, 0.0]
        self.speed = self.gained = 0.0
        self._mean = [0.0, 0.0]
        self._slow = list(self._velocity)

    def start(self, readings: Readings) -> None:
        """Begin on ground at rest."""
        super().start(readings)
        self._forget()

    def rest(self, readings: Readings) -> tuple[float, float]:
        """Equilibrium of the CoM, ahead and to the left of the centre of pressure. In m."""
        per_acceleration = max(0.3, readings.com_from_feet[2]) / GRAVITY
        ahead, left = self.acceleration
        return per_acceleration * ahead, per_acceleration * left

    def step(
        self,
        readings: Readings,
        mode: Mode,
        com_y: float,
        ground: Sequence[float],
        leans: bool = False,
    ) -> None:
        """Compute the attributes for one tick; arguments as in `Balance.step`."""
        per_acceleration = max(0.3, readings.com_from_feet[2]) / GRAVITY
        self._rest = self.rest(readings)
        before = self._velocity[0]
        super().step(readings, mode, com_y, ground, leans)
        self._observe(readings, min(ground), per_acceleration)
        self.gained -= self._velocity[0] - before

    def _observe(self, readings: Readings, both: float, per_acceleration: float) -> None:
        share = self._period / self.riding.moving_time
        for k, pressed in enumerate((self.pressed, self._carried(readings))):
            away = readings.com_from_feet[k] - pressed
            falling = both * away / per_acceleration
            if k == 0:
                self.gained = self._period * falling
            self._mean[k] += share * (falling - self._mean[k])
            self._slow[k] += share * (self._velocity[k] - self._slow[k])
            rise = (self._velocity[k] - self._slow[k]) / self.riding.moving_time
            self.acceleration[k] = max(-_FASTEST, min(_FASTEST, self._mean[k] - rise))

    def _com_velocity(self, readings: Readings) -> tuple[float, float]:
        return readings.com_velocity[0], readings.com_velocity[1]

    def _with_speed(self, slow: float, fast: float) -> float:
        share = max(0.0, min(1.0, abs(self.speed) - _SLOW))
        return slow + share * (fast - slow)

    def _damping_y(self, settled: float) -> float:
        return self._with_speed(super()._damping_y(settled), self.riding.fast_kd_com_y)

    def _roll_give(self) -> float:
        return self._with_speed(self.riding.roll_give, 1.0)

    def _bends(self, k: int, reach: float) -> float:
        # Sideways the torso bends at once: the foot bars are narrow.
        return fades_in(abs(self.capture[k]) / reach, _SAFE) if k == 0 else 1.0

    def _learn(self, readings: Readings, acceleration: Sequence[float]) -> None:
        return

    def _settle(self, readings: Readings, ground: Sequence[float]) -> float:
        """Settled at once: a platform always moves, and its gains do not depend on settling."""
        self.settled = 1.0
        return self.settled


class RollingFilter:
    """Kalman filter of the vehicle's speed, which no sensor measures.

    With a the acceleration found from the feet, c the CoM from the feet, w the turn rate, a_y the
    acceleration to the left, f the rolling resistance, and s = v / sqrt(v^2 + `_ROLLS`^2) the
    direction of rolling:

        v' = a + b,   b' = 0,   n' = 0,

        a + b = k (c - n - f s)      where it rolls and c is near c*; k = 3/4 g / h, as c, held on a
                                     Segway, is 4 times as far from n as the pressure is,
        a_y   = w (v + u)            with u the bar's push, known to a factor of two,
        v     = vx                   if an operator leans it and vx has been the same for long,
        v     = 0                    if it shall stand, and the estimate is slow.

    Attributes:
        speed: v, forward. In m/s.
        error: b, correction of the acceleration a. In m/s^2.
        neutral: n, CoM x at which the vehicle at rest does not accelerate. In m.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.start()

    def start(self) -> None:
        """Begin at rest."""
        self.speed = self.error = self.neutral = 0.0
        self._vv, self._bb, self._nn = _START
        self._vb = self._vn = self._bn = 0.0

    def predict(self, gained: float) -> None:
        """Predict over one tick, by the change of speed `gained` (m/s) found from the feet."""
        dt = self._period
        self.speed += gained + dt * self.error
        self._vv += dt * (2.0 * self._vb + dt * self._bb + _WALK[0])
        self._vb += dt * self._bb
        self._vn += dt * self._bn
        self._bb += dt * _WALK[1]
        self._nn += dt * _WALK[2]

    def roll(self, acceleration: float, com_x: float, height: float) -> None:
        """Correct by the vehicle's acceleration (m/s^2) at a CoM x from the feet and height (m)."""
        k = 0.75 * GRAVITY / height
        square = self.speed**2
        if square == 0.0:
            return
        expected = k * (com_x - _ROLLING * self.way)
        self._take(0.0, 1.0, k, expected - acceleration, _LEAN * (1.0 + _ROLLS**2 / square))

    def turn(self, rate: float, acceleration: float) -> None:
        """Correct by the acceleration to the left (m/s^2) at a turn rate (rad/s)."""
        spread = _ASIDE_NOISE + (_BAR * rate) ** 2
        self._take(rate, 0.0, 0.0, acceleration - _BAR * rate, spread)

    def see(self, speed: float, spread: float) -> None:
        """Correct by a speed (m/s) whose white noise has the density `spread` ((m/s)^2 s)."""
        self._take(1.0, 0.0, 0.0, speed, spread)

    @property
    def way(self) -> float:
        """Direction of rolling, smooth in the speed, -1..1."""
        return self.speed / math.hypot(self.speed, _ROLLS)

    def _take(self, v: float, b: float, n: float, value: float, spread: float) -> None:
        """Correct by v speed + b error + n neutral = value, with the noise density `spread`."""
        gv = self._vv * v + self._vb * b + self._vn * n
        gb = self._vb * v + self._bb * b + self._bn * n
        gn = self._vn * v + self._bn * b + self._nn * n
        share = 1.0 / (gv * v + gb * b + gn * n + spread / self._period)
        off = share * (value - v * self.speed - b * self.error - n * self.neutral)
        self.speed += gv * off
        self.error += gb * off
        self.neutral += gn * off
        self._vv -= share * gv * gv
        self._vb -= share * gv * gb
        self._vn -= share * gv * gn
        self._bb -= share * gb * gb
        self._bn -= share * gb * gn
        self._nn -= share * gn * gn


Interval = tuple[float, float]
"""Least and greatest value."""

# Noise of the filter, from rides of robots 1 to 10; DECISIONS.md lists other attempts.
_START = (0.02**2, 0.005**2, 0.02**2)  # (m/s)^2, (m/s^2)^2, m^2: initial variances of v, b, n
_WALK = (0.02**2, 0.003**2, 0.0005**2)  # random walk per second of v, b, n; b follows the vertical
_LEAN = 0.15**2  # (m/s^2)^2 s: a differs from k (c - n) by 0.15 m/s^2, for half a second
_NEAR = 0.01  # m, distance of the CoM from its set-point beyond which the lean is transient
_ROLLS = 0.2  # m/s, speed from which there is rolling resistance
_ROLLING = 0.001  # m, f: CoM x that overcomes rolling resistance, besides the part in n
_ASIDE_NOISE = 0.1**2  # (m/s^2)^2 s, noise density of the acceleration to a side
_BAR = 0.4  # m/s, u: speed by which the bar's push makes a turn look faster
_SEEN = 0.1**2  # (m/s)^2 s: with `_WALK`, a correction by such a speed takes 5 s
_REST, _RESTS = 0.4, 0.1**2  # m/s, speed up to which it may be at rest; (m/s)^2 s, noise density

_ANYWHERE: Interval = (-math.inf, math.inf)
_GOES = 0.3  # m/s^2, acceleration along a lean at which `press_more` is added in full
_BACKING, _ASIDE = 0.8, 0.25  # m/s backward; ratio of the sideways lean that is left there
_LIFT_TIME = 0.3  # s, time constant of the share of the weight that the feet do not carry
_LIFTED = (0.05, 0.15)  # of that share: a lean is reduced above the first, 0 above the second
_NARROW = 0.8  # m of sideways lean less per m that the feet are closer than `press_distance`
_LEAST = 0.03  # m, lean back or to a side that is always permitted
_STEADY = 5.0  # s of constant commanded speed, after which the vehicle has this speed
_OFF = 0.3  # rad, saturation of the heading error


class RidingController:
    """Standing in a crouch on a vehicle that may move.

    The body is held as in standing, with gains of its own and with `MovingBalance`. In addition:

        c_x* = com_x,  c_y* = com_y               while the operator leans (com_x or com_y not 0),
        c_x* = n + f s + kp_speed (vx - v)         otherwise: Cassie holds vx by its own estimate,
        c_y* = kp_yaw_rate (w - r)                 and brakes if vx is 0. It keeps the heading,
        w    = yaw_rate + heading_gain e           which turns by yaw_rate,

    with e the heading's error, r the yaw rate and n, v, f s of `RollingFilter`. For vx = 0 f s is
    left out, so that rolling resistance stops the Segway. c_x* keeps the centre of pressure,
    c_x* - h a / g, within `press_limit`.

    Attributes:
        rolling: Filter of the vehicle's speed.

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
        self._stand = StandingController(stand, period, self._balance)
        self._mode = Mode()
        self._level = Level(period)
        self.rolling = RollingFilter(period)
        self._readings = Readings()
        self._forget()

    def _forget(self) -> None:
        self._said = self._since = 0.0
        self._turn = self._lifted = 0.0
        self.rolling.start()
        self._heading = math.nan
        self._com_error = (0.0, 0.0)

    @property
    def config(self) -> SegwayConfig:
        """Gains of riding."""
        return self._balance.riding

    def configure(self, config: SegwayConfig, stand: StandConfig) -> None:
        """Use new gains at once."""
        self._balance.configure(config, stand)

    @property
    def speed(self) -> float:
        """Estimated forward speed. In m/s."""
        return self.rolling.speed

    @property
    def lean(self) -> tuple[float, float]:
        """Set-point of the CoM after all bounds, forward and to the left of the feet. In m."""
        return float(self._mode.com_x), float(self._mode.com_y)

    def start(self, readings: Readings, com_error: tuple[float, float] = (0.0, 0.0)) -> None:
        """Begin at rest, from the present pose.

        Args:
            readings: The robot now.
            com_error: Offset of the CoM from the estimate, found while standing. In m.
        """
        self._stand.start(readings)
        self._level.start(readings.state)
        self._forget()
        self._com_error = com_error

    def step(self, readings: Readings, mode: Mode, command: MotorCommand) -> None:
        """Fill in the set-points.

        Args:
            readings: The robot now.
            mode: Set-points for vx, yaw_rate, height, CoM shift, roll and pitch.
            command: Result.
        """
        state = self._level.corrected(
            readings.state, self.config.level_time, self._balance.acceleration
        )
        readings = self._readings
        readings.update(state, self._com_error)
        readings.height = height_above_soles(readings)
        held = float(mode.com_x) == 0.0 == float(mode.com_y)
        self._know(readings, mode, held)
        wanted = self._mode
        wanted.copy_from(mode)
        if held:
            self._hold(readings, mode, wanted)
        else:
            self._heading = math.nan
        (back, ahead), (right, left) = self._bounds(readings, held)
        share = self._carried(readings)
        wanted.com_x[...] = share * max(back, min(ahead, float(wanted.com_x)))
        wanted.com_y[...] = share * max(right, min(left, float(wanted.com_y)))
        self._stand.step(readings, wanted, command, 0.0)

    def _know(self, readings: Readings, mode: Mode, held: bool) -> None:
        """Update the filter of the vehicle's speed; `held`: see `_bounds`."""
        rolling, balance, vx = self.rolling, self._balance, float(mode.vx)
        rolling.predict(balance.gained)
        # Low-passed like the acceleration.
        self._turn += self._period / self.config.moving_time * (readings.yaw_rate - self._turn)
        rolling.turn(self._turn, balance.acceleration[1])
        com_x, _, height = readings.com_from_feet
        if self._lifted < _LIFTED[0] and abs(com_x - float(self._mode.com_x)) < _NEAR:
            rolling.roll(balance.acceleration[0], com_x, max(0.3, height))
        self._since = self._since + self._period if vx == self._said else 0.0
        self._said = vx
        if held:
            if vx == 0.0 and abs(rolling.speed) < _REST:
                rolling.see(0.0, _RESTS)
        elif vx != 0.0 and self._since >= _STEADY:
            rolling.see(vx, _SEEN)
        balance.speed = rolling.speed

    def _hold(self, readings: Readings, mode: Mode, wanted: Mode) -> None:
        """Set the lean in `wanted` that keeps the commanded speed and yaw rate."""
        c, rolling = self.config, self.rolling
        vx, yaw_rate = float(mode.vx), float(mode.yaw_rate)
        resists = _ROLLING * rolling.way if vx != 0.0 else 0.0
        wanted.com_x[...] = rolling.neutral + resists + c.kp_speed * (vx - rolling.speed)
        if vx == 0.0 == yaw_rate:
            self._heading = math.nan
            return
        turn = yaw_rate + c.heading_gain * self._off_heading(readings.yaw, yaw_rate)
        wanted.com_y[...] = c.kp_yaw_rate * (turn - readings.yaw_rate)

    def _off_heading(self, yaw: float, yaw_rate: float) -> float:
        """Saturated heading error, positive to the left; all in rad and rad/s."""
        if math.isnan(self._heading):
            self._heading = yaw
        off = math.remainder(self._heading + self._period * yaw_rate - yaw, 2.0 * math.pi)
        off = max(-_OFF, min(_OFF, off))
        self._heading = yaw + off
        return off

    def _bounds(self, readings: Readings, held: bool) -> tuple[Interval, Interval]:
        """Bounds of the CoM's set-point; of bounds that contradict each other the later one counts.

        - Speed: no lean of the operator increases a speed that is too high for the motors.
        - Pressure: the feet can hold it for long. Ground that accelerates with a lean is a vehicle,
          and needs a larger pressure. Feet that are close together permit less to a side.
        - Backward: a lean to a side makes the robot fall off while it rolls backward.
        - Corner: far back and to a side the outer shin touches the pad of the bar. The bar carries
          the robot instead of the foot, which slips; when the bar comes free the robot falls.

        Args:
            readings: The robot now.
            held: Whether the robot holds the speed itself, as the operator commands no lean.

        Returns:
            Least and greatest com_x, least and greatest com_y. In m.
        """
        c, balance = self.config, self._balance
        speed, (rest_x, rest_y) = balance.speed, balance.rest(readings)
        x = y = _ANYWHERE
        if not held:
            highest = self.rolling.neutral + c.kp_speed * (c.top_speed - speed)
            lowest = self.rolling.neutral + c.kp_speed * (-c.back_speed - speed)
            x = (min(0.0, lowest), max(0.0, highest))
        along = balance.acceleration[0] / _GOES
        ahead = c.press_limit + c.press_more * max(0.0, min(1.0, along))
        back = c.press_limit + c.press_more * max(0.0, min(1.0, -along))
        x = _cut(x, rest_x - back, rest_x + ahead)
        if speed < 0.0:
            backward = min(1.0, -speed / _BACKING)
            aside = c.press_limit_y * (1.0 - backward * (1.0 - _ASIDE))
            y = (-aside, aside)
        apart = readings.legs[0].foot[1] - readings.legs[1].foot[1]
        aside = max(_LEAST, c.press_limit_y - _NARROW * max(0.0, c.press_distance - apart))
        y = _cut(y, rest_y - aside, rest_y + aside)
        com_x, com_y, _ = readings.com_from_feet
        aside = max(_LEAST, c.corner - max(0.0, -com_x))
        x = _cut(x, -max(_LEAST, c.corner - abs(com_y)), math.inf)
        return x, _cut(y, -aside, aside)

    def _carried(self, readings: Readings) -> float:
        """Factor on a lean while more than the feet carries the robot, 0..1.

        With a shin on the bar's pad the centre of pressure shows neither the ground's acceleration
        nor the speed, and the foot below that shin slips.
        """
        feet = float(readings.legs[0].force) + float(readings.legs[1].force)
        self._lifted += self._period / _LIFT_TIME * (1.0 - feet / WEIGHT - self._lifted)
        least, most = _LIFTED
        return 1.0 - max(0.0, min(1.0, (self._lifted - least) / (most - least)))


def _cut(bounds: Interval, least: float, greatest: float) -> Interval:
    """Bounds of a value that is kept within `bounds` first, and then within two others."""
    low, high = bounds
    return max(least, min(greatest, low)), max(least, min(greatest, high))


def height_above_soles(readings: Readings) -> float:
    """Pelvis height from the legs alone, as the estimate may drift on a vehicle. In m."""
    weights = [leg.contact + 0.01 for leg in readings.legs]
    below = sum(weight * leg.foot[2] for weight, leg in zip(weights, readings.legs, strict=True))
    return SOLE_RADIUS - below / sum(weights)
