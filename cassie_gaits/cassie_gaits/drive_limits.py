"""What the ten drives bear and do by themselves, in the order of `names.DRIVES`."""

from __future__ import annotations

import numpy as np

from cassie_gaits import robot
from cassie_gaits.names import LEG_DRIVES

TORQUE_LIMITS = np.tile([robot.DRIVES[name].torque_limit for name in LEG_DRIVES], 2)
"""Largest torque. Shape (10,), in Nm."""

DAMPING = np.tile([4.0, 4.0, 8.0, 8.0, 2.0], 2)
"""Damping of a drive without a valid command, and in mode DAMP. Shape (10,), in Nms/rad."""

KP_LIMIT = 5000.0
"""Largest position gain that a drive accepts. In Nm/rad."""

KD_LIMIT = 500.0
"""Largest velocity gain that a drive accepts. In Nms/rad."""
