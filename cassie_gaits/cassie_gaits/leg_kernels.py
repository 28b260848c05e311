"""Arithmetic of `leg_chain`, compiled.

Vectors are tuples of three floats, a frame's axes are three such vectors in the pelvis frame.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled
from cassie_gaits.leg_records import RecordArray

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]
Axes = tuple[Vector, Vector, Vector]
Motion = tuple[Axes, Vector, Vector, Vector]

GRAVITY = 9.81
"""In m/s^2."""

# Share of the greatest C at which the achilles rod's loop still closes well: the derivatives of the
# heel spring's angle grow without bound where it ceases to close.
_CLOSES_WELL = 0.9999
_UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_ZERO = (0.0, 0.0, 0.0)


@compiled
def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def _minus(a: Any, b: Any) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def _times(factor: float, a: Any) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def _cross(a: Any, b: Any) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def _dot(a: Any, b: Any) -> float:
    total: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return total


@compiled
def _into(axes: Axes, v: Any) -> Vector:
    """A vector given in a frame, in the pelvis frame."""
    x, y, z = axes
    return (
        x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
        x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
        x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
    )


@compiled
def _store(vector: Vector, out: FloatArray) -> None:
    out[0], out[1], out[2] = vector


@compiled
def _next_link(motion: Motion, leg: Any, i: int, joint: float, rate: float) -> Motion:
    """Axes, origin, its velocity and the angular velocity of link i, from those of its parent."""
    axes, origin, velocity, omega = motion
    arm, fixed = _into(axes, leg.positions[i]), leg.rotations[i]
    x, y = _into(axes, fixed[:, 0]), _into(axes, fixed[:, 1])
    z = _into(axes, fixed[:, 2])
    c, s = math.cos(joint - leg.zeros[i]), math.sin(joint - leg.zeros[i])
    turned = (_plus(_times(c, x), _times(s, y)), _minus(_times(c, y), _times(s, x)), z)
    velocity = _plus(velocity, _cross(omega, arm))
    return turned, _plus(origin, arm), velocity, _plus(omega, _times(rate, z))


@compiled
def leg_kinematics(
    joints: FloatArray,
    rates: FloatArray,
    legs: RecordArray,
    loops: RecordArray,
    states: RecordArray,
) -> None:
    """Kinematics of a leg.

    Args:
        joints: Shape (7,), in rad.
        rates: Shape (7,), in rad/s.
        legs: The leg, of `leg_records.LEG_TYPE`. Shape (1,).
        loops: Its achilles rod, see `linkage.heel_loop`. Shape (1,).
        states: Result, of `leg_records.STATE_TYPE`. Shape (1,).
    """
    leg, state = legs[0], states[0]
    motion = (_UPRIGHT, _ZERO, _ZERO, _ZERO)
    moment, rate = _ZERO, _ZERO
    shin = tarsus = swing = _ZERO
    for i in range(7):
        motion = _next_link(motion, leg, i, joints[i], rates[i])
        axes, origin, velocity, omega = motion
        _store(axes[2], state.axes[i])
        _store(origin, state.origins[i])
        own = _into(axes, leg.moments[i])
        moment = _plus(moment, _plus(_times(leg.masses[i], origin), own))
        rate = _plus(rate, _plus(_times(leg.masses[i], velocity), _cross(omega, own)))
        if i == 4:
            shin = own
        elif i == 5:
            tarsus, swing = own, _into(axes, leg.swing)
    _store(moment, state.com_moment)
    _store(rate, state.com_rate)
    _place_foot(motion, leg, state)
    _deflect_springs(joints, loops[0], state)
    _hang_lower_leg(shin, tarsus, swing, leg, state)


@compiled
def _place_foot(motion: Motion, leg: Any, state: Any) -> None:
    axes, origin, velocity, omega = motion
    arm = _into(axes, leg.sole)
    _store(origin, state.ankle)
    _store(_plus(origin, arm), state.foot)
    _store(_plus(velocity, _cross(omega, arm)), state.foot_velocity)
    for k in range(3):
        _store(axes[k], state.foot_rotation[:, k])
    for i in range(7):
        arm = _minus(origin, state.origins[i])
        _store(_cross(state.axes[i], arm), state.ankle_jacobian[:, i])


@compiled
def _turned(x: float, y: float, c: float, s: float) -> tuple[float, float]:
    return c * x - s * y, s * x + c * y


@compiled
def heel_deflection(
    knee: float, shin: float, tarsus: float, loop: Any
) -> tuple[float, float, float, float]:
    """Deflection of the heel spring and its partial derivatives, compiled.

    Args:
        knee: q4. In rad.
        shin: q5. In rad.
        tarsus: q6. In rad.
        loop: The entry of `heel_loop`.

    Returns:
        Heel angle in rad and its derivatives to q4, q5, q6. All are NaN if the rod does not
        reach, or so barely that a derivative exceeds some 100, and if an angle is not finite.
    """
    upper = knee + loop.knee_turn
    lower, foot = upper + shin, knee + shin + tarsus + loop.tarsus_turn
    if not -100.0 < foot + lower < 100.0:
        return math.nan, math.nan, math.nan, math.nan
    cos_f, sin_f = math.cos(foot), math.sin(foot)
    # Joint axes from the tarsus axis backwards, and the rod's base from there; hip pitch axes.
    shin_x, shin_y = _turned(-loop.tarsus[0], -loop.tarsus[1], math.cos(lower), math.sin(lower))
    x, y = _turned(-loop.shin[0], -loop.shin[1], math.cos(upper), math.sin(upper))
    knee_x, knee_y = shin_x + x, shin_y + y
    base_x = knee_x - loop.knee[0] + loop.base[0]
    base_y = knee_y - loop.knee[1] + loop.base[1]
    # From the heel spring's joint to the base; tarsus axes.
    x, y = _turned(base_x, base_y, cos_f, -sin_f)
    w = (x - loop.heel[0], y - loop.heel[1], loop.base[2] - loop.heel[2])
    a, b = _dot(w, loop.cosine), _dot(w, loop.sine)
    c = 0.5 * (_dot(w, w) + loop.reach) - _dot(w, loop.still)
    amplitude = math.hypot(a, b)
    if not abs(c) < _CLOSES_WELL * amplitude:
        return math.nan, math.nan, math.nan, math.nan
    heel = math.atan2(b, a) + loop.branch * math.acos(c / amplitude)
    heel -= 2.0 * math.pi * round(heel / (2.0 * math.pi))
    # The rod keeps its length: what the tip moves along the rod sums to zero.
    cos_h, sin_h = math.cos(heel), math.sin(heel)
    x = loop.heel[0] + loop.still[0] + loop.cosine[0] * cos_h + loop.sine[0] * sin_h
    y = loop.heel[1] + loop.still[1] + loop.cosine[1] * cos_h + loop.sine[1] * sin_h
    x, y = _turned(x, y, cos_f, sin_f)
    rod_x, rod_y, by_heel = base_x - x, base_y - y, a * sin_h - b * cos_h
    by_knee = (rod_y * (x - knee_x) - rod_x * (y - knee_y)) / by_heel
    by_shin = (rod_y * (x - shin_x) - rod_x * (y - shin_y)) / by_heel
    return heel, by_knee, by_shin, (rod_y * x - rod_x * y) / by_heel


@compiled
def _deflect_springs(joints: FloatArray, loop: Any, state: Any) -> None:
    heel, _, by_shin, by_tarsus = heel_deflection(joints[3], joints[4], joints[5], loop)
    if not math.isfinite(heel):
        heel = by_shin = by_tarsus = 0.0
    state.springs[0], state.springs[1] = joints[4], heel
    state.heel_gradient[0], state.heel_gradient[1] = by_shin, by_tarsus


@compiled
def _hang_lower_leg(shin: Vector, tarsus: Vector, swing: Vector, leg: Any, state: Any) -> None:
    """Derivative of mass times position below the springs; the foot counts at the toe joint."""
    span = _minus(state.origins[6], state.origins[5])
    about_tarsus = _plus(tarsus, _times(leg.masses[6], span))
    span = _minus(state.origins[5], state.origins[4])
    carried = _plus(about_tarsus, _times(leg.masses[5] + leg.masses[6], span))
    about_shin = _plus(shin, carried)
    turning = _cross(state.axes[4], about_shin)
    _store(_plus(turning, _times(state.heel_gradient[0], swing)), state.lower_leg[0])
    turning = _cross(state.axes[5], about_tarsus)
    _store(_plus(turning, _times(state.heel_gradient[1], swing)), state.lower_leg[1])


@compiled
def spring_force(
    legs: RecordArray, states: RecordArray, toe_torque: float, up: FloatArray | Vector
) -> Vector:
    """Ground force on the foot, see `leg_chain.LegChain.force`.

    Args:
        legs: The leg. Shape (1,).
        states: Its kinematics. Shape (1,).
        toe_torque: In Nm.
        up: Shape (3,).

    Returns:
        In N; zero where the springs tell nothing.
    """
    leg, state = legs[0], states[0]
    heel = leg.heel_stiffness * state.springs[1]
    shin = leg.shin_stiffness * state.springs[0] + heel * state.heel_gradient[0]
    shin += toe_torque + GRAVITY * _dot(up, state.lower_leg[0])
    tarsus = heel * state.heel_gradient[1] + toe_torque
    tarsus += GRAVITY * _dot(up, state.lower_leg[1])
    by_shin, by_tarsus = state.ankle_jacobian[:, 4], state.ankle_jacobian[:, 5]
    aa, ab = _dot(by_shin, by_shin), _dot(by_shin, by_tarsus)
    bb = _dot(by_tarsus, by_tarsus)
    determinant = aa * bb - ab * ab
    if determinant < 1e-6 or state.heel_gradient[1] == 0.0:
        return _ZERO
    x = (bb * shin - ab * tarsus) / determinant
    y = (aa * tarsus - ab * shin) / determinant
    return _plus(_times(x, by_shin), _times(y, by_tarsus))


@compiled
def both_legs(
    joints: FloatArray,
    rates: FloatArray,
    toe_torques: FloatArray | tuple[float, float],
    up: FloatArray | Vector,
    pair: Any,
) -> None:
    """Kinematics and spring force of both legs.

    Args:
        joints: Shape (2, 7), in rad.
        rates: Shape (2, 7), in rad/s.
        toe_torques: Two, in Nm.
        up: Unit vector against gravity in the pelvis frame.
        pair: Of `PAIR_TYPE`; gets states and forces.
    """
    for i in range(2):
        leg, state = pair.legs[i : i + 1], pair.states[i : i + 1]
        leg_kinematics(joints[i], rates[i], leg, pair.loop, state)
        pair.forces[i] = _dot(up, spring_force(leg, state, toe_torques[i], up))


@compiled
def update_pair(
    joints: FloatArray,
    rates: FloatArray,
    toe_torques: FloatArray,
    up: FloatArray,
    pairs: RecordArray,
) -> None:
    """`both_legs` with the pair in an array of shape (1,)."""
    both_legs(joints, rates, toe_torques, up, pairs[0])
