"""Which states reach a node that answers every tenth, and from which estimators."""

import time

import pytest

from cassie_msgs.layout import DECIMATED_STATE, RobotState
from cassie_msgs.ros.decimated_states import DecimatedStates
from cassie_msgs.ros.fast_lane import LanePublisher, LaneWaiter


class Reader:
    """A node's states, and the waiter that it made at its start."""

    def __init__(self, node):
        self.states = DecimatedStates(node)
        self.waiter = LaneWaiter(node, [self.states])

    def match(self, publisher):
        deadline = time.monotonic() + 30.0
        while not (publisher.matched and self.states.matched):
            assert time.monotonic() < deadline, self.states.topic
            self.states.follow_estimator()
            time.sleep(0.01)

    def heard(self):
        """Episode and seq of the states that come until there are none for 0.2 s."""
        state, keys = RobotState(), []
        while self.waiter.wait(0.2):
            while self.states.take_next(state):
                keys.append((int(state.episode), int(state.seq)))
        return keys


def publish(publisher, keys):
    state = RobotState()
    for state.episode[...], state.seq[...] in keys:
        publisher.publish(state)


@pytest.fixture
def reader(node):
    return Reader(node)


def test_what_an_estimator_decimates_is_taken_as_it_is(node, reader):
    decimated, every = (LanePublisher(node, RobotState, t) for t in (DECIMATED_STATE, None))
    reader.match(decimated)
    keys = [(1, 0), (1, 10), (1, 13), (1, 13), (2, 0)]  # tick 13 waits, so it is repeated
    publish(decimated, keys)
    publish(every, [(1, 20)])
    assert reader.heard() == keys
    assert not every.matched  # or each state would cost the estimator and this node time


def test_of_an_estimator_that_decimates_none_the_states_between_are_skipped(node, reader):
    every = LanePublisher(node, RobotState)
    reader.match(every)
    keys = [*((1, seq) for seq in range(25)), (1, 24), (1, 24), *((2, seq) for seq in range(11))]
    publish(every, keys)
    tenth = [(1, 0), (1, 10), (1, 20), (1, 24), (1, 24), (2, 0), (2, 10)]
    assert reader.heard() == tenth
    assert reader.states.estimator.topic == RobotState.TOPIC  # so that its second writers are named


def test_an_estimator_may_be_replaced_by_one_of_the_other_kind(node, reader):
    every = LanePublisher(node, RobotState)
    reader.match(every)
    publish(every, [(1, 10)])
    assert reader.heard() == [(1, 10)]
    decimated = LanePublisher(node, RobotState, DECIMATED_STATE)
    reader.match(decimated)
    publish(decimated, [(2, 0)])
    assert reader.heard() == [(2, 0)]
    node.destroy_publisher(decimated.publisher)
    reader.match(every)
    publish(every, [(3, 0)])
    assert reader.heard() == [(3, 0)]
