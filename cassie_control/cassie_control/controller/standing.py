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

_NOMINAL_STANCE = 0.15  # m, half the distance of the feet that the paper stands with
_REACH = 0.075  # m, centre of pressure from the middle of the sole
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
        self._settle = 1.0 - math.exp(-period / _GROUND_TIME)

    def start(self, readings: Readings, height: float) -> None:
        """Begin from the present pose: the feet stay where they are, loaded legs keep their length.

        Args:
            readings: The robot now.
            height: Commanded pelvis height. In m.
        """
        self._height_sum = 0.0
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
        left = self._left_share(readings, float(mode.com_y))
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

    def _left_share(self, readings: Readings, com_y: float) -> float:
        """Share of the weight for the left foot that brings the CoM over the middle."""
        c = self.config
        y, vy = readings.com_from_feet[1], readings.com_velocity[1]
        wanted = (c.kp_com_y * (y - com_y) + c.kd_com_y * vy) / WEIGHT
        apart = max(0.1, readings.legs[0].foot[1] - readings.legs[1].foot[1])
        return max(0.05, min(0.95, 0.5 + (y + wanted) / apart))

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
        kp[base : base + 5] = (c.kp_hip_roll, c.kp_hip_yaw, c.kp_hip_pitch, c.kp_knee, kp_toe)
        kd[base : base + 5] = (c.kd_hip_roll, c.kd_hip_yaw, c.kd_hip_pitch, c.kd_knee, c.kd_toe)
        held = leg.weight_torques(readings.tilt, c.gravity * WEIGHT * share, 0.0, 0.0)
        toe = self._toe_torque(leg, readings, float(mode.com_x))
        command.torque[base : base + 5] = (*held, toe)

    def _toe_torque(self, leg: LegReadings, readings: Readings, com_x: float) -> float:
        """Torque, in Nm, that puts the centre of pressure under the CoM's way; `com_x` in m."""
        c = self.config
        error = readings.com_from_feet[0] - com_x
        wanted = (c.kp_com_x * error + c.kd_com_x * readings.com_velocity[0]) / WEIGHT
        pressure = readings.com[0] + max(-_REACH, min(_REACH, error + wanted)) - error
        torque = -leg.contact * max(0.0, leg.force) * (pressure - leg.ankle[0])
        return max(-c.toe_torque, min(c.toe_torque, torque))

    def _release_hips(self, hips: list[float], leg: LegReadings, ground: float) -> None:
        """Let the hips of a foot in the air go to where the paper stands. In rad."""
        if ground > 0.1:
            return
        nominal = math.atan2(_NOMINAL_STANCE - HIP_Y, 0.8) * leg.side
        limit = _HIP_RELEASE * self._period
        hips[0] += max(-limit, min(limit, nominal - hips[0]))
        hips[1] += max(-limit, min(limit, -hips[1]))
