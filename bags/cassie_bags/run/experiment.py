"""Experiments as files: what is run, on which robot, and what is expected of it.

See the package's README for the keys. A file is read strictly: a key that is not known is an
error that names the nearest known one.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from cassie_bags.errors import ExperimentError
from cassie_bags.run.expectations import Expectation, read_expectation
from cassie_bags.run.yaml_file import apply_changes, flat, parse_mapping, read_mapping
from cassie_gaits.errors import CassieError
from cassie_msgs.tunables import (
    ParameterError,
    as_mapping,
    replace_checked,
    unknown_name,
)
from cassie_sim.scenario import Draw, Scenario, gantry_order
from cassie_teleop.script import ScriptedOperator

NODES = ("simulator", "estimator", "controller", "supervisor")
"""Keys of the sections with parameters."""

_SCENARIO_KEYS = tuple(entry.name for entry in dataclasses.fields(Scenario))

KEYS = (
    *("name", "about", "seed", "drawn", "duration"),
    *_SCENARIO_KEYS,
    *("operator", "rider", "gait_library"),
    *NODES,
    "expect",
)

LONGEST = 86400.0
"""Longest run. In s."""

Steps = tuple[Mapping[str, Any], ...]


@dataclass(frozen=True)
class Experiment:
    """One experiment, checked.

    Attributes:
        name: What it is called; the file's stem if it says nothing.
        about: What it is, in a sentence, or nothing.
        seed: What to draw the robot from; 0 is the nominal robot at the written times.
        drawn: Whether `scenario.draw` and all times are final, so that nothing is drawn any more.
        duration: Robot time of the run. In s.
        scenario: Scene, start, events, delays and robot.
        draw: Drawn values that the file fixes, by name.
        operator: Steps of the scripted operator.
        rider: Section of the operator who sees the robot, or None.
        gait_library: Path of the gait library, or None for the default one.
        parameters: Parameters of each node of `NODES` by dotted name.
        expect: What the run must keep.
        expect_section: The same as the file says it.
    """

    name: str
    seed: int
    drawn: bool
    duration: float
    scenario: Scenario
    draw: Mapping[str, Any]
    operator: Steps
    gait_library: str | None
    parameters: Mapping[str, Mapping[str, Any]]
    expect: Expectation
    expect_section: Mapping[str, Any] = field(default_factory=dict)
    about: str = ""
    rider: Mapping[str, Any] | None = None


def packaged_folder() -> Path:
    """Where the package's experiments are: beside its sources, or where it was installed."""
    here = Path(__file__).resolve()
    sources, prefix = here.parents[2], here.parents[5]
    return sources if (sources / "experiments").is_dir() else prefix / "share" / "cassie_bags"


def packaged_experiments() -> list[Path]:
    """Files of the package's experiments, sorted by name.

    Raises:
        ExperimentError: if there is none.
    """
    folder = packaged_folder() / "experiments"
    files = sorted(folder.glob("*.yaml"))
    if not files:
        raise ExperimentError(f"there is no experiment in {folder}")
    return files


def load_experiment(path: Path, changes: Iterable[str] = (), seed: int | None = None) -> Experiment:
    """An experiment from its file.

    Args:
        path: YAML file.
        changes: `key=value` words that replace what the file says.
        seed: Seed in place of the file's.

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    content = read_mapping(path)
    apply_changes(content, changes)
    if seed is not None:
        content["seed"] = seed
    content.setdefault("name", path.stem)
    try:
        return read_experiment(content)
    except CassieError as error:
        raise ExperimentError(f"{path}: {error}") from None


def parse_experiment(text: str, name: str) -> Experiment:
    """An experiment from text; `name` stands for the file in messages."""
    return read_experiment(parse_mapping(text, name))


def read_experiment(content: Mapping[str, Any]) -> Experiment:
    """An experiment from a mapping as YAML gives it.

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    for key in content:
        if key not in KEYS:
            raise ExperimentError(unknown_name(str(key), KEYS, "key"))
    drawn = _typed(content, "drawn", bool, False)
    overrides = flat(_section(content, "draw"), "draw")
    scenario_part = {key: content[key] for key in _SCENARIO_KEYS if content.get(key) is not None}
    scenario_part["gantry"] = [_gantry(entry, i) for i, entry in _entries(content, "gantry")]
    for key in ("pushes", "faults"):
        scenario_part[key] = [_event(entry, key, i) for i, entry in _entries(content, key)]
    operator = tuple(_event(entry, "operator", i) for i, entry in _entries(content, "operator"))
    try:
        scenario = Scenario.from_mapping(scenario_part)
        ScriptedOperator(operator, content.get("rider"))
    except ValueError as error:  # of packages with their own errors
        raise ExperimentError(str(error)) from None
    return Experiment(
        name=_typed(content, "name", str, "experiment"),
        seed=_seed(content),
        drawn=drawn,
        duration=_duration(content),
        scenario=scenario,
        draw=overrides,
        operator=operator,
        gait_library=_typed(content, "gait_library", str, None),
        parameters={node: flat(_section(content, node), node) for node in NODES},
        expect=read_expectation(content.get("expect")),
        expect_section=_section(content, "expect"),
        about=_typed(content, "about", str, ""),
        rider=content.get("rider"),
    )


def drawn_robot(experiment: Experiment, seed: int) -> Draw:
    """The robot that a seed stands for, with what the file fixes; 0 is the nominal one.

    Raises:
        ExperimentError: if a value that the file fixes is unknown or out of its range.
    """
    draw = Draw.from_seed(seed) if seed else Draw()
    try:
        return replace_checked(draw, **experiment.draw)
    except ParameterError as error:
        raise ExperimentError(f"draw: {error}") from None


def as_content(experiment: Experiment) -> dict[str, Any]:
    """The mapping that `read_experiment` makes the same experiment of."""
    scenario = experiment.scenario
    content: dict[str, Any] = {
        "name": experiment.name,
        "about": experiment.about,
        "seed": experiment.seed,
        "drawn": experiment.drawn,
        "duration": experiment.duration,
        "scene": scenario.scene,
        "scene_parameters": dict(scenario.scene_parameters),
        "start": scenario.start,
        "draw": as_mapping(scenario.draw) if experiment.drawn else dict(experiment.draw),
        "gantry": [as_mapping(move) for move in scenario.gantry],
        "pushes": [as_mapping(push) for push in scenario.pushes],
        "faults": [as_mapping(fault) for fault in scenario.faults],
        "delays": as_mapping(scenario.delays),
        "model": as_mapping(scenario.model),
        "payload": as_mapping(scenario.payload),
        "operator": [dict(step) for step in experiment.operator],
        "rider": None if experiment.rider is None else dict(experiment.rider),
        "gait_library": experiment.gait_library,
    }
    content |= {node: dict(experiment.parameters[node]) for node in NODES}
    content["expect"] = dict(experiment.expect_section)
    return content


def to_yaml(experiment: Experiment) -> str:
    """The text of a file for this experiment. Numbers keep every bit."""
    text: str = yaml.dump(as_content(experiment), Dumper=_Dumper, sort_keys=False, width=100)
    return text


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        """Write what stands in two places twice: aliases are not read."""
        return True


def _gantry(entry: object, index: int) -> dict[str, Any]:
    """`{t, height | release | hold}` as the scenario has it: action, height, speed."""
    move = _event(entry, "gantry", index)
    try:
        return gantry_order(move, f"gantry.{index}")
    except ParameterError as error:
        raise ExperimentError(str(error)) from None


def _entries(content: Mapping[str, Any], key: str) -> list[tuple[int, object]]:
    entries = content.get(key)
    if entries is None:
        return []
    if not isinstance(entries, list):
        raise ExperimentError(f"{key} = {entries!r} is not a list")
    return list(enumerate(entries))


def _event(entry: object, key: str, index: int) -> Mapping[str, Any]:
    if not isinstance(entry, Mapping):
        raise ExperimentError(f"{key}.{index} = {entry!r} is not a mapping")
    if "t" not in entry:
        raise ExperimentError(f"{key}.{index} has no t, the time at which it happens (s)")
    return entry


def _section(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    section = content.get(key)
    if section is None:
        return {}
    if not isinstance(section, Mapping):
        raise ExperimentError(f"{key} = {section!r} is not a mapping")
    return section


def _typed(content: Mapping[str, Any], key: str, kind: type, default: Any) -> Any:
    value = content.get(key)
    if value is None:
        return default
    if not isinstance(value, kind):
        what = {bool: "true or false", str: "a word"}[kind]
        raise ExperimentError(f"{key} = {value!r} is not {what}")
    return value


def _seed(content: Mapping[str, Any]) -> int:
    seed = content.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
        raise ExperimentError(f"seed = {seed!r} is not a whole number of 0 or more")
    return seed


def _duration(content: Mapping[str, Any]) -> float:
    if "duration" not in content:
        raise ExperimentError("duration must be given: robot time of the run in s")
    value = content["duration"]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ExperimentError(f"duration = {value!r} is not a number")
    if not (math.isfinite(value) and 0.0 < value <= LONGEST):
        raise ExperimentError(f"duration = {value:g} s is outside 0 .. {LONGEST:g} s")
    return float(value)
