"""Leg-angle adjustment: where and when the swing foot lands, so that the robot keeps its speed.

`PendulumPlacement` predicts with a pendulum; the paper's own law is `paper_placement`. Both give
the swing leg at the end of the step; the walking controller fades it in over the step.
"""

from __future__ import annotations

import math

from cassie_control.controller.angular_momentum import AngularMomentum
from cassie_control.controller.config import WalkConfig
from cassie_control.controller.leg_aim import HIP_BACK, HIP_ROLL_X, aim_leg
from cassie_control.controller.paper_placement import PaperPlacement
from cassie_control.controller.pendulum import Aim, Reach, fallen, foot, touchdown_time
from cassie_control.controller.readings import HIP_TO_PELVIS, HIP_Y, LegReadings, Readings
from cassie_control.controller.step_ahead import (
    Placement,
    StepAhead,
    SwingEnd,
    Wish,
    pendulum_now,
)

_LONGEST = 0.95  # m, of a leg that is aimed
_SHORTEST = 0.5
_SHORTEST_SINGLE = 0.1  # s, of a step on one foot
_SUM_SPEED = 0.2  # m/s, error of a step's mean speed that counts at most


def placement(config: WalkConfig) -> Placement:
    """The law that the configuration names."""
    return PaperPlacement(config) if config.law == "paper" else PendulumPlacement(config)


class PendulumPlacement:
    """Foot placement by the step-to-step map of a pendulum of constant height.

    After a touchdown the weight goes over to the new foot within `double_support` (t), during
    which the CoM coasts; then it falls away from the stance toe joint for the rest of the step,
    T. With x, v the CoM's position and velocity against the toe joint and w = sqrt(g / height),
    the velocity at touchdown v_end follows from

        v' = w x sinh(w T) + v cosh(w T).

    A foot set down u ahead of the CoM turns that velocity, one step later, into

        v_next = v_end cosh(w T) - w (u - v_end t) sinh(w T).

    In steady walking at speed s, with L = s (t + T) of ground a step,
    v_steady = L / (t + 2/w tanh(w T / 2)) and u_steady = v_steady (t + 1/w tanh(w T / 2)).
    Sideways the CoM also swings from foot to foot, W apart: the same with coth in the place of
    tanh and W in the place of L, towards the swing foot. The foot goes to

        u = u_steady + gain (v_end - v_steady) (t + coth(w T) / w) + sum,

    so that `gain` = 1 removes the error in one step; forward and backward walking have gains of
    their own. `sum` adds up the mean speed error of each step, bounded: it takes out what the
    pendulum leaves out. Large errors, as after a push, count for less.

    The foot stays within the swing leg's reach and apart from the stance foot. Where that bends
    the law, the step ends sooner or later, within `quickest_step` and `slowest_step`, at the time
    at which the foot comes nearest to what the law wants (`pendulum.touchdown_time`). The leg gets
    the length at which the foot meets the ground there, on the slope that the feet found.

    Assumes a stance foot that gives no torque and a CoM at constant height.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        self._momentum = AngularMomentum()
        self.reset()

    def reset(self) -> None:
        """Forget the sums."""
        self._sum_x = 0.0
        self._sum_y = 0.0

    def touchdown(
        self, mean_velocity: tuple[float, float], velocity: tuple[float, float], wish: Wish
    ) -> None:
        """Add the mean velocity's error to the sums. In m/s."""
        c = self.config
        self._sum_x = _summed(self._sum_x, c.integral_x, mean_velocity[0] - wish.vx, c)
        self._sum_y = _summed(self._sum_y, c.integral_y, mean_velocity[1] - wish.vy, c)

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        wish: Wish,
        ahead: StepAhead,
    ) -> SwingEnd:
        """Swing leg at touchdown; arguments as in `Placement.swing_end`."""
        c, com, tilt = self.config, readings.com, readings.tilt
        velocity = self._momentum.velocity(readings, stance)
        fall = pendulum_now(readings, stance, ahead, c.double_support, velocity)
        side = swing.side
        hip_x = tilt[0, 0] * HIP_ROLL_X + tilt[0, 1] * side * HIP_Y
        hip_y = tilt[1, 1] * side * HIP_Y
        hip_z = tilt[2, 0] * HIP_ROLL_X + tilt[2, 1] * side * HIP_Y
        down = hip_z - stance.ankle[2] + ahead.rise
        reach = Reach(
            side,
            hip_x - HIP_BACK - com[0],
            hip_y - com[1],
            math.sqrt(max(0.01, (_LONGEST + HIP_TO_PELVIS) ** 2 - down * down)),
            c.reach_inward,
            c.reach_outward,
            c.least_foot_distance,
        )
        aim = self._aim(wish, ahead, side, fall.rate, math.sin(wish.roll_trim) * down)
        lead = c.contact_lead
        remaining = lead + touchdown_time(
            fall,
            aim,
            reach,
            max(0.0, ahead.remaining - lead),
            max(0.0, ahead.earliest - lead),
            max(0.0, self._latest(ahead) - lead),
        )
        end = fallen(fall, remaining - lead)
        ux, uy, _ = foot(aim, reach, end)
        # The stance leg tilts: the hip sinks as the CoM leaves the foot behind.
        sinking = (
            (1.0 - c.level) * (end[0] ** 2 + end[1] ** 2 - fall.x**2 - fall.y**2) / (2.0 * down)
        )
        rise = ahead.slope[0] * (end[0] + ux) + ahead.slope[1] * (end[1] + uy)
        roll, pitch, length = aim_leg(
            com[0] + ux - hip_x,
            com[1] + uy - hip_y,
            down - max(-0.1, min(0.1, sinking)) - rise,
            ahead.yaw,
            readings.pitch,
        )
        length = max(_SHORTEST, min(_LONGEST, length + c.landing_depth))
        return SwingEnd(pitch + wish.pitch_trim, roll, length, remaining, lead)

    def _latest(self, ahead: StepAhead) -> float:
        slowest = self.config.slowest_step * ahead.step_time
        return max(ahead.remaining, slowest - ahead.elapsed)

    def _aim(self, wish: Wish, ahead: StepAhead, side: float, w: float, trim: float) -> Aim:
        c = self.config
        coast = c.double_support
        duration = max(0.2, ahead.step_time - c.contact_lead)
        single = max(_SHORTEST_SINGLE, duration - coast)
        tanh_half = math.tanh(0.5 * w * single) / w
        coth_half = 1.0 / (w * w * tanh_half)
        slope = coast + 1.0 / (w * math.tanh(w * single))
        width = side * 2.0 * (HIP_Y + c.foot_spread + wish.spread)
        travel = duration / (coast + 2.0 * tanh_half)
        vx, vy = wish.vx * travel, wish.vy * travel
        sway = width / (coast + 2.0 * coth_half)
        return Aim(
            vx * (coast + tanh_half) + self._sum_x,
            vy * (coast + tanh_half) + sway * (coast + coth_half) + self._sum_y + trim,
            vx,
            vy + sway,
            c.pendulum_gain_x * slope,
            c.pendulum_gain_back * slope,
            c.pendulum_gain_y * slope,
        )


def _summed(total: float, gain: float, error: float, c: WalkConfig) -> float:
    """A sum, in m, with the error of a step's mean speed (m/s) added."""
    error = max(-_SUM_SPEED, min(_SUM_SPEED, error))
    return max(-c.integral_limit, min(c.integral_limit, total + gain * error))
