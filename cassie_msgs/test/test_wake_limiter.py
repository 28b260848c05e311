"""How long a node sleeps between messages that matter."""

from __future__ import annotations

import time

from cassie_msgs.ros.fast_lane import WakeLimiter


def test_half_of_the_time_between_calls_and_not_longer_than_permitted() -> None:
    limiter = WakeLimiter(longest=0.05)
    for pause, expected in ((0.04, 0.02), (0.02, 0.02), (0.3, 0.05)):
        time.sleep(pause)
        started = time.monotonic()
        limiter.limit()
        slept = time.monotonic() - started
        assert expected * 0.8 <= slept < expected + 0.1
