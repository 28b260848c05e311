"""Rides in figures: gates, speeds, shaking; the rows that ask for them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from synthetic import glide

from cassie_bags.bag.recording import GROUND_TRUTH_TOPIC, Recording, rows_of
from cassie_bags.bag.rows import Rows, stamps
from cassie_bags.run.cores import make_loop, tick_count
from cassie_bags.run.simulate import Store, run
from cassie_bags.signals.leg_geometry import euler_angles
from cassie_bags.signals.riding import gate_miss, measure_ride
from cassie_bags.signals.track import rolled
from cassie_bags.studies.run_trial import experiment_of, run_trial
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.motions import GO, Ride
from cassie_bags.studies.sweep.random_commands import riding_commands
from cassie_bags.studies.sweep.table import chosen_rows
from cassie_control.config import SegwayConfig
from cassie_gaits.robot import WEIGHT
from cassie_msgs.experiment.script import RiderScript
from cassie_msgs.structured import structure
from cassie_sim.segway import TRACK, WHEEL_RADIUS

GATES = {"first": 2.0, "spacing": 3.0, "offset": 0.2, "count": 2}
RIDER = structure(RiderScript, {"targets": [{"t": 1.0, "speed": 1.0}, {"t": 2.0, "gates": GATES}]})


def segway(seconds: float, left: float = 0.0, pitch: float = 0.0) -> Rows:
    """Rows of a Segway at 1 m/s, `left` of the x axis (m), whose pitch swings at 4 Hz (rad)."""
    time = np.arange(round(100 * seconds)) / 100.0
    rows = np.zeros(len(time), rows_of(GROUND_TRUTH_TOPIC, []).dtype)
    rows["sec"], rows["nanosec"] = time, np.round(1e9 * (time % 1.0))
    rows["position"][:, 0], rows["position"][:, 1] = time, left
    angle = 0.5 * pitch * np.sin(2.0 * math.pi * 4.0 * time)
    rows["orientation"][:, 1], rows["orientation"][:, 3] = np.sin(angle), np.cos(angle)
    rows["linear"][:, 0] = 1.0
    return rows


def ride(seconds: float = 10.0, left: float = 0.0, pitch: float = 0.0) -> Recording:
    return dataclasses.replace(glide(seconds, vx=1.0), segway=segway(seconds, left, pitch))


def test_in_pictures_its_wheels_roll_as_far_as_it_went():
    circle = np.linspace(0.0, 2.0 * math.pi, 400)  # to the left, of 1 m radius
    pose = np.zeros((400, 7))
    pose[:, 0], pose[:, 1] = np.sin(circle), 1.0 - np.cos(circle)
    pose[:, 5], pose[:, 6] = np.sin(0.5 * circle), np.cos(0.5 * circle)
    left, right = rolled(pose)[-1]
    half = 0.5 * TRACK
    assert left == pytest.approx(2.0 * math.pi * (1.0 - half) / WHEEL_RADIUS, rel=1e-3)
    assert right == pytest.approx(2.0 * math.pi * (1.0 + half) / WHEEL_RADIUS, rel=1e-3)


def test_gates_are_where_the_rider_saw_the_robot_when_he_wanted_them():
    # He saw it at 1.8 m: gates at 3.8 m, 0.2 m to the left, and at 6.8 m, 0.2 m to the right.
    assert gate_miss(ride(left=0.0), RIDER) == pytest.approx(0.2)
    assert gate_miss(ride(left=0.15), RIDER) == pytest.approx(0.35)


def test_a_gate_that_is_not_reached_is_missed_and_without_gates_there_is_no_figure():
    assert gate_miss(ride(seconds=5.0), RIDER) == math.inf
    without = structure(RiderScript, {"targets": [{"t": 1.0, "speed": 1.0}]})
    assert math.isnan(gate_miss(ride(), without))
    assert math.isnan(gate_miss(ride(), None))


def test_a_ride_in_figures():
    figures = measure_ride(ride(pitch=0.01), RIDER, (3.0, 9.0))
    assert figures["ride_min"] == pytest.approx(1.0, abs=1e-3)
    assert figures["ride_drift"] == pytest.approx(6.0, abs=0.02)
    assert figures["stop_time"] == math.inf
    assert figures["platform_rms"] == pytest.approx(math.degrees(0.01 / math.sqrt(2.0)), rel=0.02)


def test_slow_tilts_are_no_shaking():
    rows = segway(20.0)
    tilt = 0.5 * 0.02 * np.arange(len(rows)) / len(rows)
    rows["orientation"][:, 1], rows["orientation"][:, 3] = np.sin(tilt), np.cos(tilt)
    figures = measure_ride(dataclasses.replace(ride(20.0), segway=rows), None, (1.0, 19.0))
    assert figures["platform_rms"] < 0.001


@pytest.mark.parametrize("window", [(3.0, 12.0), (20.0, 30.0)])
def test_a_ride_that_ended_early_has_no_figures(window):
    assert all(map(math.isnan, measure_ride(ride(), RIDER, window).values()))


def test_without_a_segway_there_are_no_figures():
    assert all(map(math.isnan, measure_ride(glide(4.0), None, (1.0, 3.0)).values()))


@pytest.mark.parametrize("row", chosen_rows(["segway"]), ids=lambda row: row.name)
def test_the_runs_of_each_row_can_be_run(row):
    for trial in row.trials(Budget(seeds=2), row.levels[row.first]):
        experiment = experiment_of(trial)
        assert experiment.scenario.scene == "segway"
        assert experiment.duration >= trial.window[1]


def test_leans_are_as_large_as_the_message_lets_them_and_the_same_for_a_seed():
    steps = riding_commands(1, 16.0, 316.0)
    assert steps == riding_commands(1, 16.0, 316.0) != riding_commands(2, 16.0, 316.0)
    assert max(step["com_x"] for step in steps) > 0.09
    assert min(step["height"] for step in steps) < 0.45


def test_random_leans_do_not_throw_it_off():
    """It turned as it rolled slowly backward, and the torso swung from side to side."""
    (row,) = chosen_rows(["segway.leans"])
    trial = next(t for t in row.trials(Budget(seeds=6), 0.0) if t.seed == 6)
    shorter = dataclasses.replace(trial, content={**trial.content, "duration": 45.0})
    assert not run_trial(shorter)["fell"]


def test_a_lean_that_is_held_overcomes_the_limiter():
    """The README of cassie_sim says so: the limiter tilts the platform, but not the robot.

    The robot's own bound, `segway.top_speed`, holds. It went on to 6 m/s and more.
    """
    lean = [{"t": GO, "com_x": 0.03}]
    trial = Ride().trial(Budget(seeds=1), 0, (GO, GO + 26.0), lean)
    experiment, store = experiment_of(trial), Store()
    run(make_loop(experiment, store), range(tick_count(experiment)))
    speed = store.recording(0.0).segway["linear"][:, 0]
    assert speed[-1] == pytest.approx(SegwayConfig().top_speed, abs=0.3)
    assert speed.max() < 6.0


def test_he_finds_another_heading_without_swinging():
    """He looked 0.2 s late and leant by too much: the heading swung, and ever more so."""
    window = (GO + 6.0, GO + 9.0)
    rider = {"targets": [{"t": GO, "heading": 0.15}]}
    trial = Ride().trial(Budget(seeds=1), 1, window, [], rider=rider)
    experiment, store = experiment_of(trial), Store()
    run(make_loop(experiment, store), range(tick_count(experiment)))
    rows = store.recording(0.0).segway
    calm = stamps(rows) > window[0]
    assert np.abs(rows["angular"][calm, 2]).max() < 0.1
    assert euler_angles(rows["orientation"])[-1, 0] == pytest.approx(0.15, abs=0.05)


@pytest.mark.parametrize(
    ("name", "section", "rides"),
    [("standing", "stand", False), ("riding", "segway", True), ("shipped", "", True)],
)
def test_each_law_stands_on_a_segway_with_its_gains(name: str, section: str, rides: bool):
    (row,) = chosen_rows([f"segway_shaking.{name}_soft"])
    (trial,) = row.trials(Budget(seeds=1), 1.0)
    experiment = experiment_of(trial)
    assert ("segway" in {step.changes.get("mode") for step in experiment.operator}) == rides
    assert experiment.scenario.scene_parameters["softness"] == 2.0
    if section:
        assert experiment.controller[f"{section}.kp_com_x"] == pytest.approx(1200.0 - WEIGHT)
        assert experiment.controller[f"{section}.kd_com_x"] == 160.0
    else:
        assert experiment.controller == {}


def test_gains_hold_where_they_shake_the_platform_little():
    (row,) = chosen_rows(["segway_shaking.standing_nominal"])
    assert row.holds({"platform_rms": 0.4}, 1.0) and not row.holds({"platform_rms": 0.94}, 1.0)
    assert not row.holds({"platform_rms": math.nan}, 1.0)
