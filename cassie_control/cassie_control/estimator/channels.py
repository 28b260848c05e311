"""Channels of the sensors by name, and their bits in `RobotState.sensor_faults`."""

from __future__ import annotations

from cassie_gaits.names import DRIVES, SENSED_JOINTS

_AXES = ("x", "y", "z")

CHANNELS: tuple[tuple[str, str], ...] = (
    ("orientation", "IMU"),
    *((f"angular_velocity.{i}", f"IMU {axis}") for i, axis in enumerate(_AXES)),
    *((f"linear_acceleration.{i}", f"IMU {axis}") for i, axis in enumerate(_AXES)),
    *((f"drive_position.{i}", name) for i, name in enumerate(DRIVES)),
    *((f"drive_velocity.{i}", name) for i, name in enumerate(DRIVES)),
    *((f"joint_position.{i}", name) for i, name in enumerate(SENSED_JOINTS)),
    *((f"joint_velocity.{i}", name) for i, name in enumerate(SENSED_JOINTS)),
    *((f"drive_torque.{i}", name) for i, name in enumerate(DRIVES)),
)
"""Field of Sensors with its index, and the part that it measures, in the order of the bits."""

_FIELDS = [name.partition(".")[0] for name, _ in CHANNELS]

ORIENTATION = _FIELDS.index("orientation")
GYRO = _FIELDS.index("angular_velocity")
ACCELEROMETER = _FIELDS.index("linear_acceleration")
DRIVE_POSITION, DRIVE_VELOCITY = _FIELDS.index("drive_position"), _FIELDS.index("drive_velocity")
JOINT_POSITION, JOINT_VELOCITY = _FIELDS.index("joint_position"), _FIELDS.index("joint_velocity")
DRIVE_TORQUE = _FIELDS.index("drive_torque")
"""Bit of the first channel of each field."""

ACCELEROMETER_BITS = 0b111 << ACCELEROMETER
"""Bits of the accelerometer's three axes."""


def names(mask: int) -> tuple[str, ...]:
    """Names of the channels whose bits are set: "drive_position.3 (left_knee)"."""
    return tuple(f"{name} ({part})" for k, (name, part) in enumerate(CHANNELS) if mask >> k & 1)


def no_estimate(missing: int) -> str:
    """Message that there is no estimate, and what to do about it.

    Args:
        missing: Channels without which there is no estimate, a bit each.
    """
    return (
        f"no estimate without {', '.join(names(missing))}: switch the power off and hang it up or "
        "let it lie still for 1 s; its sensors are then checked anew"
    )
