"""Set-points of the controller, and those that an operator's command asks for."""

from __future__ import annotations

from dataclasses import dataclass, fields

from cassie_control.finite import fault
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode

_TOLERANCE = 1e-3  # rad or m


@dataclass
class SetPoints:
    """Set-points of the controller.

    Attributes:
        vx, vy: Velocity, forward and to the left. In m/s.
        yaw_rate: Turn rate, to the left. In rad/s.
        height: Height of the pelvis above the soles. In m.
        com_x, com_y: Shift of the centre of mass, forward and to the left. In m.
        roll, pitch: Angles of the torso. In rad.
        trims: Trims of sagittal and lateral leg angle, torso pitch and roll. In rad.
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


def command_fault(command: OperatorCommand) -> str:
    """Why an operator's command has no meaning; empty if it has.

    A value beyond a limit is no reason: the command is then followed up to that limit.
    """
    if int(command.mode) > RobotMode.SEGWAY:
        return f"mode is {command.mode}, must be 0 .. {RobotMode.SEGWAY:d}"
    return fault(command)


def requested_mode(command: OperatorCommand) -> RobotMode:
    """The mode that an operator asks for; standing if the operator may not ask for it."""
    asked = int(command.mode)
    permitted = (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY)
    return RobotMode(asked) if asked in permitted else RobotMode.STAND


def set_points_of(command: OperatorCommand) -> SetPoints:
    """The set-points that an operator's command asks for."""
    vx, vy, yaw_rate = float(command.vx), float(command.vy), float(command.yaw_rate)
    sagittal, lateral, pitch, roll = command.trims.tolist()
    return SetPoints(
        vx=vx,
        vy=vy,
        yaw_rate=yaw_rate,
        height=float(command.height),
        com_x=float(command.com_x),
        com_y=float(command.com_y),
        roll=float(command.roll),
        pitch=float(command.pitch),
        trims=(sagittal, lateral, pitch, roll),
    )


def have_same_posture(now: SetPoints, wanted: SetPoints) -> bool:
    """Whether set-points have reached wanted ones, except height and speeds."""
    pairs = (
        (now.roll, wanted.roll),
        (now.pitch, wanted.pitch),
        (now.com_x, wanted.com_x),
        (now.com_y, wanted.com_y),
        *zip(now.trims, wanted.trims, strict=True),
    )
    return all(abs(value - goal) < _TOLERANCE for value, goal in pairs)


def is_upright(now: SetPoints) -> bool:
    """Whether set-points have reached an upright torso."""
    return max(map(abs, (now.roll, now.pitch, *now.trims[2:]))) < _TOLERANCE
