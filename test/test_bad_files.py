"""Files that no node can use end it with one line, soon, and with little memory."""

from __future__ import annotations

import gzip
import os
import resource
import subprocess
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
from bringup import PACKAGES

from cassie_bags.ros.processes import environment, executable, own_domain

MOST_MEMORY = 600
"""That a node may take until it ends. In MiB; with files that it can use it takes 130 to 170."""

BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)


def huge(path: Path) -> None:
    """A file of 1 TiB that takes no place."""
    path.touch()
    os.truncate(path, 2**40)


def gzip_bomb(path: Path) -> None:
    """10 GiB of blanks in 10 MiB."""
    path.write_bytes(gzip.compress(b" " * 2**24) * 640)


def text(content: str) -> Callable[[Path], None]:
    """Makes a file with this content."""
    return lambda path: path.write_text(content)  # type: ignore[return-value]


def link(target: str) -> Callable[[Path], None]:
    """Makes a link."""
    return lambda path: path.symlink_to(target)


NESTED = "[" * 5000 + "]" * 5000
TWICE = "operator:\n- {t: 0.0, power: true, power: false}\n"
FILES: dict[str, list[tuple[str, str, Callable[[Path], object], str]]] = {
    "gait_library": [
        ("gait_controller", "zero.json", link("/dev/zero"), "it is no regular file"),
        ("gait_controller", "pipe.json", os.mkfifo, "it is no regular file"),
        ("gait_controller", "folder.json", Path.mkdir, "Is a directory"),
        ("gait_controller", "huge.json", huge, "larger than 32 MiB"),
        ("gait_controller", "bomb.json.gz", gzip_bomb, "it expands to what is larger than 32 MiB"),
        ("gait_controller", "nested.json", text(NESTED), "it is nested too deeply"),
    ],
    "learned_torques_file": [
        ("gait_controller", "zero.json", link("/dev/zero"), "it is no regular file"),
        ("gait_controller", "huge.json", huge, "larger than 32 MiB"),
        ("gait_controller", "nested.json", text(NESTED), "it is nested too deeply"),
    ],
    "scenario": [
        ("simulator", "zero.yaml", link("/dev/zero"), "it is no regular file"),
        ("simulator", "bomb.yaml", text(BOMB), "bomb.yaml:2: aliases"),
        ("simulator", "nested.yaml", text(NESTED), "it is nested too deeply"),
        ("simulator", "twice.yaml", text(TWICE), "twice.yaml:2: key power is given twice"),
    ],
    "script": [
        ("scripted_operator", "pipe.yaml", os.mkfifo, "it is no regular file"),
        ("scripted_operator", "huge.yaml", huge, "it is larger than 4 MiB"),
        ("scripted_operator", "twice.yaml", text(TWICE), "twice.yaml:2: key power is given twice"),
    ],
}


def ended(process: subprocess.Popen[str]) -> tuple[int, float]:
    """Exit code and most memory, in MiB, of a process that ends."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_maxrss / 1024.0


def with_little_memory() -> None:
    """In a child: no more address space than this, whatever happens."""
    resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30))


@pytest.mark.parametrize("parameter", FILES)
def test_a_file_that_cannot_be_used_ends_a_node_with_one_line(tmp_path, parameter):
    runs = []
    with ExitStack() as stack:  # a domain for each: of two in one, the second would be refused
        for node, name, make, words in FILES[parameter]:
            make(tmp_path / name)
            command = [str(executable(PACKAGES[node], node)), "--ros-args"]
            process = subprocess.Popen(
                [*command, "-p", f"{parameter}:={tmp_path / name}"],
                env=environment(stack.enter_context(own_domain())),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                preexec_fn=with_little_memory,
            )
            stack.callback(process.kill)  # nothing where it has ended
            runs.append((process, name, words))
        for process, name, words in runs:
            assert process.stderr is not None
            errors = process.stderr.read()
            code, memory = ended(process)
            assert code == 2, errors
            assert errors.count("\n") == 1, errors
            assert name in errors and words in errors
            assert memory < MOST_MEMORY, f"{name}: {memory:.0f} MiB"
