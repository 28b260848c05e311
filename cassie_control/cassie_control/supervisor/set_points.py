"""The operator's commands, kept within limits and changed at limited rates."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, fields, replace

from cassie_control.finite import fault
from cassie_control.supervisor.config import SupervisorConfig
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode

_NEAR = 1e-3  # rad or m


@dataclass
class SetPoints:
    """What the controller is given.

    Attributes:
        vx, vy: Forward and to the left. In m/s.
        yaw_rate: To the left. In rad/s.
        height: Of the pelvis above the soles. In m.
        com_x, com_y: Shift of the centre of mass, forward and to the left. In m.
        roll, pitch: Of the torso. In rad.
        trims: Sagittal and lateral leg angle, torso pitch and roll. In rad.
    """

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0
    height: float = 0.9
    com_x: float = 0.0
    com_y: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    trims: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def write(self, mode: Mode) -> None:
        """Fill in the set-points of a mode message."""
        for name in _NAMES:
            getattr(mode, name)[...] = getattr(self, name)


_NAMES = tuple(field.name for field in fields(SetPoints))


def refusal(command: OperatorCommand) -> str:
    """Why an operator's command cannot be followed; empty if it can.

    What exceeds a limit is followed up to that limit; this is about what means nothing.
    """
    if int(command.mode) > RobotMode.SEGWAY:
        return f"mode is {command.mode}, must be 0 .. {RobotMode.SEGWAY:d}"
    return fault(command)


def requested_mode(command: OperatorCommand) -> RobotMode:
    """The mode that an operator asks for; standing if it is none to ask for."""
    asked = int(command.mode)
    permitted = (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY)
    return RobotMode(asked) if asked in permitted else RobotMode.STAND


def within_limits(command: OperatorCommand, config: SupervisorConfig) -> SetPoints:
    """An operator's command within the limits."""
    c = riding(config) if int(command.mode) == RobotMode.SEGWAY else config
    vx, vy, yaw_rate = _walkable(float(command.vx), float(command.vy), float(command.yaw_rate), c)
    sagittal, lateral, pitch, roll = command.trims.tolist()
    commanded = SetPoints(
        vx=vx,
        vy=vy,
        yaw_rate=yaw_rate,
        height=_bounded(float(command.height), c.height_low, c.height_high),
        com_x=_bounded(float(command.com_x), -c.com_x_limit, c.com_x_limit),
        com_y=_bounded(float(command.com_y), -c.com_y_limit, c.com_y_limit),
        roll=float(command.roll),
        pitch=float(command.pitch),
        trims=(sagittal, lateral, pitch, roll),
    )
    return _tilted(commanded, c.tilt_limit, c.tilt_limit, c.trim_limit)


@functools.cache
def riding(config: SupervisorConfig) -> SupervisorConfig:
    """The limits that hold on a Segway, in the place of those on foot."""
    return replace(
        config,
        vx_forward=config.ride_forward,
        vx_backward=config.ride_backward,
        vy_limit=0.0,
        yaw_rate_limit=config.ride_yaw_rate,
        acceleration=config.ride_acceleration,
        com_x_limit=config.ride_com_x,
        com_y_limit=config.ride_com_y,
        shift_rate=config.ride_shift_rate,
        height_low=min(config.ride_height_low, config.ride_height),
        height_high=config.ride_height,
        height_rate=config.ride_height_rate,
        tilt_limit=config.ride_tilt,
    )


def crouched(commanded: SetPoints, config: SupervisorConfig) -> SetPoints:
    """A command made on foot, with the height and tilt that riding permits."""
    c = riding(config)
    commanded = replace(commanded, height=_bounded(commanded.height, c.height_low, c.height_high))
    return _tilted(commanded, c.tilt_limit, c.tilt_limit, c.trim_limit)


def approach(now: SetPoints, commanded: SetPoints, config: SupervisorConfig, period: float) -> None:
    """Move set-points towards a command by one period, in s, each no faster than permitted."""
    c = config
    now.vx = _towards(now.vx, commanded.vx, c.acceleration * period)
    now.vy = _towards(now.vy, commanded.vy, c.acceleration * period)
    now.yaw_rate = _towards(now.yaw_rate, commanded.yaw_rate, c.turn_acceleration * period)
    now.height = _towards(now.height, commanded.height, c.height_rate * period)
    now.com_x = _towards(now.com_x, commanded.com_x, c.shift_rate * period)
    now.com_y = _towards(now.com_y, commanded.com_y, c.shift_rate * period)
    now.roll = _towards(now.roll, commanded.roll, c.tilt_rate * period)
    now.pitch = _towards(now.pitch, commanded.pitch, c.tilt_rate * period)
    step = c.tilt_rate * period
    a, b = now.trims, commanded.trims
    now.trims = (
        _towards(a[0], b[0], step),
        _towards(a[1], b[1], step),
        _towards(a[2], b[2], step),
        _towards(a[3], b[3], step),
    )


def stepping(commanded: SetPoints, config: SupervisorConfig) -> SetPoints:
    """A command with what a robot bears of it that steps."""
    c = config
    commanded = replace(commanded, com_x=0.0, com_y=0.0)
    return _tilted(commanded, c.walk_roll, c.walk_pitch, c.walk_trim)


def agree(now: SetPoints, least: SetPoints) -> bool:
    """Whether set-points have come to where a mode wants them, height and speeds aside."""
    pairs = (
        (now.roll, least.roll),
        (now.pitch, least.pitch),
        (now.com_x, least.com_x),
        (now.com_y, least.com_y),
        *zip(now.trims, least.trims, strict=True),
    )
    return all(abs(now_ - least_) < _NEAR for now_, least_ in pairs)


def upright(commanded: SetPoints, walk_height: float) -> SetPoints:
    """A command without tilt, at the height of walking: standing takes over from walking with it.

    With a tilted torso the legs give way meanwhile.
    """
    trims = (*commanded.trims[:2], 0.0, 0.0)
    return replace(
        commanded, roll=0.0, pitch=0.0, trims=trims, height=walk_height, com_x=0.0, com_y=0.0
    )


def is_upright(now: SetPoints) -> bool:
    """Whether set-points have come to `upright`, its height aside."""
    return max(map(abs, (now.roll, now.pitch, *now.trims[2:]))) < _NEAR


def _tilted(commanded: SetPoints, roll: float, pitch: float, trim: float) -> SetPoints:
    """A command whose torso tilts no further than roll and pitch, trims included. All in rad."""
    sagittal, lateral, pitch_trim, roll_trim = commanded.trims
    pitch_trim = _bounded(pitch_trim, -min(trim, pitch), min(trim, pitch))
    roll_trim = _bounded(roll_trim, -min(trim, roll), min(trim, roll))
    return replace(
        commanded,
        roll=_bounded(commanded.roll, -roll - roll_trim, roll - roll_trim),
        pitch=_bounded(commanded.pitch, -pitch - pitch_trim, pitch - pitch_trim),
        trims=(
            _bounded(sagittal, -trim, trim),
            _bounded(lateral, -trim, trim),
            pitch_trim,
            roll_trim,
        ),
    )


def _walkable(
    vx: float, vy: float, yaw_rate: float, c: SupervisorConfig
) -> tuple[float, float, float]:
    """Speeds within their limits and, together, within an ellipsoid over those limits.

    Each limit can be used up alone; what is asked for at once is scaled down as a whole, so that
    the robot turns and sidesteps less while it walks fast.
    """
    vx = _bounded(vx, -c.vx_backward, c.vx_forward)
    vy = _bounded(vy, -c.vy_limit, c.vy_limit)
    yaw_rate = _bounded(yaw_rate, -c.yaw_rate_limit, c.yaw_rate_limit)
    shares = (
        _share(vx, c.vx_forward if vx > 0.0 else c.vx_backward),
        _share(vy, c.vy_limit),
        _share(yaw_rate, c.yaw_rate_limit),
    )
    scale = 1.0 / max(1.0, math.hypot(*shares))
    return scale * vx, scale * vy, scale * yaw_rate


def _share(value: float, limit: float) -> float:
    return value / limit if limit > 0.0 else 0.0


def _bounded(value: float, low: float, high: float) -> float:
    return max(low, min(high, value))


def _towards(now: float, commanded: float, step: float) -> float:
    return now + max(-step, min(step, commanded - now))
