"""The paper's own leg-angle adjustment, for comparison."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import HIP_TO_PELVIS, LegReadings, Readings
from cassie_control.planner.pendulum import PendulumState, predict_com
from cassie_control.planner.placement import Commanded, GaitStep, SwingTarget
from cassie_gaits.robot import GRAVITY

_MIN_HEIGHT = 0.4  # m, of the pendulum
_MAX_SIN_ROLL = 0.4  # saturation of the swing leg's roll where the feet would meet


class PaperPlacement:
    """The paper's leg-angle adjustment.

    Added to the gait's swing leg angles at touchdown, with v the low-passed pelvis velocity and
    v_0 the same at the last touchdown:

        pitch: Kp (v_x - command) + Kd (v_x - v_0x) + offset + trim,
        roll:  Kp (v_y - command) + Kd (v_y - v_0y) + d narrowing sat(v_x, 0, 1) + trim,

    with d = 1 in left stance and -1 in right stance: the swing foot lands further in.

    The defaults are the authors' values except for the sagittal Kd and the offset, which the
    authors tune and trim by hand for gaits of their own. With this project's gaits their Kd of 0.25
    lets the speed oscillate by 0.3 m/s with a period of seven steps; 0.4 leaves 0.03. With an
    offset of 0.04 rad the robot accelerates backward from the third step on: beyond the slowest
    gait, the law removes too little of the speed. So the robot falls at -0.25 m/s, too. With the
    drives' gains of that time it walked in place and at 0.25 and 0.5 m/s, with speed errors of
    +0.02 m/s and of -0.03 to -0.1 m/s. With the gains since found for the other law it falls in
    place within a minute.

    Source:
        Da et al. 2016, Eqs. (13) and (17), in the form that the authors run on Cassie; they
        command sideways walking by a constant bias, which here is -Kp command. The bound on the
        distance of the feet is an addition.
    """

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget the velocity at the last touchdown."""
        self._touchdown_velocity = (0.0, 0.0)

    def touchdown(
        self,
        mean_velocity: tuple[float, float],
        velocity: tuple[float, float],
        commanded: Commanded,
    ) -> None:
        """Store the low-passed velocity of this touchdown. In m/s."""
        self._touchdown_velocity = velocity

    def swing_target(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        commanded: Commanded,
        gait_step: GaitStep,
    ) -> SwingTarget:
        """Swing leg at touchdown; arguments as in `Placement.swing_target`."""
        c = self.config
        (vx, vy), (vx_0, vy_0) = gait_step.velocity, self._touchdown_velocity
        pitch = c.paper_kp_x * (vx - commanded.vx) + c.paper_kd_x * (vx - vx_0)
        roll = c.paper_kp_y * (vy - commanded.vy) + c.paper_kd_y * (vy - vy_0)
        roll += stance.side * c.paper_narrowing * max(0.0, min(1.0, vx))
        roll += gait_step.landing_roll + commanded.roll_trim
        reach = gait_step.landing_length + HIP_TO_PELVIS
        uy = swing.hip_y + reach * math.sin(roll) - readings.com[1]
        velocity = (readings.com_velocity[0], readings.com_velocity[1])
        state = _pendulum_state(readings, stance, gait_step, c.double_support, velocity)
        _, y_end, _, _ = predict_com(state, gait_step.remaining)
        shortfall = c.least_foot_distance - swing.side * (y_end + uy)
        if shortfall > 0.0:
            from_hip = readings.com[1] + uy + swing.side * shortfall - swing.hip_y
            roll = math.asin(max(-_MAX_SIN_ROLL, min(_MAX_SIN_ROLL, from_hip / reach)))
        pitch += gait_step.landing_pitch + c.paper_offset + commanded.pitch_trim
        return SwingTarget(pitch, roll, gait_step.landing_length, gait_step.remaining)


def _pendulum_state(
    readings: Readings,
    stance: LegReadings,
    gait_step: GaitStep,
    double_support: float,
    velocity: tuple[float, float],
) -> PendulumState:
    """The CoM as a pendulum on the stance toe joint; `double_support` in s, `velocity` in m/s."""
    com, ankle = readings.com, stance.ankle
    return PendulumState(
        com[0] - ankle[0],
        com[1] - ankle[1],
        velocity[0],
        velocity[1],
        math.sqrt(GRAVITY / max(_MIN_HEIGHT, com[2] - ankle[2])),
        max(0.0, double_support - gait_step.elapsed),
    )
