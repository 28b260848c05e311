"""The robot and its world as a plant: sensor samples out, motor commands in.

One control tick is `Plant.sense()` followed by `Plant.step(command)`. Everything in between
(drives, sensor filters, gantry, pushes) runs at the rate of the physics.

A torque acts 3 ms after the drives have set it, so the physics of a tick of 2 ms never needs the
command of that tick. `Plant.run_ahead()` computes the physics in parallel with the command.

A tick of Python costs more than its physics, so compiled code (`physics`) computes all physics
steps until the next event at once.
"""

from __future__ import annotations

import functools
from typing import Any

import mujoco
import numpy as np

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, RecordArray, Records
from cassie_gaits.robot import DRIVE_DELAY
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_sim.drives import DriveNumbers, Drives, drive_steps
from cassie_sim.errors import CommandError
from cassie_sim.events import Events
from cassie_sim.gantry import Gantry
from cassie_sim.native import addresses, mj_step_address
from cassie_sim.physics import physics_steps
from cassie_sim.physics_thread import PhysicsThread
from cassie_sim.plant_config import PlantConfig, check_rates
from cassie_sim.plant_model import Readings, compile_model
from cassie_sim.poses import height_over_ground, set_drives
from cassie_sim.scenes import scene_motion
from cassie_sim.segway_drive import SegwayDrive
from cassie_sim.sensors import IdealSensors, make_sensors

BATTERY = (72.0, 1.0)
"""Voltage in V and state of charge, both constant in the simulation."""

_SECOND = 1_000_000_000  # in ns


@compiled
def hand_over(
    drives: Records[DriveNumbers], seq: int, episode: int, stamp: int, samples: RecordArray
) -> None:
    """Write the fields of a sample that are not measured.

    Args:
        drives: Record of the drives. Shape (1,).
        seq, episode: Seq and episode of the sample.
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


_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Snapshot:
    """State of physics and sensors at one moment.

    Args:
        model, data: Model and data of the physics.
        robot: Views of `data`.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, robot: Readings) -> None:
        self._model, self._data, self._robot = model, data, robot
        self._state = np.zeros(mujoco.mj_stateSize(model, _STATE))
        self._rotation = np.zeros(9)
        self._records = b""
        self._attitudes: FloatArray = np.zeros(0)

    def take(self, sensors: IdealSensors) -> None:
        """Store the present state."""
        mujoco.mj_getState(self._model, self._data, self._state, _STATE)
        self._rotation[:] = self._robot.rotation  # from the last kinematics, which lags by a step
        self._records = sensors.records.tobytes()  # as a whole; numpy copies records by field
        self._attitudes = sensors.attitudes.copy()

    def restore(self, sensors: IdealSensors) -> None:
        """Go back to the stored state."""
        mujoco.mj_setState(self._model, self._data, self._state, _STATE)
        self._robot.rotation[:] = self._rotation
        sensors.records.view(np.uint8)[:] = np.frombuffer(self._records, np.uint8)
        sensors.attitudes[:] = self._attitudes


STANDING_DRIVES = (0.0, 0.0, 0.5, -1.15, -1.6)
"""Leg pose at the start: the pelvis 1 m above level soles. One leg, in rad."""

HANGING_HEIGHT = 1.15
"""Pelvis height while hanging from the gantry at the start. In m."""

_ALONE = 200  # ticks after which a thread that had no free processor is tried again

COMMAND_WATCHDOG = 0.02
"""Robot time without a command after which the drives damp. In s."""


class Plant:
    """Cassie in a scene.

    Attributes:
        beside: Whether `run_ahead` computes the physics in its own thread.

    Args:
        config: Rates and sensor grade.
        scenario: Scene, start, events, delays and the robot drawn.
        meshes: Whether to load the visual meshes, for pictures.

    Raises:
        SimulationError, ParameterError: naming the setting, its value and the permitted values.
    """

    def __init__(
        self, config: PlantConfig, scenario: Scenario | None = None, *, meshes: bool = False
    ) -> None:
        self.config = config
        self.scenario = scenario or Scenario()
        check_rates(config)
        self.substeps = config.physics_rate // config.control_rate
        self.tick_ns = 1_000_000_000 // config.control_rate
        self.period = 1.0 / config.physics_rate
        self.model = compile_model(self.scenario, meshes=meshes, period=self.period)
        self.data = mujoco.MjData(self.model)
        self._robot = Readings(self.model, self.data)
        self._native = (mj_step_address(), *addresses(self.model, self.data))
        self._motion = scene_motion(self.scenario.scene, self.scenario.scene_parameters)
        self.gantry = Gantry()
        draw, scale = self.scenario.draw, self.scenario.model
        self._make_sensors = functools.partial(
            make_sensors, config.sensors, draw, self.substeps * self.period, self.period
        )
        self.sensors = self._make_sensors()
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
        self._seen = np.zeros((len(self.drives.pipeline) - 1, 20))
        self._before = Snapshot(self.model, self.data, self._robot)
        self._in_thread = 0  # physics steps that the thread computes now
        self._thread: PhysicsThread | None = None
        self._alone = 0  # ticks without the thread, as there is no free processor
        self.beside = False
        self.reset()

    def reset(self) -> None:
        """Go back to the start pose at time 0, with the same robot and the same noise."""
        self._await_thread()
        if self._thread is not None:
            self._thread.end()
            self._thread = None
        mujoco.mj_resetData(self.model, self.data)
        self.seq = 0
        self._physics_steps = 0
        self._ahead = 0
        self._written = self._drawn = self._powered = False
        self.drives.reset()
        self.events.reset()
        self.gantry.release()
        self._move_ground()
        self._place()
        mujoco.mj_forward(self.model, self.data)
        self.sensors = sensors = self._make_sensors()
        sensors.reset(*self._robot.measured())
        robot, drives = self._robot, self.drives
        self._arrays: tuple[Any, ...] = (
            *(robot.qpos, robot.qvel, robot.torques, robot.quaternion, robot.imu),
            *(robot.q_indices, robot.v_indices, drives.records, drives.pipeline),
            *(sensors.records, sensors.attitudes, sensors.noise, self._seen),
        )

    @property
    def vehicle(self) -> SegwayDrive | None:
        """The Segway of the scene; None without one."""
        return self._motion if isinstance(self._motion, SegwayDrive) else None

    def power(self, on: bool) -> None:
        """Switch the drives; without power they give no torque from the next physics step on."""
        self.drives.powered = on

    def sense(self) -> Sensors:
        """The sensor sample of this tick. Valid until the next call; call it once per tick."""
        sample = self._sample
        if not self._written:
            self.sensors.write(sample, again=self._drawn)
        self._written = self._drawn = False
        stamp = self.seq * self.tick_ns
        hand_over(self.drives.records, self.seq, self.episode, stamp, sample.record)
        self.events.spoil(self.seq * self.substeps, sample)
        return sample

    def run_ahead(self) -> None:
        """Compute the physics of this tick before its command comes, if no event acts on it.

        `step` goes on from there, or begins anew if the power was switched or an event added
        meanwhile. Until `step`, the plant's true state is ahead of the tick: call `take_back`
        before reading it. The result is the same to the last bit.
        """
        now, steps = self._physics_steps, min(self.substeps, len(self._seen))
        if self.beside and self._alone > 0:
            self._alone -= 1
            return
        waits = self._ahead or self.gantry.attached or self._motion is not None
        if waits or self.events.delays_commands or not self.events.idle(now, steps):
            return
        self.sensors.prepare(steps)
        self._before.take(self.sensors)
        self._powered = self.drives.powered
        self._robot.wrench[:] = 0.0
        if not self.beside:
            self._run(steps)
            self._arrive(steps)
            return
        if self._thread is None:
            self._thread = PhysicsThread(self._native, self._arrays)
        self._in_thread = steps
        self._thread.begin(steps)

    def _arrive(self, steps: int) -> None:
        """Take in that the physics is ahead by some steps."""
        self._ahead = steps
        if steps == self.substeps:
            self.sensors.write(self._sample, again=self._drawn)
            self._written = True

    def _await_thread(self) -> None:
        if self._in_thread and self._thread is not None:
            if self._thread.finish():
                self._alone = _ALONE
            steps, self._in_thread = self._in_thread, 0
            self._arrive(steps)

    def _may_go_on(self) -> bool:
        """Whether no event has come that acts on the steps computed ahead."""
        quiet = self.events.idle(self._physics_steps, self._ahead) and not self.gantry.attached
        return quiet and self.drives.powered == self._powered

    def take_back(self) -> None:
        """Undo `run_ahead`; call this before the plant is read or changed."""
        self._await_thread()
        if self._ahead:
            self._before.restore(self.sensors)
            self._ahead = 0
            self._drawn = self._written
            self._written = False

    def step(self, command: MotorCommand | None) -> None:
        """Advance by one control tick.

        Args:
            command: Set-points for this tick. None keeps the last set-points, until the watchdog
                of the drives damps.

        Raises:
            CommandError: if the command is refused; the tick has then run with damped drives.
        """
        self._await_thread()
        if self._ahead and not self._may_go_on():
            self.take_back()
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
            CommandError: if the command is refused; the drives then damp.
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
        """Advance the physics until the next external event, by at most `most` steps."""
        steps = self._ahead or self._make_steps(most)
        self._ahead = 0
        drive_steps(self.drives.records, self.drives.pipeline, self._seen, steps)
        self._physics_steps += steps

    def _make_steps(self, most: int) -> int:
        robot, gantry, events, now = self._robot, self.gantry, self.events, self._physics_steps
        held = gantry.attached
        if held:
            gantry.step(self.period, robot.position, robot.rotation, robot.twist)
        robot.wrench[:] = gantry.wrench
        events.apply(now, self.data, gantry, robot.position)
        alone = held or gantry.attached
        steps = 1 if alone else min(events.quiet_steps(now, most), len(self._seen))
        self.sensors.prepare(steps)
        self._run(steps)
        return steps

    def _move_ground(self) -> None:
        if self._motion is not None:
            self._motion.apply(self.model, self.data, self.time)

    def _run(self, steps: int) -> None:
        step, model, data = self._native
        physics_steps(step, model, data, steps, *self._arrays)

    def _place(self) -> None:
        data, draw = self.data, self.scenario.draw
        half_yaw = 0.5 * draw.initial_yaw
        data.qpos[:3] = (0.0, 0.0, HANGING_HEIGHT)
        data.qpos[3:7] = (np.cos(half_yaw), 0.0, 0.0, np.sin(half_yaw))
        drives = np.tile(STANDING_DRIVES, 2) + np.array(draw.joint_offset)
        set_drives(self.model, data, drives)
        if self.scenario.start == "gantry":
            self.gantry.hold(data.qpos[:3], HANGING_HEIGHT)
            # The straps stretch under the weight: begin at the height where they carry it.
            self.gantry.height = HANGING_HEIGHT
            return
        # Standing begins in the harness, soles on the ground; the gantry lowers it within 0.5 s.
        data.qpos[2] += HANGING_HEIGHT  # above all objects of the scene
        mujoco.mj_kinematics(self.model, data)
        data.qpos[2] -= height_over_ground(self.model, data)
        height = float(data.qpos[2])
        self.gantry.hold(data.qpos[:3], height + 0.02)
        self.gantry.height = height + 0.02
        self.gantry.lower(height - 0.03, speed=0.1)
