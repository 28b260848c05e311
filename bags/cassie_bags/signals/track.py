"""A recording as signals over time: set-points, and the robot's true motion."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.continuity import episodes, first_occurrences, only_episode
from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import BoolArray, FloatArray, IntArray, Rows, stamps, stamps_ns
from cassie_bags.errors import BagError
from cassie_bags.signals.leg_geometry import (
    euler_angles,
    in_heading,
    leg_points,
    quaternions,
    rotation_matrices,
    to_world,
)
from cassie_gaits.robot import SOLE_RADIUS
from cassie_msgs.experiment.expectation import TRACKED
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode, RobotState, Sensors
from cassie_sim.segway import TRACK, WHEEL_RADIUS

AVERAGED_OVER = 0.8
"""Width of a moving mean that removes the sway of the gait, about two steps. In s."""

_FLIGHT = 0.25  # s around a sample within which a foot must carry load


@dataclass(frozen=True)
class Track:
    """Signals of one episode at the ticks that have a true pose, a sample and a state.

    Attributes:
        time: Robot time. Shape (n,), in s.
        position: True pelvis origin in the world. Shape (n, 3), in m.
        orientation: True pelvis to world, x y z w. Shape (n, 4).
        velocity: True velocity of the pelvis origin in the world. Shape (n, 3), in m/s.
        angles: True yaw (unwrapped), pitch, roll. Shape (n, 3), in rad.
        achieved: By name of `TRACKED`: velocities of the pelvis origin in the heading frame, yaw
            rate, pelvis height above the loaded soles. Each of shape (n,).
        commanded: Set-points of `achieved` by name; NaN for the height of a robot that walks, which
            its gait decides. Each of shape (n,).
        mode: Mode from the supervisor. Shape (n,).
        legs: `leg_geometry.leg_points` in the world. Shape (n, 2, 9, 3), in m.
        foot_load: Load of each foot, 0..1. Shape (n, 2).
        carries: Whether the robot stands, walks or rides on its own legs: the feet carry load
            within a quarter of a second of the sample. Shape (n,).
        sensors: Rows of `Sensors` at these ticks.
        state: Rows of `RobotState` at these ticks.
        vehicle: True pose of the Segway's chassis at each tick: x, y, z (m), quaternion x y z w;
            the last known pose between its samples. Shape (n, 7), or (0, 7) without a Segway.
        wheels: Angles of the left and right wheel in the chassis, computed without slip. Shape
            (n, 2), or (0, 2), in rad.
    """

    time: FloatArray
    position: FloatArray
    orientation: FloatArray
    velocity: FloatArray
    angles: FloatArray
    achieved: dict[str, FloatArray]
    commanded: dict[str, FloatArray]
    mode: IntArray
    legs: FloatArray
    foot_load: FloatArray
    carries: BoolArray
    sensors: Rows
    state: Rows
    vehicle: FloatArray
    wheels: FloatArray

    @property
    def tick(self) -> float:
        """Time between two ticks; 0 with a single tick. In s."""
        return float(self.time[1] - self.time[0]) if len(self.time) > 1 else 0.0

    @property
    def upright(self) -> FloatArray:
        """Cosine of the tilt of the pelvis. Shape (n,)."""
        cosine: FloatArray = np.cos(self.angles[:, 1]) * np.cos(self.angles[:, 2])
        return cosine

    @property
    def sole_height(self) -> FloatArray:
        """Height of the middle of each sole in the world. Shape (n, 2), in m."""
        return _sole_heights(self.legs)

    @property
    def sole_pitch(self) -> FloatArray:
        """Pitch of each sole, toe up. Shape (n, 2), in rad."""
        tip, heel = self.legs[:, :, -2], self.legs[:, :, -1]
        ahead = np.linalg.norm((tip - heel)[:, :, :2], axis=2)
        pitch: FloatArray = np.arctan2((tip - heel)[:, :, 2], ahead)
        return pitch


def make_track(recording: Recording) -> Track:
    """Signals of the last episode with a tick that has sensors, state and true pose.

    Raises:
        BagError: if no episode has such a tick.
    """
    recording, (sensors, state, truth) = _last_episode(recording)
    orientation = truth["orientation"]
    legs = to_world(leg_points(state["q"][:, 6:]), truth["position"], orientation)
    angles = euler_angles(orientation)
    mode = _held(recording.rows(Mode), sensors, ("mode",))["mode"].astype(np.int64)
    load = state["foot_load"]
    own = np.isin(mode, [RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY])
    own &= _nearby(load.sum(axis=1) > 0.5, stamps(sensors), _FLIGHT)
    velocity = np.einsum("nij,nj->ni", rotation_matrices(orientation), truth["linear"])
    achieved = _velocities(truth, velocity, angles)
    achieved["height"] = truth["position"][:, 2] - _ground(legs, load)
    vehicle, wheels = _vehicle(recording, stamps_ns(sensors))
    return Track(
        time=stamps(sensors),
        position=truth["position"],
        orientation=orientation,
        velocity=velocity,
        angles=angles,
        achieved=achieved,
        commanded=_commanded(recording, sensors, mode),
        mode=mode,
        legs=legs,
        foot_load=load,
        carries=own,
        sensors=sensors,
        state=state,
        vehicle=vehicle,
        wheels=wheels,
    )


def with_estimate_as_truth(recording: Recording) -> Recording:
    """A recording without true pose, with the estimated pose as the true one."""
    state = recording.rows(RobotState)
    truth = np.zeros(len(state), recording.truth.dtype)
    for name in ("sec", "nanosec"):
        truth[name] = state[name]
    truth["position"] = state["q"][:, :3]
    truth["orientation"] = quaternions(state["q"][:, 3:6])
    rotation = rotation_matrices(truth["orientation"])
    truth["linear"] = np.einsum("nji,nj->ni", rotation, state["v"][:, :3])
    truth["angular"] = state["angular_velocity"]
    return dataclasses.replace(recording, truth=truth)


def _last_episode(recording: Recording) -> tuple[Recording, tuple[Rows, Rows, Rows]]:
    """The last episode with a tick that has sensors, state and truth; their rows at such ticks."""
    numbers = episodes(recording)
    if not numbers:
        raise BagError("the recording holds no sample of /cassie/sensors")
    for number in reversed(numbers):
        part = only_episode(recording, number)
        rows = [first_occurrences(part.rows(kind)) for kind in (Sensors, RobotState)]
        rows.append(part.truth)
        ticks = reduce(np.intersect1d, map(stamps_ns, rows))
        if len(ticks):
            sensors, state, truth = (_on_ticks(each, ticks) for each in rows)
            return part, (sensors, state, truth)
    raise BagError("the recording holds no tick with sensors, state and true pose")


def _on_ticks(rows: Rows, ticks: IntArray) -> Rows:
    """The first row of each tick. `ticks` are sorted stamps (ns), and `rows` has each of them."""
    times, first = np.unique(stamps_ns(rows), return_index=True)
    if len(ticks) == len(rows) == len(times) and (np.diff(first) == 1).all():
        return rows  # not copied, for most recordings
    return rows[first[np.isin(times, ticks)]]


def _vehicle(recording: Recording, ticks: IntArray) -> tuple[FloatArray, FloatArray]:
    """The attributes `vehicle` and `wheels` of a track."""
    rows = recording.segway
    if not len(rows):
        return np.zeros((0, 7)), np.zeros((0, 2))
    index = (np.searchsorted(stamps_ns(rows), ticks, side="right") - 1).clip(0)
    pose = np.hstack([rows["position"], rows["orientation"]])
    return pose[index], rolled(pose)[index]


def rolled(pose: FloatArray) -> FloatArray:
    """Angles of a Segway's wheels in its chassis, left and right.

    Args:
        pose: Pose of the chassis: x, y, z (m), quaternion x y z w. Shape (n, 7).

    Returns:
        Angles from the first pose on, without slip. Shape (n, 2), in rad.
    """
    yaw, pitch, _ = euler_angles(pose[:, 3:]).T
    yaw = np.unwrap(yaw)
    middle, moved = 0.5 * (yaw[1:] + yaw[:-1]), np.diff(pose[:, :2], axis=0)
    ahead = np.cos(middle) * moved[:, 0] + np.sin(middle) * moved[:, 1]
    ways = ahead[:, None] - 0.5 * TRACK * np.diff(yaw)[:, None] * np.array([1.0, -1.0])
    angles = np.vstack([np.zeros(2), np.cumsum(ways, axis=0)]) / WHEEL_RADIUS
    turned: FloatArray = angles - (pitch - pitch[0])[:, None]
    return turned


def _nearby(flags: BoolArray, time: FloatArray, width: float) -> BoolArray:
    """Whether a flag is set at most `width` (s) away."""
    if not flags.any():
        return flags
    set_at = time[flags]
    after = np.searchsorted(set_at, time).clip(0, len(set_at) - 1)
    before = (after - 1).clip(0)
    distance = np.minimum(np.abs(set_at[after] - time), np.abs(set_at[before] - time))
    near: BoolArray = distance <= width
    return near


def _velocities(truth: Rows, world: FloatArray, angles: FloatArray) -> dict[str, FloatArray]:
    yaw, pitch, roll = angles.T
    ahead, left, _ = in_heading(world, yaw).T
    rate = truth["angular"]
    return {
        "vx": ahead,
        "vy": left,
        "yaw_rate": (np.sin(roll) * rate[:, 1] + np.cos(roll) * rate[:, 2]) / np.cos(pitch),
    }


def _sole_heights(legs: FloatArray) -> FloatArray:
    heights: FloatArray = legs[:, :, -2:, 2].mean(axis=2) - SOLE_RADIUS
    return heights


def _ground(legs: FloatArray, load: FloatArray) -> FloatArray:
    """Height of the ground under the robot: mean of the soles, weighted by their load."""
    soles = _sole_heights(legs)
    weight = load.clip(0.0, 1.0)
    total = weight.sum(axis=1)
    loaded = (soles * weight).sum(axis=1) / np.where(total > 0.0, total, 1.0)
    ground: FloatArray = np.where(total > 0.05, loaded, soles.min(axis=1))
    return ground


def _commanded(recording: Recording, sensors: Rows, mode: IntArray) -> dict[str, FloatArray]:
    """Set-points of a scripted operator; without one, set-points of the supervisor's modes."""
    operator = recording.rows(OperatorCommand)
    scripted = operator[operator["scripted"]]
    source = scripted if len(scripted) else recording.rows(Mode)
    commanded = _held(source, sensors, TRACKED)
    commanded["height"] = np.where(mode == RobotMode.WALK, np.nan, commanded["height"])
    return commanded


def _held(rows: Rows, sensors: Rows, names: tuple[str, ...]) -> dict[str, npt.NDArray[Any]]:
    """Fields of a scheduled message at each tick, held from `effective_seq` on.

    The first values also hold before they take effect, so that means are those of the set-points.
    """
    rows = rows[rows["episode"] == sensors["episode"][0]] if len(rows) else rows
    if not len(rows):
        return {name: np.zeros(len(sensors)) for name in names}
    rows = rows[np.argsort(rows["effective_seq"], kind="stable")]
    index = np.searchsorted(rows["effective_seq"], sensors["seq"], side="right") - 1
    return {name: rows[name][index.clip(0)] for name in names}
