"""The cores with a safe answer where they fail: drives damp, and the reason is kept.

The nodes and the run in one process both use these, so that they also agree on bad input.
"""

from __future__ import annotations

import math
import traceback
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from cassie_control.errors import ControlError, SensorError
from cassie_control.estimator.channels import no_estimate
from cassie_control.supervisor.status import SupervisorStatus, damped
from cassie_gaits.drive_limits import DAMPING
from cassie_gaits.errors import CassieError
from cassie_msgs.layout import (
    ControllerStatus,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sample,
    Sensors,
)
from cassie_msgs.schedule import effective_seq

SampleT = TypeVar("SampleT", bound=Sample)


class Estimator(Protocol):
    """Interface of a state estimator."""

    def reset(self) -> None: ...

    def step(self, sensors: Sensors) -> RobotState: ...


class Controller(Protocol):
    """Interface of a controller."""

    @property
    def status(self) -> ControllerStatus: ...

    def reset(self) -> None: ...

    def step(self, state: RobotState, mode: Mode) -> MotorCommand: ...


class Supervisor(Protocol):
    """Interface of a supervisor."""

    @property
    def status(self) -> SupervisorStatus: ...

    def reset(self) -> None: ...

    def step(
        self, state: RobotState, operator: OperatorCommand | None, controller_lost: bool = False
    ) -> Mode: ...


class GuardedEstimator:
    """An estimator that answers a sample it cannot use with a state of NaN.

    Missed samples are interpolated linearly between the last and the next sample, so that the
    estimator's filters go on at their own rate.

    Args:
        core: The estimator.
        most_missed: Largest number of missed samples in a row that are interpolated; after more,
            the estimator goes on from the next sample as if none were missing.

    Attributes:
        problem: Why the last sample could not be used; empty when it could.
    """

    def __init__(self, core: Estimator, most_missed: int = 0) -> None:
        self.core = core
        self._most_missed = most_missed
        self._last, self._between = Sensors(), Sensors()
        self.problem = ""
        self._invalid = RobotState()
        self._invalid.q[:] = self._invalid.v[:] = np.nan

    def reset(self) -> None:
        """Start afresh."""
        self.problem = ""
        self.core.reset()

    def step(self, sensors: Sensors) -> RobotState:
        """The state at this sample; reused by the next step."""
        try:
            if self._most_missed:
                self._bridge(sensors)
            state = self.core.step(sensors)
        except Exception as error:  # whatever broke, the drives must damp
            self.problem = _describe(error)
            self._invalid.power[...] = sensors.power
            missing = error.missing if isinstance(error, SensorError) else 0
            self._invalid.sensor_faults[...] = missing
            self._invalid.copy_tail(sensors, "missed_ticks")
            return _answering(self._invalid, sensors)
        self.problem = ""
        return state

    def _bridge(self, sensors: Sensors) -> None:
        """Step the estimator with interpolated samples for the missed ones."""
        last, between = self._last, self._between
        (last_episode, last_seq), (episode, seq) = last.place, sensors.place
        steps = seq - last_seq
        if episode == last_episode and 1 < steps <= self._most_missed + 1:
            for step in range(1, steps):
                between.copy_from(sensors)
                between.floats[:] = last.floats + step / steps * (sensors.floats - last.floats)
                between.orientation[:] /= np.linalg.norm(between.orientation)
                between.seq[...] = last_seq + step
                between.stamp_ns = (
                    last.stamp_ns + (sensors.stamp_ns - last.stamp_ns) * step // steps
                )
                self.core.step(between)
        last.copy_from(sensors)


class GuardedController:
    """A controller that damps the drives where it fails.

    Attributes:
        problem: Why the last state could not be answered; empty when it could.
    """

    def __init__(self, core: Controller) -> None:
        self.core = core
        self.problem = ""
        self._blank = ControllerStatus()
        self._damping = MotorCommand()
        self._damping.kd[:] = DAMPING

    def reset(self) -> None:
        """Start afresh."""
        self.problem = ""
        self.core.reset()

    def step(self, state: RobotState, mode: Mode) -> MotorCommand:
        """Set-points for one tick; reused by the next step."""
        try:
            command = self.core.step(state, mode)
        except Exception as error:  # whatever broke, the drives must damp
            self.problem = _describe(error)
            return _answering(self._damping, state)
        self.problem = ""
        return command

    def status(self, state: RobotState) -> ControllerStatus:
        """Report of the step that answered `state`; blank where it failed. Reused."""
        if not self.problem:
            try:
                return self.core.status
            except Exception as error:  # a report that fails must not stop the controller
                self.problem = _describe(error)
        return _answering(self._blank, state)


class GuardedSupervisor:
    """A supervisor that lets the drives damp where it fails.

    Attributes:
        problem: Why the last state could not be answered; empty when it could.
        status: Status that belongs to the last answer, for people.
    """

    def __init__(self, core: Supervisor) -> None:
        self.core = core
        self.problem = ""
        self._damping = Mode()
        self._damping.mode[...] = int(RobotMode.DAMP)
        self.status = core.status

    def reset(self) -> None:
        """Start afresh."""
        self.problem = ""
        self.core.reset()
        self.status = self.core.status

    def step(
        self, state: RobotState, operator: OperatorCommand | None, controller_lost: bool = False
    ) -> Mode:
        """The mode for the ticks from `effective_seq` on; reused by the next step."""
        try:
            if not math.isfinite(state.q.dot(state.q) + state.v.dot(state.v)):
                # A state that is not finite must not enter the core's filters.
                missing = int(state.sensor_faults)
                raise ControlError(no_estimate(missing) if missing else "the state is not finite")
            mode = self.core.step(state, operator, controller_lost)
        except Exception as error:  # whatever broke, the drives must damp
            self.problem = _describe(error)
            self.status = damped(self.core.status, self.problem)
            self._damping.effective_seq[...] = effective_seq(int(state.seq))
            return _answering(self._damping, state)
        self.problem = ""
        self.status = self.core.status
        return mode


def _answering(answer: SampleT, question: Sample) -> SampleT:
    answer.answer(question)
    return answer


def _describe(error: Exception) -> str:
    """The error in words; for an unexpected one also its type and place in the code."""
    text = " ".join(str(error).split())
    if isinstance(error, CassieError):
        return text
    *_, (frame, line) = traceback.walk_tb(error.__traceback__)
    place = f"{Path(frame.f_code.co_filename).name}:{line}"
    return f"{type(error).__name__}: {text or 'no further words'} ({place})"
