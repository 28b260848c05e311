"""Positions of the legs' joints and soles, for whole recordings at once.

Forward kinematics on numpy arrays over time, from the table of `cassie_gaits.robot`. It is for
metrics and pictures; the control loop has its own model.
"""

from __future__ import annotations

import numpy as np

from cassie_bags.bag.rows import FloatArray
from cassie_gaits import robot
from cassie_gaits.names import LEG_JOINTS, LEGS

LEG_POINTS = (*LEG_JOINTS, "sole_tip", "sole_heel")
"""Points of `leg_points`, in order."""


def leg_points(joints: FloatArray) -> FloatArray:
    """Points of both legs in the pelvis frame.

    Args:
        joints: Joint angles q1..q7, left then right. Shape (n, 14), in rad.

    Returns:
        Origins of the joint frames and the two ends of the sole's centre line. Shape
        (n, 2, 9, 3): sample, leg, `LEG_POINTS`, axis. In m.
    """
    samples = len(joints)
    points = np.zeros((samples, len(LEGS), len(LEG_POINTS), 3))
    for leg_index, leg in enumerate(LEGS):
        links = {link.name: link for link in robot.leg_links(leg)}
        rotation = np.broadcast_to(np.eye(3), (samples, 3, 3))
        origin = np.zeros((samples, 3))
        for index, name in enumerate(LEG_JOINTS):
            link = links[name]
            angle = joints[:, 7 * leg_index + index] - link.joint.zero
            origin = origin + rotation @ np.array(link.position)
            rotation = rotation @ _axes(link) @ _about_z(angle)
            points[:, leg_index, index] = origin
        for index, contact in enumerate(robot.FOOT_CONTACTS):
            end = np.array(contact if leg == "left" else robot.mirror_vector(contact, 2))
            points[:, leg_index, len(LEG_JOINTS) + index] = origin + rotation @ end
    return points


def to_world(points: FloatArray, position: FloatArray, orientation: FloatArray) -> FloatArray:
    """Transform points from the pelvis frame to the world.

    Args:
        points: Points in the pelvis frame. Shape (n, ..., 3), in m.
        position: Pelvis origin. Shape (n, 3), in m.
        orientation: Rotation pelvis to world, quaternion x y z w. Shape (n, 4).

    Returns:
        Points in the world, in the shape of `points`. In m.
    """
    rotation = rotation_matrices(orientation)
    flat = points.reshape(len(points), -1, 3)
    moved: FloatArray = np.einsum("nij,nkj->nki", rotation, flat) + position[:, None, :]
    return np.reshape(moved, points.shape)


def rotation_matrices(orientation: FloatArray) -> FloatArray:
    """Rotation matrices of quaternions x y z w. Shape (n, 4) to (n, 3, 3)."""
    x, y, z, w = orientation.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def euler_angles(orientation: FloatArray) -> FloatArray:
    """Yaw, pitch and roll (z-y-x), yaw unwrapped over time. Shape (n, 4) to (n, 3), in rad."""
    matrices = rotation_matrices(orientation)
    yaw = np.unwrap(np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0]))
    pitch = np.arcsin(np.clip(-matrices[:, 2, 0], -1.0, 1.0))
    roll = np.arctan2(matrices[:, 2, 1], matrices[:, 2, 2])
    return np.stack([yaw, pitch, roll], axis=1)


def in_heading(vectors: FloatArray, yaw: FloatArray) -> FloatArray:
    """World vectors, shape (n, 3), in heading frames of yaw angles (rad): ahead, left, up."""
    x, y, z = vectors.T
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * x + s * y, c * y - s * x, z], axis=1)


def quaternions(angles: FloatArray) -> FloatArray:
    """Quaternions x y z w of yaw, pitch and roll (z-y-x, rad). Shape (n, 3) to (n, 4)."""
    (cy, cp, cr), (sy, sp, sr) = np.cos(0.5 * angles.T), np.sin(0.5 * angles.T)
    parts = [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
    return np.stack(parts, axis=1)


def _axes(link: robot.Link) -> FloatArray:
    x, y = np.array(link.x_axis), np.array(link.y_axis)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _about_z(angle: FloatArray) -> FloatArray:
    matrices = np.zeros((len(angle), 3, 3))
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(angle)
    matrices[:, 1, 0] = np.sin(angle)
    matrices[:, 0, 1] = -matrices[:, 1, 0]
    matrices[:, 2, 2] = 1.0
    return matrices
