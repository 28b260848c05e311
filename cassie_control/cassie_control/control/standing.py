"""Standing: toe torques hold the CoM over the feet, leg lengths hold height and roll.

The height's set-point moves with bounded rate and acceleration (`approach`). A push may make the
robot rise for a moment (`Rise`): legs that push up brake it more than the weight alone does.
"""

from __future__ import annotations

import math

from cassie_control.config import StandConfig
from cassie_control.control.balance import Balance
from cassie_control.control.robot import (
    ANKLE_HEIGHT,
    HIP_TO_PELVIS,
    HIP_X,
    HIP_Y,
    LegReadings,
    Readings,
)
from cassie_gaits import virtual_leg
from cassie_gaits.robot import GRAVITY, WEIGHT
from cassie_msgs.layout import Mode, MotorCommand


def approach(
    value: float,
    rate: float,
    target: float,
    fastest: float,
    acceleration: float,
    period: float,
    braking: float | None = None,
) -> tuple[float, float]:
    """The next value and rate on the way to a target, with bounded rate and acceleration.

    Args:
        value, rate: Present value and rate.
        target: Value at which to come to rest.
        fastest, acceleration: Bounds of rate and acceleration.
        period: Control period. In s.
        braking: Bound of the deceleration, if it differs from `acceleration`.
    """
    away, gain = target - value, acceleration * period
    loss = gain if braking is None else braking * period
    # Rate from which braking just stops at the target; half a tick early, as it acts a tick late.
    brake = math.sqrt(2.0 * loss / period * abs(away) + (0.5 * loss) ** 2) - 0.5 * loss
    wanted = math.copysign(min(fastest, max(0.0, brake)), away)
    change = gain if wanted * rate >= 0.0 and abs(wanted) > abs(rate) else loss
    rate += max(-change, min(change, wanted - rate))
    if abs(away) <= abs(rate) * period and abs(rate) <= 2.0 * loss:
        return target, 0.0
    return value + rate * period, rate


_TOP = 1.03  # m, largest pelvis height of a rise: the knees are then nearly straight
_HOLD = 0.3  # s for which the height is held once the capture point is safe again
_BACK = 0.2  # m/s, rate at which the height returns
_SETTLE = 1.0  # m/s^2, acceleration with which the height returns
_BRAKING = 3.0  # m/s^2; with more, the feet would leave the ground as the springs oscillate


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
        self._hold = 0.0

    def step(self, config: StandConfig, height: float, urgent: bool, footed: bool) -> None:
        """Advance by one period.

        Args:
            config: Gains.
            height: Commanded pelvis height. In m.
            urgent: Whether the capture point is at the edge of the support.
            footed: Whether both feet carry: on one foot a rise would tip the robot over.
        """
        before = self.rate
        self._hold = _HOLD if urgent and footed else max(0.0, self._hold - self._period)
        if urgent and footed:
            goal = max(self.height, min(config.rise, _TOP - height))
        else:
            goal = self.height if self._hold > 0.0 else 0.0
        fastest, acceleration, braking = math.inf, config.rise_acceleration, _BRAKING
        if self._hold <= 0.0:
            fastest, acceleration, braking = _BACK, _SETTLE, _SETTLE
        self.height, self.rate = approach(
            self.height, self.rate, goal, fastest, acceleration, self._period, braking
        )
        self.acceleration = (self.rate - before) / self._period


_NOMINAL_STANCE = 0.16  # m, half the distance of the feet: the paper stands with about 0.3 m
_GROUND_TIME = 0.06  # s, time constant of a foot's contact
_HANGS, _STANDS = 0.3, 0.9  # contact: hangs if the larger is below, stands if the smaller is above
_HEIGHT_SUM = 0.08  # m, saturation of the integrated height error
_HIP_RELEASE = 0.3  # rad/s at which an unloaded hip returns to its nominal angle
_OVERBENT = 0.15  # rad beyond `bend_limit` from which the torso is held again
_FOOT_MIDDLE = 0.02  # m, middle of the sole ahead of the toe joint


class StandingController:
    """Quiet standing on both feet.

    `Balance` gives the centre of pressure, the share of each foot and the direction of the force:

        toe torque of foot i   = -F_i (centre of pressure - toe joint), with the moment of the
                                 force's horizontal part about the toe joint; in the air the toe
                                 keeps the sole level,
        hip pitch              = torso pitch regulated through both hips, and the toe torque, which
                                 the leg transmits to the torso,
        hip roll, hip yaw      = held at the angle with which the foot took load,
        mean leg length        = height, plus the integrated height error,
        leg length difference  = roll_length * roll error + roll_rate_length * roll rate.

    The ground's forces are fed forward through the leg Jacobians. The commanded length of a leg
    includes the deflection of its springs under its share of the weight. The height follows its
    set-point with bounded rate and acceleration; a push forward adds `Rise`. `height_damping` damps
    the oscillation of the leaf springs. A foot that a push has lifted stays beside the other one.

    Args:
        config: Gains.
        period: Control period. In s.
        balance: Balance law, if not `Balance`.

    Source:
        Section "Quiet Standing". Each toe is weighted by its own foot's load, not by the smaller
        one, so that rocking does not take away the torque of the loaded foot.
    """

    def __init__(self, config: StandConfig, period: float, balance: Balance | None = None) -> None:
        self._period = period
        self._balance = balance or Balance(config, period)
        self._rise = Rise(period)
        self._height = (0.0, 0.0)
        self._height_sum = 0.0
        self._weight = WEIGHT
        self._hips = [[0.0, 0.0], [0.0, 0.0]]
        self._ground = [0.0, 0.0]
        self._lands = False
        self._settle = 1.0 - math.exp(-period / _GROUND_TIME)

    @property
    def config(self) -> StandConfig:
        """Gains; new ones are used from the next step on."""
        return self._balance.config

    @config.setter
    def config(self, config: StandConfig) -> None:
        self._balance.config = config

    @property
    def beyond(self) -> tuple[float, float]:
        """How far the capture point is outside the support, forward and sideways. In m."""
        return self._balance.beyond

    @property
    def com_error(self) -> tuple[float, float]:
        """Offset of the CoM from the estimate, forward and to the left. In m."""
        return self._balance.com_error

    def start(self, readings: Readings) -> None:
        """Begin from the present pose: feet stay where they are, legs keep their length at first.

        `com_error` is kept.
        """
        length = 0.5 * sum(virtual_leg.length(leg.joints[3]) for leg in readings.legs)
        self._height = (length + HIP_TO_PELVIS + ANKLE_HEIGHT, 0.0)
        self._height_sum = 0.0
        self._rise.start()
        self._ground = [leg.contact for leg in readings.legs]
        self._hips = [[leg.joints[0], leg.joints[1]] for leg in readings.legs]
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
            self._ground[i] += self._settle * (leg.contact - self._ground[i])
        both = min(self._ground)
        if max(self._ground) < _HANGS:
            self._lands = True
        elif both > _STANDS:
            self._lands = False
        balance = self._balance
        # The whole robot leans about the feet to shift the CoM sideways.
        height = max(0.4, readings.height)
        com_y = float(mode.com_y) - lean * height
        balance.step(readings, mode, com_y, self._ground, leans=lean != 0.0)
        roll = float(mode.roll) - com_y / height
        # Else only while both feet carry: to shorten the leg of a lifted foot would cause rocking.
        difference = (max(self._ground) if self._lands else both) * (
            self.config.roll_length * (readings.roll - roll)
            + self.config.roll_rate_length * readings.roll_rate
            - balance.lean_length * roll
        )
        length = self._mean_length(readings, float(mode.height), both)
        self._weight = WEIGHT * (1.0 + self._rise.acceleration / GRAVITY)
        for i, leg in enumerate(readings.legs):
            share = balance.left if i == 0 else 1.0 - balance.left
            other = self._ground[1 - i]
            self._leg(
                i,
                leg,
                readings,
                command,
                length - 0.5 * leg.side * difference,
                self._ground[i] * (1.0 - other * (1.0 - share)),
                mode,
            )

    def _mean_length(self, readings: Readings, height: float, both: float) -> float:
        """Leg length for the pelvis height, in m; `both` is the smaller contact, 0..1."""
        c = self.config
        height, rate = self._height = approach(
            *self._height, height, c.height_rate, c.height_acceleration, self._period
        )
        self._rise.step(c, height, self._balance.urgent, both > 0.7)
        height, rate = height + self._rise.height, rate + self._rise.rate
        if both > 0.7:
            error = height - readings.height
            self._height_sum += c.height_integral * self._period * error
            self._height_sum = max(-_HEIGHT_SUM, min(_HEIGHT_SUM, self._height_sum))
        bounce = both * c.height_damping * (readings.velocity[2] - rate)
        return height - HIP_TO_PELVIS - ANKLE_HEIGHT + self._height_sum - bounce

    def _leg(
        self,
        i: int,
        leg: LegReadings,
        readings: Readings,
        command: MotorCommand,
        length: float,
        share: float,
        mode: Mode,
    ) -> None:
        """Set-points of leg `i`, which is `length` m long and carries `share` of the weight."""
        c, balance, base = self.config, self._balance, 5 * i
        ground, give = self._ground[i], balance.give
        air = 1.0 - ground
        length += ground * (share - 0.5) * WEIGHT / c.leg_stiffness
        length = virtual_leg.clamp_length(length, 0.25, 0.97)
        hips = self._hips[i]
        self._release_hips(hips, leg, ground)
        in_air = self._in_air(i, readings) / max(length, 0.4)
        command.position[base : base + 5] = (
            # A lifted leg keeps its angle in the world, to land where it left the ground.
            hips[0] - float(mode.roll) - air * (readings.roll - float(mode.roll)),
            hips[1],
            virtual_leg.hip_pitch_angle(in_air, self._ground[1 - i] * readings.pitch, length),
            virtual_leg.knee_angle(length),
            virtual_leg.toe_angle(0.0, readings.pitch, leg.joints[2]),
        )
        command.velocity[base : base + 5] = 0.0
        kp_hip_roll = c.kp_hip_roll + balance.settled * (c.settled_kp_hip_roll - c.kp_hip_roll)
        kp_hip_roll, kp_hip = kp_hip_roll * (air + ground * give[1]), c.kp_hip_pitch * air
        kd_hip = c.kd_hip_pitch * air + c.kd_leg_pitch * ground
        command.kp[base : base + 5] = (kp_hip_roll, c.kp_hip_yaw, kp_hip, c.kp_knee, c.kp_toe * air)
        command.kd[base : base + 5] = (c.kd_hip_roll, c.kd_hip_yaw, kd_hip, c.kd_knee, c.kd_toe)
        roll, yaw, pitch, knee = leg.weight_torques(
            readings.tilt, self._weight * share, *balance.lean
        )
        toe = self._toe_torque(leg)
        pitch += toe + self._torso(readings, float(mode.pitch), ground)
        command.torque[base : base + 5] = (roll, yaw, pitch, knee, toe)

    def _torso(self, readings: Readings, wanted: float, ground: float) -> float:
        """Torque of one hip, in Nm, that holds the torso's pitch or bends it.

        As a torque, since late set-points that follow the measured joint would oscillate.
        """
        c, balance, give = self.config, self._balance, self._balance.give[0]
        bent = wanted - readings.pitch
        overbent = beyond(bent, c.bend_limit + _OVERBENT)
        torso = c.kp_hip_pitch * (give * bent + (1.0 - give) * overbent)
        torso -= c.kd_hip_pitch * max(0.3, give) * readings.pitch_rate
        # A leg that stands alone gives the torque of both hips.
        alone = 2.0 / max(1.0, sum(self._ground))
        return alone * ground * (0.5 * balance.moment + torso)

    def _in_air(self, i: int, readings: Readings) -> float:
        """Position of the toe joint of leg `i` in the air, ahead of its hip. In m.

        It is below the CoM while the robot hangs, and beside the other foot while that one carries.
        """
        other = readings.legs[1 - i]
        hanging = readings.com[0] - _FOOT_MIDDLE - HIP_X
        beside = other.ankle[0] - HIP_X + HIP_TO_PELVIS * readings.pitch
        return hanging + self._ground[1 - i] * (beside - hanging)

    def _toe_torque(self, leg: LegReadings) -> float:
        """Torque, in Nm, that moves the foot's centre of pressure to `Balance.pressed`.

        Both soles have the same: the edges of feet that stand one ahead of the other differ.
        """
        balance, limit = self._balance, self.config.toe_torque
        arm = leg.foot[0] + balance.pressed - leg.ankle[0] + ANKLE_HEIGHT * balance.lean[0]
        torque = -leg.contact * max(0.0, leg.force) * arm
        return max(-limit, min(limit, torque))

    def _release_hips(self, hips: list[float], leg: LegReadings, ground: float) -> None:
        """Move the hips of a foot in the air to the paper's stance. In rad."""
        if ground > 0.1:
            return
        nominal = math.atan2(_NOMINAL_STANCE - HIP_Y, 0.8) * leg.side
        limit = _HIP_RELEASE * self._period
        hips[0] += max(-limit, min(limit, nominal - hips[0]))
        hips[1] += max(-limit, min(limit, -hips[1]))


def beyond(value: float, limit: float) -> float:
    """How far a value is outside of -limit .. limit; 0 within."""
    return value - max(-limit, min(limit, value))
