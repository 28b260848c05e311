"""Parts of the nonlinear program: a function, and the instants at which it is evaluated.

A part's function has few arguments, so its exact second derivative is cheap. The program's
Jacobian and Hessian are assembled from those of the parts by constant matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from cassie_gaits.optimize.tape import Tape
from cassie_gaits.records import FloatArray

_TAPES: dict[tuple[Hashable, str], Tape] = {}


@dataclass(frozen=True)
class Inner:
    """Intermediate values of rows and cost, for long inner and short outer expressions.

    Attributes:
        symbols: Symbols in which rows and cost are written. Shape (m, 1).
        values: Values of these symbols as functions of the block's `z` and `p`. Shape (m, 1).
    """

    symbols: ca.SX
    values: ca.SX


@dataclass(frozen=True)
class Row:
    """A constraint with its bounds.

    Attributes:
        name: Name of the constraint, for people.
        value: Symbol of the value.
        low, high: Bounds; equal for an equation.
        scale: The program uses value / scale.
        unit: Unit of the value; empty for a ratio.
        law: Whether it is a law of motion, which must always hold.
    """

    name: str
    value: ca.SX
    low: float
    high: float
    scale: float = 1.0
    unit: str = ""
    law: bool = False


class Block:
    """Constraints, and perhaps a part of the cost, at several instants.

    Args:
        name: Name of the block.
        z: Symbols of the coordinates, which are linear in the unknowns. Shape (n, 1).
        p: Symbols of the request's parameters.
        rows: Constraints.
        maps: For each instant the matrix from the unknowns to `z`. Each of shape (n, unknowns).
        cost: Symbol of a cost, or None.
        weights: Weights of the cost at each instant.
        inner: If given, rows and cost are functions of its symbols.
        signs: Factors of the parameters at this block. Shape (parameters,).
        form: Key that is equal for blocks with the same rows, cost and inner values.

    Attributes:
        map: All matrices of `maps`, stacked vertically.
        weights: Weights of the cost. Shape (1, instants).
        signs: Factors of the parameters.
    """

    def __init__(
        self,
        name: str,
        z: ca.SX,
        p: ca.SX,
        rows: list[Row],
        maps: list[FloatArray],
        cost: ca.SX | None = None,
        weights: FloatArray | None = None,
        inner: Inner | None = None,
        *,
        signs: FloatArray | None = None,
        form: Hashable,
    ) -> None:
        self.rows = rows
        self.count = len(maps)
        self.lower = np.tile([row.low / row.scale for row in rows], self.count)
        self.upper = np.tile([row.high / row.scale for row in rows], self.count)
        self.map = ca.DM(ca.sparsify(ca.DM(np.vstack(maps))))
        self.weights = ca.DM(weights).T if weights is not None else ca.DM.zeros(1, self.count)
        self._name, self._z, self._p = name, z, p
        self.signs = np.ones(p.size1()) if signs is None else signs
        self._form = form
        self._inner = inner or Inner(z, z)
        self._outer_values = ca.vertcat(*(row.value / row.scale for row in rows))
        self._outer_cost = cost
        outer_cost = ca.SX(0) if cost is None else cost
        if inner is not None:
            self._inner = Inner(inner.symbols, ca.cse(inner.values))
        self._values, self._cost = ca.substitute(
            [self._outer_values, outer_cost], [self._inner.symbols], [self._inner.values]
        )
        self._value = ca.Function(f"{name}_value", [z, p], [self._values, self._cost])

    @property
    def size(self) -> int:
        """Number of constraints."""
        return len(self.rows) * self.count

    def repeated_rows(self) -> list[Row]:
        """The row of every constraint, in the program's order."""
        return self.rows * self.count

    def value(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Constraints and cost."""
        values, costs = self._value.map(self.count)(self._points(x), self._repeat(p))
        return ca.vec(values), ca.dot(costs, self.weights)

    def jacobian(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Constraints and their Jacobian."""
        function = ca.Function(
            f"{self._name}_jacobian",
            [self._z, self._p],
            [self._values, ca.jacobian(self._values, self._z)],
        )
        values, jacobians = function.map(self.count)(self._points(x), self._repeat(p))
        blocks = ca.diagcat(*ca.horzsplit(jacobians, function.size2_out(1)))
        return ca.vec(values), ca.mtimes(blocks, self.map)

    def cost_gradient(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Cost and its gradient."""
        if self._outer_cost is None:
            return ca.MX(0), ca.MX(x.size1(), 1)
        function = ca.Function(
            f"{self._name}_cost_gradient",
            [self._z, self._p],
            [self._cost, ca.gradient(self._cost, self._z)],
        )
        costs, gradients = function.map(self.count)(self._points(x), self._repeat(p))
        weighted = gradients * ca.repmat(self.weights, gradients.size1(), 1)
        return ca.dot(costs, self.weights), ca.mtimes(self.map.T, ca.vec(weighted))

    def hessian(self, x: ca.MX, p: ca.MX, multipliers: ca.MX, sigma: ca.MX) -> ca.MX:
        """Hessian of the Lagrangian.

        Args:
            x: Unknowns.
            p: Parameters.
            multipliers: Multipliers of this block's constraints.
            sigma: Factor of the cost.
        """
        lam, factor = ca.SX.sym("multipliers", len(self.rows)), ca.SX.sym("sigma")
        function = ca.Function(
            f"{self._name}_hessian",
            [self._z, self._p, lam, factor],
            [self._lagrangian_hessian(lam, factor)],
        )
        hessians = function.map(self.count)(
            self._points(x),
            self._repeat(p),
            ca.reshape(multipliers, len(self.rows), self.count),
            sigma * self.weights,
        )
        blocks = ca.diagcat(*ca.horzsplit(hessians, function.size2_out(0)))
        return ca.mtimes(self.map.T, ca.mtimes(blocks, self.map))

    def value_tape(self) -> Tape:
        """Tape from z, p to rows and cost, stacked vertically."""
        return self._tape("value", [], lambda: ca.vertcat(self._values, self._cost))

    def jacobian_tape(self) -> Tape:
        """Tape from z, p to rows, cost, gradient of the cost by z, and Jacobian by z by columns."""

        def outputs() -> ca.SX:
            jacobian = ca.jacobian(self._values, self._z)
            gradient = ca.gradient(self._cost, self._z)
            return ca.vertcat(self._values, self._cost, gradient, ca.vec(ca.densify(jacobian)))

        return self._tape("jacobian", [], outputs)

    def hessian_tape(self) -> Tape:
        """Tape from z, p, multipliers, factor of the cost to the Hessian's upper half by rows."""
        lam, factor = ca.SX.sym("multipliers", len(self.rows)), ca.SX.sym("sigma")

        def outputs() -> ca.SX:
            hessian = ca.densify(self._lagrangian_hessian(lam, factor))
            return ca.vertcat(*(hessian[i, i:].T for i in range(hessian.size1())))

        return self._tape("hessian", [lam, factor], outputs)

    def _tape(self, what: str, more: list[ca.SX], outputs: Callable[[], ca.SX]) -> Tape:
        """The tape, made once for all blocks of a form, as that takes a second."""
        key = (self._form, what)
        if key not in _TAPES:
            inputs = ca.vertcat(self._z, self._p, *more)
            _TAPES[key] = Tape(f"{self._name}_{what}", inputs, outputs())
        return _TAPES[key]

    def _lagrangian_hessian(self, lam: ca.SX, factor: ca.SX) -> ca.SX:
        """Hessian of the Lagrangian, by the chain rule through the inner values.

        Args:
            lam: Multipliers of the rows.
            factor: Factor of the cost.
        """
        lagrangian = ca.dot(lam, self._outer_values)
        if self._outer_cost is not None:
            lagrangian += factor * self._outer_cost
        outer, gradient = ca.hessian(lagrangian, self._inner.symbols)
        if self._inner.values is self._z:
            return outer
        outer, gradient = ca.substitute(
            [outer, gradient], [self._inner.symbols], [self._inner.values]
        )
        weights = ca.SX.sym("weights", gradient.size1())
        own = ca.hessian(ca.dot(weights, self._inner.values), self._z)[0]
        own = ca.substitute(own, weights, gradient)
        jacobian = ca.jacobian(self._inner.values, self._z)
        return own + ca.mtimes([jacobian.T, outer, jacobian])

    def _points(self, x: ca.MX) -> ca.MX:
        return ca.reshape(ca.mtimes(self.map, x), -1, self.count)

    def _repeat(self, p: ca.MX) -> ca.MX:
        return ca.repmat(ca.DM(self.signs) * p, 1, self.count)
