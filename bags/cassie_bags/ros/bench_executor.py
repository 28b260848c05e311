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
from rclpy.qos import DurabilityPolicy, QoSProfile

from cassie_bags.run.cores import make_cores, tick_count
from cassie_bags.run.experiment import load_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import Cores
from cassie_control.schedule import ModeTable
from cassie_msgs import msg
from cassie_msgs.layout import Mode, MotorCommand, OperatorCommand, RobotState, Sample, Sensors
from cassie_msgs.schedule import PERIOD_TICKS, period_of
from cassie_sim import ground_truth

SampleT = TypeVar("SampleT", bound=Sample)

# Latched: the first samples wait until each node has been discovered.
_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


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


class LoopNode(Node):
    """A node that sends and takes samples as message objects."""

    def sender(self, kind: type[SampleT]) -> Callable[[SampleT], None]:
        """A function that publishes samples of a type."""
        publisher = self.create_publisher(getattr(msg, kind.__name__), kind.TOPIC, _QOS)
        return lambda sample: publisher.publish(to_message(sample))

    def take(self, kind: type[SampleT], callback: Callable[[SampleT], None]) -> None:
        """Call `callback` with each sample of a type; the sample is written again after it."""
        sample = kind()

        def receive(message: Any) -> None:
            to_sample(message, sample)
            callback(sample)

        self.create_subscription(getattr(msg, kind.__name__), kind.TOPIC, receive, _QOS)


def estimate(node: LoopNode, cores: Cores) -> None:
    """Answer every sensor sample by a state."""
    send = node.sender(RobotState)
    node.take(Sensors, lambda sensors: send(cores.estimator.step(sensors)))


def operate(node: LoopNode, cores: Cores) -> None:
    """Answer the first state of each period by an operator command."""
    send = node.sender(OperatorCommand)

    def answer(state: RobotState) -> None:
        if int(state.seq) % PERIOD_TICKS == 0:
            send(cores.operator.answer(state))

    node.take(RobotState, answer)


def supervise(node: LoopNode, cores: Cores) -> None:
    """Answer the first state of each period, and the operator's answer to it, by a mode.

    The loop runs on for a period before it waits, so that two of each may be queued at once.
    """
    send = node.sender(Mode)
    states: dict[int, RobotState] = {}
    commands: dict[int, OperatorCommand] = {}

    def keep(sample: SampleT, samples: dict[int, SampleT]) -> None:
        if int(sample.seq) % PERIOD_TICKS == 0:
            copy = samples[int(sample.seq)] = type(sample)()
            copy.copy_from(sample)
        for seq in sorted(states.keys() & commands.keys()):
            send(cores.supervisor.step(states.pop(seq), commands.pop(seq)))

    node.take(RobotState, lambda state: keep(state, states))
    node.take(OperatorCommand, lambda command: keep(command, commands))


def control(node: LoopNode, cores: Cores) -> None:
    """Answer every state by a motor command, once the mode made for its tick has arrived."""
    send = node.sender(MotorCommand)
    modes, waiting = ModeTable(), list[RobotState]()

    def answer() -> None:
        if waiting and modes.may_begin(seq := int(waiting[0].seq)):
            mode = modes.at(seq)
            assert mode is not None
            send(cores.controller.step(waiting.pop(), mode))

    def take_state(state: RobotState) -> None:
        waiting[:] = [state]
        answer()

    def take_mode(mode: Mode) -> None:
        modes.add(mode)
        answer()

    node.take(RobotState, take_state)
    node.take(Mode, take_mode)


def simulate(node: LoopNode, cores: Cores, ticks: int, times: list[float]) -> None:
    """Answer every motor command by the next sensor sample, up to a number of ticks.

    Args:
        node, cores: The node, and the cores of the experiment.
        ticks: Number of ticks, after which the process ends.
        times: Gets the wall time of each tick. In s.
    """
    plant, truth, power = cores.plant, ground_truth.GroundTruth(), {0: False}
    send = node.sender(Sensors)
    true_pose = node.create_publisher(Odometry, ground_truth.TOPIC, _QOS)

    def take_operator(operator: OperatorCommand) -> None:
        power[int(operator.effective_seq)] = bool(operator.power)

    def advance(command: MotorCommand) -> None:
        plant.power(power.get(period_of(plant.seq), False))
        plant.step(command)
        times.append(time.perf_counter())
        if plant.seq >= ticks:
            raise SystemExit
        send(plant.sense())
        true_pose.publish(truth.write(plant))

    node.take(MotorCommand, advance)
    node.take(OperatorCommand, take_operator)
    send(plant.sense())


def main() -> None:
    """Run one node."""
    name, file, target = sys.argv[1:4]
    experiment = resolve(load_experiment(Path(file)))
    cores = make_cores(experiment)
    rclpy.init()
    node = LoopNode(name)
    times: list[float] = []
    try:
        if name == "simulator":
            simulate(node, cores, tick_count(experiment), times)
        else:
            {
                "state_estimator": estimate,
                "scripted_operator": operate,
                "mode_supervisor": supervise,
                "gait_controller": control,
            }[name](node, cores)
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException, SystemExit):
        pass
    finally:
        if times:
            np.savez(Path(target), sent=times)
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
