"""Content of a page about a recorded bag, of an experiment or of a drive by hand."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from cassie_bags.bag.summary import summarize
from cassie_bags.report.page import Entry, drive_entry, heading, run_entry
from cassie_bags.report.pictures import draw
from cassie_bags.report.view import recorded_experiment, view_of
from cassie_bags.run.judge import evaluate
from cassie_bags.signals.metrics import measure


def recorded_entry(bag: Path, name: str, folder: Path, *, film: bool) -> Entry:
    """Content of a page about a bag. An experiment in it is compared with its expectations.

    Args:
        bag: MCAP file, or a folder as `ros2 bag` writes it.
        name: Name of the bag on the page.
        folder: Folder for the pictures.
        film: Whether to make a video too.

    Raises:
        BagError: if the bag cannot be read, or has no tick with sensors and state.
    """
    summary = summarize(bag)
    recording = summary.recording
    experiment = recorded_experiment(recording)
    title = name if experiment is None else heading(experiment.name, experiment.seed, name)
    view = view_of(recording, title, experiment, summary)
    if summary.damage:
        note = f"What could be read is shown: the bag is {summary.damage}."
        view = dataclasses.replace(view, notes=[*view.notes, note])
    versions = recording.metadata.get("cassie_versions", {})
    files = {key: str(path) for key, path in draw(view, folder, film=film).items()}
    if experiment is None or not len(recording.truth):  # evaluation needs the true pose
        metrics = measure(recording, view.track, view.phases)
        notes = [*view.notes, *(f"Missing: {g}" for g in summary.gaps)]
        if experiment is not None:
            notes.append("Not judged, as the experiment's file asks for the true pose.")
        entry = drive_entry(dataclasses.replace(view, notes=notes), metrics, files, versions)
        if experiment is None:
            return entry
        return {**entry, "name": experiment.name, "seed": experiment.seed, "bag": name}
    outcome = evaluate(experiment, recording, "recorded", lockstep_broken=summary.lockstep_broken)
    return {**run_entry(dataclasses.replace(outcome, files=files), view, versions), "bag": name}
