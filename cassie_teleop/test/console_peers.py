"""Stand-ins for the tests of web_console: the process, a page without a browser, a robot."""

import asyncio
import functools
import json
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import aiohttp

from cassie_msgs.layout import OperatorCommand, RobotState
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.ros.fast_lane import EVERY, LanePublisher, LaneSubscription, LaneWaiter

CODE = "from cassie_teleop.ros.web_console import main; main()"


class WebConsole:
    """The process and its address."""

    def __init__(self, *arguments):
        command = [sys.executable, "-c", CODE, "--ros-args", "-p", "port:=0", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().split()[-1]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    @property
    def name(self):
        return f"web_console-{self.process.pid}"

    @property
    def memory(self):
        """Resident memory. In MiB."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024


class Page:
    """A page without a browser: answers frames with heartbeats while it is awake."""

    def __init__(self, address):
        self.address = address
        self.sticks = {"forward": 0.0, "left": 0.0, "turn": 0.0}
        self.awake = True
        self.visible = True
        self.frame, self.status, self.told = {}, {}, ""
        self.closed = False
        self._to_say = []
        self._opened = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    def __enter__(self):
        self._thread.start()
        assert self._opened.wait(20)
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.closed = True
        self._thread.join(10)

    def press(self, button):
        self._to_say.append({"press": button})

    async def _run(self):
        base = self.address.partition("?")[0]
        origin = base.rstrip("/")
        jar = aiohttp.CookieJar(unsafe=True)
        async with aiohttp.ClientSession(cookie_jar=jar) as session:
            async with session.get(self.address) as answer:
                assert answer.status == 200
            async with session.ws_connect(f"{origin}/socket", headers={"Origin": origin}) as socket:
                self.hello = await socket.receive_json()
                self._opened.set()
                while not self.closed:
                    try:
                        message = await socket.receive(timeout=0.05)
                    except asyncio.TimeoutError:
                        continue
                    if message.type is not aiohttp.WSMsgType.TEXT:
                        return
                    self._follow(json.loads(message.data))
                    echo = self.frame.get("t", 0.0)
                    if self.awake and "t" in self.frame:
                        say = [{"visible": self.visible, **self.sticks}, *self._to_say]
                        self._to_say.clear()
                        for each in say:
                            await socket.send_json({"echo": echo, **each})

    def _follow(self, message):
        self.told = message.get("told", self.told)
        self.status = message.get("status", self.status)
        if "t" in message:
            self.frame = message


class Robot:
    """What the console sees of a robot and its supervisor, and what it sends to them."""

    def __init__(self, node):
        self.commands = []
        self.lost = False  # whether the page's link was lost at any time
        self.state = RobotState()
        self.status = SupervisorStatus(mode="stand", requested="stand", armed=True)
        self._states = LanePublisher(node, RobotState)
        self._statuses = node.create_publisher(SupervisorStatus, "/cassie/supervisor_status", 10)
        self._subscription = LaneSubscription(node, OperatorCommand, qos=EVERY)
        self._waiter = LaneWaiter(node, [self._subscription])
        self._said = 0.0

    @property
    def readers(self):
        """Number of nodes that get both its states and statuses."""
        return min(self._states.matched, self._statuses.get_subscription_count())

    def until(self, condition, timeout=90.0):
        """Live on until a condition holds; returns what it says."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            self._live()
            if found := condition():
                return found
        raise AssertionError("it has not come to that")

    def command(self, condition):
        """The first command from now on of which a condition holds."""
        self.commands.clear()
        return self.until(lambda: next((c for c in self.commands if condition(c)), None))

    def moving(self, condition=lambda command: command.vx > 0.0):
        """As `command`, of one that moves it; fails at once where the link is lost meanwhile."""
        self.commands.clear()
        found = self.until(
            lambda: self.lost or next((c for c in self.commands if condition(c)), None)
        )
        assert found is not True, "the page's link was lost"
        return found

    def _live(self):
        if time.monotonic() - self._said > 0.02:
            self._said = time.monotonic()
            self.state.stamp_ns = self.state.stamp_ns + 20_000_000
            self._states.publish(self.state)
            self._statuses.publish(self.status)
        self._waiter.wait(0.005)
        command = OperatorCommand()
        while self._subscription.take_next(command):
            self.commands.append(command)
            self.lost = self.lost or not command.link
            command = OperatorCommand()


def again_after_a_lost_link(test):
    """Try a test of the page again, up to five times, if its link was lost or the browser was slow.

    A link that is late by 0.3 s is lost, and on a busy machine that may happen at any moment. The
    robot then stops, and keys that are held count no more, which is right. Each further try waits
    longer for the machine to become less busy.
    """

    @functools.wraps(test)
    def tried(*args, robot, **more):
        for left in reversed(range(6)):
            robot.lost = False
            try:
                return test(*args, robot=robot, **more)
            except Exception as error:  # the browser's own time-out is known by its name alone
                again = robot.lost or type(error).__name__ == "TimeoutError"
                if not (again and left):
                    raise
                time.sleep(5.0 * (6 - left))
        return None

    return tried
