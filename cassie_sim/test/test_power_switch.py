"""Whose commands move the power switch."""

from __future__ import annotations

from cassie_msgs.layout import OperatorCommand
from cassie_sim.power_switch import PowerSwitch

A, B = b"a" * 16, b"b" * 16


def answer(seq: int, *, episode: int = 7, power: bool = True) -> OperatorCommand:
    command = OperatorCommand()
    command.episode[...], command.seq[...], command.effective_seq[...] = episode, seq, seq + 10
    command.power[...], command.scripted[...] = power, True
    return command


def test_a_second_script_counts_once_the_first_has_been_silent() -> None:
    switch = PowerSwitch(scripted=True, start_timeout=1.0)
    switch.take(answer(0), A, 7, 0, now=1.0)
    switch.take(answer(10), B, 7, 10, now=1.2)
    assert switch.refused == "another script plays already"
    switch.take(answer(20), B, 7, 20, now=4.1)
    assert not switch.refused
    switch.take(answer(20), A, 7, 20, now=4.2)
    assert switch.refused == "another script plays already"


def test_a_script_that_a_busy_machine_holds_up_or_a_pause_silences_still_plays() -> None:
    switch = PowerSwitch(scripted=True, start_timeout=1.0)
    switch.take(answer(0), A, 7, 0, now=1.0)
    switch.give_up()
    switch.take(answer(10), B, 7, 10, now=2.5)
    assert switch.refused == "another script plays already"
    switch.take(answer(10), A, 7, 10, now=2.6)
    assert not switch.refused
    assert not switch.lost
    switch.pause(now=30.0)
    switch.take(answer(20), B, 7, 20, now=30.5)
    assert switch.refused == "another script plays already"


def test_an_answer_from_the_future_or_of_another_episode_is_not_planned() -> None:
    switch = PowerSwitch(scripted=True, start_timeout=1.0)
    switch.take(answer(2**62), A, 7, 100, now=1.0)
    assert switch.refused.startswith("effective_seq = 4611686018427387914 is outside 0 .. 110")
    switch.take(answer(0, episode=12345), A, 7, 0, now=1.0)
    assert switch.awaits(0)


def test_a_script_that_nobody_expects_is_refused() -> None:
    switch = PowerSwitch(scripted=False, start_timeout=1.0)
    switch.take(answer(0, episode=12345), A, 7, 0, now=1.0)
    assert "no script is expected" in switch.refused
    assert not switch.apply(10)
