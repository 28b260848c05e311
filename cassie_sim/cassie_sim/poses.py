"""Poses of the MuJoCo model with closed kinematic loops."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from cassie_gaits.linkage import achilles_turn
from cassie_gaits.names import DRIVES, LEGS
from cassie_gaits.records import FloatArray
from cassie_gaits.robot import NEUTRAL_TARSUS
from cassie_sim.errors import SimulationError
from cassie_sim.ground import GROUND_GROUP

_PASSIVE = ("tarsus", "heel_spring", "achilles_rod", "plantar_rod", "foot_crank")


def set_drives(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    drives: Sequence[float] | FloatArray,
    *,
    springs: tuple[float, float] = (0.0, 0.0),
) -> None:
    """Put the legs into a pose with closed loops; the pelvis is not moved.

    Args:
        model: Robot, alone or in a scene.
        data: State of the model; `qpos` is changed, velocities are not.
        drives: Drive positions, left then right. Shape (10,), in rad.
        springs: Deflections of shin and heel spring of both legs. In rad.

    Raises:
        SimulationError: if a drive position is not finite, or no pose closes the loops within a
            micrometre.
    """
    if not np.isfinite(drives).all():
        raise SimulationError(f"drive positions are {list(drives)} rad, must be finite")
    for name, value in zip(DRIVES, drives, strict=True):
        data.qpos[_address(model, name)] = value
    for index, leg in enumerate(LEGS):
        knee, toe = float(drives[5 * index + 3]), float(drives[5 * index + 4])
        data.qpos[_address(model, f"{leg}_shin")] = springs[0]
        data.qpos[_address(model, f"{leg}_tarsus")] = NEUTRAL_TARSUS - knee
        data.qpos[_address(model, f"{leg}_heel_spring")] = springs[1]
        data.qpos[_address(model, f"{leg}_foot_crank")] = toe
        data.qpos[_address(model, f"{leg}_plantar_rod")] = -toe
        ball = _address(model, f"{leg}_achilles_rod")
        # From another start the loop may close with the tarsus folded the wrong way.
        data.qpos[ball : ball + 4] = achilles_turn(leg, knee, 0.0, NEUTRAL_TARSUS - knee)
    _close_loops(model, data)


def _close_loops(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Close the loops by Newton's method: move the undriven joints, with springs fixed."""
    free = _passive_dofs(model)
    step = np.zeros(model.nv)
    for _ in range(40):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error, jacobian = _pin_errors(model, data)
        if np.abs(error).max() < 1e-10:
            return
        step[:] = 0.0
        change = np.linalg.lstsq(jacobian[:, free], -error, rcond=None)[0]
        # The ball joint's spin about the rod is free; large steps occur only far from the solution.
        step[free] = change * min(1.0, 0.5 / max(1e-12, float(np.abs(change).max())))
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
    if np.abs(error).max() > 1e-6:
        raise SimulationError(
            f"no pose closes the leg loops: pins stay {np.abs(error).max():.2g} m apart"
        )


def _passive_dofs(model: mujoco.MjModel) -> list[int]:
    dofs: list[int] = []
    for leg in LEGS:
        for name in _PASSIVE:
            if name == "heel_spring":
                continue
            joint = model.joint(f"{leg}_{name}")
            dofs.extend(range(joint.dofadr[0], joint.dofadr[0] + len(joint.damping)))
    return dofs


def _pin_errors(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
    errors, jacobians = [], []
    for index in range(model.neq):
        if model.eq_type[index] != mujoco.mjtEq.mjEQ_CONNECT:
            continue
        points, jacs = [], []
        for body, anchor in (
            (model.eq_obj1id[index], model.eq_data[index, :3]),
            (model.eq_obj2id[index], model.eq_data[index, 3:6]),
        ):
            point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ anchor
            jac = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, jac, None, point, body)
            points.append(point)
            jacs.append(jac)
        errors.append(points[0] - points[1])
        jacobians.append(jacs[0] - jacs[1])
    return np.concatenate(errors), np.vstack(jacobians)


def _address(model: mujoco.MjModel, joint: str) -> int:
    return int(model.joint(joint).qposadr[0])


def lowest_sole(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Height of the lowest point of the soles above the world's origin. In m."""
    names = [f"{leg}_{end}" for leg in LEGS for end in ("heel", "toe")]
    return min(float(data.geom(name).xpos[2] - model.geom(name).size[0]) for name in names)


def height_over_ground(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Distance by which the robot can sink until a sole touches the ground below it. In m.

    Compute the kinematics before, with all soles above the ground. Infinite without ground below.
    """
    group = np.zeros(mujoco.mjNGROUP, np.uint8)
    group[GROUND_GROUP] = 1
    hit = np.zeros(1, np.int32)
    down = np.array([0.0, 0.0, -1.0])
    least = np.inf
    for leg in LEGS:
        for end in ("heel", "toe"):
            point = data.geom(f"{leg}_{end}").xpos
            distance = mujoco.mj_ray(model, data, point, down, group, 1, -1, hit)
            if distance >= 0.0:
                least = min(least, float(distance - model.geom(f"{leg}_{end}").size[0]))
    return float(least)
