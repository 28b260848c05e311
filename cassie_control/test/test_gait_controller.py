"""The controller: changes of mode, refusals, and new gains on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robot_states import leg_joints, mode_of, random_state, state_of

from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import Activity, GaitController
from cassie_control.control.limits import stops
from cassie_control.errors import ControlError
from cassie_gaits.drive_limits import DAMPING
from cassie_gaits.gait_library_file import default_library_path, load_certified
from cassie_msgs.layout import MotorCommand, RobotMode
from cassie_msgs.tunables import replace_checked

LIBRARY = load_certified(default_library_path())
CONFIG = ControllerConfig()
PERIOD = 0.002
OFF, DAMP, STAND, WALK = RobotMode.OFF, RobotMode.DAMP, RobotMode.STAND, RobotMode.WALK


def controller():
    return GaitController(CONFIG, LIBRARY, PERIOD)


def standing():
    return state_of(leg_joints(), leg_joints())


def stepping(left=330.0, right=0.0):
    return state_of(leg_joints(), leg_joints(knee=-1.3), forces=(left, right))


def run(core, state, mode, duration=PERIOD):
    """The last command after some time in one state."""
    commanded = mode_of(mode=int(mode))
    for _ in range(max(1, round(duration / PERIOD))):
        command = core.step(state, commanded)
    return command


def walking(duration=0.1):
    """A controller in the middle of its first step, on the left leg."""
    core = controller()
    run(core, standing(), STAND)
    run(core, standing(), WALK, CONFIG.transition.lean_time + 2.0 * PERIOD)
    run(core, stepping(), WALK, duration)
    assert core.activity is Activity.WALKING
    return core


def test_off_commands_nothing():
    command = run(controller(), standing(), OFF)
    for field in ("torque", "velocity", "kp", "kd"):
        assert (getattr(command, field) == 0.0).all()


def test_walking_begins_with_a_lean_to_the_left_and_a_step_of_the_right_leg():
    core = controller()
    run(core, standing(), STAND)
    assert core.activity is Activity.STANDING
    command = run(core, standing(), WALK, 0.9 * CONFIG.transition.lean_time)
    assert core.activity is Activity.LEANING
    assert command.position[8] > command.position[3]  # the right leg is longer: it leans left
    run(core, standing(), WALK, 0.2 * CONFIG.transition.lean_time)
    assert core.activity is Activity.WALKING
    assert float(core.status.stance_leg) == 0.0
    assert 0.0 < float(core.status.phase) < 0.5


def test_a_lean_ends_when_standing_is_commanded_again():
    core = controller()
    run(core, standing(), WALK, 0.1)
    run(core, standing(), STAND)
    assert core.activity is Activity.STANDING


def test_walking_ends_only_at_a_touchdown():
    core = walking()
    run(core, stepping(), STAND, 0.3)
    assert core.activity is Activity.WALKING
    run(core, stepping(right=300.0), STAND)
    assert core.activity is Activity.STANDING
    assert float(core.status.stance_leg) == -1.0


@pytest.mark.parametrize("velocity", [(0.3, 0.0), (0.0, -0.6)])
def test_walking_goes_on_while_standing_would_not_bring_it_to_rest(velocity):
    core = walking(0.3)
    for speed in (*[velocity] * 12, (0.0, 0.0)):
        assert core.activity is Activity.WALKING
        for swing_force in (300.0, 0.0):
            left = core.walking.timing.stance == 0
            state = stepping(330.0, swing_force) if left else stepping(swing_force, 330.0)
            state.com_velocity[:2] = speed
            run(core, state, STAND, PERIOD if swing_force else 0.25)
    assert core.activity is Activity.STANDING


def test_walking_goes_on_from_touchdown_to_touchdown():
    core = walking(0.25)
    run(core, stepping(right=300.0), WALK)
    assert core.activity is Activity.WALKING
    assert (float(core.status.stance_leg), float(core.status.step_count)) == (1.0, 1.0)


@pytest.mark.parametrize("mode", [OFF, DAMP])
def test_off_and_damping_take_effect_at_once(mode):
    core = walking()
    command = run(core, stepping(), mode)
    assert (command.torque == 0.0).all()
    assert (command.kp == 0.0).all()
    assert command.kd == pytest.approx(DAMPING if mode is DAMP else np.zeros(10))
    assert (command.velocity == 0.0).all() or mode is OFF


@pytest.mark.parametrize("name", ["q", "com_velocity", "foot_force", "angular_velocity"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_a_state_that_is_no_number_is_refused_and_changes_nothing(name, value):
    core, undisturbed = walking(), walking()
    state = stepping()
    getattr(state, name)[1] = value
    with pytest.raises(ControlError, match=rf"state {name}\[1\] is"):
        run(core, state, WALK)
    assert run(core, stepping(), WALK).to_bytes() == run(undisturbed, stepping(), WALK).to_bytes()


@pytest.mark.parametrize("name", ["vx", "yaw_rate", "height", "roll"])
def test_a_mode_that_is_no_number_is_refused_and_changes_nothing(name):
    core, undisturbed = walking(), walking()
    with pytest.raises(ControlError, match=f"mode {name} is nan, must be finite"):
        core.step(stepping(), mode_of(mode=int(WALK), **{name: np.nan}))
    assert run(core, stepping(), WALK).to_bytes() == run(undisturbed, stepping(), WALK).to_bytes()


def test_an_unknown_mode_is_refused():
    with pytest.raises(ControlError, match=r"mode is 7, must be 0 \.\. 4"):
        controller().step(standing(), mode_of(mode=7))


def test_a_law_that_breaks_sends_nothing_and_starts_afresh(monkeypatch):
    core = walking()

    def broken(readings, mode, command):
        command.torque[2] = np.nan
        return False

    monkeypatch.setattr(core.walking, "step", broken)
    with pytest.raises(ControlError, match=r"command torque\[2\] is nan"):
        run(core, stepping(), WALK)
    monkeypatch.undo()
    assert core.activity is Activity.IDLE
    assert np.isfinite(run(core, standing(), STAND).floats).all()


@pytest.mark.parametrize("mode", [STAND, WALK])
@pytest.mark.parametrize("seed", range(6))
def test_commands_are_finite_and_within_the_limits_whatever_the_state(mode, seed):
    rng = np.random.default_rng(seed)
    core, low, high = walking() if mode is WALK else controller(), *stops()
    for _ in range(30):
        state = random_state(int(rng.integers(1000)), roll=rng.normal(), pitch=rng.normal())
        state.floats[:] *= rng.choice([1.0, 3.0, 1e3])
        state.foot_load[:] = np.clip(state.foot_load, 0.0, 1.0)
        state.contact_probability[:] = np.clip(state.contact_probability, 0.0, 1.0)
        command = run(core, state, mode)
        assert np.isfinite(command.floats).all()
        assert ((command.position > low) & (command.position < high)).all()
        assert ((command.kp >= 0.0) & (command.kp <= 5000.0)).all()
        assert ((command.kd >= 0.0) & (command.kd <= 500.0)).all()


def test_new_gains_take_effect_while_walking_goes_on():
    core = walking()
    timing = core.walking.timing
    phase, rate, steps = timing.phase, timing.rate, timing.steps
    stiff = replace(CONFIG.walk.joints, kp_knee=123.0)
    core.configure(replace(CONFIG, walk=replace(CONFIG.walk, joints=stiff)))
    command = run(core, stepping(), WALK)
    assert command.kp[8] == 123.0
    assert core.activity is Activity.WALKING
    assert timing.steps == steps
    assert timing.phase == pytest.approx(phase + PERIOD * rate)


def test_new_gains_of_standing_and_of_riding_take_effect_while_it_rides():
    core = controller()
    run(core, standing(), RobotMode.SEGWAY, 0.5)
    new = {"stand.kp_knee": 300.0, "segway.kd_hip_roll": 6.0}
    core.configure(replace_checked(CONFIG, **new))
    command = run(core, standing(), RobotMode.SEGWAY)
    assert core.activity is Activity.RIDING
    assert command.kp[3] == pytest.approx(300.0)
    assert command.kd[0] == pytest.approx(6.0)


def test_reset_makes_it_as_new():
    core, fresh = walking(), controller()
    core.reset()
    assert core.activity is Activity.IDLE
    for mode in (STAND, WALK):
        first, second = run(core, standing(), mode, 0.7), run(fresh, standing(), mode, 0.7)
        assert first.to_bytes() == second.to_bytes()


def test_status_tells_tracking_errors_and_saturation():
    core = walking()
    state = stepping()
    command = core.step(state, mode_of(mode=int(WALK), effective_seq=40))
    status = core.status
    assert (int(status.mode), int(status.mode_seq)) == (int(WALK), 40)
    assert status.y == pytest.approx(core.walking.plan.measured - core.walking.plan.desired)
    assert 0.0 < float(status.saturation) < 1.0
    assert float(status.saturation) == pytest.approx(
        np.abs(command.torque / ([112.5, 112.5, 195.2, 195.2, 45.0] * 2)).max()
    )


def test_the_command_answers_its_state():
    state = standing()
    state.seq[...], state.episode[...] = 12, 5
    state.stamp_ns = 24_000_000
    command = run(controller(), state, STAND)
    assert isinstance(command, MotorCommand)
    assert (int(command.seq), int(command.episode), command.stamp_ns) == (12, 5, 24_000_000)
