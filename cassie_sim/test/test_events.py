"""Events: pushes, gantry moves, sensor faults, set-points under way."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Delays, GantryMove, Push, Scenario, SensorFault
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_sim.errors import SimulationError
from cassie_sim.events import Events
from cassie_sim.gantry import Gantry
from cassie_sim.robot_mjcf import robot_model, robot_spec

RATE = 2000
PERIOD = 1.0 / RATE
ORIGIN = np.zeros(3)


def events(**scenario: object) -> Events:
    return Events(Scenario(**scenario), robot_model(), RATE)  # type: ignore[arg-type]


def momentum_gained(pushes: tuple[Push, ...], late: Push | None = None) -> np.ndarray:
    """Momentum of the free robot after half a second without gravity. Shape (3,), in Ns."""
    model = robot_spec(gravity=0.0).compile()
    model.dof_damping[:] = 0.0
    data, gantry = mujoco.MjData(model), Gantry()
    unit = Events(Scenario(pushes=pushes), model, RATE)
    for step in range(1000):
        if late is not None and step == 200:
            unit.push(late, step)
        unit.apply(step, data, gantry, ORIGIN)
        mujoco.mj_step(model, data)
    mujoco.mj_subtreeVel(model, data)
    return np.array(model.body_mass.sum() * data.subtree_linvel[0])


@pytest.mark.parametrize("body", ["pelvis", "left_toe", "right_tarsus"])
def test_push_gives_force_times_duration(body):
    push = Push(t=0.1, duration=0.05, force=(100.0, -60.0, 30.0), body=body)
    np.testing.assert_allclose(momentum_gained((push,)), [5.0, -3.0, 1.5], atol=0.03)


def test_pushes_add_up_and_one_may_come_in_late():
    pushes = (
        Push(t=0.1, duration=0.1, force=(50.0, 0.0, 0.0)),
        Push(t=0.15, duration=0.1, force=(0.0, 20.0, 0.0)),
        Push(t=0.15, duration=0.1, force=(10.0, 0.0, 0.0), body="left_toe"),
    )
    late = Push(t=0.0, duration=0.1, force=(0.0, 0.0, 10.0))
    np.testing.assert_allclose(momentum_gained(pushes, late), [6.0, 2.0, 1.0], atol=0.01)


def test_push_begins_and_ends_on_its_step_and_comes_again_after_reset():
    unit = events(pushes=(Push(t=0.01, duration=0.005, force=(1.0, 0.0, 0.0)),))
    data, pelvis = mujoco.MjData(robot_model()), robot_model().body("pelvis").id
    for _ in range(2):
        pushed = []
        for step in range(50):
            unit.apply(step, data, Gantry(), ORIGIN)
            pushed.append(float(data.xfrc_applied[pelvis, 0]))
        assert pushed == [0.0] * 20 + [1.0] * 10 + [0.0] * 20
        unit.reset()


def test_push_adds_to_the_pull_of_the_gantry():
    unit = events(pushes=(Push(t=0.0, duration=0.001, force=(1.0, 0.0, 0.0)),))
    data, gantry = mujoco.MjData(robot_model()), Gantry()
    pelvis = robot_model().body("pelvis").id
    gantry.wrench[2] = 300.0
    for step, expected in enumerate(([1.0, 0.0, 300.0], [1.0, 0.0, 300.0], [0.0, 0.0, 300.0])):
        data.xfrc_applied[pelvis] = gantry.wrench
        unit.apply(step, data, gantry, ORIGIN)
        np.testing.assert_array_equal(data.xfrc_applied[pelvis, :3], expected)


def test_unknown_body_names_the_nearest():
    with pytest.raises(
        SimulationError, match=r"push at 2\.5 s: unknown body pelvs: did you mean p"
    ):
        events(pushes=(Push(t=2.5, force=(1.0, 0.0, 0.0), body="pelvs"),))
    with pytest.raises(SimulationError, match="push: unknown body left_tow: did you mean left_toe"):
        events().push(Push(t=0.0, force=(1.0, 0.0, 0.0), body="left_tow"), 0)


def test_gantry_obeys_at_its_time():
    moves = (
        GantryMove(t=0.01, action="hold", height=1.0, speed=0.5),
        GantryMove(t=0.02, action="lower", height=0.9),
        GantryMove(t=0.03, action="release"),
    )
    unit, gantry, data = events(gantry=moves), Gantry(), mujoco.MjData(robot_model())
    held = []
    for step in range(80):
        unit.apply(step, data, gantry, np.array([0.0, 0.0, 1.0]))
        held.append(gantry.attached)
    assert held == [False] * 20 + [True] * 40 + [False] * 20


def spoiled(kind: str, channel: str = "drive_position.3", size: float = 1.0) -> list[np.ndarray]:
    """The channel's field at ticks 0, 1, ... of 2 ms, faulty from tick 5 to 15; truly its tick."""
    fault = SensorFault(t=0.01, duration=0.02, channel=channel, kind=kind, size=size)
    unit, sample = events(faults=(fault,)), Sensors()
    field = channel.partition(".")[0]
    rows = []
    for tick in range(20):
        getattr(sample, field)[...] = tick
        unit.spoil(4 * tick, sample)
        rows.append(np.array(getattr(sample, field)))
    return rows


@pytest.mark.parametrize(
    ("kind", "during"),
    [
        ("off", [0.0] * 10),
        ("nan", [np.nan] * 10),
        ("stuck", [5.0] * 10),
        ("delay", [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0]),
        ("spike", [8.0, 6.0, 7.0, 8.0, 9.0, 13.0, 11.0, 12.0, 13.0, 14.0]),
    ],
)
def test_faulty_channel(kind, during):
    rows = spoiled(kind, size=0.006 if kind == "delay" else 3.0)
    truth = np.arange(20.0)
    np.testing.assert_array_equal([row[2] for row in rows], truth)
    expected = truth.copy()
    expected[5:15] = during
    np.testing.assert_array_equal([row[3] for row in rows], expected)


def test_a_negative_delay_is_refused():
    with pytest.raises(SimulationError, match=r"fault at 0 s, .*: size = -0\.02 s is no delay"):
        events(faults=(SensorFault(t=0.0, channel="battery", kind="delay", size=-0.02),))


def test_fault_of_a_whole_field_and_of_a_single_number():
    np.testing.assert_array_equal(spoiled("off", "angular_velocity")[7], 0.0)
    np.testing.assert_array_equal(spoiled("off", "power")[7], 0.0)


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("drive_positon.3", "unknown channel drive_positon: did you mean drive_position"),
        ("seq", "unknown channel seq"),
        ("drive_position.10", "index must be 0 .. 9"),
        ("drive_position.x", "index must be 0 .. 9"),
        ("drive_position.-1", "index must be 0 .. 9"),
    ],
)
def test_unknown_channel_is_refused(channel, message):
    with pytest.raises(SimulationError, match=rf"fault at 1\.5 s.*{message}"):
        events(faults=(SensorFault(t=1.5, channel=channel, kind="off"),))


def numbered(number: int) -> MotorCommand:
    command = MotorCommand()
    command.torque[:] = number
    return command


def test_set_points_arrive_when_they_are_due():
    unit = events(delays=Delays(set_point=0.003))
    command, arrivals = MotorCommand(), []
    for step in range(16):
        if step % 4 == 0 and step < 12:
            command.torque[:] = step // 4 + 1  # the sender uses one message again and again
            unit.send(command, step)
        arrived = unit.arrived(step)
        arrivals.append(0 if arrived is None else int(arrived.torque[0]))
    assert arrivals == [0] * 6 + [1, 0, 0, 0, 2, 0, 0, 0, 3, 0]


def test_without_delay_the_command_itself_arrives_at_once():
    unit, command = events(), numbered(4)
    unit.send(command, 8)
    assert unit.arrived(8) is command
    assert unit.arrived(9) is None


def test_of_two_that_have_arrived_the_newer_counts_and_reset_forgets():
    unit = events(delays=Delays(set_point=0.001))
    unit.send(numbered(1), 0)
    unit.send(numbered(2), 1)
    arrived = unit.arrived(5)
    assert arrived is not None and arrived.torque[0] == 2.0
    unit.send(numbered(3), 6)
    unit.reset()
    assert unit.arrived(20) is None
