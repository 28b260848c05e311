"""The robot's state for a browser page, from samples of the control lane."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from cassie_msgs.layout import ControllerStatus, Mode, OperatorCommand, RobotState, Sample
from cassie_teleop.robot_description import RobotDescription

FloatArray = npt.NDArray[np.float64]
SampleT = TypeVar("SampleT", bound=Sample)

SILENCE = 1.0
"""Age from which a topic counts as silent. In s."""

_WINDOW = 3.0  # s of wall time over which the real-time factor is computed
_DRIVES = tuple(
    f"{leg}_{drive}"
    for leg in ("left", "right")
    for drive in ("hip_roll", "hip_yaw", "hip_pitch", "knee", "toe")
)


class RealTimeFactor:
    """Ratio of robot time to wall time, over the last seconds."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, float]] = deque()

    def add(self, wall: float, robot: float) -> None:
        """Take in the robot time at wall time `wall`; a new episode starts anew."""
        if self._points and robot < self._points[-1][1]:
            self._points.clear()
        self._points.append((wall, robot))
        while wall - self._points[0][0] > _WINDOW:
            self._points.popleft()

    @property
    def value(self) -> float | None:
        """The ratio; None before there are two points."""
        (w0, r0), (w1, r1) = (self._points[0], self._points[-1]) if self._points else ((0, 0),) * 2
        return (r1 - r0) / (w1 - w0) if w1 - w0 > 0.2 else None


class Heard(Generic[SampleT]):
    """Newest sample of a type and the time at which it came."""

    def __init__(self, sample: SampleT) -> None:
        self.sample = sample
        self.at = -math.inf

    def load(self, raw: bytes, now: float) -> None:
        """Take in a message; one that does not fit its type changes nothing."""
        try:
            self.sample.load(raw)
        except ValueError:
            return
        self.at = now

    def fresh(self, now: float) -> bool:
        """Whether the sample came within `SILENCE`."""
        return now - self.at <= SILENCE


class Picture:
    """Collects messages and returns their values for the page.

    Attributes:
        state, mode, controller, operator: Newest sample of each, and the time at which it came.
        factor: Ratio of robot time to wall time.
        poses: Pose of each frame in its parent: x, y, z in m, quaternion x, y, z, w.
        segway: Speed of the Segway, in m/s, and the time at which it came.
    """

    def __init__(self) -> None:
        self.state, self.mode = Heard(RobotState()), Heard(Mode())
        self.controller, self.operator = Heard(ControllerStatus()), Heard(OperatorCommand())
        self.factor = RealTimeFactor()
        self.poses: dict[str, Sequence[float]] = {}
        self.segway = (0.0, -math.inf)

    def follow_state(self, raw: bytes, now: float) -> bool:
        """Take in a state; returns whether it begins another episode."""
        state = self.state.sample
        before, known = int(state.episode), self.state.at > -math.inf
        self.state.load(raw, now)
        self.factor.add(now, state.stamp_ns * 1e-9)
        return known and int(state.episode) != before

    @property
    def yaw(self) -> float:
        """Heading of the robot. In rad."""
        return float(self.state.sample.q[3])

    @property
    def powered(self) -> bool:
        """Whether the drives have power, by the newest state."""
        return float(self.state.sample.power) > 0.5

    @property
    def wall_paced(self) -> bool:
        """Whether robot time follows the wall clock, by the newest state."""
        return bool(self.state.sample.wall_paced)

    def figures(self, now: float, robot: RobotDescription | None) -> dict[str, Any]:
        """All values that change with each frame, for JSON; None stands for unknown."""
        state, controller = self.state.sample, self.controller.sample
        known, working = self.state.fresh(now), self.controller.fresh(now)
        factor = self.factor.value if known else None
        limited, asked = self.mode.fresh(now), self.operator.fresh(now)
        efforts = robot.efforts if robot is not None else {}
        links = robot.moving if robot is not None else []
        limits = np.array([efforts.get(name, math.inf) for name in _DRIVES])
        return {
            "stamp": round(state.stamp_ns * 1e-9, 3) if known else None,
            "episode": int(state.episode) if self.state.at > -math.inf else None,
            "poses": [_pose(self.poses.get(name, ())) for name in links],
            "achieved": _rounded(achieved(state), 3) if known else None,
            "segway": finite(self.segway[0], 2) if now - self.segway[1] <= SILENCE else None,
            "limited": _set_points(self.mode.sample) if limited else None,
            "asked": _set_points(self.operator.sample) if asked else None,
            "torque": _rounded(state.drive_torque / limits, 3) if known else None,
            "contact": _rounded(state.contact_probability, 2) if known else None,
            "force": _rounded(state.foot_force, 0) if known else None,
            "battery": _rounded(state.battery_charge.ravel(), 2)[0] if known else None,
            "outputs": _rounded(controller.y, 4) if working else None,
            "phase": _rounded(controller.phase.ravel(), 3)[0] if working else None,
            "latency": _rounded(controller.command_latency.ravel(), 4)[0] if working else None,
            "factor": None if factor is None else round(factor, 2),
        }


def achieved(state: RobotState) -> FloatArray:
    """Speed forward and to the left in the heading frame, in m/s, and turn rate, in rad/s. (3,)."""
    x, y, _, yaw_rate = state.v[:4].tolist()
    cosine, sine = math.cos(float(state.q[3])), math.sin(float(state.q[3]))
    return np.array([cosine * x + sine * y, cosine * y - sine * x, yaw_rate])


def _pose(pose: Sequence[float]) -> Sequence[float | None]:
    return _rounded(pose, 4) if all(map(math.isfinite, pose)) else ()


def _set_points(sample: Mode | OperatorCommand) -> list[float | None]:
    """Speeds forward and to the left, turn rate, height."""
    values = (sample.vx, sample.vy, sample.yaw_rate, sample.height)
    return _rounded([float(value) for value in values], 3)


def finite(value: float, digits: int) -> float | None:
    """A rounded number for JSON; None if it is not finite, which JSON cannot express."""
    return round(float(value), digits) if math.isfinite(value) else None


def _rounded(values: Sequence[float] | FloatArray, digits: int) -> list[float | None]:
    return [finite(value, digits) for value in values]
