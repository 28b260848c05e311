"""Keys and the status lines."""

import io
import os
import pty
import termios

from cassie_teleop.keyboard import (
    HELP,
    MODE_KEYS,
    ORDER_KEYS,
    STEPS,
    Keyboard,
    Motion,
    Status,
    help_lines,
    status_lines,
)
from cassie_teleop.terminal import Terminal


def typed(keys):
    keyboard = Keyboard()
    for key in keys:
        keyboard.press(key)
    return keyboard


def test_nothing_is_asked_before_a_power_key():
    assert typed("ww2 ").request is None
    assert typed("p").request.power and not typed("o").request.power


def test_the_emergency_stop_works_with_caps_lock_and_power_alone_moves_nothing():
    request = typed("p2wwaqrO").request
    assert (request.power, request.mode, request.vx, request.vy, request.yaw_rate) == (
        False,
        "stand",
        0,
        0,
        0,
    )
    assert typed("p2wwaqrOp").request == typed("pr").request


def test_keys_step_set_points_within_their_ranges():
    request = typed("p2" + "w" * 5 + "a" * 2).request
    assert (request.mode, request.vx, request.yaw_rate) == ("walk", 0.5, 0.2)
    assert typed("p" + "w" * 99).request.vx == 4.5
    assert typed("p" + "f" * 99).request.height == 0.35


def test_space_stops_motion_and_zero_brings_all_back():
    request = typed("p2wwaaqrr ").request
    assert (request.vx, request.vy, request.yaw_rate, request.mode) == (0, 0, 0, "walk")
    assert request.height > 0.93
    assert typed("p2wwrr0").request == typed("p2").request


def test_every_key_is_in_the_help_and_none_has_two_meanings():
    keys = [*STEPS, *MODE_KEYS, *ORDER_KEYS, "p", "o", "x", "0", "c"]
    assert len(set(keys)) == len(keys)
    assert all(key in HELP for key in keys)


def test_a_key_that_does_nothing_is_answered():
    assert Keyboard().press("§") == "'§' does nothing: ? lists the keys"
    assert Keyboard().press("special key") == "special key does nothing: ? lists the keys"
    assert Keyboard().press("w") == "press p for power on first, or o for power off"
    assert typed("p").press("w") == ""
    assert typed("px").left


def test_keys_without_a_character_are_named():
    """F5, an arrow of either kind, Esc, and Alt with a letter that ends an arrow, too."""
    keyboard, program = pty.openpty()
    with os.fdopen(program) as source, io.StringIO() as sink:
        terminal = Terminal(source, sink)
        try:
            os.write(keyboard, b"w\x1b[15~\x1b[A\x1bOB\x1bA\x1b")
            pressed = terminal.keys(1.0)
        finally:
            terminal.close()
            os.close(keyboard)
    assert pressed == ["w", "special key", "up", "down", "special key", "Esc"]


def test_keys_need_no_enter_after_a_shell_had_the_terminal():
    keyboard, program = pty.openpty()
    shell = termios.tcgetattr(program)
    with os.fdopen(program) as source, io.StringIO() as sink:
        terminal = Terminal(source, sink)
        try:
            termios.tcsetattr(program, termios.TCSADRAIN, shell)
            os.write(keyboard, b"o")
            assert terminal.keys(1.0) == ["o"]
        finally:
            terminal.close()
            os.close(keyboard)


def test_arrows_do_what_letters_do():
    assert typed(["p", "2", "up", "up", "left"]).request == typed("p2wwa").request
    assert typed(["p", "2", "down", "right"]).request == typed("p2sd").request


def test_keys_of_the_simulator_work_without_power_and_the_bar_alternates():
    keyboard = typed("nb")
    keyboard.obeyed("let_go_bar")
    for key in "buz":
        keyboard.press(key)
    assert keyboard.request is None
    assert keyboard.orders == ["lower", "let_go_bar", "hold_bar", "hang_up", "reset"]


def test_a_bar_that_the_simulator_did_not_let_go_of_is_still_to_be_let_go():
    keyboard = typed("bb")
    assert keyboard.orders == ["let_go_bar", "let_go_bar"]


def test_lines_tell_mode_reason_faults_age_and_fit():
    status = Status("stand", "hanging on the gantry", ["estimator lost " * 9], 2.0)
    motion = Motion(limited=(0.1, 0.0, 0.0, 0.9), achieved=(0.08, 0.01, -0.02, 0.91), segway=1.25)
    lines = status_lines(typed("p2w").request, status, motion, 80)
    text = "\n".join(lines)
    for part in (
        "stand (2.0 s ago)",
        "hanging",
        "fault: estimator lost",
        "Segway",
        "+1.25",
        "walk",
    ):
        assert part in text
    assert "limited     +0.10  +0.00  +0.00   0.90" in lines
    assert "achieved    +0.08  +0.01  -0.02   0.91" in lines
    for width in (80, 39):  # of a terminal with 40 columns one stays free
        lines = status_lines(typed("p2w").request, status, motion, width)
        assert max(map(len, lines)) <= width
        assert "achieved    +0.08  +0.01  -0.02   0.91" in lines


def test_the_help_breaks_between_words():
    for width in (79, 39):
        lines = help_lines(width)
        assert max(map(len, lines)) <= width
        assert "".join(lines).split() == HELP.split()


def test_a_narrow_window_gets_lines_as_well():
    status = Status("stand", "hanging on the gantry", ["fallen"], 0.1)
    for width in range(-1, 30):
        lines = status_lines(typed("p2").request, status, Motion(limited=(0.1, 0, 0, 0.9)), width)
        assert max(map(len, lines)) <= max(width, 20)


def test_lines_that_do_not_fit_into_the_window_are_left_out(monkeypatch):
    monkeypatch.setenv("COLUMNS", "11")
    monkeypatch.setenv("LINES", "2")
    keyboard, program = pty.openpty()
    with os.fdopen(program) as source, io.StringIO() as sink:
        terminal = Terminal(source, sink)
        try:
            terminal.show(["stand", "a line that is too long", "one line too many"])
        finally:
            terminal.close()
            os.close(keyboard)
        assert sink.getvalue().rstrip("\n").endswith("stand\na line tha")


def test_who_else_drives_and_what_speeds_wait_for_is_told():
    other = Status("stand", "", [], 0.1, other="rc_teleop-7")
    text = "".join(status_lines(typed("p2w").request, other, Motion(), 80))
    assert "rc_teleop-7 drives: c takes over" in text
    disarmed = Status("walk", "", [], 0.1, armed=False)
    assert "space" in "".join(status_lines(typed("p2w").request, disarmed, Motion(), 80))
    assert "space" not in "".join(status_lines(typed("p2").request, disarmed, Motion(), 80))


def test_nothing_sounds_wrong_before_anything_is():
    lines = status_lines(None, Status("off", "", [], 0.1), Motion(), 80)
    assert lines[0] == "off" and "fault" not in "".join(lines)
    assert "press p" in lines[2]
    assert "no status from the supervisor" in status_lines(None, None, Motion(), 80)[0]


def test_tilt_and_lean_are_shown_when_there_are_some():
    assert "lean" not in "".join(status_lines(typed("p2").request, None, Motion(), 80))
    text = "".join(status_lines(typed("p3iijth").request, None, Motion(), 200))
    assert "roll +0.02 pitch +0.02 rad" in text and "lean +0.02 +0.01 m" in text
