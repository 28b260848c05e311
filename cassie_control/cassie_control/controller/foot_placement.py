"""Leg-angle adjustment: where the swing foot lands, so that the robot keeps its speed.

Two laws with one interface: `PendulumPlacement` predicts with a pendulum, `PaperPlacement` is the
paper's own. Both give the swing leg's pitch and roll at the end of the step; the walking
controller fades them in over the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

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
    """What the operator wants of the steps.

    Attributes:
        vx, vy: Velocity, forward and to the left. In m/s.
        pitch_trim, roll_trim: Added to the swing leg's angles at touchdown. In rad.
        spread: How far each foot lands outside its usual place. In m.
    """

    vx: float = 0.0
    vy: float = 0.0
    pitch_trim: float = 0.0
    roll_trim: float = 0.0
    spread: float = 0.0


@dataclass
class SwingEnd:
    """Pitch and roll of the swing leg at touchdown. In rad."""

    pitch: float
    roll: float


@dataclass
class StepAhead:
    """The present step, as far as leg-angle adjustment needs to know it.

    Attributes:
        elapsed: Time since the last touchdown. In s.
        remaining: Time to the next one. In s.
        step_time: Duration of the next step. In s.
        velocity: Low-passed, forward and to the left. In m/s.
        pitch, roll: The gait's swing leg angles at touchdown. In rad.
        length: The gait's swing leg length at touchdown. In m.
    """

    elapsed: float = 0.0
    remaining: float = 0.0
    step_time: float = 0.4
    velocity: tuple[float, float] = (0.0, 0.0)
    pitch: float = 0.0
    roll: float = 0.0
    length: float = 0.8


class Placement(Protocol):
    """A law of leg-angle adjustment."""

    config: WalkConfig

    def reset(self) -> None:
        """Forget earlier steps."""

    def touchdown(
        self, mean_velocity: tuple[float, float], velocity: tuple[float, float], wish: Wish
    ) -> None:
        """A step ended.

        Args:
            mean_velocity: Of the last two steps, forward and to the left. In m/s.
            velocity: Low-passed. In m/s.
            wish: Commanded velocity.
        """

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        wish: Wish,
        ahead: StepAhead,
    ) -> SwingEnd:
        """Leg angles at touchdown.

        Args:
            readings: The robot now.
            stance, swing: Its legs.
            wish: Commanded velocity.
            ahead: The present step.
        """


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

    def touchdown(
        self, mean_velocity: tuple[float, float], velocity: tuple[float, float], wish: Wish
    ) -> None:
        """Add the mean velocity's error to the sums. In m/s."""
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
        ahead: StepAhead,
    ) -> SwingEnd:
        """Leg angles at touchdown; arguments as in `Placement.swing_end`."""
        c = self.config
        end = _fall(readings, stance, ahead, c.double_support)
        w, coast = end.w, c.double_support
        single = max(0.1, ahead.step_time - coast)
        slope = coast + 1.0 / (w * math.tanh(w * single))
        tanh_half = math.tanh(0.5 * w * single) / w
        coth_half = 1.0 / (w * w * tanh_half)
        width = swing.side * 2.0 * (HIP_Y + c.foot_spread + wish.spread)
        vx_steady = wish.vx * ahead.step_time / (coast + 2.0 * tanh_half)
        vy_travel = wish.vy * ahead.step_time / (coast + 2.0 * tanh_half)
        vy_swing = width / (coast + 2.0 * coth_half)
        ux = vx_steady * (coast + tanh_half) + self._sum_x
        ux += c.pendulum_gain_x * (end.vx - vx_steady) * slope
        uy = vy_travel * (coast + tanh_half) + vy_swing * (coast + coth_half) + self._sum_y
        uy += c.pendulum_gain_y * (end.vy - vy_travel - vy_swing) * slope
        uy += math.sin(wish.roll_trim) * (ahead.length + HIP_TO_PELVIS)
        uy = _kept_apart(c, swing, end.y, uy)
        angles = _leg_angles(readings, swing, ux, uy, ahead.length)
        return SwingEnd(angles.pitch + wish.pitch_trim, angles.roll)


class PaperPlacement:
    """The paper's leg-angle adjustment.

    Added to the gait's swing leg angles at touchdown, with v the low-passed pelvis velocity and
    v_0 the same at the last touchdown:

        pitch: Kp (v_x - wish) + Kd (v_x - v_0x) + offset + trim,
        roll:  Kp (v_y - wish) + Kd (v_y - v_0y) + d narrowing sat(v_x, 0, 1) + trim,

    with d = 1 in left stance and -1 in right stance: the swing foot lands further in.

    The defaults are the authors' figures but for the offset, which they trim by hand. They were
    found for gaits that their optimizer made; with the provisional library Cassie steps in place
    but drifts by 5 to 20 cm/s, and runs ahead of a commanded speed or falls.

    Source:
        Da et al. 2016, Eqs. (13) and (17), in the form that the authors run on Cassie; they
        command sideways walking by a constant bias, which here is -Kp wish. The bound on the
        distance of the feet is an addition.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget the last touchdown."""
        self._last = (0.0, 0.0)

    def touchdown(
        self, mean_velocity: tuple[float, float], velocity: tuple[float, float], wish: Wish
    ) -> None:
        """Remember the low-passed velocity of this touchdown. In m/s."""
        self._last = velocity

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        wish: Wish,
        ahead: StepAhead,
    ) -> SwingEnd:
        """Leg angles at touchdown; arguments as in `Placement.swing_end`."""
        c = self.config
        vx, vy = ahead.velocity
        pitch = c.paper_kp_x * (vx - wish.vx) + c.paper_kd_x * (vx - self._last[0])
        roll = c.paper_kp_y * (vy - wish.vy) + c.paper_kd_y * (vy - self._last[1])
        roll += stance.side * c.paper_narrowing * max(0.0, min(1.0, vx))
        roll += ahead.roll + wish.roll_trim
        reach = ahead.length + HIP_TO_PELVIS
        uy = swing.hip_y + reach * math.sin(roll) - readings.com[1]
        end = _fall(readings, stance, ahead, c.double_support)
        further = _kept_apart(c, swing, end.y, uy) - uy
        if further != 0.0:
            roll = _leg_angles(readings, swing, 0.0, uy + further, ahead.length).roll
        return SwingEnd(ahead.pitch + pitch + c.paper_offset + wish.pitch_trim, roll)


@dataclass(frozen=True)
class _Fall:
    """A pendulum at touchdown: rate w in 1/s; y in m from the stance toe joint; speeds in m/s."""

    w: float
    vx: float
    vy: float
    y: float


def _fall(readings: Readings, stance: LegReadings, ahead: StepAhead, coast: float) -> _Fall:
    """Predict the CoM at the next touchdown. `coast` is in s."""
    com = readings.com
    w = math.sqrt(GRAVITY / max(0.4, com[2] - stance.ankle[2]))
    coasting = min(max(0.0, coast - ahead.elapsed), ahead.remaining)
    falling = w * (ahead.remaining - coasting)
    sinh, cosh = math.sinh(falling), math.cosh(falling)
    vx, vy = readings.com_velocity[0], readings.com_velocity[1]
    x = com[0] - stance.ankle[0] + vx * coasting
    y = com[1] - stance.ankle[1] + vy * coasting
    return _Fall(
        w=w,
        vx=w * x * sinh + vx * cosh,
        vy=w * y * sinh + vy * cosh,
        y=y * cosh + vy / w * sinh,
    )


def _kept_apart(c: WalkConfig, swing: LegReadings, y_end: float, uy: float) -> float:
    """`uy` moved outward until the feet are far enough apart at touchdown. All in m."""
    apart = swing.side * (y_end + uy)
    return uy + swing.side * max(0.0, c.least_foot_distance - apart)


def _leg_angles(
    readings: Readings, swing: LegReadings, ux: float, uy: float, length: float
) -> SwingEnd:
    """Angles that put the swing toe joint at (ux, uy) from the CoM, heading frame. In m."""
    from_hip_x = readings.com[0] + ux - HIP_X
    from_hip_y = readings.com[1] + uy - swing.hip_y
    pitch = math.asin(max(-0.6, min(0.6, from_hip_x / length)))
    roll = math.asin(max(-0.4, min(0.4, from_hip_y / (length + HIP_TO_PELVIS))))
    return SwingEnd(pitch, roll)
