"""Which mode may follow which: a table of conditions; each one says in words why it fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cassie_control.estimator.config import ON_GROUND
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.limits import limits_in_force
from cassie_control.supervisor.posture import Posture
from cassie_control.supervisor.ride_exit import RideExit
from cassie_control.supervisor.set_points import SetPoints, have_same_posture
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import RobotMode, RobotState

_STAND, _WALK, _SEGWAY = RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY


@dataclass(frozen=True)
class TransitionInputs:
    """Inputs of the conditions.

    Attributes:
        state: The robot now.
        posture, ride_exit: Posture of the robot, and whether riding may end.
        set_points: Set-points in force.
        powered: Whether the drives have power.
        controller_lost: Whether the controller is silent.
        time_in_mode: Time for which the mode has been in force. In s.
        stepping_in_place_time: Time for which the robot has stepped in place, ready to stand. In s.
        requested: Mode that the operator asks for.
        ride_confirmed: Whether the operator has asked for riding and for its crouch.
        lifted_while_walking: Whether the robot was lifted while it walked, and stand was not asked
            for since.
        config: Bounds.
    """

    state: RobotState
    posture: Posture
    ride_exit: RideExit
    set_points: SetPoints
    powered: bool
    controller_lost: bool
    time_in_mode: float
    stepping_in_place_time: float
    requested: RobotMode
    ride_confirmed: bool
    lifted_while_walking: bool
    config: SupervisorConfig


Condition = Callable[[TransitionInputs], str]
"""Returns why the condition does not hold; empty where it holds."""


def _has_power(now: TransitionInputs) -> str:
    return "" if now.powered else "the drives have no power"


def _has_controller(now: TransitionInputs) -> str:
    return "the controller is silent" if now.controller_lost else ""


def _has_not_fallen(now: TransitionInputs) -> str:
    return "Cassie fell: hang it up or set it upright" if now.posture.fallen else ""


def _is_high(now: TransitionInputs) -> str:
    low = now.posture.low
    return f"the pelvis is at {now.posture.height:.2f} m: lift it" if low else ""


def _is_upright(now: TransitionInputs) -> str:
    if now.posture.upright > 0.0:
        return ""
    return f"the torso is tilted by more than {now.config.upright_tilt:g} rad"


def _stands(_: TransitionInputs) -> str:
    return "stand first"


def carries_weight(now: TransitionInputs) -> str:
    """Condition: both feet are on the ground and carry the robot."""
    carried = float(now.state.foot_force.sum())
    loaded = carried >= now.config.weight_share * WEIGHT
    if loaded and float(now.state.contact_probability.min()) >= ON_GROUND:
        return ""
    carried = max(0.0, carried)  # in the air the estimate may be below zero
    return f"the feet carry {carried:.0f} N of {WEIGHT:.0f} N: let it down"


def _is_at_walking_height(now: TransitionInputs) -> str:
    c, height = now.config, now.posture.height
    if abs(height - c.walk_height) <= c.height_tolerance:
        return ""
    return f"walking begins at {c.walk_height:g} m, pelvis at {height:.2f} m"


def _is_crouched(now: TransitionInputs) -> str:
    c, height = now.config, now.posture.height
    if height <= c.ride_height + c.height_tolerance:
        return ""
    return f"riding needs a crouch of {c.ride_height:g} m, pelvis at {height:.2f} m"


def _is_straight_to(mode: RobotMode) -> Condition:
    """Condition: tilt, shift and trims are within the limits of a mode without CoM shift."""

    def condition(now: TransitionInputs) -> str:
        asked = mode if mode is _WALK else _STAND
        limits = limits_in_force(now.config, mode, asked, stepping=False, walked=False)
        straight = have_same_posture(now.set_points, limits.clamp(now.set_points))
        return "" if straight else "straightening up first"

    return condition


def _is_still(now: TransitionInputs) -> str:
    still, needed = min(now.posture.still, now.time_in_mode), now.config.stand_time
    return f"standing still for {still:.1f} s of {needed:g} s" if still < needed else ""


def _is_confirmed(now: TransitionInputs) -> str:
    if now.requested is not _SEGWAY or now.ride_confirmed:
        return ""
    return f"to ride ask for stand at {now.config.ride_height:g} m or less and for segway again"


def _is_asked_anew(now: TransitionInputs) -> str:
    lifted = now.lifted_while_walking
    return "the robot was lifted while walking: ask for stand, then for walk" if lifted else ""


def _has_slowed_down(now: TransitionInputs) -> str:
    c, speed = now.config, now.posture.speed
    if now.stepping_in_place_time >= c.stop_time or now.lifted_while_walking:
        return ""
    if max(abs(now.set_points.vx), abs(now.set_points.vy)) > 0.0:
        return f"slowing down from {speed:.2f} m/s"
    return f"stepping in place first: {speed:.2f} m/s, stands below {c.stop_speed:g} m/s"


def _may_leave(now: TransitionInputs) -> str:
    return now.ride_exit.refusal(now.config, _is_still(now), hangs=now.posture.hangs)


ALWAYS: tuple[Condition, ...] = (
    _has_power,
    _has_controller,
    _has_not_fallen,
    _is_high,
    _is_upright,
)
"""Conditions of every mode in which the drives do more than damp."""

CONDITIONS: dict[tuple[RobotMode, RobotMode], tuple[Condition, ...]] = {
    (_STAND, _WALK): (
        *(carries_weight, _is_at_walking_height, _is_straight_to(_WALK), _is_still, _is_asked_anew),
    ),
    # Riding begins at rest, crouched, on both feet. No sensor shows what is below the feet.
    (_STAND, _SEGWAY): (
        *(carries_weight, _is_crouched, _is_straight_to(_SEGWAY), _is_still, _is_confirmed),
    ),
    (_WALK, _STAND): (_has_slowed_down,),
    (_SEGWAY, _STAND): (_may_leave,),
    (RobotMode.OFF, _STAND): (),
    (RobotMode.DAMP, _STAND): (),
}
"""Further conditions from one mode to another; all other changes lead through standing."""


def refusal(now: TransitionInputs, current: RobotMode, wanted: RobotMode) -> str:
    """Why a mode would be refused now; empty where it would not.

    Args:
        now: Inputs of the conditions.
        current: Mode in force.
        wanted: Stand, walk or segway.
    """
    further = () if wanted is current else CONDITIONS.get((current, wanted), (_stands,))
    reasons = (condition(now) for condition in (*ALWAYS, *further))
    return next((reason for reason in reasons if reason), "")
