"""The mode supervisor: conditions of each mode, falls and losses."""

from __future__ import annotations

import math

import pytest
from supervised import CONFIG, DAMP, OFF, PERIOD, STAND, WALK, Scene

from cassie_control.errors import ControlError
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import RobotState


def test_without_power_off_and_with_it_stand(scene):
    scene.state.power[...] = 0.0
    assert int(scene.run().mode) == OFF
    assert scene.readiness == "the drives have no power"
    scene.state.power[...] = 1.0
    assert int(scene.run().mode) == STAND
    assert scene.readiness == ""


def test_losing_power_is_off_at_once(walking):
    walking.state.power[...] = 0.0
    walking.run()
    assert walking.mode is OFF


def test_tilted_it_damps_and_says_why(scene):
    scene.state.q[5] = 0.5
    scene.run()
    assert scene.mode is DAMP
    assert scene.readiness == "the torso is tilted by more than 0.3 rad"


def test_walking_needs_standing_first(scene):
    scene.ask(mode=int(WALK))
    scene.run()
    assert scene.mode is STAND
    assert scene.core.status.walk == "stand first"


@pytest.mark.parametrize("estimated", [0.0, -6.5])
def test_hanging_it_stands_and_says_that_it_waits_to_be_let_down(scene, estimated):
    scene.state.foot_force[:] = estimated
    scene.run(1.0)
    assert scene.mode is STAND
    assert scene.readiness == f"the feet carry 0 N of {WEIGHT:.0f} N: let it down"
    scene.state.foot_force[:] = 0.5 * WEIGHT
    scene.run(1.0)
    assert scene.readiness == ""


def test_walking_needs_the_weight_on_the_feet(scene):
    scene.state.foot_force[:] = 0.3 * WEIGHT
    scene.ask(mode=int(WALK))
    scene.run(2.0)
    assert scene.mode is STAND
    assert scene.readiness == f"the feet carry {0.6 * WEIGHT:.0f} N of {WEIGHT:.0f} N: let it down"


def test_walking_needs_both_feet_on_the_ground(scene):
    scene.state.contact_probability[1] = 0.2
    scene.ask(mode=int(WALK))
    scene.run(2.0)
    assert scene.mode is STAND
    assert scene.readiness.startswith("the feet carry")


def test_walking_begins_at_its_height(standing):
    standing.state.q[2] = 0.8
    standing.ask(mode=int(WALK), height=0.8)
    mode = standing.run(2.0)
    assert standing.mode is STAND
    assert standing.readiness == "walking begins at 0.95 m, pelvis at 0.80 m"
    assert float(mode.height) == pytest.approx(CONFIG.walk_height)  # it rises by itself


def test_walking_needs_standing_still_for_a_while(scene):
    scene.ask(mode=int(WALK))
    scene.state.com_velocity[0] = 0.2
    scene.run(2.0)
    assert scene.readiness == "standing still for 0.0 s of 1 s"
    scene.state.com_velocity[0] = 0.0
    scene.run(0.5)
    assert scene.readiness.startswith("standing still for 0.")
    scene.run(0.6)
    assert scene.mode is WALK


def test_a_height_that_is_wrong_for_a_moment_as_it_lands_is_no_fall(standing):
    height = float(standing.state.q[2])
    standing.state.q[2] = 0.15
    standing.run(0.06)
    assert standing.mode is STAND
    standing.state.q[2] = height
    standing.run(1.0)
    standing.state.q[2] = 0.15
    standing.run(0.2)
    assert standing.mode is DAMP


def test_walking_ends_after_stepping_in_place(walking):
    walking.ask(vx=0.5)
    walking.state.com_velocity[0] = 0.5
    walking.run(3.0)
    walking.ask(mode=int(STAND))
    walking.run(0.5)
    assert walking.mode is WALK
    assert walking.readiness == "slowing down from 0.50 m/s"
    walking.run(2.0)
    assert walking.readiness == "stepping in place first: 0.50 m/s, stands below 0.15 m/s"
    walking.state.com_velocity[0] = 0.0
    walking.run(CONFIG.stop_time)
    assert walking.mode is WALK
    walking.run(1.0)
    assert walking.mode is STAND


def test_it_straightens_up_before_it_stands_and_tilts_again_after_a_second(walking):
    walking.ask(pitch=0.15, roll=-0.1, trims=(0.01, 0.0, 0.05, 0.0))
    assert float(walking.run(2.0).pitch) == pytest.approx(0.15)
    walking.ask(mode=int(STAND), height=0.6)
    for _ in range(1000):
        walking.run()
        if walking.mode is STAND:
            break
    assert walking.mode is STAND
    for time in (0.0, 0.9):
        mode = walking.run(time)
        assert max(abs(float(x)) for x in (mode.pitch, mode.roll, *mode.trims[2:])) < 1e-3
        assert float(mode.height) == pytest.approx(CONFIG.walk_height)
    mode = walking.run(3.0)
    assert float(mode.pitch) == pytest.approx(0.15)
    assert float(mode.height) == pytest.approx(0.6)


def test_walking_bears_less_tilt_than_standing_and_begins_with_no_more(standing):
    standing.ask(roll=0.2, pitch=-0.25, trims=(0.1, -0.1, 0.0, 0.1))
    mode = standing.run(2.0)
    assert float(mode.roll + mode.trims[3]) == pytest.approx(CONFIG.tilt_limit)
    assert float(mode.pitch) == pytest.approx(-CONFIG.tilt_limit)
    standing.ask(mode=int(WALK))
    standing.run()
    assert (standing.mode, standing.readiness) == (STAND, "straightening up first")
    mode = standing.run(3.0)
    assert standing.mode is WALK
    assert float(mode.roll + mode.trims[3]) == pytest.approx(CONFIG.walk_roll)
    assert float(mode.pitch) == pytest.approx(-CONFIG.walk_pitch)
    assert mode.trims[:2].tolist() == pytest.approx([CONFIG.walk_trim, -CONFIG.walk_trim])


def test_who_steps_to_catch_herself_tilts_no_more_than_in_walking(standing):
    standing.ask(roll=0.2)
    standing.run(2.0)
    standing.state.foot_force[:] = (300.0, 0.0)
    assert float(standing.run(1.0).roll) == pytest.approx(CONFIG.walk_roll)


def test_a_lost_operator_stops_and_stands(walking):
    walking.ask(vx=0.5)
    walking.run(3.0)
    walking.operator = None
    mode = walking.run(0.5)
    assert walking.mode is WALK
    assert 0.0 < float(mode.vx) < 0.5
    assert walking.core.status.faults == ("operator lost: stopping and standing",)
    assert not walking.core.status.link
    mode = walking.run(4.0)
    assert walking.mode is STAND
    assert float(mode.vx) == 0.0
    assert float(mode.height) == pytest.approx(CONFIG.walk_height)


def test_nothing_is_wrong_with_a_robot_that_nobody_has_driven_yet():
    supervisor, state = ModeSupervisor(CONFIG, PERIOD), RobotState()
    state.q[2] = 1.2
    supervisor.step(state, None)
    assert supervisor.status.faults == ()


def test_a_bad_link_counts_as_a_lost_operator(walking):
    walking.ask(link=False)
    walking.run(3.0)
    assert walking.mode is STAND
    assert walking.core.status.faults == ("operator lost: stopping and standing",)


def test_a_lost_controller_damps_until_it_is_back(walking):
    walking.lost = True
    walking.run()
    assert walking.mode is DAMP
    assert walking.readiness == "the controller is silent"
    walking.lost = False
    walking.run()
    assert walking.mode is STAND


@pytest.mark.parametrize(("index", "value"), [(4, 0.9), (5, -0.9)])
def test_a_fall_damps_until_it_has_been_upright_for_a_while(walking, index, value):
    walking.state.q[index] = value
    walking.run()
    assert walking.mode is DAMP
    assert walking.core.status.fallen
    assert walking.core.status.faults == ("fallen: drives damp",)
    walking.state.power[...] = 0.0
    walking.run(0.1)
    assert walking.core.status.faults == ("fallen",)
    walking.state.power[...] = 1.0
    walking.run(2.0)
    walking.state.q[index] = 0.0
    walking.run(0.9 * CONFIG.upright_time)
    assert walking.mode is DAMP
    assert walking.readiness == "Cassie fell: hang it up or set it upright"
    walking.run(0.2 * CONFIG.upright_time)
    assert walking.mode is STAND
    assert not walking.core.status.fallen


def test_tilt_on_the_way_up_starts_the_wait_anew(walking):
    walking.state.q[4] = 0.9
    walking.run()
    for _ in range(4):
        walking.state.q[4] = 0.0
        walking.run(0.6)
        walking.state.q[4] = 0.4
        walking.run(0.1)
    assert walking.mode is DAMP


def test_sinking_onto_the_ground_upright_is_a_fall_too(standing):
    standing.state.q[2] = 0.3
    standing.run(0.12)
    assert standing.mode is DAMP
    assert standing.core.status.fallen
    for _ in range(250):
        standing.run()
        assert standing.mode is DAMP
        assert standing.core.status.fallen  # upright, but as low as it fell
    standing.state.q[2] = 0.6
    standing.run(1.2)
    assert standing.mode is STAND


def test_too_low_to_stand_is_said(scene):
    scene.state.q[2] = 0.3
    scene.run(2.0)
    assert scene.mode is DAMP
    assert scene.readiness == "the pelvis is at 0.30 m: lift it"


def test_standing_begins_at_the_height_it_has_on_the_ground(scene):
    scene.lost = True
    scene.state.q[2] = 0.6
    scene.run()
    scene.lost = False
    mode = scene.run()
    assert float(mode.height) == pytest.approx(0.6, abs=0.02)
    assert float(scene.run(0.5).height) == pytest.approx(0.6 + 0.5 * CONFIG.height_rate, abs=0.03)


def test_hanging_the_legs_take_the_commanded_height_at_once(scene):
    scene.state.q[2], scene.state.foot_force[:] = 1.15, 0.0
    scene.state.power[...] = 0.0
    scene.run()
    scene.state.power[...] = 1.0
    assert float(scene.run().height) == pytest.approx(CONFIG.walk_height)


def test_a_state_that_is_no_number_is_refused_and_changes_nothing(walking):
    before = walking.run(2.0).to_bytes()
    walking.state.com_velocity[0] = math.nan
    with pytest.raises(ControlError, match=r"state com_velocity\[0\] is nan"):
        walking.run()
    walking.state.com_velocity[0] = 0.0
    assert walking.run().to_bytes() == before


def test_the_answer_holds_ten_ticks_later(scene):
    scene.state.seq[...], scene.state.episode[...] = 120, 4
    mode = scene.run()
    assert (int(mode.seq), int(mode.effective_seq), int(mode.episode)) == (120, 130, 4)


def test_reset_is_as_new(walking):
    walking.core.reset()
    fresh = Scene()
    fresh.ask(mode=int(WALK))
    for duration in (PERIOD, 0.5, 2.0):
        assert walking.run(duration).to_bytes() == fresh.run(duration).to_bytes()
        assert walking.core.status == fresh.core.status
