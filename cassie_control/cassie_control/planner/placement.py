"""Interface of leg-angle adjustment: its inputs and its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from cassie_control.config import WalkConfig
from cassie_control.control.robot import LegReadings, Readings
from cassie_gaits.records import FloatArray, Record, array


class Commanded(Record):
    """Commands for the steps.

    Attributes:
        vx, vy: Commanded velocity, forward and to the left. In m/s.
        turn_rate: Commanded rate of the heading, to the left. In rad/s.
        pitch_trim, roll_trim: Added to the swing leg's angles at touchdown. In rad.
        spread: How far each foot lands outside its usual place. In m.
    """

    vx: float
    vy: float
    turn_rate: float
    pitch_trim: float
    roll_trim: float
    spread: float


@dataclass
class SwingTarget:
    """Swing leg at touchdown.

    Attributes:
        pitch, roll: Leg angles. In rad.
        length: Leg length. In m.
        remaining: Time to the end of the step. In s.
        contact_lead: Time from the foot's first contact to the end of the step. In s.
    """

    pitch: float
    roll: float
    length: float
    remaining: float
    contact_lead: float = 0.0


class GaitStep(Record):
    """The present step, as input of leg-angle adjustment.

    Attributes:
        elapsed: Time since the last touchdown. In s.
        remaining: Time to the next touchdown by the gait. In s.
        earliest: Least time to the next touchdown that the swing leg can follow. In s.
        step_time: Duration of the step by the gait. In s.
        velocity: Low-passed velocity, forward and to the left. In m/s.
        landing_pitch, landing_roll: The gait's swing leg angles at touchdown. In rad.
        landing_length: The gait's swing leg length at touchdown. In m.
        hip_rise: Difference of the hip's height over the next foothold at touchdown and its present
            height over the stance foot: the gait's stance leg grows, its foot sinks, and the ground
            around that foot is lower than the foot. In m.
        landing_yaw: Swing hip yaw at touchdown. In rad.
        slope: Slope of the ground forward and to the left, rise over distance. Shape (2,).
    """

    elapsed: float
    remaining: float
    earliest: float
    step_time: float
    velocity: FloatArray = array(2)
    landing_pitch: float
    landing_roll: float
    landing_length: float
    hip_rise: float
    landing_yaw: float
    slope: FloatArray = array(2)


class Placement(Protocol):
    """A law of leg-angle adjustment."""

    config: WalkConfig

    def reset(self) -> None:
        """Forget earlier steps."""

    def touchdown(
        self,
        mean_velocity: tuple[float, float],
        velocity: tuple[float, float],
        commanded: Commanded,
    ) -> None:
        """Update at the end of a step.

        Args:
            mean_velocity: Mean of the last two steps, forward and to the left. In m/s.
            velocity: Low-passed velocity. In m/s.
            commanded: Commands for the steps.
        """

    def swing_target(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        commanded: Commanded,
        gait_step: GaitStep,
    ) -> SwingTarget:
        """Swing leg at touchdown.

        Args:
            readings: The robot now.
            stance, swing: Stance leg and swing leg.
            commanded: Commands for the steps.
            gait_step: The present step.
        """
