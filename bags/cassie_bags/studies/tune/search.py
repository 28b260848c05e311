"""The search: CMA-ES over normalized parameters, generation by generation; it can be resumed."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.bag.rows import FloatArray
from cassie_bags.errors import ExperimentError


@dataclass(frozen=True)
class Generation:
    """Result of one generation: number, best and median cost, step size of the search.

    Each generation has robots of its own, so that costs compare only within a generation.
    """

    number: int
    best: float
    middle: float
    step: float


class _Normal:
    """Normal random numbers of one search; the package would use numpy's global ones instead."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def __call__(self, *shape: int) -> FloatArray:
        return self._rng.standard_normal(shape)


@dataclass
class Search:
    """A search at the end of a generation.

    The covariance matrix adaptation evolution strategy (Hansen) of the package `cma`, within
    the box from -1 to 1. The same seed gives the same search.

    Attributes:
        history: Generations, in order.
    """

    strategy: Any
    history: list[Generation] = field(default_factory=list)

    @staticmethod
    def begin(size: int, seed: int, step: float, population: int) -> Search:
        """A new search from the middle of the box.

        Args:
            size: Number of parameters.
            seed: Seed of the search, from 1 on.
            step: Initial step size over half the width of the box.
            population: Candidates of a generation; 0: a number that suits `size`.
        """
        import cma

        options: dict[str, Any] = {"bounds": [-1.0, 1.0], "verbose": -9, "verb_log": 0}
        options |= {"seed": math.nan, "randn": _Normal(seed)}
        if population:
            options["popsize"] = population
        strategy = cma.CMAEvolutionStrategy(np.zeros(size), step, options)
        return Search(strategy)

    def advance(self, evaluate: Callable[[Sequence[FloatArray]], Sequence[float]]) -> Generation:
        """Run one generation; `evaluate` gives costs of candidates, of coordinates from -1 to 1."""
        candidates = [np.asarray(candidate) for candidate in self.strategy.ask()]
        costs = list(evaluate(candidates))
        self.strategy.tell(candidates, costs)
        best, middle, step = np.min(costs), np.median(costs), self.strategy.sigma
        number = len(self.history) + 1
        self.history.append(Generation(number, float(best), float(middle), float(step)))
        return self.history[-1]

    @property
    def found(self) -> FloatArray:
        """Coordinates of the middle of the search distribution. Shape (size,).

        Every generation has robots of its own, so that no single candidate is the best of all. The
        middle is the result of all generations.
        """
        return np.asarray(self.strategy.result.xfavorite, dtype=float)

    @property
    def population(self) -> int:
        """Number of candidates of a generation."""
        return int(self.strategy.popsize)

    def save(self, path: Path, purpose: str) -> None:
        """Store the search for `load`; `purpose` identifies the searched problem."""
        part = path.with_suffix(".part")
        part.write_bytes(pickle.dumps((purpose, self)))
        part.replace(path)

    @staticmethod
    def load(path: Path, purpose: str) -> Search:
        """Load a search to resume it.

        Raises:
            ExperimentError: if there is none, or it is for another purpose.
        """
        try:
            stored, search = pickle.loads(path.read_bytes())
        except OSError as error:
            raise ExperimentError(f"cannot resume from {path}: {error.strerror}") from None
        except (pickle.UnpicklingError, ValueError, EOFError, AttributeError, ImportError):
            raise ExperimentError(f"cannot resume from {path}: it holds no search") from None
        if not isinstance(search, Search) or stored != purpose:
            raise ExperimentError(
                f"cannot resume from {path}: it searches other parameters, or for another objective"
            )
        return search
