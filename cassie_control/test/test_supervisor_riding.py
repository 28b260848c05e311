"""The supervisor's rules of riding a Segway."""

from __future__ import annotations

import pytest
from supervised import CONFIG, SEGWAY, STAND, WALK

from cassie_control.estimator.channels import ACCELEROMETER, GYRO
from cassie_msgs.operators import RIDE_STOP


def test_riding_begins_crouched_at_rest_and_ends_when_it_is_confirmed(standing):
    standing.ask(mode=int(SEGWAY), height=1.0)
    standing.run(3.0)
    assert standing.mode is STAND
    assert "crouch" in standing.readiness
    assert float(standing.run().height) == pytest.approx(CONFIG.ride_height)
    standing.state.q[2] = CONFIG.ride_height
    standing.state.com_velocity[0] = 0.3
    standing.run(2.0)
    assert "standing still" in standing.readiness
    standing.state.com_velocity[0] = 0.0
    standing.run(CONFIG.stand_time + 0.1)
    assert standing.mode is STAND
    assert standing.readiness == "to ride ask for stand at 0.67 m or less and for segway again"
    standing.ask(mode=int(STAND), height=0.6)
    standing.run()
    standing.ask(mode=int(SEGWAY))
    standing.run()
    assert standing.mode is SEGWAY
    standing.ask(mode=int(WALK))
    standing.run(2.0)
    assert (standing.mode, standing.readiness) == (SEGWAY, "stand first")
    leave(standing)
    assert standing.mode is STAND


def ride(standing):
    """Crouch, and ask for it."""
    standing.state.q[2] = CONFIG.ride_height
    standing.ask(mode=int(STAND), height=0.6)
    standing.run(2.0)
    standing.ask(mode=int(SEGWAY))
    standing.run()


def leave(riding):
    """Ask to stand, wait until it has braked, and confirm."""
    riding.ask(mode=int(STAND))
    riding.run(CONFIG.ride_stop_time + 0.1)
    riding.ask(mode=int(SEGWAY))
    riding.run(0.2)
    riding.ask(mode=int(STAND))
    riding.run()


def test_a_command_without_meaning_ends_a_lean(standing):
    """The Segway sped up under the last good lean while the operator sent NaN."""
    ride(standing)
    standing.ask(height=0.6, com_x=0.02)
    assert standing.run(1.0).com_x == pytest.approx(0.02)
    standing.ask(yaw_rate=float("nan"))
    mode = standing.run(1.0)
    assert (float(mode.com_x), float(mode.com_y)) == (0.0, 0.0)
    assert standing.mode is SEGWAY
    standing.ask(yaw_rate=0.0)
    assert standing.run(1.0).com_x == pytest.approx(0.02)


def test_riding_is_refused_with_a_foot_in_the_air(standing):
    standing.state.q[2] = CONFIG.ride_height
    standing.state.foot_force[:] = (300.0, 0.0)
    standing.state.contact_probability[:] = (1.0, 0.0)
    standing.ask(mode=int(SEGWAY), height=0.6)
    standing.run(3.0)
    assert "let it down" in standing.readiness


def test_a_link_that_comes_back_is_no_request_to_ride(standing):
    standing.state.q[2] = CONFIG.ride_height
    standing.state.com_velocity[0] = 0.3
    standing.ask(mode=int(SEGWAY), height=0.6)
    standing.run(2.0)
    standing.ask(link=False)
    standing.run(2.0)
    standing.ask(link=True)
    standing.state.com_velocity[0] = 0.0
    standing.run(2.0)
    assert standing.mode is STAND
    assert "ask for stand" in standing.readiness


@pytest.mark.parametrize("lean", [{"roll": 0.2}, {"pitch": -0.2}, {"com_x": 0.05}])
def test_riding_begins_upright_over_the_middle(standing, lean):
    standing.ask(height=0.6, **lean)
    standing.run(3.0)
    standing.state.q[2] = CONFIG.ride_height
    standing.ask(mode=int(SEGWAY), height=0.6)
    standing.run()
    assert standing.mode is STAND
    assert standing.readiness == "straightening up first"


def test_trims_count_as_tilt_on_a_segway(standing):
    ride(standing)
    standing.ask(roll=0.2, pitch=-0.2, trims=(0.1, 0.1, -0.1, 0.1))
    mode = standing.run(3.0)
    assert float(mode.roll + mode.trims[3]) == pytest.approx(CONFIG.ride_tilt)
    assert float(mode.pitch + mode.trims[2]) == pytest.approx(-CONFIG.ride_tilt)


def test_a_rider_without_operator_rides_on(standing):
    ride(standing)
    standing.ask(com_x=0.03)
    standing.run(2.0)
    standing.operator = None
    mode = standing.run(2.0)
    assert standing.mode is SEGWAY
    assert float(mode.com_x) == 0.0
    assert standing.core.status.faults == ("operator lost: braking and riding on",)


@pytest.fixture
def riding(standing):
    ride(standing)
    standing.run(2.0)
    assert standing.mode is SEGWAY
    return standing


def test_a_rider_gets_the_speeds_and_leans_of_a_segway(riding):
    riding.ask(mode=int(SEGWAY), height=0.6, vx=4.0, com_x=0.1, com_y=0.2)
    mode = riding.run(10.0)
    assert float(mode.vx) == pytest.approx(4.0)
    assert float(mode.com_x) == pytest.approx(CONFIG.ride_com_x)
    assert float(mode.com_y) == pytest.approx(CONFIG.ride_com_y)


def test_an_accelerometer_that_contradicts_carried_feet_does_not_stop_a_ride(riding):
    riding.ask(mode=int(SEGWAY), height=0.6, com_x=0.03)
    riding.state.sensor_faults[...] = 1 << ACCELEROMETER
    assert float(riding.run(2.0).com_x) == pytest.approx(0.03)
    riding.state.sensor_faults[...] = 1 << GYRO
    assert float(riding.run(2.0).com_x) == 0.0


def test_who_asks_to_stand_while_riding_first_brakes_and_is_asked_to_confirm(riding):
    riding.ask(mode=int(STAND), vx=4.0, com_x=0.05)
    mode = riding.run(1.0)
    assert riding.mode is SEGWAY
    assert (float(mode.vx), float(mode.com_x)) == (0.0, 0.0)
    assert riding.readiness == f"braking for {CONFIG.ride_stop_time - 1.0:.1f} s more"
    riding.run(60.0)
    assert riding.mode is SEGWAY
    assert "ask for segway and stand once more" in riding.readiness


def test_to_ask_again_too_late_or_too_early_confirms_nothing(riding):
    for braked, waited in ((CONFIG.ride_stop_time - 1.0, 0.2), (CONFIG.ride_stop_time + 1.0, 2.5)):
        riding.ask(mode=int(STAND))
        riding.run(braked)
        riding.ask(mode=int(SEGWAY))
        riding.run(waited)
        riding.ask(mode=int(STAND))
        riding.run(1.0)
        assert riding.mode is SEGWAY


def test_a_confirmed_end_still_waits_for_rest(riding):
    riding.state.com_velocity[0] = 0.2
    leave(riding)
    assert riding.mode is SEGWAY
    assert "standing still" in riding.readiness
    riding.state.com_velocity[0] = 0.0
    riding.run(CONFIG.stand_time + 0.1)
    assert riding.mode is STAND


def test_who_is_lifted_off_a_segway_stands(riding):
    riding.ask(mode=int(STAND))
    riding.state.foot_force[:] = 10.0
    riding.run(0.3)
    assert riding.mode is SEGWAY
    riding.run(0.3)
    assert riding.mode is STAND


def test_a_lost_link_is_no_confirmation(riding):
    riding.ask(mode=int(STAND))
    riding.run(CONFIG.ride_stop_time + 1.0)
    riding.ask(link=False)
    riding.run(0.5)
    riding.ask(link=True)
    riding.run(1.0)
    assert riding.mode is SEGWAY


@pytest.mark.parametrize("mode", [STAND, WALK])
@pytest.mark.parametrize(("height", "kept"), [(1.0, CONFIG.ride_height), (0.4, 0.6)])
def test_a_rider_who_asks_for_another_mode_stays_crouched_and_upright(riding, mode, height, kept):
    riding.ask(mode=int(mode), height=height, vx=1.0, roll=-0.2, pitch=0.2)
    answer = riding.run(5.5)
    assert riding.mode is SEGWAY
    assert float(answer.vx) == 0.0
    assert (float(answer.roll), float(answer.pitch)) == (-CONFIG.ride_tilt, CONFIG.ride_tilt)
    assert float(answer.height) == pytest.approx(kept)


def test_the_lease_waits_until_the_segway_has_braked():
    assert CONFIG.ride_stop_time == RIDE_STOP
