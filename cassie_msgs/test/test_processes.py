"""Child processes: they end with their parent, whenever that dies."""

from __future__ import annotations

import subprocess
import sys

LATE = """
import os, signal, time
from cassie_msgs.processes import end_with_parent
{before}
parent = os.getpid()
if os.fork():
    os._exit(0)  # dies before its child has asked for the signal
while os.getppid() == parent:
    time.sleep(0.01)
end_with_parent(parent)
print("lives", flush=True)
"""
SOON = """
import os, signal, time
from cassie_msgs.processes import end_with_parent
{before}
parent = os.getpid()
reader, writer = os.pipe()
if os.fork():
    os.read(reader, 1)
    os._exit(0)
end_with_parent(parent)
os.write(writer, b"1")
time.sleep(20.0)
print("lives", flush=True)
"""
HANDLER = "signal.signal(signal.SIGTERM, lambda *_: None)"


def printed(program: str, before: str = "") -> str:
    """What a program and its child print; returns when both have ended."""
    command = [sys.executable, "-c", program.format(before=before)]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=90, check=True).stdout


def test_a_child_ends_when_its_parent_dies() -> None:
    assert printed(SOON) == ""


def test_a_child_whose_parent_has_died_before_ends_at_once() -> None:
    assert printed(LATE) == ""


def test_a_handler_that_the_parent_has_set_does_not_keep_its_child_alive() -> None:
    assert printed(SOON, HANDLER) == ""
    assert printed(LATE, HANDLER) == ""
