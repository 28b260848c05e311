"""What nodes took in beside what they answer: /cassie/node_events and /cassie/operator_in_force."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

from cassie_bags.errors import BagError

EVENTS_TOPIC = "/cassie/node_events"
IN_FORCE_TOPIC = "/cassie/operator_in_force"

_FIXED = struct.Struct("<4xiII4xQ")
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class Event:
    """A NodeEvent; see its .msg file.

    Attributes:
        episode: Of the tick.
        seq: First control tick that it holds for.
        node: Whose event it is.
        event: Kind.
        content: What JSON says.
    """

    episode: int
    seq: int
    node: str
    event: str
    content: Any


def read_event(raw: bytes) -> Event:
    """A serialized NodeEvent.

    Raises:
        BagError: if it is none.
    """
    try:
        _, _, episode, seq = _FIXED.unpack_from(raw)
        words, place = [], _FIXED.size
        for _ in range(3):
            place += -place % _LENGTH.size
            (length,) = _LENGTH.unpack_from(raw, place)
            place += _LENGTH.size + length
            words.append(raw[place - length : place - 1].decode())
        node, event, content = words
        return Event(episode, seq, node, event, json.loads(content))
    except (struct.error, ValueError):
        raise BagError(f"a message of {len(raw)} bytes on {EVENTS_TOPIC} is no NodeEvent") from None
