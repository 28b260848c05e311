"""The Pinocchio tree of Cassie, with every rod as a body and open loops.

Velocities are in the order of the tree: x, y, z, yaw, pitch, roll (rates of the Euler angles of
eq:qdef), then left and right leg with the links of `robot.LEFT_LEG` in their order. `dynamics`
closes the loops and converts to the paper's coordinates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cassie_gaits import robot
from cassie_gaits.linkage import link_rotation, pin_in_target
from cassie_gaits.names import LEG_JOINTS, LEGS
from cassie_gaits.records import FloatArray, IntArray

BASE_SIZE = 6


@dataclass(frozen=True)
class Loop:
    """One loop closure of the tree.

    Attributes:
        tip: Frame at the rod's far end.
        pin: Frame at the point of the target to which the tip is pinned.
        follows: Indices in the tree's velocity that the closure determines.
    """

    tip: int
    pin: int
    follows: IntArray


@dataclass(frozen=True)
class Tree:
    """The open tree, and the indices of coordinates and frames in it.

    Attributes:
        model: `pinocchio.Model`.
        joints_q: Index in the tree's configuration of each of the 20 coordinates. Shape (20,).
        joints_v: Index in the tree's velocity of each of the 20 coordinates. Shape (20,).
        zeros: Coordinates at which the tree's configuration is zero. Shape (20,), in rad.
        balls_q: Index of the first element of each achilles rod's quaternion, left, right.
        heels_q: Index in the configuration of each heel spring, left, right.
        cranks_q: Index in the configuration of each foot crank, left, right.
        loops: Loop closures, two for the left leg, two for the right leg.
        soles: Frame at the middle of each sole, x to the tip, z up; left, right.
        toes: Frame of each toe joint, left, right.
    """

    model: Any
    joints_q: IntArray
    joints_v: IntArray
    zeros: FloatArray
    balls_q: tuple[int, int]
    heels_q: tuple[int, int]
    cranks_q: tuple[int, int]
    loops: tuple[Loop, ...]
    soles: tuple[int, int]
    toes: tuple[int, int]


def build_tree(gravity: float = 9.81, pelvis_link: robot.Link = robot.PELVIS) -> Tree:
    """Build the tree from the robot table.

    Args:
        gravity: Gravity. In m/s^2.
        pelvis_link: Link of the pelvis, such as a symmetric one.
    """
    model = pin.Model()
    model.name = "cassie"
    model.gravity = pin.Motion(np.array([0.0, 0.0, -gravity]), np.zeros(3))
    position = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "position")
    pelvis = model.addJoint(
        position, pin.JointModelSphericalZYX(), pin.SE3.Identity(), "orientation"
    )
    model.appendBodyToJoint(pelvis, _inertia(pelvis_link), pin.SE3.Identity())
    joints = {leg: _add_leg(model, pelvis, leg) for leg in LEGS}
    model.armature = _armature(model, joints)
    order = [joints[leg][name] for leg in LEGS for name in LEG_JOINTS]
    zeros = {link.name: link.joint.zero for link in robot.LEFT_LEG}
    base = list(range(BASE_SIZE))

    def first_q(name: str) -> tuple[int, int]:
        return (model.idx_qs[joints["left"][name]], model.idx_qs[joints["right"][name]])

    return Tree(
        model=model,
        joints_q=np.array(base + [model.idx_qs[joint] for joint in order]),
        joints_v=np.array(base + [model.idx_vs[joint] for joint in order]),
        zeros=np.array([0.0] * BASE_SIZE + [zeros[name] for _ in LEGS for name in LEG_JOINTS]),
        balls_q=first_q("achilles_rod"),
        heels_q=first_q("heel_spring"),
        cranks_q=first_q("foot_crank"),
        loops=tuple(_loop(model, joints[leg], leg, rod) for leg in LEGS for rod in robot.RODS),
        soles=(_sole(model, joints["left"], "left"), _sole(model, joints["right"], "right")),
        toes=(_toe(model, joints["left"], "left"), _toe(model, joints["right"], "right")),
    )


def _inertia(link: robot.Link) -> Any:
    xx, yy, zz, xy, xz, yz = link.inertia
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pin.Inertia(link.mass, np.array(link.com), matrix)


def _add_leg(model: Any, pelvis: int, leg: str) -> dict[str, int]:
    """Add the joints and bodies of a leg; the result maps each link to its joint."""
    joints = {"pelvis": pelvis}
    for link in robot.leg_links(leg):
        placement = pin.SE3(link_rotation(link), np.array(link.position))
        parent = joints[link.parent]
        if link.joint.kind == "fixed":
            model.appendBodyToJoint(parent, _inertia(link), placement)
            continue
        kind = pin.JointModelSpherical() if link.joint.kind == "ball" else pin.JointModelRZ()
        joints[link.name] = model.addJoint(parent, kind, placement, f"{leg}_{link.name}")
        model.appendBodyToJoint(joints[link.name], _inertia(link), pin.SE3.Identity())
    del joints["pelvis"]
    return joints


def _armature(model: Any, joints: dict[str, dict[str, int]]) -> FloatArray:
    armature = np.zeros(model.nv)
    for leg in LEGS:
        for link in robot.leg_links(leg):
            if link.name in joints[leg]:
                armature[model.idx_vs[joints[leg][link.name]]] = link.joint.armature
    return armature


def _loop(model: Any, joints: dict[str, int], leg: str, rod: robot.Rod) -> Loop:
    in_target = pin_in_target(rod)
    if leg == "right":
        in_target = in_target * (1.0, 1.0, -1.0)
    tip = _frame(model, joints[rod.rod], f"{leg}_{rod.rod}_tip", np.array([rod.length, 0.0, 0.0]))
    target = _frame(model, joints[rod.target], f"{leg}_{rod.rod}_pin", in_target)
    first = model.idx_vs[joints[rod.rod]]
    if rod.rod == "achilles_rod":
        # The pin does not determine the rod's spin about its own x axis; that spin is zero.
        follows = [first + 1, first + 2, model.idx_vs[joints["heel_spring"]]]
    else:
        follows = [model.idx_vs[joints["foot_crank"]], first]
    return Loop(tip, target, np.array(follows))


def _sole(model: Any, joints: dict[str, int], leg: str) -> int:
    # With q4 + q5 + q6 = 13 degrees the foot is level if toe, tarsus and hip pitch sum to
    # -50 degrees from a thigh that points down: ahead is then at 140 degrees in the toe frame.
    ahead = np.array([math.cos(math.radians(140.0)), math.sin(math.radians(140.0)), 0.0])
    heel, tip = sorted((np.array(point) for point in robot.FOOT_CONTACTS), key=ahead.dot)
    forward = (tip - heel) / np.linalg.norm(tip - heel)
    left = np.array([0.0, 0.0, -1.0])
    rotation = np.column_stack([forward, left, np.cross(forward, left)])
    return _frame(model, joints["toe"], f"{leg}_sole", 0.5 * (heel + tip), rotation)


def _toe(model: Any, joints: dict[str, int], leg: str) -> int:
    return _frame(model, joints["toe"], f"{leg}_toe_joint", np.zeros(3))


def _frame(
    model: Any, joint: int, name: str, position: FloatArray, rotation: FloatArray | None = None
) -> int:
    placement = pin.SE3(np.eye(3) if rotation is None else rotation, position)
    return int(model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME)))
