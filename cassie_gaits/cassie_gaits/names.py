"""Names and orders of joints, drives and coordinates, used by every package.

Orders are fixed once: left before right, and along a leg from hip to toe.
"""

from __future__ import annotations

LEGS = ("left", "right")
LEG_JOINTS = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "shin", "tarsus", "toe")
LEG_DRIVES = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "toe")
HIP_ROLL, HIP_YAW, HIP_PITCH, KNEE, SHIN, TARSUS, TOE = range(7)
"""Places in `LEG_JOINTS`; the first four are places in `LEG_DRIVES`, too."""

TOE_DRIVE = LEG_DRIVES.index("toe")
"""Place of the toe in `LEG_DRIVES`."""

LEG_DRIVE_COUNT = len(LEG_DRIVES)
"""Drives of a leg: in arrays over drives those of leg `i` begin at `LEG_DRIVE_COUNT * i`."""

LEG_SENSED_JOINTS = ("shin", "tarsus", "toe")

BASE_COORDINATES = ("x", "y", "z", "yaw", "pitch", "roll")

JOINTS = tuple(f"{leg}_{joint}" for leg in LEGS for joint in LEG_JOINTS)
"""The 14 joints of eq:qbody."""

DRIVES = tuple(f"{leg}_{drive}" for leg in LEGS for drive in LEG_DRIVES)
"""The 10 drives in the order of every command and sensor sample."""

SENSED_JOINTS = tuple(f"{leg}_{joint}" for leg in LEGS for joint in LEG_SENSED_JOINTS)
"""The 6 joints with an encoder at the joint."""

COORDINATES = BASE_COORDINATES + JOINTS
"""The 20 coordinates of eq:qdef."""

DRIVE_IN_Q = tuple(COORDINATES.index(name) for name in DRIVES)
"""Index in q of each drive's joint. Length 10."""
