"""Channels of a radio or gamepad to wishes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_msgs.tunables import replace_checked
from cassie_teleop.device import RANGES, TRIMS, AxisMap, Device, Switch
from cassie_teleop.wish import Wish


class RadioError(ValueError):
    """Channels that cannot be meant: wrong in number, not finite or out of -1 .. 1."""


class Radio:
    """Reads channels as its device file says; keeps what buttons have latched."""

    def __init__(self, device: Device) -> None:
        """Start with nothing latched."""
        self.device = device
        self._latched: dict[str, bool] = {}

    def read(self, axes: Sequence[float], buttons: Sequence[int]) -> Wish | None:
        """The wishes behind one set of channels.

        Args:
            axes: Values in -1 .. 1, as many as the device has.
            buttons: 0 or 1 each.

        Returns:
            The wishes; None while power is switched by buttons and neither was pressed
            yet, so that nobody cuts the power by starting a program.

        Raises:
            RadioError: naming the channel, its value and what is expected.
        """
        self._check(axes, buttons)
        device = self.device
        power = self._on("power", device.power, axes, buttons)
        asked = [name for name, on in device.mode.items() if self._on(name, on, axes, buttons)]
        if power is None:
            return None
        held = device.dead_man is None or bool(buttons[device.dead_man])
        moves = {"vx", "vy", "yaw_rate"}
        values = {
            name: clamped(name, mapped(axis_map, axes[axis_map.axis]))
            for name, axis_map in device.setpoints.items()
            if held or name not in moves
        }
        trims = tuple(values.pop(name, 0.0) for name in TRIMS)
        link = all(buttons[index] for index in device.link_buttons)
        return replace_checked(
            device.start,
            **values,
            trims=trims,
            power=power,
            link=link,
            mode=asked[-1] if asked else "stand",
        )

    def cuts_power(self, axes: Sequence[float], buttons: Sequence[int]) -> bool:
        """Whether the power switch is off; of channels that are refused for others, too."""
        device = self.device
        if (len(axes), len(buttons)) != (device.axes, device.buttons):
            return False  # who knows which of them is the switch
        if device.power.axis >= 0 and not _sound(axes[device.power.axis]):
            return False
        return self._on("power", device.power, axes, buttons) is False

    def _check(self, axes: Sequence[float], buttons: Sequence[int]) -> None:
        device = self.device
        for what, given, count in (
            ("axes", axes, device.axes),
            ("buttons", buttons, device.buttons),
        ):
            if len(given) != count:
                raise RadioError(f"/joy has {len(given)} {what}, the device file says {count}")
        for index, value in enumerate(axes):
            if not _sound(value):
                raise RadioError(f"/joy axis {index} = {value:g} is outside -1 .. 1")

    def _on(
        self, name: str, switch: Switch, axes: Sequence[float], buttons: Sequence[int]
    ) -> bool | None:
        if switch.axis >= 0:
            return axes[switch.axis] >= switch.above - 1e-3
        if switch.off_button < 0:
            return bool(buttons[switch.on_button])
        if buttons[switch.off_button]:
            self._latched[name] = False
        elif buttons[switch.on_button]:
            self._latched[name] = True
        return self._latched.get(name)


def _sound(value: float) -> bool:
    return abs(value) <= 1.001  # not so of NaN


def mapped(axis_map: AxisMap, value: float) -> float:
    """Set-point of an axis; continuous at the edge of the dead band, full at 1."""
    band = axis_map.dead_band
    beyond = max(0.0, min(1.0, abs(value)) - band) / (1.0 - band)
    if value >= 0.0:
        return axis_map.offset + axis_map.scale * beyond
    return axis_map.offset - (axis_map.scale_negative or axis_map.scale) * beyond


def clamped(name: str, value: float) -> float:
    """A set-point held within its range."""
    spec = RANGES["trims" if name in TRIMS else name]
    low = -math.inf if spec.low is None else spec.low
    high = math.inf if spec.high is None else spec.high
    return min(max(value, low), high)


def without_link(wish: Wish) -> Wish:
    """The same wishes once the link is gone: nothing moves any more, power stays as it was."""
    return replace_checked(wish, link=False, vx=0.0, vy=0.0, yaw_rate=0.0)
