"""Summary of a bag, as text and as JSON."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence

from cassie_bags.bag.summary import STATUS_TOPIC, Interval, Summary
from cassie_bags.report.plain import WIDTH, aligned, finite

_AS_IN_SUMMARY = (
    *("lost_bytes", "duration", "wall_time", "topics", "gaps", "strays"),
    *("episodes", "modes", "faults", "made_gaits", "nodes", "problems"),
)


def summary_text(summary: Summary, falls: Mapping[int, float] | None) -> str:
    """Summary of a bag in some lines; `falls` is the time of each fall (s) by episode, if known."""
    return "\n".join(_lines(summary, falls))


def summary_json(summary: Summary, falls: Mapping[int, float] | None) -> str:
    """Summary of a bag as one line of JSON."""
    content = {
        "files": [str(file) for file in summary.files],
        "size": summary.size,
        "whole": summary.complete,
        **{name: getattr(summary, name) for name in _AS_IN_SUMMARY},
        "falls": None if falls is None else [{"episode": e, "t": t} for e, t in falls.items()],
        "metadata": summary.metadata,
    }
    return json.dumps(finite(content), allow_nan=False)


def _lines(summary: Summary, falls: Mapping[int, float] | None) -> Iterator[str]:
    for file in summary.files:
        yield f"file         {file}"
    yield f"size         {summary.size / 1e6:.1f} MB, {summary.damage or 'whole'}"
    yield f"duration     {summary.duration:.2f} s of robot time{_speed(summary)}"
    yield ""
    rows: list[Sequence[str]] = [("topic", "type", "count", "Hz")]
    rows += [
        (t.topic, t.type or "(no schema)", str(t.count), f"{t.rate:.1f}") for t in summary.topics
    ]
    yield from aligned(rows, left=2)
    yield ""
    yield from _section("missing", summary.gaps or ["nothing: seq has no gap"])
    if summary.strays:
        yield from _section("strays", [f"{line} of no node of this run" for line in summary.strays])
    yield from _section("episodes", [f"{e.name}: {_span(e)}" for e in summary.episodes])
    yield from _section("modes", map(_with_reason, summary.modes))
    if summary.modes and not summary.has_status:
        words = f"(reasons by commands and sensors alone: {STATUS_TOPIC} was not recorded)"
        yield from _section("", [words])
    yield from _section("faults", [f"{f.name}: {_span(f)}" for f in summary.faults])
    if gaits := summary.made_gaits:
        listed = ", ".join(f"{count} {result}" for result, count in gaits.items())
        yield from _section("made gaits", [f"{sum(gaits.values())} answers: {listed}"])
    yield from _section("nodes", [f"{n.t0:.2f} s  {n.name}" for n in summary.nodes])
    yield from _section("diagnostics", summary.problems)
    if falls is not None:
        lines = [f"at {time:.2f} s of episode {episode}" for episode, time in falls.items()]
        yield from _section("falls", lines or ["none"])
    yield from _origin(summary.metadata)


def _speed(summary: Summary) -> str:
    if abs(summary.wall_time - summary.duration) < 1e-3:
        return ""  # a run without ROS, which records no wall time
    return f", {summary.wall_time:.2f} s of wall time"


def _section(name: str, lines: Iterable[str]) -> Iterator[str]:
    for index, line in enumerate(lines):
        wrapped = textwrap.wrap(line, WIDTH - 13) or [""]
        for part, words in enumerate(wrapped):
            head = name if index == part == 0 else ""
            yield f"{head:<13}{words}"


def _span(interval: Interval) -> str:
    return f"{interval.t0:.2f} .. {interval.t1:.2f} s"


def _with_reason(mode: Interval) -> str:
    return f"{_span(mode)}  {mode.name}" + (f" ({mode.reason})" if mode.reason else "")


def _origin(metadata: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    if run := metadata.get("cassie_experiment"):
        yield from _section("experiment", [f"{run.get('name', '?')}, seed {run.get('seed', '?')}"])
        yield from _section("drawn", [drawn_text(run.get("draw", ""))])
    if versions := metadata.get("cassie_versions"):
        listed = ", ".join(f"{name} {version}" for name, version in versions.items())
        yield from _section("versions", [listed])
    others = sorted(set(metadata) - {"cassie_experiment", "cassie_versions"})
    if others:
        yield from _section("records", [", ".join(others)])


def drawn_text(text: str) -> str:
    """The values drawn from a seed, from the bag's record; numbers with three digits."""
    try:
        content = json.loads(text)
    except ValueError:
        return text
    if not isinstance(content, dict):
        return text
    return ", ".join(f"{name} {_short(value)}" for name, value in content.items())


def _short(value: object) -> str:
    if isinstance(value, list):
        return "[" + " ".join(_short(entry) for entry in value) + "]"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
