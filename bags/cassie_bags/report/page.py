"""One page about one or many runs: tables and pictures. A single HTML file without links."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any

import jinja2
from PIL import Image

from cassie_bags.report.plain import finite
from cassie_bags.report.text import outcome_content, phase_content
from cassie_bags.report.view import View
from cassie_bags.run.judge import RunResult
from cassie_bags.signals.metrics import UNITS, Metrics

CAPTIONS = {
    "strip": "Images",
    "mode_timeline": "Modes",
    "speed_tracking": "Tracking",
    "footsteps": "Footsteps",
    "foot_forces": "Foot forces by the springs; below 0 as a leg is pulled up, by its lower part",
    "torques": "Torques by their limits",
    "outputs_by_phase": "Errors of the outputs over the phase of a step",
    "knee_phase_portrait": "Phase portrait of the left knee",
    "estimate": "Error of the state estimate",
}
"""Captions of a run's pictures by name, in the order of the page."""

MAX_SIDE_BY_SIDE = 3
"""Largest number of runs whose pictures stand side by side; more follow one another."""

_SHAPES = {"strip": "strip", "knee_phase_portrait": "narrow"}
_TRACKED = (
    {"name": "vx", "label": "forward"},
    {"name": "vy", "label": "left"},
    {"name": "yaw_rate", "label": "yaw rate"},
    {"name": "height", "label": "height"},
)
_EMPTY: dict[str, Any] = {
    **dict.fromkeys(("seed", "passed", "fell", "fall_time", "duration")),
    **dict.fromkeys(("bag", "about"), ""),
    **dict.fromkeys(("failures", "phases", "cuts", "checks", "modes", "events", "notes"), ()),
    **dict.fromkeys(("metrics", "draw", "versions", "files"), MappingProxyType({})),
}
"""Content of the template where an entry has none."""

_NO_DITHER = Image.Dither.NONE
_NEARLY_WHITE = 247  # larger values become white: the fewer colours may change a white ground
_COLOURS = 256  # number of colours of a picture of lines and text

Entry = Mapping[str, Any]
"""Content of the page about one run, as for JSON: result of `run_entry` or `drive_entry`."""


def run_entry(outcome: RunResult, view: View | None, versions: Mapping[str, str]) -> Entry:
    """Content of the page about an experiment.

    Args:
        outcome: Result of the run.
        view: Content of its pictures, if there are any.
        versions: Versions with which the run was made.
    """
    content: Entry = finite(
        {
            **outcome_content(outcome),
            **_view_content(view),
            "about": outcome.experiment.about,
            "versions": dict(versions),
        }
    )
    return content


def drive_entry(
    view: View, metrics: Metrics, files: Mapping[str, str], versions: Mapping[str, str]
) -> Entry:
    """Content of the page about a recorded drive, which has no expectations.

    Args:
        view: Content of its pictures.
        metrics: Metrics of the drive.
        files: Pictures by name.
        versions: Versions with which the drive was recorded.
    """
    content: Entry = finite(
        {
            "name": view.title,
            "fell": metrics.fell,
            "fall_time": metrics.fall_time,
            "duration": metrics.run["duration"],
            "metrics": dict(metrics.run),
            "phases": [phase_content(phase) for phase in metrics.phases],
            **_view_content(view),
            "versions": dict(versions),
            "files": dict(files),
        }
    )
    return content


def heading(name: str, seed: int | None, bag: str) -> str:
    """Heading of a run.

    Args:
        name: Name of the experiment, or of the bag of a drive by hand.
        seed: Seed of the experiment, if there is one.
        bag: Name of an experiment's bag, empty if it is not known.
    """
    run = name if seed is None else f"{name}, seed {seed}"
    return f"{run} ({bag})" if bag else run


def _view_content(view: View | None) -> dict[str, Any]:
    if view is None:
        return {}
    return {
        "modes": view.modes,
        "events": view.events,
        "notes": view.notes,
    }


def page(title: str, entries: Sequence[Entry], versions: Mapping[str, str]) -> str:
    """The page as HTML.

    Args:
        title: Title of the page.
        entries: Contents of the runs. Up to `MAX_SIDE_BY_SIDE` with pictures stand side by side.
        versions: Versions with which the page is made.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("cassie_bags", "report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    runs = [_prepared(entry) for entry in entries]
    metrics = [run["metrics"] for run in runs]
    return environment.get_template("page.html").render(
        title=title,
        entries=runs,
        bags=any(run["bag"] for run in runs),
        judged=[run for run in runs if run["passed"] is not None],
        beside=1 < len(runs) <= MAX_SIDE_BY_SIDE
        and all(any(run["pictures"].values()) for run in runs),
        metrics=[
            n for n in (metrics[0] if metrics else {}) if any(m.get(n) is not None for m in metrics)
        ],
        captions=CAPTIONS,
        shapes=_SHAPES,
        tracked=_TRACKED,
        units=UNITS,
        versions=versions,
    )


def _prepared(entry: Entry) -> dict[str, Any]:
    """A run's content with all that the template reads."""
    entry = {**_EMPTY, **entry}
    title = heading(entry["name"], entry["seed"], entry["bag"])
    files = entry["files"]
    problems = {check["problem"] for check in entry["checks"]}
    return {
        **entry,
        "heading": title,
        "anchor": title.replace(" ", "-"),
        "other_failures": [words for words in entry["failures"] if words not in problems],
        # Only the files that the content names: others in the folder may be of an earlier run.
        "pictures": {n: _picture(Path(files[n]), n) if n in files else "" for n in CAPTIONS},
        "video": _data("video/mp4", Path(files["video"]).read_bytes()) if "video" in files else "",
    }


def _picture(path: Path, name: str) -> str:
    """A picture as part of the page: photos as JPEG, drawings as PNG with few colours."""
    stream = BytesIO()
    with Image.open(path) as image:
        if name == "strip":
            image.convert("RGB").save(stream, "JPEG", quality=88, optimize=True)
            return _data("image/jpeg", stream.getvalue())
        few = image.convert("RGB").quantize(_COLOURS, Image.Quantize.FASTOCTREE, dither=_NO_DITHER)
        palette = few.getpalette() or []
        few.putpalette([255 if value > _NEARLY_WHITE else value for value in palette])
        few.save(stream, "PNG")
    return _data("image/png", stream.getvalue())


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
