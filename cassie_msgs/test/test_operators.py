"""Lease, stop, power and arming of several operators."""

import numpy as np
import pytest

from cassie_msgs.layout import OperatorCommand, RobotMode
from cassie_msgs.operators import (
    COMMAND_AGE,
    MAX_OPERATORS,
    RIDE_STOP,
    Operators,
    key_of,
    sender_of,
    write_sender,
)

A, B = bytes(range(16)), bytes(range(16, 32))


def command(name="", **fields):
    result = OperatorCommand()
    write_sender(result, name)
    values = {"power": True, "link": True, "mode": RobotMode.STAND, "height": 0.9} | fields
    for field, value in values.items():
        getattr(result, field)[...] = value
    return result


def walk(name, vx=0.5, **fields):
    return command(name, mode=RobotMode.WALK, vx=vx, **fields)


class Scene:
    """Operators at a time that goes on by 20 ms a command."""

    def __init__(self):
        self.operators = Operators()
        self.now = 10.0

    def say(self, writer, what):
        self.now += 0.02
        self.operators.take(what, writer, self.now)

    @property
    def vx(self):
        held = self.operators.command(self.now)
        return None if held is None else float(held.vx)

    @property
    def holder(self):
        return self.operators.holder(self.now)


@pytest.fixture
def driven():
    """A drives at 0.5 m/s, B listens in."""
    scene = Scene()
    scene.say(A, command("a-1"))
    scene.say(A, walk("a-1"))
    scene.say(B, command("b-2", power=False))
    assert scene.operators.power and scene.vx == 0.5 and scene.holder == "a-1"
    return scene


def test_the_first_holds_the_lease_and_others_change_nothing(driven):
    driven.say(B, walk("b-2", vx=-0.3))
    driven.say(A, walk("a-1"))
    assert driven.vx == 0.5
    assert driven.holder == "a-1" and driven.operators.others(driven.now) == ["b-2"]
    assert driven.operators.lease == key_of(A)


@pytest.mark.parametrize("how", ["emergency_stop", "power"])
def test_every_operator_can_stop_until_the_holder_switches_off_and_on(driven, how):
    driven.say(B, command("b-2"))
    driven.say(B, command("b-2", **({"power": False} if how == "power" else {how: True})))
    assert not driven.operators.power
    driven.say(B, command("b-2"))
    driven.say(A, walk("a-1"))
    driven.say(A, command("a-1"))
    assert not driven.operators.power
    assert driven.operators.power_refused == "stopped by b-2: switch the power off and on again"
    driven.say(A, command("a-1", power=False))
    driven.say(A, command("a-1"))
    assert driven.operators.power and not driven.operators.power_refused


def test_a_stop_of_nobody_in_particular_does_not_count(driven):
    driven.say(B, command("", emergency_stop=True))
    assert driven.operators.power
    driven.say(A, walk("a-1", emergency_stop=True))  # the holder's counts, with a name or not
    assert not driven.operators.power


def test_an_operator_whose_switch_was_never_on_stops_nobody_by_it(driven):
    for _ in range(100):
        driven.say(B, command("b-2", power=False))
        driven.say(A, walk("a-1"))
    assert driven.operators.power


def test_taking_over_needs_the_holder_at_rest_and_an_explicit_act(driven):
    driven.say(B, command("b-2", take_over=True))
    assert driven.holder == "a-1"
    driven.say(A, command("a-1"))
    driven.say(B, command("b-2", take_over=True))
    assert driven.holder == "b-2" and driven.operators.power
    driven.say(A, walk("a-1"))
    assert driven.vx == 0.0
    driven.say(A, walk("a-1", take_over=True))  # B rests
    assert driven.holder == "a-1"
    driven.say(B, command("b-2", take_over=True))  # still the same press of the button
    assert driven.holder == "a-1"


def test_a_segway_that_brakes_is_not_taken_over(driven):
    """It was, as soon as its operator asked for stand: while it still rolled."""
    driven.say(A, command("a-1", mode=RobotMode.SEGWAY, com_x=0.03))
    for _ in range(int((RIDE_STOP - 0.1) / 0.06)):
        driven.say(A, command("a-1"))
        driven.say(B, command("b-2"))
        driven.say(B, command("b-2", take_over=True))
    assert driven.holder == "a-1"
    driven.now += 0.2
    driven.say(A, command("a-1"))
    driven.say(B, command("b-2"))
    driven.say(B, command("b-2", take_over=True))
    assert driven.holder == "b-2"


def test_a_segway_without_power_is_taken_over_at_once(driven):
    driven.say(A, command("a-1", mode=RobotMode.SEGWAY, com_x=0.03))
    driven.say(A, command("a-1", power=False))
    driven.say(B, command("b-2", power=False, take_over=True))
    assert driven.holder == "b-2"


def test_a_new_holder_whose_switch_is_off_leaves_the_power_until_it_was_on(driven):
    driven.say(A, command("a-1"))
    driven.say(B, command("b-2", power=False, take_over=True))
    assert driven.holder == "b-2" and driven.operators.power
    driven.say(B, command("b-2"))
    driven.say(B, command("b-2", power=False))
    assert not driven.operators.power


def test_the_lease_of_a_silent_operator_is_free_and_its_speeds_end(driven):
    driven.now += COMMAND_AGE + 0.01
    assert driven.vx is None and driven.holder == ""
    driven.say(B, walk("b-2", vx=0.3, power=False))
    assert driven.holder == "b-2" and driven.vx == 0.0
    assert driven.operators.power  # nobody has switched it off


def test_nobody_drives_on_the_robot_of_a_silent_operator(driven):
    """A second operator got a walking robot, and drove it on, as soon as the first one hung."""
    driven.say(B, walk("b-2", vx=0.0))
    driven.now += COMMAND_AGE + 0.01
    for vx in (0.0, 0.5):
        driven.say(B, walk("b-2", vx=vx))
        assert driven.vx is None and driven.holder == ""
    told = "b-2 may drive after asking for stand without a speed"
    assert driven.operators.waiting(driven.now) == told
    driven.say(b"C" * 24, command(""))  # noise that says nothing like a name
    assert driven.holder == ""
    driven.say(B, command("b-2"))
    assert driven.holder == "b-2" and not driven.operators.waiting(driven.now)
    driven.say(B, walk("b-2"))
    assert driven.vx == 0.5
    driven.say(A, walk("a-1", vx=-0.3))  # it is back, and has to ask
    assert driven.vx == 0.5


def test_a_riding_robot_of_a_silent_operator_is_taken_over_without_a_lean(driven):
    ride = {"mode": RobotMode.SEGWAY, "com_x": 0.0}
    driven.now += COMMAND_AGE + 0.01
    driven.say(B, command("b-2", **ride))
    driven.say(B, command("b-2", **ride | {"com_x": 0.03, "take_over": True}))
    assert driven.holder == ""
    driven.say(B, command("b-2", **ride | {"take_over": True}))
    assert driven.holder == "b-2"


def test_speeds_count_only_after_they_were_zero():
    scene = Scene()
    scene.say(A, walk("a-1"))
    assert scene.vx == 0.0 and not scene.operators.armed
    scene.say(A, command("a-1", mode=RobotMode.WALK))
    scene.say(A, walk("a-1"))
    assert scene.vx == 0.5 and scene.operators.armed


@pytest.mark.parametrize("event", ["link", "silence", "episode"])
def test_arming_is_lost_with_the_link_and_with_the_episode(driven, event):
    if event == "link":
        driven.say(A, walk("a-1", link=False))
    elif event == "silence":
        driven.now += 1.0
        assert driven.vx is None
    else:
        driven.operators.reset()
    driven.say(A, walk("a-1"))
    assert driven.vx == 0.0
    driven.say(A, walk("a-1", vx=0.0))
    driven.say(A, walk("a-1"))
    assert driven.vx == 0.5


def test_on_a_segway_the_lean_has_to_be_zero_too():
    scene = Scene()
    scene.say(A, command("a-1", mode=RobotMode.SEGWAY, com_x=0.05))
    assert float(scene.operators.command(scene.now).com_x) == 0.0
    scene.say(A, command("a-1", mode=RobotMode.SEGWAY))
    scene.say(A, command("a-1", mode=RobotMode.SEGWAY, com_x=0.05))
    assert float(scene.operators.command(scene.now).com_x) == 0.05


@pytest.mark.parametrize("fields", [{"mode": RobotMode.WALK}, {"vx": 0.4}, {"yaw_rate": -0.3}])
def test_power_comes_on_only_with_stand_and_without_a_speed(fields):
    scene = Scene()
    scene.say(A, command("a-1", **fields))
    assert not scene.operators.power
    assert "power comes on only with stand" in scene.operators.power_refused
    scene.say(A, command("a-1"))
    assert scene.operators.power


def test_a_new_episode_is_without_power_until_old_requests_are_gone(driven):
    driven.operators.reset()
    driven.say(A, walk("a-1"))
    assert not driven.operators.power and driven.vx == 0.0


def test_the_supervisor_follows_the_lease_that_the_robot_tells(driven):
    driven.operators.follow(key_of(B))
    assert driven.holder == "b-2"
    driven.operators.follow(0)
    driven.operators.follow(12345)
    assert driven.holder == "b-2"


def test_a_holder_that_means_nothing_can_still_switch_off(driven):
    driven.say(A, walk("a-1", vx=np.nan))
    assert driven.operators.power and driven.operators.refused == "a value is not finite"
    driven.say(A, walk("a-1", vx=np.nan, power=False))
    assert not driven.operators.power


def test_beside_a_script_a_person_can_only_stop():
    operators = Operators(scripted=True)
    assert operators.script(True)
    operators.take(walk("a-1"), A, 1.0)
    assert operators.script(True) and operators.command(1.0) is None
    operators.take(command("a-1", power=False), A, 1.1)
    assert not operators.script(True) and operators.stopped_by == "a-1"
    assert not operators.script(False)
    assert operators.script(True)


def test_random_commands_of_strangers_are_not_obeyed(driven):
    rng = np.random.default_rng(3)
    for number in range(3000):
        raw = rng.integers(0, 256, OperatorCommand.SIZE, dtype=np.uint8)
        raw[:4] = (0, 1, 0, 0)
        what = OperatorCommand()
        what.load(raw.tobytes())
        driven.say(rng.bytes(16) if number % 2 else B, what)
        driven.say(A, walk("a-1"))
        assert driven.operators.power and driven.vx == 0.5 and driven.holder == "a-1"
    assert len(driven.operators._operators) <= MAX_OPERATORS


@pytest.mark.parametrize(
    "name", ["", "rc_teleop-12", "x" * 30, "a_node_with_a_long_name_indeed-4711"]
)
def test_names_survive_the_message(name):
    what = OperatorCommand()
    write_sender(what, name)
    assert sender_of(what) == name[:30] if len(name) <= 30 else sender_of(what).endswith("-4711")
