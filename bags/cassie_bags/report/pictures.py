"""All pictures of a run: plots, a strip of images, and a short video of the robot in its scene.

Stick figures stand in the strip if nothing can be rendered. Loading matplotlib and MuJoCo takes a
while.
"""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from cassie_bags.bag.rows import FloatArray
from cassie_bags.report.figures import BLUE, DARK, GREY, ORANGE, draw_all, drawing, shortened
from cassie_bags.report.view import View
from cassie_bags.signals.track import Track
from cassie_gaits.names import LEGS
from cassie_msgs.experiment.expectation import Phase
from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.camera import frame_of
from cassie_sim.errors import SimulationError
from cassie_sim.poses import set_drives
from cassie_sim.scenes import scene_motion, scene_spec
from cassie_sim.video import Camera, Film

STRIP_LENGTH = 10
"""Number of images in a strip."""

_VIDEO_FPS = 16.0
_VIDEO_LENGTH = 10.0  # s, longest playing time of a video; a longer run is played faster
_SKY = 112  # upper rows of an image, which are empty
_MAX_NAME = 22  # characters of a phase's name above an image
_BONES = (1, 2, 3, 4, 5, 6)  # hip yaw to toe in `leg_points`


def draw(view: View, folder: Path, *, film: bool = True) -> dict[str, Path]:
    """Draw all pictures of a run; problems are reported on stderr.

    Args:
        view: View of the run.
        folder: Target folder.
        film: Whether to make a video too.

    Returns:
        The files by name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    video = reason = None
    if film:
        try:
            video = film_of(view, folder / "video.mp4")
        except SimulationError as error:
            reason = str(error)
    try:
        files = draw_all(view, folder)
        files["strip"] = folder / "strip.png"
        reason = strip(view, files["strip"]) or reason
    finally:
        if video is not None:
            video.close()
    if video is not None:
        files["video"] = folder / "video.mp4"
    if reason is not None:
        print(f"stick figures and no video: {reason}", file=sys.stderr)
    return files


def moments(track: Track, phases: Sequence[Phase], count: int = STRIP_LENGTH) -> list[int]:
    """Samples to show: equally many of each phase, or evenly spread if phases are few or many.

    Args:
        track: Signals of the run.
        phases: Phases of the run.
        count: Largest number of samples.
    """
    if not 4 <= len(phases) <= count:
        return [round(i) for i in np.linspace(0, len(track.time) - 1, min(count, len(track.time)))]
    each = count // len(phases)
    times = [
        phase.t0 + (phase.t1 - phase.t0) * (part + 0.5) / each
        for phase in phases
        for part in range(each)
    ]
    samples = np.searchsorted(track.time, times).clip(0, len(track.time) - 1)
    return sorted({int(index) for index in samples})


def strip(view: View, path: Path) -> str | None:
    """Draw a strip of images, at moments of each phase, into a PNG file.

    Returns:
        Reason for stick figures instead of the robot, or None if the strip shows the robot.
    """
    track, phases = view.track, view.phases
    shown = moments(track, phases)
    images, reason = None, None
    try:
        images = _images(track, view.scenario, shown)
    except SimulationError as error:
        reason = str(error)
    with drawing(path, 1.3 * len(shown), 1.75) as figure:
        panels = figure.subplots(1, len(shown), squeeze=False)[0]
        for position, (axes, index) in enumerate(zip(panels, shown, strict=True)):
            if images is None:
                _draw_stick_figure(axes, track, index)
            else:
                axes.imshow(images[position][_SKY:])
            axes.set_axis_off()
            time = float(track.time[index])
            name = next((phase.name for phase in phases if phase.t0 <= time < phase.t1), "")
            axes.set_title(f"{shortened(name, _MAX_NAME)}\n{time:.1f} s", fontsize=7, loc="center")
        figure.suptitle(view.title, x=0.01, ha="left", fontsize=9)
    return reason


def film_of(view: View, path: Path) -> Film:
    """Film a run; a long one is played faster. The caller closes the film, which waits for its end.

    Raises:
        SimulationError: if this machine cannot render or write videos.
    """
    track, posed = view.track, PosedModel(view.scenario)
    length = float(track.time[-1] - track.time[0])
    speed = max(1.0, math.ceil(length / _VIDEO_LENGTH))
    count = max(1, round(length / speed * _VIDEO_FPS))
    film = Film(posed.model, path, _VIDEO_FPS)
    try:
        for index in np.linspace(0, len(track.time) - 1, count).round().astype(int):
            film.snap(posed.pose(track, int(index)))
    except BaseException:
        film.close(soon=True)
        raise
    return film


def _draw_stick_figure(axes: Axes, track: Track, index: int) -> None:
    """Draw a sample from the robot's left as lines: pelvis, thighs, shins, tarsi, feet, ground."""
    yaw = track.angles[index, 0]
    ahead = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    origin = track.position[index]
    for leg, colour in ((1, ORANGE), (0, BLUE)):
        points = track.legs[index, leg]
        bones = np.vstack([origin, points[list(_BONES)]])
        axes.plot((bones - origin) @ ahead, bones[:, 2], color=colour, linewidth=1.6)
        foot = points[-2:]
        axes.plot((foot - origin) @ ahead, foot[:, 2], color=colour, linewidth=2.6)
    pitch = track.angles[index, 1]
    up = np.array([math.sin(pitch), math.cos(pitch)])
    axes.plot([0.0, 0.18 * up[0]], [origin[2], origin[2] + 0.18 * up[1]], color=DARK, linewidth=6)
    axes.axhline(track.sole_height[index].min(), color=GREY, linewidth=0.8)
    axes.set(xlim=(-0.45, 0.45), ylim=(-0.1, 1.45), aspect="equal")


def _images(track: Track, scenario: Scenario, shown: Sequence[int]) -> list[npt.NDArray[np.uint8]]:
    posed = PosedModel(scenario)
    camera = Camera(posed.model, width=270, height=360, fine=True)
    try:
        return [camera.picture(posed.pose(track, index)) for index in shown]
    finally:
        camera.close()


class PosedModel:
    """The robot in the scene of a scenario, set to the poses of a recording.

    Raises:
        SimulationError: if the scene cannot be built.
    """

    def __init__(self, scenario: Scenario) -> None:
        spec = scene_spec(scenario.scene, scenario.scene_parameters, meshes=True)
        self._motion = scene_motion(scenario.scene, scenario.scene_parameters)
        self.model = spec.compile()
        self._data = mujoco.MjData(self.model)

    def pose(self, track: Track, index: int) -> FloatArray:
        """Frame (`cassie_sim.camera.frame_of`) of one sample of a track.

        Springs are as measured, rods close the loops, and the ground is moved.
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
