"""The page in a real browser, in front of a stand-in for the robot."""

import re
import time
from contextlib import contextmanager

import pytest
from console_peers import Robot, WebConsole, again_after_a_lost_link
from geometry_msgs.msg import TransformStamped
from mcap.reader import make_reader
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from slow_wire import SlowWire
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from cassie_msgs.layout import RobotMode, RobotState

DESKTOP = {"width": 1000, "height": 620}
PHONES = {"portrait": {"width": 390, "height": 844}, "landscape": {"width": 844, "height": 390}}
FOOT = """
    <link name="{0}_toe"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
    <joint name="{0}" type="revolute"><parent link="pelvis"/><child link="{0}_toe"/></joint>
"""
FEET = f"<robot><link name='pelvis'/>{FOOT.format('left')}{FOOT.format('right')}</robot>"
NONE = "\N{EN DASH}"
PAD = """
    window.pads = [];
    navigator.getGamepads = () => window.pads;
    window.pad = (axes, down) => (window.pads = [{
        connected: true, mapping: "standard", axes,
        buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: i === down })),
    }]);
"""


class Driver:
    """A page in a browser, beside a robot that lives on while something is waited for."""

    def __init__(self, page, robot):
        self.page, self.robot = page, robot
        self.errors = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))

    def open(self, address):
        self.page.goto(address)
        self.robot.until(lambda: self.text("mode") == "stand" and self.can("take"))

    def text(self, name):
        return self.page.locator(f"#{name}").text_content().strip().lower()

    def can(self, name):
        return self.page.locator(f"#{name}").is_enabled()

    def press(self, button, condition):
        """Press a button, again where the page was too slow for it, until a condition holds."""
        pressed = 0.0

        def done():
            nonlocal pressed
            if condition():
                return True
            if time.monotonic() - pressed > 1.0:
                pressed = time.monotonic()
                self.page.evaluate(
                    "at => document.querySelector(at)?.click()", f"[data-press={button}]"
                )
            return False

        self.robot.until(done)

    def drive(self, mode="walk"):
        self.press("drive", lambda: "you drive" in self.text("driver"))
        self.press("power", lambda: any(c.power for c in self.robot.commands))
        self.robot.state.power[...] = 1.0
        self.robot.until(lambda: self.text("power") == "power is on")
        wanted = RobotMode[mode.upper()]
        self.press(mode, lambda: self.robot.commands and self.robot.commands[-1].mode == wanted)
        self.ready(mode)

    def ready(self, mode):
        """Wait until the page shows that a mode is asked for and that the sticks count."""
        asked = self.page.locator(f"[data-mode={mode}]")
        self.robot.until(
            lambda: (
                re.search(r"\b(on|asked)\b", asked.get_attribute("class") or "")
                and self.text("driver") == "you drive"
            )
        )


@pytest.fixture
def robot(node):
    robot = Robot(node)
    robot.status.walk_readiness = "too bright"
    return robot


@pytest.fixture
def console():
    with WebConsole() as console:
        yield console


@contextmanager
def driver_of(browser, robot, address, size=DESKTOP, **options):
    context = browser.new_context(viewport=size, **options)
    context.add_init_script(PAD)
    driver = Driver(context.new_page(), robot)
    try:
        driver.open(address)
        yield driver
        assert driver.errors == []
    finally:
        context.close()


def middle(locator):
    box = locator.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@again_after_a_lost_link
def test_sticks_are_driven_by_mouse_and_letting_go_is_stop(browser, robot, console):
    with driver_of(browser, robot, console.address) as driver:
        driver.drive()
        mouse = driver.page.mouse
        x, y = middle(driver.page.locator("#move-stick"))
        mouse.move(x, y)
        mouse.down()
        mouse.move(x, y - 80, steps=4)
        assert robot.command(lambda c: c.vx > 0.7).vy == 0.0
        mouse.move(x - 80, y, steps=4)
        robot.command(lambda c: c.vy > 0.2)
        mouse.up()
        robot.command(lambda c: c.vx == 0.0 and c.vy == 0.0)
        x, y = middle(driver.page.locator("#turn-stick"))
        mouse.move(x, y)
        mouse.down()
        mouse.move(x + 80, y, steps=4)
        robot.command(lambda c: c.yaw_rate < -0.5)
        mouse.up()
        robot.command(lambda c: c.yaw_rate == 0.0)


@again_after_a_lost_link
def test_two_fingers_move_both_sticks(browser, robot, console):
    phone = {"size": PHONES["portrait"], "has_touch": True, "is_mobile": True}
    with driver_of(browser, robot, console.address, **phone) as driver:
        driver.drive()
        touch = driver.page.context.new_cdp_session(driver.page)

        def fingers(kind, *points):
            points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        (x1, y1), (x2, y2) = (
            middle(driver.page.locator(f"#{name}-stick")) for name in ("move", "turn")
        )
        fingers("touchStart", (x1, y1))
        fingers("touchStart", (x1, y1), (x2, y2))
        fingers("touchMove", (x1, y1 - 70), (x2 - 70, y2))
        robot.command(lambda c: c.vx > 0.5 and c.yaw_rate > 0.3)
        fingers("touchEnd")
        robot.command(lambda c: c.vx == 0.0 and c.yaw_rate == 0.0)


@again_after_a_lost_link
def test_keys_drive_while_they_are_held_and_a_lost_focus_lets_go(browser, robot, console):
    with driver_of(browser, robot, console.address) as driver:
        driver.drive()
        keyboard = driver.page.keyboard
        keyboard.down("w")
        assert robot.moving().vx == pytest.approx(0.4)
        keyboard.down("Shift")
        keyboard.down("ArrowLeft")
        command = robot.command(lambda c: c.yaw_rate > 0.0)
        assert (command.vx, command.yaw_rate) == pytest.approx((0.8, 0.6))
        keyboard.up("w")
        assert robot.command(lambda c: c.vx == 0.0).yaw_rate > 0.0
        driver.page.evaluate("dispatchEvent(new Event('blur'))")
        robot.command(lambda c: c.yaw_rate == 0.0)
        keyboard.press("1")
        robot.command(lambda c: c.mode == RobotMode.STAND)


@again_after_a_lost_link
def test_a_key_that_is_released_during_a_shortcut_is_let_go(browser, robot, console):
    with driver_of(browser, robot, console.address) as driver:
        driver.drive()
        keyboard = driver.page.keyboard
        for modifier in ("Control", "Alt", "Meta"):
            keyboard.down("w")
            robot.moving()
            keyboard.down(modifier)
            keyboard.up("w")
            keyboard.up(modifier)
            robot.command(lambda c: c.vx == 0.0)


@again_after_a_lost_link
def test_a_key_is_sent_while_it_is_handled_not_by_a_timer(browser, robot, console):
    """A browser lets timers wait for the picture that follows an input: 40 ms and more here."""
    with driver_of(browser, robot, console.address) as driver:
        driver.drive()
        sent = driver.page.evaluate("""
            async () => {
                const sent = [];
                const send = WebSocket.prototype.send;
                WebSocket.prototype.send = function (text) {
                    sent.push(JSON.parse(text).forward);
                    send.call(this, text);
                };
                const event = (kind) => new KeyboardEvent(kind, { code: "KeyW" });
                const seen = [];
                for (const kind of ["keydown", "keyup"]) {
                    await new Promise((go) => setTimeout(go, 30)); // a person is slower
                    sent.length = 0;
                    window.dispatchEvent(event(kind));
                    seen.push([...sent]);
                }
                return seen;
            }
        """)
        assert sent == [[0.5], [0]]


def test_a_gamepad_drives_and_its_button_stops(browser, robot, console):
    with driver_of(browser, robot, console.address) as driver:
        driver.drive(mode="stand")
        driver.page.evaluate("pad([0, 0, 0, 0], 3)")  # Y
        robot.command(lambda c: c.mode == RobotMode.WALK)
        driver.page.evaluate("pad([0, 0, 0, 0], -1)")
        driver.ready("walk")
        driver.page.evaluate("pad([0.05, -1, 1, 0], -1)")
        command = robot.command(lambda c: c.vx > 0.7)
        assert command.vy == 0.0 and command.yaw_rate < -0.5
        driver.page.evaluate("window.pads = []")  # unplugged
        robot.command(lambda c: c.vx == 0.0 and c.yaw_rate == 0.0)
        driver.page.evaluate("pad([0, 0, 0, 0], 1)")  # B
        assert not robot.command(lambda c: c.emergency_stop).power


def test_a_gamepad_that_is_plugged_in_is_named_and_whether_it_drives(browser, robot, console):
    plug = """(mapping) => dispatchEvent(Object.assign(
        new Event("gamepadconnected"), { gamepad: { id: "Pad 7", mapping } }
    ))"""
    with driver_of(browser, robot, console.address) as driver:
        driver.page.evaluate(plug, "standard")
        assert driver.text("notice") == "gamepad: pad 7"
        driver.page.evaluate(plug, "")
        assert "pad 7: its layout is unknown" in driver.text("notice")


@pytest.mark.parametrize("how", ["button", "Escape", "o"])
@again_after_a_lost_link
def test_the_emergency_stop_works_from_a_page_that_looks_on(browser, robot, console, how):
    with driver_of(browser, robot, console.address) as driver:
        if how == "button":
            driver.page.locator("#stop").click()
        else:
            driver.page.keyboard.press(how)
        assert not robot.command(lambda c: c.emergency_stop).power


@pytest.mark.parametrize("how", ["cut", "slow", "hidden", "asleep"])
@again_after_a_lost_link
def test_a_link_that_is_cut_or_late_a_hidden_and_a_sleeping_page_stop_it(
    browser, robot, console, how
):
    port = int(re.search(r":(\d+)/", console.address)[1])
    with (
        SlowWire(port) as wire,
        driver_of(browser, robot, f"http://127.0.0.1:{wire.port}/") as driver,
    ):
        driver.drive()
        driver.page.keyboard.down("w")
        robot.moving()
        if how == "cut":
            wire.cut = True
        elif how == "slow":
            wire.delay = 0.2  # either way
        elif how == "hidden":
            driver.page.evaluate("""
                Object.defineProperty(document, "hidden", { value: true, configurable: true });
                document.dispatchEvent(new Event("visibilitychange"));
            """)
        else:
            driver.page.evaluate("""
                setTimeout(() => { const t = Date.now(); while (Date.now() - t < 2000); }, 50)
            """)
        lost = robot.command(lambda c: not c.link)
        assert (float(lost.vx), bool(lost.power)) == (0.0, True)
        if how == "cut":
            robot.until(lambda: "offline" in driver.page.locator("body").get_attribute("class"))
            assert driver.page.locator("#offline").is_visible()
            assert (driver.text("mode"), driver.text("readiness")) == (NONE, "connecting …")


@again_after_a_lost_link
def test_a_second_page_looks_on_and_is_told_who_drives(browser, robot, console):
    with (
        driver_of(browser, robot, console.address) as first,
        driver_of(browser, robot, console.address) as second,
    ):
        first.drive()
        robot.until(lambda: "view only: page" in second.text("driver"))
        for name in ("walk", "stand", "segway", "power", "neutral"):
            assert second.page.locator(f"[data-press={name}]").first.is_disabled()
        assert second.text("take") == "take over"
        second.page.keyboard.down("w")
        second.press("drive", lambda: "drives" in second.text("notice"))
        assert not any(c.vx for c in robot.commands)
        assert first.text("driver") == "you drive"


@again_after_a_lost_link
def test_a_page_that_looks_on_can_record(browser, robot, tmp_path):
    with (
        WebConsole("-p", f"bags:={tmp_path}") as console,
        driver_of(browser, robot, console.address) as driver,
    ):
        record = driver.page.locator("#record")
        record.evaluate("button => button.click()")
        robot.until(lambda: driver.text("record") == "end recording")
        name = driver.text("bag")
        robot.until(lambda: robot.readers == 2)  # the page and the recorder
        recorded = int(robot.state.stamp_ns) + 1_000_000_000
        robot.until(lambda: robot.state.stamp_ns > recorded)
        record.evaluate("button => button.click()")
        robot.until(lambda: driver.text("record") == "record")
        robot.until(lambda: f"recorded {tmp_path / name}".lower() in driver.text("notice"))
    with (tmp_path / name).open("rb") as bag:
        topics = {channel.topic for _, channel, _ in make_reader(bag).iter_messages()}
    assert {RobotState.TOPIC, "/cassie/supervisor_status"} <= topics


@again_after_a_lost_link
def test_the_height_is_unknown_without_a_place_or_a_state_of_the_robot(
    browser, node, robot, console
):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    description = node.create_publisher(String, "/robot_description", latched)
    description.publish(String(data=FEET))
    places = node.create_publisher(TFMessage, "/tf", 10)

    def placed(heights):
        """Publish the heights of links, until the page shows a height of the pelvis or none."""
        transforms = [TransformStamped(child_frame_id=name) for name in heights]
        for transform, height in zip(transforms, heights.values(), strict=True):
            transform.transform.translation.z = height
        places.publish(TFMessage(transforms=transforms))
        cells = driver.page.locator("#speeds tr[data-row='3'] td")
        return cells.last.text_content()

    feet = {"left_toe": -0.88, "right_toe": -0.88}
    with driver_of(browser, robot, console.address) as driver:
        robot.until(lambda: driver.page.locator("#empty").is_hidden())
        robot.until(lambda: placed(feet) == NONE)  # a page that has just opened shows nothing
        for _ in range(10):
            assert placed(feet) == NONE
            driver.page.wait_for_timeout(50)
        robot.until(lambda: placed({"pelvis": 0.9, **feet}) == "0.90")
        deadline = time.monotonic() + 90.0
        while placed({"pelvis": 0.9, **feet}) != NONE:  # and the robot's states are silent
            assert time.monotonic() < deadline
            driver.page.wait_for_timeout(50)
        assert driver.text("factor") == NONE


LEVEL = """
    async (heights) => {
        const { RobotView } = await import("/web/robot_view.js");
        const view = Object.create(RobotView.prototype);
        view.robot = { root: { position: { z: 1 } }, soles: [[{ radius: 0 }], [{ radius: 0 }]] };
        Object.assign(view, { level: null, contact: [false, false] });
        for (const z of heights) view.stand([[{ z }], [{ z }]], [0, 0]);
        return view.level;
    }
"""


def test_the_ground_hides_no_foot_of_a_robot_that_hangs(browser, robot, console):
    """After a reset the feet were in the ground: the first picture still had the old place."""
    with driver_of(browser, robot, console.address) as driver:
        assert driver.page.evaluate(LEVEL, [0.0, -0.2]) == -0.2
        assert driver.page.evaluate(LEVEL, [0.0, 0.2]) == 0.0


@again_after_a_lost_link
def test_a_new_episode_has_no_footsteps_of_before(browser, robot, console, node):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    description = node.create_publisher(String, "/robot_description", latched)
    description.publish(String(data=FEET))
    places = node.create_publisher(TFMessage, "/tf", 10)
    transforms = [TransformStamped(child_frame_id=f) for f in ("left_toe", "right_toe", "pelvis")]
    robot.state.contact_probability[...] = 1.0

    def steps():
        places.publish(TFMessage(transforms=transforms))
        return driver.page.locator("#view").get_attribute("data-steps")

    with driver_of(browser, robot, console.address) as driver:
        robot.until(lambda: steps() == "2")
        robot.state.contact_probability[...] = 0.0
        assert steps() == "2"
        robot.state.episode[...] += 1
        robot.until(lambda: steps() == "0")
        # On a Segway there is no ground under the feet: marks would lie in the air beside it.
        segway = node.create_publisher(Odometry, "/segway/ground_truth", 10)

        def rides():
            segway.publish(Odometry())
            steps()
            return not driver.page.locator("#vehicle").evaluate("row => row.hidden")

        robot.until(rides)
        robot.state.contact_probability[...] = 1.0
        end = time.monotonic() + 1.0
        robot.until(lambda: rides() and time.monotonic() > end)
        assert steps() == "0"


@again_after_a_lost_link
def test_words_say_what_the_robot_waits_for(browser, robot, console):
    robot.status.faults = ["left knee is warm"]
    with driver_of(browser, robot, console.address) as driver:
        robot.until(lambda: "left knee is warm" in driver.text("faults"))
        robot.status.requested, robot.status.readiness = "walk", "too bright"
        robot.until(lambda: driver.text("readiness") == "walk is asked for: too bright")
        walk = driver.page.locator("[data-mode=walk]")
        assert walk.get_attribute("title") == "too bright"
        assert not driver.page.locator("#simulator").is_visible()  # there is none


@again_after_a_lost_link
def test_the_panel_covers_no_stick_of_a_narrow_window(browser, robot, console):
    with driver_of(browser, robot, console.address) as driver:
        page = driver.page
        for width in (640, 905, 1000, 1041, 1280):
            page.set_viewport_size({"width": width, "height": 620})
            stage = page.locator("#stage").bounding_box()
            boxes = [page.locator(f"#{name}-stick").bounding_box() for name in ("move", "turn")]
            assert boxes[0]["x"] >= 0, width
            assert boxes[1]["x"] + boxes[1]["width"] <= stage["x"] + stage["width"], width


@pytest.mark.parametrize("orientation", PHONES)
@again_after_a_lost_link
def test_on_a_phone_everything_is_in_view_and_nothing_covers_the_stop(
    browser, robot, console, orientation
):
    phone = {"size": PHONES[orientation], "has_touch": True, "is_mobile": True}
    with driver_of(browser, robot, console.address, **phone) as driver:
        page = driver.page
        driver.drive()
        names = ["#stop", "#take", "#power", "#move-stick", "#turn-stick", "#open-panel"]
        names += [f"[data-mode={mode}]" for mode in ("stand", "walk", "segway")]
        boxes = {name: page.locator(name).bounding_box() for name in names}
        assert "Esc" not in page.locator("#stop").inner_text()
        width, height = page.viewport_size["width"], page.viewport_size["height"]
        for name, box in boxes.items():
            assert box["x"] >= 0 and box["x"] + box["width"] <= width, name
            assert box["y"] >= 0 and box["y"] + box["height"] <= height, name
            assert min(box["width"], box["height"]) >= 36, name
            for other, its in boxes.items():
                apart = (
                    box["x"] + box["width"] <= its["x"] + 1
                    or its["x"] + its["width"] <= box["x"] + 1
                    or box["y"] + box["height"] <= its["y"] + 1
                    or its["y"] + its["height"] <= box["y"] + 1
                )
                assert name == other or apart, (name, other)
        for panel in (False, True):
            if panel:
                page.locator("#open-panel").tap()
                assert driver.text("open-panel") == "close"
                robot.until(lambda: page.locator("#panel").bounding_box()["x"] < width - 100)
            x, y = middle(page.locator("#stop"))
            top = page.evaluate(f"document.elementFromPoint({x}, {y}).closest('button')?.id")
            assert top == "stop"
            robot.commands.clear()
            page.locator("#stop").tap()
            robot.command(lambda c: c.emergency_stop)
