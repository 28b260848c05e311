"""What leg-angle adjustment is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from cassie_control.config import WalkConfig
from cassie_control.control.robot import LegReadings, Readings
from cassie_gaits.records import FloatArray, Record, array


class Commanded(Record):
    """What the operator wants of the steps.

    Attributes:
        vx, vy: Velocity, forward and to the left. In m/s.
        turn_rate: Of the heading, to the left. In rad/s.
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
class SwingEnd:
    """Swing leg at touchdown.

    Attributes:
        pitch, roll: In rad.
        length: In m.
        remaining: Time to the end of the step. In s.
        lead: How long before that the foot touches down. In s.
    """

    pitch: float
    roll: float
    length: float
    remaining: float
    lead: float = 0.0


class StepAhead(Record):
    """The present step, as far as leg-angle adjustment needs to know it.

    Attributes:
        elapsed: Time since the last touchdown. In s.
        remaining: Time to the next one as the gait has it. In s.
        earliest: Least time to the next one that the swing leg can make. In s.
        step_time: Duration of the next step. In s.
        velocity: Low-passed, forward and to the left. In m/s.
        pitch, roll: The gait's swing leg angles at touchdown. In rad.
        length: The gait's swing leg length at touchdown. In m.
        rise: How much the gait's stance leg grows until touchdown, less what its foot sinks, and
            what the next foot lands lower for the stance foot's own height. In m.
        yaw: Swing hip yaw at touchdown. In rad.
        slope: Rise of the ground ahead and to the left. Shape (2,).
    """

    elapsed: float
    remaining: float
    earliest: float
    step_time: float
    velocity: FloatArray = array(2)
    pitch: float
    roll: float
    length: float
    rise: float
    yaw: float
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
        """A step ended.

        Args:
            mean_velocity: Of the last two steps, forward and to the left. In m/s.
            velocity: Low-passed. In m/s.
            command: Commanded velocity.
        """

    def swing_end(
        self,
        readings: Readings,
        stance: LegReadings,
        swing: LegReadings,
        commanded: Commanded,
        ahead: StepAhead,
    ) -> SwingEnd:
        """Leg angles at touchdown.

        Args:
            readings: The robot now.
            stance, swing: Its legs.
            command: Commanded velocity.
            ahead: The present step.
        """
