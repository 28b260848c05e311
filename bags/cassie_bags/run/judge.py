"""From a recording to an outcome: the run in numbers, held against what was expected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from cassie_bags.bag.continuity import episodes, gaps
from cassie_bags.bag.recording import Recording
from cassie_bags.run.experiment import Experiment
from cassie_bags.signals.metrics import Metrics, Phase, measure
from cassie_bags.signals.phases import phases_of_steps
from cassie_bags.signals.track import make_track


@dataclass(frozen=True)
class Outcome:
    """What came of a run.

    Attributes:
        experiment: What was run, drawn.
        metrics: The run in numbers.
        failures: What it did not keep of what was expected; empty if it passed.
        how: "dds" or "in-process".
        lockstep_broken: Whether the simulator gave up lock-step.
        files: Files it left, by name.
    """

    experiment: Experiment
    metrics: Metrics
    failures: Sequence[str]
    how: str
    lockstep_broken: bool = False
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether the run kept all that was expected."""
        return not self.failures


def phases_of(experiment: Experiment) -> Sequence[Phase]:
    """The phases to report: those the file names, else the operator's intervals."""
    return experiment.expect.phases or phases_of_steps(experiment.operator, experiment.duration)


def evaluate(
    experiment: Experiment, recording: Recording, how: str, *, lockstep_broken: bool = False
) -> Outcome:
    """Hold a run against what was expected of it.

    Args:
        experiment: What was run, drawn.
        recording: What came of it.
        how: "dds" or "in-process".
        lockstep_broken: Whether the simulator gave up lock-step.

    Raises:
        BagError: if the recording holds nothing to look at.
    """
    track = make_track(recording)
    metrics = measure(recording, track, phases_of(experiment), experiment.rider)
    failures = experiment.expect.failures(metrics)
    if not experiment.expect.lockstep_broken:
        if lockstep_broken:
            failures.append("lockstep_broken: the commands did not come in time")
        failures += [f"lost: {gap}" for gap in gaps(recording)]
        if len(episodes(recording)) > 1:
            failures.append(f"the simulator restarted: {len(episodes(recording))} episodes")
    return Outcome(experiment, metrics, failures, how, lockstep_broken)
