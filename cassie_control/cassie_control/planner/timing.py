"""Phase of the step, when the step ends, and the mean walking velocity."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Robot
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Record, Records, array, whole

LEFT, RIGHT = 0, 1
"""Numbers of the legs."""


FOOT_RATE_TIME = 0.03
"""Time constant of the low-pass of a foot's motion that is a difference of two poses. In s."""

_PHASE_RATE_TIME = 0.02  # s, time constant of the phase's rate: at least the longest tick
_FIXED_RATE_PHASE = 0.9  # phase beyond which the step's time is not changed, nor a step joined
_MAX_TOUCHDOWN_SPEED = 1.5  # m/s, vertical, to end a step: feet land at up to 0.9, come free at 3
_WALKING_SPEED = 0.2  # m/s, from which the place of the centre of mass tells the phase
_FULL_BACKWARD = 3.0  # s/m: laws for walking backward act in full from 1/3 m/s on


class StepTiming(Record):
    """Phase and stance leg of the present step, and the velocities read from it.

    A step ends when the swing foot carries `touchdown_force` after `earliest_touchdown` s, or at
    phase `latest_touchdown`. Before, the springs of a leg that is swung quickly may show such a
    force. It does not count while the foot moves up or down by 1.5 m/s or more, either: the foot
    has caught on an edge and comes free, and its springs deflect as the leg stops it.

    Attributes:
        stance: LEFT or RIGHT.
        steps: Steps ended since walking began.
        phase: The paper's tau, 0 at touchdown, 1 at the planned end of the step.
        rate: Rate of the phase. In 1/s.
        step_time: Duration of the step by the gait. In s.
        elapsed: Time since the last touchdown. In s.
        velocity: Low-passed velocity of the pelvis, forward and to the left. In m/s.
        travel: Integral of the pelvis's velocity since the last touchdown. In m.
        mean_velocities: Mean velocities of the last two steps, the newer one last. In m/s.
        foot_height: Height of the swing foot above the stance foot. In m.
        foot_speed: Low-passed vertical speed of the swing foot, without sign. In m/s.
        touchdown_force, earliest_touchdown, latest_touchdown: See `config.WalkConfig`.
        velocity_weight: Low-pass weight of a new velocity.
        period: Control period. In s.
    """

    stance: int = whole()
    steps: int = whole()
    phase: float
    rate: float
    step_time: float
    elapsed: float
    velocity: FloatArray = array(2)
    travel: FloatArray = array(2)
    mean_velocities: FloatArray = array(2, 2)
    foot_height: float
    foot_speed: float
    touchdown_force: float
    earliest_touchdown: float
    latest_touchdown: float
    velocity_weight: float
    period: float

    def __init__(self, config: WalkConfig, step_time: float, period: float) -> None:
        """Prepare for a first step of `step_time` s at a control period in s."""
        super().__init__(step_time=step_time, period=period)
        self.configure(config)
        self.start(LEFT)

    def configure(self, config: WalkConfig) -> None:
        """Use new parameters; the step goes on."""
        self.touchdown_force = config.touchdown_force
        self.earliest_touchdown = config.earliest_touchdown
        self.latest_touchdown = config.latest_touchdown
        self.velocity_weight = 1.0 - math.exp(-2.0 * math.pi * config.speed_filter * self.period)

    def start(self, stance: int) -> None:
        """Begin the first step, on a stance leg."""
        self.stance, self.steps = stance, 0
        self.phase = self.elapsed = 0.0
        self.rate = 1.0 / self.step_time
        self.velocity[:] = self.travel[:] = self.mean_velocities[:] = 0.0
        self.foot_height = self.foot_speed = 0.0

    def join(self, x: float, velocity: tuple[float, float]) -> None:
        """Continue, after `start`, in the middle of a step.

        A robot that walks forward or backward is above its stance foot in the middle of a step, and
        travels velocity * step time in it. One that hardly moves begins its step anew.

        Args:
            x: Of the centre of mass from the stance foot. In m.
            velocity: Of the pelvis, forward and to the left. In m/s.
        """
        self.velocity[:] = velocity
        if abs(velocity[0]) > _WALKING_SPEED:
            phase = 0.5 + x / (velocity[0] * self.step_time)
            self.phase = max(0.0, min(_FIXED_RATE_PHASE, phase))
            self.elapsed = self.phase * self.step_time


@compiled
def advance(timings: Records[StepTiming], robots: Records[Robot]) -> bool:
    """Advance by one period; True if the step ended. `end_step` then begins the next."""
    timing, robot = timings[0], robots[0]
    for k in range(2):
        timing.velocity[k] += timing.velocity_weight * (robot.velocity[k] - timing.velocity[k])
        timing.travel[k] += timing.period * robot.velocity[k]
    stance, swing = timing.stance, 1 - timing.stance
    height = robot.foot[swing, 2] - robot.foot[stance, 2]
    speed = abs(height - timing.foot_height) / timing.period
    timing.foot_speed += timing.period / FOOT_RATE_TIME * (speed - timing.foot_speed)
    timing.foot_height = height
    timing.elapsed += timing.period
    timing.phase += timing.period * timing.rate
    if timing.phase >= timing.latest_touchdown:
        return True
    if timing.elapsed < timing.earliest_touchdown or robot.force[swing] <= timing.touchdown_force:
        return False
    return bool(timing.foot_speed < _MAX_TOUCHDOWN_SPEED)


@compiled
def backward_share(speed: float) -> float:
    """Share of the laws for walking backward at a forward speed (m/s), 0..1."""
    return max(0.0, min(1.0, -_FULL_BACKWARD * speed))


@compiled
def time_to_planned_touchdown(timing: StepTiming) -> float:
    """Time to the end of the step by the gait; 0 where touchdown is late. In s."""
    remaining: float = max(0.0, 1.0 - timing.phase) * timing.step_time
    return remaining


@compiled
def adapt_phase_rate(timing: StepTiming, remaining: float) -> None:
    """Set the phase's rate so that the planned end of the step comes after a time, in s.

    The rate follows with the time constant `_PHASE_RATE_TIME`, and is constant near the end of the
    step.
    """
    if timing.phase > _FIXED_RATE_PHASE:
        return
    rate = (1.0 - timing.phase) / max(remaining, 1e-3)
    timing.rate += timing.period / _PHASE_RATE_TIME * (rate - timing.rate)


@compiled
def end_step(timings: Records[StepTiming]) -> tuple[float, float]:
    """Exchange stance and swing leg, and begin a step; called after `advance`.

    Returns:
        Mean velocity of the last two steps, or of the only one. In m/s.
    """
    timing = timings[0]
    for k in range(2):
        timing.mean_velocities[0, k] = timing.mean_velocities[1, k]
        timing.mean_velocities[1, k] = timing.travel[k] / timing.elapsed
        timing.travel[k] = 0.0
    timing.stance = 1 - timing.stance
    timing.foot_height, timing.foot_speed = -timing.foot_height, 0.0
    timing.steps += 1
    timing.phase = timing.elapsed = 0.0
    timing.rate = 1.0 / timing.step_time
    before, last = timing.mean_velocities[0], timing.mean_velocities[1]
    if timing.steps == 1:
        return last[0], last[1]
    return (before[0] + last[0]) / 2.0, (before[1] + last[1]) / 2.0
