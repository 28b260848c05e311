"""Laws of leg-angle adjustment, and what they answer in a step."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_control.config import WalkConfig
from cassie_control.control.outputs import LENGTH_SW, PITCH_SW, ROLL_SW, Step
from cassie_control.control.robot import Readings
from cassie_control.planner.footstep import PendulumPlacement
from cassie_control.planner.paper import PaperPlacement, plan_landing_by_paper
from cassie_control.planner.pendulum import plan_landing
from cassie_control.planner.placement import Commanded, SwingTarget
from cassie_control.planner.terrain import GroundSlope
from cassie_control.planner.timing import StepTiming


@dataclass
class StepAhead:
    """The present step: times in s, low-passed velocity in m/s, the gait's end in rad and m."""

    elapsed: float
    remaining: float = 0.0
    step_time: float = 0.4
    velocity: tuple[float, float] = (0.0, 0.0)
    landing_pitch: float = 0.0
    landing_roll: float = 0.0
    landing_length: float = 0.8


def make_placement(config: WalkConfig) -> PendulumPlacement | PaperPlacement:
    """The law that the configuration names."""
    return PaperPlacement(config) if config.as_in_paper else PendulumPlacement(config)


def swing_target(
    law: PendulumPlacement | PaperPlacement,
    readings: Readings,
    stance: int,
    commanded: Commanded,
    ahead: StepAhead,
) -> SwingTarget:
    """The law's answer on level ground; `stance` is the number of the stance leg."""
    timing, step = StepTiming(law.config, ahead.step_time, 0.002), Step()
    timing.stance, timing.elapsed, timing.velocity = stance, ahead.elapsed, ahead.velocity
    timing.phase = 1.0 - ahead.remaining / ahead.step_time
    step.gait[PITCH_SW, 5], step.gait[ROLL_SW, 5] = ahead.landing_pitch, ahead.landing_roll
    step.gait[LENGTH_SW, 5] = ahead.landing_length
    now = readings.records, timing.records, step.records, commanded.records
    robots, timings, steps, commands = now
    if isinstance(law, PaperPlacement):
        return plan_landing_by_paper(law.gains.records, *now)
    slopes = GroundSlope(law.config, 0.002).records
    return plan_landing(law.gains.records, robots, law.masses, timings, slopes, steps, commands)
