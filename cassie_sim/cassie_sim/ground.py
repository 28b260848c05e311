"""Ground surfaces: friction, and how far a foot sinks in.

Hard ground is MuJoCo's stiff contact. Soft ground is a force law at each end of each foot, made
of the same contact with another impedance. With MuJoCo's impedance d(r) at a depth r, which
rises from d0 to d1 over `width`, and the inverse weight w of the foot, the force is

    F = m (s r d / d1^2 + c v),    m = d / ((1 - d) w),

with v the speed into the ground, c = 700 1/s, and m, about 0.6 kg, the soil that moves with the
foot. So stiffness rises about twelvefold over the depth, and damping dissipates the foot's energy.
The ground yields within some hundredths of a second. A rising foot leaves the ground at once, since
the ground follows at no more than s r d / (d1^2 c). s is chosen so that a foot which carries the
robot's weight, half on each end, sinks by `sinking`. Friction is Coulomb friction, with an elliptic
cone.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from cassie_gaits import robot
from cassie_gaits.names import LEGS
from cassie_sim.robot_mjcf import robot_model

GROUND_GROUP = 2
"""Group of all ground geoms, for rays that shall hit nothing else."""

SLOWEST_PERIOD = 0.001
"""Longest physics step with which the damping of soft ground is stable. In s."""

HARDER_FRICTION = 10.0
"""Ratio of the friction's impedance to the normal one's, `impratio`: with 1 loaded feet creep."""

_HARD_SOLREF = (0.005, 1.0)
_SOFT_IMPEDANCE = (0.3, 0.7)
_SOFT_DAMPING = 700.0  # c, in 1/s; integrated explicitly, so c times the period must be below 1
_WIDTH = 2.0  # depth at which the impedance is highest, ratio to `sinking`

_PELVIS = 8  # contact bit of the pelvis, see robot_mjcf
_END_BITS = {
    (leg, end): 16 << (2 * i + j)
    for i, leg in enumerate(LEGS)
    for j, end in enumerate(("heel", "toe"))
}
_TEXTURE = "ground"


@dataclass(frozen=True)
class Surface:
    """Surface of one piece of ground.

    Attributes:
        friction: Coulomb friction.
        sinking: Depth to which a foot with the robot's weight sinks; 0 is hard. In m.
        colour: Red, green, blue, opacity.
    """

    friction: float
    sinking: float = 0.0
    colour: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)


def add_plane(
    spec: mujoco.MjSpec, surface: Surface, name: str, quat: Sequence[float] | None = None
) -> mujoco.MjsGeom:
    """An infinite plane through the origin; level, or rotated by `quat` (w x y z)."""
    geom = spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.1]
    )
    if quat is not None:
        geom.quat = list(quat)
    make_ground(spec, geom, surface)
    return geom


def make_ground(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, surface: Surface) -> None:
    """Give a geom the contact and the colour of a surface."""
    # With priority the ground's values are used; otherwise MuJoCo uses the larger friction.
    geom.priority = 1
    geom.friction = [surface.friction, 0.005, 0.0001]
    geom.condim = 3
    geom.contype = 1
    geom.conaffinity = 15
    geom.group = GROUND_GROUP
    geom.material = _TEXTURE
    geom.rgba = surface.colour
    if surface.sinking > 0.0:
        geom.solref, geom.solimp = soft_contact(surface.sinking)
        spec.option.impratio = HARDER_FRICTION
    else:
        geom.solref = _HARD_SOLREF


def carry_only(geom: mujoco.MjsGeom, ends: Sequence[str] = ("heel", "toe")) -> None:
    """Let soft ground carry only `ends` of the feet, and the pelvis, but no other part of a leg.

    Otherwise the lower end of the tarsus, 2 cm above the sole, would hold up a sinking foot.
    Call `tell_ends_apart` before.
    """
    geom.contype = 0
    geom.conaffinity = _PELVIS | sum(_END_BITS[leg, end] for leg in LEGS for end in ends)


def tell_ends_apart(spec: mujoco.MjSpec) -> None:
    """Give each end of each foot its own contact bit; each leg still meets the other's foot."""
    for (leg, end), bit in _END_BITS.items():
        spec.geom(f"{leg}_{end}").contype = bit
    for geom in spec.geoms:
        for leg, other in zip(LEGS, reversed(LEGS), strict=True):
            if geom.parent.name.startswith(leg) and not geom.name and geom.contype:
                geom.conaffinity |= _END_BITS[other, "heel"] | _END_BITS[other, "toe"]


def is_soft(model: mujoco.MjModel) -> bool:
    """Whether there is soft ground in a scene."""
    return bool((model.geom_solref[:, 0] < 0.0).any())


def soft_contact(sinking: float) -> tuple[list[float], list[float]]:
    """MuJoCo's solref and solimp of ground into which a foot sinks.

    Args:
        sinking: Depth under half of the robot's weight on each end of one foot. In m.
    """
    low, high = _SOFT_IMPEDANCE
    width = _WIDTH * sinking
    d = low + (high - low) * sinking / width
    per_end = 0.5 * robot.WEIGHT
    stiffness = per_end / sinking * high**2 * (1.0 - d) * _inverse_weight() / d**2
    return [-stiffness, -_SOFT_DAMPING * high], [low, high, width, 0.5, 1.0]


@functools.cache
def _inverse_weight() -> float:
    """MuJoCo's inverse weight of a foot. In 1/kg."""
    model = robot_model()
    return float(model.body_invweight0[model.body("left_toe").id, 0])


def add_texture(spec: mujoco.MjSpec) -> None:
    """Add the ground's checker pattern, one square per metre, which surfaces tint."""
    spec.add_texture(
        name=_TEXTURE,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.87, 0.88],
        rgb2=[0.78, 0.80, 0.82],
        width=256,
        height=256,
    )
    material = spec.add_material(name=_TEXTURE, texrepeat=[1.0, 1.0], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = _TEXTURE


def tilt(rise_ahead: float, rise_left: float) -> list[float]:
    """Rotation of ground that rises ahead and to the left (rad), as w x y z."""
    pitch = np.array([np.cos(rise_ahead / 2), 0.0, -np.sin(rise_ahead / 2), 0.0])
    roll = np.array([np.cos(rise_left / 2), np.sin(rise_left / 2), 0.0, 0.0])
    quaternion = np.zeros(4)
    mujoco.mju_mulQuat(quaternion, pitch, roll)
    return list(quaternion.tolist())
