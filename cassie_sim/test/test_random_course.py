"""The course by seed: its tiles lie end to end around the robot, wherever it is."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cassie_sim.random_course import CourseMotion, RandomCourse, TileOrder, course_tiles
from cassie_sim.scenes import read_scene, scene_motion, scene_spec

PARKED_BELOW = -400.0


class Walked:
    """A course over which a point goes in place of a robot."""

    def __init__(self, **parameters: float) -> None:
        self.model = scene_spec("random_course", parameters).compile()
        self.data = mujoco.MjData(self.model)
        self.motion = scene_motion("random_course", parameters)
        self.go(0.0, 0.0, time=0.0)

    def go(self, x: float, y: float = 0.0, time: float = 1.0) -> None:
        self.data.qpos[:3] = x, y, 50.0
        self.motion.apply(self.model, self.data, time)

    def height(self, x: float, y: float) -> float:
        """Of the ground, from a ray straight down. In m."""
        mujoco.mj_kinematics(self.model, self.data)
        hit = np.zeros(1, np.int32)
        start, down = np.array([x, y, 20.0]), np.array([0.0, 0.0, -1.0])
        distance = mujoco.mj_ray(self.model, self.data, start, down, None, 1, -1, hit)
        assert distance > 0.0, f"no ground at {x}, {y}"
        return 20.0 - float(distance)

    def laid(self) -> np.ndarray:
        """Poses of the tiles in place. Shape (n, 7)."""
        poses = np.hstack([self.data.mocap_pos, self.data.mocap_quat])
        return poses[poses[:, 2] > PARKED_BELOW]


def drawn(count: int, **parameters: float) -> list:
    order = TileOrder(read_scene("random_course", parameters))
    return [order.draw() for _ in range(count)]


def test_tiles_meet_without_a_gap_and_without_an_edge_where_no_step_is():
    course = Walked(step=0.0, rise_deg=6.0)
    for tile in drawn(60, step=0.0, rise_deg=6.0):
        course.go(tile.begin + 0.1, 0.0)
        before, behind = (course.height(tile.begin + d, 0.0) for d in (-1e-3, 1e-3))
        assert behind == pytest.approx(before, abs=1e-3)


def test_steps_between_tiles_are_no_larger_than_asked_for():
    course = Walked(step=0.05, rise_deg=0.0)
    steps = []
    for tile in drawn(100, step=0.05, rise_deg=0.0):
        course.go(tile.begin + 0.1, 0.0)
        steps.append(course.height(tile.begin + 1e-4, 0.0) - course.height(tile.begin - 1e-4, 0.0))
    assert np.abs(steps).max() <= 0.05 + 1e-9
    assert min(steps) < -0.03 and max(steps) > 0.03


def test_the_order_has_all_kinds_and_needs_no_tile_in_two_places_at_once():
    settings = RandomCourse()
    kinds = [tile.kind for tile in drawn(300)]
    assert set(kinds) == set(course_tiles(settings))
    for first in range(297):
        assert len(set(kinds[first : first + 4])) == 4


def test_the_course_stays_near_the_height_of_its_start():
    assert max(abs(tile.pos[1]) for tile in drawn(2000)) < 2.0


def test_a_kind_with_nothing_to_it_is_left_out():
    kinds = set(course_tiles(RandomCourse(riser=0.0, rough=0.0, sinking=0.0)))
    assert kinds.isdisjoint({"stairs", "rough", "sand"})
    assert len(kinds) >= 4


def test_the_same_seed_lays_the_same_bits_and_another_seed_others():
    courses = [Walked(seed=seed) for seed in (3, 3, 4)]
    for x in np.arange(0.0, 300.0, 0.7):
        for course in courses:
            course.go(float(x), 0.02 * float(x))
    assert courses[0].laid().tobytes() == courses[1].laid().tobytes()
    assert courses[0].laid().tobytes() != courses[2].laid().tobytes()


def test_who_turns_back_finds_the_ground_that_was_there():
    course = Walked()
    seen = {}
    for x in np.arange(0.0, 60.0, 0.5):
        course.go(float(x), 0.1 * float(x))
        seen[float(x)] = course.laid().tobytes()
    for x in np.arange(59.5, 0.0, -0.5):
        course.go(float(x), 0.0)
        assert course.laid().tobytes() == seen[float(x)]


def test_a_new_episode_begins_at_the_start_again():
    course = Walked()
    first = course.laid().tobytes()
    for x in np.arange(0.0, 80.0, 1.0):
        course.go(float(x), 1.0)
    course.go(0.0, 0.0, time=0.0)
    assert course.laid().tobytes() == first


@pytest.mark.parametrize("slope", [0.0, 0.3, -0.5])
def test_there_is_ground_behind_and_ahead_and_the_tiles_follow_the_robot_aside(slope):
    course = Walked()
    for x in np.arange(0.0, 400.0, 0.5):
        course.go(float(x), slope * float(x))
        if x > 20.0 and x % 5.0 == 0.0:
            for ahead in (-4.0, 0.0, 8.0):
                assert abs(course.height(x + ahead, slope * (x + ahead))) < 2.0
            assert np.abs(course.laid()[:, 1] - slope * x).max() < 15.0 * abs(slope) + 0.6


def test_after_kilometres_no_more_is_in_place_than_at_the_start():
    course = Walked()
    counts = set()
    for x in np.arange(0.0, 3000.0, 2.0):
        course.go(float(x))
        if x >= 10.0:
            counts.add(len(course.laid()))
    assert counts == {4}


def test_a_tile_that_lies_the_other_way_round_goes_down_where_the_other_goes_up():
    course = Walked(rise_deg=0.0, step=0.0, riser=0.05)
    climbs = set()
    for tile in drawn(200, rise_deg=0.0, step=0.0, riser=0.05):
        if tile.kind == "stairs":
            course.go(tile.begin + 0.1)
            rise = course.height(tile.end - 0.1, 0.0) - course.height(tile.begin + 0.1, 0.0)
            climbs.add(round(rise, 6))
    assert climbs == {0.25, -0.25}


def test_motion_of_a_course_is_that_of_its_scene():
    assert isinstance(scene_motion("random_course", {"seed": 2}), CourseMotion)
