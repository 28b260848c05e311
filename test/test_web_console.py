"""The real robot, driven from a real browser."""

import math
import re
import time

import pytest
from bringup import WALK, Robot

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

    def until(condition, what, act):
        """Act now and every two seconds, since a page that was late has to begin anew."""
        acted = -math.inf

        def done():
            nonlocal acted
            if condition():
                return True
            if time.monotonic() - acted > 2.0:
                act()
                acted = time.monotonic()
            return False

        eyes.wait_for(done, what)

    def click(button):
        page.evaluate("at => document.querySelector(at)?.click()", f"[data-press={button}]")

    def press(button, condition, what):
        until(condition, what, lambda: click(button))

    def hold(keys, condition, what):
        """Walk with keys held; after a lost link walk again, with keys pressed again."""
        driven = False

        def act():
            nonlocal driven
            if driven and eyes.mode == "walk" and text("driver") == "you drive":
                return  # it is on its way
            for key in keys:
                page.keyboard.up(key)
            click("walk")
            driven = eyes.mode == "walk" and text("driver") == "you drive"
            if driven:
                for key in keys:
                    page.keyboard.down(key)

        until(condition, what, act)
        for key in keys:
            page.keyboard.up(key)

    def text(name):
        return page.locator(f"#{name}").text_content().strip().lower()

    press("drive", lambda: "you drive" in text("driver"), "the lease")
    press("power", lambda: text("power") == "power is on", "power")
    eyes.wait_for(lambda: eyes.mode == "stand", "standing in the gantry")
    press("lower", lambda: eyes.height() < 0.95, "the ground")
    eyes.wait_for(lambda: eyes.mode == "stand" and text("readiness") == "it stands", "standing")
    press("walk", lambda: eyes.mode == "walk", "walking")
    began, _ = eyes.position()
    hold("w", lambda: eyes.position()[0] > began + 1.0, "a metre ahead")
    yaw = eyes.yaw()
    hold("wa", lambda: eyes.yaw() > yaw + 0.5, "a turn to the left")
    press("stand", lambda: eyes.mode == "stand", "standing again")
    assert robot.stands()
    page.keyboard.press("Escape")
    eyes.wait_for(lambda: not robot.stands(), "power off")
    eyes.wait_for(lambda: text("mode") in ("fallen", "off"), "the page to say so")
    assert errors == []


@pytest.mark.parametrize("flags", [[], ["--commands"]], ids=str)
def test_a_replayed_bag_is_shown(tmp_path, browser, flags):
    """A bag as `record` writes it holds what every node publishes; other nodes publish it, too."""
    walk = (*WALK, {"t": 3.0, "vx": 0.5})
    with Robot(tmp_path / "recorded", operator=walk) as robot:
        eyes = robot.eyes
        bag = robot.record()
        robot.start()
        eyes.wait_for(lambda: eyes.position()[0] > 2.0, "two metres")
        robot.processes.stop()
    with Robot(tmp_path / "replayed") as robot:
        page = browser.new_page(viewport=SCREEN)
        page.goto(address_of(robot))
        replay = [executable("cassie_bags", "replay"), bag, "--start", "5", "--loop", *flags]
        robot.processes.start("replay", replay)

        def speeds():
            """Forward: commanded, limited, achieved."""
            robot.processes.check("replay")
            return page.locator("#speeds tr[data-row='0'] td").all_text_contents()

        def walks():
            achieved = speeds()[2]
            return achieved[:1].isdigit() and float(achieved) > 0.3

        robot.eyes.wait_for(walks, "a walk")
        if flags:
            robot.eyes.wait_for(lambda: speeds()[:2] == ["0.50", "0.50"], "what was asked for")
        robot.eyes.wait_for(lambda: page.locator("#mode").text_content() == "walk", "its mode")
