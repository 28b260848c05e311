"""Errors of the simulator."""

from __future__ import annotations

from cassie_gaits.errors import CassieError


class SimulationError(CassieError):
    """A scene, scenario or simulator setting cannot be used."""


class CommandError(CassieError):
    """A motor command is refused: a value is not finite or a gain is out of range."""
