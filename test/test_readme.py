"""The READMEs say what the code does."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest
from rclpy.context import Context

from cassie_bags.studies.sweep.table import all_rows
from cassie_control.controller.config import ControllerConfig
from cassie_msgs.tunables import names

ROOT = Path(__file__).resolve().parents[1]
READMES = [ROOT / "README.md", *sorted(ROOT.glob("*/README.md"))]


def commands() -> Iterator[tuple[str, str, str]]:
    """Package, executable and the rest of each command, with the lines that go on with it."""
    for readme in READMES:
        text = re.sub(r"\n +(?=\[-)", " ", readme.read_text(encoding="utf-8"))
        yield from re.findall(r"ros2 run (cassie_\w+) (\w+)([^\n`#]*)", text)


def source_of(package: str, executable: str) -> str:
    """The sources of an executable; the test fails if a package's setup.py has none."""
    (setup,) = (path for path in ROOT.glob("*/setup.py") if f'"{package}"' in path.read_text())
    module = re.search(rf'"{executable} = ([\w.]+):main"', setup.read_text())
    assert module, f"{package} has no {executable}"
    return (setup.parent / f"{module[1].replace('.', '/')}.py").read_text(encoding="utf-8")


def test_parameter_tables_are_those_of_the_code() -> None:
    check = [sys.executable, ROOT / ".workspace" / "parameter_tables.py", "--check"]
    result = subprocess.run(check, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_files_that_readmes_name_exist() -> None:
    for readme in READMES:
        for target in re.findall(r"\]\((?!http)([^)#]+)\)", readme.read_text(encoding="utf-8")):
            assert (readme.parent / target).exists(), f"{readme.name} names {target}"


def test_modules_that_readmes_name_exist() -> None:
    seen = 0
    for readme in READMES:
        for name in re.findall(r"`(cassie_\w+(?:\.\w+)+)`", readme.read_text(encoding="utf-8")):
            parent, _, last = name.rpartition(".")
            found = find_spec(parent) and (find_spec(name) or hasattr(import_module(parent), last))
            assert found, f"{readme} names {name}"
            seen += 1
    assert seen > 10


def test_commands_that_readmes_name_have_these_options() -> None:
    seen = 0
    for package, executable, rest in commands():
        source = source_of(package, executable)
        for option in re.findall(r"(?<=[ \[])--[a-z][a-z-]*", rest.partition("--ros-args")[0]):
            assert f'"{option}"' in source, f"ros2 run {package} {executable} has no {option}"
            seen += 1
    assert seen > 40


@pytest.mark.parametrize(
    "words", [f"{e} {rest}" for _, e, rest in commands() if "--ros-args" in rest]
)
def test_ros_arguments_that_readmes_show_can_be_read(words: str) -> None:
    context = Context()
    context.init([word for word in shlex.split(words) if word != "&"])
    context.shutdown()


def test_parameters_that_readmes_name_exist() -> None:
    known = set(names(ControllerConfig))
    groups = "|".join({name.partition(".")[0] for name in known if "." in name})
    known |= {name.rpartition(".")[0] for name in known} | {row.name for row in all_rows()}
    for readme in READMES:
        text = readme.read_text(encoding="utf-8")
        for name in re.findall(rf"[` ]((?:{groups})\.[a-z_.]*[a-z])(?=[`:=])", text):
            assert name in known, f"{readme} names {name}"
