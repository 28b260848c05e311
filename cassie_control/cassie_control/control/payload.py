"""Estimate of a payload's mass from the drives' torques while walking."""

from __future__ import annotations

import numpy as np

from cassie_control.control.robot import Robot, nominal_readings
from cassie_gaits import robot as model
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.names import HIP_PITCH, KNEE, LEG_DRIVE_COUNT, TARSUS
from cassie_gaits.optimize.request import RANGES
from cassie_gaits.records import FloatArray, Records

_LOW_PASS_WEIGHT = 0.15  # of a new pair of steps
_MIN_PAYLOAD, _MAX_PAYLOAD = RANGES["payload"]  # kg, for which gaits can be requested
_CARRIED_MASS = 30.2  # kg, mean `lifting_force` over g with no payload, 29.9 to 30.5; no lower legs


@compiled
def lifting_force(robots: Records[Robot], pairs: Records[LegPair], torque: FloatArray) -> float:
    """Vertical force with which the drives' torques hold the pelvis up.

    By virtual work: a foot that moves down by dz, with the pelvis at rest, turns the hip pitch by
    dp and the knee by dk, where the tarsus turns against the knee. The ground's force acts by
    (u_p dp + u_k dk) / dz. The springs do not enter it: the estimator takes the scale of their
    stiffness from the robot's nominal weight, so that their forces do not show a payload.

    Args:
        robots: The robot now. Shape (1,).
        pairs: Kinematics of both legs. Shape (1,).
        torque: Torques of the ten drives. Shape (10,), in Nm.

    Returns:
        Sum over both legs. In N.
    """
    x, z, force = robots[0].R_HP[0], robots[0].R_HP[2], 0.0
    for i in range(2):
        jacobian, first = pairs[0].states[i].toe_jacobian, LEG_DRIVE_COUNT * i
        hip_x = hip_z = knee_x = knee_z = 0.0
        for k in range(3):
            hip, knee = jacobian[k, HIP_PITCH], jacobian[k, KNEE] - jacobian[k, TARSUS]
            hip_x += x[k] * hip
            hip_z += z[k] * hip
            knee_x += x[k] * knee
            knee_z += z[k] * knee
        work = knee_x * torque[first + HIP_PITCH] - hip_x * torque[first + KNEE]
        force += work / (hip_x * knee_z - knee_x * hip_z)
    return force


class Payload:
    """Mean lifting force over two steps, divided by gravity, less that without a payload.

    Over a stride that ends as it began, the mean acceleration of the centre of mass is 0.

    Attributes:
        mass: Low-passed over strides, 0 or more. In kg.
    """

    def __init__(self) -> None:
        readings = nominal_readings()
        lifting_force(readings.records, readings.pair, np.zeros(10))  # loads or compiles it
        self.reset()

    def reset(self) -> None:
        """No payload, and a new stride."""
        self.mass = 0.0
        self._force_sum = 0.0
        self._ticks, self._stride_start = 0, -1

    def step(self, force: float, steps: int) -> None:
        """Update with one tick.

        Args:
            force: `lifting_force`. In N.
            steps: Number of steps since walking began.
        """
        if not 0 <= steps - self._stride_start < 2:
            if self._ticks and steps - self._stride_start == 2:
                payload = self._force_sum / self._ticks / model.GRAVITY - _CARRIED_MASS
                payload = max(_MIN_PAYLOAD, min(_MAX_PAYLOAD, payload))
                self.mass += _LOW_PASS_WEIGHT * (payload - self.mass)
            self._force_sum, self._ticks, self._stride_start = 0.0, 0, steps
        self._force_sum += force
        self._ticks += 1
