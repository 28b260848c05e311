"""The command `sweep`: its table and files, pieces of it, Ctrl-C, wrong words."""

from __future__ import annotations

import datetime
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_experiment_command import environment

from cassie_bags.run.provenance import revision


def sweep(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cassie_bags.cli.sweep", *words]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment(), check=False, timeout=600
    )


def test_the_command_runs_a_row_prints_and_keeps_it(tmp_path: Path):
    budget = ["--seeds", "1", "--seconds", "6", "--jobs", "1"]
    process = sweep("speed.+0", *budget, "--no-compare", "--out", str(tmp_path))
    assert process.returncode == 0, process.stderr
    assert "speed error at 0 m/s" in process.stdout
    (kept,) = json.loads((tmp_path / "sweeps.json").read_text())["rows"]
    assert kept["results"]["measured"]["measured"] < 0.03
    assert (tmp_path / "sweeps.png").stat().st_size > 5000
    again = sweep("speed.+0", *budget, "--no-compare", "--resume", "--out", str(tmp_path))
    assert again.returncode == 0, again.stderr
    assert again.stdout == process.stdout
    assert again.stderr == ""  # nothing was measured anew


@pytest.mark.parametrize("option", ["--compare", "--compare-seeds"])
def test_what_is_about_a_comparison_contradicts_no_comparison(option: str):
    value = "controller.walk.law=paper" if option == "--compare" else "2"
    process = sweep("speed.+0", "--no-compare", option, value)
    assert process.returncode == 2
    reason = f"--no-compare leaves out what {option} is about: give one"
    assert process.stderr == f"sweep: error: {reason}\n"


def test_rows_are_put_into_a_file_of_results_with_what_they_were_measured_with(tmp_path: Path):
    results = tmp_path / "RESULTS.md"
    results.write_text("# Results\nOf one robot.\n")
    words = ["speed.+0", "--seeds", "1", "--phases", "1", "--seconds", "6", "--no-compare"]
    more = ["--jobs", "1", "--out", str(tmp_path / "out"), "--results", str(results)]
    began = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    process = sweep(*words, *more)
    assert process.returncode == 0, process.stderr
    text = results.read_text()
    assert text.startswith("# Results\nOf one robot.\n\n## Walking\n")
    assert "| speed error at 0 m/s | ≤ 0.03 m/s |" in text
    (made,) = (line for line in text.splitlines() if line.startswith("| 1 |"))
    assert f"`ros2 run cassie_bags sweep {' '.join(words)}`" in made
    assert began <= made.split(" | ")[1] <= datetime.datetime.now(datetime.timezone.utc).isoformat()
    assert revision() in made
    assert str(tmp_path) not in text
    beside = (tmp_path / "out" / "sweeps.md").read_text()
    assert beside.partition("## ")[2] == text.partition("## ")[2]


def test_pieces_of_a_sweep_come_together(tmp_path: Path):
    words = ["--seeds", "1", "--seconds", "2", "--jobs", "1", "--out", str(tmp_path), "--resume"]
    few = [*words, "--compare-seeds", "1"]
    first = sweep("speed.+0", *few).stdout
    assert "speed error at 0 m/s" in first
    assert first.splitlines()[0].endswith("paper's law")
    second = sweep("speed.+0.25", *few)
    assert "speed error at 0 m/s" not in second.stdout
    content = json.loads((tmp_path / "sweeps.json").read_text())
    assert [row["name"] for row in content["rows"] if row["results"]] == ["speed.+0", "speed.+0.25"]
    assert (tmp_path / "sweeps.txt").read_text().count("speed error") == 2


def test_workers_that_have_finished_end_without_a_word(tmp_path: Path):
    script = (
        "from cassie_bags.studies.workers import workers\n"
        "if __name__ == '__main__':\n"
        "    pool = workers(2, None)\n"
        "    print(sorted(result for _, result in pool.results(abs, [-1, 2])))\n"
        "    pool.close()\n"
    )
    path = tmp_path / "pool.py"
    path.write_text(script)
    done = subprocess.run(
        [sys.executable, path], capture_output=True, text=True, env=environment(), check=True
    )
    assert (done.stdout, done.stderr) == ("[1, 2]\n", "")


OWN = """
rows:
  - name: own.still
    title: stands for a second
    counts: true
    stand: {}
    window: {end: 1.0, seconds: 0.5}
"""


def test_rows_of_a_file_are_listed_and_measured_as_others_are(tmp_path: Path):
    path = tmp_path / "own.yaml"
    path.write_text(OWN)
    assert (
        "own.still                stands for a second"
        in sweep("--rows", str(path), "--list").stdout
    )
    words = ["--rows", str(path), "--seeds", "1", "--jobs", "1", "--no-compare"]
    for named in ([], ["own"]):
        process = sweep(*named, *words, "--out", str(tmp_path / "out"))
        assert process.returncode == 0, process.stderr
        assert re.search(r"^stands for a second  +>= 100 %  +100 yes", process.stdout, re.MULTILINE)
    (kept,) = json.loads((tmp_path / "out" / "sweeps.json").read_text())["rows"]
    assert f"sweep own --rows {path} --seeds 1" in kept["results"]["measured"]["origin"]["command"]
    path.write_text(OWN.replace("end: 1.0", "ned: 1.0"))
    refused = sweep("--rows", str(path), "--out", str(tmp_path / "none"))
    assert refused.returncode == 2
    expected = f"sweep: error: {path}: row own.still: window: unknown key ned: did you mean end?\n"
    assert (refused.stdout, refused.stderr) == ("", expected)
    assert not (tmp_path / "none").exists()


# While the workers start, and after it.
@pytest.mark.parametrize(("jobs", "later"), [(2, 0.0), (2, 0.1), (2, 1.0), (1, 1.0)])
def test_ctrl_c_ends_a_sweep_and_leaves_no_process(tmp_path: Path, jobs: int, later: float):
    words = ["speed.+0", "--seeds", "8", "--jobs", str(jobs), "--no-compare"]
    words += ["--out", str(tmp_path)]
    with subprocess.Popen(
        [sys.executable, "-m", "cassie_bags.cli.sweep", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        start_new_session=True,
    ) as process:
        group = process.pid
        while process.poll() is None and len(members(group)) < 3:
            time.sleep(0.01)
        time.sleep(later)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=90)
    assert process.returncode == 130, errors
    assert errors.splitlines()[-1] == "sweep: stopped"
    assert "Traceback" not in errors
    for _ in range(50):
        if not members(group):
            break
        time.sleep(0.1)
    assert members(group) == []


def members(group: int) -> list[int]:
    """Processes of a group, without zombies."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def test_a_folder_that_cannot_be_is_told_before_anything_is_measured(tmp_path: Path):
    (tmp_path / "file").write_text("in the way of a folder")
    process = sweep("speed.+0", "--seeds", "1", "--out", str(tmp_path / "file" / "out"))
    assert process.returncode == 2, process.stdout
    assert process.stdout == ""
    assert process.stderr.startswith("sweep: error: ")
    assert len(process.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["stopp"], "unknown row stopp: did you mean stop"),
        (["--seeds", "0"], "0 is not a whole number of 1 or more"),
        (["--seconds", "nan"], "nan is not 2 .. 600 s"),
        (["speed.+0", "--set", "durtion=3"], "unknown key durtion: did you mean duration"),
        (["speed.+0", "--set", "seed=3", "--results", "R.md"], "takes the robot as it is"),
        (["speed.+0", "--compare", "seed=3", "--results", "R.md"], "takes the robot as it is"),
        (["--rows", "no/such/own.yaml"], "cannot read no/such/own.yaml: No such file"),
        (["speed.+0", "--results", "no/such/R.md"], "no/such/R.md: there is no such folder"),
    ],
)
def test_wrong_words_exit_with_2(words: list[str], reason: str, tmp_path: Path):
    process = sweep(
        *words, "--seeds" if "--seeds" not in words else "--phases", "1", "--out", str(tmp_path)
    )
    assert process.returncode == 2, process.stdout
    assert reason in process.stderr
    assert "Traceback" not in process.stderr
