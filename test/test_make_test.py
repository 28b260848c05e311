"""`make test`: what counts as a suite that passed, and the number of tests at its end."""

from __future__ import annotations

import importlib.util
import sys
from collections import deque
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def runner() -> ModuleType:
    """Module of `make test`."""
    spec = importlib.util.spec_from_file_location("make_test", ROOT / ".workspace" / "test.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_test"] = module  # dataclasses look there for the types of their fields
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("content", "words", "passed", "failed"),
    [
        ("def test_it(): pass", "suite: passed", 1, 0),
        ("def test_it(): pass\ndef test_other(): assert False", "FAILED with status 1", 1, 1),
        ("import nothing_of_this_name", "FAILED with status 2", 0, 1),
        ("", "FAILED with status 5", 0, 0),
        ("import pytest\n@pytest.mark.skip\ndef test_it(): pass", "no test has passed", 0, 0),
        ("import pytest\n@pytest.mark.xfail\ndef test_it(): assert 0", "no test has passed", 0, 0),
        (None, "FAILED with status 4", 0, 0),
    ],
    ids=["passes", "fails", "cannot be read", "has no test", "skips", "expects failure", "missing"],
)
def test_a_suite_in_which_no_test_passes_fails(
    runner: ModuleType,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    content: str | None,
    words: str,
    passed: int,
    failed: int,
) -> None:
    file = tmp_path / "test_suite.py"
    if content is not None:
        file.write_text(content)
    lane = runner.Lane(deque([("suite", (*runner.PYTEST, str(file)))]), deque())
    lane.run()
    assert words in capsys.readouterr().out
    assert lane.failed == ([] if words == "suite: passed" else ["suite"])
    assert lane.tests == runner.Count(passed, failed)


def test_other_commands_need_no_tests(runner: ModuleType) -> None:
    lane = runner.Lane(deque([("lint", ("true",))]), deque())
    lane.run()
    assert lane.failed == []


def test_the_tests_of_each_package_are_a_suite(runner: ModuleType) -> None:
    suites = {**runner.NODES, **runner.ARITHMETIC}
    paths = {word for command in suites.values() for word in command}
    folders = {f"{path.parent.name}/test" for path in ROOT.glob("*/package.xml")}
    assert folders
    assert folders | {"test"} <= paths


def test_the_last_lines_give_number_and_verdict(
    runner: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "test_suite.py"
    file.write_text("def test_it(): pass\ndef test_other(): pass")
    monkeypatch.setattr(runner, "NODES", {"nodes": (*runner.PYTEST, str(file))})
    monkeypatch.setattr(runner, "ARITHMETIC", {"lint": ("true",)})
    assert runner.main() == 0
    number, verdict = capsys.readouterr().out.splitlines()[-2:]
    assert number == "2 passed, 0 failed"
    assert verdict.startswith("make test: all passed (")
