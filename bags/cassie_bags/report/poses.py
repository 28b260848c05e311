"""Configurations of the MuJoCo model from a recording, for pictures."""

from __future__ import annotations

import contextlib

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_bags.signals.track import Track
from cassie_gaits.names import LEGS
from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.camera import frame_of
from cassie_sim.errors import SimulationError
from cassie_sim.poses import set_drives
from cassie_sim.scenes import scene_motion, scene_spec

FloatArray = npt.NDArray[np.float64]


class PosedModel:
    """The robot in its scene, set to the poses of a recording.

    Args:
        scenario: Scenario of the recording.

    Raises:
        SimulationError: if the scene cannot be built.
    """

    def __init__(self, scenario: Scenario) -> None:
        spec = scene_spec(scenario.scene, scenario.scene_parameters, meshes=True)
        self._motion = scene_motion(scenario.scene, scenario.scene_parameters)
        self.model = spec.compile()
        self._data = mujoco.MjData(self.model)

    def pose(self, track: Track, index: int) -> FloatArray:
        """Frame of one sample: springs as measured, rods that close the loops, ground moved.

        Args:
            track: Signals of the run.
            index: Index of the sample.

        Returns:
            As `cassie_sim.camera.frame_of` returns it.
        """
        data, row = self._data, track.sensors[index]
        with contextlib.suppress(SimulationError):  # a fallen robot may leave its joint limits
            set_drives(self.model, data, row["drive_position"])
        for leg, name in enumerate(LEGS):
            for joint, value in zip(
                ("shin", "tarsus"), row["joint_position"][3 * leg : 3 * leg + 2], strict=True
            ):
                data.joint(f"{name}_{joint}").qpos[0] = value
        x, y, z, w = track.orientation[index]
        data.qpos[:3] = track.position[index]
        data.qpos[3:7] = (w, x, y, z)
        if len(track.vehicle):
            x, y, z, *turned = track.vehicle[index]
            data.joint("segway").qpos[:] = (x, y, z, turned[3], *turned[:3])
            for name, angle in zip(LEGS, track.wheels[index], strict=True):
                data.joint(f"segway_{name}_wheel").qpos[0] = angle
        if self._motion is not None:
            self._motion.apply(self.model, data, float(track.time[index]))
        return frame_of(data)
