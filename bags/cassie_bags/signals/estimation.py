"""Errors of a state estimate."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_bags.bag.rows import FloatArray
from cassie_bags.signals.leg_geometry import in_heading
from cassie_bags.signals.track import Track


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


def estimation_error(track: Track) -> EstimationError:
    """Errors of the estimated states of a track."""
    q, place = track.state["q"], track.position[:, :2]
    return EstimationError(
        velocity=in_heading(track.state["v"][:, :3] - track.velocity, track.angles[:, 0]),
        tilt=q[:, [5, 4]] - track.angles[:, [2, 1]],
        position=(q[:, :2] - q[0, :2]) - (place - place[0]),
    )
