"""The MuJoCo model of a scenario, and the robot's readings in it."""

from __future__ import annotations

import mujoco
import numpy as np

from cassie_gaits import robot
from cassie_gaits.names import DRIVES, SENSED_JOINTS
from cassie_gaits.records import FloatArray
from cassie_msgs.experiment.scenario import Payload, Scenario
from cassie_sim.errors import SimulationError
from cassie_sim.ground import SLOWEST_PERIOD, is_soft
from cassie_sim.scenes import scene_spec

_PAYLOAD_RADIUS = 0.08  # radius of a solid ball with the payload's inertia, in m


def compile_model(scenario: Scenario, *, meshes: bool, period: float) -> mujoco.MjModel:
    """The robot of a scenario in its scene.

    Args:
        scenario: Scene, drawn robot, payload and factors on the model.
        meshes: Whether to load the visual meshes.
        period: Length of a physics step. In s.

    Raises:
        SimulationError, ParameterError: naming the setting, its value and the permitted values.
    """
    spec = scene_spec(scenario.scene, scenario.scene_parameters, meshes=meshes)
    spec.option.timestep = period
    if scenario.payload.mass > 0.0:
        _add_payload(spec, scenario.payload)
    for name, kind in (
        ("gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")
    model = spec.compile()
    if is_soft(model) and period > SLOWEST_PERIOD:
        raise SimulationError(
            f"physics_rate = {1.0 / period:g} Hz: soft ground needs {1.0 / SLOWEST_PERIOD:g} Hz "
            "or more"
        )
    _scale(model, scenario)
    if scenario.payload.mass > 0.0:
        _weigh_payload(model, scenario.payload)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _add_payload(spec: mujoco.MjSpec, payload: Payload) -> None:
    """Add the payload as a body without shape, fixed to the pelvis."""
    place = np.add(robot.PELVIS.com, (payload.x, payload.y, payload.z))
    body = spec.body("pelvis").add_body(name="payload", pos=place)
    body.explicitinertial = True
    body.mass, body.inertia = payload.mass, _ball_inertia(payload)


def _weigh_payload(model: mujoco.MjModel, payload: Payload) -> None:
    """Set the load's own mass again: the factors on mass are for the robot's links only."""
    body = model.body("payload").id
    model.body_mass[body] = payload.mass
    model.body_inertia[body] = _ball_inertia(payload)


def _ball_inertia(payload: Payload) -> FloatArray:
    return np.full(3, 0.4 * payload.mass * _PAYLOAD_RADIUS**2)


def _scale(model: mujoco.MjModel, scenario: Scenario) -> None:
    scale, draw = scenario.model, scenario.draw
    mass = scale.mass * draw.mass
    model.body_mass[:] *= mass
    model.body_inertia[:] *= mass
    model.jnt_stiffness[:] *= scale.spring
    model.dof_damping[:] *= scale.damping
    model.dof_armature[:] *= scale.armature
    ground = model.geom_priority > 0
    model.geom_friction[ground, 0] *= scale.friction * draw.friction


class Readings:
    """Views of the true state, and of the part that the sensors measure.

    Attributes:
        qpos, qvel: MuJoCo's coordinates and their rates.
        q_indices, v_indices: Indices in `qpos` and `qvel` of drives, then of shin, tarsus, toe of
            both legs. Shape (16,).
        position: Position of the pelvis. Shape (3,), in m.
        quaternion: Pelvis to world, w x y z. Shape (4,).
        rotation: Rotation matrix from pelvis to world, row by row, as of the last kinematics. Shape
            (9,).
        twist: Linear velocity in the world, angular velocity in the pelvis. Shape (6,).
        wrench: External force and torque on the pelvis, to be set. Shape (6,), world axes.
        torques: Torques of the drives, to be set. Shape (10,), in Nm.
        imu: Angular velocity and specific force, pelvis frame. Shape (6,), in rad/s and m/s^2.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        joints = [model.joint(name) for name in DRIVES + SENSED_JOINTS]
        self.q_indices = np.array([joint.qposadr[0] for joint in joints], np.int64)
        self.v_indices = np.array([joint.dofadr[0] for joint in joints], np.int64)
        pelvis = model.body("pelvis").id
        self.qpos: FloatArray = data.qpos
        self.qvel: FloatArray = data.qvel
        self.position: FloatArray = data.qpos[:3]
        self.quaternion: FloatArray = data.qpos[3:7]
        self.rotation: FloatArray = data.xmat[pelvis]
        self.twist: FloatArray = data.qvel[:6]
        self.wrench: FloatArray = data.xfrc_applied[pelvis]
        self.torques: FloatArray = data.ctrl
        imu = model.sensor("gyro").adr[0]  # the accelerometer follows the gyro
        self.imu: FloatArray = data.sensordata[imu : imu + 6]

    def measured(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The arguments of `IdealSensors.observe`."""
        angles, rates = self.qpos[self.q_indices], self.qvel[self.v_indices]
        return angles, rates, self.quaternion, self.imu
