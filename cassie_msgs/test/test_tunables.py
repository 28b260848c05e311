"""Tunables: what passes, what is refused, and in which words."""

from dataclasses import MISSING, dataclass, field

import pytest

from cassie_msgs.tunables import (
    ParameterError,
    as_mapping,
    check,
    entries,
    flatten,
    from_mapping,
    names,
    replace_checked,
    tunable,
    unknown_name,
)


@dataclass(frozen=True, kw_only=True)
class Gains:
    kp_knee: float = tunable(200.0, "Nm/rad", 0, 2000, "stiffness of the knee")
    steps: int = tunable(2, "", 1, 9, "steps")
    weights: tuple[float, float] = tunable((0.0, 1.0), "m", -1, 1, "weights")
    lag: float = tunable(0.0, "s", 0.0, None, "lag")


@dataclass(frozen=True, kw_only=True)
class Config:
    rate: float = tunable(MISSING, "Hz", 1, 2000, "control rate", live=False)
    grade: str = tunable("faithful", choices=("ideal", "faithful"), description="sensors")
    video: bool = tunable(False, description="write a video")
    gains: Gains = field(default_factory=Gains)


GOOD = {"rate": 500, "gains": {"kp_knee": 300}, "gains.weights": [1, -1]}


def test_mapping_there_and_back():
    config = from_mapping(Config, GOOD)
    assert config == from_mapping(Config, as_mapping(config))
    assert config.gains == Gains(kp_knee=300.0, weights=(1.0, -1.0))
    assert isinstance(config.rate, float)


def test_entries_carry_dotted_names_and_units():
    table = {entry.name: entry for entry in entries(from_mapping(Config, GOOD))}
    assert list(table) == names(Config)
    assert table["gains.kp_knee"].spec.unit == "Nm/rad"
    assert table["gains.weights"].length == 2
    assert not table["rate"].spec.live


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gains.kp_knee": 9000}, r"kp_knee = 9000 Nm/rad is outside 0 \.\. 2000 Nm/rad"),
        ({"gains.kp_knee": float("nan")}, "kp_knee = nan Nm/rad is outside"),
        ({"rate": float("inf")}, "rate = inf Hz is outside"),
        ({"rate": 10**400}, r"rate = inf Hz is outside 1 \.\. 2000 Hz$"),
        ({"gains.steps": -(10**400)}, r"steps = -10+\.\.\.0+ is outside"),
        ({"gains.lag": float("inf")}, r"lag = inf s is outside 0 \.\. inf s: it is not finite"),
        ({"gains.lag": 10**400}, r"lag = inf s is outside 0 \.\. inf s: it is not finite"),
        ({"gains.steps": 2.5}, "steps = 2.5 is not a whole number"),
        ({"gains.steps": True}, "steps = True is not a whole number"),
        ({"gains.weights": [0, 0, 0]}, "is not a list of 2 numbers"),
        ({"gains.weights": [0, 2]}, r"weights\[1\] = 2 m is outside -1 \.\. 1 m"),
        ({"gains.weights": 3}, "is not a list of 2 numbers"),
        ({"grade": "perfect"}, "grade = 'perfect' is not one of ideal, faithful"),
        ({"video": 1}, "video = 1 is not true or false"),
        ({"rate": "fast"}, "rate = 'fast' is not a number"),
        ({"gains.kp_nee": 3}, r"unknown parameter gains.kp_nee: did you mean gains.kp_knee\?"),
    ],
)
def test_bad_values_are_refused_by_name(change, message):
    with pytest.raises(ParameterError, match=message):
        from_mapping(Config, flatten(GOOD) | change)
    with pytest.raises(ParameterError, match=message):
        replace_checked(from_mapping(Config, GOOD), **change)


@dataclass(frozen=True, kw_only=True)
class Range:
    low: float = tunable(0.0, "m", -9, 9, "lower end")
    high: float = tunable(1.0, "m", -9, 9, "upper end")

    def __post_init__(self):
        if self.low > self.high:
            raise ParameterError(f"low = {self.low:g} is above high = {self.high:g}")


@dataclass(frozen=True, kw_only=True)
class Ranges:
    reach: Range = field(default_factory=Range)


@pytest.mark.parametrize("value", ["wide", [1.0], True, float("nan"), None])
def test_types_are_checked_before_a_class_compares_its_fields(value):
    with pytest.raises(ParameterError, match=r"^low = "):
        replace_checked(Range(), low=value)
    for changed in (from_mapping, lambda cls, given: replace_checked(cls(), **flatten(given))):
        with pytest.raises(ParameterError, match=r"^reach\.low = "):
            changed(Ranges, {"reach": {"low": value}})


@pytest.mark.parametrize("value", [300, 301])
def test_a_figure_given_nested_and_with_dots_is_refused(value):
    given = {**GOOD, "gains.kp_knee": value}
    with pytest.raises(ParameterError, match=f"gains.kp_knee is given twice: 300 and {value}"):
        from_mapping(Config, given)


@pytest.mark.parametrize("empty", [{"gains": {"kp_knee": {}}}, {"gains.kp_knee": {}}])
def test_an_empty_mapping_is_no_value_but_an_empty_group_is_one(empty):
    with pytest.raises(ParameterError, match=r"gains.kp_knee = \{\} is a mapping"):
        from_mapping(Config, {"rate": 500, **empty})
    assert from_mapping(Config, {"rate": 500, "gains": {}}).gains == Gains()


def test_a_figure_without_default_must_be_given():
    with pytest.raises(ParameterError, match=r"rate must be given \(1 \.\. 2000 Hz\)"):
        from_mapping(Config, {})


def test_check_looks_into_nested_configurations():
    with pytest.raises(ParameterError, match=r"gains\.kp_knee = -1"):
        check(Config(rate=500.0, gains=Gains(kp_knee=-1.0)))


def test_an_unknown_name_is_answered_with_the_nearest_one_or_with_what_there_is():
    many = [f"{group}.gain_{index}" for group in ("walk", "stand") for index in range(99)]
    assert unknown_name("walk.gian_7", many, "parameter").endswith("did you mean walk.gain_7?")
    assert unknown_name("zz", [*many, "law"], "parameter") == (
        "unknown parameter zz: known groups: law, stand, walk"
    )
    assert unknown_name("zz", ["b", "a"], "row") == "unknown row zz: known: a, b"
