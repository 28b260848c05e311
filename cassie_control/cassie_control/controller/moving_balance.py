"""Balance on ground that may accelerate, as the platform of a Segway does."""

from __future__ import annotations

from collections.abc import Sequence

from cassie_control.controller.balance import Balance
from cassie_control.controller.readings import WEIGHT, Readings
from cassie_control.controller.standing_config import SegwayConfig
from cassie_msgs.layout import Mode

_GRAVITY = 9.81
_SLOW = 2.0  # m/s up to which the gains hold; 1 m/s faster those for bumps that come fast
_PRESS, _SHARE = (
    0.065,
    0.4,
)  # m, and of the feet's distance: farther they press for no command
_NEAR = 0.015  # m from where the CoM is, which it may be wanted in any case
_FASTEST = 2.5  # m/s^2, bound of what the ground is believed to do


class MovingBalance(Balance):
    """The balance law with the ground's acceleration taken out.

    With c the CoM from the feet, v its velocity seen from them, p the centre of pressure and h the
    CoM's height, the ground accelerates by

        a = g (c - p) / h - dv/dt,   through a low-pass of `moving_time`,

    which is 0 on plain ground. On ground that accelerates, c rests ahead of p by h a / g, so

        p = c - h a / g + (kp (c - c*) + kd v) / W.

    A Segway accelerates by what the feet press on its platform, W p / (r M): there this law holds c
    at c* with the same stiffness as on plain ground, where feedback of c alone would be 4 times as
    stiff, and it needs to know nothing of the vehicle. The error of c is that learnt by who stood
    before: on ground that moves it cannot be told from an acceleration.

    A platform that rolls on uneven ground presses the steering bar against its knees: it turns by
    itself, and it is thrown to a side until one foot carries it. Hips that give way at that, as
    in standing, throw the torso to and fro until a foot slips. So from 2 to 3 m/s the gains go over
    to `fast_...`: hips that stay stiff and less weight shifted by speed sideways.

    Attributes:
        acceleration: Of the ground, forward and to the left. In m/s^2.
        speed: Of the ground, forward: the acceleration without low-pass, summed. In m/s.

    Args:
        config: Gains.
        period: Of control. In s.
    """

    config: SegwayConfig

    def __init__(self, config: SegwayConfig, period: float) -> None:
        super().__init__(config, period)
        self._forget()

    def _forget(self) -> None:
        self.acceleration = [0.0, 0.0]
        self.speed = 0.0
        self._mean = [0.0, 0.0]
        self._slow = list(self._velocity)

    def start(self, readings: Readings, bias: tuple[float, float] = (0.0, 0.0)) -> None:
        """Begin on ground at rest."""
        super().start(readings, bias)
        self._forget()

    def rest(self, readings: Readings) -> tuple[float, float]:
        """How far ahead of the centre of pressure, and to its left, the CoM would rest. In m."""
        per_acceleration = max(0.3, readings.com_from_feet[2]) / _GRAVITY
        ahead, left = self.acceleration
        return per_acceleration * ahead, per_acceleration * left

    def near(self, readings: Readings) -> tuple[tuple[float, float], tuple[float, float]]:
        """Where the CoM may be wanted so that the feet need not press at their edges for it.

        To come back from a lean they press farther out at first. A command that asks for more than
        they have throws it: the torso bends, and swings back.

        Returns:
            Least and greatest com_x, the same of com_y. In m.
        """
        c = self.config
        gains = ((c.kp_com_x, c.kd_com_x), (c.kp_com_y, self._damping_y(1.0)))
        apart = readings.legs[0].foot[1] - readings.legs[1].foot[1]
        rest, bounds = self.rest(readings), []
        for k, ((kp, kd), most) in enumerate(zip(gains, (_PRESS, _SHARE * apart), strict=True)):
            com = readings.com_from_feet[k] + self._bias[k]
            pressed = com - rest[k] + kd * self._velocity[k] / WEIGHT
            scale = WEIGHT / max(1.0, kp)
            bounds.append(
                (
                    com - max(_NEAR, scale * (most - pressed)),
                    com + max(_NEAR, scale * (most + pressed)),
                )
            )
        return bounds[0], bounds[1]

    def step(self, readings: Readings, mode: Mode, com_y: float, ground: Sequence[float]) -> None:
        """Set the attributes; arguments as `Balance.step`."""
        per_acceleration = max(0.3, readings.com_from_feet[2]) / _GRAVITY
        self._rest = self.rest(readings)
        before = self._velocity[0]
        super().step(readings, mode, com_y, ground)
        self._observe(readings, min(ground), per_acceleration)
        self.speed -= self._velocity[0] - before

    def _observe(self, readings: Readings, both: float, per_acceleration: float) -> None:
        share = self._period / self.config.moving_time
        for k, pressed in enumerate((self.pressed, self._carried(readings))):
            away = readings.com_from_feet[k] + self._bias[k] - pressed
            falling = both * away / per_acceleration
            if k == 0:
                self.speed += self._period * falling
            self._mean[k] += share * (falling - self._mean[k])
            self._slow[k] += share * (self._velocity[k] - self._slow[k])
            rise = (self._velocity[k] - self._slow[k]) / self.config.moving_time
            self.acceleration[k] = max(-_FASTEST, min(_FASTEST, self._mean[k] - rise))

    def _com_velocity(self, readings: Readings) -> tuple[float, float]:
        return readings.com_velocity[0], readings.com_velocity[1]

    def _with_speed(self, slow: float, fast: float) -> float:
        share = max(0.0, min(1.0, abs(self.speed) - _SLOW))
        return slow + share * (fast - slow)

    def _damping_y(self, settled: float) -> float:
        return self._with_speed(super()._damping_y(settled), self.config.fast_kd_com_y)

    def _roll_give(self) -> float:
        return self._with_speed(self.config.roll_give, self.config.fast_roll_give)

    def _bends(self, k: int, reach: float) -> float:
        # To the side the torso bends at once: the foot bars are narrow.
        return super()._bends(k, reach) if k == 0 else 1.0

    def _learn(self, readings: Readings) -> None:
        return

    def _settle(self, readings: Readings, ground: Sequence[float]) -> float:
        """A platform moves: here it counts as settled at once, with gains that know no other."""
        self.settled = 1.0
        return self.settled
