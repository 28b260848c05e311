"""Where the feet shall press so that the CoM stays where it is wanted."""

from __future__ import annotations

import math

from cassie_control.controller.config import StandConfig
from cassie_control.controller.readings import WEIGHT, Readings
from cassie_msgs.layout import Mode

_REACH = 0.075  # m, centre of pressure from the middle of the sole
_GRAVITY = 9.81  # m/s^2
_BIAS = 0.05  # m, bound of the learnt error of the CoM
_BIAS_STEP = 0.02  # m, so that a push teaches little
_SWAY = 0.5  # bound of the sideways force over the weight: less than a dry floor's friction


class Balance:
    """The centre of pressure from the CoM, and what the hips do where the feet cannot.

    With c the CoM from the feet's midpoint, c* where it is wanted, v its velocity and W the weight:

        p       = c + (kp (c - c*) + kd v) / W, cut to the support,
        excess  = what was cut off.

    - CoM: at rest it is above the centre of pressure, whatever the IMU's tilt is worth. What the
      feet press tells how far the estimate is off, learnt over `bias_time`.
    - The ground's force leans from p towards the CoM, so that it turns the torso by no more than
      its own regulation asks for.
    - Excess: the torso bends towards the fall, which pushes the CoM back (hip strategy); its own
      regulation gives way meanwhile.

    Attributes:
        pressure: Of the feet, fore and aft, from the pelvis origin, heading frame. In m.
        left: Share of the weight on the left foot, 0..1.
        lean: Horizontal over vertical ground force, forward and to the left.
        moment: Torque that bends the torso forward. In Nm.
        give: What is left of the torso's own regulation, pitch and roll, 0..1.
        beyond: How far the capture point is outside the support, forward and sideways. In m.

    Args:
        config: Gains.
        period: Of control. In s.

    Source:
        Capture point and its feedback to the centre of pressure: Englsberger et al., IROS 2011.
    """

    def __init__(self, config: StandConfig, period: float) -> None:
        self.config = config
        self._period = period
        self._bias = [0.0, 0.0]
        self._velocity = [0.0, 0.0]
        self._pressed = 0.0
        self._rest = (0.0, 0.0)
        self.pressure = 0.0
        self.left = 0.5
        self.lean = (0.0, 0.0)
        self.moment = 0.0
        self.give = (1.0, 1.0)
        self.beyond = (0.0, 0.0)

    def start(self, readings: Readings) -> None:
        """Begin with the velocity that the robot has, and no error learnt."""
        self._bias = [0.0, 0.0]
        self._velocity = list(readings.com_velocity[:2])
        self._pressed = 0.0
        self.beyond = (0.0, 0.0)

    def step(self, readings: Readings, mode: Mode, com_y: float, both: float) -> None:
        """Set the attributes.

        Args:
            readings: The robot now.
            mode: Set-points for CoM x and pitch.
            com_y: Where the CoM is wanted, to the left of the feet's midpoint. In m.
            both: Contact of the foot that has less of it, 0..1.
        """
        c = self.config
        share = 1.0 - math.exp(-self._period * c.velocity_bandwidth)
        for k in (0, 1):
            self._velocity[k] += share * (readings.com_velocity[k] - self._velocity[k])
        if both > 0.7:
            self._learn(readings)
        x = readings.com_from_feet[0] + self._bias[0]
        y = readings.com_from_feet[1] + self._bias[1]
        height = max(0.3, readings.com_from_feet[2])
        ahead, left = self._rest
        force = c.kp_com_x * (x - float(mode.com_x)) + c.kd_com_x * self._velocity[0]
        wanted = x - ahead + force / WEIGHT
        self._pressed = max(-_REACH, min(_REACH, wanted))
        self.pressure = readings.com[0] - readings.com_from_feet[0] + self._pressed
        excess_x = wanted - self._pressed
        force = c.kp_com_y * (y - com_y) + c.kd_com_y * self._velocity[1]
        wanted = y - left + force / WEIGHT
        apart = max(0.1, readings.legs[0].foot[1] - readings.legs[1].foot[1])
        self.left = max(0.0, min(1.0, 0.5 + wanted / apart))
        self._look_ahead(x, y, math.sqrt(height / _GRAVITY), 0.5 * apart)
        pressed_y = (self.left - 0.5) * apart
        excess_y = wanted - pressed_y
        moment_y = self._bend(c.roll_gain, excess_y, readings.roll - float(mode.roll))
        sway = (y - pressed_y - moment_y / WEIGHT) / height
        self.lean = (both * (x - self._pressed) / height, max(-_SWAY, min(_SWAY, sway)))
        self.give = (
            max(0.0, 1.0 - abs(excess_x) / c.give),
            max(0.3, 1.0 - abs(excess_y) / c.give),
        )
        self.moment = self._bend(c.bend_gain, excess_x, float(mode.pitch) - readings.pitch)

    def _bend(self, gain: float, excess: float, unbent: float) -> float:
        """Torque of the hip strategy; `unbent` is how far the torso is from upright, rad."""
        c = self.config
        moment = max(-c.bend_torque, min(c.bend_torque, gain * WEIGHT * excess))
        return (
            moment * max(0.0, 1.0 - abs(unbent) / c.bend_limit) if unbent * excess < 0.0 else moment
        )

    def _look_ahead(self, x: float, y: float, time: float, half: float) -> None:
        """Find `beyond`, with the CoM at x, y (m), and feet that are `half` (m) off the middle."""
        ahead = abs(x + time * self._velocity[0]) - _REACH
        aside = abs(y + time * self._velocity[1]) - half
        self.beyond = (max(0.0, ahead), max(0.0, aside))

    @staticmethod
    def _carried(readings: Readings) -> float:
        """Where the feet press, to the left of their midpoint. In m."""
        left, right = readings.legs
        middle = 0.5 * (left.foot[1] + right.foot[1])
        carried = max(1.0, left.force + right.force)
        return (left.force * left.foot[1] + right.force * right.foot[1]) / carried - middle

    def _learn(self, readings: Readings) -> None:
        share = self._period / self.config.bias_time
        for k, pressed in enumerate((self._pressed, self._carried(readings))):
            error = pressed - readings.com_from_feet[k] - self._bias[k]
            learnt = self._bias[k] + share * max(-_BIAS_STEP, min(_BIAS_STEP, error))
            self._bias[k] = max(-_BIAS, min(_BIAS, learnt))
