"""Meaning of each field of a recorded topic: its unit and the names of its components.

The fields of the control lane, the ground truth and the Segway's topics stand here, and the units
of ROS's own messages. Other topics are described by their ROS definitions, in SI units.

Source:
    REP 103, "Standard Units of Measure and Coordinate Conventions".
"""

from __future__ import annotations

from dataclasses import dataclass

from cassie_bags.bag.recording import GROUND_TRUTH_TOPIC, SEGWAY_IMU_TOPIC, SEGWAY_TRUTH_TOPIC
from cassie_msgs.layout import (
    ControllerStatus,
    Gait,
    GaitRequest,
    GaitResult,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sensors,
)

LEGS = ("left", "right")
XYZ = ("x", "y", "z")
XYZW = ("x", "y", "z", "w")
DRIVES = tuple(
    f"{leg}_{drive}"
    for leg in LEGS
    for drive in ("hip_roll", "hip_yaw", "hip_pitch", "knee", "toe")
)
JOINTS = tuple(f"{leg}_{joint}" for leg in LEGS for joint in ("shin", "tarsus", "toe"))
COORDINATES = (
    *("x", "y", "z", "yaw", "pitch", "roll"),
    *(
        f"{leg}_{joint}"
        for leg in LEGS
        for joint in ("hip_roll", "hip_yaw", "hip_pitch", "knee", "shin", "tarsus", "toe")
    ),
)
OUTPUTS = (
    *("torso_roll", "stance_hip_yaw", "torso_pitch", "stance_leg_length", "swing_leg_roll"),
    *("swing_hip_yaw", "swing_leg_pitch", "swing_leg_length", "swing_foot_pitch"),
)
_TRIMS = ("sagittal_leg", "lateral_leg", "torso_pitch", "torso_roll")
_VARIANCES = (
    *("x", "y", "z", "yaw", "pitch", "roll", "vx", "vy", "vz"),
    *("rate_x", "rate_y", "rate_z"),
)
_POSE_UNITS = ("m",) * 3 + ("rad",) * 17
_OUTPUT_UNITS = tuple("m" if name.endswith("length") else "rad" for name in OUTPUTS)
_VARIANCE_UNITS = ("m^2",) * 3 + ("rad^2",) * 3 + ("m^2/s^2",) * 3 + ("rad^2/s^2",) * 3
_RESULTS = ", ".join(f"{result.value} {result.name.lower()}" for result in GaitResult)
_COEFFICIENTS = tuple(f"{name}.{k}" for name in OUTPUTS for k in range(6))
_COEFFICIENT_UNITS = tuple(unit for unit in _OUTPUT_UNITS for _ in range(6))
_MODES = ", ".join(f"{mode.value} {mode.name.lower()}" for mode in RobotMode)


@dataclass(frozen=True)
class Field:
    """One field of a message.

    Attributes:
        unit: Unit of the field; empty for numbers without one.
        about: Meaning of the field.
        components: Names of the entries of an array, in order; empty for a scalar.
        units: Unit of each entry, where the units differ.
    """

    unit: str
    about: str
    components: tuple[str, ...] = ()
    units: tuple[str, ...] = ()

    def unit_of(self, component: str) -> str:
        """Unit of an entry by its name; for a scalar, the unit of the field."""
        if self.units and component in self.components:
            return self.units[self.components.index(component)]
        return self.unit


def _per_second(units: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{unit}/s" for unit in units)


_COMMON = {
    "sec": Field("s", "stamp of the sensor sample, robot time, whole seconds"),
    "nanosec": Field("ns", "rest of the stamp"),
    "episode": Field("", "rises when the simulator resets or restarts"),
    "seq": Field("", "control tick within the episode"),
}
_STAMP = {
    "sec": Field("s", "stamp, robot time, whole seconds"),
    "nanosec": Field("ns", "rest of the stamp"),
}
_DELAYS = {
    "longest_delay": Field("s", "largest delay of a control tick in this episode"),
    "missed_ticks": Field("", "control ticks of this episode without a new command"),
    "late_ticks": Field("", "control ticks of this episode that ended late"),
    "wall_paced": Field("", "1 where control ticks follow the wall clock"),
    "operator_lease": Field("", "operator who holds the lease; 0 is nobody"),
}
_SET_POINTS = {
    "vx": Field("m/s", "velocity forward, heading frame"),
    "vy": Field("m/s", "velocity to the left, heading frame"),
    "yaw_rate": Field("rad/s", "turn rate to the left"),
    "height": Field("m", "pelvis origin above the loaded soles"),
    "com_x": Field("m", "shift of the centre of mass forward"),
    "com_y": Field("m", "shift of the centre of mass to the left"),
    "roll": Field("rad", "torso roll"),
    "pitch": Field("rad", "torso pitch"),
    "trims": Field("rad", "trims", _TRIMS),
}
_GAIT = {
    **_COMMON,
    "effective_seq": Field("", "first control tick at which the gait may be taken up"),
    "vx": Field("m/s", "mean velocity forward"),
    "vy": Field("m/s", "mean velocity to the left"),
    "yaw_rate": Field("rad/s", "mean turn rate to the left"),
    "payload": Field("kg", "mass on the pelvis in addition to its own"),
    "slope": Field("rad", "rise of the ground ahead"),
}
_ODOMETRY = {
    **_STAMP,
    "position": Field("m", "true position in the world", XYZ),
    "orientation": Field("", "true orientation, body to world, quaternion", XYZW),
    "linear": Field("m/s", "true velocity, body axes", XYZ),
    "angular": Field("rad/s", "true angular velocity, body axes", XYZ),
}

FIELDS: dict[str, dict[str, Field]] = {
    Sensors.TOPIC: {
        **_COMMON,
        "orientation": Field("", "the IMU's estimate, pelvis to world, quaternion", XYZW),
        "angular_velocity": Field("rad/s", "pelvis frame, mean since the last sample", XYZ),
        "linear_acceleration": Field("m/s^2", "specific force in the pelvis frame", XYZ),
        "drive_position": Field("rad", "angle at the joint", DRIVES),
        "drive_velocity": Field("rad/s", "speed at the joint", DRIVES),
        "drive_torque": Field("Nm", "torque at the joint", DRIVES),
        "joint_position": Field("rad", "joints without a drive of their own", JOINTS),
        "joint_velocity": Field("rad/s", "velocity of joints without a drive of their own", JOINTS),
        "battery": Field(
            "V, 0..1", "voltage and state of charge", ("voltage", "charge"), ("V", "0..1")
        ),
        "power": Field("", "1 while the drives are powered"),
        "damping": Field("", "1 while the drives damp by themselves"),
        **_DELAYS,
    },
    RobotState.TOPIC: {
        **_COMMON,
        "q": Field("m, rad", "generalized coordinates, see eq:qdef", COORDINATES, _POSE_UNITS),
        "v": Field("m/s, rad/s", "time derivative of q", COORDINATES, _per_second(_POSE_UNITS)),
        "com_position": Field("m", "centre of mass from the feet's middle, heading frame", XYZ),
        "com_velocity": Field("m/s", "velocity of the centre of mass, heading frame", XYZ),
        "foot_force": Field("N", "vertical force from spring deflection", LEGS),
        "foot_load": Field("0..1", "how far each foot is loaded", LEGS),
        "contact_probability": Field("0..1", "contact probability of each foot", LEGS),
        "angular_velocity": Field("rad/s", "pelvis frame", XYZ),
        "covariance": Field("", "diagonal of the covariance", _VARIANCES, _VARIANCE_UNITS),
        "power": Field("", "1 while the drives are powered"),
        "drive_torque": Field("Nm", "as the drives report it", DRIVES),
        "battery_charge": Field("0..1", "-1 while the gauge fails"),
        "sensor_faults": Field("", "rejected channels of Sensors, a bit each"),
        **_DELAYS,
    },
    Mode.TOPIC: {
        **_COMMON,
        "effective_seq": Field("", "first control tick at which the mode holds"),
        "mode": Field("", _MODES),
        "transition": Field("s", "time in this mode, at most 1"),
        **_SET_POINTS,
    },
    MotorCommand.TOPIC: {
        **_COMMON,
        "torque": Field("Nm", "feed-forward torque", DRIVES),
        "position": Field("rad", "set-point", DRIVES),
        "velocity": Field("rad/s", "set-point", DRIVES),
        "kp": Field("Nm/rad", "gain on the position", DRIVES),
        "kd": Field("Nms/rad", "gain on the velocity", DRIVES),
    },
    ControllerStatus.TOPIC: {
        **_COMMON,
        "mode_seq": Field("", "effective_seq of the mode in force"),
        "mode": Field("", _MODES),
        "phase": Field("", "progress of the step, above 1 while touchdown is late"),
        "stance_leg": Field("", "0 left, 1 right, -1 both"),
        "step_count": Field("", "steps since walking began"),
        "gait_speed": Field("m/s", "speed at which the gait library is read"),
        "step_time": Field("s", "nominal duration of the present step"),
        "velocity": Field("m/s", "filtered velocity", ("sagittal", "lateral")),
        "y": Field("rad, m", "tracking error of the nine outputs", OUTPUTS, _OUTPUT_UNITS),
        "dy": Field("rad/s, m/s", "rate of the errors y", OUTPUTS, _per_second(_OUTPUT_UNITS)),
        "saturation": Field("", "largest ratio of a drive's feed-forward torque to its limit"),
        "command_latency": Field("s", "from a state to the drives, beyond their 3 ms"),
        "supervisor_lost": Field("", "1 while the controller stops and stands by itself"),
    },
    OperatorCommand.TOPIC: {
        **_COMMON,
        "sec": Field("s", "stamp, robot time from a script, wall time from a person"),
        "effective_seq": Field("", "first control tick of the command; 0 from a person"),
        **_SET_POINTS,
        "mode": Field("", f"requested mode: {_MODES}"),
        "power": Field("", "whether the drives shall be powered"),
        "link": Field("", "whether the radio link is good at both ends"),
        "scripted": Field("", "whether a script is the sender, on the robot's clock"),
        "emergency_stop": Field("", "cuts the power at once"),
        "take_over": Field("", "asks for the lease that another operator holds"),
        "sender": Field("", "name of the sender, ASCII codes", tuple(str(i) for i in range(30))),
    },
    GROUND_TRUTH_TOPIC: _ODOMETRY,
    GaitRequest.TOPIC: _GAIT,
    Gait.TOPIC: {
        **_GAIT,
        "result": Field("", _RESULTS),
        "step_time": Field("s", "duration of a step"),
        **{
            f"{leg}_stance": Field(
                "", "Bezier coefficients of the outputs", _COEFFICIENTS, _COEFFICIENT_UNITS
            )
            for leg in LEGS
        },
    },
    SEGWAY_TRUTH_TOPIC: _ODOMETRY,
    SEGWAY_IMU_TOPIC: {
        **_STAMP,
        "angular": Field("rad/s", "angular velocity, chassis axes", XYZ),
        "force": Field("m/s^2", "specific force, chassis axes", XYZ),
    },
}
"""Fields by topic, then by name; the names are the columns of an export."""

_TIME = {"sec": "s", "nanosec": "ns"}
_TWIST = {**_TIME, "linear": "m/s", "angular": "rad/s"}

STANDARD_UNITS: dict[str, dict[str, str]] = {
    "geometry_msgs/msg/Twist": _TWIST,
    "geometry_msgs/msg/TwistStamped": _TWIST,
    "nav_msgs/msg/Odometry": {**_TWIST, "position": "m"},
    "rosgraph_msgs/msg/Clock": _TIME,
    "sensor_msgs/msg/Imu": {
        **_TIME,
        "angular_velocity": "rad/s",
        "linear_acceleration": "m/s^2",
    },
    "sensor_msgs/msg/JointState": {
        **_TIME,
        "position": "rad",
        "velocity": "rad/s",
        "effort": "Nm",
    },
    "tf2_msgs/msg/TFMessage": {**_TIME, "translation": "m"},
}
"""Units of ROS's own messages by type, then by the part of a field's dotted name with a unit."""


def standard_field(message_type: str, name: str) -> Field:
    """Field of one of ROS's own messages: with its unit where it is known, else without."""
    units = STANDARD_UNITS.get(message_type, {})
    return Field(next((units[part] for part in name.split(".") if part in units), ""), "")


def entry_name(topic: str, field: str, index: int) -> str:
    """Name of a field's entry in a topic of Cassie, as `plot` and `export` have it."""
    components = FIELDS[topic][field].components
    return f"{field}.{components[index]}" if components else field
