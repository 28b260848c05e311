"""The paper's own leg-angle adjustment, for comparison."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.outputs import AT_END, LENGTH_SW, PITCH_SW, ROLL_SW, Step
from cassie_control.control.robot import HIP_DOWN, HIP_Y, Robot, pendulum_height
from cassie_control.planner.pendulum import PendulumState, predict_com
from cassie_control.planner.placement import Commanded, Placement, SwingTarget
from cassie_control.planner.timing import StepTiming, time_to_planned_touchdown
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Record, Records, array
from cassie_gaits.robot import GRAVITY

_MAX_SIN_ROLL = 0.4  # saturation of the swing leg's roll where the feet would meet


class PaperGains(Record):
    """Fields of `config.WalkConfig` for the paper's law, and its memory of the last touchdown.

    Attributes:
        touchdown_velocity: Low-passed velocity at the last touchdown, forward and to the left. In
            m/s.
    """

    paper_kp_x: float
    paper_kd_x: float
    paper_kp_y: float
    paper_kd_y: float
    paper_narrowing: float
    paper_offset: float
    double_support: float
    least_foot_distance: float
    touchdown_velocity: FloatArray = array(2)


@compiled
def plan_landing_by_paper(
    all_gains: Records[PaperGains],
    robots: Records[Robot],
    timings: Records[StepTiming],
    steps: Records[Step],
    commands: Records[Commanded],
) -> SwingTarget:
    """Swing leg at touchdown, by the law of `PaperPlacement`.

    Args:
        all_gains, robots, timings, commands: Gains, robot, phase and commands. Shape (1,).
        steps: The step, with the gait at this phase. Shape (1,).
    """
    c, robot, timing, step, commanded = all_gains[0], robots[0], timings[0], steps[0], commands[0]
    stance, gait = timing.stance, step.gait
    side = 1.0 - 2.0 * (1 - stance)
    hip_y, com_y = side * HIP_Y, robot.com[1]
    vx, vy = timing.velocity[0], timing.velocity[1]
    vx_0, vy_0 = c.touchdown_velocity[0], c.touchdown_velocity[1]
    pitch = c.paper_kp_x * (vx - commanded.vx) + c.paper_kd_x * (vx - vx_0)
    roll = c.paper_kp_y * (vy - commanded.vy) + c.paper_kd_y * (vy - vy_0)
    roll -= side * c.paper_narrowing * max(0.0, min(1.0, vx))
    roll += gait[ROLL_SW, AT_END] + commanded.roll_trim
    reach = gait[LENGTH_SW, AT_END] + HIP_DOWN
    uy = hip_y + reach * math.sin(roll) - com_y
    remaining = time_to_planned_touchdown(timing)
    _, y_end, _, _ = predict_com(_pendulum_state(c, robot, timing), remaining)
    shortfall = c.least_foot_distance - side * (y_end + uy)
    if shortfall > 0.0:
        from_hip = com_y + uy + side * shortfall - hip_y
        roll = math.asin(max(-_MAX_SIN_ROLL, min(_MAX_SIN_ROLL, from_hip / reach)))
    pitch += gait[PITCH_SW, AT_END] + c.paper_offset + commanded.pitch_trim
    return SwingTarget(pitch, roll, gait[LENGTH_SW, AT_END], remaining, 0.0)


@compiled
def _pendulum_state(gains: PaperGains, robot: Robot, timing: StepTiming) -> PendulumState:
    """The CoM as a pendulum on the stance toe joint."""
    stance = timing.stance
    return PendulumState(
        robot.com[0] - robot.toe_joint[stance, 0],
        robot.com[1] - robot.toe_joint[stance, 1],
        robot.com_velocity[0],
        robot.com_velocity[1],
        math.sqrt(GRAVITY / pendulum_height(robot, stance)),
        max(0.0, gains.double_support - timing.elapsed),
    )


class PaperPlacement(Placement):
    """The paper's leg-angle adjustment (`plan_landing_by_paper`).

    Added to the gait's swing leg angles at touchdown, with v the low-passed pelvis velocity and
    v_0 that at the last touchdown:

        pitch: Kp (v_x - command) + Kd (v_x - v_0x) + offset + trim,
        roll:  Kp (v_y - command) + Kd (v_y - v_0y) - side narrowing sat(v_x, 0, 1) + trim,

    with side = 1 if the left leg swings, else -1: the swing foot lands further in.

    The defaults are the authors' values, except for the sagittal Kd and the offset, which the
    authors tune by hand for gaits of their own. DECISIONS.md has what the law does with each.

    Source:
        Da et al. 2016, Eqs. (13) and (17), in the form that the authors run on Cassie; they
        command sideways walking by a constant bias, which here is -Kp command. The bound on the
        distance of the feet is an addition.

    Attributes:
        gains: For compiled functions.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.gains: PaperGains = PaperGains()
        super().__init__(config)

    def reset(self) -> None:
        """Forget the velocity at the last touchdown."""
        self.gains.touchdown_velocity[:] = (0.0, 0.0)

    def touchdown(
        self,
        mean_velocity: tuple[float, float],
        velocity: tuple[float, float],
        commanded: Commanded,
    ) -> None:
        """Store the low-passed velocity of this touchdown. In m/s."""
        self.gains.touchdown_velocity[:] = velocity
