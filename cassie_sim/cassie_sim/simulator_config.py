"""Parameters of the simulator node, and the scenario that they define."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cassie_msgs.experiment.file import Experiment, read_experiment
from cassie_msgs.experiment.scenario import STARTS, Scenario
from cassie_msgs.strict_yaml import YamlError, parse_yaml
from cassie_msgs.structured import as_section, structure
from cassie_msgs.tunables import ParameterError, tunable
from cassie_sim.plant_config import PlantConfig

PACINGS = ("lockstep", "realtime")


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
    seed: int = tunable(0, "", 0, None, "Seed of robot and noise; 0: nominal robot", live=False)
    scenario: str = tunable(
        "",
        description="YAML file with scene, start, draw and events, instead of `scene`, "
        "`scene_parameters`, `start` and `seed`",
        live=False,
    )
    pacing: str = tunable(
        "lockstep",
        choices=PACINGS,
        description="What sets the pace: the commands (lockstep) or the wall clock (realtime)",
        live=False,
    )
    max_rate: float = tunable(
        1.0,
        "",
        0.0,
        1000.0,
        "Largest ratio of robot time to wall time; 0 is no limit (realtime: at most 1)",
    )
    keep_awake: bool = tunable(
        True,
        description="Keep processors from sleeping in realtime, and while robot time runs "
        "without a limit, if the system permits",
    )
    command_timeout: float = tunable(
        5.0, "s", 0.1, 1e6, "Wall time without a command after which the drives damp"
    )
    start_timeout: float = tunable(
        10.0, "s", 0.0, 1e6, "Wall time for the other nodes to join at the start", live=False
    )
    paused: bool = tunable(False, description="Begin paused, at tick 0", live=False)
    scripted_operator: bool = tunable(
        False, description="The operator is a script that answers every 10th state", live=False
    )
    headless: bool = tunable(True, description="Run without a window", live=False)
    video: str = tunable("", description="File of the film (.mp4 or .gif)", live=False)
    video_fps: float = tunable(25.0, "Hz", 1.0, 100.0, "Pictures per robot second", live=False)
    duration: float = tunable(
        0.0, "s", 0.0, 1e9, "Robot time after which the simulator ends; 0 is never", live=False
    )

    @property
    def hurries(self) -> bool:
        """Whether processors are to stay awake, as each tick waits for messages."""
        return self.keep_awake and (self.max_rate == 0.0 or self.pacing == "realtime")


def scenario_of(config: SimulatorConfig) -> Scenario:
    """The scenario that the parameters define.

    Raises:
        ParameterError: if a file cannot be read, a key is unknown or a value does not fit.
    """
    if config.scenario:
        return read_experiment(Path(config.scenario)).scenario
    content = {
        "scene": config.scene,
        "scene_parameters": _scene_parameters(config.scene_parameters),
        "start": config.start,
        "seed": config.seed,
    }
    return structure(Experiment, content).scenario


def _scene_parameters(text: str) -> Mapping[str, Any]:
    try:
        return as_section(parse_yaml(text, "scene_parameters"), "scene_parameters")
    except YamlError as error:
        raise ParameterError(str(error)) from None
