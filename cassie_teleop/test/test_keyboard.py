"""Keys and the status line."""

from cassie_teleop.keyboard import HELP, MODE_KEYS, STEPS, Keyboard, Status, status_line


def typed(keys):
    keyboard = Keyboard()
    for key in keys:
        keyboard.press(key)
    return keyboard


def test_nothing_is_wished_before_a_power_key():
    assert typed("ww2 ").wish is None
    assert typed("p").wish.power and not typed("o").wish.power


def test_the_emergency_stop_works_with_caps_lock_and_power_alone_moves_nothing():
    wish = typed("p2wwaqrO").wish
    assert (wish.power, wish.mode, wish.vx, wish.vy, wish.yaw_rate) == (False, "stand", 0, 0, 0)
    assert typed("p2wwaqrOp").wish == typed("pr").wish


def test_keys_step_set_points_within_their_ranges():
    wish = typed("p2" + "w" * 5 + "a" * 2).wish
    assert (wish.mode, wish.vx, wish.yaw_rate) == ("walk", 0.5, 0.2)
    assert typed("p" + "w" * 99).wish.vx == 4.5
    assert typed("p" + "f" * 99).wish.height == 0.35


def test_space_stops_motion_and_zero_brings_all_back():
    wish = typed("p2wwaaqrr ").wish
    assert (wish.vx, wish.vy, wish.yaw_rate, wish.mode) == (0, 0, 0, "walk")
    assert wish.height > 0.93
    assert typed("p2wwrr0").wish == typed("p2").wish


def test_every_key_is_in_the_help_and_none_has_two_meanings():
    keys = [*STEPS, *MODE_KEYS, "p", "o", "x", "0"]
    assert len(set(keys)) == len(keys)
    assert all(key in HELP for key in keys)


def test_unknown_keys_mean_nothing():
    assert not Keyboard().press("§") and not typed("p").press("z")
    assert typed("px").left


def test_the_line_tells_mode_reason_faults_age_and_fits():
    status = Status("stand", "hanging on the gantry", ["estimator lost"], 2.0)
    line = status_line(typed("p2w").wish, status, 300)
    for part in ("stand (2.0 s ago)", "hanging", "FAULT: estimator lost", "vx +0.10", "walk"):
        assert part in line
    assert len(status_line(None, status, 40)) == 40
    assert "no word from the supervisor" in status_line(None, None, 200)
    assert "ago" not in status_line(None, Status("walk", "", [], 0.1), 200)


def test_a_narrow_terminal_still_shows_what_the_supervisor_waits_for():
    waits = "the feet carry 120 N of 312 N: let her down"
    line = status_line(typed("p2wwaaiijj").wish, Status("stand", waits, [], 0.1), 80)
    assert line.startswith(f"stand | not yet: {waits} | walk ")


def test_tilt_and_lean_are_shown_when_there_are_some():
    assert "lean" not in status_line(typed("p2").wish, None, 200)
    line = status_line(typed("p3iijth").wish, None, 200)
    assert "roll +0.02 pitch +0.02 rad lean +0.02 +0.01 m" in line
