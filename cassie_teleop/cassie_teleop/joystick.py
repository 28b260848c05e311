"""Gamepads and radios on this computer, through SDL without a window."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# Use the kernel's order of axes and buttons, whether or not this user may open the device itself.
os.environ.setdefault("SDL_JOYSTICK_HIDAPI", "0")
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")


class JoystickError(OSError):
    """There is no such device, or no device at all, or the device is gone."""


@dataclass(frozen=True)
class Reading:
    """Axes in -1 .. 1, left and up positive, then two axes for each hat; buttons 0 or 1."""

    axes: list[float]
    buttons: list[int]


class Joystick:
    """One device, found by number or by part of its name.

    Raises:
        JoystickError: at construction, if there is no such device; the message lists all devices.
    """

    def __init__(self, wanted: str) -> None:
        """Open the device; an empty `wanted` is the first one."""
        import pygame

        self._pygame = pygame
        pygame.display.init()
        pygame.joystick.init()
        devices = [pygame.joystick.Joystick(i) for i in range(pygame.joystick.get_count())]
        self._device = chosen(devices, wanted)
        self.name: str = self._device.get_name()

    def read(self) -> Reading:
        """Present state of the device; call this from the thread that opened it.

        Raises:
            JoystickError: if the device was unplugged.
        """
        for event in self._pygame.event.get():
            removed = event.type == self._pygame.JOYDEVICEREMOVED
            if removed and event.instance_id == self._device.get_instance_id():
                raise JoystickError(f"{self.name} was unplugged")
        return reading(self._device)

    def close(self) -> None:
        """Release the device."""
        self._pygame.joystick.quit()
        self._pygame.display.quit()


def reading(device: Any) -> Reading:
    """State of an SDL device with ROS's signs. SDL counts right and down, for hats right and up."""
    axes = [0.0 - device.get_axis(i) for i in range(device.get_numaxes())]
    for index in range(device.get_numhats()):
        right, up = device.get_hat(index)
        axes += [0.0 - right, float(up)]
    buttons = [int(device.get_button(i)) for i in range(device.get_numbuttons())]
    return Reading([min(1.0, max(-1.0, value)) for value in axes], buttons)


def chosen(devices: list[Any], wanted: str) -> Any:
    """The device with number `wanted` or `wanted` in its name; the first if `wanted` is empty.

    Raises:
        JoystickError: if there is no such device; the message lists all devices.
    """
    if not devices:
        raise JoystickError(
            "no joystick found: is it plugged in, and may this user read /dev/input/event*?"
        )
    if wanted.isdigit() and int(wanted) < len(devices):
        return devices[int(wanted)]
    for device in devices:
        if not wanted.isdigit() and wanted.lower() in device.get_name().lower():
            return device
    there = ", ".join(f"{i}: {device.get_name()}" for i, device in enumerate(devices))
    raise JoystickError(f"device = {wanted}: no such joystick; there are {there}")
