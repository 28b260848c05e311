"""Differences of two bags, as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from cassie_bags.bag.comparison import TopicComparison
from cassie_bags.bag.summary import Summary
from cassie_bags.errors import BagError
from cassie_bags.report.plain import aligned

MACHINERY = frozenset(["/diagnostics", "/parameter_events", "/rosout"])
"""Topics that do not tell runs apart: what they hold depends on when the recorder started."""


def comparison_text(
    summaries: tuple[Summary, Summary],
    topics: Sequence[TopicComparison],
    metrics: tuple[Mapping[str, float], Mapping[str, float]] | str,
    note: str = "",
) -> str:
    """Samples by topic, the first differences, and the metrics of both runs side by side.

    Args:
        summaries: Summaries of the bags A and B.
        topics: Comparison of each topic.
        metrics: Metrics of A and B by name; or the reason why they cannot be measured.
        note: What to know of the metrics; empty if there is nothing.

    Raises:
        BagError: if neither bag holds any of the compared topics.
    """
    if not any(any(one.counts) for one in topics):
        raise BagError("neither bag holds a topic of the control lane: there is nothing to compare")
    lines = [f"{name}: {s.files[0]}" for name, s in zip("AB", summaries, strict=True)]
    rows: list[Sequence[str]] = [("topic", "A", "B", "common", "different")]
    for one in topics:
        if any(one.counts):
            rows.append((one.topic, *map(str, (*one.counts, one.common, one.different))))
    lines += ["", *aligned(rows), "", *_other_topics(summaries, {one.topic for one in topics})]
    firsts = [(one.topic, one.first) for one in topics if one.first is not None]
    for topic, first in sorted(firsts, key=lambda pair: pair[1].time):
        a, b = first.values
        lines.append(
            f"first difference of {topic}: {first.field} at tick {first.tick} "
            f"({first.time:.3f} s): {a!r} against {b!r}"
        )
    if all(one.same for one in topics):
        lines.append("the control lane is the same to the last bit")
    if only := in_one_bag(summaries):
        lines.append(f"in one bag only: {', '.join(only)}")
    lines.append("")
    if isinstance(metrics, str):
        lines.append(f"no figures: {metrics}")
    else:
        lines += [*([note] if note else []), *_metrics_table(*metrics)]
    return "\n".join(lines)


def in_one_bag(summaries: tuple[Summary, Summary]) -> list[str]:
    """Topics that only one bag holds, also outside of the control lane, but of `MACHINERY`."""
    a, b = ({topic.topic for topic in s.topics if topic.count} for s in summaries)
    return sorted((a ^ b) - MACHINERY)


def _other_topics(summaries: tuple[Summary, Summary], known: set[str]) -> list[str]:
    a, b = ({topic.topic: topic.count for topic in s.topics} for s in summaries)
    return [
        f"{topic}: {a.get(topic, 0)} messages against {b.get(topic, 0)}"
        for topic in sorted((a.keys() | b.keys()) - known)
        if a.get(topic, 0) != b.get(topic, 0)
    ]


def _metrics_table(a: Mapping[str, float], b: Mapping[str, float]) -> list[str]:
    rows: list[Sequence[str]] = [("figure", "A", "B", "B - A")]
    for name, value in a.items():
        if not (math.isnan(value) and math.isnan(b[name])):
            rows.append((name, f"{value:.5g}", f"{b[name]:.5g}", f"{b[name] - value:.3g}"))
    return aligned(rows)
