"""Stairs: flights of risers and treads with landings between them."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.tunables import tunable
from cassie_sim.stretches import Stretch

BEYOND = 100.0
"""Length of the ground behind the last flight. In m."""

WAYS = ("up", "down", "up_and_down", "down_and_up")


@dataclass(frozen=True, kw_only=True)
class Stairs:
    """Level ground, then flights of stairs that are unknown to the robot."""

    friction: float = tunable(1.0, "", 0.05, 3.0, "Coulomb friction of the ground")
    riser: float = tunable(0.1, "m", 0.0, 0.25, "Height of each step")
    tread: float = tunable(0.3, "m", 0.2, 2.0, "Depth of each step")
    number: int = tunable(5, "", 1, 50, "Number of risers in a flight")
    way: str = tunable(
        "up_and_down", choices=WAYS, description="Direction of the flights, possibly alternating"
    )
    flights: int = tunable(2, "", 1, 50, "Number of flights")
    landing: float = tunable(1.5, "m", 0.2, 20.0, "Length of level ground between two flights")
    start: float = tunable(1.5, "m", 0.3, 50.0, "Distance ahead at which the first riser is")


def stairs_stretches(settings: Stairs) -> list[Stretch]:
    """The ground from the start on, as stretches: each riser is the step of its tread's stretch."""
    stretches = [Stretch(length=settings.start, friction=settings.friction)]
    words = settings.way.split("_and_")
    for flight in range(settings.flights):
        rise = settings.riser if words[flight % len(words)] == "up" else -settings.riser
        last = BEYOND if flight == settings.flights - 1 else settings.landing
        stretches += flight_stretches(settings, rise, last)
    return stretches


def flight_stretches(settings: Stairs, rise: float, landing: float) -> list[Stretch]:
    """One flight, with the landing behind it.

    Args:
        settings: Treads, number and friction.
        rise: Height of each step; negative goes down. In m.
        landing: Length of the landing. In m.
    """
    lengths = [settings.tread] * (settings.number - 1) + [landing]
    return [Stretch(length=length, step=rise, friction=settings.friction) for length in lengths]
