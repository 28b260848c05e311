"""Parts of `make bench`: each measures one way to run the loop, in a process of its own.

    python -m cassie_bags.ros.bench_parts PART SECONDS FILE

writes the figures of a part as JSON.
"""

from __future__ import annotations

import dataclasses
import faulthandler
import functools
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.rows import FloatArray
from cassie_bags.errors import RunError
from cassie_bags.ros.bench_operator import operated
from cassie_bags.ros.command_node import simulator_client
from cassie_bags.ros.dds_run import NODES, START_TIMEOUT, start_nodes, watch
from cassie_bags.ros.processes import Processes, environment, executable, own_domain
from cassie_bags.run.cores import connect, make_cores, make_loop, tick_count
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.seed import resolve, write_resolved
from cassie_bags.run.simulate import run
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.processes import end_within, interrupt
from cassie_msgs.ros.process import LEAVE_TIMEOUT

EXPERIMENT = """
name: bench
start: standing
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.98}
  - {t: 1.0, mode: walk}
duration: 12.0
simulator: {control_rate: 500, pacing: lockstep}
"""

_SETTLE = 1.0  # s of robot time at the start that are not measured
_TIMES = "times.npz"  # file of a simulator


def main(words: list[str]) -> int:
    """Measure one part and write its figures; why it failed is the last line on stderr."""
    part, seconds, file = words
    faulthandler.enable()
    signal.signal(signal.SIGTERM, interrupt)
    text = EXPERIMENT.replace("12.0", f"{float(seconds):g}")
    code = 0
    try:
        figures = PARTS[part](resolve(parse_experiment(text, "bench")))
        Path(file).write_text(json.dumps(figures), encoding="utf-8")
    except RunError as error:
        print(error, file=sys.stderr)
        code = 3
    except KeyboardInterrupt:
        code = 130
    end_within(LEAVE_TIMEOUT, code)
    return code


Times = Mapping[str, npt.NDArray[Any]]
"""What a simulator recorded, by name: see `bench_simulator` and `bench_executor`."""


def _over_dds(experiment: Experiment, *, stack: bool = False, record: bool = False) -> Times:
    """Run the installed nodes with a timed simulator."""
    with _nodes() as (folder, processes, domain):
        program = _module("bench_simulator", folder / _TIMES)
        if record:
            recorder = executable("cassie_bags", "record")
            processes.start("record", [recorder, "-o", folder / "bag.mcap"])
        start_nodes(experiment, folder, processes, {"simulator": program}, stack=stack)
        with simulator_client(domain) as simulator:
            simulator.resume(START_TIMEOUT)
            watch(experiment, processes, simulator)
            processes.stop()
        return dict(np.load(folder / _TIMES))


def _module(name: str, *words: str | Path) -> list[str | Path]:
    """Command that runs a module beside this one."""
    return [sys.executable, "-m", f"cassie_bags.ros.{name}", *words]


@contextmanager
def _nodes() -> Iterator[tuple[Path, Processes, int]]:
    """A folder, the processes of a run, and its domain, which no other run uses."""
    with (
        tempfile.TemporaryDirectory(prefix="cassie_bench_") as name,
        own_domain() as domain,
        Processes(environment(domain), Path(name) / "log") as processes,
    ):
        yield Path(name), processes, domain


def _five_processes(experiment: Experiment) -> dict[str, float]:
    """Real-time factor, and the time from a sample to its command."""
    times = _over_dds(experiment)
    sent, answered = times["sent"], times["answered"]
    skip = _settled(experiment)
    trips = (answered - sent)[skip:] * 1e6
    return {
        "rtf_five_processes_500hz": _factor(experiment, sent),
        "round_trip_p50_us": float(np.nanpercentile(trips, 50)),
        "round_trip_p99_us": float(np.nanpercentile(trips, 99)),
    }


def _factor_at(experiment: Experiment, rate: int, record: bool = False) -> dict[str, float]:
    """Real-time factor at a control rate, with or without a recorder."""
    changed = _with(experiment, control_rate=rate)
    name = f"rtf_five_processes_{rate}hz" + ("_recorded" if record else "")
    return {name: _factor(changed, _over_dds(changed, record=record)["sent"])}


def _stack(experiment: Experiment) -> dict[str, float]:
    """Real-time factor with estimator and controller as two nodes of one process."""
    return {"rtf_stack_500hz": _factor(experiment, _over_dds(experiment, stack=True)["sent"])}


def _missed(experiment: Experiment, busy: int) -> dict[str, float]:
    """Share of the control ticks without a new command, paced by the wall clock.

    On an idle machine also the share of ticks that the machine itself takes away: see `_WATCHER`.
    """
    loops = [[sys.executable, "-c", "while True: pass"]] * busy
    cores = os.sched_getaffinity(0) if not busy else ()
    watchers = [[sys.executable, "-c", _WATCHER, str(core)] for core in cores]
    beside = [subprocess.Popen(words, stdout=subprocess.PIPE) for words in loops + watchers]
    try:
        times = _over_dds(_with(experiment, pacing="realtime", max_rate=1.0))
        for process in beside:
            process.terminate()
        stalled = [np.array(process.communicate()[0].split(), float) for process in beside]
    finally:
        for process in beside:
            process.kill()
            process.wait()
    sent = times["sent"]
    name = "missed_share_realtime_500hz" + ("_busy" if busy else "")
    figures = {name: float(times["missed"] / len(sent))}
    if watchers:
        taken = np.concatenate(stalled)
        within = (sent[0] < taken) & (taken < sent[-1])
        figures["stalled_share_realtime_500hz"] = float(within.sum() / len(sent))
    return figures


_WATCHER = """
import os, sys, time
os.sched_setaffinity(0, [int(sys.argv[1])])
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
except OSError:
    pass
due = time.perf_counter()
while True:
    due += 0.001
    time.sleep(max(0.0, due - time.perf_counter()))
    late = time.perf_counter() - due
    if late > 0.001:
        print(due, flush=True)
    due += late
"""
"""Program that tells when a processor stood still for more than 1 ms.

It runs before the nodes if the system permits it, so only the system itself or the host of a
virtual machine can stop it. No software that runs beside it answers while its processor stands
still.
"""


def _with(experiment: Experiment, **simulator: Any) -> Experiment:
    """An experiment with other parameters of the simulator."""
    return dataclasses.replace(experiment, simulator={**experiment.simulator, **simulator})


def _default_executor(experiment: Experiment) -> dict[str, float]:
    """Five processes with message objects and `rclpy.spin`."""
    with _nodes() as (folder, processes, _):
        file = folder / "experiment.yaml"
        write_resolved(experiment, file)
        for name in NODES:
            processes.start(name, _module("bench_executor", name, file, folder / _TIMES))
        while processes.running("simulator"):
            processes.check("simulator")
            time.sleep(0.05)
        sent = np.load(folder / _TIMES)["sent"]
    return {"rtf_default_executor_500hz": _factor(experiment, sent)}


def _one_process(experiment: Experiment) -> dict[str, float]:
    """Real-time factor of the cores in one process; the physics in its own thread if possible."""
    loop = make_loop(experiment, lambda *_: None, physics_thread=len(os.sched_getaffinity(0)) > 1)
    times: list[float] = []

    def ticks() -> Any:
        for tick in range(tick_count(experiment)):
            times.append(time.perf_counter())
            yield tick

    run(loop, ticks())
    return {"rtf_in_process_500hz": _factor(experiment, np.array(times))}


def _tick(experiment: Experiment) -> dict[str, float]:
    """Time of one tick of estimator and controller together."""
    cores = make_cores(experiment)
    estimator, controller = _Timed(cores.estimator), _Timed(cores.controller)
    timed: Any = {"estimator": estimator, "controller": controller}
    loop = connect(dataclasses.replace(cores, **timed), lambda *_: None)
    run(loop, range(tick_count(experiment)))
    both = (np.array(estimator.times) + np.array(controller.times))[_settled(experiment) :] * 1e6
    return {"tick_us": float(np.median(both)), "tick_p99_us": float(np.percentile(both, 99))}


class _Timed:
    """A core that measures the time of each step."""

    def __init__(self, core: Any) -> None:
        self._core = core
        self.times: list[float] = []

    def step(self, *arguments: Any) -> Any:
        started = time.perf_counter()
        answer = self._core.step(*arguments)
        self.times.append(time.perf_counter() - started)
        return answer

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)


def _settled(experiment: Experiment) -> int:
    """Number of ticks at the start that are not measured."""
    return round(_SETTLE * tick_count(experiment) / experiment.duration)


def _factor(experiment: Experiment, times: FloatArray) -> float:
    """Ratio of robot time to wall time, from the wall time of each tick."""
    counted = times[_settled(experiment) :]
    robot = (len(counted) - 1) * experiment.duration / tick_count(experiment)
    return float(robot / (counted[-1] - counted[0]))


PARTS: Mapping[str, Callable[[Experiment], dict[str, float]]] = {
    "five processes": _five_processes,
    "five processes at 1 kHz": functools.partial(_factor_at, rate=1000),
    "five processes at 2 kHz": functools.partial(_factor_at, rate=2000),
    "five processes and a recorder": functools.partial(_factor_at, rate=500, record=True),
    "estimator and controller in one process": _stack,
    "default executor": _default_executor,
    "one process": _one_process,
    "tick": _tick,
    "realtime": functools.partial(_missed, busy=0),
    "realtime beside two busy loops": functools.partial(_missed, busy=2),
    "realtime with page, joystick and recorder": lambda e: operated(e.duration),
}
"""What measures each part, in the order of the benchmark."""

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
