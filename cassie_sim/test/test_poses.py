"""Poses with closed loops, over the whole range of the knee."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from cassie_gaits.names import LEGS
from cassie_gaits.robot import NEUTRAL_TARSUS
from cassie_sim.errors import SimulationError
from cassie_sim.poses import lowest_sole, set_drives
from cassie_sim.robot_mjcf import robot_model

MODEL = robot_model()
KNEES = np.radians(np.arange(-37.0, -165.0, -2.0))
SPRINGS = [(0.0, 0.0), *((s, h) for s in (-0.05, 0.05) for h in (-0.05, 0.05))]


def gaps(data: mujoco.MjData) -> float:
    """Largest distance of a rod's end from its pin. In m."""
    mujoco.mj_fwdPosition(MODEL, data)
    assert data.ne == 3 * MODEL.neq
    return float(np.abs(data.efc_pos[: data.ne]).max())


def tarsus(data: mujoco.MjData, leg: str) -> float:
    return float(data.joint(f"{leg}_tarsus").qpos[0])


@pytest.mark.parametrize("springs", SPRINGS)
def test_loops_close_with_the_tarsus_along_the_thigh(springs):
    for knee in KNEES:
        data = mujoco.MjData(MODEL)
        set_drives(MODEL, data, [0.0, 0.0, 0.5, knee, -1.6] * 2, springs=springs)
        assert gaps(data) < 1e-9
        for leg in LEGS:
            assert abs(tarsus(data, leg) - (NEUTRAL_TARSUS - knee)) < 0.2, math.degrees(knee)


def test_the_pose_before_does_not_matter():
    fresh, used = mujoco.MjData(MODEL), mujoco.MjData(MODEL)
    for knee in (-2.8, -0.7, -2.3):
        set_drives(MODEL, used, [0.1, 0.0, 0.5, knee, -1.6] * 2)
    set_drives(MODEL, fresh, [0.1, 0.0, 0.5, -2.3, -1.6] * 2)
    np.testing.assert_array_equal(fresh.qpos, used.qpos)


def test_missing_number_and_springs_out_of_reach_are_refused():
    data = mujoco.MjData(MODEL)
    with pytest.raises(SimulationError, match=r"drive positions are .*nan.* must be finite"):
        set_drives(MODEL, data, [0.0, 0.0, 0.5, -1.2, math.nan] * 2)
    with pytest.raises(SimulationError, match="no pose closes the leg loops: pins stay"):
        set_drives(MODEL, data, [0.0, 0.0, 0.5, -0.7, -1.6] * 2, springs=(0.0, -1.5))


def test_lowest_sole_is_where_the_foot_touches():
    data = mujoco.MjData(MODEL)
    data.qpos[:3] = (0.0, 0.0, 1.5)
    set_drives(MODEL, data, [0.0, 0.0, 0.5, -1.2, -1.6] * 2)
    mujoco.mj_kinematics(MODEL, data)
    height = lowest_sole(MODEL, data)
    bottoms = [data.geom(f"{leg}_{end}").xpos[2] - 0.02 for leg in LEGS for end in ("heel", "toe")]
    assert height == pytest.approx(min(bottoms))
    assert 0.45 < height < 0.55
