"""A library of gaits over sagittal speed, lateral speed and turning rate, with interpolation.

`gait_library_file` has its file.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from cassie_gaits.bezier import COEFFICIENTS
from cassie_gaits.compiled import compiled
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_grid import GaitGrid
from cassie_gaits.names import DRIVES
from cassie_gaits.records import FloatArray, IntArray

OUTPUTS = (
    "torso_roll",
    "stance_hip_yaw",
    "torso_pitch",
    "stance_leg_length",
    "swing_leg_roll",
    "swing_hip_yaw",
    "swing_leg_pitch",
    "swing_leg_length",
    "swing_foot_pitch",
)
"""The nine outputs of eq:h0, the rows of every coefficient matrix."""

PASSIVE = ("stance_foot_roll", "stance_leg_pitch")
"""The undriven coordinates of a step, the rows of `Gait.passive`: roll of the stance foot about the
middle line of its sole, and pitch of the stance leg, defined as for an output."""

STANCES = ("right_stance", "left_stance")
"""The two domains, in the order in which arrays and files hold them."""

MOST_COEFFICIENTS = 64
"""Largest number of coefficients in a polynomial of torque or passive motion."""

MOST_POINTS = 10_000
"""Largest number of points of a grid of speeds; the dense library has 1666."""

KINDS = ("optimized", "imported")

_CHANGE_SIGN = ("torso_roll", "stance_hip_yaw", "swing_leg_roll", "swing_hip_yaw")
_MIRROR_SIGN = np.array([-1.0 if name in _CHANGE_SIGN else 1.0 for name in OUTPUTS])[:, np.newaxis]


@dataclass(frozen=True, eq=False)
class Gait:
    """One periodic gait: a step on the right leg, then one on the left.

    Attributes:
        vx: Mean sagittal speed. In m/s.
        vy: Mean speed to the left. In m/s.
        yaw_rate: Mean turning rate to the left. In rad/s.
        step_time: Duration of a step. In s.
        coefficients: Bezier coefficients of the outputs, right stance then left stance. Shape
            (2, 9, 6), in rad and m, read-only.
        torques: Bezier coefficients of the ten drives' torques in the order of `names.DRIVES`,
            right stance then left stance, or None. Shape (2, 10, n), in Nm, read-only.
        passive: Bezier coefficients of the undriven coordinates, `PASSIVE`, or None. Shape
            (2, 2, n), in rad, read-only.
        cost: Value of the optimized cost, or None.
        solver: Report of the solver.
        certificate: Result of an independent check, or None.
    """

    vx: float
    vy: float
    yaw_rate: float
    step_time: float
    coefficients: FloatArray
    torques: FloatArray | None = None
    cost: float | None = None
    solver: Mapping[str, Any] = field(default_factory=dict)
    certificate: Mapping[str, Any] | None = None
    passive: FloatArray | None = None

    def __post_init__(self) -> None:
        for name in ("vx", "vy", "yaw_rate", "step_time"):
            if not np.isfinite(getattr(self, name)):
                raise GaitLibraryError(f"{name} is {getattr(self, name)}, expected a finite number")
        if not 0.05 <= self.step_time <= 5.0:
            raise GaitLibraryError(f"step_time is {self.step_time} s, expected 0.05 .. 5 s")
        shape = (2, len(OUTPUTS), COEFFICIENTS)
        object.__setattr__(self, "coefficients", _frozen(self.coefficients, shape, "coefficients"))
        if self.torques is not None:
            object.__setattr__(self, "torques", _series(self.torques, len(DRIVES), "torques"))
        if self.passive is not None:
            object.__setattr__(self, "passive", _series(self.passive, len(PASSIVE), "passive"))
        object.__setattr__(self, "solver", MappingProxyType(dict(self.solver)))
        if self.certificate is not None:
            object.__setattr__(self, "certificate", MappingProxyType(dict(self.certificate)))

    @property
    def speeds(self) -> str:
        """Text of the gait's speeds, for messages."""
        if self.vy == 0.0 and self.yaw_rate == 0.0:
            return f"{self.vx:g} m/s"
        return f"{self.vx:g}, {self.vy:g} m/s, {self.yaw_rate:g} rad/s"

    def __reduce__(self) -> tuple[Any, ...]:
        # Read-only mappings cannot be sent between processes.
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        values["solver"] = dict(self.solver)
        if self.certificate is not None:
            values["certificate"] = dict(self.certificate)
        return functools.partial(Gait, **values), ()


@dataclass(frozen=True)
class Provenance:
    """Origin of a library.

    Attributes:
        tool: Tool that made the library.
        version: Version of the tool.
        date: Date on which the library was made, as the tool gave it; YYYY-MM-DD.
        settings: Settings of the tool.
    """

    tool: str
    version: str
    date: str
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GaitLibrary:
    """Gaits on a grid of speeds with multilinear interpolation between them (`gait_grid`).

    Attributes:
        gaits: Gaits in ascending order of (vx, vy, yaw_rate). Points of the grid may lack a gait.
        kind: One of `KINDS`.
        model_hash: `model_hash.model_hash()` of the robot that the gaits are made for.
        provenance: Origin of the gaits.
        robot: Name of the robot.
        path: File from which the library was loaded, or None.

    Raises:
        GaitLibraryError: if there is no gait, the speeds do not ascend, or `kind` is unknown.

    Source:
        Da et al. 2016, Eqs. (8)-(10), which the paper cites: coefficients and step frequency
        are linear in the speed between two gaits; the speed is clamped to the library's range.
        Here this holds for each of the three speeds.
    """

    gaits: tuple[Gait, ...]
    kind: str
    model_hash: str
    provenance: Provenance
    robot: str = "cassie"
    path: Path | None = None
    _grid: GaitGrid = field(init=False, repr=False)
    _row: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise GaitLibraryError(f"kind is {self.kind!r}, expected one of {', '.join(KINDS)}")
        if not self.gaits:
            raise GaitLibraryError("the library has no gait")
        points = [(gait.vx, gait.vy, gait.yaw_rate) for gait in self.gaits]
        for before, after in pairwise(points):
            if not after > before:
                raise GaitLibraryError(f"{after} follows {before}, expected rising speeds")
        size = math.prod(len(set(axis)) for axis in zip(*points, strict=True))
        if size > MOST_POINTS:
            raise GaitLibraryError(
                f"the speeds span a grid of {size} points, expected at most {MOST_POINTS}"
            )
        rows = [[*gait.coefficients.ravel(), 1.0 / gait.step_time] for gait in self.gaits]
        object.__setattr__(self, "_grid", GaitGrid(np.array(points), np.array(rows)))
        object.__setattr__(self, "_row", np.zeros(len(rows[0])))

    @property
    def axes(self) -> tuple[list[float], ...]:
        """Sagittal speeds, lateral speeds (m/s) and turning rates (rad/s) of the grid."""
        return self._grid.axes

    @property
    def holes(self) -> int:
        """Points of the grid without a gait of their own."""
        return self._grid.holes

    @property
    def table(self) -> tuple[FloatArray, IntArray, FloatArray]:
        """Table for `gait_grid.read_row`; a row has both steps' coefficients and 1 / step time."""
        return self._grid.table

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest vx. In m/s."""
        return self._grid.axes[0][0], self._grid.axes[0][-1]

    def interpolate(
        self, speed: float, vy: float = 0.0, yaw_rate: float = 0.0
    ) -> tuple[FloatArray, FloatArray, float]:
        """Gait at a speed. Each speed is clamped to its range in the library.

        Args:
            speed: Filtered sagittal speed. In m/s.
            vy: Speed to the left. In m/s.
            yaw_rate: Turning rate to the left. In rad/s.

        Returns:
            Coefficients for right stance and for left stance, each of shape (9, 6) in rad and
            m, and the step time in s.

        Raises:
            GaitLibraryError: if a number is not finite.
        """
        if not math.isfinite(speed + vy + yaw_rate):
            raise GaitLibraryError(
                f"gait speed is {speed}, {vy} m/s, {yaw_rate} rad/s, expected finite numbers"
            )
        self._grid.read(float(speed), float(vy), float(yaw_rate), self._row)
        right, left = self._row[:-1].reshape(2, len(OUTPUTS), COEFFICIENTS).copy()
        return right, left, 1.0 / float(self._row[-1])


_STEP_SHAPE = (len(OUTPUTS), COEFFICIENTS)
_STEP_SIZE = len(OUTPUTS) * COEFFICIENTS


@compiled
def gait_in_stance(row: FloatArray, stance: int) -> FloatArray:
    """Coefficients in a row of `GaitLibrary.table` of the step on a leg.

    Args:
        row: The row. Shape (m,).
        stance: The stance leg, 0 for the left and 1 for the right one.

    Returns:
        A view. Shape (9, 6), in rad and m.
    """
    begin = _STEP_SIZE * (1 - stance)  # right stance stands first
    return row[begin : begin + _STEP_SIZE].reshape(_STEP_SHAPE)


def mirror(coefficients: FloatArray) -> FloatArray:
    """Coefficients of the same step with left and right exchanged.

    Torso roll, both hip yaws and swing leg roll change their sign; pitches and lengths do not.

    Args:
        coefficients: Rows in the order of `OUTPUTS`. Shape (9, n).
    """
    result: FloatArray = coefficients * _MIRROR_SIGN
    return result


def mirror_passive(coefficients: FloatArray) -> FloatArray:
    """Coefficients of `PASSIVE` with left and right exchanged. Shape (2, n)."""
    result: FloatArray = coefficients * np.array([[-1.0], [1.0]])
    return result


def mirror_torques(coefficients: FloatArray) -> FloatArray:
    """Coefficients of the drives' torques with left and right exchanged. Shape (10, n)."""
    legs = coefficients.reshape(2, 5, -1)[::-1] * np.array([-1.0, -1.0, 1.0, 1.0, 1.0])[:, None]
    result: FloatArray = legs.reshape(10, -1)
    return result


def _series(values: FloatArray, rows: int, name: str) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.ndim != 3 or not 2 <= array.shape[2] <= MOST_COEFFICIENTS:
        expected = f"(2, {rows}, 2 .. {MOST_COEFFICIENTS})"
        raise GaitLibraryError(f"{name} have shape {array.shape}, expected {expected}")
    return _frozen(array, (2, rows, array.shape[2]), name)


def _frozen(values: FloatArray, shape: tuple[int, ...], name: str) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise GaitLibraryError(f"{name} have shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        raise GaitLibraryError(f"{name} hold a number that is not finite")
    array.setflags(write=False)
    return array
