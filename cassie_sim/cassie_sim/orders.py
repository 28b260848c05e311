"""Pushes and gantry moves that are requested while the plant runs, checked as those of a file."""

from __future__ import annotations

from collections.abc import Sequence

from cassie_msgs.experiment.scenario import GantryMove, Push
from cassie_msgs.tunables import from_mapping
from cassie_sim.errors import SimulationError
from cassie_sim.gantry import SPEED
from cassie_sim.plant import Plant

CAUGHT = 0.5
"""Largest speed at which the Segway can be taken by its bar: it stops at once. In m/s."""


def push(plant: Plant, body: str, force: Sequence[float], duration: float) -> str:
    """Push a body from the next tick on.

    Args:
        plant: Plant whose body is pushed.
        body: Name of the body; empty is the pelvis.
        force: Force in world axes. Shape (3,), in N.
        duration: Duration of the push. In s.

    Returns:
        Text that says what happens.

    Raises:
        ParameterError, SimulationError: naming the value and the permitted values.
    """
    mapping = {"t": 0.0, "body": body or "pelvis", "force": list(force), "duration": duration}
    event = from_mapping(Push, mapping)
    plant.events.push(event, plant.seq * plant.substeps)
    x, y, z = (round(value, 1) + 0.0 for value in event.force)  # 0, not -0
    return f"{event.body} pushed with ({x:g}, {y:g}, {z:g}) N for {duration:g} s"


def hold_bar(plant: Plant, held: bool) -> str:
    """Hold the Segway by its bar, or release it.

    Returns:
        Text that says what happens.

    Raises:
        SimulationError: if there is no Segway, if it is faster than `CAUGHT`, or if the bar is to
            be released while the robot hangs.
    """
    vehicle = plant.vehicle
    if vehicle is None:
        raise SimulationError(f"there is no Segway in scene {plant.scenario.scene}")
    if not held and plant.gantry.attached:
        raise SimulationError(
            "the robot hangs in the gantry: let it down, wait for mode segway, then let go"
        )
    speed = vehicle.speed(plant.data)
    if held and speed > CAUGHT:
        raise SimulationError(
            f"the Segway rolls at {speed:.1f} m/s: its bar can be taken up to {CAUGHT:g} m/s; "
            "lean back to brake"
        )
    vehicle.hold_bar(held)
    return "somebody holds the bar" if held else "nobody holds the bar any more"


def move_gantry(plant: Plant, action: str, height: float, speed: float) -> str:
    """Hold the pelvis at a height, lower and then release it, or release it at once.

    Args:
        plant: Plant whose gantry moves.
        action: "hold", "lower" or "release".
        height: Pelvis height to reach, for hold and lower. In m.
        speed: Speed of the winch; 0 is the default. In m/s.

    Returns:
        Text that says what happens.

    Raises:
        ParameterError: naming the value and the permitted values.
        SimulationError: if the action is "lower" and the gantry does not hold the pelvis.
    """
    mapping: dict[str, object] = {"t": 0.0, "action": action}
    if action != "release":
        mapping |= {"height": height, "speed": speed or SPEED}
    move = from_mapping(GantryMove, mapping)
    gantry = plant.gantry
    if action == "hold":
        gantry.hold(plant.pelvis_pose[0], move.height, move.speed)
        return f"the gantry holds the pelvis at {move.height:g} m"
    if action == "lower":
        if not gantry.attached:
            raise SimulationError("the gantry does not hold the robot: ask for hold before lower")
        gantry.lower(move.height, move.speed)
        return f"the gantry lowers the pelvis to {move.height:g} m and lets go"
    gantry.release()
    return "the gantry has let go"
