"""Physics made before its command is there: the same to the last bit, whatever comes in between."""

from __future__ import annotations

import gc
import math
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Delays, Draw, GantryMove, Push, Scenario
from cassie_msgs.layout import MotorCommand
from cassie_sim.errors import CommandError
from cassie_sim.physics_thread import PhysicsThread
from cassie_sim.plant import STANDING_DRIVES, Plant
from cassie_sim.plant_config import PlantConfig

TICKS = 150

SCENARIOS = {
    "falling": Scenario(draw=Draw.from_seed(3), gantry=(GantryMove(t=0.0, action="release"),)),
    "standing": Scenario(start="standing", draw=Draw.from_seed(4)),
    "pushed": Scenario(
        gantry=(GantryMove(t=0.0025, action="release"), GantryMove(t=0.1005, height=1.0)),
        pushes=(
            Push(t=0.0515, duration=0.0205, force=(80.0, 40.0, 0.0)),
            Push(t=0.0805, duration=0.001, force=(0.0, 40.0, 0.0), body="left_shin"),
        ),
    ),
    "delayed": Scenario(delays=Delays(torque=0.001, set_point=0.0035)),
}


def command(tick: int) -> MotorCommand | None:
    """Now and then none, and one that is refused."""
    made = MotorCommand()
    made.position[:] = STANDING_DRIVES * 2
    made.position[3] += 0.1 * math.sin(0.3 * tick)
    made.kp[:], made.kd[:] = 200.0, 8.0
    if tick == 60:
        made.kp[0] = math.nan
    return None if 90 <= tick < 105 else made


def nothing(_plant: Plant, _tick: int) -> None:
    return None


def between(plant: Plant, tick: int) -> None:
    """What a person does while the command of a tick is computed."""
    if tick in (20, 40, 70):
        plant.power(tick != 20)
    elif tick == 50:
        plant.take_back()
        plant.events.push(Push(t=0.0, duration=0.01, force=(30.0, 0.0, 0.0)), plant.seq * 4)
    elif tick == 80:
        plant.take_back()
        plant.gantry.hold(plant.pelvis_pose[0], 0.9)
    elif tick == 100:
        plant.gantry.release()


def trajectory(
    plant: Plant, *, ahead: bool, between: Callable[[Plant, int], None] = nothing
) -> tuple[np.ndarray, int]:
    """True state and sample of each tick, and the number of ticks begun ahead."""
    plant.power(True)
    rows, early, refused = [], 0, 0
    for tick in range(TICKS):
        raw = np.frombuffer(plant.sense().to_bytes(), np.uint8).astype(float)
        rows.append(np.concatenate([plant.data.qpos, plant.data.qvel, raw]))
        if ahead:
            plant.run_ahead()
            early += plant.beside or plant.data.time > plant.time + 1e-9
        between(plant, tick)
        try:
            plant.step(command(tick))
        except CommandError:
            refused += 1
    assert refused == 1
    return np.array(rows), early


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize(
    "config",
    [
        PlantConfig(),
        PlantConfig(control_rate=2000),
        PlantConfig(control_rate=250),
        PlantConfig(sensors="ideal"),
    ],
    ids=["500", "2000", "250", "ideal"],
)
def test_the_same_to_the_last_bit(name, config, beside):
    expected, _ = trajectory(Plant(config, SCENARIOS[name]), ahead=False)
    plant = Plant(config, SCENARIOS[name])
    plant.beside = beside
    found, early = trajectory(plant, ahead=True)
    np.testing.assert_array_equal(found, expected)
    if name == "falling":
        assert early >= TICKS - 2
    if name == "delayed" and not beside:
        assert not early


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("name", ["falling", "standing", "pushed"])
def test_the_same_when_something_comes_in_between(name, beside):
    plain = Plant(PlantConfig(), SCENARIOS[name])
    expected, _ = trajectory(plain, ahead=False, between=between)
    plant = Plant(PlantConfig(), SCENARIOS[name])
    plant.beside = beside
    found, early = trajectory(plant, ahead=True, between=between)
    np.testing.assert_array_equal(found, expected)
    assert early > 20
    plant.run_ahead()
    plant.reset()
    plain.reset()
    np.testing.assert_array_equal(
        trajectory(plant, ahead=True)[0], trajectory(plain, ahead=False)[0]
    )


def test_taken_back_is_as_before():
    plant = Plant(PlantConfig(), SCENARIOS["falling"])
    trajectory(plant, ahead=True)
    before = plant.data.qpos.copy(), plant.data.qvel.copy(), plant.data.time
    plant.run_ahead()
    assert (plant.data.qpos != before[0]).any()
    plant.take_back()
    np.testing.assert_array_equal(plant.data.qpos, before[0])
    np.testing.assert_array_equal(plant.data.qvel, before[1])
    assert plant.data.time == before[2]


def test_a_thread_of_the_physics_sleeps_between_runs_and_ends_with_its_plant():
    plant = Plant(PlantConfig(), SCENARIOS["falling"])
    plant.beside = True
    gc.collect()  # of other plants
    before = threading.active_count()
    trajectory(plant, ahead=True)
    assert threading.active_count() == before + 1
    for _ in range(3):
        time.sleep(0.1)  # longer than it looks for work
        used = time.process_time()
        time.sleep(0.2)
        assert time.process_time() - used < 0.1
        tick = plant.seq
        plant.sense()
        plant.run_ahead()
        plant.step(command(0))
        assert plant.seq == tick + 1
    del plant
    gc.collect()
    assert threading.active_count() == before


def test_on_a_busy_machine_the_physics_goes_on_in_its_own_thread_no_more(monkeypatch):
    plant, plain = (Plant(PlantConfig(), SCENARIOS["falling"]) for _ in range(2))
    plant.beside = True
    monkeypatch.setattr(PhysicsThread, "finish", lambda self: finish(self) or True)
    begun = []
    monkeypatch.setattr(PhysicsThread, "begin", lambda self, n: begun.append(n) or begin(self, n))
    found, _ = trajectory(plant, ahead=True)
    np.testing.assert_array_equal(found, trajectory(plain, ahead=False)[0])
    assert len(begun) == 1


begin, finish = PhysicsThread.begin, PhysicsThread.finish
