"""Figures of the standard topics."""

from __future__ import annotations

import math

import pytest

from cassie_control.ros.standard_topics import into_frame, quaternion_of


@pytest.mark.parametrize(
    ("angles", "quaternion"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ((math.pi / 2, 0.0, 0.0), (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))),
        ((0.0, math.pi / 2, 0.0), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))),
        ((0.0, 0.0, math.pi / 2), (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))),
    ],
)
def test_yaw_pitch_roll_as_quaternion(
    angles: tuple[float, float, float], quaternion: tuple[float, ...]
) -> None:
    assert quaternion_of(*angles) == pytest.approx(quaternion)


def test_a_robot_that_faces_left_and_moves_left_moves_forward() -> None:
    facing_left = quaternion_of(math.pi / 2, 0.0, 0.0)
    assert into_frame(facing_left, [0.0, 0.5, 0.1]) == pytest.approx((0.5, 0.0, 0.1))


def test_a_robot_that_leans_forward_sees_the_vertical_ahead_of_its_axis() -> None:
    x, y, z = into_frame(quaternion_of(0.0, 0.3, 0.0), [0.0, 0.0, 1.0])
    assert (x, y, z) == pytest.approx((-math.sin(0.3), 0.0, math.cos(0.3)))
