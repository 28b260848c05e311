"""Why there is no gait: constraints violated at the best point found, and those in conflict.

The laws of motion hold; every other row may be violated, and the sum of the violations is
minimized. At the minimum the multipliers balance: each violated row has weight one, and the other
rows and bounds with the largest multipliers are in conflict with the violated ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from cassie_gaits.bezier import COEFFICIENTS
from cassie_gaits.optimize import grid
from cassie_gaits.optimize.bounds import row_bounds, unknown_bounds
from cassie_gaits.optimize.posture import COORDINATES
from cassie_gaits.optimize.problem import Problem, problem
from cassie_gaits.optimize.request import Request, parameters
from cassie_gaits.records import FloatArray, IntArray

MOST_NAMED = 6
"""Largest number of rows that are named on each side."""

VIOLATED = 1e-4
"""Threshold of the scaled violation from which a row counts as violated."""

CONFLICT_RATIO = 0.02
"""Ratio to the largest multiplier, from which a row that holds counts as in conflict."""

_TIGHT = 2e-3
"""Scaled distance from a bound within which a row counts as at it."""

_NEAR = 1e-5
"""Weight of the squared distance from the first point, which makes the solution unique."""

_IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-5,
    "max_iter": 150,
    "acceptable_tol": 1e-3,
    "acceptable_iter": 8,
    "mu_strategy": "adaptive",
    "linear_solver": "mumps",
}


@dataclass(frozen=True)
class Conflict:
    """Rows that cannot be met together, worst first.

    Attributes:
        missed: Names of violated rows with the violations, for people.
        against: Names of rows that hold at that point and are in conflict. If no row is violated,
            names of the rows at their bounds that increase the cost most.
    """

    missed: tuple[str, ...]
    against: tuple[str, ...]

    def __str__(self) -> str:
        if not self.missed:
            tightest = ", ".join(self.against) or "none"
            return f"the optimizer's own constraints can be met; what binds most: {tightest}"
        text = f"missed at the best point found: {', '.join(self.missed)}"
        return f"{text}; in conflict with: {', '.join(self.against) or 'the laws of motion'}"


def conflict(request: Request, unknowns: FloatArray) -> Conflict:
    """The constraints on which a request without a gait fails.

    Args:
        request: The request.
        unknowns: Point at which the search ended.
    """
    program = problem(symmetric=request.symmetric, lean=False)
    lower, upper = row_bounds(program, request)
    x_lower, x_upper = unknown_bounds(program, request)
    soft = _soft(program)
    x0 = np.clip(np.nan_to_num(unknowns), x_lower, x_upper)
    zero, endless = np.zeros(2 * len(soft)), np.full(2 * len(soft), np.inf)
    result = _elastic(request.symmetric)(
        x0=np.concatenate([x0, zero + 0.1]),
        p=np.concatenate([parameters(request), x0]),
        lbx=np.concatenate([x_lower, zero]),
        ubx=np.concatenate([x_upper, endless]),
        lbg=lower,
        ubg=upper,
    )
    w, multipliers, bound_multipliers = (
        np.array(result[name]).ravel() for name in ("x", "lam_g", "lam_x")
    )
    size = program.unknowns
    below, above = w[size:].reshape(2, -1)
    violations = np.zeros(len(program.rows))
    violations[soft] = np.abs(below - above)
    missed = _missed(program, violations)
    if not missed:
        violations[:] = 0.0
        multipliers, bound_multipliers = _multipliers(program, request, x0)
    return Conflict(missed, _against(program, violations, multipliers, bound_multipliers[:size]))


def _soft(program: Problem) -> IntArray:
    """Rows that may be violated."""
    return np.flatnonzero([not row.law for row in program.rows])


@cache
def _elastic(symmetric: bool) -> ca.Function:
    """The program with the sum of violations as cost: unknowns, violations below and above."""
    program = problem(symmetric=symmetric, lean=False)
    n, soft, rows = program.unknowns, _soft(program), len(program.rows)
    slack = ca.DM(ca.Sparsity.triplet(rows, len(soft), soft.tolist(), list(range(len(soft)))), 1.0)
    w = ca.MX.sym("w", n + 2 * len(soft))
    p = ca.MX.sym("p", program.parameters + n)
    x, below, above = ca.vertsplit(w, [0, n, n + len(soft), n + 2 * len(soft)])
    given, first = ca.vertsplit(p, [0, program.parameters, program.parameters + n])
    g, jacobian = program.derivatives["jac_g"](x, given)
    f = ca.sum1(below) + ca.sum1(above) + 0.5 * _NEAR * ca.sumsqr(x - first)
    g = g + ca.mtimes(slack, below - above)
    ones = ca.MX.ones(2 * len(soft))
    gradient = ca.vertcat(_NEAR * (x - first), ones)
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", rows)
    lagrangian = program.derivatives["hess_lag"](x, given, 0.0, lam) + sigma * _NEAR * ca.DM.eye(n)
    hessian = ca.diagcat(lagrangian, ca.MX(2 * len(soft), 2 * len(soft)))
    derivatives = {
        "grad_f": ca.Function("nlp_grad_f", [w, p], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function(
            "nlp_jac_g",
            [w, p],
            [g, ca.horzcat(jacobian, slack, -slack)],
            ["x", "p"],
            ["g", "jac_g_x"],
        ),
        "hess_lag": ca.Function(
            "nlp_hess_l",
            [w, p, sigma, lam],
            [hessian],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    }
    options: dict[str, Any] = {"ipopt": _IPOPT, "print_time": False, "error_on_fail": False}
    elastic = {"x": w, "p": p, "f": f, "g": g}
    return ca.nlpsol("conflict", "ipopt", elastic, options | {"calc_lam_p": False, **derivatives})


def _multipliers(
    program: Problem, request: Request, x: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Multipliers of rows and bounds at their limits, by least squares of the cost's gradient."""
    p = parameters(request)
    gradient = np.array(program.derivatives["grad_f"](x, p)[1]).ravel()
    g, rows = program.derivatives["jac_g"](x, p)
    values, jacobian = np.array(g).ravel(), np.array(rows)
    lower, upper = row_bounds(program, request)
    x_lower, x_upper = unknown_bounds(program, request)
    tight = np.flatnonzero((values - lower < _TIGHT) | (upper - values < _TIGHT))
    fixed = np.flatnonzero((x - x_lower < _TIGHT) | (x_upper - x < _TIGHT))
    sides = np.vstack([jacobian[tight], np.eye(len(x))[fixed]])
    found = np.linalg.lstsq(sides.T, -gradient, rcond=None)[0]
    multipliers, bound_multipliers = np.zeros(len(values)), np.zeros(len(x))
    multipliers[tight], bound_multipliers[fixed] = found[: len(tight)], found[len(tight) :]
    return multipliers, bound_multipliers


def _missed(program: Problem, violations: FloatArray) -> tuple[str, ...]:
    worst: dict[str, tuple[float, str]] = {}
    for row, violation in zip(program.rows, violations.tolist(), strict=True):
        if violation > VIOLATED and violation > worst.get(row.name, (0.0, ""))[0]:
            worst[row.name] = (violation, row.unit)
    ordered = sorted(worst.items(), key=lambda item: -item[1][0])
    return tuple(f"{name} (by {f'{by:.3g} {unit}'.strip()})" for name, (by, unit) in ordered)[
        :MOST_NAMED
    ]


def _against(
    program: Problem, violations: FloatArray, multipliers: FloatArray, bound_multipliers: FloatArray
) -> tuple[str, ...]:
    """Rows and bounds that hold, by the sum of their multipliers."""
    missed = {program.rows[i].name for i in np.flatnonzero(violations > VIOLATED)}
    sums: dict[str, float] = {}
    for row, multiplier in zip(program.rows, np.abs(multipliers).tolist(), strict=True):
        if not row.law and row.name not in missed:
            sums[row.name] = sums.get(row.name, 0.0) + multiplier
    for name, multiplier in zip(
        _names_of_unknowns(program), np.abs(bound_multipliers), strict=True
    ):
        sums[name] = sums.get(name, 0.0) + float(multiplier)
    ordered = sorted(sums.items(), key=lambda item: -item[1])
    least = CONFLICT_RATIO * ordered[0][1]
    return tuple(name for name, total in ordered[:MOST_NAMED] if total > least)


def _names_of_unknowns(program: Problem) -> list[str]:
    passive = grid.PASSIVE_DEGREE + 1
    names = []
    for i, name in enumerate(COORDINATES):
        count = COEFFICIENTS if i < grid.OUTPUT_COUNT else passive
        names += [f"range of {name.replace('_', ' ')}"] * count
    return names * program.steps
