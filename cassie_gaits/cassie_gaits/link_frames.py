"""The robot's tree of frames: the pose of each link in its parent, for the URDF and for /tf.

A URDF is a tree of hinges. The achilles rods, heel springs, foot cranks and plantar rods close
loops and have no encoder: the closed forms of `linkage` give their angles from the measured joints.
An achilles rod's ball joint is modelled as a hinge perpendicular to the leg's plane. The rod's tip
is then up to 0.8 mm away from the heel spring's tip, for deflections of that spring up to 0.1 rad.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.errors import KinematicsError
from cassie_gaits.linkage import (
    HeelLoop,
    crank_angles,
    heel_deflection,
    heel_loop,
    link_rotation,
)
from cassie_gaits.names import LEG_JOINTS, LEGS
from cassie_gaits.records import FloatArray, Records

ODOM_FRAME, BASE_FRAME, IMU_FRAME = "odom", "base_link", "imu_link"
"""Names after REP-105 and REP-120."""


@dataclass(frozen=True, eq=False)
class LinkFrame:
    """A link's frame in the tree.

    Attributes:
        name: Name of the frame, and of the link in the URDF.
        parent: Name of the parent frame.
        joint: Name of the joint between the two, as in /joint_states if it has an encoder.
        position: Origin in the parent's frame. Shape (3,), in m.
        rotation: Orientation in the parent's frame at joint angle zero. Shape (3, 3).
        axis: Unit vector of the hinge in the link's frame, or None if it is fixed. Shape (3,).
        leg: "left", "right" or, for the IMU, "".
        link: Link with its parameters; None for the IMU, whose mass is part of the pelvis.
    """

    name: str
    parent: str
    joint: str
    position: FloatArray
    rotation: FloatArray
    axis: FloatArray | None
    leg: str = ""
    link: robot.Link | None = None

    @property
    def rest(self) -> FloatArray:
        """Position in m and quaternion x, y, z, w in the parent at joint angle zero. (7,)."""
        return np.concatenate([self.position, _quaternion(self.rotation)])


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Unit quaternion x, y, z, w of a rotation matrix. Shape (4,).

    Source:
        Bar-Itzhack 2000, New method for extracting the quaternion from a rotation matrix: the
        eigenvector of the greatest eigenvalue of a symmetric matrix.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    matrix = np.array(
        [
            [xx - yy - zz, xy + yx, xz + zx, zy - yz],
            [xy + yx, yy - xx - zz, yz + zy, xz - zx],
            [xz + zx, yz + zy, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    quaternion: FloatArray = np.linalg.eigh(matrix)[1][:, -1]
    return quaternion


def _leg_frame(leg: str, link: robot.Link) -> LinkFrame:
    rotation, axis = link_rotation(link), np.array([0.0, 0.0, 1.0])
    if link.joint.kind == "ball":
        axis = rotation[2]  # perpendicular to the leg's plane
    # The table gives the pose at `joint.zero`; turn it back about the joint's axis.
    cosine, sine = math.cos(link.joint.zero), math.sin(link.joint.zero)
    back = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return LinkFrame(
        name=f"{leg}_{link.name}_link",
        parent=BASE_FRAME if link.parent == "pelvis" else f"{leg}_{link.parent}_link",
        joint=f"{leg}_{link.name}",
        position=np.array(link.position),
        rotation=rotation @ back,
        axis=None if link.joint.kind == "fixed" else axis,
        leg=leg,
        link=link,
    )


_IMU = LinkFrame(IMU_FRAME, BASE_FRAME, "imu", np.array(robot.IMU_POSITION), np.eye(3), None)

FRAMES = (_IMU, *(_leg_frame(leg, link) for leg in LEGS for link in robot.leg_links(leg)))
"""Every frame below `BASE_FRAME`, parents before children."""

FIXED_FRAMES = tuple(frame for frame in FRAMES if frame.axis is None)
MOVING_FRAMES = tuple(frame for frame in FRAMES if frame.axis is not None)
"""Frames with a hinge, left leg before right, each with the same links in the same order."""

_LEG = [frame.link.name for frame in MOVING_FRAMES if frame.link and frame.leg == "left"]
_MEASURED = [_LEG.index(name) for name in LEG_JOINTS]
_CRANK_AND_ROD = [_LEG.index("foot_crank"), _LEG.index("plantar_rod")]
_HEEL_AND_ROD = [_LEG.index("heel_spring"), _LEG.index("achilles_rod")]


class LinkPoses:
    """Poses of the base in the world and of all moving links in their parents.

    If a rod does not reach, which joints out of their range may cause, the links of its loop
    without an encoder keep their last pose.
    """

    def __init__(self) -> None:
        self._rests = np.array([frame.rest for frame in MOVING_FRAMES])
        self._axes = np.array([frame.axis for frame in MOVING_FRAMES])
        self._angles = np.zeros((len(LEGS), len(_LEG)))
        self._poses = np.zeros((1 + len(MOVING_FRAMES), 7))
        self._loop = heel_loop().records
        (rod,) = (link for link in robot.LEFT_LEG if link.name == "achilles_rod")
        self._rod_zero = math.atan2(rod.x_axis[1], rod.x_axis[0])

    def at(self, q: FloatArray) -> FloatArray:
        """Poses at the coordinates of eq:qdef.

        Args:
            q: Coordinates. Shape (20,), in m and rad.

        Returns:
            Position in m and quaternion x, y, z, w: of the base in the world, then of
            `MOVING_FRAMES` in their parents. Shape (23, 7); valid until the next call.
        """
        for leg, angles in enumerate(self._angles):
            angles[_MEASURED] = joints = q[6 + 7 * leg : 13 + 7 * leg]
            *_, knee, shin, tarsus, toe = joints.tolist()
            with suppress(KinematicsError):
                angles[_CRANK_AND_ROD] = crank_angles(toe)
            heel, rod = _heel_and_rod(knee, shin, tarsus, self._loop)
            if math.isfinite(heel):
                angles[_HEEL_AND_ROD] = heel, rod - self._rod_zero
        _place_base(q, self._poses[0])
        _turn_links(self._rests, self._axes, self._angles.ravel(), self._poses[1:])
        return self._poses


@compiled
def _heel_and_rod(
    knee: float, shin: float, tarsus: float, loops: Records[HeelLoop]
) -> tuple[float, float]:
    """Deflection of the heel spring and direction of the achilles rod.

    Args:
        knee: q4. In rad.
        shin: q5. In rad.
        tarsus: q6. In rad.
        loops: See `linkage.heel_loop`. Shape (1,).

    Returns:
        Angle of the spring, and angle of the rod in the plane of the leg, from the hip pitch link's
        x axis. In rad; NaN if the rod does not reach.
    """
    loop = loops[0]
    heel = heel_deflection(knee, shin, tarsus, loop)[0]
    c, s = math.cos(heel), math.sin(heel)
    x = loop.heel[0] + loop.still[0] + loop.cosine[0] * c + loop.sine[0] * s
    y = loop.heel[1] + loop.still[1] + loop.cosine[1] * c + loop.sine[1] * s
    # From the tip in the tarsus link up to the hip pitch link: rotate, then translate.
    for turn, joint in (
        (tarsus + loop.tarsus_turn - loop.knee_turn, loop.tarsus),
        (shin, loop.shin),
        (knee + loop.knee_turn, loop.knee),
    ):
        c, s = math.cos(turn), math.sin(turn)
        x, y = joint[0] + c * x - s * y, joint[1] + s * x + c * y
    return heel, math.atan2(y - loop.base[1], x - loop.base[0])


@compiled
def _place_base(q: FloatArray, pose: FloatArray) -> None:
    cy, sy = math.cos(0.5 * q[3]), math.sin(0.5 * q[3])
    cp, sp = math.cos(0.5 * q[4]), math.sin(0.5 * q[4])
    cr, sr = math.cos(0.5 * q[5]), math.sin(0.5 * q[5])
    pose[:3] = q[:3]
    pose[3] = cy * cp * sr - sy * sp * cr
    pose[4] = cy * sp * cr + sy * cp * sr
    pose[5] = sy * cp * cr - cy * sp * sr
    pose[6] = cy * cp * cr + sy * sp * sr


@compiled
def _turn_links(rests: FloatArray, axes: FloatArray, angles: FloatArray, poses: FloatArray) -> None:
    """Write the poses (n, 7) of links: rest poses (n, 7), rotated about their axes (n, 3)."""
    for i in range(len(angles)):
        c, s = math.cos(0.5 * angles[i]), math.sin(0.5 * angles[i])
        x, y, z = s * axes[i, 0], s * axes[i, 1], s * axes[i, 2]
        rx, ry, rz, rw = rests[i, 3], rests[i, 4], rests[i, 5], rests[i, 6]
        poses[i, :3] = rests[i, :3]
        poses[i, 3] = rw * x + rx * c + ry * z - rz * y
        poses[i, 4] = rw * y - rx * z + ry * c + rz * x
        poses[i, 5] = rw * z + rx * y - ry * x + rz * c
        poses[i, 6] = rw * c - rx * x - ry * y - rz * z
