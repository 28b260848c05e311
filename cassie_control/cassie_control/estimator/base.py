"""Common part of both estimators: joints, leg kinematics, foot loads, Euler angles, CoM."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.errors import SensorError
from cassie_control.estimator import config as estimator_config
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.finite import LARGEST, check
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair, both_legs
from cassie_gaits.names import LEG_DRIVE_COUNT, LEG_SENSED_JOINTS, SHIN, TOE, TOE_DRIVE
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array
from cassie_gaits.vectors import cross, is_within, minus, plus, times, turned
from cassie_msgs.layout import RobotState, Sensors


class Body(Record):
    """Data of the robot that every estimator uses.

    Attributes:
        period: Time between samples. In s.
        mass: Mass of the robot. In kg.
        pelvis_moment: Mass times centre of mass of the pelvis. In kg m.
        imu_position: Position of the IMU in the pelvis. In m.
        load_from, load_span, contact_force, contact_width, height_bandwidth: See `EstimatorConfig`.
        toe_torques: Torques of the toes in the last sample. In Nm.
        attitude: IMU to world, as measured by the IMU in the last sample.
        imu_to_soles: Middle of each sole from the IMU at the last sample, pelvis frame. In m.
        carrying_share: Low-passed fraction of time in which the feet carried the robot.
        force_scale: Factor on the forces of the legs' springs.
        force_scale_time: Time constant of `force_scale`; it grows after the start. In s.
    """

    period: float
    mass: float
    pelvis_moment: FloatArray = array(3)
    imu_position: FloatArray = array(3)
    load_from: float
    load_span: float
    contact_force: float
    contact_width: float
    height_bandwidth: float
    toe_torques: FloatArray = array(2)
    attitude: FloatArray = array(3, 3)
    imu_to_soles: FloatArray = array(2, 3)
    carrying_share: float
    force_scale: float
    force_scale_time: float


@compiled
def update_legs(
    samples: RecordArray, states: RecordArray, leg_pairs: Records[LegPair], bodies: Records[Body]
) -> None:
    """Joints, kinematics, forces and loads of the legs; and the sample's values in the state.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        leg_pairs: Result, kinematics of both legs. Shape (1,).
        bodies: Data of the robot; its values of the last sample are updated. Shape (1,).
    """
    sample, state, legs, body = samples[0], states[0], leg_pairs[0], bodies[0]
    _copy_from_sample(samples, states)
    joints, rates, up = state.q[6:].reshape(2, 7), state.v[6:].reshape(2, 7), body.attitude[2]
    _order_joints(sample, joints, rates, body)
    _rotation_of(sample.orientation, body.attitude)
    both_legs(joints, rates, body.toe_torques, up, legs)
    for i in range(2):
        for k in range(3):
            body.imu_to_soles[i, k] = legs.states[i].foot[k] - body.imu_position[k]
    _scale_forces(body, legs.forces, sample.linear_acceleration, state.foot_force)
    _update_foot_loads(body, state)


@compiled
def complete_state(state: RobotState, legs: LegPair, body: Body, rotation: FloatArray) -> None:
    """Complete the state by the Euler angles and the CoM, from the estimated pelvis.

    Args:
        state: Has position, velocity and angular velocity; gets Euler angles, rates and CoM.
        legs: Kinematics of both legs.
        body: Data of the robot.
        rotation: Pelvis to world. Shape (3, 3).
    """
    _euler_angles(rotation, state.angular_velocity, state.q[3:6], state.v[3:6])
    _compute_com(state, legs, body, rotation)


@compiled
def _compute_com(state: RobotState, legs: LegPair, body: Body, rotation: FloatArray) -> None:
    """Centre of mass from the midpoint of the feet, and its velocity, in the heading frame.

    Args:
        state: Has position, velocity, angular velocity and Euler angles; gets the CoM.
        legs: Kinematics of both legs.
        body: Data of the robot.
        rotation: Pelvis to world. Shape (3, 3).
    """
    left, right, mass = legs.states[0], legs.states[1], body.mass
    moment = plus(plus(body.pelvis_moment, left.com_moment), right.com_moment)
    com = (moment[0] / mass, moment[1] / mass, moment[2] / mass)
    moment_rate = plus(left.com_rate, right.com_rate)
    velocity = (moment_rate[0] / mass, moment_rate[1] / mass, moment_rate[2] / mass)
    velocity = turned(rotation, plus(velocity, cross(state.angular_velocity, com)))
    offset = turned(rotation, minus(com, times(0.5, plus(left.foot, right.foot))))
    c, s = math.cos(state.q[3]), math.sin(state.q[3])
    vx, vy = state.v[0] + velocity[0], state.v[1] + velocity[1]
    state.com_position[0] = c * offset[0] + s * offset[1]
    state.com_position[1] = c * offset[1] - s * offset[0]
    state.com_position[2] = offset[2]
    state.com_velocity[0] = c * vx + s * vy
    state.com_velocity[1] = c * vy - s * vx
    state.com_velocity[2] = state.v[2] + velocity[2]


@compiled
def _copy_from_sample(samples: RecordArray, states: RecordArray) -> None:
    """Copy the values of the sample that the state repeats."""
    sample, state = samples[0], states[0]
    state.sec, state.nanosec = sample.sec, sample.nanosec
    state.episode, state.seq = sample.episode, sample.seq
    state.power = sample.power
    state.drive_torque[:] = sample.drive_torque
    charge = sample.battery[1]
    state.battery_charge = charge if 0.0 <= charge <= 1.0 else -1.0
    state.longest_delay = sample.longest_delay
    state.missed_ticks, state.late_ticks = sample.missed_ticks, sample.late_ticks
    state.wall_paced, state.operator_lease = sample.wall_paced, sample.operator_lease


_LEG_SENSED_JOINT_COUNT = len(LEG_SENSED_JOINTS)


@compiled
def _order_joints(sample: Sensors, joints: FloatArray, rates: FloatArray, body: Body) -> None:
    """Measurements of drives and joints in the order along each leg; the toe's are its drive's.

    Args:
        sample: Has the measurements.
        joints, rates: Result, hip_roll to toe. Shape (2, 7), in rad and rad/s.
        body: Gets the toes' torques.
    """
    for i in range(2):
        drive, shin = LEG_DRIVE_COUNT * i, _LEG_SENSED_JOINT_COUNT * i
        for k in range(SHIN):
            joints[i, k] = sample.drive_position[drive + k]
            rates[i, k] = sample.drive_velocity[drive + k]
        for k in range(SHIN, TOE):
            joints[i, k] = sample.joint_position[shin + k - SHIN]
            rates[i, k] = sample.joint_velocity[shin + k - SHIN]
        joints[i, TOE] = sample.drive_position[drive + TOE_DRIVE]
        rates[i, TOE] = sample.drive_velocity[drive + TOE_DRIVE]
        body.toe_torques[i] = sample.drive_torque[drive + TOE_DRIVE]


# Whether the feet alone carry the robot at this moment. `acceleration` asks whether the robot has
# been on its feet for some steps: with the weight at rest, and a longer time constant.
_CARRYING_TIME = 0.05  # s, time constant of `Body.carrying_share`
# `Body.force_scale_time` grows from the duration of a step, over which the error averages out.
_FIRST_SCALE_TIME, _LAST_SCALE_TIME = 0.4, 6.0  # s
# Springs within 20 % and a mass within 10 % of the nominal ones give 0.9 / 1.2 to 1.1 / 0.8.
_MIN_SCALE, _MAX_SCALE = 0.7, 1.4


@compiled
def _scale_forces(
    body: Body, springs: FloatArray, specific_force: FloatArray, forces: FloatArray
) -> None:
    """Forces of the feet, scaled so that on average they carry the robot's weight.

    Neither the springs' stiffness nor the mass is known to better than some ten percent. Averaged
    over a step, the springs' force N must equal the mass times the vertical specific force a. So
    the scale k is an integral, with a time constant T that grows by the time on the feet:

        k' = (m a - k (N_left + N_right)) / (m g T)

    Args:
        body: Data of the robot; its scale is updated.
        springs: Vertical forces by the nominal stiffness of the springs. Shape (2,), in N.
        specific_force: At the IMU, pelvis frame. Shape (3,), in m/s^2.
        forces: Result. Shape (2,), in N.

    Source:
        Newton's law along the vertical, averaged over a step; the integral is this project's.
    """
    period, mass, up = body.period, body.mass, body.attitude[2]
    spring_force, apparent_weight = springs[0] + springs[1], 0.0
    for k in range(3):
        apparent_weight += mass * up[k] * specific_force[k]
    # Else a gantry carries the robot, too.
    carrying = 1.0 if spring_force > estimator_config.CARRYING_RATIO * apparent_weight else 0.0
    body.carrying_share += period / _CARRYING_TIME * (carrying - body.carrying_share)
    if body.carrying_share > 0.5:
        body.force_scale_time = min(_LAST_SCALE_TIME, body.force_scale_time + period)
        error = apparent_weight - body.force_scale * spring_force
        body.force_scale += period / body.force_scale_time * error / (mass * robot.GRAVITY)
        body.force_scale = max(_MIN_SCALE, min(_MAX_SCALE, body.force_scale))
    for i in range(2):
        forces[i] = body.force_scale * springs[i]


_MAX_LOG_ODDS = 50.0  # against contact, so that the exponential does not overflow


@compiled
def _update_foot_loads(body: Body, state: RobotState) -> None:
    """Load and probability of contact of each foot, from its force F.

    The load says how far the foot is loaded: 0 up to `load_from`, 1 from `load_from` + `load_span`
    on, linear between. The probability is 1 / (1 + exp((F_0 - F) / w)), with `contact_force` F_0
    and `contact_width` w.
    """
    for i in range(2):
        force = state.foot_force[i]
        state.foot_load[i] = max(0.0, min(1.0, (force - body.load_from) / body.load_span))
        log_odds = min(_MAX_LOG_ODDS, (body.contact_force - force) / body.contact_width)
        state.contact_probability[i] = 1.0 / (1.0 + math.exp(log_odds))


@compiled
def _rotation_of(orientation: FloatArray, rotation: FloatArray) -> None:
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


_MIN_COS_PITCH = 0.05  # at such a pitch the robot has fallen


@compiled
def _euler_angles(
    rotation: FloatArray, angular_velocity: FloatArray, angles: FloatArray, rates: FloatArray
) -> None:
    """Z-y-x Euler angles and their rates.

    Args:
        rotation: Pelvis to world. Shape (3, 3).
        angular_velocity: Pelvis frame. Shape (3,), in rad/s.
        angles: Yaw, pitch, roll: the previous ones, replaced by the result. Yaw is unwrapped, so
            that it can be tracked and integrated. Shape (3,), in rad.
        rates: Result, their time derivatives. Shape (3,), in rad/s.
    """
    sin_pitch = max(-1.0, min(1.0, -rotation[2, 0]))
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    angles[0] = yaw + 2.0 * math.pi * round((angles[0] - yaw) / (2.0 * math.pi))
    angles[1] = math.asin(sin_pitch)
    angles[2] = math.atan2(rotation[2, 1], rotation[2, 2])
    c_roll, s_roll = math.cos(angles[2]), math.sin(angles[2])
    c_pitch = max(_MIN_COS_PITCH, math.cos(angles[1]))
    scaled_yaw_rate = s_roll * angular_velocity[1] + c_roll * angular_velocity[2]
    rates[0] = scaled_yaw_rate / c_pitch
    rates[1] = c_roll * angular_velocity[1] - s_roll * angular_velocity[2]
    rates[2] = angular_velocity[0] + scaled_yaw_rate * math.sin(angles[1]) / c_pitch


class LegEstimator:
    """Base class of the estimators; child classes estimate the pelvis.

    Foot force is the force of the deflected springs (`leg.spring_force`), scaled so that on average
    both feet carry the weight of the nominal robot (`_scale_forces`). Load and contact probability
    follow from foot force.

    Args:
        config: Parameters.
        period: Time between samples. In s.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._period = period
        self._state = RobotState()
        self._legs = LegPair()
        self._feet: FloatArray = self._legs.records["states"]["foot"][0]
        self._body = Body(period=period, mass=robot.MASS)
        self._body.pelvis_moment = robot.PELVIS.mass * np.array(robot.PELVIS.com)
        self._body.imu_position[:] = robot.IMU_POSITION
        self._body.attitude = np.eye(3)
        self._rotation = self._body.attitude
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
        """Parameters in force; may be set while the estimator runs."""
        return self._config

    @config.setter
    def config(self, config: EstimatorConfig) -> None:
        self._configure(config)

    def _configure(self, config: EstimatorConfig) -> None:
        self._config = config
        self._body.take(config)

    def reset(self) -> None:
        """Begin anew: at rest, at the origin, with the height from the next sample's legs."""
        self._state.floats[:] = 0.0
        body = self._body
        body.carrying_share, body.force_scale, body.force_scale_time = 0.0, 1.0, _FIRST_SCALE_TIME

    def restart(self) -> None:
        """Begin anew with the next sample, at rest at this place; the yaw's full turns are kept."""
        x, y, yaw = self._state.q[[0, 1, 3]]
        self.reset()
        if math.isfinite(x + y + yaw):
            self._state.q[[0, 1, 3]] = x, y, yaw

    def set_accelerometer_rejected(self, rejected: bool) -> None:
        """Set whether the accelerometer is rejected, so that samples have gravity in its place."""

    def step(self, sensors: Sensors) -> RobotState:
        """Estimate from one sample.

        Returns:
            The state; reused by the next step.

        Raises:
            SensorError: if a value is not finite or the orientation is no unit quaternion; the
                estimate is then not changed.
        """
        _check(sensors)
        update_legs(sensors.record, self._state.record, self._legs.records, self._body.records)
        self._estimate_pelvis(sensors)
        return self._state

    def _estimate_pelvis(self, sensors: Sensors) -> None:
        """Estimate the pelvis, with its covariance, and the CoM."""
        raise NotImplementedError

    def _first_height(self) -> float:
        """Pelvis height when the lower foot touches level ground. In m."""
        return robot.SOLE_RADIUS - float((self._feet @ self._body.attitude[2]).min())


@compiled
def squared_norm(q: FloatArray) -> float:
    """Squared norm of a quaternion. Shape (4,)."""
    total: float = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    return total


@compiled
def is_orientation(q: FloatArray) -> bool:
    """Whether the norm of a measured quaternion is that of an orientation; false for NaN."""
    return 0.9 < squared_norm(q) < 1.1


def _check(sensors: Sensors) -> None:
    """Raise an error for values that are not finite and for an orientation of wrong length."""
    if not is_within(sensors.floats, LARGEST):
        # Estimation does not need the battery gauge, so its failure is no error.
        check(sensors, "sensor", SensorError, unused=("battery",))
    if not is_orientation(sensors.orientation):
        norm = math.sqrt(squared_norm(sensors.orientation))
        raise SensorError(f"sensor orientation is a quaternion of length {norm:.3g}, must be 1")
