"""Bounds of the set-points and of their rates in each situation.

A command is first clamped to the limits of the mode that it asks for. The mode in force then
applies a row of `limits_in_force`. Each row has bounds alone, so that every set-point is the
permitted one nearest to the command, and one table lists all cases.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.set_points import SetPoints
from cassie_msgs.layout import RobotMode

_STAND, _WALK, _SEGWAY = RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY

_EXPONENT_ON_FOOT, _EXPONENT_RIDING = 3.0, 2.0  # `Limits.exponent`


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bounds of set-points, and of their rates.

    Attributes:
        vx_forward, vx_backward, vy: Largest speeds. In m/s.
        yaw_rate: Largest turn rate. In rad/s.
        exponent: p of the superellipsoid |vx/..|^p + |vy/..|^p + |yaw_rate/..|^p <= 1 over the
            largest speeds, which bounds combined speeds.
        height_low, height_high: Range of the pelvis height. In m.
        com_x, com_y: Largest shift of the centre of mass. In m.
        roll, pitch: Largest tilt of the torso, with trims. In rad.
        trim: Largest trim. In rad.
        acceleration, turn_acceleration: Rates of speeds and turn rate. In m/s^2 and rad/s^2.
        height_rate, shift_rate, tilt_rate: Rates of height, CoM shift, and tilt with trims. In m/s,
            m/s and rad/s.
        brakes: Whether vx steps to its set-point at once, without the rate limit.
    """

    vx_forward: float
    vx_backward: float
    vy: float
    yaw_rate: float
    exponent: float
    height_low: float
    height_high: float
    com_x: float
    com_y: float
    roll: float
    pitch: float
    trim: float
    acceleration: float
    turn_acceleration: float
    height_rate: float
    shift_rate: float
    tilt_rate: float
    brakes: bool = False

    def clamp(self, commanded: SetPoints) -> SetPoints:
        """The set-points within the bounds that are nearest to a command.

        Combined speeds are kept within a superellipsoid over their bounds. A single speed may reach
        its bound; combined speeds are scaled down together, so that the robot turns and sidesteps
        less while it walks fast.
        """
        vx, vy, yaw_rate = self._speeds(commanded)
        sagittal, lateral, pitch_trim, roll_trim = commanded.trims
        pitch_trim = _clamp(pitch_trim, min(self.trim, self.pitch))
        roll_trim = _clamp(roll_trim, min(self.trim, self.roll))
        return SetPoints(
            vx=vx,
            vy=vy,
            yaw_rate=yaw_rate,
            height=max(self.height_low, min(self.height_high, commanded.height)),
            com_x=_clamp(commanded.com_x, self.com_x),
            com_y=_clamp(commanded.com_y, self.com_y),
            roll=max(-self.roll - roll_trim, min(self.roll - roll_trim, commanded.roll)),
            pitch=max(-self.pitch - pitch_trim, min(self.pitch - pitch_trim, commanded.pitch)),
            trims=(
                _clamp(sagittal, self.trim),
                _clamp(lateral, self.trim),
                pitch_trim,
                roll_trim,
            ),
        )

    def _speeds(self, commanded: SetPoints) -> tuple[float, float, float]:
        vx = min(self.vx_forward, max(-self.vx_backward, commanded.vx))
        vy = _clamp(commanded.vy, self.vy)
        yaw_rate = _clamp(commanded.yaw_rate, self.yaw_rate)
        ratios = (
            _ratio(vx, self.vx_forward if vx > 0.0 else self.vx_backward),
            _ratio(vy, self.vy),
            _ratio(yaw_rate, self.yaw_rate),
        )
        norm = sum(ratio**self.exponent for ratio in ratios)
        scale = max(1.0, norm) ** (-1.0 / self.exponent)
        return scale * vx, scale * vy, scale * yaw_rate

    def approach(self, now: SetPoints, commanded: SetPoints, period: float) -> None:
        """Move set-points towards a command over one period (s), each within its rate limit."""
        speed, turn = self.acceleration * period, self.turn_acceleration * period
        height, shift = self.height_rate * period, self.shift_rate * period
        tilt = self.tilt_rate * period
        now.vx = commanded.vx if self.brakes else _rate_limited(now.vx, commanded.vx, speed)
        now.vy = _rate_limited(now.vy, commanded.vy, speed)
        now.yaw_rate = _rate_limited(now.yaw_rate, commanded.yaw_rate, turn)
        now.height = _rate_limited(now.height, commanded.height, height)
        now.com_x = _rate_limited(now.com_x, commanded.com_x, shift)
        now.com_y = _rate_limited(now.com_y, commanded.com_y, shift)
        now.roll = _rate_limited(now.roll, commanded.roll, tilt)
        now.pitch = _rate_limited(now.pitch, commanded.pitch, tilt)
        a, b = now.trims, commanded.trims
        now.trims = (
            _rate_limited(a[0], b[0], tilt),
            _rate_limited(a[1], b[1], tilt),
            _rate_limited(a[2], b[2], tilt),
            _rate_limited(a[3], b[3], tilt),
        )


@functools.cache
def on_foot(c: SupervisorConfig) -> Limits:
    """Limits of an operator's commands on foot."""
    return Limits(
        vx_forward=c.vx_forward,
        vx_backward=c.vx_backward,
        vy=c.vy_limit,
        yaw_rate=c.yaw_rate_limit,
        exponent=_EXPONENT_ON_FOOT,
        height_low=c.height_low,
        height_high=c.height_high,
        com_x=c.com_x_limit,
        com_y=c.com_y_limit,
        roll=c.tilt_limit,
        pitch=c.tilt_limit,
        trim=c.trim_limit,
        acceleration=c.acceleration,
        turn_acceleration=c.turn_acceleration,
        height_rate=c.height_rate,
        shift_rate=c.shift_rate,
        tilt_rate=c.tilt_rate,
    )


@functools.cache
def on_segway(c: SupervisorConfig) -> Limits:
    """Limits of an operator's commands on a Segway."""
    return replace(
        on_foot(c),
        vx_forward=c.ride_forward,
        vx_backward=c.ride_backward,
        vy=0.0,
        yaw_rate=c.ride_yaw_rate,
        exponent=_EXPONENT_RIDING,
        acceleration=c.ride_acceleration,
        com_x=c.ride_com_x,
        com_y=c.ride_com_y,
        shift_rate=c.ride_shift_rate,
        height_low=c.ride_height_low,
        height_high=c.ride_height,
        height_rate=c.ride_height_rate,
        roll=c.ride_tilt,
        pitch=c.ride_tilt,
    )


def command_limits(mode: RobotMode, c: SupervisorConfig) -> Limits:
    """Limits of a command that asks for a mode."""
    return on_segway(c) if mode is _SEGWAY else on_foot(c)


@functools.cache
def limits_in_force(
    c: SupervisorConfig, current: RobotMode, requested: RobotMode, *, stepping: bool, walked: bool
) -> Limits:
    """Limits that the mode in force applies to a command, which is within its own mode's limits.

    | mode in force | asked for | speeds | height | CoM shift | tilt and trims |
    |---|---|---|---|---|---|
    | stand | stand | 0 | as commanded | as commanded | as commanded |
    | stand, a foot in the air | stand | 0 | as commanded | as commanded | of walking |
    | stand, walked just now | stand | 0 | of walking | 0 | torso upright |
    | stand | walk | 0 | of walking | 0 | of walking |
    | stand | segway | 0 | crouch or lower | 0 | as commanded |
    | walk | walk | as commanded | of walking | 0 | of walking |
    | walk | stand | 0 | of walking | 0 | torso upright, of walking |
    | walk | segway | 0 | of walking | 0 | of walking |
    | segway | segway | as commanded | of riding | as commanded | of riding |
    | segway | another | 0, vx at once | of riding | 0 | of riding |

    Standing takes over from walking with an upright torso: with a tilted torso the legs yield
    meanwhile. With power off or damped drives no set-point is in force.

    Args:
        c: Parameters of the supervisor.
        current, requested: Mode in force, and mode that the operator asks for.
        stepping: Whether a foot is in the air, or was within about a step.
        walked: Whether the robot stands and has walked just now.
    """
    limits = on_segway(c) if current is _SEGWAY else on_foot(c)
    limits = replace(limits, vx_forward=math.inf, vx_backward=math.inf, vy=math.inf)
    limits = replace(limits, yaw_rate=math.inf, com_x=math.inf, com_y=math.inf)
    if current is not requested or requested is _STAND:
        limits = replace(limits, vx_forward=0.0, vx_backward=0.0, vy=0.0, yaw_rate=0.0)
    if current is _SEGWAY:
        if current is not requested:
            limits = replace(limits, com_x=0.0, com_y=0.0, brakes=True)
        return limits
    if requested is _SEGWAY:
        limits = replace(limits, height_high=c.ride_height, com_x=0.0, com_y=0.0)
    if _WALK in (requested, current):
        limits = replace(limits, height_low=c.walk_height, height_high=c.walk_height)
        limits = replace(limits, com_x=0.0, com_y=0.0)
    if _WALK in (requested, current) or stepping:
        limits = replace(limits, roll=c.walk_roll, pitch=c.walk_pitch, trim=c.walk_trim)
    if walked or (current, requested) == (_WALK, _STAND):
        limits = replace(limits, height_low=c.walk_height, height_high=c.walk_height)
        limits = replace(limits, com_x=0.0, com_y=0.0, roll=0.0, pitch=0.0)
    return limits


def _ratio(value: float, limit: float) -> float:
    return abs(value) / limit if 0.0 < limit < math.inf else 0.0


def _clamp(value: float, bound: float) -> float:
    return min(bound, max(-bound, value))  # 0, not -0, for a bound of 0


def _rate_limited(now: float, commanded: float, max_change: float) -> float:
    return now + max(-max_change, min(max_change, commanded - now))
