"""Where the feet shall press so that the CoM stays where it is wanted."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_control.config import StandConfig
from cassie_control.control.robot import Readings
from cassie_gaits.robot import GRAVITY, WEIGHT
from cassie_msgs.layout import Mode

_REACH = 0.079  # m, centre of pressure from the middle of the sole
_HELD = 0.9  # contact of the lighter foot while it settles
_UNSETTLE = 0.2  # s, in which it goes back to the gains before it settled
_FIRM = 0.9  # how far settled it must be to rise
_LOST = 0.3  # contact of the heavier one at which it starts anew
_BOUNCE = 0.1  # m/s, speed of the pelvis up to which it does
_RUSH = 0.016  # m of the capture point that are due to speed, more than when it moves by itself
_GAP = 1.5  # periods between estimates from which their difference is no rate
_SAFE, _FADE = 0.75, 0.15  # capture point over reach at which, and over what, the torso may bend
_UNKNOWN = 0.08  # m, bound of what the CoM is found to be off: 8 kg may hang 0.05 m off centre
_TEACHES = 0.02  # m, so that a push teaches little
_FIRST = 0.7  # s, in which it is found at first
_SWAY = 0.5  # bound of the sideways force over the weight: less than a dry floor's friction


class Balance:
    """The centre of pressure from the CoM, and what the hips do where the feet cannot.

    With c the CoM from the middle of the feet that carry, c* where it is wanted, v its velocity and
    W the weight:

        p       = c + (kp (c - c*) + kd v) / W, cut to the edges of each sole, and to both feet,
        excess  = what was cut off.

    - CoM: at rest it is above the centre of pressure, whatever the IMU's tilt is worth and
      whatever the robot carries. What the feet press tells how far the estimate is off, over
      `bias_time`. Who has just been set down may fall before that, and a pendulum tells it sooner:

          c = p + (1 - settled) h / g c'',   over 0.7 s at first.

      `Readings` has it in every CoM, for all laws alike.
    - The ground's force leans from p towards the CoM, so that it turns the torso by no more than
      its own regulation asks for.
    - Excess: the torso bends towards the fall, which pushes the CoM back (hip strategy); its own
      regulation gives way meanwhile. Not while the capture point is well inside: to stand up
      straight again costs what bending has gained.
    - Gains that meet a push at once, and the bending, come in as it settles. Ground that has just
      been met bounces, and with late commands they would feed that.

    Attributes:
        pressed: Centre of pressure of each foot, ahead of the middle of its sole. In m.
        left: Share of the weight on the left foot, 0..1.
        lean: Horizontal over vertical ground force, forward and to the left.
        moment: Torque that bends the torso forward. In Nm.
        give: What is left of the torso's own regulation, pitch and roll, 0..1.
        settled: How far it has settled on its feet, 0..1.
        capture: Capture point from the middle of the feet, forward and to the left. In m.
        urgent: Whether a push drives it forward to the toes, so that legs that push up help.
        beyond: How far the capture point is outside the support, forward and sideways. In m.
        com_error: What the CoM was found to be farther forward and to the left than estimated, in
            m. It outlasts a start: what it carries it still carries.

    Args:
        config: Gains.
        period: Of control. In s.

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
        """Leg length difference by the roll that is wanted. In m/rad."""
        return 0.0

    def start(self, readings: Readings) -> None:
        """Begin with the velocity that the robot has."""
        self._velocity = list(readings.com_velocity[:2])
        self.pressed = self.settled = 0.0
        self.capture = self.beyond = (0.0, 0.0)
        self.urgent = False

    def _com_velocity(self, readings: Readings) -> tuple[float, float]:
        """Of the CoM, forward and to the left; once it has settled, from joint positions. In m/s.

        The rates of the shins come 4 ms after those of the knees. In the 42 Hz mode of knees and
        leaf springs, where both all but cancel, the estimate by rates is thus 3 times too large,
        and toe torques by that would feed the mode when commands come late.
        """
        passed, before = readings.time - self._time, self._com
        # Without its error: to find the CoM elsewhere is no motion.
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
        """Set the attributes.

        Args:
            readings: The robot now.
            mode: Set-points for CoM x and pitch.
            com_y: Where the CoM is wanted, to the left of the feet's midpoint. In m.
            ground: Contact of each foot, 0..1.
            leans: Whether it moves itself onto one foot: that unsettles it, and teaches nothing.
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
        # The foot that carries it is what it stands on, wherever a lifted one swings.
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
        """Set `pressed`; returns how much farther it wants to press, in m."""
        c = self.config
        kd = _between(c.kd_com_x, c.settled_kd_com_x, settled)
        wanted = x - self._rest[0] + (c.kp_com_x * error + kd * self._velocity[0]) / WEIGHT
        self.pressed = max(-_REACH, min(_REACH, wanted))
        return settled * self._bends(0, _REACH) * (wanted - self.pressed)

    def _press_y(self, error: float, y: float, apart: float, settled: float) -> float:
        """Set `left`; returns how much farther to the side it wants to press, in m."""
        c = self.config
        kd = self._damping_y(settled)
        wanted = y - self._rest[1] + (c.kp_com_y * error + kd * self._velocity[1]) / WEIGHT
        self.left = max(0.0, min(1.0, 0.5 + wanted / apart))
        return self._bends(1, 0.5 * apart) * (wanted - (self.left - 0.5) * apart)

    def _damping_y(self, settled: float) -> float:
        """Force sideways by CoM y velocity, in Ns/m; `settled` is how far it has settled, 0..1."""
        return _between(self.config.kd_com_y, self.config.settled_kd_com_y, settled)

    def _roll_give(self) -> float:
        """What is left of the hip roll stiffness when it has given way, 0..1."""
        return 0.0

    def _bends(self, k: int, reach: float) -> float:
        """Share of the excess by which the torso bends; `reach` is what the feet reach, in m.

        None as long as the capture point is safely inside: the feet will do.
        """
        return fades_in(abs(self.capture[k]) / reach, _SAFE)

    def _settle(self, readings: Readings, ground: Sequence[float]) -> float:
        """How far it has settled, 0..1: gains that meet a push would shake a landing."""
        if max(ground) < _LOST:
            self.settled = 0.0
        elif min(ground) > _HELD and max(map(abs, readings.velocity)) < _BOUNCE:
            self.settled = min(1.0, self.settled + self._period / self.config.settle_time)
        return self.settled

    @staticmethod
    def _bend(gain: float, excess: float, unbent: float, most: float, limit: float) -> float:
        """Torque of the hip strategy, at most so much; `unbent` is how far from upright, rad."""
        moment = max(-most, min(most, gain * WEIGHT * excess))
        return moment * max(0.0, 1.0 - abs(unbent) / limit) if unbent * excess < 0.0 else moment

    def _look_ahead(self, x: float, y: float, time: float, half: float) -> None:
        """Find `capture`, `beyond` and `urgent`.

        Args:
            x, y: Of the CoM. In m.
            time: Of the pendulum, sqrt(height / g). In s.
            half: Of the distance of the feet. In m.
        """
        vx, vy = (time * v for v in self._velocity)
        self.capture = (x + vx, y + vy)
        self.beyond = (max(0.0, abs(x + vx) - _REACH), max(0.0, abs(y + vy) - half))
        edge = _REACH - self.config.rise_margin
        forward = vx > max(_RUSH, 2.0 * abs(vy))
        self.urgent = self.settled > _FIRM and forward and x + vx > edge

    @staticmethod
    def _standing_on(readings: Readings, ground: Sequence[float]) -> float:
        """Middle of the feet that carry it, ahead of the pelvis origin. In m."""
        left, right = (leg.foot[0] for leg in readings.legs)
        carried = ground[0] + ground[1]
        if carried < 0.1:
            return 0.5 * (left + right)
        return (ground[0] * left + ground[1] * right) / carried

    @staticmethod
    def _carried(readings: Readings) -> float:
        """Where the feet press, to the left of their midpoint. In m."""
        left, right = readings.legs
        middle = 0.5 * (left.foot[1] + right.foot[1])
        carried = max(1.0, left.force + right.force)
        return (left.force * left.foot[1] + right.force * right.foot[1]) / carried - middle

    def _learn(self, readings: Readings, acceleration: Sequence[float]) -> None:
        """Draw `com_error` to what the feet press; `acceleration` is the CoM's, in m/s^2."""
        share = self._period / _between(_FIRST, self.config.bias_time, self.settled)
        falls = (1.0 - self.settled) * readings.com_from_feet[2] / GRAVITY
        pressed = (self.pressed, self._carried(readings))

        def found(k: int) -> float:
            error = pressed[k] + falls * acceleration[k] - readings.com_from_feet[k]
            learnt = self.com_error[k] + share * max(-_TEACHES, min(_TEACHES, error))
            return max(-_UNKNOWN, min(_UNKNOWN, learnt))

        self.com_error = (found(0), found(1))


def fades_in(share: float, safe: float) -> float:
    """How far the torso may bend, 0..1, with the capture point at that share of the reach."""
    return max(0.0, min(1.0, (share - safe) / _FADE))


def _between(first: float, last: float, share: float) -> float:
    return first + share * (last - first)
