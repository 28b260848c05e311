"""The bag of a run in one process."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from cassie_bags.bag.recording import GAIT_TOPICS, KNOWN_TYPES
from cassie_bags.bag.rosbag2 import QOS_DEFAULT, QOS_LANE, Qos
from cassie_bags.bag.writer import BagWriter
from cassie_bags.run.cores import makes_gaits, simulator_config
from cassie_bags.run.provenance import metadata_of
from cassie_bags.run.simulate import Observer
from cassie_control.frame_messages import FrameMessages, fixed_frames
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import RobotState
from cassie_msgs.standard_messages import TransformWriter, text_message
from cassie_sim.robot_mjcf import mesh_folder
from cassie_sim.robot_urdf import INSTALLED_MESHES, robot_urdf

_LATCHED = Qos(durability="transient_local", depth=1)


@contextmanager
def bag_observer(
    path: Path, experiment: Experiment, topics: Collection[str] | None = None
) -> Iterator[Observer]:
    """An observer that writes every message into a bag; the `with` statement closes the bag.

    Args:
        path: The bag.
        experiment: Experiment that is run, drawn; it is written into the bag.
        topics: Topics that are written. None: those of a `Recording`, and what ROS tools need to
            show the robot: /robot_description, /tf and /tf_static.

    Raises:
        BagError: if the bag cannot be written.
    """
    with BagWriter(path) as bag:
        for name, content in metadata_of(experiment).items():
            bag.add_metadata(name, content)
        channels = {
            topic: bag.add_topic(topic, kind, QOS_LANE)
            for topic, kind in KNOWN_TYPES.items()
            if topic in (KNOWN_TYPES if topics is None else topics)
            and (topic not in GAIT_TOPICS or makes_gaits(experiment))
        }
        robot = _ShownRobot(bag, experiment) if topics is None else None

        def observe(topic: str, raw: bytes, stamp: int) -> None:
            if topic in channels:
                bag.write(channels[topic], raw, stamp, stamp)
            if robot is not None and topic == RobotState.TOPIC:
                robot.write(raw, stamp)

        yield observe


class _ShownRobot:
    """Writes the robot's description and frames into a bag, as simulator and estimator do."""

    def __init__(self, bag: BagWriter, experiment: Experiment) -> None:
        self._bag, self._state = bag, RobotState()
        self._frames = FrameMessages(simulator_config(experiment).control_rate)
        text, transforms = "std_msgs/msg/String", TransformWriter.TYPE
        description = text_message(robot_urdf(INSTALLED_MESHES if mesh_folder() else None))
        self._latched = {
            bag.add_topic("/robot_description", text, _LATCHED): description,
            bag.add_topic("/tf_static", transforms, _LATCHED): fixed_frames(),
        }
        self._moving = bag.add_topic("/tf", transforms, QOS_DEFAULT)

    def write(self, raw: bytes, stamp: int) -> None:
        """Write what belongs to a state at its robot time (ns)."""
        for channel, message in self._latched.items():
            self._bag.write(channel, message, stamp, stamp)
        self._latched = {}
        self._state.load(raw)
        if self._frames.due(int(self._state.seq)):
            self._bag.write(self._moving, self._frames.moving(self._state), stamp, stamp)
