"""The robot and its world as a plant: sensor samples out, motor commands in.

One control tick is `Plant.sense()` followed by `Plant.step(command)`. Everything in between
(drives, sensor filters, gantry, pushes) runs at the rate of the physics.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_gaits.robot import DRIVE_DELAY
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_msgs.tunables import check, tunable
from cassie_sim.drives import Drives
from cassie_sim.errors import CommandError, SimulationError
from cassie_sim.events import Events
from cassie_sim.gantry import Gantry
from cassie_sim.kernels import physics_steps
from cassie_sim.native import addresses, mj_step_address
from cassie_sim.plant_model import Readings, compile_model
from cassie_sim.poses import height_over_ground, set_drives
from cassie_sim.scenario import Scenario
from cassie_sim.scenes import scene_motion
from cassie_sim.sensors import FaithfulSensors, IdealSensors, ImuErrors

FloatArray = npt.NDArray[np.float64]

STANDING_DRIVES = (0.0, 0.0, 0.5, -1.15, -1.6)
"""Leg pose at the start: the pelvis 1 m above level soles. One leg, in rad."""

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
        self.model = compile_model(self.scenario, meshes=meshes, period=self.period)
        self.data = mujoco.MjData(self.model)
        self._robot = Readings(self.model, self.data)
        self._native = (mj_step_address(), *addresses(self.model, self.data))
        self._motion = scene_motion(self.scenario.scene, self.scenario.scene_parameters)
        self.gantry = Gantry()
        self.sensors = self._make_sensors()
        draw, scale = self.scenario.draw, self.scenario.model
        self.drives = Drives(
            self.period,
            DRIVE_DELAY + self.scenario.delays.torque,
            np.array(draw.torque_constant) * scale.torque,
            COMMAND_WATCHDOG,
        )
        self.events = Events(self.scenario, self.model, config.physics_rate)
        self.seq = 0
        self.episode = 0
        self._sample = Sensors()
        self.reset()

    def reset(self) -> None:
        """Back to the start pose at time 0, with the same robot and the same noise."""
        mujoco.mj_resetData(self.model, self.data)
        self.seq = 0
        self._physics_steps = 0
        self.drives.reset()
        self.events.reset()
        self.gantry.release()
        self._move_ground()
        self._place()
        mujoco.mj_forward(self.model, self.data)
        self.sensors = self._make_sensors()
        self.sensors.reset(*self._robot.measured())

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
        if command is not None:
            self.events.send(command, self._physics_steps)
        self._move_ground()
        refusal: CommandError | None = None
        end = self._physics_steps + self.substeps
        while self._physics_steps < end:
            try:
                self._receive()
            except CommandError as error:
                refusal = error
            self._advance(end - self._physics_steps)
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
        return self._robot.position, self._robot.quaternion

    @property
    def pelvis_twist(self) -> FloatArray:
        """True linear velocity in the world and angular velocity in the pelvis; a view (6,)."""
        return self._robot.twist

    def _receive(self) -> None:
        """Give the drives the command that arrives now.

        Raises:
            CommandError: if it is refused; the drives then damp.
        """
        command = self.events.arrived(self._physics_steps)
        if command is None:
            return
        try:
            self.drives.set_points(command)
        except CommandError:
            self.drives.damp()
            raise

    def _advance(self, most: int) -> None:
        """Physics steps up to the next on which something acts from outside, at most `most`."""
        robot, gantry, events, now = self._robot, self.gantry, self.events, self._physics_steps
        held = gantry.attached
        if held:
            gantry.step(self.period, robot.position, robot.rotation, robot.twist)
        robot.wrench[:] = gantry.wrench
        events.apply(now, self.data, gantry, robot.position)
        alone = held or gantry.attached
        steps = self.sensors.prepare(1 if alone else events.quiet_steps(now, most))
        self._run(steps)
        self._physics_steps += steps

    def _move_ground(self) -> None:
        if self._motion is not None:
            self._motion.apply(self.model, self.data, self.time)

    def _run(self, steps: int) -> None:
        robot, drives, sensors = self._robot, self.drives, self.sensors
        physics_steps(
            *self._native,
            steps,
            robot.qpos,
            robot.qvel,
            robot.torques,
            robot.quaternion,
            robot.imu,
            robot.q_indices,
            robot.v_indices,
            drives.records,
            drives.pipeline,
            sensors.records,
            sensors.attitudes,
            sensors.noise,
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
        data.qpos[2] += HANGING_HEIGHT  # clear of whatever the scene has put there
        mujoco.mj_kinematics(self.model, data)
        data.qpos[2] -= height_over_ground(self.model, data)
        height = float(data.qpos[2])
        self.gantry.hold(data.qpos[:3], height + 0.02)
        self.gantry.height = height + 0.02
        self.gantry.lower(height - 0.03, speed=0.1)


def _check_rates(config: PlantConfig) -> None:
    check(config)
    if config.physics_rate % config.control_rate:
        raise SimulationError(
            f"control_rate = {config.control_rate} Hz does not divide "
            f"physics_rate = {config.physics_rate} Hz"
        )
    if 1_000_000_000 % config.control_rate:
        raise SimulationError(
            f"control_rate = {config.control_rate} Hz: its period is no whole number of ns"
        )
    if config.sensors == "faithful" and config.physics_rate != 2000:
        raise SimulationError(
            f"physics_rate = {config.physics_rate} Hz: faithful sensors are defined at 2000 Hz; "
            "use sensors = ideal for other rates"
        )
