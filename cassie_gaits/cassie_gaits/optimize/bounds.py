"""Bounds of a program's rows and unknowns for one request."""

from __future__ import annotations

import numpy as np

from cassie_gaits.bezier import COEFFICIENTS
from cassie_gaits.optimize import grid
from cassie_gaits.optimize.constraints import AHEAD, APART, BEHIND, LANDING, PELVIS, STRAIGHT
from cassie_gaits.optimize.posture import COORDINATES
from cassie_gaits.optimize.problem import Problem
from cassie_gaits.optimize.request import Limits, Request
from cassie_gaits.records import FloatArray

OUTER_WAY = 0.3
"""Room for the outer foot per turn of a step: its longer path, and as much for its detour. In m."""


def row_bounds(program: Problem, request: Request) -> tuple[FloatArray, FloatArray]:
    """Bounds of the program's rows, tightened by the request. Shape (rows,) each."""
    lower, upper = program.lower.copy(), program.upper.copy()
    names = np.array(program.names)
    limits = Limits()
    lower[names == APART] += request.feet_apart - limits.feet_apart
    lower[names == LANDING] += limits.landing_speed - request.landing_speed
    upper[names == PELVIS] += request.pelvis_distance - limits.pelvis_high
    room = request.detour + OUTER_WAY * abs(request.yaw_rate) * request.step_time
    upper[names == AHEAD], lower[names == BEHIND] = room, -room
    if request.slope != 0.0:
        lower[names == STRAIGHT] = upper[names == STRAIGHT] = 0.0
    return lower, upper


def unknown_bounds(program: Problem, request: Request) -> tuple[FloatArray, FloatArray]:
    """Bounds of the unknowns, (unknowns,) each. Bounds of coefficients bound a Bezier curve."""
    turning = abs(request.yaw_rate) * request.step_time
    narrow = {"torso_roll": request.torso_roll, "torso_pitch": request.torso_pitch}
    narrow |= dict.fromkeys(("stance_hip_yaw", "swing_hip_yaw"), request.hip_yaw + turning)
    bound = np.full(program.unknowns, np.inf)
    parts = bound.reshape(-1, grid.STEP_UNKNOWNS)
    for name, most in narrow.items():
        first = COORDINATES.index(name) * COEFFICIENTS
        parts[:, first : first + COEFFICIENTS] = most
    lower, upper = np.maximum(program.x_lower, -bound), np.minimum(program.x_upper, bound)
    first = COORDINATES.index("swing_foot_pitch") * COEFFICIENTS
    for x in (lower, upper):  # the foot is level except near lift-off and landing
        x.reshape(-1, grid.STEP_UNKNOWNS)[:, first + 2 : first + 5] = request.slope
    return lower, upper
