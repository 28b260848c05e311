"""What every suite needs before its first process starts, and what several of them use."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from rclpy.node import Node

# Where tests run as a shell's background job, Ctrl-C is ignored, and every process that they
# start would inherit that and not end by it.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def node() -> Iterator[Node]:
    """A node in a context of its own, which a test may shut down."""
    import rclpy  # only suites with nodes have need of it

    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("tester", context=context)
    yield node
    node.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.fixture(scope="session")
def real_time() -> bool:
    """Whether this user may ask for real-time scheduling."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A Chromium of this computer, which gives way to the nodes that are tested."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("no Chromium: apt install chromium")
    from playwright.sync_api import sync_playwright

    script = Path(tmp_path_factory.mktemp("browser"), "chromium")
    script.write_text(f'#!/bin/sh\nexec nice -n 10 {chromium} "$@"\n')
    script.chmod(0o755)
    graphics = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    # Chromium is no ROS node: libraries of the workspace are not for it.
    clean = {key: value for key, value in os.environ.items() if key != "LD_LIBRARY_PATH"}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=script, args=graphics, env=clean)
        yield browser
        browser.close()
