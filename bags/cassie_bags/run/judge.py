"""Evaluates a recording: the metrics of the run, compared with the expectations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cassie_bags.bag.continuity import episodes, gaps
from cassie_bags.bag.recording import Recording
from cassie_bags.run.cuts import Cut, cuts_of
from cassie_bags.signals.metrics import Metrics, measure
from cassie_bags.signals.track import make_track
from cassie_msgs.experiment.expectation import Bound, Expectation, Phase
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.experiment.script import OperatorStep

_STEP_KEYS = ("vx", "vy", "yaw_rate", "height", "roll", "pitch", "com_x", "com_y")
"""Keys of an operator step that name its phase."""


@dataclass(frozen=True)
class RunResult:
    """Result of a run.

    Attributes:
        experiment: Experiment that was run, drawn.
        metrics: Metrics of the run.
        failures: Expectations that the run did not meet, in words; empty if it passed.
        how: "dds" or "in-process".
        lockstep_broken: Whether the simulator gave up lock-step.
        files: Files that the run wrote, by name.
        cuts: Commands that the supervisor cut.
    """

    experiment: Experiment
    metrics: Metrics
    failures: Sequence[str]
    how: str
    lockstep_broken: bool = False
    files: Mapping[str, str] = field(default_factory=dict)
    cuts: Sequence[Cut] = ()

    @property
    def passed(self) -> bool:
        """Whether the run met all expectations."""
        return not self.failures


def phases_of(experiment: Experiment) -> Sequence[Phase]:
    """The phases of the report: those of the file, else the operator's intervals."""
    return experiment.expect.phases or phases_of_steps(experiment.operator, experiment.duration)


def phases_of_steps(steps: Sequence[OperatorStep], duration: float) -> tuple[Phase, ...]:
    """One phase for each interval between operator steps, named by the changes of the step.

    Steps are in order of time; without steps the whole run is one phase, of the duration (s).
    """
    if not steps:
        return (Phase("without an operator", 0.0, duration),)
    starts = [step.t for step in steps]
    ends = [*starts[1:], duration]
    return tuple(
        Phase(_step_name(step.changes), t0, min(t1, duration))
        for step, t0, t1 in zip(steps, starts, ends, strict=True)
        if t0 < min(t1, duration)
    )


def _step_name(changes: Mapping[str, Any]) -> str:
    words = []
    if "power" in changes:
        words.append("power on" if changes["power"] else "power off")
    if "mode" in changes:
        words.append(str(changes["mode"]))
    words += [f"{key} {changes[key]:g}" for key in _STEP_KEYS if key in changes]
    return ", ".join(words) or "no change"


def evaluate(
    experiment: Experiment, recording: Recording, how: str, *, lockstep_broken: bool = False
) -> RunResult:
    """Compare a run with its expectations.

    Args:
        experiment: Experiment that was run, drawn.
        recording: Recording of the run.
        how: "dds" or "in-process".
        lockstep_broken: Whether the simulator gave up lock-step.

    Raises:
        BagError: if the recording has nothing to evaluate.
    """
    track = make_track(recording)
    phases = phases_of(experiment)
    metrics = measure(recording, track, phases, experiment.rider)
    failures = [check.problem for check in checks(experiment.expect, metrics) if check.problem]
    if not experiment.expect.lockstep_broken:
        if lockstep_broken:
            failures.append("lockstep_broken: the commands did not come in time")
        failures += [f"lost: {gap}" for gap in gaps(recording)]
        if len(episodes(recording)) > 1:
            failures.append(f"the simulator restarted: {len(episodes(recording))} episodes")
    cuts = cuts_of(experiment, recording, phases)
    return RunResult(experiment, metrics, failures, how, lockstep_broken, cuts=cuts)


@dataclass(frozen=True)
class Check:
    """One expectation of a run, and its result.

    Attributes:
        phase: Name of the phase; empty for the whole run.
        name: Name of the metric.
        value, target: Measured value, and expected value.
        problem: What is wrong, in one line; empty if nothing is.
    """

    phase: str
    name: str
    value: str
    target: str
    problem: str


def checks(expected: Expectation, metrics: Metrics) -> list[Check]:
    """All expectations of a run with their results."""
    results = []
    if expected.fell is not None:
        results.append(_fall_check(expected.fell, metrics))
    for name, bound in expected.metrics.items():
        results.append(_check("", name, metrics.run[name], bound))
    for values in metrics.phases:
        phase = values.phase
        if phase.bounds and not values.reached:
            problem = f"{phase.name}: the run ended before {phase.t1:g} s"
            results.append(Check(phase.name, "reached", "no", "yes", problem))
            continue
        results += [_check(phase.name, n, values.values[n], b) for n, b in phase.bounds.items()]
    return results


def _fall_check(expected: bool, metrics: Metrics) -> Check:
    when = "" if metrics.fall_time is None else f" at {metrics.fall_time:.2f} s"
    value = f"yes{when}" if metrics.fell else "no"
    problem = f"the robot fell{when}" if metrics.fell else "the robot did not fall"
    met = metrics.fell == expected
    return Check("", "falls", value, "yes" if expected else "no", "" if met else problem)


def _check(phase: str, name: str, value: float, bound: Bound) -> Check:
    problem = f"{name} = {value:.4g}, expected {bound}"
    if phase:
        problem = f"{phase}: {problem}"
    return Check(phase, name, f"{value:.4g}", str(bound), "" if bound.holds(value) else problem)
