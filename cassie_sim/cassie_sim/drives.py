"""The ten drives: impedance law, torque-speed limit, delay, watchdog and power switch."""

from __future__ import annotations

import math

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import DAMPING, KD_LIMIT, KP_LIMIT
from cassie_gaits.names import DRIVES, LEG_DRIVES
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array, whole
from cassie_msgs.layout import MotorCommand
from cassie_sim.errors import CommandError


class DriveNumbers(Record):
    """The ten drives, see `Drives`.

    Attributes:
        torque, position, velocity, kp, kd: Set-points. In Nm, rad, rad/s, Nm/rad and Nms/rad.
        damping: kd while damped. In Nms/rad.
        torque_limit, speed_limit: Largest torque, and speed without load. In Nm and rad/s.
        torque_constant: Ratio of real to nominal torque.
        applied: Torques that act now. In Nm.
        head: Row of the delayed torques to fill next.
        age, timeout: Physics steps since the last valid command, and the number of steps after
            which the drives damp.
        powered, damped: Whether the drives have power, and whether they damp. 1 or 0.
    """

    torque: FloatArray = array(10)
    position: FloatArray = array(10)
    velocity: FloatArray = array(10)
    kp: FloatArray = array(10)
    kd: FloatArray = array(10)
    damping: FloatArray = array(10)
    torque_limit: FloatArray = array(10)
    speed_limit: FloatArray = array(10)
    torque_constant: FloatArray = array(10)
    applied: FloatArray = array(10)
    head: int = whole()
    age: int = whole()
    timeout: int = whole()
    powered: int = whole()
    damped: int = whole()


@compiled
def take_set_points(
    drives: Records[DriveNumbers], commands: RecordArray, low: FloatArray, high: FloatArray
) -> bool:
    """Whether the set-points of a command are within their limits; if so, the drives take them.

    Args:
        drives: Drives, changed in place. Shape (1,).
        commands: `MotorCommand.record`; NaN is in no range. Shape (1,).
        low, high: Limits of each field of a command. Shape (5,).
    """
    drive, command = drives[0], commands[0]
    for i in range(10):
        torque, position, velocity = command.torque[i], command.position[i], command.velocity[i]
        fields = (torque, position, velocity, command.kp[i], command.kd[i])
        for k in range(len(fields)):
            if not low[k] <= fields[k] <= high[k]:
                return False
    drive.torque[:], drive.position[:] = command.torque, command.position
    drive.velocity[:], drive.kp[:], drive.kd[:] = command.velocity, command.kp, command.kd
    drive.age = 0
    drive.damped = 0
    return True


@compiled
def damp(drives: Records[DriveNumbers]) -> None:
    """Replace the set-points by pure damping."""
    drive = drives[0]
    drive.torque[:] = drive.position[:] = drive.velocity[:] = drive.kp[:] = 0.0
    drive.kd[:] = drive.damping
    drive.damped = 1


@compiled
def drive_step(
    drives: Records[DriveNumbers], pipeline: FloatArray, position: FloatArray, velocity: FloatArray
) -> None:
    """Compute one step of the drives: watchdog, impedance law, torque-speed limit, delay, power.

    Args:
        drives: Drives; `applied` gets the torques that act now. Shape (1,).
        pipeline: Delayed torques, one row per physics step. Shape (steps + 1, 10), in Nm.
        position: Measured positions. Shape (10,), in rad.
        velocity: Measured velocities. Shape (10,), in rad/s.
    """
    drive = drives[0]
    if drive.age >= drive.timeout and not drive.damped:
        damp(drives)
    drive.age += 1
    head, rows = drive.head, pipeline.shape[0]
    following = head + 1 if head + 1 < rows else 0
    for i in range(10):
        u = (
            drive.torque[i]
            + drive.kp[i] * (drive.position[i] - position[i])
            + drive.kd[i] * (drive.velocity[i] - velocity[i])
        )
        limit = drive.torque_limit[i]
        bound = 2.0 * limit * (1.0 - abs(velocity[i]) / drive.speed_limit[i])
        bound = max(0.0, min(limit, bound))
        pipeline[head, i] = max(-bound, min(bound, u))
        drive.applied[i] = pipeline[following, i] * drive.torque_constant[i]
    drive.head = following
    if not drive.powered:
        pipeline[:] = 0.0
        drive.applied[:] = 0.0


@compiled
def drive_steps(
    drives: Records[DriveNumbers], pipeline: FloatArray, seen: FloatArray, steps: int
) -> None:
    """Call `drive_step` for each step of `physics_steps`, with its measurements `seen`."""
    for k in range(steps):
        drive_step(drives, pipeline, seen[k, :10], seen[k, 10:])


LIMITS = {
    "torque": (-1e6, 1e6),
    "position": (-1e6, 1e6),
    "velocity": (-1e6, 1e6),
    "kp": (0.0, KP_LIMIT),
    "kd": (0.0, KD_LIMIT),
}
"""Range of each field of a command: Nm, rad, rad/s, Nm/rad, Nms/rad.

For the first three that is any number whose sum does not overflow: the motor bounds the torque.
The order is that of `MotorCommand`.
"""

_LOW, _HIGH = (np.array(ends) for ends in zip(*LIMITS.values(), strict=True))


class Drives:
    """Joint torques from set-points, at the rate of the physics.

    Each drive computes u = torque + kp (position - q) + kd (velocity - v). The motor bounds u to
    min(u_max, 2 u_max (1 - |v| / v_max)), never below 0. The torque takes effect `delay` later.
    Without power the torque is zero at once. While damped (no command for `watchdog`, or a
    refused command) the drives compute u = -DAMPING v until the next valid command.

    Args:
        period: Length of a physics step. In s.
        delay: Latency from a commanded torque to its effect. In s, rounded to physics steps.
        torque_constant: Ratio of real to nominal torque of each drive. Shape (10,).
        watchdog: Time without a command after which the drives damp. In s.

    Attributes:
        records: All numbers of the drives, `DriveNumbers`. Shape (1,).
        pipeline: Delayed torques, one row per physics step. Shape (steps + 1, 10), in Nm.
        applied: Torques that act now. Shape (10,), in Nm.

    Source:
        Torque-speed limit and 3 ms delay of the public Cassie simulators.
    """

    def __init__(
        self, period: float, delay: float, torque_constant: FloatArray, watchdog: float
    ) -> None:
        drives = [robot.DRIVES[name] for name in LEG_DRIVES] * 2
        self._numbers = numbers = DriveNumbers()
        self.records = numbers.records
        numbers.torque_limit[:] = [drive.torque_limit for drive in drives]
        numbers.speed_limit[:] = [drive.speed_limit for drive in drives]
        numbers.torque_constant[:], numbers.damping[:] = torque_constant, DAMPING
        numbers.timeout = round(watchdog / period)
        self.pipeline = np.zeros((max(0, round(delay / period)) + 1, 10))
        self.applied: FloatArray = numbers.applied
        self.reset()

    @property
    def powered(self) -> bool:
        """Whether the drives have power."""
        return bool(self._numbers.powered)

    @powered.setter
    def powered(self, on: bool) -> None:
        self._numbers.powered = int(on)

    @property
    def damped(self) -> bool:
        """Whether the drives damp because there is no valid command."""
        return bool(self._numbers.damped)

    def reset(self) -> None:
        """Reset the drives: no power, no set-points and no delayed torques."""
        self.pipeline[:] = 0.0
        self.applied[:] = 0.0
        self.powered = False
        self._numbers.age = 0
        self.damp()

    def damp(self) -> None:
        """Replace the set-points by pure damping until the next valid command."""
        damp(self.records)

    def set_points(self, command: MotorCommand) -> None:
        """Take the set-points of a command.

        Raises:
            CommandError: if a value is not finite or a gain is out of range; the set-points
                are then not changed.
        """
        if not take_set_points(self.records, command.record, _LOW, _HIGH):
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
