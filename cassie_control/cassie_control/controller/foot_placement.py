"""Leg-angle adjustment: where the swing foot lands, so that the robot keeps its speed.

Two laws with one interface: `PendulumPlacement` predicts with a pendulum, `PaperPlacement` is the
paper's own. Both give the swing leg's pitch and roll at the end of the step; the walking
controller fades them in over the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cassie_control.controller.config import WalkConfig
from cassie_control.controller.readings import (
    HIP_TO_PELVIS,
    HIP_X,
    HIP_Y,
    LegReadings,
    Readings,
)

GRAVITY = 9.81


@dataclass
class Wish:
    """Commanded velocities in the heading frame. In m/s."""

    vx: float = 0.0
    vy: float = 0.0


@dataclass
class SwingEnd:
    """Pitch and roll of the swing leg at touchdown. In rad."""

    pitch: float
    roll: float


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

    so that `gain` = 1 removes the error in one step. `sum` adds up the mean speed error of each
    step, bounded: it takes out what the pendulum leaves out.

    Assumes a stance foot that gives no torque and a CoM at constant height.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget the sums."""
        self._sum_x = 0.0
        self._sum_y = 0.0

    def touchdown(self, mean_velocity: tuple[float, float], wish: Wish) -> None:
        """Take in the mean velocity of the last two steps. In m/s."""
        c = self.config
        bound = c.integral_limit
        self._sum_x += c.integral_x * (mean_velocity[0] - wish.vx)
        self._sum_y += c.integral_y * (mean_velocity[1] - wish.vy)
        self._sum_x = max(-bound, min(bound, self._sum_x))
        self._sum_y = max(-bound, min(bound, self._sum_y))

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        wish: Wish,
        elapsed: float,
        remaining: float,
        step_time: float,
        length: float,
    ) -> SwingEnd:
        """Leg angles at touchdown.

        Args:
            readings: The robot now.
            stance, swing: Its legs.
            wish: Commanded velocity.
            elapsed: Time since the last touchdown. In s.
            remaining: Time to the next one. In s.
            step_time: Duration of the next step. In s.
            length: Swing leg length at touchdown. In m.
        """
        c = self.config
        com = readings.com
        w = math.sqrt(GRAVITY / max(0.4, com[2] - stance.ankle[2]))
        coast = c.double_support
        coasting = min(max(0.0, coast - elapsed), remaining)
        sinh, cosh = math.sinh(w * (remaining - coasting)), math.cosh(w * (remaining - coasting))
        vx, vy = readings.com_velocity[0], readings.com_velocity[1]
        x = com[0] - stance.ankle[0] + vx * coasting
        y = com[1] - stance.ankle[1] + vy * coasting
        y_end = y * cosh + vy / w * sinh
        vx_end = w * x * sinh + vx * cosh
        vy_end = w * y * sinh + vy * cosh

        single = max(0.1, step_time - coast)
        slope = coast + 1.0 / (w * math.tanh(w * single))
        tanh_half = math.tanh(0.5 * w * single) / w
        coth_half = 1.0 / (w * w * tanh_half)
        width = swing.side * 2.0 * (HIP_Y + c.foot_spread)
        vx_steady = wish.vx * step_time / (coast + 2.0 * tanh_half)
        vy_travel = wish.vy * step_time / (coast + 2.0 * tanh_half)
        vy_swing = width / (coast + 2.0 * coth_half)
        ux = vx_steady * (coast + tanh_half) + self._sum_x
        ux += c.pendulum_gain_x * (vx_end - vx_steady) * slope
        uy = vy_travel * (coast + tanh_half) + vy_swing * (coast + coth_half) + self._sum_y
        uy += c.pendulum_gain_y * (vy_end - vy_travel - vy_swing) * slope

        # Feet must not cross: measure the sideways distance from the stance foot at touchdown.
        apart = swing.side * (y_end + uy)
        uy += swing.side * max(0.0, c.least_foot_distance - apart)
        return _leg_angles(readings, swing, ux, uy, length)


class PaperPlacement:
    """The paper's leg-angle adjustment.

    Added to the gait's swing leg angles: sagittal Kp (v - wish) + Kd (v - v at the last touchdown),
    lateral Kp v + Kd (v - v at the last touchdown), with v the filtered pelvis velocity.

    Source:
        Da et al. 2016, Eqs. (13) and (17), in the form that the authors run on Cassie. Unlike
        there, the commanded sideways velocity is subtracted from the lateral one.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget the last touchdown."""
        self._last = (0.0, 0.0)
        self.velocity = (0.0, 0.0)
        self.gait_end = (0.0, 0.0)

    def touchdown(self, mean_velocity: tuple[float, float], wish: Wish) -> None:
        """Remember the filtered velocity of this touchdown."""
        self._last = self.velocity

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        wish: Wish,
        elapsed: float,
        remaining: float,
        step_time: float,
        length: float,
    ) -> SwingEnd:
        """Leg angles at touchdown; arguments as in `PendulumPlacement.swing_end`."""
        c = self.config
        vx, vy = self.velocity
        pitch = c.paper_kp_x * (vx - wish.vx) + c.paper_kd_x * (vx - self._last[0])
        roll = c.paper_kp_y * (vy - wish.vy) + c.paper_kd_y * (vy - self._last[1])
        return SwingEnd(self.gait_end[0] + pitch, self.gait_end[1] + roll)


def _leg_angles(
    readings: Readings, swing: LegReadings, ux: float, uy: float, length: float
) -> SwingEnd:
    """Angles that put the swing toe joint at (ux, uy) from the CoM, heading frame."""
    from_hip_x = readings.com[0] + ux - HIP_X
    from_hip_y = readings.com[1] + uy - swing.hip_y
    pitch = math.asin(max(-0.6, min(0.6, from_hip_x / length)))
    roll = math.asin(max(-0.4, min(0.4, from_hip_y / (length + HIP_TO_PELVIS))))
    return SwingEnd(pitch, roll)
