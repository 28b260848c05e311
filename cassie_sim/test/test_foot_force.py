"""Foot force from the springs against the simulated ground, standing quietly."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cassie_gaits import virtual_leg
from cassie_gaits.leg import LegPair, both_legs
from cassie_gaits.names import JOINTS, LEGS
from cassie_gaits.robot import WEIGHT
from cassie_sim.poses import lowest_sole, set_drives
from cassie_sim.scenes import scene_spec

MODEL = scene_spec("flat", {}).compile()
SECONDS = 2.0


def standing(leg_length: float) -> mujoco.MjData:
    """Both feet on the ground at rest, drives stiff, pelvis kept upright but free to sink."""
    knee = virtual_leg.knee_angle(leg_length)
    hip = virtual_leg.hip_pitch_angle(0.0, 0.0, leg_length)
    drives = np.array([0.0, 0.0, hip, knee, virtual_leg.toe_angle(0.0, 0.0, hip)] * 2)
    data = mujoco.MjData(MODEL)
    set_drives(MODEL, data, drives)
    mujoco.mj_kinematics(MODEL, data)
    data.qpos[2] -= lowest_sole(MODEL, data)
    pelvis, start = MODEL.body("pelvis").id, data.qpos[:3].copy()
    addresses = [MODEL.jnt_qposadr[MODEL.actuator_trnid[i, 0]] for i in range(MODEL.nu)]
    speeds = [MODEL.jnt_dofadr[MODEL.actuator_trnid[i, 0]] for i in range(MODEL.nu)]
    for _ in range(round(SECONDS / MODEL.opt.timestep)):
        data.ctrl[:] = 2000.0 * (drives - data.qpos[addresses]) - 40.0 * data.qvel[speeds]
        hold = [2000.0, 2000.0, 0.0] * (start - data.qpos[:3]) - 300.0 * data.qvel[:3]
        data.xfrc_applied[pelvis, :3] = hold
        data.xfrc_applied[pelvis, 3:] = -2000.0 * data.qpos[4:7] - 200.0 * data.qvel[3:6]
        mujoco.mj_step(MODEL, data)
    mujoco.mj_forward(MODEL, data)
    return data


def ground_force(data: mujoco.MjData, leg: str) -> np.ndarray:
    """Force of the ground on a foot, world axes. Shape (3,), in N."""
    feet = {MODEL.geom(f"{leg}_{end}").id for end in ("heel", "toe")}
    total, wrench = np.zeros(3), np.zeros(6)
    for i in range(data.ncon):
        contact = data.contact[i]
        if feet & {contact.geom1, contact.geom2}:
            mujoco.mj_contactForce(MODEL, data, i, wrench)
            sign = 1.0 if contact.geom2 in feet else -1.0
            total += sign * contact.frame.reshape(3, 3).T @ wrench[:3]
    return total


@pytest.mark.parametrize("leg_length", [0.55, 0.75, 0.9])
def test_springs_tell_the_ground_force(leg_length):
    data = standing(leg_length)
    assert np.abs(data.qvel).max() < 5e-3
    R_WB = data.body("pelvis").xmat.reshape(3, 3)
    pair, carried = LegPair(), 0.0
    for leg in LEGS:
        names = [name for name in JOINTS if name.startswith(leg)]
        joints = np.array([data.joint(name).qpos[0] for name in names])
        toe = float(data.actuator(f"{leg}_toe").force[0])
        both = np.tile(joints, (2, 1))
        both_legs(both, np.zeros((2, 7)), np.full(2, toe), R_WB[2], pair.records[0])
        i = LEGS.index(leg)
        heel = data.joint(f"{leg}_heel_spring").qpos[0]
        assert pair.states[i]["springs"][1] == pytest.approx(heel, abs=2e-3)
        true = ground_force(data, leg)
        assert pair.forces[i] == pytest.approx(true[2], rel=0.02)
        carried += true[2]
    assert carried == pytest.approx(WEIGHT, rel=0.01)
