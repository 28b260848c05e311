"""Many experiments in one go: a page with all of them, and exit codes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from test_experiment_command import TEXT, environment

from cassie_bags.cli.experiment import main
from cassie_bags.report.page import page


def experiments(*words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cassie_bags.cli.experiment", "--in-process", "--no-video"]
    command += map(str, words)
    return subprocess.run(
        command, capture_output=True, text=True, env=environment(), check=False, timeout=600
    )


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text(TEXT + "about: It <stands> still.\n")
    bad.write_text(TEXT.replace("target: 0.0", "target: 3.0"))
    return [good, bad]


def test_one_page_shows_every_run_and_a_failure_is_told(files: list[Path], tmp_path: Path):
    out = tmp_path / "out"
    process = experiments(*files, "--out", out, "--jobs", "1")
    assert process.returncode == 1, process.stderr
    assert "1 of 2 as expected" in process.stdout
    text = (out / "report.html").read_text()
    assert "1 of 2 runs as expected" in text
    assert "It &lt;stands&gt; still." in text
    assert "vx = " in text
    for run in ("good", "bad"):
        for caption in (
            "Images",
            "Modes",
            "Tracking",
            "Footsteps",
            "Phase portrait of the left knee",
        ):
            assert f'alt="{caption}: {run}, seed 0"' in text, caption
    assert not re.search(r"(src|href)=\"(?!data:|#)", text)  # nothing but itself
    assert "data:video" not in text
    for name in ("good", "bad"):
        assert f"Cassie: {name}" in (out / name / "report.html").read_text()
        assert (out / name / "bag.mcap").stat().st_size > 10_000
        assert (out / name / "result.json").is_file()


def test_a_run_that_cannot_be_made_is_told_and_the_others_go_on(files: list[Path], tmp_path: Path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "bad").write_text("in the way of a folder")
    process = experiments(*reversed(files), "--out", out, "--jobs", "1")
    assert process.returncode == 3, process.stderr
    assert "bad, seed 0: the run did not come to its end: " in process.stderr
    assert "good, seed 0: as expected" in process.stderr
    assert "the run did not come to its end" in (out / "report.html").read_text()


def test_two_files_of_one_name_are_refused_since_they_would_share_a_folder(
    files: list[Path], tmp_path: Path
):
    other = tmp_path / "other" / files[0].name
    other.parent.mkdir()
    other.write_text(TEXT)
    process = experiments(files[0], other, "--out", tmp_path / "out")
    assert process.returncode == 2, process.stdout
    assert "two files are called good: they would share a folder" in process.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--set", "durtion=3"], "unknown key durtion: did you mean duration"),
        (["--seeds", "-1"], "-1"),
        (["--seeds", "0"], "0"),
        (["--seeds", "2", "--json"], "--json is for one run"),
        (["--all"], "--all runs those of the package: name no file"),
        (["--seed", "1", "--seeds", "2"], "not allowed with"),
    ],
)
def test_wrong_words_exit_with_2(files: list[Path], tmp_path: Path, words, reason):
    process = experiments(files[0], "--out", tmp_path / "out", *words)
    assert process.returncode == 2
    assert reason in process.stderr
    assert "Traceback" not in process.stderr


@pytest.mark.parametrize("how", [[], ["--in-process"]])
@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ("pushes: [{t: 1, force: [1, 0, 0], body: pelvsi}]", "push at 1 s: unknown body pelvsi"),
        ("faults: [{t: 1, channel: battery.7, kind: nan}]", "fault at 1 s, channel battery.7: ind"),
        ("simulator: {control_rate: 300}", "control_rate = 300 Hz does not divide"),
        ("scene: slop", "unknown scene slop: did you mean slope?"),
    ],
)
def test_what_the_plant_refuses_is_refused_with_the_file_before_a_node_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], how: list[str], section: str, reason: str
):
    file = tmp_path / "wrong.yaml"
    file.write_text(f"duration: 1\n{section}\n")
    assert main([str(file), *how]) == 2
    assert f"experiment: error: {file}: {reason}" in capsys.readouterr().err


@pytest.mark.parametrize("section", ["{video: film.mp4}", "{headless: false}"])
def test_film_and_window_of_the_node_are_not_left_out_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], section: str
):
    file = tmp_path / "shown.yaml"
    file.write_text(f"duration: 1\nsimulator: {section}\n")
    assert main([str(file), "--in-process"]) == 2
    assert "needs the node: not in one process" in capsys.readouterr().err


def test_a_page_without_pictures_is_a_page():
    content = {"name": "try", "seed": 3, "passed": False, "failures": ["the robot fell"]}
    text = page("Title & more", [content], {"mujoco": "4"})
    assert "Title &amp; more" in text
    assert "the robot fell" in text
    assert "<img" not in text


def test_pictures_of_an_earlier_run_are_not_shown(files: list[Path], tmp_path: Path):
    out = tmp_path / "out"
    (out / "good_1").mkdir(parents=True)
    (out / "good_1" / "strip.png").write_bytes(b"of a run before")
    (out / "good_1" / "bag.mcap").mkdir()  # so that this run cannot be made
    process = experiments(files[0], "--seeds", "1", "--out", out, "--jobs", "1")
    assert process.returncode == 3, process.stderr
    assert "<img" not in (out / "report.html").read_text()
