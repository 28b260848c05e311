"""The messages of the control lane, field by field in the order of their .msg files.

The .msg files give units and the order within arrays. `cassie_msgs.sample` explains `Sample`. A
test checks that these tables give the same bytes as ROS itself.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import numpy.typing as npt

from cassie_msgs.sample import LayoutError, Sample, header

__all__ = [
    "GAIT_TYPES",
    "SAMPLE_TYPES",
    "ControllerStatus",
    "Gait",
    "GaitRequest",
    "GaitResult",
    "LayoutError",
    "Mode",
    "MotorCommand",
    "OperatorCommand",
    "RobotMode",
    "RobotState",
    "Sample",
    "Sensors",
    "header",
]

FloatArray = npt.NDArray[np.float64]
UInt64Array = npt.NDArray[np.uint64]
UInt8Array = npt.NDArray[np.uint8]
BoolArray = npt.NDArray[np.bool_]

F8, U8, U1, B1 = np.float64, np.uint64, np.uint8, np.bool_


class RobotMode(IntEnum):
    """Modes of the robot, the constants of Mode.msg."""

    OFF = 0
    DAMP = 1
    STAND = 2
    WALK = 3
    SEGWAY = 4


class GaitResult(IntEnum):
    """Result of a request for a gait, the constants of Gait.msg."""

    FOUND = 0
    REFUSED = 1
    NOT_FOUND = 2
    NOT_CERTIFIED = 3


class Sensors(Sample):
    """Sensors.msg: one sample of the robot's sensors, per control tick."""

    TOPIC = "/cassie/sensors"
    LAYOUT = (
        ("orientation", F8, 4),
        ("angular_velocity", F8, 3),
        ("linear_acceleration", F8, 3),
        ("drive_position", F8, 10),
        ("drive_velocity", F8, 10),
        ("drive_torque", F8, 10),
        ("joint_position", F8, 6),
        ("joint_velocity", F8, 6),
        ("battery", F8, 2),
        ("power", F8, 1),
        ("damping", F8, 1),
        ("longest_delay", F8, 1),
        ("missed_ticks", U8, 1),
        ("late_ticks", U8, 1),
        ("wall_paced", U8, 1),
        ("operator_lease", U8, 1),
    )
    orientation: FloatArray
    angular_velocity: FloatArray
    linear_acceleration: FloatArray
    drive_position: FloatArray
    drive_velocity: FloatArray
    drive_torque: FloatArray
    joint_position: FloatArray
    joint_velocity: FloatArray
    battery: FloatArray
    power: FloatArray
    damping: FloatArray
    longest_delay: FloatArray
    missed_ticks: UInt64Array
    late_ticks: UInt64Array
    wall_paced: UInt64Array
    operator_lease: UInt64Array


class RobotState(Sample):
    """RobotState.msg: state estimate, per sensor sample."""

    TOPIC = "/cassie/state"
    LAYOUT = (
        ("q", F8, 20),
        ("v", F8, 20),
        ("com_position", F8, 3),
        ("com_velocity", F8, 3),
        ("foot_force", F8, 2),
        ("foot_load", F8, 2),
        ("contact_probability", F8, 2),
        ("angular_velocity", F8, 3),
        ("covariance", F8, 12),
        ("power", F8, 1),
        ("drive_torque", F8, 10),
        ("battery_charge", F8, 1),
        ("longest_delay", F8, 1),
        ("sensor_faults", U8, 1),
        ("missed_ticks", U8, 1),
        ("late_ticks", U8, 1),
        ("wall_paced", U8, 1),
        ("operator_lease", U8, 1),
    )
    q: FloatArray
    v: FloatArray
    com_position: FloatArray
    com_velocity: FloatArray
    foot_force: FloatArray
    foot_load: FloatArray
    contact_probability: FloatArray
    angular_velocity: FloatArray
    covariance: FloatArray
    power: FloatArray
    drive_torque: FloatArray
    battery_charge: FloatArray
    longest_delay: FloatArray
    sensor_faults: UInt64Array
    missed_ticks: UInt64Array
    late_ticks: UInt64Array
    wall_paced: UInt64Array
    operator_lease: UInt64Array


DECIMATED_STATE = f"{RobotState.TOPIC}_decimated"
"""Topic of every tenth state, and of repeated ones, for nodes that answer every tenth."""


class Mode(Sample):
    """Mode.msg: what the controller shall do, for every 10th state."""

    TOPIC = "/cassie/mode"
    LAYOUT = (
        ("effective_seq", U8, 1),
        ("mode", U8, 1),
        ("transition", F8, 1),
        ("vx", F8, 1),
        ("vy", F8, 1),
        ("yaw_rate", F8, 1),
        ("height", F8, 1),
        ("com_x", F8, 1),
        ("com_y", F8, 1),
        ("roll", F8, 1),
        ("pitch", F8, 1),
        ("trims", F8, 4),
    )
    effective_seq: UInt64Array
    mode: UInt64Array
    transition: FloatArray
    vx: FloatArray
    vy: FloatArray
    yaw_rate: FloatArray
    height: FloatArray
    com_x: FloatArray
    com_y: FloatArray
    roll: FloatArray
    pitch: FloatArray
    trims: FloatArray


class MotorCommand(Sample):
    """MotorCommand.msg: set-points of the ten drives, per state."""

    TOPIC = "/cassie/motor_command"
    LAYOUT = (
        ("torque", F8, 10),
        ("position", F8, 10),
        ("velocity", F8, 10),
        ("kp", F8, 10),
        ("kd", F8, 10),
    )
    torque: FloatArray
    position: FloatArray
    velocity: FloatArray
    kp: FloatArray
    kd: FloatArray


class ControllerStatus(Sample):
    """ControllerStatus.msg: what the controller is doing."""

    TOPIC = "/cassie/controller_status"
    LAYOUT = (
        ("mode_seq", U8, 1),
        ("mode", U8, 1),
        ("phase", F8, 1),
        ("stance_leg", F8, 1),
        ("step_count", F8, 1),
        ("gait_speed", F8, 1),
        ("step_time", F8, 1),
        ("velocity", F8, 2),
        ("y", F8, 9),
        ("dy", F8, 9),
        ("saturation", F8, 1),
        ("command_latency", F8, 1),
        ("supervisor_lost", F8, 1),
    )
    mode_seq: UInt64Array
    mode: UInt64Array
    phase: FloatArray
    stance_leg: FloatArray
    step_count: FloatArray
    gait_speed: FloatArray
    step_time: FloatArray
    velocity: FloatArray
    y: FloatArray
    dy: FloatArray
    saturation: FloatArray
    command_latency: FloatArray
    supervisor_lost: FloatArray


class OperatorCommand(Sample):
    """OperatorCommand.msg: command of an operator, 50 Hz."""

    TOPIC = "/cassie/operator_command"
    LAYOUT = (
        ("effective_seq", U8, 1),
        ("vx", F8, 1),
        ("vy", F8, 1),
        ("yaw_rate", F8, 1),
        ("height", F8, 1),
        ("com_x", F8, 1),
        ("com_y", F8, 1),
        ("roll", F8, 1),
        ("pitch", F8, 1),
        ("trims", F8, 4),
        ("mode", U1, 1),
        ("power", B1, 1),
        ("link", B1, 1),
        ("scripted", B1, 1),
        ("emergency_stop", B1, 1),
        ("take_over", B1, 1),
        ("sender", U1, 30),
    )
    effective_seq: UInt64Array
    vx: FloatArray
    vy: FloatArray
    yaw_rate: FloatArray
    height: FloatArray
    com_x: FloatArray
    com_y: FloatArray
    roll: FloatArray
    pitch: FloatArray
    trims: FloatArray
    mode: UInt8Array
    power: BoolArray
    link: BoolArray
    scripted: BoolArray
    emergency_stop: BoolArray
    take_over: BoolArray
    sender: UInt8Array


class GaitRequest(Sample):
    """GaitRequest.msg: the request for a gait."""

    TOPIC = "/cassie/gait_request"
    LAYOUT = (
        ("effective_seq", U8, 1),
        ("vx", F8, 1),
        ("vy", F8, 1),
        ("yaw_rate", F8, 1),
        ("payload", F8, 1),
        ("slope", F8, 1),
    )
    effective_seq: UInt64Array
    vx: FloatArray
    vy: FloatArray
    yaw_rate: FloatArray
    payload: FloatArray
    slope: FloatArray


class Gait(Sample):
    """Gait.msg: a certified gait, or the statement that there is none."""

    TOPIC = "/cassie/gait"
    LAYOUT = (
        ("effective_seq", U8, 1),
        ("result", U8, 1),
        ("vx", F8, 1),
        ("vy", F8, 1),
        ("yaw_rate", F8, 1),
        ("payload", F8, 1),
        ("slope", F8, 1),
        ("step_time", F8, 1),
        ("right_stance", F8, 54),
        ("left_stance", F8, 54),
    )
    effective_seq: UInt64Array
    result: UInt64Array
    vx: FloatArray
    vy: FloatArray
    yaw_rate: FloatArray
    payload: FloatArray
    slope: FloatArray
    step_time: FloatArray
    right_stance: FloatArray
    left_stance: FloatArray


SAMPLE_TYPES: tuple[type[Sample], ...] = (
    Sensors,
    RobotState,
    Mode,
    MotorCommand,
    ControllerStatus,
    OperatorCommand,
)
"""Sample types of every run."""

GAIT_TYPES: tuple[type[Sample], ...] = (GaitRequest, Gait)
"""Further sample types of a run whose controller takes gaits from gait_optimizer."""
