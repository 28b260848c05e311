"""The layout tables give the bytes that rclpy itself serializes, both ways."""

import array

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from cassie_msgs.layout import GAIT_TYPES, SAMPLE_TYPES, Gait, GaitResult, Mode, RobotMode
from cassie_msgs.ros.fast_lane import message_type

PADDING = slice(16, 20)  # before seq; the serializer of ROS leaves what was in memory there


def without_padding(raw):
    """Length and content, without the bytes that carry nothing."""
    return len(raw), raw[: PADDING.start], raw[PADDING.stop :]


def filled(sample_type, seed):
    """A sample and a ROS message with the same random content."""
    rng = np.random.default_rng(seed)
    sample, message = sample_type(), message_type(sample_type)()
    sample.stamp_ns = int(rng.integers(0, 2**61))
    message.stamp.sec, message.stamp.nanosec = divmod(sample.stamp_ns, 10**9)
    for name in message.get_fields_and_field_types():
        if name == "stamp":
            continue
        view = getattr(sample, name)
        if view.dtype == np.float64:
            view[...] = rng.normal(size=view.shape)
        else:
            view[...] = rng.integers(0, 2, size=view.shape)
        setattr(message, name, view.copy() if view.shape else view.item())
    return sample, message


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sample_type", SAMPLE_TYPES + GAIT_TYPES)
def test_bytes_equal_rclpy_serialization_both_ways(sample_type, seed):
    sample, message = filled(sample_type, seed)
    theirs, ours = serialize_message(message), sample.to_bytes()
    assert without_padding(theirs) == without_padding(ours)
    assert ours[PADDING] == b"\0\0\0\0"
    assert deserialize_message(ours, type(message)) == message
    received = sample_type()
    received.load(theirs)
    for name in sample.DTYPE.names:
        np.testing.assert_array_equal(getattr(received, name), getattr(sample, name))


@pytest.mark.parametrize("sample_type", SAMPLE_TYPES + GAIT_TYPES)
def test_fields_stand_in_the_order_of_the_message(sample_type):
    fields = list(message_type(sample_type).get_fields_and_field_types())
    assert list(sample_type.DTYPE.names) == ["sec", "nanosec", *fields[1:]]


def test_mode_constants_are_those_of_the_message():
    message = message_type(Mode)
    assert {mode.name: int(mode) for mode in RobotMode} == {
        name: getattr(message, name) for name in ("OFF", "DAMP", "STAND", "WALK", "SEGWAY")
    }


def test_results_of_a_gait_are_those_of_the_message():
    message = message_type(Gait)
    assert {result.name: int(result) for result in GaitResult} == {
        name: getattr(message, name) for name in ("FOUND", "REFUSED", "NOT_FOUND", "NOT_CERTIFIED")
    }


def test_the_test_sees_a_wrong_layout():
    _, message = filled(Mode, 0)
    message.height += 1.0
    sample, _ = filled(Mode, 0)
    assert without_padding(serialize_message(message)) != without_padding(sample.to_bytes())
    assert isinstance(message.trims, (np.ndarray, array.array))
