"""Feed-forward torques that are learned over repeated steps, which the paper names as future work.

The torques are a table, which is kept in a file beside the gait library:

    {"schema_version": 1, "robot": "cassie", "model_hash": "...",
     "provenance": {"tool": "...", "version": "...", "date": "2025-01-31", "settings": {...}},
     "joints": ["stance_hip_roll", ..., "swing_toe"], "speeds": [-0.5, ..., 1.0],
     "torques": for each speed, for each joint, values at evenly spaced phases from 0 to 1}

Speeds in m/s, rising; torques in Nm, of a step on the left leg. The file of `optimized.json` is
`optimized.learned.json`.
"""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.config import ControllerConfig
from cassie_control.control.robot import Readings, Robot
from cassie_control.errors import ControlError
from cassie_control.planner.timing import RIGHT, StepTiming
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.errors import CassieError
from cassie_gaits.gait_library import Provenance
from cassie_gaits.gait_library_file import library_path
from cassie_gaits.json_file import check_free, read_json
from cassie_gaits.model_hash import model_hash
from cassie_gaits.names import DRIVE_IN_Q, LEG_DRIVES
from cassie_gaits.records import Records
from cassie_msgs.layout import Mode, MotorCommand, RobotMode, RobotState

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

STANCE_HIP_PITCH, SWING_HIP_PITCH = 2, 7
"""Rows of the table."""

_BACK = 3.0  # 1/(m/s), share of the swing hip's torques on the stance hip, by backward speed


@compiled
def _place(values: FloatArray, x: float) -> tuple[int, float]:
    """Index of the grid point below `x`, and the interpolation weight of the next; clamped."""
    last = values.size - 1
    if last == 0 or x <= values[0]:
        return 0, 0.0
    i = 0
    while i < last and values[i + 1] <= x:
        i += 1
    if i == last:
        return last - 1, 1.0
    return i, (x - values[i]) / (values[i + 1] - values[i])


@compiled
def _phase_place(points: int, phase: float) -> tuple[int, float]:
    """Interval of a phase on an even grid from 0 to 1, and the interpolation weight of its end."""
    x = max(0.0, min(1.0, phase)) * (points - 1)
    i = min(points - 2, int(x))
    return i, x - i


@compiled
def _value(
    table: FloatArray, speed: tuple[int, float, int], j: int, phase: tuple[int, float]
) -> float:
    """Interpolated torque of joint `j`, at a speed and a phase as `_place` gives them."""
    s, to_speed, after = speed
    p, to_phase = phase
    low = table[s, j, p] + to_phase * (table[s, j, p + 1] - table[s, j, p])
    high = table[after, j, p] + to_phase * (table[after, j, p + 1] - table[after, j, p])
    value: float = low + to_speed * (high - low)
    return value


@compiled
def add(
    table: FloatArray,
    speeds: FloatArray,
    now: tuple[float, float, float, float],
    robots: Records[Robot],
    stance: int,
    fresh: bool,
    added: FloatArray,
    gaps: FloatArray,
    torque: FloatArray,
) -> None:
    """Add the table's torques.

    Args:
        table: Learned torques. Shape (s, 10, n), in Nm.
        speeds: Speeds of the table. Shape (s,), in m/s.
        now: Phase, speed, weight of the last step's torques, and weight of all torques.
        robots: The robot now. Shape (1,).
        stance: Number of the stance leg.
        fresh: Whether a step begins.
        added: Torques added at the last tick, by drive; updated. Shape (10,), in Nm.
        gaps: Difference of the last step's and this step's torques at touchdown; updated. Shape
            (10,), in Nm.
        torque: Torques of the command; changed. Shape (10,), in Nm.
    """
    s, to_speed = _place(speeds, now[1])
    p, to_phase = _phase_place(table.shape[2], now[0])
    after = min(s + 1, speeds.size - 1)
    mirrored = stance == RIGHT
    load, free = robots[0].load[stance], 1.0 - robots[0].contact[1 - stance]
    carried = free * max(0.0, min(1.0, -_BACK * now[1]))
    for j in range(10):
        value = _value(table, (s, to_speed, after), j, (p, to_phase))
        stands = j < 5
        if j == STANCE_HIP_PITCH:  # transmits the swing torque's reaction to the ground
            value -= carried * _value(table, (s, to_speed, after), SWING_HIP_PITCH, (p, to_phase))
        if stands:
            value *= load
        else:
            value *= free
        drive = j
        if mirrored:
            drive = j + 5 if stands else j - 5
            if j % 5 < 2:
                value = -value
        if fresh:
            gaps[drive] = added[drive] - value
        value += now[2] * gaps[drive]
        added[drive] = value
        torque[drive] += now[3] * value


@compiled
def notice(
    sums: FloatArray,
    counts: FloatArray,
    weights: FloatArray,
    speeds: FloatArray,
    at: tuple[float, float, float],
    mirrored: bool,
    q: FloatArray,
    v: FloatArray,
    command: FloatArray,
    drives: IntArray,
    limits: FloatArray,
) -> None:
    """Sum the torques of the drives' loops at a phase and speed.

    Args:
        sums: Sums of torques; updated. Shape (s, 10, n), in Nm.
        counts: Sums of weights by phase; updated. Shape (n,).
        weights: Sums of weights by speed; updated. Shape (s,).
        speeds: Speeds of the table. Shape (s,), in m/s.
        at: Phase, speed, and weight of this tick: how far the swing foot is free.
        mirrored: Whether the right leg stands.
        q, v: Positions and velocities of the state. Shape (20,), in rad and rad/s.
        command: Torque, position, velocity, kp and kd of the drives. Shape (50,).
        drives: Index of each drive in q. Shape (10,).
        limits: Saturation of the loops' torques. Shape (10,), in Nm.
    """
    s, to_speed = _place(speeds, at[1])
    p, to_phase = _phase_place(counts.size, at[0])
    after = min(s + 1, speeds.size - 1)
    here, ahead = at[2] * (1.0 - to_phase), at[2] * to_phase
    weights[s] += at[2] * (1.0 - to_speed)
    weights[after] += at[2] * to_speed
    counts[p] += here
    counts[p + 1] += ahead
    for j in range(10):
        drive, sign = j, 1.0
        if mirrored:
            drive = (j + 5) % 10
            if j % 5 < 2:
                sign = -1.0
        k = drives[drive]
        loop = command[30 + drive] * (command[10 + drive] - q[k])
        loop += command[40 + drive] * (command[20 + drive] - v[k])
        loop = sign * max(-limits[j], min(limits[j], loop))
        sums[s, j, p] += loop * (1.0 - to_speed) * here
        sums[s, j, p + 1] += loop * (1.0 - to_speed) * ahead
        sums[after, j, p] += loop * to_speed * here
        sums[after, j, p + 1] += loop * to_speed * ahead


@compiled
def teach(
    table: FloatArray,
    sums: FloatArray,
    counts: FloatArray,
    weights: FloatArray,
    limits: FloatArray,
    gains: FloatArray,
    how: tuple[float, float],
) -> None:
    """Update the table after a step.

    Args:
        table: Learned torques; changed. Shape (s, 10, n), in Nm.
        sums, counts, weights: Sums from `notice`.
        limits: Saturation of the table. Shape (10,), in Nm.
        gains: Share of the loops' torque that is learned. Shape (10,).
        how: Leak and smoothing.
    """
    leak, smoothing = how
    points = counts.size
    first, last = -1, -1
    for p in range(points):
        if counts[p] > 0.5:
            first = p if first < 0 else first
            last = p
    if first < 0:
        return
    for s in range(table.shape[0]):
        share = weights[s] / weights.sum()
        for j in range(10):
            row, gain = table[s, j], gains[j]
            before = row[0]
            for p in range(points):
                here = row[p]
                bend = before - 2.0 * here + row[min(p + 1, points - 1)]
                change = share * (0.25 * smoothing * bend - leak * here)
                if p < first or p > last:  # double support: nearest phase of single support
                    change += share * gain * (row[first if p < first else last] - here)
                elif counts[p] > 0.5:
                    change += gain * sums[s, j, p] / counts[p]
                before = here
                row[p] = max(-limits[j], min(limits[j], here + change))


SCHEMA_VERSION = 1

JOINTS = tuple(f"{role}_{drive}" for role in ("stance", "swing") for drive in LEG_DRIVES)
"""Rows of the table: the stance leg's drives, then the swing leg's."""

PHASES = 21
"""Points of a new table from phase 0 to 1: 20 ms apart, near the drives' bandwidth."""

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Speeds of a new table: those of the paper's library. In m/s."""

_KEYS = {"schema_version", "robot", "model_hash", "provenance", "joints", "speeds", "torques"}
_MOST_SPEEDS, _MOST_PHASES = 64, 1001
_DECIMALS = 3


class LearnedTorquesError(ControlError):
    """Learned torques, or their file, cannot be used."""


def torque_limits() -> FloatArray:
    """Torque limit of the drive of each row of `JOINTS`. Shape (10,), in Nm."""
    return np.array([robot.DRIVES[name].torque_limit for name in LEG_DRIVES] * 2)


@dataclass(frozen=True, eq=False)
class LearnedTorques:
    """Torques by speed, joint and phase, of a step on the left leg.

    Attributes:
        speeds: Speeds, rising. Shape (s,), in m/s.
        torques: Rows of `JOINTS` at evenly spaced phases from 0 to 1. Shape (s, 10, n), in Nm.
        provenance: Where they come from, or None.

    Raises:
        LearnedTorquesError: if shapes do not match, speeds do not rise, or a value is not finite or
            a torque exceeds its drive's limit.
    """

    speeds: FloatArray
    torques: FloatArray
    provenance: Provenance | None = None

    def __post_init__(self) -> None:
        speeds, torques = self.speeds, self.torques
        if speeds.ndim != 1 or not 1 <= len(speeds) <= _MOST_SPEEDS:
            raise LearnedTorquesError(f"speeds are {speeds.shape}, expected 1 .. {_MOST_SPEEDS}")
        if torques.ndim != 3 or torques.shape[:2] != (len(speeds), len(JOINTS)):
            expected = (len(speeds), len(JOINTS), "n")
            raise LearnedTorquesError(f"torques have shape {torques.shape}, expected {expected}")
        if not 2 <= torques.shape[2] <= _MOST_PHASES:
            raise LearnedTorquesError(f"{torques.shape[2]} phases, expected 2 .. {_MOST_PHASES}")
        if not (np.isfinite(speeds).all() and np.isfinite(torques).all()):
            raise LearnedTorquesError("a speed or torque is not finite")
        for before, after in pairwise(speeds.tolist()):
            if not after > before:
                raise LearnedTorquesError(f"speed {after:g} follows {before:g}, expected to rise")
        limits = torque_limits()
        largest = np.abs(torques).max(axis=(0, 2))
        for joint, value, bound in zip(JOINTS, largest, limits, strict=True):
            if value > bound:
                raise LearnedTorquesError(
                    f"{joint} gets {value:g} Nm, at most {bound:g} Nm are permitted"
                )


def nothing_learned(speeds: tuple[float, ...] = SPEEDS) -> LearnedTorques:
    """A table of zeros over speeds (m/s)."""
    return LearnedTorques(np.array(speeds), np.zeros((len(speeds), len(JOINTS), PHASES)))


def path_beside(library: str | Path) -> Path:
    """Path of the torques learned on a gait library, from the library's name or file."""
    library = library_path(str(library))
    stem = library.name.removesuffix(".gz").removesuffix(".json")
    return library.with_name(f"{stem}.learned.json")


def load_beside(library: str | Path, path: str | Path = "") -> LearnedTorques:
    """The torques of a file, or those beside a gait library: none if there is no such file.

    Raises:
        LearnedTorquesError: as `load_torques`.
    """
    if path:
        return load_torques(path)
    beside = path_beside(library)
    return load_torques(beside) if beside.exists() else nothing_learned()


def load_torques(path: str | Path) -> LearnedTorques:
    """Read learned torques.

    Raises:
        LearnedTorquesError: if the file is missing, no regular file, too large, damaged, of another
            schema or for another robot; one line with the file's name and the reason.
    """
    try:
        return _table(read_json(Path(path)))
    except CassieError as error:
        raise LearnedTorquesError(f"learned torques {path}: {error}") from None


def save_torques(learned: LearnedTorques, path: str | Path) -> None:
    """Write learned torques; a reader sees the old file or the whole new one.

    Raises:
        LearnedTorquesError: if the file cannot be written.
    """
    path = Path(path)
    origin = learned.provenance
    document = {
        "schema_version": SCHEMA_VERSION,
        "robot": "cassie",
        "model_hash": model_hash(),
        "provenance": {
            "tool": origin.tool if origin else "unknown",
            "version": origin.version if origin else "unknown",
            "date": origin.date if origin else "unknown",
            "settings": dict(origin.settings) if origin else {},
        },
        "joints": list(JOINTS),
        "speeds": learned.speeds.tolist(),
        "torques": np.round(learned.torques, _DECIMALS).tolist(),
    }
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")
        part.replace(path)
    except (OSError, TypeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise LearnedTorquesError(f"learned torques {path}: {reason}") from error


def _table(document: object) -> LearnedTorques:
    top = _object(document, "the file")
    version = top.get("schema_version")
    if isinstance(version, bool) or version != SCHEMA_VERSION:
        raise LearnedTorquesError(
            f"schema_version is {reprlib.repr(version)}, expected {SCHEMA_VERSION}"
        )
    if set(top) != _KEYS:
        wrong = reprlib.repr(sorted(set(top) ^ _KEYS))
        raise LearnedTorquesError(f"the file lacks or has too much: {wrong}")
    if top["joints"] != list(JOINTS):
        raise LearnedTorquesError(f"joints are {reprlib.repr(top['joints'])}, expected {JOINTS}")
    if top["model_hash"] != model_hash():
        raise LearnedTorquesError(
            f"it is for model {reprlib.repr(top['model_hash'])}, this robot is {model_hash()}"
        )
    origin = _object(top["provenance"], "provenance")
    settings = _object(origin.get("settings", {}), "provenance.settings")
    check_free(settings, "provenance.settings")
    tool, version, date = (origin.get(key) for key in ("tool", "version", "date"))
    if not (isinstance(tool, str) and isinstance(version, str) and isinstance(date, str)):
        raise LearnedTorquesError("provenance lacks tool, version or date")
    return LearnedTorques(
        _numbers(top["speeds"], "speeds", 1),
        _numbers(top["torques"], "torques", 3),
        Provenance(tool, version, date, settings),
    )


def _object(value: object, name: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise LearnedTorquesError(f"{name} is no JSON object")
    return value


def _numbers(value: object, name: str, depth: int) -> FloatArray:
    """Nested lists of numbers, all of the same lengths."""
    problem = f"{name} are no lists of numbers of equal lengths"

    def check(entry: object, level: int) -> None:
        if level == 0:
            if type(entry) not in (int, float):
                raise LearnedTorquesError(problem)
            return
        if not isinstance(entry, list):
            raise LearnedTorquesError(problem)
        for part in entry:
            check(part, level - 1)

    check(value, depth)
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, OverflowError):
        raise LearnedTorquesError(problem) from None
    if array.ndim != depth:
        raise LearnedTorquesError(problem)
    return array


_BRIDGE = 0.03  # s, over which the torques of one step become those of the next
_FADE = 0.5  # s, in which all learned torques appear or vanish with the switch
_FADE_FAILED = 0.05  # s, in which all learned torques vanish once a sensor has failed
_FIRST = 4  # steps after the beginning of walking that are not used for learning
_LATEST = 1.15  # largest final phase of a step that is used for learning
_OFF_SPEED = 0.15  # m/s, largest speed error of a step that is used for learning
_UPRIGHT = 0.15  # rad, largest torso roll and pitch of a step that is used for learning
_KEEP_BALANCE = [
    JOINTS.index(name)
    for name in ("stance_hip_roll", "stance_hip_pitch", "stance_knee", "swing_hip_roll")
]
_DRIVES = np.array(DRIVE_IN_Q)


class TorqueLearning:
    """Torques by phase, joint and speed, added to the gait's feed-forward and learned from it.

    With u_j(phase, speed) the table, mirrored for steps on the right leg, and

        e_j = kp (position - q) + kd (velocity - v)

    the tracking torque of the drive's own loop. Each step straight ahead at the commanded speed
    updates the table. Error e changes the phase p that was `lead` before (the drives' delay and the
    loop's response time):

        u(p) <- Q[ (1 - leak) u(p) + gain e(p + lead) ], within +- limit of the drive's torque,

    with Q a low-pass along the phase. gain / (gain + leak) of the repeating error is learned. Four
    joints are left out, since their errors are part of the balance. With learned torques of the
    stance knee, which carries load, the sway grows within some twenty steps until the robot falls.
    With those of the torso and the swing hip's roll the robot falls on soft ground. Only single
    support is used: in double support the legs press against each other, which no torque removes;
    there the table is continued from the nearest phase of single support.

    The torque of the swing hip's pitch has a reaction on the torso: walking backward, the torso
    pitched by 0.1 rad in each step, farther than with nothing learned. So backward the stance hip
    transmits the reaction to the ground, as for the swing leg's inertia (`control.drives`), fully
    from 1/3 m/s on. Forward the reaction is small, and robots that otherwise tolerate set-points 25
    ms late fell with this compensation.

    Between its points and speeds the table is linear; beyond phase 1 and the outermost speeds it is
    constant. At a touchdown the torques become those of the new step within 30 ms. A stance leg
    gets them in proportion to its load, a swing leg as far as its foot is free. With a failed
    sensor the torques vanish within 50 ms: they were learned with healthy sensors of the joints.

    Under the paper's own law nothing is added.

    Attributes:
        torques: The table. Shape (s, 10, n), in Nm, of a step on the left leg.
        taught: Number of steps that were used for learning.

    Args:
        config: Switch and parameters of learning.
        learned: Initial table; None: zeros.
        period: Control period. In s.

    Source:
        Section "Conclusions" names torques learned over repeated steps; the law is iterative
        learning from the feedback's own torque (Kawato's feedback-error learning by phase).
    """

    def __init__(
        self, config: ControllerConfig, learned: LearnedTorques | None, period: float
    ) -> None:
        self._added = np.zeros(len(JOINTS))
        self._gaps = np.zeros(len(JOINTS))
        self._period = period
        self._phases = np.zeros(64)
        self.configure(config)
        self.begin(nothing_learned() if learned is None else learned)

    def begin(self, learned: LearnedTorques) -> None:
        """Begin anew from other torques."""
        self.speeds = np.ascontiguousarray(learned.speeds)
        self.torques = np.array(learned.torques)
        self._sums = np.zeros_like(self.torques)
        self._counts = np.zeros(self.torques.shape[2])
        self._weights = np.zeros(len(self.speeds))
        self.taught = 0
        self.start()

    def configure(self, config: ControllerConfig) -> None:
        """Use new parameters of learning."""
        self._config = config.learning
        self._adds = config.learned_torques != "none" and not config.walk.as_in_paper
        self._learns = self._adds and config.learned_torques == "learn"
        self._gains = np.full(len(JOINTS), config.learning.gain)
        self._gains[_KEEP_BALANCE] = 0.0
        self._limits = torque_limits() * config.learning.limit
        self._lead = min(len(self._phases) - 1, round(config.learning.lead / self._period))

    def start(self) -> None:
        """Begin walking, with no torques added yet."""
        self._added[:] = 0.0
        self._share = 1.0 if self._adds else 0.0
        self._steps = 0
        self._age = 0
        self._teaches = True
        self._last_phase = 0.0
        self._clear()

    def step(
        self,
        timing: StepTiming,
        speed: float,
        readings: Readings,
        mode: Mode,
        command: MotorCommand,
    ) -> None:
        """Add the torques of this tick to the command's, and learn from it where that is on.

        Args:
            timing: Phase and stance leg.
            speed: Speed at which the gait library is read. In m/s.
            readings: The robot now.
            mode: Commanded mode and set-points.
            command: Set-points of this tick, complete.
        """
        failed = int(readings.state.sensor_faults) != 0
        if self._share != 1.0 or failed or not self._adds:
            change = self._period / (_FADE_FAILED if failed else _FADE)
            wanted = 1.0 if self._adds and not failed else 0.0
            self._teaches = self._teaches and not failed
            self._share += max(-change, min(change, wanted - self._share))
            if self._share == 0.0:
                return
        steps, stance = timing.steps, timing.stance
        fresh = steps != self._steps
        if fresh:
            if self._learns:
                self._end_step(timing, mode)
            self._steps = steps
        bridge = max(0.0, 1.0 - timing.elapsed / _BRIDGE)
        if self._learns:
            upright = max(abs(readings.roll), abs(readings.pitch)) <= _UPRIGHT
            self._teaches = self._teaches and upright
            free = 1.0 - readings.legs[1 - stance].contact
            self._notice(timing, speed, 0.0 if bridge else free, readings.state, mode, command)
        add(
            self.torques,
            self.speeds,
            (timing.phase, speed, bridge, self._share),
            readings.records,
            stance,
            fresh,
            self._added,
            self._gaps,
            command.torque,
        )

    def learned(self) -> LearnedTorques:
        """A copy of the present table."""
        return LearnedTorques(self.speeds.copy(), self.torques.copy())

    def _notice(
        self,
        timing: StepTiming,
        speed: float,
        free: float,
        state: RobotState,
        mode: Mode,
        command: MotorCommand,
    ) -> None:
        """Record the torques of the drives' loops at this tick."""
        straight = mode.mode == RobotMode.WALK and mode.vy == 0.0 == mode.yaw_rate
        self._teaches = self._teaches and bool(straight)
        self._last_phase = timing.phase
        self._phases[self._age % len(self._phases)] = timing.phase
        if self._age >= self._lead:
            phase = self._phases[(self._age - self._lead) % len(self._phases)]
            notice(
                self._sums,
                self._counts,
                self._weights,
                self.speeds,
                (float(phase), speed, free),
                timing.stance == RIGHT,
                state.q,
                state.v,
                command.floats,
                _DRIVES,
                self._limits,
            )
        self._age += 1

    def _end_step(self, timing: StepTiming, mode: Mode) -> None:
        """Learn from the step that ended, if it was an ordinary one."""
        kept_speed = abs(timing.velocity[0] - float(mode.vx)) <= _OFF_SPEED
        in_time = self._last_phase <= _LATEST
        if self._teaches and kept_speed and in_time and timing.steps > _FIRST:
            c = self._config
            teach(
                self.torques,
                self._sums,
                self._counts,
                self._weights,
                self._limits,
                self._gains,
                (c.leak, c.smoothing),
            )
            self.taught += 1
        self._clear()

    def _clear(self) -> None:
        self._age = 0
        self._teaches = True
        self._sums[:] = 0.0
        self._counts[:] = 0.0
        self._weights[:] = 0.0
