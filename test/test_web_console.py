"""The real robot, driven from a real browser."""

import re
import time

import pytest
from bringup import Robot

from cassie_bags.ros.processes import executable

SCREEN = {"width": 1280, "height": 760}


@pytest.fixture
def robot(tmp_path):
    simulator = {"scripted_operator": False, "max_rate": 1.0, "start": "gantry"}
    supervisor = {"scripted_operator": False}
    with Robot(tmp_path, simulator=simulator, mode_supervisor=supervisor) as robot:
        robot.start("state_estimator", "gait_controller", "mode_supervisor", "simulator")
        yield robot


def address_of(robot):
    """Start the console; returns the address that it prints."""
    program = executable("cassie_teleop", "web_console")
    robot.processes.start("web_console", [program, "--ros-args", "-p", "port:=0"])
    log = robot.folder / "log" / "web_console.log"
    found = []

    def printed():
        found[:] = re.findall(r"http://\S+", log.read_text() if log.exists() else "")
        return found

    robot.eyes.wait_for(printed, "the address")
    return found[0]


def test_stand_walk_turn_stop_stand_and_emergency_stop(robot, browser):
    eyes = robot.eyes
    page = browser.new_page(viewport=SCREEN)
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(address_of(robot))

    def press(button, condition, what):
        """Press a button, again where the link was too slow for it, until a condition holds."""
        pressed = 0.0

        def done():
            nonlocal pressed
            if condition():
                return True
            if time.monotonic() - pressed > 2.0:
                pressed = time.monotonic()
                page.evaluate("at => document.querySelector(at)?.click()", f"[data-press={button}]")
            return False

        eyes.wait_for(done, what)

    def text(name):
        return page.locator(f"#{name}").text_content().strip().lower()

    press("drive", lambda: "you drive" in text("driver"), "the lease")
    press("power", lambda: text("power") == "power is on", "power")
    press("lower", lambda: eyes.height() < 0.95, "the ground")
    eyes.wait_for(lambda: eyes.mode == "stand" and text("readiness") == "it stands", "standing")
    press("walk", lambda: eyes.mode == "walk", "walking")
    eyes.wait_for(lambda: text("driver") == "you drive", "sticks that count")
    began, _ = eyes.position()
    page.keyboard.down("w")
    eyes.wait_for(lambda: eyes.position()[0] > began + 1.0, "a metre ahead")
    page.keyboard.down("a")
    yaw = eyes.yaw()
    eyes.wait_for(lambda: eyes.yaw() > yaw + 0.5, "a turn to the left")
    page.keyboard.up("a")
    page.keyboard.up("w")
    press("stand", lambda: eyes.mode == "stand", "standing again")
    assert robot.stands()
    page.keyboard.press("Escape")
    eyes.wait_for(lambda: not robot.stands(), "power off")
    eyes.wait_for(lambda: text("mode") in ("fallen", "off"), "the page to say so")
    assert errors == []
