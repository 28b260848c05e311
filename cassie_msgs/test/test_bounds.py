"""Numbers that cannot come from a node that works are refused, and a stream that went on is not."""

import numpy as np
import pytest

from cassie_msgs.bounds import CONFIRMED, LEAD, Progress, outside


def test_outside_names_value_and_range():
    assert outside("seq", 5, 0, 5) == ""
    assert outside("seq", 2**62, 0, 5) == "seq = 4611686018427387904 is outside 0 .. 5"
    assert outside("seq", -1, 0, 5) == "seq = -1 is outside 0 .. 5"


def test_repeats_steps_gaps_and_new_episodes_are_believed():
    progress = Progress()
    for episode, seq in ((7, 0), (7, 0), (7, 1), (7, 40), (8, 0), (8, 1), (2**31, 3)):
        assert progress.refusal(episode, seq) == ""


@pytest.mark.parametrize(
    "key", [(7, 2**62), (7, 101 + LEAD), (7, 99), (6, 100), (7 + 2**31 + 1, 0), (0, 0)]
)
def test_a_number_out_of_bounds_changes_nothing(key):
    progress = Progress()
    assert progress.refusal(7, 100) == ""
    assert "is outside" in progress.refusal(*key)
    assert progress.refusal(7, 101) == ""


def test_a_stream_that_went_on_while_nobody_listened_is_believed_after_a_few():
    progress = Progress()
    progress.refusal(7, 100)
    far = 100 + 2 * LEAD
    refusals = [progress.refusal(7, far + tick) for tick in range(CONFIRMED + 2)]
    assert [bool(text) for text in refusals] == [True] * (CONFIRMED - 1) + [False] * 3


def test_random_numbers_are_not_believed_beside_a_stream():
    rng = np.random.default_rng(1)
    progress = Progress()
    for tick in range(2000):
        assert progress.refusal(7, tick) == ""
        assert progress.refusal(int(rng.integers(2**32)) | 2**31, int(rng.integers(2**63))) != ""


def test_after_a_restart_any_number_is_the_first():
    progress = Progress()
    progress.refusal(7, 100)
    progress.restart()
    assert progress.refusal(3, 5) == ""
