"""Who computes: the same results from this process, local processes and a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from tqdm import tqdm

from cassie_bags.errors import RunError
from cassie_bags.studies.workers import (
    DaskCluster,
    LocalProcesses,
    ThisProcess,
    Workers,
    all_results,
    workers,
)

ITEMS = [3, 1, 2, 5]


def double(number: int) -> int:
    return 2 * number


def refuse(number: int) -> int:
    raise RunError(f"{number} is refused")


def local_cluster(workers: int) -> Any:
    """A cluster in this process; imported here, as workers load this file to find `double`."""
    from distributed import LocalCluster

    return LocalCluster(n_workers=workers, processes=False, dashboard_address=None)


@pytest.fixture(params=["here", "local", "dask"])
def pool(request: pytest.FixtureRequest) -> Iterator[Workers]:
    if request.param == "here":
        yield ThisProcess()
    elif request.param == "local":
        local = LocalProcesses(2)
        yield local
        local.close()
    else:
        with local_cluster(1) as cluster:
            remote = DaskCluster(cluster.scheduler_address)
            yield remote
            remote.close()


def test_every_item_gets_its_result_and_an_error_comes_back(pool: Workers):
    assert dict(pool.results(double, ITEMS)) == {0: 6, 1: 2, 2: 4, 3: 10}
    with pytest.raises(RunError, match="3 is refused"):
        list(pool.results(refuse, [3]))
    assert pool.count >= 1


def test_all_results_are_in_the_order_of_the_items():
    class Backwards(ThisProcess):
        def results(self, function, items):
            yield from reversed(list(super().results(function, items)))

    with tqdm(total=len(ITEMS), disable=True) as bar:
        assert all_results(Backwards(), double, ITEMS, bar) == [6, 2, 4, 10]


def test_what_is_not_wanted_is_not_begun():
    begun = []
    results = ThisProcess().results(begun.append, ITEMS)
    next(results)
    results.close()
    assert begun == [3]


def wait_a_second(number: int) -> int:
    time.sleep(1.0)
    return number


def test_a_process_lost_when_no_more_is_wanted_says_nothing(monkeypatch: pytest.MonkeyPatch):
    said: list[object] = []
    monkeypatch.setattr(threading, "excepthook", said.append)
    before = set(threading.enumerate())
    pool = LocalProcesses(1)
    results = pool.results(wait_a_second, [0] * 10)
    next(results)
    results.close()
    for process in multiprocessing.active_children():
        process.kill()
    for thread in set(threading.enumerate()) - before:
        thread.join(10.0)
    pool.close()
    assert not said


def test_closed_at_work_it_leaves_neither_process_nor_thread():
    before = set(threading.enumerate())
    pool = LocalProcesses(2)
    results = pool.results(wait_a_second, [0] * 10)
    next(results)
    pool.close()
    assert set(threading.enumerate()) == before
    assert not multiprocessing.active_children()


def die(_: int) -> int:
    os._exit(9)


def test_a_process_that_dies_is_one_clear_error():
    pool = LocalProcesses(1)
    with pytest.raises(RunError, match="a worker process died"):
        list(pool.results(die, ITEMS))
    pool.close()


def blocked_signals(_: int) -> bool:
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_process_gets_no_ctrl_c_from_its_first_moment_on():
    pool = LocalProcesses(1)
    assert dict(pool.results(blocked_signals, [0])) == {0: True}
    assert not blocked_signals(0)
    pool.close()


def lack_a_package(_: int) -> int:
    raise ModuleNotFoundError("No module named 'cassie_bags'")


def test_workers_of_a_cluster_that_cannot_are_one_clear_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("cassie_bags.studies.workers.CONNECT_TIMEOUT", 1)
    with local_cluster(0) as cluster:
        with pytest.raises(RunError, match="had no worker within 1 s"):
            DaskCluster(cluster.scheduler_address)
        cluster.scale(1)
        remote = DaskCluster(cluster.scheduler_address)
        with pytest.raises(RunError, match="No module named 'cassie_bags'"):
            list(remote.results(lack_a_package, [0]))
        remote.close()


def test_as_many_processes_as_cores_unless_said_otherwise():
    pool = workers(None, None)
    assert pool.count == len(os.sched_getaffinity(0))
    pool.close()


def test_a_missing_scheduler_is_one_clear_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("cassie_bags.studies.workers.CONNECT_TIMEOUT", 1)
    with pytest.raises(RunError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        workers(None, "tcp://127.0.0.1:9")
