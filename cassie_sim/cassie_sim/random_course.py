"""An endless course of all grounds: tiles that are laid ahead of the robot, one after another.

Each kind of ground is one tile: a body of the model that can be moved. A seed determines the
order of the tiles, their rise, the steps between them, which tiles are reversed and their sideways
offsets. Only the tiles around the robot are in place, so a physics step costs the same after any
distance. The course runs in the direction in which the robot started; each tile is shifted sideways
onto the path that the robot takes.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from cassie_msgs.tunables import tunable
from cassie_sim.ground import tell_ends_apart, tilt
from cassie_sim.stairs import Stairs, flight_stretches
from cassie_sim.stretches import SURFACES, Site, Stretch, add_stretches, lay

GROUND = 4.0
"""Length of each kind of ground. In m."""

MARGIN = 0.5
"""Length of concrete before and behind each kind of ground. In m."""

BACK, AHEAD = 1, 2
"""Tiles in place behind and ahead of the tile that the robot is on."""

_SIDE = 0.5  # largest sideways offset of a tile, so that its bumps are met at other places, in m
_HIGH = 1.0  # height of the ground, up or down, beyond which the course returns to level, in m
_STEP_SHARE, _RISE_SHARE = 0.3, 0.5  # share of tiles with a step, and with a rise
_PARKED = (0.0, 0.0, -500.0)
_MOST_TURN = 1.0  # tangent of the greatest angle between the course and the robot's path
_SHORTEST_WAY = 1.0  # shortest distance over which the slope of the robot's path is taken, in m


@dataclass(frozen=True, kw_only=True)
class RandomCourse:
    """Endless tiles of all grounds in random order. 0 leaves a kind out."""

    seed: int = tunable(1, "", 0, 2**31, "Seed of the course and of random bumps and heights")
    start: float = tunable(2.0, "m", 0.5, 50.0, "Length of level concrete at the beginning")
    rise_deg: float = tunable(4.0, "deg", 0.0, 20.0, "Steepest rise, up or down")
    step: float = tunable(0.03, "m", 0.0, 0.2, "Largest step between two tiles, up or down")
    riser: float = tunable(0.03, "m", 0.0, 0.17, "Riser of stairs with five steps")
    tread: float = tunable(0.4, "m", 0.2, 0.8, "Tread of stairs with five steps")
    rough: float = tunable(0.01, "m", 0.0, 0.06, "Standard deviation of rough ground's height")
    sinking: float = tunable(0.02, "m", 0.0, 0.06, "Depth to which a foot sinks in sand")
    uneven: float = tunable(0.01, "m", 0.0, 0.05, "Height of bumps and depth of hollows of grass")
    friction: float = tunable(0.3, "", 0.05, 1.0, "Coulomb friction of the waxed tile")


def course_tiles(settings: RandomCourse) -> dict[str, list[Stretch]]:
    """Stretches of each kind of tile, with concrete at both ends."""
    tiles = {
        "concrete": [Stretch(length=GROUND + 2.0 * MARGIN)],
        "grass": _between("grass", uneven=settings.uneven),
        "snow": _between("snow"),
        "waxed": _between("waxed", friction=settings.friction),
        "gravel": _between("gravel"),
        "burn": _between("burn", branch_high=0.03),
    }
    if settings.sinking > 0.0:
        tiles["sand"] = _between("sand", sinking=settings.sinking)
    if settings.rough > 0.0:
        tiles["rough"] = _between("concrete", rough=settings.rough)
    if settings.riser > 0.0:
        stairs = Stairs(tread=settings.tread)
        level = 0.5 * (GROUND + 2.0 * MARGIN - (stairs.number - 1) * stairs.tread)
        flight = flight_stretches(stairs, settings.riser, level)
        tiles["stairs"] = [Stretch(length=level), *flight]
    return tiles


def _between(surface: str, **figures: Any) -> list[Stretch]:
    margin = Stretch(length=MARGIN)
    ground = dataclasses.replace(SURFACES[surface], length=GROUND, **figures)
    return [margin, ground, margin]


def add_course(spec: mujoco.MjSpec, settings: RandomCourse) -> None:
    """Add the level ground at the start, and the tiles, which are out of sight until laid."""
    add_stretches(spec, (Stretch(length=settings.start),), 0)
    tell_ends_apart(spec)
    rng = np.random.default_rng(settings.seed)
    for kind, stretches in course_tiles(settings).items():
        body = spec.worldbody.add_body(name=_body(kind), mocap=True, pos=list(_PARKED))
        lay(Site(spec, body, f"{kind}_"), stretches, rng, 0.0)


def _body(kind: str) -> str:
    return f"tile_{kind}"


@dataclass(frozen=True)
class Tile:
    """A tile of the course.

    Attributes:
        kind: Kind of ground.
        begin: Beginning of the tile along the course. In m.
        end: End of the tile along the course. In m.
        pos: Position of the tile's body, x and z. In m.
        quat: Orientation of the tile's body, w x y z.
        aside: Offset of the tile to the left of the robot's path. In m.
    """

    kind: str
    begin: float
    end: float
    pos: tuple[float, float]
    quat: tuple[float, ...]
    aside: float


class TileOrder:
    """Random sequence of the tiles of a course, determined by its seed.

    Args:
        settings: Settings of the course.
    """

    def __init__(self, settings: RandomCourse) -> None:
        self._settings = settings
        self._rng = np.random.default_rng((settings.seed, 1))
        self._sizes = {
            kind: (sum(s.length for s in stretches), sum(s.step for s in stretches))
            for kind, stretches in course_tiles(settings).items()
        }
        self._x, self._z = settings.start, 0.0
        self._recent: list[str] = []

    def draw(self) -> Tile:
        """The next tile."""
        rng, settings = self._rng, self._settings
        kinds = [kind for kind in self._sizes if kind not in self._recent]
        kind = kinds[int(rng.integers(len(kinds)))]
        self._recent = [*self._recent, kind][-(BACK + AHEAD) :]
        climb = self._sizes[kind][1]
        up = -math.copysign(1.0, self._z) if abs(self._z) > _HIGH else rng.choice((-1.0, 1.0))
        step = up * settings.step * rng.uniform(0.5, 1.0) * (rng.random() < _STEP_SHARE)
        rise = up * settings.rise_deg * rng.uniform(0.3, 1.0) * (rng.random() < _RISE_SHARE)
        aside = float(rng.uniform(-_SIDE, _SIDE))
        turned = up < 0.0 if climb else bool(rng.integers(2))
        return self._place(kind, math.radians(0.0 if climb else rise), float(step), turned, aside)

    def _place(self, kind: str, rise: float, step: float, turned: bool, aside: float) -> Tile:
        """Put a tile behind the last one; a reversed tile begins with its end."""
        length, climb = self._sizes[kind]
        begin, z = self._x, self._z + step
        gain = -climb if turned else climb
        cos, sin = math.cos(rise), math.sin(rise)
        self._x = begin + length * cos - gain * sin
        self._z = z + length * sin + gain * cos
        quat = np.array(tilt(rise, 0.0))
        if turned:
            mujoco.mju_mulQuat(quat, quat.copy(), np.array([0.0, 0.0, 0.0, 1.0]))
        pos = (self._x, self._z) if turned else (begin, z)
        return Tile(kind, begin, self._x, pos, tuple(quat.tolist()), aside)


class CourseMotion:
    """Lays the tiles around the robot, once per control tick.

    Args:
        settings: Settings of the course.
    """

    def __init__(self, settings: RandomCourse) -> None:
        self._settings = settings
        self._kinds = tuple(course_tiles(settings))
        self._reset()

    def _reset(self) -> None:
        self._order = TileOrder(self._settings)
        self._tiles: list[Tile] = []
        self._across: list[float] = []  # offset of each tile to the left of the course, in m
        self._on = -1  # index of the tile that the robot is on; -1 before the first
        self._on_from, self._on_to = math.inf, -math.inf  # begin and end of that tile, in m
        self._way = (0.0, 0.0, 0.0)  # a point (m) on the robot's path, slope to the left

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, time: float) -> None:
        """Lay the missing tiles around the robot, and remove those that it has left behind.

        Args:
            model, data: The world.
            time: Robot time. In s.
        """
        if time == 0.0:  # a new episode
            self._reset()
        x, y = float(data.qpos[0]), float(data.qpos[1])
        if not self._on_from <= x < self._on_to:
            self._find_way(x, y)
            self._find_tile(x)
            self._lay(model, data)

    def _find_way(self, x: float, y: float) -> None:
        """Estimate the robot's path, from its position when tiles were last laid."""
        x0, y0, slope = self._way
        if abs(x - x0) > _SHORTEST_WAY:
            slope = min(_MOST_TURN, max(-_MOST_TURN, (y - y0) / (x - x0)))
        self._way = (x, y, slope)

    def _find_tile(self, x: float) -> None:
        tiles = self._tiles
        while len(tiles) < self._on + 2 or tiles[self._on + 1].begin <= x:
            if len(tiles) >= self._on + 2:
                self._on += 1
            else:
                tiles.append(self._order.draw())
        while self._on >= 0 and x < tiles[self._on].begin:
            self._on -= 1
        self._on_from = tiles[self._on].begin if self._on >= 0 else -math.inf
        self._on_to = tiles[self._on + 1].begin

    def _lay(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Put the tiles around the robot in place, and all others out of sight."""
        first, last = max(0, self._on - BACK), self._on + AHEAD
        while len(self._tiles) <= last:
            self._tiles.append(self._order.draw())
        x, y, slope = self._way
        for tile in self._tiles[len(self._across) : last + 1]:
            middle = 0.5 * (tile.begin + tile.end)
            self._across.append(y + slope * (middle - x) + tile.aside)
        mocap = {kind: int(model.body(_body(kind)).mocapid[0]) for kind in self._kinds}
        data.mocap_pos[list(mocap.values())] = _PARKED
        for tile, across in zip(
            self._tiles[first : last + 1], self._across[first : last + 1], strict=True
        ):
            index = mocap[tile.kind]
            data.mocap_pos[index] = tile.pos[0], across, tile.pos[1]
            data.mocap_quat[index] = tile.quat
