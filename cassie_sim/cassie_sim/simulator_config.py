"""What can be set on the simulator node, and the scenario that follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from cassie_msgs.strict_yaml import YamlError, parse_yaml, read_yaml
from cassie_msgs.tunables import ParameterError, tunable, unknown_name
from cassie_sim.plant_config import PlantConfig
from cassie_sim.scenario import STARTS, Draw, Scenario, gantry_order

PACINGS = ("lockstep", "realtime")

_SCENARIO_KEYS = tuple(entry.name for entry in fields(Scenario))
_OTHER_KEYS = (
    "about",
    "name",
    "seed",
    "drawn",
    "duration",
    "operator",
    "rider",
    "gait_library",
    "simulator",
    "estimator",
    "controller",
    "supervisor",
    "expect",
)
"""Keys of an experiment that other nodes read."""

_SHOWN = 60  # characters of a wrong content that a message shows


@dataclass(frozen=True, kw_only=True)
class SimulatorConfig(PlantConfig):
    """Parameters of the simulator node."""

    scene: str = tunable(
        "flat", description="Ground under the robot: flat, slope, grass, sand, ...", live=False
    )
    scene_parameters: str = tunable(
        "", description="Parameters of the scene, as YAML: {rise_deg: 5.0}", live=False
    )
    start: str = tunable(
        "gantry", choices=STARTS, description="Pose at the start of an episode", live=False
    )
    seed: int = tunable(0, "", 0, None, "Robot and noise drawn; 0 is the nominal robot", live=False)
    scenario: str = tunable(
        "",
        description="YAML file with scene, start, draw and events, in place of the four above",
        live=False,
    )
    pacing: str = tunable(
        "lockstep",
        choices=PACINGS,
        description="Who sets the pace: the commands (lockstep) or the wall clock",
        live=False,
    )
    max_rate: float = tunable(
        1.0,
        "",
        0.0,
        1000.0,
        "Robot time per wall time, at most; 0 is as fast as it goes (realtime: at most 1)",
    )
    keep_awake: bool = tunable(
        True,
        description="Keep processors from sleeping in realtime, and while robot time runs as "
        "fast as it goes, where the system permits",
    )
    command_timeout: float = tunable(
        5.0, "s", 0.1, 1e6, "Wall time without a command after which the drives damp"
    )
    start_timeout: float = tunable(
        10.0, "s", 0.0, 1e6, "Wall time in which the other nodes may join at the start", live=False
    )
    paused: bool = tunable(False, description="Begin paused, at tick 0", live=False)
    scripted_operator: bool = tunable(
        False, description="The operator is a script that answers every 10th state", live=False
    )
    headless: bool = tunable(True, description="Run without a window", live=False)
    video: str = tunable("", description="File to film into (.mp4 or .gif)", live=False)
    video_fps: float = tunable(25.0, "Hz", 1.0, 100.0, "Pictures per robot second", live=False)
    duration: float = tunable(
        0.0, "s", 0.0, 1e9, "Robot time after which the simulator ends; 0 is never", live=False
    )

    @property
    def hurries(self) -> bool:
        """Whether processors are to stay awake: a tick waits for each message's way."""
        return self.keep_awake and (self.max_rate == 0.0 or self.pacing == "realtime")


def scenario_of(config: SimulatorConfig) -> Scenario:
    """The scenario that the parameters ask for.

    Raises:
        ParameterError: if a file cannot be read, a key is unknown or a value does not fit.
    """
    if config.scenario:
        return load_scenario(Path(config.scenario))
    return Scenario.from_mapping(
        {
            "scene": config.scene,
            "scene_parameters": _scene_parameters(config.scene_parameters),
            "start": config.start,
            "draw": _drawn(config.seed),
        }
    )


def load_scenario(path: Path) -> Scenario:
    """The scenario in an experiment file; what other nodes read from the file is left out.

    Without `draw` in it, its `seed` draws the robot.

    Raises:
        ParameterError: if the file cannot be read, a key is unknown or a value does not fit.
    """
    try:
        content = _mapping(read_yaml(path), f"scenario {path}")
    except YamlError as error:
        raise ParameterError(f"scenario: {error}") from None
    for key in content:
        if key not in _SCENARIO_KEYS + _OTHER_KEYS:
            known = _SCENARIO_KEYS + _OTHER_KEYS
            raise ParameterError(f"{path}: {unknown_name(str(key), known, 'key')}")
    mapping = {key: value for key, value in content.items() if key in _SCENARIO_KEYS}
    if isinstance(moves := mapping.get("gantry"), list):
        mapping["gantry"] = [
            gantry_order(move, f"gantry[{i}]") if isinstance(move, Mapping) else move
            for i, move in enumerate(moves)
        ]
    if "draw" not in mapping:
        seed = content.get("seed", 0)
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise ParameterError(f"{path}: seed = {seed!r} is not a whole number of 0 or more")
        mapping["draw"] = _drawn(seed)
    return Scenario.from_mapping(mapping)


def _scene_parameters(text: str) -> dict[str, Any]:
    try:
        return _mapping(parse_yaml(text, "scene_parameters"), "scene_parameters")
    except YamlError as error:
        raise ParameterError(str(error)) from None


def _drawn(seed: int) -> Mapping[str, Any]:
    """Draws of a seed as a mapping; none for 0, the nominal robot."""
    draw = Draw.from_seed(seed) if seed else Draw()
    return {entry.name: getattr(draw, entry.name) for entry in fields(Draw)}


def _mapping(content: Any, what: str) -> dict[str, Any]:
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise ParameterError(f"{what} = {_shown(content)} is not a mapping of names to values")
    return content


def _shown(content: Any) -> str:
    """The beginning of what may be a whole file."""
    text = content if isinstance(content, str) else str(content)
    return repr(text) if len(text) <= _SHOWN else f"{text[:_SHOWN]!r}..."
