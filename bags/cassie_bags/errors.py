"""Errors of recordings and experiments."""

from __future__ import annotations

from cassie_gaits.errors import CassieError


class ExperimentError(CassieError):
    """An experiment file says something that cannot be run."""


class BagError(CassieError):
    """A bag cannot be written, read or repaired."""


class RunError(CassieError):
    """A run did not come to its end: a node died, or did not answer."""
