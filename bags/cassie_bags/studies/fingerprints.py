"""Fingerprints of all runs: recorded again, or compared with those recorded."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
from pathlib import Path

from cassie_bags.errors import ExperimentError
from cassie_bags.run.experiment import packaged_experiments
from cassie_bags.run.fingerprint import (
    FAST,
    ROBOTS,
    START,
    Fingerprint,
    FingerprintDifference,
    Fingerprints,
    Run,
    default_path,
    differences,
    fields_to_hash,
    fingerprint_of,
    load,
    save,
)
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.provenance import changes_of_environment, environment
from cassie_bags.studies.workers import Workers, all_results, workers


def run(arguments: argparse.Namespace) -> int:
    """Check or renew fingerprints; returns the exit code."""
    arguments.file = arguments.file or default_path()
    if arguments.bags is not None:
        if arguments.fast:
            raise ExperimentError("--fast takes parts of runs: leave out --bags")
        if not arguments.bags.is_dir():
            raise ExperimentError(f"--bags: there is no folder {arguments.bags}")
    with contextlib.closing(workers(arguments.jobs, None)) as pool:
        return _renew(arguments, pool) if arguments.renew else _check(arguments, pool)


def _check(arguments: argparse.Namespace, pool: Workers) -> int:
    known = load(arguments.file)
    changes = changes_of_environment(known.environment)
    runs = _runs(arguments, START if changes else None)
    if changes:
        print(
            f"not as recorded: {'; '.join(changes)}\n"
            f"holding the pose in the first {START:g} s within tolerances in place of the bits"
        )
    computed = _take(runs, known, pool)
    different: list[FingerprintDifference] = []
    for run in runs:
        expected = known.runs.get(run.file.stem, {}).get(run.robot)
        if expected is None:
            different.append(
                FingerprintDifference(run.file.stem, run.robot, "", "has no fingerprint: --renew")
            )
        else:
            different += differences(run, expected, computed[run], exactly=not changes)
    if not (arguments.files or arguments.fast):
        names = {run.file.stem for run in runs}
        different += [
            FingerprintDifference(name, robot, "", "has no experiment file: --renew")
            for name, robots in known.runs.items()
            for robot in robots
            if name not in names
        ]
    _print(different, len(runs))
    return 1 if different else 0


def _renew(arguments: argparse.Namespace, pool: Workers) -> int:
    if arguments.fast or arguments.bags:
        raise ExperimentError("--renew takes whole runs: neither --fast nor --bags")
    prints = Fingerprints(environment(), fields_to_hash(), {})
    if arguments.files and arguments.file.exists():
        known = load(arguments.file)
        if (changes := changes_of_environment(known.environment)) or known.fields != prints.fields:
            changed = "; ".join(changes) or "messages have other fields"
            raise ExperimentError(f"all fingerprints have to be renewed: {changed}")
        prints = known
    runs = _runs(arguments, None)
    merged = {name: dict(robots) for name, robots in prints.runs.items()}
    for run, fingerprint in _take(runs, prints, pool).items():
        merged.setdefault(run.file.stem, {})[run.robot] = fingerprint
    in_order = {name: dict(sorted(robots.items())) for name, robots in sorted(merged.items())}
    save(dataclasses.replace(prints, runs=in_order), arguments.file)
    print(f"fingerprints of {len(runs)} runs: {arguments.file}")
    return 0


def _take(runs: list[Run], prints: Fingerprints, pool: Workers) -> dict[Run, Fingerprint]:
    """Fingerprints of runs, with the same fields as `prints`."""
    taking = functools.partial(fingerprint_of, fields=prints.fields)
    with progress_bar("run", len(runs)) as bar:
        return dict(zip(runs, all_results(pool, taking, runs, bar), strict=True))


def _runs(arguments: argparse.Namespace, seconds: float | None) -> list[Run]:
    files: list[Path] = arguments.files or packaged_experiments()
    if not arguments.fast:
        return [
            Run(file, robot, seconds, _bag(arguments.bags, file.stem, robot))
            for file in files
            for robot in ROBOTS
        ]
    chosen = {file: FAST[file.stem] for file in files if file.stem in FAST}
    return [Run(file, robot, seconds or long) for file, (robot, long) in chosen.items()]


def _bag(folder: Path | None, name: str, robot: int) -> Path | None:
    """The bag of a run that the command `experiment` wrote into its folder; None if absent."""
    if folder is None:
        return None
    bag = folder / (f"{name}_{robot}" if robot else name) / "bag.mcap"
    return bag if bag.exists() else None


def _print(different: list[FingerprintDifference], count: int) -> None:
    if different:
        print(f"{'experiment':20} {'robot':5}  {'topic':26} what")
    for each in different:
        print(f"{each.experiment:20} {each.robot:5}  {each.topic:26} {each.reason}")
    runs_that_differ = len({(each.experiment, each.robot) for each in different})
    print(
        f"{runs_that_differ} of {count} runs differ" if different else f"{count} runs as recorded"
    )
