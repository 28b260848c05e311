"""Parts of the nonlinear program: a function, and the instants at which it is asked.

A part's function has few arguments, so its exact second derivative is cheap; the program's
Jacobian and Hessian are put together from these by constant matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """A constraint with its bounds.

    Attributes:
        name: What it is, for a person.
        value: Symbol of the value.
        low, high: Bounds; equal for an equation.
        scale: The program sees value / scale.
    """

    name: str
    value: ca.SX
    low: float
    high: float
    scale: float = 1.0


class Block:
    """Constraints, and perhaps a share of the cost, at several instants.

    Args:
        name: Of the block.
        z: Symbols that the unknowns lead to. Shape (n, 1).
        p: Symbols of the request's parameters.
        rows: Constraints.
        maps: For each instant the matrix from the unknowns to `z`. Each of shape (n, unknowns).
        cost: Symbol of a cost, or None.
        weights: Of the cost at each instant.
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
    ) -> None:
        self.rows = rows
        self.count = len(maps)
        self.lower = np.tile([row.low / row.scale for row in rows], self.count)
        self.upper = np.tile([row.high / row.scale for row in rows], self.count)
        self._map = ca.DM(ca.sparsify(ca.DM(np.vstack(maps))))
        self._weights = ca.DM(weights).T if weights is not None else ca.DM.zeros(1, self.count)
        values = ca.vertcat(*(row.value / row.scale for row in rows))
        price = ca.SX(0) if cost is None else cost
        multipliers, sigma = ca.SX.sym("multipliers", len(rows)), ca.SX.sym("sigma")
        lagrangian = sigma * price + ca.dot(multipliers, values)
        self._value = ca.Function(f"{name}_value", [z, p], [values, price])
        self._slope = ca.Function(
            f"{name}_slope", [z, p], [values, price, ca.jacobian(values, z), ca.gradient(price, z)]
        )
        self._bend = ca.Function(
            f"{name}_bend", [z, p, multipliers, sigma], [ca.hessian(lagrangian, z)[0]]
        )

    @property
    def size(self) -> int:
        """Number of constraints."""
        return len(self.rows) * self.count

    def names(self) -> list[str]:
        """Of every constraint."""
        return [row.name for row in self.rows] * self.count

    def value(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Constraints and cost."""
        values, prices = self._value.map(self.count)(self._points(x), self._repeat(p))
        return ca.vec(values), ca.dot(prices, self._weights)

    def slope(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """Constraints, cost, Jacobian of the constraints and gradient of the cost."""
        values, prices, jacobians, gradients = self._slope.map(self.count)(
            self._points(x), self._repeat(p)
        )
        blocks = ca.diagcat(*ca.horzsplit(jacobians, self._slope.size2_out(2)))
        gradient = ca.mtimes(self._map.T, ca.vec(gradients * _rows_like(gradients, self._weights)))
        return (
            ca.vec(values),
            ca.dot(prices, self._weights),
            ca.mtimes(blocks, self._map),
            gradient,
        )

    def bend(self, x: ca.MX, p: ca.MX, multipliers: ca.MX, sigma: ca.MX) -> ca.MX:
        """Hessian of the Lagrangian."""
        lam = ca.reshape(multipliers, len(self.rows), self.count)
        hessians = self._bend.map(self.count)(
            self._points(x), self._repeat(p), lam, sigma * self._weights
        )
        blocks = ca.diagcat(*ca.horzsplit(hessians, self._bend.size2_out(0)))
        return ca.mtimes(self._map.T, ca.mtimes(blocks, self._map))

    def _points(self, x: ca.MX) -> ca.MX:
        return ca.reshape(ca.mtimes(self._map, x), -1, self.count)

    def _repeat(self, p: ca.MX) -> ca.MX:
        return ca.repmat(p, 1, self.count)


def _rows_like(matrix: ca.MX, row: ca.DM) -> ca.DM:
    return ca.repmat(row, matrix.size1(), 1)
