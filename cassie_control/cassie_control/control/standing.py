"""Standing: toe torques hold the CoM over the feet, leg lengths hold height and roll.

The height's set-point moves with bounded rate and acceleration (`approach`). A push may make the
robot rise for a moment (`Rise`): legs that push up brake it more than the weight alone does.
"""

from __future__ import annotations

import math
from collections import deque

from cassie_control.config import StandConfig
from cassie_control.control.balance import BOTH_FEET, HANGING_CONTACT, STANDING_CONTACT, Balance
from cassie_control.control.compliance import MIN_LENGTH, compliance
from cassie_control.control.forces import holding_torques
from cassie_control.control.robot import (
    HIP_DOWN,
    HIP_X,
    HIP_Y,
    MAX_COMMANDED_LENGTH,
    MIN_LEVER,
    SOLE_MIDDLE,
    TOE_JOINT_HEIGHT,
    LegReadings,
    Readings,
)
from cassie_gaits import virtual_leg
from cassie_gaits.names import HIP_PITCH, HIP_ROLL, HIP_YAW, KNEE, LEG_DRIVE_COUNT
from cassie_gaits.robot import DRIVES, GRAVITY, WEIGHT
from cassie_msgs.layout import Mode, MotorCommand
from cassie_msgs.schedule import PERIOD_TICKS


def approach(
    value: float,
    rate: float,
    target: float,
    max_rate: float,
    acceleration: float,
    period: float,
    braking: float | None = None,
) -> tuple[float, float]:
    """The next value and rate on the way to a target, with bounded rate and acceleration.

    Args:
        value, rate: Present value and rate.
        target: Value at which to come to rest.
        max_rate, acceleration: Bounds of rate and acceleration.
        period: Control period. In s.
        braking: Bound of the deceleration, if it differs from `acceleration`.

    Returns:
        Value and rate one period later. Without the last tick's rounding this is the time-optimal
        motion with bounded acceleration from rest.
    """
    distance, speed_up = target - value, acceleration * period
    slow_down = speed_up if braking is None else braking * period
    # Rate from which braking just stops at the target; half a tick early, as it acts a tick late.
    braking_rate = (
        math.sqrt(2.0 * slow_down / period * abs(distance) + (0.5 * slow_down) ** 2)
        - 0.5 * slow_down
    )
    wanted = math.copysign(min(max_rate, max(0.0, braking_rate)), distance)
    speeds_up = wanted * rate >= 0.0 and abs(wanted) > abs(rate)
    max_change = speed_up if speeds_up else slow_down
    rate += max(-max_change, min(max_change, wanted - rate))
    if abs(distance) <= abs(rate) * period and abs(rate) <= 2.0 * slow_down:
        return target, 0.0
    return value + rate * period, rate


_MAX_RISE_HEIGHT = 1.03  # m, largest pelvis height of a rise, 0.1 m below straight legs
_RISE_HOLD_TIME = 0.3  # s for which the height is held once the capture point is safe again
_RISE_RETURN_RATE = 0.2  # m/s, rate at which the height returns
_RISE_RETURN_ACCELERATION = 1.0  # m/s^2, acceleration with which the height returns
_RISE_DECELERATION = 3.0  # m/s^2; with more, springs oscillate and the feet leave the ground


class Rise:
    """Height added to the command while a push has moved the capture point to the edge.

    With the CoM at x and height z, and the centre of pressure at p,

        x'' = (x - p) (g + z'') / z.

    While the CoM is still inside of p, legs that push up brake it more. When they sink again, the
    CoM is nearer to p, and less is lost than was gained. A rise of 0.1 m gains some 6 mm of capture
    point.

    Attributes:
        height: Height added to the command. In m.
        rate: Rate of this height. In m/s.
        acceleration: Acceleration of this height. In m/s^2.

    Args:
        period: Control period. In s.

    Source:
        Koolen, Posa, Tedrake, "Balance control using center of mass height variation: limitations
        imposed by unilateral contact", Humanoids 2016.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.start()

    def start(self) -> None:
        """Begin at the commanded height."""
        self.height = self.rate = self.acceleration = 0.0
        self._hold_time = 0.0

    def step(self, config: StandConfig, height: float, rise_helps: bool, both_feet: bool) -> None:
        """Advance by one period.

        Args:
            config: Gains.
            height: Commanded pelvis height. In m.
            rise_helps: Whether the capture point is at the edge of the support.
            both_feet: Whether both feet carry: on one foot a rise would tip the robot over.
        """
        before = self.rate
        pushed = rise_helps and both_feet
        self._hold_time = _RISE_HOLD_TIME if pushed else max(0.0, self._hold_time - self._period)
        if pushed:
            target = max(self.height, min(config.rise, _MAX_RISE_HEIGHT - height))
        else:
            target = self.height if self._hold_time > 0.0 else 0.0
        max_rate, acceleration, braking = math.inf, config.rise_acceleration, _RISE_DECELERATION
        if self._hold_time <= 0.0:
            max_rate = _RISE_RETURN_RATE
            acceleration = braking = _RISE_RETURN_ACCELERATION
        self.height, self.rate = approach(
            self.height, self.rate, target, max_rate, acceleration, self._period, braking
        )
        self.acceleration = (self.rate - before) / self._period


_NOMINAL_HALF_WIDTH = 0.16  # m, half the distance of the feet: the paper stands with about 0.3 m
_NOMINAL_LENGTH = 0.8  # m, of a leg, for the hips' nominal angle
_CONTACT_TIME = 0.06  # s, time constant of a foot's contact
_MAX_HEIGHT_INTEGRAL = 0.08  # m, saturation of the integrated height error
_HIP_RELEASE_RATE = 0.3  # rad/s at which an unloaded hip returns to its nominal angle
_MAX_OVERBEND = 0.15  # rad beyond `bend_limit` from which the torso is held again
_AIR_CONTACT = 0.1  # contact up to which a foot is in the air
_MIN_TORSO_DAMPING = 0.3  # least factor on the damping of the torso's pitch


class StandingController:
    """Quiet standing on both feet.

    `Balance` gives the centre of pressure, the share of each foot and the direction of the force:

        toe torque of foot i   = -contact_i F_i (centre of pressure - toe joint), with the moment of
                                 the force's horizontal part about the toe joint; in the air the
                                 toe keeps the sole level,
        hip pitch              = torso pitch regulated through both hips, and the toe torque, which
                                 the leg transmits to the torso,
        hip roll, hip yaw      = held at the angle with which the foot took load, the roll less the
                                 desired one,
        mean leg length        = height, the springs' deflection, and the integrated height error,
        leg length difference  = roll_length * roll error + roll_rate_length * roll rate
                                 - lean_length * desired roll (0 but for riding), bounded, times a
                                 contact probability.

    The ground's forces are fed forward through the leg Jacobians. The height follows its set-point
    with bounded rate and acceleration; a push forward adds `Rise`. With z the height that results,
    l = z - z0 the length of the legs with bent springs, C their `compliance`, W the weight, s_i the
    share of leg i, v_z the vertical velocity, e = 1 - lateness, and z'' the mean between two modes,
    leg i gets

        force   F_i = s_i W (1 + z'' / g),
        length  l + C W ((1 + z'' / g) / 2 + e (s_i - 1/2)) + integral + height_damping (z' - v_z)
                  +- half of the difference,
        rate    z'.

    Late set-points leave the springs' deflection by a shift of the weight out: with it they would
    ring. A foot that a push has lifted stays beside the other one.

    Attributes:
        lateness: How far the drives act late, 0..1 (`LateGains.share`).
        knee_factor: Factor on the knees' gains (`LateGains.factor`).

    Args:
        balance: Balance law, with the gains.
        period: Control period. In s.

    Source:
        Section "Quiet Standing". Each toe is weighted by its own foot's load, not by the smaller
        one, so that rocking does not take away the torque of the loaded foot.
    """

    def __init__(self, balance: Balance, period: float) -> None:
        compliance(MIN_LENGTH)  # takes 40 ms the first time
        self.lateness, self.knee_factor = 0.0, 1.0
        self._period = period
        self._balance = balance
        self._rise = Rise(period)
        self._height = (0.0, 0.0)
        self._rates = deque([0.0] * PERIOD_TICKS, PERIOD_TICKS)
        self._height_integral = 0.0
        self._weight = WEIGHT
        self._hip_angles = [[0.0, 0.0], [0.0, 0.0]]
        self._contact = [0.0, 0.0]
        self._landing = False
        self._contact_weight = 1.0 - math.exp(-period / _CONTACT_TIME)

    @property
    def config(self) -> StandConfig:
        """Gains; new ones are used from the next step on."""
        return self._balance.config

    @config.setter
    def config(self, config: StandConfig) -> None:
        self._balance.config = config

    @property
    def outside_support(self) -> tuple[float, float]:
        """Distance of the capture point outside the support, forward and sideways. In m."""
        return self._balance.outside_support

    @property
    def com_error(self) -> tuple[float, float]:
        """Offset of the CoM from the estimate, forward and to the left. In m."""
        return self._balance.com_error

    def start(self, readings: Readings) -> None:
        """Begin from the present pose: feet stay where they are, legs keep their length at first.

        `com_error` is kept.
        """
        length = 0.5 * sum(virtual_leg.length(leg.joints[KNEE]) for leg in readings.legs)
        loaded = length
        for _ in range(3):
            loaded = length - 0.5 * WEIGHT * compliance(loaded)
        self._height = (loaded + HIP_DOWN + TOE_JOINT_HEIGHT, 0.0)
        self._rates.extend([0.0] * PERIOD_TICKS)
        self._height_integral = 0.0
        self._rise.start()
        self._contact = [leg.contact for leg in readings.legs]
        self._hip_angles = [[leg.joints[HIP_ROLL], leg.joints[HIP_YAW]] for leg in readings.legs]
        self._balance.start(readings)

    def step(self, readings: Readings, mode: Mode, command: MotorCommand, lean: float) -> None:
        """Fill in the set-points.

        Args:
            readings: The robot now.
            mode: Set-points for height, CoM shift, roll and pitch.
            command: Result.
            lean: Roll about the feet, added to that of the CoM shift. In rad.
        """
        for i, leg in enumerate(readings.legs):
            # Slower than the legs' oscillation, which a faster feed-forward would excite.
            self._contact[i] += self._contact_weight * (leg.contact - self._contact[i])
        both = min(self._contact)
        if max(self._contact) < HANGING_CONTACT:
            self._landing = True
        elif both > STANDING_CONTACT:
            self._landing = False
        balance = self._balance
        # The whole robot leans about the feet to shift the CoM sideways.
        height = max(MIN_LEVER, readings.height)
        com_y = float(mode.com_y) - lean * height
        balance.step(readings, mode, com_y, self._contact, leans=lean != 0.0)
        roll = float(mode.roll) - com_y / height
        # Else only while both feet carry: to shorten the leg of a lifted foot would cause rocking.
        difference = (max(self._contact) if self._landing else both) * balance.bounded_difference(
            readings,
            self.config.roll_length * (readings.roll - roll)
            + self.config.roll_rate_length * readings.roll_rate
            - balance.lean_length * roll,
        )
        length, rate = self._mean_length(readings, float(mode.height), both)
        for i, leg in enumerate(readings.legs):
            share = balance.left_share if i == 0 else 1.0 - balance.left_share
            other = self._contact[1 - i]
            self._set_leg(
                i,
                leg,
                readings,
                command,
                (length - 0.5 * leg.side * difference, rate),
                self._contact[i] * (1.0 - other * (1.0 - share)),
                mode,
            )

    def _mean_length(self, readings: Readings, height: float, both: float) -> tuple[float, float]:
        """Mean length of the legs and its rate, in m and m/s; sets the force that they bear.

        Args:
            readings: The robot now.
            height: Commanded pelvis height. In m.
            both: The smaller contact, 0..1.
        """
        c = self.config
        height, rate = self._height = approach(
            *self._height, height, c.height_rate, c.height_acceleration, self._period
        )
        # The commanded height moves in a step at each mode. This mean has none of their ripple.
        acceleration = both * (rate - self._rates[0]) / (PERIOD_TICKS * self._period)
        self._rates.append(rate)
        self._rise.step(c, height, self._balance.rise_helps, both > BOTH_FEET)
        height, rate = height + self._rise.height, rate + self._rise.rate
        self._weight = WEIGHT * (1.0 + (acceleration + self._rise.acceleration) / GRAVITY)
        if both > BOTH_FEET:
            error = height - readings.height
            integral = self._height_integral + c.height_integral * self._period * error
            integral = max(-_MAX_HEIGHT_INTEGRAL, min(_MAX_HEIGHT_INTEGRAL, integral))
            self._height_integral = integral
        bounce = both * c.height_damping * (readings.velocity[2] - rate)
        length = height - HIP_DOWN - TOE_JOINT_HEIGHT
        length += 0.5 * self._weight * compliance(length)
        return length + self._height_integral - bounce, both * rate

    def _set_leg(
        self,
        i: int,
        leg: LegReadings,
        readings: Readings,
        command: MotorCommand,
        motion: tuple[float, float],
        share: float,
        mode: Mode,
    ) -> None:
        """Set-points of leg `i`, which bears `share` of the weight.

        Args:
            i: 0 for the left leg, 1 for the right.
            leg: The leg now.
            readings: The robot now.
            command: Result.
            motion: Length and its rate. In m and m/s.
            share: Share of the weight, 0..1.
            mode: Set-points for roll and pitch.
        """
        c, balance = self.config, self._balance
        drives = slice(LEG_DRIVE_COUNT * i, LEG_DRIVE_COUNT * (i + 1))
        contact = self._contact[i]
        air = 1.0 - contact
        _, roll_regulation = balance.torso_regulation
        length, rate = motion
        shifted = contact * (share - 0.5) * WEIGHT
        length += (1.0 - self.lateness) * shifted * compliance(length)
        length = min(MAX_COMMANDED_LENGTH, max(MIN_LENGTH, length))
        hip_angles = self._hip_angles[i]
        self._release_hips(hip_angles, leg, contact)
        air_pitch = self._air_foot_x(i, readings) / max(length, MIN_LEVER)
        knee = virtual_leg.knee_angle(length)
        command.position[drives] = (
            # A lifted leg keeps its angle in the world, to land where it left the ground.
            hip_angles[0] - float(mode.roll) - air * (readings.roll - float(mode.roll)),
            hip_angles[1],
            air_pitch
            + self._contact[1 - i] * readings.pitch
            + virtual_leg.lean(knee)
            - virtual_leg.HIP_OFFSET,
            knee,
            virtual_leg.toe_angle(0.0, readings.pitch, leg.joints[HIP_PITCH]),
        )
        knee_rate = virtual_leg.knee_rate(knee, length, rate)
        command.velocity[drives] = (0.0, 0.0, 0.0, knee_rate, 0.0)
        kp_roll = c.kp_hip_roll + balance.settled * (c.settled_kp_hip_roll - c.kp_hip_roll)
        kp_roll, kp_pitch = kp_roll * (air + contact * roll_regulation), c.kp_hip_pitch * air
        kd_pitch = c.kd_hip_pitch * air + c.kd_leg_pitch * contact
        kp_knee, kd_knee = self.knee_factor * c.kp_knee, self.knee_factor * c.kd_knee
        command.kp[drives] = (kp_roll, c.kp_hip_yaw, kp_pitch, kp_knee, c.kp_toe * air)
        command.kd[drives] = (c.kd_hip_roll, c.kd_hip_yaw, kd_pitch, kd_knee, c.kd_toe)
        roll, yaw, pitch, knee = holding_torques(
            leg.toe_jacobian, readings.R_HP, self._weight * share, *balance.force_ratio
        )
        toe = self._toe_torque(leg)
        pitch += toe + self._torso_torque(readings, float(mode.pitch), contact)
        command.torque[drives] = (roll, yaw, pitch, knee, toe)

    def _torso_torque(self, readings: Readings, pitch: float, contact: float) -> float:
        """Torque of one hip, in Nm, that holds the torso's pitch or bends it.

        As a torque, since late set-points that follow the measured joint would oscillate.
        """
        c, balance = self.config, self._balance
        regulation, _ = balance.torso_regulation
        error = pitch - readings.pitch
        overbend = dead_band(error, c.bend_limit + _MAX_OVERBEND)
        torso = c.kp_hip_pitch * (regulation * error + (1.0 - regulation) * overbend)
        torso -= c.kd_hip_pitch * max(_MIN_TORSO_DAMPING, regulation) * readings.pitch_rate
        # A leg that stands alone gives the torque of both hips.
        factor = 2.0 / max(1.0, sum(self._contact))
        return factor * contact * (0.5 * balance.bending_torque + torso)

    def _air_foot_x(self, i: int, readings: Readings) -> float:
        """Position of the toe joint of leg `i` in the air, ahead of its hip. In m.

        It is below the CoM while the robot hangs, and beside the other foot while that one carries.
        """
        other = readings.legs[1 - i]
        below_com = readings.com[0] - SOLE_MIDDLE - HIP_X
        next_to_foot = other.toe_joint[0] - HIP_X + HIP_DOWN * readings.pitch
        return below_com + self._contact[1 - i] * (next_to_foot - below_com)

    def _toe_torque(self, leg: LegReadings) -> float:
        """Torque, in Nm, that moves the foot's centre of pressure to `Balance.cop_x`.

        Each foot has it at the same place of its own sole, whichever foot stands ahead.
        """
        balance, limit = self._balance, DRIVES["toe"].torque_limit
        arm = (
            leg.foot[0]
            + balance.cop_x
            - leg.toe_joint[0]
            + TOE_JOINT_HEIGHT * balance.force_ratio[0]
        )
        torque = -leg.contact * max(0.0, leg.force) * arm
        return max(-limit, min(limit, torque))

    def _release_hips(self, hip_angles: list[float], leg: LegReadings, contact: float) -> None:
        """Move the hips of a foot in the air to the paper's stance. In rad."""
        if contact > _AIR_CONTACT:
            return
        nominal = math.atan2(_NOMINAL_HALF_WIDTH - HIP_Y, _NOMINAL_LENGTH) * leg.side
        limit = _HIP_RELEASE_RATE * self._period
        hip_angles[0] += max(-limit, min(limit, nominal - hip_angles[0]))
        hip_angles[1] += max(-limit, min(limit, -hip_angles[1]))


def dead_band(value: float, limit: float) -> float:
    """A value less its part within -limit .. limit; 0 within."""
    return value - max(-limit, min(limit, value))
