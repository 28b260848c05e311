"""Commands beyond the supervisor's limits: what it permitted instead, and by which parameter."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import Rows, stamps
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.limits import command_limits
from cassie_control.supervisor.set_points import set_points_of
from cassie_msgs.experiment.expectation import TRACKED, Phase
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode
from cassie_msgs.tunables import from_mapping

_UNITS = {"vx": "m/s", "vy": "m/s", "yaw_rate": "rad/s", "height": "m"}
_SPEEDS = ("vx", "vy", "yaw_rate")
_ON_FOOT = {
    "vx": ("vx_backward", "vx_forward"),
    "vy": ("vy_limit", "vy_limit"),
    "yaw_rate": ("yaw_rate_limit", "yaw_rate_limit"),
    "height": ("height_low", "height_high"),
}
_RIDING = {
    "vx": ("ride_backward", "ride_forward"),
    "vy": ("", ""),
    "yaw_rate": ("ride_yaw_rate", "ride_yaw_rate"),
}
_LEAST = 1e-6  # m/s, rad/s or m; a smaller difference is rounding


@dataclass(frozen=True)
class Cut:
    """A set-point that the supervisor cut in a phase of a run.

    Attributes:
        phase: Name of the phase.
        name: Name of the set-point, one of `TRACKED`.
        commanded, permitted: Value of the operator, and what the supervisor made of it.
        parameters: Parameters of the supervisor that bound it: one, or those of all speeds that
            were commanded together. Empty for a speed sideways on a Segway.
    """

    phase: str
    name: str
    commanded: float
    permitted: float
    parameters: tuple[str, ...]

    def __str__(self) -> str:
        unit = _UNITS[self.name]
        cut = (
            f"{self.phase}: the command {self.name} = {self.commanded:.4g} {unit} was cut to "
            f"{self.permitted:.4g} {unit}"
        )
        if not self.parameters:
            return f"{cut}: a Segway does not move sideways"
        names = [f"supervisor.{name}" for name in self.parameters]
        together = ", as speeds are bounded together" if len(names) > 1 else ""
        return f"{cut} by {', '.join(names)}{together}"


def cuts_of(
    experiment: Experiment, recording: Recording, phases: Iterable[Phase]
) -> tuple[Cut, ...]:
    """The cuts of a run, the largest of each set-point in each phase.

    Commands count while the mode that they ask for is in force: speeds while the robot walks or
    rides, which have heights of their own, and the height while it stands.
    """
    config = from_mapping(SupervisorConfig, experiment.parameters["supervisor"])
    commands, modes = recording.rows(OperatorCommand), recording.rows(Mode)
    found = []
    for phase in phases:
        given, in_force = (_inside(rows, phase) for rows in (commands, modes))
        known = set(in_force["mode"].tolist()) & set(RobotMode)
        largest: dict[str, Cut] = {}
        for row in _different(given[np.isin(given["mode"], sorted(known))]):
            for cut in _cuts(phase.name, row, config):
                before = largest.get(cut.name)
                if before is None or _size(cut) > _size(before):
                    largest[cut.name] = cut
        found += [largest[name] for name in TRACKED if name in largest]
    return tuple(found)


def _inside(rows: Rows, phase: Phase) -> Rows:
    if not len(rows):
        return rows
    time = stamps(rows)
    return rows[(time >= phase.t0 - 1e-9) & (time < phase.t1 - 1e-9)]


def _different(rows: Rows) -> Iterator[Rows]:
    """One row of each kind of command."""
    if len(rows):
        table = np.column_stack([rows[name] for name in ("mode", *TRACKED)])
        for index in np.unique(table, axis=0, return_index=True)[1].tolist():
            yield rows[index : index + 1]


def _size(cut: Cut) -> float:
    return abs(cut.commanded - cut.permitted)


def _cuts(phase: str, row: Rows, config: SupervisorConfig) -> Iterator[Cut]:
    """Cuts of one command, a row of `OperatorCommand`. Shape (1,)."""
    command = OperatorCommand()
    for field in ("mode", *TRACKED):
        getattr(command, field)[...] = row[field]
    mode = RobotMode(int(command.mode))
    if mode not in (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY):
        return
    limits, asked = command_limits(mode, config), set_points_of(command)
    permitted = limits.clamp(asked)
    ends = _RIDING if mode is RobotMode.SEGWAY else _ON_FOOT
    low = {"vx": -limits.vx_backward, "vy": -limits.vy, "yaw_rate": -limits.yaw_rate}
    high = {"vx": limits.vx_forward, "vy": limits.vy, "yaw_rate": limits.yaw_rate}
    low["height"], high["height"] = limits.height_low, limits.height_high
    for name in ("height",) if mode is RobotMode.STAND else _SPEEDS:
        value, result = float(getattr(asked, name)), float(getattr(permitted, name))
        if abs(value - result) <= _LEAST:
            continue
        alone = min(high[name], max(low[name], value))
        by: tuple[str, ...] = (ends[name][value > 0.0 if name != "height" else value > result],)
        if abs(alone - result) > _LEAST:
            moved = [each for each in _SPEEDS if getattr(asked, each)]
            by = tuple(ends[each][getattr(asked, each) > 0.0] for each in moved)
        yield Cut(phase, name, value, result, tuple(filter(None, by)))
