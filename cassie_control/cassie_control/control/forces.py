"""The weight that the legs are told to carry, compiled: how much, by which leg, with what torques.

While the drives act at once, a leg is told to carry what its foot's force says. Where they act late
on commands, by D, the leg that lifts would go on pushing for D after the other one has landed. Then
the weight goes over by the phase, for the moment at which the drives will act: over a time T from
touchdown on,

    s = min(1, (t + D) / T) min(1, 1 + (t_end - t - D) / T)

of it to the stance leg, t since its touchdown and t_end at the next one.
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

_BRUSHED = 50.0  # N on a foot up to which its leg does not push: it may have met a bump


@compiled
def damped_weight(gain: Gains, robot: Robot, step: Step) -> float:
    """What the legs press with: the weight, less while the CoM rises off the ground's slope.

    The knees' own damping has to be small (`config.JointGains`), so that the body would bounce on
    the legs. Where the drives act late, the feet's force tells how fast the CoM will rise by then.
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
        share = _due(gain, step)
        return share if i == step.stance else 1.0 - share
    if gain.share_force > 0.0:
        force = max(0.0, robot.force[i] - _BRUSHED)
        other = max(0.0, robot.force[1 - i] - _BRUSHED)
        share = force / max(0.5 * WEIGHT, force + other)
    else:
        share = robot.load[i] / max(1.0, robot.load[0] + robot.load[1])
    return share


@compiled
def _due(gain: Gains, step: Step) -> float:
    """Share that the stance leg will carry when the drives act on this command.

    Until the foot of the swing leg carries, its touchdown is taken to come at the end of the step.
    """
    since = step.phase / step.rate + gain.latency
    until = (1.0 - step.phase) / step.rate - gain.latency
    taken = min(1.0, max(0.0, since / gain.handover))
    left = min(1.0, max(0.0, 1.0 + until / gain.handover))
    share: float = taken * left
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
