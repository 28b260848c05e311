"""Bounds of every command, whatever law made it."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.errors import ControlError
from cassie_control.finite import LARGEST
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import KD_LIMIT, KP_LIMIT
from cassie_gaits.names import LEG_DRIVES, LEGS
from cassie_gaits.records import FloatArray
from cassie_msgs.layout import MotorCommand


@compiled
def clamp(values: FloatArray, low: FloatArray, high: FloatArray) -> int:
    """Clamp each value in place; returns the index of the first that is not finite, or -1.

    Args:
        values, low, high: Values and their bounds. Same shape (n,) and unit.
    """
    for i in range(values.size):
        if not math.isfinite(values[i]):
            return i
        values[i] = max(low[i], min(high[i], values[i]))
    return -1


MARGIN = math.radians(0.5)
"""Least distance of a set-point from its joint's stops. In rad."""


def stops() -> tuple[FloatArray, FloatArray]:
    """Lower and upper stop of each drive's joint.

    The knee's stops are `robot.KNEE_STOPS`.

    Returns:
        Two arrays in the order of the drives. Shape (10,), in rad.
    """
    low, high = [], []
    for leg in LEGS:
        joints = robot.stops(leg) | {"knee": robot.KNEE_STOPS}
        for drive in LEG_DRIVES:
            low.append(joints[drive][0])
            high.append(joints[drive][1])
    return np.array(low), np.array(high)


def _command_bounds() -> tuple[FloatArray, FloatArray]:
    low, high = stops()
    zero = np.zeros(len(low))
    largest = zero + LARGEST  # the motors themselves bound torque and speed
    lower = (-largest, low + MARGIN, -largest, zero, zero)
    upper = (largest, high - MARGIN, largest, zero + KP_LIMIT, zero + KD_LIMIT)
    return np.concatenate(lower), np.concatenate(upper)


_LOW, _HIGH = _command_bounds()


def limit(command: MotorCommand) -> None:
    """Keep a command within the drives' gains and `MARGIN` inside the joints' stops.

    Raises:
        ControlError: if a value is not finite; the message names it.
    """
    bad = clamp(command.floats, _LOW, _HIGH)
    if bad >= 0:
        field, drive = divmod(bad, len(command.torque))
        name = MotorCommand.LAYOUT[field][0]
        raise ControlError(f"command {name}[{drive}] is {command.floats[bad]}: not sent")
