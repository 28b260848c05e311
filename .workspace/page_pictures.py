"""Takes the pictures of the browser page that the READMEs show, in cassie_teleop/images.

Starts the robot with its console, walks it by the page's keys, and looks at it on a desktop, on a
phone upright and on its side. Needs Chromium. Run it in the shell of env.sh:
python3 .workspace/page_pictures.py
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, Route, expect, sync_playwright

IMAGES = Path(__file__).parents[1] / "cassie_teleop" / "images"
SCREENS: dict[str, dict[str, Any]] = {
    "console": {"viewport": {"width": 1280, "height": 760}},
    "console_phone": {
        "viewport": {"width": 390, "height": 844},
        "has_touch": True,
        "is_mobile": True,
    },
    "console_landscape": {
        "viewport": {"width": 844, "height": 390},
        "has_touch": True,
        "is_mobile": True,
    },
}
_CHANGES = {  # pictures as of a graphics card, but as seldom as the processor can draw them
    "robot_view.js": ("SOFTWARE.test(rendererName())", "false"),
    "console.js": ("graphics: 1000 / 30", "graphics: 500"),
}
_TIMEOUT = 10_000  # ms
_TRIES = 6
_WALK = 8_000  # ms, until the robot walks at its speed and the charts have lines


def main() -> None:
    """Take all pictures."""
    with robot() as address, browser() as chromium:
        for name, options in SCREENS.items():
            page = chromium.new_context(**options).new_page()
            page.route("**/web/*.js", changed)
            page.goto(address)
            walk(page)
            page.screenshot(path=IMAGES / f"{name}.png")
            page.keyboard.up("w")
            page.keyboard.up("Shift")
            press(page, "stand", "readiness", "it stands")
            press(page, "leave", "take", "Drive")
            page.context.close()
            print(IMAGES / f"{name}.png")


@contextmanager
def robot() -> Iterator[str]:
    """The robot with its console; the address of the page."""
    command = ["ros2", "run", "cassie_bags", "robot", "--console", "-p", "web_console:port:=0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield next(m[1] for line in process.stdout if (m := re.search(r"(http://\S+)", line)))
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


@contextmanager
def browser() -> Iterator[Browser]:
    """A Chromium that draws by the processor."""
    graphics = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    # Chromium is no ROS node: libraries of the workspace are not for it.
    clean = {key: value for key, value in os.environ.items() if key != "LD_LIBRARY_PATH"}
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=graphics, env=clean)
        yield chromium
        chromium.close()


def changed(route: Route) -> None:
    """Serve a script of the page with its change for the pictures."""
    response = route.fetch()
    text = response.text()
    for name, (old, new) in _CHANGES.items():
        if route.request.url.endswith(name):
            assert old in text, f"{name} has no {old}"
            text = text.replace(old, new)
    route.fulfill(response=response, body=text)


def walk(page: Page) -> None:
    """Drive the robot until it walks at the speed of the keys."""
    press(page, "drive", "driver", "you drive")
    press(page, "power", "power", "Power is on")
    if page.locator("#readiness").text_content() != "it stands":
        press(page, "lower", "readiness", "it stands")
    press(page, "walk", "readiness", "it walks")
    says(page, "driver", "you drive")
    page.keyboard.down("Shift")
    page.keyboard.down("w")
    page.wait_for_timeout(_WALK)


def press(page: Page, button: str, name: str, text: str) -> None:
    """Press a button until an element of the page has a text: a page that is late is not heard."""
    for _ in range(_TRIES):
        button_at = page.locator(f"[data-press={button}]").first
        if button_at.count():
            button_at.evaluate("button => button.click()")
        with suppress(AssertionError):
            return says(page, name, text)
    raise TimeoutError(f"{button}: no {text}")


def says(page: Page, name: str, text: str) -> None:
    """Wait until an element of the page has a text."""
    expect(page.locator(f"#{name}")).to_contain_text(text, timeout=_TIMEOUT)


if __name__ == "__main__":
    main()
