"""Conversion of Joy messages over time to requests: old or invalid messages mean no link."""

from __future__ import annotations

from collections.abc import Sequence

from cassie_msgs.request import Request
from cassie_msgs.tunables import replace_checked
from cassie_teleop.radio import Radio, RadioError
from cassie_teleop.requests import without_link


class Receiver:
    """Keeps the last valid request and the present problem.

    Args:
        radio: Reads the channels.
        timeout: Greatest age of a message, in s of wall time.

    Attributes:
        records: Whether the device asks for a recording; None while it is not known.
    """

    def __init__(self, radio: Radio, timeout: float) -> None:
        """Begin without a message."""
        self.timeout = timeout
        self.records: bool | None = None
        self._radio = radio
        self._request: Request | None = None
        self._refusal = ""
        self._time: float | None = None

    def receive(self, axes: Sequence[float], buttons: Sequence[int], now: float) -> bool:
        """Take in a message, at a monotonic time in s.

        Returns:
            Whether it must be sent at once: power has changed, or the robot has to stop.
        """
        before = self._request
        self._time = now
        try:
            request = self._radio.read(axes, buttons)
        except RadioError as error:
            self._refusal = self._refusal or str(error)  # the first of a series: one report
            if before is None or not before.power or not self._radio.cuts_power(axes, buttons):
                return False
            self._request = replace_checked(before, power=False)  # the emergency stop still works
            return True
        self._refusal = ""
        self._request = request
        self.records = self._radio.records(axes, buttons)
        if request is None:
            return False
        return (
            before is None
            or before.power != request.power
            or (_moves(before) and not _moves(request))
        )

    def problem(self, now: float) -> str:
        """Text of the problem at a time; empty if there is none."""
        if self._time is None:
            return "no message on /joy yet"
        if now - self._time > self.timeout:
            return f"/joy is silent for more than {self.timeout:g} s"
        if self._refusal:
            return f"refused: {self._refusal}"
        if self._request is None:
            return "waiting for the power button"
        return "" if self._request.link else "the radio has no signal"

    def request(self, now: float) -> Request | None:
        """The request to send at a time; None before the first valid one."""
        if self._request is None:
            return None
        return without_link(self._request) if self.problem(now) else self._request


def _moves(request: Request) -> bool:
    return any((request.vx, request.vy, request.yaw_rate))
