"""What physics steps change, kept so that they can be taken back."""

from __future__ import annotations

import mujoco
import numpy as np

from cassie_sim.plant_model import Readings
from cassie_sim.sensors import IdealSensors

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Snapshot:
    """State of physics and sensors at one moment.

    Args:
        model, data: Whose physics.
        robot: Views of `data`.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, robot: Readings) -> None:
        self._model, self._data, self._robot = model, data, robot
        self._state = np.zeros(mujoco.mj_stateSize(model, _STATE))
        self._rotation = np.zeros(9)

    def take(self, sensors: IdealSensors) -> None:
        """Keep the present state."""
        mujoco.mj_getState(self._model, self._data, self._state, _STATE)
        self._rotation[:] = self._robot.rotation  # of the last kinematics, which is a step behind
        self._records = sensors.records.copy()
        self._attitudes = sensors.attitudes.copy()

    def restore(self, sensors: IdealSensors) -> None:
        """Go back to the state that was kept."""
        mujoco.mj_setState(self._model, self._data, self._state, _STATE)
        self._robot.rotation[:] = self._rotation
        sensors.records[:] = self._records
        sensors.attitudes[:] = self._attitudes
