"""Gaits made while the robot walks: asked for, taken up, told, replayed. With real nodes."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bringup import STAND, Robot
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from cassie_bags.bag.node_events import EVENTS_TOPIC, read_event
from cassie_bags.bag.reader import read_messages
from cassie_bags.ros.record import COMPLETE
from cassie_bags.run.verify import verify
from cassie_msgs.layout import Gait, GaitRequest, GaitResult, MotorCommand
from cassie_msgs.schedule import GAIT_TICKS
from cassie_msgs.srv import SolveGait

WALK = (*STAND, {"t": 1.0, "mode": "walk"}, {"t": 3.0, "vx": 0.3})
NODES = ("state_estimator", "gait_controller", "mode_supervisor", "scripted_operator", "simulator")
OPTIMIZER = {"gait_source": "optimizer"}
SECONDS = 6.0


def recorded(bag: Path, kind: type[Gait] | type[GaitRequest] | type[MotorCommand]) -> np.ndarray:
    """Messages of a type in a bag."""
    raw = [raw[: kind.SIZE] for _, _, _, raw in read_messages(bag, [kind.TOPIC])]
    return np.frombuffer(b"".join(raw), kind.DTYPE)


def set_points(bag: Path) -> np.ndarray:
    """Torque and position of each tick, which may have been answered more than once."""
    rows = recorded(bag, MotorCommand)
    rows = rows[np.unique(rows["seq"], return_index=True)[1]]
    return np.hstack([rows["torque"], rows["position"]])


def run(folder: Path, **optimizer: object) -> Path:
    """A walk on gaits of the optimizer, recorded in lock-step."""
    simulator = {"duration": SECONDS, "paused": True}
    with Robot(folder, WALK, simulator=simulator, gait_controller=OPTIMIZER) as robot:
        robot.start("gait_optimizer", **optimizer)
        robot.eyes.wait_for(
            lambda: robot.processes.printed("gait_optimizer", "ready"), "the optimizer"
        )
        bag = robot.record()
        robot.start(*NODES)
        eyes = robot.eyes
        eyes.wait_for(lambda: robot.processes.printed("record", COMPLETE), "the recorder")
        robot.go()
        eyes.wait_for(lambda: not robot.processes.running("simulator"), "the end of the run")
        robot.processes.stop("record")
    return bag


def test_a_walk_on_made_gaits_is_the_same_each_time_and_in_a_replay(tmp_path: Path) -> None:
    bags = [run(tmp_path / name, payload=6.0) for name in ("one", "other")]
    requests, gaits = (recorded(bags[0], kind) for kind in (GaitRequest, Gait))
    assert len(requests) >= 5
    assert (requests["seq"] % GAIT_TICKS == 0).all()
    assert (gaits["result"] == int(GaitResult.FOUND)).all()
    np.testing.assert_array_equal(gaits["effective_seq"], gaits["seq"] + GAIT_TICKS)
    np.testing.assert_array_equal(gaits["payload"], 6.0)
    events = [read_event(raw) for *_, raw in read_messages(bags[0], [EVENTS_TOPIC])]
    taken = [event.content["effective_seq"] for event in events if event.event == "gait"]
    assert taken == gaits["effective_seq"][: len(taken)].tolist()
    assert len(taken) >= len(gaits) - 1
    found = verify(bags[0])
    assert found.gaps == [] and found.differences == []
    one, other = (set_points(bag) for bag in bags)
    np.testing.assert_array_equal(one, other)


def test_without_an_optimizer_the_robot_walks_on_the_library_and_says_so(tmp_path: Path) -> None:
    with Robot(tmp_path, WALK, gait_controller=OPTIMIZER) as robot:
        robot.start(*NODES)
        eyes = robot.eyes
        eyes.wait_for(
            lambda: eyes.report_since(
                0.0, "gait_controller: gait_optimizer", "is gait_optimizer running?"
            ),
            "the controller to miss the optimizer",
        )
        reached = eyes.tick
        eyes.wait_for(lambda: eyes.tick > reached + 1000, "robot time to go on")
        assert eyes.mode == "walk" and robot.stands()


def test_ctrl_c_ends_the_optimizer_also_while_it_prepares(tmp_path: Path) -> None:
    with Robot(tmp_path) as robot:
        robot.start("gait_optimizer")
        eyes = robot.eyes
        # The service is the last thing that the node makes before the preparation.
        client = eyes.node.create_client(SolveGait, "/cassie/solve_gait")
        eyes.wait_for(client.service_is_ready, "the node")
        robot.processes.signal("gait_optimizer", signal.SIGINT)
        eyes.wait_for(lambda: not robot.processes.running("gait_optimizer"), "its end")
        robot.processes.check("gait_optimizer")
        assert robot.processes.log("gait_optimizer").read_text() == ""


@pytest.fixture(scope="module")
def optimizer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    """A robot's domain in which the optimizer runs alone, for calls of which each is its own."""
    with Robot(tmp_path_factory.mktemp("optimizer")) as robot:
        robot.start("gait_optimizer")
        yield robot
        assert robot.processes.running("gait_optimizer")


@pytest.mark.parametrize("value", ["heavy", [1.0], True, float("nan")])
def test_a_payload_of_another_type_is_refused_by_the_running_optimizer(
    optimizer: Robot, value: object
) -> None:
    eyes = optimizer.eyes
    client = eyes.node.create_client(SetParameters, "/gait_optimizer/set_parameters")
    eyes.wait_for(client.service_is_ready, "the service")
    wrong = Parameter("payload", value=value).to_parameter_msg()
    future = client.call_async(SetParameters.Request(parameters=[wrong]))
    eyes.wait_for(future.done, "the answer")
    (answer,) = future.result().results
    assert not answer.successful
    assert "payload" in answer.reason
    assert optimizer.processes.running("gait_optimizer")


@pytest.mark.parametrize(
    ("fields", "success", "words"),
    [
        ({"vx": 0.4, "payload": 5.0, "slope": -0.05}, True, "certified"),
        ({"vx": 0.4, "yaw_rate": 0.3, "slope": 0.1}, False, "do not turn"),
        ({"vx": float("nan")}, False, "vx is nan m/s"),
        ({"vx": 4.5}, False, "no gait found"),
        ({"payload": 1e308}, False, "payload is 1e+308 kg, expected 0 .. 30 kg"),
        ({"payload": -5.0}, False, "payload is -5 kg, expected 0 .. 30 kg"),
    ],
)
def test_the_service_solves_certifies_and_says_why_not(
    optimizer: Robot, fields: dict[str, float], success: bool, words: str
) -> None:
    eyes = optimizer.eyes
    client = eyes.node.create_client(SolveGait, "/cassie/solve_gait")
    eyes.wait_for(client.service_is_ready, "the service")
    future = client.call_async(SolveGait.Request(**fields))
    eyes.wait_for(future.done, "the gait")
    answer = future.result()
    assert answer.success is success
    assert words in answer.message
    assert bool(np.any(answer.right_stance)) is success
    assert optimizer.processes.running("gait_optimizer")
