"""Errors of estimation and control."""

from __future__ import annotations

from cassie_gaits.errors import CassieError


class SensorError(CassieError):
    """A sensor sample cannot be used; the message names the field.

    Attributes:
        missing: Channels without which there is no estimate, a bit each (`estimator.channels`).
    """

    def __init__(self, message: str, missing: int = 0) -> None:
        super().__init__(message)
        self.missing = missing


class ControlError(CassieError):
    """A state or mode cannot be used; the message names the field."""
