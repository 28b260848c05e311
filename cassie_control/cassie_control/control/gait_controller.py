"""The controller: standing, walking, riding, damping or no torque, and the changes between."""

from __future__ import annotations

import enum

from cassie_control.config import ControllerConfig
from cassie_control.control.balance import Balance
from cassie_control.control.latency import CommandLatency
from cassie_control.control.limits import limit
from cassie_control.control.outputs import Step
from cassie_control.control.payload import Payload, lifting_force
from cassie_control.control.recovery import (
    RecoveryStep,
    ShorteningLimit,
    add_braking_toe_torque,
    comes_to_rest,
    loaded_leg,
)
from cassie_control.control.riding import RidingController
from cassie_control.control.robot import Readings
from cassie_control.control.standing import StandingController
from cassie_control.control.walking import WalkingController
from cassie_control.errors import ControlError
from cassie_control.finite import LARGEST, check
from cassie_control.learning.torque_learning import TorqueLearning
from cassie_control.learning.torque_table import LearnedTorques
from cassie_control.planner.timing import LEFT, StepTiming
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.drive_limits import DAMPING, TORQUE_LIMITS
from cassie_gaits.gait_library import GaitLibrary
from cassie_gaits.names import KNEE, LEG_DRIVE_COUNT
from cassie_gaits.records import FloatArray, RecordArray, Records
from cassie_gaits.vectors import is_within
from cassie_msgs.layout import (
    ControllerStatus,
    Gait,
    GaitRequest,
    Mode,
    MotorCommand,
    RobotMode,
    RobotState,
)
from cassie_msgs.schedule import GAIT_TICKS

_OFF, _DAMP, _STAND, _WALK, _SEGWAY = map(int, RobotMode)
"""Modes as plain numbers: to find a member of an Enum takes Python 0.3 us."""


@compiled
def report_status(
    statuses: RecordArray,
    states: RecordArray,
    modes: RecordArray,
    commands: RecordArray,
    timings: Records[StepTiming],
    steps: Records[Step],
    torque_limit: FloatArray,
    walks: bool,
    gait_speed: float,
    latency: float,
) -> None:
    """Report a step of the controller in `ControllerStatus.record`.

    Args:
        statuses: Result. Shape (1,).
        states, modes, commands: Inputs and output of the step; records. Shape (1,).
        timings, steps: Timing and step of walking. Shape (1,).
        torque_limit: Torque limits of the drives. Shape (10,), in Nm.
        walks: Whether the robot walks.
        gait_speed: Speed at which the gait library is read. In m/s.
        latency: Latency found in the drives. In s.
    """
    status, state, mode, timing, step = statuses[0], states[0], modes[0], timings[0], steps[0]
    status.sec, status.nanosec = state.sec, state.nanosec
    status.episode, status.seq = state.episode, state.seq
    status.mode_seq, status.mode = mode.effective_seq, mode.mode
    status.phase = timing.phase if walks else 0.0
    status.stance_leg = float(timing.stance) if walks else -1.0
    status.step_count = float(timing.steps) if walks else 0.0
    status.gait_speed, status.step_time = gait_speed, timing.step_time
    status.velocity[0], status.velocity[1] = timing.velocity[0], timing.velocity[1]
    for i in range(9):
        status.y[i] = step.measured[i] - step.desired[i] if walks else 0.0
        status.dy[i] = step.measured_rates[i] - step.desired_rates[i] if walks else 0.0
    status.saturation = 0.0
    for i in range(10):
        share = abs(commands[0].torque[i]) / torque_limit[i]
        status.saturation = max(status.saturation, share)
    status.command_latency = latency


class Activity(enum.Enum):
    """What the controller does now."""

    IDLE = "idle"
    DAMPING = "damping"
    STANDING = "standing"
    LEANING = "leaning"
    WALKING = "walking"
    RIDING = "riding"


class GaitController:
    """Computes drive set-points from state and mode.

    From standing, walking begins with a lean to the left and a step of the right leg. A controller
    that begins anew while the robot walks goes on with a step on the leg that carries it. From
    walking, standing begins at the next touchdown from which it comes to rest; the supervisor asks
    for standing when Cassie steps in place. A push that standing cannot hold makes the robot step
    by itself (`recovery`), until it comes to rest. Riding a Segway is standing with gains of its
    own.

    Args:
        config: Gains.
        library: Gaits.
        period: Control period. In s.
        learned: Torques learned over repeated steps, or None.
    """

    def __init__(
        self,
        config: ControllerConfig,
        library: GaitLibrary,
        period: float,
        learned: LearnedTorques | None = None,
    ) -> None:
        self._period = period
        self._library, self._learned = library, learned
        self.config = config
        self.reset()

    def configure(self, config: ControllerConfig) -> None:
        """Use new gains at once."""
        self.config = config
        self._set_delays()
        self.standing.config = config.stand
        self.riding.configure(config.segway, config.stand)
        self.walking.configure(config.walk)
        self.learning.configure(config)

    def reset(self) -> None:
        """Start afresh, without any memory of the past; takes 10 ms."""
        config, period = self.config, self._period
        self.readings = Readings()
        self.standing = StandingController(Balance(config.stand, period), period)
        self.riding = RidingController(config.segway, config.stand, period)
        self.walking = WalkingController(config.walk, self._library, period)
        self.learning = TorqueLearning(config, self._learned, period)
        self.recovery = RecoveryStep(period)
        self.shortening = ShorteningLimit(period)
        self.latency = CommandLatency(period)
        self._status = ControllerStatus()
        self._payload, self._request = Payload(), GaitRequest()
        self._state = RobotState()
        self._mode = Mode()
        self._command = MotorCommand()
        self.activity = Activity.IDLE
        self._time_in_activity = 0.0
        self._recovering = False
        self._set_delays()

    def _set_delays(self) -> None:
        """Use gains for the drives' delays that were found."""
        latency, torque_delay = self.latency.latency, self.latency.torque_delay
        self.walking.set_delays(latency, torque_delay)
        late = self.config.walk.late
        self.standing.lateness = late.share(latency)
        # Standing knees have nearly twice the damping of walking ones.
        self.standing.knee_factor = late.factor(2.0 * torque_delay)

    def step(self, state: RobotState, mode: Mode) -> MotorCommand:
        """Set-points for one tick.

        Returns:
            The command; reused by the next step.

        Raises:
            ControlError: if state or mode hold a value that is not finite, or the mode is
                unknown; nothing is then changed. Also if the command came out not finite; the
                controller then starts afresh.
        """
        if not is_within(state.floats, LARGEST):
            check(state, "state", ControlError)
        if not is_within(mode.floats, LARGEST):
            check(mode, "mode", ControlError)
        wanted = int(mode.mode)
        if wanted > _SEGWAY:
            raise ControlError(f"mode is {wanted}, must be 0 .. {_SEGWAY}")
        self.readings.update(state, self.standing.com_error)
        if self.latency.observe(state):
            self._set_delays()
        command = self._command
        command.answer(state)
        self._time_in_activity += self._period
        self._select_activity(wanted)
        self._run_activity(mode)
        try:
            limit(command)
        except ControlError:
            self.reset()
            raise
        self.latency.sent(command)
        self._state, self._mode = state, mode
        return command

    def _select_activity(self, mode: int) -> None:
        if mode == _WALK and self.activity is Activity.WALKING:
            return
        if mode in (_OFF, _DAMP):
            self._enter(Activity.IDLE if mode == _OFF else Activity.DAMPING)
        elif mode == _STAND and self.activity is not Activity.WALKING:
            if self.activity is not Activity.STANDING:
                self._enter(Activity.STANDING)
                self.standing.start(self.readings)
        elif mode == _SEGWAY and self.activity is not Activity.RIDING:
            self._enter(Activity.RIDING)
            self.riding.start(self.readings, self.standing.com_error)
        elif mode == _WALK:
            if self.activity is Activity.IDLE and not comes_to_rest(self.readings):
                self._start_walking(loaded_leg(self.readings))
                self.walking.join(self.readings)
            elif self.activity is not Activity.LEANING:
                if self.activity is not Activity.STANDING:
                    self.standing.start(self.readings)
                self._enter(Activity.LEANING)
            elif self._time_in_activity >= self.config.transition.lean_time:
                self._start_walking(LEFT)

    def _start_walking(self, stance: int) -> None:
        """Begin with a step on a stance leg."""
        self._enter(Activity.WALKING)
        self._recovering = False
        self.walking.start(self.readings, stance)
        self.learning.start()

    def _enter(self, activity: Activity) -> None:
        if activity is self.activity:
            return
        self.activity = activity
        self._time_in_activity = 0.0

    def _run_activity(self, mode: Mode) -> None:
        command = self._command
        if self.activity is Activity.WALKING:
            if self._step_walking(mode) and self._may_stop(mode):
                self._enter(Activity.STANDING)
                self.standing.start(self.readings)
                self.standing.step(self.readings, mode, command, 0.0)
        elif self.activity is Activity.IDLE:
            command.torque[:] = command.kp[:] = command.kd[:] = 0.0
        elif self.activity is Activity.DAMPING:
            command.torque[:] = command.kp[:] = command.velocity[:] = 0.0
            command.kd[:] = DAMPING
        elif self.activity is Activity.STANDING:
            self.standing.step(self.readings, mode, command, 0.0)
            self._start_recovery(mode)
        elif self.activity is Activity.RIDING:
            self.riding.step(self.readings, mode, command)
        else:
            transition = self.config.transition
            share = min(1.0, self._time_in_activity / transition.lean_time)
            self.standing.step(self.readings, mode, command, -transition.lean_roll * share)

    def _start_recovery(self, mode: Mode) -> None:
        """Begin a recovery step at this tick if standing cannot hold a push."""
        stance = self.recovery.stance(self.readings, self.standing, self.config.transition)
        if stance is None:
            return
        knee = float(self._command.position[LEG_DRIVE_COUNT * stance + KNEE])
        self.shortening.start(virtual_leg.length(knee))
        self._start_walking(stance)
        self._recovering = True
        self._step_walking(mode)

    def _step_walking(self, mode: Mode) -> bool:
        """One tick of walking; True if a step ended."""
        walking = self.walking
        ended = walking.step(self.readings, mode, self._command)
        speed = walking.library_speed
        self.learning.step(walking.timing, speed, self.readings, mode, self._command)
        if self._recovering and walking.timing.steps < 1:
            stance = walking.timing.stance
            add_braking_toe_torque(self.readings, stance, self._command)
            self.shortening.apply(stance, self._command, self.config.stand)
        return ended

    def _may_stop(self, mode: Mode) -> bool:
        """Whether walking ends at this touchdown."""
        return int(mode.mode) == _STAND and comes_to_rest(self.readings)

    def offer(self, gait: Gait) -> None:
        """Use a gait from the next touchdown of walking on, see `WalkingController.offer`."""
        self.walking.offer(gait)

    def request(self) -> GaitRequest | None:
        """Request of a gait after the last step, or None; every `GAIT_TICKS` ticks; reused.

        The speed ahead is one at which the library is read: gaits made for more cost more work, and
        robots fell on them. The caller calls it after every step where gaits are made: it also
        estimates the payload.
        """
        state, mode, payload = self._state, self._mode, self._payload
        if self.activity is not Activity.WALKING:
            payload.reset()
            return None
        readings = self.readings
        force = lifting_force(readings.records, readings.pair, state.drive_torque)
        payload.step(force, int(self.walking.timing.steps))
        if int(state.seq) % GAIT_TICKS:
            return None
        request = self._request
        request.answer(state)
        request.effective_seq[...] = int(state.seq) + GAIT_TICKS
        request.vx[...] = self.walking.within_library(float(mode.vx))
        request.vy[...], request.yaw_rate[...] = mode.vy, mode.yaw_rate
        request.payload[...], request.slope[...] = payload.mass, self.walking.slope
        return request

    @property
    def status(self) -> ControllerStatus:
        """Report of the last step; reused. It is computed when read, which is not every tick."""
        walking = self.walking
        walks = self.activity is Activity.WALKING
        if walks:
            walking.measure(self.readings)
        report_status(
            self._status.record,
            self._state.record,
            self._mode.record,
            self._command.record,
            walking.timing.records,
            walking.plan.records,
            TORQUE_LIMITS,
            walks,
            walking.library_speed,
            self.latency.latency,
        )
        return self._status
