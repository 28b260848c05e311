"""Content of a recording's pictures, computed once."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from cassie_bags.bag.continuity import episodes
from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import Rows, stamps
from cassie_bags.bag.summary import Interval, Summary, intervals_of_mode, summarize
from cassie_bags.errors import ExperimentError
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.judge import phases_of
from cassie_bags.signals.events import Event, events_of
from cassie_bags.signals.falls import fall_time, falls
from cassie_bags.signals.track import Track, make_track, with_estimate_as_truth
from cassie_msgs.experiment.expectation import Phase
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import ControllerStatus, Sensors

TimedT = TypeVar("TimedT", Event, Interval)


@dataclass(frozen=True)
class View:
    """The last episode of a recording.

    Attributes:
        title: Title of the run.
        track: Signals of the episode.
        status: Rows of `ControllerStatus`.
        phases: Phases of the run.
        modes: Modes of the robot with the supervisor's reasons, where they are known.
        events: Pushes, gantry, faults, events of nodes, and the fall, in order of time.
        scenario: Scenario of the run.
        estimated: Whether the estimated pose is used as the true one.
        notes: Notes for the reader, in sentences.
    """

    title: str
    track: Track
    status: Rows
    phases: Sequence[Phase]
    modes: Sequence[Interval]
    events: Sequence[Event]
    scenario: Scenario
    estimated: bool = False
    notes: Sequence[str] = ()


def view_of(
    recording: Recording,
    title: str,
    experiment: Experiment | None = None,
    summary: Summary | None = None,
) -> View:
    """View of a recording.

    Args:
        recording: Recording of a run.
        title: Title of the run.
        experiment: Experiment that was run; if None, the phases are the intervals of the modes.
        summary: Summary of the bag, with reports of the supervisor and the nodes.

    Raises:
        BagError: if the recording has no tick with sensors and state.
    """
    notes = []
    estimated = not len(recording.truth)
    if estimated:
        recording = with_estimate_as_truth(recording)
        notes.append("The bag holds no true pose: the estimate stands in its place.")
    track = make_track(recording)
    numbers, shown = episodes(recording), int(track.sensors["episode"][0])
    if len(numbers) > 1:
        notes.append(
            f"Episode {shown} is shown, number {numbers.index(shown) + 1} of {len(numbers)}."
        )
    scenario = Scenario() if experiment is None else experiment.scenario
    modes = list(intervals_of_mode(track.time, track.mode))
    events = [*events_of(scenario, float(track.time[-1]))]
    begins = [each.t0 for each in summary.episodes if each.name == str(shown)] if summary else []
    if summary is not None and modes and not summary.has_status:
        notes.append(
            "Reasons of modes are what commands and sensors show: the supervisor's status is not "
            "in the bag."
        )
    if summary is not None and begins:
        # Times of a bag continue over episodes; times of a track begin at 0 in each episode.
        begun = begins[0] - float(track.time[0])
        reported = [_shifted(mode, -begun) for mode in summary.modes if mode.t1 >= begun]
        modes = [_with_reason(mode, reported) for mode in modes]
        since = [_shifted(e, -begun) for e in _reported_events(summary) if e.t1 >= begun]
        events += [dataclasses.replace(event, t0=max(event.t0, 0.0)) for event in since]
    if (fell := fall_time(track)) is not None:
        events.append(Event("fall", fell, fell, "fall"))
    status = recording.rows(ControllerStatus)
    phases = [Phase(mode.name, mode.t0, mode.t1) for mode in modes if mode.t1 > mode.t0]
    return View(
        title=title,
        track=track,
        status=status[status["episode"] == track.sensors["episode"][0]],
        phases=phases if experiment is None else phases_of(experiment),
        modes=modes,
        events=sorted(events, key=lambda event: event.t0),
        scenario=scenario,
        estimated=estimated,
        notes=notes,
    )


def view_of_bag(bag: Path, title: str, summary: Summary | None = None) -> View:
    """View of any bag, of an experiment or of a drive by hand.

    Args:
        bag: MCAP file, or a folder as `ros2 bag` writes it.
        title: Title of the run, if the bag has no experiment.
        summary: Summary of the bag, if there is one already.

    Raises:
        BagError: as `view_of`, and if the bag cannot be read.
    """
    summary = summarize(bag) if summary is None else summary
    experiment = recorded_experiment(summary.recording)
    if experiment is not None:
        title = f"{experiment.name}, seed {experiment.seed}"
    return view_of(summary.recording, title, experiment, summary)


def events_of_bag(summary: Summary) -> list[Event]:
    """Events of all episodes of a bag, in robot time that continues over episodes."""
    experiment = recorded_experiment(summary.recording)
    scenario = Scenario() if experiment is None else experiment.scenario
    fallen = falls(summary.recording) or {}
    sensors = summary.recording.rows(Sensors)
    events = _reported_events(summary)
    for episode in summary.episodes:
        number = int(episode.name)
        time = stamps(sensors[sensors["episode"] == number])
        if not len(time):
            continue
        own = [*events_of(scenario, float(time[-1]))]
        if number in fallen:
            own.append(Event("fall", fallen[number], fallen[number], "fall"))
        begun = episode.t0 - float(time[0])  # of the episode's own time
        events += [_shifted(event, begun) for event in own]
    return sorted(events, key=lambda event: event.t0)


def recorded_experiment(recording: Recording) -> Experiment | None:
    """The experiment whose file is in a recording; None if none can be read."""
    text = recording.metadata.get("cassie_experiment", {}).get("file")
    if text is None:
        return None
    try:
        return parse_experiment(text, "the experiment in the bag")
    except ExperimentError:  # a file of another version: the recording can still be shown
        return None


def _reported_events(summary: Summary) -> list[Event]:
    """Faults and events of nodes, in the bag's robot time."""
    kinds = {"fault": summary.faults, "node": summary.nodes}
    return [Event(kind, e.t0, e.t1, e.name) for kind, found in kinds.items() for e in found]


def _shifted(one: TimedT, by: float) -> TimedT:
    """An event or interval that begins and ends later by a time. In s."""
    return dataclasses.replace(one, t0=one.t0 + by, t1=one.t1 + by)


def _with_reason(mode: Interval, reported: Sequence[Interval]) -> Interval:
    """A mode with the supervisor's reason at its start. Times agree to some ticks."""
    for other in reported:
        if other.name == mode.name and abs(other.t0 - mode.t0) < 0.1 and other.reason:
            return dataclasses.replace(mode, reason=other.reason)
    return mode
