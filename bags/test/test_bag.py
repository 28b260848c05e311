"""Bags: written, read by others, recovered after a kill, refused when they are none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from synthetic import TICK_NS, glide_messages

from cassie_bags.bag.continuity import differences, gaps
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import (
    GROUND_TRUTH_TOPIC,
    LANE_TOPICS,
    RECORDED_TOPICS,
    from_messages,
    read_recording,
)
from cassie_bags.bag.recording import TYPES as RECORDED_TYPES
from cassie_bags.bag.recover import recover
from cassie_bags.bag.writer import CHUNK_NS, QOS_LANE, BagWriter
from cassie_bags.errors import BagError
from cassie_msgs.layout import RobotState
from cassie_msgs.standard_messages import ODOMETRY
from cassie_sim import ground_truth, segway_truth

TYPES = {topic: kind.TYPE for topic, kind in LANE_TOPICS.items()} | {
    GROUND_TRUTH_TOPIC: ODOMETRY.type
}


def write_bag(path: Path, messages: dict[str, list[bytes]]) -> None:
    with BagWriter(path) as bag:
        write_messages(bag, messages)


def write_messages(bag: BagWriter, messages: dict[str, list[bytes]]) -> None:
    bag.add_metadata("cassie_experiment", {"seed": "7"})
    channels = {topic: bag.add_topic(topic, TYPES[topic], QOS_LANE) for topic in messages}
    ticks = len(messages[RobotState.TOPIC])
    for tick in range(ticks):
        for topic, list_ in messages.items():
            every = -(-ticks // max(1, len(list_)))
            if tick % every == 0 and tick // every < len(list_):
                bag.write(channels[topic], list_[tick // every], tick * TICK_NS, tick * TICK_NS)


@pytest.fixture(scope="module")
def messages() -> dict[str, list[bytes]]:
    return glide_messages(2.0, yaw_rate=0.2)


@pytest.fixture
def bag(tmp_path: Path, messages: dict[str, list[bytes]]) -> Path:
    path = tmp_path / "bag.mcap"
    write_bag(path, messages)
    return path


def test_a_bag_gives_back_every_message_and_its_metadata(bag: Path, messages):
    recording = read_recording(bag)
    assert differences(recording, from_messages(messages, 1.0), RECORDED_TOPICS) == []
    assert recording.metadata["cassie_experiment"] == {"seed": "7"}
    assert gaps(recording) == []


def test_rosbags_reads_it_by_the_definitions_in_it(bag: Path, messages):
    with AnyReader([bag]) as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        assert counts == {topic: len(list_) for topic, list_ in messages.items()}
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == RobotState.TOPIC:
                sample = RobotState()
                sample.load(raw)
                np.testing.assert_array_equal(message.q, sample.q)
                assert message.seq == sample.seq
                assert message.stamp.nanosec == sample.stamp_ns % 1_000_000_000
            if connection.topic == GROUND_TRUTH_TOPIC:
                assert message.header.frame_id == "odom"
                assert message.twist.twist.linear.x == pytest.approx(0.5)


def test_it_says_that_it_is_ros_2_and_under_which_qos_it_was_sent(bag: Path):
    with bag.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        for schema in summary.schemas.values():
            assert schema.encoding == "ros2msg"
    with AnyReader([bag]) as reader:
        for connection in reader.connections:
            assert connection.ext.offered_qos_profiles[0].reliability.name == "RELIABLE"


def test_no_chunk_spans_more_than_half_a_second(bag: Path):
    with bag.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    spans = [chunk.message_end_time - chunk.message_start_time for chunk in summary.chunk_indexes]
    assert len(spans) == 4
    assert max(spans) < CHUNK_NS


def test_a_chunk_also_ends_after_half_a_second_of_wall_time(tmp_path: Path, messages):
    path = tmp_path / "slow.mcap"
    bag = BagWriter(path)
    channel = bag.add_topic(RobotState.TOPIC, RobotState.TYPE)
    bag.write(channel, messages[RobotState.TOPIC][0], 0, 1_000)
    size = path.stat().st_size
    bag.flush_if_due(400_000_000)
    assert path.stat().st_size == size
    bag.flush_if_due(500_001_000)
    assert path.stat().st_size > size
    bag.close()


def test_a_closed_bag_can_be_closed_again(tmp_path: Path):
    bag = BagWriter(tmp_path / "empty.mcap")
    bag.close()
    bag.close()


@pytest.mark.parametrize("cut", [1, 100, 5000, 60000])
def test_recovery_saves_every_whole_chunk(tmp_path: Path, bag: Path, messages, cut: int):
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(bag.read_bytes()[:-cut])
    saved = recover(torn, tmp_path / "saved.mcap")
    assert not saved.complete
    assert saved.duration >= 2.0 - 3 * 0.5
    with AnyReader([tmp_path / "saved.mcap"]) as reader:
        assert reader.message_count == saved.messages
    recording = read_recording(tmp_path / "saved.mcap")
    assert gaps(recording) == []
    assert recording.metadata["cassie_experiment"] == {"seed": "7"}


def test_recovery_of_a_whole_bag_changes_nothing(tmp_path: Path, bag: Path, messages):
    saved = recover(bag, tmp_path / "copy.mcap")
    assert saved.complete
    assert saved.messages == sum(map(len, messages.values()))
    assert (
        differences(read_recording(bag), read_recording(tmp_path / "copy.mcap"), RECORDED_TOPICS)
        == []
    )


def test_a_killed_writer_loses_at_most_half_a_second(tmp_path: Path):
    path = tmp_path / "killed.mcap"
    script = """
import sys, time
from pathlib import Path
from cassie_bags.bag.writer import BagWriter
from cassie_msgs.layout import RobotState
bag = BagWriter(Path(sys.argv[1]))
channel = bag.add_topic(RobotState.TOPIC, RobotState.TYPE)
sample = RobotState()
for seq in range(1000):
    sample.seq[...] = seq
    bag.write(channel, sample.to_bytes(), seq * 2_000_000, seq * 2_000_000)
print("ready", flush=True)
time.sleep(60)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        [sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, env=environment
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        process.send_signal(signal.SIGKILL)
    saved = recover(path, tmp_path / "saved.mcap")
    assert saved.messages >= 750
    assert gaps(read_recording(tmp_path / "saved.mcap")) == []


def test_what_is_no_bag_is_refused(tmp_path: Path, bag: Path):
    text = tmp_path / "text.mcap"
    text.write_text("no bag")
    with pytest.raises(BagError, match="is not an MCAP file"):
        read_recording(text)
    with pytest.raises(BagError, match="is not an MCAP file"):
        recover(text, tmp_path / "out.mcap")
    with pytest.raises(BagError, match="No such file"):
        read_recording(tmp_path / "none.mcap")
    with pytest.raises(BagError, match="onto itself"):
        recover(bag, bag)
    start = tmp_path / "start.mcap"
    start.write_bytes(bag.read_bytes()[:200])
    with pytest.raises(BagError, match="no whole chunk"):
        recover(start, tmp_path / "out.mcap")
    with pytest.raises(BagError, match="cannot write bag"):
        BagWriter(text / "bag.mcap")


def test_an_unknown_message_type_is_refused_with_its_name(tmp_path: Path):
    with BagWriter(tmp_path / "x.mcap") as bag:
        with pytest.raises(BagError, match="nav_msgs/msg/Odometr is not installed"):
            bag.add_topic("/x", "nav_msgs/msg/Odometr")
        with pytest.raises(BagError, match="not of the form package/msg/Name"):
            bag.add_topic("/x", "Odometry")


def test_a_missing_sample_is_a_gap_and_a_repeated_one_is_not(messages):
    short = {topic: list(list_) for topic, list_ in messages.items()}
    del short[RobotState.TOPIC][100:103]
    short["/cassie/mode"].pop(4)
    short[GROUND_TRUTH_TOPIC].pop(50)
    short["/cassie/motor_command"].insert(7, short["/cassie/motor_command"][6])
    assert gaps(from_messages(short, 1.0)) == [
        "/cassie/state: 3 samples missing in episode 1, first after seq 99",
        "/cassie/mode: 1 samples missing in episode 1, first after seq 30",
        "/cassie/ground_truth: 1 samples missing",
    ]


def test_a_recording_that_begins_late_has_a_gap(messages):
    late = {topic: list_[1:] for topic, list_ in messages.items()}
    assert "/cassie/sensors: episode 1 begins with seq 1" in gaps(from_messages(late, 1.0))
    assert gaps(from_messages(late, 1.0), from_start=False) == []


def test_one_changed_bit_is_a_difference(messages):
    changed = {topic: list(list_) for topic, list_ in messages.items()}
    raw = bytearray(changed["/cassie/motor_command"][300])
    raw[40] ^= 1
    changed["/cassie/motor_command"][300] = bytes(raw)
    one, other = from_messages(messages, 1.0), from_messages(changed, 1.0)
    assert differences(one, other, RECORDED_TOPICS) == [
        "/cassie/motor_command: 1 of 1000 differ, first sample 300"
    ]


def test_types_of_topics_are_known_after_reading(bag: Path):
    index = BagIndex()
    count = sum(1 for _ in read_messages(bag, ["/cassie/state"], index))
    assert count == 1000
    assert index.types["/cassie/state"] == "cassie_msgs/msg/RobotState"
    assert index.complete


def test_the_true_pose_is_looked_for_where_the_simulator_puts_it():
    assert ground_truth.TOPIC == GROUND_TRUTH_TOPIC
    assert segway_truth.TYPES.items() <= RECORDED_TYPES.items()
