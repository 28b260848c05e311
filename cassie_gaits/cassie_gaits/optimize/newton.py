"""Newton's method on the barrier problem of a program, from a point near its solution.

IPOPT begins with a large barrier, lowers it, and treats the program as sparse. A gait's program has
at most 200 unknowns and dense rows, so a dense factorization takes a few ms. From a neighbouring
gait the barrier need not be large at first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from cassie_gaits.optimize.evaluation import Evaluation, Values
from cassie_gaits.records import FloatArray

TOLERANCE = 1e-6
"""Tolerance of the scaled optimality conditions, as IPOPT's `tol`."""

_TO_BOUNDARY = 0.99
"""Largest share of the distance to a bound that a step may take."""

_SHORTEST = 1e-3
"""Share of the longest step below which the line search stops without success."""

_SHIFTS = (0.0, 1e-2, 1.0, 1e2, 1e4)
"""Values added to the Hessian's diagonal, in turn, until the step leads towards a minimum."""

_SOLVED, _FALL = 10.0, 0.2
"""Ratio of error to barrier at which a barrier problem counts as solved, and factor of the next."""

_MULTIPLIER_SCALE = 100.0
_LESS = 1e-5
"""Least relative progress that the filter accepts."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of unknowns and rows; equal for a fixed one, infinite for no bound.

    Attributes:
        x_lower, x_upper: Bounds of the unknowns. Shape (unknowns,).
        lower, upper: Bounds of the rows. Shape (rows,).
    """

    x_lower: FloatArray
    x_upper: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, eq=False)
class Result:
    """Result of the iteration.

    Attributes:
        unknowns: Unknowns at the end. Shape (unknowns,).
        status: Status, named as in IPOPT.
        iterations: Number of steps.
    """

    unknowns: FloatArray
    status: str
    iterations: int


@dataclass(eq=False)
class _Iterate:
    """A point with its multipliers.

    Attributes:
        x: Unknowns. Shape (unknowns,).
        w: Variables with bounds: free unknowns, then slacks of the inequalities. Shape (m,).
        low, high: Multipliers of the bounds of `w`. Shape (m,).
        multipliers: Multipliers of the rows. Shape (rows,).
        values: Values of the program at x.
        residuals: Differences of rows from their targets or slacks. Shape (rows,).
    """

    x: FloatArray
    w: FloatArray
    low: FloatArray
    high: FloatArray
    multipliers: FloatArray
    values: Values
    residuals: FloatArray


@dataclass(frozen=True, eq=False)
class _Step:
    """Change of `w`, and the new multipliers."""

    change: FloatArray
    low: FloatArray
    high: FloatArray
    multipliers: FloatArray


class Newton:
    """The barrier problem of one request.

    Args:
        evaluation: Evaluation of the program.
        bounds: Bounds of unknowns and rows.
        p: Parameters.
        barrier: Weight of the logarithms at the end of the iteration.

    Source:
        Waechter and Biegler 2006, Secs. 2.1 to 2.3, with the slacks eliminated.
    """

    def __init__(
        self, evaluation: Evaluation, bounds: Bounds, p: FloatArray, barrier: float
    ) -> None:
        self._evaluation, self._p, self._last = evaluation, p, barrier
        self._barrier = barrier
        self._x_bounds = bounds.x_lower, bounds.x_upper
        self._free = np.flatnonzero(bounds.x_lower != bounds.x_upper)
        self._equal = bounds.lower == bounds.upper
        self._unequal = ~self._equal
        self._target = bounds.lower[self._equal]
        unequal = self._unequal
        self._lower = np.concatenate([bounds.x_lower[self._free], bounds.lower[unequal]])
        self._upper = np.concatenate([bounds.x_upper[self._free], bounds.upper[unequal]])
        self._has_lower, self._has_upper = np.isfinite(self._lower), np.isfinite(self._upper)
        self._filter: list[tuple[float, float]] = []

    def run(
        self, start: FloatArray, max_steps: int, bound_distance: float, barrier: float
    ) -> Result:
        """Iterate.

        Args:
            start: Unknowns at the start.
            max_steps: Largest number of steps.
            bound_distance: Least distance from the bounds at the start.
            barrier: Barrier at the start; it decreases to that of the class.
        """
        self._filter.clear()
        self._barrier = max(barrier, self._last)
        at = self._begin(start, bound_distance)
        if at is None:
            return Result(start, "Invalid_Number_Detected", 0)
        for iteration in range(max_steps + 1):
            while self._barrier > self._last and self._error(at) <= _SOLVED * self._barrier:
                self._barrier = max(self._last, _FALL * self._barrier)
                self._filter.clear()
            if self._barrier == self._last and self._error(at) <= TOLERANCE:
                return Result(at.x, "Solve_Succeeded", iteration)
            if iteration == max_steps:
                break
            step = self._step(at)
            if step is None:
                return Result(at.x, "Error_In_Step_Computation", iteration)
            if not self._advance(at, step):
                return Result(at.x, "Search_Direction_Becomes_Too_Small", iteration)
        return Result(at.x, "Maximum_Iterations_Exceeded", max_steps)

    def _begin(self, start: FloatArray, bound_distance: float) -> _Iterate | None:
        """First iterate, inside the bounds, with its multipliers; None where a value is not finite.

        On a steep slope the bounds can move the start to a posture that the legs cannot take.
        """
        n = len(self._free)
        x = np.clip(start, *self._x_bounds)
        rows = self._evaluation.cost_and_rows(x, self._p)[1]
        w = self._moved_inside(np.concatenate([x[self._free], rows[self._unequal]]), bound_distance)
        x[self._free] = w[:n]
        values = self._evaluation.values(x, self._p)
        found = (w, values.cost, values.rows, values.cost_gradient, values.jacobian)
        if not all(np.isfinite(part).all() for part in found):
            return None
        low, high = self._barrier / (w - self._lower), self._barrier / (self._upper - w)
        multipliers = np.empty(len(values.rows))
        multipliers[self._unequal] = (high - low)[n:]
        jacobian = values.jacobian[:, self._free]
        rest = values.cost_gradient[self._free] + (high - low)[:n]
        rest += jacobian[self._unequal].T @ multipliers[self._unequal]
        multipliers[self._equal] = np.linalg.lstsq(jacobian[self._equal].T, -rest, rcond=None)[0]
        return _Iterate(x, w, low, high, multipliers, values, self._residuals(values.rows, w))

    def _moved_inside(self, w: FloatArray, bound_distance: float) -> FloatArray:
        gap = np.minimum(bound_distance, 1e-2 * (self._upper - self._lower))
        return np.clip(w, self._lower + gap, self._upper - gap)

    def _residuals(self, rows: FloatArray, w: FloatArray) -> FloatArray:
        residuals = np.empty(len(rows))
        residuals[self._equal] = rows[self._equal] - self._target
        residuals[self._unequal] = rows[self._unequal] - w[len(self._free) :]
        return residuals

    def _error(self, at: _Iterate) -> float:
        """Error of the optimality conditions, scaled as in IPOPT."""
        n = len(self._free)
        pull = at.high - at.low
        jacobian = at.values.jacobian[:, self._free]
        dual = at.values.cost_gradient[self._free] + jacobian.T @ at.multipliers
        dual += pull[:n]
        slack = pull[n:] - at.multipliers[self._unequal]
        products = np.concatenate(
            [
                at.low[self._has_lower] * (at.w - self._lower)[self._has_lower],
                at.high[self._has_upper] * (self._upper - at.w)[self._has_upper],
            ]
        )
        total = float(at.low.sum() + at.high.sum())
        mean = (float(np.abs(at.multipliers).sum()) + total) / (len(at.multipliers) + len(products))
        scale = max(_MULTIPLIER_SCALE, mean) / _MULTIPLIER_SCALE
        bound_scale = max(_MULTIPLIER_SCALE, total / len(products)) / _MULTIPLIER_SCALE
        return max(
            float(np.abs(dual).max()) / scale,
            float(np.abs(slack).max()) / scale,
            float(np.abs(at.residuals).max()),
            float(np.abs(products - self._barrier).max()) / bound_scale,
        )

    def _step(self, at: _Iterate) -> _Step | None:
        """Newton's step; None if the Hessian cannot be made convex along the equations."""
        n, equal, unequal = len(self._free), self._equal, self._unequal
        down, up = at.w - self._lower, self._upper - at.w
        stiff = at.low / down + at.high / up
        push = self._barrier / up - self._barrier / down
        jacobian = at.values.jacobian[:, self._free]
        equations, others = jacobian[equal], jacobian[unequal]
        hessian = self._evaluation.hessian(at.x, self._p, at.multipliers)
        hessian = hessian[np.ix_(self._free, self._free)]
        hessian += (others.T * stiff[n:]) @ others
        hessian[np.diag_indices(n)] += stiff[:n]
        gradient = at.values.cost_gradient[self._free] + push[:n]
        gradient += others.T @ (stiff[n:] * at.residuals[unequal] + push[n:])
        solution = _saddle(hessian, equations, -np.concatenate([gradient, at.residuals[equal]]))
        if solution is None:
            return None
        change = np.concatenate([solution[:n], others @ solution[:n] + at.residuals[unequal]])
        multipliers = np.empty(len(at.multipliers))
        multipliers[equal] = solution[n:]
        multipliers[unequal] = stiff[n:] * change[n:] + push[n:]
        low = (self._barrier - at.low * change) / down
        high = (self._barrier + at.high * change) / up
        return _Step(change, low, high, multipliers)

    def _advance(self, at: _Iterate, step: _Step) -> bool:
        """Whether a step is an improvement for some length; goes along it by that length."""
        down, up = at.w - self._lower, self._upper - at.w
        longest = min(_reach(down, step.change), _reach(up, -step.change))
        size = self._search(at, step.change, longest)
        if size is None:
            return False
        dual = min(_reach(at.low, step.low - at.low), _reach(at.high, step.high - at.high))
        at.w = at.w + size * step.change
        at.x[self._free] = at.w[: len(self._free)]
        at.low = at.low + dual * (step.low - at.low)
        at.high = at.high + dual * (step.high - at.high)
        at.multipliers = at.multipliers + size * (step.multipliers - at.multipliers)
        at.values = self._evaluation.values(at.x, self._p)
        at.residuals = self._residuals(at.values.rows, at.w)
        return True

    def _search(self, at: _Iterate, change: FloatArray, longest: float) -> float | None:
        """Length of a step that the filter accepts."""
        n = len(self._free)
        violation, merit = float(np.abs(at.residuals).sum()), self._merit(at.values.cost, at.w)
        push = self._barrier / (self._upper - at.w) - self._barrier / (at.w - self._lower)
        derivative = float(at.values.cost_gradient[self._free] @ change[:n] + push @ change)
        size, x = longest, at.x.copy()
        while size > _SHORTEST * longest:
            w = at.w + size * change
            x[self._free] = w[:n]
            cost, rows = self._evaluation.cost_and_rows(x, self._p)
            new_violation = float(np.abs(self._residuals(rows, w)).sum())
            new_merit = self._merit(cost, w)
            steep = derivative < 0.0 and violation < 1e-4
            steep = steep and size * (-derivative) ** 2.3 > violation**1.1
            rounding = 1e-10 * abs(merit)
            if steep:
                better = new_merit <= merit + 1e-8 * size * derivative + rounding
            else:
                better = _better(new_violation, new_merit, violation, merit)
            # If only rounding errors are left, accept Newton's full steps.
            better = better or (new_violation < 1e-7 and new_merit <= merit + rounding)
            if better and all(_better(new_violation, new_merit, *entry) for entry in self._filter):
                if not steep:
                    self._filter.append((violation, merit))
                return size
            size *= 0.5
        return None

    def _merit(self, cost: float, w: FloatArray) -> float:
        with np.errstate(invalid="ignore"):
            low = np.log((w - self._lower)[self._has_lower]).sum()
            high = np.log((self._upper - w)[self._has_upper]).sum()
        return cost - self._barrier * float(low + high)


def _better(violation: float, merit: float, old_violation: float, old_merit: float) -> bool:
    """Whether one of the two is smaller; false for NaN."""
    return violation <= (1.0 - _LESS) * old_violation or (
        merit <= old_merit - _LESS * old_violation and violation < np.inf
    )


def _reach(distance: FloatArray, change: FloatArray) -> float:
    """Longest step, at most 1, that leaves a share of each distance to a bound."""
    shrinks = (change < 0.0) & np.isfinite(distance)
    if not shrinks.any():
        return 1.0
    return min(1.0, float((-_TO_BOUNDARY * distance[shrinks] / change[shrinks]).min()))


def _saddle(hessian: FloatArray, equations: FloatArray, right: FloatArray) -> FloatArray | None:
    """Solution of [[H + shift, J'], [J, 0]] with as many negative eigenvalues as J has rows."""
    n, m = len(hessian), len(equations)
    matrix = np.zeros((n + m, n + m))
    matrix[:n, :n], matrix[n:, :n] = hessian, equations
    matrix[np.arange(n, n + m), np.arange(n, n + m)] = -1e-10
    diagonal = hessian.diagonal()
    for shift in _SHIFTS:
        matrix[np.arange(n), np.arange(n)] = diagonal + shift
        factors, pivots, info = lapack.dsytrf(matrix, lower=1)
        if info == 0 and _negative(factors, pivots) == m:
            solution: FloatArray = lapack.dsytrs(factors, pivots, right, lower=1)[0].ravel()
            return solution
    return None


def _negative(factors: FloatArray, pivots: npt.NDArray[np.int32]) -> int:
    """Number of negative eigenvalues of a matrix, from LAPACK's factors L D L'."""
    single = pivots > 0
    pairs = int((~single).sum()) // 2  # a 2 x 2 block has one eigenvalue of each sign
    return int((factors.diagonal()[single] < 0.0).sum()) + pairs
