"""Pushes and gantry moves that come in while the plant runs."""

from __future__ import annotations

import pytest

from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.errors import SimulationError
from cassie_sim.orders import CAUGHT, hold_bar, move_gantry, push
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(PlantConfig())


@pytest.fixture(autouse=True)
def _reset(plant: Plant) -> None:
    plant.reset()


def _run(plant: Plant, ticks: int) -> None:
    for _ in range(ticks):
        plant.sense()
        plant.step(None)


def test_a_push_lasts_its_time_and_moves_the_pelvis(plant: Plant) -> None:
    _run(plant, 50)
    push(plant, "", (200.0, 0.0, 0.0), 0.1)
    speed = float(plant.pelvis_twist[0])
    _run(plant, 50)
    assert plant.pelvis_twist[0] > speed + 0.1
    _run(plant, 2)
    pelvis = plant.model.body("pelvis").id
    assert plant.data.xfrc_applied[pelvis, 0] == pytest.approx(plant.gantry.wrench[0])


def test_the_answer_to_a_push_has_the_digits_of_a_push(plant: Plant) -> None:
    answer = push(plant, "", (119.99999, 0.00513814, -0.01), 0.1)
    assert answer == "pelvis pushed with (120, 0, 0) N for 0.1 s"


def test_release_drops_the_robot(plant: Plant) -> None:
    _run(plant, 50)
    move_gantry(plant, "release", 0.0, 0.0)
    _run(plant, 20)
    assert plant.pelvis_twist[2] < -0.3
    assert not plant.data.xfrc_applied.any()


def test_lower_moves_at_its_speed(plant: Plant) -> None:
    _run(plant, 50)
    height = plant.gantry.height
    move_gantry(plant, "lower", 1.0, 0.5)
    _run(plant, 50)
    assert plant.gantry.height == pytest.approx(height - 0.05, abs=1e-6)


def test_what_is_not_held_cannot_be_lowered(plant: Plant) -> None:
    _run(plant, 10)
    assert "let go" in move_gantry(plant, "release", 0.0, 0.0)
    with pytest.raises(ValueError, match="ask for hold before lower"):
        move_gantry(plant, "lower", 1.0, 0.5)


@pytest.mark.parametrize(
    ("body", "force", "duration", "words"),
    [
        ("pelvsi", (1.0, 0.0, 0.0), 1.0, "unknown body pelvsi"),
        ("world", (1.0, 0.0, 0.0), 1.0, "unknown body world"),
        ("", (float("nan"), 0.0, 0.0), 1.0, "force"),
        ("", (1.0, 0.0, 0.0), -1.0, "duration = -1 s is outside"),
    ],
)
def test_a_wrong_push_is_refused(
    plant: Plant, body: str, force: tuple[float, ...], duration: float, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        push(plant, body, force, duration)


@pytest.mark.parametrize(
    ("action", "height", "words"),
    [("drop", 0.9, "not one of hold, lower, release"), ("hold", 9.0, "height = 9 m is outside")],
)
def test_a_wrong_gantry_move_is_refused(
    plant: Plant, action: str, height: float, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        move_gantry(plant, action, height, 0.1)


def test_nobody_takes_the_bar_of_a_segway_that_rolls_fast() -> None:
    """It stopped at once, and the robot fell over the bar at 1.3 m/s."""
    plant = Plant(PlantConfig(), Scenario(scene="segway"))
    _run(plant, 10)
    with pytest.raises(SimulationError, match="hangs in the gantry"):
        hold_bar(plant, False)
    plant.gantry.release()
    hold_bar(plant, False)
    velocity = plant.data.joint("segway").qvel
    velocity[0] = 1.3
    with pytest.raises(
        SimulationError, match=r"rolls at 1\.3 m/s: its bar can be taken up to 0\.5"
    ):
        hold_bar(plant, True)
    velocity[0] = 0.9 * CAUGHT
    assert hold_bar(plant, True) == "somebody holds the bar"
    velocity[0] = 1.3  # whoever has it may let go at any speed
    assert hold_bar(plant, False) == "nobody holds the bar any more"
