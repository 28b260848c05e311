"""Decides the robot's mode, and the set-points that the controller gets from commands."""

from __future__ import annotations

from dataclasses import replace

from cassie_control.errors import ControlError
from cassie_control.estimator.channels import ACCELEROMETER_BITS
from cassie_control.finite import check
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.health import Battery, TickLoss
from cassie_control.supervisor.limits import command_limits, limits_in_force
from cassie_control.supervisor.posture import Posture
from cassie_control.supervisor.ride_exit import RideExit
from cassie_control.supervisor.set_points import (
    SetPoints,
    command_fault,
    is_upright,
    requested_mode,
    set_points_of,
)
from cassie_control.supervisor.status import SupervisorStatus, faults
from cassie_control.supervisor.transitions import TransitionInputs, carries_weight, refusal
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode, RobotState
from cassie_msgs.schedule import PERIOD_TICKS, effective_seq

_MODES = (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY)
_TAKE_OVER_TIME = 1.0  # s for which the torso stays upright after walking


class ModeSupervisor:
    """Stand, walk, segway, damp or off, from the robot's state and the operator's command.

    - Without power: off. After a fall: damp, until the torso has been upright for `upright_time`
      (hung up, or set on its feet). While the controller is lost: damp, until it answers again.
    - Stand: whenever the torso is upright. From walking the robot first stops: set-points go to
      zero. Once it has stepped in place for `stop_time`, the controller begins to stand at one of
      the next touchdowns.
    - Walk: from standing, once the feet carry the weight and the CoM has been still at
      `walk_height` for `stand_time`; the supervisor itself raises the robot to that height.
    - Segway: from standing, crouched, on both feet, upright and at rest. The operator asks for
      Segway and, as a confirmation, for the crouch. Without the confirmation the robot crouches and
      waits to be asked again. `RideExit` says when riding ends.
    - No command from the operator, a bad link, a sensor that fails, an empty battery, or too many
      missed control ticks: stop and stand; on a Segway, brake and stay on it. With an empty battery
      the robot then sits down.
    - A command without meaning (not a number, an unknown mode) is refused: the last good command
      holds, without its speeds and, for riding, without its lean.
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
        self._last_command: tuple[bytes, int, SupervisorConfig] | None = None
        self._command_refusal = ""
        self._requested = RobotMode.STAND
        self._mode_in_force = RobotMode.OFF
        self._linked = False
        self._ride_confirmed = False  # by the crouch in the same command
        self._time_in_mode = 0.0
        self._stepping_in_place_time = 0.0
        self._walked_just_now = False
        self._lifted_while_walking = False  # until stand is asked for
        self._posture = Posture()
        self._ride_exit = RideExit()
        self._tick_loss = TickLoss(self._period)
        self._battery = Battery()
        self._ticks_missed = False  # too many of them; until the robot stands

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
        self._observe(state)
        linked = operator is not None and bool(operator.link)
        powered = float(state.power) > 0.5
        failed = self._failed_channels(state)
        able = not (failed or self._ticks_missed or self._battery.empty)
        linked_before, requested_before = self._linked, self._requested
        self._linked = linked and able
        refused = self._read_command(operator if self._linked else None)
        if self._requested is not RobotMode.SEGWAY:
            self._ride_confirmed = False
        elif operator is not None and requested_before is not RobotMode.SEGWAY:
            low = float(operator.height) <= self.config.ride_height
            self._ride_confirmed = linked_before and low
        self._update_ride_exit()
        self._update_lifted(failed)
        inputs = TransitionInputs(
            state=state,
            posture=self._posture,
            ride_exit=self._ride_exit,
            set_points=self._set_points,
            powered=powered,
            controller_lost=controller_lost,
            time_in_mode=self._time_in_mode,
            stepping_in_place_time=self._stepping_in_place_time,
            requested=self._requested,
            ride_confirmed=self._ride_confirmed,
            lifted_while_walking=self._lifted_while_walking,
            config=self.config,
        )
        reasons = {mode: refusal(inputs, self._mode_in_force, mode) for mode in _MODES}
        self._enter(self._next_mode(reasons, powered, controller_lost))
        self._move_set_points()
        standing = self._mode_in_force is RobotMode.STAND
        self.status = SupervisorStatus(
            mode=self._mode_in_force,
            requested=self._requested,
            stand=reasons[RobotMode.STAND],
            walk=reasons[RobotMode.WALK],
            segway=reasons[RobotMode.SEGWAY],
            faults=faults(
                self._posture.fallen,
                powered,
                self._mode_in_force is RobotMode.SEGWAY,
                linked or not powered,  # without power no operator is needed
                refused,
                failed,
                self._tick_loss.recent if self._ticks_missed else 0.0,
                self._battery.fault(state),
            ),
            fallen=self._posture.fallen,
            waits=self._waiting_for(inputs) if standing else "",
            link=linked,
            missed_share=self._tick_loss.share,
        )
        return self._answer(state)

    def _observe(self, state: RobotState) -> None:
        """Update posture, battery and missed control ticks."""
        self._posture.step(state, self._mode_in_force in _MODES, self.config, self._period)
        self._tick_loss.step(state)
        self._battery.step(state, self.config)
        self._ticks_missed = self._tick_loss.recent > self.config.missed_share or (
            self._ticks_missed and self._mode_in_force in (RobotMode.WALK, RobotMode.SEGWAY)
        )

    def _failed_channels(self, state: RobotState) -> int:
        """Sensors' channels that fail, a bit each.

        On a Segway moving feet contradict the accelerometer, which is checked by their forces.
        """
        failed = int(state.sensor_faults)
        if self._mode_in_force is RobotMode.SEGWAY:
            failed &= ~ACCELEROMETER_BITS
        return failed

    def _update_ride_exit(self) -> None:
        """Update the confirmation with which riding ends."""
        stand_requested = self._requested is RobotMode.STAND if self._linked else None
        if self._mode_in_force is RobotMode.SEGWAY:
            self._ride_exit.step(stand_requested, self.config, self._period)
        else:
            self._ride_exit.reset()

    def _update_lifted(self, failed: int) -> None:
        """Update whether somebody has lifted the walking robot; `failed` channels, a bit each."""
        if self._mode_in_force is RobotMode.WALK:
            # With failed sensors the feet's forces do not show that somebody lifts the robot.
            self._lifted_while_walking = self._posture.hangs and not failed
        elif self._requested is RobotMode.STAND:
            self._lifted_while_walking = False

    def _enter(self, mode: RobotMode) -> None:
        """Put a mode in force, which may be the present one."""
        previous, self._mode_in_force = self._mode_in_force, mode
        self._time_in_mode = 0.0 if mode is not previous else self._time_in_mode + self._period
        recent = self._walked_just_now and self._time_in_mode < _TAKE_OVER_TIME
        walked = previous is RobotMode.WALK or recent
        self._walked_just_now = walked and mode is RobotMode.STAND

    def _read_command(self, operator: OperatorCommand | None) -> str:
        """Store the operator's command; returns why it is refused, or empty."""
        if operator is None:
            self._last_command = None
            sits_down = self._battery.empty and self._mode_in_force is RobotMode.STAND
            height = self.config.height_low if sits_down else self._set_points.height
            self._commanded = SetPoints(height=height)
            self._requested = RobotMode.STAND
            return ""
        command = (operator.floats.tobytes(), int(operator.mode), self.config)
        if command == self._last_command:
            return self._command_refusal  # operators repeat the same command
        self._last_command, self._command_refusal = command, command_fault(operator)
        if self._command_refusal:
            self._commanded = replace(self._commanded, vx=0.0, vy=0.0, yaw_rate=0.0)
            if self._requested is RobotMode.SEGWAY:
                self._commanded = replace(self._commanded, com_x=0.0, com_y=0.0)
        else:
            self._requested = requested_mode(operator)
            limits = command_limits(self._requested, self.config)
            self._commanded = limits.clamp(set_points_of(operator))
        return self._command_refusal

    def _waiting_for(self, inputs: TransitionInputs) -> str:
        if self._posture.stepping:
            return "one foot off the ground: stepping until it rests"
        return "" if self._posture.grounded else carries_weight(inputs)

    def _next_mode(
        self, reasons: dict[RobotMode, str], powered: bool, controller_lost: bool
    ) -> RobotMode:
        if not powered:
            return RobotMode.OFF
        if self._posture.fallen or controller_lost:
            return RobotMode.DAMP
        if self._mode_in_force in (RobotMode.OFF, RobotMode.DAMP):
            return RobotMode.DAMP if reasons[RobotMode.STAND] else RobotMode.STAND
        wanted = RobotMode.STAND if self._lifted_while_walking else self._requested
        return self._mode_in_force if reasons[wanted] else wanted

    def _move_set_points(self) -> None:
        """Move the set-points towards the command, within the limits of the mode in force."""
        c = self.config
        if self._mode_in_force in (RobotMode.OFF, RobotMode.DAMP):
            height = max(c.height_low, min(c.height_high, self._posture.height))
            self._set_points = SetPoints(
                height=height if self._posture.grounded else self._commanded.height
            )
        limits = limits_in_force(
            c,
            self._mode_in_force,
            self._requested,
            stepping=self._posture.stepping,
            walked=self._walked_just_now,
        )
        limits.approach(self._set_points, limits.clamp(self._commanded), self._period)
        slow = (
            self._mode_in_force is RobotMode.WALK
            and self._set_points.vx == self._set_points.vy == self._set_points.yaw_rate == 0.0
            and self._posture.speed < c.stop_speed
            and is_upright(self._set_points)
        )
        time = self._stepping_in_place_time + self._period
        self._stepping_in_place_time = time if slow else 0.0

    def _answer(self, state: RobotState) -> Mode:
        mode = self._mode
        mode.answer(state)
        mode.effective_seq[...] = effective_seq(int(state.seq))
        mode.mode[...] = int(self._mode_in_force)
        mode.transition[...] = min(1.0, self._time_in_mode)
        self._set_points.write(mode)
        return mode
