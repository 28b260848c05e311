"""What every suite needs before its first process starts, and what several of them use."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
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
