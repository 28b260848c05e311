"""What a page may say, and what is refused."""

import json

import pytest

from cassie_teleop.page_messages import Beat, MessageError, Press, Slide, Sticks, read_message

BEAT = {"echo": 1.5, "visible": True, "forward": 0.5, "left": 0, "turn": -1}


def test_messages_are_read():
    assert read_message(json.dumps(BEAT)) == Beat(1.5, True, Sticks(0.5, 0.0, -1.0))
    assert read_message('{"echo": 2, "press": "stop"}') == Press(2.0, "stop")
    text = '{"echo": 2, "slide": "height", "value": 0.8}'
    assert read_message(text) == Slide(2.0, "height", 0.8)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        "3",
        "{",
        "[" * 400,
        '{"a":' * 80,
        "x" * 501,
        '{"echo": 1}',
        '{"press": "stop"}',
        '{"echo": 1, "press": "stop", "more": 1}',
        '{"echo": 1, "press": "reboot"}',
        '{"echo": 1, "press": ["stop"]}',
        '{"echo": 1, "press": {"a": 1}}',
        '{"echo": NaN, "press": "walk"}',
        '{"echo": 1e999, "press": "walk"}',
        '{"echo": "1", "press": "walk"}',
        '{"echo": true, "press": "walk"}',
        '{"echo": 1, "slide": "vx", "value": 1}',
        '{"echo": 1, "slide": "height", "value": Infinity}',
        '{"echo": 1, "slide": "height", "value": ' + "9" * 400 + "}",
        json.dumps(BEAT | {"forward": 1.01}),
        json.dumps(BEAT | {"turn": float("nan")}),
        json.dumps(BEAT | {"left": None}),
        json.dumps(BEAT | {"visible": 1}),
    ],
)
def test_anything_else_is_refused(text):
    with pytest.raises(MessageError):
        read_message(text)
