"""Transport between the processes of one machine.

With `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`, rmw_fastrtps sends messages through shared
memory. A process that is killed leaves its segment behind, and the next writer to it blocks for
seconds in the middle of a publish. On the loopback interface no writer waits for a dead process,
at the same speed for messages of this size. With more frequent announcements, nodes find each other
in tenths of a second instead of seconds.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, MutableMapping
from pathlib import Path

PROFILE = Path(__file__).parent / "loopback.xml"

QUIET = 0.5
"""Time without a new node after which discovery is over. In s."""

ALONE = 4.0
"""Time without any node after which discovery is over: on a busy machine the first answers take
longer than later ones. In s."""

LONGEST = 10.0
"""Longest time of discovery. In s."""

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILE_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


def use_loopback(environment: MutableMapping[str, str] = os.environ) -> bool:
    """Use the loopback interface in this process if its discovery range is this machine only.

    Call it before `rclpy.init`. An environment that asks for another range, profile or
    middleware is not changed.

    Args:
        environment: Variables to read and change.

    Returns:
        Whether variables were changed.
    """
    middleware = environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    profiles = {environment.get(name, str(PROFILE)) for name in _PROFILE_VARIABLES}
    configured = profiles != {str(PROFILE)}
    local = environment.get(_RANGE) == "LOCALHOST"
    if not local or configured or middleware != "rmw_fastrtps_cpp":
        return False
    for name in _PROFILE_VARIABLES:
        environment[name] = str(PROFILE)
    # LOCALHOST would add shared memory to the transports of the profile.
    environment[_RANGE] = "SYSTEM_DEFAULT"
    return True


def wait_for_discovery(look: Callable[[], Collection[object]]) -> None:
    """Wait until discovery finds nothing new.

    Args:
        look: Returns what was found so far, without this process.
    """
    begin = changed = time.monotonic()
    found: Collection[object] = ()
    while time.monotonic() - changed < (QUIET if found else ALONE):
        now = look()
        if now != found:
            found, changed = now, time.monotonic()
        if time.monotonic() - begin > LONGEST:
            return
        time.sleep(0.05)
