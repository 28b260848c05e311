"""Experiments with every node as a process, and the same one without ROS."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rosbags.highlevel import AnyReader
from same import differences

from cassie_bags.bag.continuity import gaps
from cassie_bags.bag.reader import read_messages
from cassie_bags.bag.recording import KNOWN_TYPES, TYPES, read_recording
from cassie_bags.bag.rows import stamps_ns
from cassie_bags.errors import RunError
from cassie_bags.ros.processes import Processes, environment, executable, own_domain
from cassie_bags.run.verify import verify
from cassie_gaits.link_frames import LinkPoses
from cassie_msgs.layout import Gait, RobotState

TEXT = """
start: standing
seed: 6
duration: 5.0
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.98}
  - {t: 1.0, mode: walk}
pushes:
  - {t: 3.0, duration: 0.1, force: [0.0, 20.0, 0.0]}
expect:
  fell: null
"""


@pytest.fixture(scope="module", autouse=True)
def installed() -> None:
    try:
        executable("cassie_bags", "experiment")
        executable("cassie_control", "gait_controller")
    except RunError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("experiment") / "try.yaml"
    path.write_text(TEXT)
    return path


def experiment(*words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [executable("cassie_bags", "experiment"), *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@contextmanager
def both_cores_loaded() -> Iterator[None]:
    command = [sys.executable, "-c", "while True: pass"]
    burners = [subprocess.Popen(command) for _ in range(os.cpu_count() or 2)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def test_over_dds_twice_and_in_one_process_every_sample_is_the_same(file: Path, tmp_path: Path):
    folders = [tmp_path / name for name in ("dds", "loaded", "process", "stack")]
    runs = [experiment(file, "--out", folders[0], "--no-pictures")]
    with both_cores_loaded():
        runs.append(experiment(file, "--out", folders[1], "--no-pictures"))
    runs.append(experiment(file, "--out", folders[2], "--no-pictures", "--in-process"))
    runs.append(experiment(file, "--out", folders[3], "--no-pictures", "--stack"))
    for run in runs:
        assert run.returncode == 0, run.stderr
    dds, loaded, process, stack = (read_recording(folder / "bag.mcap") for folder in folders)
    assert gaps(dds) == gaps(loaded) == gaps(process) == gaps(stack) == []
    assert len(process.truth) == 2500
    assert differences(dds, process, TYPES) == []
    assert differences(loaded, process, TYPES) == []
    assert differences(stack, process, TYPES) == []
    contents = [json.loads(run.stdout) for run in runs]
    for key in ("phases", "peak_torque", "draw"):
        assert contents[0][key] == contents[2][key]
    _check_other_topics(folders[0] / "bag.mcap")
    for folder in (folders[0], folders[2]):
        _check_transforms(folder / "bag.mcap")


def test_made_gaits_are_the_same_over_dds_and_in_one_process(file: Path, tmp_path: Path):
    made = ("--no-pictures", "--set", "controller.gait_source=optimizer")
    bags = []
    for name, words in (("dds", ()), ("process", ("--in-process",))):
        run = experiment(file, "--out", tmp_path / name, *made, *words)
        assert run.returncode == 0, run.stderr
        bags.append(read_recording(tmp_path / name / "bag.mcap"))
    dds, process = bags
    assert len(process.rows(Gait)) > 0
    assert differences(dds, process, KNOWN_TYPES) == []


def _check_other_topics(bag: Path) -> None:
    """Beside the control lane, the bag has what ROS tools want to see."""
    with AnyReader([bag]) as reader:
        topics = reader.topics
        for topic in ("/clock", "/joint_states", "/imu/data", "/odom", "/diagnostics"):
            assert topics[topic].msgcount > 3
        assert topics["/robot_description"].msgcount == 1


def _check_transforms(bag: Path) -> None:
    """The frames on /tf and /tf_static are the URDF's, and where the state says."""
    rows = read_recording(bag).rows(RobotState)
    states = dict(zip(stamps_ns(rows).tolist(), rows["q"], strict=True))
    links = LinkPoses()
    with AnyReader([bag]) as reader:
        found: dict[str, list] = {"/robot_description": [], "/tf_static": [], "/tf": []}
        for connection, _, raw in reader.messages():
            if connection.topic in found:
                found[connection.topic].append(reader.deserialize(raw, connection.msgtype))
    ((description,), (fixed,), moving) = found.values()
    frames = {entry.child_frame_id: entry.header.frame_id for entry in fixed.transforms}
    frames |= {entry.child_frame_id: entry.header.frame_id for entry in moving[0].transforms}
    joints = ElementTree.fromstring(description.data).iter("joint")
    expected = {
        joint.find("child").get("link"): joint.find("parent").get("link") for joint in joints
    }
    assert frames == expected | {"base_link": "odom"}
    assert len(moving) > 200
    for message in moving:
        stamp = message.transforms[0].header.stamp
        poses = links.at(states[stamp.sec * 10**9 + stamp.nanosec])
        for entry, pose in zip(message.transforms, poses, strict=True):
            t, r = entry.transform.translation, entry.transform.rotation
            assert np.array_equal([t.x, t.y, t.z, r.x, r.y, r.z, r.w], pose)


RIDE = """
scene: segway
scene_parameters: {let_go: 5.5}
start: gantry
seed: 6
duration: 8.0
gantry:
  - {t: 0.02, hold: 1.35, speed: 1.0}
  - {t: 1.0, height: 0.785, speed: 0.3}
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.65}
  - {t: 4.2, mode: segway}
rider:
  targets:
    - {t: 5.0, speed: 1.0, heading: 0.1}
expect:
  fell: false
  metrics:
    drift: {min: 0.3}
"""


def test_a_ride_is_the_same_over_dds_and_in_one_process(tmp_path: Path):
    """Its rider sees the truth, and the Segway's own topics are in the bag."""
    path = tmp_path / "ride.yaml"
    path.write_text(RIDE)
    folders = [tmp_path / name for name in ("dds", "process")]
    for folder, words in zip(folders, ((), ("--in-process",)), strict=True):
        run = experiment(path, "--out", folder, "--no-pictures", *words)
        assert run.returncode == 0, run.stderr
    dds, process = (read_recording(folder / "bag.mcap") for folder in folders)
    assert len(process.segway) == len(process.segway_imu) == 800
    assert differences(dds, process, TYPES) == []


def test_gaits_are_made_where_an_experiment_asks_for_them(tmp_path: Path):
    file = tmp_path / "made.yaml"
    file.write_text(
        "duration: 5.0\nseed: 3\nstart: standing\ncontroller: {gait_source: optimizer}\n"
        "operator:\n- {t: 0.0, power: true, mode: stand, height: 0.95}\n"
        "- {t: 0.6, mode: walk, vx: 0.3}\n"
    )
    out = tmp_path / "out"
    assert experiment(file, "--no-pictures", "--out", out).returncode == 0
    gaits = list(read_messages(out / "bag.mcap", [Gait.TOPIC]))
    assert len(gaits) >= 2
    assert verify(out / "bag.mcap").differences == []


def test_a_node_that_ends_ends_the_run_with_its_words(file: Path):
    run = experiment(file, "--set", "simulator.video=/none/such/film.mp4")
    assert run.returncode == 3
    assert run.stdout == ""
    assert run.stderr.startswith("experiment: error: simulator ended with exit code 2: ")
    assert "there is no folder /none/such" in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_a_file_that_no_node_could_use_is_refused_before_any_starts(file: Path):
    run = experiment(file, "--set", "gait_library=/dev/null")
    assert run.returncode == 2
    assert "/dev/null" in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_ctrl_c_ends_every_process(file: Path, tmp_path: Path):
    with own_domain() as domain, Processes(environment(domain), tmp_path / "log") as processes:
        command = [executable("cassie_bags", "experiment"), file, "--out", tmp_path / "out"]
        processes.start("experiment", [*command, "--set", "duration=600"])
        log = tmp_path / "out" / "log" / "simulator.log"
        deadline = time.monotonic() + 100.0
        while not (log.is_file() and "running at tick 0" in log.read_text()):
            assert processes.running("experiment"), processes.log("experiment").read_text()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert _processes_of(tmp_path) >= 6
        processes.signal("experiment", signal.SIGINT)
        while processes.running("experiment"):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert processes.log("experiment").read_text().splitlines()[-1] == "experiment: stopped"
    assert _processes_of(tmp_path) == 0


def test_a_killed_runner_leaves_no_process_behind(file: Path, tmp_path: Path):
    with own_domain() as domain, Processes(environment(domain), tmp_path / "log") as processes:
        command = [executable("cassie_bags", "experiment"), file, "--out", tmp_path / "out"]
        processes.start("experiment", [*command, "--set", "duration=600"])
        deadline = time.monotonic() + 100.0
        while _processes_of(tmp_path) < 7:
            assert processes.running("experiment"), processes.log("experiment").read_text()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        processes.signal("experiment", signal.SIGKILL)
        while _processes_of(tmp_path):
            assert time.monotonic() < deadline
            time.sleep(0.05)


def _processes_of(folder: Path) -> int:
    """Number of processes whose command line names a folder."""
    count = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            count += str(folder).encode() in path.read_bytes()
        except OSError:  # it has just ended
            continue
    return count
