"""Messages of a browser page: stick positions, a button, a slider. One JSON object each."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

MAX_LENGTH = 500
"""Longest message. In characters."""

SLIDERS = ("height", "com_x", "com_y", "pitch", "roll")
"""Set-points with a slider; names of `Request`."""

ORDERS = (
    *("lower", "hang_up", "let_go", "reset", "push_left", "push_ahead"),
    *("hold_bar", "let_go_bar"),
)
"""Buttons that call a service of the simulator."""

RECORD = "record"
"""Button that begins and ends a recording; every page may press it."""

BUTTONS = ("drive", "leave", "power", "stop", "stand", "walk", "segway", "neutral", RECORD, *ORDERS)
"""Every button; "stop" is the emergency stop."""

_LARGEST = 1e12


class MessageError(ValueError):
    """A message that no page of this server sends."""


@dataclass(frozen=True)
class Sticks:
    """Stick positions: forward, to the left, turn to the left. -1 .. 1; 0 at rest."""

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0

    @property
    def at_rest(self) -> bool:
        """Whether no stick is moved."""
        return self == Sticks()


@dataclass(frozen=True)
class Beat:
    """Heartbeat of a page, about 30 times per second.

    Attributes:
        echo: Time of the newest frame that the page had received, as stated in the frame. In s.
        visible: Whether the page is visible.
        sticks: Stick positions.
    """

    echo: float
    visible: bool
    sticks: Sticks


@dataclass(frozen=True)
class Press:
    """A button was pressed."""

    echo: float
    button: str


@dataclass(frozen=True)
class Slide:
    """A slider was moved to a value, in the unit of its set-point."""

    echo: float
    name: str
    value: float


def read_message(text: str) -> Beat | Press | Slide:
    """The message in a text.

    Raises:
        MessageError: saying what is wrong with the text.
    """
    if len(text) > MAX_LENGTH:
        raise MessageError(f"{len(text)} characters, at most {MAX_LENGTH} are permitted")
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        raise MessageError("no JSON") from None
    if not isinstance(message, dict):
        raise MessageError("no JSON object")
    keys = set(message)
    if keys == {"echo", "visible", "forward", "left", "turn"}:
        return _beat(message)
    if keys == {"echo", "press"}:
        return Press(_number(message, "echo"), _word(message, "press", BUTTONS))
    if keys == {"echo", "slide", "value"}:
        name = _word(message, "slide", SLIDERS)
        return Slide(_number(message, "echo"), name, _number(message, "value"))
    raise MessageError(f"unknown keys: {', '.join(sorted(keys))}"[:100])


def _beat(message: dict[str, Any]) -> Beat:
    visible = message["visible"]
    if not isinstance(visible, bool):
        raise MessageError("visible is not true or false")
    axes = [_number(message, name) for name in ("forward", "left", "turn")]
    if max(map(abs, axes)) > 1.0:
        raise MessageError("a stick is outside -1 .. 1")
    return Beat(_number(message, "echo"), visible, Sticks(*axes))


def _number(message: dict[str, Any], name: str) -> float:
    value = message[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise MessageError(f"{name} is not a number")
    if not (abs(value) <= _LARGEST and math.isfinite(value)):
        raise MessageError(f"{name} is outside -{_LARGEST:g} .. {_LARGEST:g}")
    return float(value)


def _word(message: dict[str, Any], name: str, known: tuple[str, ...]) -> str:
    value = message[name]
    if value not in known:
        raise MessageError(f"{name} is none of {', '.join(known)}")
    return str(value)
