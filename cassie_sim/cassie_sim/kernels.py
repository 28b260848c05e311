"""What happens at every physics step and every sample, compiled.

A tick of Python costs more than its physics, so the plant hands over as many physics steps as
pass without an event. All arrays are float64 and are changed in place; records are those of
`plant_records`, in arrays of shape (1,).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from cassie_gaits.compiled import compiled
from cassie_sim.plant_records import RecordArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

BATTERY = (72.0, 1.0)
"""Voltage in V and state of charge, which the simulation keeps."""

_SECOND = 1_000_000_000  # in ns


@compiled
def take_set_points(
    drives: RecordArray, command: FloatArray, low: FloatArray, high: FloatArray
) -> bool:
    """Take over the set-points of a command if they are within their limits; whether they are.

    Args:
        drives: `DRIVES_TYPE`.
        command: Rows of `set_points`, one after the other; NaN is in no range. Shape (50,).
        low, high: Limits of each row. Shape (5,).
    """
    drive = drives[0]
    for i in range(50):
        if not low[i // 10] <= command[i] <= high[i // 10]:
            return False
    for i in range(50):
        drive.set_points[i // 10, i % 10] = command[i]
    drive.age = 0
    drive.damped = 0
    return True


@compiled
def damp(drives: RecordArray) -> None:
    """Replace the set-points by pure damping."""
    drive = drives[0]
    drive.set_points[:] = 0.0
    drive.set_points[4] = drive.damping
    drive.damped = 1


@compiled
def drive_step(
    drives: RecordArray, pipeline: FloatArray, position: FloatArray, velocity: FloatArray
) -> None:
    """Watchdog, impedance law, torque-speed bound, delay and power of the ten drives.

    Args:
        drives: `DRIVES_TYPE`; `applied` gets the torques that act now.
        pipeline: Torques under way, one row a physics step. Shape (steps + 1, 10), in Nm.
        position: Measured. Shape (10,), in rad.
        velocity: Measured. Shape (10,), in rad/s.
    """
    drive = drives[0]
    if drive.age >= drive.timeout and not drive.damped:
        damp(drives)
    drive.age += 1
    head, rows = drive.head, pipeline.shape[0]
    following = head + 1 if head + 1 < rows else 0
    asked = drive.set_points
    for i in range(10):
        u = (
            asked[0, i]
            + asked[3, i] * (asked[1, i] - position[i])
            + asked[4, i] * (asked[2, i] - velocity[i])
        )
        limit = drive.torque_limit[i]
        bound = 2.0 * limit * (1.0 - abs(velocity[i]) / drive.speed_limit[i])
        bound = max(0.0, min(limit, bound))
        pipeline[head, i] = max(-bound, min(bound, u))
        drive.applied[i] = pipeline[following, i] * drive.torque_constant[i]
    drive.head = following
    if not drive.powered:
        pipeline[:] = 0.0
        drive.applied[:] = 0.0


@compiled
def _count_drives(sensor: Any, position: FloatArray) -> None:
    """Encoders of the drives: count, truncate toward zero, filter the velocity."""
    newest = sensor.newest + 1 if sensor.newest + 1 < sensor.taps.shape[0] else 0
    for i in range(10):
        per_rad = sensor.counts_per_rad[i]
        count = math.trunc(position[i] * per_rad)
        sensor.counts[newest, i] = count
        sensor.position[i] = count / per_rad
        total, row = 0.0, newest
        for k in range(sensor.taps.shape[0]):
            total += sensor.taps[k] * sensor.counts[row, i]
            row = row - 1 if row > 0 else sensor.taps.shape[0] - 1
        sensor.velocity[i] = total / per_rad
    sensor.newest = newest


@compiled
def _count_joints(sensor: Any, joints: FloatArray, noise: FloatArray) -> None:
    """Encoders of shin, tarsus and toe: noise, counts, truncation, velocity filter."""
    x, y, a, b = sensor.joint_x, sensor.joint_y, sensor.a, sensor.b
    for i in range(6):
        per_rad = sensor.joint_counts_per_rad[i]
        x[3, i] = x[2, i]
        x[2, i] = x[1, i]
        x[1, i] = x[0, i]
        x[0, i] = math.trunc((joints[i] + noise[i]) * per_rad) / per_rad
        new = b[0] * x[0, i] + b[1] * x[1, i] + b[2] * x[2, i] + b[3] * x[3, i]
        new -= a[0] * y[0, i] + a[1] * y[1, i]
        y[1, i] = y[0, i]
        y[0, i] = new
        sensor.joints[i] = x[0, i]
        sensor.joint_rates[i] = new


@compiled
def observe(
    sensors: RecordArray,
    attitudes: FloatArray,
    noise: FloatArray,
    angles: FloatArray,
    rates: FloatArray,
    quaternion: FloatArray,
    imu: FloatArray,
) -> None:
    """Take in one physics step.

    Args:
        sensors: `SENSORS_TYPE`.
        attitudes: Ring of the last orientations, w x y z. Shape (delay + 1, 4).
        noise: To add to the joints, one row a physics step. Shape (n, 6), in rad.
        angles: Of drives, then of shin, tarsus and toe. Shape (16,), in rad.
        rates: Theirs. Shape (16,), in rad/s.
        quaternion: Pelvis to world, w x y z. Shape (4,).
        imu: Angular velocity and specific force, pelvis frame. Shape (6,), rad/s and m/s^2.
    """
    sensor = sensors[0]
    if sensor.faithful:
        _count_drives(sensor, angles[:10])
        _count_joints(sensor, angles[10:], noise[sensor.noise_row])
        sensor.noise_row += 1
    else:
        sensor.position[:] = angles[:10]
        sensor.velocity[:] = rates[:10]
        sensor.joints[:] = angles[10:]
        sensor.joint_rates[:] = rates[10:]
    row = sensor.attitude_row + 1 if sensor.attitude_row + 1 < attitudes.shape[0] else 0
    sensor.attitude_row = row
    attitudes[row] = quaternion
    for i in range(6):
        sensor.imu[i] += imu[i]
    sensor.count += 1


@intrinsic
def _call(_context: Any, function: Any, first: Any, second: Any) -> Any:
    """Call the C function of two pointers at an address; all three are integers.

    With an address as an argument, unlike a ctypes function, the caller's machine code can be kept.
    """
    signature = types.void(types.intp, types.intp, types.intp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), (pointer, pointer))
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        operands = [builder.inttoptr(argument, pointer) for argument in arguments[1:]]
        builder.call(target, operands)
        return context.get_dummy_value()

    return signature, generate


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
    drives: RecordArray,
    pipeline: FloatArray,
    sensors: RecordArray,
    attitudes: FloatArray,
    noise: FloatArray,
    seen: FloatArray,
) -> None:
    """Physics and sensors for some physics steps, with the torques under way.

    What the drives make of these steps, `drive_steps`, acts only after them.

    Args:
        step: Address of MuJoCo's `mj_step`.
        model, data: Addresses of its model and data.
        steps: How many; at most as long as a torque takes.
        qpos, qvel, ctrl: Of `data`.
        quaternion, imu: In `data`, see `observe`.
        q_indices, v_indices: Where drives and joints are in `qpos` and `qvel`. Shape (16,).
        drives, pipeline: See `drive_steps`; not changed.
        sensors, attitudes, noise: See `observe`.
        seen: Result: what the drives measure before each step, position in rad, then velocity in
            rad/s. Shape (n, 20).
    """
    drive, sensor, rows = drives[0], sensors[0], pipeline.shape[0]
    angles, rates = np.empty(16), np.empty(16)
    for k in range(steps):
        row = (drive.head + 1 + k) % rows
        for i in range(10):
            seen[k, i] = sensor.position[i]
            seen[k, 10 + i] = sensor.velocity[i]
            ctrl[i] = pipeline[row, i] * drive.torque_constant[i] if drive.powered else 0.0
        _call(step, model, data)
        for i in range(16):
            angles[i] = qpos[q_indices[i]]
            rates[i] = qvel[v_indices[i]]
        observe(sensors, attitudes, noise, angles, rates, quaternion, imu)


@compiled
def drive_steps(drives: RecordArray, pipeline: FloatArray, seen: FloatArray, steps: int) -> None:
    """`drive_step` for the steps of `physics_steps`, which saw `seen`."""
    for k in range(steps):
        drive_step(drives, pipeline, seen[k, :10], seen[k, 10:])


@compiled
def hand_over(
    drives: RecordArray, seq: int, episode: int, stamp: int, samples: RecordArray
) -> None:
    """What belongs to a sample besides what is measured.

    Args:
        drives: `DRIVES_TYPE`.
        seq, episode: Of the sample.
        stamp: Robot time. In ns.
        samples: Result, `Sensors.record`. Shape (1,).
    """
    drive, sample = drives[0], samples[0]
    sample.sec, sample.nanosec = stamp // _SECOND, stamp % _SECOND
    sample.episode, sample.seq = episode, seq
    for i in range(10):
        sample.drive_torque[i] = drive.applied[i]
    sample.power, sample.damping = drive.powered, drive.damped
    sample.battery[0], sample.battery[1] = BATTERY


@compiled
def write_sample(
    sensors: RecordArray, attitudes: FloatArray, noise: FloatArray, samples: RecordArray
) -> None:
    """The measured fields of a sample; begins the next interval of the IMU's means.

    Args:
        sensors, attitudes: See `observe`.
        noise: Standard normal: angular velocity, acceleration, roll, pitch. Shape (8,).
        samples: Result, `Sensors.record`. Shape (1,).
    """
    sensor, sample = sensors[0], samples[0]
    sample.drive_position[:] = sensor.position
    sample.drive_velocity[:] = sensor.velocity
    sample.joint_position[:] = sensor.joints
    sample.joint_velocity[:] = sensor.joint_rates
    oldest = sensor.attitude_row + 1 if sensor.attitude_row + 1 < attitudes.shape[0] else 0
    _write_attitude(sensor, attitudes[oldest], noise[6:], sample.orientation)
    share = 1.0 / max(sensor.count, 1)
    for i in range(3):
        for k, out in ((i, sample.angular_velocity), (3 + i, sample.linear_acceleration)):
            error = noise[k] * sensor.imu_sigma[k] + sensor.imu_bias[k]
            out[i] = sensor.imu[k] * share + error
    sensor.imu[:] = 0.0
    sensor.count = 0


@compiled
def _write_attitude(
    sensor: Any, quaternion: FloatArray, noise: FloatArray, orientation: FloatArray
) -> None:
    """Orientation x y z w with the errors of the attitude filter; without any, the truth."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    if sensor.faithful:
        sensor.time += sensor.period
        for i in range(2):
            sensor.wander[i] *= sensor.wander_decay
            sensor.wander[i] += sensor.wander_sigma * noise[i]
        roll = 0.5 * (sensor.attitude_bias[0] + sensor.wander[0])
        pitch = 0.5 * (sensor.attitude_bias[1] + sensor.wander[1])
        yaw = 0.5 * sensor.yaw_drift * sensor.time
        # Tilt errors act in the pelvis frame (right), the yaw error in the world (left).
        w, x, y, z = (
            w - x * roll - y * pitch,
            x + w * roll - z * pitch,
            y + w * pitch + z * roll,
            z + x * pitch - y * roll,
        )
        w, x, y, z = w - yaw * z, x - yaw * y, y + yaw * x, z + yaw * w
        scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w * scale, x * scale, y * scale, z * scale
    orientation[0], orientation[1], orientation[2], orientation[3] = x, y, z, w


@compiled
def write_odometry(
    position: FloatArray, quaternion: FloatArray, twist: FloatArray, figures: FloatArray
) -> None:
    """Pose and twist of a nav_msgs/Odometry, the twist in the body's frame.

    Args:
        position: In the world. Shape (3,), in m.
        quaternion: Body to world, w x y z, of length 1. Shape (4,).
        twist: Linear velocity in the world (m/s), angular in the body (rad/s). Shape (6,).
        figures: Result: position, orientation x y z w and its 36 covariances, twist and its.
            Shape (85,); covariances stay as they are.
    """
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    vx, vy, vz = twist[0], twist[1], twist[2]
    tx, ty, tz = 2.0 * (vy * z - vz * y), 2.0 * (vz * x - vx * z), 2.0 * (vx * y - vy * x)
    for k in range(3):
        figures[k] = position[k]
        figures[43 + 3 + k] = twist[3 + k]
    figures[3], figures[4], figures[5], figures[6] = x, y, z, w
    figures[43] = vx + w * tx + ty * z - tz * y
    figures[44] = vy + w * ty + tz * x - tx * z
    figures[45] = vz + w * tz + tx * y - ty * x
