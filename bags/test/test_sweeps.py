"""Sweeps: rows by name, the search over levels, falls that count, and real runs in seconds."""

from __future__ import annotations

import dataclasses
import json
import math
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cassie_bags.errors import ExperimentError
from cassie_bags.run.cores import connect, make_cores
from cassie_bags.run.simulate import Store
from cassie_bags.run.yaml_file import spelled_out
from cassie_bags.signals.window import _slip, _velocity_off, _without_sway, measure_effort
from cassie_bags.studies.run_trial import (
    experiment_of,
    run_trial,
    unbelieved_channels,
)
from cassie_bags.studies.sweep.course import PAPER_LAW, Budget, push, step_time, walk
from cassie_bags.studies.sweep.random_commands import radio_commands
from cassie_bags.studies.sweep.row import Row, RowResult, measure_row
from cassie_bags.studies.sweep.table import all_rows, chosen_rows, load, read_rows, save, table
from cassie_bags.studies.trial import Measures, Trial
from cassie_bags.studies.workers import CachedWorkers, LocalProcesses, ThisProcess
from cassie_gaits.robot import GRAVITY
from cassie_msgs.layout import RobotState

BUDGET = Budget(seeds=4, phases=10)


def row(levels=(1.0, 2.0, 3.0, 4.0, 5.0), **changes) -> Row:
    """A push that is stronger by level; what falls is decided by `strong`."""

    def trials(budget: Budget, level: float) -> list[Trial]:
        return [Trial({"level": level}, seed, (0.0, 1.0)) for seed in range(1, 11)]

    return dataclasses.replace(
        Row("group.word", "a push", "Ns", 3.0, levels, trials, start=2), **changes
    )


def strong(limit: float, weak_seeds: int = 0):
    """A robot that falls beyond a limit, and always for the first few seeds."""

    def run(trial: Trial) -> Measures:
        fell = trial.content["level"] > limit or trial.seed <= weak_seeds
        vx = trial.content["level"] - 0.01 * trial.seed
        return {"fell": float(fell), "vx": vx, "end": 36.0, "false_alarms": 0.0}

    return run


def measure(row: Row, run, budget: Budget = BUDGET) -> RowResult:
    return measure_row(row, budget, partial(ThisProcess().results, run), print)


@pytest.mark.parametrize(("limit", "met"), [(1.0, False), (2.5, False), (3.0, True), (9.0, True)])
def test_the_hardest_level_that_holds_is_found_from_either_side(limit: float, met: bool):
    result = measure(row(), strong(limit))
    assert result.measured == min(5.0, math.floor(limit))
    assert result.met is met


@pytest.mark.parametrize(("beyond", "tried"), [(0, [3.0]), (1, [3.0, 4.0])])
def test_no_more_levels_are_tried_beyond_a_target_than_wanted(beyond: int, tried: list[float]):
    budget = dataclasses.replace(BUDGET, beyond=beyond)
    result = measure(row(), strong(9.0), budget)
    assert [level.level for level in result.levels] == tried
    assert result.met


def test_a_level_whose_figure_is_a_hair_short_of_the_target_is_not_yet_the_last():
    budget = dataclasses.replace(BUDGET, beyond=0)
    short = row(figure=lambda figures, _: figures["vx"])
    result = measure(short, strong(9.0), budget)
    assert [level.level for level in result.levels] == [3.0, 4.0]
    assert result.measured == pytest.approx(3.9)
    assert result.met


def test_a_level_names_the_robots_that_missed_it():
    (level,) = measure(row((1.0,), start=0, share=0.5), strong(9.0, weak_seeds=2)).levels
    assert level.missed == [1, 2]


def test_false_alarms_stand_beside_the_falls_and_under_the_table():
    def alarmed(trial: Trial) -> Measures:
        return strong(9.0)(trial) | {"false_alarms": 2.0 * (trial.seed in (3, 5))}

    shown = row((1.0,), start=0)
    result = measure(shown, alarmed)
    assert result.levels[0].alarmed == 2
    text = table([shown], {"measured": {shown.name: result}})
    assert "(0 of 10 fell, 2 with a false alarm)" in text
    assert text.endswith("measured: healthy sensors rejected in 2 of 10 runs, 0.1 h")
    calm = measure(shown, strong(9.0))
    assert "false alarm" not in table([shown], {"measured": {shown.name: calm}})


STUCK = {"channel": "joint_position.0", "kind": "stuck", "t": 2.5, "duration": 1.0}


def test_channels_that_are_not_believed_are_counted_as_false_where_nothing_was_put_in():
    trial = walk(1, (2.0, 3.0))
    trial = dataclasses.replace(trial, content={**trial.content, "duration": 3.0})
    assert run_trial(trial)["false_alarms"] == 0.0
    faulty = dataclasses.replace(trial, content={**trial.content, "faults": [STUCK]})
    assert run_trial(faulty)["false_alarms"] == 0.0
    cores, store = make_cores(experiment_of(faulty)), Store()
    loop = connect(cores, store)
    for _ in range(1500):
        loop.tick()
    states = store.recording(0.0).rows(RobotState)
    assert unbelieved_channels(states, 2.5) == 0
    assert unbelieved_channels(states, 3.0) >= 1


def test_rows_that_look_at_the_same_runs_share_them():
    runs, pool = [], CachedWorkers(ThisProcess())

    def counted(trial: Trial) -> Measures:
        runs.append(trial)
        return strong(9.0)(trial)

    for name in ("group.one", "group.other"):
        shown = row((3.0,), start=0, name=name)
        assert measure_row(shown, BUDGET, partial(pool.results, counted), print).met
    assert len(runs) == 10


def test_a_radio_that_jumps_is_the_same_for_the_same_seed():
    steps = radio_commands(3, 5.0, 35.0)
    assert steps == radio_commands(3, 5.0, 35.0)
    assert steps != radio_commands(4, 5.0, 35.0)
    times = [step["t"] for step in steps]
    assert times == sorted(times)
    assert 5.0 <= times[0] < times[-1] < 35.0
    assert {step["mode"] for step in steps if "mode" in step} >= {"walk", "stand"}
    assert {1.2, -0.7} <= {step.get("vx") for step in steps}


def test_a_radio_that_jumps_does_not_make_it_fall():
    (row,) = chosen_rows(["radio"])
    (trial,) = row.trials(Budget(seeds=1, seconds=2.0), 0.0)
    figures = run_trial(trial)
    assert figures["fell"] == 0.0
    assert figures["end"] == pytest.approx(20.0, abs=0.01)


@pytest.mark.parametrize("robot", [1, 3])
def test_robots_walk_where_their_heels_dig_in(robot: int):
    """The nominal one did; robot 1 ran away, and robot 3 stopped: a toe was taken for late."""
    (row,) = (row for row in chosen_rows(["sinking"]) if row.name == "sinking.heel")
    trial = row.trials(Budget(seeds=robot), 0.08)[-1]
    assert trial.seed == robot
    figures = run_trial(trial)
    assert figures["fell"] == 0.0
    assert row.holds(figures, 0.08)
    assert figures["sole_pitch"] > 30.0


def test_what_holds_nowhere_is_no_figure():
    result = measure(row(), strong(0.0))
    assert math.isnan(result.measured)
    assert not result.met


@pytest.mark.parametrize(("weak", "held"), [(1, True), (2, False)])
def test_nine_of_ten_must_hold(weak: int, held: bool):
    assert measure(row(share=0.9), strong(9.0, weak)).met is held


def test_a_level_that_can_no_longer_hold_ends_early():
    result = measure(row(share=0.9), strong(9.0, 10))
    assert [level.run for level in result.levels] == [2, 2, 2]


def test_the_worst_figure_of_those_that_walk_counts_and_a_fall_is_a_miss():
    single = row(
        (1.0,), start=0, target=0.95, figure=lambda figures, _: figures["vx"], at_least=True
    )
    good = measure(single, strong(9.0))
    assert good.measured == pytest.approx(0.9)
    assert not good.met
    assert measure(dataclasses.replace(single, target=0.9), strong(9.0)).met
    fallen = measure(dataclasses.replace(single, target=0.5), strong(9.0, 1))
    assert (fallen.levels[0].fell, fallen.levels[0].run, fallen.met) == (1, 10, False)


def test_no_two_rows_have_name_or_title_in_common():
    for words in ([row.name for row in all_rows()], [row.title for row in all_rows()]):
        assert len(words) == len(set(words))


def test_rows_are_chosen_by_name_and_by_group():
    names = [row.name for row in all_rows()]
    assert [row.name for row in chosen_rows(["speed.+0.5"])] == ["speed.+0.5"]
    assert len(chosen_rows(["push_in_place"])) == 8
    promised, beyond = chosen_rows([]), chosen_rows(["beyond"])
    assert [row.name for row in (*promised, *beyond)] == names
    assert chosen_rows(["speed.everything"])[0].name in {row.name for row in beyond}
    assert not {row.name for row in chosen_rows(["speed"])} & {row.name for row in beyond}
    assert {row.group for row in chosen_rows(["payload"])} == {"payload"}
    with pytest.raises(ExperimentError, match="unknown row spede: did you mean speed"):
        chosen_rows(["spede"])


@pytest.mark.parametrize("name", [row.name for row in all_rows()])
def test_every_row_can_be_run_at_its_first_and_its_last_levels(name: str):
    (row,) = chosen_rows([name])
    for level in (row.levels[0], row.levels[-1]):
        experiment_of(row.trials(Budget(seeds=1, phases=1), level)[0])
    trials = row.trials(Budget(seeds=2, phases=4), row.levels[row.first])
    assert {trial.seed for trial in trials} == {1, 2}
    for trial in (trials[0], trials[-1]):
        assert 0.0 < trial.window[0] < trial.window[1] <= experiment_of(trial).duration


def test_phases_spread_over_two_steps():
    delays = [delay for delay, _ in Budget(phases=10).each_phase(0.0)]
    assert delays[0] == 0.0
    assert delays[-1] == pytest.approx(0.9 * 2.0 * step_time(0.0))


@pytest.mark.parametrize("name", [row.name for row in all_rows()])
def test_every_row_has_other_robots_do_what_the_first_ones_do(name: str):
    (row,) = chosen_rows([name])
    level, chosen = row.levels[row.first], {"seeds": 2, "phases": 4}
    first, others = (row.trials(Budget(**chosen, first=n), level) for n in (1, 101))
    assert [trial.seed for trial in others] == [100 + trial.seed for trial in first]
    for one, other in zip(first, others, strict=True):
        assert other.window == one.window


def trials_of(name: str, level: float, budget: Budget) -> list[Trial]:
    (chosen,) = chosen_rows([name])
    return chosen.trials(budget, level)


def test_payloads_lie_five_centimetres_off_centre_on_every_side():
    loads = [
        trial.content["payload"] for trial in trials_of("payload.walking", 8.0, Budget(seeds=4))
    ]
    places = [(round(load["x"], 9), round(load["y"], 9)) for load in loads]
    assert places == [(0.05, 0.0), (0.0, 0.05), (-0.05, 0.0), (0.0, -0.05)]
    assert {load["mass"] for load in loads} == {8.0}


def test_pushes_of_a_circle_have_one_impulse_and_every_duration():
    pushes = [
        trial.content["pushes"][0] for trial in trials_of("push_circle_fast.90", 22.0, Budget())
    ]
    assert {entry["duration"] for entry in pushes} == {0.05, 0.1, 0.2, 0.4}
    impulses = [entry["duration"] * entry["force"][1] for entry in pushes]
    assert impulses == pytest.approx([22.0] * 10)


def test_everything_at_once_is_asked_for_to_either_side():
    commands = [
        next(step for step in trial.content["operator"] if "vy" in step)
        for trial in trials_of("speed.everything", 1.0, Budget(seeds=4))
    ]
    sides = {(step["vy"], step["yaw_rate"]) for step in commands}
    assert sides == {(0.2, 0.4), (0.2, -0.4), (-0.2, 0.4), (-0.2, -0.4)}


def test_blind_steps_ice_and_pillars_are_spread_over_a_stride():
    stride = 2.0 * step_time(0.4) * 0.4
    steps = trials_of("step_fast.up", 0.1, Budget(seeds=4))
    starts = np.array([trial.content["scene_parameters"]["start"] for trial in steps])
    np.testing.assert_allclose(starts, 1.0 + stride * np.arange(4) / 4.0)
    ice = trials_of("friction.ice", 0.12, Budget(seeds=4))
    first = [trial.content["scene_parameters"]["stretches"][0]["length"] for trial in ice]
    np.testing.assert_allclose(first, starts)
    waxed = [
        trial.content["scene_parameters"]
        for trial in trials_of("friction.pillar", 0.25, Budget(seeds=4))
    ]
    pillars = [each["pillars"][0]["x"] for each in waxed]
    np.testing.assert_allclose(pillars, 2.0 + starts)
    assert {each["stretches"][0]["friction"] for each in waxed} == {0.25}


def test_obstacles_of_other_robots_are_spread_over_the_same_stride():
    first, others = (trials_of("stairs.up", 0.17, Budget(seeds=4, first=seed)) for seed in (1, 101))
    for one, other in zip(first, others, strict=True):
        assert one.content["scene_parameters"] == other.content["scene_parameters"]


def test_a_push_has_its_impulse_and_direction():
    event = push(1.0, 12.0, 90.0)
    assert event["duration"] * event["force"][1] == pytest.approx(12.0)
    assert event["force"][0] == pytest.approx(0.0, abs=1e-9)


def test_a_trial_keeps_the_written_times_and_draws_the_robot():
    trial = Trial({"duration": 3.0, "pushes": [push(1.5, 10.0, 0.0)]}, 7, (0.0, 1.0))
    experiment = experiment_of(trial)
    assert experiment.scenario.pushes[0].t == 1.5
    assert experiment.scenario.draw.mass != 1.0
    assert (experiment.seed, experiment_of(trial)) == (7, experiment)
    fixed = experiment_of(Trial({"duration": 3.0, "draw": {"mass": 1.1}}, 7, (0.0, 1.0)))
    assert fixed.scenario.draw.mass == 1.1


def test_a_push_gives_the_same_impulse_however_long_it_lasts():
    event = push(1.0, 12.0, 180.0, 0.4)
    assert event["duration"] == 0.4
    assert event["duration"] * event["force"][0] == pytest.approx(-12.0)


def walked_two_metres(torque: float, velocity: float) -> SimpleNamespace:
    """A walk of 4 s at 0.5 m/s in which one drive works and another brakes."""
    time = np.arange(0.0, 4.0, 0.002)
    sensors = {name: np.zeros((len(time), 10)) for name in ("drive_torque", "drive_velocity")}
    sensors["drive_torque"][:, [3, 4]] = torque
    sensors["drive_velocity"][:, 3], sensors["drive_velocity"][:, 4] = velocity, -velocity
    rows = np.rec.fromarrays(list(sensors.values()), names=list(sensors))
    position = np.outer(time, [0.5, 0.0, 0.0])
    return SimpleNamespace(time=time, tick=0.002, position=position, sensors=rows)


def test_cost_of_transport_is_work_by_weight_and_distance():
    walked = walked_two_metres(torque=30.0, velocity=2.0)
    figures = measure_effort(walked, (1.0, 3.0), 33.0)
    expected = 30.0 * 2.0 * 2.0 / (33.0 * GRAVITY * 1.0)
    assert figures["transport_work"] == pytest.approx(expected, rel=0.01)
    assert figures["transport_work_abs"] == pytest.approx(2.0 * expected, rel=0.01)
    assert figures["torque_rms"] == pytest.approx(30.0 * math.sqrt(2.0))
    assert all(map(math.isnan, measure_effort(walked, (1.0, 5.0), 33.0).values()))
    short = measure_effort(walked, (1.0, 1.5), 33.0)
    assert math.isnan(short["transport_work"])
    assert short["torque_rms"] == pytest.approx(30.0 * math.sqrt(2.0))


def test_the_sway_of_steps_is_no_side_slip():
    time = np.arange(0.0, 20.0, 0.002)
    sway = 0.25 * np.sin(2.0 * np.pi * time / 0.78)
    assert _slip(sway, 400) < 0.03
    assert _slip(sway + 0.2, 400) == pytest.approx(0.2, abs=0.03)
    cut = 0.5 + sway[: round(2.25 * 390)]  # ends a quarter of two steps later than it begins
    assert abs(cut.mean() - 0.5) > 0.015
    assert _without_sway(cut, 400) == pytest.approx(0.5, abs=0.003)


def test_the_way_back_to_a_command_counts_without_the_sway():
    time = np.arange(0.0, 10.0, 0.002)
    sway = 0.25 * np.sin(2.0 * np.pi * time / 0.8)
    achieved = {"vx": 0.5 + 0.2 * (time > 6.0), "vy": sway}
    commanded = {"vx": np.full(len(time), 0.5), "vy": np.zeros(len(time))}
    track = SimpleNamespace(achieved=achieved, commanded=commanded)
    assert _velocity_off(track, time < 6.0, 400) < 0.01
    assert _velocity_off(track, time > 2.0, 400) == pytest.approx(0.2, abs=0.01)
    assert math.isnan(_velocity_off(track, time < 0.5, 400))


STAND = {
    "start": "standing",
    "duration": 1.6,
    "operator": [{"t": 0.0, "power": True, "mode": "stand", "height": 0.95}],
}


def test_a_robot_that_stands_is_measured():
    figures = run_trial(Trial(STAND, 0, (1.0, 1.6)))
    assert (figures["fell"], figures["standing"]) == (0.0, 1.0)
    assert abs(figures["vx"]) < 0.1
    assert figures["step_rate"] == 0.0
    assert 10.0 < figures["torque_rms"] < 200.0
    assert math.isnan(figures["transport_work"])
    assert figures["rmse_vx"] < 0.1
    assert figures["end"] == pytest.approx(1.6, abs=0.01)


def test_a_robot_that_falls_ends_its_run():
    content = {**STAND, "duration": 30.0, "pushes": [push(0.8, 150.0, 0.0)]}
    figures = run_trial(Trial(content, 0, (20.0, 30.0)))
    assert figures["fell"] == 1.0
    assert figures["end"] < 5.0
    assert math.isnan(figures["vx"])


def test_local_processes_give_what_this_process_gives():
    trials = [Trial(STAND, seed, (1.0, 1.6)) for seed in (1, 2)]
    here = dict(ThisProcess().results(run_trial, trials))
    pool = LocalProcesses(2)
    try:
        there = dict(pool.results(run_trial, trials))
        for index, figures in here.items():
            assert there[index] == pytest.approx(figures, rel=0.0, abs=0.0, nan_ok=True)
    finally:
        pool.close()


def test_results_are_kept_as_json_and_as_a_table(tmp_path: Path):
    shown = row()
    results = {
        "measured": {shown.name: measure(shown, strong(4.0))},
        "paper": {shown.name: RowResult(shown.name, math.nan, False, [], "unknown parameter")},
    }
    save(tmp_path / "out/sweeps.json", [shown], results, BUDGET)
    content = json.loads((tmp_path / "out/sweeps.json").read_text())
    assert content["rows"][0]["results"]["measured"]["measured"] == 4.0
    assert content["rows"][0]["results"]["paper"]["measured"] is None
    assert content["budget"]["seeds"] == 4
    text = table([shown], results)
    assert ">= 3 Ns" in text
    assert "4 yes (1 of 21 fell)" in text
    assert "unknown parameter" in text


def test_kept_results_come_back_for_the_same_budget_alone(tmp_path: Path):
    shown, path = row(), tmp_path / "sweeps.json"
    assert load(path, [shown], BUDGET) == {}
    results = {"measured": {shown.name: measure(shown, strong(4.0))}}
    save(path, [shown], results, BUDGET)
    again = load(path, [shown], BUDGET)
    assert table([shown], again) == table([shown], results)
    assert again["measured"][shown.name].measured == 4.0
    with pytest.raises(ExperimentError, match="measured with other seeds, phases"):
        load(path, [shown], Budget(seeds=9))
    path.write_text("[]")
    with pytest.raises(ExperimentError, match="holds no results of sweeps"):
        load(path, [shown], BUDGET)


def test_speeds_that_robots_reached_are_kept_in_the_order_of_the_trials(tmp_path: Path):
    shown = row((1.0,), start=0, share=0.5, achieved=lambda figures, _: figures["vx"])
    path = tmp_path / "sweeps.json"
    result = measure(shown, strong(9.0, weak_seeds=2))
    assert result.levels[0].achieved is not None
    assert list(result.levels[0].achieved) == [1.0 - 0.01 * seed for seed in range(3, 11)]
    save(path, [shown], {"measured": {shown.name: result}}, BUDGET)
    (kept,) = read_rows(path)
    assert kept.results["measured"] == result
    assert measure(row(), strong(9.0)).levels[0].achieved is None


def test_results_that_were_kept_before_origins_and_speeds_are_read(tmp_path: Path):
    shown, path = row(), tmp_path / "sweeps.json"
    save(path, [shown], {"measured": {shown.name: measure(shown, strong(4.0))}}, BUDGET)
    content = json.loads(path.read_text())
    kept = content["rows"][0]["results"]["measured"]
    del kept["origin"]
    for level in kept["levels"]:
        del level["achieved"]
    path.write_text(json.dumps(content))
    (again,) = read_rows(path)
    assert again.results["measured"].origin is None
    assert again.results["measured"].measured == 4.0


@pytest.mark.parametrize(("limit", "open_ended"), [(3.5, False), (9.0, True), (0.0, False)])
def test_a_limit_lies_beyond_where_every_level_that_was_tried_holds(limit: float, open_ended: bool):
    assert measure(row(), strong(limit)).open_ended is open_ended


def test_the_paper_law_is_compared_with_gains_with_which_it_walks():
    """With the drives' gains of the other law it ran away where 0.25 m/s was asked for."""
    changes = spelled_out([PAPER_LAW])
    assert 'controller.walk.law="paper"' in changes
    figures = run_trial(walk(1, (15.0, 30.0), vx=0.25, changes=changes))
    assert figures["fell"] == 0.0
    assert figures["vx"] == pytest.approx(0.25, abs=0.05)
