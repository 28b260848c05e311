"""Ground in stretches along x: each with its own surface, rise, step, bumps and branches."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from cassie_msgs.tunables import (
    ParameterError,
    from_mapping,
    replace_checked,
    tunable,
    unknown_name,
)
from cassie_sim.ground import Surface, carry_only, make_ground, tell_ends_apart, tilt
from cassie_sim.height_field import FIELD_BASE, FIELD_HALF_WIDTH, random_heights

BEHIND = 30.0
"""How far the first stretch reaches behind the start. In m."""

_HALF_WIDTH = 20.0  # m, of a stretch
_THICKNESS = 1.0  # m, half of the thickness of a stretch's box
_OVERLAP = 0.3  # m; a foot deep in soft ground must not touch the side of the ground's box
_BELOW = 0.001  # m by which level soft ground lies lower than hard ground
_BOTTOM = 2.5  # depth of hard ground below soft ground, ratio to the sinking
_COVERED = 1.5  # bumps and branches lie up to this distance to both sides, in m
_BUMP_RADIUS = (0.15, 0.35)  # m, range
_BUMPS_PER_AREA = 6.0  # 1/m^2
_BRANCH_LENGTH = (0.4, 1.4)  # m, range
_UNSEEN = (0.0, 0.0, 0.0, 0.0)
_WOOD = (0.36, 0.25, 0.16, 1.0)


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A stretch of ground. Its surface gives the values that are missing."""

    surface: str = tunable("concrete", description="Surface of the stretch")
    length: float = tunable(5.0, "m", 0.1, 200.0, "Length along the ground")
    rise_deg: float = tunable(0.0, "deg", -30.0, 30.0, "Rise ahead; negative goes down")
    step: float = tunable(0.0, "m", -0.3, 0.3, "Step at the beginning; negative goes down")
    friction: float = tunable(1.0, "", 0.05, 3.0, "Coulomb friction")
    sinking: float = tunable(0.0, "m", 0.0, 0.15, "Depth to which a foot with the weight sinks")
    heel_dig: float = tunable(0.0, "m", 0.0, 0.3, "Additional depth to which the heel sinks")
    uneven: float = tunable(0.0, "m", 0.0, 0.05, "Height of bumps and depth of hollows")
    rough: float = tunable(
        0.0, "m", 0.0, 0.15, "Standard deviation of random height, of hard ground"
    )
    grain: float = tunable(0.4, "m", 0.02, 5.0, "Distance over which the random height changes")
    branches: float = tunable(0.0, "1/m", 0.0, 20.0, "Number of branches across the path per metre")
    branch_low: float = tunable(0.02, "m", 0.005, 0.1, "Diameter of the thinnest branch")
    branch_high: float = tunable(0.04, "m", 0.005, 0.1, "Diameter of the thickest branch")


SURFACES: Mapping[str, Stretch] = {
    "concrete": Stretch(surface="concrete", friction=1.0),
    "waxed": Stretch(surface="waxed", friction=0.25),
    "grass": Stretch(surface="grass", friction=0.8, sinking=0.02, uneven=0.02),
    "snow": Stretch(surface="snow", friction=0.3, sinking=0.02, uneven=0.005),
    "sand": Stretch(surface="sand", friction=0.6, sinking=0.06, uneven=0.01),
    "burn": Stretch(surface="burn", friction=0.7, sinking=0.01, uneven=0.01, branches=3.0),
    "gravel": Stretch(surface="gravel", friction=0.6, rough=0.008, grain=0.06),
}
"""Default values of a stretch by its surface."""

COLOURS = {
    "concrete": (1.0, 1.0, 1.0, 1.0),
    "waxed": (0.95, 0.88, 0.72, 1.0),
    "grass": (0.48, 0.72, 0.35, 1.0),
    "snow": (1.1, 1.12, 1.17, 1.0),
    "sand": (0.98, 0.85, 0.58, 1.0),
    "burn": (0.45, 0.42, 0.38, 1.0),
    "gravel": (0.66, 0.64, 0.6, 1.0),
}


def read_stretch(mapping: Mapping[str, Any], where: str) -> Stretch:
    """A stretch from a mapping as YAML gives it.

    Raises:
        ParameterError: naming the key, its value and the permitted values.
    """
    name = mapping.get("surface", "concrete")
    if not isinstance(name, str) or name not in SURFACES:
        raise ParameterError(f"{where}: {unknown_name(str(name), SURFACES, 'surface')}")
    try:
        given = dataclasses.asdict(from_mapping(Stretch, mapping))
        for key in mapping:  # `from_mapping` accepts an unknown key with an empty mapping
            if key not in given:
                raise ParameterError(unknown_name(str(key), given, "parameter"))
        stretch = replace_checked(SURFACES[name], **{key: given[key] for key in mapping})
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None
    check_branches(stretch.branch_low, stretch.branch_high, where)
    if stretch.rough > 0.0 and stretch.sinking > 0.0:
        raise ParameterError(
            f"{where}: rough = {stretch.rough:g} m with sinking = {stretch.sinking:g} m, "
            "but soft ground cannot be rough: set one of them to 0"
        )
    return stretch


def check_branches(low: float, high: float, where: str) -> None:
    """Check that the thinnest branch is not thicker than the thickest. In m.

    Raises:
        ParameterError: naming both diameters.
    """
    if low > high:
        raise ParameterError(f"{where}: branch_low = {low:g} m is above branch_high = {high:g} m")


@dataclass(frozen=True)
class Site:
    """Place where ground is built.

    Attributes:
        spec: The world.
        body: Body that carries the ground; the first stretch begins at its origin.
        prefix: Prefix of the names of the ground's geoms.
    """

    spec: mujoco.MjSpec
    body: mujoco.MjsBody
    prefix: str = ""


def add_stretches(spec: mujoco.MjSpec, stretches: Sequence[Stretch], seed: int) -> None:
    """Lay consecutive stretches; the first begins behind the robot, level with its start.

    Args:
        spec: World to which the ground is added.
        stretches: Stretches from the start on. The first one's length counts from the robot.
        seed: Seed of bumps, branches and random heights.
    """
    if any(stretch.sinking > 0.0 for stretch in stretches):
        tell_ends_apart(spec)
    lay(Site(spec, spec.worldbody), stretches, np.random.default_rng(seed), BEHIND)


def lay(site: Site, stretches: Sequence[Stretch], rng: np.random.Generator, behind: float) -> None:
    """Lay consecutive stretches from the origin of a body on.

    Args:
        site: Place of the ground. With soft ground it needs `tell_ends_apart`.
        stretches: Stretches from the origin on.
        rng: Random numbers for bumps, branches and random heights.
        behind: How far the first stretch reaches behind the origin. In m.
    """
    x = z = 0.0
    for index, stretch in enumerate(stretches):
        z += stretch.step
        rise = math.radians(stretch.rise_deg)
        before = behind if index == 0 else _overlap_before(stretches[index - 1], stretch)
        following = stretches[index + 1] if index + 1 < len(stretches) else None
        frame = _Frame(x, z, rise)
        surface = Surface(stretch.friction, stretch.sinking, COLOURS[stretch.surface])
        if stretch.rough > 0.0:
            _add_field(site, f"field_{index}", frame, stretch, surface, rng)
        if before > 0.0 or stretch.rough == 0.0:
            shown = dataclasses.replace(stretch, length=0.0) if stretch.rough > 0.0 else stretch
            after = _overlap_after(stretch, following)
            _add_box(site, f"stretch_{index}", frame, shown, surface, before, after)
        keep_clear = 0.5 if index == 0 else 0.0
        _add_bumps(site, f"bump_{index}", frame, stretch, surface, rng, keep_clear)
        _add_branches(site, f"branch_{index}", frame, stretch, rng, keep_clear)
        x += stretch.length * math.cos(rise)
        z += stretch.length * math.sin(rise)


@dataclass(frozen=True)
class _Frame:
    """Beginning of a stretch and its rise (rad)."""

    x: float
    z: float
    rise: float

    def at(self, along: float, y: float, up: float) -> list[float]:
        """A point of the stretch in the world."""
        cos, sin = math.cos(self.rise), math.sin(self.rise)
        return [self.x + along * cos - up * sin, y, self.z + along * sin + up * cos]

    @property
    def quat(self) -> list[float]:
        """Rotation of the stretch, w x y z."""
        return tilt(self.rise, 0.0)


def _overlap_before(previous: Stretch, stretch: Stretch) -> float:
    """How far a box may reach below the previous box without coming out of that box. In m."""
    if stretch.sinking == 0.0 or stretch.step > 0.0:
        return 0.0
    return _OVERLAP if stretch.rise_deg >= previous.rise_deg else 0.1 * _OVERLAP


def _overlap_after(stretch: Stretch, following: Stretch | None) -> float:
    """How far a box may reach below the following box. In m."""
    if following is None or stretch.sinking == 0.0 or following.step < 0.0:
        return 0.0
    return _OVERLAP if following.rise_deg >= stretch.rise_deg else 0.1 * _OVERLAP


def _add_box(
    site: Site,
    name: str,
    frame: _Frame,
    stretch: Stretch,
    surface: Surface,
    before: float,
    after: float,
) -> None:
    half = 0.5 * (before + stretch.length + after)

    # Soft ground lies below its neighbours: two surfaces at one height would be drawn mixed.
    low = -_THICKNESS - max(stretch.uneven, _BELOW if stretch.sinking > 0.0 else 0.0)

    def add(name: str, up: float, surface: Surface) -> mujoco.MjsGeom:
        geom = site.body.add_geom(
            name=f"{site.prefix}{name}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[half, _HALF_WIDTH, _THICKNESS],
            pos=frame.at(half - before, 0.0, up),
            quat=frame.quat,
        )
        make_ground(site.spec, geom, surface)
        return geom

    box = add(name, low, surface)
    if stretch.sinking == 0.0:
        return
    # Ground below the surface, or a second one in its place, is not drawn.
    unseen = dataclasses.replace(surface, colour=_UNSEEN)
    depth = stretch.sinking + stretch.heel_dig
    add(f"{name}_bottom", low - _BOTTOM * depth, dataclasses.replace(unseen, sinking=0.0))
    _carry_feet(box, stretch, lambda deeper: add(f"{name}_heel", low, deeper), surface)


def _add_field(
    site: Site,
    name: str,
    frame: _Frame,
    stretch: Stretch,
    surface: Surface,
    rng: np.random.Generator,
) -> None:
    """Add a field of random heights, level at both ends, with level ground beside it."""
    heights = random_heights(stretch.length, stretch.rough, stretch.grain, rng)
    low, high = float(heights.min()), float(heights.max())
    span = max(high - low, 1e-6)
    half = 0.5 * stretch.length
    site.spec.add_hfield(
        name=f"{site.prefix}{name}",
        size=[half, FIELD_HALF_WIDTH, span, FIELD_BASE],
        nrow=heights.shape[0],
        ncol=heights.shape[1],
        userdata=((heights - low) / span).ravel().tolist(),
    )
    geom = site.body.add_geom(
        name=f"{site.prefix}{name}",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname=f"{site.prefix}{name}",
        pos=frame.at(half, 0.0, low),
        quat=frame.quat,
    )
    make_ground(site.spec, geom, surface)
    width = 0.5 * (_HALF_WIDTH - FIELD_HALF_WIDTH)
    for side in (1.0, -1.0):
        bank = site.body.add_geom(
            name=f"{site.prefix}{name}_{'left' if side > 0.0 else 'right'}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[half, width, _THICKNESS],
            pos=frame.at(half, side * (FIELD_HALF_WIDTH + width), -_THICKNESS),
            quat=frame.quat,
        )
        make_ground(site.spec, bank, surface)


def _carry_feet(
    geom: mujoco.MjsGeom,
    stretch: Stretch,
    add_again: Callable[[Surface], mujoco.MjsGeom],
    surface: Surface,
) -> None:
    """Let soft ground carry feet only.

    Where heels sink deeper than toes, `add_again` adds the ground a second time, for the heels.
    """
    if stretch.heel_dig == 0.0:
        carry_only(geom)
        return
    carry_only(geom, ("toe",))
    deeper = stretch.sinking + stretch.heel_dig
    carry_only(add_again(dataclasses.replace(surface, sinking=deeper, colour=_UNSEEN)), ("heel",))


def _add_bumps(
    site: Site,
    name: str,
    frame: _Frame,
    stretch: Stretch,
    surface: Surface,
    rng: np.random.Generator,
    keep_clear: float,
) -> None:
    """Add bumps, as caps of large balls.

    The ground between them lies `uneven` below the stretch, the highest tops `uneven` above it.
    """
    if stretch.uneven == 0.0:
        return
    count = round(_BUMPS_PER_AREA * (stretch.length - keep_clear) * 2.0 * _COVERED)
    for index in range(count):
        along = float(rng.uniform(keep_clear, stretch.length))
        y = float(rng.uniform(-_COVERED, _COVERED))
        height = 2.0 * stretch.uneven * float(rng.uniform(0.2, 1.0))
        foot = float(rng.uniform(*_BUMP_RADIUS))
        radius = (foot**2 + height**2) / (2.0 * height)
        pos = frame.at(along, y, height - stretch.uneven - radius)
        bump = _add_ball(site, f"{name}_{index}", pos, radius, surface)
        if surface.sinking > 0.0:
            again = functools.partial(_add_ball, site, f"{name}_{index}_heel", pos, radius)
            _carry_feet(bump, stretch, again, surface)


def _add_ball(
    site: Site, name: str, pos: list[float], radius: float, surface: Surface
) -> mujoco.MjsGeom:
    kind = mujoco.mjtGeom.mjGEOM_SPHERE
    geom = site.body.add_geom(
        name=f"{site.prefix}{name}", type=kind, size=[radius, 0.0, 0.0], pos=pos
    )
    make_ground(site.spec, geom, surface)
    return geom


def _add_branches(
    site: Site,
    name: str,
    frame: _Frame,
    stretch: Stretch,
    rng: np.random.Generator,
    keep_clear: float,
) -> None:
    """Add round branches that lie on the ground and do not roll."""
    for index in range(round(stretch.branches * (stretch.length - keep_clear))):
        along = float(rng.uniform(keep_clear, stretch.length))
        y = float(rng.uniform(-_COVERED, _COVERED))
        radius = 0.5 * float(rng.uniform(stretch.branch_low, stretch.branch_high))
        half = 0.5 * float(rng.uniform(*_BRANCH_LENGTH))
        turn = float(rng.uniform(-math.pi / 3.0, math.pi / 3.0))
        ahead, left = half * math.sin(turn), half * math.cos(turn)
        up = radius - stretch.uneven
        geom = site.body.add_geom(
            name=f"{site.prefix}{name}_{index}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[radius, 0.0, 0.0],
            fromto=[
                *frame.at(along - ahead, y - left, up),
                *frame.at(along + ahead, y + left, up),
            ],
        )
        make_ground(site.spec, geom, Surface(stretch.friction, 0.0, _WOOD))
