"""The nonlinear program of a gait, with exact derivatives for IPOPT."""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any

import casadi as ca
import numpy as np

from cassie_gaits.bezier import COEFFICIENTS
from cassie_gaits.optimize import constraints, grid
from cassie_gaits.optimize.blocks import Block
from cassie_gaits.optimize.evaluation import Evaluation
from cassie_gaits.optimize.posture import COORDINATES
from cassie_gaits.optimize.request import Limits
from cassie_gaits.records import FloatArray

COST_SCALE = 1e-3

GUESS = {"leg_length": 0.9}
"""The constant first guess; coordinates not named here are zero. From there the solver reaches the
cheapest of several local optima. In m."""

BARRIER = 1e-4
"""Weight of the log barrier at which the solver ends and a neighbour's solution begins."""

_IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-6,
    "constr_viol_tol": 1e-7,
    "acceptable_iter": 0,
    # The final barrier increases the cost by 0.1 % and makes gaits change smoothly with the speed.
    "mu_target": BARRIER,
    "linear_solver": "mumps",
    # Slower than an adaptive barrier, but it reaches the same optimum from any first guess.
    "mu_strategy": "monotone",
}

_FOLLOW = {
    "warm_start_init_point": "yes",
    "mu_init": BARRIER,
    "warm_start_bound_push": 1e-6,
    "warm_start_bound_frac": 1e-6,
    "warm_start_slack_bound_push": 1e-6,
    "warm_start_slack_bound_frac": 1e-6,
    "warm_start_mult_bound_push": 1e-6,
}
"""Options to start from a neighbour's solution and to stay in its local optimum."""

_FOLLOW_ITERATIONS = 120
"""Most iterations of the follower; it takes 5 to 30, and beyond, another start is better."""


class Problem:
    """The program for symmetric or for general gaits; its parameters are those of the request.

    Args:
        symmetric: Whether the program has one step, mirrored, or two steps.
        lean: Whether to omit constraints that walking seldom reaches. After solving the lean
            program, the caller must check all constraints.
        limits: Bounds.
        max_iterations: Largest number of the solver's iterations.
    """

    def __init__(
        self,
        *,
        symmetric: bool = True,
        lean: bool = False,
        limits: Limits | None = None,
        max_iterations: int = 300,
    ) -> None:
        self.symmetric = symmetric
        self.steps = 1 if symmetric else 2
        self.unknowns = self.steps * grid.STEP_UNKNOWNS
        limits = limits or Limits()
        places = [self._place(step) for step in range(self.steps)]
        self.blocks: list[Block] = []
        for step, place in enumerate(places):
            sign = 1.0 if step == 0 else -1.0
            after = places[(step + 1) % self.steps]
            self.blocks += [
                constraints.dynamics_block(limits, place, sign, lean=lean),
                constraints.posture_block(limits, place, lean=lean),
                constraints.clearance_block(limits, place, middle=True),
                constraints.landing_block(limits, place, after, sign),
            ]
            if not lean:
                self.blocks.append(constraints.clearance_block(limits, place, middle=False))
        second = None if symmetric else places[1]
        self.blocks.append(constraints.travel_block(places[0], second))
        self.lower = np.concatenate([block.lower for block in self.blocks])
        self.upper = np.concatenate([block.upper for block in self.blocks])
        self.rows = [row for block in self.blocks for row in block.repeated_rows()]
        self.names = [row.name for row in self.rows]
        self.parameters = len(constraints.PARAMETERS)
        self.x_lower, self.x_upper = self._bounds()
        self._max_iterations = max_iterations

    @cached_property
    def solver(self) -> ca.Function:
        """IPOPT as a function from x0, p, lbx, ubx, lbg, ubg to x, f, g and multipliers."""
        return self._ipopt({})

    @cached_property
    def follower(self) -> ca.Function:
        """IPOPT for a start from a neighbour's solution and its multipliers."""
        return self._ipopt({**_FOLLOW, "max_iter": min(_FOLLOW_ITERATIONS, self._max_iterations)})

    @cached_property
    def evaluation(self) -> Evaluation:
        """Evaluation of cost, rows and their derivatives for `newton`."""
        return Evaluation(self.blocks, self.unknowns, COST_SCALE)

    def prepare(self) -> None:
        """Set up the solvers now, and not at the first gait."""
        self.solver.n_in()
        self.follower.n_in()
        self.evaluation.cost_and_rows(self.guess(), np.ones(self.parameters))

    @cached_property
    def values(self) -> ca.Function:
        """Function from x, p to scaled cost and constraints."""
        x, p, f, g = self._symbols()
        return ca.Function("values", [x, p], [f, g])

    def guess(self) -> FloatArray:
        """Unknowns of the constant first guess."""
        return np.tile(_constant(GUESS, 0.0), self.steps)

    def _place(self, step: int) -> FloatArray:
        place = np.zeros((grid.STEP_UNKNOWNS, self.unknowns))
        first = step * grid.STEP_UNKNOWNS
        place[:, first : first + grid.STEP_UNKNOWNS] = np.eye(grid.STEP_UNKNOWNS)
        return place

    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        lower = _constant({"leg_length": 0.3}, -1.2)
        upper = _constant({"leg_length": 1.02}, 1.2)
        return np.tile(lower, self.steps), np.tile(upper, self.steps)

    def _symbols(self) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        x, p = ca.MX.sym("x", self.unknowns), ca.MX.sym("p", self.parameters)
        values = [block.value(x, p) for block in self.blocks]
        g = ca.vertcat(*(value for value, _ in values))
        return x, p, COST_SCALE * _total([cost for _, cost in values]), g

    def _ipopt(self, extra: dict[str, Any]) -> ca.Function:
        x, p, f, g = self._symbols()
        options: dict[str, Any] = {
            "ipopt": {**_IPOPT, "max_iter": self._max_iterations, **extra},
            "print_time": False,
            "error_on_fail": False,
            "calc_lam_p": False,
            **self.derivatives,
        }
        return ca.nlpsol("gait", "ipopt", {"x": x, "p": p, "f": f, "g": g}, options)

    @cached_property
    def derivatives(self) -> dict[str, ca.Function]:
        """Derivatives of cost, rows and Lagrangian, in the form of IPOPT's interface."""
        x, p, *_ = self._symbols()
        rows = [block.jacobian(x, p) for block in self.blocks]
        g, jacobian = (ca.vertcat(*(row[i] for row in rows)) for i in (0, 1))
        costs = [block.cost_gradient(x, p) for block in self.blocks]
        f, gradient = (COST_SCALE * _total([cost[i] for cost in costs]) for i in (0, 1))
        sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", g.size1())
        ends = np.cumsum([0] + [block.size for block in self.blocks])
        pieces = ca.vertsplit(lam, ends.tolist())
        hessian = _total(
            [
                block.hessian(x, p, piece, COST_SCALE * sigma)
                for block, piece in zip(self.blocks, pieces, strict=True)
            ]
        )
        names = ["x", "p"]
        return {
            "grad_f": ca.Function(
                "nlp_grad_f", [x, p], [f, ca.densify(gradient)], names, ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function("nlp_jac_g", [x, p], [g, jacobian], names, ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, p, sigma, lam],
                [ca.triu(hessian)],
                [*names, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }


def _total(terms: list[ca.MX]) -> ca.MX:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def _constant(values: dict[str, float], other: float) -> FloatArray:
    """Unknowns of a step whose coordinates are constant; keys are endings of their names."""
    unknowns = []
    for i, name in enumerate(COORDINATES):
        value = next((v for ending, v in values.items() if name.endswith(ending)), other)
        count = COEFFICIENTS if i < grid.OUTPUT_COUNT else grid.PASSIVE_DEGREE + 1
        unknowns += [value] * count
    return np.array(unknowns)


@cache
def problem(*, symmetric: bool, lean: bool) -> Problem:
    """The program with the table's limits, made once per process."""
    return Problem(symmetric=symmetric, lean=lean)
