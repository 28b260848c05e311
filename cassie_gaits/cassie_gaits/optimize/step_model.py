"""Quantities of the problem at one instant and at the change of legs, as CasADi functions.

Coordinates `y` are those of `posture.COORDINATES`; `yd` and `ydd` are their time derivatives. A
step on the left leg is the mirror image of one on the right, so a change of legs mirrors.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from cassie_gaits import robot
from cassie_gaits.optimize import bodies
from cassie_gaits.optimize.inverse_dynamics import Efforts, Recursion, State, foot_frame
from cassie_gaits.optimize.posture import SIZE, Posture, places, posture

_SOLE = bodies.leg("right").sole

FLIP = ca.DM([-1.0, -1.0, 1.0, 1.0, 1.0])
"""Factors on a leg's five joint angles when left and right are exchanged."""


@dataclass(frozen=True)
class Instant:
    """Symbols of one instant, and quantities that follow from them.

    Attributes:
        y, yd, ydd: Coordinates and their rates. Shape (11, 1).
        slope: Rise of the ground ahead. In rad.
        asymmetry, payload: Parameters of the pelvis, see `inverse_dynamics.Recursion`.
        posture: Posture at `y`.
        efforts: Torques and ground reaction, with gravity.
        force, moment: Ground force and moment about the stance sole, in the world's axes. (3, 1).
        stance_rate, swing_rate: Rates of the five joints. Shape (5, 1), in rad/s.
    """

    y: ca.SX
    yd: ca.SX
    ydd: ca.SX
    slope: ca.SX
    asymmetry: ca.SX
    payload: ca.SX
    posture: Posture
    efforts: Efforts
    force: ca.SX
    moment: ca.SX
    stance_rate: ca.SX
    swing_rate: ca.SX


def instant() -> Instant:
    """The instant of a robot in motion on its right foot."""
    y, yd, ydd = (ca.SX.sym(name, SIZE) for name in ("y", "yd", "ydd"))
    slope, asymmetry, payload = (ca.SX.sym(name) for name in ("slope", "asymmetry", "payload"))
    at = posture(y, slope)
    joints = ca.vertcat(at.stance, at.swing)
    rates = ca.jtimes(joints, y, yd)
    accels = ca.jtimes(rates, y, yd) + ca.jtimes(rates, yd, ydd)
    roll_rate, roll_accel = yd[SIZE - 2], ydd[SIZE - 2]
    up = ca.mtimes(at.foot_to_ground.T, ca.DM([0.0, 0.0, robot.GRAVITY]))
    root = foot_state(ca.vertcat(roll_rate, 0.0, 0.0), ca.vertcat(roll_accel, 0.0, 0.0), up)
    efforts = Recursion(asymmetry, payload).run(
        root, (at.stance, rates[:5], accels[:5]), (at.swing, rates[5:], accels[5:])
    )
    to_world = ca.mtimes(at.foot_to_ground, ca.DM(foot_frame().T))
    force, moment = ca.mtimes(to_world, efforts.force), ca.mtimes(to_world, efforts.moment)
    symbols = (y, yd, ydd, slope, asymmetry, payload)
    return Instant(*symbols, at, efforts, force, moment, rates[:5], rates[5:])


def foot_state(omega: ca.SX, alpha: ca.SX, accel: ca.SX) -> State:
    """Motion of the right toe link at the toe joint, from the motion of its sole.

    Args:
        omega: Angular velocity, level foot axes. Shape (3, 1), in rad/s.
        alpha: Angular acceleration, level foot axes. Shape (3, 1), in rad/s^2.
        accel: Acceleration of the sole, level foot axes. Shape (3, 1), in m/s^2.
    """
    turn, sole = ca.DM(foot_frame()), ca.DM(_SOLE)
    state = State(ca.mtimes(turn, omega), ca.mtimes(turn, alpha), ca.mtimes(turn, accel))
    state.accel = state.point(-sole)
    return state


@dataclass(frozen=True)
class Touchdown:
    """Symbols at the change of legs, and residuals that must be zero there.

    Attributes:
        end, end_rate: Coordinates and rates at the end of a step. Shape (11, 1).
        start, start_rate: Coordinates and rates at the start of the next step, mirrored. (11, 1).
        slope, asymmetry, payload: As in `Instant`; the next step's asymmetry is the negative.
        same_posture: Differences of torso and joints across the change. Shape (12, 1), in rad.
        impulse: Impulses of drives and of the foot's roll in the impact. Shape (11, 1), in Nms.
        foot: Position of the swing sole at the end. Shape (3, 1), in m.
        foot_velocity: Velocity of the swing sole at the end. Shape (3, 1), in m/s.
        foot_yaw: Turn of the swing foot against the stance foot. In rad.
        lift: Velocity of the next step's swing sole at its start. Shape (3, 1), in m/s.
    """

    end: ca.SX
    end_rate: ca.SX
    start: ca.SX
    start_rate: ca.SX
    slope: ca.SX
    asymmetry: ca.SX
    payload: ca.SX
    same_posture: ca.SX
    impulse: ca.SX
    foot: ca.SX
    foot_velocity: ca.SX
    foot_yaw: ca.SX
    lift: ca.SX


def touchdown() -> Touchdown:
    """The swing foot lands and becomes the stance foot.

    Source:
        eq:impactMap, as inverse dynamics at rest without gravity, with the jump of velocities as
        acceleration: the impulses of all drives and of the foot's roll are zero.
    """
    end, end_rate, start, start_rate = (
        ca.SX.sym(name, SIZE) for name in ("end", "end_rate", "start", "start_rate")
    )
    slope, asymmetry, payload = (ca.SX.sym(name) for name in ("slope", "asymmetry", "payload"))
    before, after = posture(end, slope), posture(start, slope)
    _, foot, attitude = places(before)
    velocity = ca.jtimes(foot, end, end_rate)
    lift = ca.jtimes(places(after)[1], start, start_rate)
    # The axial vector of R^T R' is the angular velocity in the foot's axes.
    spin = ca.mtimes(attitude.T, _rate_of(attitude, end, end_rate))
    spin = ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])
    jump = foot_state(
        ca.SX.zeros(3),
        ca.vertcat(start_rate[SIZE - 2], 0.0, 0.0) - ca.DM([-1.0, 1.0, -1.0]) * spin,
        -ca.DM([1.0, -1.0, 1.0]) * ca.mtimes(attitude.T, velocity),
    )
    rate_before = ca.jtimes(ca.vertcat(before.stance, before.swing), end, end_rate)
    rate_after = ca.jtimes(ca.vertcat(after.stance, after.swing), start, start_rate)
    still = ca.SX.zeros(5)
    efforts = Recursion(-asymmetry, payload).run(
        jump,
        (after.stance, still, rate_after[:5] - FLIP * rate_before[5:]),
        (after.swing, still, rate_after[5:] - FLIP * rate_before[:5]),
    )
    roll_impulse = ca.dot(ca.DM(foot_frame()[:, 0]), efforts.moment)
    same = _difference(before, after)
    impulse = ca.vertcat(efforts.stance, efforts.swing, roll_impulse)
    yaw = ca.atan2(attitude[1, 0], attitude[0, 0])
    symbols = (end, end_rate, start, start_rate, slope, asymmetry, payload)
    return Touchdown(*symbols, same, impulse, foot, velocity, yaw, lift)


def _difference(before: Posture, after: Posture) -> ca.SX:
    """Differences of torso and joints across the change of legs, which mirrors."""
    return ca.vertcat(
        after.torso[1] - before.torso[1],
        after.torso[2] + before.torso[2],
        after.stance - FLIP * before.swing,
        after.swing - FLIP * before.stance,
    )


def _rate_of(matrix: ca.SX, by: ca.SX, rate: ca.SX) -> ca.SX:
    return ca.reshape(ca.jtimes(ca.vec(matrix), by, rate), 3, 3)
