"""Values and derivatives of a program as dense arrays, made from the tapes of its blocks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from cassie_gaits.optimize.blocks import Block
from cassie_gaits.records import FloatArray


@dataclass(frozen=True, eq=False)
class Values:
    """A program at a point.

    Attributes:
        cost: Scaled cost.
        rows: Constraints. Shape (rows,).
        cost_gradient: Gradient of the scaled cost. Shape (unknowns,).
        jacobian: Jacobian of the constraints. Shape (rows, unknowns).
    """

    cost: float
    rows: FloatArray
    cost_gradient: FloatArray
    jacobian: FloatArray


class Evaluation:
    """Evaluates a program.

    Args:
        blocks: Blocks of the program.
        unknowns: Number of the program's unknowns.
        scale: Scale of the cost.
    """

    def __init__(self, blocks: list[Block], unknowns: int, scale: float) -> None:
        self._parts = [_Part(block) for block in blocks]
        self._unknowns, self._scale = unknowns, scale
        ends = np.cumsum([0, *(block.size for block in blocks)])
        self._rows = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self._count = int(ends[-1])

    def cost_and_rows(self, x: FloatArray, p: FloatArray) -> tuple[float, FloatArray]:
        """Scaled cost, and constraints of shape (rows,)."""
        found = [part.values(x, p) for part in self._parts]
        cost = self._scale * sum(cost for cost, _ in found)
        return cost, np.concatenate([rows for _, rows in found])

    def values(self, x: FloatArray, p: FloatArray) -> Values:
        """Cost and constraints with their first derivatives."""
        rows, jacobian = np.empty(self._count), np.zeros((self._count, self._unknowns))
        cost, cost_gradient = 0.0, np.zeros(self._unknowns)
        for part, at in zip(self._parts, self._rows, strict=True):
            part_cost, gradient, rows[at], jacobian[at, part.columns] = part.derivatives(x, p)
            cost += part_cost
            cost_gradient[part.columns] += gradient
        return Values(self._scale * cost, rows, self._scale * cost_gradient, jacobian)

    def hessian(self, x: FloatArray, p: FloatArray, multipliers: FloatArray) -> FloatArray:
        """Hessian of the Lagrangian.

        Args:
            x: Unknowns. Shape (unknowns,).
            p: Parameters. Shape (parameters,).
            multipliers: Multipliers of the constraints. Shape (rows,).

        Returns:
            Shape (unknowns, unknowns).
        """
        result = np.zeros((self._unknowns, self._unknowns))
        for part, at in zip(self._parts, self._rows, strict=True):
            hessian = part.hessian(x, p, multipliers[at], self._scale)
            result[part.columns, part.columns] += hessian
        return result


class _Part:
    """A block with its tapes, and with its matrices for the unknowns on which it depends."""

    def __init__(self, block: Block) -> None:
        maps = np.array(ca.DM(block.map)).reshape(block.count, -1, block.map.size2())
        used = np.flatnonzero(np.abs(maps).max(axis=(0, 1)))
        self.columns = slice(int(used[0]), int(used[-1]) + 1)
        self._maps = np.ascontiguousarray(maps[:, :, self.columns])
        self._count, self._size = self._maps.shape[:2]
        self._height = len(block.rows)
        self._weights, self._signs = np.array(block.weights).ravel(), block.signs
        self._value, self._jacobian = block.value_tape(), block.jacobian_tape()
        self._hessian = block.hessian_tape()
        self._upper = np.triu_indices(self._size)

    def values(self, x: FloatArray, p: FloatArray) -> tuple[float, FloatArray]:
        out = self._value.run(self._inputs(x, p))
        return float(self._weights @ out[-1]), out[:-1].T.ravel()

    def derivatives(
        self, x: FloatArray, p: FloatArray
    ) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        out = self._jacobian.run(self._inputs(x, p))
        height, size = self._height, self._size
        rows, costs, out = out[:height].T.ravel(), out[height], out[height + 1 :]
        gradients = out[:size].T * self._weights[:, np.newaxis]
        gradient = np.tensordot(gradients, self._maps, axes=2)
        jacobians = np.ascontiguousarray(out[size:].T).reshape(-1, size, height).swapaxes(1, 2)
        jacobian = np.matmul(jacobians, self._maps).reshape(len(rows), -1)
        return float(self._weights @ costs), gradient, rows, jacobian

    def hessian(
        self, x: FloatArray, p: FloatArray, multipliers: FloatArray, scale: float
    ) -> FloatArray:
        lam = multipliers.reshape(self._count, self._height).T
        factor = (scale * self._weights)[np.newaxis]
        out = self._hessian.run(np.concatenate([self._inputs(x, p), lam, factor]))
        hessians = np.zeros((self._count, self._size, self._size))
        rows, columns = self._upper
        hessians[:, rows, columns] = hessians[:, columns, rows] = out.T
        first = np.matmul(hessians, self._maps).reshape(-1, self._maps.shape[2])
        result: FloatArray = self._maps.reshape(first.shape).T @ first
        return result

    def _inputs(self, x: FloatArray, p: FloatArray) -> FloatArray:
        places = (self._maps @ x[self.columns]).T
        parameters = np.repeat((self._signs * p)[:, np.newaxis], self._count, axis=1)
        return np.concatenate([places, parameters])
