"""A core that breaks: the drives damp, the reason is kept, and all is well again after it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cassie_control.errors import SensorError
from cassie_control.guarded import GuardedController, GuardedEstimator, GuardedSupervisor
from cassie_control.supervisor.status import SupervisorStatus
from cassie_msgs.layout import (
    ControllerStatus,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sensors,
)


class Estimator:
    """Breaks on tick 1."""

    def reset(self) -> None: ...

    def step(self, sensors: Sensors) -> RobotState:
        if sensors.seq == 1:
            raise SensorError("sensor gyro[0] is nan")
        return RobotState()


class Controller:
    """Breaks on tick 1, and its status on tick 2."""

    def __init__(self) -> None:
        self.seq = 0

    def reset(self) -> None: ...

    def step(self, state: RobotState, mode: Mode) -> MotorCommand:
        self.seq = int(state.seq)
        if self.seq == 1:
            raise ZeroDivisionError("division by zero")
        return MotorCommand()

    @property
    def status(self) -> ControllerStatus:
        if self.seq == 2:
            raise AttributeError("no phase")
        return ControllerStatus()


class Supervisor:
    """Notes the states it gets."""

    status = SupervisorStatus(mode=RobotMode.STAND)

    def __init__(self) -> None:
        self.seen: list[int] = []

    def reset(self) -> None: ...

    def step(
        self, state: RobotState, operator: OperatorCommand | None, controller_lost: bool = False
    ) -> Mode:
        self.seen.append(int(state.seq))
        mode = Mode()
        mode.mode[...] = int(RobotMode.STAND)
        return mode


def _state(seq: int) -> RobotState:
    state = RobotState()
    state.seq[...] = seq
    state.episode[...] = 7
    state.stamp_ns = 2_000_000 * seq
    return state


def _line_of(text: str) -> int:
    lines = Path(__file__).read_text(encoding="utf-8").splitlines()
    return next(number for number, line in enumerate(lines, 1) if line.strip().startswith(text))


def test_a_sample_that_cannot_be_used_gives_a_state_that_cannot_either() -> None:
    estimator = GuardedEstimator(Estimator())
    sensors = Sensors()
    sensors.seq[...] = 1
    sensors.episode[...] = 7
    sensors.stamp_ns = 2_000_000
    state = estimator.step(sensors)
    assert np.isnan(state.q).all()
    assert (int(state.seq), int(state.episode), state.stamp_ns) == (1, 7, 2_000_000)
    assert estimator.problem == "sensor gyro[0] is nan"
    sensors.seq[...] = 2
    assert np.isfinite(estimator.step(sensors).q).all()
    assert estimator.problem == ""


def test_a_state_that_cannot_be_answered_gives_damping() -> None:
    controller = GuardedController(Controller())
    command = controller.step(_state(1), Mode())
    assert (command.kd > 0.0).all()
    assert not command.kp.any()
    assert not command.torque.any()
    assert (int(command.seq), int(command.episode), command.stamp_ns) == (1, 7, 2_000_000)
    place = f"test_guarded.py:{_line_of('raise ZeroDivisionError')}"
    assert controller.problem == f"ZeroDivisionError: division by zero ({place})"
    controller.step(_state(3), Mode())
    assert controller.problem == ""


def test_a_status_that_breaks_does_not_cost_the_controller() -> None:
    controller = GuardedController(Controller())
    controller.step(_state(2), Mode())
    assert int(controller.status(_state(2)).seq) == 2
    place = f"test_guarded.py:{_line_of('raise AttributeError')}"
    assert controller.problem == f"AttributeError: no phase ({place})"


def test_a_state_of_nan_damps_and_does_not_reach_the_supervisors_filters() -> None:
    core = Supervisor()
    supervisor = GuardedSupervisor(core)
    state = _state(10)
    state.v[3] = np.nan
    mode = supervisor.step(state, None)
    assert mode.mode == RobotMode.DAMP
    assert (int(mode.seq), int(mode.effective_seq)) == (10, 20)
    assert core.seen == []
    assert "not finite" in supervisor.problem
    assert supervisor.status.mode is RobotMode.DAMP  # in words, too
    assert "not finite" in supervisor.status.faults[0]
    assert supervisor.step(_state(20), None).mode == RobotMode.STAND
    assert supervisor.problem == ""
    assert supervisor.status.mode is RobotMode.STAND


def test_a_state_that_cannot_be_estimated_still_tells_pace_and_lease() -> None:
    class Estimator:
        def reset(self) -> None: ...

        def step(self, sensors: Sensors) -> RobotState:
            raise ZeroDivisionError("division by zero")

    sensors = Sensors()
    sensors.wall_paced[...], sensors.operator_lease[...], sensors.missed_ticks[...] = 1, 77, 5
    state = GuardedEstimator(Estimator()).step(sensors)
    assert np.isnan(state.q).all()
    assert (state.wall_paced, state.operator_lease, state.missed_ticks) == (1, 77, 5)
