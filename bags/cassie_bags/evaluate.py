"""From a recording to an outcome: numbers, verdict and pictures."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.continuity import episodes, gaps
from cassie_bags.experiment_file import Experiment
from cassie_bags.metrics import Phase, measure
from cassie_bags.phases import phases_of_steps
from cassie_bags.recording import Recording
from cassie_bags.report import Outcome
from cassie_bags.track import Track, make_track
from cassie_sim.errors import SimulationError


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


def draw(
    experiment: Experiment, track: Track, folder: Path, *, film: bool = True
) -> dict[str, Path]:
    """Draw all pictures of a run; what cannot be drawn is said on stderr.

    Args:
        experiment: What was run.
        track: Its signals.
        folder: Where to.
        film: Whether to make a video too, which takes longer than all pictures.

    Returns:
        The files by name.
    """
    from cassie_bags.figures import draw_all  # matplotlib takes a while to load
    from cassie_bags.pictures import strip, video

    phases = phases_of(experiment)
    title = f"{experiment.name}, seed {experiment.seed}"
    files = draw_all(track, phases, title, folder)
    files["strip"] = folder / "strip.png"
    reason = strip(track, experiment.scenario, phases, title, files["strip"])
    if reason is None and film:
        try:
            video(track, experiment.scenario, folder / "video.mp4")
            files["video"] = folder / "video.mp4"
        except SimulationError as error:
            reason = str(error)
    if reason is not None:
        print(f"stick figures and no video: {reason}", file=sys.stderr)
    return files
