"""What is in a bag, as text and as files for other programs; what is no bag is refused."""

from __future__ import annotations

import csv
import os
import re
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from synthetic import TICK_NS, glide, glide_messages, standing_height
from test_bag import write_bag, write_messages
from test_commands import play
from test_damaged_bags import parts

from cassie_bags.bag import fields
from cassie_bags.bag.comparison import Difference, compare_recordings
from cassie_bags.bag.continuity import episodes, only_episode
from cassie_bags.bag.definitions import definition
from cassie_bags.bag.export import export
from cassie_bags.bag.fields import FIELDS
from cassie_bags.bag.node_events import EVENTS_TOPIC
from cassie_bags.bag.output import new_files
from cassie_bags.bag.reader import BagIndex, read_messages, unknown_topic
from cassie_bags.bag.recording import (
    GROUND_TRUTH_TOPIC,
    TYPES,
    from_messages,
    layout_problem,
    read_recording,
)
from cassie_bags.bag.rosbag2 import QOS_LANE
from cassie_bags.bag.summary import (
    DIAGNOSTICS_TOPIC,
    SENSOR_CHANNELS,
    STATUS_TOPIC,
    TopicSummary,
    summarize,
)
from cassie_bags.bag.tables import Table, read_curves, read_tables
from cassie_bags.bag.writer import BagWriter
from cassie_bags.cli import report
from cassie_bags.errors import BagError
from cassie_bags.report.figures import EVENT_COLOURS
from cassie_bags.report.plots import save_curves
from cassie_bags.report.view import events_of_bag
from cassie_bags.signals.falls import falls
from cassie_control.estimator import channels
from cassie_gaits import gait_library, names
from cassie_msgs.layout import (
    GAIT_TYPES,
    SAMPLE_TYPES,
    Gait,
    GaitRequest,
    GaitResult,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sensors,
)

EVENT = "cassie_msgs/msg/NodeEvent"
STATUS = "cassie_msgs/msg/SupervisorStatus"


def command(verb: str, *words: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.run(
        [sys.executable, "-m", f"cassie_bags.cli.{verb}", *map(str, words)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )


@pytest.fixture(scope="module")
def messages() -> dict[str, list[bytes]]:
    return glide_messages(2.0, yaw_rate=0.2)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, messages) -> Path:
    path = tmp_path_factory.mktemp("bags") / "bag.mcap"
    write_bag(path, messages)
    return path


@pytest.fixture
def folder(tmp_path: Path, messages) -> Path:
    """A bag as other tools of ROS 2 write it: metadata.yaml beside MCAP."""
    path = tmp_path / "rosbag2"
    store = get_typestore(Stores.ROS2_JAZZY)
    for kind in {TYPES[topic] for topic in messages}:
        if kind.startswith("cassie_msgs"):
            store.register(get_types_from_msg(definition(kind), kind))
    with Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, list_ in messages.items():
            connection = writer.add_connection(topic, TYPES[topic], typestore=store)
            for tick, raw in enumerate(list_):
                writer.write(connection, tick * TICK_NS, raw)
    return path


def status_message(store, time_ns: int, **values) -> bytes:
    kind = store.types[STATUS]
    header = store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"](*divmod(time_ns, 1_000_000_000))
    content = {
        "header": header(stamp, ""), "episode": 1, "seq": 0, "mode": "stand", "requested": "walk",
        "readiness": "", "stand_readiness": "", "walk_readiness": "", "segway_readiness": "",
        "faults": [], "fallen": False, "link": True, "armed": True, "holder": "me",
        "operators": [], "missed_ticks": 0, "late_ticks": 0, "longest_delay": 0.0,
        "missed_share": 0.0,
    } | values  # fmt: skip
    return bytes(store.serialize_cdr(kind(**content), STATUS))


def test_every_field_of_every_topic_has_a_unit_or_a_meaning(messages):
    for kind in (*SAMPLE_TYPES, *GAIT_TYPES):
        named = FIELDS[kind.TOPIC]
        assert tuple(named) and set(named) == set(kind.DTYPE.names or ())
        for name, field in named.items():
            shape = kind.DTYPE[name].shape
            assert len(field.components) == (shape[0] if shape else 0), (kind.TOPIC, name)
            assert field.about
            assert len(field.units) in (0, len(field.components))
    assert FIELDS[RobotState.TOPIC]["v"].unit_of("yaw") == "rad/s"
    assert fields.DRIVES == names.DRIVES
    assert fields.JOINTS == names.SENSED_JOINTS
    assert fields.COORDINATES == names.COORDINATES
    assert fields.OUTPUTS == gait_library.OUTPUTS


def test_a_summary_knows_topics_rates_episodes_and_modes(bag: Path):
    summary = summarize(bag)
    assert summary.complete and summary.lost_bytes == 0
    assert summary.duration == pytest.approx(1.998)
    counts = {topic.topic: (topic.count, round(topic.rate)) for topic in summary.topics}
    assert counts[RobotState.TOPIC] == (1000, 500)
    assert counts[Mode.TOPIC] == (100, 50)
    assert summary.gaps == []
    assert [(e.name, e.t0, e.t1) for e in summary.episodes] == [("1", 0.0, pytest.approx(1.998))]
    assert [(mode.name, mode.t0) for mode in summary.modes] == [("walk", 0.0)]
    assert summary.metadata["cassie_experiment"]["seed"] == "7"


def test_a_summary_without_the_supervisors_status_has_what_the_estimator_rejected(
    tmp_path: Path, bag: Path, messages
):
    state, marked = RobotState(), []
    for raw in messages[RobotState.TOPIC]:
        state.load(raw)
        state.sensor_faults[...] = 1 << 10 if 200 <= state.seq < 300 else 0
        marked.append(state.to_bytes())
    path = tmp_path / "faulty.mcap"
    write_bag(path, messages | {RobotState.TOPIC: marked})
    (fault,) = summarize(path).faults
    assert fault.name == "drive_position.3 (left_knee) rejected by the estimator"
    assert (fault.t0, fault.t1) == (pytest.approx(0.4), pytest.approx(0.6))
    shown = command("info", path).stdout
    assert "faults       drive_position.3 (left_knee) rejected by the estimator" in shown
    assert f"sensors alone: {STATUS_TOPIC} was not recorded" in " ".join(shown.split())
    assert summarize(bag).faults == []
    assert channels.names((1 << len(SENSOR_CHANNELS)) - 1) == SENSOR_CHANNELS
    assert len(SENSOR_CHANNELS) == len(channels.CHANNELS)


def test_the_duration_is_that_of_the_run_also_where_the_recorder_began_before_it(
    tmp_path: Path, messages
):
    path = tmp_path / "early.mcap"
    writer = BagWriter(path)
    early = writer.add_topic("/parameter_events", "rcl_interfaces/msg/ParameterEvent", QOS_LANE)
    writer.write(early, b"", 0, 0)
    lane = {topic: writer.add_topic(topic, TYPES[topic], QOS_LANE) for topic in messages}
    for topic, list_ in messages.items():
        for tick, raw in enumerate(list_):
            writer.write(lane[topic], raw, 7_000_000_000 + tick * TICK_NS, 0)
    writer.close()
    assert summarize(path).duration == pytest.approx(1.998)


def test_a_summary_says_what_is_missing_and_that_a_bag_was_not_closed(tmp_path: Path, bag: Path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    summary = summarize(cut)
    assert not summary.complete
    assert 200 < len(summary.recording.rows(RobotState)) < 1000
    holed = glide_messages(1.0)
    del holed[Sensors.TOPIC][100:103]
    path = tmp_path / "holed.mcap"
    write_bag(path, holed)
    (gap,) = summarize(path).gaps
    assert gap == "/cassie/sensors: 3 samples missing in episode 1, first after seq 99"


def test_modes_have_their_reasons_and_faults_their_time(tmp_path: Path, messages):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(STATUS), STATUS))
    said = [
        {"readiness": "the robot hangs"},
        {"faults": ["no state for 0.1 s"], "requested": "stand"},
        {"faults": []},
    ]
    path = tmp_path / "said.mcap"
    with BagWriter(path) as writer:
        modes = writer.add_topic(Mode.TOPIC, Mode.TYPE)
        status = writer.add_topic(STATUS_TOPIC, STATUS)
        sample = Mode()
        for second, (mode, values) in enumerate(
            zip((RobotMode.STAND, RobotMode.DAMP, RobotMode.STAND), said, strict=True)
        ):
            sample.mode[...] = mode
            time = second * 1_000_000_000
            writer.write(modes, sample.to_bytes(), time, time)
            writer.write(status, status_message(store, time, **values), time, time)
    summary = summarize(path)
    assert [(mode.name, mode.t0, mode.reason) for mode in summary.modes] == [
        ("stand", 0.0, "walk was asked for: the robot hangs"),
        ("damp", 1.0, "no state for 0.1 s"),
        ("stand", 2.0, ""),
    ]
    assert [(f.name, f.t0, f.t1) for f in summary.faults] == [("no state for 0.1 s", 1.0, 2.0)]


def test_without_the_supervisors_status_commands_and_sensors_give_reasons(tmp_path: Path):
    """As in a bag of a run in one process, which has the control lane alone."""
    path = tmp_path / "lane.mcap"
    with BagWriter(path) as writer:
        kinds = (RobotState, OperatorCommand, Mode)
        topics = {kind: writer.add_topic(kind.TOPIC, kind.TYPE) for kind in kinds}
        state, command_, mode = RobotState(), OperatorCommand(), Mode()
        command_.mode[...] = RobotMode.WALK
        for second, (power, faults, now) in enumerate(
            [
                (0.0, 0, RobotMode.OFF),
                (1.0, 0, RobotMode.STAND),
                (1.0, 0, RobotMode.WALK),
                (1.0, 1 << 10, RobotMode.STAND),
            ]
        ):
            time = second * 1_000_000_000
            state.power[...], state.sensor_faults[...], mode.mode[...] = power, faults, now
            for sample in (state, command_, mode):
                sample.seq[...] = second * 10
                sample.stamp_ns = time
                late = 20_000_000 if sample is command_ else 0  # as a recorder may take it
                writer.write(topics[type(sample)], sample.to_bytes(), time + late, time)
    assert [(mode.name, mode.reason) for mode in summarize(path).modes] == [
        ("off", "the drives have no power"),
        ("stand", "walk was asked for"),
        ("walk", "the operator asked for it"),
        ("stand", "the estimator rejects drive_position.3 (left_knee); walk was asked for"),
    ]


def test_what_befell_nodes_is_told(tmp_path: Path):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(EVENT), EVENT))
    stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
    said = [
        ("gait_controller", "began", "{}"),
        ("gait_controller", "parameters", '{"walk.kp": 2.5}'),
        ("gait_controller", "mode", '{"effective_seq": null}'),
        ("gait_controller", "lost", '{"node": "mode_supervisor"}'),
        ("gait_controller", "began", "{}"),
    ]
    path = tmp_path / "events.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic(EVENTS_TOPIC, EVENT)
        for second, words in enumerate(said):
            message = store.types[EVENT](stamp, 0, second, *words)
            time = second * 1_000_000_000
            writer.write(channel, bytes(store.serialize_cdr(message, EVENT)), time, time)
    assert [(node.t0, node.name) for node in summarize(path).nodes] == [
        (1.0, "gait_controller: walk.kp = 2.5"),
        (3.0, "mode_supervisor lost, says gait_controller"),
        (4.0, "gait_controller began anew"),
    ]


def test_falls_are_found_in_every_episode():
    parts = [glide(1.0, episode=1, tilt_from=0.5), glide(1.0, episode=2)]
    lane = {topic: np.concatenate([part.lane[topic] for part in parts]) for topic in parts[0].lane}
    truth = np.concatenate([part.truth for part in parts])
    both = replace(parts[0], lane=lane, truth=truth)
    assert falls(both) == {1: pytest.approx(0.5)}
    assert episodes(only_episode(both, 1)) == [1]
    np.testing.assert_array_equal(only_episode(both, 2).truth, parts[1].truth)
    assert falls(replace(both, truth=both.truth[:0])) is None


def test_a_folder_of_ros2_bag_and_a_text_path_give_the_same_arrays(bag: Path, folder: Path):
    for other in (folder, str(folder), str(bag)):
        for topic, rows in read_recording(bag).lane.items():
            np.testing.assert_array_equal(read_recording(other).lane[topic], rows)
    assert summarize(folder).complete


def test_a_folder_is_read_in_the_order_of_its_files(tmp_path: Path, messages):
    for number, ticks in ((10, slice(900, 1000)), (9, slice(0, 900))):
        states = {RobotState.TOPIC: messages[RobotState.TOPIC][ticks]}
        write_bag(tmp_path / f"split_{number}.mcap", states)
    assert read_recording(tmp_path).rows(RobotState)["seq"].tolist() == list(range(1000))


@pytest.mark.parametrize("form", ["csv", "npz", "parquet"])
def test_what_is_exported_is_what_was_recorded(tmp_path: Path, bag: Path, form: str):
    if form == "parquet":
        parquet = pytest.importorskip("pyarrow.parquet", reason="the extra parquet")
    export(read_tables(bag), tmp_path / "out", form)
    recording = read_recording(bag)
    for topic, stem in ((Sensors.TOPIC, "cassie_sensors"), (Mode.TOPIC, "cassie_mode")):
        rows, path = recording.lane[topic], tmp_path / "out" / f"{stem}.{form}"
        if form == "npz":
            with np.load(path) as content:
                for name in rows.dtype.names or ():
                    np.testing.assert_array_equal(content[name], rows[name])
                np.testing.assert_array_equal(content["log_time"], rows["seq"] * TICK_NS)
            continue
        if form == "csv":
            with path.open(newline="") as stream:
                read = list(csv.DictReader(stream))
            columns = {key: np.array([float(row[key]) for row in read]) for key in read[0]}
        else:
            table = parquet.read_table(path)
            columns = {name: table[name].to_numpy() for name in table.column_names}
        for name, field in FIELDS[topic].items():
            for index, part in enumerate(field.components or ("",)):
                expected = rows[name][:, index] if part else rows[name]
                np.testing.assert_array_equal(columns[f"{name}.{part}".rstrip(".")], expected)
    if form == "parquet":
        schema = parquet.read_schema(tmp_path / "out" / "cassie_sensors.parquet")
        assert schema.field("drive_torque.left_knee").metadata == {b"unit": b"Nm"}


@pytest.mark.parametrize(
    ("kind", "column", "unit"),
    [
        ("sensor_msgs/msg/JointState", "position.left_knee", "rad"),
        ("sensor_msgs/msg/JointState", "effort.left_knee", "Nm"),
        ("sensor_msgs/msg/Imu", "linear_acceleration.z", "m/s^2"),
        ("sensor_msgs/msg/Imu", "angular_velocity_covariance.0", ""),
        ("nav_msgs/msg/Odometry", "pose.pose.position.x", "m"),
        ("nav_msgs/msg/Odometry", "twist.twist.angular.z", "rad/s"),
        ("nav_msgs/msg/Odometry", "header.stamp.nanosec", "ns"),
        ("tf2_msgs/msg/TFMessage", "transforms.3.transform.translation.y", "m"),
        ("tf2_msgs/msg/TFMessage", "transforms.3.transform.rotation.y", ""),
    ],
)
def test_messages_of_ros_are_exported_with_their_units(
    tmp_path: Path, kind: str, column: str, unit: str
):
    times = np.zeros(1, np.int64)
    table = Table("/topic", kind, times, times, {column: np.zeros(1)})
    assert table.unit(column) == unit
    export({"/topic": table}, tmp_path, "csv")
    with (tmp_path / "fields.csv").open(newline="") as stream:
        assert {row["column"]: row["unit"] for row in csv.DictReader(stream)}[column] == unit


def test_pandas_reads_an_export(tmp_path: Path, bag: Path):
    pandas = pytest.importorskip("pandas")
    export(read_tables(bag, [GROUND_TRUTH_TOPIC]), tmp_path / "out", "csv")
    frame = pandas.read_csv(tmp_path / "out" / "cassie_ground_truth.csv")
    np.testing.assert_array_equal(frame["position.x"], read_recording(bag).truth["position"][:, 0])
    assert frame["position.z"].iloc[0] == standing_height()


def test_topics_of_any_type_become_columns(tmp_path: Path):
    """By the definitions in the bag, with joints by their names and words as words."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "sensor_msgs/msg/JointState"
    types = store.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 5), "base")
    path = tmp_path / "joints.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic("/joint_states", kind)
        for count in (1, 2):
            joints = types[kind](
                header, ["knee", "toe"][:count], np.arange(count) + 0.5, np.zeros(0), np.zeros(0)
            )
            writer.write(channel, bytes(store.serialize_cdr(joints, kind)), count, count)
    table = read_tables(path)["/joint_states"]
    np.testing.assert_array_equal(table.fields["position.knee"], [0.5, 0.5])
    np.testing.assert_array_equal(table.fields["position.toe"], [np.nan, 1.5])
    assert table.fields["header.frame_id"].tolist() == ["base", "base"]
    export({"/joint_states": table}, tmp_path / "out", "npz")
    with np.load(tmp_path / "out" / "joint_states.npz", allow_pickle=False) as content:
        assert content["header.frame_id"].tolist() == ["base", "base"]


def test_a_message_without_joints_is_a_row_of_its_other_fields(tmp_path: Path):
    store = get_typestore(Stores.ROS2_JAZZY)
    kind, none = "sensor_msgs/msg/JointState", np.zeros(0)
    header = store.types["std_msgs/msg/Header"](
        store.types["builtin_interfaces/msg/Time"](1, 5), "base"
    )
    path = tmp_path / "joints.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic("/joint_states", kind)
        joints = store.types[kind](header, [], none, none, none)
        writer.write(channel, bytes(store.serialize_cdr(joints, kind)), 1, 1)
    assert read_tables(path)["/joint_states"].fields["header.frame_id"].tolist() == ["base"]


def test_a_layout_of_another_version_is_read_by_its_definition(tmp_path: Path):
    """A command without its gains, as an older version could have had it."""
    text = "builtin_interfaces/Time stamp\nuint32 episode\nuint64 seq\nfloat64[2] torque\n"
    text += "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    sample = MotorCommand()
    sample.torque[:2] = 1.5, -2.0
    path = tmp_path / "old.mcap"
    with BagWriter(path) as writer:
        writer._schemas[MotorCommand.TYPE] = writer._writer.register_schema(
            MotorCommand.TYPE, "ros2msg", text.encode()
        )
        channel = writer.add_topic(MotorCommand.TOPIC, MotorCommand.TYPE)
        writer.write(channel, sample.to_bytes()[:44], 0, 0)
    table = read_tables(path)[MotorCommand.TOPIC]
    assert table.fields["torque.1"].tolist() == [-2.0]


def write_defined(path: Path, channels: list[tuple[str, str, str, list[bytes]]]) -> None:
    """A bag with a channel for each topic, type, definition and list of messages."""
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2")
        for topic, kind, text, list_ in channels:
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            channel = writer.register_channel(topic, "cdr", schema)
            for tick, raw in enumerate(list_):
                writer.add_message(channel, tick * TICK_NS, raw, tick * TICK_NS)
        writer.finish()


PAIR = b"\0\1\0\0\1\0\0\0\2\0\0\0"


def test_each_topic_is_read_by_its_own_definition(tmp_path: Path):
    path = tmp_path / "two.mcap"
    texts = {"/a": "int32 x\nint32 y\n", "/b": "int32 y\nint32 x\n"}
    write_defined(path, [(topic, "my/msg/Pair", text, [PAIR]) for topic, text in texts.items()])
    tables = read_tables(path)
    assert [int(tables["/a"].fields[name][0]) for name in "xy"] == [1, 2]
    assert [int(tables["/b"].fields[name][0]) for name in "xy"] == [2, 1]


@pytest.mark.parametrize(
    "other", ["int32  x # a comment\n\nuint8 C=1\nint32 y", "int32 y\nint32 x"]
)
def test_a_topic_with_two_definitions_is_refused_unless_their_fields_are_the_same(
    tmp_path: Path, other: str
):
    path = tmp_path / "two.mcap"
    texts = ["int32 x\nint32 y\n", other]
    write_defined(path, [("/a", "my/msg/Pair", text, [PAIR]) for text in texts])
    if "comment" in other:
        assert read_tables(path)["/a"].fields["x"].tolist() == [1, 1]
    else:
        with pytest.raises(BagError, match=r"the bag has two definitions of my/msg/Pair for it"):
            read_tables(path)


@pytest.mark.parametrize("kind", sorted(set(TYPES.values())))
def test_installed_definitions_have_the_fields_by_which_bags_are_read_fast(kind: str):
    index, topic = BagIndex(), next(topic for topic in TYPES if TYPES[topic] == kind)
    text = definition(kind)
    for variant in (text, re.sub(r"#.*|(?<= ) +", "", text)):
        schema = Schema(data=variant.encode(), encoding="ros2msg", id=1, name=kind)
        index.add_channel(0, Channel(1, topic, "cdr", {}, 1), schema, used=False)
        assert layout_problem(topic, index) == ""


def mode_of(vx: float, vy: float) -> bytes:
    sample = Mode()
    sample.vx[...], sample.vy[...] = vx, vy
    return sample.to_bytes()


@pytest.mark.parametrize("other", ["fields", "type", "big endian", "XCDR2"])
def test_messages_of_the_control_lane_are_read_as_the_bag_defines_them(tmp_path: Path, other: str):
    """Also where they have the size of this version's message."""
    path, raw, kind, text = (
        tmp_path / "bag.mcap",
        mode_of(0.5, -0.25),
        Mode.TYPE,
        definition(Mode.TYPE),
    )
    reason = "the bag's cassie_msgs/msg/Mode has float64 vy where this version has float64 vx"
    if other == "fields":
        lines = [
            line for line in text.splitlines() if line.startswith(("float64 vx", "float64 vy"))
        ]
        text = text.replace("\n".join(lines), "\n".join(reversed(lines)))
    elif other == "type":
        kind = "other_msgs/msg/Thing"
        reason = f"the bag names the message type {kind}, not {Mode.TYPE}"
    elif other == "big endian":
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(text, kind))
        message = store.deserialize_cdr(raw, kind)
        raw = bytes(store.serialize_cdr(message, kind, little_endian=False))
        reason = "cassie_msgs/msg/Mode in encoding 0000, not 0001"
    else:
        raw = b"\0\7" + raw[2:]
        reason = "cassie_msgs/msg/Mode in encoding 0007, not 0001"
    write_defined(path, [(Mode.TOPIC, kind, text, [raw])])
    for look in (read_recording, summarize):
        with pytest.raises(BagError, match=re.escape(reason)):
            look(path)
    if other == "XCDR2":
        with pytest.raises(BagError, match="encoding 0007, not 0000 or 0001"):
            read_tables(path)
        return
    fields = read_tables(path)[Mode.TOPIC].fields
    swapped = other == "fields"
    assert fields["vx"].tolist() == [-0.25 if swapped else 0.5]
    assert fields["vy"].tolist() == [0.5 if swapped else -0.25]


def test_a_definition_that_damage_changed_is_replaced_by_its_copy(tmp_path: Path, bag: Path):
    """Between chunks it has no checksum of its own."""
    content = bag.read_bytes()
    place = content.index(b"float64[20] q")
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content[:place] + b"float32" + content[place + 7 :])
    assert len(read_recording(path).rows(RobotState)) == 1000
    assert read_tables(path)[RobotState.TOPIC].fields["q"].shape == (1000, 20)


def test_one_long_word_does_not_lengthen_all_others(tmp_path: Path):
    """3000 words, each as long as the longest, would take 22 GiB."""
    path, long = tmp_path / "words.mcap", "x" * 2_000_000
    with BagWriter(path) as writer:
        channel = writer.add_topic("/word", "std_msgs/msg/String")
        for tick, word in enumerate(["short"] * 3000 + [long]):
            raw = b"\0\1\0\0" + (len(word) + 1).to_bytes(4, "little") + word.encode() + b"\0"
            writer.write(channel, raw, tick, tick)
    table = read_tables(path)["/word"]
    assert table.fields["data"].tolist()[-2:] == ["short", long]
    for form in ("csv", "npz"):
        done = command("export", path, "--format", form, "-o", tmp_path / form)
        assert done.returncode == 0, done.stderr
        left_out = ["export: /word: data is too long, left out"] if form == "npz" else []
        assert done.stderr.splitlines() == left_out
    with (tmp_path / "csv" / "word.csv").open(newline="") as stream:
        csv.field_size_limit(len(long))
        assert [len(row["data"]) for row in csv.DictReader(stream)][-2:] == [5, len(long)]
    with np.load(tmp_path / "npz" / "word.npz") as content:
        assert set(content) == {"time", "log_time", "publish_time"}


def test_joints_of_the_same_name_are_numbered(tmp_path: Path):
    store = get_typestore(Stores.ROS2_JAZZY)
    kind, none = "sensor_msgs/msg/JointState", np.zeros(0)
    stamp = store.types["builtin_interfaces/msg/Time"](1, 5)
    header = store.types["std_msgs/msg/Header"](stamp, "base")
    path = tmp_path / "joints.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic("/joint_states", kind)
        joints = store.types[kind](header, ["a", "a"], np.array([1.0, 2.0]), none, none)
        writer.write(channel, bytes(store.serialize_cdr(joints, kind)), 1, 1)
    found = read_tables(path)["/joint_states"].fields
    assert [found[f"position.{index}"].tolist() for index in (0, 1)] == [[1.0], [2.0]]
    assert not {name for name in found if "position" in name} - {"position.0", "position.1"}


def test_a_field_with_a_reserved_name_replaces_no_other(tmp_path: Path):
    path = tmp_path / "names.mcap"
    text = f"int32 time\nmy/Inner message\n{'=' * 80}\nMSG: my/Inner\nint32 time\n"
    write_defined(path, [("/a", "my/msg/Outer", text, [PAIR])])
    fields = read_tables(path)["/a"].fields
    assert {name: values.tolist() for name, values in fields.items()} == {
        "message.message.time": [1],
        "message.time": [2],
    }


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("export", ("BAG", "--topics", Mode.TOPIC)),
        ("plot", ("BAG",)),
        ("plot", ("BAG", "mode.vx")),
        ("compare", ("BAG", "BAG")),
    ],
)
def test_a_bag_that_is_not_whole_is_used_and_said_to_be_damaged(
    tmp_path: Path, bag: Path, verb: str, words
):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    output = {"export": "out", "plot": "out.png"}.get(verb)
    more = ["-o", tmp_path / output] if output else []
    done = command(verb, *[cut if word == "BAG" else word for word in words], *more)
    assert done.returncode == 0, done.stderr
    said = command("info", cut).stdout.splitlines()[1].partition(", ")[2]
    assert re.fullmatch(r"damaged or not closed: \d+ bytes could not be read; see recover", said)
    assert done.stderr.splitlines() == [f"{verb}: {cut} is {said}"] * words.count("BAG")


def test_of_a_damaged_bag_the_missing_messages_are_counted(tmp_path: Path, bag: Path):
    content = bytearray(bag.read_bytes())
    chunks = [part for part in parts(bag) if part[0] == Opcode.CHUNK]
    content[chunks[3][2] - 50] ^= 4
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    lost = chunks[3][2] - chunks[3][1]
    index = BagIndex()
    read_tables(path, [RobotState.TOPIC], None, index)
    expected = f"{lost} bytes could not be read, 100 messages between the others are missing"
    assert index.damage == f"damaged or not closed: {expected}; see recover"


def test_times_are_the_nearest_numbers_to_those_of_the_clock():
    times = np.array([18_000_000, 10**18, 1_700_000_000_018_000_000])
    table = Table("/topic", "a/msg/B", times, times, {})
    assert table.columns()["time"].tolist() == [0.018, 1e9, 1_700_000_000.018]


@pytest.mark.parametrize("log_time", [2**63, 2**64 - 1])
def test_log_times_of_64_bits_are_read_as_they_are(tmp_path: Path, log_time: int):
    path = tmp_path / "late.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic("/count", "std_msgs/msg/UInt32")
        for time in (log_time - 5, log_time):
            writer.write(channel, b"\0\1\0\0\7\0\0\0", time, time)
    tables = read_tables(path)
    assert tables["/count"].log_time.tolist() == [log_time - 5, log_time]
    for form in ("csv", "npz"):
        done = command("export", path, "--format", form, "-o", tmp_path / form)
        assert done.returncode == 0, done.stderr
    with (tmp_path / "csv" / "count.csv").open(newline="") as stream:
        assert [int(row["log_time"]) for row in csv.DictReader(stream)][1] == log_time
    done = command("plot", path, "count.data", "-o", tmp_path / "count.png")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("form", ["csv", "npz", "parquet"])
def test_numbers_of_64_bits_keep_all_bits(tmp_path: Path, form: str):
    path, values = tmp_path / "large.mcap", [0, 2**63 + 1, 2**64 - 1]
    with BagWriter(path) as writer:
        channel = writer.add_topic("/count", "std_msgs/msg/UInt64")
        for time, value in enumerate(values):
            writer.write(channel, b"\0\1\0\0" + value.to_bytes(8, "little"), time, time)
    if form == "parquet":
        parquet = pytest.importorskip("pyarrow.parquet", reason="the extra parquet")
    export(read_tables(path), tmp_path / "out", form)
    file = tmp_path / "out" / f"count.{form}"
    if form == "csv":
        with file.open(newline="") as stream:
            assert [int(row["data"]) for row in csv.DictReader(stream)] == values
    elif form == "npz":
        assert np.load(file)["data"].tolist() == values
    else:
        assert parquet.read_table(file)["data"].to_pylist() == values


def write_mixed_bag(path: Path, encodings: dict[str, str]) -> None:
    """A bag with one message for each topic, in the given encoding; only "cdr" can be read."""
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2")
        string = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        other = writer.register_schema("thing", "jsonschema", b"{}")
        idl = writer.register_schema("std_msgs/msg/Char", "ros2idl", b"module std_msgs {};")
        for topic, encoding in encodings.items():
            schema = {"cdr": string, "idl": idl, "none": 0}.get(encoding, other)
            name = "cdr" if schema == idl else encoding
            channel = writer.register_channel(topic, name, schema)
            writer.add_message(channel, 0, b"\0\1\0\0\3\0\0\0hi\0", 0)
        writer.finish()


def test_topics_that_cannot_be_read_are_named_and_the_others_are_exported(tmp_path: Path):
    path, out = tmp_path / "mixed.mcap", tmp_path / "out"
    write_mixed_bag(path, {"/text": "cdr", "/json": "json", "/idl": "idl", "/bare": "none"})
    done = command("export", path, "-o", out)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines() == [
        "export: /bare is left out: its messages are encoded as none, not as cdr",
        "export: /idl is left out: the definition of std_msgs/msg/Char is written in ros2idl, "
        "not in ros2msg",
        "export: /json is left out: its messages are encoded as json, not as cdr",
    ]
    assert sorted(file.name for file in out.iterdir()) == ["fields.csv", "text.csv"]
    with (out / "text.csv").open() as stream:
        assert [row["data"] for row in csv.DictReader(stream)] == ["hi"]


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_every_topic_has_a_file_of_its_own_whatever_its_name(tmp_path: Path, form: str):
    path, out = tmp_path / "names.mcap", tmp_path / "out"
    plain = {"/c/d": "c_d", "/a__b": "a__b", "/.hidden": "_hidden", "/a\nb": "a_b"}
    odd = ["/fields", "/", "", "/a/b", "/a_b", "/A", "/a", "/" + "l" * 300, "/" + "l" * 301, "/é\0"]
    odd.append("/a_b_662b7b62")  # the digits of /a/b
    write_mixed_bag(path, dict.fromkeys([*plain, *odd], "cdr"))
    done = command("export", path, "-o", out, "--format", form)
    assert done.returncode == 0, done.stderr
    with (out / "fields.csv").open(newline="") as stream:
        file_of = {row["topic"]: row["file"] for row in csv.DictReader(stream)}
    assert sorted(file_of) == sorted([*plain, *odd])
    assert len(set(map(str.lower, file_of.values()))) == len(file_of)
    assert {file.name for file in out.iterdir()} == {*file_of.values(), "fields.csv"}
    assert all(re.fullmatch(rf"[\w-]+\.{form}", name, re.ASCII) for name in file_of.values())
    assert [file_of[topic] for topic in ("/c/d", "/a__b", "/.hidden")] == [
        f"{plain[topic]}.{form}" for topic in ("/c/d", "/a__b", "/.hidden")
    ]
    assert re.fullmatch(rf"a_b_[0-9a-f]{{8}}\.{form}", file_of["/a/b"])
    command("export", path, "-o", tmp_path / "one", "--format", form, "--topics", "/fields")
    assert (tmp_path / "one" / file_of["/fields"]).is_file()


def test_a_bag_of_which_no_topic_can_be_read_is_not_exported(tmp_path: Path):
    path, out = tmp_path / "json.mcap", tmp_path / "out"
    write_mixed_bag(path, {"/json": "json"})
    done = command("export", path, "-o", out)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == f"export: error: {path}: no topic can be read"
    assert "/json is left out" in done.stderr
    assert not out.exists()
    with pytest.raises(BagError, match="/json cannot be read: its messages are encoded as json"):
        read_tables(path)


def foreign(path: Path, topics: list[tuple[str, str, bytes]]) -> None:
    """A bag of another program, with three messages on each topic of a type (none if empty)."""
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2")
        for topic, kind, data in topics:
            text = b"uint32 data\n" if kind.endswith("UInt32") else b"string data\n"
            schema = writer.register_schema(kind, "ros2msg", text) if kind else 0
            channel = writer.register_channel(topic, "cdr", schema)
            for time in range(3):
                writer.add_message(channel, time, data, time)
        writer.finish()


COUNT = ("/count", "std_msgs/msg/UInt32", b"\0\1\0\0\7\0\0\0")
WORD = ("/word", "std_msgs/msg/String", b"\0\1\0\0\2\0\0\0a\0")


@pytest.mark.parametrize(
    ("topics", "types", "reason"),
    [
        ([("/json", "", b"{}")], "(no schema)", "the bag names no message type"),
        (
            [COUNT, ("/count", *WORD[1:])],
            "std_msgs/msg/UInt32, std_msgs/msg/String",
            "the bag names two message types, std_msgs/msg/UInt32 and std_msgs/msg/String",
        ),
    ],
    ids=["no schema", "two types"],
)
def test_a_topic_without_one_type_is_told_and_left_out(tmp_path: Path, topics, types, reason):
    path = tmp_path / "foreign.mcap"
    foreign(path, [*topics, WORD])
    done = command("info", path)
    assert done.returncode == 0, done.stderr
    assert re.search(rf"{topics[0][0]} +{re.escape(types)} +{3 * len(topics)} ", done.stdout)
    assert "whole" in done.stdout
    done = command("export", path, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert f"{topics[0][0]} is left out: {reason}" in done.stderr
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"word.csv", "fields.csv"}
    for words, code in ((["--topics", topics[0][0], "/word"], 0), (["--topics", topics[0][0]], 2)):
        done = command("export", path, "-o", tmp_path / f"named{code}", *words)
        assert done.returncode == code
        assert reason in done.stderr and "Traceback" not in done.stderr
    with pytest.raises(BagError, match=re.escape(reason)):
        read_curves(path, [f"{topics[0][0]}.data"])


@pytest.mark.parametrize("topic", [STATUS_TOPIC, DIAGNOSTICS_TOPIC])
def test_a_summary_reads_no_reports_of_another_type(tmp_path: Path, topic: str):
    path = tmp_path / "foreign.mcap"
    foreign(path, [(topic, *WORD[1:])])
    summary = summarize(path)
    assert summary.topics == [TopicSummary(topic, WORD[1], 3, pytest.approx(1e9))]
    assert summary.problems == summary.faults == []


def test_a_file_that_metadata_names_twice_is_not_read_twice(tmp_path: Path):
    foreign(tmp_path / "a.mcap", [COUNT])
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n"
        "  storage_identifier: mcap\n"
        "  relative_file_paths: [a.mcap, ./a.mcap]\n"
    )
    with pytest.raises(BagError, match=r"metadata\.yaml names a\.mcap twice"):
        summarize(tmp_path)


def test_nothing_is_overwritten_and_nothing_half_written(tmp_path: Path, bag: Path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "cassie_state.csv").write_text("mine")
    done = command("export", bag, "-o", out)
    assert done.returncode == 2
    assert "cassie_state.csv exists" in done.stderr
    assert [path.name for path in out.iterdir()] == ["cassie_state.csv"]
    assert (out / "cassie_state.csv").read_text() == "mine"


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_results_that_could_not_be_written_whole_do_not_stay(tmp_path: Path, failure):
    here, there = tmp_path / "a.csv", tmp_path / "new" / "folder" / "b.csv"

    def write() -> None:
        with new_files([here, there]) as (one, _):
            one.write_text("half a line")
            raise failure

    if isinstance(failure, OSError):
        with pytest.raises(BagError, match=f"cannot write {tmp_path}: No space left on device"):
            write()
    else:
        with pytest.raises(KeyboardInterrupt):
            write()
    assert list(tmp_path.iterdir()) == []


def test_results_appear_whole_and_never_over_a_file(tmp_path: Path):
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    with new_files([one, other]) as parts:
        for part in parts:
            assert part.parent == tmp_path and part.suffix == ".csv"
            part.write_text("new")
        assert not one.exists()
    assert sorted(tmp_path.iterdir()) == [one, other]
    one.unlink()
    with pytest.raises(BagError, match="other"):  # noqa: SIM117
        with new_files([one, other]) as parts:
            for part in parts:
                part.write_text("newer")
    assert other.read_text() == "new"
    assert list(tmp_path.iterdir()) == [other]


@pytest.mark.parametrize(
    ("verb", "words", "output"),
    [
        ("export", ("BAG",), "out"),
        ("export", ("BAG", "--format", "npz"), "out"),
        ("plot", ("BAG", "state.q.yaw"), "out.svg"),
        ("plot", ("BAG",), "out.png"),
        ("compare", ("BAG", "BAG"), "out.png"),
        ("recover", ("BAG",), "out.mcap"),
    ],
)
def test_a_full_disk_leaves_nothing(tmp_path: Path, bag: Path, verb: str, words, output: str):
    """The disk is full for this process: no file may have more than 4 kB."""

    def fill() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))

    given = [str(bag) if word == "BAG" else word for word in words]
    done = subprocess.run(
        [sys.executable, "-m", f"cassie_bags.cli.{verb}", *given, "-o", tmp_path / output],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        preexec_fn=fill,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(f"{verb}: error: cannot write {tmp_path / output}")
    assert "File too large" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_page_that_could_not_be_written_whole_does_not_stay(tmp_path: Path, bag, monkeypatch):
    def write_half(path: Path, text: str, encoding: str) -> None:
        path.write_bytes(text[:1000].encode(encoding))
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", write_half)
    assert report.main([str(bag), "--no-video", "-o", str(tmp_path / "page.html")]) == 2
    assert list(tmp_path.iterdir()) == []


def test_parquet_without_its_library_says_what_to_install(tmp_path: Path, bag: Path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(BagError, match="pip install pyarrow"):
        export(read_tables(bag, [Mode.TOPIC]), tmp_path / "out", "parquet")
    assert not (tmp_path / "out").exists()


VERBS = {"info": (), "export": (), "plot": (), "compare": ("BAG",), "report": ()}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("missing.mcap", None, "No such file or directory"),
        ("empty.mcap", b"", "is empty"),
        ("ros1.bag", b"#ROSBAG V2.0\n" + bytes(100), "is not an MCAP file"),
        ("old.db3", b"SQLite format 3\0" + bytes(100), "ros2 bag convert"),
        ("short.mcap", b"\x89MCA", "is not an MCAP file"),
        ("only_magic.mcap", b"\x89MCAP0\r\n", "holds no"),
        ("folder", "", "holds no MCAP file"),
        ("db3", "old.db3", "ros2 bag convert"),
    ],
)
def test_what_is_no_bag_is_one_line(tmp_path: Path, bag: Path, verb, name, content, reason):
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        path.mkdir()
        if content:
            (path / content).write_bytes(b"")
    others = [bag if word == "BAG" else word for word in VERBS[verb]]
    before = sorted(tmp_path.rglob("*"))
    done = command(verb, path, *others)
    assert done.returncode == 2, done.stdout
    assert reason in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()[-1]) < 400
    assert sorted(tmp_path.rglob("*")) == before


def test_info_is_text_or_json(bag: Path):
    done = command("info", bag)
    assert done.returncode == 0, done.stderr
    assert "/cassie/state " in done.stdout and "500.0" in done.stdout
    assert "nothing: seq has no gap" in done.stdout
    assert "0.00 .. 1.98 s  walk" in done.stdout
    done = command("info", bag, "--json")
    assert '"whole": true' in done.stdout


def test_each_message_of_a_folder_is_read_once(folder: Path, messages):
    assert sum(1 for _ in read_messages(folder)) == sum(map(len, messages.values()))


def test_a_bag_is_the_same_as_itself_in_another_container(bag: Path, folder: Path):
    done = command("compare", bag, folder)
    assert done.returncode == 0, done.stderr
    assert "the same to the last bit" in done.stdout


def test_the_first_difference_has_its_field_tick_and_values(tmp_path: Path, messages):
    one, other = (from_messages(messages, 1.0) for _ in range(2))
    lane = {topic: rows.copy() for topic, rows in other.lane.items()}
    state = lane[RobotState.TOPIC]
    state["episode"] += 4  # which tells runs apart
    state["q"][700:, 3] += 1e-6
    state["v"][650, 0] = -0.0  # which equals 0, but is another bit
    state["covariance"][:, 0] = np.nan
    same = {**one.lane, RobotState.TOPIC: one.lane[RobotState.TOPIC].copy()}
    same[RobotState.TOPIC]["covariance"][:, 0] = np.nan
    lane[MotorCommand.TOPIC] = lane[MotorCommand.TOPIC][:-5]
    found = {
        c.topic: c for c in compare_recordings(replace(one, lane=same), replace(other, lane=lane))
    }
    assert found[RobotState.TOPIC].first == Difference(
        RobotState.TOPIC, "v.x", 1, 650, 1.3, (0.0, -0.0)
    )
    assert found[RobotState.TOPIC].different == 301
    assert found[Sensors.TOPIC].same
    command = found[MotorCommand.TOPIC]
    assert (command.counts, command.common, command.different) == ((1000, 995), 995, 0)
    assert not command.same


def gaits(results, vx=0.4):
    """Requests and their answers, one pair every 250 ticks."""
    messages = {GaitRequest.TOPIC: [], Gait.TOPIC: []}
    for index, result in enumerate(results):
        request, gait = GaitRequest(), Gait()
        gait.result[...], gait.vx[...] = int(result), vx
        for message in (request, gait):
            message.seq[...], message.episode[...] = 250 * index, 1
            message.stamp_ns = 250 * index * TICK_NS
            messages[message.TOPIC].append(message.to_bytes())
    return messages


FOUND_TWICE = (GaitResult.FOUND, GaitResult.FOUND)


def test_gaits_are_compared_where_both_bags_have_them(tmp_path: Path, bag: Path, messages):
    one, same, other = (tmp_path / f"{name}.mcap" for name in ("one", "same", "other"))
    for path, found in ((one, gaits(FOUND_TWICE)), (same, gaits(FOUND_TWICE)),
                        (other, gaits(FOUND_TWICE, vx=0.5))):  # fmt: skip
        write_bag(path, messages | found)
    done = command("compare", one, same)
    assert done.returncode == 0, done.stdout
    assert re.search(r"/cassie/gait +2 +2 +2 +0", done.stdout)
    done = command("compare", one, other)
    assert done.returncode == 1
    assert "first difference of /cassie/gait: vx at tick 0 (0.000 s): 0.4 against 0.5" in (
        done.stdout
    )
    done = command("compare", one, bag)
    assert done.returncode == 1
    assert "in one bag only: /cassie/gait, /cassie/gait_request" in done.stdout


@pytest.mark.parametrize("topic", ["/parameter_events", "/rosout", "/diagnostics"])
def test_topics_of_the_machinery_make_no_two_runs_different(
    tmp_path: Path, bag: Path, messages, topic: str
):
    path = tmp_path / "more.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic(topic, EVENT)
        writer.write(channel, b"", 0, 0)
        lane = {name: writer.add_topic(name, TYPES[name], QOS_LANE) for name in messages}
        for name, list_ in messages.items():
            for tick, raw in enumerate(list_):
                writer.write(lane[name], raw, tick * TICK_NS, tick * TICK_NS)
    done = command("compare", bag, path)
    assert done.returncode == 0, done.stdout
    assert f"{topic}: 0 messages against 1" in done.stdout
    assert "in one bag only" not in done.stdout


def test_info_counts_made_gaits_by_their_result(tmp_path: Path, bag: Path, messages):
    results = (*FOUND_TWICE, GaitResult.REFUSED, GaitResult.NOT_CERTIFIED)
    path = tmp_path / "made.mcap"
    write_bag(path, messages | gaits(results))
    shown = command("info", path).stdout
    assert "made gaits   4 answers: 2 found, 1 refused, 1 not certified\n" in shown
    assert "made gaits" not in command("info", bag).stdout
    assert len(read_recording(path).rows(Gait)) == 4
    assert len(read_recording(bag).rows(Gait)) == 0


def test_a_truth_value_that_is_another_byte_is_a_difference(messages):
    """Damage may leave any byte where a message has true or false."""
    recordings = []
    for byte in (1, 2):
        recording = glide(1.0)
        rows = recording.lane[OperatorCommand.TOPIC].copy()
        rows["power"].view(np.uint8)[3] = byte
        lane = {**recording.lane, OperatorCommand.TOPIC: rows}
        recordings.append(recording.with_rows({**lane, **recording.stamped}))
    one, other = recordings
    (found,) = [each for each in compare_recordings(one, other) if not each.same]
    assert found.first is not None
    assert (found.first.field, found.first.values) == ("power", (True, 2))


def test_compare_tells_a_difference_by_its_exit_code_and_draws_both(tmp_path: Path, bag: Path):
    other = tmp_path / "other.mcap"
    write_bag(other, glide_messages(2.0, vx=0.4))
    picture = tmp_path / "both.png"
    done = command("compare", bag, other, "-o", picture)
    assert done.returncode == 1, done.stderr
    assert (
        "first difference of /cassie/mode: vx at tick 0 (0.000 s): 0.5 against 0.4" in done.stdout
    )
    assert re.search(r"vx_mean +0.5 +0.4 +-0.1", done.stdout)
    assert picture.stat().st_size > 10_000


def test_without_a_true_pose_runs_are_compared_by_the_estimate(tmp_path: Path, bag: Path, messages):
    blind = tmp_path / "blind.mcap"
    write_bag(blind, {t: raw for t, raw in messages.items() if t != GROUND_TRUTH_TOPIC})
    for other, holders in ((blind, "A and B hold"), (bag, "A holds")):
        done = command("compare", blind, other, "-o", tmp_path / f"{other.stem}.png")
        assert done.returncode == (other is not blind), done.stderr
        assert f"{holders} no true pose: the figures of both are from the estimate" in done.stdout
        assert re.search(r"vx_mean +0 +0 +0\n", done.stdout)  # the estimate of this robot rests


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        ("/nosuch", "known: /cassie/sensors, /diagnostics"),
        ("/cassie/foo", "known: /cassie/sensors, /diagnostics"),
        ("/sensors", "did you mean /cassie/sensors?"),
        ("/cassie/sensor", "did you mean /cassie/sensors?"),
        ("/diagnostic", "did you mean /diagnostics?"),
    ],
)
def test_only_a_similar_topic_is_suggested(name: str, answer: str):
    topics = ["/cassie/sensors", "/diagnostics"]
    assert unknown_topic(name, topics) == f"unknown topic {name}: {answer}"


def test_a_field_is_found_by_its_short_name(bag: Path):
    (yaw, velocity, whole) = read_curves(
        bag, ["state.q.yaw", "mode.vx", "/cassie/sensors.drive_torque"]
    )
    recording = read_recording(bag)
    np.testing.assert_array_equal(yaw.columns["yaw"], recording.rows(RobotState)["q"][:, 3])
    assert (yaw.name, yaw.unit) == ("/cassie/state.q.yaw", "rad")
    assert list(velocity.columns) == ["vx"]
    assert tuple(whole.columns) == fields.DRIVES
    np.testing.assert_allclose(whole.time, np.arange(1000) * 0.002)
    with pytest.raises(BagError, match=r"did you mean q\.yaw"):
        read_curves(bag, ["state.q.jaw"])


def test_plots_are_drawn_and_never_over_a_file(tmp_path: Path, bag: Path):
    for words in ((), ("state.q.yaw", "sensors.drive_torque")):
        path = tmp_path / f"{len(words)}.png"
        done = command("plot", bag, *words, "-o", path)
        assert done.returncode == 0, done.stderr
        assert path.stat().st_size > 10_000
        before = path.read_bytes()
        assert command("plot", bag, *words, "-o", path).returncode == 2
        assert path.read_bytes() == before


@pytest.mark.parametrize("values", [[1e308, -1e308], [1e308, 1e308], [1.0, 2.0, np.inf, -1e301]])
def test_numbers_beyond_any_axis_are_counted_and_not_drawn(tmp_path: Path, values: list[float]):
    path = tmp_path / "large.mcap"
    raw = [b"\0\1\0\0" + np.float64(value).tobytes() for value in values]
    write_defined(path, [("/x", "std_msgs/msg/Float64", "float64 data\n", raw)])
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        (curve,) = read_curves(path, ["x.data"])
        save_curves([curve], [], [], "large", tmp_path / "large.svg")
    assert "/x.data, without 2 values beyond 1e+300" in (tmp_path / "large.svg").read_text()
    done = command("plot", path, "x.data", "-o", tmp_path / "large.png")
    assert (done.returncode, done.stderr) == (0, "")


def test_plots_of_fields_mark_what_happened(tmp_path: Path, bag: Path):
    """In the time of the bag, which goes on over episodes."""
    experiment = "duration: 5\nstart: standing\npushes: [{t: 1.0, force: [20, 0, 0]}]\n"
    messages = {topic: list(raw) for topic, raw in glide_messages(2.0, tilt_from=1.5).items()}
    for topic, more in glide_messages(2.0, episode=2).items():
        messages[topic] += more
    path = tmp_path / "two.mcap"
    with BagWriter(path) as writer:
        write_messages(writer, messages)
        writer.add_metadata("cassie_experiment", {"file": experiment})
    events = [(event.kind, round(event.t0, 2)) for event in events_of_bag(summarize(path))]
    assert events == [("push", 1.0), ("fall", 1.5), ("push", 3.0)]
    for source in (path, bag):
        done = command("plot", source, "state.q.yaw", "-o", tmp_path / f"{source.stem}.svg")
        assert done.returncode == 0, done.stderr
    drawn, without = ((tmp_path / f"{name}.svg").read_text() for name in ("two", "bag"))
    assert drawn.count(EVENT_COLOURS["push"]) > 3
    assert EVENT_COLOURS["push"] not in without


@pytest.mark.parametrize("verb", VERBS)
def test_a_missing_bag_is_told_before_anything_heavy_is_loaded(verb: str):
    done = play(verb, "missing.mcap", *(["other.mcap"] if VERBS[verb] else []))
    assert done.returncode == 2, done.stderr
    assert "missing.mcap: No such file or directory" in done.stderr


def test_what_is_in_one_bag_only_is_said_beside_the_verdict(tmp_path: Path, bag: Path, messages):
    """Two bags without a control lane were "the same to the last bit"."""
    more, none = tmp_path / "more.mcap", tmp_path / "none.mcap"
    with BagWriter(none) as writer:
        channel = writer.add_topic("/clock", "rosgraph_msgs/msg/Clock")
        writer.write(channel, bytes(12), 1, 1)
    with BagWriter(more) as writer:
        write_messages(writer, messages)
        writer.write(writer.add_topic("/clock", "rosgraph_msgs/msg/Clock"), bytes(12), 1, 1)
    done = command("compare", none, none)
    assert done.returncode == 2
    assert "nothing to compare" in done.stderr
    done = command("compare", bag, more)
    assert done.returncode == 1
    assert done.stdout.index("the same to the last bit") < done.stdout.index("only: /clock")
    done = command("compare", bag, none)
    assert "no figures: " in done.stdout


def test_a_topic_alone_or_empty_is_told_as_such(tmp_path: Path, bag: Path):
    with pytest.raises(BagError, match=r"mode is a topic: name a field of it, mode\.FIELD"):
        read_curves(bag, ["mode"])
    with BagWriter(tmp_path / "empty.mcap") as writer:
        writer.add_topic(Mode.TOPIC, Mode.TYPE)
        writer.write(writer.add_topic("/clock", "rosgraph_msgs/msg/Clock"), bytes(12), 1, 1)
    with pytest.raises(BagError, match="holds no message of /cassie/mode"):
        read_curves(tmp_path / "empty.mcap", ["mode.vx"])
    done = command(
        "export", tmp_path / "empty.mcap", "-o", tmp_path / "out", "--topics", "/clock", Mode.TOPIC
    )
    assert done.returncode == 0, done.stderr
    assert "/cassie/mode holds no message: left out" in done.stderr


def test_constants_of_a_message_are_no_data(tmp_path: Path):
    store = get_typestore(Stores.ROS2_JAZZY)
    kind, types = "diagnostic_msgs/msg/DiagnosticStatus", store.types
    path = tmp_path / "status.mcap"
    with BagWriter(path) as writer:
        channel = writer.add_topic("/status", kind)
        message = types[kind](1, "battery", "low", "", [])
        writer.write(channel, bytes(store.serialize_cdr(message, kind)), 1, 1)
    assert list(read_tables(path)["/status"].fields) == ["level", "name", "message", "hardware_id"]


def test_the_rate_of_a_topic_is_that_of_the_run(tmp_path: Path, messages):
    """Others wrote to it as well: in their shorter span there was no such rate."""
    with BagWriter(tmp_path / "mixed.mcap") as writer:
        for topic, list_ in messages.items():
            channel = writer.add_topic(topic, TYPES[topic])
            for tick, raw in enumerate(list_):
                if topic == Sensors.TOPIC and tick % 2:
                    stray = Sensors()
                    stray.load(raw)
                    stray.episode[...] = 99
                    writer.write(channel, stray.to_bytes(), 1_900_000_000, tick)
                writer.write(channel, raw, tick * TICK_NS, tick * TICK_NS)
    summary = summarize(tmp_path / "mixed.mcap")
    (sensors,) = (topic for topic in summary.topics if topic.topic == Sensors.TOPIC)
    assert sensors.count == 1500
    assert round(sensors.rate) == 500


def test_wall_time_is_told_without_a_robot_too(tmp_path: Path):
    with BagWriter(tmp_path / "clock.mcap") as writer:
        channel = writer.add_topic("/clock", "rosgraph_msgs/msg/Clock")
        for second in range(3):
            writer.write(channel, bytes(12), 0, (5 + second) * 1_000_000_000)
    assert summarize(tmp_path / "clock.mcap").wall_time == pytest.approx(2.0)


@pytest.mark.parametrize("verb", ["info", "plot"])
def test_a_closed_stdout_is_no_traceback(bag: Path, verb: str, tmp_path: Path):
    words = " ".join([sys.executable, "-m", f"cassie_bags.cli.{verb}", str(bag)])
    more = f"-o {tmp_path / 'out.png'}" if verb == "plot" else ""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        ["sh", "-c", f"{words} {more} >&-"],
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        check=False,
    )
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr


def test_a_page_is_html_and_links_in_a_circle_are_no_traceback(tmp_path: Path, bag: Path):
    done = command("report", bag, "-o", tmp_path / "page.pdf")
    assert done.returncode == 2
    assert "page.pdf does not end in .html" in done.stderr
    (tmp_path / "a.mcap").symlink_to(tmp_path / "b.mcap")
    (tmp_path / "b.mcap").symlink_to(tmp_path / "a.mcap")
    done = command("recover", tmp_path / "a.mcap")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
