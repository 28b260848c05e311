"""Mappings as typed configurations: what they become, the way back, and refusals with paths."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from cassie_msgs.experiment.file import Experiment, read_experiment, to_yaml
from cassie_msgs.experiment.scenario import Draw
from cassie_msgs.strict_yaml import parse_yaml
from cassie_msgs.structured import structure, unstructure
from cassie_msgs.tunables import ParameterError, as_mapping, tunable


@dataclass(frozen=True, kw_only=True)
class Wheel:
    radius: float = tunable(dataclasses.MISSING, "m", 0.1, 1.0, "Radius")
    spokes: int = tunable(8, "", 1, 99, "How many")


@dataclass(frozen=True, kw_only=True)
class Cart:
    name: str = tunable("cart")
    load: float | None = tunable(None, "kg", 0.0, 50.0, "Load")
    force: tuple[float, float] = tunable((0.0, 0.0), "N", -9.0, 9.0, "Pull")
    wheels: tuple[Wheel, ...] = ()
    spare: Wheel | None = None
    lamps: Mapping[str, Wheel] = field(default_factory=dict, metadata={"known": ("left", "right")})
    rest: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.wheels) == 1:
            raise ParameterError("one wheel is too few")


FULL = {
    "name": "x",
    "load": 3,
    "force": [1, 2.5],
    "wheels": [{"radius": 0.5}, {"radius": 1, "spokes": 9}],
    "spare": {"radius": 0.2},
    "lamps": {"left": {"radius": 0.1}},
    "rest": {"any": [1, {"thing": True}]},
}


def test_a_mapping_becomes_what_the_annotations_say():
    cart = structure(Cart, FULL)
    assert cart.force == (1.0, 2.5) and cart.load == 3.0 and isinstance(cart.load, float)
    assert cart.wheels == (Wheel(radius=0.5), Wheel(radius=1.0, spokes=9))
    assert cart.spare == Wheel(radius=0.2) and cart.lamps["left"].radius == 0.1
    assert cart.rest == {"any": [1, {"thing": True}]}
    assert structure(Cart, None) == structure(Cart, {}) == Cart()
    assert structure(Cart, {"wheels": None, "load": None, "spare": None}) == Cart()


@pytest.mark.parametrize("content", [FULL, {}, {"load": 0.1 + 0.2}])
def test_what_is_written_is_read_as_the_same(content):
    cart = structure(Cart, content)
    assert structure(Cart, unstructure(cart)) == cart


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"nam": "x"}, "^unknown key nam: did you mean name"),
        (
            {"wheels": [{"radius": 0.5}, {"radius": 3}]},
            r"^wheels\.1\.radius = 3 m is outside 0",
        ),
        (
            {"wheels": [{"radius": 0.5}, {}]},
            r"^wheels\.1\.radius must be given \(0\.1 \.\. 1 m\)",
        ),
        (
            {"wheels": [{"radius": 0.5, "spoke": 1}]},
            r"^wheels\.0: unknown key spoke: did you mean",
        ),
        ({"wheels": [{"radius": 0.5}]}, "^one wheel is too few"),
        ({"wheels": {}}, "^wheels = {} is not a list"),
        ({"wheels": [None, None]}, r"^wheels\.0 = None is not a mapping"),
        ({"spare": {"radius": "big"}}, r"^spare\.radius = 'big' is not a number"),
        ({"spare": {"radius": True}}, r"^spare\.radius = True is not a number"),
        ({"spare": {"radius": 0.5, "spokes": 1.5}}, r"^spare\.spokes = 1\.5 is not a whole number"),
        ({"lamps": {"lft": {"radius": 1}}}, "^lamps: unknown key lft: did you mean left"),
        ({"lamps": {"left": {"radius": 2}}}, r"^lamps\.left\.radius = 2 m is outside"),
        ({"force": [1, float("nan")]}, r"^force\[1\] = nan N is outside"),
        ({"load": 60}, r"^load = 60 kg is outside 0 \.\. 50 kg"),
        ({"name": None}, "^name = None is not a word"),
        ({"rest": 3}, "^rest = 3 is not a mapping"),
        ([1], r"\[1\] is not a mapping"),
    ],
)
def test_a_refusal_names_path_value_and_range(content, message):
    with pytest.raises(ParameterError, match=message):
        structure(Cart, content)


def test_an_experiment_is_the_same_after_it_was_written():
    content = {
        "duration": 3,
        "seed": 5,
        "gantry": [{"t": 2, "hold": 1.0}, {"t": 1, "release": True}],
        "operator": [{"t": 0.1 + 0.2, "mode": "walk", "trims": [0, 0.01, 0, 0]}],
        "rider": {"targets": [{"t": 0, "gates": {"count": 3}}]},
        "controller": {"walk": {"law": "paper"}, "walk.hold_gain": 0.0},
        "expect": {"fell": None, "phases": [{"t0": 1, "t1": 2, "vx": {"max": 0.1}}]},
    }
    experiment = structure(Experiment, content)
    assert experiment.draw == Draw.from_seed(5)
    assert [move.t for move in experiment.gantry] == [1.0, 2.0]
    assert experiment.controller == {"walk.law": "paper", "walk.hold_gain": 0.0}
    assert structure(Experiment, parse_yaml(to_yaml(experiment), "f")) == experiment


def test_what_a_file_fixes_is_not_drawn_and_what_is_drawn_stays():
    fixed = structure(Experiment, {"seed": 5, "draw": {"mass": 1.1}}).draw
    assert as_mapping(fixed) == as_mapping(Draw.from_seed(5)) | {"mass": 1.1}
    assert structure(Experiment, {"seed": 5, "drawn": True, "draw": {"mass": 1.1}}).draw == Draw(
        mass=1.1
    )


def test_a_file_names_itself_and_the_key_that_it_lacks(tmp_path):
    path = tmp_path / "e.yaml"
    path.write_text("scene: flat")
    assert read_experiment(path).operator == ()
    with pytest.raises(ParameterError, match=r"e\.yaml: operator must be given"):
        read_experiment(path, needs=("operator",))
    path.write_text("operator: [{t: 0, vx: 9}]")
    with pytest.raises(ParameterError, match=r"e\.yaml: operator\.0\.vx = 9 m/s is outside -1\.3 "):
        read_experiment(path)
