"""Scenes: the ground under the robot, each with named parameters in known ranges."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import mujoco

from cassie_gaits import robot
from cassie_gaits.names import LEGS
from cassie_msgs.tunables import ParameterError, from_mapping, replace_checked, unknown_name
from cassie_sim.errors import SimulationError
from cassie_sim.ground import Surface, add_plane, add_texture, make_ground, tilt
from cassie_sim.motion import GroundMotion
from cassie_sim.random_course import CourseMotion, RandomCourse, add_course
from cassie_sim.robot_mjcf import robot_spec
from cassie_sim.scene_parameters import (
    Block,
    Course,
    Debris,
    Flat,
    Grass,
    Gravel,
    Pillar,
    Rough,
    Sand,
    Segway,
    Slope,
    Snow,
    Step,
    Tilting,
    WaxedFloor,
    read_course,
)
from cassie_sim.segway import add_segway
from cassie_sim.segway_drive import SegwayDrive
from cassie_sim.segway_ground import WAYS, add_bumps
from cassie_sim.stairs import Stairs, stairs_stretches
from cassie_sim.stretches import COLOURS, SURFACES, Stretch, add_stretches, check_branches

SoftT = TypeVar("SoftT", Sand, Stretch)

FAR = 100.0
"""Length of practically endless ground. In m."""

SHOE_WIDTH = 0.12
"""Width of the soles of shoes. In m."""

_MOVING = "moving_ground"
_BLOCK_SIZE = (0.25, 0.11, 0.15)  # half lengths, in m
_BLOCK_Y = 0.15  # m, distance to the side
_PILLAR_HEIGHT = 2.5  # m
_DARK_TREAD = (0.62, 0.64, 0.68, 1.0)  # every second tread of stairs


def read_scene(name: str, parameters: Mapping[str, object]) -> Any:
    """All parameters of a scene.

    Args:
        name: One of `SCENES`.
        parameters: Values by name; a missing one has its default.

    Raises:
        SimulationError: if there is no such scene; the message names the nearest one.
        ParameterError: if a parameter is unknown or out of range; the message begins with its path
            in an experiment, such as `scene_parameters.riser`.
    """
    if name not in SCENES:
        raise SimulationError(unknown_name(name, SCENES, "scene"))
    cls, _ = SCENES[name]
    try:
        return read_course(parameters) if cls is Course else from_mapping(cls, parameters)
    except ParameterError as error:
        first = re.split(r"[ .:]", str(error), maxsplit=1)[0]
        dot = "." if first in {field.name for field in dataclasses.fields(cls)} else ": "
        raise ParameterError(f"scene_parameters{dot}{error}") from None


def scene_spec(
    name: str, parameters: Mapping[str, object], *, meshes: bool = False
) -> mujoco.MjSpec:
    """The robot in a scene.

    Args:
        name: One of `SCENES`.
        parameters: Values by name; a missing one has its default.
        meshes: Whether the robot has its visual meshes.

    Raises:
        SimulationError: if there is no such scene; the message names the nearest one.
        ParameterError: if a parameter is unknown or out of range.
    """
    settings = read_scene(name, parameters)
    spec = robot_spec(meshes=meshes)
    _add_lights_and_camera(spec)
    SCENES[name][1](spec, settings)
    return spec


def scene_motion(
    name: str, parameters: Mapping[str, object]
) -> GroundMotion | SegwayDrive | CourseMotion | None:
    """How a scene's ground moves by itself, or None if it does not.

    Raises:
        SimulationError, ParameterError: as `scene_spec`.
    """
    settings = read_scene(name, parameters)
    if isinstance(settings, Block):
        duration = settings.height / settings.rate if settings.rate else 0.0
        return GroundMotion(_MOVING, settings.start, 0.0, 0.0, settings.height, duration)
    if isinstance(settings, Tilting):
        ahead, left = math.radians(settings.rise_deg), math.radians(settings.side_deg)
        most = max(abs(settings.rise_deg), abs(settings.side_deg))
        return GroundMotion(_MOVING, settings.start, ahead, left, 0.0, most / settings.rate_deg)
    if isinstance(settings, Segway):
        return SegwayDrive(settings)
    if isinstance(settings, RandomCourse):
        return CourseMotion(settings)
    return None


def _flat(spec: mujoco.MjSpec, settings: Flat) -> None:
    add_plane(spec, Surface(settings.friction), "ground")


def _waxed_floor(spec: mujoco.MjSpec, settings: WaxedFloor) -> None:
    add_plane(spec, Surface(settings.friction, 0.0, COLOURS["waxed"]), "ground")


def _slope(spec: mujoco.MjSpec, settings: Slope) -> None:
    if settings.side_deg != 0.0:
        # Ground that rises to the side does so everywhere, without a level part at the start.
        quat = tilt(math.radians(settings.rise_deg), math.radians(settings.side_deg))
        add_plane(spec, Surface(settings.friction), "slope", quat)
        return
    level = Stretch(length=settings.start, friction=settings.friction)
    rising = Stretch(length=FAR, rise_deg=settings.rise_deg, friction=settings.friction)
    add_stretches(spec, (level, rising), 0)


def _grass(spec: mujoco.MjSpec, settings: Grass) -> None:
    _add_ahead(spec, settings, "grass", ("friction", "sinking", "uneven"))


def _snow(spec: mujoco.MjSpec, settings: Snow) -> None:
    _add_ahead(spec, settings, "snow", ("friction", "sinking", "uneven"))


def _sand(spec: mujoco.MjSpec, settings: Sand) -> None:
    if settings.shoes:
        settings = _carried_by_shoes(settings)
        _put_on_shoes(spec)
    _add_ahead(spec, settings, "sand", ("friction", "sinking", "heel_dig", "uneven"))


def _debris(spec: mujoco.MjSpec, settings: Debris) -> None:
    check_branches(settings.branch_low, settings.branch_high, "debris")
    _add_ahead(spec, settings, "burn", ("friction", "branches", "branch_low", "branch_high"))


def _add_ahead(
    spec: mujoco.MjSpec,
    settings: Grass | Snow | Sand | Debris | Gravel,
    surface: str,
    names: tuple[str, ...],
) -> None:
    """Add concrete up to `start`, then the surface for 30 m, then the bare surface.

    The last part has no bumps, branches or random heights.
    """
    figures = {name: getattr(settings, name) for name in names}
    ground = replace_checked(SURFACES[surface], rise_deg=settings.rise_deg, length=30.0, **figures)
    add_stretches(spec, (Stretch(length=settings.start), ground), settings.seed)


def _step(spec: mujoco.MjSpec, settings: Step) -> None:
    level = Stretch(length=settings.start, friction=settings.friction)
    beyond = Stretch(length=FAR, step=settings.height, friction=settings.friction)
    add_stretches(spec, (level, beyond), 0)


def _rough(spec: mujoco.MjSpec, settings: Rough) -> None:
    level = Stretch(length=settings.start, friction=settings.friction)
    field = Stretch(
        length=settings.length,
        friction=settings.friction,
        rough=settings.height,
        grain=settings.grain,
    )
    beyond = Stretch(length=FAR, friction=settings.friction)
    add_stretches(spec, (level, field, beyond), settings.seed)


def _gravel(spec: mujoco.MjSpec, settings: Gravel) -> None:
    _add_ahead(spec, settings, "gravel", ("friction", "rough", "grain"))


def _stairs(spec: mujoco.MjSpec, settings: Stairs) -> None:
    stretches = stairs_stretches(settings)
    add_stretches(spec, stretches, 0)
    for index in range(2, len(stretches), 2):  # so that one tread is told from the next
        spec.geom(f"stretch_{index}").rgba = _DARK_TREAD


def _random_course(spec: mujoco.MjSpec, settings: RandomCourse) -> None:
    add_course(spec, settings)


def _pillar(spec: mujoco.MjSpec, settings: Pillar) -> None:
    add_plane(spec, Surface(settings.friction), "ground")
    _add_pillar(spec, settings, "pillar")


def _add_pillar(spec: mujoco.MjSpec, settings: Pillar, name: str) -> None:
    geom = spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[settings.radius, 0.5 * _PILLAR_HEIGHT, 0.0],
        pos=[settings.x, settings.y, 0.5 * _PILLAR_HEIGHT],
    )
    make_ground(spec, geom, Surface(settings.friction, 0.0, (0.8, 0.78, 0.75, 1.0)))


def _course(spec: mujoco.MjSpec, settings: Course) -> None:
    stretches = settings.stretches
    if settings.shoes:
        stretches = tuple(_carried_by_shoes(stretch) for stretch in stretches)
        _put_on_shoes(spec)
    add_stretches(spec, stretches, settings.seed)
    for index, pillar in enumerate(settings.pillars):
        _add_pillar(spec, pillar, f"pillar_{index}")


def _block(spec: mujoco.MjSpec, settings: Block) -> None:
    add_plane(spec, Surface(settings.friction), "ground")
    side = 1.0 if settings.side == "left" else -1.0
    body = spec.worldbody.add_body(name=_MOVING, mocap=True, pos=[0.0, side * _BLOCK_Y, 0.0])
    _add_box(body, spec, _BLOCK_SIZE, Surface(settings.friction, 0.0, (0.75, 0.55, 0.4, 1.0)))


def _segway(spec: mujoco.MjSpec, settings: Segway) -> None:
    way = WAYS[settings.surface]
    add_plane(spec, Surface(settings.friction, 0.0, COLOURS[way.colour]), "ground")
    if way.height > 0.0:
        add_bumps(spec, settings, way)
    add_segway(spec)


def _tilting(spec: mujoco.MjSpec, settings: Tilting) -> None:
    body = spec.worldbody.add_body(name=_MOVING, mocap=True)
    _add_box(body, spec, (10.0, 10.0, 0.5), Surface(settings.friction))


def _add_box(
    body: mujoco.MjsBody,
    spec: mujoco.MjSpec,
    size: tuple[float, float, float],
    surface: Surface,
) -> None:
    """Add a box whose upper face contains the origin of its body."""
    geom = body.add_geom(
        name=f"{body.name}_box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=size,
        pos=[0.0, 0.0, -size[2]],
    )
    make_ground(spec, geom, surface)


def _put_on_shoes(spec: mujoco.MjSpec) -> None:
    """Give both ends of each foot the width of a shoe: capsules across the foot."""
    for leg in LEGS:
        for end in ("heel", "toe"):
            geom = spec.geom(f"{leg}_{end}")
            geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            geom.size = [geom.size[0], 0.5 * SHOE_WIDTH - geom.size[0], 0.0]


def _carried_by_shoes(ground: SoftT) -> SoftT:
    """The ground under shoes: sinking depends on pressure, so on the width of the sole."""
    share = 2.0 * robot.SOLE_RADIUS / SHOE_WIDTH
    figures = {"sinking": share * ground.sinking, "heel_dig": share * ground.heel_dig}
    return replace_checked(ground, **figures)


def _add_lights_and_camera(spec: mujoco.MjSpec) -> None:
    add_texture(spec)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.75, 0.85, 0.95],
        rgb2=[1.0, 1.0, 1.0],
        width=128,
        height=128,
    )
    # Light and camera move with the pelvis; otherwise the shadows would stay at the start.
    pelvis = spec.body("pelvis")
    pelvis.add_light(
        pos=[-0.5, -0.8, 3.0],
        dir=[0.16, 0.26, -1.0],
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
    )
    spec.stat.extent = 2.0
    spec.stat.center = [0.0, 0.0, 0.5]
    pelvis.add_camera(
        name="track",
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        pos=[0.65, -2.9, 0.3],
        xyaxes=[1.0, 0.22, 0.0, -0.03, 0.13, 1.0],
    )


SCENES: dict[str, tuple[type[Any], Callable[..., None]]] = {
    "flat": (Flat, _flat),
    "slope": (Slope, _slope),
    "grass": (Grass, _grass),
    "snow": (Snow, _snow),
    "waxed_floor": (WaxedFloor, _waxed_floor),
    "sand": (Sand, _sand),
    "debris": (Debris, _debris),
    "step": (Step, _step),
    "rough": (Rough, _rough),
    "gravel": (Gravel, _gravel),
    "stairs": (Stairs, _stairs),
    "random_course": (RandomCourse, _random_course),
    "pillar": (Pillar, _pillar),
    "course": (Course, _course),
    "block": (Block, _block),
    "segway": (Segway, _segway),
    "tilting": (Tilting, _tilting),
}
"""Parameters and builder of each scene by its name."""
