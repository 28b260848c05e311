"""Decides the robot's mode, and the set-points that the controller gets from commands."""

from __future__ import annotations

from dataclasses import replace

from cassie_control.errors import ControlError
from cassie_control.estimator.channels import ACCELEROMETER
from cassie_control.finite import check
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.health import Battery, TickLoss
from cassie_control.supervisor.leaving import Leaving
from cassie_control.supervisor.limits import asked_for, situation
from cassie_control.supervisor.posture import Posture
from cassie_control.supervisor.set_points import (
    SetPoints,
    commanded_by,
    is_upright,
    meaningless,
    requested_mode,
)
from cassie_control.supervisor.status import SupervisorStatus, faults
from cassie_control.supervisor.transitions import Moment, carries_weight, refusal
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode, RobotState
from cassie_msgs.schedule import PERIOD_TICKS, effective_seq

# Moving feet contradict the accelerometer, whose faults are found from the feet's forces.
_FELT_FROM_FEET = 7 << ACCELEROMETER
_MODES = (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY)
_TAKING_OVER = 1.0  # s for which the torso stays upright after walking


class ModeSupervisor:
    """Stand, walk, damp or off, from the robot's state and the operator's command.

    - Without power: off. After a fall, or while the controller is lost: damp, until the torso has
      been upright for `upright_time` (hung up, or set on its feet).
    - Stand: whenever the torso is upright. From walking the robot first stops: set-points go to
      zero. Once it has stepped in place for `stop_time`, the controller begins to stand at one of
      the next touchdowns.
    - Walk: from standing, once the feet carry the weight and the CoM has been still at
      `walk_height` for `stand_time`; the supervisor itself raises the robot to that height.
    - Segway: from standing, crouched, on both feet, upright and at rest. The operator asks for
      Segway and, as a confirmation, for the crouch. Without the confirmation the robot crouches and
      waits to be asked again. `Leaving` says when riding ends.
    - No command from the operator, a bad link, a sensor that fails, an empty battery, or too many
      missed control ticks: stop and stand; on a Segway, brake and stay on it. With an empty battery
      the robot then sits down.
    - A command without meaning (not a number, an unknown mode) is refused: the last good command
      holds, without its speeds.
    - After damping with feet on the ground, standing begins from the present pelvis height.

    All decisions use the state's own clock, so that a recording replays to the same bits.

    Args:
        config: Limits and conditions.
        period: Control period; `step` is called every `PERIOD_TICKS` control ticks. In s.
    """

    def __init__(self, config: SupervisorConfig, period: float) -> None:
        self.config = config
        self._period = period * PERIOD_TICKS
        self._mode = Mode()
        self.reset()

    def reset(self) -> None:
        """Return to mode off."""
        self.status = SupervisorStatus()
        self._set_points = SetPoints()
        self._commanded = SetPoints()
        self._asked: tuple[bytes, int, SupervisorConfig] | None = None  # last command
        self._refused = ""  # why the last command was refused
        self._requested = RobotMode.STAND
        self._current = RobotMode.OFF
        self._linked = False
        self._ride_confirmed = False  # by the crouch in the same command
        self._since = 0.0
        self._slow = 0.0
        self._walked = False
        self._lifted = False  # while it walked, until stand is asked for
        self._posture = Posture()
        self._leaving = Leaving()
        self._loss = TickLoss(self._period)
        self._battery = Battery()
        self._late = False  # too many control ticks are missed; until the robot stands

    def step(
        self,
        state: RobotState,
        operator: OperatorCommand | None,
        controller_lost: bool = False,
    ) -> Mode:
        """Answer one state.

        Args:
            state: The robot now; its seq a multiple of `PERIOD_TICKS`.
            operator: The command in force; None when no command arrives any more.
            controller_lost: Whether the controller has fallen silent.

        Returns:
            The mode from `effective_seq` on; reused by the next step.

        Raises:
            ControlError: if the state holds a value that is not finite; nothing is then changed.
        """
        check(state, "state", ControlError)
        moving = self._current in (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY)
        self._posture.step(state, moving, self.config, self._period)
        self._loss.step(state)
        self._battery.step(state, self.config)
        self._late = self._loss.recent > self.config.missed_share or (
            self._late and self._current in (RobotMode.WALK, RobotMode.SEGWAY)
        )
        linked = operator is not None and bool(operator.link)
        failed = int(state.sensor_faults)
        if self._current is RobotMode.SEGWAY:
            failed &= ~_FELT_FROM_FEET
        able = not (failed or self._late or self._battery.empty)
        heard, asked_before, self._linked = self._linked, self._requested, linked and able
        refused = self._hear(operator if self._linked else None)
        if self._requested is not RobotMode.SEGWAY:
            self._ride_confirmed = False
        elif operator is not None and asked_before is not RobotMode.SEGWAY:
            self._ride_confirmed = heard and float(operator.height) <= self.config.ride_height
        powered = float(state.power) > 0.5
        asked = self._requested is RobotMode.STAND if self._linked else None
        if self._current is RobotMode.SEGWAY:
            self._leaving.step(asked, self.config, self._period)
        else:
            self._leaving.reset()
        if self._current is RobotMode.WALK:
            # With failed sensors the feet's forces do not show that somebody lifts the robot.
            self._lifted = self._posture.hangs and not failed
        elif self._requested is RobotMode.STAND:
            self._lifted = False
        now = Moment(
            state,
            self._posture,
            self._leaving,
            self._set_points,
            powered,
            controller_lost,
            self._since,
            self._slow,
            self._requested,
            self._ride_confirmed,
            self._lifted,
            self.config,
        )
        reasons = {mode: refusal(now, self._current, mode) for mode in _MODES}
        previous = self._current
        self._current = self._next(reasons, powered, controller_lost)
        self._since = 0.0 if self._current is not previous else self._since + self._period
        walked = previous is RobotMode.WALK or (self._walked and self._since < _TAKING_OVER)
        self._walked = walked and self._current is RobotMode.STAND
        self._limit()
        self.status = SupervisorStatus(
            mode=self._current,
            requested=self._requested,
            stand=reasons[RobotMode.STAND],
            walk=reasons[RobotMode.WALK],
            segway=reasons[RobotMode.SEGWAY],
            faults=faults(
                self._posture.fallen,
                powered,
                self._current is RobotMode.SEGWAY,
                linked or not powered,  # without power no operator is needed
                refused,
                failed,
                self._loss.recent if self._late else 0.0,
                self._battery.fault(state),
            ),
            fallen=self._posture.fallen,
            waits=self._waits(now) if self._current is RobotMode.STAND else "",
            link=linked,
            missed_share=self._loss.share,
        )
        return self._answer(state)

    def _hear(self, operator: OperatorCommand | None) -> str:
        """Store the operator's command; returns why it is refused, or empty."""
        if operator is None:
            self._asked = None
            low = self._battery.empty and self._current is RobotMode.STAND
            height = self.config.height_low if low else self._set_points.height
            self._commanded = SetPoints(height=height)
            self._requested = RobotMode.STAND
            return ""
        asked = (operator.floats.tobytes(), int(operator.mode), self.config)
        if asked == self._asked:
            return self._refused  # operators repeat the same command
        self._asked, self._refused = asked, meaningless(operator)
        if self._refused:
            self._commanded = replace(self._commanded, vx=0.0, vy=0.0, yaw_rate=0.0)
        else:
            self._requested = requested_mode(operator)
            limits = asked_for(self._requested, self.config)
            self._commanded = limits.nearest(commanded_by(operator))
        return self._refused

    def _waits(self, now: Moment) -> str:
        if self._posture.stepping:
            return "one foot off the ground: stepping until it rests"
        return "" if self._posture.grounded else carries_weight(now)

    def _next(
        self, reasons: dict[RobotMode, str], powered: bool, controller_lost: bool
    ) -> RobotMode:
        if not powered:
            return RobotMode.OFF
        if self._posture.fallen or controller_lost:
            return RobotMode.DAMP
        if self._current in (RobotMode.OFF, RobotMode.DAMP):
            return RobotMode.DAMP if reasons[RobotMode.STAND] else RobotMode.STAND
        wanted = RobotMode.STAND if self._lifted else self._requested
        return self._current if reasons[wanted] else wanted

    def _limit(self) -> None:
        """Move the set-points towards the command, within the limits of the mode in force."""
        c = self.config
        if self._current in (RobotMode.OFF, RobotMode.DAMP):
            height = max(c.height_low, min(c.height_high, self._posture.height))
            self._set_points = SetPoints(
                height=height if self._posture.grounded else self._commanded.height
            )
        limits = situation(
            c,
            self._current,
            self._requested,
            stepping=self._posture.stepping,
            walked=self._walked,
        )
        limits.approach(self._set_points, limits.nearest(self._commanded), self._period)
        slow = (
            self._current is RobotMode.WALK
            and self._set_points.vx == self._set_points.vy == self._set_points.yaw_rate == 0.0
            and self._posture.speed < c.stop_speed
            and is_upright(self._set_points)
        )
        self._slow = self._slow + self._period if slow else 0.0

    def _answer(self, state: RobotState) -> Mode:
        mode = self._mode
        mode.answer(state)
        mode.effective_seq[...] = effective_seq(int(state.seq))
        mode.mode[...] = int(self._current)
        mode.transition[...] = min(1.0, self._since)
        self._set_points.write(mode)
        return mode
