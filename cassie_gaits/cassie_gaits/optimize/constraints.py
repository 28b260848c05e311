"""The rows of Table `table:optimization_constraints` and the robot's limits, as program blocks."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from cassie_gaits import robot
from cassie_gaits.optimize import grid
from cassie_gaits.optimize.blocks import Block, Inner, Row
from cassie_gaits.optimize.inverse_dynamics import RIGID_JOINTS
from cassie_gaits.optimize.posture import SIZE, places, posture
from cassie_gaits.optimize.request import Limits
from cassie_gaits.optimize.step_model import Instant, instant, touchdown
from cassie_gaits.records import FloatArray

PARAMETERS = ("vx", "vy", "yaw_rate", "step_time", "clearance", "slope", "payload", "asymmetry")
"""Order of the program's parameters, as `request.parameters` gives them."""

GRID = 25
"""Instants at which rows of the posture alone are checked; odd, so that one is mid-step."""

APART = "distance between feet"
LANDING = "swing foot velocity on impact (z)"
AHEAD = "swing foot ahead of where it lands"
BEHIND = "swing foot behind where it lifts off"
PELVIS = "distance between pelvis and stance foot"
"""Rows whose bounds a request may tighten."""

STRAIGHT = "swing foot straight ahead on a slope"
"""The row whose bounds become equal on a slope: turned-out feet would not stand level there."""

LEGS = {"stance": "right", "swing": "left"}

INF = math.inf


def parameter_symbols() -> tuple[ca.SX, dict[str, ca.SX]]:
    """The vector of parameters and its entries by name."""
    p = ca.SX.sym("p", len(PARAMETERS))
    return p, {name: p[i] for i, name in enumerate(PARAMETERS)}


def dynamics_block(limits: Limits, place: FloatArray, sign: float, *, lean: bool) -> Block:
    """Dynamics, drives and friction at the Gauss points.

    Args:
        limits: Bounds.
        place: Matrix from all unknowns to those of this step.
        sign: Sign of the pelvis's asymmetry in this step.
        lean: Whether to omit constraints that walking seldom reaches: the drives' torque at speed.
    """
    p, by_name = parameter_symbols()
    z = ca.SX.sym("z", 3 * SIZE)
    time = by_name["step_time"]
    y, y1, y2 = ca.vertsplit(z, SIZE)
    arguments = [y, y1 / time, y2 / time**2, by_name["slope"], by_name["asymmetry"]]
    arguments.append(by_name["payload"])
    at = instant()
    symbols = [at.y, at.yd, at.ydd, at.slope, at.asymmetry, at.payload]
    names = ("force", "roll_moment", "torque", "rate", "attitude", "hips")
    values = ca.Function("inner", symbols, _inner_values(at), list("yvaspm"), list(names))(
        *arguments
    )
    parts = dict(zip(names, values, strict=True))
    if lean:
        del parts["rate"]
    inner = {name: ca.SX.sym(name, part.size1()) for name, part in parts.items()}
    phases, weights = grid.gauss()
    return Block(
        "dynamics",
        z,
        p,
        _dynamics_rows(inner, limits),
        [grid.coordinates_at(phase, 2) @ place for phase in phases],
        _cost(inner, limits),
        weights,
        Inner(ca.vertcat(*inner.values()), ca.vertcat(*parts.values())),
        signs=_asymmetry_times(sign),
        form=("dynamics", limits, lean),
    )


def _asymmetry_times(sign: float) -> FloatArray:
    """Factors of the parameters, with `sign` for the pelvis's asymmetry."""
    return np.array([sign if name == "asymmetry" else 1.0 for name in PARAMETERS])


def _inner_values(at: Instant) -> list[ca.SX]:
    """Force in ground axes, moment about the foot, torques, rates, torso pitch and roll, hips."""
    c, s = ca.cos(at.slope), ca.sin(at.slope)
    along, across = c * at.force[0] + s * at.force[2], c * at.force[2] - s * at.force[0]
    return [
        ca.vertcat(along, at.force[1], across),
        ca.dot(at.posture.foot_to_ground[:, 0], at.moment),
        ca.vertcat(at.efforts.stance, at.efforts.swing),
        ca.vertcat(at.stance_rate, at.swing_rate),
        at.posture.torso[1:],
        ca.vertcat(at.posture.stance[:2], at.posture.swing[:2]),
    ]


def _dynamics_rows(at: dict[str, ca.SX], limits: Limits) -> list[Row]:
    weight = robot.WEIGHT  # only a scale, so the payload is omitted
    along, side, across = ca.vertsplit(at["force"])
    cone = (limits.share * limits.friction * across) ** 2 - along**2 - side**2
    toe = RIGID_JOINTS.index("toe")
    law: dict[str, Any] = {"low": 0.0, "high": 0.0, "scale": 10.0, "unit": "Nm", "law": True}
    return [
        Row("dynamics of the stance foot's roll", at["roll_moment"], **law),
        Row("torque for stance foot pitch", at["torque"][toe], **law),
        Row("friction cone", cone / weight**2, 0.0, INF),
        Row("ground pushes", across / weight, 0.05, INF),
        *_drive_rows(at["torque"], at.get("rate"), limits),
    ]


def _drive_rows(torques: ca.SX, rates: ca.SX | None, limits: Limits) -> list[Row]:
    """|u| <= u_max, and with rates |u| / (2 u_max) + |speed| / no-load speed <= 1."""
    rows, full = [], limits.share
    names = [(side, joint) for side in LEGS for joint in RIGID_JOINTS]
    for i, (side, joint) in enumerate(names):
        drive, name = robot.DRIVES[joint], f"{side} {joint.replace('_', ' ')}"
        load = torques[i] / (2.0 * drive.torque_limit)
        moves = (side, joint) != ("stance", "toe")
        if moves:
            rows.append(Row(f"torque of {name}", load, -0.5 * full, 0.5 * full))
        if rates is not None:
            speed = rates[i] / drive.speed_limit
            for sign in (1.0, -1.0) if moves else (1.0,):
                value = sign * speed + (load if moves else 0.0)
                rows.append(Row(f"torque at speed of {name}", value, -full, full))
    return rows


def _cost(at: dict[str, ca.SX], limits: Limits) -> ca.SX:
    """Integrand of the cost in "Set of Gaits"."""
    guided = ca.vertcat(at["attitude"], at["hips"])
    return ca.sumsqr(at["torque"]) + limits.weight * ca.sumsqr(guided)


def posture_block(limits: Limits, place: FloatArray, *, lean: bool) -> Block:
    """Block of distances and joint stops over the whole step.

    Args:
        limits: Bounds.
        place: Matrix from all unknowns to those of this step.
        lean: Whether to omit the joint stops.
    """
    p, by_name = parameter_symbols()
    y = ca.SX.sym("y", SIZE)
    at = posture(y, by_name["slope"])
    pelvis, foot, attitude = places(at)
    c, s = ca.cos(by_name["slope"]), ca.sin(by_name["slope"])
    tilt = c * attitude[2, 0] - s * attitude[0, 0]
    margin = limits.margin
    stride = ca.fabs(by_name["vx"]) * by_name["step_time"]
    rows = [
        Row(
            PELVIS,
            ca.norm_2(pelvis),
            limits.pelvis_low + margin,
            limits.pelvis_high - margin,
            unit="m",
        ),
        Row(APART, foot[1], limits.feet_apart + margin, INF, unit="m"),
        Row(AHEAD, foot[0] - stride, -INF, 0.0, unit="m"),
        Row(BEHIND, foot[0] + stride, 0.0, INF, unit="m"),
        Row("absolute swing foot pitch", tilt, -limits.foot_pitch, limits.foot_pitch, unit="rad"),
    ]
    if not lean:
        rows += _stop_rows("stance", at.stance) + _stop_rows("swing", at.swing)
    phases = np.linspace(0.0, 1.0, GRID)
    maps = [grid.coordinates_at(phase, 0) @ place for phase in phases]
    return Block("posture", y, p, rows, maps, form=("posture", limits, lean))


_STOP_MARGIN = 1e-3  # rad, by which joints stay inside their stops


def _stop_rows(side: str, joints: ca.SX) -> list[Row]:
    rows, stops = [], robot.stops(LEGS[side]) | {"knee": robot.KNEE_STOPS}
    for i, joint in enumerate(RIGID_JOINTS):
        low, high = stops[joint]
        name = f"stops of {side} {joint.replace('_', ' ')}"
        rows.append(Row(name, joints[i], low + _STOP_MARGIN, high - _STOP_MARGIN, unit="rad"))
    return rows


def clearance_block(limits: Limits, place: FloatArray, *, middle: bool) -> Block:
    """Block of the swing foot's height.

    Args:
        limits: Bounds.
        place: Matrix from all unknowns to those of this step.
        middle: True for a height of at least the clearance at mid-step, false for a foot above the
            ground during the step.
    """
    p, by_name = parameter_symbols()
    y = ca.SX.sym("y", SIZE)
    slope = by_name["slope"]
    _, foot, _ = places(posture(y, slope))
    height = ca.cos(slope) * foot[2] - ca.sin(slope) * foot[0]
    if middle:
        phases = [0.5]
        above = height - by_name["clearance"]
        row = Row("mid-step swing foot clearance", above, limits.margin, INF, unit="m")
    else:
        phases = list(np.linspace(0.0, 1.0, GRID)[1:-1])
        row = Row("swing foot above the ground", height, 0.0, INF, unit="m")
    maps = [grid.coordinates_at(phase, 0) @ place for phase in phases]
    name = "clearance" if middle else "height"
    return Block(name, y, p, [row], maps, form=(name, limits))


def landing_block(limits: Limits, end: FloatArray, start: FloatArray, sign: float) -> Block:
    """Change of legs: equal posture, impact map, and touchdown of the swing foot.

    Args:
        limits: Bounds.
        end: Matrix from all unknowns to those of the step that ends.
        start: Matrix from all unknowns to those of the following step, which is mirrored.
        sign: Sign of the pelvis's asymmetry in the step that ends.
    """
    p, by_name = parameter_symbols()
    z = ca.SX.sym("z", 4 * SIZE)
    time, slope = by_name["step_time"], by_name["slope"]
    ye, ye1, ys, ys1 = ca.vertsplit(z, SIZE)
    at = touchdown()
    symbols = [at.end, at.end_rate, at.start, at.start_rate, at.slope, at.asymmetry, at.payload]
    results = [at.same_posture, at.impulse, at.foot, at.foot_velocity, at.foot_yaw, at.lift]
    same, impulse, foot, velocity, yaw, lift = ca.Function("at", symbols, results)(
        *(ye, ye1 / time, ys, ys1 / time, slope),
        *(by_name["asymmetry"], by_name["payload"]),
    )
    c, s = ca.cos(slope), ca.sin(slope)
    along, across = c * velocity[0] + s * velocity[2], c * velocity[2] - s * velocity[0]
    law: dict[str, Any] = {"low": 0.0, "high": 0.0, "law": True}
    rows = [Row("same posture after the change of legs", same[i], **law) for i in range(12)]
    rows += [Row("impact map", impulse[i], **law) for i in range(11)]
    fast = limits.landing_speed - 1e-3
    rows += [
        Row("swing foot lands", c * foot[2] - s * foot[0], **law),
        Row("swing foot velocity on impact (x)", along, 0.0, 0.0, unit="m/s"),
        Row("swing foot velocity on impact (y)", velocity[1], 0.0, 0.0, unit="m/s"),
        Row(LANDING, across, -fast, -limits.definite, unit="m/s"),
        Row("swing foot lifts off", c * lift[2] - s * lift[0], limits.definite, INF, unit="m/s"),
        Row(STRAIGHT, yaw, -1.0, 1.0, unit="rad"),
    ]
    ends, starts = grid.coordinates_at(1.0, 1) @ end, grid.coordinates_at(0.0, 1) @ start
    maps, signs = [np.vstack([ends, starts])], _asymmetry_times(sign)
    return Block("landing", z, p, rows, maps, signs=signs, form=("landing", limits))


def travel_block(first: FloatArray, second: FloatArray | None) -> Block:
    """Mean velocity and turn over two steps.

    Args:
        first: Matrix from all unknowns to those of the step on the right leg.
        second: Matrix for the step on the left leg, mirrored; None for a symmetric gait.

    The feet may be turned out: the heading is the mean of both feet's headings. A symmetric gait
    goes straight along it. Otherwise the robot goes along an arc, on which one foot has the longer
    path. Its velocity is then the mean of both feet's velocities, each over two steps and relative
    to the heading halfway.
    """
    p, by_name = parameter_symbols()
    count = 1 if second is None else 2
    z = ca.SX.sym("z", count * SIZE)
    time, slope = by_name["step_time"], by_name["slope"]
    at = touchdown()
    place = ca.Function("place", [at.end, at.slope], [at.foot, at.foot_yaw])
    foot, yaw = place(z[:SIZE], slope)
    ahead = foot[0] / ca.cos(slope)
    if second is None:
        advance = ahead * ca.cos(yaw / 2.0) + foot[1] * ca.sin(yaw / 2.0)
        miss = advance / time - by_name["vx"]
        rows = [Row("average sagittal velocity", miss, 0.0, 0.0, unit="m/s")]
        maps = [grid.coordinates_at(1.0, 0) @ first]
        return Block("travel", z, p, rows, maps, form=("travel", 1))
    other, other_yaw = place(z[SIZE:], slope)
    turn, yaw2 = by_name["yaw_rate"], -other_yaw
    step = ca.vertcat(ahead, foot[1])
    next_step = ca.vertcat(other[0] / ca.cos(slope), -other[1])
    # The chord of an arc is shorter than the arc by the factor sin(a) / a, even in a.
    bend = turn * time
    chord = 2.0 * time * (1.0 - bend**2 / 6.0 + bend**4 / 120.0 - bend**6 / 5040.0)
    right = _turned(step + _turned(next_step, yaw), -0.5 * (yaw + bend))
    left = _turned(step + _turned(next_step, -yaw2), -0.5 * (yaw - bend))
    mean, turned = 0.5 * (right + left) / chord, yaw + yaw2
    rows = [
        Row("average sagittal velocity", mean[0] - by_name["vx"], 0.0, 0.0, unit="m/s"),
        Row("average lateral velocity", mean[1] - by_name["vy"], 0.0, 0.0, unit="m/s"),
        Row("average turning rate", turned / (2.0 * time) - turn, 0.0, 0.0, unit="rad/s"),
    ]
    ends = [grid.coordinates_at(1.0, 0) @ part for part in (first, second)]
    return Block("travel", z, p, rows, [np.vstack(ends)], form=("travel", 2))


def _turned(way: ca.SX, angle: ca.SX) -> ca.SX:
    """A displacement over the ground, rotated to the left."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(c * way[0] - s * way[1], s * way[0] + c * way[1])
