"""Reaction of Cassie to failing sensors, in every way, while it stands and walks.

Each mode is run once up to the time of the fault. From there on every fault runs in a process of
its own, a copy of the first one.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from cassie_bags.errors import ExperimentError
from cassie_bags.run.cores import connect, make_cores
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.seed import resolve
from cassie_bags.studies.results import check_results, markdown, put_results
from cassie_bags.studies.trial import walking_operator
from cassie_bags.studies.workers import in_copies
from cassie_control.estimator.channels import CHANNELS
from cassie_gaits.processes import available_cores
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.experiment.scenario import FAULT_KINDS, SensorFault
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_msgs.tunables import unknown_name
from cassie_sim.events import ActiveFault
from cassie_sim.plant import Plant

SECTION = "Failing sensors"
"""Heading of the faults' table in a file of results."""

MODES = ("standing", "walking")
_FAULT_TIME = {"standing": 2.5, "walking": 8.0}  # s of robot time at which the sensor fails
_OBSERVED_TIME = 9.0  # s of robot time that are observed after the fault

BOUNDS_AND_SPIKES = {
    "position": (0.03, 0.2),
    "velocity": (0.3, 2.0),
    "orientation": (0.03, 0.1),
    "acceleration": (3.0, 10.0),
    "torque": (1000.0, 50.0),
}
"""Error from which a fault counts, and height of spikes, by measured quantity.

In rad, rad/s, m/s^2, Nm; for torques only NaN reaches the bound.
"""

_MAX_LATENCY = 0.1  # s, longest time from the error's exceeding its bound to the report
_DELAY = 0.02
_FALLEN_HEIGHT, _FALLEN_TILT = 0.55, 0.7  # m, rad: before the drives damp, which is at 0.8 rad


@dataclass(frozen=True)
class Cell:
    """Result of one fault in one mode.

    Attributes:
        channel, kind, mode: Failed channel, kind of fault, and mode of the robot.
        exceeded: Time after the fault's start at which the error first exceeded its bound, in s;
            None if it never did.
        reported: Time after the fault's start of the channel's first report, in s; None if never.
        others: Further channels that were reported.
        outcome: "goes on", "stands", "damps" or "falls".
    """

    channel: str
    kind: str
    mode: str
    exceeded: float | None
    reported: float | None
    others: tuple[str, ...]
    outcome: str

    @property
    def latency(self) -> float:
        """Time from the error's exceeding its bound to the report; inf without a report. In s."""
        if self.exceeded is None:
            return 0.0
        return math.inf if self.reported is None else max(0.0, self.reported - self.exceeded)

    @property
    def safe(self) -> bool:
        """Whether Cassie did not fall, and a fault that exceeds its bound was reported in time."""
        return self.outcome != "falls" and self.latency <= _MAX_LATENCY


def quantity(channel: str) -> str:
    """Measured quantity of a channel: a key of `BOUNDS_AND_SPIKES`."""
    field = channel.partition(".")[0]
    if field == "orientation":
        return field
    return "velocity" if field == "angular_velocity" else field.rpartition("_")[2]


def experiment_of(mode: str, seed: int) -> Experiment:
    """Experiment of standing, or of walking at 0.5 m/s, on flat ground."""
    operator = [{"t": 0.0, "power": True, "mode": "stand", "height": 0.95}]
    if mode == "walking":
        operator = walking_operator(0.5)
    duration = _FAULT_TIME[mode] + _OBSERVED_TIME
    content = {"name": mode, "seed": seed, "duration": duration, "start": "standing"}
    return resolve(read_experiment({**content, "operator": operator}))


class _FaultyPlant:
    """A plant with a sensor that can be made to fail."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._truth = Sensors()
        self.fault: ActiveFault | None = None
        self.channel = ""
        self.largest_error = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def sense(self) -> Sensors:
        sample = self._plant.sense()
        if self.fault is not None:
            self._truth.copy_from(sample)
            self.fault.spoil(self._plant.seq * self._plant.substeps, sample)
            error = error_of(self.channel, self._truth, sample)
            self.largest_error = max(self.largest_error, error)
        return sample


class FaultOutcome:
    """Finds the outcome of a fault, tick by tick.

    Drives that damp let the robot sink down, which is no fall. Damping after a fall is a fall.
    """

    def __init__(self) -> None:
        self._fell = self._damped = False

    def note(self, height: float, tilt: float, *, damped: bool) -> None:
        """Process a tick: the pelvis's height in m, its tilt in rad, whether the drives damp."""
        self._damped = self._damped or damped
        if not self._damped:
            self._fell = self._fell or height < _FALLEN_HEIGHT or tilt > _FALLEN_TILT

    def outcome(self, *, standing: bool) -> str:
        """The outcome as in `Cell.outcome`; `standing`: whether the robot stands at the end."""
        if self._fell:
            return "falls"
        if self._damped:
            return "damps"
        return "stands" if standing else "goes on"


class PreparedRun:
    """A run in one of `MODES`, with a robot by its seed, up to the time at which a sensor fails."""

    def __init__(self, mode: str, seed: int) -> None:
        cores = make_cores(experiment_of(mode, seed))
        self._mode = mode
        self._command = MotorCommand()
        self._plant = _FaultyPlant(cores.plant)
        self._estimator, self._controller = cores.estimator, cores.controller
        faulty = dataclasses.replace(cores, plant=cast(Plant, self._plant))
        self._loop = connect(faulty, self._observe)
        for _ in range(round(_FAULT_TIME[mode] * 1e9 / self._plant.tick_ns)):
            self._loop.tick()

    def _observe(self, topic: str, raw: bytes, _: int) -> None:
        if topic == MotorCommand.TOPIC and self._plant.fault is not None:
            self._command.load(raw)

    def fail(self, channel_and_kind: tuple[str, str]) -> Cell:
        """Let a channel fail in a way and observe the outcome; call it once, in its own process."""
        channel, kind = channel_and_kind
        plant, (bound, spike) = self._plant, BOUNDS_AND_SPIKES[quantity(channel)]
        size = _DELAY if kind == "delay" else spike
        fault = SensorFault(t=plant.time, channel=channel, kind=kind, size=size)
        plant.fault, plant.channel = ActiveFault(fault, plant.config.physics_rate), channel
        seen: dict[str, float] = {}
        watched = FaultOutcome()
        exceeded: float | None = None
        for tick in range(round(_OBSERVED_TIME * 1e9 / plant.tick_ns)):
            self._loop.tick()
            time = tick * plant.tick_ns * 1e-9
            for name in self._estimator.faults:
                seen.setdefault(name.partition(" ")[0], time)
            position, (_, x, y, _) = plant.pelvis_pose
            tilt = math.acos(1.0 - 2.0 * float(x * x + y * y))
            watched.note(float(position[2]), tilt, damped=not self._command.kp.any())
            if exceeded is None and plant.largest_error > bound:
                exceeded = time
        reported = seen.pop(channel, None)
        outcome = watched.outcome(standing=self._controller.activity.value == "standing")
        return Cell(channel, kind, self._mode, exceeded, reported, tuple(seen), outcome)


def error_of(channel: str, truth: Sensors, sample: Sensors) -> float:
    """Error of a faulty channel; NaN counts as infinite. In rad, rad/s, m/s^2 or Nm."""
    field, _, index = channel.partition(".")
    true, given = getattr(truth, field), getattr(sample, field)
    if field == "orientation":
        given = given / max(1e-9, float(np.linalg.norm(given)))
        error = 2.0 * math.acos(min(1.0, abs(float(true @ given))))
    else:
        error = abs(float(given[int(index)] - true[int(index)]))
    return math.inf if math.isnan(error) else error


def run_table(
    channels: Sequence[str],
    kinds: Sequence[str],
    modes: Sequence[str],
    seed: int,
    jobs: int = 1,
) -> Iterable[Cell]:
    """Cells of the table, in the order of completion.

    Args:
        channels: Names of channels, see `cassie_control.estimator.channels`.
        kinds: Kinds of faults, of `FAULT_KINDS`.
        modes: Modes of the robot, of `MODES`.
        seed: Seed of the robot.
        jobs: Number of processes at a time.
    """
    for mode in modes:
        prepared = PreparedRun(mode, seed)
        faults = list(itertools.product(channels, kinds))
        yield from in_copies(prepared.fail, faults, jobs)


def table(cells: Iterable[Cell]) -> list[str]:
    """Lines of a Markdown table: channel and mode by kind of fault."""
    rows: dict[tuple[str, str], dict[str, Cell]] = {}
    for cell in cells:
        rows.setdefault((cell.channel, cell.mode), {})[cell.kind] = cell
    lines = [["channel", "mode", *FAULT_KINDS]]
    for (channel, mode), row in rows.items():
        words = [describe(row[kind]) if kind in row else "" for kind in FAULT_KINDS]
        lines.append([f"`{channel}`", mode, *words])
    return markdown(lines)


def describe(cell: Cell) -> str:
    """A cell in a few words: outcome, and time from the error's bound to the report."""
    if cell.reported is None:
        when = "no error" if cell.exceeded is None else "NOT reported"
    else:
        when = f"{1000.0 * cell.latency:.0f} ms"
    return f"{cell.outcome}, {when}"


def run(arguments: argparse.Namespace) -> int:
    """Let each channel fail; returns the exit code."""
    named = arguments.channels or arguments.kinds or arguments.modes
    check_results(arguments, "channels, kinds and modes", partial=bool(named))
    kinds, modes = arguments.kinds or FAULT_KINDS, arguments.modes or MODES
    for mode in modes:
        if mode not in MODES:
            raise ExperimentError(unknown_name(mode, MODES, "mode"))
    channels = arguments.channels or [name for name, _ in CHANNELS]
    jobs = arguments.jobs or available_cores()
    total = len(channels) * len(kinds) * len(modes)
    results = run_table(channels, kinds, modes, arguments.seed, jobs)
    cells: list[Cell] = list(progress_bar("fault", total, results))
    print("\n".join(table(cells)))
    safe = sum(cell.safe for cell in cells)
    put_results(arguments, SECTION, table(cells), f"faults --seed {arguments.seed}")
    print(f"seed {arguments.seed}: {safe} of {len(cells)} safe and in time")
    return 0 if safe == len(cells) else 1
