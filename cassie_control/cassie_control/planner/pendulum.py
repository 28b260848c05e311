"""Where and when the swing foot comes down, by a walking pendulum of constant height.

Compiled; everything is in m, s and the heading frame, positions of the CoM from the stance toe
joint, u the swing foot's from the CoM at touchdown. `side` is 1 if the left leg swings, else -1.
`foot` says where it goes for a CoM that touches down with a velocity, and what it can reach.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_control.control.robot import HIP_BACK, HIP_DOWN, HIP_ROLL_X, HIP_Y, Robot, aim_leg
from cassie_control.planner.momentum import Masses, momentum_velocity
from cassie_control.planner.plan import Commanded, StepAhead
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Record, Records
from cassie_gaits.robot import GRAVITY

LEAST_GAIN = 0.3
"""Share of a gain that is left at any speed."""


class Aim(NamedTuple):
    """Foot placement as a law of the velocity at touchdown.

    Attributes:
        ux, uy: Of the swing foot from the CoM in steady walking.
        vx, vy: Velocity at touchdown in steady walking.
        gain_forward, gain_backward, gain_y: Of the error of that velocity, in place. In s.
        speed: Low-passed, ahead.
        fade: Share by which sagittal gains fall with speed. In 1/(m/s).
    """

    ux: float
    uy: float
    vx: float
    vy: float
    gain_forward: float
    gain_backward: float
    gain_y: float
    speed: float
    fade: float


class Reach(NamedTuple):
    """Where the swing foot can be set down.

    Attributes:
        side: Of the swing leg.
        hip_x, hip_y: Swing hip from the CoM.
        far: Greatest distance from the hip fore and aft.
        inward, outward: Greatest distance from the hip sideways.
        apart: Least sideways distance from the stance foot.
        easy: Distance from the CoM outward from which a step is rather made quicker.
        slippery: The same from which the ground may not bear a foot.
        far_share: Of the way beyond that, how much a foot still goes.
        far_most: By which it is held back at most; held back more, a speed to the side would grow
            from step to step.
    """

    side: float
    hip_x: float
    hip_y: float
    far: float
    inward: float
    outward: float
    apart: float
    easy: float
    slippery: float
    far_share: float
    far_most: float


@compiled
def foot(
    aim: Aim, reach: Reach, end: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Where the foot goes for a CoM that touches down as `end` says, kept within reach.

    Returns:
        u_x, u_y, and how far out of easy reach the law wanted it. In m.
    """
    _, y_end, vx, vy = end
    side, hip_x, hip_y, far, inward, outward, apart, easy, slippery, far_share, far_most = reach
    wanted_x = aim.ux + _sagittal_gain(aim, vx) * (vx - aim.vx)
    wanted_y = aim.uy + aim.gain_y * (vy - aim.vy)
    ux = hip_x + min(far, max(-far, wanted_x - hip_x))
    out = side * hip_y + min(outward, max(-inward, side * (wanted_y - hip_y)))
    held = out - min(far_most, (1.0 - far_share) * max(0.0, out - slippery))
    # Feet that would meet are worse than a foot out of the hip's reach.
    nearest = apart - side * y_end
    out = max(out, nearest)
    # The sooner a foot lands to catch a fall, the nearer: that needs less friction.
    missed = max(math.hypot(wanted_x - ux, wanted_y - side * out), out - easy)
    return ux, side * max(held, nearest), missed


@compiled
def _sagittal_gain(aim: Aim, vx: float) -> float:
    """Of the error of the velocity at touchdown, `vx`: less of it, the faster. In s."""
    forward = max(LEAST_GAIN, 1.0 - aim.fade * max(0.0, aim.speed, vx))
    # Walking backward steadily asks for no less; a push does.
    backward = max(LEAST_GAIN, 1.0 - aim.fade * max(0.0, min(0.0, aim.speed) - vx))
    back = backward * aim.gain_backward
    # From backward to forward gain over a stretch of velocity, so that the law is continuous.
    return back + min(1.0, max(0.0, 0.5 + vx / 0.4)) * (forward * aim.gain_forward - back)


class Law(Record):
    """What foot placement takes of `config.WalkConfig`, by the same names, and its sums.

    Attributes:
        sum_x, sum_y: Sums of the errors of steps' mean speeds. In m.
    """

    double_support: float
    slowest_step: float
    foot_spread: float
    pendulum_gain_x: float
    pendulum_gain_back: float
    pendulum_gain_y: float
    pendulum_fade_x: float
    pendulum_fade_y: float
    pendulum_gain_still: float
    still_speed: float
    sidestep: float
    step_ahead: float
    step_ahead_fast: float
    reach_inward: float
    reach_outward: float
    least_foot_distance: float
    level: float
    landing_depth: float
    easy_lean: float
    far_lean: float
    far_share: float
    far_most: float
    sum_x: float
    sum_y: float


_LONGEST = 0.95  # m, of a leg that is aimed
_SHORTEST = 0.5
_FAST_LEAN = 0.1  # s/m, by which both leans grow beyond 1 m/s, where feet land farther out
_SIDE_LEAN = 1.0  # s/m, by which `far_lean` grows beyond 0.1 m/s asked for to a side
_UNDER_WAY = 0.2  # m/s ahead or back that is asked for, from which `far_share` counts in full
_SHORTEST_SINGLE = 0.1  # s, of a step on one foot
_TIMES = 9  # touchdown times that are compared
_LATENESS = 0.02  # m^2/s^2, what a change of the step's time costs against a foot out of reach


class Now(NamedTuple):
    """What `landing` takes of the present.

    Attributes:
        com_x, com_y, com_z: CoM from the pelvis origin.
        ankle_x, ankle_y, ankle_z: Stance toe joint from there.
        velocity_x, velocity_y: Of the CoM, from the angular momentum about the stance toe joint.
        pitch: Of the torso. In rad.
        side: Of the swing leg.
        elapsed, remaining, earliest, step_time, speed, yaw, rise, slope_x, slope_y: `StepAhead`.
        lead: Time from the swing foot's first contact to the end of the step.
        commanded_vx, commanded_vy, spread, roll_trim: `Commanded`.
        sum_x, sum_y: Sums of the errors of steps' mean speeds.
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
    speed: float
    yaw: float
    rise: float
    slope_x: float
    slope_y: float
    lead: float
    commanded_vx: float
    commanded_vy: float
    spread: float
    roll_trim: float
    sum_x: float
    sum_y: float


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
    """Time to touchdown at which the foot that the law wants is nearest to within easy reach.

    Args:
        planned: Time to the gait's own touchdown, which is kept where it serves as well.
        earliest, latest: Bounds of the result.
    """
    best, least = planned, _cost(fall, aim, reach, planned, 0.0)
    if least < 1e-4 * _LATENESS:
        return planned
    for i in range(_TIMES):
        time = earliest + (latest - earliest) * i / (_TIMES - 1)
        cost = _cost(fall, aim, reach, time, time - planned)
        if cost < least:
            best, least = time, cost
    return best


@compiled
def _cost(fall: Fall, aim: Aim, reach: Reach, time: float, change: float) -> float:
    _, _, missed = foot(aim, reach, fallen(fall, time))
    return float(missed * missed + _LATENESS * change * change)


@compiled
def landing(
    laws: Records[Law],
    robots: Records[Robot],
    momenta: Records[Masses],
    swing: int,
    aheads: Records[StepAhead],
    commands: Records[Commanded],
    lead: float,
) -> tuple[float, float, float, float]:
    """Swing leg at touchdown, by the law of `PendulumPlacement`.

    Args:
        laws, robots, momenta, aheads, commands: What it is to know. Shape (1,).
        swing: Number of the swing leg.
        lead: Time from the swing foot's first contact to the end of the step. In s.

    Returns:
        Roll and pitch in rad, length in m, time to touchdown in s.
    """
    law, robot, ahead, commanded = laws[0], robots[0], aheads[0], commands[0]
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
        ahead.elapsed,
        ahead.remaining,
        ahead.earliest,
        ahead.step_time,
        ahead.velocity[0],
        ahead.yaw,
        ahead.rise,
        ahead.slope[0],
        ahead.slope[1],
        lead,
        commanded.vx,
        commanded.vy,
        commanded.spread,
        commanded.roll_trim,
        law.sum_x,
        law.sum_y,
    )
    return _land(law, now, robot.tilt)


@compiled
def _land(law: Law, now: Now, tilt: FloatArray) -> tuple[float, float, float, float]:
    """See `landing`; `tilt` (3, 3) leads from the pelvis to the heading frame."""
    side, lead = now.side, now.lead
    fall, above = _falling(law, now)
    hip_x = tilt[0, 0] * HIP_ROLL_X + tilt[0, 1] * side * HIP_Y
    hip_y = tilt[1, 1] * side * HIP_Y
    down = tilt[2, 0] * HIP_ROLL_X + tilt[2, 1] * side * HIP_Y - now.ankle_z + now.rise
    faster = _FAST_LEAN * max(0.0, abs(now.speed) - 1.0)
    aside = _SIDE_LEAN * max(0.0, abs(now.commanded_vy) - 0.1)
    reach = Reach(
        side,
        hip_x - HIP_BACK - now.com_x,
        hip_y - now.com_y,
        math.sqrt(max(0.01, (_LONGEST + HIP_DOWN) ** 2 - down * down)),
        law.reach_inward,
        law.reach_outward,
        law.least_foot_distance,
        above * (law.easy_lean + faster),
        above * (law.far_lean + faster + aside),
        1.0 - (1.0 - law.far_share) * min(1.0, abs(now.commanded_vx) / _UNDER_WAY),
        law.far_most,
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
def _falling(law: Law, now: Now) -> tuple[Fall, float]:
    """The pendulum as it is, and its CoM's height above the foot along the slope (m)."""
    x, y, height = now.com_x - now.ankle_x, now.com_y - now.ankle_y, now.com_z - now.ankle_z
    # Along a slope the CoM travels in a plane parallel to it, at this height above the foot.
    above = max(0.4, height - now.slope_x * x - now.slope_y * y)
    faster = max(0.4, height) / above
    coasts = max(0.0, law.double_support - now.elapsed)
    rate = math.sqrt(GRAVITY / above)
    return Fall(x, y, faster * now.velocity_x, faster * now.velocity_y, rate, coasts), above


@compiled
def _steady(law: Law, now: Now, w: float, trim: float) -> Aim:
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
    asked = math.hypot(now.commanded_vx, now.commanded_vy) / law.still_speed
    moving = abs(now.velocity_x) / law.still_speed
    more_y = law.pendulum_gain_still * max(0.0, 1.0 - asked)
    more_x = min(more_y, law.pendulum_gain_still * max(0.0, 1.0 - moving))
    share_y = max(LEAST_GAIN, 1.0 - law.pendulum_fade_y * max(0.0, now.speed))
    ahead = law.step_ahead - law.step_ahead_fast * abs(now.commanded_vx)
    return Aim(
        vx * (coast + tanh_half) + ahead * now.commanded_vx + now.sum_x,
        vy * (coast + tanh_half)
        + law.sidestep * now.commanded_vy
        + sway * (coast + coth_half)
        + now.sum_y
        + trim,
        vx,
        vy + sway,
        (law.pendulum_gain_x + more_x) * slope,
        (law.pendulum_gain_back + more_x) * slope,
        share_y * (law.pendulum_gain_y + more_y) * slope,
        now.speed,
        law.pendulum_fade_x,
    )
