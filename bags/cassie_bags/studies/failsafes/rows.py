"""The rows of the table of fail-safes: what happens, what the robot does, how to go on.

The README of `cassie_control` has the texts of these rows, and the tests run the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cassie_bags.studies.failsafes.participants import (
    CONTROLLER,
    ESTIMATOR,
    SUPERVISOR,
    SimulatedOperator,
    UnsafeError,
)
from cassie_msgs.layout import OperatorCommand, RobotMode

if TYPE_CHECKING:
    from cassie_bags.studies.failsafes.wall_paced import WallPaced

Rng = np.random.Generator
Test = Callable[["WallPaced", Rng, str], None]
"""Makes a fail-safe happen in a run; raises `UnsafeError` if the robot does something else."""

SPEEDS = {"stand": None, "step in place": 0.0, "walk": 0.8, "ride": None}
"""Activities of the robot when a row begins, with the walking speed. In m/s."""

WALKING = ("step in place", "walk")
ON_FOOT = ("stand", *WALKING)
ALL = (*ON_FOOT, "ride")

_BRAKES = "stops and stands; on a Segway brakes and rides on"
_GOOD_LINK, _COMMANDS_AGAIN = (
    f"{what}, then the speeds at zero once" for what in ("good link", "commands again")
)
_POWER_ANEW = "hang it up, power off and on, let it down"

_STOP_TIME = 8.0  # s: from 0.8 m/s at 0.3 m/s^2, then stepping in place
_WATCHDOG = 0.022  # s: 20 ms without a command and a tick


@dataclass(frozen=True)
class FailSafe:
    """One row of the table.

    Attributes:
        name: Name for commands.
        trigger: What goes wrong.
        time: Time in which the robot acts.
        action: What the robot does.
        recovery: How to go on.
        test: Makes it happen in a run.
        states: Activities of the robot before, keys of `SPEEDS`.
        sections: Further sections of the experiment, drawn with the generator.
    """

    name: str
    trigger: str
    time: str
    action: str
    recovery: str
    test: Test
    states: tuple[str, ...]
    sections: Callable[[Rng, float], dict[str, Any]]


ROWS: list[FailSafe] = []
"""All rows, in the order of the table."""


def _row(
    trigger: str,
    time: str,
    action: str,
    recovery: str,
    states: tuple[str, ...] = ON_FOOT,
    sections: Callable[[Rng, float], dict[str, Any]] = lambda rng, t: {},
) -> Callable[[Test], Test]:
    """Make a test the row of its name; the arguments are those of `FailSafe`."""

    def add(test: Test) -> Test:
        name = test.__name__.lstrip("_")
        ROWS.append(FailSafe(name, trigger, time, action, recovery, test, states, sections))
        return test

    return add


def _rests(run: WallPaced, state: str, limit: float = _STOP_TIME) -> None:
    """Check that the robot stops and stands, or goes on riding, and does not fall."""
    if state == "ride":
        run.run(2.0)
        _hold_ride(run)
        return
    run.until(lambda: run.mode is RobotMode.STAND, limit, "stop and stand")
    run.run(1.0)


def _hold_ride(run: WallPaced) -> None:
    if run.mode is not RobotMode.SEGWAY:
        raise UnsafeError(f"left the Segway; {run.describe()}")


def _wants_arming(run: WallPaced, state: str) -> None:
    """Check that old commanded speeds are ignored until all speeds have been zero once."""
    since = run.now
    run.person.changes |= {"vx": 0.4}
    run.run(1.5)
    if run.armed or any(run.peak_speeds(since).values()):
        raise UnsafeError(f"old speeds count: {dict(run.peak_speeds(since))}")
    run.person.changes |= {"vx": 0.0, "vy": 0.0, "yaw_rate": 0.0, "com_x": 0.0, "com_y": 0.0}
    run.until(lambda: run.armed, 0.5, "arming")
    if state in WALKING:
        run.person.changes |= {"vx": 0.3}
        run.until(lambda: run.peak_speeds(run.now - 0.1)["vx"] > 0.25, 8.0, "the speed asked for")
        run.run(1.0)


def _recovers(run: WallPaced) -> None:
    """Check that it stands again: power off, hung up till the fault is over, power on, let down."""
    run.person.changes |= {"power": False, "mode": RobotMode.STAND, "vx": 0.0, "yaw_rate": 0.0}
    run.run(0.1, upright=False)
    run.hang_up()
    run.run(3.0, upright=False)
    run.until(
        lambda: "checked anew" not in str(run.faults),
        20.0,
        "sensors to be checked anew",
        upright=False,
    )
    run.person.changes |= {"power": True, "emergency_stop": False, "height": 0.9}
    run.until(lambda: run.mode is RobotMode.STAND, 4.0, "stand in the gantry", upright=False)
    run.let_down()
    run.run(3.0, upright=False)
    run.fallen = False
    run.run(1.5)
    if run.mode is not RobotMode.STAND or abs(run.height - 0.9) > 0.06:
        raise UnsafeError(f"does not stand after it was let down; {run.describe()}")


def _damps_without(node: str, run: WallPaced, rng: Rng) -> None:
    """Check that the drives damp while a node is silent, and that the robot then recovers."""
    run.silent.add(node)
    drives = run.plant.drives
    run.until(lambda: bool(drives.damped), _WATCHDOG, "damping", upright=False)
    run.hold(lambda: bool(drives.damped), float(rng.uniform(0.8, 2.5)), "damping")
    run.restart(node)
    run.run(1.0, upright=False)
    _recovers(run)


@_row("The radio's or page's link is bad", "at once", _BRAKES, _GOOD_LINK, ALL)
def _link_lost(run: WallPaced, rng: Rng, state: str) -> None:
    run.person.changes |= {"link": False}
    _rests(run, state)
    run.person.changes |= {"link": True}
    _wants_arming(run, state)


@_row("The operator's node is killed or stopped", "0.5 s", _BRAKES, _COMMANDS_AGAIN, ALL)
def _operator_silent(run: WallPaced, rng: Rng, state: str) -> None:
    run.person.silent = True
    run.until(lambda: "operator lost" in str(run.faults), 0.6, "the fault")
    _rests(run, state)
    run.person.silent = False
    _wants_arming(run, state)


@_row("The link comes and goes every 0.05 to 0.7 s", "at once", _BRAKES, _GOOD_LINK, ALL)
def _flapping_link(run: WallPaced, rng: Rng, state: str) -> None:
    for _ in range(8):
        good = bool(rng.integers(2))
        run.person.changes["link"] = good
        run.person.silent = not good and bool(rng.integers(2))
        run.run(float(rng.uniform(0.05, 0.7)))
    run.person.silent = False
    run.person.changes["link"] = False
    _rests(run, state)
    run.person.changes["link"] = True
    _wants_arming(run, state)


@_row(
    "Values that mean nothing arrive, and then nothing",
    "at once",
    "refuses them; stops and stands; on a Segway brakes and rides on",
    _COMMANDS_AGAIN,
    ALL,
)
def _wild_values(run: WallPaced, rng: Rng, state: str) -> None:
    def garble(command: OperatorCommand) -> None:
        wild = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e9, 1e4, -50.0, 5.0], 12)
        chosen = rng.random(12) < 0.5
        command.floats[chosen] = wild[chosen]
        command.mode[...] = rng.integers(256)

    since = run.now
    run.person.garble = garble
    run.run(0.3)
    run.person.garble, run.person.silent = None, True
    _rests(run, state)
    limits = {"vx": 4.2 if state == "ride" else 1.2, "vy": 0.3, "yaw_rate": 1.0}
    for name, value in run.peak_speeds(since).items():
        if not value <= limits[name] + 1e-9:
            raise UnsafeError(f"{name} = {value:g} came through")
    run.person.silent = False
    _wants_arming(run, state)


@_row(
    "Power is switched on while a mode or speed is asked for",
    "at once",
    "no power",
    "ask for stand and no speed",
    ("stand",),
)
def _power_on_refused(run: WallPaced, rng: Rng, state: str) -> None:
    run.person.changes |= {"power": False}
    run.hang_up()
    run.run(2.0, upright=False)
    asked: list[dict[str, Any]] = [
        {"mode": RobotMode.WALK},
        {"vx": 0.4},
        {"yaw_rate": -0.5},
        {"mode": RobotMode.SEGWAY},
    ]
    changes = asked[int(rng.integers(len(asked)))]
    run.person.changes |= {"power": True, **changes}
    run.hold(lambda: not run.powered, 1.0, "no power")
    if "power comes on only with stand" not in str(run.faults):
        raise UnsafeError(f"not told: {run.faults}")
    _recovers(run)


@_row(
    "The operator cuts the power, and asks for it while asking to walk",
    "one physics step",
    "no torque, no power",
    "hang it up, ask for stand, power on, let it down",
)
def _power_cut(run: WallPaced, rng: Rng, state: str) -> None:
    run.person.changes |= {"power": False}
    # A command takes some time to reach the robot; from then on the robot has a physics step.
    run.until(lambda: not run.powered, 0.03, "no power", upright=False)
    run.hold(lambda: run.torque == 0.0, float(rng.uniform(0.3, 1.5)), "no torque")
    run.person.changes |= {"power": True, "mode": RobotMode.WALK, "vx": 0.4}
    run.hold(lambda: not run.powered, 0.5, "no power while it is asked to walk")
    _recovers(run)


@_row(
    "Another operator presses the emergency stop",
    "one physics step",
    "no power, until the holder of the lease switches it off and on",
    _POWER_ANEW,
)
def _other_operator_stops(run: WallPaced, rng: Rng, state: str) -> None:
    other = SimulatedOperator("person-2")
    other.changes |= {"power": False}
    run.others.append(other)
    run.run(0.5)
    other.changes |= {"emergency_stop": True}
    run.until(lambda: not run.powered, 0.05, "no power", upright=False)
    other.changes |= {"emergency_stop": False}
    run.hold(lambda: not run.powered, 1.0, "no power until it was switched off and on")
    _recovers(run)


@_row(
    "The state estimator is killed, stopped or restarted",
    "20 ms",
    "drives damp",
    f"restart it; {_POWER_ANEW}",
)
def _estimator_silent(run: WallPaced, rng: Rng, state: str) -> None:
    _damps_without(ESTIMATOR, run, rng)


@_row(
    "The gait controller is killed, stopped or restarted",
    "20 ms",
    "drives damp",
    f"restart it; {_POWER_ANEW}",
)
def _controller_silent(run: WallPaced, rng: Rng, state: str) -> None:
    _damps_without(CONTROLLER, run, rng)


@_row(
    "The mode supervisor is killed, stopped or restarted",
    "0.4 s",
    "the controller stops and stands by itself",
    "restart it",
)
def _supervisor_silent(run: WallPaced, rng: Rng, state: str) -> None:
    run.silent.add(SUPERVISOR)
    run.run(float(rng.uniform(5.0, 7.0)))
    run.person.changes |= {"mode": RobotMode.STAND, "vx": 0.0}
    run.restart(SUPERVISOR)
    run.until(lambda: run.mode is RobotMode.STAND, 4.0, "stand")
    run.run(1.0)
    if state in WALKING:
        run.person.changes |= {"mode": RobotMode.WALK}
        run.until(lambda: run.mode is RobotMode.WALK, 5.0, "walk")
        run.run(1.5)


def _torque_sensor(rng: Rng, t: float) -> dict[str, Any]:
    kind = str(rng.choice(["off", "stuck", "nan", "spike"]))
    channel = f"drive_torque.{rng.integers(10)}"
    size = {"size": 200.0} if kind == "spike" else {}
    return {"faults": [{"t": t, "channel": channel, "kind": kind, **size}]}


@_row(
    "A drive reports a torque other than the one commanded",
    "0.1 s",
    "stops and stands without that channel, if the error exceeds its bound",
    "repair it",
    sections=_torque_sensor,
)
def _torque_differs(run: WallPaced, rng: Rng, state: str) -> None:
    run.run(12.0)  # an error below the channel's bound is not reported
    if "without drive_torque" in str(run.faults) and run.mode is not RobotMode.STAND:
        raise UnsafeError(f"does not stand; {run.describe()}")


@_row(
    "The torso tilts by more than 0.8 rad",
    "20 ms",
    "drives damp until the torso has been upright for 1 s",
    "power off, hang it up, power on, let it down",
)
def _attitude(run: WallPaced, rng: Rng, state: str) -> None:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    run.push((600.0 * float(np.cos(angle)), 600.0 * float(np.sin(angle)), 0.0), 0.3)
    run.until(lambda: run.mode is RobotMode.DAMP, 5.0, "damp", upright=False)
    run.run(2.0, upright=False)
    if run.mode is not RobotMode.DAMP:
        raise UnsafeError(f"does not damp where it lies; {run.describe()}")
    _recovers(run)


@_row(
    "Somebody lifts it while it walks",
    "0.5 s",
    "ends walking, and stands once it is let down",
    "ask for stand, then for walk",
    WALKING,
)
def _lifted(run: WallPaced, rng: Rng, state: str) -> None:
    run.hang_up()
    run.until(lambda: run.mode is RobotMode.STAND, 2.0, "end walking in the air")
    run.run(float(rng.uniform(0.0, 4.0)))
    run.let_down()
    run.run(2.0)
    run.hold(lambda: run.mode is RobotMode.STAND, 4.0, "stand although walk is asked for")
    run.person.changes |= {"mode": RobotMode.STAND}
    run.run(0.5)
    run.person.changes |= {"mode": RobotMode.WALK}
    run.until(lambda: run.mode is RobotMode.WALK, 4.0, "walk once it is asked for anew")
    run.run(2.0)


@_row(
    "The battery is low, and then empty",
    "20 ms",
    "warns; then stops, stands and sits down",
    "charge it",
)
def _battery(run: WallPaced, rng: Rng, state: str) -> None:
    run.charge = float(rng.uniform(0.12, 0.18))
    run.until(lambda: "stop and charge it" in str(run.faults), 0.1, "the warning")
    before = run.mode
    run.hold(lambda: run.mode is before, 1.0, "to go on")
    run.charge = float(rng.uniform(0.01, 0.09))
    run.until(lambda: run.mode is RobotMode.STAND, _STOP_TIME, "stop and stand")
    run.until(lambda: run.height < 0.5, 4.0, "sit down")
    run.run(1.0)


@_row(
    "A busy machine misses more than a fifth of the control ticks of a second",
    "1 s",
    "stops and stands",
    "end what keeps the machine busy; walking may begin again",
)
def _missed_ticks(run: WallPaced, rng: Rng, state: str) -> None:
    share = float(rng.uniform(0.3, 0.5))
    run.drops = lambda: bool(rng.random() < share)
    run.until(lambda: "control ticks missed" in str(run.faults), 1.5, "the fault")
    _rests(run, state)


@_row("The link is lost and a push of 8 Ns comes", "at once", "stops and stands", _GOOD_LINK)
def _link_lost_and_push(run: WallPaced, rng: Rng, state: str) -> None:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    force = 8.0 / 0.1
    run.person.changes |= {"link": False}
    run.run(float(rng.uniform(0.0, 0.5)))
    run.push((force * float(np.cos(angle)), force * float(np.sin(angle)), 0.0), 0.1)
    _rests(run, state, limit=12.0)


def _any_sensor(rng: Rng, t: float) -> dict[str, Any]:
    quantity, count = [
        ("drive_position", 10),
        ("drive_velocity", 10),
        ("joint_position", 6),
        ("joint_velocity", 6),
        ("drive_torque", 10),
    ][int(rng.integers(5))]
    channel = f"{quantity}.{rng.integers(count)}"
    kind = str(rng.choice(["off", "stuck", "nan"]))
    return {"faults": [{"t": t + float(rng.uniform(0.0, 0.5)), "channel": channel, "kind": kind}]}


@_row(
    "The link is lost and a sensor fails",
    "at once",
    "stops and stands without that channel",
    "repair it",
    sections=_any_sensor,
)
def _link_lost_and_sensor(run: WallPaced, rng: Rng, state: str) -> None:
    run.person.changes |= {"link": False}
    _rests(run, state, limit=12.0)


@_row(
    "The mode supervisor is silent again and again on a Segway",
    "0.4 s",
    "the controller brakes and rides on by itself",
    "restart it if it stays silent",
    ("ride",),
)
def _supervisor_riding(run: WallPaced, rng: Rng, state: str) -> None:
    for _ in range(3):
        run.silent.add(SUPERVISOR)
        run.run(float(rng.uniform(0.2, 2.0)))
        run.silent.discard(SUPERVISOR)
        run.run(float(rng.uniform(0.2, 2.0)))
        _hold_ride(run)
    run.run(3.0)
