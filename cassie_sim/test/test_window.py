"""The window shows all of the robot, wherever it walks."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import mujoco
import mujoco.viewer
import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.errors import SimulationError
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig
from cassie_sim.window import Window, follow

NARROWEST = 1.0  # width of the window by its height


class Viewer:
    """Takes the place of MuJoCo's viewer."""

    def __init__(self, **options: Any) -> None:
        self.options = options
        self.cam = mujoco.MjvCamera()

    def lock(self) -> Any:
        return nullcontext()


@pytest.mark.parametrize("start", ["standing", "gantry"])
@pytest.mark.parametrize("place", [(0.0, 0.0), (12.0, -7.0)])
def test_all_of_the_robot_is_in_the_picture(start: str, place: tuple[float, float]) -> None:
    plant = Plant(PlantConfig(), Scenario(start=start))
    model, data, camera = plant.model, plant.data, mujoco.MjvCamera()
    follow(model, camera)
    scene, option = mujoco.MjvScene(model, maxgeom=2000), mujoco.MjvOption()
    for _ in range(2):
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, option, None, camera, everything, scene)
        data.qpos[:2] += place
        mujoco.mj_forward(model, data)
    mujoco.mjv_updateScene(model, data, option, None, camera, everything, scene)
    eye = scene.camera[0]
    forward, up = np.array(eye.forward), np.array(eye.up)
    steepness = eye.frustum_top / eye.frustum_near
    seen = 0
    for geom in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[geom]] != model.body("pelvis").id:
            continue
        offset, size = data.geom_xpos[geom] - np.array(eye.pos), model.geom_rbound[geom]
        depth = offset @ forward - size
        assert abs(offset @ up) + size < depth * steepness
        assert abs(offset @ np.cross(forward, up)) + size < depth * steepness * NARROWEST
        seen += 1
    assert seen >= 11


def test_panels_are_folded_and_the_camera_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    viewers: list[Viewer] = []

    def launch(_: Any, __: Any, **options: Any) -> Viewer:
        viewers.append(Viewer(**options))
        return viewers[-1]

    monkeypatch.setattr(mujoco.viewer, "launch_passive", launch)
    plant = Plant(PlantConfig())
    Window(plant.model, plant.data)
    (viewer,) = viewers
    assert viewer.options == {"show_left_ui": False, "show_right_ui": False}
    assert viewer.cam.type == mujoco.mjtCamera.mjCAMERA_TRACKING
    assert viewer.cam.trackbodyid == plant.model.body("pelvis").id


def test_without_a_display_the_refusal_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    plant = Plant(PlantConfig())
    with pytest.raises(SimulationError, match="neither DISPLAY nor WAYLAND_DISPLAY"):
        Window(plant.model, plant.data)
