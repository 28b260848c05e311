"""Node web_console: a browser page that shows and drives the robot by topics only."""

from __future__ import annotations

import asyncio
import json
import math
import secrets
import socket
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rclpy.node import Node

from cassie_msgs.layout import OperatorCommand
from cassie_msgs.request import Request
from cassie_msgs.ros import parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.ros.scheduling import Place, Scheduling
from cassie_msgs.tunables import ParameterError, tunable
from cassie_teleop.console import LINK_AGE, Console, Reach
from cassie_teleop.page_messages import RECORD, Beat, Press, Slide
from cassie_teleop.page_server import PageServer, is_loopback
from cassie_teleop.robot_description import RobotDescription
from cassie_teleop.ros.console_topics import ConsoleTopics
from cassie_teleop.ros.recorder import Recorder, RecorderService
from cassie_teleop.ros.sender import Sender
from cassie_teleop.ros.simulator_services import SimulatorServices

_SHORTEST_TOKEN = 8  # characters
_LOOK = 1.0  # s between two checks of the ROS graph


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    host: str = tunable(
        "127.0.0.1",
        description="Address to listen on; one that other computers can reach needs the token",
        live=False,
    )
    port: int = tunable(8080, "", 0, 65535, "Port to listen on; 0 is any free one", live=False)
    token: str = tunable(
        "",
        description="Token that a browser must show; if one is needed, empty makes a new one",
        live=False,
    )
    rate: float = tunable(50.0, "Hz", 10, 200, "Rate of operator commands", live=False)
    frame_rate: float = tunable(25.0, "Hz", 5, 60, "Rate of updates of the page", live=False)
    bags: str = tunable("recordings", description="Folder for recordings", live=False)
    reach: Reach = field(default_factory=Reach)


class WebConsole(Node):
    """Connects pages with topics; without a page there are no subscriptions.

    Pages and topics are served alternately on the main thread. Where robot time follows the wall
    clock, this node has priority over browsers on the same computer, whose drawing must not delay
    the sticks.
    """

    def __init__(self, stop: process.Stop) -> None:
        """Begin to listen.

        Raises:
            ValueError: if a parameter is wrong.
            OSError: if the port is in use.
        """
        super().__init__("web_console")
        self._config = parameters.declare(self, Config())
        self._stop = stop
        self._sender = Sender(self)
        self._scheduling = Scheduling(self.get_logger().info, Place.OPERATOR)
        self._console = Console(self._sender.name, self._config.reach)
        parameters.on_change(self, lambda: self._config, self._configure)
        self._simulator = SimulatorServices(self, self._tell)
        self._recorder = Recorder(
            Path(self._config.bags).expanduser(), self._show, RecorderService(self, self._tell)
        )
        self._topics: ConsoleTopics | None = None
        self._description: RobotDescription | None = None
        self._described = 0
        self._pages: set[int] = set()
        self._graph: dict[str, Any] = {"orders": [], "heard": False}
        self._ending = False
        self._looked = -math.inf
        self._last: Request | None = None
        token = _token(self._config)
        try:
            self._server = PageServer(self._config.host, self._config.port, token, self)
        except OSError as error:
            other = "-p port:=0 takes a free one (with robot: -p web_console:port:=0)"
            raise OSError(f"{error}; {other}") from None
        self._address = _address(self._config.host, self._server.port, token)

    def loop(self) -> None:
        """Serve until stopped."""
        print(f"web_console: open {self._address}", flush=True)
        asyncio.run(self._serve())

    def close(self) -> None:
        """Send exactly one stop, if a page drove, and end a recording."""
        if self._last is not None:
            self._sender.send_last(self._last)
        self._recorder.close()

    # interface of the pages

    def join(self, page: int, address: str) -> dict[str, Any]:
        """Take in that a page was opened; the first one begins the subscriptions."""
        name = f"page {page} ({address})"
        self._console.join(page, name)
        self._pages.add(page)
        if self._topics is None:
            self._topics = ConsoleTopics(self)
            self._look()
            self._woken.set()
        return {"page": page, "name": name, "own": self._sender.name}

    def leave(self, page: int) -> None:
        """Take in that a page is gone; the last one ends the subscriptions."""
        self._console.leave(page)
        self._pages.discard(page)
        self._send()
        if not self._pages and self._topics is not None:
            self._woken.clear()
            self._topics.close()
            self._topics = None

    def hear(self, page: int, message: Beat | Press | Slide) -> str:
        """Take in a message of a page; sticks of the driving page and stops are sent at once.

        A page sends at most `MAX_RATE` messages per second.
        """
        now = time.monotonic()
        told = self._console.hear(page, message, now)
        stops = isinstance(message, Press) and message.button == "stop"
        drives = isinstance(message, Beat) and page == self._console.driver
        if stops or drives:
            self._send()
        while self._console.orders:
            self._do(self._console.orders.popleft())
        return told

    def _do(self, order: str) -> None:
        if order == RECORD:
            self._recorder.toggle()
        else:
            self._simulator.call(order, self._yaw)

    def late(self, page: int) -> bool:
        """Whether the link to a page is late."""
        return self._console.link_age(page, time.monotonic()) > LINK_AGE

    def links(self) -> list[dict[str, Any]]:
        """Links of the robot; empty while the robot is not known."""
        return self._description.links if self._description is not None else []

    def mesh(self, index: int) -> Path | None:
        """File of a mesh."""
        meshes = self._description.meshes if self._description is not None else []
        return meshes[index] if index < len(meshes) else None

    # periodic work

    async def _serve(self) -> None:
        ended, self._woken = asyncio.Event(), asyncio.Event()
        self._loop = asyncio.get_running_loop()

        def wake() -> None:
            with suppress(RuntimeError):  # the server has ended already
                self._loop.call_soon_threadsafe(ended.set)

        self._stop.on_request(wake)
        async with self._server.serving():
            works = (ended.wait(), self._send_commands(), self._send_frames(), self._look_around())
            tasks = [asyncio.create_task(work) for work in works]
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            self._last = self._console.last_request()
            self._ending = True  # messages of pages that close now are ignored
            for task in tasks:
                task.cancel()
        for task in done:
            task.result()

    async def _send_commands(self) -> None:
        while True:
            wait = self._looked + 1.0 / self._config.rate - time.monotonic()
            if wait > 0.0:  # after the last turn, or a page's message since then
                await asyncio.sleep(wait)
            elif not self._send() and not self._pages:
                await self._woken.wait()

    def _send(self) -> bool:
        """Whether there was a command to send; sends it."""
        now = self._looked = time.monotonic()
        request = None if self._ending else self._console.request(now)
        if request is not None:
            self._sender.send(request)
        return request is not None

    async def _send_frames(self) -> None:
        due = 0.0
        while True:
            await self._woken.wait()
            now = time.monotonic()
            due = max(due + 1.0 / self._config.frame_rate, now)
            if self._topics is not None:
                self._server.show(*self._frame(self._topics, now))
            await asyncio.sleep(due - time.monotonic())

    async def _look_around(self) -> None:
        while True:
            await self._woken.wait()
            self._look()
            await asyncio.sleep(_LOOK)

    def _look(self) -> None:
        """Check which nodes exist."""
        # One subscriber of operator commands is this node itself.
        heard = self.count_subscribers(OperatorCommand.TOPIC) > 1
        self._recorder.look()
        self._graph = {"orders": self._simulator.available(), "heard": heard}

    def _frame(self, topics: ConsoleTopics, now: float) -> tuple[str, str]:
        """JSON of the present values, and JSON of the values that seldom change."""
        topics.take(now)
        console, picture = self._console, topics.picture
        if topics.new_episode:
            console.disarm()
        robot = topics.robot(now)
        if robot is not None:
            console.follow_lease(topics.holder, now)
        if picture.state.fresh(now):
            self._scheduling.follow(picture.wall_paced)
            console.follow_power(picture.powered)
        if topics.description is not self._description:
            self._description, self._described = topics.description, self._described + 1
        frame = picture.figures(now, self._description)
        frame["t"] = now
        frame["ages"] = {page: round(console.link_age(page, now), 3) for page in self._pages}
        status: dict[str, Any] = {
            **self._graph,
            "robot": robot,
            "power": picture.powered if picture.state.fresh(now) else None,
            "reports": [*([topics.problem] if topics.problem else []), *topics.reports(now)],
            "described": self._described,
            "driver": console.driver,
            "driver_name": console.driver_name,
            "linked": console.linked(now),
            "armed": console.armed,
            "asked": asdict(console.asked),
            "notice": console.notice,
            "pages": len(self._pages),
            "recording": self._recorder.file if self._recorder.available else None,
        }
        return _json(frame), _json({"status": status})

    @property
    def _yaw(self) -> float:
        return 0.0 if self._topics is None else self._topics.picture.yaw

    def _tell(self, text: str) -> None:
        """Show the answer of a service; called by the executor's thread."""
        with suppress(RuntimeError):  # the pages' thread has ended
            self._loop.call_soon_threadsafe(self._show, text)

    def _show(self, text: str) -> None:
        """Show a line on all pages."""
        self._console.notice = text

    def _configure(self, config: Config) -> None:
        self._config = config
        self._console.reach = config.reach


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, separators=(",", ":"), allow_nan=False)


def _token(config: Config) -> str:
    """Token that a browser must show; empty for none.

    Raises:
        ParameterError: if the token is short enough to be guessed.
    """
    if config.token and len(config.token) < _SHORTEST_TOKEN:
        raise ParameterError(f"token has {len(config.token)} characters, needs {_SHORTEST_TOKEN}")
    if config.token or is_loopback(config.host):
        return config.token
    return secrets.token_urlsafe(16)


def _address(host: str, port: int, token: str) -> str:
    """Address to open; if the server listens on all addresses, the one that others can reach."""
    if host in ("0.0.0.0", "::"):
        host = socket.gethostname()
        with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # sends nothing; gives the local address for sending
            host = probe.getsockname()[0]
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/" + (f"?token={quote(token)}" if token else "")


ABOUT = About(
    package="cassie_teleop",
    text="Serves a page that shows and drives the robot in a browser. The address is printed.",
    reads=(
        "/cassie/state",
        "/cassie/mode",
        "/cassie/controller_status",
        "/cassie/supervisor_status",
        "/cassie/operator_command",
        "/segway/ground_truth",
        "/tf",
        "/robot_description",
        "/diagnostics",
    ),
    writes=("/cassie/operator_command",),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("web_console", WebConsole, ABOUT)
