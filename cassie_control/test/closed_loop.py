"""Estimator, supervisor and controller with a simulated Cassie, in one process."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import GaitController
from cassie_control.estimator.choice import make_estimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_gaits.gait_library import GaitLibrary
from cassie_gaits.gait_library_file import default_library_path, load_certified
from cassie_gaits.names import LEGS
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode, RobotState
from cassie_msgs.schedule import PERIOD_TICKS
from cassie_sim.plant import Plant, PlantConfig

PERIOD = 0.002


@dataclass
class Moment:
    """One tick: time in s, true pose and forces, estimate, what the controller did, its sample.

    `position` in m, `angles` yaw, pitch, roll in rad, `velocity` in m/s and `forces` in N are true.
    """

    time: float
    position: np.ndarray
    angles: np.ndarray
    velocity: np.ndarray
    forces: np.ndarray
    q: np.ndarray
    v: np.ndarray
    foot_force: np.ndarray
    activity: str
    sample: bytes


class Robot:
    """A simulated Cassie and its operator."""

    def __init__(
        self,
        scenario: Scenario,
        sensors: str = "ideal",
        config: ControllerConfig | None = None,
        *,
        library: GaitLibrary | None = None,
        record: bool = False,
    ) -> None:
        self.plant = Plant(PlantConfig(sensors=sensors), scenario)
        self.estimator = make_estimator(EstimatorConfig(), PERIOD)
        self.controller = GaitController(
            config or ControllerConfig(), library or load_certified(default_library_path()), PERIOD
        )
        self.supervisor = ModeSupervisor(SupervisorConfig(), PERIOD)
        self.operator = OperatorCommand()
        self.state = RobotState()
        self.moments: list[Moment] = []
        self.controller_lost = False
        self._record = record
        self._mode, self._next_mode = Mode(), Mode()
        self._feet = [
            {self.plant.model.geom(f"{leg}_{end}").id for end in ("heel", "toe")} for leg in LEGS
        ]
        self.ask(power=True, link=True, height=0.95, mode=int(RobotMode.STAND))

    def ask(self, **fields: float) -> None:
        """Set fields of the operator's command."""
        for name, value in fields.items():
            getattr(self.operator, name)[...] = value

    def run(self, duration: float) -> None:
        """Let robot time pass, in s."""
        for _ in range(round(duration / PERIOD)):
            self._tick()

    @property
    def mode(self) -> RobotMode:
        """Mode in force."""
        return RobotMode(int(self._mode.mode))

    @property
    def fallen(self) -> bool:
        """Whether the torso is down or lies."""
        position, (_, x, y, _) = self.plant.pelvis_pose
        return bool(position[2] < 0.35 or 1.0 - 2.0 * (x * x + y * y) < 0.5)

    def _tick(self) -> None:
        plant = self.plant
        sensors = plant.sense()
        if self._record:
            self._sample = sensors.to_bytes()
        state = self.state = self.estimator.step(sensors)
        if plant.seq % PERIOD_TICKS == 0:
            self._mode.copy_from(self._next_mode)
            plant.power(bool(self.operator.power))
            answer = self.supervisor.step(state, self.operator, self.controller_lost)
            self._next_mode.copy_from(answer)
        command = self.controller.step(state, self._mode)
        if self._record:
            self.moments.append(self._moment())
        plant.step(command)

    def _moment(self) -> Moment:
        position, (w, x, y, z) = self.plant.pelvis_pose
        angles = (
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
            math.asin(2.0 * (w * y - x * z)),
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        )
        state = self.state
        return Moment(
            time=self.plant.time,
            position=position.copy(),
            angles=np.array(angles),
            velocity=self.plant.pelvis_twist[:3].copy(),
            forces=self._ground_forces(),
            q=state.q.copy(),
            v=state.v.copy(),
            foot_force=state.foot_force.copy(),
            activity=self.controller.activity.value,
            sample=self._sample,
        )

    def _ground_forces(self) -> np.ndarray:
        """Vertical force of the ground on each foot. Shape (2,), in N."""
        data, wrench, forces = self.plant.data, np.zeros(6), np.zeros(2)
        for index in range(data.ncon):
            contact = data.contact[index]
            for leg, feet in enumerate(self._feet):
                if feet & {contact.geom1, contact.geom2}:
                    mujoco.mj_contactForce(self.plant.model, data, index, wrench)
                    sign = 1.0 if contact.geom2 in feet else -1.0
                    forces[leg] += sign * (contact.frame.reshape(3, 3).T @ wrench[:3])[2]
        return forces
