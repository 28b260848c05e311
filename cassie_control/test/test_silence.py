"""Who counts as lost, and from when on."""

from __future__ import annotations

from cassie_control.silence import Silence


def test_lost_after_its_limit_and_found_when_heard() -> None:
    silence = Silence(0.7, 10.0, now=100.0)
    silence.heard(101.0)
    assert not silence.lost(101.6)
    assert silence.lost(101.8)
    silence.heard(102.0)
    assert not silence.lost(102.1)


def test_before_it_was_heard_it_has_more_time() -> None:
    silence = Silence(0.7, 10.0, now=100.0)
    assert not silence.lost(109.9)
    assert silence.lost(110.1)


def test_an_excuse_counts_anew() -> None:
    silence = Silence(0.7, 10.0, now=100.0)
    silence.heard(101.0)
    silence.excuse(105.0)
    assert not silence.lost(105.6)
    assert silence.lost(105.8)
