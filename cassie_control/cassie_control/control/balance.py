"""Balance while standing: the centre of pressure that keeps the CoM at its set-point."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_control.config import StandConfig
from cassie_control.control.robot import Readings
from cassie_gaits.robot import GRAVITY, WEIGHT
from cassie_msgs.layout import Mode

_REACH = 0.079  # m, centre of pressure from the middle of the sole
_HELD = 0.9  # contact of the less loaded foot from which the robot settles
_UNSETTLE = 0.2  # s, in which gains return to those before settling
_FIRM = 0.9  # threshold of `Balance.settled` for a rise
_LOST = 0.3  # contact of the more loaded foot below which settling starts anew
_BOUNCE = 0.1  # m/s, speed of the pelvis up to which the robot settles
_RUSH = 0.016  # m of the capture point by its velocity: more than the robot's own motions cause
_GAP = 1.5  # periods between estimates from which their difference is no rate
_SAFE, _FADE = 0.75, 0.15  # ratio of capture point to reach where bending begins; span to its full
_UNKNOWN = 0.08  # m, saturation of the CoM's error: 8 kg may hang 0.05 m off centre
_TEACHES = 0.02  # m, saturation of the CoM's innovation, so that a push has little effect
_FIRST = 0.7  # s, time constant of the CoM's error before settling
_SWAY = 0.5  # bound of the sideways force over the weight: less than a dry floor's friction


class Balance:
    """The centre of pressure from the CoM, and a hip strategy where the feet do not suffice.

    With c the CoM from the middle of the feet that carry, c* its set-point, v its velocity and W
    the weight:

        p       = c + (kp (c - c*) + kd v) / W, saturated at the edges of each sole and both feet,
        excess  = p before saturation - p.

    - CoM: at rest it is above the centre of pressure, whatever the error of the IMU's tilt and
      whatever the robot carries. So the feet's forces correct the estimate, with the time constant
      `bias_time`. A robot that has just been set down may fall before that. A pendulum's equation
      corrects sooner:

          c = p + (1 - settled) h / g c'',   with 0.7 s at first.

      `Readings` adds the correction to every CoM, for all laws.
    - The ground's force points from p towards the CoM, so that it turns the torso by no more than
      the torso's regulation commands.
    - Excess: the torso bends towards the fall, which pushes the CoM back (hip strategy); the
      torso's regulation is reduced meanwhile. The torso does not bend while the capture point is
      well inside: to straighten up again costs what bending has gained.
    - Gains that react to a push at once, and the bending, increase as the robot settles. Ground
      contact bounces at first, and with late commands these gains would excite that.

    Attributes:
        pressed: Centre of pressure of each foot, ahead of the middle of its sole. In m.
        left: Share of the weight on the left foot, 0..1.
        lean: Horizontal over vertical ground force, forward and to the left.
        moment: Torque that bends the torso forward. In Nm.
        give: Remaining factor of the torso's regulation, pitch and roll, 0..1.
        settled: How far the robot has settled on its feet, 0..1.
        capture: Capture point from the middle of the feet, forward and to the left. In m.
        urgent: Whether a push moves the capture point forward to the toes, so that a rise helps.
        beyond: How far the capture point is outside the support, forward and sideways. In m.
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
        self.pressed = self.settled = 0.0
        self._rest = (0.0, 0.0)
        self._time, self._com = -math.inf, (0.0, 0.0)
        self.left = 0.5
        self.lean = (0.0, 0.0)
        self.moment = 0.0
        self.give = (1.0, 1.0)
        self.capture = self.beyond = (0.0, 0.0)
        self.urgent = False

    @property
    def lean_length(self) -> float:
        """Leg length difference by the desired roll. In m/rad."""
        return 0.0

    def start(self, readings: Readings) -> None:
        """Begin with the robot's present velocity."""
        self._velocity = list(readings.com_velocity[:2])
        self.pressed = self.settled = 0.0
        self.capture = self.beyond = (0.0, 0.0)
        self.urgent = False

    def _com_velocity(self, readings: Readings) -> tuple[float, float]:
        """CoM velocity, forward and to the left; after settling from joint positions. In m/s.

        The rates of the shins lag those of the knees by 4 ms. In the 42 Hz mode of knees and leaf
        springs the two nearly cancel. So the estimate by rates is 3 times too large there, and with
        late commands toe torques from it would excite the mode.
        """
        passed, before = readings.time - self._time, self._com
        # Without its error, as a correction of the CoM is no motion.
        (x, y, _), (error_x, error_y) = readings.com, self.com_error
        com = (x - error_x, y - error_y)
        self._time, self._com = readings.time, com
        estimated, settled = readings.com_velocity, self.settled
        if not 0.0 < passed < _GAP * self._period:
            return estimated[0], estimated[1]
        vx, vy = (
            _between(
                estimated[k], readings.velocity[k] + (self._com[k] - before[k]) / passed, settled
            )
            for k in (0, 1)
        )
        return vx, vy

    def step(
        self,
        readings: Readings,
        mode: Mode,
        com_y: float,
        ground: Sequence[float],
        leans: bool = False,
    ) -> None:
        """Compute the attributes for one tick.

        Args:
            readings: The robot now.
            mode: Set-points for CoM x, pitch and roll.
            com_y: Set-point of the CoM, to the left of the feet's midpoint. In m.
            ground: Contact of each foot, 0..1.
            leans: Whether the robot leans onto one foot; it then unsettles, and `com_error` stays.
        """
        c, both = self.config, min(ground)
        if leans:
            self.settled = max(0.0, self.settled - self._period / _UNSETTLE)
        settled = self._settle(readings, ground)
        bandwidth = _between(c.velocity_bandwidth, c.settled_bandwidth, settled)
        share = 1.0 - math.exp(-self._period * bandwidth)
        before = tuple(self._velocity)
        for k, speed in enumerate(self._com_velocity(readings)):
            self._velocity[k] += share * (speed - self._velocity[k])
        if both > 0.7 and not leans:
            acceleration = [(self._velocity[k] - before[k]) / self._period for k in (0, 1)]
            self._learn(readings, acceleration)
        # The robot stands on the foot that carries it, wherever a lifted foot swings.
        middle = self._standing_on(readings, ground)
        x = readings.com[0] - middle
        y = readings.com_from_feet[1]
        height = max(0.3, readings.com_from_feet[2])
        apart = max(0.1, readings.legs[0].foot[1] - readings.legs[1].foot[1])
        self._look_ahead(x, y, math.sqrt(height / GRAVITY), 0.5 * apart)
        excess_x = self._press_x(x - float(mode.com_x), x, settled)
        excess_y = self._press_y(y - com_y, y, apart, settled)
        pressed_y = (self.left - 0.5) * apart
        bent_y = readings.roll - float(mode.roll)
        moment_y = self._bend(c.roll_gain, excess_y, bent_y, c.roll_torque, c.roll_limit)
        sway = (y - pressed_y - moment_y / WEIGHT) / height
        self.lean = (both * (x - self.pressed) / height, max(-_SWAY, min(_SWAY, sway)))
        self.give = (
            max(0.0, 1.0 - abs(excess_x) / c.give),
            max(self._roll_give(), 1.0 - abs(excess_y) / c.give),
        )
        bent_x = float(mode.pitch) - readings.pitch
        self.moment = self._bend(c.bend_gain, excess_x, bent_x, c.bend_torque, c.bend_limit)

    def _press_x(self, error: float, x: float, settled: float) -> float:
        """Set `pressed`; returns the excess that may bend the torso, in m."""
        c = self.config
        kd = _between(c.kd_com_x, c.settled_kd_com_x, settled)
        wanted = x - self._rest[0] + (c.kp_com_x * error + kd * self._velocity[0]) / WEIGHT
        self.pressed = max(-_REACH, min(_REACH, wanted))
        return settled * self._bends(0, _REACH) * (wanted - self.pressed)

    def _press_y(self, error: float, y: float, apart: float, settled: float) -> float:
        """Set `left`; returns the sideways excess that may bend the torso, in m."""
        c = self.config
        kd = self._damping_y(settled)
        wanted = y - self._rest[1] + (c.kp_com_y * error + kd * self._velocity[1]) / WEIGHT
        self.left = max(0.0, min(1.0, 0.5 + wanted / apart))
        return self._bends(1, 0.5 * apart) * (wanted - (self.left - 0.5) * apart)

    def _damping_y(self, settled: float) -> float:
        """Sideways force by CoM y velocity, in Ns/m; `settled` is in 0..1."""
        return _between(self.config.kd_com_y, self.config.settled_kd_com_y, settled)

    def _roll_give(self) -> float:
        """Least factor on the hip roll stiffness, 0..1."""
        return 0.0

    def _bends(self, k: int, reach: float) -> float:
        """Share of the excess by which the torso bends, 0..1; `reach` is that of the feet, in m.

        It is 0 as long as the capture point is safely inside, where the feet suffice.
        """
        return fades_in(abs(self.capture[k]) / reach, _SAFE)

    def _settle(self, readings: Readings, ground: Sequence[float]) -> float:
        """Update `settled`, 0..1, as gains that react to a push would shake a landing."""
        if max(ground) < _LOST:
            self.settled = 0.0
        elif min(ground) > _HELD and max(map(abs, readings.velocity)) < _BOUNCE:
            self.settled = min(1.0, self.settled + self._period / self.config.settle_time)
        return self.settled

    @staticmethod
    def _bend(gain: float, excess: float, unbent: float, most: float, limit: float) -> float:
        """Torque of the hip strategy, at most `most`; `unbent` is set-point minus torso angle."""
        moment = max(-most, min(most, gain * WEIGHT * excess))
        return moment * max(0.0, 1.0 - abs(unbent) / limit) if unbent * excess < 0.0 else moment

    def _look_ahead(self, x: float, y: float, time: float, half: float) -> None:
        """Compute `capture`, `beyond` and `urgent`.

        Args:
            x, y: Position of the CoM. In m.
            time: Time constant of the pendulum, sqrt(height / g). In s.
            half: Half of the sideways distance of the feet. In m.
        """
        vx, vy = (time * v for v in self._velocity)
        self.capture = (x + vx, y + vy)
        self.beyond = (max(0.0, abs(x + vx) - _REACH), max(0.0, abs(y + vy) - half))
        edge = _REACH - self.config.rise_margin
        forward = vx > max(_RUSH, 2.0 * abs(vy))
        self.urgent = self.settled > _FIRM and forward and x + vx > edge

    @staticmethod
    def _standing_on(readings: Readings, ground: Sequence[float]) -> float:
        """Middle of the feet that carry the robot, ahead of the pelvis origin. In m."""
        left, right = (leg.foot[0] for leg in readings.legs)
        carried = ground[0] + ground[1]
        if carried < 0.1:
            return 0.5 * (left + right)
        return (ground[0] * left + ground[1] * right) / carried

    @staticmethod
    def _carried(readings: Readings) -> float:
        """Measured centre of pressure, to the left of the feet's midpoint. In m."""
        left, right = readings.legs
        middle = 0.5 * (left.foot[1] + right.foot[1])
        carried = max(1.0, left.force + right.force)
        return (left.force * left.foot[1] + right.force * right.foot[1]) / carried - middle

    def _learn(self, readings: Readings, acceleration: Sequence[float]) -> None:
        """Correct `com_error` by the centre of pressure and the CoM's `acceleration` (m/s^2)."""
        share = self._period / _between(_FIRST, self.config.bias_time, self.settled)
        falls = (1.0 - self.settled) * readings.com_from_feet[2] / GRAVITY
        pressed = (self.pressed, self._carried(readings))

        def found(k: int) -> float:
            error = pressed[k] + falls * acceleration[k] - readings.com_from_feet[k]
            learnt = self.com_error[k] + share * max(-_TEACHES, min(_TEACHES, error))
            return max(-_UNKNOWN, min(_UNKNOWN, learnt))

        self.com_error = (found(0), found(1))


def fades_in(share: float, safe: float) -> float:
    """Factor of the torso's bending, 0..1, at a ratio of capture point to reach."""
    return max(0.0, min(1.0, (share - safe) / _FADE))


def _between(first: float, last: float, share: float) -> float:
    return first + share * (last - first)
