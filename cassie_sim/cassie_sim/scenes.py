"""Scenes: the ground under the robot, each with named parameters in known ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from cassie_msgs.tunables import from_mapping, tunable, unknown_name
from cassie_sim.errors import SimulationError
from cassie_sim.robot_mjcf import robot_spec


@dataclass(frozen=True, kw_only=True)
class Flat:
    """Level, hard ground."""

    friction: float = tunable(1.0, "", 0.05, 3.0, "Coulomb friction of the ground")


@dataclass(frozen=True, kw_only=True)
class Slope(Flat):
    """Hard ground, level around the start and tilted beyond it."""

    angle: float = tunable(5.0, "deg", -30.0, 30.0, "Rise ahead; negative goes down")
    side_angle: float = tunable(0.0, "deg", -30.0, 30.0, "Rise to the left")
    start: float = tunable(1.0, "m", 0.3, 50.0, "Distance ahead at which the slope begins")


SCENES: dict[str, type[Any]] = {"flat": Flat, "slope": Slope}
"""Parameters of each scene by its name."""


def scene_spec(
    name: str, parameters: Mapping[str, object], *, meshes: bool = False
) -> mujoco.MjSpec:
    """The robot in a scene.

    Args:
        name: One of `SCENES`.
        parameters: Values by name; what is left out keeps its default.
        meshes: Whether the robot carries its visual meshes.

    Raises:
        SimulationError: if there is no such scene; the message names the nearest one.
        ParameterError: if a parameter is unknown or out of range.
    """
    if name not in SCENES:
        raise SimulationError(unknown_name(name, SCENES, "scene"))
    settings: Any = from_mapping(SCENES[name], parameters)
    spec = robot_spec(meshes=meshes)
    _add_lights_and_camera(spec)
    _BUILDERS[name](spec, settings)
    return spec


def _flat(spec: mujoco.MjSpec, settings: Flat) -> None:
    _add_ground(spec, settings.friction, name="ground")


def _slope(spec: mujoco.MjSpec, settings: Slope) -> None:
    tilt, side = math.radians(settings.angle), math.radians(settings.side_angle)
    if side != 0.0:
        # Ground that rises to the side does so from the start: there is no level part to leave.
        _add_ground(spec, settings.friction, name="slope", quat=_tilt(tilt, side))
        return
    _add_ground(spec, settings.friction, name="ground", end=settings.start)
    _add_ramp(spec, settings.friction, settings.start, 60.0, tilt, _tilt(tilt, 0.0))


def _tilt(rise_ahead: float, rise_left: float) -> list[float]:
    pitch = np.array([math.cos(rise_ahead / 2), 0.0, -math.sin(rise_ahead / 2), 0.0])
    roll = np.array([math.cos(rise_left / 2), math.sin(rise_left / 2), 0.0, 0.0])
    quaternion = np.zeros(4)
    mujoco.mju_mulQuat(quaternion, pitch, roll)
    return list(quaternion.tolist())


def _add_ground(
    spec: mujoco.MjSpec,
    friction: float,
    *,
    name: str,
    quat: list[float] | None = None,
    end: float | None = None,
) -> None:
    """Add level ground, on and on or up to `end` ahead (m); or a plane tilted by `quat`."""
    finite = end is not None
    geom = spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX if finite else mujoco.mjtGeom.mjGEOM_PLANE,
        size=[30.0, 30.0, 0.5] if finite else [0.0, 0.0, 0.1],
        pos=[0.0, 0.0, 0.0] if end is None else [end - 30.0, 0.0, -0.5],
    )
    if quat is not None:
        geom.quat = quat
    _make_ground(geom, friction)


def _add_ramp(
    spec: mujoco.MjSpec,
    friction: float,
    start: float,
    length: float,
    tilt: float,
    quat: list[float],
) -> None:
    # The box's upper edge near the robot lies on the end of the level part.
    half, thick = length / 2, 0.5
    centre_x = start + half * math.cos(tilt) + thick * math.sin(tilt)
    centre_z = half * math.sin(tilt) - thick * math.cos(tilt)
    geom = spec.worldbody.add_geom(
        name="slope",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[half, 30.0, thick],
        pos=[centre_x, 0.0, centre_z],
        quat=quat,
    )
    _make_ground(geom, friction)


def _make_ground(geom: mujoco.MjsGeom, friction: float) -> None:
    # Priority makes the ground's friction count; else the larger one of two geoms does.
    geom.priority = 1
    geom.friction = [friction, 0.005, 0.0001]
    geom.solref = [0.005, 1.0]
    geom.condim = 3
    geom.contype = 1
    geom.conaffinity = 15
    geom.material = "ground"


def _add_lights_and_camera(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="ground",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.87, 0.88],
        rgb2=[0.78, 0.80, 0.82],
        width=256,
        height=256,
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.75, 0.85, 0.95],
        rgb2=[1.0, 1.0, 1.0],
        width=128,
        height=128,
    )
    material = spec.add_material(name="ground", texrepeat=[1.0, 1.0], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground"
    # Light and camera go along with the pelvis, or shadows would stay behind.
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


_BUILDERS: dict[str, Callable[..., None]] = {"flat": _flat, "slope": _slope}
