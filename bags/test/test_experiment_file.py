"""Experiment files: what is read, changed, drawn and refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cassie_bags.errors import ExperimentError
from cassie_bags.run.cores import check_parameters
from cassie_bags.run.experiment import load_experiment, parse_experiment
from cassie_bags.run.judge import phases_of_steps
from cassie_bags.run.seed import delayed, resolve
from cassie_bags.run.yaml_file import consistent
from cassie_msgs.experiment.file import Experiment, read_experiment, to_yaml
from cassie_msgs.experiment.scenario import Draw

TEXT = """
name: try
start: gantry
seed: 5
duration: 20.0
scene_parameters: {friction: 0.8}
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.9}
  - {t: 4.0, mode: walk}
  - {t: 4.1, vx: 0.5}
gantry:
  - {t: 2.0, height: 0.8, speed: 0.05}
  - {t: 9.0, hold: 1.0}
  - {t: 12.0, release: true}
pushes:
  - {t: 6.0, duration: 0.1, force: [50.0, 0.0, 0.0], body: pelvis}
delays: {torque: 0.001}
model: {mass: 1.1}
simulator: {pacing: lockstep, max_rate: 2.0}
controller: {walk: {joints: {kp_knee: 300.0}}, walk.law: paper}
expect:
  fell: false
  phases:
    - {name: walk, t0: 6, t1: 9, vx: {target: 0.5, tolerance: 0.1}}
"""


def read(text: str = TEXT) -> Experiment:
    return parse_experiment(text, "try.yaml")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "try.yaml"
    path.write_text(TEXT)
    return path


def test_a_file_says_what_it_says():
    experiment = read()
    assert experiment.seed == 5
    assert experiment.scenario.model.mass == 1.1
    assert experiment.scenario.delays.torque == 0.001
    assert [move.action for move in experiment.scenario.gantry] == ["lower", "hold", "release"]
    assert experiment.scenario.gantry[0].height == 0.8
    assert experiment.scenario.gantry[1].height == 1.0
    assert experiment.scenario.pushes[0].force == (50.0, 0.0, 0.0)
    assert experiment.parameters["controller"] == {
        "walk.joints.kp_knee": 300.0,
        "walk.law": "paper",
    }
    assert experiment.expect.phases[0].name == "walk"


def test_a_file_without_a_name_is_called_after_itself(tmp_path: Path):
    path = tmp_path / "nameless.yaml"
    path.write_text("duration: 1.0")
    assert load_experiment(path).name == "nameless"


def test_changes_from_the_command_line_replace_what_the_file_says(file: Path):
    changes = ["operator.2.vx=0.6", "duration=30", "delays.set_point=1e-2", "supervisor.x.y=3"]
    experiment = load_experiment(file, changes, seed=9)
    assert experiment.operator[2].changes["vx"] == 0.6
    assert experiment.duration == 30.0
    assert experiment.scenario.delays.set_point == 0.01
    assert experiment.seed == 9
    assert experiment.parameters["supervisor"] == {"x.y": 3}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("vx", "expected key=value"),
        ("operator.7.vx=1", "index 7 of operator is not one of 0 .. 2"),
        ("operator.last.vx=1", "last is no index"),
        ("duration.x=1", "duration is a value"),
        ("duratio=1", "did you mean duration"),
        ("operator.1={", "--set operator.1={"),
    ],
)
def test_a_change_that_leads_nowhere_is_refused(file: Path, change: str, reason: str):
    with pytest.raises(ExperimentError, match=reason):
        load_experiment(file, [change])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("duraton: 3", "unknown key duraton: did you mean duration"),
        ("name: x", "duration must be given"),
        ("duration: .nan", "outside 0"),
        ("duration: -1", "outside 0"),
        ("duration: long", "is not a number"),
        ("duration: true", "is not a number"),
        ("duration: 1\nduration: 2", "try.yaml:2: key duration is given twice"),
        ("duration: [1", "try.yaml:1"),
        ("- 1", "holds no mapping"),
        ("", "holds no mapping"),
        ("duration: 1\nseed: -1", "seed = -1"),
        ("duration: 1\nseed: 1.5", "seed = 1.5 is not a whole number"),
        ("duration: 1\nstart: standin", "start = 'standin' is not one of gantry, standing"),
        ("duration: 1\noperator: 3", "operator = 3 is not a list"),
        ("duration: 1\noperator: [{vx: 1}]", r"operator.0.t must be given \(0 .. inf s\)"),
        ("duration: 1\noperator: [{t: 0, v: 1.0}]", "operator.0: unknown key v"),
        ("duration: 1\noperator: [{t: 0, vx: .nan}]", r"operator.0.vx = nan m/s is outside"),
        ("duration: 1\ngantry: [{t: 1}]", "gantry.0: expected one of height, release and hold"),
        ("duration: 1\ngantry: [{t: 1, hold: 1.0, release: true}]", "expected one of"),
        ("duration: 1\ngantry: [{t: 1, release: 3}]", "gantry.0.release = 3 is not true"),
        ("duration: 1\ngantry: [{t: 1, hight: 1.0}]", "gantry.0: .* did you mean height"),
        ("duration: 1\ngantry: [{t: 1, height: 9.0}]", r"height = 9 m is outside 0.2 \.\. 2 m"),
        ("duration: 1\npushes: [{t: 1, force: [1, 2]}]", "pushes.0.force = .* list of 3 numbers"),
        ("duration: 1\npushes: [{t: 1, force: [1, 2, .nan]}]", r"pushes.0.force\[2\] = nan N"),
        ("duration: 1\npushes: [5]", "pushes.0 = 5 is not a mapping"),
        (
            "duration: 1\nfaults: [{t: 1, channel: battery, kind: of}]",
            "kind = 'of' is not one",
        ),
        (
            "duration: 1\nfaults: [{t: 1, duration: 0, channel: battery, kind: 'off'}]",
            r"faults.0.duration = 0 s is outside 0.0005 \.\. inf s",
        ),
        ("duration: 1\nmodel: {mas: 1.0}", "model: unknown key mas: did you mean mass"),
        ("duration: 1\ndelays: {torque: 1.0}", r"delays.torque = 1 s is outside 0 \.\. 0.1 s"),
        ("duration: 1\ncontroller: 5", "controller = 5 is not a mapping"),
        ("duration: 1\nexpect: {fel: true}", "expect: unknown key fel: did you mean fell"),
        ("duration: 1\nseed: 2\ndraw: {mass: 7.0}", r"draw.mass = 7 is outside 0.5 \.\. 1.5"),
        ("duration: 1\nseed: 2\ndraw: {weight: 1.0}", "draw: unknown key weight"),
        (
            "duration: 1\ncontroller: {walk: {law: paper}, walk.law: ours}",
            "controller: walk.law is given twice: 'paper' and 'ours'",
        ),
        ("duration: 1\noperator:\n- {t: 0, vx: 1, vx: 2}", "try.yaml:3: key vx is given twice"),
        ("duration: 0", r"duration = 0 is too short: at least 0\.02 s"),
        ("duration: 0.001", r"duration = 0\.001 is too short"),
        ("start: standing", "duration must be given"),
        ("duration: 1\nmodel: &m {mass: 1.0}\ndraw: *m", "try.yaml:3: aliases"),
    ],
)
def test_a_wrong_file_is_refused_with_key_value_and_range(text: str, reason: str):
    with pytest.raises(ExperimentError, match=reason):
        resolve(read(text))


@pytest.mark.parametrize("key", ["start: standing", "seed: 3", "scene: slope", "duration: 5.0"])
def test_what_a_key_says_is_not_said_again_to_the_simulator(key: str):
    name, _, value = key.partition(": ")
    given = {"duration": "2.0"} | {name: value}
    text = "\n".join(f"{name}: {value}" for name, value in given.items())
    with pytest.raises(ExperimentError, match=f"simulator.{name} follows from other keys"):
        check_parameters(read(f"{text}\nsimulator: {{{key}}}"))


@pytest.mark.parametrize(
    ("controller", "change", "law"),
    [
        ("{walk.law: paper}", "walk.law=pendulum", "pendulum"),
        ("{walk: {joints: {kp_knee: 1.0}}, walk.law: paper}", "walk.law=pendulum", "pendulum"),
        ("{walk: {law: paper}}", "walk.law=pendulum", "pendulum"),
        ("{walk.law: paper}", "walk={law: pendulum}", "pendulum"),
        ("{walk.law: paper}", "walk={}", None),
    ],
)
def test_a_change_replaces_either_spelling_of_a_parameter(
    tmp_path: Path, controller: str, change: str, law: str | None
):
    path = tmp_path / "try.yaml"
    path.write_text(f"duration: 1.0\ncontroller: {controller}")
    found = load_experiment(path, [f"controller.{change}"]).parameters["controller"]
    assert found.get("walk.law") == law


@pytest.mark.parametrize(
    "changes",
    [
        ["duration=3", "duration=4"],
        ["controller.walk.law=paper", "controller={walk.law: ours}"],
        ["controller.walk.law=paper", "controller.walk={}"],
        ["controller.walk.law=ours", "@FILE"],
        ["@FILE", "@OTHER"],
        ["operator.1.vx=0.5", "operator=[]"],
    ],
)
def test_changes_that_contradict_each_other_are_refused(tmp_path: Path, changes: list[str]):
    for name, law in (("FILE", "paper"), ("OTHER", "ours")):
        (tmp_path / name).write_text(f"controller: {{walk: {{law: {law}}}}}")
    words = [change.replace("@", f"@{tmp_path}/") for change in changes]
    with pytest.raises(ExperimentError, match=r"is given twice: .* and "):
        consistent(words)


def test_changes_that_agree_or_go_beyond_a_file_are_taken(tmp_path: Path):
    (tmp_path / "FILE").write_text("controller: {walk: {law: paper}}")
    consistent(["duration=3", "duration=3.0", "controller.walk.law=paper"])
    consistent([f"@{tmp_path}/FILE", "controller.walk.law=ours"])
    consistent(["operator=[{t: 0}]", "operator.0.vx=0.5", "operator.1.vx=0.6"])


@pytest.mark.parametrize("word", ["off", "'off'"])
def test_a_sensor_that_is_off_is_off_although_yaml_takes_that_for_false(word: str):
    fault = f"faults: [{{t: 1.0, duration: 1.0, channel: drive_position.3, kind: {word}}}]\n"
    assert read(TEXT + fault).scenario.faults[0].kind == "off"


def test_a_missing_file_is_refused(tmp_path: Path):
    with pytest.raises(ExperimentError, match="No such file"):
        load_experiment(tmp_path / "none.yaml")


def test_an_error_names_the_file(tmp_path: Path):
    path = tmp_path / "wrong.yaml"
    path.write_text("duration: -3")
    with pytest.raises(ExperimentError, match=r"wrong\.yaml: duration"):
        load_experiment(path)


def test_a_seed_draws_the_same_robot_and_times_each_time():
    one, other = resolve(read()), resolve(read())
    assert one == other
    assert one.scenario.draw == Draw.from_seed(5)
    assert one.drawn


def test_ten_seeds_are_ten_robots():
    robots = [resolve(read(TEXT.replace("seed: 5", f"seed: {seed}"))) for seed in range(10)]
    assert len({robot.scenario.draw for robot in robots}) == 10
    assert len({robot.operator[1].t for robot in robots}) == 10


def test_seed_0_is_the_nominal_robot_at_the_written_times():
    experiment = resolve(read(TEXT.replace("seed: 5", "seed: 0")))
    assert experiment.scenario.draw == Draw()
    assert [step.t for step in experiment.operator] == [0.0, 4.0, 4.1]


def test_drawn_times_keep_their_order_and_bounds():
    written = read()
    for seed in range(1, 40):
        experiment = resolve(read(TEXT.replace("seed: 5", f"seed: {seed}")))
        times = [step.t for step in experiment.operator]
        assert times == sorted(times)
        assert times[0] == 0.0
        for move, before in zip(experiment.scenario.gantry, written.scenario.gantry, strict=True):
            assert before.t <= move.t <= before.t + 0.2
        assert 6.0 <= experiment.scenario.pushes[0].t <= 6.4


def test_what_the_file_fixes_is_not_drawn():
    experiment = resolve(read(TEXT + "draw: {mass: 1.0}\n"))
    assert experiment.scenario.draw.mass == 1.0
    assert experiment.scenario.draw.friction == Draw.from_seed(5).friction


def test_the_drawn_file_gives_the_same_experiment_to_the_last_bit():
    experiment = resolve(read())
    again = parse_experiment(to_yaml(experiment), "drawn.yaml")
    assert resolve(again) == resolve(resolve(again))
    assert again.scenario == experiment.scenario
    assert again.operator == experiment.operator
    assert again.expect == experiment.expect
    assert again.parameters == experiment.parameters
    assert resolve(again).scenario == experiment.scenario


def test_nodes_can_read_the_drawn_file(tmp_path: Path):
    experiment = resolve(read())
    path = tmp_path / "drawn.yaml"
    path.write_text(to_yaml(experiment))
    assert read_experiment(path, needs=("operator",)) == experiment


def test_delays_never_reverse_two_events():
    rng = np.random.default_rng(0)
    for _ in range(50):
        times = delayed([0.0, 1.0, 1.01, 1.02, 3.0], 0.2, rng)
        assert times == sorted(times)


def test_phases_without_expectations_are_the_operators_intervals():
    steps = read().operator
    phases = phases_of_steps(steps, 20.0)
    assert [(phase.t0, phase.t1) for phase in phases] == [(0.0, 4.0), (4.0, 4.1), (4.1, 20.0)]
    assert phases[0].name == "power on, stand, height 0.9"
    assert phases[2].name == "vx 0.5"


def test_a_seed_is_given_once(tmp_path: Path):
    path = tmp_path / "try.yaml"
    path.write_text("duration: 1\nseed: 5", "utf-8")
    assert load_experiment(path, (), 2).seed == 2
    assert load_experiment(path, ("seed=1",)).seed == 1
    with pytest.raises(ExperimentError, match="seed is given twice: --set seed=1, --seed 2"):
        load_experiment(path, ("seed=1",), 2)
