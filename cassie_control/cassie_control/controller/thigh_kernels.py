"""The hip as the torso's set-points take it: less of it rings, so that late set-points matter less.

The torso hangs on the stance hip: its drive is told the measured hip angle plus the torso's error.
Where set-points come late by D, the drive's damping is kd (v(t - D) - v(t)): nothing at 1 / D,
which for 20 ms is near the 42 Hz at which hip and leaf springs ring. So a share of the hip's motion
is replaced by a smooth track of the leg in space, hip angle less torso angle, which follows a
steady swing without lag,

    x' = r + 2 w (thigh - x),   r' = w^2 (thigh - x),

and which the drive damps at 2 kHz, late or not. It is a share only: as damping at the drive it
makes torques that come late by 3 ms ring at the same frequency.
"""

from __future__ import annotations

import math
from typing import Any

from cassie_gaits.compiled import compiled


@compiled
def _thigh(robot: Any, i: int, axis: int) -> tuple[float, float]:
    """Leg `i` in space, about roll (`axis` 0) or against pitch (1). In rad and rad/s."""
    if axis == 0:
        return robot.joints[i, 0] + robot.roll, robot.rates[i, 0] + robot.roll_rate
    return robot.joints[i, 2] - robot.pitch, robot.rates[i, 2] - robot.pitch_rate


@compiled
def track_thighs(figure: Any, robot: Any, step: Any) -> None:
    """Bring the tracks of both legs up to date; the first ones begin as measured."""
    w, dt = 2.0 * math.pi * figure.thigh_track, figure.period
    for i in range(2):
        for axis in range(2):
            angle, rate = _thigh(robot, i, axis)
            if step.tracked == 0.0:
                step.thigh[i, axis], step.thigh_rates[i, axis] = angle, rate
            else:
                ahead = step.thigh[i, axis] + dt * step.thigh_rates[i, axis]
                step.thigh[i, axis] = ahead + 2.0 * w * dt * (angle - ahead)
                step.thigh_rates[i, axis] += w * w * dt * (angle - ahead)
    step.tracked = 1.0


@compiled
def steady_hip(figure: Any, robot: Any, i: int, axis: int, step: Any) -> tuple[float, float]:
    """Hip roll (`axis` 0) or pitch (1) of a leg, with its share of the track. In rad, rad/s."""
    angle, rate = _thigh(robot, i, axis)
    joint = 2 * axis
    return (
        robot.joints[i, joint] + figure.thigh_angle * (step.thigh[i, axis] - angle),
        robot.rates[i, joint] + figure.thigh_rate * (step.thigh_rates[i, axis] - rate),
    )
