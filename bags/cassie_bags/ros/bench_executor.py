"""The control loop with message objects and rclpy's default executor, for comparison.

Only the benchmark uses it, to compare it with the control lane. Each node is one process:

    python -m cassie_bags.ros.bench_executor NODE EXPERIMENT.yaml FILE

The simulator writes the wall time (s) of each tick to FILE (.npz) and ends.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile

from cassie_bags.bag.recording import GROUND_TRUTH_TOPIC
from cassie_bags.run.cores import Cores, make_cores, tick_count
from cassie_bags.run.experiment import load_experiment
from cassie_bags.run.seed import resolve
from cassie_control.schedule import ModeTable
from cassie_msgs import msg
from cassie_msgs.layout import Mode, MotorCommand, OperatorCommand, RobotState, Sample, Sensors
from cassie_msgs.schedule import PERIOD_TICKS, REPEAT_PERIOD, period_of

SampleT = TypeVar("SampleT", bound=Sample)

_QOS = QoSProfile(depth=100)


def to_message(sample: Sample) -> Any:
    """A message object with the content of a sample."""
    message = getattr(msg, type(sample).__name__)()
    message.stamp.sec, message.stamp.nanosec = divmod(sample.stamp_ns, 1_000_000_000)
    message.episode, message.seq = int(sample.episode), int(sample.seq)
    for name, _, count in sample.LAYOUT:
        value = getattr(sample, name)
        setattr(message, name, value if count > 1 else value.item())
    return message


def to_sample(message: Any, sample: Sample) -> None:
    """Copy the content of a message object into a sample."""
    sample.stamp_ns = message.stamp.sec * 1_000_000_000 + message.stamp.nanosec
    sample.episode[...], sample.seq[...] = message.episode, message.seq
    for name, _, _ in sample.LAYOUT:
        getattr(sample, name)[...] = getattr(message, name)


def copied(sample: SampleT) -> SampleT:
    """A copy of a sample."""
    copy = type(sample)()
    copy.copy_from(sample)
    return copy


def once(step: Callable[..., SampleT]) -> Callable[..., SampleT]:
    """A step that runs once for each sample; a repeated sample gets the same answer again."""
    last: list[tuple[tuple[int, int], SampleT]] = []

    def answer(sample: Sample, *others: Sample) -> SampleT:
        key = int(sample.episode), int(sample.seq)
        if not last or last[0][0] != key:
            last[:] = [(key, step(sample, *others))]
        return last[0][1]

    return answer


class LoopNode(Node):
    """A node with one core."""

    def __init__(self, name: str, cores: Cores) -> None:
        super().__init__(name)
        self.cores = cores

    def sends(self, kind: type[Sample]) -> Callable[[Sample], None]:
        """A function that publishes samples of a type."""
        publisher = self.create_publisher(getattr(msg, kind.__name__), kind.TOPIC, _QOS)
        return lambda sample: publisher.publish(to_message(sample))

    def takes(self, kind: type[Sample], callback: Callable[[Any], None]) -> None:
        """Call `callback` with each sample of a type."""
        sample = kind()

        def receive(message: Any) -> None:
            to_sample(message, sample)
            callback(sample)

        self.create_subscription(getattr(msg, kind.__name__), kind.TOPIC, receive, _QOS)


class Estimator(LoopNode):
    """Computes the state from the sensors."""

    def __init__(self, cores: Cores) -> None:
        super().__init__("state_estimator", cores)
        send, answer = self.sends(RobotState), once(cores.estimator.step)
        self.takes(Sensors, lambda sensors: send(answer(sensors)))


class Operator(LoopNode):
    """Answers every 10th state by an operator command."""

    def __init__(self, cores: Cores) -> None:
        super().__init__("scripted_operator", cores)
        self._send = self.sends(OperatorCommand)
        self._operate = once(cores.operator.answer)
        self.takes(RobotState, self._answer)

    def _answer(self, state: RobotState) -> None:
        if int(state.seq) % PERIOD_TICKS == 0:
            self._send(self._operate(state))


class Supervisor(LoopNode):
    """Answers every 10th state, and the operator's answer to it, by a mode.

    The loop runs on for a period before it waits, so that two of each may be queued at once.
    """

    def __init__(self, cores: Cores) -> None:
        super().__init__("mode_supervisor", cores)
        self._send = self.sends(Mode)
        self._states: dict[int, RobotState] = {}
        self._commands: dict[int, OperatorCommand] = {}
        self._supervise = once(cores.supervisor.step)
        self.takes(RobotState, self._take_state)
        self.takes(OperatorCommand, self._take_operator)

    def _take_state(self, state: RobotState) -> None:
        if int(state.seq) % PERIOD_TICKS == 0:
            self._states[int(state.seq)] = copied(state)
            self._answer()

    def _take_operator(self, command: OperatorCommand) -> None:
        self._commands[int(command.seq)] = copied(command)
        self._answer()

    def _answer(self) -> None:
        for seq in sorted(self._states.keys() & self._commands.keys()):
            self._send(self._supervise(self._states.pop(seq), self._commands.pop(seq)))


class Controller(LoopNode):
    """Computes a motor command from state and mode."""

    def __init__(self, cores: Cores) -> None:
        super().__init__("gait_controller", cores)
        self._send = self.sends(MotorCommand)
        self._modes = ModeTable()
        self._state = RobotState()
        self._done = -1
        self._command = MotorCommand()
        self.takes(RobotState, self._take_state)
        self.takes(Mode, self._take_mode)

    def _take_state(self, state: RobotState) -> None:
        self._state.copy_from(state)
        if int(state.seq) == self._done:
            self._send(self._command)  # the command was lost
        self._answer()

    def _take_mode(self, mode: Mode) -> None:
        self._modes.add(mode)
        self._answer()

    def _answer(self) -> None:
        seq = int(self._state.seq)
        mode = self._modes.at(seq)
        if seq > self._done and mode is not None and self._modes.may_begin(seq):
            self._done = seq
            self._command = self.cores.controller.step(self._state, mode)
            self._send(self._command)


class Simulator(LoopNode):
    """Computes the next sensors from a motor command, tick after tick."""

    def __init__(self, cores: Cores, ticks: int) -> None:
        super().__init__("simulator", cores)
        self._ticks = ticks
        self._send = self.sends(Sensors)
        self._truth = self.create_publisher(Odometry, GROUND_TRUTH_TOPIC, _QOS)
        self._power = {0: False}
        self.times: list[float] = []
        self.takes(MotorCommand, self._advance)
        self.takes(OperatorCommand, self._take_operator)
        self._timer = self.create_timer(REPEAT_PERIOD, self._repeat)
        self._looked_at = -1

    def _repeat(self) -> None:
        """Send a sample again if no node has answered it since the last check."""
        plant = self.cores.plant
        if plant.seq == self._looked_at or not plant.seq:
            self._send(plant.sense())
        self._looked_at = plant.seq

    def _take_operator(self, operator: OperatorCommand) -> None:
        self._power[int(operator.effective_seq)] = bool(operator.power)

    def _advance(self, command: MotorCommand) -> None:
        plant = self.cores.plant
        if int(command.seq) != plant.seq:
            return
        plant.power(self._power.get(period_of(plant.seq), False))
        plant.step(command)
        self.times.append(time.perf_counter())
        if plant.seq >= self._ticks:
            raise SystemExit
        self._send(plant.sense())
        self._publish_truth()

    def _publish_truth(self) -> None:
        plant, message = self.cores.plant, Odometry(child_frame_id="base_link")
        message.header.frame_id = "odom"
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = divmod(plant.seq * plant.tick_ns, 1_000_000_000)
        point, turn = message.pose.pose.position, message.pose.pose.orientation
        position, quaternion = plant.pelvis_pose
        point.x, point.y, point.z = position.tolist()
        turn.w, turn.x, turn.y, turn.z = quaternion.tolist()
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = plant.pelvis_twist.tolist()
        self._truth.publish(message)


def main() -> None:
    """Run one node."""
    name, file, times = sys.argv[1:4]
    experiment = resolve(load_experiment(Path(file)))
    cores = make_cores(experiment)
    rclpy.init()
    nodes: dict[str, Callable[[], LoopNode]] = {
        "state_estimator": lambda: Estimator(cores),
        "scripted_operator": lambda: Operator(cores),
        "mode_supervisor": lambda: Supervisor(cores),
        "gait_controller": lambda: Controller(cores),
        "simulator": lambda: Simulator(cores, tick_count(experiment)),
    }
    node = nodes[name]()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException, SystemExit):
        pass
    finally:
        if isinstance(node, Simulator):
            np.savez(Path(times), sent=node.times)
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
