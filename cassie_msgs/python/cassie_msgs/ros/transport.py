"""How the processes of one machine reach each other.

With `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`, rmw_fastrtps carries messages through shared
memory. A process that is killed leaves its end of it behind, and whoever writes there next
waits for it, for seconds, in the middle of a publish. Over the loopback interface nobody
waits for the dead, at the same speed for messages of this size; and with announcements that
are closer together, nodes find each other in tenths of a second instead of seconds.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from pathlib import Path

PROFILE = Path(__file__).parent / "loopback.xml"
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
