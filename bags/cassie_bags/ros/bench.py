"""`make bench`: speed of the loop over DDS, with rclpy's default executor, and without DDS.

All variants run the same cores on the same experiment, one after another, several times. The
results are medians. The command prints a table and writes a JSON file.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import os
import platform
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.cli.arguments import positive, seconds
from cassie_bags.errors import RunError
from cassie_bags.ros.bench_operator import operated
from cassie_bags.ros.processes import Processes, environment, executable, own_domain
from cassie_bags.run.cores import connect, make_cores, make_loop, tick_count
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.seed import resolve, write_resolved
from cassie_bags.run.simulate import run
from cassie_msgs.experiment.file import Experiment

FloatArray = npt.NDArray[np.float64]

EXPERIMENT = """
name: bench
start: standing
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.98}
  - {t: 1.0, mode: walk}
duration: 12.0
simulator: {control_rate: 500, pacing: lockstep}
"""

TARGETS = {
    "rtf_five_processes_500hz": (4.5, "at least"),
    "rtf_five_processes_1000hz": (2.6, "at least"),
    "rtf_five_processes_2000hz": (1.4, "at least"),
    "rtf_stack_500hz": (5.5, "at least"),
    "rtf_in_process_500hz": (14.0, "at least"),
    "round_trip_p50_us": (300.0, "at most"),
    "round_trip_p99_us": (1000.0, "at most"),
    "tick_us": (100.0, "at most"),
    "tick_p99_us": (250.0, "at most"),
    "missed_share_realtime_500hz": (1e-4, "at most"),
    "missed_share_realtime_500hz_busy": (0.01, "at most"),
    "missed_share_realtime_500hz_operated": (1e-3, "at most"),
    "page_processor_share": (0.15, "at most"),
    "stick_to_command_page_p99_ms": (60.0, "at most"),
    "stick_to_command_joy_p99_ms": (25.0, "at most"),
}

_SETTLE = 1.0  # s of robot time at the start that are not measured
_TIMEOUT = 120.0  # s of wall time for one run


def main() -> int:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m cassie_bags.ros.bench", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/bench.json"))
    parser.add_argument("--repetitions", type=positive, default=3)
    parser.add_argument("--seconds", type=seconds, default=12.0, help="robot time of a run")
    arguments = parser.parse_args()
    text = EXPERIMENT.replace("12.0", f"{arguments.seconds:g}")
    experiment = resolve(parse_experiment(text, "bench"))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    failures: list[str] = []
    try:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        results = [_measure(experiment, n, failures) for n in range(arguments.repetitions)]
    except KeyboardInterrupt:
        print("bench: stopped", file=sys.stderr)
        return 130
    except OSError as error:
        print(f"bench: error: {error}", file=sys.stderr)
        return 2
    figures = _by_name(results)
    medians = {name: statistics.median(values) for name, values in figures.items()}
    content = {
        **medians,
        "failures": failures,
        "repetitions": results,
        "machine": _machine(),
        "robot_s": arguments.seconds,
    }
    arguments.out.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    print(_table(figures, len(results)))
    print(f"written to {arguments.out}")
    if failures:
        print(f"bench: error: not measured: {'; '.join(failures)}", file=sys.stderr)
    return 3 if failures else 0


def _measure(experiment: Experiment, number: int, failures: list[str]) -> dict[str, float]:
    """Measure every variant once; those that fail are added to `failures`."""
    values: dict[str, float] = {}
    for name, variant in (
        ("five processes", _five_processes),
        ("five processes at 1 kHz", functools.partial(_factor_at, rate=1000)),
        ("five processes at 2 kHz", functools.partial(_factor_at, rate=2000)),
        ("five processes and a recorder", functools.partial(_factor_at, rate=500, record=True)),
        ("estimator and controller in one process", _stack),
        ("default executor", _default_executor),
        ("one process", _one_process),
        ("tick", _tick),
        ("a bare loop", _machine_late),
        ("realtime", functools.partial(_missed, busy=0)),
        ("realtime beside two busy loops", functools.partial(_missed, busy=2)),
        ("realtime with page, joystick and recorder", lambda e: operated(e.duration)),
    ):
        print(f"run {number + 1}: {name}", file=sys.stderr, flush=True)
        try:
            values |= variant(experiment)
        except (RunError, TimeoutError) as error:
            print(f"bench: {name}: {error}", file=sys.stderr)
            failures.append(f"{name} in run {number + 1}")
    return values


def _by_name(results: list[dict[str, float]]) -> dict[str, list[float]]:
    """Values of each figure in the repetitions that have it."""
    names = dict.fromkeys(name for result in results for name in result)
    return {name: [result[name] for result in results if name in result] for name in names}


def _over_dds(
    experiment: Experiment, *, stack: bool = False, record: bool = False
) -> Mapping[str, npt.NDArray[Any]]:
    """Run the installed nodes with a timed simulator; returns the times that it recorded."""
    from cassie_bags.ros.command_node import simulator_client
    from cassie_bags.ros.dds_run import START_TIMEOUT, start_nodes, watch

    def run_nodes(folder: Path, processes: Processes, domain: int) -> None:
        program: list[str | Path] = [
            sys.executable,
            "-m",
            "cassie_bags.ros.bench_simulator",
            folder / "times.npz",
        ]
        if record:
            recorder = executable("cassie_bags", "record")
            processes.start("record", [recorder, "-o", folder / "bag.mcap"])
        start_nodes(experiment, folder, processes, {"simulator": program}, stack=stack)
        with simulator_client(domain) as simulator:
            simulator.resume(START_TIMEOUT)
            watch(experiment, processes, simulator)
            processes.stop()

    return _timed(run_nodes)


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
    """Share of the control ticks without a new command, paced by the wall clock."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    try:
        times = _over_dds(_with(experiment, pacing="realtime", max_rate=1.0))
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    name = "missed_share_realtime_500hz" + ("_busy" if busy else "")
    return {name: float(times["missed"] / len(times["sent"]))}


_LOOP = """
import os, sys, time
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
except OSError:
    pass
due, late, ticks = time.monotonic(), 0, int(sys.argv[1])
for _ in range(ticks):
    due += 0.002
    time.sleep(max(0.0, due - time.monotonic()))
    late += time.monotonic() > due + 0.002
print(late / ticks)
"""


def _machine_late(experiment: Experiment) -> dict[str, float]:
    """Share of the ticks that a bare loop misses: the limit of any software on this machine.

    It only sleeps until each tick of 2 ms, with real-time priority if permitted.
    """
    ticks = str(round(experiment.duration * 500))
    process = subprocess.run([sys.executable, "-c", _LOOP, ticks], capture_output=True, check=True)
    return {"missed_share_bare_loop_500hz": float(process.stdout)}


def _with(experiment: Experiment, **simulator: Any) -> Experiment:
    """An experiment with other parameters of the simulator."""
    return dataclasses.replace(experiment, simulator={**experiment.simulator, **simulator})


def _default_executor(experiment: Experiment) -> dict[str, float]:
    """Five processes with message objects and `rclpy.spin`."""
    from cassie_bags.ros.dds_run import NODES

    def run_nodes(folder: Path, processes: Processes, _: int) -> None:
        file = folder / "experiment.yaml"
        write_resolved(experiment, file)
        for name in NODES:
            module = "cassie_bags.ros.bench_executor"
            processes.start(name, [sys.executable, "-m", module, name, file, folder / "times.npz"])
        deadline = time.monotonic() + _TIMEOUT
        while processes.running("simulator"):
            processes.check("simulator")
            if time.monotonic() > deadline:
                raise TimeoutError(f"the default executor takes more than {_TIMEOUT:g} s")
            time.sleep(0.05)

    sent = _timed(run_nodes)["sent"]
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


def _timed(run_nodes: Callable[[Path, Processes, int], None]) -> Mapping[str, npt.NDArray[Any]]:
    """Play a run in a folder and domain of its own; returns the times from its simulator."""
    with (
        tempfile.TemporaryDirectory(prefix="cassie_bench_") as name,
        own_domain() as domain,
        Processes(environment(domain), Path(name) / "log") as processes,
    ):
        folder = Path(name)
        run_nodes(folder, processes, domain)
        with np.load(folder / "times.npz") as times:
            return dict(times)


def _settled(experiment: Experiment) -> int:
    """Number of ticks at the start that are not measured."""
    return round(_SETTLE * tick_count(experiment) / experiment.duration)


def _factor(experiment: Experiment, times: FloatArray) -> float:
    """Ratio of robot time to wall time, from the wall time of each tick."""
    counted = times[_settled(experiment) :]
    robot = (len(counted) - 1) * experiment.duration / tick_count(experiment)
    return float(robot / (counted[-1] - counted[0]))


def _machine() -> dict[str, Any]:
    return {
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "machine": platform.machine(),
        "python": platform.python_version(),
    }


def _table(figures: Mapping[str, list[float]], repetitions: int) -> str:
    lines = [f"{'median of ' + str(repetitions):38}{'value':>10}{'least':>10}{'most':>10}  target"]
    for name, values in figures.items():
        target = "{1} {0:g}".format(*TARGETS[name]) if name in TARGETS else ""
        numbers = statistics.median(values), min(values), max(values)
        cells = "".join(f"{number:10.4g}" for number in numbers)
        lines.append(f"{name:38}{cells}  {target}")
    load = os.getloadavg()[0]
    lines.append(f"{len(os.sched_getaffinity(0))} cores, load {load:.1f} over the last minute")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
