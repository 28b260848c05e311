"""How the gait tools end: stopped, killed, or with a worker that died."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cassie_gaits.gait_library_file import library_path, load_certified
from cassie_gaits.optimize import library
from cassie_gaits.processes import local_processes
from cassie_gaits.ros import check_gaits, optimize_gaits

OPTIMIZED = library_path("optimized")


def children(pid):
    """Processes whose parent is `pid`."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(stat.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(stat.parent.name))
    return found


def is_alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def wait_for(condition, seconds):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_ended_leaves_its_findings_and_no_process(tmp_path, kind, capsys):
    out = tmp_path / "gaits.json"
    out.write_bytes(OPTIMIZED.read_bytes())
    speeds = [f"{0.02 * i:g}" for i in range(40)]
    command = [sys.executable, "-m", "cassie_gaits.ros.optimize_gaits", "--out", str(out)]
    run = subprocess.Popen(
        [*command, "--speeds", *speeds],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    partial = tmp_path / "gaits.json.partial"
    assert wait_for(lambda: partial.exists() and partial.read_text().count("\n") > 2, 60.0)
    workers = children(run.pid)
    assert workers
    run.send_signal(kind)
    _, error = run.communicate(timeout=90.0)
    if kind != signal.SIGKILL:
        assert run.returncode == 130
        assert error == "optimize_gaits: stopped; --resume goes on from here\n"
    assert wait_for(lambda: not any(map(is_alive, workers)), 3.0)
    lines = [json.loads(line) for line in partial.read_text().splitlines()]
    assert out.read_bytes() == OPTIMIZED.read_bytes()
    found = [f"{line['request']['vx']:g}" for line in lines[1:]]
    resume = ["--speeds", *found, "-0.02", "--resume", "--jobs", "1", "--out", str(out)]
    assert optimize_gaits.main(resume) == 0
    assert f"{len(found)} of {len(found) + 1} taken over" in capsys.readouterr().out
    assert len(load_certified(out).gaits) == len(found) + 1


def test_a_check_that_is_stopped_ends_at_once_and_leaves_no_process():
    command = [sys.executable, "-m", "cassie_gaits.ros.check_gaits", "dense", "--jobs", "2"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert run.stdout is not None
    assert "certified" in run.stdout.readline()  # of 1424
    workers = children(run.pid)
    assert len(workers) == 2
    run.send_signal(signal.SIGINT)
    _, error = run.communicate(timeout=90.0)
    assert (run.returncode, error) == (130, "check_gaits: stopped\n")
    assert wait_for(lambda: not any(map(is_alive, workers)), 3.0)


TOOLS = [
    ("check_gaits", str(OPTIMIZED)),
    ("plot_gaits", str(OPTIMIZED), "--out", "pictures"),
    ("optimize_gaits", "--speeds", "0", "0.1", "--out", "gaits.json"),
]


def started(words, folder, output):
    name, *rest = words
    command = [sys.executable, "-m", f"cassie_gaits.ros.{name}", *rest]
    return subprocess.Popen(command, cwd=folder, stdout=output, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("words", TOOLS, ids=lambda words: words[0])
def test_a_reader_that_ends_before_the_tool_ends_it_without_an_error(tmp_path, words):
    run = started(words, tmp_path, subprocess.PIPE)
    run.stdout.close()
    _, error = run.communicate(timeout=90.0)
    assert run.returncode == 128 + signal.SIGPIPE
    assert "rror" not in error


def test_a_full_disk_is_one_clear_error(tmp_path):
    with Path("/dev/full").open("w") as full:
        run = started(TOOLS[0], tmp_path, full)
        _, error = run.communicate(timeout=90.0)
    assert run.returncode == 2
    assert error == "check_gaits: error: [Errno 28] No space left on device\n"


@pytest.mark.parametrize(
    ("tool", "words", "gaits"),
    [(check_gaits, [str(OPTIMIZED)], 7), (optimize_gaits, ["--speeds", "0", "0.1"], 2)],
)
def test_there_are_no_more_processes_than_gaits(tmp_path, monkeypatch, tool, words, gaits):
    monkeypatch.chdir(tmp_path)
    counts = []

    def counted(count):
        counts.append(count)
        return local_processes(1)

    monkeypatch.setattr(tool, "local_processes", counted)
    assert tool.main([*words, "--jobs", "99999"]) == 0
    assert counts == [gaits]


def dies(*_):
    os._exit(9)


def test_a_process_that_dies_is_one_clear_error(capsys, tmp_path, monkeypatch):
    reason = "error: a worker process died, perhaps for lack of memory\n"
    monkeypatch.setattr(check_gaits, "certify", dies)
    assert check_gaits.main([str(OPTIMIZED)]) == 2
    assert capsys.readouterr().err == f"check_gaits: {reason}"
    monkeypatch.setattr(library, "solve", dies)
    assert optimize_gaits.main(["--speeds", "0", "--out", str(tmp_path / "x.json")]) == 2
    assert capsys.readouterr().err == f"optimize_gaits: {reason}"
