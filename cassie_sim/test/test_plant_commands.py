"""Plant: motor commands on their way to the drives, refusals, watchdog and power."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Delays, Scenario
from cassie_msgs.layout import MotorCommand
from cassie_sim.errors import CommandError
from cassie_sim.plant import STANDING_DRIVES, Plant
from cassie_sim.plant_config import PlantConfig

IDEAL = PlantConfig(sensors="ideal")


def holding() -> MotorCommand:
    """Hold the start pose."""
    command = MotorCommand()
    command.position[:] = STANDING_DRIVES * 2
    command.kp[:], command.kd[:] = 200.0, 8.0
    return command


def test_torque_acts_three_milliseconds_after_the_command():
    plant = Plant(PlantConfig(control_rate=2000, sensors="ideal"))
    plant.power(True)
    command = MotorCommand()
    command.torque[0] = 20.0
    acting = []
    for _ in range(8):
        plant.step(command)
        acting.append(float(plant.drives.applied[0]))
    assert acting == [0.0] * 6 + [20.0] * 2


def test_delays_of_a_scenario_come_on_top():
    delays = Delays(torque=0.002, set_point=0.004)
    plant = Plant(PlantConfig(control_rate=2000, sensors="ideal"), Scenario(delays=delays))
    plant.power(True)
    command = MotorCommand()
    command.torque[0] = 20.0
    acting = []
    for _ in range(20):
        plant.step(command)
        acting.append(float(plant.drives.applied[0]))
    assert acting.index(20.0) == 6 + 4 + 8
    assert plant.drives.damped is False


def test_set_points_under_way_arrive_though_no_more_are_sent():
    plant = Plant(IDEAL, Scenario(delays=Delays(set_point=0.01)))
    plant.power(True)
    plant.step(holding())
    damped = []
    for _ in range(20):
        plant.step(None)
        damped.append(plant.drives.damped)
    # Sent at 0, there at 10 ms, and 20 ms later the watchdog damps.
    assert damped == [True] * 4 + [False] * 10 + [True] * 6


def test_refused_command_is_reported_and_the_tick_runs_damped_until_a_valid_one():
    plant = Plant(IDEAL)
    plant.power(True)
    plant.step(holding())
    assert plant.sense().damping == 0.0
    bad = holding()
    bad.kp[4] = math.nan
    with pytest.raises(CommandError, match="kp of left_toe is nan"):
        plant.step(bad)
    assert plant.seq == 2
    assert plant.sense().damping == 1.0
    plant.step(holding())
    assert plant.sense().damping == 0.0


def test_watchdog_damps_after_20_ms_without_commands():
    plant = Plant(IDEAL)
    plant.power(True)
    plant.step(holding())
    for _ in range(9):
        plant.step(None)
        assert plant.sense().damping == 0.0
    plant.step(None)
    assert plant.sense().damping == 1.0


def test_power_is_off_at_the_start_and_off_again_within_a_step():
    plant = Plant(PlantConfig(control_rate=2000))
    plant.step(holding())
    sample = plant.sense()
    assert sample.power == 0.0
    np.testing.assert_array_equal(sample.drive_torque, 0.0)
    plant.power(True)
    for _ in range(20):
        plant.step(holding())
    sample = plant.sense()
    assert sample.power == 1.0
    assert np.abs(sample.drive_torque).max() > 0.1
    plant.power(False)
    plant.step(holding())
    np.testing.assert_array_equal(plant.sense().drive_torque, 0.0)
    np.testing.assert_array_equal(plant.data.ctrl, 0.0)
