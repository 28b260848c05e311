"""Of a position and a velocity that do not go together the right one is named, and in time."""

from __future__ import annotations

import numpy as np
import pytest
from faulty_samples import IN_TIME, LIMITS, reports, samples, spoil


@pytest.mark.parametrize("channel", ["angular_velocity.2", "drive_velocity.1", "drive_velocity.6"])
def test_spikes_of_a_velocity_do_not_make_its_position_look_late(walked_faithful, channel):
    rows = samples(walked_faithful, 1250)
    bad = spoil(rows, channel, "spike", 240)
    first = reports(rows)
    assert first.get(channel, 10**6) <= bad[0] + IN_TIME
    assert set(first) <= {channel}


@pytest.mark.parametrize("drive", [5, 6])
@pytest.mark.parametrize("start", [300, 340, 380])
def test_a_position_that_jumps_a_little_and_stays_is_not_taken_for_its_velocity(
    walked_faithful, drive, start
):
    """At rest the velocity had said 0 for a while: it seemed to be stuck while the joint moved."""
    rows = samples(walked_faithful, 0)[: start + 100]
    position, velocity = (rows[field][:, drive] for field in ("drive_position", "drive_velocity"))
    position[start - 10 : start], velocity[start - 10 : start + 1] = position[start], 0.0
    position[start:] -= 0.017
    position[start:] = position[start]
    first = reports(rows)
    assert first.get(f"drive_position.{drive}", 10**6) <= start + IN_TIME
    assert set(first) <= {f"drive_position.{drive}"}


@pytest.mark.parametrize("channel", ["joint_velocity.2", "joint_velocity.5"])
def test_spikes_of_a_toe_that_stands_are_named_in_time(walked_faithful, channel):
    """Those of 2 rad/s were just as large as what counted as one: the noise decided."""
    rows = samples(walked_faithful, 0)[:400]
    field, _, index = channel.partition(".")
    rows[field][300::5, int(index)] += 1.8
    first = reports(rows)
    assert first.get(channel, 10**6) <= 308  # once the second one is over
    assert set(first) <= {channel}


@pytest.mark.parametrize(
    "channel", ["angular_velocity.1", "drive_position.3", "drive_velocity.2", "joint_position.1"]
)
def test_a_channel_that_comes_late_is_named_in_time(walked_faithful, channel):
    rows = samples(walked_faithful, 1250)
    bad = spoil(rows, channel, "delay", 200)
    first = reports(rows)
    assert len(bad)
    assert first.get(channel, 10**6) <= bad[0] + IN_TIME


@pytest.mark.parametrize(
    "channel", ["drive_position.3", "drive_position.8", "drive_velocity.8", "joint_position.4"]
)
@pytest.mark.parametrize("late", [10, 15, 20])
def test_of_a_pair_the_late_one_is_named_whenever_it_begins(walked_faithful, channel, late):
    for start in range(200, 500, 20):
        rows = samples(walked_faithful, 1250)[: start + 250]
        field, _, index = channel.partition(".")
        values = rows[field][:, int(index)]
        true = values.copy()
        values[start:] = true[np.maximum(start, np.arange(start, len(true)) - late)]
        bad = np.flatnonzero(np.abs(values - true) > LIMITS[field.rpartition("_")[2]])
        first = reports(rows)
        if len(bad) and bad[0] + IN_TIME < len(rows):
            assert first.get(channel, 10**6) <= bad[0] + IN_TIME, f"late from row {start} on"
