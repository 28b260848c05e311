"""Errors of recordings and experiments."""

from __future__ import annotations

from cassie_gaits.errors import CassieError


class ExperimentError(CassieError):
    """An experiment file has content that cannot be run."""


class BagError(CassieError):
    """A bag cannot be written, read or repaired."""


class RunError(CassieError):
    """A run did not end normally: a node died, or did not answer."""
