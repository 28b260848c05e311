"""Messages answered by the thread that receives them."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import rclpy

from cassie_msgs.layout import Mode
from cassie_msgs.ros.fast_lane import EVERY, LaneSubscription, LaneWaiter

TALKER = Path(__file__).with_name("lane_talker.py")


@pytest.fixture
def lane():
    """A subscription to what another process says all the time, and a waiter."""
    talker = subprocess.Popen([sys.executable, str(TALKER)])
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("listener", context=context)
    subscription = LaneSubscription(node, Mode, qos=EVERY)
    waiter = LaneWaiter(node, [subscription])
    assert waiter.wait(10.0)
    yield subscription, waiter
    node.destroy_node()
    rclpy.shutdown(context=context)
    talker.terminate()
    assert talker.wait(timeout=90) == 0


def until(condition) -> None:
    deadline = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.001)


def test_the_thread_that_receives_answers_and_nobody_is_woken(lane):
    subscription, waiter = lane
    sample, answered, woken = Mode(), [], []

    def answer() -> bool:
        while subscription.take_next(sample):
            answered.append((threading.get_ident(), int(sample.seq)))
        return True

    with subscription.served(answer):
        waiter.wait(0.0)  # what came before is told as ever
        until(lambda: answered)
        begun = len(answered)
        woken = [waiter.wait(0.01) for _ in range(20)]
    threads, seqs = zip(*answered, strict=True)
    assert len(answered) > begun + 20 and not any(woken)
    assert len(set(threads)) == 1 and threads[0] != threading.get_ident()
    assert list(seqs) == list(range(seqs[0], seqs[0] + len(seqs)))


def test_afterwards_and_where_there_is_no_answer_whoever_waits_takes_the_message(lane):
    subscription, waiter = lane
    with subscription.served(lambda: False):
        for _ in range(5):
            assert waiter.wait(5.0)
            while subscription.take_raw() is not None:
                pass
    for _ in range(5):
        assert waiter.wait(5.0)
        assert subscription.take_raw() is not None


def test_what_an_answer_raises_comes_out_of_the_wait(lane):
    subscription, waiter = lane

    def answer() -> bool:
        raise KeyError("broken on request")

    with subscription.served(answer), pytest.raises(KeyError, match="broken on request"):
        for _ in range(3):  # the first may be told of what came before
            waiter.wait(5.0)


def test_serving_begins_and_ends_while_both_threads_take(lane):
    """What one thread holds and the other waits for must never go round in a circle."""
    subscription, waiter = lane
    there, here = [], []

    def answer() -> bool:
        if len(there) > len(here):
            return False
        there.append(subscription.take_raw())
        return True

    deadline = time.monotonic() + 20.0
    while len(here) < 50:
        with subscription.served(answer):
            for _ in range(50):
                waiter.wait(0.0001)
                if (raw := subscription.take_raw()) is not None:
                    here.append(raw)
        assert time.monotonic() < deadline, (len(there), len(here))
    assert len(there) >= 50
