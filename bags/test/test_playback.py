"""Playback of a recording: when each message is due, without a clock of its own."""

from __future__ import annotations

import math

import pytest

from cassie_bags.bag.playback import Playback

TIMES = [1_000, 1_000, 2_000, 3_000, 4_000]


def due(playback: Playback, wall: int) -> list[int]:
    """All that is due by a wall time."""
    found = []
    while (index := playback.next(wall)[0]) is not None:
        found.append(index)
    return found


def test_messages_are_due_when_the_rate_says():
    playback = Playback(TIMES, rate=2.0)
    assert due(playback, 0) == [0, 1]
    assert playback.next(0) == (None, pytest.approx(500e-9))
    assert due(playback, 499) == []
    assert due(playback, 500) == [2]
    playback.set_rate(1.0, 500)
    assert due(playback, 1_499) == [] and due(playback, 1_500) == [3]
    assert not playback.finished
    assert due(playback, 9_000) == [4]
    assert playback.finished and playback.next(9_000) == (None, math.inf)


def test_time_stands_still_while_paused():
    playback = Playback(TIMES, paused=True)
    assert due(playback, 0) == [0, 1] and due(playback, 9_000) == []
    playback.pause(False, 9_000)
    assert due(playback, 10_000) == [2]
    playback.pause(True, 10_500)
    assert playback.position(99_000) == 2_500 and playback.next(99_000)[1] == math.inf
    playback.pause(False, 99_000)
    assert due(playback, 99_500) == [3]


def test_a_step_plays_all_messages_of_the_next_time():
    playback = Playback(TIMES, paused=True, begin=500)
    assert due(playback, 0) == []
    for expected in ([0, 1], [2], [3], [4]):
        assert playback.step(0)
        assert due(playback, 50_000) == expected
    assert not playback.step(0)
    assert not Playback(TIMES).step(0)  # it is not paused


def test_seeking_plays_from_there_and_stays_inside():
    playback = Playback(TIMES)
    due(playback, 0)
    assert list(playback.seek(3_000, 100)) == [2]
    assert due(playback, 100) == [3]
    assert not playback.seek(-5, 200)
    assert due(playback, 200) == [0, 1]
    playback.seek(99_000, 300)
    assert due(playback, 300) == [4] and playback.finished
    playback.seek(2_000, 400)
    assert not playback.finished and due(playback, 400) == [2]


def test_only_the_part_asked_for_is_played_again_and_again():
    playback = Playback(TIMES, begin=1_500, end=3_500, loop=True)
    assert due(playback, 0) == []
    assert due(playback, 1_500) == [2, 3]
    wait = playback.next(1_500)[1]
    assert wait > 0 and playback.rounds == 1
    assert due(playback, 3_000) == [2, 3]
    assert not playback.finished


def test_a_part_without_messages_is_finished_at_once():
    playback = Playback(TIMES, begin=4_100, end=4_200)
    assert playback.finished and playback.next(0) == (None, math.inf)
