"""All pictures of a run into a folder. Loads matplotlib and MuJoCo, which takes a while."""

from __future__ import annotations

import sys
from pathlib import Path

from cassie_bags.report.figures import draw_all
from cassie_bags.report.strip import strip, video
from cassie_bags.run.experiment import Experiment
from cassie_bags.run.judge import phases_of
from cassie_bags.signals.track import Track
from cassie_sim.errors import SimulationError


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
