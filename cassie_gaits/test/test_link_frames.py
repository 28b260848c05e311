"""The tree of frames: its closed forms against those of the linkage, and what it does not know."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.link_frames import (
    BASE_FRAME,
    FIXED_FRAMES,
    FRAMES,
    MOVING_FRAMES,
    LinkPoses,
)
from cassie_gaits.linkage import achilles_direction, crank_angles, heel_angle
from cassie_gaits.names import JOINTS, LEGS

LEG = (0.05, -0.1, 0.6, -1.2, -0.05, 1.5, -1.3)


def coordinates(left: tuple[float, ...] = LEG, right: tuple[float, ...] = LEG) -> np.ndarray:
    return np.array([0.3, -0.2, 0.9, 0.5, -0.1, 0.2, *left, *right])


def by_name(poses: np.ndarray) -> dict[str, np.ndarray]:
    """Poses of the moving links by their joint."""
    return {frame.joint: pose for frame, pose in zip(MOVING_FRAMES, poses[1:], strict=True)}


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of quaternions x, y, z, w."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*vector, a[3] * b[3] - a[:3] @ b[:3]])


def about_z(angle: float) -> np.ndarray:
    return np.array([0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)])


def test_every_link_is_in_the_tree_below_its_parent():
    names = [BASE_FRAME]
    for frame in FRAMES:
        assert frame.parent in names
        names.append(frame.name)
    assert len(names) == len(set(names)) == 2 + 2 * len(robot.LEFT_LEG)
    assert {frame.joint for frame in FRAMES} >= set(JOINTS)
    assert set(FRAMES) == {*FIXED_FRAMES, *MOVING_FRAMES}


def test_the_base_stands_where_the_coordinates_say():
    base = LinkPoses().at(coordinates())[0]
    np.testing.assert_array_equal(base[:3], [0.3, -0.2, 0.9])
    yaw, pitch, roll = about_z(0.5), about_z(-0.1)[[0, 2, 1, 3]], about_z(0.2)[[2, 0, 1, 3]]
    np.testing.assert_allclose(base[3:], product(product(yaw, pitch), roll), atol=1e-15)


@pytest.mark.parametrize("leg", LEGS)
def test_rods_and_springs_turn_as_the_linkage_has_them(leg: str):
    poses = by_name(LinkPoses().at(coordinates(right=(0.0, 0.0, 0.4, -2.1, 0.02, 2.3, -0.9))))
    knee, shin, tarsus, toe = LEG[3:] if leg == "left" else (-2.1, 0.02, 2.3, -0.9)
    crank, rod = crank_angles(toe)
    angles = {
        "knee": knee,
        "toe": toe,
        "heel_spring": heel_angle(knee, shin, tarsus),
        "foot_crank": crank,
        "plantar_rod": rod,
    }
    rests = {frame.joint: frame.rest for frame in MOVING_FRAMES}
    for name, angle in angles.items():
        pose, rest = poses[f"{leg}_{name}"], rests[f"{leg}_{name}"]
        np.testing.assert_array_equal(pose[:3], rest[:3])
        np.testing.assert_allclose(pose[3:], product(rest[3:], about_z(angle)), atol=1e-12)


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("knee", np.radians([-45.0, -70.0, -110.0, -157.0]))
@pytest.mark.parametrize("deflection", [-0.04, 0.0, 0.04])
def test_an_achilles_rod_ends_a_millimetre_from_its_pin(leg: str, knee: float, deflection: float):
    tarsus = robot.NEUTRAL_TARSUS - knee + deflection
    joints = (0.0, 0.0, 0.4, knee, 0.02, tarsus, -1.3)
    *vector, w = by_name(LinkPoses().at(coordinates(joints, joints)))[f"{leg}_achilles_rod"][3:]
    x_axis = np.array([1.0, 0.0, 0.0])
    along = x_axis + 2.0 * np.cross(vector, np.cross(vector, x_axis) + w * x_axis)
    expected = achilles_direction(knee, 0.02, tarsus) * (1.0, 1.0, 1.0 if leg == "left" else -1.0)
    np.testing.assert_allclose(along, expected, atol=0.001 / robot.RODS[0].length)


def test_a_rod_that_does_not_reach_stays_and_the_rest_goes_on():
    links = LinkPoses()
    before = by_name(links.at(coordinates()).copy())
    broken = by_name(links.at(coordinates(left=(0.1, 0.2, 0.4, -0.6, 0.0, 1.8, 3.0))))
    stays = {"left_achilles_rod", "left_heel_spring", "left_foot_crank", "left_plantar_rod"}
    right = {name for name in before if name.startswith("right")}
    same = {name for name in before if np.array_equal(broken[name], before[name])}
    assert same == right | stays
    assert np.isfinite(list(broken.values())).all()
