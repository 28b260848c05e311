"""What every way to drive does with a request: saturate it, stop it, ask for the lease."""

from __future__ import annotations

import math

from cassie_msgs.request import Request
from cassie_msgs.tunables import entries, replace_checked

RANGES = {entry.name: entry.spec for entry in entries(Request())}
"""Range and unit of each set-point, by name."""

TRIMS = ("trim_sagittal", "trim_lateral", "trim_pitch", "trim_roll")
"""Names of the entries of `Request.trims`, in order."""

TAKE_OVER_TIME = 1.0
"""Duration of one request for the lease of another operator. In s."""


def clamped(name: str, value: float) -> float:
    """A set-point, saturated at the bounds of its range."""
    spec = RANGES["trims" if name in TRIMS else name]
    low = -math.inf if spec.low is None else spec.low
    high = math.inf if spec.high is None else spec.high
    return min(max(value, low), high)


def stopped(request: Request) -> Request:
    """The request with all speeds at zero."""
    return replace_checked(request, vx=0.0, vy=0.0, yaw_rate=0.0)


def without_link(request: Request) -> Request:
    """The request after a loss of the link: without speeds, and with power unchanged."""
    return replace_checked(stopped(request), link=False)
