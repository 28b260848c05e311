"""Interface of leg-angle adjustment: its commands and its result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from cassie_control.config import WalkConfig
from cassie_gaits.records import Record

LEG_PITCH_TRIM, LEG_ROLL_TRIM, TORSO_PITCH_TRIM, TORSO_ROLL_TRIM = range(4)
"""Places in `Mode.trims`."""


class Commanded(Record):
    """Commands for the steps.

    Attributes:
        vx, vy: Commanded velocity, forward and to the left. In m/s.
        yaw_rate: Commanded rate of the heading, to the left. In rad/s.
        pitch_trim, roll_trim: Added to the swing leg's angles at touchdown. In rad.
    """

    vx: float
    vy: float
    yaw_rate: float
    pitch_trim: float
    roll_trim: float


class SwingTarget(NamedTuple):
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
    contact_lead: float


class Placement(ABC):
    """What a law of leg-angle adjustment remembers from step to step.

    Args:
        config: Its gains.

    Attributes:
        gains: Gains and memory, for compiled functions.
    """

    gains: Record

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        self.reset()

    @property
    def config(self) -> WalkConfig:
        """Gains; new ones are used from the next tick on."""
        return self._config

    @config.setter
    def config(self, config: WalkConfig) -> None:
        self._config = config
        self.gains.take(config)

    @abstractmethod
    def reset(self) -> None:
        """Forget earlier steps."""

    @abstractmethod
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
