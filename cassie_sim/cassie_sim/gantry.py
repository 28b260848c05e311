"""The overhead gantry: a harness that holds, lowers and releases the pelvis."""

from __future__ import annotations

import numpy as np

from cassie_gaits.records import FloatArray
from cassie_gaits.robot import WEIGHT

SPEED = 0.1
"""Default speed of the winch. In m/s."""

STIFFNESS = 12000.0
"""Stiffness of the straps, which only pull upwards. In N/m."""

_DAMPING = 900.0  # Ns/m, of the straps
_SWAY_STIFFNESS, _SWAY_DAMPING = 1500.0, 250.0  # N/m and Ns/m, towards the place below the winch
_TILT_STIFFNESS, _TILT_DAMPING = 400.0, 40.0  # Nm/rad and Nms/rad, towards upright


class Gantry:
    """Straps from a winch to the pelvis.

    The straps pull upwards like a damped spring and are slack when the pelvis is above the
    winch's height. In proportion to the weight that they carry, they also centre the pelvis below
    the winch, keep it upright and damp its rotation.
    """

    def __init__(self) -> None:
        self.attached = False
        self.height = 0.0
        self._target = 0.0
        self._speed = SPEED
        self._release_when_slack = False
        self._anchor = np.zeros(2)
        self.wrench = np.zeros(6)
        """Force and torque on the pelvis in world axes. Shape (6,), in N and Nm."""

    def hold(self, position: FloatArray, height: float, speed: float = SPEED) -> None:
        """Hold the pelvis at its present position and move it to a height.

        Args:
            position: Position of the pelvis in the world. Shape (3,), in m.
            height: Pelvis height to reach. In m.
            speed: Speed of the winch. In m/s.
        """
        if not self.attached:
            self.height = min(float(position[2]), height)
        self.attached = True
        self._anchor[:] = position[:2]
        self._target = height
        self._speed = speed
        self._release_when_slack = False

    def lower(self, height: float, speed: float = SPEED) -> None:
        """Move the winch to a height and release the pelvis there."""
        self._target = height
        self._speed = speed
        self._release_when_slack = True

    def release(self) -> None:
        """Release the pelvis at once."""
        self.attached = False
        self.wrench[:] = 0.0

    def step(
        self, period: float, position: FloatArray, rotation: FloatArray, twist: FloatArray
    ) -> FloatArray:
        """Force and torque on the pelvis, after one step of the winch.

        Args:
            period: Length of the step. In s.
            position: Position of the pelvis. Shape (3,), in m.
            rotation: Rotation matrix from pelvis to world. Shape (9,), row by row.
            twist: Linear velocity in the world, angular velocity in the pelvis. Shape (6,).

        Returns:
            `wrench`.
        """
        change = self._target - self.height
        limit = self._speed * period
        self.height += max(-limit, min(limit, change))
        if self._release_when_slack and abs(change) < 1e-9:
            self.release()
            return self.wrench
        x, y, z = position.tolist()
        vx, vy, vz, wx, wy, wz = twist.tolist()
        tension = max(0.0, STIFFNESS * (self.height - z) - _DAMPING * vz)
        if self.height <= z:
            tension = 0.0
        share = min(1.0, tension / WEIGHT)
        self.wrench[0] = share * (_SWAY_STIFFNESS * (self._anchor[0] - x) - _SWAY_DAMPING * vx)
        self.wrench[1] = share * (_SWAY_STIFFNESS * (self._anchor[1] - y) - _SWAY_DAMPING * vy)
        self.wrench[2] = tension
        self._set_torque(share, rotation.tolist(), (wx, wy, wz))
        return self.wrench

    def _set_torque(self, share: float, r: list[float], rate: tuple[float, float, float]) -> None:
        wx, wy, wz = rate
        # Tilt is the cross product of the pelvis's z axis with the vertical.
        up_x, up_y = r[2], r[5]
        world = (
            r[0] * wx + r[1] * wy + r[2] * wz,
            r[3] * wx + r[4] * wy + r[5] * wz,
            r[6] * wx + r[7] * wy + r[8] * wz,
        )
        self.wrench[3] = share * (_TILT_STIFFNESS * up_y - _TILT_DAMPING * world[0])
        self.wrench[4] = share * (-_TILT_STIFFNESS * up_x - _TILT_DAMPING * world[1])
        self.wrench[5] = -share * _TILT_DAMPING * world[2]
