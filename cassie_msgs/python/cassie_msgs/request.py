"""What an operator commands: set-points, mode, power and link."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.layout import OperatorCommand, RobotMode
from cassie_msgs.tunables import tunable

MODES = ("stand", "walk", "segway")
_MODE_NUMBERS = {name: RobotMode[name.upper()] for name in MODES}
_NUMBERS = ("vx", "vy", "yaw_rate", "height", "com_x", "com_y", "roll", "pitch", "trims")


@dataclass(frozen=True, kw_only=True)
class Request:
    """One command of an operator; `cassie_msgs.tunables.replace_checked` changes it in range."""

    mode: str = tunable("stand", choices=MODES, description="Commanded mode")
    vx: float = tunable(0.0, "m/s", -1.3, 4.5, "Speed forward; beyond 2.4 on a Segway")
    vy: float = tunable(0.0, "m/s", -0.4, 0.4, "Speed to the left")
    yaw_rate: float = tunable(0.0, "rad/s", -1.2, 1.2, "Turn to the left")
    height: float = tunable(0.9, "m", 0.35, 1.05, "Pelvis origin above the loaded soles")
    com_x: float = tunable(0.0, "m", -0.1, 0.1, "Shift of the centre of mass forward")
    com_y: float = tunable(0.0, "m", -0.1, 0.1, "Shift of the centre of mass to the left")
    roll: float = tunable(0.0, "rad", -0.3, 0.3, "Torso roll")
    pitch: float = tunable(0.0, "rad", -0.3, 0.3, "Torso pitch")
    trims: tuple[float, float, float, float] = tunable(
        (0.0, 0.0, 0.0, 0.0),
        "rad",
        -0.1,
        0.1,
        "Trims of sagittal and lateral leg angle, torso pitch, torso roll",
    )
    power: bool = tunable(False, description="Drives powered; false is the emergency stop")
    link: bool = tunable(True, description="The operator's link is good")
    emergency_stop: bool = tunable(
        False, description="No power while this is set, whichever operator holds the lease"
    )
    take_over: bool = tunable(
        False, description="Requests the lease from its holder; granted while the robot rests"
    )


def write(request: Request, command: OperatorCommand) -> None:
    """Fill the fields of a command; the header is not changed."""
    for name in _NUMBERS:
        getattr(command, name)[...] = getattr(request, name)
    command.mode[...] = _MODE_NUMBERS[request.mode]
    command.power[...] = request.power
    command.link[...] = request.link
    command.emergency_stop[...] = request.emergency_stop
    command.take_over[...] = request.take_over
