"""Where and when the swing foot lands, by a walking pendulum of constant height.

Compiled. Units are m and s, the frame is the heading frame. Positions of the CoM are relative to
the stance toe joint; u is the swing foot's position relative to the CoM at touchdown. `side` is 1
if the left leg swings, else -1. `foot` is the law: the foothold for a CoM's state at touchdown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_control.control.robot import HIP_BACK, HIP_DOWN, HIP_ROLL_X, HIP_Y, Robot, aim_leg
from cassie_control.planner.momentum import Masses, momentum_velocity
from cassie_control.planner.plan import Commanded, StepAhead
from cassie_gaits.compiled import compiled
from cassie_gaits.records import Record, Records
from cassie_gaits.robot import GRAVITY


class Aim(NamedTuple):
    """Foot placement as a law of the velocity at touchdown.

    Attributes:
        ux, uy: Position of the swing foot relative to the CoM in steady walking.
        vx, vy: Velocity at touchdown in steady walking.
        gain_x, gain_y: Gain on the error of the velocity at touchdown, in place. In s.
        loss_x, loss_y: Decrease of the gains with the forward velocity. In s/m.
    """

    ux: float
    uy: float
    vx: float
    vy: float
    gain_x: float
    gain_y: float
    loss_x: float
    loss_y: float


class Reach(NamedTuple):
    """Where the swing foot can be set down.

    Attributes:
        side: 1 if the left leg swings, else -1.
        hip_x, hip_y: Swing hip relative to the CoM.
        far: Largest distance from the hip, forward and backward.
        inward, outward: Largest distance from the hip sideways.
        apart: Least sideways distance from the stance foot.
        cone: Outward distance from the CoM up to which a foot is within the friction cone.
    """

    side: float
    hip_x: float
    hip_y: float
    far: float
    inward: float
    outward: float
    apart: float
    cone: float


@compiled
def foot(
    aim: Aim, reach: Reach, end: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Foothold for a CoM with the state `end` (x, y, vx, vy) at touchdown, kept within reach.

    Returns:
        u_x, u_y, and the larger of two distances: to the law's foothold before it was kept within
        reach, or beyond the friction cone. In m.
    """
    _, y_end, vx, vy = end
    side = reach.side
    wanted_x = aim.ux + _gain(aim.gain_x, aim.loss_x, vx) * (vx - aim.vx)
    wanted_y = aim.uy + _gain(aim.gain_y, aim.loss_y, vx) * (vy - aim.vy)
    ux = reach.hip_x + min(reach.far, max(-reach.far, wanted_x - reach.hip_x))
    out = min(reach.outward, max(-reach.inward, side * (wanted_y - reach.hip_y)))
    # Feet that would meet are worse than a foot out of the hip's reach.
    out = max(side * reach.hip_y + out, reach.apart - side * y_end)
    missed = math.hypot(wanted_x - ux, wanted_y - side * out)
    return ux, side * out, max(missed, out - reach.cone)


@compiled
def _gain(in_place: float, loss: float, vx: float) -> float:
    """a / b of the step-to-step map at a touchdown velocity `vx`, from its value in place. In s."""
    return in_place / (1.0 + loss * abs(vx))


class Law(Record):
    """Fields of `config.WalkConfig` for foot placement, and the observer's state.

    Attributes:
        offset_x, offset_y: Offset of the foot from the disturbance observer. In m.
    """

    double_support: float
    slowest_step: float
    foot_spread: float
    map_gain_x: float
    map_gain_y: float
    map_loss_x: float
    map_loss_y: float
    reach_inward: float
    reach_outward: float
    least_foot_distance: float
    friction: float
    landing_depth: float
    offset_x: float
    offset_y: float


# Polynomial in v, rising powers: how far the robot's foothold lies ahead of the pendulum's in
# steady walking at v. Fitted to the disturbance observer's offset of robots 1 to 6 at 14 speeds,
# within 5 mm. In m, v in m/s.
_AHEAD = (-0.0018, 0.0227, -0.0223, -0.0054)
_SLOWEST, _FASTEST = -1.0, 1.8  # m/s, range of these speeds
_LONGEST = 0.95  # m, largest leg length for a foothold
_SHORTEST = 0.5
_SHORTEST_SINGLE = 0.1  # s, least duration of single support
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_TIME_TOLERANCE = 2e-3  # s, of the touchdown time that is searched: one control period
_LATENESS = 0.02  # m^2/s^2, weight of the step time's change against a foot out of reach


class Fall(NamedTuple):
    """A CoM at constant velocity for a while, which then falls away from the stance foot.

    Attributes:
        x, y, vx, vy: Position and velocity now.
        rate: w = sqrt(g / height). In 1/s.
        coasting: Remaining time at constant velocity.
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
    """Time to touchdown at which the law's foothold is in reach, or nearest to it.

    Args:
        fall, aim, reach: State of the CoM, the law, and where a foot can be set down.
        planned: Time to the gait's own touchdown, which is kept if its foothold is in reach.
        earliest, latest: Bounds of the result.
    """
    if _cost(fall, aim, reach, planned, 0.0) < 1e-4 * _LATENESS:
        return planned
    # Golden section search: the cost is a squared distance to a box plus a squared delay.
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
        laws, robots, momenta, aheads, commands: Law, robot, masses, step, commands. Shape (1,).
        swing: Number of the swing leg.
        lead: Time from the swing foot's first contact to the end of the step. In s.

    Returns:
        Roll and pitch in rad, length in m, time to touchdown in s.
    """
    law, robot, ahead, commanded = laws[0], robots[0], aheads[0], commands[0]
    side, tilt, com = 1.0 - 2.0 * swing, robot.tilt, robot.com
    fall = _falling(law, robot, 1 - swing, momentum_velocity(robots, 1 - swing, momenta), ahead)
    hip_x = tilt[0, 0] * HIP_ROLL_X + tilt[0, 1] * side * HIP_Y
    hip_y = tilt[1, 1] * side * HIP_Y
    down = tilt[2, 0] * HIP_ROLL_X + tilt[2, 1] * side * HIP_Y
    down = down - robot.ankle[1 - swing, 2] + ahead.rise
    reach = Reach(
        side,
        hip_x - HIP_BACK - com[0],
        hip_y - com[1],
        math.sqrt(max(0.01, (_LONGEST + HIP_DOWN) ** 2 - down * down)),
        law.reach_inward,
        law.reach_outward,
        law.least_foot_distance,
        law.friction * GRAVITY / (fall.rate * fall.rate),
    )
    aim = _steady(law, ahead.step_time - lead, commanded, side, fall.rate)
    trim = math.sin(commanded.roll_trim) * down
    aim = Aim(aim.ux, aim.uy + trim, aim.vx, aim.vy, aim.gain_x, aim.gain_y, aim.loss_x, aim.loss_y)
    latest = max(ahead.remaining, law.slowest_step * ahead.step_time - ahead.elapsed)
    time = touchdown_time(
        fall,
        aim,
        reach,
        max(0.0, ahead.remaining - lead),
        max(0.0, ahead.earliest - lead),
        max(0.0, latest - lead),
    )
    end = fallen(fall, time)
    ux, uy, _ = foot(aim, reach, end)
    rise = ahead.slope[0] * (fall.x + ux) + ahead.slope[1] * (fall.y + uy)
    roll, pitch, length = aim_leg(
        com[0] + ux - hip_x,
        com[1] + uy - hip_y,
        down - rise,
        ahead.yaw,
        robot.pitch,
    )
    # From the first contact to the end of the step the hips move on along the slope.
    climbed = lead * (ahead.slope[0] * end[2] + ahead.slope[1] * end[3])
    length += law.landing_depth + climbed
    return roll, pitch, max(_SHORTEST, min(_LONGEST, length)), lead + time


@compiled
def _falling(
    law: Law, robot: Robot, stance: int, velocity: tuple[float, float], ahead: StepAhead
) -> Fall:
    """Present state of the pendulum; its height is measured from the slope through the foot."""
    x, y = robot.com[0] - robot.ankle[stance, 0], robot.com[1] - robot.ankle[stance, 1]
    height = robot.com[2] - robot.ankle[stance, 2]
    # Along a slope the CoM moves in a plane parallel to it, at this height above the foot.
    above = max(0.4, height - ahead.slope[0] * x - ahead.slope[1] * y)
    faster = max(0.4, height) / above
    coasts = max(0.0, law.double_support - ahead.elapsed)
    return Fall(
        x, y, faster * velocity[0], faster * velocity[1], math.sqrt(GRAVITY / above), coasts
    )


@compiled
def ahead_of_pendulum(speed: float) -> float:
    """Distance, in m, of the robot's foothold ahead of the pendulum's, at a steady speed (m/s)."""
    v = max(_SLOWEST, min(_FASTEST, speed))
    return _AHEAD[0] + v * (_AHEAD[1] + v * (_AHEAD[2] + v * _AHEAD[3]))


@compiled
def _steady(law: Law, duration: float, commanded: Commanded, side: float, w: float) -> Aim:
    """Law for steady walking as commanded: step duration in s, w the pendulum's rate (1/s)."""
    coast, duration = law.double_support, max(0.2, duration)
    single = max(_SHORTEST_SINGLE, duration - coast)
    tanh_half = math.tanh(0.5 * w * single) / w
    coth_half = 1.0 / (w * w * tanh_half)
    slope = coast + 1.0 / (w * math.tanh(w * single))
    width = side * 2.0 * (HIP_Y + law.foot_spread + commanded.spread)
    travel = duration / (coast + 2.0 * tanh_half)
    vx, vy = commanded.vx * travel, commanded.vy * travel
    sway = width / (coast + 2.0 * coth_half)
    # Difference of the next touchdown's velocity in the present and in the next heading.
    turn = commanded.turn_rate * duration
    push = w * math.sinh(w * single)
    turned_x = -turn * (vy - sway) * _gain(law.map_gain_x, law.map_loss_x, vx) / push
    turned_y = turn * vx * _gain(law.map_gain_y, law.map_loss_y, vx) / push
    ahead = ahead_of_pendulum(commanded.vx) + law.offset_x
    return Aim(
        vx * (coast + tanh_half) - turned_x + ahead,
        vy * (coast + tanh_half) + sway * (coast + coth_half) - turned_y + law.offset_y,
        vx,
        vy + sway,
        law.map_gain_x * slope,
        law.map_gain_y * slope,
        law.map_loss_x,
        law.map_loss_y,
    )
