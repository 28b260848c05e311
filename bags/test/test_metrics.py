"""Metrics against known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from synthetic import LEG, glide, standing_height

from cassie_bags.bag.recording import Recording, run_time
from cassie_bags.signals.footsteps import placements
from cassie_bags.signals.leg_geometry import euler_angles, leg_points, to_world
from cassie_bags.signals.metrics import Metrics, measure
from cassie_bags.signals.track import make_track
from cassie_msgs.experiment.expectation import Phase
from cassie_msgs.layout import RobotMode
from cassie_sim.poses import set_drives


def measured(recording: Recording, *phases: Phase) -> Metrics:
    return measure(recording, make_track(recording), phases)


def test_speed_and_turn_of_a_circle_are_those_it_was_made_with():
    metrics = measured(glide(4.0, vx=0.6, yaw_rate=0.5), Phase("all", 1.0, 3.0))
    values = metrics.phases[0].values
    assert values["vx"] == pytest.approx(0.6, abs=1e-9)
    assert values["vy"] == pytest.approx(0.0, abs=1e-9)
    assert values["yaw_rate"] == pytest.approx(0.5, abs=1e-9)
    assert values["turn_deg"] == pytest.approx(math.degrees(0.5 * 1.998), abs=1e-6)
    assert values["vx_rms"] == pytest.approx(0.0, abs=1e-9)


def test_height_is_that_above_the_soles():
    phase = measured(glide(2.0, lift=0.0), Phase("all", 0.0, 1.0)).phases[0]
    assert phase.values["height"] == pytest.approx(standing_height(), abs=1e-9)


def test_the_height_has_no_set_point_while_it_walks():
    walks = measured(glide(2.0), Phase("all", 0.0, 1.0))
    assert math.isnan(walks.phases[0].commanded["height"])
    assert math.isnan(walks.phases[0].values["height_rms"])
    assert math.isnan(walks.run["height_rms_error"])
    stands = measured(glide(2.0, mode=RobotMode.STAND), Phase("all", 0.0, 1.0))
    assert stands.phases[0].commanded["height"] == pytest.approx(standing_height())
    assert stands.phases[0].values["height_rms"] == pytest.approx(0.0, abs=1e-9)
    assert stands.run["height_rms_error"] == pytest.approx(0.0, abs=1e-9)


def test_soles_that_lie_flat_pitch_down_with_a_robot_that_topples_forward():
    phases = Phase("up", 0.0, 1.0), Phase("down", 1.0, 2.0)
    up, down = measured(glide(2.0, tilt_from=1.0), *phases).phases
    assert up.values["sole_pitch_deg"] == pytest.approx(0.0, abs=0.1)
    assert down.values["sole_pitch_deg"] == pytest.approx(-90.0, abs=0.1)


def test_distance_and_drift_of_a_straight_line():
    run = measured(glide(3.0, vx=-0.5)).run
    assert run["distance"] == pytest.approx(0.5 * 2.998, abs=1e-6)
    assert run["drift"] == pytest.approx(run["distance"])


def test_an_upright_robot_has_not_fallen():
    metrics = measured(glide(1.0))
    assert not metrics.fell
    assert metrics.fall_time is None


def test_a_toppled_robot_has_fallen_when_it_toppled():
    metrics = measured(glide(2.0, tilt_from=1.25))
    assert metrics.fell
    assert metrics.fall_time == pytest.approx(1.25)


def test_real_time_factor_is_robot_time_by_wall_time():
    assert measured(glide(4.0)).run["real_time_factor"] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize(
    ("logs", "walls", "expected"),
    [([0, 5], [10, 20], 1e-8), ([0, 5], [0, 5], math.nan), ([], [], math.nan)],
)
def test_a_run_without_wall_time_in_its_bag_has_none(logs, walls, expected):
    assert run_time(logs, walls) == pytest.approx(expected, nan_ok=True)


def test_peak_torque_names_the_drive():
    metrics = measured(glide(1.0))
    assert metrics.peak_torque["left_knee"] == 50.0
    assert metrics.run["peak_torque_ratio"] == pytest.approx(50.0 / 195.2)


def test_a_phase_after_the_end_is_not_reached():
    metrics = measured(glide(1.0), Phase("in", 0.0, 1.0), Phase("out", 0.5, 2.0))
    assert [phase.reached for phase in metrics.phases] == [True, False]


def test_a_foot_that_never_lifts_is_one_placement():
    found = placements(make_track(glide(1.0, vx=0.0)))
    assert sorted(placement.leg for placement in found) == [0, 1]
    for placement in found:
        assert placement.tip[0] > placement.heel[0]


def test_leg_points_agree_with_the_simulated_robot():
    import mujoco

    from cassie_sim.scenes import scene_spec

    model = scene_spec("flat", {}).compile()
    data = mujoco.MjData(model)
    set_drives(model, data, [LEG[i] for i in (0, 1, 2, 3, 6)] * 2)
    data.qpos[:3] = 0.3, -0.2, 1.1
    data.qpos[3:7] = np.array([0.9, 0.1, -0.3, 0.2]) / np.linalg.norm([0.9, 0.1, -0.3, 0.2])
    mujoco.mj_kinematics(model, data)
    names = ["hip_roll", "hip_yaw", "hip_pitch", "knee", "shin", "tarsus", "toe"]
    joints = [data.joint(f"{leg}_{name}").qpos[0] for leg in ("left", "right") for name in names]
    orientation = data.qpos[[4, 5, 6, 3]][None]
    points = to_world(leg_points(np.array([joints])), data.qpos[None, :3], orientation)
    for leg, side in enumerate(("left", "right")):
        for index, name in enumerate(names):
            expected = data.body(f"{side}_{name}").xpos
            np.testing.assert_allclose(points[0, leg, index], expected, atol=2e-6)


def test_euler_angles_are_those_of_a_rotation_about_each_axis():
    half = 0.2
    for axis, column in ((2, 0), (1, 1), (0, 2)):
        quaternion = np.zeros(4)
        quaternion[axis], quaternion[3] = math.sin(half), math.cos(half)
        expected = np.zeros(3)
        expected[column] = 2 * half
        np.testing.assert_allclose(euler_angles(quaternion[None])[0], expected, atol=1e-12)
