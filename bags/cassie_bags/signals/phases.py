"""Phases of a run: those that its file names, or the intervals between operator steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cassie_msgs.experiment.expectation import Phase
from cassie_msgs.experiment.script import OperatorStep

_SHOWN = ("vx", "vy", "yaw_rate", "height", "roll", "pitch", "com_x", "com_y")


def phases_of_steps(steps: Sequence[OperatorStep], duration: float) -> tuple[Phase, ...]:
    """One phase for each interval between operator steps, named by the changes of the step.

    Args:
        steps: Operator steps, in order of time; if there are none, the whole run is one phase.
        duration: End of the last phase. In s.
    """
    if not steps:
        return (Phase("without an operator", 0.0, duration),)
    starts = [step.t for step in steps]
    ends = [*starts[1:], duration]
    return tuple(
        Phase(_name(step.changes), t0, min(t1, duration))
        for step, t0, t1 in zip(steps, starts, ends, strict=True)
        if t0 < min(t1, duration)
    )


def _name(changes: Mapping[str, Any]) -> str:
    words = []
    if "power" in changes:
        words.append("power on" if changes["power"] else "power off")
    if "mode" in changes:
        words.append(str(changes["mode"]))
    words += [f"{key} {changes[key]:g}" for key in _SHOWN if key in changes]
    return ", ".join(words) or "no change"
