"""What both estimators do alike: joints, leg kinematics, foot loads, Euler angles, CoM."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.fusion import com_in_heading
from cassie_control.finite import LARGEST, check
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair, both_legs
from cassie_gaits.vectors import is_within
from cassie_msgs.layout import RobotState, Sensors

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]

BODY_TYPE = np.dtype(
    [
        ("period", float),  # between samples, s
        ("mass", float),  # of the robot, kg
        ("pelvis_moment", float, 3),  # mass times centre of mass of the pelvis, kg m
        ("imu", float, 3),  # its position in the pelvis, m
        # Of the configuration, see `config`:
        ("load_from", float),  # N
        ("load_span", float),
        ("contact_force", float),
        ("contact_width", float),
        ("height_bandwidth", float),  # 1/s
        # Of the last sample:
        ("toe_torques", float, 2),  # Nm
        ("attitude", float, (3, 3)),  # IMU to world, as the IMU itself has it
        ("arms", float, (2, 3)),  # middle of each sole from the IMU, pelvis frame, m
        # What is remembered:
        ("scale", float, 3),  # share of late in which the feet carried it, the factor of their
        # springs' forces, and the time that it is averaged over, s
        ("ground", float),  # height of the ground under the loaded feet, m
    ]
)
"""The robot as every estimator has it."""


GRAVITY = 9.81
FIRST_TIME, _SCALE_TIME = 0.4, 6.0  # s, over which forces are averaged: at first, at last
_CONTACT_TIME = 0.05  # s
_STANDS = 0.6  # share of what is felt, that feet which carry it seem to carry at least
_LEAST_SCALE, _LARGEST_SCALE = 0.7, 1.4  # springs +-20 %, mass +-10 %


@compiled
def read_legs(
    samples: RecordArray, states: RecordArray, pairs: RecordArray, bodies: RecordArray
) -> None:
    """Joints, kinematics, forces and loads of the legs; and what the state repeats of the sample.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        pairs: Result, `LegPair.record`. Shape (1,).
        bodies: Of `BODY_TYPE`. Shape (1,).
    """
    sample, state, pair, body = samples[0], states[0], pairs[0], bodies[0]
    _pass_on(sample, state)
    joints, rates, up = state.q[6:].reshape(2, 7), state.v[6:].reshape(2, 7), body.attitude[2]
    _arrange_joints(sample, joints, rates, body.toe_torques)
    rotation_of(sample.orientation, body.attitude)
    both_legs(joints, rates, body.toe_torques, up, pair)
    for i in range(2):
        for k in range(3):
            body.arms[i, k] = pair.states[i].foot[k] - body.imu[k]
    _scale_forces(body, pair.forces, sample.linear_acceleration, up, state.foot_force)
    _weigh_feet(body, state.foot_force, state.foot_load, state.contact_probability)


@compiled
def finish(state: Any, pair: Any, body: Any, rotation: FloatArray) -> None:
    """Euler angles, and the CoM, of a pelvis that is known.

    Args:
        state: Of `RobotState.RECORD`; has position, velocity and angular velocity.
        pair: Of `PAIR_TYPE`.
        body: Of `BODY_TYPE`.
        rotation: Pelvis to world. Shape (3, 3).
    """
    rate = state.angular_velocity
    euler_angles(rotation, rate, state.q[3:6], state.v[3:6])
    com_in_heading(
        rotation,
        state.q[3],
        rate,
        state.v[:3],
        pair.states,
        body.pelvis_moment,
        body.mass,
        state.com_position,
        state.com_velocity,
    )


@compiled
def finish_state(
    states: RecordArray, pairs: RecordArray, bodies: RecordArray, rotation: FloatArray
) -> None:
    """`finish` with records in arrays of shape (1,)."""
    finish(states[0], pairs[0], bodies[0], rotation)


@compiled
def _pass_on(sample: Any, state: Any) -> None:
    """What the state repeats of the sample."""
    state.sec, state.nanosec = sample.sec, sample.nanosec
    state.episode, state.seq = sample.episode, sample.seq
    state.power = sample.power
    state.drive_torque[:] = sample.drive_torque
    charge = sample.battery[1]
    state.battery_charge = charge if 0.0 <= charge <= 1.0 else -1.0
    state.longest_delay = sample.longest_delay
    state.missed_ticks, state.late_ticks = sample.missed_ticks, sample.late_ticks
    state.wall_paced, state.operator_lease = sample.wall_paced, sample.operator_lease


@compiled
def _arrange_joints(
    sample: Any, joints: FloatArray, rates: FloatArray, toe_torques: FloatArray
) -> None:
    """Measurements of drives and joints in the order along each leg.

    Args:
        sample: Of `Sensors.RECORD`.
        joints, rates: Result, hip_roll to toe. Shape (2, 7), in rad and rad/s.
        toe_torques: Result. Shape (2,), in Nm.
    """
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


@compiled
def _scale_forces(
    body: Any, springs: FloatArray, specific_force: FloatArray, up: FloatArray, forces: FloatArray
) -> None:
    """Forces of the feet such that on average they carry the robot's weight.

    Neither the springs' stiffness nor the mass is known to better than some ten percent. What
    the springs hold, averaged over a step, must be the mass times what the accelerometer feels.

    Args:
        body: Of `BODY_TYPE`; its scale is brought up to date.
        springs: Vertical forces after the nominal springs. Shape (2,), in N.
        specific_force: At the IMU, pelvis frame. Shape (3,), in m/s^2.
        up: The vertical in the pelvis frame. Shape (3,).
        forces: Result. Shape (2,), in N.
    """
    scale, period, mass = body.scale, body.period, body.mass
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
def _weigh_feet(body: Any, forces: FloatArray, load: FloatArray, contact: FloatArray) -> None:
    """Load and probability of contact of each foot, from its force.

    Args:
        body: Of `BODY_TYPE`.
        forces: Shape (2,), in N.
        load: Result, 0..1. Shape (2,).
        contact: Result, 0..1. Shape (2,).
    """
    for i in range(2):
        load[i] = max(0.0, min(1.0, (forces[i] - body.load_from) / body.load_span))
        odds = (body.contact_force - forces[i]) / body.contact_width
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


_CONFIGURED = ("load_from", "load_span", "contact_force", "contact_width", "height_bandwidth")


class LegEstimator:
    """An estimator whose pelvis is left to its children.

    Foot force is what the deflected springs hold (`LegChain.force`), scaled so that on average
    both carry the weight of the nominal robot (`scale_forces`); load and contact probability follow
    from it.

    Args:
        config: Figures.
        period: Time between samples. In s.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._period = period
        self._state = RobotState()
        self._legs = LegPair()
        self._feet: FloatArray = self._legs.records["states"]["foot"][0]
        self._body = np.zeros(1, BODY_TYPE)
        body = self._body[0]
        body["period"], body["mass"] = period, robot.total_mass()
        body["pelvis_moment"] = robot.PELVIS.mass * np.array(robot.PELVIS.com)
        body["imu"] = robot.IMU_POSITION
        self._attitude: FloatArray = body["attitude"]
        self._rotation = np.eye(3)
        self._configure(config)

    @property
    def feet(self) -> FloatArray:
        """Middle of each sole in the pelvis at the last sample. Shape (2, 3), in m."""
        return self._feet

    @property
    def rotation(self) -> FloatArray:
        """Pelvis to world at the last sample. Shape (3, 3)."""
        return self._rotation

    @property
    def config(self) -> EstimatorConfig:
        """Figures in force; may be set while it runs."""
        return self._config

    @config.setter
    def config(self, config: EstimatorConfig) -> None:
        self._configure(config)

    def _configure(self, config: EstimatorConfig) -> None:
        self._config = config
        for name in _CONFIGURED:
            self._body[name] = getattr(config, name)

    def reset(self) -> None:
        """Forget everything: at rest, at the origin, height from the next sample's legs."""
        self._state.floats[:] = 0.0
        self._body["scale"] = 0.0, 1.0, FIRST_TIME
        self._body["ground"] = 0.0

    def restart(self) -> None:
        """Begin anew with the next sample, at rest; place and counted turns are kept."""
        x, y, yaw = self._state.q[[0, 1, 3]]
        self.reset()
        if math.isfinite(x + y + yaw):
            self._state.q[[0, 1, 3]] = x, y, yaw

    def coast(self, blind: bool) -> None:
        """Whether to go on without the accelerometer, which then only tells gravity."""

    def step(self, sensors: Sensors) -> RobotState:
        """Estimate from one sample.

        Returns:
            The state; reused by the next step.

        Raises:
            SensorError: if a value is not finite or the orientation is no unit quaternion; the
                estimate then stays as it was.
        """
        _check(sensors)
        read_legs(sensors.record, self._state.record, self._legs.records, self._body)
        self._move(sensors)
        return self._state

    def _move(self, sensors: Sensors) -> None:
        """Estimate the pelvis, with its covariance, and the CoM."""
        raise NotImplementedError

    def _first_height(self) -> float:
        """Pelvis height when the lower foot touches level ground. In m."""
        return robot.SOLE_RADIUS - float((self._feet @ self._attitude[2]).min())


@compiled
def _square(quaternion: FloatArray) -> float:
    w, x, y, z = quaternion
    square: float = w * w + x * x + y * y + z * z
    return square


def _check(sensors: Sensors) -> None:
    if not is_within(sensors.floats, LARGEST):
        # A battery gauge that fails fells nobody.
        check(sensors, "sensor", SensorError, unused=("battery",))
    square = _square(sensors.orientation)
    if not 0.8 < square < 1.2:
        norm = math.sqrt(square)
        raise SensorError(f"sensor orientation is a quaternion of length {norm:.3g}, must be 1")
