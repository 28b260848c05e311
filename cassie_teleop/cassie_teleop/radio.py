"""Conversion of the channels of a radio or gamepad to requests."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from cassie_msgs.request import Request
from cassie_msgs.tunables import replace_checked
from cassie_teleop.device import AxisMap, Device, Switch
from cassie_teleop.requests import TRIMS, clamped


class RadioError(ValueError):
    """Invalid channels: wrong number, not finite or outside -1 .. 1."""


class Radio:
    """Reads channels by the device file; keeps the state of latched buttons."""

    def __init__(self, device: Device) -> None:
        """Begin without latched buttons."""
        self.device = device
        self._latched: dict[str, bool] = {}
        self._touched: set[int] = set()

    def read(self, axes: Sequence[float], buttons: Sequence[int]) -> Request | None:
        """The request for one set of channels.

        Args:
            axes: Values in -1 .. 1, as many as the device has.
            buttons: Values, 0 or 1 each.

        Returns:
            The request; None while power is switched by buttons and neither was pressed
            yet, so that the start of a program does not cut the power.

        Raises:
            RadioError: naming the channel, its value and the expected value.
        """
        self._check(axes, buttons)
        device = self.device
        axes = self._rested(axes)
        power = self._on("power", device.power, axes, buttons)
        if not power:
            for name in device.mode:  # power comes on only in mode stand
                self._latched.pop(name, None)
        asked = [name for name, on in device.mode.items() if self._on(name, on, axes, buttons)]
        if power is None:
            return None
        held, turbo = self.held(buttons)
        moves = {"vx", "vy", "yaw_rate"}
        values = {
            name: clamped(name, mapped(axis_map, axes[axis_map.axis], turbo))
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

    def records(self, axes: Sequence[float], buttons: Sequence[int]) -> bool | None:
        """Whether the switch asks for a recording, by channels that were read.

        None if there is no such switch, or its buttons were not pressed yet.
        """
        switch = self.device.record
        return None if switch is None else self._on("record", switch, axes, buttons)

    def held(self, buttons: Sequence[int]) -> tuple[bool, bool]:
        """Whether a button that lets the robot move is held, and whether it is the turbo button."""
        enable, turbo = self.device.enable_button, self.device.enable_turbo_button
        fast = turbo is not None and bool(buttons[turbo])
        free = enable is None and turbo is None
        return free or fast or (enable is not None and bool(buttons[enable])), fast

    def _rested(self, axes: Sequence[float]) -> list[float]:
        """Axes with untouched triggers set to 1, their value at rest; drivers report 0 for them."""
        values = list(axes)
        for axis in self.device.triggers:
            if values[axis] != 0.0:
                self._touched.add(axis)
            elif axis not in self._touched:
                values[axis] = 1.0
        return values

    def cuts_power(self, axes: Sequence[float], buttons: Sequence[int]) -> bool:
        """Whether the power switch is off, also if other channels are invalid."""
        device = self.device
        if len(axes) not in device.axes or len(buttons) not in device.buttons:
            return False  # it is unknown which channel is the switch
        if device.power.axis >= 0 and not _sound(axes[device.power.axis]):
            return False
        return self._on("power", device.power, axes, buttons) is False

    def _check(self, axes: Sequence[float], buttons: Sequence[int]) -> None:
        device = self.device
        for what, given, counts in (
            ("axes", axes, device.axes),
            ("buttons", buttons, device.buttons),
        ):
            if len(given) not in counts:
                said = " or ".join(map(str, counts))
                raise RadioError(f"/joy has {len(given)} {what}, the device file says {said}")
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
    return abs(value) <= 1.001  # false for NaN


def mapped(axis_map: AxisMap, value: float, turbo: bool = False) -> float:
    """Set-point of an axis; continuous at the edge of the dead band, full at 1.

    Args:
        axis_map: Meaning of the axis.
        value: Value of the axis, -1 .. 1.
        turbo: Whether the turbo button is held.
    """
    band = axis_map.dead_band
    if turbo and axis_map.scale_turbo and axis_map.scale:
        ratio = axis_map.scale_turbo / axis_map.scale
        axis_map = dataclasses.replace(
            axis_map,
            scale=axis_map.scale_turbo,
            scale_negative=axis_map.scale_negative * ratio,
        )
    beyond = max(0.0, min(1.0, abs(value)) - band) / (1.0 - band)
    if value >= 0.0:
        return axis_map.offset + axis_map.scale * beyond
    return axis_map.offset - (axis_map.scale_negative or axis_map.scale) * beyond
