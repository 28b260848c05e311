"""The record and replay nodes as processes, on a ROS domain of their own."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from same import differences
from synthetic import glide_messages
from test_bag import write_bag
from test_looking import write_mixed_bag

pytest.importorskip("rclpy")

import rclpy
from builtin_interfaces.msg import Time
from mcap.reader import make_reader
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String, UInt64
from std_srvs.srv import SetBool, Trigger

from cassie_bags.bag.continuity import gaps
from cassie_bags.bag.definitions import definition
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import (
    TYPES,
    Recording,
    from_messages,
    read_recording,
)
from cassie_bags.bag.recover import recover
from cassie_bags.bag.rosbag2 import Qos
from cassie_bags.bag.summary import summarize
from cassie_bags.bag.writer import BagWriter
from cassie_bags.cli import record as record_command
from cassie_bags.cli import replay as replay_command
from cassie_bags.errors import BagError, RunError
from cassie_bags.ros import recorded_topic, replay
from cassie_bags.ros.processes import Processes, environment, executable, own_domain
from cassie_bags.ros.record import COMPLETE
from cassie_bags.ros.recorded_topic import Received, RecordedTopic, message_class
from cassie_msgs.layout import Mode, RobotState, Sensors
from cassie_msgs.ros.fast_lane import WRITER
from cassie_msgs.ros.inbox import Inbox

TIMEOUT = 20.0


@pytest.fixture(scope="module", autouse=True)
def installed() -> None:
    try:
        executable("cassie_bags", "record")
    except RunError as error:
        pytest.skip(str(error))


@pytest.fixture
def domain() -> Iterator[int]:
    with own_domain() as number:
        yield number


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    with Processes(environment(domain), tmp_path / "log") as group:
        yield group


@pytest.fixture
def node(domain: int) -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("test", context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def test_ctrl_c_ends_a_recording_beside_a_robot_that_goes_on(
    node: Node, processes: Processes, tmp_path: Path
) -> None:
    """And nothing in the bag lacks what it answers."""
    topics = ["/cassie/sensors", "/cassie/state", "/cassie/motor_command"]
    publishers = {
        topic: node.create_publisher(message_class(TYPES[topic]), topic, WRITER) for topic in topics
    }
    bag = tmp_path / "bag.mcap"
    processes.start("record", [executable("cassie_bags", "record"), "-o", bag])
    wait_until(lambda: all(each.get_subscription_count() for each in publishers.values()))
    messages = glide_messages(30.0)
    began = time.monotonic()
    ended = False
    for tick in range(len(messages[topics[0]])):
        for topic in topics:
            publishers[topic].publish(messages[topic][tick])
        time.sleep(0.0003)
        if not ended and time.monotonic() > began + 1.0:
            processes.signal("record", signal.SIGINT)
            ended = True
        if not processes.running("record"):
            break
    assert not processes.running("record")
    assert "recorded" in (tmp_path / "log" / "record.log").read_text()
    sensors, states, commands = (
        set(read_recording(bag).lane[topic]["seq"].tolist()) for topic in topics
    )
    assert len(commands) > 100
    assert commands <= states <= sensors


def test_a_busy_machine_does_not_keep_it_from_recording_real_time(
    node: Node, processes: Processes, tmp_path: Path, real_time: bool
) -> None:
    """It runs before ordinary processes while robot time follows the wall clock."""
    if not real_time:
        pytest.skip("needs the permission for real-time scheduling")
    publisher = node.create_publisher(message_class(RobotState.TYPE), RobotState.TOPIC, WRITER)
    processes.start("record", [executable("cassie_bags", "record"), "-o", tmp_path / "bag.mcap"])
    wait_until(lambda: publisher.get_subscription_count() == 1)
    pid = processes.pid("record")
    state = RobotState()
    for wall_paced, policy in ((False, os.SCHED_OTHER), (True, os.SCHED_FIFO)):
        state.wall_paced[...] = wall_paced
        publisher.publish(state.to_bytes())
        wait_until(
            lambda wanted=policy: os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == wanted
        )
    processes.stop("record")
    processes.check("record")


def test_bytes_that_are_no_message_are_left_out_and_the_bag_is_whole(
    node: Node, processes: Processes, tmp_path: Path
) -> None:
    messages = {topic: each[:100] for topic, each in glide_messages(1.0).items()}
    foreign = {
        **{topic: TYPES[topic] for topic in messages},
        "/cassie/supervisor_status": "cassie_msgs/msg/SupervisorStatus",
        "/cassie/node_events": "cassie_msgs/msg/NodeEvent",
        "/clock": "rosgraph_msgs/msg/Clock",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        "/robot_description": "std_msgs/msg/String",
        "/tf": "tf2_msgs/msg/TFMessage",
    }
    publishers = {
        topic: node.create_publisher(message_class(kind), topic, WRITER)
        for topic, kind in foreign.items()
    }
    bag = tmp_path / "bag.mcap"
    processes.start("record", [executable("cassie_bags", "record"), "-o", bag])
    wait_until(lambda: all(each.get_subscription_count() for each in publishers.values()))
    time.sleep(0.5)
    for tick in range(100):
        for topic, publisher in publishers.items():
            if tick < len(messages.get(topic, ())):
                publisher.publish(messages[topic][tick])
            publisher.publish(b"\0\1\0\0" + b"\xff" * (tick % 5))
        time.sleep(0.002)
    time.sleep(0.5)
    processes.stop("record")
    told = processes.log("record").read_text()
    assert "Traceback" not in told and "recorded" in told
    summary = summarize(bag)
    counts = {each.topic: each.count for each in summary.topics}
    for topic in foreign:
        assert counts.get(topic, 0) == len(messages.get(topic, ())), topic
        assert f"left out: {topic}: " in told


def publish_all(node: Node, messages: dict[str, list[bytes]], heard: Callable[[], bool]) -> None:
    """Publish tick by tick, at a few thousand messages a second.

    As the nodes do it, the first sample is repeated until every reader has `heard` it: that a
    writer knows its reader does not mean that the reader knows the writer.
    """
    publishers = {
        topic: node.create_publisher(message_class(kind), topic, WRITER)
        for topic, kind in TYPES.items()
    }
    wait_until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    ticks = len(messages["/cassie/state"])
    deadline = time.monotonic() + TIMEOUT
    while not heard():
        assert time.monotonic() < deadline, "not every topic was heard"
        for topic, list_ in messages.items():
            publishers[topic].publish(list_[0])
        time.sleep(0.1)
    for tick in range(ticks):
        for topic, list_ in messages.items():
            every = -(-ticks // len(list_))
            if tick % every == 0:
                publishers[topic].publish(list_[tick // every])
        if tick % 20 == 0:
            time.sleep(0.005)
    for publisher in publishers.values():
        publisher.wait_for_all_acked()


def start_recorder(processes: Processes, bag: Path, *options: str) -> None:
    processes.start("record", [executable("cassie_bags", "record"), "-o", bag, *options])
    wait_until(
        lambda: processes.printed("record", "recording to") or not processes.running("record")
    )


def same(recording: Recording, messages: dict[str, list[bytes]]) -> list[str]:
    return differences(recording, from_messages(messages, 1.0), TYPES)


def test_the_recorder_loses_nothing_and_closes_its_bag_on_ctrl_c(
    processes: Processes, node: Node, tmp_path: Path
):
    messages = glide_messages(4.0)
    bag = tmp_path / "bag.mcap"
    start_recorder(processes, bag)
    publish_all(node, messages, lambda: processes.printed("record", COMPLETE))
    started = time.monotonic()
    processes.stop("record")
    assert time.monotonic() - started < 2.0
    processes.check("record")
    assert "Traceback" not in processes.log("record").read_text()
    recording = read_recording(bag)
    assert gaps(recording) == []
    assert same(recording, messages) == []
    assert "mujoco" in recording.metadata["cassie_versions"]
    with AnyReader([bag]) as reader:
        assert reader.duration == pytest.approx(4.0e9, rel=0.01)


def late_messages(seconds: float, begin: float) -> dict[str, list[bytes]]:
    """Of a robot that runs since `begin` seconds."""
    messages = {}
    for topic, list_ in glide_messages(begin + seconds).items():
        messages[topic] = list_[round(len(list_) * begin / (begin + seconds)) :]
    return messages


def log_times(bag: Path) -> dict[str, list[int]]:
    """Log times of a bag's messages by topic, in the order in which they were written. In ns."""
    times: dict[str, list[int]] = {}
    for topic, log_time, *_ in read_messages(bag, None):
        times.setdefault(topic, []).append(log_time)
    return times


def test_a_strangers_sample_is_recorded_at_the_robots_time_of_its_receipt(
    processes: Processes, node: Node, tmp_path: Path
):
    bag, messages = tmp_path / "bag.mcap", glide_messages(1.0)
    start_recorder(processes, bag)
    publish_all(node, messages, lambda: processes.printed("record", COMPLETE))
    stranger = node.create_publisher(message_class(Sensors.TYPE), Sensors.TOPIC, WRITER)
    wait_until(lambda: stranger.get_subscription_count() == 1)
    stray = Sensors()
    stray.episode[...], stray.stamp_ns = 2**31, 10**18
    stranger.publish(stray.to_bytes())
    time.sleep(0.5)
    processes.stop("record")
    times = log_times(bag)
    assert max(times[Sensors.TOPIC]) == 998_000_000 == times[Sensors.TOPIC][-1]
    assert max(max(each) for each in times.values()) < 1_100_000_000
    first_ones = times[Sensors.TOPIC].count(0)  # repeated until every reader has heard one
    strays = 1
    assert len(times[Sensors.TOPIC]) == len(set(times[Sensors.TOPIC])) + first_ones - 1 + strays
    assert "1.0" in processes.log("record").read_text().partition(" topics, ")[2]


def clock_message(seconds: float) -> Clock:
    whole, part = divmod(round(seconds * 1e9), 1_000_000_000)
    return Clock(clock=Time(sec=whole, nanosec=part))


def test_a_clock_that_is_reset_or_jumps_keeps_one_time_axis(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    clock, text = node.create_publisher(Clock, "/clock", 100), latched(node)
    start_recorder(processes, bag, "/clock", "/robot_description")
    wait_until(lambda: clock.get_subscription_count() * text.get_subscription_count() == 1)
    for tick in range(200):
        clock.publish(clock_message(tick % 100 * 0.01))
        text.publish(String(data="<robot/>"))
        if tick == 50:
            clock.publish(clock_message(1e9))
        time.sleep(0.01)
    processes.stop("record")
    times = log_times(bag)
    assert len(times["/clock"]) == 201
    for each in times.values():
        assert each == sorted(each)
        assert each[-1] == pytest.approx(2e9, abs=0.1e9)
    assert len(set(times["/robot_description"])) > 190  # each its own, not one of a batch


def test_each_message_without_a_stamp_has_the_times_of_its_own(
    processes: Processes, node: Node, tmp_path: Path
):
    """Not those of the recorder's batch."""
    bag = tmp_path / "bag.mcap"
    publisher = node.create_publisher(String, "/text", 1000)
    start_recorder(processes, bag, "/text")
    wait_until(lambda: publisher.get_subscription_count() == 1)
    sent = []
    for number in range(500):
        publisher.publish(String(data=str(number)))
        sent.append(time.time_ns())
        time.sleep(0.002)
    processes.stop("record")
    rows = [(log, published) for _, log, published, _ in read_messages(bag)]
    assert len(rows) == 500
    assert len({log for log, _ in rows}) == len({published for _, published in rows}) == 500
    errors = [abs(ours - theirs) for ours, (_, theirs) in zip(sent, rows, strict=True)]
    assert sorted(errors)[len(errors) // 2] < 1_000_000


def test_writers_of_every_quality_of_service_are_recorded(
    processes: Processes, node: Node, tmp_path: Path
):
    """Also one that joins later and offers less than the first, and what is latched."""
    bag = tmp_path / "bag.mcap"
    offers = [
        QoSProfile(depth=100),
        QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT),
        QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    ]
    first = node.create_publisher(String, "/text", offers[0])
    start_recorder(processes, bag, "/text")
    wait_until(lambda: first.get_subscription_count() == 1)
    others = [node.create_publisher(String, "/text", offer) for offer in offers[1:]]
    for name in "12":
        others[1].publish(String(data=f"latched {name}"))
    wait_until(lambda: others[0].get_subscription_count() == 1)
    wait_until(lambda: others[1].get_subscription_count() == 3)
    time.sleep(0.5)
    for number in range(300):
        for index, publisher in enumerate((first, *others)):
            publisher.publish(String(data=f"{index} {number}"))
        time.sleep(0.002)
    processes.stop("record")
    assert "lost" not in processes.log("record").read_text()
    texts = [deserialize_message(raw, String).data for *_, raw in read_messages(bag)]
    assert texts[:2] == ["latched 1", "latched 2"]
    expected = {f"{index} {number}" for index in range(3) for number in range(300)}
    assert set(texts[2:]) == expected and len(texts) == len(expected) + 2


def latched(node: Node) -> Any:
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(String, "/robot_description", qos)
    publisher.publish(String(data="<robot name='cassie'/>"))
    return publisher


def test_a_recording_begun_late_begins_at_the_robots_time(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    messages = late_messages(2.0, 30.0)
    publisher = latched(node)
    start_recorder(processes, bag)
    wait_until(lambda: publisher.get_subscription_count() == 1)
    time.sleep(0.5)  # it has the description before anything tells robot time
    publish_all(node, messages, lambda: processes.printed("record", COMPLETE))
    processes.stop("record")
    with AnyReader([bag]) as reader:
        assert reader.topics["/robot_description"].msgcount == 1
        assert reader.start_time == pytest.approx(30e9, abs=0.01e9)
        assert reader.duration == pytest.approx(2e9, abs=0.05e9)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--topics", "/a//b"], "/a//b is no name of a topic"),
        (["/1a"], "/1a is no name of a topic"),
        (["/chatter/"], "/chatter/ is no name of a topic"),
        (["-a", "/chatter"], "--all records every topic: leave out /chatter"),
    ],
)
def test_wrong_topics_of_a_recording_are_named(words: list[str], reason: str, capsys):
    with pytest.raises(SystemExit):
        record_command.parse(words)
    assert reason in capsys.readouterr().err
    parsed = record_command.parse(["chatter", "--topics", "/a/b_1"])
    assert parsed.topics == ["/chatter", "/a/b_1"]


def test_a_topic_that_was_asked_for_and_never_came_is_named(
    processes: Processes, node: Node, tmp_path: Path
):
    publisher = latched(node)
    start_recorder(processes, tmp_path / "bag.mcap", "/robot_description", "/nosuch")
    wait_until(lambda: publisher.get_subscription_count() == 1)
    processes.stop("record")
    printed = processes.log("record").read_text()
    assert "never published: /nosuch" in printed
    assert "never published: /robot_description" not in printed


def test_a_folder_is_recorded_split_and_found_by_other_readers(
    processes: Processes, node: Node, tmp_path: Path
):
    folder = tmp_path / "walk"
    messages = glide_messages(4.0)
    start_recorder(processes, folder, "--max-bag-duration", "1", "--compression-format", "none")
    publish_all(node, messages, lambda: processes.printed("record", COMPLETE))
    processes.stop("record")
    processes.check("record")
    assert sorted(path.name for path in folder.iterdir()) == [
        "metadata.yaml",
        *(f"walk_{number}.mcap" for number in range(4)),
    ]
    assert same(read_recording(folder), messages) == []
    with AnyReader([folder]) as reader:
        assert reader.topics["/cassie/state"].msgcount >= 2000


def call(node: Node, kind: Any, name: str, request: Any) -> Any:
    client = node.create_client(kind, name)
    wait_until(client.service_is_ready)
    future = client.call_async(request)
    wait_until(lambda: spin(node) and future.done())
    return future.result()


def test_a_service_begins_and_ends_recordings(processes: Processes, node: Node, tmp_path: Path):
    bag = tmp_path / "bag.mcap"
    publisher = latched(node)
    record = [executable("cassie_bags", "record"), "-o", bag, "--start-paused"]
    processes.start("record", record)
    service = "/recorder/record"
    assert not call(node, SetBool, service, SetBool.Request(data=False)).success
    for name in ("bag.mcap", "bag_2.mcap", "bag_3.mcap"):
        assert call(node, SetBool, service, SetBool.Request(data=True)).success
        wait_until(lambda: publisher.get_subscription_count() == 1)
        assert not call(node, SetBool, service, SetBool.Request(data=True)).success
        answer = call(node, SetBool, service, SetBool.Request(data=False))
        assert answer.success and name in answer.message
        wait_until(lambda: publisher.get_subscription_count() == 0)
        with AnyReader([tmp_path / name]) as reader:
            assert reader.topics["/robot_description"].msgcount == 1
    assert not call(node, Trigger, "/recorder/split", Trigger.Request()).success
    processes.stop("record")
    processes.check("record")
    assert len(list(tmp_path.glob("*.mcap"))) == 3


def test_a_recording_begun_by_a_service_takes_the_next_free_name(
    processes: Processes, node: Node, tmp_path: Path
):
    (tmp_path / "bag_2.mcap").write_text("of another recording")
    start_recorder(processes, tmp_path / "bag.mcap")
    for name in ("bag.mcap", "bag_3.mcap"):
        answer = call(node, SetBool, "/recorder/record", SetBool.Request(data=False))
        assert answer.success and name in answer.message
        assert call(node, SetBool, "/recorder/record", SetBool.Request(data=True)).success
    assert (tmp_path / "bag_4.mcap").exists()
    assert (tmp_path / "bag_2.mcap").read_text() == "of another recording"


def test_a_split_before_robot_time_is_known_keeps_what_came_in_the_first_file(
    processes: Processes, node: Node, tmp_path: Path
):
    folder = tmp_path / "bag"
    publisher = node.create_publisher(String, "/text", 100)
    start_recorder(processes, folder, "/text")
    wait_until(lambda: publisher.get_subscription_count() == 1)
    for part in range(2):
        for number in range(50):
            publisher.publish(String(data=f"{part} {number}"))
        time.sleep(0.3)
        if part == 0:
            assert call(node, Trigger, "/recorder/split", Trigger.Request()).success
    processes.stop("record")
    for part in range(2):
        rows = read_messages(folder / f"bag_{part}.mcap")
        texts = [deserialize_message(raw, String).data for *_, raw in rows]
        assert texts == [f"{part} {number}" for number in range(50)]


def test_a_file_size_that_definitions_alone_exceed_is_refused(capsys):
    with pytest.raises(SystemExit):
        record_command.parse(["-o", "folder", "-b", "30000"])
    assert "30000 is less than 1000000 bytes" in capsys.readouterr().err
    assert record_command.parse(["-o", "folder", "-b", "1000000"]).max_bag_size == 1_000_000


def test_parameters_of_all_nodes_their_changes_and_files_are_kept(
    processes: Processes, node: Node, tmp_path: Path
):
    (tmp_path / "gaits.json").write_text("{}")
    node.declare_parameter("speed", 0.5)
    node.declare_parameter("gaits", str(tmp_path / "gaits.json"))
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    bag = tmp_path / "bag.mcap"
    processes.start("record", [executable("cassie_bags", "record"), "-o", bag])

    def kept() -> bool:
        executor.spin_once(timeout_sec=0.05)
        return bag.exists() and b"gaits.json" in bag.read_bytes()

    wait_until(kept)
    wait_until(lambda: node.count_subscribers("/parameter_events") > 0)
    node.set_parameters([Parameter("speed", value=0.7)])
    wait_until(lambda: node.count_subscribers("/parameter_events") > 0)
    time.sleep(0.5)
    executor.remove_node(node)
    processes.stop("record")
    index = BagIndex()
    events = [data for *_, data in read_messages(bag, ["/parameter_events"], index)]
    assert json.loads(index.metadata["cassie_parameters:/test"]["speed"]) == 0.5
    assert any(b"speed" in data for data in events)
    with bag.open("rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    assert (attachment.name.split("/")[1], attachment.data) == ("gaits.json", b"{}")


def test_a_disk_that_fills_ends_the_recording_in_one_line(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    program = executable("cassie_bags", "record")
    limited = f"ulimit -f 600; exec {program} -o {bag} --compression-format none"  # in KiB
    processes.start("record", ["bash", "-c", limited])
    messages = glide_messages(8.0)
    publishers = {
        topic: node.create_publisher(message_class(kind), topic, WRITER)
        for topic, kind in TYPES.items()
    }
    wait_until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    for tick in range(4000):
        publishers["/cassie/state"].publish(messages["/cassie/state"][tick])
        publishers["/cassie/sensors"].publish(messages["/cassie/sensors"][tick])
        time.sleep(0.001)
        if not processes.running("record"):
            break
    wait_until(lambda: not processes.running("record"))
    with pytest.raises(RunError, match="exit code 1"):
        processes.check()
    words = processes.log("record").read_text()
    assert words.count("error: cannot write bag") == 1 and "Traceback" not in words
    assert recover(bag, tmp_path / "saved.mcap").messages > 100


def test_a_killed_recorder_leaves_a_bag_that_can_be_recovered(
    processes: Processes, node: Node, tmp_path: Path
):
    messages = glide_messages(3.0)
    bag = tmp_path / "bag.mcap"
    start_recorder(processes, bag)
    publish_all(node, messages, lambda: processes.printed("record", COMPLETE))
    wait_until(lambda: bag.stat().st_size > 100_000)
    processes.signal("record", signal.SIGKILL)
    wait_until(lambda: not processes.running("record"))
    recover(bag, tmp_path / "saved.mcap")
    recording = read_recording(tmp_path / "saved.mcap")
    index = BagIndex()
    assert len(list(read_messages(tmp_path / "saved.mcap", None, index))) > 2000
    unexplained = [gap for gap in gaps(recording) if gap.partition(":")[0] not in index.lost]
    assert unexplained == []  # on a busy machine a recorder loses messages also while it lives
    assert len(recording.truth) > 500


def test_a_replay_publishes_every_message_with_its_type(
    processes: Processes, node: Node, tmp_path: Path
):
    messages = glide_messages(2.0)
    bag, copy = tmp_path / "bag.mcap", tmp_path / "copy.mcap"
    write_bag(bag, messages)
    start_recorder(processes, copy)
    replay = executable("cassie_bags", "replay")
    started = time.monotonic()
    processes.start("replay", [replay, bag, "--commands", "--rate", "4", "--wait", str(TIMEOUT)])
    wait_until(lambda: not processes.running("replay"))
    assert time.monotonic() - started >= 0.5
    processes.check("replay")
    processes.stop("record")
    processes.check("record", "replay")
    assert same(read_recording(copy), messages) == [], processes.log("record").read_text()
    with AnyReader([copy]) as reader:
        assert reader.topics["/clock"].msgtype == "rosgraph_msgs/msg/Clock"
        assert reader.topics["/clock"].msgcount > 10


def test_a_message_that_was_sent_twice_stays_before_the_next_one(
    node: Node, monkeypatch: pytest.MonkeyPatch
):
    state = message_class("cassie_msgs/msg/RobotState")
    publisher = node.create_publisher(state, "/cassie/state", 100)
    topic = RecordedTopic(node, "cassie_msgs/msg/RobotState", "/cassie/state")
    wait_until(lambda: topic.subscriptions[0].matched == 1)
    received = iter((30, 20, 40))
    monkeypatch.setattr(Inbox, "times", property(lambda inbox: (7, next(received))))
    messages = glide_messages(0.01)["/cassie/state"][:3]
    for raw in messages:
        publisher.publish(raw)
    taken: list[Received] = []
    wait_until(lambda: len(taken.extend(topic.take()) or taken) == 3)
    assert [each.received for each in taken] == [30, 30, 40]
    assert [each.raw for each in taken] == list(messages)


def test_a_gap_of_any_length_in_a_writers_numbers_is_counted(
    node: Node, monkeypatch: pytest.MonkeyPatch
):
    state = message_class("cassie_msgs/msg/RobotState")
    publisher = node.create_publisher(state, "/cassie/state", 100)
    topic = RecordedTopic(node, "cassie_msgs/msg/RobotState", "/cassie/state")
    wait_until(lambda: topic.subscriptions[0].matched == 1)
    numbers = iter((1, 2**60, 2**60 - 1, 2**60 - 1))
    monkeypatch.setattr(Inbox, "number", property(lambda inbox: next(numbers)))
    for raw in glide_messages(0.01)["/cassie/state"][:4]:
        publisher.publish(raw)
    taken: list[Received] = []
    wait_until(lambda: len(taken.extend(topic.take()) or taken) == 3)
    assert [each.lost for each in taken] == [0, 2**60 - 2, 2**60 - 3]


def test_messages_that_did_not_come_are_counted_by_topic(
    node: Node, monkeypatch: pytest.MonkeyPatch
):
    state = message_class("cassie_msgs/msg/RobotState")
    publishers = [node.create_publisher(state, "/cassie/state", 100) for _ in range(2)]
    monkeypatch.setattr(recorded_topic, "DEPTH", 10)
    topic = RecordedTopic(node, "cassie_msgs/msg/RobotState", "/cassie/state")
    wait_until(lambda: topic.subscriptions[0].matched == 2)
    raw = glide_messages(0.01)["/cassie/state"][0]
    publishers[0].publish(raw)
    wait_until(lambda: bool(topic.take()))
    for _ in range(25):  # the queue holds the last ten
        publishers[0].publish(raw)
    time.sleep(0.5)
    publishers[1].publish(raw)
    wait_until(lambda: not topic.take())
    assert topic.lost in (15, 16)  # of the other writer's the first may push out one more


class Listener:
    """Hears states; their seqs in order."""

    def __init__(self, node: Node) -> None:
        self.seqs: list[int] = []
        state = message_class("cassie_msgs/msg/RobotState")
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._node = node
        node.create_subscription(state, "/cassie/state", lambda m: self.seqs.append(m.seq), 1000)

    def wait_for(self, condition: Callable[[], bool]) -> None:
        wait_until(lambda: self._executor.spin_once(timeout_sec=0.05) or condition())

    def quiet(self) -> bool:
        """Whether nothing comes for a while."""
        count = len(self.seqs)
        until = time.monotonic() + 0.5
        while time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.05)
        return len(self.seqs) == count

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self._node.create_client(kind, name)
        self.wait_for(client.service_is_ready)
        future = client.call_async(request)
        self.wait_for(future.done)
        return future.result()

    def set(self, name: str, value: float) -> bool:
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        answer = self.call(SetParameters, "/replay/set_parameters", request)
        return all(result.successful for result in answer.results)


def test_a_replay_is_paused_stepped_and_sought_by_services(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(2.0))
    heard = Listener(node)
    replay = [executable("cassie_bags", "replay"), bag, "--start-paused", "--wait", str(TIMEOUT)]
    processes.start("replay", [*replay, "--topics", "/cassie/state"])
    heard.wait_for(lambda: len(heard.seqs) == 1)  # the first moment stands still
    assert heard.quiet()
    for seq in (1, 2):
        assert heard.call(Trigger, "/replay/step", Trigger.Request()).success
        heard.wait_for(lambda seq=seq: heard.seqs == list(range(seq + 1)))
    assert heard.set("position", 1.0)
    heard.wait_for(lambda: heard.seqs[-1] == 500)
    assert heard.quiet()
    assert not heard.set("position", 99.0) and not heard.set("rate", 0.0)
    assert heard.set("rate", 4.0)
    assert heard.call(SetBool, "/replay/pause", SetBool.Request(data=False)).success
    assert not heard.call(Trigger, "/replay/step", Trigger.Request()).success
    heard.wait_for(lambda: heard.seqs[-1] == 999)
    assert heard.seqs[3:] == list(range(500, 1000))
    wait_until(lambda: not processes.running("replay"))
    processes.check("replay")


def test_a_part_of_a_folder_of_ros2_bag_is_replayed(
    processes: Processes, node: Node, tmp_path: Path
):
    messages = glide_messages(2.0)
    source, folder = tmp_path / "bag.mcap", tmp_path / "theirs"
    write_bag(source, messages)
    with (
        AnyReader([source]) as reader,
        Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        by_topic = {
            each.topic: writer.add_connection(each.topic, each.msgtype, typestore=reader.typestore)
            for each in reader.connections
        }
        for each, stamp, raw in reader.messages():
            writer.write(by_topic[each.topic], 1_700_000_000_000_000_000 + stamp, raw)
    assert same(read_recording(folder), messages) == []
    heard = Listener(node)
    replay = [executable("cassie_bags", "replay"), folder, "--wait", str(TIMEOUT)]
    part = ["--start", "0.5", "--duration", "0.2", "--topics", "/cassie/state"]
    processes.start("replay", [*replay, *part])
    heard.wait_for(lambda: not processes.running("replay"))
    processes.check("replay")
    heard.wait_for(heard.quiet)
    assert heard.seqs == list(range(250, 351))


def write_texts(path: Path, qos: Qos) -> None:
    """A bag with three early texts, and numbers for 2 s afterwards."""
    with BagWriter(path) as bag:
        text = bag.add_topic("/text", "std_msgs/msg/String", qos)
        number = bag.add_topic("/number", "std_msgs/msg/UInt64")
        for index in range(3):
            raw = serialize_message(String(data=f"latched {index}"))
            bag.write(text, raw, index, index)
        for index in range(200):
            when = index * 10_000_000
            bag.write(number, serialize_message(UInt64(data=index)), when, when)


@pytest.mark.parametrize("start", [[], ["--start", "1.5"]])
def test_a_replay_latches_what_was_latched(
    processes: Processes, node: Node, tmp_path: Path, start: list[str]
):
    bag = tmp_path / "bag.mcap"
    write_texts(bag, Qos(durability="transient_local", depth=1))
    processes.start("replay", [executable("cassie_bags", "replay"), bag, "-p", *start])
    wait_until(lambda: node.count_publishers("/text") == 1)
    time.sleep(0.5)
    texts: list[str] = []
    qos = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(String, "/text", lambda message: texts.append(message.data), qos)
    if not start:
        request = SetBool.Request(data=False)
        assert call(node, SetBool, "/replay/pause", request).success
    wait_until(lambda: spin(node) and len(texts) == 3)
    assert texts == [f"latched {index}" for index in range(3)]


def test_a_seek_forward_publishes_what_is_latched_on_the_way(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_texts(bag, Qos(durability="transient_local"))
    heard = Listener(node)
    texts: list[str] = []
    node.create_subscription(String, "/text", lambda message: texts.append(message.data), 10)
    words = [executable("cassie_bags", "replay"), bag, "--start-paused", "--wait", "2"]
    processes.start("replay", words)
    heard.wait_for(lambda: texts == ["latched 0"])
    assert heard.set("position", 1.0)
    heard.wait_for(lambda: texts == [f"latched {index}" for index in range(3)])
    processes.stop("replay")


def test_a_replay_offers_the_quality_of_service_that_was_recorded(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_texts(bag, Qos(reliability="best_effort"))
    processes.start("replay", [executable("cassie_bags", "replay"), bag, "-p"])
    wait_until(lambda: node.count_publishers("/text") * node.count_publishers("/number") == 1)
    (text,) = node.get_publishers_info_by_topic("/text")
    (number,) = node.get_publishers_info_by_topic("/number")
    assert text.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert number.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    assert text.qos_profile.durability == DurabilityPolicy.VOLATILE
    processes.stop("replay")


def test_keys_on_a_terminal_steer_a_replay(processes: Processes, node: Node, tmp_path: Path):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(2.0))
    heard = Listener(node)
    ours, theirs = pty.openpty()
    program = executable("cassie_bags", "replay")
    words = f"{program} {bag} -p --wait {TIMEOUT} --topics /cassie/state < {os.ttyname(theirs)}"
    processes.start("replay", ["bash", "-c", f"exec {words}"])
    heard.wait_for(lambda: len(heard.seqs) == 1)
    os.write(ours, b"\x1b[C")
    heard.wait_for(lambda: heard.seqs == [0, 1])
    os.write(ours, b" ")
    heard.wait_for(lambda: len(heard.seqs) > 50)
    os.write(ours, b" ")
    heard.wait_for(heard.quiet)
    os.write(ours, b"\x1b[D")
    heard.wait_for(lambda: heard.seqs[-1] == 0)
    os.write(ours, b"q")
    wait_until(lambda: not processes.running("replay"))
    processes.check("replay")
    os.close(ours)
    os.close(theirs)


def test_a_replay_leaves_out_what_moves_a_robot(processes: Processes, node: Node, tmp_path: Path):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.5))
    received: dict[str, list[bytes]] = {"RobotState": [], "MotorCommand": [], "Mode": []}
    for name, topic in (
        ("RobotState", "/cassie/state"),
        ("MotorCommand", "/cassie/motor_command"),
        ("Mode", "/cassie/mode"),
    ):
        kind = message_class(f"cassie_msgs/msg/{name}")
        node.create_subscription(kind, topic, received[name].append, 10, raw=True)
    processes.start("replay", [executable("cassie_bags", "replay"), bag, "--loop", "--rate", "5"])
    wait_until(lambda: spin(node) and len(received["RobotState"]) > 300)
    processes.stop("replay")
    assert not received["MotorCommand"] and not received["Mode"]


def test_a_replay_beside_a_node_that_writes_the_same_is_refused(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.5))
    publisher = node.create_publisher(
        message_class("cassie_msgs/msg/Sensors"), "/cassie/sensors", 1
    )
    processes.start("replay", [executable("cassie_bags", "replay"), bag])
    wait_until(lambda: spin(node) and not processes.running("replay"))
    words = processes.log("replay").read_text()
    assert words.startswith("replay: error: /cassie/sensors is written by ")
    assert "ROS_DOMAIN_ID=" in words and len(words.splitlines()) == 1
    assert "--allow-second" in words
    node.destroy_publisher(publisher)


def test_a_replay_beside_a_node_that_writes_the_same_plays_for_those_who_mean_it(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.5))
    publisher = node.create_publisher(
        message_class("cassie_msgs/msg/Sensors"), "/cassie/sensors", 1
    )
    heard = Listener(node)
    replay = [executable("cassie_bags", "replay"), bag, "--loop", "--allow-second"]
    processes.start("replay", replay)
    heard.wait_for(lambda: len(heard.seqs) > 300)
    processes.check("replay")
    node.destroy_publisher(publisher)


def test_a_replay_ends_when_a_node_begins_to_write_the_same(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.5))
    heard = Listener(node)
    processes.start("replay", [executable("cassie_bags", "replay"), bag, "--loop"])
    heard.wait_for(lambda: len(heard.seqs) > 10)
    publisher = node.create_publisher(
        message_class("cassie_msgs/msg/Sensors"), "/cassie/sensors", 1
    )
    heard.wait_for(lambda: not processes.running("replay"))
    assert "/cassie/sensors is written by " in processes.log("replay").read_text()
    with pytest.raises(RunError, match="exit code 1"):
        processes.check("replay")
    node.destroy_publisher(publisher)


def test_a_replay_of_some_topics_plays_these_again_and_again(
    processes: Processes, node: Node, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.5))
    received: list[bytes] = []
    state = message_class("cassie_msgs/msg/RobotState")
    subscription = node.create_subscription(state, "/cassie/state", received.append, 10, raw=True)
    command = [executable("cassie_bags", "replay"), bag, "--loop", "--rate", "10"]
    processes.start("replay", [*command, "--wait", "9", "--topics", "/cassie/state"])
    wait_until(lambda: processes.running("replay") and spin(node) and len(received) > 300)
    processes.stop("replay")
    processes.check("replay")
    assert node.count_publishers("/cassie/sensors") == 0
    node.destroy_subscription(subscription)


def test_ctrl_c_ends_a_replay_to_a_subscriber_that_is_stopped(
    processes: Processes, domain: int, tmp_path: Path
):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.1))
    listener = (
        "import rclpy, time; rclpy.init(); node = rclpy.create_node('listener')\n"
        "from cassie_msgs.msg import RobotState\n"
        "node.create_subscription(RobotState, '/cassie/state', print, 10)\n"
        "print('listening', flush=True); time.sleep(60)"
    )
    processes.start("listener", [sys.executable, "-c", listener])
    wait_until(lambda: processes.printed("listener", "listening"))
    replay = [executable("cassie_bags", "replay"), bag, "--rate", "0.05", "--wait", "10"]
    processes.start("replay", [*replay, "--topics", "/cassie/state"])
    time.sleep(1.5)  # it plays for two seconds after it has found the listener
    processes.signal("listener", signal.SIGSTOP)
    time.sleep(3.0)
    processes.signal("replay", signal.SIGINT)
    asked = time.monotonic()
    wait_until(lambda: not processes.running("replay"))
    processes.signal("listener", signal.SIGCONT)
    assert time.monotonic() - asked < 3.0


def test_a_replay_says_what_it_cannot_read(processes: Processes, tmp_path: Path):
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(2.0))
    content = bag.read_bytes()
    bag.write_bytes(content[: 2 * len(content) // 3])
    processes.start("replay", [executable("cassie_bags", "replay"), bag, "--rate", "100"])
    wait_until(lambda: not processes.running("replay"))
    processes.check("replay")
    log = processes.log("replay").read_text()
    assert "is damaged or not closed: " in log
    assert "messages replayed" in log


def test_topics_with_other_fields_than_the_installed_ones_are_not_played(
    processes: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def exchanged(kind: str) -> str:
        text = definition(kind)
        return re.sub(r"\bv([xy])\b", r"v_\1", text) if kind == Mode.TYPE else text

    monkeypatch.setattr("cassie_bags.bag.writer.definition", exchanged)
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.1))
    replay = [executable("cassie_bags", "replay"), bag, "--commands", "--rate", "100"]
    processes.start("replay", replay)
    wait_until(lambda: not processes.running("replay"))
    processes.check("replay")
    log = processes.log("replay").read_text()
    assert "/cassie/mode is not replayed: the bag has other fields in cassie_msgs/msg/Mode" in log
    assert "messages replayed" in log


def test_topics_that_cannot_be_played_are_named_and_the_others_played(
    processes: Processes, tmp_path: Path
):
    bag = tmp_path / "mixed.mcap"
    write_mixed_bag(bag, {"/text": "cdr", "/json": "json", "/été": "cdr"})
    processes.start("replay", [executable("cassie_bags", "replay"), bag])
    wait_until(lambda: not processes.running("replay"))
    processes.check("replay")
    log = processes.log("replay").read_text()
    assert "/json is not replayed: its messages are encoded as json, not as cdr" in log
    assert "/été is not replayed: this is not a valid name of a topic" in log
    assert "1 messages replayed" in log


def test_a_bag_of_which_no_topic_can_be_played_is_an_error(processes: Processes, tmp_path: Path):
    bag = tmp_path / "json.mcap"
    write_mixed_bag(bag, {"/json": "json"})
    processes.start("replay", [executable("cassie_bags", "replay"), bag, "--topics", "/json"])
    wait_until(lambda: not processes.running("replay"))
    with pytest.raises(RunError, match=r"exit code 2: replay: error: .*: no topic can be played"):
        processes.check()
    assert "/json is not replayed" in processes.log("replay").read_text()


@pytest.mark.parametrize("kind", ["thing", "", "a/b/c/d", "/msg/String", "std_msgs/msg/Nothing"])
def test_a_type_that_is_none_is_refused(kind: str):
    with pytest.raises(BagError, match="message type"):
        message_class(kind)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--wait", "nan"], "nan is not 0 s or more"),
        (["--duration", "0"], "0 is not more than 0 s"),
        (["--duration", "-1"], "-1 is not more than 0 s"),
        (["--rate", "fast"], "fast is not a rate of 0.01 .. 1000"),
    ],
)
def test_wrong_words_of_a_replay_are_named(words: list[str], reason: str, capsys):
    with pytest.raises(SystemExit):
        replay_command.parse(["bag.mcap", *words])
    assert reason in capsys.readouterr().err


def spin(node: Node) -> bool:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    for _ in range(100):
        executor.spin_once(timeout_sec=0.01)
    executor.remove_node(node)
    return True


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (
            ["replay", "bag.mcap", "--topics", "/parameter_events"],
            "/parameter_events is what every node publishes of itself",
        ),
        (["replay", "none.mcap"], "No such file"),
        (["replay", "text.mcap"], "is not an MCAP file"),
        (["replay", "bag.mcap", "--start", "99"], "has no message in the part asked for"),
        (["replay", "late.mcap"], "a log time of 9223372037 s does not fit into /clock"),
        (["recover", "text.mcap"], "is not an MCAP file"),
        (["record", "-o", "text.mcap/bag.mcap"], "cannot write bag"),
        (["record", "-o", "text.mcap"], "text.mcap exists: give another name"),
        (["record", "-o", "there"], "there exists: give another name"),
        (["record", "-o", "new.mcap", "--min-free-space", "1e8"], "less than 100000000 MiB"),
        (["recover", "bag.mcap", "-o", "text.mcap"], "text.mcap exists: give another output"),
        (["recover", "bag.mcap", "-o", "/proc/bag.mcap"], "cannot write /proc/bag.mcap"),
        (["record", "-o", "new.mcap", "--metadata", "flat.yaml"], "seed = 3 is not a mapping"),
    ],
)
def test_a_wrong_file_ends_the_command_with_one_line(
    processes: Processes, tmp_path: Path, command: list[str], reason: str
):
    (tmp_path / "text.mcap").write_text("no bag")
    (tmp_path / "flat.yaml").write_text("seed: 3")
    name, *words = command
    write_bag(tmp_path / "bag.mcap", glide_messages(0.1))
    with BagWriter(tmp_path / "late.mcap") as bag:
        bag.write(bag.add_topic("/clocks", "std_msgs/msg/Empty"), b"\0\1\0\0\0", 2**63, 2**63)
    (tmp_path / "there").mkdir()
    paths = [str(tmp_path / word) if word == "there" or "." in word else word for word in words]
    processes.start(name, [executable("cassie_bags", name), *paths])
    wait_until(lambda: not processes.running(name))
    with pytest.raises(RunError, match=f"exit code 2: {name}: error: .*{reason}"):
        processes.check()
    assert len(processes.log(name).read_text().splitlines()) == 1
    assert (tmp_path / "text.mcap").read_text() == "no bag"
    assert not (tmp_path / "new.mcap").exists()


def test_a_writer_whose_node_has_no_name_yet_counts_in_the_end(tmp_path, monkeypatch):
    """On a busy machine the look for writers ended before the name was known, and it played."""
    bag = tmp_path / "bag.mcap"
    write_bag(bag, glide_messages(0.5))
    monkeypatch.setattr(replay, "_DISCOVERY", 0.1)
    monkeypatch.setattr(replay, "writers", lambda *_: {b"another": replay.UNKNOWN})
    with own_domain() as domain:
        rclpy.init(args=[], domain_id=domain)
        try:
            with pytest.raises(BagError, match="is written by an unknown node"):
                replay.Replay(replay_command.parse([str(bag)]), replay.Stop())
        finally:
            rclpy.shutdown()
