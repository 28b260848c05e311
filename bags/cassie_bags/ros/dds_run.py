"""One experiment with every node as a process, in lock-step over DDS, recorded."""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from cassie_bags.bag.rosbag2 import METADATA_FILE
from cassie_bags.errors import RunError
from cassie_bags.ros.command_node import SimulatorClient, simulator_client
from cassie_bags.ros.processes import (
    Processes,
    environment,
    executable,
    own_domain,
    write_parameters,
)
from cassie_bags.ros.record import COMPLETE
from cassie_bags.run.cores import library_path, makes_gaits, simulator_config
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.provenance import metadata_of
from cassie_bags.run.seed import write_resolved
from cassie_msgs.experiment.file import Experiment
from cassie_sim.simulator_config import SimulatorConfig

START_TIMEOUT = 90.0
"""Time-out until every node takes part. In s of wall time."""

STALL_TIMEOUT = 90.0
"""Longest wall time without progress of robot time. In s."""

_CHECK_PERIOD = 0.1  # s between two checks of the processes

NODES = {
    "state_estimator": ("cassie_control", "estimator"),
    "gait_controller": ("cassie_control", "controller"),
    "mode_supervisor": ("cassie_control", "supervisor"),
    "scripted_operator": ("cassie_teleop", None),
    "simulator": ("cassie_sim", "simulator"),
}
"""Package and section of the experiment of each node, by executable."""

OPTIMIZER = "gait_optimizer"
"""Node that makes gaits while the robot walks; started where `controller.gait_source` asks so."""

STACKED = ("state_estimator", "gait_controller")
"""Nodes that can share a process, `cassie_control stack`."""


def run_over_dds(experiment: Experiment, folder: Path, *, stack: bool = False) -> Path:
    """Run a drawn experiment with all nodes as processes, and record it.

    The simulator begins paused. Each node answers the first sample, which is repeated until the
    recorder has received every topic; then robot time starts. All processes are ended in any case.

    Args:
        experiment: Experiment to run, drawn.
        folder: Folder for bag, drawn file, parameters and logs.
        stack: Whether estimator and controller are two nodes of one process.

    Returns:
        The bag.

    Raises:
        RunError: if a node does not take part, dies or stalls; the message has its name and its
            last line of output.
    """
    bag = folder / "bag.mcap"
    metadata = folder / "parameters" / "bag.yaml"
    metadata.parent.mkdir(parents=True, exist_ok=True)
    for old in (bag, folder / METADATA_FILE):  # of an earlier run
        old.unlink(missing_ok=True)
    metadata.write_text(yaml.safe_dump(metadata_of(experiment)), encoding="utf-8")
    with (
        own_domain() as domain,
        simulator_client(domain) as simulator,
        Processes(environment(domain), folder / "log") as processes,
    ):
        record = executable("cassie_bags", "record")
        processes.start("record", [record, "-o", bag, "--metadata", metadata])
        start_nodes(experiment, folder, processes, stack=stack)
        _await_nodes(processes, optimizer=makes_gaits(experiment))
        simulator.resume(START_TIMEOUT)
        watch(experiment, processes, simulator)
        processes.stop("record")
        processes.check("record", "simulator")
    return bag


def start_nodes(
    experiment: Experiment,
    folder: Path,
    processes: Processes,
    programs: Mapping[str, Sequence[str | Path]] | None = None,
    *,
    stack: bool = False,
) -> None:
    """Start the five nodes of a drawn experiment, and gait_optimizer where it is to make gaits.

    Args:
        experiment: Experiment to run.
        folder: Folder for the drawn file and the parameters.
        processes: Processes of the run, which get the nodes.
        programs: Commands that replace installed executables, by node.
        stack: Whether estimator and controller are two nodes of one process.
    """
    scenario = folder / "experiment.yaml"
    write_resolved(experiment, scenario)
    parameters = node_parameters(experiment, scenario)
    if makes_gaits(experiment):
        processes.start(OPTIMIZER, [executable("cassie_gaits", OPTIMIZER)])
    places = processors_of(simulator_config(experiment), os.sched_getaffinity(0))
    if stack:
        own = {name: parameters[name] for name in STACKED}
        words = write_parameters(folder / "parameters" / "stack.yaml", own)
        program = executable("cassie_control", "stack")
        processes.start("stack", [program, *words], places.get("gait_controller", ()))
    for name, (package, _) in NODES.items():
        if stack and name in STACKED:
            continue
        own = {"/**": parameters[name]}
        words = write_parameters(folder / "parameters" / f"{name}.yaml", own)
        command = (programs or {}).get(name) or [executable(package, name)]
        processes.start(name, [*command, *words], places.get(name, ()))


def processors_of(config: SimulatorConfig, available: Collection[int]) -> dict[str, set[int]]:
    """Processors to which nodes are pinned, by node; other nodes run on any processor.

    In lock-step estimator and controller take turns while the physics is computed. On two
    processors, a thread that is woken on the other processor waits for an interrupt. So these
    three nodes are pinned to processors where that does not happen. This holds only where robot
    time runs as fast as possible and no film is made, which would share the simulator's
    processor.
    """
    if len(available) != 2 or config.video or config.max_rate or config.pacing == "realtime":
        return {}
    first, second = sorted(available)
    return {"simulator": {first}, "state_estimator": {second}, "gait_controller": {second}}


def node_parameters(experiment: Experiment, scenario: Path) -> dict[str, dict[str, Any]]:
    """ROS parameters of each node for a drawn experiment and its file, by executable."""
    config = simulator_config(experiment)
    parameters: dict[str, dict[str, Any]] = {
        name: dict(experiment.parameters[section]) if section else {}
        for name, (_, section) in NODES.items()
    }
    parameters["simulator"] |= {
        "scenario": str(scenario),
        "scripted_operator": True,
        "paused": True,
        "duration": experiment.duration,
        "max_rate": config.max_rate,
    }
    parameters["gait_controller"]["gait_library"] = str(library_path(experiment))
    parameters["mode_supervisor"]["scripted_operator"] = True
    parameters["scripted_operator"]["script"] = str(scenario)
    for name in ("state_estimator", "gait_controller", "mode_supervisor"):
        parameters[name]["control_rate"] = config.control_rate
    return parameters


def _await_nodes(processes: Processes, *, optimizer: bool) -> None:
    """Wait until the recorder has received the control lane, and an optimizer is ready.

    Raises:
        RunError: if a process ends, or at the time-out.
    """
    missing = {"record": (COMPLETE, "not every topic of the control lane is published")}
    if optimizer:
        missing[OPTIMIZER] = ("ready", f"{OPTIMIZER} is not ready")
    deadline = time.monotonic() + START_TIMEOUT
    while missing:
        processes.check()
        for name, (words, problem) in list(missing.items()):
            if processes.printed(name, words):
                del missing[name]
            elif time.monotonic() > deadline:
                raise RunError(f"after {START_TIMEOUT:g} s {problem}")
        time.sleep(_CHECK_PERIOD / 5)


def watch(experiment: Experiment, processes: Processes, simulator: SimulatorClient) -> None:
    """Wait for the simulator to end, with a progress bar on a terminal.

    Args:
        experiment: Experiment that runs.
        processes: Processes of the run.
        simulator: Client that reads robot time.

    Raises:
        RunError: if a node ends earlier, or robot time stands still.
    """
    reached, since = -1.0, time.monotonic()
    with progress_bar("s", experiment.duration) as bar:
        while processes.running("simulator"):
            processes.check("simulator")
            now = simulator.robot_time()
            if now > reached:
                reached, since = now, time.monotonic()
                bar.update(now - bar.n)
            elif time.monotonic() - since > STALL_TIMEOUT:
                raise RunError(f"robot time stands still at {reached:g} s")
            time.sleep(_CHECK_PERIOD)
    processes.check("simulator")
