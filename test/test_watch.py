"""Which node the supervisor takes for lost."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from cassie_bags.ros.processes import own_domain
from cassie_control.ros.common import Conditions
from cassie_control.ros.watch import Watch
from cassie_msgs.schedule import ANSWER_AFTER, START_TIMEOUT


@pytest.fixture
def watch() -> Iterator[Watch]:
    """In front of a controller that never answers."""
    context = Context()
    with own_domain() as domain:
        rclpy.init(args=[], context=context, domain_id=domain)
        node = Node("watch", context=context)
        yield Watch(node, Conditions(node))
        node.destroy_node()
        rclpy.shutdown(context=context)


def test_a_controller_is_not_lost_for_a_time_without_states(watch: Watch) -> None:
    """The whole machine had stood still: on its first state the robot was damped."""
    now = time.monotonic()
    watch.heard_state(now)
    now += START_TIMEOUT + 1.0
    watch.heard_state(now)
    assert not watch.controller_lost(now)


def test_a_controller_that_gets_states_and_is_silent_is_lost(watch: Watch) -> None:
    start = now = time.monotonic()
    while now < start + START_TIMEOUT + 1.0:
        watch.heard_state(now)
        now += 0.5 * ANSWER_AFTER
    assert watch.controller_lost(now)
