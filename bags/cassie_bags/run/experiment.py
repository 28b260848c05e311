"""Reads experiments: files of the package, other files, text and mappings.

The keys are the fields of `cassie_msgs.experiment.file.Experiment`; the README explains them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_bags.run.yaml_file import apply_changes, parse_mapping, read_mapping
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.structured import structure
from cassie_msgs.tunables import ParameterError

MIN_DURATION = 0.02
"""Shortest run. In s."""


def packaged_folder() -> Path:
    """The package's folder with `experiments`: its sources, or where it was installed."""
    here = Path(__file__).resolve()
    sources, prefix = here.parents[2], here.parents[5]
    return sources if (sources / "experiments").is_dir() else prefix / "share" / "cassie_bags"


def packaged_experiments() -> list[Path]:
    """Files of the package's experiments, sorted by name.

    Raises:
        ExperimentError: if there is none.
    """
    folder = packaged_folder() / "experiments"
    files = sorted(folder.glob("*.yaml"))
    if not files:
        raise ExperimentError(f"there is no experiment in {folder}")
    return files


def load_experiment(path: Path, changes: Iterable[str] = (), seed: int | None = None) -> Experiment:
    """An experiment from its file.

    Args:
        path: YAML file.
        changes: Words `key=value` or `@file.yaml` that replace values of the file.
        seed: Seed in place of the file's.

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    content, changes = read_mapping(path), tuple(changes)
    apply_changes(content, changes)
    if seed is not None:
        if any(change.partition("=")[0] == "seed" for change in changes):
            raise ExperimentError(
                f"seed is given twice: --set seed={content['seed']}, --seed {seed}"
            )
        content["seed"] = seed
    content.setdefault("name", path.stem)
    try:
        return read_experiment(content)
    except ExperimentError as error:
        raise ExperimentError(f"{path}: {error}") from None


def parse_experiment(text: str, name: str) -> Experiment:
    """An experiment from text; `name` stands for the file in messages."""
    return read_experiment(parse_mapping(text, name))


def read_experiment(content: Mapping[str, Any]) -> Experiment:
    """An experiment from a mapping as YAML gives it.

    Raises:
        ExperimentError: naming the path of the key, its value and what is permitted.
    """
    try:
        experiment = structure(Experiment, content)
    except ParameterError as error:
        raise ExperimentError(str(error)) from None
    if "duration" not in content:
        raise ExperimentError("duration must be given: robot time of the run in s")
    if experiment.duration < MIN_DURATION:
        raise ExperimentError(
            f"duration = {experiment.duration:g} is too short: at least {MIN_DURATION:g} s"
        )
    return experiment
