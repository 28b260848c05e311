"""After a violent fall it is switched off, hung up and let down, and stands as if nothing had been.

`CASSIE_FALLS=101-120 python3 -m pytest bags/test/test_violent_falls.py` tries these seeds.
"""

from __future__ import annotations

import os

import pytest
from violent_falls import draw_fall, fall_and_stand

FIRST, _, LAST = os.environ.get("CASSIE_FALLS", "13-15").partition("-")


@pytest.mark.parametrize("seed", range(int(FIRST), int(LAST or FIRST) + 1))
def test_it_stands_again_after_a_violent_fall(seed):
    outcome = fall_and_stand(seed)
    print(outcome)
    assert outcome.fell
    assert outcome.stands, outcome
    if outcome.lost > 0.0:
        assert "switch the power off and hang it up or let it lie still for 1 s" in outcome.words


def test_a_seed_always_draws_the_same_fall():
    assert draw_fall(4) == draw_fall(4)
    assert draw_fall(4) != draw_fall(5)
