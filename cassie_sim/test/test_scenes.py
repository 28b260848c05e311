"""Scenes: names, ground heights, friction that counts."""

from __future__ import annotations

import dataclasses
import math
import re

import mujoco
import numpy as np
import pytest

from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.tunables import ParameterError
from cassie_sim.errors import SimulationError
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig
from cassie_sim.poses import height_over_ground, lowest_sole, set_drives
from cassie_sim.scenes import SCENES, scene_motion, scene_spec
from cassie_sim.stairs import Stairs, stairs_stretches


def ground_height(model: mujoco.MjModel, x: float, y: float = 0.0) -> float:
    """Height of the ground above the world's origin, from a ray straight down. In m."""
    data = mujoco.MjData(model)
    data.qpos[:3] = (-20.0, -20.0, 2.0)  # the robot out of the way
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    start = np.array([x, y, 20.0])
    distance = mujoco.mj_ray(model, data, start, np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
    assert distance > 0.0
    return 20.0 - float(distance)


def test_unknown_scene_names_the_nearest():
    with pytest.raises(SimulationError, match="unknown scene slop: did you mean slope"):
        scene_spec("slop", {})


def test_unknown_parameter_names_the_nearest():
    with pytest.raises(ParameterError, match="unknown parameter rise_dge: did you mean rise_deg"):
        scene_spec("slope", {"rise_dge": 5.0})


def test_branches_thinner_than_the_thinnest_are_named():
    message = r"debris: branch_low = 0.05 m is above branch_high = 0.04 m"
    with pytest.raises(ParameterError, match=message):
        scene_spec("debris", {"branch_low": 0.05})


def test_parameter_out_of_range_names_value_and_range():
    with pytest.raises(ParameterError, match=r"rise_deg = 45 deg is outside -30 .. 30 deg"):
        scene_spec("slope", {"rise_deg": 45.0})


@pytest.mark.parametrize(
    ("scene", "parameters", "message"),
    [
        ("stairs", {"riser": 0.9}, "scene_parameters.riser = 0.9 m is outside 0 .. 0.25 m"),
        ("stairs", {"riser": "high"}, "scene_parameters.riser = 'high' is not a number"),
        (
            "stairs",
            {"risers": 0.1},
            "scene_parameters: unknown parameter risers: did you mean riser?",
        ),
        (
            "course",
            {},
            "scene_parameters.stretches must be given: a list of {surface, length, ...}",
        ),
        (
            "course",
            {"stretches": [{"step": 1.0}]},
            "scene_parameters.stretches.0: step = 1 m is out",
        ),
        (
            "segway",
            {"let_go": 5, "take_hold": 3},
            "scene_parameters.take_hold = 3 s is before let_go",
        ),
    ],
)
def test_a_wrong_parameter_is_named_with_its_path_in_an_experiment(scene, parameters, message):
    with pytest.raises(ParameterError, match=f"^{re.escape(message)}"):
        scene_spec(scene, parameters)


def test_treads_of_stairs_differ_in_their_colour_alone():
    parameters = {"number": 3, "riser": 0.1}
    stairs = scene_spec("stairs", parameters).compile()
    stretches = [dataclasses.asdict(each) for each in stairs_stretches(Stairs(**parameters))]
    course = scene_spec("course", {"stretches": stretches, "seed": 0}).compile()
    treads = [stairs.geom(f"stretch_{i}") for i in range(1, 4)]
    assert treads[0].rgba.tolist() != treads[1].rgba.tolist()
    assert treads[0].rgba.tolist() == treads[2].rgba.tolist()
    for name in ("geom_pos", "geom_size", "geom_friction", "geom_solref", "geom_contype"):
        np.testing.assert_array_equal(getattr(stairs, name), getattr(course, name))


def test_a_bar_may_be_taken_at_a_time_while_its_release_is_commanded():
    scene_spec("segway", {"take_hold": 3.0})
    scene_spec("segway", {"let_go": 3.0, "take_hold": 5.0})


def test_flat_ground_is_at_zero():
    model = scene_spec("flat", {}).compile()
    for x, y in ((0.0, 0.0), (10.0, -3.0), (-5.0, 7.0)):
        assert ground_height(model, x, y) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("angle", [5.0, 12.0, -8.0])
@pytest.mark.parametrize("start", [1.0, 3.0])
def test_slope_is_level_first_and_then_rises_ahead(angle, start):
    model = scene_spec("slope", {"rise_deg": angle, "start": start}).compile()
    rise = math.tan(math.radians(angle))
    for x in (-2.0, 0.0, start - 0.01):
        assert ground_height(model, x) == pytest.approx(0.0, abs=1e-6)
    for x in (start + 0.01, start + 1.0, start + 10.0):
        assert ground_height(model, x, 2.0) == pytest.approx(rise * (x - start), abs=1e-6)


@pytest.mark.parametrize(("angle", "side"), [(0.0, 6.0), (0.0, -4.0), (5.0, 6.0)])
def test_slope_to_the_side_rises_to_the_left(angle, side):
    model = scene_spec("slope", {"rise_deg": angle, "side_deg": side}).compile()
    assert ground_height(model, 0.0) == pytest.approx(0.0, abs=1e-6)
    assert math.copysign(1.0, ground_height(model, 0.0, 1.0)) == math.copysign(1.0, side)
    across = ground_height(model, 0.0, 1.0) - ground_height(model, 0.0, -1.0)
    ahead = ground_height(model, 1.0) - ground_height(model, -1.0)
    assert across / 2.0 == pytest.approx(
        math.tan(math.radians(side)) / math.cos(math.radians(angle)), rel=0.01
    )
    assert ahead / 2.0 == pytest.approx(math.tan(math.radians(angle)), abs=1e-6)


@pytest.mark.parametrize("friction", [0.2, 0.7, 1.8])
@pytest.mark.parametrize("scene", ["flat", "slope"])
def test_friction_of_the_ground_counts_not_that_of_the_foot(scene, friction):
    model = scene_spec(scene, {"friction": friction}).compile()
    data = mujoco.MjData(model)
    set_drives(model, data, [0.0, 0.0, 0.5, -1.15, -1.6] * 2)
    mujoco.mj_kinematics(model, data)
    data.qpos[2] -= lowest_sole(model, data) + 0.002
    mujoco.mj_forward(model, data)
    assert data.ncon == 4
    for contact in data.contact:
        assert contact.friction[0] == pytest.approx(friction)


EVERY_SCENE = [
    ("flat", {}),
    ("slope", {"rise_deg": -10.0}),
    ("slope", {"side_deg": 8.0, "rise_deg": 0.0}),
    ("grass", {"rise_deg": 5.0}),
    ("snow", {}),
    ("waxed_floor", {}),
    ("sand", {"heel_dig": 0.1, "shoes": True}),
    ("debris", {}),
    ("step", {"height": -0.1}),
    ("rough", {}),
    ("gravel", {"rise_deg": -5.0}),
    ("stairs", {"way": "down_and_up"}),
    ("random_course", {}),
    ("pillar", {}),
    ("block", {"side": "right"}),
    ("segway", {"softness": 2.0}),
    ("tilting", {}),
    (
        "course",
        {
            "stretches": [{"length": 2.0}, {"surface": "grass", "rise_deg": 5.0}],
            "pillars": [{"x": 3.0, "y": 1.0}],
        },
    ),
]


def test_no_scene_is_left_out_of_the_tests():
    assert {name for name, _ in EVERY_SCENE} == set(SCENES)


@pytest.mark.parametrize(("scene", "parameters"), EVERY_SCENE)
def test_a_robot_placed_in_a_scene_touches_its_ground_and_is_not_inside_it(scene, parameters):
    plant = Plant(
        PlantConfig(sensors="ideal"),
        Scenario(scene=scene, scene_parameters=parameters, start="standing"),
    )
    mujoco.mj_kinematics(plant.model, plant.data)
    assert height_over_ground(plant.model, plant.data) == pytest.approx(0.0, abs=1e-9)
    assert all(contact.dist > -1e-3 for contact in plant.data.contact)
    for _ in range(50):
        plant.step(None)
    assert np.isfinite(plant.data.qpos).all()


@pytest.mark.parametrize("scene", sorted(SCENES))
def test_every_scene_refuses_what_it_does_not_know(scene):
    with pytest.raises(ParameterError, match="unknown parameter fricton"):
        scene_spec(scene, {"fricton": 0.5, **({"stretches": [{}]} if scene == "course" else {})})


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, "stretches must be given"),
        ({"stretches": 3}, "stretches = 3 is not a list of mappings"),
        (
            {"stretches": [{"surface": "gras"}]},
            "stretches.0: unknown surface gras: did you mean gr",
        ),
        ({"stretches": [{}, {"lenght": 3}]}, "stretches.1: unknown parameter lenght: did you mean"),
        ({"stretches": [{"surface": ["grass"]}]}, "stretches.0: unknown surface"),
        ({"stretches": [{"lenght": {}}]}, "unknown parameter lenght: did you mean length"),
        ({"stretches": [{"step": 1.0}]}, r"stretches.0: step = 1 m is outside -0.3 .. 0.3 m"),
        ({"stretches": [{"branch_low": 0.05}]}, "branch_low = 0.05 m is above branch_high"),
        ({"stretches": [{"surface": "grass", "rough": 0.02}]}, "soft ground cannot be rough"),
        ({"stretches": [{"surface": "gravel", "sinking": 0.02}]}, "rough = 0.008 m with sinking"),
        ({"stretches": [{}], "pillars": [{"radius": 0}]}, "pillars.0: radius = 0 m is outside"),
        ({"stretches": [{}], "sed": 3}, "unknown parameter sed: did you mean seed"),
    ],
)
def test_what_is_wrong_in_a_course_is_named(parameters, message):
    with pytest.raises(ParameterError, match=message):
        scene_spec("course", parameters)


def test_the_stretches_of_a_course_lie_end_to_end():
    stretches = [
        {"length": 3.0},
        {"length": 4.0, "rise_deg": 10.0},
        {"length": 2.0, "step": -0.1},
        {"surface": "sand", "length": 5.0, "uneven": 0.0},
    ]
    model = scene_spec("course", {"stretches": stretches}).compile()
    top = 4.0 * math.sin(math.radians(10.0))
    x = 3.0 + 4.0 * math.cos(math.radians(10.0))
    for where, height in (
        (-20.0, 0.0),
        (2.99, 0.0),
        (x - 0.01, top),
        (x + 0.05, top - 0.1),
        (x + 6.9, top - 0.1),
    ):
        assert ground_height(model, where) == pytest.approx(height, abs=3e-3)


@pytest.mark.parametrize("height", [-0.1, 0.05])
def test_a_step_has_its_height_where_it_is(height):
    model = scene_spec("step", {"height": height, "start": 2.0}).compile()
    assert ground_height(model, 1.99) == pytest.approx(0.0, abs=1e-9)
    assert ground_height(model, 2.01) == pytest.approx(height, abs=1e-9)
    assert ground_height(model, 30.0) == pytest.approx(height, abs=1e-9)


def heights(scene, parameters, x0=1.2, x1=9.0):
    """Heights along three lines. Shape (n,), in m."""
    model = scene_spec(scene, {"start": 1.0, **parameters}).compile()
    return np.array(
        [ground_height(model, x, y) for x in np.arange(x0, x1, 0.07) for y in (-0.4, 0.0, 0.4)]
    )


def test_grass_is_uneven_by_its_figure_and_the_same_for_a_seed():
    one = heights("grass", {"uneven": 0.02, "seed": 3})
    assert one.min() == pytest.approx(-0.02, abs=1e-3)
    assert 0.005 < one.max() < 0.03
    assert one.std() > 0.005
    np.testing.assert_array_equal(one, heights("grass", {"uneven": 0.02, "seed": 3}))
    assert np.abs(one - heights("grass", {"uneven": 0.02, "seed": 4})).max() > 0.01


def test_rough_ground_has_its_standard_deviation_and_is_level_at_the_start():
    field = heights("rough", {"height": 0.03, "grain": 0.3}, 1.6, 14.0)
    assert field.std() == pytest.approx(0.03, rel=0.4)
    level = heights("rough", {"height": 0.03}, -3.0, 0.99)
    assert np.abs(level).max() < 1e-9


@pytest.mark.parametrize("scene", ["rough", "gravel"])
def test_beside_a_field_of_random_heights_the_ground_is_level(scene):
    model = scene_spec(scene, {}).compile()
    for y in (-19.0, -4.5, 4.5, 19.0):
        assert ground_height(model, 6.0, y) == pytest.approx(0.0, abs=1e-9)


def test_gravel_has_its_standard_deviation_and_is_finer_than_rough_ground():
    field = heights("gravel", {"rough": 0.01, "grain": 0.06}, 1.6, 14.0)
    assert field.std() == pytest.approx(0.01, rel=0.3)
    model = scene_spec("gravel", {"rough": 0.01, "grain": 0.06}).compile()
    line = np.array([ground_height(model, x) for x in np.arange(3.0, 6.0, 0.01)])
    level = line - line.mean()
    assert abs(np.mean(level[:-12] * level[12:])) < 0.5 * level.var()
    assert np.mean(level[:-1] * level[1:]) > 0.7 * level.var()


def test_gravel_among_other_ground_meets_it_level():
    stretches = [
        {"length": 2.0},
        {"surface": "gravel", "length": 3.0, "rise_deg": 5.0},
        {"surface": "gravel", "length": 3.0},
        {"length": 2.0},
    ]
    model = scene_spec("course", {"stretches": stretches}).compile()
    x, z = 2.0 + 3.0 * math.cos(math.radians(5.0)), 3.0 * math.sin(math.radians(5.0))
    for where, height in ((2.0, 0.0), (x, z), (x + 3.0, z), (x + 4.0, z)):
        assert ground_height(model, where - 0.002) == pytest.approx(height, abs=2e-3)
        assert ground_height(model, where + 0.002) == pytest.approx(height, abs=2e-3)


def test_a_robot_may_begin_on_gravel():
    model = scene_spec("course", {"stretches": [{"surface": "gravel"}]}).compile()
    assert ground_height(model, -2.0) == pytest.approx(0.0, abs=1e-9)
    assert abs(ground_height(model, 0.5)) < 0.05


@pytest.mark.parametrize(
    ("way", "tops"),
    [
        ("up", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
        ("down", [-0.1, -0.2, -0.3, -0.4, -0.5, -0.6]),
        ("up_and_down", [0.1, 0.2, 0.3, 0.2, 0.1, 0.0]),
        ("down_and_up", [-0.1, -0.2, -0.3, -0.2, -0.1, 0.0]),
    ],
)
def test_stairs_have_their_risers_treads_and_landings(way, tops):
    parameters = {"number": 3, "riser": 0.1, "tread": 0.35, "landing": 1.2, "start": 2.0}
    model = scene_spec("stairs", {"way": way, **parameters}).compile()
    begins = [2.0, 2.35, 2.7, 3.9, 4.25, 4.6]
    ends = [*begins[1:], 60.0]
    assert ground_height(model, 1.999) == pytest.approx(0.0, abs=1e-9)
    for begin, end, top in zip(begins, ends, tops, strict=True):
        assert ground_height(model, begin + 1e-3) == pytest.approx(top, abs=1e-9)
        assert ground_height(model, end - 1e-3) == pytest.approx(top, abs=1e-9)


def test_branches_are_as_thick_as_asked_for_and_lie_on_the_ground():
    model = scene_spec("debris", {"branches": 4.0, "seed": 5}).compile()
    radii = []
    for index in range(model.ngeom):
        if model.geom(index).name.startswith("branch"):
            radii.append(float(model.geom_size[index, 0]))
            assert -0.02 <= model.geom_pos[index, 2] - radii[-1] <= 0.0
    assert len(radii) == 120
    assert 0.01 <= min(radii) < 0.0105
    assert 0.0195 < max(radii) <= 0.02


def test_ground_tilts_when_and_as_far_as_asked_for():
    motion = scene_motion(
        "tilting", {"rise_deg": 4.0, "side_deg": -8.0, "start": 2.0, "rate_deg": 2.0}
    )
    model = scene_spec("tilting", {}).compile()
    data = mujoco.MjData(model)
    for time, share in ((0.0, 0.0), (2.0, 0.0), (4.0, 0.5), (6.0, 1.0), (60.0, 1.0)):
        motion.apply(model, data, time)
        mujoco.mj_kinematics(model, data)
        up = data.body("moving_ground").xmat.reshape(3, 3)[:, 2]
        assert math.degrees(math.atan2(-up[0], up[2])) == pytest.approx(4.0 * share, abs=0.05)
        assert math.degrees(math.asin(-up[1])) == pytest.approx(-8.0 * share, abs=0.05)


def test_a_block_rises_under_one_foot_and_lifts_it():
    parameters = {"height": 0.06, "side": "left", "start": 0.1, "rate": 0.3}
    plant = Plant(
        PlantConfig(sensors="ideal"),
        Scenario(scene="block", scene_parameters=parameters, start="standing"),
    )
    for tick in range(200):
        plant.step(None)
        if tick == 49:
            assert plant.data.geom("left_toe").xpos[2] < 0.03
    assert plant.data.geom("left_toe").xpos[2] > 0.07
    assert plant.data.geom("right_toe").xpos[2] < 0.03
    plant.reset()
    assert plant.data.mocap_pos[0, 2] == 0.0


def test_a_pillar_stops_what_runs_into_it():
    model = scene_spec("pillar", {"x": 0.5, "y": 0.0}).compile()
    data = mujoco.MjData(model)
    data.qpos[2] = 1.2
    data.qvel[0] = 2.0
    for _ in range(800):
        mujoco.mj_step(model, data)
    assert data.qpos[0] < 0.3
    assert "pillar" in {model.geom(contact.geom1).name for contact in data.contact} or (
        data.qvel[0] < 0.0
    )
