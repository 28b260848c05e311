"""Scripts: what is in force when, the header of answers, and what is refused."""

import numpy as np
import pytest

from cassie_msgs.experiment.file import Experiment, read_experiment
from cassie_msgs.layout import RobotMode, RobotState
from cassie_msgs.structured import structure
from cassie_msgs.tunables import ParameterError
from cassie_teleop.script import ScriptedOperator

STEPS = [
    {"t": 1.0, "power": True, "mode": "stand", "height": 0.8},
    {"t": 2.0, "mode": "walk", "vx": 0.5, "trims": [0.01, 0, 0, 0]},
    {"t": 2.0, "yaw_rate": -0.3},
    {"t": 4, "link": False},
]


def scripted(steps: list) -> ScriptedOperator:
    return ScriptedOperator(structure(Experiment, {"operator": steps}).operator)


def test_a_step_holds_from_its_time_on_and_omitted_keys_keep_their_value():
    operator = scripted(STEPS)
    assert not operator.request(0.999).power
    assert operator.request(1.0).power and operator.request(1.9).height == 0.8
    command = operator.command(3.0)
    assert command.mode == RobotMode.WALK and command.power and command.scripted
    assert (command.vx, command.yaw_rate, command.height) == (0.5, -0.3, 0.8)
    np.testing.assert_array_equal(command.trims, [0.01, 0, 0, 0])
    assert command.link and not operator.command(4.0).link


def test_an_answer_carries_the_states_stamp_and_holds_ten_ticks_on():
    state = RobotState()
    state.stamp_ns = 2_000_000_000
    state.episode[...], state.seq[...] = 7, 1000
    answer = scripted(STEPS).answer(state)
    assert (answer.stamp_ns, answer.episode, answer.seq) == (2_000_000_000, 7, 1000)
    assert answer.effective_seq == 1010 and answer.vx == 0.5


def test_the_same_time_gives_the_same_bytes_whatever_came_before():
    first, second = scripted(STEPS), scripted(STEPS)
    second.command(4.0)
    second.reset()
    assert first.command(1.5).to_bytes() == second.command(1.5).to_bytes()


def test_no_steps_are_a_script_of_defaults():
    assert not scripted([]).command(100.0).power


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ({"t": 0, "vz": 1}, r"operator.0: unknown key vz: did you mean v[xy]\?"),
        ({"t": 0, "hight": 1}, r"did you mean height\?"),
        ({"t": 0, "vx": 5.5}, r"operator.0.vx = 5.5 m/s is outside -1.3 \.\. 4.5 m/s"),
        ({"t": 0, "yaw_rate": float("nan")}, "yaw_rate = nan rad/s is outside"),
        ({"t": 0, "trims": [0, 0]}, "trims = .* is not a list of 4 numbers"),
        ({"t": 0, "mode": "run"}, "mode = 'run' is not one of stand, walk, segway"),
        ({"t": 0, "power": "on"}, "power = 'on' is not true or false"),
        ({"vx": 0.1}, r"operator.0.t must be given"),
        ({"t": -1}, r"operator.0.t = -1 s is outside 0 \.\. inf s"),
        ({"t": float("inf")}, "t = inf s"),
        ("walk", "operator.0 = 'walk' is not a mapping"),
    ],
)
def test_bad_steps_are_refused_by_number_and_key(step, message):
    with pytest.raises(ParameterError, match=message):
        scripted([step])


def test_times_must_ascend():
    with pytest.raises(ParameterError, match=r"operator.1.t = 1 s is before operator.0.t = 2 s"):
        scripted([{"t": 2}, {"t": 1}])


def test_files_hold_a_list_or_one_under_operator(tmp_path):
    path = tmp_path / "script.yaml"
    path.write_text("- {t: 0, power: true}\n")
    alone = read_experiment(path)
    path.write_text("scene: flat\noperator:\n- {t: 0, power: true}\n")
    assert (
        read_experiment(path)
        == alone
        == structure(Experiment, {"operator": [{"t": 0, "power": True}]})
    )
    for text, message in [
        ("a: 1", "unknown key a"),
        ("scene: flat", "operator must be given"),
        ("- [", "yaml:1:"),
        ("", "operator must be given"),
    ]:
        path.write_text(text)
        with pytest.raises(ParameterError, match=message):
            read_experiment(path, needs=("operator",))
