"""Benchmark of the operator's interfaces: joystick and page, with the loop and a recorder."""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import re
import tempfile
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import Joy

from cassie_bags.errors import RunError
from cassie_bags.ros.command_node import command_node
from cassie_bags.ros.processes import Processes, environment, executable, own_domain
from cassie_msgs.layout import OperatorCommand
from cassie_msgs.operators import sender_of
from cassie_msgs.ros.fast_lane import EVERY, LaneSubscription, LaneWaiter
from cassie_msgs.ros.scheduling import Place, run_as, step_back

TIMEOUT = 60.0
"""Time-out until the robot is ready, and until it walks. In s of wall time."""

_RATE = 500.0  # Hz of the control loop
_MAX_LATENCY = 1.0  # s, time-out of a stick's command; a longer latency counts as this
_COMMAND_PERIOD = 0.005  # s between two checks for commands
_CHECK_PERIOD = 0.01  # s between two checks of anything else
_XBOX = {"start": 7, "walk": 3, "enable": 4}  # buttons; see the device file
_AXES, _BUTTONS = 8, 11


def operated(seconds: float) -> dict[str, float]:
    """Benchmark of a robot at wall-clock pace that a page drives, with a recorder and a joystick.

    The page is a client without a browser: drawing costs the browser's time, which may run on
    another computer. The joystick has no lease; its commands are published nevertheless.

    Args:
        seconds: Measured time of walking. In s.

    Returns:
        Share of the control ticks without a new command; the console's share of one processor;
        and the latencies from a stick to its command, for the page and for /joy. In ms.

    Raises:
        RunError: if the robot does not begin to walk.
    """
    with _robot() as (processes, listener):
        return asyncio.run(_operate(processes, listener, seconds))


class _Listener:
    """Publishes /joy and reads every operator command, as promptly as the supervisor does."""

    def __init__(self, node: Node) -> None:
        self._joy = node.create_publisher(Joy, "/joy", 10)
        self._commands = LaneSubscription(node, OperatorCommand, qos=EVERY)
        self._waiter = LaneWaiter(node, [self._commands])
        self._changed: dict[str, tuple[float, float]] = {}
        self._open = True
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        run_as(Place.OPERATOR)

    async def move(self, vx: float, *pressed: str) -> None:
        """Publish the positions of the joystick."""
        down = {_XBOX[name] for name in pressed}
        axes = [0.0, vx, *[0.0] * (_AXES - 2)]
        self._joy.publish(Joy(axes=axes, buttons=[int(i in down) for i in range(_BUTTONS)]))

    def changed(self, node: str) -> tuple[float, float]:
        """Forward speed that a node commands (m/s), and since when (monotonic time, s)."""
        return self._changed.get(node, (0.0, 0.0))

    def close(self) -> None:
        """End the reading."""
        self._open = False
        self._waiter.wake()
        self._thread.join()
        step_back()

    def _listen(self) -> None:
        command = OperatorCommand()
        while self._open:
            self._waiter.wait(1.0)
            now = time.monotonic()
            while self._commands.take_next(command):
                name, vx = sender_of(command).partition("-")[0], float(command.vx)
                if vx != self.changed(name)[0]:
                    self._changed[name] = (vx, now)


class _Page:
    """Client of a page: answers each frame, and drives."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.status: dict[str, Any] = {}
        self._socket = socket
        self._sticks = {"forward": 0.0, "left": 0.0, "turn": 0.0}
        self._echo = 0.0

    @property
    def mode(self) -> str:
        """Mode that the page shows; empty while the supervisor is silent."""
        return str((self.status.get("robot") or {"mode": ""})["mode"])

    async def live(self) -> None:
        """Answer frames until the link ends."""
        async for message in self._socket:
            content = json.loads(message.data)
            self.status = content.get("status", self.status)
            if "t" in content:
                self._echo = content["t"]
                await self.beat()

    async def beat(self, **sticks: float) -> None:
        """Send the positions of the sticks."""
        self._sticks |= sticks
        await self._socket.send_json({"echo": self._echo, "visible": True, **self._sticks})

    async def press(self, button: str) -> None:
        """Press a button."""
        await self._socket.send_json({"echo": self._echo, "press": button})


@contextmanager
def _robot() -> Iterator[tuple[Processes, _Listener]]:
    """The robot in the gantry, its console, a recorder and rc_teleop, in a domain of their own."""
    with (
        tempfile.TemporaryDirectory(prefix="cassie_bench_") as name,
        own_domain() as domain,
        command_node("bench", domain) as (node, _),
        Processes(environment(domain), Path(name) / "log") as processes,
    ):
        options = ["--console", "--realtime", "-p", "web_console:port:=0"]
        logs = Path(name) / "robot"
        robot = executable("cassie_bags", "robot")
        processes.start("robot", [robot, *options, "--logs", logs])
        recorder = executable("cassie_bags", "record")
        processes.start("record", [recorder, "-o", Path(name) / "bag.mcap"])
        teleop = executable("cassie_teleop", "rc_teleop")
        processes.start("rc_teleop", [teleop, "--ros-args", "-p", "device:=xbox"])
        listener = _Listener(node)
        try:
            yield processes, listener
        finally:
            listener.close()


async def _operate(processes: Processes, listener: _Listener, seconds: float) -> dict[str, float]:
    address = await _address(processes)
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{address}socket", headers={"Origin": address.rstrip("/")}) as socket,
    ):
        page = _Page(socket)
        living = asyncio.create_task(page.live())
        try:
            await _walk(page, listener)
            return await _measure(page, listener, processes, seconds)
        finally:
            living.cancel()


async def _address(processes: Processes) -> str:
    """Address of the page, once the robot can be driven."""

    def ready() -> re.Match[str] | None:
        processes.check()
        output = processes.log("robot").read_text(encoding="utf-8", errors="replace")
        return re.search(r"drive it: (http://\S+/)", output)

    return str((await _until(ready, "the robot to be ready"))[1])


async def _walk(page: _Page, listener: _Listener) -> None:
    """Drive by the page until the robot walks."""
    await _until(lambda: page.status, "the page")
    await page.press("drive")
    await _until(lambda: page.status.get("driver"), "the lease")
    await page.press("power")
    await _until(lambda: page.status["power"], "power")
    await page.press("lower")
    await _until(lambda: page.mode == "stand", "standing")
    await page.press("walk")
    await _until(lambda: page.mode == "walk", "walking")
    for button in ("start", "walk", "enable"):
        for _ in range(10):  # a press must last
            await listener.move(0.0, button)
            await asyncio.sleep(0.02)
    await page.beat(forward=0.5)
    await _until(lambda: listener.changed("web_console")[0] > 0.0, "the page to move it")
    await listener.move(0.5, "enable")
    await _until(lambda: listener.changed("rc_teleop")[0] > 0.0, "the joystick")


async def _measure(
    page: _Page, listener: _Listener, processes: Processes, seconds: float
) -> dict[str, float]:
    console = _child(processes.pid("robot"), "web_console")
    missed, used, began = _missed(page), _processor_time(console), time.monotonic()
    delays: dict[str, list[float]] = {"page": [], "joy": []}
    for number in itertools.count():
        if time.monotonic() - began > seconds:
            break
        share = 0.3 + 0.3 * (number % 97) / 97  # differs from the last one
        for stick, node, move in (
            ("page", "web_console", page.beat(forward=share)),
            ("joy", "rc_teleop", listener.move(share, "enable")),
        ):
            await asyncio.sleep(0.006 + 0.001 * (number % 15))
            delays[stick].append(await _delay(listener, node, move))
    took = time.monotonic() - began
    used = _processor_time(console) - used
    await asyncio.sleep(1.5)  # until the newest count has arrived
    return {
        "missed_share_realtime_500hz_operated": (_missed(page) - missed) / (_RATE * took),
        "page_processor_share": used / took,
        "stick_to_command_page_p99_ms": 1e3 * float(np.percentile(delays["page"], 99)),
        "stick_to_command_joy_p99_ms": 1e3 * float(np.percentile(delays["joy"], 99)),
    }


async def _delay(listener: _Listener, node: str, move: Awaitable[None]) -> float:
    """Latency from a move of a stick to the first command of its node with another speed. In s."""
    before = listener.changed(node)
    began = time.monotonic()
    await move
    while listener.changed(node) == before:
        await asyncio.sleep(_COMMAND_PERIOD)
        if time.monotonic() - began > _MAX_LATENCY:
            return _MAX_LATENCY
    return listener.changed(node)[1] - began


async def _until(condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + TIMEOUT
    while time.monotonic() < deadline:
        if result := condition():
            return result
        await asyncio.sleep(_CHECK_PERIOD)
    raise RunError(f"bench waited {TIMEOUT:g} s for {what}")


def _missed(page: _Page) -> int:
    return int(page.status["robot"]["missed"])


def _child(parent: int, name: str) -> int:
    """The child of a process whose command line has a name.

    Raises:
        RunError: if there is none.
    """
    for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        if name in Path(f"/proc/{child}/cmdline").read_text():
            return int(child)
    raise RunError(f"{name} does not run")


def _processor_time(pid: int) -> float:
    """Processor time that a process has used. In s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
