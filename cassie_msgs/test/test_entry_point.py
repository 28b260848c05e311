"""Console scripts: what a Ctrl-C does while a module is imported, and later."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

from cassie_msgs.processes import STOPPED

SLOW = """
import sys, time
def wait(name):
    print(name, flush=True)
    try:
        time.sleep({seconds})
    except BaseException:
        if {lost}:
            return
        raise
"""
IMPORTS = (
    SLOW
    + """
wait("imports")
def main(): return 7
"""
)
IMPORTS_LATER = """
import time
def main():
    try:
        import imports
        time.sleep(60.0)
    except KeyboardInterrupt:
        return 7
"""
RUNS = (
    SLOW
    + """
def main():
    wait("runs")
    return 7
"""
)
START = """
import signal, sys
{before}
from cassie_msgs.processes import entry_point
sys.path.insert(0, {folder!r})
sys.exit(entry_point({module!r})())
"""


def interrupted(
    folder: Path,
    module: str,
    *,
    seconds: float = 60.0,
    before: str = "",
    lost: bool = True,
    number: signal.Signals = signal.SIGINT,
) -> int:
    """Exit code of a console script that a signal interrupts; it says nothing.

    Args:
        folder: Folder for the modules.
        module: Module of the console script.
        seconds: Time for which the script waits for the signal. In s.
        before: Statement before the script.
        lost: Whether the script ignores exceptions, as some compiled modules do.
        number: The signal, Ctrl-C's or another.
    """
    for name, text in {"imports": IMPORTS, "imports_later": IMPORTS_LATER, "runs": RUNS}.items():
        (folder / f"{name}.py").write_text(text.format(seconds=seconds, lost=lost))
    process = subprocess.Popen(
        [sys.executable, "-c", START.format(folder=str(folder), before=before, module=module)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None and process.stdout.readline()
    time.sleep(0.1)
    process.send_signal(number)
    _, errors = process.communicate(timeout=90)
    assert errors == ""
    return process.returncode


def test_ctrl_c_during_its_imports_ends_a_script_without_words(tmp_path: Path) -> None:
    assert interrupted(tmp_path, "imports") == STOPPED


def test_main_may_handle_a_ctrl_c_that_came_during_an_import(tmp_path: Path) -> None:
    assert interrupted(tmp_path, "imports_later", seconds=1.0) == 7


def test_a_termination_during_an_import_waits_for_its_end(tmp_path: Path) -> None:
    before = "from cassie_msgs.processes import interrupt; signal.signal(signal.SIGTERM, interrupt)"
    how = {"seconds": 1.0, "before": before, "number": signal.SIGTERM}
    assert interrupted(tmp_path, "imports_later", **how) == 7


def test_ctrl_c_that_main_does_not_handle_ends_a_script_without_words(tmp_path: Path) -> None:
    assert interrupted(tmp_path, "runs", lost=False) == STOPPED


def test_main_may_handle_ctrl_c(tmp_path: Path) -> None:
    assert interrupted(tmp_path, "runs", lost=True) == 7


def test_a_script_in_the_background_of_a_shell_goes_on(tmp_path: Path) -> None:
    ignore = "signal.signal(signal.SIGINT, signal.SIG_IGN)"
    assert interrupted(tmp_path, "imports", seconds=0.5, before=ignore) == 7
