"""After a fall: rejected channels are checked anew at rest without power; dead ones stay out."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loop import PERIOD, Robot
from faulty_samples import monitored, samples

from cassie_control.errors import SensorError
from cassie_control.estimator.choice import make_monitored
from cassie_control.estimator.config import ESTIMATORS, EstimatorConfig
from cassie_control.guarded import GuardedEstimator, GuardedSupervisor
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import Sensors

SWINGS, RESTS = 1.5, 4.5  # s
LEARNED = 1.2  # s of rest
TARSUS = ("joint_position.4", "joint_velocity.4")
ADVICE = "switch the power off and hang it up or let it lie still for 1 s"


@pytest.fixture(scope="module")
def hung():
    """Hangs without power, is pushed at `SWINGS`, and has long been still from `RESTS` on."""
    push = {"t": SWINGS, "duration": 0.2, "force": (150.0, 60.0, 0.0)}
    robot = Robot(Scenario.from_mapping({"pushes": [push]}), "faithful", record=True)
    robot.ask(power=False)
    robot.run(7.0)
    return robot


def at(time):
    """Row of a time, in s."""
    return round(time / PERIOD)


def values_of(rows, channel):
    field, _, index = channel.partition(".")
    return rows[field][:, int(index)]


def flail(rows, pair=TARSUS):
    """Let a joint's position and velocity go wild for 0.3 s while it swings: it is lost."""
    draw = np.random.default_rng(3)
    for channel in pair:
        part = values_of(rows, channel)[at(SWINGS) : at(SWINGS + 0.3)]
        part += draw.uniform(-40.0, 40.0, len(part))


def answers(rows, core=None, come=None):
    """What is not believed and whether there is an estimate, row by row; the last state."""
    core, sample = core or monitored(), Sensors()
    raw, size, faults, known, state = rows.tobytes(), Sensors.SIZE, [], [], None
    for k in range(len(rows)) if come is None else np.flatnonzero(come):
        sample.load(raw[k * size : (k + 1) * size])
        try:
            state = core.step(sample)
        except SensorError:
            known.append(False)
        else:
            known.append(True)
        faults.append({name.partition(" ")[0] for name in core.faults})
    return faults, np.array(known), state


def test_what_hangs_still_without_power_is_learned_anew(hung):
    rows = samples(hung, 0)
    flail(rows)
    faults, known, state = answers(rows)
    assert set(TARSUS) <= faults[at(SWINGS + 0.3)]
    assert not known[at(SWINGS + 0.3) : at(SWINGS + 1.0)].any()
    assert known[at(RESTS + LEARNED) :].all()
    assert faults[-1] == set()
    _, _, expected = answers(samples(hung, at(RESTS)))
    assert np.abs(state.q[[2, *range(4, 20)]] - expected.q[[2, *range(4, 20)]]).max() < 0.01
    assert np.abs(state.v).max() < 0.2


def test_it_is_learned_anew_although_samples_are_missing(hung):
    rows = samples(hung, 0)
    flail(rows)
    come = np.arange(len(rows)) % 100 < 97
    faults, known, _ = answers(rows, come=come)
    assert not known[come[: at(SWINGS + 0.3)].sum()]
    assert known[come[: at(RESTS + LEARNED)].sum() :].all()
    assert faults[-1] == set()


def test_with_power_nothing_is_learned_anew(hung):
    rows = samples(hung, 0)
    flail(rows)
    rows["power"] = 1.0
    _, known, _ = answers(rows)
    assert not known[at(SWINGS + 0.3) :].any()


def test_what_moves_is_not_learned_anew(hung):
    rows = samples(hung, 0)
    flail(rows)
    swing = rows["drive_position"][:, 2], rows["drive_velocity"][:, 2]
    time = PERIOD * np.arange(len(rows))
    swing[0][:] += 0.3 * np.sin(6.0 * time)
    swing[1][:] += 1.8 * np.cos(6.0 * time)
    _, known, _ = answers(rows)
    assert not known[at(SWINGS + 0.3) :].any()


def test_what_its_partner_bears_out_is_believed_again_while_it_swings(hung):
    """A shin was not believed after a fall, as the robot swung on: switched on, it fell again."""
    rows, end = samples(hung, 0), at(SWINGS + 0.3)
    position, velocity = TARSUS
    flail(rows, (position,))
    values_of(rows, velocity)[at(SWINGS) : end] += 0.5  # what replaces it drifts off
    time = PERIOD * np.arange(len(rows))
    rows["drive_position"][:, 2] += 0.3 * np.sin(6.0 * time)
    rows["drive_velocity"][:, 2] += 1.8 * np.cos(6.0 * time)
    faults, known, _ = answers(rows)
    assert position in faults[end]
    assert known.all()
    assert faults[at(SWINGS + 2.5)] == set()


@pytest.mark.parametrize("kind", ["off", "stuck", "nan"])
@pytest.mark.parametrize("channel", ["drive_position.2", "drive_position.8", "joint_position.4"])
def test_a_dead_position_is_not_believed_because_it_hangs_still(hung, channel, kind):
    rows = samples(hung, 0)
    values = values_of(rows, channel)
    start = at(SWINGS + 0.1)
    values[start:] = {"off": 0.0, "stuck": values[start], "nan": np.nan}[kind]
    faults, known, _ = answers(rows)
    assert all(channel in names for names in faults[at(SWINGS + 0.5) :])
    assert known.all()


@pytest.mark.parametrize("kind", ["off", "stuck", "nan"])
@pytest.mark.parametrize("number", [("joint", 4), ("drive", 0), ("drive", 8)])
def test_a_joint_whose_encoder_breaks_in_a_fall_stays_lost(hung, number, kind):
    rows, (part, i), end = samples(hung, 0), number, at(SWINGS + 0.3)
    pair = (f"{part}_position.{i}", f"{part}_velocity.{i}")
    flail(rows, pair)
    rows["power"][: at(SWINGS + 0.4)] = 1.0
    for channel in pair:
        values = values_of(rows, channel)
        values[end:] = {"off": 0.0, "stuck": values[end], "nan": np.nan}[kind]
    faults, known, _ = answers(rows)
    assert not known[end:].any()
    assert set(pair) <= faults[-1]


def test_a_channel_that_was_off_while_it_fell_is_learned_anew(hung):
    rows = samples(hung, 0)
    for channel in TARSUS:
        values_of(rows, channel)[at(SWINGS + 0.1) : at(SWINGS + 1.1)] = 0.0
    faults, known, _ = answers(rows)
    assert "joint_position.4" in faults[at(SWINGS + 1.0)]
    assert known[at(RESTS + LEARNED) :].all()
    assert faults[-1] == set()


@pytest.mark.parametrize("channel", ["orientation", "drive_velocity.3", "joint_position.1"])
def test_a_channel_that_is_no_number_at_first_is_believed_later(hung, channel):
    """It had been compared with what it was replaced by, which was no number for good."""
    rows = samples(hung, at(RESTS))
    rows["power"] = 1.0
    values = rows[channel] if channel == "orientation" else values_of(rows, channel)
    values[: at(0.2)] = np.nan
    faults, known, _ = answers(rows)
    assert channel in faults[0]
    assert known[at(1.3) :].all()
    assert faults[-1] == set()


def test_after_a_gap_the_estimate_begins_anew(hung):
    """The filter had gone on from the attitude before the gap."""
    rows = samples(hung, 0)
    for channel in TARSUS:
        values_of(rows, channel)[at(SWINGS + 0.01) : at(SWINGS + 0.02)] = np.nan
    rows["power"] = 1.0
    core, sample = monitored(), Sensors()
    for k, moment in enumerate(hung.moments):
        sample.load(rows[k].tobytes())
        try:
            state = core.step(sample)
        except SensorError:
            continue
        assert np.abs(state.q[4:6] - moment.angles[1:]).max() < 0.02


@pytest.mark.parametrize("field", ["covariance", "vectors", "rotation"])
def test_a_filter_that_has_diverged_begins_anew(hung, field):
    rows = samples(hung, at(RESTS))
    core = monitored()
    answers(rows[:100], core)
    core.core._filter.records[field] = np.nan
    _, known, state = answers(rows[100:300], core)
    assert known[1:].all()
    assert np.isfinite(state.q).all()
    true = hung.moments[at(RESTS) + 299]
    assert np.abs(state.q[4:6] - true.angles[1:]).max() < 0.01


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_the_estimate_begins_anew_where_it_was(hung, estimator):
    rows = samples(hung, 0)
    rows["power"][: at(SWINGS + 0.5)] = 1.0
    core, sample, places = (
        make_monitored(EstimatorConfig(estimator=estimator), PERIOD),
        Sensors(),
        [],
    )
    for k in range(len(rows)):
        sample.load(rows[k].tobytes())
        places.append(core.step(sample).q[[0, 1, 3]].copy())
    assert core.starts == 1
    assert np.abs(places[at(SWINGS + 1.0)][:2]).max() > 2e-3
    assert np.abs(np.diff(places[at(SWINGS + 1.0) :], axis=0)).max() < 5e-4


def test_a_robot_that_never_had_power_does_not_begin_anew(hung):
    core = monitored()
    answers(samples(hung, 0), core)
    assert core.starts == 0


def test_the_fault_says_what_to_do(hung):
    rows = samples(hung, 0)
    flail(rows)
    estimator = GuardedEstimator(monitored())
    supervisor = GuardedSupervisor(ModeSupervisor(SupervisorConfig(), PERIOD))
    sample, end = Sensors(), at(SWINGS + 0.4)
    for k in range(end):
        sample.load(rows[k].tobytes())
        state = estimator.step(sample)
    supervisor.step(state, None)
    for words in (estimator.problem, *supervisor.status.faults):
        assert "joint_position.4 (right_tarsus), joint_velocity.4 (right_tarsus)" in words
        assert ADVICE in words
    for k in range(end, len(rows)):
        sample.load(rows[k].tobytes())
        state = estimator.step(sample)
    supervisor.step(state, None)
    assert estimator.problem == ""
    assert not any(ADVICE in fault for fault in supervisor.status.faults)


def test_let_down_it_knows_its_height_from_the_first_touch():
    """The height followed the ground within 0.1 s; after a fall it was a metre off before."""
    moves = [
        {"t": 0.1, "action": "hold", "height": 1.6, "speed": 1.0},
        {"t": 2.0, "action": "lower", "height": 0.82, "speed": 0.3},
    ]
    robot = Robot(Scenario.from_mapping({"gantry": moves}), "faithful", record=True)
    robot.ask(height=0.9)
    robot.run(7.0)
    touched = [m for m in robot.moments if m.forces.max() > 70.0]
    assert 3.0 < touched[0].time < 6.5
    errors = [abs(m.q[2] - m.position[2]) for m in touched]
    assert max(errors) < 0.12
    assert max(errors[at(0.2) :]) < 0.02
