"""Feed-forward of the weight, compiled: how much each leg carries, with what torques.

While the drives act at once, a leg's share of the weight follows its foot's force. With a latency D
of the drives, the leg that lifts would push for a time D after the other leg has landed. Then the
weight shifts by the phase, for the moment at which the drives will act. Over a time T from
touchdown on, the stance leg's share is

    s = min(1, (t + D) / T) min(1, 1 + (t_end - t - D) / T)

with t the time since its touchdown and t_end that of the next touchdown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray
from cassie_gaits.robot import GRAVITY, WEIGHT

if TYPE_CHECKING:  # robot.py takes `holding_torques` from here
    from cassie_control.control.gains import Gains
    from cassie_control.control.outputs import Step
    from cassie_control.control.robot import Robot

_FORCE_DEAD_BAND = 50.0  # N, threshold of a foot's force for its share: it may only touch a bump


@compiled
def damped_weight(gain: Gains, robot: Robot, step: Step) -> float:
    """Force of the legs, in N: the weight, less a damping by the CoM's speed off the slope.

    The knees' own damping has to be small (`config.JointGains`), so that the body would bounce on
    the legs. Where the drives act late, the feet's force predicts the CoM's speed at that time.
    """
    rise = step.slope_ahead * robot.com_velocity[0] + step.slope_left * robot.com_velocity[1]
    acceleration = (robot.force[0] + robot.force[1]) / gain.mass - GRAVITY
    speed = robot.com_velocity[2] - rise + gain.latency * acceleration
    weight: float = WEIGHT - gain.bounce_damping * speed
    return max(0.0, weight)


@compiled
def carried_share(gain: Gains, robot: Robot, step: Step, i: int) -> float:
    """Share of the weight that is fed forward to a leg."""
    share: float
    if gain.latency > 0.0:
        share = _predicted_stance_share(gain, step)
        return share if i == step.stance else 1.0 - share
    if gain.share_force > 0.0:
        force = max(0.0, robot.force[i] - _FORCE_DEAD_BAND)
        other = max(0.0, robot.force[1 - i] - _FORCE_DEAD_BAND)
        share = force / max(0.5 * WEIGHT, force + other)
    else:
        share = robot.load[i] / max(1.0, robot.load[0] + robot.load[1])
    return share


@compiled
def _predicted_stance_share(gain: Gains, step: Step) -> float:
    """Share that the stance leg will carry when the drives act on this command.

    The next touchdown is assumed at the planned end of the step, even if it is late.
    """
    elapsed = step.phase / step.phase_rate + gain.latency
    remaining = (1.0 - step.phase) / step.phase_rate - gain.latency
    loading = min(1.0, max(0.0, elapsed / gain.handover))
    unloading = min(1.0, max(0.0, 1.0 + remaining / gain.handover))
    share: float = loading * unloading
    return share


@compiled
def holding_torques(
    jacobian: FloatArray, tilt: FloatArray, force: float, lean_x: float, lean_y: float
) -> tuple[float, float, float, float]:
    """See `LegReadings.weight_torques`; `jacobian` (3, 7) moves the toe joint, pelvis frame."""
    x = force * (tilt[2, 0] + lean_x * tilt[0, 0] + lean_y * tilt[1, 0])
    y = force * (tilt[2, 1] + lean_x * tilt[0, 1] + lean_y * tilt[1, 1])
    z = force * (tilt[2, 2] + lean_x * tilt[0, 2] + lean_y * tilt[1, 2])
    roll = jacobian[0, 0] * x + jacobian[1, 0] * y + jacobian[2, 0] * z
    yaw = jacobian[0, 1] * x + jacobian[1, 1] * y + jacobian[2, 1] * z
    pitch = jacobian[0, 2] * x + jacobian[1, 2] * y + jacobian[2, 2] * z
    knee = jacobian[0, 3] * x + jacobian[1, 3] * y + jacobian[2, 3] * z
    tarsus = jacobian[0, 5] * x + jacobian[1, 5] * y + jacobian[2, 5] * z
    return -roll, -yaw, -pitch, tarsus - knee
