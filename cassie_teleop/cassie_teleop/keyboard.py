"""Conversion of keys to set-points, and the status lines."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field

from cassie_msgs.request import Request
from cassie_msgs.tunables import replace_checked
from cassie_teleop.requests import clamped, stopped

HELP = """\
  p power on       o power off (emergency stop)
  1 stand          2 walk          3 segway
  w/s forward      a/d turn        q/e sideways     space: stop moving
  arrows: as w s a d               r/f height       t/g pitch       y/h roll
  i/k, j/l lean (CoM)              0 all set-points back
  simulator: n let down   u hang up   z reset   b Segway's bar: let go, hold
  c take over from another operator, at rest
  ? this help      x or Ctrl-C: stop and leave"""

STEPS: dict[str, tuple[str, float]] = {
    **{"w": ("vx", 0.1), "s": ("vx", -0.1), "q": ("vy", 0.05), "e": ("vy", -0.05)},
    **{"a": ("yaw_rate", 0.1), "d": ("yaw_rate", -0.1), "r": ("height", 0.02)},
    **{"f": ("height", -0.02), "t": ("pitch", 0.02), "g": ("pitch", -0.02)},
    **{"y": ("roll", -0.02), "h": ("roll", 0.02), "i": ("com_x", 0.01), "k": ("com_x", -0.01)},
    **{"j": ("com_y", 0.01), "l": ("com_y", -0.01)},
}
ARROWS = {"up": "w", "down": "s", "left": "a", "right": "d"}
MODE_KEYS = {"1": "stand", "2": "walk", "3": "segway"}
ORDER_KEYS = {"n": "lower", "u": "hang_up", "z": "reset", "b": "let_go_bar"}
"""Services of the simulator; `b` alternately releases and holds the bar."""

_NARROWEST = 20  # characters
_POWER_FIRST = "press p for power on first, or o for power off"


class Keyboard:
    """Set-points by the pressed keys.

    Attributes:
        request: The request; None until a power key was pressed, so that the start of this program
            does not cut the power.
        asks: Whether the lease of another operator was just requested.
        left: Whether the user has ended the program.
        orders: Services that were requested and not yet called.
        mode: Mode of the robot by the supervisor; empty without a status.
    """

    def __init__(self) -> None:
        """Begin without set-points."""
        self.request: Request | None = None
        self.asks = self.left = False
        self.orders: list[str] = []
        self.mode = ""
        self._bar_held = True

    def disarm(self) -> None:
        """Begin a new episode: the robot rests until a key is pressed."""
        self._bar_held = True
        if self.request is not None:
            self.request = replace_checked(stopped(self.request), mode="stand")

    def press(self, key: str) -> str:
        """Take in a key, also with Caps Lock on; returns why it has no effect, empty if it has."""
        key = ARROWS.get(key, key.lower())
        if key == "x":
            self.left = True
        elif key == "p":
            request = self.request or Request()
            # The robot must not start walking when the power comes back.
            request = request if request.power else replace_checked(stopped(request), mode="stand")
            self.request = replace_checked(request, power=True, emergency_stop=False)
        elif key == "o":
            request = replace_checked(stopped(self.request or Request()), mode="stand")
            self.request = replace_checked(request, power=False, emergency_stop=True)
        elif key == "b" and self._bar_held and self.mode not in ("", "segway"):
            return f"the bar is held until mode segway (key 3): the mode is {self.mode}"
        elif key in ORDER_KEYS:
            self._order(ORDER_KEYS[key])
        elif key in STEPS or key in MODE_KEYS or key in (" ", "c", "0"):
            if self.request is None:
                return _POWER_FIRST
            self.request = self._changed(self.request, key)
        else:
            name = key if len(key) > 1 else repr(key)
            return f"{name} does nothing: ? lists the keys"
        return ""

    def _changed(self, request: Request, key: str) -> Request:
        if key in STEPS:
            name, step = STEPS[key]
            value = clamped(name, round(getattr(request, name) + step, 6))
            return replace_checked(request, **{name: value})
        if key in MODE_KEYS:
            return replace_checked(request, mode=MODE_KEYS[key])
        if key == " ":
            return stopped(request)
        if key == "c":
            self.asks = True
            return replace_checked(stopped(request), mode="stand")
        return Request(mode=request.mode, power=request.power)

    def _order(self, order: str) -> None:
        if order == "let_go_bar":
            order = "let_go_bar" if self._bar_held else "hold_bar"
        self.orders.append(order)

    def obeyed(self, order: str) -> None:
        """Take in that the simulator has done an order; a refused one changes nothing."""
        if order in ("let_go_bar", "hold_bar"):
            self._bar_held = order == "hold_bar"


@dataclass(frozen=True)
class Status:
    """Values of SupervisorStatus that the lines show, with their age in s.

    Attributes:
        other: Name of another operator who holds the lease; empty if there is none.
        armed: Whether speeds count; false until they have been at zero.
    """

    mode: str
    readiness: str
    faults: Sequence[str]
    age: float
    other: str = ""
    armed: bool = True


@dataclass(frozen=True)
class Motion:
    """Speeds forward and to the left (m/s), turn rate (rad/s), height (m), as far as known.

    Attributes:
        limited: Set-points after the supervisor's limits.
        achieved: Estimated values.
        segway: Speed of the Segway, in m/s.
    """

    limited: Sequence[float] = field(default=())
    achieved: Sequence[float] = field(default=())
    segway: float | None = None


def status_lines(
    request: Request | None, status: Status | None, motion: Motion, width: int
) -> list[str]:
    """Lines for the terminal: state of the robot, speeds, faults.

    Args:
        request: The request of the keys; None before a power key was pressed.
        status: Status of the supervisor; None before the first one.
        motion: Speeds after the supervisor's limits, and achieved ones.
        width: Longest line, but at least `_NARROWEST`. In characters.
    """
    lines = [_robot(status)]
    if status is not None and (word := _unheard(request, status)):
        lines.append(word)
    lines.append(f"{'':10}{'ahead':>7}{'left':>7}{'turn':>7}{'height':>7}  m/s, rad/s, m")
    lines.append(_commanded(request))
    lines += [
        _row(name, values)
        for name, values in (("limited", motion.limited), ("achieved", motion.achieved))
    ]
    if motion.segway is not None:
        lines.append(f"{'Segway':10}{motion.segway:+7.2f} m/s")
    lines += [f"fault: {fault}" for fault in (status.faults if status is not None else ())]
    return [part for line in lines for part in wrapped(line, width)]


def help_lines(width: int) -> list[str]:
    """The help as lines of at most `width` characters."""
    return [part for line in HELP.splitlines() for part in wrapped(line, width)]


def wrapped(line: str, width: int) -> list[str]:
    """A line as lines of at most `width` characters, and of `_NARROWEST` in a window below that."""
    width = max(width, _NARROWEST)
    return textwrap.wrap(line, width, drop_whitespace=False, subsequent_indent="  ")


def _robot(status: Status | None) -> str:
    if status is None:
        return "no status from the supervisor: is the robot running?"
    age = f" ({status.age:.1f} s ago)" if status.age > 0.5 else ""
    waits = f", not yet as asked: {status.readiness}" if status.readiness else ""
    return f"{status.mode}{age}{waits}"


def _unheard(request: Request | None, status: Status) -> str:
    """Why the robot does not follow the request; empty if it does."""
    if status.other:
        return f"{status.other} drives: c takes over while the robot rests, o cuts the power"
    if request is not None and request != stopped(request) and not status.armed:
        return "the speeds do not count yet: press space"
    return ""


def _commanded(request: Request | None) -> str:
    if request is None:
        return _POWER_FIRST + "; ? for help"
    row = _row("commanded", (request.vx, request.vy, request.yaw_rate, request.height))
    words = [request.mode] if request.power else ["no power", request.mode]
    if request.roll or request.pitch:
        words.append(f"roll {request.roll:+.2f} pitch {request.pitch:+.2f} rad")
    if request.com_x or request.com_y:
        words.append(f"lean {request.com_x:+.2f} {request.com_y:+.2f} m")
    return f"{row}  {', '.join(words)}"


def _row(name: str, values: Sequence[float]) -> str:
    figures = "".join(f"{value:+7.2f}" for value in values[:3])
    height = f"{values[3]:7.2f}" if len(values) > 3 else ""
    return f"{name:10}{figures}{height}" if values else f"{name:10}{'-':>7}"
