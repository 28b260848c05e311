"""Inputs of nodes beyond samples and schedule: /cassie/node_events, /cassie/operator_in_force."""

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
class RecordedEvent:
    """A NodeEvent; see its .msg file.

    Attributes:
        episode: Episode of the tick.
        seq: First control tick at which the event holds.
        node: Node of the event.
        event: Kind of event.
        content: Decoded JSON content.
        received: When the recorder received it. Wall clock, in ns; 0 if not known.
    """

    episode: int
    seq: int
    node: str
    event: str
    content: Any
    received: int = 0


def read_event(raw: bytes, received: int = 0) -> RecordedEvent:
    """Parse a serialized NodeEvent, which the recorder received at a time of the wall clock (ns).

    Raises:
        BagError: if the bytes are no NodeEvent.
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
        return RecordedEvent(episode, seq, node, event, json.loads(content), received)
    except (struct.error, ValueError):
        raise BagError(f"a message of {len(raw)} bytes on {EVENTS_TOPIC} is no NodeEvent") from None
