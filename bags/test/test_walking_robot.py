"""Drawn robots walk fast without a limp, sideways as told to, and on slippery ground."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import stamps
from cassie_bags.run.cores import connect, make_cores, make_loop, tick_count
from cassie_bags.run.experiment import load_experiment, parse_experiment, read_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import Store, run
from cassie_bags.signals.metrics import sole_pitch
from cassie_bags.signals.track import Track, make_track
from cassie_bags.studies.run_trial import experiment_of, run_trial
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.table import chosen_rows
from cassie_msgs.layout import ControllerStatus, RobotState

TEXT = """
start: standing
seed: {seed}
duration: {duration}
operator:
  - {{t: 0.0, power: true, mode: stand, height: 0.95}}
  - {{t: 2.0, mode: walk}}
  - {{t: 4.0, {commanded}}}
supervisor: {{vx_forward: 1.6, vx_backward: 0.9, acceleration: 0.5}}
"""


SLIPPERY = """
draw: {friction: 1.0}
scene: waxed_floor
scene_parameters: {friction: 0.25}
"""


def walk(commanded: str, duration: float, more: str = "", seed: int = 2) -> tuple[Recording, Track]:
    text = TEXT.format(commanded=commanded, duration=duration, seed=seed) + more
    experiment = resolve(parse_experiment(text, "walk"))
    store = Store()
    recording = store.recording(run(make_loop(experiment, store), range(tick_count(experiment))))
    return recording, make_track(recording)


def test_it_walks_at_one_and_a_half_metres_per_second_without_a_limp():
    recording, track = walk("vx: 1.5", 13.0)
    status = recording.rows(ControllerStatus)
    late = stamps(status) > 10.0
    vx, vy = (np.interp(stamps(status)[late], track.time, track.achieved[n]) for n in ("vx", "vy"))
    assert vx.mean() == pytest.approx(1.5, abs=0.05)
    assert abs(vy.mean()) < 0.06
    left, right = (vx[status["stance_leg"][late] == leg].mean() for leg in (0, 1))
    assert left == pytest.approx(right, abs=0.06)


def test_it_does_not_run_ahead_at_the_end_of_an_acceleration():
    """What it had lacked while it became faster drove it 0.14 m/s beyond what was asked for."""
    _, track = walk("vx: 1.5", 10.0)
    after = (track.time > 8.0) & (track.time < 10.0)
    assert track.achieved["vx"][after].mean() == pytest.approx(1.5, abs=0.07)


def test_it_does_not_bounce_from_leg_to_leg_while_it_walks_backward():
    """Every other step was 3 cm higher, more and more until it fell."""
    recording, track = walk("vx: -0.9", 14.0, seed=1)
    status = recording.rows(ControllerStatus)
    late = stamps(status) > 10.0
    height = np.interp(stamps(status)[late], track.time, track.achieved["height"])
    left, right = (height[status["stance_leg"][late] == leg].mean() for leg in (0, 1))
    assert left == pytest.approx(right, abs=0.008)


def test_a_speed_to_the_side_is_kept_soon_after_it_is_asked_for():
    _, track = walk("vy: 0.3", 11.0)
    assert track.achieved["vy"][track.time > 7.0].mean() == pytest.approx(0.3, abs=0.04)


def test_it_begins_to_walk_and_walks_where_the_friction_is_a_quarter():
    _, track = walk("vx: 0.5", 11.0, SLIPPERY, seed=3)
    assert track.time[-1] == pytest.approx(11.0, abs=0.1)
    assert np.abs(track.angles[:, 1:]).max() < 0.3
    assert track.achieved["vx"][track.time > 7.0].mean() == pytest.approx(0.5, abs=0.05)


def stays_up_at_the_pillar(seed=None, changes=()):
    """Whether a robot bumps into the pillar of the waxed floor for 6 s and walks on."""
    file = Path(__file__).parents[1] / "experiments" / "waxed_floor.yaml"
    experiment = resolve(replace(load_experiment(file, changes, seed), duration=20.0))
    store = Store()
    recording = store.recording(run(make_loop(experiment, store), range(tick_count(experiment))))
    track = make_track(recording)
    assert track.time[-1] == pytest.approx(20.0, abs=0.1)
    return np.abs(track.angles[:, 1:]).max() < 0.5


@pytest.mark.parametrize("changes", [(), ("model.mass=1.001",)])
def test_it_bumps_into_a_pillar_on_waxed_floor_and_stays_up(changes):
    """It put its feet far out to catch itself, and they slid away."""
    assert stays_up_at_the_pillar(changes=changes)


def test_most_drawn_robots_stay_up_at_the_pillar():
    """Which of them fall hangs on the last bit of an angle, so that six of ten count."""
    up = fell = 0
    for seed in range(1, 11):
        good = stays_up_at_the_pillar(seed)
        up, fell = up + good, fell + (not good)
        if up == 6 or fell == 5:
            break
    assert up == 6


def test_the_pillar_of_the_waxed_floor_is_in_its_way():
    file = Path(__file__).parents[1] / "experiments" / "waxed_floor.yaml"
    cores = make_cores(resolve(load_experiment(file)))
    loop, plant = connect(cores, lambda *_: None), cores.plant
    pillar = plant.model.geom("pillar_0").id
    bumped = False
    for _ in range(int(18.0 / 0.002)):
        loop.tick()
        bumped |= any(pillar in contact.geom for contact in plant.data.contact)
    assert bumped


@pytest.mark.parametrize("seed", [None, 4])
def test_heels_that_dig_into_sand_pitch_its_feet_and_it_walks_on(seed):
    """Feet pitched by 30 degrees looked like a slope, and the ground met them early: it fell."""
    file = Path(__file__).parents[1] / "experiments" / "sand_court.yaml"
    experiment = resolve(replace(load_experiment(file, (), seed), duration=24.0))
    store = Store()
    recording = store.recording(run(make_loop(experiment, store), range(tick_count(experiment))))
    track = make_track(recording)
    on_sand = track.time > 14.0
    assert track.time[-1] == pytest.approx(24.0, abs=0.1)
    assert np.abs(track.angles[:, 1:]).max() < 0.3
    assert sole_pitch(track, on_sand) > 28.0
    assert track.achieved["vx"][on_sand].mean() == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize("seed", [4, 8])
def test_sticks_that_jump_do_not_make_it_run_away_to_the_side(seed):
    """Feet that were held back from far out let its speed to the side grow from step to step."""
    (row,) = chosen_rows(["radio.jumps"])
    trial = next(one for one in row.trials(Budget(), 0.0) if one.seed == seed)
    others = ("roll", "com_x", "com_y", "trims")  # with which it walks elsewhere
    steps = [
        {name: value for name, value in step.items() if name not in others}
        for step in trial.content["operator"]
    ]
    trial = replace(trial, content={**trial.content, "operator": steps})
    cores = make_cores(experiment_of(trial))
    loop = connect(cores, lambda *_: None)
    for _ in range(int(83.0 / 0.002)):
        loop.tick()
    assert cores.plant.pelvis_pose[0][2] > 0.8


def test_feet_are_not_held_back_so_far_that_a_side_slope_throws_it():
    """By 4 cm, for the sake of a waxed floor: robot 8 fell as it came onto it."""
    (row,) = chosen_rows(["slope.side"])
    trial = next(one for one in row.trials(Budget(), 8.0) if one.seed == 8)
    assert not run_trial(trial)["fell"]


def crosses(name, level, seed):
    """Whether a robot crosses the ground of a row of the sweep."""
    (row,) = chosen_rows([name])
    measures = run_trial(row.trials(Budget(seeds=40), level)[seed - 1])
    return not measures["fell"] and row.holds(measures, level)


def most_cross(name, level, seeds, may_fall=1):
    """Whether all but so many robots cross it; no more are run than decide that."""
    seeds = list(seeds)
    crossed = fell = 0
    while fell <= may_fall and crossed < len(seeds) - may_fall:
        good = crosses(name, level, seeds[crossed + fell])
        crossed, fell = crossed + good, fell + (not good)
    return fell <= may_fall


@pytest.mark.parametrize(("name", "level"), [("step_fast.up", 0.1), ("step_fast.down", 0.2)])
def test_a_foot_swings_clear_of_ground_that_nobody_sees(name, level):
    """Toes caught on a riser of 7 cm, and the robot fell over it."""
    assert most_cross(name, level, range(1, 21), may_fall=2)


@pytest.mark.parametrize(
    ("name", "level", "seed"),
    [("steep.up", 28.0, 1), ("steep.up", 28.0, 5), ("steep.side", 12.0, 13)],
)
def test_a_steep_slope_is_crossed(name, level, seed):
    """Feet that met the hips' climb late let it run away; a side slope was at first not believed.

    Up 30 and to the side 14 degrees hold 20 of 20 robots, so that each of them must do these.
    """
    assert crosses(name, level, seed)


def test_stairs_are_climbed():
    """A toe held under a riser sprang free and landed behind the other foot, on 17 of 40 robots."""
    assert most_cross("stairs.up", 0.1, range(1, 21), may_fall=2)


def test_hard_ground_of_4_cm_is_crossed():
    """Hips that rose and sank with each foothold threw half of the robots to the side.

    18 of 20 robots must walk; which one falls hangs on the last bit.
    """
    assert most_cross("rough.hard", 0.04, range(1, 21), may_fall=2)


@pytest.mark.parametrize(("speed", "seeds", "may_fall"), [(0.8, [5], 0), (1.2, range(11, 21), 1)])
def test_feet_that_tufts_of_grass_tilt_do_not_make_it_run_away(speed, seeds, may_fall):
    """A tilt was taken for a rise: the next foot landed late and far ahead.

    At 1.2 m/s 9 of 10 robots must walk; which one falls hangs on the last bit.
    """
    assert most_cross(f"grass.{speed}", speed, seeds, may_fall)


@pytest.mark.parametrize(
    "commanded",
    [
        [{"t": 4.0, "roll": 0.3}],
        [{"t": 4.0, "vx": 1.0}, {"t": 8.0, "roll": 0.3}],
        [{"t": 4.0, "vx": 1.0}, {"t": 9.0, "trims": [-0.1, 0.0, 0.0, 0.0]}],
    ],
    ids=["roll in place", "roll at speed", "trim at speed"],
)
def test_tilt_and_trims_do_not_make_a_walking_robot_fall(commanded):
    operator = [{"t": 0.0, "power": True, "mode": "stand", "height": 0.98}]
    operator += [{"t": 2.0, "mode": "walk"}, *commanded]
    content = {"name": "tilt", "start": "standing", "duration": 14.0, "operator": operator}
    cores = make_cores(resolve(read_experiment(content)))
    loop = connect(cores, lambda *_: None)
    for _ in range(7000):
        loop.tick()
    assert cores.plant.pelvis_pose[0][2] > 0.85


@pytest.mark.parametrize(
    ("row", "phase"), [("fore", 2), ("fore", 11), ("fore", 61), ("aft", 12), ("aft", 96)]
)
def test_a_push_in_place_is_not_answered_by_too_long_a_step(row, phase):
    """The step that caught it threw it back faster than the next one could bear."""
    trial = chosen_rows([f"push_in_place.{row}"])[0].trials(Budget(phases=100), 22.0)[phase]
    assert not run_trial(trial)["fell"]


def test_short_pushes_over_the_stance_foot_are_met_by_quick_steps():
    """The other foot cannot cross it: the sooner it lands, the sooner the stance foot can step out.

    All ten fell while a step lasted 0.26 s at least. Three may: which ones hangs on the last bit.
    """
    pushes = {90: (105, 106), 120: (105, 106), 240: (109, 110), 270: (109, 110), 300: (109, 110)}
    fell = 0.0
    for angle, seeds in pushes.items():
        (row,) = chosen_rows([f"push_circle_in_place.{angle}"])
        trials = row.trials(Budget(first=101), 30.0)
        fell += sum(run_trial(trial)["fell"] for trial in trials if trial.seed in seeds)
    assert fell <= 3


@pytest.mark.parametrize("seed", [6, 9])
def test_it_finds_out_that_commands_come_late_and_walks_on(seed):
    """With the usual gains each of these falls within its first steps."""
    recording, track = walk("vx: 0.5", 16.0, "delays: {set_point: 0.04}\n", seed=seed)
    status = recording.rows(ControllerStatus)
    assert status["command_latency"][stamps(status) > 4.0] == pytest.approx(0.04)
    late = track.time > 11.0
    assert track.achieved["vx"][late].mean() == pytest.approx(0.5, abs=0.03)
    assert track.achieved["height"][late].min() > 0.85


@pytest.mark.parametrize(
    ("seed", "delays"),
    [
        (2, "set_point: 0.02"),
        (1, "torque: 0.002, set_point: 0.02"),
        (7, "torque: 0.002, set_point: 0.02"),
    ],
)
def test_what_comes_late_does_not_ring_and_the_springs_ringing_is_no_fault(seed, delays):
    """Knees damped by the drives rang with the springs; that was taken for faults of sensors."""
    recording, track = walk("vx: 0.5", 16.0, f"delays: {{{delays}}}\n", seed=seed)
    assert not recording.rows(RobotState)["sensor_faults"].any()
    late = track.time > 11.0
    assert track.achieved["vx"][late].mean() == pytest.approx(0.5, abs=0.04)
    assert track.achieved["height"][late].min() > 0.85


@pytest.mark.parametrize(("seed", "set_point"), [(1, 0.01), (3, 0.015), (4, 0.025)])
def test_stiff_knees_do_not_feed_the_springs_where_torques_are_late(seed, set_point):
    """Robots rang and fell as they stood; they walk a fifth too fast at most."""
    delays = f"delays: {{torque: 0.003, set_point: {set_point}}}\n"
    recording, track = walk("vx: 0.5", 30.0, delays, seed=seed)
    assert not recording.rows(RobotState)["sensor_faults"].any()
    assert track.time[-1] == pytest.approx(30.0, abs=0.1)
    late = track.time > 10.0
    assert track.achieved["vx"][late].mean() == pytest.approx(0.5, abs=0.12)
    assert track.achieved["height"][late].min() > 0.8
