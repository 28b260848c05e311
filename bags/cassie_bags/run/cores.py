"""Builds the cores of an experiment from its file, in the same way as the nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from cassie_bags.errors import ExperimentError
from cassie_bags.run.simulate import ControlLoop, Cores, Observer
from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import GaitController
from cassie_control.estimator.choice import make_monitored
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.learning.torque_table import LearnedTorques, load_for_library
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_gaits.gait_library import GaitLibrary
from cassie_gaits.gait_library_file import default_library_path, load_certified
from cassie_gaits.gait_library_file import library_path as packaged_or_path
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import Sample
from cassie_msgs.tunables import ParameterError, from_mapping
from cassie_sim.plant import Plant
from cassie_sim.scenes import scene_spec
from cassie_sim.simulator_config import SimulatorConfig
from cassie_teleop.script import ScriptedOperator

SET_BY_FILE = (
    *("scenario", "scene", "scene_parameters", "start", "seed", "duration"),
    *("paused", "scripted_operator"),
)
"""Parameters of the simulator that follow from other keys of an experiment."""

UNCERTIFIED, LEARNED_FILE = "allow_uncertified", "learned_torques_file"
"""Parameters of the controller's node, not of its core."""

GAIT_SOURCE = "gait_source"
"""Parameter of the controller's node: whether gaits are optimized while the robot walks."""

_OF_NODE = (UNCERTIFIED, LEARNED_FILE, GAIT_SOURCE)
ConfigT = TypeVar("ConfigT")


def simulator_config(experiment: Experiment) -> SimulatorConfig:
    """The simulator's parameters, `max_rate` 0 unless the file says otherwise.

    Raises:
        ExperimentError: if one is unknown, out of range, or set by another key of the file.
    """
    given = experiment.parameters["simulator"]
    for name in SET_BY_FILE:
        if name in given:
            raise ExperimentError(f"simulator.{name} follows from other keys of an experiment")
    return _config(SimulatorConfig, {"max_rate": 0.0, **given}, "simulator")


def check_parameters(experiment: Experiment) -> None:
    """Check the parameters and files that the nodes will get, before any node starts.

    Raises:
        CassieError, ParameterError: naming parameter, value and range, or the file.
    """
    simulator_config(experiment)
    scene_spec(experiment.scenario.scene, experiment.scenario.scene_parameters)
    load_gaits(experiment)
    load_learned(experiment)
    makes_gaits(experiment)
    _config(EstimatorConfig, experiment.parameters["estimator"], "estimator")
    _controller_config(experiment)
    _config(SupervisorConfig, experiment.parameters["supervisor"], "supervisor")


def check_plant(experiment: Experiment) -> None:
    """Build the plant once: that checks rates, pushed bodies and failing channels.

    Over DDS the simulator would refuse them only after the other nodes have started.

    Raises:
        CassieError, ParameterError: naming the value and what is permitted.
    """
    Plant(simulator_config(experiment), experiment.scenario)


def library_path(experiment: Experiment) -> Path:
    """File of the experiment's gait library."""
    name = experiment.gait_library
    return packaged_or_path(name) if name else default_library_path()


def load_gaits(experiment: Experiment) -> GaitLibrary:
    """The experiment's gait library, certified unless `controller.allow_uncertified` is true.

    Raises:
        CassieError: as `load_certified`.
        ExperimentError: if `allow_uncertified` is neither true nor false.
    """
    allow = experiment.parameters["controller"].get(UNCERTIFIED, False)
    if not isinstance(allow, bool):
        raise ExperimentError(f"controller.{UNCERTIFIED} is {allow!r}, expected true or false")
    return load_certified(library_path(experiment), allow_uncertified=allow)


def load_learned(experiment: Experiment) -> LearnedTorques:
    """The torques of `controller.learned_torques_file`, or those beside the gait library.

    Raises:
        CassieError: as `load_torques`.
        ExperimentError: if the parameter is no path.
    """
    path = experiment.parameters["controller"].get(LEARNED_FILE, "")
    if not isinstance(path, str):
        raise ExperimentError(f"controller.{LEARNED_FILE} is {path!r}, expected a path")
    return load_for_library(library_path(experiment), path)


def _controller_config(experiment: Experiment) -> ControllerConfig:
    section = experiment.parameters["controller"]
    given = {name: value for name, value in section.items() if name not in _OF_NODE}
    return _config(ControllerConfig, given, "controller")


def makes_gaits(experiment: Experiment) -> bool:
    """Whether `controller.gait_source` is optimizer.

    Raises:
        ExperimentError: if it is neither that nor library.
    """
    source = experiment.parameters["controller"].get(GAIT_SOURCE, "library")
    if source not in ("library", "optimizer"):
        raise ExperimentError(
            f"controller.{GAIT_SOURCE} is {source!r}, expected library or optimizer"
        )
    return bool(source == "optimizer")


def make_cores(experiment: Experiment) -> Cores:
    """The cores of a drawn experiment, at tick 0.

    Raises:
        CassieError, ParameterError: naming what cannot be used.
    """
    config = simulator_config(experiment)
    period = 1.0 / config.control_rate
    parameters = experiment.parameters
    arguments = (
        _controller_config(experiment),
        load_gaits(experiment),
        period,
        load_learned(experiment),
    )
    controller: GaitController
    gait_messages: Callable[[], Sequence[Sample]] | None = None
    if makes_gaits(experiment):
        from cassie_bags.run.optimized import OptimizedGaitController

        controller = optimized = OptimizedGaitController(*arguments)
        gait_messages = optimized.take_messages
    else:
        controller = GaitController(*arguments)
    return Cores(
        Plant(config, experiment.scenario),
        make_monitored(_config(EstimatorConfig, parameters["estimator"], "estimator"), period),
        controller,
        ModeSupervisor(_config(SupervisorConfig, parameters["supervisor"], "supervisor"), period),
        ScriptedOperator(experiment.operator, experiment.rider),
        gait_messages,
    )


def check_one_process(experiment: Experiment) -> None:
    """Check that an experiment can run in one process.

    Raises:
        ExperimentError: if it needs a wall clock, or a video or window of the simulator.
    """
    config = simulator_config(experiment)
    if config.pacing == "realtime":
        raise ExperimentError(
            "simulator.pacing = realtime needs a wall clock: in one process it is lockstep"
        )
    if config.video or not config.headless:
        name = "video" if config.video else "headless"
        raise ExperimentError(
            f"simulator.{name} = {getattr(config, name)} needs the node: not in one process"
        )


def make_loop(
    experiment: Experiment, observer: Observer, *, physics_thread: bool = False
) -> ControlLoop:
    """The cores of a drawn experiment on the schedule of lock-step, at tick 0.

    Args:
        experiment: What to run, drawn.
        observer: Gets every message.
        physics_thread: Whether the physics runs in a thread of its own. The thread needs a
            processor for itself, and an observer that does not read the plant.

    Raises:
        CassieError, ParameterError: naming what cannot be used.
    """
    check_one_process(experiment)
    cores = make_cores(experiment)
    cores.plant.beside = physics_thread
    return connect(cores, observer)


def connect(cores: Cores, observer: Observer) -> ControlLoop:
    """Cores at tick 0 on the schedule of lock-step; `observer` gets every message."""
    return ControlLoop(cores, observer)


def tick_count(experiment: Experiment) -> int:
    """Number of control ticks of the run, as the simulator counts them."""
    return round(experiment.duration * simulator_config(experiment).control_rate)


def _config(cls: type[ConfigT], given: Mapping[str, Any], section: str) -> ConfigT:
    try:
        return from_mapping(cls, given)
    except ParameterError as error:
        raise ExperimentError(f"{section}: {error}") from None
