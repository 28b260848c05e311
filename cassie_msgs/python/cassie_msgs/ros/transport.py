"""How the processes of one machine reach each other.

With `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`, rmw_fastrtps carries messages through shared
memory. A process that is killed leaves its end of it behind, and whoever writes there next
waits for it, for seconds, in the middle of a publish. Over the loopback interface nobody
waits for the dead, at the same speed for messages of this size; and with announcements that
are closer together, nodes find each other in tenths of a second instead of seconds.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, MutableMapping
from pathlib import Path

PROFILE = Path(__file__).parent / "loopback.xml"

QUIET = 0.5
"""Discovery is over once nothing was found for this long. In s."""

ALONE = 4.0
"""The same while nobody was found at all: on a busy machine the first answers take longer. In s."""

LONGEST = 10.0
"""That discovery may take. In s."""

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILE_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


def use_loopback(environment: MutableMapping[str, str] = os.environ) -> bool:
    """Have this process, where it is meant for this machine only, use the loopback interface.

    Call it before `rclpy.init`. An environment that asks for another range, profile or
    middleware stays as it is.

    Args:
        environment: Variables to read and change.

    Returns:
        Whether they were changed.
    """
    middleware = environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    profiles = {environment.get(name, str(PROFILE)) for name in _PROFILE_VARIABLES}
    configured = profiles != {str(PROFILE)}
    local = environment.get(_RANGE) == "LOCALHOST"
    if not local or configured or middleware != "rmw_fastrtps_cpp":
        return False
    for name in _PROFILE_VARIABLES:
        environment[name] = str(PROFILE)
    # LOCALHOST would add shared memory to whatever the profile says.
    environment[_RANGE] = "SYSTEM_DEFAULT"
    return True


def wait_for_discovery(look: Callable[[], Collection[object]]) -> None:
    """Wait until discovery finds nothing new.

    Args:
        look: What was found so far, without oneself.
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
