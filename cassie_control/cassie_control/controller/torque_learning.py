"""Feed-forward torques that are learned over repeated steps: the paper's stated next step."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_control.controller.config import ControllerConfig
from cassie_control.controller.learned_kernels import add, notice, teach
from cassie_control.controller.learned_torques import (
    JOINTS,
    LearnedTorques,
    nothing_learned,
    torque_limits,
)
from cassie_control.controller.readings import Readings
from cassie_control.controller.step_timing import RIGHT, StepTiming
from cassie_gaits.names import DRIVE_IN_Q
from cassie_msgs.layout import Mode, MotorCommand, RobotMode, RobotState

FloatArray = npt.NDArray[np.float64]

_BRIDGE = 0.03  # s, over which the torques of one step become those of the next
_FADE = 0.5  # s, in which all of it comes and goes with the switch
_FADE_FAILED = 0.05  # s, in which it goes once a sensor has failed
_FIRST = 4  # steps after walking began from which on it learns
_LATEST = 1.15  # phase at the end of a step that still teaches
_OFF_SPEED = 0.15  # m/s, from the commanded speed at which a step still teaches
_UPRIGHT = 0.15  # rad of torso roll and pitch within which a step still teaches
_KEEP_BALANCE = [
    JOINTS.index(name)
    for name in ("stance_hip_roll", "stance_hip_pitch", "stance_knee", "swing_hip_roll")
]
_DRIVES = np.array(DRIVE_IN_Q)


class TorqueLearning:
    """Torques by phase, joint and speed, added to the gait's feed-forward and learned from it.

    With u_j(phase, speed) the table, mirrored for steps on the right leg, and

        e_j = kp (position - q) + kd (velocity - v)

    the torque by which the drive's own loop tracked, each step that walked straight ahead at the
    commanded speed changes the table, at the phase p that was `lead` before (the drives' delay and
    what the loop takes), to

        u(p) <- Q[ (1 - leak) u(p) + gain e(p + lead) ], within +- limit of the drive's torque,

    Q a low-pass along the phase. gain / (gain + leak) of what repeats of the error is taken over.
    Four joints are left out, since their errors belong to how it keeps its balance: with learned
    torques of the stance knee, which carries, the sway grows within some twenty steps until it
    falls, and with those of the torso and the swing hip's roll it falls on soft ground. It learns
    on one foot only: with both on the ground the legs press against each other, which no torque
    takes away; there the table goes on as at the nearest phase on one foot.

    What the swing hip's pitch gets pushes the torso back: it nodded by 0.1 rad in each step
    backward, farther than with nothing learned. Backward the stance hip takes that to the ground,
    as it does for the swing leg's inertia (`drive_kernels`), all of it from 1/3 m/s on. Forward it
    is little, and robots that bear set-points 25 ms late fell with it.

    Between its points and its speeds the table is linear; beyond phase 1 and the outermost speeds
    it stays as it is. At a touchdown the torques go over to those of the new step within 30 ms.
    A stance leg gets them in proportion to its load, a swing leg as far as its foot is free. With a
    failed sensor they go at once: they were learned where the drives' loops see their joints.

    Under the paper's own law nothing is added.

    Attributes:
        torques: The table. Shape (s, 10, n), in Nm, of a step on the left leg.
        taught: Steps that it has learned from.

    Args:
        learned: Where it begins; None: nothing learned.
        period: Of control. In s.

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
        """Start over from other torques."""
        self.speeds = np.ascontiguousarray(learned.speeds)
        self.torques = np.array(learned.torques)
        self._sums = np.zeros_like(self.torques)
        self._counts = np.zeros(self.torques.shape[2])
        self._weights = np.zeros(len(self.speeds))
        self.taught = 0
        self.start()

    def configure(self, config: ControllerConfig) -> None:
        """Take over the switch and how it learns."""
        self._config = config.learning
        self._adds = config.learned_torques != "none" and config.walk.law != "paper"
        self._learns = self._adds and config.learned_torques == "learn"
        self._gains = np.full(len(JOINTS), config.learning.gain)
        self._gains[_KEEP_BALANCE] = 0.0
        self._limits = torque_limits() * config.learning.limit
        self._lead = min(len(self._phases) - 1, round(config.learning.lead / self._period))

    def start(self) -> None:
        """Walking begins: nothing is added yet."""
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
            speed: At which the gait library is read. In m/s.
            readings: The robot now.
            mode: What is commanded.
            command: Set-points of this tick, complete.
        """
        failed = int(readings.state.sensor_faults) != 0
        change = self._period / (_FADE_FAILED if failed else _FADE)
        wanted = 1.0 if self._adds and not failed else 0.0
        self._teaches = self._teaches and not failed
        self._share += max(-change, min(change, wanted - self._share))
        if self._share == 0.0:
            return
        fresh = timing.steps != self._steps
        if fresh:
            if self._learns:
                self._end_step(timing, mode)
            self._steps = timing.steps
        swing = readings.legs[1 - timing.stance]
        bridge = max(0.0, 1.0 - timing.elapsed / _BRIDGE)
        free = 1.0 - swing.contact
        if self._learns:
            upright = max(abs(readings.roll), abs(readings.pitch)) <= _UPRIGHT
            self._teaches = self._teaches and upright
            self._notice(timing, speed, 0.0 if bridge else free, readings.state, mode, command)
        add(
            self.torques,
            self.speeds,
            (timing.phase, speed, bridge, self._share),
            (readings.legs[timing.stance].load, free),
            timing.stance == RIGHT,
            fresh,
            self._added,
            self._gaps,
            command.torque,
        )

    def learned(self) -> LearnedTorques:
        """The table as it is now."""
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
        """Keep what the drives' loop does at this tick."""
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
