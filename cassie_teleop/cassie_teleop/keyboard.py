"""Keys to wishes, and the status line under them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cassie_msgs.tunables import replace_checked
from cassie_teleop.radio import clamped
from cassie_teleop.wish import Wish

HELP = """\
  p power on       o power off (emergency stop)
  1 stand          2 walk          3 segway
  w/s forward      a/d turn        q/e sideways     space: stop moving
  r/f height       t/g pitch       y/h roll         i/k, j/l lean (CoM)
  0 all set-points back            c take over from another operator, at rest
  ? this help                      x or Ctrl-C: stop and leave"""

STEPS: dict[str, tuple[str, float]] = {
    **{"w": ("vx", 0.1), "s": ("vx", -0.1), "q": ("vy", 0.05), "e": ("vy", -0.05)},
    **{"a": ("yaw_rate", 0.1), "d": ("yaw_rate", -0.1), "r": ("height", 0.02)},
    **{"f": ("height", -0.02), "t": ("pitch", 0.02), "g": ("pitch", -0.02)},
    **{"y": ("roll", -0.02), "h": ("roll", 0.02), "i": ("com_x", 0.01), "k": ("com_x", -0.01)},
    **{"j": ("com_y", 0.01), "l": ("com_y", -0.01)},
}
MODE_KEYS = {"1": "stand", "2": "walk", "3": "segway"}


class Keyboard:
    """Wishes as the keys have made them.

    Attributes:
        wish: None until a power key was pressed, so that nobody cuts the power by
            starting a program.
        asks: Whether the lease of another operator was just asked for.
        left: Whether the user leaves.
    """

    def __init__(self) -> None:
        """Start without a wish."""
        self.wish: Wish | None = None
        self.asks = self.left = False

    def disarm(self) -> None:
        """A new episode: nothing moves until a key says so."""
        if self.wish is not None:
            self.wish = replace_checked(stopped(self.wish), mode="stand")

    def press(self, key: str) -> bool:
        """Take one key, also with Caps Lock on; says whether it means something now."""
        key = key.lower()
        if key == "x":
            self.left = True
        elif key == "p":
            wish = self.wish or Wish()
            # The robot does not walk off when the power comes back.
            wish = wish if wish.power else replace_checked(stopped(wish), mode="stand")
            self.wish = replace_checked(wish, power=True, emergency_stop=False)
        elif key == "o":
            wish = replace_checked(stopped(self.wish or Wish()), mode="stand")
            self.wish = replace_checked(wish, power=False, emergency_stop=True)
        elif self.wish is None:
            return False
        elif key in STEPS:
            name, step = STEPS[key]
            value = clamped(name, round(getattr(self.wish, name) + step, 6))
            self.wish = replace_checked(self.wish, **{name: value})
        elif key in MODE_KEYS:
            self.wish = replace_checked(self.wish, mode=MODE_KEYS[key])
        elif key == " ":
            self.wish = stopped(self.wish)
        elif key == "c":
            self.wish = replace_checked(stopped(self.wish), mode="stand")
            self.asks = True
        elif key == "0":
            self.wish = Wish(mode=self.wish.mode, power=self.wish.power)
        else:
            return False
        return True


def stopped(wish: Wish) -> Wish:
    """The same wishes without motion."""
    return replace_checked(wish, vx=0.0, vy=0.0, yaw_rate=0.0)


@dataclass(frozen=True)
class Status:
    """What the line shows of SupervisorStatus, with its age in s."""

    mode: str
    readiness: str
    faults: Sequence[str]
    age: float


def status_line(wish: Wish | None, status: Status | None, width: int) -> str:
    """One line of at most `width` characters: the robot, which must not be cut off, the wishes."""
    if status is None:
        robot = "no word from the supervisor"
    else:
        age = f" ({status.age:.1f} s ago)" if status.age > 0.5 else ""
        robot = f"{status.mode}{age}"
        robot += f" | FAULT: {'; '.join(status.faults)}" if status.faults else ""
        robot += f" | not yet: {status.readiness}" if status.readiness else ""
    line = f"{robot} | {_wanted(wish)}"
    return line if len(line) <= width else line[: max(0, width - 1)] + "…"


def _wanted(wish: Wish | None) -> str:
    """The wishes, those for tilt and lean only when there are some."""
    if wish is None:
        return "press p for power on, o for power off, ? for help"
    power = "" if wish.power else "NO POWER, "
    wanted = f"{power}{wish.mode} vx {wish.vx:+.2f} vy {wish.vy:+.2f} m/s"
    wanted += f" turn {wish.yaw_rate:+.2f} rad/s height {wish.height:.2f} m"
    if wish.roll or wish.pitch:
        wanted += f" roll {wish.roll:+.2f} pitch {wish.pitch:+.2f} rad"
    if wish.com_x or wish.com_y:
        wanted += f" lean {wish.com_x:+.2f} {wish.com_y:+.2f} m"
    return wanted
