"""Scenarios: strict reading, and robots drawn from seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Draw, Scenario
from cassie_msgs.tunables import ParameterError, as_mapping, check

TWO_DEGREES = math.radians(2.0)


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"scen": "flat"}, "unknown key scen: did you mean scene"),
        ({"start": "gantri"}, "start = 'gantri' is not one of gantry, standing"),
        ({"draw": {"masss": 1.0}}, "draw: unknown key masss: did you mean mass"),
        ({"draw": {"mass": 3.0}}, r"draw.mass = 3 is outside 0.5 \.\. 1.5"),
        (
            {"draw": {"torque_constant": [1.0, 1.0]}},
            "torque_constant = .* not a list of 10 numbers",
        ),
        ({"draw": 3}, "draw = 3 is not a mapping"),
        ({"scene_parameters": [1]}, r"scene_parameters = \[1\] is not a mapping"),
        ({"delays": {"torque": 1.0}}, r"delays.torque = 1 s is outside 0 \.\. 0.1 s"),
        ({"model": {"sprng": 1.0}}, "model: unknown key sprng: did you mean spring"),
        ({"pushes": {"t": 1.0}}, "pushes = .* is not a list"),
        ({"pushes": [3]}, r"pushes\.0 = 3 is not a mapping"),
        ({"pushes": [{"t": 1.0}]}, r"pushes\.0\.force must be given"),
        ({"pushes": [{"t": 1.0, "force": [1.0]}]}, r"pushes\.0\.force = .* list of 3 numbers"),
        ({"gantry": [{"t": 1.0, "heigth": 1}]}, r"gantry\.0: unknown key heigth: did you mean"),
        ({"gantry": [{"t": math.nan, "release": True}]}, r"gantry\.0\.t = nan s is outside"),
        ({"faults": [{"t": 0.0, "channel": "power", "kind": "of"}]}, r"faults\.0\.kind = 'of'"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(mapping, message):
    with pytest.raises(ParameterError, match=message):
        Scenario.from_mapping(mapping)


def test_empty_mapping_is_the_nominal_robot_on_the_gantry():
    scenario = Scenario.from_mapping({})
    assert scenario == Scenario()
    assert (scenario.scene, scenario.start, scenario.draw) == ("flat", "gantry", Draw())


def test_sections_and_events_arrive():
    scenario = Scenario.from_mapping(
        {
            "scene": "slope",
            "scene_parameters": {"rise_deg": 5},
            "start": "standing",
            "draw": {"mass": 1.01},
            "delays": {"set_point": 0.01},
            "model": {"mass": 1.1},
            "pushes": [
                {"t": 5, "force": [1, 2, 3]},
                {"t": 2, "force": [0, 0, 9], "body": "left_toe"},
            ],
            "gantry": [{"t": 2.0, "action": "release"}],
            "faults": [{"t": 1, "channel": "drive_position.3", "kind": "stuck"}],
        }
    )
    assert scenario.scene_parameters == {"rise_deg": 5}
    assert (scenario.draw.mass, scenario.delays.set_point, scenario.model.mass) == (1.01, 0.01, 1.1)
    assert [push.t for push in scenario.pushes] == [2.0, 5.0]
    assert scenario.pushes[1].force == (1.0, 2.0, 3.0)
    assert scenario.gantry[0].action == "release"
    assert scenario.faults[0].channel == "drive_position.3"


def test_a_seed_is_always_the_same_robot_and_another_seed_another():
    assert Draw.from_seed(7) == Draw.from_seed(7)
    assert Draw.from_seed(7) != Draw.from_seed(8)


def test_drawn_robots_keep_and_fill_their_ranges():
    draws = [Draw.from_seed(seed) for seed in range(1, 301)]
    for draw in draws:
        check(draw)
    for values, low, high in (
        ([draw.initial_yaw for draw in draws], -TWO_DEGREES, TWO_DEGREES),
        ([draw.joint_offset for draw in draws], -TWO_DEGREES, TWO_DEGREES),
        ([draw.torque_constant for draw in draws], 0.97, 1.03),
        ([draw.mass for draw in draws], 0.98, 1.02),
        ([draw.friction for draw in draws], 0.9, 1.1),
    ):
        assert low <= np.min(values) < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < np.max(values) <= high
    biases = np.array([draw.attitude_bias for draw in draws])
    np.testing.assert_allclose(biases.std(axis=0), math.radians(0.3), rtol=0.2)


def test_a_drawn_robot_can_be_written_down_and_read_again():
    draw = Draw.from_seed(11)
    assert Scenario.from_mapping({"draw": as_mapping(draw)}).draw == draw
