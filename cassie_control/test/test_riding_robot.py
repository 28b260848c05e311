"""A simulated Cassie rides: on plain ground, on a Segway until it is stopped and lifted off."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from closed_loop import Robot

from cassie_control.config import ControllerConfig, SegwayConfig
from cassie_msgs.experiment.scenario import Draw, Scenario
from cassie_msgs.layout import RobotMode

SEGWAY, STAND = int(RobotMode.SEGWAY), int(RobotMode.STAND)

LET_DOWN = {
    "scene": "segway",
    "start": "gantry",
    "gantry": [
        {"t": 0.02, "action": "hold", "height": 1.35, "speed": 1.0},
        {"t": 1.0, "action": "lower", "height": 0.785, "speed": 0.3},
        {"t": 30.0, "action": "hold", "height": 1.2, "speed": 0.5},
    ],
}


@pytest.mark.parametrize(
    ("force", "axle_x"),
    [
        ((100.0, 0.0, 0.0), 0.0),
        ((-90.0, 0.0, 0.0), 0.0),
        ((0.0, 180.0, 0.0), 0.0),
        ((120.0, 0.0, 0.0), SegwayConfig().axle_x),
        ((-70.0, 0.0, 0.0), SegwayConfig().axle_x),
        ((0.0, 180.0, 0.0), SegwayConfig().axle_x),
    ],
    ids=["fore", "aft", "side", "fore_above_axle", "aft_above_axle", "side_above_axle"],
)
def test_on_plain_ground_it_stands_pushes_as_in_stand(force, axle_x):
    """Above an axle it leans back: it stands more from behind, and less from ahead."""
    push = {"t": 6.0, "duration": 0.1, "force": force}
    scenario = {"start": "standing", "pushes": [push]}
    config = ControllerConfig(segway=replace(SegwayConfig(), axle_x=axle_x))
    robot = Robot(Scenario.from_mapping(scenario), "faithful", config, record=True)
    robot.ask(height=0.65)
    robot.run(4.0)
    robot.ask(mode=SEGWAY)
    robot.run(1.0)
    assert robot.mode is RobotMode.SEGWAY
    robot.run(6.0)
    assert not robot.fallen
    assert abs(robot.moments[-1].velocity).max() < 0.05


def test_leant_to_a_side_after_a_walk_on_plain_ground_it_does_not_tip_over():
    """It ends a walk with its feet nearer to each other than a Segway's platform has them."""
    robot = Robot(Scenario(start="standing", draw=Draw.from_seed(3)), "faithful")
    robot.run(2.0)
    robot.ask(mode=int(RobotMode.WALK))
    robot.run(4.0)
    robot.ask(mode=STAND)
    robot.run(4.0)
    robot.ask(height=0.65)
    robot.run(4.0)
    robot.ask(mode=SEGWAY)
    robot.run(1.0)
    for com_x, com_y in ((0.0, 0.1), (0.0, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, -0.1)):
        robot.ask(com_x=com_x, com_y=com_y)
        robot.run(4.0)
        assert robot.mode is RobotMode.SEGWAY
        assert not robot.fallen


def put_on(gantry, seconds: float, seed: int = 0, **scene_parameters) -> Robot:
    """Let down onto it in 5 s and riding for so many seconds, held by its bar until 8 s."""
    parameters = {"let_go": 8.0, **scene_parameters}
    scenario = Scenario.from_mapping({**LET_DOWN, "gantry": gantry, "scene_parameters": parameters})
    if seed:
        scenario = replace(scenario, draw=Draw.from_seed(seed))
    robot = Robot(scenario, "faithful", record=True)
    robot.ask(height=0.65)
    robot.run(5.0)
    robot.ask(mode=SEGWAY)
    robot.run(seconds)
    return robot


@pytest.fixture(scope="module")
def riding() -> Robot:
    """At more than 3 m/s, leant forward for a while; the gantry lifts it at 30 s."""
    robot = put_on(LET_DOWN["gantry"], 5.0, take_hold=28.0)
    robot.ask(com_x=0.06)
    robot.run(3.5)
    robot.ask(com_x=0.001)
    robot.run(1.0)
    return robot


def test_a_segway_is_stopped_and_left_only_when_it_is_lifted(riding):
    assert riding.mode is RobotMode.SEGWAY
    assert _forward(riding) > 3.0
    riding.ask(mode=STAND, com_x=0.0)  # 14.5 s
    riding.run(8.0)
    assert abs(_forward(riding)) < 0.6
    riding.run(7.0)  # 29.5 s, held by its bar since 28 s
    assert abs(_forward(riding)) < 0.2
    assert not riding.fallen
    assert riding.mode is RobotMode.SEGWAY
    riding.run(2.5)  # lifted by 0.9 m, and then by as much as it takes
    assert riding.mode is RobotMode.STAND
    assert not riding.fallen
    assert riding.plant.pelvis_pose[0][2] > 0.95


@pytest.mark.parametrize("seed", [0, 5, 8])
def test_without_the_operators_link_it_brakes_and_stays_on_it(seed):
    """Drawn robots rolled on at up to 0.5 m/s, as they did not know how fast they were."""
    robot = put_on(LET_DOWN["gantry"][:2], 4.0, seed)
    robot.ask(com_x=0.05)
    robot.run(3.0)
    assert _forward(robot) > 0.8
    robot.ask(link=False)
    robot.run(8.0)
    assert not robot.fallen
    assert robot.mode is RobotMode.SEGWAY
    assert abs(_forward(robot)) < 0.4


def test_leant_back_and_to_a_side_until_it_rolls_backward_it_is_not_thrown_off():
    """It turned faster and faster as it slowed down, and threw it out as it rolled back."""
    robot = put_on(LET_DOWN["gantry"][:2], 5.0)
    robot.ask(com_x=0.06)
    robot.run(2.0)
    robot.ask(com_x=-0.095, com_y=0.095)
    robot.run(12.0)
    assert _forward(robot) < -0.1
    assert not robot.fallen
    assert max(abs(moment.angles[2]) for moment in robot.moments) < 0.25


def test_a_lean_that_lasts_leads_to_the_top_speed_and_not_beyond():
    """It went on at the CoM's zero, 2 cm ahead of where the Segway keeps its speed.

    It holds `top_speed` by its own estimate, from which the true speed drifts away.
    """
    robot = put_on(LET_DOWN["gantry"][:2], 5.0)
    robot.ask(com_x=0.05)
    robot.run(25.0)
    assert not robot.fallen
    assert _forward(robot) == pytest.approx(SegwayConfig().top_speed, abs=0.6)
    robot.run(10.0)
    assert _forward(robot) == pytest.approx(SegwayConfig().top_speed, abs=0.6)


def test_on_a_lawn_the_torso_does_not_swing_from_side_to_side():
    robot = put_on(LET_DOWN["gantry"][:2], 5.0, surface="grass")
    robot.ask(com_x=0.08)
    robot.run(3.5)
    robot.ask(com_x=0.02)
    robot.run(5.0)
    assert _forward(robot) > 3.8
    rolls = [moment.angles[2] for moment in robot.moments if moment.time > 14.0]
    assert max(map(abs, rolls)) < math.radians(7.0)


def test_a_robot_whose_height_is_found_late_is_not_damped_as_it_lands():
    scenario = Scenario.from_mapping({**LET_DOWN, "gantry": LET_DOWN["gantry"][:2]})
    drawn = Scenario(
        scene=scenario.scene, start="gantry", gantry=scenario.gantry, draw=Draw.from_seed(7)
    )
    robot = Robot(drawn, "faithful", record=True)
    robot.ask(height=0.65)
    robot.run(4.5)
    assert robot.mode is RobotMode.STAND
    assert not robot.fallen


def _forward(robot: Robot) -> float:
    """Mean speed ahead over the last half second. In m/s."""
    last = robot.moments[-250:]
    yaw = last[-1].angles[0]
    moved = last[-1].position - last[0].position
    return float(math.cos(yaw) * moved[0] + math.sin(yaw) * moved[1]) / (0.002 * 249)
