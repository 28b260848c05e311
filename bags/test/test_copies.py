"""Copies of a process that go on by themselves."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time

import pytest

from cassie_bags.errors import RunError
from cassie_bags.studies.workers import in_copies

COUNT = [0]


def count_on(by: int) -> tuple[int, int]:
    COUNT[0] += by
    return COUNT[0], os.getpid()


def test_each_begins_as_a_copy_of_the_same_and_results_keep_their_order():
    COUNT[0] = 10
    results = list(in_copies(count_on, [3, 1, 2, 5], 2))
    assert [count for count, _ in results] == [13, 11, 12, 15]
    assert len({process for _, process in results} | {os.getpid()}) == 5
    assert COUNT == [10]


def test_an_error_comes_back_and_leaves_no_process():
    def refuse(number: int) -> int:
        if number:
            time.sleep(60.0)
        raise RunError(f"{number} is refused")

    with pytest.raises(RunError, match="0 is refused"):
        list(in_copies(refuse, [1, 0], 2))
    assert multiprocessing.active_children() == []


def test_a_copy_that_dies_is_one_clear_error():
    with pytest.raises(RunError, match="a worker process died"):
        list(in_copies(lambda _: os.kill(os.getpid(), signal.SIGKILL), [0, 1], 1))


def test_what_is_no_longer_wanted_is_ended():
    results = in_copies(lambda seconds: time.sleep(seconds), [0.0, 60.0], 2)
    next(results)
    results.close()
    assert multiprocessing.active_children() == []
