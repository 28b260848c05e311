"""Conversion of velocity commands, as of Nav2 and others, to operator commands.

Times come in as arguments: monotonic, in s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_msgs.request import Request
from cassie_msgs.tunables import replace_checked
from cassie_teleop.requests import RANGES, TAKE_OVER_TIME, clamped, stopped

AT_REST = 1.0
"""Time for which power is commanded with stand and no speed, so that it comes on. In s."""

LARGEST = 10.0
"""Largest valid value of a velocity command. In m/s and rad/s."""


_SET_POINTS = {"linear.x": "vx", "linear.y": "vy", "angular.z": "yaw_rate"}


def obstacle(name: str, holder: str, faults: Sequence[str], armed: bool) -> str:
    """Why the robot does not follow velocity commands, and what to do; empty if it follows.

    Args:
        name: Name of the sender of the commands.
        holder: Name of the lease's holder, by the supervisor; empty if there is none.
        faults: Faults, by the supervisor.
        armed: Whether the holder's speeds count, by the supervisor.
    """
    if holder not in ("", name):
        return f"{holder} drives: call /cmd_vel/take_over while the robot stands"
    refused = next((fault for fault in faults if fault.startswith("no power: ")), "")
    if "switch the power off" in refused:
        return f"{refused}: call /cmd_vel/power"
    if refused:
        return f"{refused}: pause the velocity commands"
    return "" if armed else "speeds do not count until the velocity was zero once"


class VelocityError(ValueError):
    """An invalid velocity command."""


class VelocityCommands:
    """The operator command that follows from the newest velocity command.

    A velocity commands walking. After `timeout` without a velocity command a stop is commanded, and
    `stand_after` later the mode stand.

    Attributes:
        timeout: Time without a velocity command until a stop is commanded. In s.
        stand_after: Time from the stop until stand is commanded. In s.
    """

    def __init__(self, timeout: float, stand_after: float) -> None:
        self.timeout, self.stand_after = timeout, stand_after
        self._base: Request | None = None
        self._velocity = (0.0, 0.0, 0.0)
        self._came = self._moved = self._powered = self._asked = -math.inf

    def receive(self, vx: float, vy: float, yaw_rate: float, now: float) -> str:
        """Take in a velocity command: forward, to the left (m/s), turn to the left (rad/s).

        Values beyond the ranges of the set-points saturate.

        Returns:
            Text that names a saturated value; empty if there is none.

        Raises:
            VelocityError: naming a value that is not finite or beyond `LARGEST`; the command then
                counts as a stop.
        """
        self._velocity, self._came = (0.0, 0.0, 0.0), now
        for name, value in zip(_SET_POINTS, (vx, vy, yaw_rate), strict=True):
            if not abs(value) <= LARGEST:  # also true of NaN
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

    @property
    def active(self) -> bool:
        """Whether there are requests: power was commanded or cut once."""
        return self._base is not None

    @property
    def powered(self) -> bool:
        """Whether power is commanded."""
        return self._base is not None and self._base.power

    def power(self, on: bool, now: float) -> None:
        """Command power, or cut it."""
        base = self._base or Request()
        self._base = replace_checked(base, power=on, emergency_stop=not on)
        self._powered = now if on else -math.inf

    def take_over(self, now: float) -> None:
        """Request the lease of the operator who drives."""
        self._asked = now

    def request(self, now: float) -> Request | None:
        """The present request to the robot; None before power was commanded or cut once."""
        if self._base is None:
            return None
        asks = now - self._asked < TAKE_OVER_TIME
        base = replace_checked(self._base, take_over=asks)
        if not base.power or asks or now - self._powered < AT_REST:
            return stopped(base)
        vx, vy, yaw_rate = self._velocity if now - self._came < self.timeout else (0.0, 0.0, 0.0)
        mode = "walk" if now - self._moved < self.timeout + self.stand_after else "stand"
        return replace_checked(base, mode=mode, vx=vx, vy=vy, yaw_rate=yaw_rate)
