"""Where and when the swing foot lands, by a walking pendulum of constant height.

Compiled. Units are m and s, the frame is the heading frame. Positions of the CoM are relative to
the stance toe joint; u is the swing foot's position relative to the CoM at touchdown. `side` is 1
if the left leg swings, else -1. `foothold` is the law: u for a CoM's state at touchdown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_control.control.outputs import AT_END, LENGTH_ST, Step
from cassie_control.control.robot import (
    HIP_BACK,
    HIP_DOWN,
    HIP_ROLL_X,
    HIP_Y,
    MAX_LEG_LENGTH,
    MIN_LEVER,
    Robot,
    aim_leg,
    pendulum_height,
)
from cassie_control.planner.momentum import Masses, momentum_velocity
from cassie_control.planner.placement import Commanded, SwingTarget
from cassie_control.planner.terrain import GroundSlope
from cassie_control.planner.timing import StepTiming, time_to_planned_touchdown
from cassie_gaits.bezier import fade
from cassie_gaits.compiled import compiled
from cassie_gaits.records import Record, Records
from cassie_gaits.robot import GRAVITY
from cassie_gaits.vectors import Vector, turned


class FootholdLaw(NamedTuple):
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
        max_x: Largest distance from the hip, forward and backward.
        max_inward, max_outward: Largest distance from the hip sideways.
        min_foot_distance: Least sideways distance from the stance foot.
        friction_cone: Outward distance from the CoM up to which a foot is within the friction cone.
    """

    side: float
    hip_x: float
    hip_y: float
    max_x: float
    max_inward: float
    max_outward: float
    min_foot_distance: float
    friction_cone: float


class ComState(NamedTuple):
    """Position (m) and velocity (m/s) of the CoM."""

    x: float
    y: float
    vx: float
    vy: float


class Foothold(NamedTuple):
    """Where the swing foot lands, relative to the CoM.

    Attributes:
        x, y: Forward and to the left. In m.
        violation: The larger of two distances: to the law's foothold before it was kept within
            reach, or beyond the friction cone. In m.
    """

    x: float
    y: float
    violation: float


@compiled
def foothold(law: FootholdLaw, reach: Reach, touchdown: ComState) -> Foothold:
    """Foothold for a CoM's state at touchdown, kept within reach.

    Args:
        law: Coefficients of the law for the commanded velocity.
        reach: Where the foot can be set down.
        touchdown: State of the CoM at the swing foot's first contact.

    Source:
        Equations of `footstep.PendulumPlacement`.
    """
    _, y, vx, vy = touchdown
    side = reach.side
    law_x = law.ux + _map_gain(law.gain_x, law.loss_x, vx) * (vx - law.vx)
    law_y = law.uy + _map_gain(law.gain_y, law.loss_y, vx) * (vy - law.vy)
    ux = reach.hip_x + min(reach.max_x, max(-reach.max_x, law_x - reach.hip_x))
    outward = min(reach.max_outward, max(-reach.max_inward, side * (law_y - reach.hip_y)))
    # Feet that would meet are worse than a foot out of the hip's reach.
    outward = max(side * reach.hip_y + outward, reach.min_foot_distance - side * y)
    distance = math.hypot(law_x - ux, law_y - side * outward)
    return Foothold(ux, side * outward, max(distance, outward - reach.friction_cone))


@compiled
def _map_gain(in_place: float, loss: float, vx: float) -> float:
    """a / b of the step-to-step map at a touchdown velocity `vx`, from its value in place. In s."""
    return in_place / (1.0 + loss * abs(vx))


class PlacementGains(Record):
    """Fields of `config.WalkConfig` for foot placement, and the observer's state.

    Attributes:
        offset_x, offset_y: Offset of the foot from the disturbance observer. In m.
    """

    double_support: float
    quickest_step: float
    swing_time: float
    slowest_step: float
    contact_lead: float
    contact_lead_speed: float
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
_FOOTHOLD_OFFSET = (-0.0018, 0.0227, -0.0223, -0.0054)
_MIN_FITTED_SPEED, _MAX_FITTED_SPEED = -1.0, 1.8  # m/s
_MAX_LEAD_SPEED = 1.5  # m/s forward or backward, saturation of `contact_lead_speed`
_MIN_LEG_LENGTH = 0.5  # m, of the leg at touchdown
_MIN_REACH = 0.1  # m, from the hip, forward and backward
_MIN_STEP_TIME = 0.2  # s, shortest step, less the contact lead, of the steady gait
_MIN_SINGLE_SUPPORT = 0.1  # s, shortest single support of the steady gait
_GOLDEN_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)
_TIME_TOLERANCE = 2e-3  # s, of the touchdown time; the phase's rate follows it within 20 ms
_TIME_WEIGHT = 0.2  # m^2/s^2, weight of the step time's change against a foot out of reach
_TOLERATED_COST = 1e-4 * _TIME_WEIGHT  # m^2: a foot out of reach by 4.5 mm keeps the step's time


class PendulumState(NamedTuple):
    """A CoM at constant velocity for the rest of double support, and then an inverted pendulum.

    Attributes:
        x, y, vx, vy: Position and velocity now.
        rate: w = sqrt(g / height). In 1/s.
        double_support: Remaining time at constant velocity.
    """

    x: float
    y: float
    vx: float
    vy: float
    rate: float
    double_support: float


@compiled
def predict_com(state: PendulumState, remaining: float) -> ComState:
    """State of the CoM after a time (s): it coasts in double support, and then falls.

    Source:
        Linear inverted pendulum: Kajita et al., ICRA 2001.
    """
    x, y, vx, vy, w, double_support = state
    double_support = min(double_support, remaining)
    single_support = remaining - double_support
    sinh, cosh = math.sinh(w * single_support), math.cosh(w * single_support)
    x += vx * double_support
    y += vy * double_support
    return ComState(
        x * cosh + vx / w * sinh,
        y * cosh + vy / w * sinh,
        w * x * sinh + vx * cosh,
        w * y * sinh + vy * cosh,
    )


@compiled
def contact_time(
    state: PendulumState,
    law: FootholdLaw,
    reach: Reach,
    planned: float,
    earliest: float,
    latest: float,
) -> float:
    """Time to the swing foot's first contact at which reach and friction cone are violated least.

    Args:
        state, law, reach: State of the CoM, the law, and where a foot can be set down.
        planned: Time to first contact by the gait, which is kept, whatever the bounds, while its
            foothold violates neither by more than 4.5 mm.
        earliest, latest: Bounds of the result.
    """
    if _cost(state, law, reach, planned, 0.0) < _TOLERATED_COST:
        return planned
    # Golden-section search: the cost is the squared violation plus a squared change of time.
    low, high = min(earliest, latest), latest
    left, right = high - _GOLDEN_RATIO * (high - low), low + _GOLDEN_RATIO * (high - low)
    cost_left = _cost(state, law, reach, left, left - planned)
    cost_right = _cost(state, law, reach, right, right - planned)
    while high - low > _TIME_TOLERANCE:
        if cost_left < cost_right:
            high, right, cost_right = right, left, cost_left
            left = high - _GOLDEN_RATIO * (high - low)
            cost_left = _cost(state, law, reach, left, left - planned)
        else:
            low, left, cost_left = left, right, cost_right
            right = low + _GOLDEN_RATIO * (high - low)
            cost_right = _cost(state, law, reach, right, right - planned)
    return 0.5 * (low + high)


@compiled
def _cost(
    state: PendulumState, law: FootholdLaw, reach: Reach, time: float, change: float
) -> float:
    _, _, violation = foothold(law, reach, predict_com(state, time))
    return float(violation * violation + _TIME_WEIGHT * change * change)


@compiled
def plan_landing(
    all_gains: Records[PlacementGains],
    robots: Records[Robot],
    all_masses: Records[Masses],
    timings: Records[StepTiming],
    slopes: Records[GroundSlope],
    steps: Records[Step],
    commands: Records[Commanded],
) -> SwingTarget:
    """Swing leg at touchdown, by the law of `PendulumPlacement`.

    Args:
        all_gains, robots, all_masses, timings, slopes, commands: Gains, robot, masses, phase,
            ground and commands. Shape (1,).
        steps: The step, with the gait at this phase. Shape (1,).
    """
    gains, robot, timing, slope = all_gains[0], robots[0], timings[0], slopes[0]
    step, commanded, stance = steps[0], commands[0], timing.stance
    side, com = 1.0 - 2.0 * (1 - stance), robot.com
    velocity = momentum_velocity(robots, stance, all_masses)
    state = _pendulum_state(gains, robot, timing, slope, velocity)
    hip = turned(robot.R_HP, (HIP_ROLL_X, side * HIP_Y, 0.0))
    hip_height = hip[2] - robot.toe_joint[stance, 2] + _hip_rise(timing, slope, step)
    reach = _reach(gains, robot, side, hip, hip_height, state.rate)
    contact_lead = _contact_lead(gains, timing.velocity[0])
    trim_y = math.sin(commanded.roll_trim) * hip_height
    law = _foothold_law(gains, timing.step_time - contact_lead, commanded, side, state.rate, trim_y)
    planned = time_to_planned_touchdown(timing)
    latest = max(planned, gains.slowest_step * timing.step_time - timing.elapsed)
    time = contact_time(
        state,
        law,
        reach,
        max(0.0, planned - contact_lead),
        _earliest_contact(gains, robot, timing, state, law, reach, contact_lead),
        max(0.0, latest - contact_lead),
    )
    touchdown = predict_com(state, time)
    ux, uy, _ = foothold(law, reach, touchdown)
    ground_rise = slope.ahead * (state.x + ux) + slope.left * (state.y + uy)
    roll, pitch, length = aim_leg(
        com[0] + ux - hip[0],
        com[1] + uy - hip[1],
        hip_height - ground_rise,
        step.landing_yaw,
        robot.pitch,
    )
    # From the first contact to the end of the step the hips move on along the slope.
    climb = contact_lead * (slope.ahead * touchdown.vx + slope.left * touchdown.vy)
    length += gains.landing_depth + climb
    length = max(_MIN_LEG_LENGTH, min(MAX_LEG_LENGTH, length))
    pitch += commanded.pitch_trim
    return SwingTarget(pitch, roll, length, contact_lead + time, contact_lead)


@compiled
def _reach(
    gains: PlacementGains, robot: Robot, side: float, hip: Vector, hip_height: float, w: float
) -> Reach:
    """Where the swing foot can be set down.

    Args:
        gains: Gains of foot placement.
        robot: The robot now.
        side: 1 if the left leg swings, else -1.
        hip: Hip roll joint of the swing leg from the pelvis origin, heading frame. In m.
        hip_height: Its height above the ground at touchdown. In m.
        w: Rate of the pendulum. In 1/s.
    """
    longest = MAX_LEG_LENGTH + HIP_DOWN
    return Reach(
        side,
        hip[0] - HIP_BACK - robot.com[0],
        hip[1] - robot.com[1],
        max(_MIN_REACH, math.sqrt(max(0.0, longest * longest - hip_height * hip_height))),
        gains.reach_inward,
        gains.reach_outward,
        gains.least_foot_distance,
        gains.friction * GRAVITY / (w * w),
    )


@compiled
def _earliest_contact(
    gains: PlacementGains,
    robot: Robot,
    timing: StepTiming,
    state: PendulumState,
    law: FootholdLaw,
    reach: Reach,
    contact_lead: float,
) -> float:
    """Time to the swing foot's first contact at the soonest, in s.

    The rest of `quickest_step`, and `swing_time` for each metre that the foot still has to go: a
    leg that is swung faster lifts the stance foot off the ground.
    """
    rest = max(0.0, 1.0 - timing.phase) * gains.quickest_step
    ux, uy, _ = foothold(law, reach, predict_com(state, max(0.0, rest - contact_lead)))
    com, swing_foot = robot.com, robot.toe_joint[1 - timing.stance]
    way = math.hypot(com[0] + ux - swing_foot[0], com[1] + uy - swing_foot[1])
    earliest: float = max(0.0, rest + gains.swing_time * way - contact_lead)
    return earliest


@compiled
def _contact_lead(gains: PlacementGains, speed: float) -> float:
    """Time from the swing foot's first contact to the end of the step, in s."""
    lead: float = gains.contact_lead + gains.contact_lead_speed * min(_MAX_LEAD_SPEED, abs(speed))
    return lead


@compiled
def _hip_rise(timing: StepTiming, slope: GroundSlope, step: Step) -> float:
    """By how much the hip will be higher over the next foothold than now over the stance foot.

    The gait's stance leg grows until touchdown, and its foot sinks. The ground around that foot is
    lower than the foot, as far as the hip has not compensated for that yet.

    Returns:
        In m.
    """
    stance_extension = step.gait[LENGTH_ST, AT_END] - step.desired[LENGTH_ST]
    compensated = fade(min(1.0, timing.phase)) * slope.foothold_height
    rise: float = stance_extension - slope.sinkage + compensated
    return rise


@compiled
def _pendulum_state(
    gains: PlacementGains,
    robot: Robot,
    timing: StepTiming,
    slope: GroundSlope,
    velocity: tuple[float, float],
) -> PendulumState:
    """Present state of the pendulum; its height is measured from the slope through the foot."""
    stance = timing.stance
    x, y = robot.com[0] - robot.toe_joint[stance, 0], robot.com[1] - robot.toe_joint[stance, 1]
    # Along a slope the CoM moves in a plane parallel to it, at this height above the foot.
    plane_height = robot.com[2] - robot.toe_joint[stance, 2] - slope.ahead * x - slope.left * y
    plane_height = max(MIN_LEVER, plane_height)
    # `momentum_velocity` is L / (m height above the foot), here v is that over the plane.
    scale = pendulum_height(robot, stance) / plane_height
    double_support = max(0.0, gains.double_support - timing.elapsed)
    return PendulumState(
        x,
        y,
        scale * velocity[0],
        scale * velocity[1],
        math.sqrt(GRAVITY / plane_height),
        double_support,
    )


@compiled
def ahead_of_pendulum(speed: float) -> float:
    """Distance, in m, of the robot's foothold ahead of the pendulum's, at a steady speed (m/s)."""
    v = max(_MIN_FITTED_SPEED, min(_MAX_FITTED_SPEED, speed))
    c = _FOOTHOLD_OFFSET
    return c[0] + v * (c[1] + v * (c[2] + v * c[3]))


@compiled
def _foothold_law(
    gains: PlacementGains,
    step_time: float,
    commanded: Commanded,
    side: float,
    w: float,
    trim_y: float,
) -> FootholdLaw:
    """Law for steady walking as commanded.

    Args:
        gains: Gains of foot placement.
        step_time: Duration of a step less the contact lead. In s.
        commanded: Commands for the steps.
        side: 1 if the left leg swings, else -1.
        w: Rate of the pendulum. In 1/s.
        trim_y: Added to the foothold, to the left. In m.

    Source:
        Equations of `footstep.PendulumPlacement`.
    """
    double_support, step_time = gains.double_support, max(_MIN_STEP_TIME, step_time)
    single_support = max(_MIN_SINGLE_SUPPORT, step_time - double_support)
    tanh_half = math.tanh(0.5 * w * single_support) / w
    coth_half = 1.0 / (w * w * tanh_half)
    pendulum_gain = double_support + 1.0 / (w * math.tanh(w * single_support))
    step_width = side * 2.0 * (HIP_Y + gains.foot_spread)
    # Velocity at touchdown over the mean velocity of the step.
    ratio = step_time / (double_support + 2.0 * tanh_half)
    vx, vy = commanded.vx * ratio, commanded.vy * ratio
    sway = step_width / (double_support + 2.0 * coth_half)
    # Difference of the next touchdown's velocity in the present and in the next heading.
    turn = commanded.yaw_rate * step_time
    map_b = w * math.sinh(w * single_support)
    turn_x = -turn * (vy - sway) * _map_gain(gains.map_gain_x, gains.map_loss_x, vx) / map_b
    turn_y = turn * vx * _map_gain(gains.map_gain_y, gains.map_loss_y, vx) / map_b
    offset_x = ahead_of_pendulum(commanded.vx) + gains.offset_x
    sway_y = sway * (double_support + coth_half)
    return FootholdLaw(
        vx * (double_support + tanh_half) - turn_x + offset_x,
        vy * (double_support + tanh_half) + sway_y - turn_y + gains.offset_y + trim_y,
        vx,
        vy + sway,
        gains.map_gain_x * pendulum_gain,
        gains.map_gain_y * pendulum_gain,
        gains.map_loss_x,
        gains.map_loss_y,
    )
