"""Where and when the swing foot comes down, by a walking pendulum of constant height.

Compiled; everything is in m, s and the heading frame, positions of the CoM from the stance toe
joint, u the swing foot's from the CoM at touchdown. `side` is 1 if the left leg swings, else -1.
`foot` says where it goes for a CoM that touches down with a velocity, and what it can reach.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cassie_control.control.robot import HIP_BACK, HIP_DOWN, HIP_ROLL_X, HIP_Y, aim_leg
from cassie_control.planner.momentum import momentum_velocity
from cassie_gaits.compiled import compiled
from cassie_gaits.linkage import RecordArray

FloatArray = npt.NDArray[np.float64]


class Aim(NamedTuple):
    """Foot placement as a law of the velocity at touchdown.

    Attributes:
        ux, uy: Of the swing foot from the CoM in steady walking.
        vx, vy: Velocity at touchdown in steady walking.
        gain: Of the error of that velocity, in place. In s.
        loss_x, loss_y: What the gains lose with the velocity ahead. In s/m.
    """

    ux: float
    uy: float
    vx: float
    vy: float
    gain: float
    loss_x: float
    loss_y: float


class Reach(NamedTuple):
    """Where the swing foot can be set down.

    Attributes:
        side: Of the swing leg.
        hip_x, hip_y: Swing hip from the CoM.
        far: Greatest distance from the hip fore and aft.
        inward, outward: Greatest distance from the hip sideways.
        apart: Least sideways distance from the stance foot.
    """

    side: float
    hip_x: float
    hip_y: float
    far: float
    inward: float
    outward: float
    apart: float


@compiled
def foot(
    aim: Aim, reach: Reach, end: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Where the foot goes for a CoM that touches down as `end` says, kept within reach.

    Returns:
        u_x, u_y, and how far from there the law wanted it. In m.
    """
    _, y_end, vx, vy = end
    side = reach.side
    wanted_x = aim.ux + _gain(aim, aim.loss_x, vx) * (vx - aim.vx)
    wanted_y = aim.uy + _gain(aim, aim.loss_y, vx) * (vy - aim.vy)
    ux = reach.hip_x + min(reach.far, max(-reach.far, wanted_x - reach.hip_x))
    out = min(reach.outward, max(-reach.inward, side * (wanted_y - reach.hip_y)))
    # Feet that would meet are worse than a foot out of the hip's reach.
    out = max(side * reach.hip_y + out, reach.apart - side * y_end)
    return ux, side * out, math.hypot(wanted_x - ux, wanted_y - side * out)


@compiled
def _gain(aim: Aim, speed_loss: float, vx: float) -> float:
    """a / b of the step-to-step map for a CoM that touches down at `vx`. In s."""
    return aim.gain / (1.0 + speed_loss * abs(vx))


GRAVITY = 9.81
LAW_TYPE = np.dtype(
    [
        (name, float)
        for name in (
            *("double_support", "slowest_step", "foot_spread"),
            *("map_gain", "map_loss_x", "map_loss_y"),
            *("reach_inward", "reach_outward", "least_foot_distance", "level", "landing_depth"),
        )
    ]
)
"""What `landing` takes of `WalkConfig`, in its units."""

_LONGEST = 0.95  # m, of a leg that is aimed
_SHORTEST = 0.5
_SHORTEST_SINGLE = 0.1  # s, of a step on one foot
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_TIME_TOLERANCE = 2e-3  # s, of the touchdown time that is searched: one control period
_LATENESS = 0.02  # m^2/s^2, what a change of the step's time costs against a foot out of reach


class Now(NamedTuple):
    """What `landing` takes of the present.

    Attributes:
        com_x, com_y, com_z: CoM from the pelvis origin.
        ankle_x, ankle_y, ankle_z: Stance toe joint from there.
        velocity_x, velocity_y: Of the CoM, from the angular momentum about the stance toe joint.
        pitch: Of the torso. In rad.
        side: Of the swing leg.
        elapsed, remaining, earliest, step_time, yaw, rise, slope_x, slope_y: `StepAhead`.
        lead: Time from the swing foot's first contact to the end of the step.
        commanded_vx, commanded_vy, spread, roll_trim: `Commanded`.
        offset_x, offset_y: Of the foot, from the disturbance observer.
    """

    com_x: float
    com_y: float
    com_z: float
    ankle_x: float
    ankle_y: float
    ankle_z: float
    velocity_x: float
    velocity_y: float
    pitch: float
    side: float
    elapsed: float
    remaining: float
    earliest: float
    step_time: float
    yaw: float
    rise: float
    slope_x: float
    slope_y: float
    lead: float
    commanded_vx: float
    commanded_vy: float
    spread: float
    roll_trim: float
    offset_x: float
    offset_y: float


class Fall(NamedTuple):
    """A CoM that coasts for a moment, then falls away from the stance foot.

    Attributes:
        x, y, vx, vy: Now.
        rate: w = sqrt(g / height). In 1/s.
        coasting: Time that is left of coasting.
    """

    x: float
    y: float
    vx: float
    vy: float
    rate: float
    coasting: float


@compiled
def fallen(fall: Fall, remaining: float) -> tuple[float, float, float, float]:
    """Position and velocity of the CoM after a time: x, y, vx, vy."""
    x, y, vx, vy, w, coasting = fall
    coasting = min(coasting, remaining)
    sinh, cosh = math.sinh(w * (remaining - coasting)), math.cosh(w * (remaining - coasting))
    x += vx * coasting
    y += vy * coasting
    return (
        x * cosh + vx / w * sinh,
        y * cosh + vy / w * sinh,
        w * x * sinh + vx * cosh,
        w * y * sinh + vy * cosh,
    )


@compiled
def touchdown_time(
    fall: Fall, aim: Aim, reach: Reach, planned: float, earliest: float, latest: float
) -> float:
    """Time to touchdown at which the foot that the law wants is nearest to within reach.

    Args:
        planned: Time to the gait's own touchdown, which is kept where it serves as well.
        earliest, latest: Bounds of the result.
    """
    if _cost(fall, aim, reach, planned, 0.0) < 1e-4 * _LATENESS:
        return planned
    # Golden section: the cost is the square of a distance to a box, and that of a delay.
    low, high = earliest, latest
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    cost_left = _cost(fall, aim, reach, left, left - planned)
    cost_right = _cost(fall, aim, reach, right, right - planned)
    while high - low > _TIME_TOLERANCE:
        if cost_left < cost_right:
            high, right, cost_right = right, left, cost_left
            left = high - _GOLDEN * (high - low)
            cost_left = _cost(fall, aim, reach, left, left - planned)
        else:
            low, left, cost_left = left, right, cost_right
            right = low + _GOLDEN * (high - low)
            cost_right = _cost(fall, aim, reach, right, right - planned)
    return 0.5 * (low + high)


@compiled
def _cost(fall: Fall, aim: Aim, reach: Reach, time: float, change: float) -> float:
    _, _, missed = foot(aim, reach, fallen(fall, time))
    return float(missed * missed + _LATENESS * change * change)


@compiled
def landing(
    laws: RecordArray,
    robots: RecordArray,
    momenta: RecordArray,
    swing: int,
    elapsed: float,
    remaining: float,
    earliest: float,
    step_time: float,
    yaw: float,
    rise: float,
    slope_x: float,
    slope_y: float,
    lead: float,
    commanded_vx: float,
    commanded_vy: float,
    spread: float,
    roll_trim: float,
    offset_x: float,
    offset_y: float,
) -> tuple[float, float, float, float]:
    """Swing leg at touchdown, by the law of `PendulumPlacement`.

    Args:
        laws: Of `LAW_TYPE`. Shape (1,).
        robots: Of `robot.ROBOT_TYPE`. Shape (1,).
        momenta: Of `angular_momentum.MOMENTUM_TYPE`. Shape (1,).
        swing: Number of the swing leg.
        elapsed to offset_y: See `Now`.

    Returns:
        Roll and pitch in rad, length in m, time to touchdown in s.
    """
    robot = robots[0]
    com, ankle = robot.com, robot.ankle[1 - swing]
    velocity = momentum_velocity(robots, 1 - swing, momenta)
    now = Now(
        com[0],
        com[1],
        com[2],
        ankle[0],
        ankle[1],
        ankle[2],
        velocity[0],
        velocity[1],
        robot.pitch,
        1.0 - 2.0 * swing,
        elapsed,
        remaining,
        earliest,
        step_time,
        yaw,
        rise,
        slope_x,
        slope_y,
        lead,
        commanded_vx,
        commanded_vy,
        spread,
        roll_trim,
        offset_x,
        offset_y,
    )
    return _land(laws[0], now, robot.tilt)


@compiled
def _land(law: Any, now: Now, tilt: FloatArray) -> tuple[float, float, float, float]:
    """See `landing`; `tilt` (3, 3) leads from the pelvis to the heading frame."""
    side, lead = now.side, now.lead
    fall = _falling(law, now)
    hip_x = tilt[0, 0] * HIP_ROLL_X + tilt[0, 1] * side * HIP_Y
    hip_y = tilt[1, 1] * side * HIP_Y
    down = tilt[2, 0] * HIP_ROLL_X + tilt[2, 1] * side * HIP_Y - now.ankle_z + now.rise
    reach = Reach(
        side,
        hip_x - HIP_BACK - now.com_x,
        hip_y - now.com_y,
        math.sqrt(max(0.01, (_LONGEST + HIP_DOWN) ** 2 - down * down)),
        law.reach_inward,
        law.reach_outward,
        law.least_foot_distance,
    )
    aim = _steady(law, now, fall.rate, math.sin(now.roll_trim) * down)
    latest = max(now.remaining, law.slowest_step * now.step_time - now.elapsed)
    time = touchdown_time(
        fall,
        aim,
        reach,
        max(0.0, now.remaining - lead),
        max(0.0, now.earliest - lead),
        max(0.0, latest - lead),
    )
    end = fallen(fall, time)
    ux, uy, _ = foot(aim, reach, end)
    # The stance leg tilts: the hip sinks as the CoM leaves the foot behind.
    spent = end[0] ** 2 + end[1] ** 2 - fall.x**2 - fall.y**2
    sinking = (1.0 - law.level) * spent / (2.0 * down)
    rise = now.slope_x * (fall.x + ux) + now.slope_y * (fall.y + uy)
    roll, pitch, length = aim_leg(
        now.com_x + ux - hip_x,
        now.com_y + uy - hip_y,
        down - max(-0.1, min(0.1, sinking)) - rise,
        now.yaw,
        now.pitch,
    )
    return roll, pitch, max(_SHORTEST, min(_LONGEST, length + law.landing_depth)), lead + time


@compiled
def _falling(law: Any, now: Now) -> Fall:
    """The pendulum as it is, its height above the foot along the slope."""
    x, y, height = now.com_x - now.ankle_x, now.com_y - now.ankle_y, now.com_z - now.ankle_z
    # Along a slope the CoM travels in a plane parallel to it, at this height above the foot.
    above = max(0.4, height - now.slope_x * x - now.slope_y * y)
    faster = max(0.4, height) / above
    coasts = max(0.0, law.double_support - now.elapsed)
    rate = math.sqrt(GRAVITY / above)
    return Fall(x, y, faster * now.velocity_x, faster * now.velocity_y, rate, coasts)


@compiled
def _steady(law: Any, now: Now, w: float, trim: float) -> Aim:
    """Steady walking as commanded, w the pendulum's rate (1/s), feet shifted sideways by `trim`."""
    coast = law.double_support
    duration = max(0.2, now.step_time - now.lead)
    single = max(_SHORTEST_SINGLE, duration - coast)
    tanh_half = math.tanh(0.5 * w * single) / w
    coth_half = 1.0 / (w * w * tanh_half)
    slope = coast + 1.0 / (w * math.tanh(w * single))
    width = now.side * 2.0 * (HIP_Y + law.foot_spread + now.spread)
    travel = duration / (coast + 2.0 * tanh_half)
    vx, vy = now.commanded_vx * travel, now.commanded_vy * travel
    sway = width / (coast + 2.0 * coth_half)
    return Aim(
        vx * (coast + tanh_half) + now.offset_x,
        vy * (coast + tanh_half) + sway * (coast + coth_half) + now.offset_y + trim,
        vx,
        vy + sway,
        law.map_gain * slope,
        law.map_loss_x,
        law.map_loss_y,
    )
