"""Results of a search: parameters to use, and how they were found."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from cassie_bags.run.provenance import versions
from cassie_bags.studies.tune.search import Search
from cassie_bags.studies.tune.space import Parameter


@dataclass(frozen=True)
class Score:
    """Score of a set of parameters on a set of seeds: mean cost of a run, falls, runs."""

    cost: float
    fell: int
    runs: int

    def __str__(self) -> str:
        return f"cost {self.cost:.3f}, {self.fell} of {self.runs} fell"


def write_result(
    folder: Path,
    space: Sequence[Parameter],
    values: Mapping[str, float],
    search: Search,
    scores: Mapping[str, Score],
    settings: Mapping[str, Any],
) -> dict[str, Path]:
    """Write the results of a search.

    Args:
        folder: Target folder, which must exist.
        space: Searched parameters.
        values: Best values by dotted name.
        search: Search with its history.
        scores: Scores by name of the scored parameters and seeds.
        settings: Settings of the search: objective, seeds, changes.

    Returns:
        tuned.yaml, a `controller:` section for experiments; tuned_node.yaml, the same values as a
        parameter file of the node; tuned.json, with the origin of the values.

    Raises:
        OSError: if a file cannot be written.
    """
    files = {
        "section": folder / "tuned.yaml",
        "node": folder / "tuned_node.yaml",
        "provenance": folder / "tuned.json",
    }
    comments = "".join(f"# {name}: {score}\n" for name, score in scores.items())
    files["section"].write_text(comments + yaml.safe_dump({"controller": dict(values)}), "utf-8")
    node = {"gait_controller": {"ros__parameters": dict(values)}}
    files["node"].write_text(comments + yaml.safe_dump(node), "utf-8")
    content = {
        "parameters": [{**asdict(p), "found": values[p.name]} for p in space],
        "scores": {name: asdict(score) for name, score in scores.items()},
        "history": [asdict(generation) for generation in search.history],
        "settings": dict(settings),
        "versions": versions(),
    }
    files["provenance"].write_text(json.dumps(content, indent=1), "utf-8")
    return files


def table(space: Sequence[Parameter], values: Mapping[str, float]) -> str:
    """Table of the found and the initial values."""
    width = max(len(parameter.name) for parameter in space)
    lines = [f"{'parameter':{width}}  {'from':>10}  {'found':>10}  unit"]
    lines += [f"{p.name:{width}}  {p.start:10.4g}  {values[p.name]:10.4g}  {p.unit}" for p in space]
    return "\n".join(lines)
