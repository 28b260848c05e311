"""A gait library without a certificate is refused, in one line, unless the experiment allows it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from cassie_bags.errors import ExperimentError
from cassie_bags.run.cores import check_parameters, load_gaits
from cassie_bags.run.experiment import load_experiment
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library_file import library_path, load_library, save_library


@pytest.fixture
def experiment(tmp_path):
    def make(text, **changes):
        library = load_library(library_path("optimized"))
        gaits = [dataclasses.replace(gait, certificate=None) for gait in library.gaits]
        library = dataclasses.replace(library, gaits=gaits, **changes)
        save_library(library, tmp_path / "gaits.json")
        path = tmp_path / "walk.yaml"
        path.write_text(f"duration: 1.0\ngait_library: {tmp_path / 'gaits.json'}\n{text}")
        return load_experiment(Path(path))

    return make


def test_it_is_refused(experiment):
    with pytest.raises(GaitLibraryError, match="is not certified"):
        check_parameters(experiment(""))


def test_it_runs_where_that_is_allowed(experiment):
    allowed = experiment("controller: {allow_uncertified: true}\n")
    check_parameters(allowed)
    assert len(load_gaits(allowed).gaits) == 7


def test_another_model_is_refused_even_so(experiment):
    text = "controller: {allow_uncertified: true}\n"
    with pytest.raises(GaitLibraryError, match="it is for model 0000"):
        check_parameters(experiment(text, model_hash="0000"))


def test_the_permission_is_true_or_false(experiment):
    with pytest.raises(ExperimentError, match="allow_uncertified is 3, expected true or false"):
        check_parameters(experiment("controller: {allow_uncertified: 3}\n"))
