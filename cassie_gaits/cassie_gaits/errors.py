"""Errors that the project's cores raise for input they cannot use."""

from __future__ import annotations


class CassieError(ValueError):
    """Base of every error of gaits, control, simulation and bags.

    The message is one line that names the object, its value and the expected value.
    """


class KinematicsError(CassieError):
    """Joint angles or outputs that the leg's geometry does not allow."""


class LegLengthError(KinematicsError):
    """No knee angle gives the requested leg length."""

    @classmethod
    def outside(cls, length: float, low: float, high: float) -> LegLengthError:
        """The error for a length outside its range.

        Args:
            length: The length. In m.
            low, high: The range. In m.
        """
        return cls(f"leg length {length:.4f} m is outside {low:.4f} .. {high:.4f} m")


class GaitLibraryError(CassieError):
    """A gait library, or its file, cannot be used."""
