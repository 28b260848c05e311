"""Each test run gets a ROS domain of its own."""

import os

# Others run at the same time: packages have 1 to 36, whole robots 40 to 99.
os.environ["ROS_DOMAIN_ID"] = str(19 + os.getpid() % 18)
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
