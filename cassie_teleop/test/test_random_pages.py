"""Random input from fifty pages at once: the console stays, keeps its ranges and does not grow.

`CASSIE_RANDOM_INPUT=600` makes it last ten minutes instead of seconds.
"""

import asyncio
import json
import math
import os
import threading
import time
from contextlib import suppress

import aiohttp
import numpy as np
import pytest
from console_peers import Page, Robot, WebConsole

from cassie_teleop.page_messages import BUTTONS, RECORD, SLIDERS
from cassie_teleop.requests import clamped

SECONDS = float(os.environ.get("CASSIE_RANDOM_INPUT", "10"))
CLIENTS = 50
_GROWTH = 8.0  # MiB
_LONGEST_VISIT = 5.0  # s
_WILD = (float("nan"), float("inf"), -1e308, 1e9, -1.0, 0.0, 0.5, None, "1", [], True)
_PRESSES = tuple(button for button in BUTTONS if button != RECORD)  # would start processes
_WHAT = ("bytes", "text", "wild", "raw", "beat", "press", "slide", "leave")
_SHARES = (0.01, 0.01, 0.01, 0.01, 0.6, 0.2, 0.1, 0.06)
_SETPOINTS = ("vx", "vy", "yaw_rate", "height", "com_x", "com_y", "roll", "pitch")


class Crowd:
    """Pages that say anything, and come back when they are put out."""

    def __init__(self, address, seed):
        self._origin = address.partition("?")[0].rstrip("/")
        self._seed = seed
        self._ended = False
        self.said = self.visits = 0
        self.failures = []
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended = True
        self._thread.join(20)
        assert not self._thread.is_alive()

    async def _run(self):
        connector = aiohttp.TCPConnector(limit=0)
        async with aiohttp.ClientSession(connector=connector) as session:
            rngs = [np.random.default_rng([self._seed, i]) for i in range(CLIENTS)]
            try:
                await asyncio.gather(*(self._come_and_go(session, rng) for rng in rngs))
            except Exception as error:  # told by the test, from its own thread
                self.failures.append(error)

    async def _come_and_go(self, session, rng):
        while not self._ended:
            with suppress(aiohttp.ClientError, ConnectionError, asyncio.TimeoutError):
                await asyncio.wait_for(self._visit(session, rng), _LONGEST_VISIT)
            await asyncio.sleep(rng.uniform(0.0, 0.2))

    async def _visit(self, session, rng):
        headers = {"Origin": self._origin}
        timeout = aiohttp.ClientWSTimeout(ws_close=1.0)
        socket = session.ws_connect(f"{self._origin}/socket", headers=headers, timeout=timeout)
        async with socket as opened:
            self.visits += 1
            await self._talk(opened, rng)

    async def _talk(self, socket, rng):
        echo = 0.0
        while not self._ended and not socket.closed:
            with suppress(asyncio.TimeoutError):
                message = await socket.receive(timeout=rng.uniform(0.01, 0.2))
                if message.type is aiohttp.WSMsgType.TEXT:
                    echo = json.loads(message.data).get("t", echo)
            what = str(rng.choice(_WHAT, p=_SHARES))
            self.said += 1
            if what == "leave":
                return
            if what == "raw":
                if (connection := socket._response.connection) is not None:
                    connection.transport.write(rng.bytes(int(rng.integers(1, 200))))
            elif what == "bytes":
                await socket.send_bytes(rng.bytes(int(rng.integers(3000))))
            elif what == "text":
                text = rng.bytes(int(rng.integers(800))).decode("latin-1")
                await socket.send_str(text)
            else:
                await socket.send_str(json.dumps(_message(what, echo, rng)))


def _message(what, echo, rng):
    """A message of a page: as pages say it, or with values that none says."""
    if what == "wild":
        values = [_WILD[i] for i in rng.integers(len(_WILD), size=3)]
        shapes = (
            {"echo": values[0], "visible": True, "forward": values[1], "left": 0.0, "turn": 0.0},
            {"echo": echo, "press": values[1]},
            {"echo": echo, "slide": "height", "value": values[2]},
        )
        return shapes[rng.integers(len(shapes))]
    if what == "press":
        return {"echo": echo, "press": str(rng.choice(_PRESSES))}
    if what == "slide":
        value = float(rng.normal(scale=10.0 ** rng.integers(-2, 11)))
        return {"echo": echo, "slide": str(rng.choice(SLIDERS)), "value": value}
    sticks = rng.choice([0.0, 0.0, 0.5, -1.0], 3)
    axes = dict(zip(("forward", "left", "turn"), sticks.tolist(), strict=True))
    return {"echo": echo, "visible": bool(rng.random() < 0.9), **axes}


@pytest.mark.timeout(SECONDS + 600.0)
def test_fifty_pages_of_random_input_break_nothing(node, capfd):
    robot = Robot(node)
    with WebConsole() as console, Crowd(console.address, seed=20) as crowd:
        before, heard = 0.0, 0
        end = time.monotonic() + SECONDS
        while (left := end - time.monotonic()) > 0.0:
            deadline = time.monotonic() + 0.2
            robot.until(lambda until=deadline: time.monotonic() > until)
            if not before and left < 0.5 * SECONDS:
                before = console.memory
            for command in robot.commands:
                heard += 1
                for name in _SETPOINTS:
                    value = float(getattr(command, name))
                    assert math.isclose(value, clamped(name, value), abs_tol=1e-6), (name, value)
                if not command.link:
                    assert (command.vx, command.vy, command.yaw_rate) == (0.0, 0.0, 0.0)
                robot.state.power[...] = float(command.power)
            robot.commands.clear()
            assert console.process.poll() is None and not crowd.failures
        assert console.memory < before + _GROWTH
        assert heard > 10 and crowd.visits > CLIENTS and crowd.said > 50 * SECONDS
        with Page(console.address) as page:
            robot.until(lambda: page.status.get("heard"))
            page.press("stop")
            robot.command(lambda command: command.emergency_stop)
    assert "Traceback" not in capfd.readouterr().err
