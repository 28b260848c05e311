"""Tuning: the space, the objective, a search with a known optimum, and the command."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_experiment_command import environment

from cassie_bags.errors import ExperimentError
from cassie_bags.run.yaml_file import apply_changes, spelled_out
from cassie_bags.studies.run_trial import experiment_of
from cassie_bags.studies.tune.objective import DEFAULT, load_objective
from cassie_bags.studies.tune.search import Search
from cassie_bags.studies.tune.space import JOINT_GAINS, Parameter, parameters, values
from cassie_control.config import ControllerConfig
from cassie_msgs.tunables import entries

GOAL = np.array([0.4, -0.7, 0.1, 0.9])


def bowl(candidates) -> list[float]:
    """Cost with its least value, 0, at GOAL; steep in one direction."""
    return [float((x - GOAL) ** 2 @ [1.0, 10.0, 1.0, 3.0]) for x in candidates]


def begin(seed: int = 1) -> Search:
    return Search.begin(len(GOAL), seed, 0.3, 8)


def test_a_known_optimum_is_found():
    search = begin()
    for _ in range(60):
        search.advance(bowl)
    np.testing.assert_allclose(search.found, GOAL, atol=0.01)
    assert search.history[-1].best < 1e-3
    assert [generation.number for generation in search.history] == list(range(1, 61))


def test_a_search_stays_in_the_box():
    search = begin()
    seen = []
    for _ in range(30):
        search.advance(lambda found: (seen.extend(found), [-float(x.sum()) for x in found])[1])
    assert np.abs(seen).max() <= 1.0
    np.testing.assert_allclose(search.found, 1.0, atol=0.02)


def test_costs_that_hang_on_luck_still_lead_towards_the_optimum():
    rng, search = np.random.default_rng(5), begin()
    for _ in range(40):
        search.advance(lambda found: [cost + rng.normal(0.0, 3.0) for cost in bowl(found)])
    assert bowl([search.found])[0] < 0.5 * bowl([np.zeros(4)])[0]


def test_a_resumed_search_goes_on_as_if_it_had_not_stopped(tmp_path: Path):
    whole, first = begin(), begin()
    for _ in range(6):
        whole.advance(bowl)
    for _ in range(3):
        first.advance(bowl)
    first.save(tmp_path / "search.pickle", "bowl")
    again = Search.load(tmp_path / "search.pickle", "bowl")
    for _ in range(3):
        again.advance(bowl)
    assert again.history == whole.history
    np.testing.assert_array_equal(again.found, whole.found)


def test_what_cannot_be_resumed_is_refused(tmp_path: Path):
    with pytest.raises(ExperimentError, match=r"cannot resume from .*No such file"):
        Search.load(tmp_path / "none", "bowl")
    begin().save(tmp_path / "search", "bowl")
    with pytest.raises(ExperimentError, match="it searches other parameters"):
        Search.load(tmp_path / "search", "plate")
    (tmp_path / "junk").write_bytes(b"junk")
    with pytest.raises(ExperimentError, match="it holds no search"):
        Search.load(tmp_path / "junk", "bowl")


def test_the_joint_and_leg_angle_gains_are_searched_unless_others_are_named():
    names = {parameter.name for parameter in parameters([], {}, 2.0)}
    assert {"walk.joints.kp_knee", "walk.joints.kd_toe", "walk.kp_torso_roll"} <= names
    assert {"walk.map_gain_x", "walk.map_loss_x", "walk.observer_gain"} <= names
    assert not any("paper" in name or "limit" in name for name in names)
    paper = {parameter.name for parameter in parameters([], {"walk.law": "paper"}, 2.0)}
    leg_angle = {f"walk.paper_{gain}_{axis}" for gain in ("kp", "kd") for axis in "xy"}
    assert {name for name in paper if "paper" in name} == leg_angle


def test_the_space_is_centred_on_the_start_and_keeps_the_range():
    (knee,) = parameters(["walk.joints.kp_knee"], {"walk.joints.kp_knee": 1500.0}, 2.0)
    assert (knee.start, knee.low, knee.high) == (1500.0, 750.0, 2000.0)
    assert knee.value(0.0) == 1500.0
    assert knee.value(1.0) == pytest.approx(2000.0)
    assert knee.value(-0.5) == pytest.approx(1500.0 / np.sqrt(2.0))
    zero = Parameter("x", "", 0.0, -0.2, 0.4)
    assert [zero.value(c) for c in (-1.0, 0.0, 0.5)] == pytest.approx([-0.2, 0.0, 0.2])


def test_an_unknown_pattern_names_the_nearest_parameter():
    with pytest.raises(ExperimentError, match=r"walk.joints.kp_kne: did you mean walk.joints.kp"):
        parameters(["walk.joints.kp_kne"], {}, 2.0)
    with pytest.raises(ExperimentError, match=r"unknown numeric parameter walk.law"):
        parameters(["walk.law"], {}, 2.0)


def test_the_objective_runs_every_course_on_robots_with_errors_of_the_model():
    objective = load_objective()
    found = {"walk.joints.kp_knee": 777.0}
    trials = objective.trials(found, [1, 2], ["supervisor.acceleration=0.5"])
    assert len(trials) == 2 * len(objective.courses)
    models = []
    for trial in trials:
        experiment = experiment_of(trial)
        assert experiment.parameters["controller"] == found
        assert experiment.parameters["supervisor"]["acceleration"] == 0.5
        models.append(experiment.scenario.model)
        for push in experiment.scenario.pushes:
            assert trial.window[0] < push.t < trial.window[1] - 1.0
    assert all(0.9 <= m.mass <= 1.1 and 0.8 <= m.spring <= 1.2 for m in models)
    assert len({m.mass for m in models}) == len(models)
    assert any(experiment_of(trial).scenario.pushes for trial in trials)
    assert trials == objective.trials(found, [1, 2], ["supervisor.acceleration=0.5"])


def test_a_fall_costs_more_than_anything_else_and_an_early_one_most():
    objective = load_objective()
    ahead = [course.vx for course in objective.courses].index(0.5)
    trial = objective.trials({}, [1], [])[ahead]
    perfect = {"fell": 0.0, "end": 20.0, "tracking": 0.0, "vx": 0.5, "vy": 0.0, "yaw_rate": 0.0}
    slow = {**perfect, "vx": 0.4}
    late, early = ({"fell": 1.0, "end": end} for end in (15.0, 5.0))
    costs = [objective.cost_of(trial, figures) for figures in (perfect, slow, late, early)]
    assert costs[0] == 0.0
    assert costs[1] == pytest.approx(2.0)
    assert costs == sorted(costs)
    assert costs[2] >= objective.cost.fall


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("courses: []", "courses must be a list of at least one"),
        ("cources: [{}]", "unknown key cources: did you mean courses"),
        ("courses: [{vxx: 1}]", "courses.0: unknown key vxx: did you mean vx"),
        ("courses: [{vx: 9}]", r"courses.0.vx = 9 m/s is outside -1 .. 2 m/s"),
        ("courses: [{push: {impulze: 3}}]", "courses.0.push: unknown key impulze"),
        ("courses: [{}]\nmodel: {mass: [2, 1]}", r"model.mass = \[2, 1\] is not \[low, high\]"),
        ("courses: [{}]\nmodel: {mas: [1, 2]}", "model: unknown key mas: did you mean mass"),
        ("courses: [{delays: {torque: 1}}]", "courses.0.delays.torque = 1 s is outside 0"),
        ("courses: [{}]\ncost: {fal: 1}", "cost: unknown key fal: did you mean fall"),
    ],
)
def test_what_is_wrong_in_an_objective_is_named(tmp_path: Path, text: str, reason: str):
    path = tmp_path / "objective.yaml"
    path.write_text(text)
    with pytest.raises(ExperimentError, match=reason):
        load_objective(path)


STAND = """
courses: [{name: stand, seconds: 0.5}]
"""
QUICK = ["walk.k[pd]_torso_pitch", "--robots", "1", "--population", "3", "--jobs", "1"]


def tune(*words: str | Path, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cassie_bags.cli.tune", *map(str, words)]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment(), check=False, timeout=600
    )


def test_the_command_leaves_parameters_that_experiments_take(tmp_path: Path):
    objective, out = tmp_path / "stand.yaml", tmp_path / "out"
    objective.write_text(STAND)
    words = [*QUICK, "--objective", objective, "--out", out, "--held-out", "1"]
    process = tune(*words, "--generations", "1")
    assert process.returncode == 0, process.stderr
    assert "generation 1 of 1" in process.stderr
    assert "held out, found: cost" in process.stdout
    found = yaml.safe_load((out / "tuned.yaml").read_text())["controller"]
    assert set(found) == {"walk.kp_torso_pitch", "walk.kd_torso_pitch"}
    content: dict = {}
    apply_changes(content, [f"@{out / 'tuned.yaml'}"])
    assert content["controller"]["walk"] == {
        name.removeprefix("walk."): value for name, value in found.items()
    }
    spelled = [f"controller.{name}={value!r}" for name, value in found.items()]
    assert spelled_out(["a=1", f"@{out / 'tuned.yaml'}"]) == ("a=1", *spelled)
    node = yaml.safe_load((out / "tuned_node.yaml").read_text())
    assert node["gait_controller"]["ros__parameters"] == found
    kept = json.loads((out / "tuned.json").read_text())
    assert kept["settings"]["seed"] == 1
    assert kept["settings"]["objective"]["courses"][0]["name"] == "stand"
    assert len(kept["history"]) == 1
    assert kept["versions"]["mujoco"]
    assert kept["scores"]["held out, found"]["runs"] == 1
    process = tune(*words, "--generations", "1", "--resume", "--held-out", "0")
    assert process.returncode == 0, process.stderr
    assert "after 1 generations" in process.stdout


def test_ctrl_c_keeps_what_was_found(tmp_path: Path):
    objective, out = tmp_path / "stand.yaml", tmp_path / "out"
    objective.write_text(STAND)
    words = [*QUICK, "--objective", str(objective), "--out", str(out), "--generations", "1000"]
    with subprocess.Popen(
        [sys.executable, "-m", "cassie_bags.cli.tune", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as process:
        while process.poll() is None and not (out / "search.pickle").is_file():
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=90)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert "what was found is kept" in errors
    assert "walk.kp_torso_pitch" in output
    assert (out / "tuned.yaml").is_file()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["walk.joint.*"], "unknown numeric parameter walk.joint.*"),
        (["walk.hold_gain"], "two or more are needed"),
        (["--factor", "1"], "1 is not 1.01 .. 100"),
        (["--population", "1"], "1 is not 0 (auto), or 2 or more"),
        (["--resume"], "cannot resume from"),
        (["--set", "controler.x=1"], "unknown key controler"),
        (["--set", "controller=5"], "controller = 5 is not a mapping"),
        (["--objective", "none.yaml"], "cannot read none.yaml"),
    ],
)
def test_wrong_words_exit_with_2(words: list[str], reason: str, tmp_path: Path):
    process = tune(*words, "--out", tmp_path, "--jobs", "1")
    assert process.returncode == 2, process.stdout
    assert reason in process.stderr
    assert "Traceback" not in process.stderr


def test_the_gains_of_walking_are_those_that_the_search_found():
    record = json.loads(DEFAULT.with_name("shipped.json").read_text())
    *_, last = record["searches"]
    shipped = {entry.name: entry.value for entry in entries(ControllerConfig())}
    found = {found["name"]: float(f"{found['found']:.3g}") for found in last["parameters"]}
    # The search had foot placement by gains; a model has taken their place since.
    kept = {name: value for name, value in found.items() if name in shipped}
    assert kept == {name: shipped[name] for name in kept}
    assert set(kept) == {parameter.name for parameter in parameters(JOINT_GAINS, {}, 1.5)}
    before, after = (last["scores"][f"held out, {what}"] for what in ("to begin with", "found"))
    assert after["cost"] < before["cost"]
    assert after["fell"] <= before["fell"]


def test_the_defaults_of_the_controller_are_within_their_reach():
    space = parameters([], {}, 2.0)
    for parameter in space:
        assert parameter.low <= parameter.start <= parameter.high
    assert values(space, np.zeros(len(space)))["walk.joints.kp_knee"] == (
        ControllerConfig().walk.joints.kp_knee
    )
