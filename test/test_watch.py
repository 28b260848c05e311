"""Which node the supervisor takes for lost."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from cassie_bags.ros.processes import own_domain
from cassie_control.ros.common import Conditions
from cassie_control.ros.watch import Watch
from cassie_msgs.schedule import ANSWER_AFTER, REPEAT_PERIOD, SILENT_AFTER, START_TIMEOUT


@pytest.fixture
def node() -> Iterator[Node]:
    context = Context()
    with own_domain() as domain:
        rclpy.init(args=[], context=context, domain_id=domain)
        node = Node("watch", context=context)
        yield node
        node.destroy_node()
        rclpy.shutdown(context=context)


@pytest.fixture
def watch(node: Node) -> Watch:
    """In front of a controller that never answers."""
    return Watch(node, Conditions(node))


def test_a_controller_is_not_lost_for_a_time_without_states(watch: Watch) -> None:
    """The whole machine had stood still: on its first state the robot was damped."""
    now = time.monotonic()
    watch.heard_state(now)
    now += START_TIMEOUT + 1.0
    watch.heard_state(now)
    assert not watch.controller_lost(now)


def test_without_a_simulator_the_others_are_not_lost(watch: Watch) -> None:
    """The estimator was named first, as it has less time to answer."""
    clock = watch._clock
    heard = [b"time 1"]
    clock.take_raw = lambda: heard.pop() if heard else None  # type: ignore[method-assign]
    now = time.monotonic()
    watch.look(now)
    watch.heard_state(now)
    told = []
    for _ in range(20):
        now += 0.05
        watch.look(now)
        told += watch.faults
    assert set(told) == {"simulator lost: waiting for it"}


def test_an_estimator_that_does_not_answer_repeated_samples_is_lost(watch: Watch) -> None:
    clock = watch._clock
    now = time.monotonic()
    due = now
    watch.heard_state(now)
    for _ in range(20):
        heard = [b"time 1"] * (now >= due)
        due += REPEAT_PERIOD * len(heard)
        clock.take_raw = lambda heard=heard: heard.pop() if heard else None  # type: ignore[misc, method-assign]
        watch.look(now)
        now += 0.05
    assert watch.faults == ("state_estimator lost: robot time waits for it",)


def test_a_controller_that_gets_states_and_is_silent_is_lost(watch: Watch) -> None:
    start = now = time.monotonic()
    while now < start + START_TIMEOUT + 1.0:
        watch.heard_state(now)
        now += 0.5 * ANSWER_AFTER
    assert watch.controller_lost(now)


def test_the_clock_of_another_node_is_no_simulator(node: Node, watch: Watch) -> None:
    """Beside a bag's player on /clock a lost simulator was reported as a lost estimator."""
    simulator, player = (Node(name, context=node.context) for name in ("simulator", "player"))
    first, second = (other.create_publisher(Clock, "/clock", 10) for other in (simulator, player))
    while not watch.simulator.writer:
        first.publish(Clock())
        time.sleep(0.02)
        watch.look(time.monotonic())
    watch.heard_state(time.monotonic())
    simulator.destroy_publisher(first)
    told = []
    end = time.monotonic() + SILENT_AFTER + 0.5
    while time.monotonic() < end:
        second.publish(Clock())
        time.sleep(0.02)
        watch.look(time.monotonic())
        told += watch.faults
    assert set(told) == {"simulator lost: waiting for it"}


def test_every_change_of_a_second_writers_name_is_reported(node: Node) -> None:
    """After the first stranger had left, its name stood for the next one."""
    told: list[str] = []
    conditions = Conditions(node)
    conditions._diagnostics.set = lambda *report, **_: told.append(report[-1])  # type: ignore[method-assign]
    for problem in ("one ignored", "one ignored", "another ignored", ""):
        conditions.follow("/cassie/mode", problem)
    assert told == ["one ignored", "one ignored", "another ignored", "ok"]
