"""The leg that puts the foot at a point."""

from __future__ import annotations

import math

from cassie_gaits.compiled import compiled

HIP_ROLL_X, HIP_Y = 0.021, 0.135
"""Hip roll axis in the pelvis frame, left; y mirrored. In m."""

HIP_BACK, HIP_DOWN = 0.07, 0.09
"""From the hip roll axis back and down to the hip pitch axis, under the yaw axis. In m."""


@compiled
def aim_leg(
    x: float, y: float, down: float, hip_yaw: float, torso_pitch: float
) -> tuple[float, float, float]:
    """Leg roll, leg pitch and leg length that put the toe joint at a point.

    Args:
        x, y, down: Of the point from the hip roll joint, heading frame. In m.
        hip_yaw: Hip yaw angle. In rad.
        torso_pitch: In rad.

    Returns:
        Roll and pitch in rad, as the outputs of eq:h0, and length in m.
    """
    c, s = math.cos(torso_pitch), math.sin(torso_pitch)
    forward, low = x * c + down * s + HIP_BACK, down * c - x * s  # pelvis frame, from the yaw axis
    across = forward * math.tan(hip_yaw)
    below = math.sqrt(max(0.04, y * y + low * low - across * across))
    roll = math.atan2(y, low) - math.atan2(across, below)
    along, depth = forward / math.cos(hip_yaw), below - HIP_DOWN
    return roll, math.atan2(along, depth) - torso_pitch, math.hypot(along, depth)
