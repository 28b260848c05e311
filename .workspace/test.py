"""Lint, the unit tests beside each package and the bring-up tests, on two lanes at a time.

On one lane whatever starts nodes, in turn, as some of them have to keep pace with the wall clock;
beside it, with what these leave of the processors, whatever computes, of which the first lane takes
its part when it has nothing else to do. What a suite prints comes in one piece when it is over. A
suite of tests of which none has passed counts as failed. The last two lines give the number of
tests and say whether all passed.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import xml.etree.ElementTree as ET
from collections import deque
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PYTEST = (sys.executable, "-m", "pytest", "-q", "-rs")  # says why tests were skipped
BAGS_NODES = tuple(
    f"bags/test/test_{name}.py" for name in ("experiment_nodes", "record_nodes", "bench")
)
NODES = {
    "bring-up": (*PYTEST, "test"),
    "bags with nodes": (*PYTEST, *BAGS_NODES),
    "cassie_msgs": (*PYTEST, "cassie_msgs/test"),
    "cassie_teleop": (*PYTEST, "cassie_teleop/test"),
}
ARITHMETIC = {
    "lint": (str(ROOT / ".workspace" / "lint.sh"),),
    "bags": (*PYTEST, "bags/test", *(f"--ignore={file}" for file in BAGS_NODES)),
    "cassie_control": (*PYTEST, "cassie_control/test"),
    "cassie_gaits": (*PYTEST, "cassie_gaits/test"),
    "cassie_sim": (*PYTEST, "cassie_sim/test"),
}

Suites = deque[tuple[str, tuple[str, ...]]]
"""Names and commands that are still to be run; after lint the longest first."""


@dataclass(frozen=True)
class Count:
    """Number of tests that passed and failed."""

    passed: int = 0
    failed: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(self.passed + other.passed, self.failed + other.failed)


def count(file: Path) -> Count:
    """Number of tests in a file of JUnit XML; none without a file that can be read."""
    total = Count()
    with contextlib.suppress(OSError, ET.ParseError):
        for suite in ET.parse(file).getroot().iter("testsuite"):
            number = {key: int(suite.get(key, 0)) for key in ("errors", "failures", "skipped")}
            failed = number["errors"] + number["failures"]
            total += Count(int(suite.get("tests", 0)) - failed - number["skipped"], failed)
    return total


class Lane(threading.Thread):
    """Runs suites one after the other.

    Attributes:
        failed: Names of those that did not pass.
        tests: Number of tests in those that ended.

    Args:
        own: Suites that this lane runs.
        shared: Suites that any lane runs once it has none of its own; other processes come first.
    """

    _print = threading.Lock()

    def __init__(self, own: Suites, shared: Suites) -> None:
        super().__init__(daemon=True)
        self._own, self._shared = own, shared
        self._process: subprocess.Popen[str] | None = None
        self._stopped = False
        self.failed: list[str] = []
        self.tests = Count()

    def run(self) -> None:
        """Run everything."""
        while not self._stopped:
            polite = not self._own
            try:
                name, command = (self._shared if polite else self._own).popleft()
            except IndexError:
                return
            self._run_suite(name, command, polite=polite)

    def _run_suite(self, name: str, command: tuple[str, ...], *, polite: bool) -> None:
        started = time.monotonic()
        has_tests = "pytest" in command
        with tempfile.TemporaryDirectory() as folder:
            results = Path(folder, "results.xml")
            self._process = subprocess.Popen(
                (*command, f"--junit-xml={results}") if has_tests else command,
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                start_new_session=True,
                preexec_fn=_give_way if polite else None,
            )
            text, _ = self._process.communicate()
            tests = count(results)
        status, took = self._process.returncode, time.monotonic() - started
        word = "passed"
        if status:
            word = f"FAILED with status {status}"
        elif has_tests and not tests.passed:
            word = "FAILED: no test has passed"
        if word != "passed":
            self.failed.append(name)
        self.tests += tests
        with self._print:
            print(f"== {name}: {word} ({took:.0f} s)\n{text.rstrip()}", flush=True)

    def stop(self) -> None:
        """End what runs, as by Ctrl-C, and begin nothing any more."""
        self._stopped = True
        if self._process is not None and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGINT)


def _give_way() -> None:
    """In the child: let others come first, also where Linux shares among sessions."""
    os.nice(10)
    with contextlib.suppress(OSError):
        Path("/proc/self/autogroup").write_text("10", encoding="ascii")


def main() -> int:
    """Run, say how it went; 0 if all passed."""
    started = time.monotonic()
    shared = deque(ARITHMETIC.items())
    lanes = [Lane(deque(NODES.items()), shared), Lane(deque(), shared)]
    for lane in lanes:
        lane.start()
    try:
        for lane in lanes:
            while lane.is_alive():
                lane.join(0.5)  # so that Ctrl-C is heard
    except KeyboardInterrupt:
        for lane in lanes:
            lane.stop()
        for lane in lanes:
            lane.join(10.0)
        return 130
    took = f"({time.monotonic() - started:.0f} s)"
    failed = [name for lane in lanes for name in lane.failed]
    tests = sum((lane.tests for lane in lanes), Count())
    print(f"{tests.passed} passed, {tests.failed} failed")
    if failed:
        print(f"make test: FAILED in {', '.join(failed)} {took}")
        return 1
    print(f"make test: all passed {took}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
