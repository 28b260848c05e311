"""Pictures: what stands in a frame is what is seen."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.camera import Camera, RenderError, frame_of, frame_size
from cassie_sim.plant import Plant, PlantConfig


def test_a_picture_shows_the_ground_where_it_has_moved_to():
    scenario = Scenario(
        scene="block", scene_parameters={"height": 0.3, "start": 0.0, "rate": 1.0}, start="gantry"
    )
    plant = Plant(PlantConfig(sensors="ideal"), scenario)
    before = frame_of(plant.data)
    for _ in range(100):
        plant.step(None)
    after = np.concatenate([before[: plant.model.nq], frame_of(plant.data)[plant.model.nq :]])
    assert len(before) == frame_size(plant.model) == plant.model.nq + 7
    try:
        camera = Camera(plant.model, width=160, height=120)
    except RenderError as error:
        pytest.skip(str(error))
    camera.picture(before)  # of a new camera, a few pixels of the first picture may differ
    pictures = [camera.picture(frame) for frame in (before, after, before)]
    camera.close()
    assert (pictures[0] == pictures[2]).all()
    changed = np.abs(pictures[0].astype(int) - pictures[1]).max(axis=2) > 20
    assert 50 < changed.sum() < 0.5 * changed.size


def test_the_ground_reaches_the_horizon_wherever_the_robot_has_gone():
    plant = Plant(PlantConfig(sensors="ideal"), Scenario(start="gantry"))
    here = frame_of(plant.data)
    far = here.copy()
    far[0] += 160.0
    try:
        camera = Camera(plant.model, width=160, height=120)
    except RenderError as error:
        pytest.skip(str(error))
    camera.picture(here)
    first, second = camera.picture(far), camera.picture(far)
    camera.close()
    assert np.abs(first.astype(int) - second).max() < 20
