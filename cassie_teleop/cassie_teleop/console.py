"""The browser page that drives, and the commands of its sticks and buttons.

All pages together are one operator to the robot. One page drives: the first that requests it.
Other pages only show the robot, can stop it, and can take over while the driving page lets it rest.
After each begin or end of a drive or a mode, the sticks must be at rest once before they count.
A page drives only as long as its messages echo a frame of the last `LINK_AGE` seconds. This
excludes a page that is hidden, asleep or closed, and a network that is slow in either direction.
Times come in as arguments: monotonic, in s.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from cassie_msgs.operators import RIDE_STOP
from cassie_msgs.request import MODES, Request
from cassie_msgs.tunables import replace_checked, tunable
from cassie_teleop.page_messages import ORDERS, RECORD, SLIDERS, Beat, Press, Slide, Sticks
from cassie_teleop.requests import TAKE_OVER_TIME, clamped, stopped, without_link

LINK_AGE = 0.3
"""Time-out of a page's link: age of the frame that its newest message echoes. In s."""

STOP_TIME = 1.0
"""Duration of an emergency stop while no page drives. In s."""

GRANT_TIME = 2.0
"""Time after which a page that has requested to drive must hold the lease. In s."""

LAPSE = 1.0
"""Duration of a lost link after which the mode must be commanded anew. In s."""

_CYCLE = 0.2  # s for which power is off when it is switched off and on
_MAX_ORDERS = 10


@dataclass(frozen=True, kw_only=True)
class Reach:
    """Commands of the sticks at full deflection."""

    forward: float = tunable(0.8, "m/s", 0.0, 4.5, "Speed with the stick full forward")
    backward: float = tunable(0.4, "m/s", 0.0, 1.0, "Speed with the stick full back")
    sideways: float = tunable(0.25, "m/s", 0.0, 0.4, "Sideways speed with the stick at a side")
    turn: float = tunable(0.6, "rad/s", 0.0, 1.2, "Turn rate with the stick at a side")
    lean: float = tunable(
        0.05, "m", 0.0, 0.1, "CoM shift at full stick deflection, instead of speeds in mode segway"
    )


@dataclass
class _Page:
    name: str
    echo: float = -1e9
    visible: bool = True
    sticks: Sticks = field(default_factory=Sticks)


class Console:
    """The pages, the page that drives, and its command.

    Args:
        name: Name of the sender in the commands; /cassie/supervisor_status gives the same name for
            the holder of the lease.
        reach: Commands of the sticks at full deflection.

    Attributes:
        driver: Page that drives; None if there is none.
        armed: Whether the sticks of the driving page count.
        orders: Requests besides driving that are not done yet: a service of the simulator, or the
            begin or end of a recording.
        notice: Text for all pages: why a page does not drive any more; empty at first.
    """

    def __init__(self, name: str, reach: Reach) -> None:
        self.reach = reach
        self.driver: int | None = None
        self.orders: deque[str] = deque(maxlen=_MAX_ORDERS)
        self.notice = ""
        self._name = name
        self._pages: dict[int, _Page] = {}
        self._base = Request()  # set by buttons and sliders; without speeds
        self._holder = ""
        self._powered: bool | None = None
        self._taken = self._linked = self._stopped = self._cycled = self._rode = -1e9
        self._parting = False
        self.armed = False

    def join(self, page: int, name: str) -> None:
        """Take in that a page was opened; it does not drive."""
        self._pages[page] = _Page(name)

    def leave(self, page: int) -> None:
        """Take in that a page is gone."""
        if page == self.driver:
            self._release()
        self._pages.pop(page, None)

    def hear(self, page: int, message: Beat | Press | Slide, now: float) -> str:
        """Take in a message of a page that has joined.

        Returns:
            Text for the page; empty if there is none.
        """
        mine = self._pages[page]
        if message.echo <= now:
            mine.echo = max(mine.echo, message.echo)
        if isinstance(message, Beat):
            mine.visible, mine.sticks = message.visible, message.sticks
            if page == self.driver and self._fresh(mine, now):
                self.armed = self.armed or mine.sticks.at_rest
            return ""
        if isinstance(message, Press) and message.button == "stop":
            self._stop(now)
            return ""
        if isinstance(message, Press) and message.button == RECORD:
            if self.driver not in (None, page):
                return self._who_drives()
            self.orders.append(RECORD)
            return ""
        if now - message.echo > LINK_AGE:
            return "too late: the link to this page is slow"
        if isinstance(message, Press) and message.button == "drive":
            return self._take(page, now)
        if page != self.driver:
            return self._who_drives()
        if isinstance(message, Slide):
            value = clamped(message.name, message.value)
            self._base = replace_checked(self._base, **{message.name: value})
        else:
            self._press(message.button, now)
        return ""

    def follow_lease(self, holder: str, now: float) -> None:
        """Take in the name of the lease's holder, by the supervisor; empty if there is none."""
        self._holder = holder
        if self.driver is None or holder in ("", self._name):
            return
        if now - self._taken > GRANT_TIME:
            self.notice = f"{holder} drives"
            self.driver = None  # without a stop: another operator drives the robot now

    def follow_power(self, powered: bool) -> None:
        """Take in whether the drives have power; after a loss it must be commanded anew."""
        if self._powered and not powered:
            self._rest(power=False)
        self._powered = powered

    def disarm(self) -> None:
        """Begin a new episode: command stand without speed."""
        self._rest()

    def linked(self, now: float) -> bool:
        """Whether the link to the page that drives is good."""
        return self.driver is not None and self._fresh(self._pages[self.driver], now)

    def link_age(self, page: int, now: float) -> float:
        """Age of the frame that the page's newest message echoes. In s."""
        return now - self._pages[page].echo

    def request(self, now: float) -> Request | None:
        """The present request to the robot; None while there is nothing to send.

        The stop that ends a drive is returned once.
        """
        if self.driver is None:
            if now - self._stopped < STOP_TIME:
                self._parting = False
                return replace_checked(self._base, emergency_stop=True)
            parting, self._parting = self._parting, False
            return without_link(self._base) if parting else None
        if not self.linked(now):
            self.armed = False
            if now - self._linked > LAPSE:
                self._rest()
            return without_link(self._base)
        self._linked = now
        if self._base.mode == "segway":
            self._rode = now
        motion = self._motion(self._pages[self.driver].sticks)
        asks = self._holder not in ("", self._name) and now - self._taken < TAKE_OVER_TIME
        power = self._base.power and now - self._cycled >= _CYCLE
        return replace_checked(self._base, take_over=asks, power=power, **motion)

    def last_request(self) -> Request | None:
        """The stop to send when the node ends; None if no page drives."""
        if self.driver is None:
            return None
        self._rest()
        return without_link(self._base)

    @property
    def asked(self) -> Request:
        """The request of buttons and sliders, without the sticks."""
        return self._base

    @property
    def driver_name(self) -> str:
        """Name of the page that drives; empty if there is none."""
        return "" if self.driver is None else self._pages[self.driver].name

    def _fresh(self, page: _Page, now: float) -> bool:
        return page.visible and now - page.echo <= LINK_AGE

    def _take(self, page: int, now: float) -> str:
        if page == self.driver:
            return ""
        if self.driver is not None:
            rests = self._base.mode == "stand" and self._pages[self.driver].sticks.at_rest
            rests = rests and (now - self._rode >= RIDE_STOP or not self._base.power)
            if not rests and self.linked(now):
                return f"{self._who_drives()}; it can be taken over once the robot stands"
            self.notice = f"{self._pages[page].name} has taken over from {self.driver_name}"
        # Keep this node's power command: a change from on to off would be an emergency stop.
        power = self._base.power and self._powered is not False
        self._rest(power=power)
        self.driver, self._parting = page, False
        self._taken = self._linked = now
        return ""

    def _press(self, button: str, now: float) -> None:
        if button == "leave":
            self._release()
        elif button == "power" and not (self._base.power and self._powered):
            if self._base.power and self._powered is False:
                self._cycled = now  # power was refused: switch it off and on again
            self._rest(power=True, emergency_stop=False)
        elif button in MODES:
            self.armed = self.armed and button == self._base.mode
            self._base = replace_checked(self._base, mode=button)
        elif button == "neutral":
            fresh = {name: getattr(Request(), name) for name in SLIDERS}
            self._base = replace_checked(self._base, **fresh)
        elif button in ORDERS:
            self.orders.append(button)

    def _stop(self, now: float) -> None:
        self._stopped = now
        self._rest(power=False, emergency_stop=self.driver is not None)

    def _release(self) -> None:
        self._rest(emergency_stop=False)
        self.driver, self._parting = None, True

    def _rest(self, **changes: bool) -> None:
        """Command stand, without speed until the sticks were at rest."""
        self._base = replace_checked(stopped(self._base), mode="stand", **changes)
        self.armed = False

    def _motion(self, sticks: Sticks) -> dict[str, float]:
        """Set-points that the sticks change."""
        base, reach = self._base, self.reach
        if not self.armed or base.mode == "stand":
            return {}
        if base.mode == "segway":
            com_x = clamped("com_x", base.com_x + reach.lean * sticks.forward)
            com_y = clamped("com_y", base.com_y + reach.lean * sticks.turn)
            return {"com_x": com_x, "com_y": com_y}
        along = reach.forward if sticks.forward > 0.0 else reach.backward
        return {
            "vx": along * sticks.forward,
            "vy": reach.sideways * sticks.left,
            "yaw_rate": reach.turn * sticks.turn,
        }

    def _who_drives(self) -> str:
        return f"{self.driver_name} drives" if self.driver is not None else "press Drive first"
