"""Parameters of each scene, as classes that README, ROS and experiment files share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cassie_msgs.tunables import ParameterError, from_mapping, tunable
from cassie_sim.stretches import SURFACES, Stretch, read_stretch

_GRASS, _SNOW, _SAND, _BURN = (SURFACES[name] for name in ("grass", "snow", "sand", "burn"))
_GRAVEL = SURFACES["gravel"]
_NEVER = 1e9  # s


@dataclass(frozen=True, kw_only=True)
class Flat:
    """Level, hard ground."""

    friction: float = tunable(1.0, "", 0.05, 3.0, "Coulomb friction of the ground")


@dataclass(frozen=True, kw_only=True)
class Slope(Flat):
    """Hard ground, level around the start and tilted beyond it."""

    rise_deg: float = tunable(5.0, "deg", -30.0, 30.0, "Rise ahead; negative goes down")
    side_deg: float = tunable(0.0, "deg", -30.0, 30.0, "Rise to the left")
    start: float = tunable(1.0, "m", 0.3, 50.0, "Distance ahead at which the slope begins")


@dataclass(frozen=True, kw_only=True)
class _Ahead:
    """Common parameters of scenes whose ground begins ahead of level concrete."""

    start: float = tunable(1.0, "m", 0.3, 50.0, "Distance ahead at which the ground begins")
    rise_deg: float = tunable(0.0, "deg", -30.0, 30.0, "Rise of the ground; negative goes down")
    seed: int = tunable(1, "", 0, 2**31, "Seed of random bumps, branches and heights")


@dataclass(frozen=True, kw_only=True)
class Grass(_Ahead):
    """Soft and uneven ground."""

    friction: float = tunable(_GRASS.friction, "", 0.05, 3.0, "Coulomb friction")
    sinking: float = tunable(
        _GRASS.sinking, "m", 0.0, 0.06, "Depth to which a foot with the weight sinks"
    )
    uneven: float = tunable(_GRASS.uneven, "m", 0.0, 0.05, "Height of bumps and depth of hollows")


@dataclass(frozen=True, kw_only=True)
class Snow(_Ahead):
    """Compacted snow: slippery and a little soft."""

    friction: float = tunable(_SNOW.friction, "", 0.05, 3.0, "Coulomb friction")
    sinking: float = tunable(
        _SNOW.sinking, "m", 0.0, 0.06, "Depth to which a foot with the weight sinks"
    )
    uneven: float = tunable(_SNOW.uneven, "m", 0.0, 0.05, "Height of bumps and depth of hollows")


@dataclass(frozen=True, kw_only=True)
class WaxedFloor:
    """A level, waxed floor everywhere, with pillars or without."""

    friction: float = tunable(0.25, "", 0.05, 3.0, "Coulomb friction")


@dataclass(frozen=True, kw_only=True)
class Sand(_Ahead):
    """Loose sand. Heel and toe of a foot sink in separately."""

    friction: float = tunable(_SAND.friction, "", 0.05, 3.0, "Coulomb friction")
    sinking: float = tunable(
        _SAND.sinking, "m", 0.0, 0.15, "Depth to which a bare foot with the weight sinks"
    )
    heel_dig: float = tunable(0.0, "m", 0.0, 0.3, "Additional depth to which the heel sinks")
    uneven: float = tunable(_SAND.uneven, "m", 0.0, 0.05, "Height of bumps and depth of hollows")
    shoes: bool = tunable(False, description="Tennis shoes: soles of 0.12 m width")


@dataclass(frozen=True, kw_only=True)
class Debris(_Ahead):
    """Burnt ground with branches that lie across the path."""

    friction: float = tunable(_BURN.friction, "", 0.05, 3.0, "Coulomb friction")
    branches: float = tunable(_BURN.branches, "1/m", 0.0, 20.0, "Number of branches per metre")
    branch_low: float = tunable(0.02, "m", 0.005, 0.1, "Diameter of the thinnest branch")
    branch_high: float = tunable(0.04, "m", 0.005, 0.1, "Diameter of the thickest branch")


@dataclass(frozen=True, kw_only=True)
class Step(Flat):
    """Level ground with one step that is unknown to the robot."""

    height: float = tunable(-0.05, "m", -0.3, 0.3, "Height of the step; negative goes down")
    start: float = tunable(1.5, "m", 0.3, 50.0, "Distance ahead at which the step is")


@dataclass(frozen=True, kw_only=True)
class Rough(Flat):
    """Hard ground of random height, level around the start."""

    height: float = tunable(0.03, "m", 0.0, 0.15, "Standard deviation of the height")
    grain: float = tunable(0.4, "m", 0.1, 5.0, "Distance over which the height changes")
    start: float = tunable(1.0, "m", 0.3, 10.0, "Distance ahead at which the rough ground begins")
    length: float = tunable(20.0, "m", 1.0, 60.0, "Length of the rough ground; level beyond that")
    seed: int = tunable(1, "", 0, 2**31, "Seed of the heights")


@dataclass(frozen=True, kw_only=True)
class Gravel(_Ahead):
    """Hard, fine-grained ground of random height, like fixed stones."""

    friction: float = tunable(_GRAVEL.friction, "", 0.05, 3.0, "Coulomb friction")
    rough: float = tunable(_GRAVEL.rough, "m", 0.0, 0.05, "Standard deviation of the height")
    grain: float = tunable(
        _GRAVEL.grain, "m", 0.02, 0.5, "Distance over which the height changes, a stone's size"
    )


@dataclass(frozen=True, kw_only=True)
class Pillar(Flat):
    """Level ground with a pillar to bump into."""

    x: float = tunable(2.5, "m", 0.5, 50.0, "Distance of the pillar's axis ahead of the start")
    y: float = tunable(0.4, "m", -20.0, 20.0, "Distance of the pillar's axis to the left")
    radius: float = tunable(0.2, "m", 0.02, 2.0, "Radius of the pillar")


@dataclass(frozen=True, kw_only=True)
class Block(Flat):
    """A block under one foot, there from the beginning or lifted while the robot stands."""

    height: float = tunable(0.05, "m", 0.0, 0.3, "Height of the block's top above the ground")
    side: str = tunable("left", choices=("left", "right"), description="Foot on the block")
    start: float = tunable(8.0, "s", 0.0, None, "Time at which the block begins to rise")
    rate: float = tunable(
        0.0, "m/s", 0.0, 1.0, "Speed at which the block rises; 0: at full height from the start"
    )


@dataclass(frozen=True, kw_only=True)
class Tilting(Flat):
    """Ground that tilts slowly under the robot."""

    rise_deg: float = tunable(5.0, "deg", -30.0, 30.0, "Final rise ahead")
    side_deg: float = tunable(0.0, "deg", -30.0, 30.0, "Final rise to the left")
    start: float = tunable(8.0, "s", 0.0, None, "Time at which the ground begins to tilt")
    rate_deg: float = tunable(
        1.0, "deg/s", 0.01, 30.0, "Rate of the larger one of `rise_deg` and `side_deg`"
    )


@dataclass(frozen=True, kw_only=True)
class Segway(Flat):
    """Ground with a Segway below the robot."""

    surface: str = tunable(
        "floor", choices=("floor", "sidewalk", "grass"), description="Ground under the Segway"
    )
    softness: float = tunable(1.0, "", 0.2, 5.0, "Factor by which the balance gains are reduced")
    let_go: float = tunable(
        _NEVER, "s", 0.0, None, "Time at which the bar is released, unless commanded earlier"
    )
    take_hold: float = tunable(_NEVER, "s", 0.0, None, "Time at which the bar is held again")
    length: float = tunable(
        400.0, "m", 10.0, 1000.0, "Length of the uneven ground; level beyond that"
    )
    seed: int = tunable(1, "", 0, 2**31, "Seed of the bumps")

    def __post_init__(self) -> None:
        """Check that the bar is not taken before it is released.

        Raises:
            ParameterError: if it is; the message has both times.
        """
        if self.take_hold < self.let_go < _NEVER:
            raise ParameterError(
                f"take_hold = {self.take_hold:g} s is before let_go = {self.let_go:g} s"
            )


@dataclass(frozen=True)
class Course:
    """Consecutive stretches of ground, and pillars.

    Attributes:
        stretches: Stretches in order; the first one begins behind the robot.
        pillars: Pillars, each as in the scene pillar, without friction.
        seed: Seed of bumps and branches.
        shoes: Whether the robot wears shoes.
    """

    stretches: tuple[Stretch, ...] = (Stretch(),)
    pillars: tuple[Pillar, ...] = ()
    seed: int = 1
    shoes: bool = False


@dataclass(frozen=True, kw_only=True)
class CourseSettings:
    """The plain parameters of a course."""

    seed: int = tunable(1, "", 0, 2**31, "Seed of random bumps, branches and heights")
    shoes: bool = tunable(False, description="Tennis shoes: soles of 0.12 m width")


def read_course(mapping: Mapping[str, Any]) -> Course:
    """A course from a mapping as YAML gives it.

    Raises:
        ParameterError: naming the key, its value and the permitted values.
    """
    plain = {key: mapping[key] for key in mapping if key not in ("stretches", "pillars")}
    settings = from_mapping(CourseSettings, plain)
    stretches = [
        read_stretch(entry, f"stretches.{index}")
        for index, entry in enumerate(_list(mapping, "stretches"))
    ]
    pillars = []
    for index, entry in enumerate(_list(mapping, "pillars")):
        try:
            pillars.append(from_mapping(Pillar, entry))
        except ParameterError as error:
            raise ParameterError(f"pillars.{index}: {error}") from None
    if not stretches:
        raise ParameterError("stretches must be given: a list of {surface, length, ...}")
    return Course(tuple(stretches), tuple(pillars), settings.seed, settings.shoes)


def _list(mapping: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    entries = mapping.get(key) or []
    if not isinstance(entries, list) or not all(isinstance(e, Mapping) for e in entries):
        raise ParameterError(f"{key} = {entries!r} is not a list of mappings")
    return entries
