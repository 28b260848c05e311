"""Feed-forward of the weight, compiled: how much each leg carries, with what torques.

While the drives act at once, a leg's share of the weight follows its foot's force, or its load
under the paper's law. With a latency D of the drives, the leg that lifts would push for a time D
after the other leg has landed. Then the weight shifts by the phase, for the moment at which the
drives will act. With T = `walk.double_support` the stance leg's share is

    s = min(1, (t + D) / T) min(1, 1 + (t_end - t - D) / T)

with t the time since its touchdown and t_end that of the next touchdown.
"""

from __future__ import annotations

from cassie_control.control.gains import Gains
from cassie_control.control.robot import Robot, pendulum_height
from cassie_control.planner.terrain import GroundSlope
from cassie_control.planner.timing import StepTiming
from cassie_gaits import robot as model
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.names import (
    HIP_PITCH,
    HIP_ROLL,
    HIP_YAW,
    KNEE,
    LEG_DRIVE_COUNT,
    TARSUS,
    TOE_DRIVE,
)
from cassie_gaits.records import FloatArray, Records
from cassie_msgs.layout import MotorCommand

_FORCE_DEAD_BAND = 50.0  # N, threshold of a foot's force for its share: it may only touch a bump

_LOADED_FORCE = 30.0  # N, force from which a swing foot counts as loaded
_LOADED_FORCE_SPAN = 100.0  # N, further force at which it counts as loaded in full


@compiled
def swing_foot_load(force: float) -> float:
    """How far a swing foot that carries a force (N) still stands on the ground, 0..1."""
    return min(1.0, max(0.0, (force - _LOADED_FORCE) / _LOADED_FORCE_SPAN))


@compiled
def load_share(robot: Robot, i: int) -> float:
    """A leg's share of both legs' loads. 0..1; where both are light, the sum is below 1."""
    share: float = robot.load[i] / max(1.0, robot.load[0] + robot.load[1])
    return share


@compiled
def carry_weight(
    gain: Gains,
    robot: Robot,
    pairs: Records[LegPair],
    timing: StepTiming,
    slope: GroundSlope,
    command: MotorCommand,
) -> None:
    """Assign the torques with which both legs carry the weight; the toes get none.

    Called before all functions that add torques.

    Args:
        gain: Constants of the law.
        robot, slope: The robot and the ground now.
        pairs: Kinematics of both legs. Shape (1,).
        timing: Phase, at its rate before leg-angle adjustment.
        command: Changed in place.
    """
    weight = damped_weight(gain, robot, slope)
    for i in range(2):
        share = carried_share(gain, robot, timing, i)
        _set_weight_torques(robot, i, weight * share, pairs[0].states[i].toe_jacobian, command)


@compiled
def damped_weight(gain: Gains, robot: Robot, slope: GroundSlope) -> float:
    """Force of the legs, in N: the weight, less a damping by the CoM's speed off the slope.

        F = max(0, W - bounce_damping (v_z - slope . v + D a)),    a = sum of foot forces / m - g.

    The knees' own damping has to be small (`config.JointGains`), so that the body would bounce on
    the legs. D is the latency of late drives, else 0: D a predicts the speed at that time.

    Args:
        gain: Constants of the law.
        robot, slope: The robot and the ground now.
    """
    rise = slope.ahead * robot.com_velocity[0] + slope.left * robot.com_velocity[1]
    acceleration = (robot.force[0] + robot.force[1]) / model.MASS - model.GRAVITY
    speed = robot.com_velocity[2] - rise + gain.latency * acceleration
    weight: float = model.WEIGHT - gain.bounce_damping * speed
    return max(0.0, weight)


@compiled
def carried_share(gain: Gains, robot: Robot, timing: StepTiming, i: int) -> float:
    """Share of the weight that is fed forward to a leg.

    By the feet's forces F_i less 50 N, which is f_i: f_i / max(W / 2, f_0 + f_1). With late drives
    the phase gives the share. The paper's law uses load_i / max(1, load_0 + load_1).

    Args:
        gain: Constants of the law.
        robot: The robot now.
        timing: Phase, at its rate before leg-angle adjustment.
        i: Number of the leg.

    Returns:
        0..1.
    """
    share: float
    if gain.latency > 0.0:
        share = _predicted_stance_share(gain, timing)
        return share if i == timing.stance else 1.0 - share
    if not gain.share_by_force:
        return load_share(robot, i)
    force = max(0.0, robot.force[i] - _FORCE_DEAD_BAND)
    other = max(0.0, robot.force[1 - i] - _FORCE_DEAD_BAND)
    share = force / max(0.5 * model.WEIGHT, force + other)
    return share


@compiled
def _predicted_stance_share(gain: Gains, timing: StepTiming) -> float:
    """Share that the stance leg will carry when the drives act on this command.

    The next touchdown is assumed at the planned end of the step, even if it is late.
    """
    elapsed = timing.phase / timing.rate + gain.latency
    remaining = (1.0 - timing.phase) / timing.rate - gain.latency
    loading = min(1.0, elapsed / gain.double_support)
    unloading = min(1.0, max(0.0, 1.0 + remaining / gain.double_support))
    share: float = loading * unloading
    return share


@compiled
def _set_weight_torques(
    robot: Robot, i: int, weight: float, jacobian: FloatArray, command: MotorCommand
) -> None:
    """Set the torques with which leg `i` holds a weight (N), along the line from foot to CoM."""
    x, y = robot.com[0] - robot.toe_joint[i, 0], robot.com[1] - robot.toe_joint[i, 1]
    z = pendulum_height(robot, i)
    torques = holding_torques(jacobian, robot.R_HP, weight, x / z, y / z)
    base = LEG_DRIVE_COUNT * i
    for k in range(len(torques)):
        command.torque[base + k] = torques[k]
    command.torque[base + TOE_DRIVE] = 0.0


@compiled
def holding_torques(
    jacobian: FloatArray, R_HP: FloatArray, force: float, force_x: float, force_y: float
) -> tuple[float, float, float, float]:
    """Torques of hip roll, yaw, pitch and knee that hold a ground force on the foot.

    Args:
        jacobian: Of the toe joint's position by the joints, pelvis frame. Shape (3, 7), in m/rad.
        R_HP: Rotation from pelvis to heading frame. Shape (3, 3).
        force: Vertical part of the ground force. In N.
        force_x, force_y: Ratios of the force's horizontal parts to the vertical, heading frame.

    Returns:
        Torques. In Nm.

    Source:
        u = -J^T F on the model with rigid springs, where the tarsus turns against the knee.
    """
    x = force * (R_HP[2, 0] + force_x * R_HP[0, 0] + force_y * R_HP[1, 0])
    y = force * (R_HP[2, 1] + force_x * R_HP[0, 1] + force_y * R_HP[1, 1])
    z = force * (R_HP[2, 2] + force_x * R_HP[0, 2] + force_y * R_HP[1, 2])
    roll = jacobian[0, HIP_ROLL] * x + jacobian[1, HIP_ROLL] * y + jacobian[2, HIP_ROLL] * z
    yaw = jacobian[0, HIP_YAW] * x + jacobian[1, HIP_YAW] * y + jacobian[2, HIP_YAW] * z
    pitch = jacobian[0, HIP_PITCH] * x + jacobian[1, HIP_PITCH] * y + jacobian[2, HIP_PITCH] * z
    knee = jacobian[0, KNEE] * x + jacobian[1, KNEE] * y + jacobian[2, KNEE] * z
    tarsus = jacobian[0, TARSUS] * x + jacobian[1, TARSUS] * y + jacobian[2, TARSUS] * z
    return -roll, -yaw, -pitch, tarsus - knee
