"""Rates and sensor grade of the plant."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_gaits.robot import ENCODER_RATE
from cassie_msgs.schedule import CONTROL_RATE
from cassie_msgs.tunables import check, tunable
from cassie_sim.errors import SimulationError


@dataclass(frozen=True, kw_only=True)
class PlantConfig:
    """Rates and sensor grade of the plant.

    `control_rate` must divide `physics_rate`.
    """

    physics_rate: int = tunable(2000, "Hz", 500, 20000, "Rate of physics and drives", live=False)
    control_rate: int = tunable(CONTROL_RATE, "Hz", 50, 4000, "Rate of sensor samples", live=False)
    sensors: str = tunable(
        "faithful",
        choices=("faithful", "ideal"),
        description="Sensors with resolution, filters, noise and delay, or the true values",
        live=False,
    )


def check_rates(config: PlantConfig) -> None:
    """Check that the rates are consistent.

    Raises:
        SimulationError, ParameterError: naming the setting, its value and the permitted values.
    """
    check(config)
    if config.physics_rate % config.control_rate:
        raise SimulationError(
            f"control_rate = {config.control_rate} Hz does not divide "
            f"physics_rate = {config.physics_rate} Hz"
        )
    if 1_000_000_000 % config.control_rate:
        raise SimulationError(
            f"control_rate = {config.control_rate} Hz: its period is no whole number of ns"
        )
    if config.sensors == "faithful" and config.physics_rate != ENCODER_RATE:
        raise SimulationError(
            f"physics_rate = {config.physics_rate} Hz: faithful sensors are defined "
            f"at {ENCODER_RATE:g} Hz; use sensors = ideal for other rates"
        )
