"""Velocity commands, as Nav2 and others give them, to what is asked of the robot.

Times come in as arguments: monotonic, in s.
"""

from __future__ import annotations

import math

from cassie_msgs.request import Request
from cassie_msgs.tunables import replace_checked
from cassie_teleop.device import RANGES
from cassie_teleop.keyboard import stopped
from cassie_teleop.radio import clamped

AT_REST = 1.0
"""For how long stand and no speed are asked for when power is, so that it is granted. In s."""

ASKING = 1.0
"""For how long one request asks for the lease of another operator. In s."""

LARGEST = 10.0
"""Of a velocity command, in m/s and rad/s; beyond it nothing is meant."""


_SET_POINTS = {"linear.x": "vx", "linear.y": "vy", "angular.z": "yaw_rate"}


class VelocityError(ValueError):
    """A velocity command that cannot be meant."""


class VelocityCommands:
    """The command that follows from the newest velocity command.

    A velocity asks for walking. Where none comes for `timeout`, the robot is asked to stop, and
    `stand_after` later to stand.

    Attributes:
        timeout, stand_after: In s.
    """

    def __init__(self, timeout: float, stand_after: float) -> None:
        self.timeout, self.stand_after = timeout, stand_after
        self._base: Request | None = None
        self._velocity = (0.0, 0.0, 0.0)
        self._came = self._moved = self._powered = self._asked = -math.inf

    def receive(self, vx: float, vy: float, yaw_rate: float, now: float) -> str:
        """Take in a velocity command: forward, to the left (m/s), turn to the left (rad/s).

        What is beyond the ranges of the set-points is held within them.

        Returns:
            Which value is held within its range, in words; empty if none is.

        Raises:
            VelocityError: naming a value that is not finite or far beyond; it then counts as stop.
        """
        self._velocity, self._came = (0.0, 0.0, 0.0), now
        for name, value in zip(_SET_POINTS, (vx, vy, yaw_rate), strict=True):
            if not abs(value) <= LARGEST:  # not so of NaN
                raise VelocityError(f"{name} = {value:g} is outside -{LARGEST:g} .. {LARGEST:g}")
        self._velocity = (clamped("vx", vx), clamped("vy", vy), clamped("yaw_rate", yaw_rate))
        if any(self._velocity):
            self._moved = now
        for (name, set_point), value, held in zip(
            _SET_POINTS.items(), (vx, vy, yaw_rate), self._velocity, strict=True
        ):
            if value != held:
                return f"{name} is held within {RANGES[set_point].range_text}"
        return ""

    def power(self, on: bool, now: float) -> None:
        """Ask for power, or cut it."""
        base = self._base or Request()
        self._base = replace_checked(base, power=on, emergency_stop=not on)
        self._powered = now if on else -math.inf

    def take_over(self, now: float) -> None:
        """Ask for the lease of the operator who drives."""
        self._asked = now

    def request(self, now: float) -> Request | None:
        """What to ask of the robot now; None before anybody asked for power or cut it."""
        if self._base is None:
            return None
        asks = now - self._asked < ASKING
        base = replace_checked(self._base, take_over=asks)
        if not base.power or asks or now - self._powered < AT_REST:
            return stopped(base)
        vx, vy, yaw_rate = self._velocity if now - self._came < self.timeout else (0.0, 0.0, 0.0)
        mode = "walk" if now - self._moved < self.timeout + self.stand_after else "stand"
        return replace_checked(base, mode=mode, vx=vx, vy=vy, yaw_rate=yaw_rate)
