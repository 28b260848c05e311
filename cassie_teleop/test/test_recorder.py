"""The console's recorder, with a program in the place of `record`."""

import time

import pytest

from cassie_teleop.ros import recorder as module
from cassie_teleop.ros.recorder import Recorder

DEAF_ONCE = """#!/usr/bin/env python3
import pathlib, signal, sys, time

heard = []
signal.signal(signal.SIGINT, lambda *_: heard.append(1))
pathlib.Path(sys.argv[2]).touch()
while len(heard) < 2:
    time.sleep(0.01)
"""


@pytest.fixture
def recorder(tmp_path, monkeypatch):
    """One whose program does not hear the first Ctrl-C, and what it tells."""
    program = tmp_path / "record"
    program.write_text(DEAF_ONCE, encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(module, "_program", lambda: program)
    told = []
    recorder = Recorder(tmp_path / "bags", told.append)
    recorder.toggle()
    until(lambda: list(tmp_path.glob("bags/*.mcap")))
    yield recorder, told
    recorder.close()


def test_a_recording_that_is_ended_before_it_began_says_so(tmp_path, monkeypatch):
    program = tmp_path / "record"
    program.write_text("#!/bin/sh\nexec sleep 100\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(module, "_program", lambda: program)
    told = []
    recorder = Recorder(tmp_path / "bags", told.append)
    recorder.toggle()
    recorder.toggle()

    def ended():
        recorder.look()
        return recorder.file == ""

    until(ended)
    assert told[-1] == "no recording: it was ended before the recorder had started"


def until(condition):
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_recording_that_does_not_hear_the_first_word_ends_by_the_next(recorder):
    recorder, told = recorder

    def ended():
        recorder.look()
        return recorder.file == ""

    assert not ended()
    recorder.toggle()
    until(ended)
    assert [each.split()[0] for each in told] == ["recording", "recorded"]


def test_the_end_of_the_console_ends_it_as_well(recorder):
    recorder, told = recorder
    recorder.close()
    recorder.look()
    assert recorder.file == ""
    assert told[-1].startswith("recorded ")
