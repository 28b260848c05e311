"""The simulator's part of the control lane, and its other topics."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu

from cassie_msgs.bounds import outside
from cassie_msgs.layout import LayoutError, MotorCommand, OperatorCommand, Sensors
from cassie_msgs.ros.fast_lane import (
    EVERY,
    NEWEST_OF_ONE,
    WRITER,
    LanePublisher,
    LaneSubscription,
    LaneWaiter,
    take_from_each,
)
from cassie_msgs.ros.one_writer import OneWriter, WriterWatch
from cassie_sim.ground_truth import TOPIC as GROUND_TRUTH_TOPIC
from cassie_sim.ground_truth import GroundTruth
from cassie_sim.lane import Report
from cassie_sim.plant import Plant
from cassie_sim.ros.awake import Awake
from cassie_sim.ros.joint_states import JointStates
from cassie_sim.segway_truth import IMU_TOPIC, TRUTH_TOPIC, SegwayTruth

STANDARD_RATE = 100
"""Highest rate of the topics for ROS tools, in robot time. In Hz."""

_CLOCK = struct.Struct("<4siI")
_CLOCK_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


class SimulatorLane:
    """`cassie_sim.lane.Lane` over DDS.

    Attributes:
        keep_awake: Whether processors are kept from sleeping while samples are answered.

    Args:
        node: Node that the topics belong to.
        control_rate: Rate of control ticks. In Hz.
        report: Called with reports of refused messages.
        watch: Called with the plant after each sample, for film and window.
        scripted: Whether the lane waits for a script's answers. A person's commands do not wake
            the loop: they are taken once per tick, so that a flood of them costs little.
        one_thread: Whether `watch` must be called by the thread that runs the loop.
    """

    def __init__(
        self,
        node: Node,
        control_rate: int,
        report: Report,
        watch: Callable[[Plant], None],
        *,
        scripted: bool,
        one_thread: bool = False,
    ) -> None:
        self._sensors = LanePublisher(node, Sensors)
        self._truth = node.create_publisher(Odometry, GROUND_TRUTH_TOPIC, WRITER)
        self._segway = {
            TRUTH_TOPIC: node.create_publisher(Odometry, TRUTH_TOPIC, WRITER),
            IMU_TOPIC: node.create_publisher(Imu, IMU_TOPIC, WRITER),
        }
        self._clock = node.create_publisher(Clock, "/clock", _CLOCK_QOS)
        self._joint_states = JointStates(node)
        self._controller = OneWriter(MotorCommand, in_order=False)
        self._commands = LaneSubscription(
            node, MotorCommand, qos=NEWEST_OF_ONE, guard=self._controller
        )
        self._operator = LaneSubscription(node, OperatorCommand, qos=EVERY)
        self._waiter = LaneWaiter(
            node, [self._commands, self._operator] if scripted else [self._commands]
        )
        WriterWatch(
            node,
            [self._controller],
            [self._sensors.publisher, self._truth, self._clock],
            lambda topic, problem: report(topic, problem or None),
        )
        self.wake = self._waiter.wake
        self.command, self._received = MotorCommand(), MotorCommand()
        self.command_key = (-1, -1)
        self._asked = (-1, -1)
        self._command_refused = False
        self.on_operator: Callable[[OperatorCommand | None, bytes, str], None] = _ignore
        self._operator_command = OperatorCommand()
        self._awake = Awake()
        self.keep_awake = False
        self._report = report
        self._watch = watch
        self._one_thread = one_thread
        self._ground_truth, self._segway_truth = GroundTruth(), SegwayTruth()
        self._decimation = max(1, control_rate // STANDARD_RATE)
        self._last_sample = self._last_truth = self._last_clock = b""
        self._last_segway: list[tuple[str, bytes]] = []

    def announce(self, sample: Sensors, plant: Plant) -> None:
        """Publish a new sample first, then further messages while the other nodes compute."""
        self._last_sample = raw = sample.to_bytes()
        self._sensors.publish_raw(raw)
        self._asked = (plant.episode, plant.seq)
        self._last_truth = truth = self._ground_truth.write(plant)
        self._truth.publish(truth)
        self._last_segway = self._segway_truth.messages(plant)
        self._publish_segway()
        if plant.seq % self._decimation == 0:
            seconds, nanoseconds = divmod(plant.seq * plant.tick_ns, 1_000_000_000)
            self._last_clock = _CLOCK.pack(b"\x00\x01\x00\x00", seconds, nanoseconds)
            self._clock.publish(self._last_clock)
            self._joint_states.publish(sample)
            self._awake.hold(self.keep_awake)
        self._watch(plant)

    def repeat(self) -> None:
        """Publish the last sample, truth and clock again, and let processors sleep."""
        self._awake.hold(False)
        self._sensors.publish_raw(self._last_sample)
        self._truth.publish(self._last_truth)
        self._publish_segway()
        self._clock.publish(self._last_clock)

    def _publish_segway(self) -> None:
        for topic, raw in self._last_segway:
            self._segway[topic].publish(raw)

    def wait(self, timeout: float) -> None:
        """Return when a message arrives or `wake` is called, after `timeout` s at the latest."""
        self._waiter.wait(timeout)

    def served(self, answer: Callable[[], bool]) -> AbstractContextManager[None]:
        """Have `answer` called in the receiving thread when a motor command comes, if possible."""
        return nullcontext() if self._one_thread else self._commands.served(answer)

    def take(self) -> None:
        """Take in the messages that have come."""
        self._take_command()
        for writer, raw in take_from_each(self._operator):
            self._take_operator_command(writer, raw)

    def missing(self) -> str:
        """Text that names the nodes which do not take part yet."""
        absent = []
        if not self._sensors.matched:
            absent.append("nobody reads /cassie/sensors: is state_estimator running?")
        if not self._commands.matched:
            absent.append("nobody writes /cassie/motor_command: is gait_controller running?")
        return " ".join(absent)

    def flush(self, timeout: float) -> None:
        """Wait until all published messages have arrived, at most `timeout` s."""
        deadline = time.monotonic() + timeout
        self._sensors.flush(timeout)
        self._truth.wait_for_all_acked(Duration(seconds=max(0.0, deadline - time.monotonic())))

    def _take_command(self) -> None:
        try:
            if not self._commands.take(self._received):
                return
            episode, seq = key = self._received.place
            refused = ""
            same = episode == self._asked[0]
            self._controller.used(same)
            if same:
                refused = outside("seq", seq, 0, self._asked[1])
        except LayoutError as error:
            refused = str(error)
        if refused:
            self._controller.doubt()
            self._command_refused = True
            self._report("motor_command", f"motor command refused: {refused}")
            return
        self.command, self._received = self._received, self.command
        self.command_key = key
        if self._command_refused:
            self._command_refused = False
            self._report("motor_command", None)

    def _take_operator_command(self, writer: bytes, raw: bytes) -> None:
        try:
            self._operator_command.load(raw)
        except LayoutError as error:
            self.on_operator(None, writer, str(error))
        else:
            self.on_operator(self._operator_command, writer, "")


def _ignore(_: OperatorCommand | None, __: bytes, ___: str) -> None:
    return None
