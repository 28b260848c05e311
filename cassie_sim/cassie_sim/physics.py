"""Physics steps of robot and sensors, compiled.

Arrays are changed in place; the records of drives and sensors are arrays of shape (1,).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Records
from cassie_sim.drives import DriveNumbers
from cassie_sim.native import call
from cassie_sim.sensors import SensorNumbers, observe

IntArray = npt.NDArray[np.int64]


@compiled
def physics_steps(
    step: int,
    model: int,
    data: int,
    steps: int,
    qpos: FloatArray,
    qvel: FloatArray,
    ctrl: FloatArray,
    quaternion: FloatArray,
    imu: FloatArray,
    q_indices: IntArray,
    v_indices: IntArray,
    drives: Records[DriveNumbers],
    pipeline: FloatArray,
    sensors: Records[SensorNumbers],
    attitudes: FloatArray,
    noise: FloatArray,
    seen: FloatArray,
) -> None:
    """Compute physics and sensors for some physics steps, with the delayed torques.

    The torques that the drives compute in these steps (`drive_steps`) act only after them.

    Args:
        step: Address of MuJoCo's `mj_step`.
        model, data: Addresses of MuJoCo's model and data.
        steps: Number of steps, at most the delay of a torque.
        qpos, qvel, ctrl: Arrays of `data`.
        quaternion, imu: Arrays in `data`, see `observe`.
        q_indices, v_indices: Indices of drives and joints in `qpos` and `qvel`. Shape (16,).
        drives, pipeline: See `drive_steps`; not changed.
        sensors, attitudes, noise: See `observe`.
        seen: Result: measurements of the drives before each step, position in rad, then velocity
            in rad/s. Shape (n, 20).
    """
    drive, sensor, rows = drives[0], sensors[0], pipeline.shape[0]
    angles, rates = np.empty(16), np.empty(16)
    for k in range(steps):
        row = (drive.head + 1 + k) % rows
        for i in range(10):
            seen[k, i] = sensor.position[i]
            seen[k, 10 + i] = sensor.velocity[i]
            ctrl[i] = pipeline[row, i] * drive.torque_constant[i] if drive.powered else 0.0
        call(step, model, data)
        for i in range(16):
            angles[i] = qpos[q_indices[i]]
            rates[i] = qvel[v_indices[i]]
        observe(sensors, attitudes, noise, angles, rates, quaternion, imu)
