"""Strangers on the control lane: what they write is not obeyed, and they are named."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from bringup import STAND, TIMEOUT, WALK, Robot
from rclpy.context import Context
from rclpy.node import Node

from cassie_bags.ros.processes import executable
from cassie_msgs.layout import (
    DECIMATED_STATE,
    ControllerStatus,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sample,
    Sensors,
)
from cassie_msgs.operators import write_sender
from cassie_msgs.ros.fast_lane import LanePublisher

PACINGS = ("lockstep", "realtime")
KINDS: tuple[type[Sample], ...] = (
    MotorCommand,
    Mode,
    Sensors,
    RobotState,
    ControllerStatus,
    OperatorCommand,
)


def writers(
    node: Node, kinds: tuple[type[Sample], ...]
) -> list[tuple[Sample, LanePublisher[Sample]]]:
    """A sample and a publisher for each topic of some types of messages."""
    topics = [(kind, kind.TOPIC) for kind in kinds]
    if RobotState in kinds:
        topics.append((RobotState, DECIMATED_STATE))
    return [(kind(), LanePublisher(node, kind, topic)) for kind, topic in topics]


class Stranger:
    """A node of somebody else, which writes what a function makes of each message, in a thread.

    Args:
        domain: ROS domain.
        kinds: What it writes.
        fill: Gets a message, the number of those before it, and fills it.
        rate: Of each kind. In Hz.
    """

    def __init__(
        self,
        domain: int,
        kinds: tuple[type[Sample], ...],
        fill: Callable[[Sample, int], None],
        rate: float = 50.0,
    ) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        node = rclpy.create_node("stranger", context=self._context)
        self._lane = writers(node, kinds)
        self._fill, self._period = fill, 1.0 / rate
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.sent = 0

    def __enter__(self) -> Stranger:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        self._thread.join()
        rclpy.shutdown(context=self._context)

    def _run(self) -> None:
        while not self._stopped.wait(self._period):
            for sample, publisher in self._lane:
                self._fill(sample, self.sent)
                publisher.publish(sample)
            self.sent += 1


def robot_that(gait: str, pacing: str, folder: Path) -> Robot:
    simulator: dict[str, object] = {"pacing": pacing, "paused": True, "command_timeout": TIMEOUT}
    simulator["max_rate"] = {"lockstep": 1.0, "realtime": 0.5}[pacing]
    return Robot(folder, STAND if gait == "stand" else WALK, simulator=simulator)


def bring_up(robot: Robot, gait: str) -> None:
    eyes = robot.eyes
    robot.start()
    robot.go()
    eyes.wait_for(lambda: eyes.mode == gait and not eyes.faults, f"mode {gait} without faults")


def goes_on(robot: Robot, gait: str, ticks: int) -> None:
    """Hold that the robot does what it did, for so many ticks of the same episode."""
    eyes = robot.eyes
    episode, end = eyes.episode, eyes.tick + ticks

    def over() -> bool:
        assert robot.stands(), eyes.summary()
        return eyes.tick >= end

    eyes.wait_for(over, f"{ticks} ticks")
    assert eyes.mode == gait
    assert eyes.episode == episode
    assert eyes.sensors.damping == 0.0
    assert eyes.sensors.power == 1.0


def from_the_future(sample: Sample, number: int) -> None:
    """A number that would make all others look old."""
    sample.seq[...] = 2**62
    sample.episode[...] = 2**32 - 1
    if isinstance(sample, Mode):
        sample.effective_seq[...] = 2**62
    if isinstance(sample, OperatorCommand):
        sample.scripted[...] = True
        sample.effective_seq[...] = 2**62
        sample.power[...] = False


@pytest.mark.parametrize("gait", ["stand", "walk"])
@pytest.mark.parametrize("pacing", PACINGS)
def test_strangers_on_every_topic_are_ignored_and_named(
    tmp_path: Path, pacing: str, gait: str
) -> None:
    """Plausible messages, those of the next tick and episode, and noise, at 50 Hz."""
    rng = np.random.default_rng(5)
    with robot_that(gait, pacing, tmp_path) as robot:
        bring_up(robot, gait)
        eyes = robot.eyes

        def plausible(sample: Sample, number: int) -> None:
            kind = number % 4
            if kind == 0:
                from_the_future(sample, number)
                return
            sample.floats[:] = 0.0 if kind == 1 else rng.normal(size=sample.floats.size)
            sample.seq[...] = eyes.tick + kind
            sample.episode[...] = eyes.episode + kind // 3
            if isinstance(sample, Mode):
                sample.effective_seq[...] = eyes.tick // 10 * 10 + 10
                sample.mode[...] = int(rng.integers(5))
            if isinstance(sample, OperatorCommand):
                sample.effective_seq[...] = eyes.tick // 10 * 10 + 10
                sample.scripted[...] = kind == 2
                sample.power[...] = False
            if isinstance(sample, RobotState):
                sample.floats[:] *= np.nan

        with Stranger(robot.domain, KINDS, plausible):
            goes_on(robot, gait, 1500)
            for name, topic in (
                ("simulator", "/cassie/motor_command"),
                ("state_estimator", "/cassie/sensors"),
                ("gait_controller", "/cassie/state"),
                ("gait_controller", "/cassie/mode"),
                ("mode_supervisor", DECIMATED_STATE),
                ("mode_supervisor", "/cassie/controller_status"),
            ):
                eyes.wait_for(
                    lambda name=name, topic=topic: eyes.report_since(
                        0.0, f"{name}: {topic}", "stranger ignored"
                    ),
                    f"{name} to name the stranger on {topic}",
                )
        eyes.wait_for(lambda: eyes.is_well("simulator: /cassie/motor_command"), "the end of it")


class Person:
    """An operator of flesh and blood, as a node that says the same 50 times a second."""

    def __init__(self, robot: Robot, name: str) -> None:
        self.command = OperatorCommand()
        write_sender(self.command, name)
        self.set(link=True, mode=RobotMode.STAND, height=0.9)
        self._node = Stranger(robot.domain, (OperatorCommand,), self._fill)

    def set(self, **fields: float) -> None:
        """Change what is said."""
        for name, value in fields.items():
            getattr(self.command, name)[...] = value

    def _fill(self, sample: Sample, number: int) -> None:
        assert isinstance(sample, OperatorCommand)
        sample.copy_from(self.command)

    def __enter__(self) -> Person:
        self._node.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._node.__exit__()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    """All nodes but an operator, on its feet, paused."""
    with Robot(
        tmp_path,
        simulator={"scripted_operator": False, "max_rate": 1.0, "paused": True},
        mode_supervisor={"scripted_operator": False},
    ) as robot:
        for node in ("state_estimator", "gait_controller", "mode_supervisor", "simulator"):
            robot.start(node)
        yield robot


def walking(robot: Robot, person: Person) -> None:
    eyes = robot.eyes
    person.set(power=True)
    eyes.wait_for(
        lambda: eyes.statuses and eyes.statuses[-1][1].holder.startswith("first"), "the lease"
    )
    robot.go()
    eyes.wait_for(lambda: eyes.mode == "stand" and not eyes.faults, "standing")
    person.set(mode=RobotMode.WALK)
    eyes.wait_for(lambda: eyes.mode == "walk", "walking")
    person.set(vx=0.3)


def status(robot: Robot):
    return robot.eyes.statuses[-1][1]


def test_one_operator_drives_the_other_watches_takes_over_at_rest_and_can_stop(
    robot: Robot,
) -> None:
    first, second = Person(robot, "first-1"), Person(robot, "second-2")
    with first:
        walking(robot, first)
        with second:
            _share(robot, first, second)


def _share(robot: Robot, first: Person, second: Person) -> None:
    eyes = robot.eyes
    second.set(power=True, mode=RobotMode.STAND, take_over=True)
    eyes.wait_for(lambda: list(status(robot).operators) == ["second-2"], "both to be told")
    goes_on(robot, "walk", 1500)  # moving, so nobody takes over
    assert status(robot).holder == "first-1"
    second.set(take_over=False)
    first.set(vx=0.0, mode=RobotMode.STAND)
    eyes.wait_for(lambda: eyes.mode == "stand", "standing")
    second.set(take_over=True)
    eyes.wait_for(lambda: status(robot).holder == "second-2", "the lease to change")
    second.set(take_over=False)
    first.set(mode=RobotMode.WALK, vx=0.3)
    goes_on(robot, "stand", 1000)
    first.set(emergency_stop=True)
    eyes.wait_for(lambda: eyes.sensors.power == 0.0, "the power to be cut")


def test_a_flood_of_operator_commands_moves_nothing(robot: Robot) -> None:
    with Person(robot, "first-1") as first:
        walking(robot, first)

        def run_away(sample: Sample, number: int) -> None:
            sample.copy_from(first.command)
            sample.vx[...], sample.vy[...] = -0.7, 0.3

        eyes = robot.eyes
        before, start = len(eyes.statuses), eyes.position()[0]
        with Stranger(robot.domain, (OperatorCommand,), run_away, rate=10_000.0) as stranger:
            goes_on(robot, "walk", 1500)
            assert stranger.sent > 1000
        # A busy machine may keep the first one's own thread waiting for longer than its link may.
        assert {told.holder for _, told in eyes.statuses[before:]} <= {"first-1", ""}
        assert eyes.position()[0] > start + 0.1
        eyes.wait_for(lambda: status(robot).holder == "first-1", "the lease of the first one")


@pytest.mark.parametrize("how", ["reset", "restart"])
def test_a_new_episode_wants_the_old_speeds_gone_before_anything_moves(
    robot: Robot, how: str
) -> None:
    eyes = robot.eyes
    with Person(robot, "first-1") as person:
        walking(robot, person)
        goes_on(robot, "walk", 500)
        episode = eyes.episode
        if how == "reset":
            assert robot.call("reset", start="gantry").success
        else:
            robot.kill("simulator")
            robot.start("simulator", paused=False, start="gantry")
        eyes.wait_for(lambda: eyes.episode > episode and eyes.tick > 500, "a second of it")
        assert eyes.sensors.power == 0.0
        assert not status(robot).armed
        assert any("power comes on only with stand" in fault for fault in eyes.faults)
        person.set(mode=RobotMode.STAND, vx=0.0)
        eyes.wait_for(lambda: eyes.sensors.power == 1.0 and status(robot).armed, "power")


def test_a_link_that_returns_wants_the_stick_in_the_middle(robot: Robot) -> None:
    eyes = robot.eyes
    with Person(robot, "first-1") as person:
        walking(robot, person)
        goes_on(robot, "walk", 500)
        person.set(link=False)
        eyes.wait_for(lambda: eyes.mode == "stand", "standing")
        person.set(link=True)
        eyes.wait_for(lambda: eyes.mode == "walk", "walking")
        start = np.array(eyes.position())
        goes_on(robot, "walk", 2000)
        assert np.linalg.norm(np.array(eyes.position()) - start) < 0.15  # on the spot
        assert not status(robot).armed
        person.set(vx=0.0)
        eyes.wait_for(lambda: status(robot).armed, "arming")
        person.set(vx=0.3)
        start = np.array(eyes.position())
        goes_on(robot, "walk", 3000)
        assert np.linalg.norm(np.array(eyes.position()) - start) > 0.5


def test_a_second_stack_in_the_domain_refuses_to_start_and_the_first_walks_on(
    tmp_path: Path,
) -> None:
    with robot_that("walk", "lockstep", tmp_path) as robot:
        bring_up(robot, "walk")
        eyes, episode = robot.eyes, robot.eyes.episode
        second = {
            "simulator": "cassie_sim",
            "state_estimator": "cassie_control",
            "gait_controller": "cassie_control",
            "mode_supervisor": "cassie_control",
        }
        for name, package in second.items():
            robot.processes.start(f"second_{name}", [executable(package, name)])
        for name in second:
            eyes.wait_for(
                lambda name=name: not robot.processes.running(f"second_{name}"), f"{name} to end"
            )
            assert robot.stands(), eyes.summary()
            words = robot.processes.log(f"second_{name}").read_text().strip()
            assert words.startswith(f"{name}: error: another {name} runs in ROS domain"), words
            assert "which is free" in words and len(words.splitlines()) == 1
        # Four nodes that start hold up a busy machine: then the robot stops, stands, and goes on.
        eyes.wait_for(lambda: eyes.mode == "walk" and not eyes.faults, "walking without faults")
        assert eyes.episode == episode
        goes_on(robot, "walk", 500)


def test_words_are_true_while_robot_time_waits_for_the_controller(tmp_path: Path) -> None:
    with robot_that("stand", "lockstep", tmp_path) as robot:
        bring_up(robot, "stand")
        killed = robot.kill("gait_controller")
        robot.eyes.wait_for(
            lambda: robot.eyes.fault_since(killed, "gait_controller lost: robot time waits for it"),
            "the fault",
        )
        assert not robot.eyes.fault_since(killed, "drives damp")


def test_a_supervisor_that_was_held_up_does_not_blame_the_simulator(tmp_path: Path) -> None:
    import signal

    with robot_that("stand", "realtime", tmp_path) as robot:
        bring_up(robot, "stand")
        eyes = robot.eyes
        robot.processes.signal("mode_supervisor", signal.SIGSTOP)
        time.sleep(2.0)
        robot.processes.signal("mode_supervisor", signal.SIGCONT)
        resumed = time.monotonic()
        eyes.wait_for(lambda: eyes.mode == "stand" and not eyes.faults, "standing without faults")
        tick = eyes.tick
        eyes.wait_for(lambda: eyes.tick > tick + 500, "a while")
        assert not eyes.fault_since(resumed, "simulator lost")
