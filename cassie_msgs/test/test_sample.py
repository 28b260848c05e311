"""Samples alone: views, loading, copying, and what they refuse."""

import numpy as np
import pytest

from cassie_msgs.layout import (
    SAMPLE_TYPES,
    LayoutError,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotState,
    Sample,
    Sensors,
    header,
)


@pytest.mark.parametrize("sample_type", SAMPLE_TYPES)
def test_bytes_loaded_are_the_bytes_sent(sample_type):
    sample, copy = sample_type(), sample_type()
    body = np.random.default_rng(1).integers(0, 2, sample.SIZE - 4, dtype=np.uint8)
    raw = b"\x00\x01\x00\x00" + body.tobytes()
    sample.load(raw)
    copy.copy_from(sample)
    assert sample.to_bytes() == raw == copy.to_bytes()


@pytest.mark.parametrize("sample_type", SAMPLE_TYPES)
def test_every_field_is_an_aligned_view(sample_type):
    sample = sample_type()
    for name in sample.DTYPE.names:
        view = getattr(sample, name)
        assert view.flags.aligned and view.flags.writeable and not view.flags.owndata


def test_known_offsets():
    sample = Sensors()
    sample.stamp_ns = 3_000_000_005
    sample.episode[...] = 7
    sample.seq[...] = 9
    sample.orientation[:] = 1.0, 2.0, 3.0, 4.0
    raw = sample.to_bytes()
    assert header(raw) == (3, 5, 7, 9)
    assert sample.stamp_ns == 3_000_000_005
    assert np.frombuffer(raw, "<f8", count=4, offset=4 + 24).tolist() == [1, 2, 3, 4]


def test_padding_of_the_transport_is_dropped():
    sample = RobotState()
    sample.load(RobotState().to_bytes() + b"\x00\x00\x00")
    assert len(sample.to_bytes()) == RobotState.SIZE


@pytest.mark.parametrize("raw", [b"", b"\x00\x01\x00\x00", Sensors().to_bytes(), bytes(576)])
def test_bytes_of_another_message_are_refused_with_both_sizes(raw):
    with pytest.raises(LayoutError, match=f"has {RobotState.SIZE} bytes, received {len(raw)}"):
        RobotState().load(raw)


def test_another_encoding_is_refused():
    raw = b"\x00\x00\x00\x00" + MotorCommand().to_bytes()[4:]
    with pytest.raises(LayoutError, match="encoding 0000"):
        MotorCommand().load(raw)


def test_rebinding_a_field_is_refused():
    command = OperatorCommand()
    with pytest.raises(AttributeError, match=r"write sample.vx\[...\] = value"):
        command.vx = 0.5
    command.vx[...] = 0.5
    command.power[...] = True
    assert command.to_bytes()[4 + 32 : 4 + 40] == np.float64(0.5).tobytes()


def test_copy_from_another_type_is_refused():
    with pytest.raises(LayoutError, match="Mode cannot take over"):
        Mode().copy_from(MotorCommand())  # type: ignore[arg-type]


def test_a_short_header_is_refused():
    with pytest.raises(LayoutError, match="5 bytes"):
        header(b"\x00" * 5)


@pytest.mark.parametrize("kind", SAMPLE_TYPES)
def test_floats_are_all_float64_fields_in_order(kind: type[Sample]) -> None:
    sample = kind()
    sample.floats[:] = np.arange(1.0, sample.floats.size + 1)
    fields = [
        np.atleast_1d(getattr(sample, name))
        for name, numpy_type, _ in kind.LAYOUT
        if numpy_type is np.float64
    ]
    np.testing.assert_array_equal(np.concatenate(fields), sample.floats)
    assert all(int(getattr(sample, name)) == 0 for name in ("sec", "nanosec", "episode", "seq"))


def test_an_answer_takes_stamp_episode_and_seq_of_the_question():
    question, answer = Sensors(), RobotState()
    question.stamp_ns = 5_000_000_007
    question.episode[...], question.seq[...] = 3, 9
    answer.q[:] = 1.0
    answer.answer(question)
    assert (answer.stamp_ns, int(answer.episode), int(answer.seq)) == (5_000_000_007, 3, 9)
    assert (answer.q == 1.0).all()


def test_the_tail_that_two_messages_share_is_copied_and_another_one_refused():
    sensors, state = Sensors(), RobotState()
    names = ("missed_ticks", "late_ticks", "wall_paced", "operator_lease")
    for number, name in enumerate(names):
        getattr(sensors, name)[...] = 7 + number
    state.sensor_faults[...] = 5
    state.copy_tail(sensors, "missed_ticks")
    assert [int(getattr(state, name)) for name in names] == [7, 8, 9, 10]
    assert state.sensor_faults == 5
    with pytest.raises(LayoutError, match="differ from longest_delay on"):
        state.copy_tail(sensors, "longest_delay")
