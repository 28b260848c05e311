"""Step-to-step maps of gaits after small pushes, in the simulation with the controller.

A run walks at a constant speed to the touchdown of a left foot, and continues without a push. With
each of several small pushes the run continues in another process, a copy of the first. Robot and
sensor noise are the same in all processes, so that all differences come from the push.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.ticker import MaxNLocator

from cassie_bags.bag.rows import FloatArray
from cassie_bags.errors import ExperimentError, RunError
from cassie_bags.report.figures import drawing
from cassie_bags.run.cores import connect, make_cores
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.seed import resolve
from cassie_bags.studies.results import check_results, markdown, put_results
from cassie_bags.studies.return_map_fit import (
    DECAYED,
    Deviations,
    ReturnMap,
    decay,
    fit,
    size_of,
    steps_to_decay,
)
from cassie_bags.studies.run_trial import CHECK_TICKS, has_fallen
from cassie_bags.studies.trial import walking_operator
from cassie_bags.studies.workers import in_copies
from cassie_control.learning.torque_table import SPEEDS
from cassie_gaits import robot
from cassie_gaits.gait_library_file import default_library_path, library_path, load_certified
from cassie_gaits.processes import available_cores
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.experiment.scenario import Push
from cassie_msgs.layout import Mode

SECTION = "Return maps"
"""Heading of the maps' table in a file of results."""

HEADINGS = (
    *("speed m/s", "runs", "d after 2 steps", "4", "8", f"steps to {DECAYED:g}", "noise m/s"),
    *("eigenvalues of two steps", "largest, a run left out", "residual (pairs)"),
)
"""Headings of the table."""

_STRONGEST = 10.0  # N s, largest push; the deviation after a larger one is no longer small
_STEADY = 12.0  # s of robot time after which the gait counts as steady
_IMPULSES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))  # forward, backward, left, right
_DELAYS = (0.0, 0.2)  # s from the left foot's touchdown to the push: with either foot on the ground
_PUSH_TIME = 0.1  # s, duration of a push
_NOISE_SHARE = 0.01  # of a push: a tiny one, which shows noise of ticks, contacts and estimator
_STEPS = 14  # number of touchdowns that are observed after the push
_PENDULUM_HEIGHT = 0.9  # m, height of the CoM over the ground, for `POSITION_RATE`

POSITION_RATE = math.sqrt(robot.GRAVITY / _PENDULUM_HEIGHT)
"""sqrt(g / height): converts the CoM's position to a velocity. In 1/s."""

_SLOWEST = 1.5  # s, longest time of a step; a run without a touchdown counts as stopped
_RUNS = len(_IMPULSES) * len(_DELAYS) + 2  # and a run without a push, and one that shows the noise
_ACROSS = 5  # largest number of panels side by side in the picture


@dataclass(frozen=True)
class Touchdowns:
    """Touchdowns of one run after the time of the copy.

    Attributes:
        time: Time of each touchdown since the copy was made. Shape (n,), in s.
        states: CoM velocity (x, y), and CoM position from the new stance foot (x, y) times
            `POSITION_RATE`, both in the heading frame and in m/s. The last two are the CoM's
            displacement since the copy, in m: the controller holds position and mean speed by it.
            y is mirrored where the right foot has landed. Shape (n, 6).
        fell: Whether the robot fell or stopped.
    """

    time: FloatArray
    states: FloatArray
    fell: bool


@dataclass(frozen=True)
class Measurement:
    """Result at one speed.

    Attributes:
        speed: Commanded speed. In m/s.
        deviations: Deviations of each valid run, from the first touchdown after the push on.
        dropped: Number of runs whose steps lost their match with the run without a push.
        fell: Number of runs that fell.
        noise: Median deviation after a push that is too weak to matter. In m/s.
        map: Map of two steps, or None if too few deviations are above the noise.
    """

    speed: float
    deviations: list[Deviations]
    dropped: int
    fell: int
    noise: float
    map: ReturnMap | None


def experiment_of(speed: float, seed: int, library: Path | None, uncertified: bool) -> Experiment:
    """Experiment of walking at a constant speed on flat ground, without pushes.

    Args:
        speed: Commanded speed. In m/s.
        seed: Seed of the robot.
        library: Gait library; None for the package's.
        uncertified: Whether gaits without a valid certificate are accepted.
    """
    content = {
        "name": f"return map at {speed:g} m/s",
        "seed": seed,
        "duration": _STEADY,
        "start": "standing",
        "gait_library": None if library is None else str(library),
        "controller": {"allow_uncertified": uncertified},
        "operator": walking_operator(speed),
    }
    return resolve(read_experiment(content))


class Walk:
    """A run of `experiment_of` up to a left foot's touchdown in steady walking at a speed (m/s).

    Raises:
        RunError: if the robot does not walk to this touchdown, or not at this speed.
    """

    def __init__(self, experiment: Experiment, speed: float) -> None:
        cores = make_cores(experiment)
        self._plant, self._timing = cores.plant, cores.controller.walking.timing
        self._loop = connect(cores, self._observe)
        self._mode = Mode()
        self._copy = mujoco.MjData(cores.plant.model)
        self._pelvis = cores.plant.model.body("pelvis").id
        for _ in range(round(_STEADY / self._tick)):
            self._loop.tick()
        while self._to_touchdown() and self._timing.stance != 0:
            pass
        if self._has_stopped():
            raise RunError(f"{experiment.name}: it fell or stopped before the push")
        if abs(self._mode.vx - speed) > 1e-6:
            now = f"the supervisor asks for {float(self._mode.vx):g} m/s"
            raise RunError(f"{experiment.name}: after {_STEADY:g} s {now}")

    def _observe(self, topic: str, raw: bytes, _: int) -> None:
        if topic == Mode.TOPIC:
            self._mode.load(raw)

    @property
    def _tick(self) -> float:
        return self._plant.tick_ns * 1e-9

    def _has_stopped(self) -> bool:
        return has_fallen(self._plant) or self._timing.steps == 0

    def _to_touchdown(self) -> bool:
        """Run to the next touchdown; False if there is none."""
        steps = self._timing.steps
        for tick in range(round(_SLOWEST / self._tick)):
            self._loop.tick()
            if self._timing.steps != steps:
                return not self._has_stopped()
            if tick % CHECK_TICKS == 0 and self._has_stopped():
                break
        return False

    def go_on(self, impulse: tuple[float, float], delay: float, steps: int) -> Touchdowns:
        """Continue with a push; to be called once, in a process of its own.

        Args:
            impulse: Impulse forward and to the left, in the heading frame. In N s.
            delay: Time from now to the push. In s.
            steps: Number of touchdowns to observe.
        """
        plant = self._plant
        if any(impulse):
            force = _turn(np.array(impulse), _yaw(plant.pelvis_pose[1])) / _PUSH_TIME
            push = Push(t=delay, duration=_PUSH_TIME, force=(force[0], force[1], 0.0))
            plant.events.push(push, plant.seq * plant.substeps)
        start, here = plant.time, (plant.pelvis_pose[0][:2].copy(), _yaw(plant.pelvis_pose[1]))
        times, states = [], []
        for _ in range(steps):
            if not self._to_touchdown():
                break
            times.append(plant.time - start)
            states.append(self._state(*here))
        return Touchdowns(np.array(times), np.array(states).reshape(-1, 6), len(times) < steps)

    def _state(self, origin: FloatArray, heading: float) -> FloatArray:
        """See `Touchdowns.states`; computed on a copy, which leaves the run unchanged."""
        model, data = self._plant.model, self._copy
        mujoco.mj_copyData(data, model, self._plant.data)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        stance = int(self._timing.stance)
        foot = data.site(("left_foot", "right_foot")[stance]).xpos
        yaw = _yaw(self._plant.pelvis_pose[1])
        com = data.subtree_com[self._pelvis][:2]
        away = POSITION_RATE * (com - foot[:2])
        velocity = data.subtree_linvel[self._pelvis]
        state = np.concatenate(
            [_turn(velocity[:2], -yaw), _turn(away, -yaw), _turn(com - origin, -heading)]
        )
        if stance == 1:
            state[[1, 3, 5]] *= -1.0
        return state


def measure(
    experiment: Experiment,
    speed: float,
    impulse: float,
    steps: int = _STEPS,
    jobs: int = 1,
    advance: Callable[[], None] = lambda: None,
) -> Measurement:
    """Measure the step-to-step map at one speed.

    Args:
        experiment: Experiment from `experiment_of`.
        speed: Commanded speed. In m/s.
        impulse: Impulse of each push. In N s.
        steps: Number of touchdowns to observe.
        jobs: Number of processes.
        advance: Called after each run.

    Raises:
        RunError: if the robot does not walk at this speed without a push.
    """
    pushes = [((0.0, 0.0), 0.0)]
    pushes += [((impulse * x, impulse * y), delay) for delay in _DELAYS for x, y in _IMPULSES]
    pushes.append(((_NOISE_SHARE * impulse, _NOISE_SHARE * impulse), _DELAYS[0]))
    runs: list[Touchdowns] = []
    walk = Walk(experiment, speed)
    for run in in_copies(lambda push: walk.go_on(*push, steps), pushes, jobs):
        runs.append(run)
        advance()
    nominal, *pushed, small = runs
    if nominal.fell or small.fell:
        raise RunError(f"{experiment.name}: it fell or stopped without a push")
    deviations = []
    for run, (push, delay) in zip(pushed, pushes[1:-1], strict=True):
        if not run.fell and in_line(run.time, nominal.time):
            first = int(np.searchsorted(nominal.time, delay + _PUSH_TIME))
            deviations.append(Deviations(push, delay, (run.states - nominal.states)[first:]))
    fell = sum(run.fell for run in pushed)
    dropped = len(pushed) - fell - len(deviations)
    noise = float(np.median(size_of(small.states - nominal.states)))
    return Measurement(speed, deviations, dropped, fell, noise, fit(deviations, noise))


def in_line(time: FloatArray, nominal: FloatArray) -> bool:
    """Whether every step took between 0.5 and 1.5 times as long as without a push.

    The times of touchdowns, with a push and without, have the shape (n,). In s.
    """
    ratio = np.diff(time, prepend=0.0) / np.diff(nominal, prepend=0.0)
    return bool((ratio > 0.5).all() and (ratio < 1.5).all())


def _yaw(quaternion: FloatArray) -> float:
    w, x, y, z = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _turn(vector: FloatArray, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def run(options: argparse.Namespace) -> int:
    """Push at each speed; returns the exit code."""
    if not (math.isfinite(options.impulse) and 0.1 <= options.impulse <= _STRONGEST):
        raise ExperimentError(
            f"--impulse = {options.impulse:g} N s is outside 0.1 .. {_STRONGEST:g}"
        )
    named = bool(options.speeds) or options.file is not None
    check_results(options, "speeds of the package's library", partial=named)
    if options.file is not None:
        options.file = library_path(options.file)
    speeds, jobs = _speeds(options), options.jobs or available_cores()
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
    print(f"seed {options.seed}, pushes of {options.impulse:g} N s; d: see --help", flush=True)
    print("\n".join(markdown([HEADINGS])), flush=True)
    rows: list[str] = []
    measured = []
    with progress_bar("run", len(speeds) * _RUNS) as bar:
        for speed in speeds:
            experiment = experiment_of(speed, options.seed, options.file, options.allow_uncertified)
            try:
                one = measure(experiment, speed, options.impulse, _STEPS, jobs, bar.update)
                measured.append(one)
                rows.append(line(one))
            except RunError as error:
                rows.append(f"| {speed:g} | {error} |")
            bar.write(rows[-1], file=sys.stdout)
    settled = sum(map(settles, measured))
    if options.out is not None and any(one.deviations for one in measured):
        print(_draw(measured, options.out / "return_map.png"))
    command = f"return_map --seed {options.seed} --impulse {options.impulse:g}"
    put_results(options, SECTION, [*markdown([HEADINGS]), *rows], command)
    print(f"{settled} of {len(speeds)} gaits end nearer to themselves than they began")
    return 0 if settled == len(speeds) else 1


def settles(one: Measurement) -> bool:
    """Whether no run fell or lost its steps, and the last median deviation is below the first."""
    return not one.fell and not one.dropped and float(decay(one.deviations)[-1]) < 1.0


def line(one: Measurement) -> str:
    """A row of the table, in Markdown."""
    runs = len(one.deviations) + one.dropped + one.fell
    decayed, fitted = ["-"] * 4, ["too few deviations above the noise", "-", "-"]
    if one.deviations:
        ratios, steps = decay(one.deviations), steps_to_decay(one.deviations)
        decayed = [f"{ratios[k]:.2f}" for k in (2, 4, 8)]
        decayed.append(f"more than {len(ratios) - 1}" if steps is None else str(steps))
    if one.map is not None:
        (low, high), values = one.map.spread, one.map.eigenvalues
        fitted = [" ".join(f"{value:.2f}" for value in values), f"{low:.2f} .. {high:.2f}"]
        fitted.append(f"{one.map.residual:.2f} ({one.map.pairs})")
    counted = f"{len(one.deviations)} of {runs}"
    cells = [f"{one.speed:g}", counted, *decayed, f"{one.noise:.4f}", *fitted]
    return "| " + " | ".join(cells) + " |"


def _draw(measured: Sequence[Measurement], path: Path) -> Path:
    """Draw the size of the deviations over steps, one panel for each speed."""
    rows = math.ceil(len(measured) / _ACROSS)
    across = math.ceil(len(measured) / rows)
    with drawing(path, 3.0 * across + 0.6, 2.6 * rows + 0.6) as figure:
        panels = figure.subplots(rows, across, sharex=True, sharey=True, squeeze=False).ravel()
        for axes in panels[len(measured) :]:
            axes.set_visible(False)
        for axes, one in zip(panels, measured, strict=False):
            for run in one.deviations:
                x, y = run.impulse
                name = f"({x:g}, {y:g}) N s after {run.delay:g} s"
                axes.semilogy(run.size, marker=".", linewidth=0.8, label=name)
            axes.axhline(one.noise, color="0.5", linestyle=":", label="noise")
            axes.set(title=f"{one.speed:g} m/s", xlabel="steps after the push")
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        for axes in panels[::across]:
            axes.set_ylabel("deviation (m/s)")
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=6
        ).set_title("push (ahead, to the left)")
    return path


def _speeds(options: argparse.Namespace) -> list[float]:
    path = options.file or default_library_path()
    library = load_certified(path, allow_uncertified=options.allow_uncertified)
    low, high = library.speed_range
    for speed in options.speeds or ():
        if not low <= speed <= high:
            raise ExperimentError(
                f"--speeds: {speed:g} m/s is outside {low:g} .. {high:g} of {path}"
            )
    straight = [gait.vx for gait in library.gaits if gait.vy == 0.0 and gait.yaw_rate == 0.0]
    return list(options.speeds or (straight if options.file else SPEEDS))
