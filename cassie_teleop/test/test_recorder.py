"""The console's recorder, with a program in the place of `record`."""

import time
from concurrent.futures import Future

import pytest
from std_srvs.srv import SetBool

from cassie_teleop.ros import recorder as module
from cassie_teleop.ros.recorder import Recorder, RecorderService

DEAF_ONCE = """#!/usr/bin/env python3
import pathlib, signal, sys, time

heard = []
signal.signal(signal.SIGINT, lambda *_: heard.append(1))
pathlib.Path(sys.argv[2]).touch()
while len(heard) < 2:
    time.sleep(0.01)
"""


class NoRecorder:
    """A `RecorderService` without a recorder."""

    available, file = False, ""


class Service:
    """A recorder's service that answers at once, as `cassie_bags record` does."""

    def __init__(self, bag="/tmp/some folder/drive.mcap"):
        self.ready, self.bag, self.calls, self.recording = True, bag, [], False

    def create_client(self, kind, name):
        assert name == "/recorder/record"
        return self

    def service_is_ready(self):
        return self.ready

    def call_async(self, request):
        self.calls.append(request.data)
        refused = request.data == self.recording
        if request.data:
            message = f"{self.bag} is being recorded" if refused else f"recording to {self.bag}"
        else:
            message = "nothing is being recorded" if refused else "recorded 3 messages of 1 topics"
        self.recording = request.data
        future = Future()
        future.set_result(SetBool.Response(success=not refused, message=message))
        return future


@pytest.fixture
def recorder(tmp_path, monkeypatch):
    """One whose program does not hear the first Ctrl-C, and what it tells."""
    program = tmp_path / "record"
    program.write_text(DEAF_ONCE, encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(module, "_program", lambda: program)
    told = []
    recorder = Recorder(tmp_path / "bags", told.append, NoRecorder())
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
    recorder = Recorder(tmp_path / "bags", told.append, NoRecorder())
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


def test_a_recorder_that_runs_is_asked_by_its_service(tmp_path):
    node, told = Service(), []
    recorder = Recorder(tmp_path, told.append, RecorderService(node, told.append))
    assert recorder.available
    recorder.toggle()
    assert (recorder.file, told[-1]) == ("drive.mcap", "recording to /tmp/some folder/drive.mcap")
    recorder.toggle()
    assert recorder.file == ""
    assert told[-1].startswith("recorded 3 messages")
    assert node.calls == [True, False]


def test_a_recording_begun_elsewhere_is_shown_and_can_be_ended(tmp_path):
    node, told = Service(), []
    node.recording = True
    recorder = Recorder(tmp_path, told.append, RecorderService(node, told.append))
    recorder.toggle()
    assert recorder.file == "drive.mcap"
    recorder.toggle()
    assert node.calls == [True, False] and recorder.file == ""


def test_a_recorder_that_is_gone_records_no_more(tmp_path):
    node, told = Service(), []
    recorder = Recorder(tmp_path, told.append, RecorderService(node, told.append))
    recorder.toggle()
    node.ready = False
    recorder.look()
    assert recorder.file == "" and told[-1] == "the recorder is gone"


def test_without_a_recorder_the_radio_says_how_to_start_one():
    node, told = Service(), []
    node.ready = False
    RecorderService(node, told.append).record(True)
    assert not node.calls and "record --start-paused" in told[-1]
