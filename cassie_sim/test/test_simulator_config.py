"""What can be asked of the simulator, and what is refused with which words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cassie_msgs.experiment.scenario import Draw, Scenario
from cassie_msgs.tunables import ParameterError
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig
from cassie_sim.simulator_config import SimulatorConfig, scenario_of


def scenario_in(path: Path) -> Scenario:
    return scenario_of(replace(SimulatorConfig(), scenario=str(path)))


def test_parameters_make_a_scenario() -> None:
    config = replace(
        SimulatorConfig(),
        scene="slope",
        scene_parameters="{rise_deg: 3.0}",
        start="standing",
        seed=4,
    )
    scenario = scenario_of(config)
    assert scenario.scene == "slope"
    assert scenario.scene_parameters == {"rise_deg": 3.0}
    assert scenario.start == "standing"
    assert scenario.draw == Draw.from_seed(4)


def test_seed_0_is_the_nominal_robot() -> None:
    assert scenario_of(SimulatorConfig()).draw == Draw()


def test_a_file_of_an_experiment_is_read_without_what_others_read(tmp_path: Path) -> None:
    file = tmp_path / "e.yaml"
    file.write_text(
        "name: x\nduration: 3\nstart: standing\nseed: 5\noperator: [{t: 0, power: true}]\n"
        "pushes: [{t: 1.0, force: [10, 0, 0]}]\nexpect: {fell: false}\n"
    )
    scenario = scenario_in(file)
    assert scenario.start == "standing"
    assert scenario.pushes[0].force == (10.0, 0.0, 0.0)
    assert scenario.draw == Draw.from_seed(5)


def test_the_gantry_is_ordered_as_experiments_write_it(tmp_path: Path) -> None:
    file = tmp_path / "e.yaml"
    file.write_text("gantry: [{t: 0, hold: 1.4}, {t: 1, height: 0.8}, {t: 2, release: true}]")
    moves = scenario_in(file).gantry
    assert [move.action for move in moves] == ["hold", "lower", "release"]
    assert [move.height for move in moves[:2]] == [1.4, 0.8]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gantry: [{t: 0, hold: 1.4, release: true}]", "expected one of height, release and hold"),
        ("strat: standing", "did you mean start"),
        ("- 1", "operator.0 = 1 is not a mapping"),
        (100 * "words ", r"(words ){10}'\.\.\. is not a mapping"),
        ("seed: five", "seed = 'five' is not a whole number"),
        ("{", r"e\.yaml:1: expected the node content"),
        ("pushes: [{t: 1}]", r"pushes.0.force must be given \(-5000 \.\. 5000 N\)"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "e.yaml"
    file.write_text(text)
    with pytest.raises(ParameterError, match=words):
        scenario_in(file)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="cannot read"):
        scenario_in(tmp_path / "none.yaml")
    (tmp_path / "picture.yaml").write_bytes(b"\xd0\x00")
    with pytest.raises(ParameterError, match=r"picture.yaml is not a text file"):
        scenario_in(tmp_path / "picture.yaml")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"scene": "moon"}, "moon"),
        ({"scene": "slope", "scene_parameters": "{rise: 3.0}"}, "rise_deg"),
        ({"scene": "slope", "scene_parameters": "{rise_deg: 80.0}"}, "80 deg is outside -30 .. 30"),
    ],
)
def test_a_wrong_scene_is_refused(changes: dict[str, str], words: str) -> None:
    config = replace(SimulatorConfig(), **changes)
    with pytest.raises(ValueError, match=words):
        Plant(PlantConfig(), scenario_of(config))


def test_a_control_rate_that_does_not_divide_is_refused() -> None:
    config = replace(SimulatorConfig(), control_rate=300)
    with pytest.raises(ValueError, match="300 Hz does not divide physics_rate = 2000 Hz"):
        Plant(config)
