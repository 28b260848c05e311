"""Films the experiments that the READMEs show, as GIFs in bags/images.

Run it in the shell of env.sh: python3 .workspace/films.py [NAME ...]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
from PIL import Image

from cassie_bags.run.cores import connect, make_cores, simulator_config
from cassie_bags.run.experiment import load_experiment
from cassie_bags.run.seed import resolve
from cassie_sim.camera import Camera, frame_of
from cassie_sim.scenes import scene_spec

BAGS = Path(__file__).parents[1] / "bags"
FPS = 12.5
SIZE = 960, 720  # rendered, then reduced: smoother edges
REDUCED = 384, 288
COLOURS = 64
AMBIENT = 0.25  # brighter than in the viewer: shadows stay grey


@dataclass(frozen=True)
class Shot:
    """A part of an experiment, and from where it is seen.

    Attributes:
        experiment: Name of its file in `bags/experiments`.
        begin: Robot time at which the film begins, in s.
        end: Robot time at which it ends, in s.
        azimuth: Direction in which the camera looks, 0 along x, 90 along y, in deg.
        elevation: Upward, in deg.
        distance: From the pelvis, in m.
        level: Whether the camera keeps its height while the robot climbs.
    """

    experiment: str
    begin: float
    end: float
    azimuth: float
    elevation: float
    distance: float
    level: bool = False


SHOTS = {
    "walk": Shot("grove", 12.5, 20.5, 65.0, -14.0, 2.0),
    "ride": Shot("segway_slalom", 25.0, 32.0, 125.0, -12.0, 1.9),
    "stairs": Shot("stairs", 7.5, 14.8, 78.0, -10.0, 2.3, level=True),
    "fast_walk": Shot("fast_walk", 20.0, 24.0, 75.0, -8.0, 2.2),
    "all_grounds": Shot("all_grounds", 34.0, 44.0, 60.0, -14.0, 2.6),
}


def main() -> None:
    """Make the films that are named, or all."""
    parser = argparse.ArgumentParser(description="Make the films of the README.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SHOTS)}")
    for name in parser.parse_args().names or SHOTS:
        path = BAGS / "images" / f"{name}.gif"
        write(film(SHOTS[name]), path)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def film(shot: Shot) -> list[Image.Image]:
    """The pictures of a shot."""
    experiment = resolve(load_experiment(BAGS / "experiments" / f"{shot.experiment}.yaml"))
    scenario = experiment.scenario
    model = scene_spec(scenario.scene, scenario.scene_parameters, meshes=True).compile()
    look_at(model, shot)
    model.vis.headlight.ambient = AMBIENT
    camera = Camera(model, *SIZE, fine=True)
    cores = make_cores(experiment)
    loop = connect(cores, lambda *_: None)
    rate = simulator_config(experiment).control_rate
    track, above = model.camera("track").id, model.cam_pos0[model.camera("track").id, 2]
    height = float(cores.plant.data.body("pelvis").xpos[2])
    pictures = []
    for tick in range(round(shot.end * rate)):
        if tick >= shot.begin * rate and tick % round(rate / FPS) == 0:
            if shot.level:
                climbed = float(cores.plant.data.body("pelvis").xpos[2]) - height
                model.cam_pos0[track, 2] = above - climbed
            pixels = camera.picture(frame_of(cores.plant.data))
            pictures.append(Image.fromarray(pixels).resize(REDUCED, Image.Resampling.LANCZOS))
        loop.tick()
    camera.close()
    return pictures


def look_at(model: mujoco.MjModel, shot: Shot) -> None:
    """Put the camera that goes along with the pelvis where a shot wants it."""
    azimuth, elevation = np.radians([shot.azimuth, shot.elevation])
    ahead = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right: npt.NDArray[np.float64] = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.column_stack([right, np.cross(right, ahead), -ahead])
    camera = model.camera("track").id
    model.cam_pos0[camera] = [0.0, 0.0, -0.35] - shot.distance * ahead
    model.cam_mat0[camera] = axes.ravel()


def write(pictures: list[Image.Image], path: Path) -> None:
    """Write a GIF that repeats for ever, with one palette."""
    sheet = np.vstack([np.asarray(picture) for picture in pictures[:: len(pictures) // 8]])
    palette = Image.fromarray(sheet).quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    first, *others = (
        picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
    )
    first.save(
        path, save_all=True, append_images=others, duration=1000.0 / FPS, loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
