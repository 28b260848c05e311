"""Requirements on a gait, row by row, and the margins to their bounds."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.certificate import states
from cassie_gaits.certificate.rollout import Step
from cassie_gaits.certificate.walker import Walker, rigid_velocity
from cassie_gaits.gait_library import Gait
from cassie_gaits.names import LEG_DRIVES, LEG_JOINTS, LEGS
from cassie_gaits.records import FloatArray

FRICTION = 0.6
FEET_APART = 0.2
PELVIS_TO_FOOT = (0.5, 1.0)
LANDING_SPEED = 1.0

SPEED_TOLERANCE = 1e-4
"""Tolerance of mean speeds, in m/s, and of the turning rate, in rad/s."""

REST_TOLERANCE = 1e-3
"""Tolerance of the landing foot's speed along the ground. In m/s."""

ANGLE_TOLERANCE = 5e-3
"""Tolerance of the swing foot's pitch against the ground. In rad.

This is the pitch of the foot itself; the output of that name is another angle if the leg leans to
the side. At this tolerance heel and tip differ by 0.8 mm in height.
"""

TORQUE_TOLERANCE = 1e-6
"""Tolerance of the stance toe's torque. In Nm."""


@dataclass(frozen=True)
class Row:
    """One requirement.

    Attributes:
        name: Name of the requirement.
        low, high: Bounds.
        worst: Value nearest to a bound, or farthest beyond it.
        unit: Unit of bounds and value.
    """

    name: str
    low: float
    high: float
    worst: float
    unit: str

    @property
    def margin(self) -> float:
        """Distance to the nearer bound, negative beyond it; NaN counts as beyond it."""
        margin = min(self.worst - self.low, self.high - self.worst)
        return margin if math.isfinite(margin) else -math.inf

    @property
    def met(self) -> bool:
        """Whether the value is within the bounds."""
        return self.margin >= 0.0


def row(name: str, unit: str, low: float, high: float, values: npt.ArrayLike) -> Row:
    """A row for the worst of several values."""
    array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    margins = np.minimum(array - low, high - array)
    return Row(name, low, high, float(array[int(np.argmin(margins))]), unit)


def step_rows(walker: Walker, gait: Gait, step: Step, clearance: float) -> list[Row]:
    """Rows of one step, without the mean speeds."""
    stance, swing = states.legs(step.domain)
    places = np.array([_place(walker, q, stance, swing) for q in step.q])
    feet, pelvis, foot = places[:, :3], places[:, 3], np.arcsin(places[:, 4])
    end = _sole_velocity(walker, step, swing)
    along = np.hypot(step.forces[:, 0], step.forces[:, 1])
    side = 1.0 if swing == "left" else -1.0
    toe = states.drive(stance, "toe") - 6
    middle = len(step.phases) // 2
    infinite = math.inf
    return [
        row("step time", "s", 0.05, 5.0, gait.step_time),
        row("torque for stance foot pitch", "Nm", *_about(TORQUE_TOLERANCE), step.torques[:, toe]),
        row("friction cone", "", -infinite, FRICTION, along / step.forces[:, 2]),
        row("ground pushes", "N", 0.0, infinite, step.forces[:, 2]),
        row("mid-step swing foot clearance", "m", clearance, infinite, feet[middle, 2]),
        row("swing foot above the ground", "m", 0.0, infinite, feet[1:-1, 2]),
        row("absolute swing foot pitch", "rad", *_about(ANGLE_TOLERANCE), foot),
        row("distance between feet", "m", FEET_APART, infinite, side * feet[:, 1]),
        row("distance between pelvis and stance foot", "m", *PELVIS_TO_FOOT, pelvis),
        row("swing foot velocity on impact (x)", "m/s", *_about(REST_TOLERANCE), end[0]),
        row("swing foot velocity on impact (y)", "m/s", *_about(REST_TOLERANCE), end[1]),
        row("swing foot velocity on impact (z)", "m/s", -LANDING_SPEED, 0.0, end[2]),
        *_drive_rows(step),
        _stops_row(step),
    ]


def _about(tolerance: float) -> tuple[float, float]:
    return -tolerance, tolerance


def _place(walker: Walker, q: FloatArray, stance: str, swing: str) -> FloatArray:
    """Place of the swing foot and distance of the pelvis. Shape (5,).

    These are the swing sole relative to the stance sole in ground axes, the distance from pelvis to
    stance sole, and the rise of the swing foot from heel to tip as a share of the foot's length.
    """
    soles = dict(zip(LEGS, walker.tree.soles(q), strict=True))
    (standing, _), (moving, attitude) = soles[stance], soles[swing]
    axes = walker.ground_axes()
    apart = axes.T @ (moving - standing)
    rise = axes[:, 2] @ attitude[:, 0]
    return np.array([*apart, np.linalg.norm(q[:3] - standing), rise])


def foot_places(walker: Walker, step: Step) -> FloatArray:
    """Swing sole relative to the stance sole over a step, in ground axes. Shape (n, 3), in m."""
    stance, swing = states.legs(step.domain)
    return np.array([_place(walker, q, stance, swing)[:3] for q in step.q])


def _sole_velocity(walker: Walker, step: Step, swing: str) -> FloatArray:
    sole = walker.tree.sole_jacobian(step.q[-1], swing)
    velocity = sole[:3] @ rigid_velocity(step.v[-1])
    result: FloatArray = walker.ground_axes().T @ velocity
    return result


def _drive_rows(step: Step) -> list[Row]:
    """Rows of the drives' torques: the bound at rest and the torque-speed limit."""
    drives = [robot.DRIVES[name] for _ in LEGS for name in LEG_DRIVES]
    most = np.array([drive.torque_limit for drive in drives])
    fastest = np.array([drive.speed_limit for drive in drives])
    speeds = np.abs(np.array([rigid_velocity(v)[6:] for v in step.v])) / fastest
    loads = np.abs(step.torques) / most
    return [
        row("torque of the drives, share of the limit", "", -math.inf, 1.0, loads.ravel()),
        row(
            "torque at speed, share of the limit",
            "",
            -math.inf,
            1.0,
            (0.5 * loads + speeds).ravel(),
        ),
    ]


def _stops_row(step: Step) -> Row:
    room = []
    for leg in LEGS:
        stops = {link.name: link.joint.limits for link in robot.leg_links(leg)}
        angles = step.q[:, 6 + 7 * LEGS.index(leg) :][:, :7]
        for i, joint in enumerate(LEG_JOINTS):
            low, high = stops[joint] or (-math.inf, math.inf)
            room.append(np.minimum(angles[:, i] - low, high - angles[:, i]))
    return row("joint angles inside their stops", "rad", 0.0, math.inf, np.array(room).ravel())


def travel(walker: Walker, step: Step) -> tuple[float, float, float]:
    """Landing of the swing foot: ahead and left of the stance foot in m, and its turn in rad."""
    stance, swing = states.legs(step.domain)
    foot = _place(walker, step.q[-1], stance, swing)
    _, attitude = walker.tree.sole(step.q[-1], swing)
    ahead = walker.ground_axes().T @ attitude[:, 0]
    return float(foot[0]), float(foot[1]), math.atan2(ahead[1], ahead[0])


def speed_rows(gait: Gait, first: tuple[float, ...], second: tuple[float, ...]) -> list[Row]:
    """Rows of the mean speeds over two steps.

    Args:
        gait: Gait with the commanded speeds.
        first: `travel` of the step on the right leg.
        second: `travel` of the step on the left leg.

    The heading is the mean of the two feet's headings, and the velocity the mean of their
    velocities: on an arc the outer foot has the longer path. The right foot goes from its stance to
    its landing in the second step, the left foot from its previous stance to its landing in the
    first step.
    """
    yaw1, yaw2 = first[2], second[2]
    turn, time = yaw1 + yaw2, 2.0 * gait.step_time
    one, other = complex(*first[:2]), complex(*second[:2])
    ways = (
        (one + cmath.rect(1.0, yaw1) * other, 0.5 * (yaw1 + 0.5 * turn)),
        (one + cmath.rect(1.0, -yaw2) * other, 0.5 * (yaw1 - 0.5 * turn)),
    )
    chord = time * float(np.sinc(0.5 * turn / math.pi))
    speed = sum(way * cmath.rect(1.0, -heading) for way, heading in ways) / (2.0 * chord)
    return [
        row(name, unit, want - SPEED_TOLERANCE, want + SPEED_TOLERANCE, value)
        for name, unit, want, value in (
            ("average sagittal velocity", "m/s", gait.vx, speed.real),
            ("average lateral velocity", "m/s", gait.vy, speed.imag),
            ("average turning rate", "rad/s", gait.yaw_rate, turn / time),
        )
    ]
