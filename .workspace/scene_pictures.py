"""Renders cassie_sim/images/scenes.jpg: Cassie in every scene, some with other parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from films import Shot, look_at

from cassie_bags.run.cores import connect, make_cores
from cassie_bags.run.experiment import load_experiment
from cassie_bags.run.seed import resolve
from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.camera import Camera, Image, frame_of
from cassie_sim.plant import Plant, PlantConfig

PLACES: list[tuple[str, str, dict[str, Any]]] = [
    ("flat", "flat", {}),
    ("slope, rise_deg: 15", "slope", {"rise_deg": 15.0, "start": 0.3}),
    ("slope, rise_deg: -15", "slope", {"rise_deg": -15.0, "start": 0.3}),
    ("slope, side_deg: 8", "slope", {"rise_deg": 0.0, "side_deg": 8.0}),
    ("grass", "grass", {"start": 0.3}),
    ("snow", "snow", {"start": 0.3}),
    ("snow, rise_deg: 10", "snow", {"start": 0.3, "rise_deg": 10.0}),
    ("waxed_floor", "waxed_floor", {}),
    ("sand", "sand", {"start": 0.3}),
    ("sand, shoes: true", "sand", {"start": 0.3, "shoes": True}),
    ("debris", "debris", {"start": 0.3}),
    ("step, height: -0.1", "step", {"height": -0.1, "start": 0.3}),
    ("step, height: 0.1", "step", {"height": 0.1, "start": 0.4}),
    ("rough", "rough", {"start": 0.3}),
    ("gravel", "gravel", {"start": 0.3}),
    (
        "stairs, riser: 0.1",
        "stairs",
        {"start": 0.4, "riser": 0.1, "number": 4, "landing": 0.9},
    ),
    (
        "stairs, way: down, riser: 0.17",
        "stairs",
        {"start": 0.4, "riser": 0.17, "way": "down", "flights": 1},
    ),
    ("random_course, seed: 4", "random_course", {"start": 0.6, "seed": 4}),
    ("pillar", "pillar", {"x": 0.9, "y": 0.3}),
    (
        "course: concrete, grass, burn",
        "course",
        {
            "stretches": [
                {"surface": "concrete", "length": 0.4},
                {"surface": "grass", "length": 1.0},
                {"surface": "burn", "length": 5.0, "rise_deg": 10.0, "branches": 6.0},
            ]
        },
    ),
    ("block", "block", {}),
    ("block, height: 0.1", "block", {"height": 0.1}),
]
AZIMUTHS = {
    "step, height: -0.1": 150.0,
    "step, height: 0.1": 60.0,
    "stairs, riser: 0.1": 60.0,
    "stairs, way: down, riser: 0.17": 150.0,
}
"""Direction in which the camera looks (deg, 0 along x) where it would not see the risers."""

RUNS = [("tilting", "standing_tilting", 14.0), ("segway", "segway_ride", 12.0)]
"""Scenes in which something has to happen first: title, experiment, at which time (s)."""

COLUMNS = 6
SIZE = 480, 360
CROP = slice(100, 340), slice(120, 420)  # rows and columns that show something


def main() -> None:
    """Render the sheet."""
    pictures = [
        (title, picture(placed(scene, values), AZIMUTHS.get(title)))
        for title, scene, values in PLACES
    ]
    pictures += [(title, picture(after(name, time))) for title, name, time in RUNS]
    rows = -(-len(pictures) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(3.0 * COLUMNS, 2.4 * rows), dpi=100)
    for axis, (title, image) in zip(axes.flat, pictures, strict=False):
        axis.imshow(image)
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.6, "pad": 1.5}
        axis.text(8, 10, title, fontsize=11, va="top", bbox=box)
    for axis in axes.flat:
        axis.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, 0.01, 0.01)
    path = Path(__file__).parents[1] / "cassie_sim" / "images" / "scenes.jpg"
    figure.savefig(path, pil_kwargs={"quality": 85})
    print(f"{path}: {len(pictures)} scenes")


def placed(scene: str, parameters: dict[str, Any]) -> Plant:
    """Cassie as it starts in a scene."""
    scenario = Scenario(scene=scene, scene_parameters=parameters, start="standing")
    return Plant(PlantConfig(sensors="ideal"), scenario, meshes=True)


def after(name: str, time: float) -> Plant:
    """The plant of an experiment after a time, in s."""
    file = Path(__file__).parents[1] / "bags" / "experiments" / f"{name}.yaml"
    experiment = resolve(load_experiment(file))
    cores = make_cores(experiment)
    loop = connect(cores, lambda *_: None)
    for _ in range(round(time / 0.002)):
        loop.tick()
    shown = Plant(PlantConfig(sensors="ideal"), experiment.scenario, meshes=True)
    shown.data.qpos[:] = cores.plant.data.qpos
    shown.data.mocap_pos[:] = cores.plant.data.mocap_pos
    shown.data.mocap_quat[:] = cores.plant.data.mocap_quat
    return shown


def picture(plant: Plant, azimuth: float | None = None) -> Image:
    """What is to be seen of a plant, from the default camera or in a direction (deg)."""
    if azimuth is not None:
        look_at(plant.model, Shot("", 0.0, 0.0, azimuth, -14.0, 3.2))
        plant.model.cam_pos0[plant.model.camera("track").id, 2] += 0.2  # below the title
    camera = Camera(plant.model, *SIZE, fine=True)
    image = camera.picture(frame_of(plant.data))[CROP]
    camera.close()
    return image


if __name__ == "__main__":
    main()
