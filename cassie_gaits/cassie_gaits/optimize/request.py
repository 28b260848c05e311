"""What a gait shall be, and what the optimization holds it to."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from cassie_gaits.errors import GaitLibraryError

_RANGES = {
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

TABLE_ONLY = {
    "landing_speed": 1.0,
    "feet_apart": 0.2,
    "torso_pitch": 1.2,
    "torso_roll": 1.2,
    "hip_yaw": 1.2,
    "pelvis_distance": 1.0,
    "detour": 1.0,
}
"""Where a request leaves the table alone."""


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
        payload: Mass at the pelvis's centre of mass beside its own. In kg.
        landing_speed: Largest speed of the foot down to the ground; the table allows 1. In m/s.
        feet_apart: Least distance of the feet to the side; the table asks for 0.2. In m.
        torso_pitch: Bound of torso pitch, up to 1.2 where it binds nothing. In rad.
        torso_roll: Bound of torso roll, likewise. In rad.
        hip_yaw: Bound of the hips' yaw beyond what turning takes, up to 1.2 likewise. In rad.
        pelvis_distance: Largest distance of pelvis and stance foot; the table allows 1. In m.
        detour: How far the swing foot goes beyond where it lifts off and lands, fore and aft, when
            walking straight; turning gets room for the longer way of the outer foot. In m.
        symmetric: Whether a left step is the mirror image of a right one, on a robot whose pelvis
            is made symmetric. Otherwise two steps are found, for the robot as it is.

    Raises:
        GaitLibraryError: if a number is not finite or out of range, or a symmetric gait is to go
            sideways or turn.

    Seven of these keep inside the table what it leaves wide: with `TABLE_ONLY` the cost is a fifth
    lower, but the torso sways by 0.07 rad and leans by 0.2 rad, the legs are nearly straight and
    the foot lands at 1 m/s, which a robot with springs, delays and the PD law of
    eq:ytildecontrol does not follow.

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
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise GaitLibraryError(f"{name} is {value}, expected {low} .. {high}")
        if self.symmetric and (self.vy != 0.0 or self.yaw_rate != 0.0):
            raise GaitLibraryError("a symmetric gait neither goes sideways nor turns")

    @property
    def name(self) -> str:
        """For a line of progress."""
        text = f"vx {self.vx:+.2f} m/s"
        if self.vy or self.yaw_rate:
            text += f", vy {self.vy:+.2f} m/s, yaw {self.yaw_rate:+.2f} rad/s"
        return text


@dataclass(frozen=True)
class Limits:
    """Bounds of the table, and how far inside them the solver stays.

    The solver sees constraints at a number of instants; the margins keep what lies between them
    inside the bounds.

    Attributes:
        friction: Largest ratio of ground force along the ground and across it.
        feet_apart: Least distance of the feet to the side. In m.
        pelvis_low, pelvis_high: Distance from the pelvis's origin to the stance foot. In m.
        landing_speed: Largest speed of the foot down to the ground. In m/s.
        foot_pitch: Bound of the swing foot's pitch against the ground. In rad.
        definite: Least speed of the foot up at lift-off and down at landing. In m/s.
        margin: Of lengths. In m.
        share: Of friction and of the drives' torque and speed that is used.
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
    """For the library's file; without the payload where there is none, as in older files."""
    document = asdict(request)
    if not request.payload:
        del document["payload"]
    return document
