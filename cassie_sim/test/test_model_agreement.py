"""The MuJoCo model and the models for control are the same robot.

Both come from one table, but everything else is different code: tree, loops, coordinates. The
MuJoCo side closes its loops by Newton's method, to which a closed form is no more than a start.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from cassie_gaits import robot, virtual_leg
from cassie_gaits.dynamics import INPUT, RIGID, Dynamics, rigid_pose
from cassie_gaits.leg import LegPair, both_legs
from cassie_gaits.linkage import crank_angles, heel_angle_and_slopes
from cassie_gaits.names import DRIVE_IN_Q, JOINTS, LEGS
from cassie_sim.poses import set_drives
from cassie_sim.robot_mjcf import robot_spec

MODEL = robot_spec().compile()
DYNAMICS = Dynamics()
LOW = np.radians([-15.0, -22.5, -50.0, -125.0, -130.0])
HIGH = np.radians([22.5, 22.5, 80.0, -45.0, -40.0])
MIRROR_LEG = np.array([-1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
MIRROR_BASE = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def address(joint: str) -> int:
    return int(MODEL.joint(joint).qposadr[0])


def velocity_address(joint: str) -> int:
    return int(MODEL.joint(joint).dofadr[0])


def place_base(data: mujoco.MjData, base: np.ndarray) -> None:
    data.qpos[:3] = base[:3]
    mujoco.mju_euler2Quat(data.qpos[3:7], base[3:], "zyx")


def pose(seed: int) -> tuple[mujoco.MjData, np.ndarray]:
    """A random pose on the constraint manifold, in MuJoCo and in the paper's coordinates."""
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(MODEL)
    base = np.concatenate([rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.7, 0.7, 3)])
    drives = np.concatenate([rng.uniform(LOW, HIGH), rng.uniform(LOW, HIGH)])
    drives[5] *= -1.0
    place_base(data, base)
    springs = (0.0, 0.0) if seed % 2 else (rng.uniform(-0.06, 0.03), rng.uniform(-0.03, 0.05))
    set_drives(MODEL, data, drives, springs=springs)
    mujoco.mj_forward(MODEL, data)
    return data, np.concatenate([base, [data.qpos[address(name)] for name in JOINTS]])


def pin_jacobian(data: mujoco.MjData) -> np.ndarray:
    """Velocity of the gaps at the pins, and the achilles rods' spin, by MuJoCo's velocity."""
    rows = []
    for index in range(MODEL.neq):
        jacobians = []
        for body, anchor in (
            (MODEL.eq_obj1id[index], MODEL.eq_data[index, :3]),
            (MODEL.eq_obj2id[index], MODEL.eq_data[index, 3:6]),
        ):
            point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ anchor
            jacobian = np.zeros((3, MODEL.nv))
            mujoco.mj_jac(MODEL, data, jacobian, None, point, body)
            jacobians.append(jacobian)
        rows.append(jacobians[0] - jacobians[1])
    for leg in LEGS:
        spin = np.zeros((1, MODEL.nv))
        spin[0, velocity_address(f"{leg}_achilles_rod")] = 1.0
        rows.append(spin)
    return np.vstack(rows)


def embedding(data: mujoco.MjData, q: np.ndarray) -> np.ndarray:
    """MuJoCo's velocity by that of the 20 coordinates. Shape (nv, 20)."""
    result = np.zeros((MODEL.nv, 20))
    result[:3, :3] = np.eye(3)
    _, pitch, roll = q[3:6]
    # Angular velocity in pelvis axes by the rates of yaw, pitch and roll.
    result[3:6, 3:6] = [
        [-math.sin(pitch), 0.0, 1.0],
        [math.sin(roll) * math.cos(pitch), math.cos(roll), 0.0],
        [math.cos(roll) * math.cos(pitch), -math.sin(roll), 0.0],
    ]
    for i, name in enumerate(JOINTS):
        result[velocity_address(name), 6 + i] = 1.0
    follow = np.flatnonzero(~result.any(axis=1))
    jacobian = pin_jacobian(data)
    result[follow] = -np.linalg.lstsq(jacobian[:, follow], jacobian @ result, rcond=None)[0]
    return result


def relative_difference(matrix: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference of entries, each measured by the diagonal of its row and column."""
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    return float(np.abs((matrix - expected) / scale).max())


def test_mass():
    assert pytest.approx(33.312, abs=1e-9) == robot.MASS
    assert DYNAMICS.mass == pytest.approx(33.312, abs=1e-9)
    assert MODEL.body_mass.sum() == pytest.approx(33.312, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_closed_forms_of_the_rods_agree(seed):
    data, q = pose(seed)
    for i, leg in enumerate(LEGS):
        knee, shin, tarsus, toe = q[6 + 7 * i + 3 : 13 + 7 * i]
        heel = data.qpos[address(f"{leg}_heel_spring")]
        assert heel_angle_and_slopes(knee, shin, tarsus)[0] == pytest.approx(heel, abs=1e-7)
        crank = [data.qpos[address(f"{leg}_{name}")] for name in ("foot_crank", "plantar_rod")]
        np.testing.assert_allclose(crank_angles(toe), crank, atol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_centre_of_mass_and_feet_agree(seed):
    data, q = pose(seed)
    np.testing.assert_allclose(DYNAMICS.com(q), data.subtree_com[1], rtol=1e-4, atol=1e-7)
    for leg in LEGS:
        position, rotation = DYNAMICS.sole(q, leg)
        ends = [data.geom(f"{leg}_{end}").xpos for end in ("heel", "toe")]
        np.testing.assert_allclose(position, np.mean(ends, axis=0), atol=1e-8)
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        assert abs(rotation[:, 0] @ along) == pytest.approx(1.0, abs=1e-9)
        position, rotation = DYNAMICS.toe_joint(q, leg)
        np.testing.assert_allclose(position, data.body(f"{leg}_toe").xpos, atol=1e-8)
        np.testing.assert_allclose(rotation, data.body(f"{leg}_toe").xmat.reshape(3, 3), atol=1e-8)


@pytest.mark.parametrize("seed", range(20))
def test_mass_matrix_agrees(seed):
    data, q = pose(seed)
    full = np.zeros((MODEL.nv, MODEL.nv))
    mujoco.mj_fullM(MODEL, data, full)
    G = embedding(data, q)
    expected = G.T @ full @ G
    matrix = DYNAMICS.mass_matrix(q)
    assert relative_difference(matrix, expected) < 1e-4
    assert relative_difference(RIGID.T @ matrix @ RIGID, RIGID.T @ expected @ RIGID) < 1e-4


@pytest.mark.parametrize("seed", range(20))
def test_gravity_and_bias_agree(seed):
    data, q = pose(seed)
    G = embedding(data, q)
    for torques, expected in (
        (DYNAMICS.gravity(q), G.T @ data.qfrc_bias),
        (RIGID.T @ DYNAMICS.gravity(q), RIGID.T @ G.T @ data.qfrc_bias),
    ):
        np.testing.assert_allclose(torques, expected, rtol=1e-4, atol=1e-4)


def _stiff_and_undamped() -> mujoco.MjModel:
    spec = robot_spec()
    for joint in spec.joints:
        joint.damping = np.zeros(np.shape(joint.damping))
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    for equality in spec.equalities:
        equality.solimp = [0.9999, 0.9999, 0.001, 0.5, 2.0]
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    spec.option.tolerance = 0.0
    return spec.compile()


STIFF = _stiff_and_undamped()


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_under_torque_agree(seed):
    """Springs, drives, gravity and loops together, against the simulator's forward dynamics.

    At rest: the simulator leaves the acceleration of its pins due to velocity to their damping.
    """
    placed, q = pose(2 * seed)
    u = np.random.default_rng(seed).uniform(-20.0, 20.0, 10)
    data = mujoco.MjData(STIFF)
    data.qpos[:], data.ctrl[:] = placed.qpos, u
    mujoco.mj_forward(STIFF, data)
    forces = INPUT @ u + DYNAMICS.spring_torque(q) - DYNAMICS.gravity(q)
    acceleration = np.linalg.solve(DYNAMICS.mass_matrix(q), forces)[6:]
    joints = [velocity_address(name) for name in JOINTS]
    np.testing.assert_allclose(
        data.qacc[joints], acceleration, atol=2e-3 * np.abs(acceleration).max()
    )


@pytest.mark.parametrize("seed", range(20))
def test_virtual_leg_agrees_with_forward_kinematics(seed):
    rng = np.random.default_rng(seed)
    drives = np.concatenate([rng.uniform(LOW, HIGH), rng.uniform(LOW, HIGH)])
    drives[[0, 1, 5, 6]] = 0.0
    base = np.array([0.0, 0.0, 1.0, 0.0, rng.uniform(-0.4, 0.4), 0.0])
    q, data = rigid_pose(base, drives), mujoco.MjData(MODEL)
    place_base(data, base)
    for name, value in zip(JOINTS, q[6:], strict=True):
        data.qpos[address(name)] = value
    mujoco.mj_kinematics(MODEL, data)
    hip_pitch, knee, toe = (drives[[i, 5 + i]] for i in (2, 3, 4))
    leg = [data.body(f"{n}_toe").xpos - data.body(f"{n}_hip_pitch").xpos for n in LEGS]
    sole = [data.geom(f"{n}_heel").xpos - data.geom(f"{n}_toe").xpos for n in LEGS]
    sole = [along * np.sign(along @ data.body("pelvis").xmat[:9:3]) for along in sole]
    length = [virtual_leg.length(angle) for angle in knee]
    np.testing.assert_allclose(length, np.linalg.norm(leg, axis=1), atol=2e-4)
    bends = zip(hip_pitch, knee, strict=True)
    pitch = [virtual_leg.pitch(base[4], *angles) for angles in bends]
    np.testing.assert_allclose(pitch, [math.atan2(x, -z) for x, _, z in leg], atol=3e-4)
    ends = zip(hip_pitch, toe, strict=True)
    foot = np.array([virtual_leg.foot_pitch(base[4], *angles) for angles in ends])
    np.testing.assert_allclose(
        np.sin(foot - [math.atan2(z, x) for x, _, z in sole]), 0.0, atol=3e-4
    )


@pytest.mark.parametrize("roll", [-0.1, 0.2])
def test_leg_roll_positive_puts_the_foot_to_the_left(roll):
    for index, leg in enumerate(LEGS):
        drives = np.zeros(10)
        drives[[3, 8]], drives[[4, 9]] = -1.2, -1.5
        drives[5 * index] = 0.1
        q = rigid_pose([0.0, 0.0, 1.0, 0.0, 0.0, roll], drives)
        data = mujoco.MjData(MODEL)
        place_base(data, q[:6])
        for name, value in zip(JOINTS, q[6:], strict=True):
            data.qpos[address(name)] = value
        mujoco.mj_kinematics(MODEL, data)
        across = data.body(f"{leg}_toe").xpos - data.body(f"{leg}_hip_pitch").xpos
        down = data.body(f"{leg}_hip_pitch").xmat.reshape(3, 3)[:, 2]
        expected = virtual_leg.roll(roll, 0.1)
        # The plane of the leg holds the toe; its normal tilts by the leg roll.
        assert math.asin(-down[2]) == pytest.approx(expected, abs=1e-9)
        assert across[2] < 0.0


@pytest.mark.parametrize("seed", range(6))
def test_left_and_right_mirror_each_other(seed):
    data, q = pose(seed)
    image = np.concatenate([MIRROR_BASE * q[:6], MIRROR_LEG * q[13:], MIRROR_LEG * q[6:13]])
    other = mujoco.MjData(MODEL)
    place_base(other, image[:6])
    springs = tuple(data.qpos[address(f"left_{name}")] for name in ("shin", "heel_spring"))
    set_drives(MODEL, other, image[list(DRIVE_IN_Q)], springs=springs)
    mujoco.mj_forward(MODEL, other)
    across = np.array([1.0, -1.0, 1.0])
    # The pelvis alone is not quite symmetric: its centre of mass lies 0.346 mm to the left.
    shift = 2.0 * robot.PELVIS.com[1] * robot.PELVIS.mass / robot.MASS
    left_of_pelvis = data.body("pelvis").xmat.reshape(3, 3)[:, 1]
    com = across * (data.subtree_com[1] - shift * left_of_pelvis)
    np.testing.assert_allclose(other.subtree_com[1], com, atol=1e-7)
    np.testing.assert_allclose(DYNAMICS.com(image), com, atol=1e-7)
    for leg, opposite in zip(LEGS, reversed(LEGS), strict=True):
        toe = across * data.body(f"{leg}_toe").xpos
        np.testing.assert_allclose(other.body(f"{opposite}_toe").xpos, toe, atol=1e-7)
        np.testing.assert_allclose(DYNAMICS.toe_joint(image, opposite)[0], toe, atol=1e-7)
    order = [*range(6), *range(13, 20), *range(6, 13)]
    sign = np.concatenate([MIRROR_BASE, MIRROR_LEG, MIRROR_LEG])
    matrix = DYNAMICS.mass_matrix(q)[np.ix_(order, order)] * np.outer(sign, sign)
    legs_only = np.ix_(range(6, 20), range(6, 20))
    assert relative_difference(DYNAMICS.mass_matrix(image)[legs_only], matrix[legs_only]) < 1e-4


@pytest.mark.parametrize("seed", range(20))
def test_legs_of_the_control_loop_agree(seed):
    data, q = pose(seed)
    rates = np.random.default_rng(seed).normal(size=20)
    rates[:6] = 0.0
    data.qvel[:] = embedding(data, q) @ rates
    mujoco.mj_forward(MODEL, data)
    mujoco.mj_subtreeVel(MODEL, data)
    R_WB, origin = data.body("pelvis").xmat.reshape(3, 3), q[:3]
    moment, momentum = robot.PELVIS.mass * np.array(robot.PELVIS.com), np.zeros(3)
    pair = LegPair()
    angles, angle_rates = q[6:].reshape(2, 7), rates[6:].reshape(2, 7)
    both_legs(angles, angle_rates, np.zeros(2), R_WB[2], pair.records[0])
    for i, leg in enumerate(LEGS):
        joints = slice(6 + 7 * i, 13 + 7 * i)
        state = pair.states[i]
        foot = np.mean([data.geom(f"{leg}_{end}").xpos for end in ("heel", "toe")], axis=0)
        np.testing.assert_allclose(state["foot"], R_WB.T @ (foot - origin), atol=1e-8)
        R_WF = data.body(f"{leg}_toe").xmat.reshape(3, 3)
        np.testing.assert_allclose(state["foot_rotation"], R_WB.T @ R_WF, atol=1e-8)
        velocity = DYNAMICS.sole_jacobian(q, leg)[:3] @ rates
        np.testing.assert_allclose(state["foot_velocity"], R_WB.T @ velocity, atol=1e-8)
        heel, _, *slopes = heel_angle_and_slopes(*q[joints][3:6])
        np.testing.assert_allclose(state["springs"], [q[joints][4], heel], atol=1e-9)
        np.testing.assert_allclose(state["heel_gradient"], slopes, atol=1e-9)
        moment, momentum = moment + state["com_moment"], momentum + state["com_rate"]
    mass = robot.MASS
    com = R_WB.T @ (data.subtree_com[1] - origin)
    np.testing.assert_allclose(moment / mass, com, atol=1e-3)
    com_rate = R_WB.T @ data.subtree_linvel[1]
    np.testing.assert_allclose(momentum / mass, com_rate, atol=1e-2)
