"""The result of a run: a table, and one line of JSON."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cassie_bags.report.plain import WIDTH, aligned, finite
from cassie_bags.run.judge import RunResult, checks
from cassie_bags.signals.metrics import UNITS, PhaseMetrics
from cassie_msgs.experiment.expectation import PHASE_METRICS, RUN_METRICS, TRACKED
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.tunables import as_mapping

_HEADINGS = ("phase", "", "vx", "vy", "yaw", "height", "drift", "turn")
_UNITS = ("", "", "m/s", "m/s", "rad/s", "m", "m", "deg")


def json_line(outcome: RunResult) -> str:
    """Result of a run as one line of JSON; NaN becomes null."""
    return json.dumps(finite(outcome_content(outcome)), allow_nan=False)


def outcome_content(outcome: RunResult) -> dict[str, Any]:
    """Result of a run with the content of JSON, but with NaN."""
    experiment, metrics = outcome.experiment, outcome.metrics
    return {
        "name": experiment.name,
        "how": outcome.how,
        "passed": outcome.passed,
        "failures": list(outcome.failures),
        "checks": [
            {**vars(check), "passed": not check.problem}
            for check in checks(experiment.expect, metrics)
        ],
        "fell": metrics.fell,
        "fall_time": metrics.fall_time,
        "lockstep_broken": outcome.lockstep_broken,
        "real_time_factor": metrics.run["real_time_factor"],
        "duration": metrics.run["duration"],
        "tracked": {
            name: {
                "mean": metrics.run[f"{name}_mean"],
                "mean_error": metrics.run[f"{name}_mean_error"],
                "rms_error": metrics.run[f"{name}_rms_error"],
            }
            for name in TRACKED
        },
        "peak_torque": metrics.peak_torque,
        "metrics": {name: metrics.run[name] for name in RUN_METRICS},
        "phases": [phase_content(phase) for phase in metrics.phases],
        "cuts": [{**vars(cut), "text": str(cut)} for cut in outcome.cuts],
        "seed": experiment.seed,
        "draw": as_mapping(experiment.scenario.draw),
        "event_times": {
            "operator": [step.t for step in experiment.operator],
            "gantry": [move.t for move in experiment.scenario.gantry],
            "pushes": [push.t for push in experiment.scenario.pushes],
            "faults": [fault.t for fault in experiment.scenario.faults],
        },
        "files": dict(outcome.files),
    }


def table(outcome: RunResult) -> str:
    """Table of a run: commanded and achieved values of each phase, then expectations and result."""
    metrics = outcome.metrics
    rows: list[Sequence[str]] = [_HEADINGS, _UNITS]
    for phase in metrics.phases:
        rows += _rows(phase)
    lines = [
        f"{outcome.experiment.name}, seed {outcome.experiment.seed}, {outcome.how}",
        *aligned(rows, left=2, heading=2),
        *(line for cut in outcome.cuts for line in textwrap.wrap(str(cut), WIDTH)),
        "",
        *textwrap.wrap(_drawn(outcome.experiment), WIDTH),
        f"real-time factor {metrics.run['real_time_factor']:.2f}, "
        f"{metrics.run['duration']:.2f} s of robot time, {_count(metrics.run['steps'])} steps",
        f"peak torque {100 * metrics.run['peak_torque_ratio']:.0f} % of the drive's limit, "
        f"greatest tilt {metrics.run['tilt_deg']:.1f} deg",
    ]
    if math.isfinite(missed := metrics.run["missed_share"]):
        lines.append(f"{100 * missed:.2f} % of the control ticks without a new command")
    if metrics.fall_time is not None:
        lines.append(f"fell at {metrics.fall_time:.2f} s")
    if results := checks(outcome.experiment.expect, metrics):
        rows = [["expected of", "measured", "value", "", "target", "pass"]]
        for check in results:
            unit, passed = UNITS.get(check.name, ""), "NO" if check.problem else "yes"
            part = check.phase or "the run"
            rows.append([part, check.name, check.value, unit, check.target, passed])
        lines += ["", *aligned(rows), ""]
    lines += [f"not as expected: {failure}" for failure in outcome.failures]
    lines.append(_verdict(outcome))
    return "\n".join(lines)


def _verdict(outcome: RunResult) -> str:
    """Whether the run passed, and the folder of the pictures."""
    first, more = next(iter(outcome.failures), ""), len(outcome.failures) - 1
    verdict = "passed" if outcome.passed else f"FAILED: {first}"
    if more > 0:
        verdict += f", and {more} more"
    pictures = [path for path in outcome.files.values() if path.endswith((".png", ".gif", ".mp4"))]
    return f"{verdict}; pictures in {Path(pictures[0]).parent}" if pictures else verdict


def _drawn(experiment: Experiment) -> str:
    """The values drawn from the seed, in short."""
    draw = experiment.scenario.draw
    torque = draw.torque_constant
    roll, pitch = (math.degrees(bias) for bias in draw.attitude_bias)
    return (
        f"robot drawn: mass {draw.mass:.3f}, friction {draw.friction:.3f}, "
        f"torque constants {min(torque):.3f} .. {max(torque):.3f}, "
        f"yaw {math.degrees(draw.initial_yaw):.2f} deg, IMU roll {roll:.2f}, pitch {pitch:.2f} deg"
    )


def _rows(phase: PhaseMetrics) -> list[list[str]]:
    """Rows of a phase: name and time; commanded values, achieved values, and RMS errors."""
    time = f"{phase.phase.t0:.1f} .. {phase.phase.t1:.1f} s"
    if not phase.reached:
        empty = ["-"] * (len(TRACKED) + 2)
        return [[phase.phase.name, "not", *empty], [time, "reached", *empty]]
    commanded = [_fixed(phase.commanded[key], 2) for key in TRACKED]
    achieved = [_fixed(phase.values[key], 3) for key in TRACKED]
    errors = [_fixed(phase.values[key + "_rms"], 3) for key in TRACKED]
    moved = [_fixed(phase.values["drift"], 2), _fixed(phase.values["turn_deg"], 0)]
    return [
        [phase.phase.name, "commanded", *commanded, "", ""],
        [time, "achieved", *achieved, *moved],
        ["", "RMS error", *errors, "", ""],
    ]


def phase_content(phase: PhaseMetrics) -> dict[str, Any]:
    """Content of a phase for JSON, but with NaN."""
    return {
        "name": phase.phase.name,
        "t0": phase.phase.t0,
        "t1": phase.phase.t1,
        "reached": phase.reached,
        "commanded": phase.commanded,
        "achieved": {name: phase.values[name] for name in PHASE_METRICS},
    }


def _fixed(number: float, digits: int) -> str:
    """A number with so many digits, and zero without a sign; "-" for one that is not known."""
    return f"{round(number, digits) + 0.0:.{digits}f}" if math.isfinite(number) else "-"


def _count(number: float) -> str:
    """A whole number as text; "?" if it was not recorded."""
    return f"{number:.0f}" if math.isfinite(number) else "?"
