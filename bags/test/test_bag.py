"""Bags: written, read by others, recovered after a kill, refused when they are none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from same import differences
from synthetic import TICK_NS, glide_messages

from cassie_bags.bag.continuity import SeqMonitor, gaps
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import (
    GAIT_TOPICS,
    GROUND_TRUTH_TOPIC,
    LANE_TOPICS,
    from_messages,
    read_recording,
)
from cassie_bags.bag.recording import TYPES as RECORDED_TYPES
from cassie_bags.bag.recover import recover
from cassie_bags.bag.rosbag2 import QOS_LANE
from cassie_bags.bag.summary import summarize
from cassie_bags.bag.writer import CHUNK_NS, BagWriter, FolderWriter
from cassie_bags.errors import BagError
from cassie_msgs.layout import RobotState, Sensors
from cassie_msgs.standard_messages import ODOMETRY
from cassie_sim import ground_truth, segway_truth

TYPES = {topic: kind.TYPE for topic, kind in {**LANE_TOPICS, **GAIT_TOPICS}.items()} | {
    GROUND_TRUTH_TOPIC: ODOMETRY.type
}


def write_bag(path: Path, messages: dict[str, list[bytes]]) -> None:
    with BagWriter(path) as bag:
        write_messages(bag, messages)


def write_messages(
    bag: BagWriter | FolderWriter, messages: dict[str, list[bytes]], stride: int = 1
) -> None:
    """Write them as they come; only those of every so many ticks."""
    bag.add_metadata("cassie_experiment", {"seed": "7"})
    channels = {topic: bag.add_topic(topic, TYPES[topic], QOS_LANE) for topic in messages}
    ticks = len(messages[RobotState.TOPIC])
    for tick in range(0, ticks, stride):
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
    assert differences(recording, from_messages(messages, 1.0), RECORDED_TYPES) == []
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
    assert len(spans) == 10
    assert max(spans) < CHUNK_NS


def test_no_chunk_spans_more_where_messages_come_out_of_order(tmp_path: Path, messages):
    path = tmp_path / "bag.mcap"
    with BagWriter(path) as bag:
        channel = bag.add_topic(RobotState.TOPIC, RobotState.TYPE)
        for tick in range(1000):
            early = 30_000_000 if tick % 10 == 5 else 0
            raw = messages[RobotState.TOPIC][tick]
            bag.write(channel, raw, 10**9 + tick * TICK_NS - early, tick)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    spans = [chunk.message_end_time - chunk.message_start_time for chunk in summary.chunk_indexes]
    assert max(spans) < CHUNK_NS


def test_qos_and_metadata_are_those_of_rosbag2_version_9(bag: Path, tmp_path: Path):
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(bag.read_bytes()[:-5000])
    recover(torn, tmp_path / "saved.mcap")
    for path in (bag, tmp_path / "saved.mcap"):
        with path.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            assert summary is not None and summary.statistics is not None
            records = [each.metadata for each in reader.iter_metadata() if each.name == "rosbag2"]
        assert len(records) == 1
        said = yaml.safe_load(records[0]["serialized_metadata"])
        assert (said["version"], said["storage_identifier"]) == (9, "mcap")
        assert said["message_count"] == summary.statistics.message_count
        counts = {
            each["topic_metadata"]["name"]: each["message_count"]
            for each in said["topics_with_message_count"]
        }
        for number, channel in summary.channels.items():
            (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert (profile["history"], profile["depth"]) == ("keep_last", 100)
            assert (profile["reliability"], profile["durability"]) == ("reliable", "volatile")
            assert profile["liveliness"] == "automatic"
            assert counts[channel.topic] == summary.statistics.channel_message_counts[number]


def test_a_folder_of_files_is_a_bag_of_rosbag2(tmp_path: Path, messages):
    folder = tmp_path / "walk"
    writer = FolderWriter(folder, max_duration=500_000_000)
    write_messages(writer, messages)
    writer.close()
    assert sorted(path.name for path in folder.iterdir()) == [
        "metadata.yaml",
        *(f"walk_{number}.mcap" for number in range(4)),
    ]
    with AnyReader([folder]) as reader:
        assert reader.duration == 1_998_000_001
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        assert counts == writer.counts == {topic: len(each) for topic, each in messages.items()}
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
    assert differences(read_recording(folder), from_messages(messages, 1), RECORDED_TYPES) == []
    for file in folder.glob("*.mcap"):
        assert read_recording(file).metadata["cassie_experiment"] == {"seed": "7"}
    with pytest.raises(BagError, match="exists"):
        FolderWriter(folder)


def test_a_folder_is_split_by_size(tmp_path: Path, messages):
    writer = FolderWriter(tmp_path / "walk", compress=False, max_bytes=500_000)
    write_messages(writer, messages)
    writer.close()
    sizes = [path.stat().st_size for path in (tmp_path / "walk").glob("*.mcap")]
    assert len(sizes) > 2
    assert max(sizes) < 2_000_000


def test_a_folder_that_can_have_no_further_file_lists_those_it_has(tmp_path: Path, messages):
    folder = tmp_path / "walk"
    writer = FolderWriter(folder, compress=False, max_bytes=500_000)
    (folder / "walk_1.mcap").write_bytes(b"")  # another program's
    with pytest.raises(BagError, match=r"walk_1\.mcap exists"):
        write_messages(writer, messages)
    writer.close()
    content = yaml.safe_load((folder / "metadata.yaml").read_text())
    assert content["rosbag2_bagfile_information"]["relative_file_paths"] == ["walk_0.mcap"]


def test_recovery_of_a_folder_saves_each_file(tmp_path: Path, messages):
    folder = tmp_path / "walk"
    writer = FolderWriter(folder, max_duration=900_000_000)
    write_messages(writer, messages)
    writer.close()
    (folder / "metadata.yaml").unlink()
    last = folder / "walk_2.mcap"
    last.write_bytes(last.read_bytes()[:-10_000])
    before = {path: path.read_bytes() for path in folder.iterdir()}
    saved = recover(folder, tmp_path / "saved")
    assert not saved.complete and saved.duration > 1.5
    assert before == {path: path.read_bytes() for path in folder.iterdir()}
    with AnyReader([tmp_path / "saved"]) as reader:
        assert reader.message_count == saved.messages
    assert gaps(read_recording(tmp_path / "saved")) == []


@pytest.mark.parametrize("kind", ["file", "hard link", "symbolic link", "folder", "itself"])
def test_recovery_never_writes_over_what_is_there(tmp_path: Path, bag: Path, kind: str):
    target = bag if kind == "itself" else tmp_path / "there.mcap"
    content = bag.read_bytes()
    if kind == "file":
        target.write_bytes(b"precious")
    elif kind == "hard link":
        target.hardlink_to(bag)
    elif kind == "symbolic link":
        target.symlink_to(bag)
    elif kind == "folder":
        target.mkdir()
    there = None if kind == "folder" else target.read_bytes()
    with pytest.raises(BagError, match="exists"):
        recover(bag, target)
    assert bag.read_bytes() == content
    assert there is None or target.read_bytes() == there


def test_recovery_of_nothing_leaves_nothing(tmp_path: Path, bag: Path):
    start = tmp_path / "start.mcap"
    start.write_bytes(bag.read_bytes()[:200])
    with pytest.raises(BagError, match="nothing to recover"):
        recover(start, tmp_path / "saved.mcap")
    assert not (tmp_path / "saved.mcap").exists()
    with pytest.raises(BagError, match=r"cannot write .*No such file"):
        recover(bag, tmp_path / "none" / "saved.mcap")


def test_a_bag_may_be_named_by_a_word(bag: Path, tmp_path: Path):
    assert len(read_recording(str(bag)).truth) == 1000
    assert recover(str(bag), str(tmp_path / "saved.mcap")).complete
    assert summarize(str(bag)).problems == []


def test_a_chunk_also_ends_after_a_fifth_of_a_second_of_wall_time(tmp_path: Path, messages):
    path = tmp_path / "slow.mcap"
    bag = BagWriter(path)
    channel = bag.add_topic(RobotState.TOPIC, RobotState.TYPE)
    bag.write(channel, messages[RobotState.TOPIC][0], 0, 1_000)
    size = path.stat().st_size
    bag.flush_if_due(200_000_000)
    assert path.stat().st_size == size
    bag.flush_if_due(200_001_000)
    assert path.stat().st_size > size
    bag.close()


def test_a_bag_begins_with_its_first_chunk_also_at_time_0(tmp_path: Path, messages):
    """Its metadata had the time of the second chunk."""
    with BagWriter(tmp_path / "still.mcap") as bag:
        channel = bag.add_topic(RobotState.TOPIC, RobotState.TYPE)
        bag.write(channel, messages[RobotState.TOPIC][0], 0, 1_000)
        bag.flush_if_due(200_001_000)
        bag.write(channel, messages[RobotState.TOPIC][1], 5_000, 300_000_000)
    assert (bag.contents.start, bag.contents.end) == (0, 5_000)


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
        differences(read_recording(bag), read_recording(tmp_path / "copy.mcap"), RECORDED_TYPES)
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


def test_an_answer_that_is_missing_in_real_time_is_a_missed_tick_and_no_gap(messages):
    short = {topic: list(list_) for topic, list_ in messages.items()}
    for at, raw in enumerate(short[Sensors.TOPIC]):
        sample = Sensors()
        sample.load(raw)
        sample.wall_paced[...] = 1
        short[Sensors.TOPIC][at] = sample.to_bytes()
    del short[RobotState.TOPIC][100:103]
    assert gaps(from_messages(short, 1.0)) == seen_as_missing(short) == []
    del short[Sensors.TOPIC][200]
    assert gaps(from_messages(short, 1.0)) == [
        "/cassie/sensors: 1 samples missing in episode 1, first after seq 199"
    ]
    assert seen_as_missing(short) == ["/cassie/sensors: 1 samples"]


def seen_as_missing(messages) -> list[str]:
    """What a recorder of these messages reports as missing."""
    monitor = SeqMonitor()
    for topic, list_ in messages.items():
        for raw in list_:
            monitor.note(topic, raw)
    return monitor.gaps()


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
    assert differences(one, other, RECORDED_TYPES) == [
        "/cassie/motor_command: 1 of 1000 differ, first sample 300"
    ]


def test_types_of_topics_are_known_after_reading(bag: Path):
    index = BagIndex()
    count = sum(1 for _ in read_messages(bag, ["/cassie/state"], index))
    assert count == 1000
    assert index.types["/cassie/state"] == ["cassie_msgs/msg/RobotState"]
    assert index.complete


def test_the_true_pose_is_looked_for_where_the_simulator_puts_it():
    assert ground_truth.TOPIC == GROUND_TRUTH_TOPIC
    assert segway_truth.TYPES.items() <= RECORDED_TYPES.items()


def test_two_channels_of_a_topic_count_apart(tmp_path: Path, messages):
    path, topic = tmp_path / "bag.mcap", RobotState.TOPIC
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema(TYPES[topic], "ros2msg", b"")
        channels = [writer.register_channel(topic, "cdr", schema, {"of": of}) for of in "ab"]
        for number, raw in enumerate(messages[topic][:10]):
            for place, channel in enumerate(channels):
                writer.add_message(channel, number, raw, number, 1 + number + 1000 * place)
        writer.finish()
    index = BagIndex()
    assert len(list(read_messages(path, None, index))) == 20
    assert index.lost == {}


@pytest.mark.parametrize("recovered", [False, True])
def test_the_place_of_lost_messages_stays_in_the_bag(tmp_path: Path, messages, recovered: bool):
    path, topic = tmp_path / "bag.mcap", RobotState.TOPIC
    with BagWriter(path) as bag:
        channel = bag.add_topic(topic, TYPES[topic], QOS_LANE)
        for tick, raw in enumerate(messages[topic][:100]):
            lost = 3 * (tick >= 40) + 2 * (tick >= 70)
            bag.write(channel, raw, tick * TICK_NS, tick * TICK_NS, lost)
    if recovered:
        recover(path, tmp_path / "recovered.mcap")
        path = tmp_path / "recovered.mcap"
    index = BagIndex()
    lost = [index.lost.get(topic, 0) for _ in read_messages(path, None, index)]
    assert lost == [0] * 40 + [3] * 30 + [5] * 30
