"""Errors of estimation and control."""

from __future__ import annotations

from cassie_gaits.errors import CassieError


class SensorError(CassieError):
    """A sensor sample cannot be used; the message names the field."""


class ControlError(CassieError):
    """A state or mode cannot be used; the message names the field."""
