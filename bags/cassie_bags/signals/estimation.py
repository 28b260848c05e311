"""Errors of a state estimate."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_bags.bag.rows import FloatArray, Rows
from cassie_bags.signals.leg_geometry import in_heading


@dataclass(frozen=True)
class EstimationError:
    """Estimate minus truth at each tick.

    Attributes:
        velocity: Error of the pelvis velocity in the true heading frame. Shape (n, 3), in m/s.
        tilt: Error of roll and pitch. Shape (n, 2), in rad.
        position: Error of the horizontal displacement since the first tick, world axes. Shape
            (n, 2), in m.
    """

    velocity: FloatArray
    tilt: FloatArray
    position: FloatArray


def estimation_error(
    state: Rows, position: FloatArray, velocity: FloatArray, angles: FloatArray
) -> EstimationError:
    """Errors of estimated states.

    Args:
        state: Rows of `RobotState`. Shape (n,).
        position: True pelvis origin in the world. Shape (n, 3), in m.
        velocity: True velocity of the pelvis origin in the world. Shape (n, 3), in m/s.
        angles: True yaw, pitch, roll. Shape (n, 3), in rad.
    """
    error = state["v"][:, :3] - velocity
    moved = (state["q"][:, :2] - state["q"][0, :2]) - (position[:, :2] - position[0, :2])
    return EstimationError(
        velocity=in_heading(error, angles[:, 0]),
        tilt=state["q"][:, [5, 4]] - angles[:, [2, 1]],
        position=moved,
    )
