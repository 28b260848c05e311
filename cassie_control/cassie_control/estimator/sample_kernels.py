"""From a sample to joints, loads and angles, compiled. Results are written in place."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]

GRAVITY = 9.81
FIRST_TIME, _SCALE_TIME = 0.4, 6.0  # s, over which forces are averaged: at first, at last
_CONTACT_TIME = 0.05  # s
_STANDS = 0.6  # share of what is felt, that feet which carry her seem to carry at least
_LEAST_SCALE, _LARGEST_SCALE = 0.7, 1.4  # springs +-20 %, mass +-10 %


@compiled
def arrange_joints(
    samples: RecordArray,
    joints: FloatArray,
    rates: FloatArray,
    toe_torques: FloatArray,
    rotation: FloatArray,
) -> None:
    """Measurements of drives and joints in the order along each leg, and the IMU's attitude.

    Args:
        samples: Numbers of Sensors, see `float_records`. Shape (1,).
        joints, rates: Result, hip_roll to toe. Shape (2, 7), in rad and rad/s.
        toe_torques: Result. Shape (2,), in Nm.
        rotation: Result, IMU to world. Shape (3, 3).
    """
    sample = samples[0]
    for i in range(2):
        for k in range(4):
            joints[i, k] = sample.drive_position[5 * i + k]
            rates[i, k] = sample.drive_velocity[5 * i + k]
        for k in range(2):
            joints[i, 4 + k] = sample.joint_position[3 * i + k]
            rates[i, 4 + k] = sample.joint_velocity[3 * i + k]
        joints[i, 6] = sample.drive_position[5 * i + 4]
        rates[i, 6] = sample.drive_velocity[5 * i + 4]
        toe_torques[i] = sample.drive_torque[5 * i + 4]
    rotation_of(sample.orientation, rotation)


@compiled
def scale_forces(
    springs: FloatArray,
    specific_force: FloatArray,
    up: FloatArray,
    period: float,
    mass: float,
    scale: FloatArray,
    forces: FloatArray,
) -> None:
    """Forces of the feet such that on average they carry the robot's weight.

    Neither the springs' stiffness nor the mass is known to better than some ten percent. What
    the springs hold, averaged over a step, must be the mass times what the accelerometer feels.

    Args:
        springs: Vertical forces after the nominal springs. Shape (2,), in N.
        specific_force: At the IMU, pelvis frame. Shape (3,), in m/s^2.
        up: The vertical in the pelvis frame. Shape (3,).
        period: Between samples. In s.
        mass: Nominal, of the robot. In kg.
        scale: State: share of late in which the feet carried her, the factor, and the time that
            it is averaged over, in s. Shape (3,).
        forces: Result. Shape (2,), in N.
    """
    carried, felt = springs[0] + springs[1], 0.0
    for k in range(3):
        felt += mass * up[k] * specific_force[k]
    stands = 1.0 if carried > _STANDS * felt else 0.0  # else a gantry carries too
    scale[0] += period / _CONTACT_TIME * (stands - scale[0])
    if scale[0] > 0.5:
        scale[2] = min(_SCALE_TIME, scale[2] + period)
        scale[1] += period / scale[2] * (felt - scale[1] * carried) / (mass * GRAVITY)
        scale[1] = max(_LEAST_SCALE, min(_LARGEST_SCALE, scale[1]))
    for i in range(2):
        forces[i] = scale[1] * springs[i]


@compiled
def weigh_feet(
    forces: FloatArray,
    load_from: float,
    load_span: float,
    contact_force: float,
    contact_width: float,
    load: FloatArray,
    contact: FloatArray,
) -> None:
    """Load and probability of contact of each foot, from its force.

    Args:
        forces: Shape (2,), in N.
        load_from, load_span, contact_force, contact_width: See `config`. In N.
        load: Result, 0..1. Shape (2,).
        contact: Result, 0..1. Shape (2,).
    """
    for i in range(2):
        load[i] = max(0.0, min(1.0, (forces[i] - load_from) / load_span))
        odds = (contact_force - forces[i]) / contact_width
        contact[i] = 1.0 / (1.0 + math.exp(max(-50.0, min(50.0, odds))))


@compiled
def rotation_of(orientation: FloatArray, rotation: FloatArray) -> None:
    """Rotation matrix of a quaternion.

    Args:
        orientation: x y z w, of any length but 0. Shape (4,).
        rotation: Result. Shape (3, 3).
    """
    x, y, z, w = orientation[0], orientation[1], orientation[2], orientation[3]
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    rotation[0, 0] = 1.0 - scale * (y * y + z * z)
    rotation[0, 1] = scale * (x * y - w * z)
    rotation[0, 2] = scale * (x * z + w * y)
    rotation[1, 0] = scale * (x * y + w * z)
    rotation[1, 1] = 1.0 - scale * (x * x + z * z)
    rotation[1, 2] = scale * (y * z - w * x)
    rotation[2, 0] = scale * (x * z - w * y)
    rotation[2, 1] = scale * (y * z + w * x)
    rotation[2, 2] = 1.0 - scale * (x * x + y * y)


@compiled
def euler_angles(
    rotation: FloatArray, angular_velocity: FloatArray, angles: FloatArray, rates: FloatArray
) -> None:
    """Z-y-x Euler angles and their rates.

    Args:
        rotation: Pelvis to world. Shape (3, 3).
        angular_velocity: Pelvis frame. Shape (3,), in rad/s.
        angles: Yaw, pitch, roll; as they were before, and the result: yaw counts on beyond a half
            turn, so that it can be followed and integrated. Shape (3,), in rad.
        rates: Result, their time derivatives. Shape (3,), in rad/s.
    """
    sine = max(-1.0, min(1.0, -rotation[2, 0]))
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    angles[0] = yaw + 2.0 * math.pi * round((angles[0] - yaw) / (2.0 * math.pi))
    angles[1] = math.asin(sine)
    angles[2] = math.atan2(rotation[2, 1], rotation[2, 2])
    c_roll, s_roll = math.cos(angles[2]), math.sin(angles[2])
    c_pitch = max(0.05, math.cos(angles[1]))  # a robot on its nose has fallen long before
    turning = s_roll * angular_velocity[1] + c_roll * angular_velocity[2]
    rates[0] = turning / c_pitch
    rates[1] = c_roll * angular_velocity[1] - s_roll * angular_velocity[2]
    rates[2] = angular_velocity[0] + turning * math.sin(angles[1]) / c_pitch
