"""Recovery steps: whether a push needs a step, and changes to its first step."""

from __future__ import annotations

import math

from cassie_control.config import StandConfig, TransitionConfig
from cassie_control.control.balance import BOTH_FEET, pendulum_time
from cassie_control.control.robot import SOLE_HALF_LENGTH, Readings
from cassie_control.control.standing import StandingController
from cassie_control.estimator.config import CARRYING_RATIO
from cassie_control.planner.timing import LEFT, RIGHT
from cassie_gaits import virtual_leg
from cassie_gaits.names import KNEE, LEG_DRIVE_COUNT, TOE_DRIVE
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import MotorCommand

_STANDING_MEMORY = 1.5  # s with little load on the feet, after which no recovery step may begin
_MIN_STEP_LOAD = 0.4  # share of the weight on the feet below which the robot is in the air
_REST_X = 0.06  # m, distance of capture point and feet's midpoint from which standing brings rest
_REST_FOOT_DISTANCE = (0.2, 0.45)  # m, distance of the feet that standing takes over
_REST_VERTICAL_SPEED = 0.2  # m/s, vertical speed with which both feet stay on the ground
_REST_TILT = 0.15  # rad, of the torso, below which standing can right it
_BRAKING_REACH = SOLE_HALF_LENGTH - 0.015  # m, of the centre of pressure from the sole's middle


def comes_to_rest(readings: Readings) -> bool:
    """Whether standing, from this touchdown on, brings the robot to rest."""
    x, y, height = readings.com_from_feet
    time = pendulum_time(height)
    vx, vy, _ = readings.com_velocity
    width = readings.legs[0].foot[1] - readings.legs[1].foot[1]
    within = abs(x + time * vx) < _REST_X and abs(y + time * vy) < 0.5 * width
    calm = abs(readings.velocity[2]) < _REST_VERTICAL_SPEED
    upright = max(abs(readings.roll), abs(readings.pitch)) < _REST_TILT
    low, high = _REST_FOOT_DISTANCE
    return within and calm and upright and low < width < high


def loaded_leg(readings: Readings) -> int:
    """Leg that carries more."""
    left, right = readings.legs
    return LEFT if left.force >= right.force else RIGHT


def add_braking_toe_torque(readings: Readings, stance: int, command: MotorCommand) -> None:
    """Move the stance foot's centre of pressure to the capture point, at most to the sole's edge.

    Args:
        readings: The robot now.
        stance: Leg that carries the robot.
        command: Set-points of walking, whose stance toe gives no torque; torque is added.
    """
    leg = readings.legs[stance]
    time = pendulum_time(readings.com_from_feet[2])
    capture_x = readings.com[0] + time * readings.com_velocity[0] - leg.foot[0]
    cop_x = max(-_BRAKING_REACH, min(_BRAKING_REACH, capture_x)) + leg.foot[0]
    torque = -leg.contact * max(0.0, leg.force) * (cop_x - leg.toe_joint[0])
    command.torque[LEG_DRIVE_COUNT * stance + TOE_DRIVE] += torque


class ShorteningLimit:
    """Bounds how fast the stance leg of the first recovery step shortens.

    Standing may have raised the pelvis up to straight legs, or a push may have lifted it. The gait
    shortens the leg from there to the gait's length within a tenth of a second. The robot falls by
    less in that time, so that both feet would leave the ground.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.start(0.0)

    def start(self, length: float) -> None:
        """Begin at rest, with the leg length (m) that standing commands."""
        self._length, self._rate = length, 0.0

    def apply(self, stance: int, command: MotorCommand, config: StandConfig) -> None:
        """Let the leg shorten no faster than standing lowers the pelvis.

        Args:
            stance: Leg that carries the robot.
            command: Set-points of walking; the knee's is changed.
            config: Bounds of the pelvis height's rate and acceleration.
        """
        knee = LEG_DRIVE_COUNT * stance + KNEE
        rate = max(-config.height_rate, self._rate - config.height_acceleration * self._period)
        wanted = virtual_leg.length(float(command.position[knee]))
        length = max(wanted, self._length + rate * self._period)
        if length > wanted:
            command.position[knee] = virtual_leg.knee_angle(length)
        self._rate = min(0.0, (length - self._length) / self._period)
        self._length = length


class RecoveryStep:
    """Finds the moment from which standing cannot hold a push any more.

    The capture point, CoM + velocity sqrt(z / g), is the centre of pressure at which the robot
    would come to rest. Standing holds the capture point inside the soles, and a little beyond by
    bending the torso. The robot steps when the capture point is `recovery_margin` outside.
    The foot with less load swings. A robot that hangs does not step, nor one that has not stood on
    both feet since.

    Args:
        period: Control period. In s.

    Source:
        Capture point: Pratt et al., "Capture Point: A Step toward Humanoid Push Recovery",
        Humanoids 2006.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Begin anew, as if the robot had not stood yet."""
        self._standing_timer = 0.0

    def stance(
        self, readings: Readings, standing: StandingController, config: TransitionConfig
    ) -> int | None:
        """Leg to stand on while the other one steps; None while standing holds the push.

        Args:
            readings: The robot now.
            standing: Controller, after its step at this tick.
            config: Whether it steps, and from where on.
        """
        left, right = readings.legs
        force = left.force + right.force
        if force < CARRYING_RATIO * WEIGHT:
            self._standing_timer = max(0.0, self._standing_timer - self._period)
        elif min(left.contact, right.contact) > BOTH_FEET:
            self._standing_timer = _STANDING_MEMORY
        if not config.recovery_step or self._standing_timer <= 0.0:
            return None
        if force < _MIN_STEP_LOAD * WEIGHT:
            return None
        if math.hypot(*standing.outside_support) < config.recovery_margin:
            return None
        return loaded_leg(readings)
