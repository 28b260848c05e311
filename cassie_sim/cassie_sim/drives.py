"""The ten drives: impedance law, torque-speed bound, delay, watchdog and power switch."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.names import DRIVES, LEG_DRIVES
from cassie_msgs.layout import MotorCommand
from cassie_sim.errors import CommandError
from cassie_sim.kernels import damp, drive_step, take_set_points
from cassie_sim.plant_records import DRIVES_TYPE

FloatArray = npt.NDArray[np.float64]

LIMITS = {
    "torque": (-1e6, 1e6),
    "position": (-1e6, 1e6),
    "velocity": (-1e6, 1e6),
    "kp": (0.0, 5000.0),
    "kd": (0.0, 500.0),
}
"""What a drive accepts in each field of a command: Nm, rad, rad/s, Nm/rad, Nms/rad.

For the first three that is anything that a sum of them can hold: the motor bounds the torque.
The order is that of `MotorCommand`.
"""

DAMPING = np.tile([4.0, 4.0, 8.0, 8.0, 2.0], 2)
"""Damping that the drives apply on their own when they get no valid command. In Nms/rad."""

_LOW, _HIGH = (np.array(ends) for ends in zip(*LIMITS.values(), strict=True))


class Drives:
    """Set-points in, joint torques out, at the rate of the physics.

    Each drive runs u = torque + kp (position - q) + kd (velocity - v). The motor bounds it to
    min(u_max, 2 u_max (1 - |v| / v_max)), never below 0, and it takes effect `delay` later.
    Without power the torque is zero at once. While damped (no command for `watchdog`, or a
    refused one) the drives run u = -DAMPING v until the next valid command.

    Args:
        period: Length of a physics step. In s.
        delay: From a set torque to its effect. In s, rounded to physics steps.
        torque_constant: Ratio of real to nominal torque of each drive. Shape (10,).
        watchdog: Time without a command after which the drives damp. In s.

    Attributes:
        records: All its numbers, of `DRIVES_TYPE`. Shape (1,).
        pipeline: Torques under way, one row a physics step. Shape (steps + 1, 10), in Nm.
        applied: Torques that act now. Shape (10,), in Nm.

    Source:
        Torque-speed bound and 3 ms delay of the public Cassie simulators.
    """

    def __init__(
        self, period: float, delay: float, torque_constant: FloatArray, watchdog: float
    ) -> None:
        drives = [robot.DRIVES[name] for name in LEG_DRIVES] * 2
        self.records = np.zeros(1, DRIVES_TYPE)
        self._record = record = self.records[0]
        record["torque_limit"] = [drive.torque_limit for drive in drives]
        record["speed_limit"] = [drive.speed_limit for drive in drives]
        record["torque_constant"] = torque_constant
        record["damping"] = DAMPING
        record["timeout"] = round(watchdog / period)
        self.pipeline = np.zeros((max(0, round(delay / period)) + 1, 10))
        self.applied: FloatArray = record["applied"]
        self._powered, self._damped = self.records["powered"], self.records["damped"]
        self.reset()

    @property
    def powered(self) -> bool:
        """Whether the drives have power."""
        return bool(self._powered[0])

    @powered.setter
    def powered(self, on: bool) -> None:
        self._powered[0] = on

    @property
    def damped(self) -> bool:
        """Whether the drives damp for want of a valid command."""
        return bool(self._damped[0])

    def reset(self) -> None:
        """Back to no power, no set-points and nothing under way."""
        self.pipeline[:] = 0.0
        self.applied[:] = 0.0
        self.powered = False
        self._record["age"] = 0
        self.damp()

    def damp(self) -> None:
        """Replace the set-points by pure damping until the next valid command."""
        damp(self.records)

    def set_points(self, command: MotorCommand) -> None:
        """Take over the set-points of a command.

        Raises:
            CommandError: if a value is not finite or a gain is out of range; the set-points
                stay as they were.
        """
        if not take_set_points(self.records, command.floats, _LOW, _HIGH):
            raise CommandError(f"motor command refused: {_refusal(command)}")

    def step(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """Torques that act in this physics step.

        Args:
            position: Measured drive positions. Shape (10,), in rad.
            velocity: Measured drive velocities. Shape (10,), in rad/s.

        Returns:
            Joint torques. Shape (10,), in Nm. The array is reused.
        """
        drive_step(self.records, self.pipeline, position, velocity)
        return self.applied


def _refusal(command: MotorCommand) -> str:
    for field, (low, high) in LIMITS.items():
        for name, value in zip(DRIVES, getattr(command, field).tolist(), strict=True):
            if not math.isfinite(value):
                return f"{field} of {name} is {value}, must be finite"
            if not low <= value <= high:
                return f"{field} of {name} is {value:g}, must be {low:g} .. {high:g}"
    return "a value is out of range"
