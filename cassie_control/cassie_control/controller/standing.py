"""Standing: toe torques hold the CoM over the feet, leg lengths hold height and roll."""

from __future__ import annotations

import math

from cassie_control.controller.config import StandConfig
from cassie_control.controller.readings import (
    ANKLE_HEIGHT,
    HIP_TO_PELVIS,
    HIP_X,
    HIP_Y,
    WEIGHT,
    LegReadings,
    Readings,
)
from cassie_gaits import virtual_leg
from cassie_msgs.layout import Mode, MotorCommand

_NOMINAL_STANCE = 0.16  # m, half the distance of the feet that the paper stands with
_REACH = 0.075  # m, centre of pressure from the middle of the sole
_BIAS_STEP = 0.02  # m, so that a push teaches little
_BIAS = 0.05  # m
_GROUND_TIME = 0.06  # s, until a foot counts as being on the ground
_HEIGHT_SUM = 0.08  # m, bound of the summed height error
_HIP_RELEASE = 0.3  # rad/s at which an unloaded hip goes back to its nominal angle
_FOOT_MIDDLE = 0.02  # m, middle of the sole ahead of the toe joint


class StandingController:
    """Quiet standing on both feet.

    With F_i the force on foot i and e = CoM x - commanded CoM x, both from the feet's midpoint:

        centre of pressure     = CoM x + (kp e + kd CoM velocity x) / weight, within the sole,
        toe torque of foot i   = -F_i (centre of pressure - toe joint), and in the air the toe
                                 keeps the sole level,
        hip pitch              = torso pitch regulated through both hips,
        hip roll, hip yaw      = held at the angle with which the foot took load,
        mean leg length        = height, plus the sum of the height error,
        leg length difference  = roll_length * roll error + roll_rate_length * roll rate.

    The weight is fed forward through the leg Jacobians. Its shares move the centre of pressure
    sideways, to CoM y + (kp (CoM y - commanded) + kd CoM velocity y) / weight, which damps the
    rocking from foot to foot. `height_damping` takes the bounce out of the leaf springs.

    Args:
        config: Gains.
        period: Of control. In s.

    Source:
        Section "Quiet Standing". Each toe is weighted by its own foot's load, not by the smaller
        one, so that rocking does not take away the torque of the loaded foot.
    """

    def __init__(self, config: StandConfig, period: float) -> None:
        self.config = config
        self._period = period
        self._height_sum = 0.0
        self._hips = [[0.0, 0.0], [0.0, 0.0]]
        self._ground = [0.0, 0.0]
        self._bias = [0.0, 0.0]
        self._pressure = (0.0, 0.0)
        self._velocity = [0.0, 0.0]
        self._settle = 1.0 - math.exp(-period / _GROUND_TIME)

    def start(self, readings: Readings, height: float) -> None:
        """Begin from the present pose: the feet stay where they are, loaded legs keep their length.

        Args:
            readings: The robot now.
            height: Commanded pelvis height. In m.
        """
        self._height_sum = 0.0
        self._bias = [0.0, 0.0]
        self._velocity = list(readings.com_velocity[:2])
        if min(leg.contact for leg in readings.legs) > 0.5:
            # Else the legs would give way by what the springs have taken.
            length = 0.5 * sum(virtual_leg.length(leg.joints[3]) for leg in readings.legs)
            missing = length - (height - HIP_TO_PELVIS - ANKLE_HEIGHT)
            self._height_sum = max(-_HEIGHT_SUM, min(_HEIGHT_SUM, missing))
        self._ground = [leg.contact for leg in readings.legs]
        self._hips = [[leg.joints[0], leg.joints[1]] for leg in readings.legs]

    def step(self, readings: Readings, mode: Mode, command: MotorCommand, lean: float) -> None:
        """Fill in the set-points.

        Args:
            readings: The robot now.
            mode: Set-points for height, CoM shift, roll and pitch.
            command: Result.
            lean: Torso roll on top of the commanded one. In rad.
        """
        for i, leg in enumerate(readings.legs):
            # Slower than the legs' bounce, which feed-forward that followed it would feed.
            self._ground[i] += self._settle * (leg.contact - self._ground[i])
        both = min(self._ground)
        roll = float(mode.roll) + lean - float(mode.com_y) / max(0.4, readings.height)
        # Only while both feet carry: to shorten the leg of a lifted foot would rock on.
        difference = both * (
            self.config.roll_length * (readings.roll - roll)
            + self.config.roll_rate_length * readings.roll_rate
        )
        length = self._mean_length(readings, float(mode.height), both)
        share = 1.0 - math.exp(-self._period * self.config.velocity_bandwidth)
        for k in (0, 1):
            self._velocity[k] += share * (readings.com_velocity[k] - self._velocity[k])
        self._observe(readings, both)
        com_x, com_y = self._com(readings)
        self._pitch_error = float(mode.pitch) - readings.pitch
        p_x = self._pressure_x(readings, com_x, float(mode.com_x))
        left = self._left_share(readings, com_y, float(mode.com_y))
        apart = readings.legs[0].foot[1] - readings.legs[1].foot[1]
        height = max(0.3, readings.com_from_feet[2])
        excess = self._excess_y
        sway = (com_y - (left - 0.5) * apart - self.config.roll_gain * excess) / height
        self._lean = (both * (com_x - p_x) / height, max(-0.5, min(0.5, sway)))
        self._give_y = max(0.3, 1.0 - abs(excess) / self.config.hip_excess)
        self._pressure = (p_x, (left - 0.5) * apart)
        self._p = readings.com[0] - readings.com_from_feet[0] + p_x
        for i, leg in enumerate(readings.legs):
            share = left if i == 0 else 1.0 - left
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

    def _observe(self, readings: Readings, both: float) -> None:
        """Learn by how much the CoM is off: at rest it is above the centre of pressure."""
        if both < 0.7:
            return
        left, right = readings.legs
        middle = 0.5 * (left.foot[1] + right.foot[1])
        total = left.force + right.force
        side = (left.force * left.foot[1] + right.force * right.foot[1]) / max(1.0, total) - middle
        share = self._period / self.config.bias_time
        for k, pressure in enumerate((self._pressure[0], side)):
            error = pressure - readings.com_from_feet[k] - self._bias[k]
            self._bias[k] += share * max(-_BIAS_STEP, min(_BIAS_STEP, error))
            self._bias[k] = max(-_BIAS, min(_BIAS, self._bias[k]))

    def _com(self, readings: Readings) -> tuple[float, float]:
        x, y, _ = readings.com_from_feet
        return x + self._bias[0], y + self._bias[1]

    def _pressure_x(self, readings: Readings, x: float, com_x: float) -> float:
        c = self.config
        p = x + (c.kp_com_x * (x - com_x) + c.kd_com_x * self._velocity[0]) / WEIGHT
        reach = max(-_REACH, min(_REACH, p))
        excess = p - reach
        self._give = max(0.0, 1.0 - abs(excess) / c.hip_excess) if c.hip_excess > 0 else 1.0
        self._moment = max(-c.hip_torque, min(c.hip_torque, c.hip_gain * WEIGHT * excess))
        error = self._pitch_error
        if error * excess < 0.0:
            self._moment *= max(0.0, 1.0 - abs(error) / c.hip_bend)
        return reach

    def _left_share(self, readings: Readings, y: float, com_y: float) -> float:
        """Share of the weight for the left foot that brings the CoM over the middle."""
        c = self.config
        vy = self._velocity[1]
        wanted = (c.kp_com_y * (y - com_y) + c.kd_com_y * vy) / WEIGHT
        apart = max(0.1, readings.legs[0].foot[1] - readings.legs[1].foot[1])
        share = max(0.0, min(1.0, 0.5 + (y + wanted) / apart))
        self._excess_y = y + wanted - (share - 0.5) * apart
        return share

    def _mean_length(self, readings: Readings, height: float, both: float) -> float:
        """Leg length that gives the pelvis height, in m; `both` is the lesser contact, 0..1."""
        c = self.config
        if both > 0.7:
            error = height - readings.height
            self._height_sum += c.height_integral * self._period * error
            self._height_sum = max(-_HEIGHT_SUM, min(_HEIGHT_SUM, self._height_sum))
        bounce = both * c.height_damping * readings.velocity[2]
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
        """Set-points of leg `i`, `length` m long, that carries `share` of the weight."""
        c, ground, base = self.config, self._ground[i], 5 * i
        length += ground * (share - 0.5) * WEIGHT / c.leg_stiffness
        length = virtual_leg.clamp_length(length, 0.25, 0.97)
        self._release_hips(self._hips[i], leg, ground)
        in_air = (readings.com[0] - HIP_X - _FOOT_MIDDLE) / max(length, 0.4)
        hip_pitch_air = virtual_leg.hip_pitch_angle(in_air, 0.0, length)
        hip_pitch_ground = leg.joints[2] + float(mode.pitch) - readings.pitch
        command.position[base : base + 5] = (
            *self._hips[i],
            (1.0 - ground) * hip_pitch_air + ground * hip_pitch_ground,
            virtual_leg.knee_angle(length),
            virtual_leg.toe_angle(0.0, readings.pitch, leg.joints[2]),
        )
        hip_rate = ground * (leg.rates[2] - readings.pitch_rate)
        command.velocity[base : base + 5] = (0.0, 0.0, hip_rate, 0.0, 0.0)
        kp_toe = c.kp_toe * (1.0 - ground)
        kp, kd = command.kp, command.kd
        kp[base : base + 5] = (c.kp_hip_roll * self._give_y, c.kp_hip_yaw, c.kp_hip_pitch * self._give, c.kp_knee, kp_toe)
        kd[base : base + 5] = (c.kd_hip_roll, c.kd_hip_yaw, c.kd_hip_pitch * max(0.3, self._give), c.kd_knee, c.kd_toe)
        held = leg.weight_torques(readings.tilt, c.gravity * WEIGHT * share, *self._lean)
        toe = self._toe_torque(leg)
        command.torque[base : base + 5] = (held[0], held[1], held[2] + toe + 0.5 * self._moment, held[3], toe)

    def _toe_torque(self, leg: LegReadings) -> float:
        """Torque, in Nm, that puts the centre of pressure under the CoM's way; `com_x` in m."""
        c = self.config
        arm = self._p - leg.ankle[0] + ANKLE_HEIGHT * self._lean[0]
        torque = -leg.contact * max(0.0, leg.force) * arm
        return max(-c.toe_torque, min(c.toe_torque, torque))

    def _release_hips(self, hips: list[float], leg: LegReadings, ground: float) -> None:
        """Let the hips of a foot in the air go to where the paper stands. In rad."""
        if ground > 0.1:
            return
        nominal = math.atan2(_NOMINAL_STANCE - HIP_Y, 0.8) * leg.side
        limit = _HIP_RELEASE * self._period
        hips[0] += max(-limit, min(limit, nominal - hips[0]))
        hips[1] += max(-limit, min(limit, -hips[1]))
