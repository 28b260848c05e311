"""Integration of a step on the 20-DoF model under the gait's torques only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from cassie_gaits.certificate import states
from cassie_gaits.certificate.walker import Walker
from cassie_gaits.dynamics import RIGID
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.records import FloatArray

POINTS = 401
"""Points of a step at which the table is checked."""

_FITTED = 40

MOST_EVALUATIONS = 5000
"""Largest number of evaluations of the equations of motion in a step.

A gait takes 300; without a limit, a diverging motion could take hours.
"""


@dataclass(frozen=True, eq=False)
class Step:
    """An integrated step.

    Attributes:
        domain: 0 on the right leg, 1 on the left.
        phases: Phases of the points. Shape (n,).
        q, v: States. Shape (n, 20) each.
        torques: Torques of the drives. Shape (n, 10), in Nm.
        forces: Ground forces, as in `walker.Motion`. Shape (n, 6).
        position_error, velocity_error: Error of the last state against the coefficients.
        output_error: Largest difference between outputs and coefficients, in m or rad.
        residual: Largest residual torque of the gait's own motion between its nodes. In Nm.
    """

    domain: int
    phases: FloatArray
    q: FloatArray
    v: FloatArray
    torques: FloatArray
    forces: FloatArray
    position_error: float
    velocity_error: float
    output_error: float
    residual: float


def integrate(walker: Walker, gait: Gait, domain: int) -> Step:
    """Integrate a step from its first state.

    Raises:
        GaitLibraryError: if the integration fails, or takes `MOST_EVALUATIONS`.
    """
    leg, time = states.legs(domain)[0], gait.step_time
    rigid = [int(row) for row in np.flatnonzero(RIGID.any(axis=1) & (RIGID.max(axis=1) > 0.5))]
    start_q, start_v = states.state(walker, gait, domain, 0.0)

    left = MOST_EVALUATIONS

    def rate(t: float, x: FloatArray) -> FloatArray:
        nonlocal left
        left -= 1
        if not left:
            raise GaitLibraryError(f"integration is not at its end at {t:.3g} of {time:g} s")
        q, v = _expand(x, start_q, rigid)
        motion = walker.motion(q, v, states.torques(gait, domain, t / time), leg)
        return np.concatenate([v[rigid], motion.acceleration[rigid]])

    solution = solve_ivp(
        rate,
        (0.0, time),
        np.concatenate([start_q[rigid], start_v[rigid]]),
        method="DOP853",
        rtol=1e-9,
        atol=1e-10,
        dense_output=True,
    )
    if not solution.success or not np.isfinite(solution.y).all():
        raise GaitLibraryError(f"integration broke off: {solution.message}")
    phases = np.linspace(0.0, 1.0, POINTS)
    points = [_expand(x, start_q, rigid) for x in solution.sol(phases * time).T]
    return _step(walker, gait, domain, phases, points)


def _step(
    walker: Walker,
    gait: Gait,
    domain: int,
    phases: FloatArray,
    points: list[tuple[FloatArray, FloatArray]],
) -> Step:
    leg = states.legs(domain)[0]
    torques = np.array([states.torques(gait, domain, phase) for phase in phases])
    forces = [walker.motion(*point, u, leg).force for point, u in zip(points, torques, strict=True)]
    end_q, end_v = states.state(walker, gait, domain, 1.0)
    q, v = np.array([point[0] for point in points]), np.array([point[1] for point in points])
    wanted = np.array([states.curves(gait, domain, phase)[:9] for phase in phases])
    reached = np.array([states.outputs(domain, row) for row in q])
    return Step(
        domain,
        phases,
        q,
        v,
        torques,
        np.array(forces),
        position_error=float(np.abs(q[-1] - end_q).max()),
        velocity_error=float(np.abs(v[-1] - end_v).max()),
        output_error=float(np.abs(reached - wanted).max()),
        residual=_residual(walker, gait, domain),
    )


def _residual(walker: Walker, gait: Gait, domain: int) -> float:
    """Largest residual torque of the coefficients' motion, at points between its nodes.

    Accelerations are derivatives of polynomials through the velocities at Chebyshev points.
    """
    leg = states.legs(domain)[0]
    nodes = np.cos(np.pi * (np.arange(_FITTED) + 0.5) / _FITTED)
    samples = [states.state(walker, gait, domain, 0.5 * (node + 1.0)) for node in nodes]
    chebyshev = np.polynomial.chebyshev
    v_series = chebyshev.chebfit(nodes, np.array([v for _, v in samples]), _FITTED - 1)
    a_series = chebyshev.chebder(v_series, scl=2.0 / gait.step_time)
    q_series = chebyshev.chebfit(nodes, np.array([q for q, _ in samples]), _FITTED - 1)
    worst = 0.0
    between = np.linspace(-1.0, 1.0, 101)
    motion = [chebyshev.chebval(between, series).T for series in (q_series, v_series, a_series)]
    for node, q, v, a in zip(between, *motion, strict=True):
        u = states.torques(gait, domain, 0.5 * (node + 1.0))
        worst = max(worst, float(np.abs(walker.residual(q, v, a, u, leg)).max()))
    return worst


def _expand(x: FloatArray, like: FloatArray, rigid: list[int]) -> tuple[FloatArray, FloatArray]:
    """q and v of the 20 coordinates, from positions and velocities of pelvis and drives."""
    count = len(rigid)
    q = like + RIGID @ (x[:count] - like[rigid])
    return q, RIGID @ x[count:]
