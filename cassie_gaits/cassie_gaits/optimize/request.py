"""Requests for gaits, and bounds of the optimization."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from cassie_gaits.errors import GaitLibraryError

RANGES = {
    "vx": (-5.0, 5.0),
    "vy": (-2.0, 2.0),
    "yaw_rate": (-3.0, 3.0),
    "step_time": (0.05, 1.5),
    "clearance": (0.0, 1.0),
    "slope": (-1.0, 1.0),
    "payload": (0.0, 30.0),
    "landing_speed": (0.01, 1.0),
    "feet_apart": (0.2, 0.5),
    "torso_pitch": (0.005, 1.2),
    "torso_roll": (0.001, 1.2),
    "hip_yaw": (0.001, 1.2),
    "pelvis_distance": (0.55, 1.0),
    "detour": (0.01, 1.0),
}
"""Lowest and highest value of each number of a request."""

UNITS = {
    **dict.fromkeys(("vx", "vy", "landing_speed"), "m/s"),
    **dict.fromkeys(("clearance", "feet_apart", "pelvis_distance", "detour"), "m"),
    **dict.fromkeys(("slope", "torso_pitch", "torso_roll", "hip_yaw"), "rad"),
    **{"yaw_rate": "rad/s", "step_time": "s", "payload": "kg"},
}
"""Unit of each number of a request."""

TABLE_ONLY = {
    "landing_speed": 1.0,
    "feet_apart": 0.2,
    "torso_pitch": 1.2,
    "torso_roll": 1.2,
    "hip_yaw": 1.2,
    "pelvis_distance": 1.0,
    "detour": 1.0,
}
"""Values of a request that do not tighten the table's bounds."""


@dataclass(frozen=True)
class Request:
    """One gait to be found.

    Attributes:
        vx: Mean sagittal speed over two steps. In m/s.
        vy: Mean speed to the left. In m/s.
        yaw_rate: Mean turning rate to the left. In rad/s.
        step_time: Duration of a step. In s.
        clearance: Least height of the swing foot at mid-step. In m.
        slope: Rise of the ground ahead. In rad.
        payload: Additional mass at the pelvis's centre of mass. In kg.
        landing_speed: Largest downward speed of the landing foot; the table allows 1. In m/s.
        feet_apart: Least lateral distance of the feet; the table requires 0.2. In m.
        torso_pitch: Bound of torso pitch, up to 1.2, which is no constraint. In rad.
        torso_roll: Bound of torso roll, up to 1.2, which is no constraint. In rad.
        hip_yaw: Bound of the hips' yaw in addition to that for turning, up to 1.2. In rad.
        pelvis_distance: Largest distance of pelvis and stance foot; the table allows 1. In m.
        detour: Largest distance of the swing foot, fore and aft, beyond lift-off and landing when
            walking straight; turning adds room for the outer foot's longer path. In m.
        symmetric: Whether a left step is the mirror image of a right one, on a robot with a
            symmetric pelvis. Otherwise two steps are found, for the real robot.

    Raises:
        GaitLibraryError: if a number is not finite or out of range, or a symmetric gait is to go
            sideways or turn.

    Seven of these values are tighter than the table. With `TABLE_ONLY` the cost is a fifth
    lower, but the torso rolls by 0.07 rad and pitches by 0.2 rad, the legs are nearly straight and
    the foot lands at 1 m/s. A robot with springs, delays and the PD law of eq:ytildecontrol does
    not follow such a gait.

    Source:
        Table `table:optimization_constraints`.
    """

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0
    step_time: float = 0.4
    clearance: float = 0.15
    slope: float = 0.0
    landing_speed: float = 0.25
    feet_apart: float = 0.25
    torso_pitch: float = 0.05
    torso_roll: float = 0.005
    hip_yaw: float = 0.005
    pelvis_distance: float = 0.97
    detour: float = 0.03
    symmetric: bool = True
    payload: float = 0.0

    def __post_init__(self) -> None:
        for name, (low, high) in RANGES.items():
            value, unit = getattr(self, name), UNITS[name]
            if not low <= value <= high:
                raise GaitLibraryError(
                    f"{name} is {value:g} {unit}, expected {low:g} .. {high:g} {unit}"
                )
        if self.symmetric and (self.vy != 0.0 or self.yaw_rate != 0.0):
            raise GaitLibraryError("a symmetric gait neither goes sideways nor turns")

    @property
    def name(self) -> str:
        """Name of the request, for progress messages."""
        text = f"vx {self.vx:+.2f} m/s"
        if self.vy or self.yaw_rate:
            text += f", vy {self.vy:+.2f} m/s, yaw {self.yaw_rate:+.2f} rad/s"
        return text


@dataclass(frozen=True)
class Limits:
    """Bounds of the table, and margins of the solver.

    The solver evaluates constraints at a number of instants; the margins keep the motion between
    them within the bounds.

    Attributes:
        friction: Largest ratio of tangential to normal ground force.
        feet_apart: Least lateral distance of the feet. In m.
        pelvis_low, pelvis_high: Bounds of the distance from pelvis's origin to stance foot. In m.
        landing_speed: Largest downward speed of the landing foot. In m/s.
        foot_pitch: Bound of the swing foot's pitch against the ground. In rad.
        definite: Least speed of the foot, upward at lift-off and downward at landing. In m/s.
        margin: Margin of lengths. In m.
        share: Largest used share of friction and of the drives' torque and speed.
        weight: c of the cost.
    """

    friction: float = 0.6
    feet_apart: float = 0.2
    pelvis_low: float = 0.5
    pelvis_high: float = 1.0
    landing_speed: float = 1.0
    foot_pitch: float = 4e-3
    definite: float = 1e-3
    margin: float = 2e-4
    share: float = 0.98
    weight: float = 1e4


def parameters(request: Request) -> list[float]:
    """Numbers of a request in the order in which the program takes them."""
    asymmetry = 0.0 if request.symmetric else 1.0
    return [
        request.vx,
        request.vy,
        request.yaw_rate,
        request.step_time,
        request.clearance,
        request.slope,
        request.payload,
        asymmetry,
    ]


def as_document(request: Request) -> dict[str, float | bool]:
    """The request for the library's file; without a payload of 0, as in older files."""
    document = asdict(request)
    if not request.payload:
        del document["payload"]
    return document
