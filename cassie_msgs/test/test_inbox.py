"""Messages past rclpy: long ones, destroyed subscriptions, and nothing left open."""

import gc
import time
from pathlib import Path

import pytest
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from cassie_msgs.layout import Mode
from cassie_msgs.ros.fast_lane import (
    EVERY,
    LanePublisher,
    LaneSubscription,
    LaneWaiter,
    RawSubscription,
)


def matched(publisher) -> None:
    deadline = time.monotonic() + 10.0
    while not publisher.get_subscription_count():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_long_and_short_messages_come_whole(node):
    subscription = RawSubscription(node, String, "/text", EVERY)
    publisher = node.create_publisher(String, "/text", EVERY)
    waiter = LaneWaiter(node, [subscription])
    matched(publisher)
    for size in (3, 100_000, 5, 300_000, 0):
        publisher.publish(String(data="x" * size))
        assert waiter.wait(5.0)
        assert deserialize_message(subscription.take_raw(), String).data == "x" * size
        assert subscription.take_raw() is None


def test_taken_bytes_stay_when_the_next_message_is_taken(node):
    subscription = LaneSubscription(node, Mode, qos=EVERY)
    publisher = LanePublisher(node, Mode)
    waiter, sample = LaneWaiter(node, [subscription]), Mode()
    while not publisher.matched:
        time.sleep(0.01)
    taken = []
    for seq in range(3):
        sample.seq[...] = seq
        publisher.publish(sample)
        assert waiter.wait(5.0)
        taken.append(subscription.take_raw())
    for seq, raw in enumerate(taken):
        sample.load(raw)
        assert sample.seq == seq


def test_what_came_before_the_wait_is_told_and_told_once(node):
    subscription = LaneSubscription(node, Mode, qos=EVERY)
    publisher = LanePublisher(node, Mode)
    while not publisher.matched:
        time.sleep(0.01)
    publisher.publish(Mode())
    time.sleep(0.1)
    waiter = LaneWaiter(node, [subscription])
    assert waiter.wait(5.0)
    assert subscription.take_raw() is not None
    assert not waiter.wait(0.0)


def test_a_destroyed_subscription_is_refused(node):
    subscription = LaneSubscription(node, Mode)
    node.destroy_node()
    with pytest.raises(_rclpy.InvalidHandle):
        subscription.take_raw()


def test_the_end_of_the_context_ends_a_wait(node):
    waiter = LaneWaiter(node, [LaneSubscription(node, Mode)])
    rclpy.shutdown(context=node.context)
    started = time.monotonic()
    assert not waiter.wait(30.0)
    assert time.monotonic() - started < 5.0


def test_no_descriptor_stays_open(node):
    def open_and_leave() -> None:
        for _ in range(20):
            subscription = LaneSubscription(node, Mode)
            LaneWaiter(node, [subscription])
            node.destroy_subscription(subscription.subscription)

    open_and_leave()
    gc.collect()
    before = len(list(Path("/proc/self/fd").iterdir()))
    open_and_leave()
    gc.collect()
    assert len(list(Path("/proc/self/fd").iterdir())) <= before
