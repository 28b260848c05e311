"""Events of an experiment and their times: pushes, gantry, faults of sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cassie_msgs.experiment.scenario import Scenario


@dataclass(frozen=True)
class Event:
    """An event at a time or over an interval.

    Attributes:
        kind: One of push, gantry, fault, node, fall.
        t0, t1: Start and end; equal for an instant. Robot time of the episode, in s.
        text: Short description.
        force: Force of a push, world axes. In N.
    """

    kind: str
    t0: float
    t1: float
    text: str
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)


def events_of(scenario: Scenario, end: float) -> Sequence[Event]:
    """The events of a scenario that begin before `end` (s), in order of time."""
    events = []
    for push in scenario.pushes:
        impulse = float(np.linalg.norm(push.force)) * push.duration
        text = f"push {impulse:.3g} Ns"
        events.append(Event("push", push.t, push.t + push.duration, text, push.force))
    for move in scenario.gantry:
        to = "" if move.action == "release" else f" at {move.height:g} m"
        events.append(Event("gantry", move.t, move.t, f"gantry: {move.action}{to}"))
    for fault in scenario.faults:
        text = f"{fault.channel} {fault.kind}"
        events.append(Event("fault", fault.t, min(fault.t + fault.duration, end), text))
    return sorted((e for e in events if e.t0 < end), key=lambda event: event.t0)
