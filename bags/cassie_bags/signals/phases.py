"""The phases of a run: those its file names, or else the intervals between operator steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cassie_bags.signals.metrics import Phase

_SHOWN = ("vx", "vy", "yaw_rate", "height", "roll", "pitch", "com_x", "com_y")


def phases_of_steps(steps: Sequence[Mapping[str, Any]], duration: float) -> tuple[Phase, ...]:
    """One phase for each interval between operator steps, named after what the step changes.

    Args:
        steps: Operator steps, in order of time; without any, all of the run is one phase.
        duration: End of the last phase. In s.
    """
    if not steps:
        return (Phase("without an operator", 0.0, duration),)
    starts = [float(step["t"]) for step in steps]
    ends = [*starts[1:], duration]
    return tuple(
        Phase(_name(step), t0, min(t1, duration))
        for step, t0, t1 in zip(steps, starts, ends, strict=True)
        if t0 < min(t1, duration)
    )


def _name(step: Mapping[str, Any]) -> str:
    words = []
    if "power" in step:
        words.append("power on" if step["power"] else "power off")
    if "mode" in step:
        words.append(str(step["mode"]))
    words += [f"{key} {step[key]:g}" for key in _SHOWN if key in step]
    return ", ".join(words) or "no change"
