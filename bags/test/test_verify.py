"""Replay of a bag through the cores: the same bits, and the first bit that differs."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from mcap.reader import make_reader
from rclpy.serialization import serialize_message
from synthetic import TICK_NS

from cassie_bags.bag.definitions import definition
from cassie_bags.bag.node_events import EVENTS_TOPIC, RecordedEvent, read_event
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import TYPES
from cassie_bags.bag.rosbag2 import QOS_LANE
from cassie_bags.bag.writer import BagWriter
from cassie_bags.cli.verify import main
from cassie_bags.errors import BagError
from cassie_bags.run.bag_observer import bag_observer
from cassie_bags.run.cores import connect, make_cores, make_loop
from cassie_bags.run.experiment import Experiment, packaged_folder, parse_experiment
from cassie_bags.run.recorded_lane import SECTIONS
from cassie_bags.run.seed import resolve
from cassie_bags.run.verify import Replayed, Verification, _file, verify
from cassie_control.learning.torque_table import path_for_library
from cassie_gaits.gait_library_file import default_library_path
from cassie_msgs.layout import Mode, MotorCommand, RobotState, Sample, Sensors
from cassie_msgs.msg import NodeEvent

WALK = """
duration: 4.0
seed: 2
drawn: false
start: standing
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.95}
  - {t: 0.6, mode: walk, vx: 0.3}
"""
TICKS = 2000
KILLED = 450
FIELDS: Mapping[str, tuple[str, type[Sample]]] = {
    "state_estimator": ("estimator", RobotState),
    "mode_supervisor": ("supervisor", Mode),
    "gait_controller": ("controller", MotorCommand),
}
"""Field of `Cores` and type of the messages, by node."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walk") / "bag.mcap"
    experiment = resolve(parse_experiment(WALK, "walk"))
    with bag_observer(path, experiment) as observer:
        loop = make_loop(experiment, observer)
        for _ in range(TICKS):
            loop.tick()
    return path


def altered(bag: Path, path: Path, change) -> Path:
    """A copy of a bag whose messages a function changes; None leaves one out."""
    writer = BagWriter(path)
    index = BagIndex()
    messages = list(read_messages(bag, TYPES, index))
    for name, content in index.metadata.items():
        writer.add_metadata(name, content)
    channels = {topic: writer.add_topic(topic, kind, QOS_LANE) for topic, kind in TYPES.items()}
    for topic, robot, wall, raw in messages:
        changed = change(topic, raw)
        if changed is not None:
            writer.write(channels[topic], changed, robot, wall)
    writer.close()
    return path


def test_a_bag_gives_the_same_bits_again(bag: Path, capsys: pytest.CaptureFixture[str]):
    found = verify(bag)
    assert {topic: len(each.recorded) for topic, each in found.replayed.items()} == {
        RobotState.TOPIC: TICKS,
        Mode.TOPIC: TICKS // 10,
        MotorCommand.TOPIC: TICKS,
    }
    assert found.differences == []
    assert found.gaps == []
    assert main([str(bag)]) == 0
    assert capsys.readouterr().out.count("identical") == 3


SHIPPED = sorted((packaged_folder() / "recordings").glob("*.mcap"))


def test_bags_are_shipped_and_stay_small():
    assert len(SHIPPED) >= 3
    assert sum(path.stat().st_size for path in SHIPPED) < 15e6


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_bags_give_the_same_bits_again(path: Path):
    found = verify(path)
    assert found.compared > 3000
    assert found.gaps == []
    assert found.holds, found.differences


def test_one_bit_is_found_with_its_place_and_both_values(bag: Path, tmp_path: Path):
    state = RobotState()

    def change(topic: str, raw: bytes) -> bytes:
        if topic != RobotState.TOPIC:
            return raw
        state.load(raw)
        if state.seq == 700:
            state.q[3] = np.nextafter(state.q[3], 1.0)
        return state.to_bytes()

    path = altered(bag, tmp_path / "bag.mcap", change)
    first = verify(path).differences[0]
    assert (first.topic, first.field, first.tick) == (RobotState.TOPIC, "q.yaw", 700)
    assert first.time == pytest.approx(1.4)
    assert first.values[0] == np.nextafter(first.values[1], 1.0)
    assert main([str(path)]) == 1


def test_a_gain_changed_by_a_millionth_is_found_where_it_first_matters(bag: Path):
    found = verify(bag, ["controller.walk.joints.kp_knee=549.000549"])
    states, modes, commands = found.replayed.values()
    assert states.different_count() == modes.different_count() == 0
    (first,) = found.differences
    walks = np.flatnonzero(np.isclose(commands.recorded["kp"], 549.0).any(axis=1))
    assert first.tick == commands.recorded["seq"][walks[0]]


def test_a_message_that_is_missing_is_named_and_nothing_is_compared_after_it(
    bag: Path, tmp_path: Path
):
    sample = Sensors()

    def change(topic: str, raw: bytes) -> bytes | None:
        if topic == Sensors.TOPIC:
            sample.load(raw)
            return None if sample.seq == 500 else raw
        return raw

    found = verify(altered(bag, tmp_path / "bag.mcap", change))
    assert len(found.replayed[RobotState.TOPIC].recorded) == 500
    assert len(found.replayed[MotorCommand.TOPIC].recorded) == TICKS
    assert any("sensor sample of tick 500" in gap for gap in found.gaps)
    assert found.differences == []


@pytest.mark.parametrize("chunk", [2, 4, 6])
def test_a_damaged_chunk_is_a_gap_of_each_node_and_no_difference(
    bag: Path, tmp_path: Path, chunk: int
):
    with bag.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    damaged, content = summary.chunk_indexes[chunk], bytearray(bag.read_bytes())
    content[damaged.chunk_start_offset + damaged.chunk_length // 2] ^= 4
    (tmp_path / "bag.mcap").write_bytes(content)
    found = verify(tmp_path / "bag.mcap")
    assert found.differences == []
    assert found.compared > 400
    assert {gap.partition(":")[0] for gap in found.gaps} == set(SECTIONS)
    assert "bytes could not be read" in found.damage


def test_a_bag_that_was_cut_is_said_to_be(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    content = bag.read_bytes()
    (tmp_path / "bag.mcap").write_bytes(content[: len(content) // 2])
    assert main([str(tmp_path / "bag.mcap")]) == 0
    shown = capsys.readouterr()
    assert shown.out.count("identical") == 3
    assert shown.err == "replay --verify: {} is {}\n".format(
        tmp_path / "bag.mcap", verify(tmp_path / "bag.mcap").damage
    )


def test_a_bag_with_other_fields_of_its_topics_is_refused(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def exchanged(kind: str) -> str:
        text = definition(kind)
        return re.sub(r"\bv([xy])\b", r"v_\1", text) if kind == Mode.TYPE else text

    monkeypatch.setattr("cassie_bags.bag.writer.definition", exchanged)
    path = altered(bag, tmp_path / "bag.mcap", lambda topic, raw: raw)
    assert main([str(path)]) == 2
    assert "/cassie/mode cannot be read" in capsys.readouterr().err


def test_a_node_that_was_silent_is_named_with_the_ticks_that_it_did_not_answer(
    bag: Path, tmp_path: Path
):
    command = MotorCommand()

    def change(topic: str, raw: bytes) -> bytes | None:
        if topic == MotorCommand.TOPIC:
            command.load(raw)
            return None if 800 <= command.seq < 1200 else raw
        return raw

    found = verify(altered(bag, tmp_path / "bag.mcap", change))
    (gap,) = found.gaps
    assert gap.startswith("gait_controller: no message for 400 samples, from tick 800 ")
    assert gap.endswith("to tick 1199")


def test_a_recording_that_began_after_the_robot_is_refused_with_its_gaps(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    samples = {kind.TOPIC: kind() for kind in (Sensors, RobotState, Mode, MotorCommand)}

    def change(topic: str, raw: bytes) -> bytes | None:
        if topic not in samples:
            return raw
        samples[topic].load(raw)
        return raw if samples[topic].seq >= 500 else None

    path = altered(bag, tmp_path / "bag.mcap", change)
    assert main([str(path)]) == 2
    shown = capsys.readouterr()
    assert shown.out.count("none could be replayed") == 3
    assert "identical" not in shown.out
    assert "gait_controller: 1500 messages not followed, from tick 500" in shown.out
    assert shown.err.endswith("nothing could be verified\n")


def test_another_controller_on_the_same_data_becomes_a_picture(bag: Path, tmp_path: Path):
    picture = tmp_path / "other.png"
    words = ["--with", "controller.walk.joints.kp_knee=500", "--plot", str(picture)]
    assert main([str(bag), *words]) == 0
    assert picture.stat().st_size > 20_000


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--plot", "keep.png"], "keep.png exists: give another file with --plot"),
        (["--with", "controller.walk.joints.kp_knee=500"], "replay.png exists"),
        (["--plot", "keep.jpg"], "keep.jpg does not end in .png"),
        (["--plot", "nowhere/keep.png"], "there is no folder nowhere"),
    ],
)
def test_a_picture_is_refused_before_any_work_and_never_over_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch, words: list[str], reason: str
):
    for name in ("keep.png", "replay.png"):
        (tmp_path / name).write_text("mine")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("cassie_bags.run.verify.verify", lambda *_: pytest.fail("it worked"))
    try:
        code = main([str(SHIPPED[0]), *words])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    assert reason in capsys.readouterr().err
    assert {path.read_text() for path in tmp_path.iterdir()} == {"mine"}
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--with", "plant.mass=1"], "plant is not replayed"),
        (["--with", "controller.walk.nothing=1"], "walk.nothing"),
        (["--with", "controller.walk.joints.kp_knee=-1"], "kp_knee = -1"),
        (["--gaits", "/nowhere.json"], "/nowhere.json"),
        (["--with", "controller=5"], "controller = 5 is not a mapping"),
        (["--with", "supervisor=[]"], "supervisor = [] is not a mapping"),
    ],
)
def test_what_cannot_be_replayed_is_one_line(
    bag: Path, capsys: pytest.CaptureFixture[str], words: list[str], reason: str
):
    assert main([str(bag), *words]) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1


def test_a_bag_that_does_not_tell_its_parameters_is_refused(bag: Path, tmp_path: Path):
    path = tmp_path / "bag.mcap"
    writer = BagWriter(path)
    channels = {topic: writer.add_topic(topic, kind, QOS_LANE) for topic, kind in TYPES.items()}
    for topic, robot, wall, raw in read_messages(bag, TYPES):
        writer.write(channels[topic], raw, robot, wall)
    writer.close()
    with pytest.raises(BagError, match="does not say with which parameters"):
        verify(path)


def test_a_bag_without_the_robot_is_refused(tmp_path: Path):
    writer = BagWriter(tmp_path / "empty.mcap")
    writer.close()
    with pytest.raises(BagError, match="neither states nor motor commands"):
        verify(tmp_path / "empty.mcap")


def test_bits_count_and_not_values():
    rows = np.zeros(
        3, [("sec", "i4"), ("nanosec", "u4"), ("episode", "u4"), ("seq", "u8"), ("x", "f8")]
    )
    rows["x"] = [np.nan, 0.0, 1.0]
    same, other = rows.copy(), rows.copy()
    other["x"][1] = -0.0
    assert Replayed(rows, same).first_difference("t") is None
    assert Replayed(rows, other).different_count() == 1


class Replaced:
    """A core whose process ends at a tick, once it has answered, and another one that answers too.

    Args:
        old, new: The core before and after.
        tick: The tick that both answer.
        end: Is called with the old one's answer.
    """

    def __init__(self, old: Any, new: Any, tick: int, end: Callable[[Sample], None]) -> None:
        self._core, self._old, self._new = old, old, new
        self._tick, self._end = tick, end

    @property
    def status(self) -> Any:
        return self._core.status

    def reset(self) -> None:
        self._core.reset()

    def step(self, sample: Sample, *others: Sample) -> Any:
        if int(sample.seq) == self._tick:
            self._end(self._old.step(sample, *others))
            self._core = self._new
            self._new.reset()
        return self._core.step(sample, *others)


def _began(experiment: Experiment, node: str, tick: int) -> bytes:
    """A node's event at its start, serialized."""
    gaits = default_library_path()
    content = {
        "parameters": {**experiment.parameters[SECTIONS[node]], "control_rate": 500},
        "files": {
            "gait_library": {"path": str(gaits)},
            "learned_torques_file": {"path": str(path_for_library(gaits))},
        },
    }
    event = NodeEvent(episode=0, seq=tick, node=node, event="began", content=json.dumps(content))
    raw: bytes = serialize_message(event)
    return raw


def restarted(
    path: Path, node: str, *, answers: tuple[bool, bool] = (False, True), delay: float = 0.0
) -> Path:
    """A bag of a walk in which a node is killed at `KILLED` and started again two seconds later.

    Args:
        path: The bag.
        node: The node.
        answers: Whether the recorder received the answers of the old and of the new process to this
            tick: a process may die while it publishes, and what a new one publishes at once may
            come before the recorder has found it.
        delay: How much later than its first answer the node's start is received. In s.
    """
    experiment = resolve(parse_experiment(WALK, "walk"))
    writer = BagWriter(path)
    types = {**TYPES, EVENTS_TOPIC: "cassie_msgs/msg/NodeEvent"}
    channels = {topic: writer.add_topic(topic, kind, QOS_LANE) for topic, kind in types.items()}
    cores, others = make_cores(experiment), make_cores(experiment)
    field, kind = FIELDS[node]
    wall = {"now": 1_700_000_000_000_000_000}  # ns

    def event(name: str, tick: int) -> None:
        raw = _began(experiment, name, tick)
        received = wall["now"] + round(1e9 * delay)
        writer.write(channels[EVENTS_TOPIC], raw, tick * TICK_NS, received)

    def observe(topic: str, raw: bytes, stamp: int) -> None:
        wall["now"] += 100_000
        lost = topic == kind.TOPIC and stamp == KILLED * TICK_NS and not answers[1]
        if topic in channels and not lost:
            writer.write(channels[topic], raw, stamp, wall["now"])

    def end(answer: Sample) -> None:
        if answers[0]:
            writer.write(channels[kind.TOPIC], answer.to_bytes(), KILLED * TICK_NS, wall["now"])
        wall["now"] += 2_000_000_000
        event(node, KILLED)

    replaced = Replaced(getattr(cores, field), getattr(others, field), KILLED, end)
    loop = connect(replace(cores, **{field: replaced}), observe)
    for name in SECTIONS:
        event(name, 0)
    for _ in range(TICKS // 2):
        loop.tick()
    writer.close()
    return path


@pytest.mark.parametrize(
    ("node", "answers"),
    [
        (node, answers)
        for node in ("state_estimator", "mode_supervisor", "gait_controller")
        for answers in ((True, True), (True, False), (False, True), (False, False))
        if node == "gait_controller" or answers[1]  # else the controller cannot be followed
    ],
)
def test_a_node_that_was_replaced_while_it_answered_is_followed_through(
    tmp_path: Path, node: str, answers: tuple[bool, bool]
):
    found = verify(restarted(tmp_path / "bag.mcap", node, answers=answers))
    assert found.differences == []
    assert found.gaps == []
    assert found.compared >= 2 * TICKS // 2


@pytest.mark.parametrize("node", FIELDS)
def test_a_start_of_which_the_recorder_hears_late_is_a_start_all_the_same(
    tmp_path: Path, node: str
):
    found = verify(restarted(tmp_path / "bag.mcap", node, delay=0.5))
    assert found.differences == []
    assert found.gaps == []


def with_losses(path: Path, node: str, ticks: range, lost: int) -> Path:
    """A bag of a walk without a node's answers to some ticks, of which so many count as lost."""
    experiment = resolve(parse_experiment(WALK, "walk"))
    writer = BagWriter(path)
    types = {**TYPES, EVENTS_TOPIC: "cassie_msgs/msg/NodeEvent"}
    channels = {topic: writer.add_topic(topic, kind, QOS_LANE) for topic, kind in types.items()}
    _, kind = FIELDS[node]

    def observe(topic: str, raw: bytes, stamp: int) -> None:
        tick = stamp // TICK_NS
        if topic == kind.TOPIC and tick in ticks:
            return
        if topic in channels:
            count = lost if topic == kind.TOPIC and tick >= ticks.stop else 0
            writer.write(channels[topic], raw, stamp, stamp, count)

    loop = connect(make_cores(experiment), observe)
    for name in SECTIONS:
        writer.write(channels[EVENTS_TOPIC], _began(experiment, name, 0), 0, 0)
    for _ in range(TICKS // 4):
        loop.tick()
    writer.close()
    return path


@pytest.mark.parametrize("node", ["state_estimator", "gait_controller"])
def test_answers_that_the_recorder_lost_are_computed_all_the_same(tmp_path: Path, node: str):
    found = verify(with_losses(tmp_path / "bag.mcap", node, range(301, 312), 11))
    assert found.differences == []
    assert not any(gap.startswith(node) for gap in found.gaps)
    assert len(found.replayed[FIELDS[node][1].TOPIC].recorded) == TICKS // 4 - 11


@pytest.mark.parametrize("node", FIELDS)
def test_where_some_answers_were_lost_and_some_never_given_nothing_is_compared(
    tmp_path: Path, node: str
):
    step = 10 if node == "mode_supervisor" else 1
    ticks = range(300 + step, 300 + 12 * step)
    found = verify(with_losses(tmp_path / "bag.mcap", node, ticks, 4))
    assert found.differences == []
    gap, *rest = (gap for gap in found.gaps if gap.startswith(node))
    assert f"4 messages from tick {ticks[0]} of episode 0 to tick {300 + 11 * step}" in gap
    assert gap.endswith("and which is not known; followed again from its next start")
    assert "a message before, is not in the bag" in " ".join(rest)


def test_a_node_that_skips_samples_is_followed_and_a_false_claim_of_it_is_found(tmp_path: Path):
    found = verify(with_losses(tmp_path / "bag.mcap", "state_estimator", range(301, 312), 0))
    (first,) = found.differences
    assert (first.topic, first.tick) == (RobotState.TOPIC, 312)


def test_an_event_is_read_as_ros_writes_it():
    message = NodeEvent(
        stamp=Time(sec=1, nanosec=2),
        episode=7,
        seq=2**40,
        node="gait_controller",
        event="mode",
        content='{"effective_seq": 30}',
    )
    raw = serialize_message(message)
    expected = RecordedEvent(7, 2**40, "gait_controller", "mode", {"effective_seq": 30})
    assert read_event(raw) == expected
    for length in range(len(raw) - 4):
        with pytest.raises(BagError, match=EVENTS_TOPIC):
            read_event(raw[:length])


def test_a_gait_library_is_known_by_its_hash_wherever_it_is(tmp_path: Path):
    """Beside the bag, or in it."""
    content = default_library_path().read_bytes()
    (tmp_path / "mine.json").write_bytes(content)
    expected = hashlib.sha256(content).hexdigest()
    described = {"path": "/gone/mine.json", "sha256": expected}
    folder, bag = tmp_path / "folder", tmp_path / "bag.mcap"
    folder.mkdir()
    writer = BagWriter(bag)
    writer.add_file(f"{expected}/mine.json", content)
    writer.close()
    assert _file(described, bag, folder) == tmp_path / "mine.json"
    (tmp_path / "mine.json").write_text("changed")
    assert _file(described, bag, folder) == folder / "mine.json"
    assert (folder / "mine.json").read_bytes() == content
    with pytest.raises(BagError, match=r"/gone/mine\.json is not as it was"):
        _file({**described, "sha256": "0" * 64}, bag, folder)


def test_with_other_libraries_the_first_seconds_are_held_to_a_tolerance(bag: Path):
    found = verify(bag)
    assert found.environment_changes == []
    commands = found.replayed[MotorCommand.TOPIC]
    off = {
        **found.replayed,
        MotorCommand.TOPIC: Replayed(commands.recorded, commands.computed.copy()),
    }
    elsewhere = Verification(off, [], ["numpy 1, recorded 2"])
    torque = off[MotorCommand.TOPIC].computed["torque"]
    torque[100, 0] = np.nextafter(torque[100, 0], 1e3)
    assert elsewhere.differences
    assert elsewhere.holds
    torque[100, 0] += 1e-6
    assert not elsewhere.holds
