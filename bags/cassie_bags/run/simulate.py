"""A run of the cores in one process, without ROS and as fast as possible.

The schedule is that of the nodes in lock-step (see the package's README), so that the trajectory
is the same to the last bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from cassie_bags.bag.recording import KNOWN_TYPES, Recording, from_messages
from cassie_control.control.gait_controller import GaitController
from cassie_control.estimator.faults import MonitoredEstimator
from cassie_control.guarded import GuardedController, GuardedEstimator, GuardedSupervisor
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_msgs.layout import Mode, MotorCommand, RobotState, Sample
from cassie_msgs.schedule import PERIOD_TICKS, STATUS_TICKS
from cassie_sim import ground_truth
from cassie_sim.errors import CommandError
from cassie_sim.plant import Plant
from cassie_sim.segway_truth import SegwayTruth
from cassie_teleop.script import ScriptedOperator

Observer = Callable[[str, bytes, int], None]
"""Takes topic, serialized message and its robot time (ns), in the order of the schedule."""


@dataclass(frozen=True)
class Cores:
    """The computing parts of an experiment at tick 0, without middleware between them.

    `gait_messages` gives the request for a gait and its answer after each tick with a request; None
    unless gaits are made while the robot walks.
    """

    plant: Plant
    estimator: MonitoredEstimator
    controller: GaitController
    supervisor: ModeSupervisor
    operator: ScriptedOperator
    gait_messages: Callable[[], Sequence[Sample]] | None = None


class ControlLoop:
    """One run of the cores on the schedule of lock-step.

    A tick is a sample, its state, and the motor command by the mode in force. On every
    `PERIOD_TICKS`-th tick the operator and the supervisor answer the state. Their answers take
    effect `PERIOD_TICKS` later. The power is that which the operator has set for the tick. Then the
    plant steps. The observer gets each message.
    """

    def __init__(self, cores: Cores, observer: Observer) -> None:
        self._plant, self._operator, self._observer = cores.plant, cores.operator, observer
        self._gait_messages = cores.gait_messages
        self._estimator = GuardedEstimator(cores.estimator)
        self._controller = GuardedController(cores.controller)
        self._supervisor = GuardedSupervisor(cores.supervisor)
        self._truth, self._segway = ground_truth.GroundTruth(), SegwayTruth()
        self._mode, self._next_mode = Mode(), Mode()
        self._power = self._next_power = False
        self.problems: dict[str, tuple[str, float]] = {}
        """First problem of each core and its robot time (s), by node."""

    def tick(self) -> None:
        """Run one control tick."""
        plant = self._plant
        seq, stamp = plant.seq, plant.seq * plant.tick_ns
        sensors = plant.sense()
        truth, segway = self._truth.write(plant), self._segway.messages(plant)
        if plant.beside:
            plant.run_ahead()
        self._observe(sensors, stamp)
        self._observer(ground_truth.TOPIC, truth, stamp)
        for topic, raw in segway:
            self._observer(topic, raw, stamp)
        self._operator.watch(stamp, truth)
        state = self._estimator.step(sensors)
        self._observe(state, stamp)
        self._note("state_estimator", self._estimator.problem, stamp)
        if seq % PERIOD_TICKS == 0:
            self._answer(state, stamp)
        command = self._controller.step(state, self._mode)
        self._observe(command, stamp)
        if self._gait_messages is not None:
            for message in self._gait_messages():
                self._observe(message, stamp)
        if seq % STATUS_TICKS == 0:
            self._observe(self._controller.status(state), stamp)
        self._note("gait_controller", self._controller.problem, stamp)
        plant.power(self._power)
        self._step_plant(command)

    def _answer(self, state: RobotState, stamp: int) -> None:
        """Put the answers to the last state in force, then answer this state."""
        self._mode.copy_from(self._next_mode)
        self._power = self._next_power
        operator = self._operator.answer(state)
        self._observe(operator, stamp)
        self._next_power = bool(operator.power)
        mode = self._supervisor.step(state, operator)
        self._observe(mode, stamp)
        self._note("mode_supervisor", self._supervisor.problem, stamp)
        self._next_mode.copy_from(mode)

    def _step_plant(self, command: MotorCommand) -> None:
        try:
            self._plant.step(command)
        except CommandError as error:
            self._note("simulator", str(error), self._plant.seq * self._plant.tick_ns)

    def _note(self, node: str, problem: str, stamp: int) -> None:
        if problem and node not in self.problems:
            self.problems[node] = (problem, stamp * 1e-9)

    def _observe(self, sample: Sample, stamp: int) -> None:
        self._observer(sample.TOPIC, sample.to_bytes(), stamp)


def run(loop: ControlLoop, ticks: Iterable[int]) -> float:
    """Run a loop over ticks; returns the wall time in s. `ticks` may show progress."""
    started = time.perf_counter()
    for _ in ticks:
        loop.tick()
    return time.perf_counter() - started


class Store:
    """An observer that keeps every message."""

    def __init__(self) -> None:
        self.messages: dict[str, list[bytes]] = {topic: [] for topic in KNOWN_TYPES}

    def __call__(self, topic: str, raw: bytes, stamp: int) -> None:
        self.messages[topic].append(raw)

    def recording(self, wall_time: float) -> Recording:
        """The stored messages as arrays."""
        return from_messages(self.messages, wall_time)


class RecentStore(Store):
    """An observer that keeps the last messages, so that the memory of a long run is bounded.

    Args:
        seconds: Robot time of which it keeps all messages; it keeps up to twice as much.
    """

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._span = round(seconds * 1e9)
        self._until = self._span
        self._before: dict[str, list[bytes]] = {topic: [] for topic in self.messages}

    def __call__(self, topic: str, raw: bytes, stamp: int) -> None:
        if stamp >= self._until:
            self._before, self._until = self.messages, stamp + self._span
            self.messages = {topic: [] for topic in KNOWN_TYPES}
        super().__call__(topic, raw, stamp)

    def recording(self, wall_time: float) -> Recording:
        """The stored messages as arrays."""
        messages = {topic: self._before[topic] + self.messages[topic] for topic in self.messages}
        return from_messages(messages, wall_time)
