"""The robot and its world as a plant: sensor samples out, motor commands in.

One control tick is `Plant.sense()` followed by `Plant.step(command)`. Everything in between
(drives, sensor filters, gantry, pushes) runs at the rate of the physics.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_gaits.names import DRIVES, SENSED_JOINTS
from cassie_gaits.robot import DRIVE_DELAY
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_msgs.tunables import tunable
from cassie_sim.drives import Drives
from cassie_sim.errors import SimulationError
from cassie_sim.events import Events
from cassie_sim.gantry import Gantry
from cassie_sim.kernels import gather
from cassie_sim.poses import lowest_sole, set_drives
from cassie_sim.scenario import Scenario
from cassie_sim.scenes import scene_spec
from cassie_sim.sensors import FaithfulSensors, IdealSensors, ImuErrors

FloatArray = npt.NDArray[np.float64]

STANDING_DRIVES = (0.0, 0.0, 0.5, -1.15, -1.6)
"""Leg pose at the start, about 0.9 m tall with level soles. One leg, in rad."""

HANGING_HEIGHT = 1.15
"""Pelvis height while hanging from the gantry at the start. In m."""

COMMAND_WATCHDOG = 0.02
"""Robot time without a command after which the drives damp. In s."""

BATTERY = (72.0, 1.0)
"""Voltage in V and state of charge, which the simulation keeps."""


@dataclass(frozen=True, kw_only=True)
class PlantConfig:
    """Rates and grade of the plant.

    `control_rate` must divide `physics_rate`.
    """

    physics_rate: int = tunable(2000, "Hz", 500, 20000, "Rate of physics and drives", live=False)
    control_rate: int = tunable(500, "Hz", 50, 4000, "Rate of sensor samples", live=False)
    sensors: str = tunable(
        "faithful",
        choices=("faithful", "ideal"),
        description="Sensors with bits, filters, noise and delay, or the truth",
        live=False,
    )


class Plant:
    """Cassie in a scene.

    Args:
        config: Rates and sensor grade.
        scenario: Scene, start, events, delays and the robot drawn.
        meshes: Whether to load the visual meshes, for pictures.

    Raises:
        SimulationError, ParameterError: naming the setting, its value and what is permitted.
    """

    def __init__(
        self, config: PlantConfig, scenario: Scenario | None = None, *, meshes: bool = False
    ) -> None:
        self.config = config
        self.scenario = scenario or Scenario()
        _check_rates(config)
        self.substeps = config.physics_rate // config.control_rate
        self.tick_ns = 1_000_000_000 // config.control_rate
        self.period = 1.0 / config.physics_rate
        self.model = _compile(self.scenario, meshes, self.period)
        self.data = mujoco.MjData(self.model)
        self.gantry = Gantry()
        self.sensors = self._make_sensors()
        draw, scale = self.scenario.draw, self.scenario.model
        self.drives = Drives(
            self.period,
            DRIVE_DELAY + self.scenario.delays.torque,
            np.array(draw.torque_constant) * scale.torque,
        )
        self.events = Events(self.scenario, self.model, config.physics_rate)
        self.seq = 0
        self.episode = 0
        self._sample = Sensors()
        self._index_model()
        self.reset()

    def reset(self) -> None:
        """Back to the start pose at time 0, with the same robot and the same noise."""
        mujoco.mj_resetData(self.model, self.data)
        self.seq = 0
        self._physics_steps = 0
        self._idle_ticks = 0
        self.drives.reset()
        self.events.reset()
        self.gantry.release()
        self._wrench[:] = 0.0
        self._pulled = False
        self._place()
        mujoco.mj_forward(self.model, self.data)
        self.sensors = self._make_sensors()
        self.sensors.reset(*self._measured())

    def power(self, on: bool) -> None:
        """Switch the drives; without power they give no torque from the next physics step on."""
        self.drives.powered = on

    def sense(self) -> Sensors:
        """The sensor sample of this tick. Valid until the next call; call it once a tick."""
        sample = self._sample
        sample.seq[...] = self.seq
        sample.episode[...] = self.episode
        sample.stamp_ns = self.seq * self.tick_ns
        self.sensors.write(sample)
        sample.drive_torque[:] = self.drives.applied
        sample.battery[:] = BATTERY
        sample.power[...] = float(self.drives.powered)
        sample.damping[...] = float(self.drives.damped)
        self.events.spoil(self.seq * self.substeps, sample)
        return sample

    def step(self, command: MotorCommand | None) -> None:
        """Advance one control tick.

        Args:
            command: Set-points for this tick. None keeps the last ones, until the watchdog of
                the drives damps.

        Raises:
            CommandError: if the command is refused; the tick has then run with damped drives.
        """
        refusal: ValueError | None = None
        try:
            self._take(command)
        except ValueError as error:
            self.drives.damp()
            refusal = error
        for _ in range(self.substeps):
            self._physics_step()
        self.seq += 1
        if refusal is not None:
            raise refusal

    @property
    def time(self) -> float:
        """Robot time. In s."""
        return self._physics_steps * self.period

    @property
    def pelvis_pose(self) -> tuple[FloatArray, FloatArray]:
        """True position (3,) in m and orientation w x y z (4,) of the pelvis; views."""
        return self._position, self._quaternion

    @property
    def pelvis_twist(self) -> FloatArray:
        """True linear velocity in the world and angular velocity in the pelvis; a view (6,)."""
        return self._twist

    def _take(self, command: MotorCommand | None) -> None:
        if command is None:
            self._idle_ticks += 1
            if self._idle_ticks * self.substeps * self.period >= COMMAND_WATCHDOG:
                self.drives.damp()
            return
        self._idle_ticks = 0
        delayed = self.events.delayed(command)
        if delayed is not None:
            self.drives.set_points(delayed)

    def _physics_step(self) -> None:
        torque = self.drives.step(self.sensors.position, self.sensors.velocity)
        self._ctrl[:] = torque
        gantry = self.gantry
        if gantry.attached:
            gantry.step(self.period, self._position, self._rotation, self._twist)
            self._pulled = True
        if self._pulled:  # once more after the gantry let go, at whoever's order
            self._wrench[:] = gantry.wrench
            self._pulled = gantry.attached
        self.events.apply(self._physics_steps, self.data, self.gantry, self._position)
        mujoco.mj_step(self.model, self.data)
        self._physics_steps += 1
        self.sensors.observe(*self._measured())

    def _measured(self) -> tuple[FloatArray, ...]:
        gather(self._qpos, self._drive_q, self._drive_position)
        gather(self._qvel, self._drive_v, self._drive_velocity)
        gather(self._qpos, self._joint_q, self._joint_position)
        gather(self._qvel, self._joint_v, self._joint_velocity)
        return self._measurement

    def _index_model(self) -> None:
        model, data = self.model, self.data
        joints = [model.joint(name) for name in DRIVES]
        sensed = [model.joint(name) for name in SENSED_JOINTS]
        self._drive_q = np.array([joint.qposadr[0] for joint in joints])
        self._drive_v = np.array([joint.dofadr[0] for joint in joints])
        self._joint_q = np.array([joint.qposadr[0] for joint in sensed])
        self._joint_v = np.array([joint.dofadr[0] for joint in sensed])
        self._drive_position, self._drive_velocity = np.zeros(10), np.zeros(10)
        self._joint_position, self._joint_velocity = np.zeros(6), np.zeros(6)
        pelvis = model.body("pelvis").id
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._position, self._quaternion = data.qpos[:3], data.qpos[3:7]
        self._twist = data.qvel[:6]
        self._rotation = data.xmat[pelvis]
        self._wrench = data.xfrc_applied[pelvis]
        self._measurement = (
            self._drive_position,
            self._drive_velocity,
            self._joint_position,
            self._joint_velocity,
            self._quaternion,
            data.sensordata[:6],
        )

    def _make_sensors(self) -> IdealSensors:
        if self.config.sensors == "ideal":
            return IdealSensors()
        draw = self.scenario.draw
        errors = ImuErrors(
            attitude_bias=(draw.attitude_bias[0], draw.attitude_bias[1]),
            gyro_bias=(draw.gyro_bias[0], draw.gyro_bias[1], draw.gyro_bias[2]),
            accelerometer_bias=(
                draw.accelerometer_bias[0],
                draw.accelerometer_bias[1],
                draw.accelerometer_bias[2],
            ),
            yaw_drift=draw.yaw_drift,
        )
        rng = np.random.default_rng(draw.sensor_seed)
        return FaithfulSensors(self.substeps * self.period, self.period, errors, rng)

    def _place(self) -> None:
        data, draw = self.data, self.scenario.draw
        half_yaw = 0.5 * draw.initial_yaw
        data.qpos[:3] = (0.0, 0.0, HANGING_HEIGHT)
        data.qpos[3:7] = (np.cos(half_yaw), 0.0, 0.0, np.sin(half_yaw))
        drives = np.tile(STANDING_DRIVES, 2) + np.array(draw.joint_offset)
        set_drives(self.model, data, drives)
        if self.scenario.start == "gantry":
            self.gantry.hold(data.qpos[:3], HANGING_HEIGHT)
            # The straps stretch under the weight: begin where they carry it.
            self.gantry.height = HANGING_HEIGHT
            return
        # Standing begins in the harness, soles on the ground, let down within half a second.
        mujoco.mj_kinematics(self.model, data)
        data.qpos[2] -= lowest_sole(self.model, data)
        height = float(data.qpos[2])
        self.gantry.hold(data.qpos[:3], height + 0.02)
        self.gantry.height = height + 0.02
        self.gantry.lower(height - 0.03, speed=0.1)


def _check_rates(config: PlantConfig) -> None:
    if config.physics_rate % config.control_rate:
        raise SimulationError(
            f"control_rate = {config.control_rate} Hz does not divide "
            f"physics_rate = {config.physics_rate} Hz"
        )
    if config.sensors == "faithful" and config.physics_rate != 2000:
        raise SimulationError(
            f"physics_rate = {config.physics_rate} Hz: faithful sensors are defined at 2000 Hz; "
            "use sensors = ideal for other rates"
        )


def _compile(scenario: Scenario, meshes: bool, period: float) -> mujoco.MjModel:
    if scenario.start == "segway":
        raise SimulationError(f"start = segway: the scene {scenario.scene} has no Segway")
    spec = scene_spec(scenario.scene, scenario.scene_parameters, meshes=meshes)
    spec.option.timestep = period
    for name, kind in (
        ("gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")
    model = spec.compile()
    scale, draw = scenario.model, scenario.draw
    mass = scale.mass * draw.mass
    model.body_mass[:] *= mass
    model.body_inertia[:] *= mass
    model.jnt_stiffness[:] *= scale.spring
    model.dof_damping[:] *= scale.damping
    model.dof_armature[:] *= scale.armature
    ground = model.geom_priority > 0
    model.geom_friction[ground, 0] *= scale.friction * draw.friction
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
