"""Where the swing foot goes: a pendulum keeps its speed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from robot_states import leg_joints, put, put_ankle, readings_of, state_of

from cassie_control.config import LateGains, WalkConfig
from cassie_control.control.robot import HIP_TO_PELVIS, HIP_X, HIP_Y
from cassie_control.planner.footstep import PendulumPlacement, placement
from cassie_control.planner.plan import Commanded, StepAhead
from cassie_gaits.robot import GRAVITY

CONFIG = WalkConfig(
    pendulum_gain_x=1.0,
    pendulum_gain_back=1.0,
    pendulum_gain_y=1.0,
    pendulum_gain_still=0.0,
    pendulum_fade_x=0.0,
    pendulum_fade_y=0.0,
    sidestep=0.0,
    step_ahead=0.0,
    step_ahead_fast=0.0,
    slowest_step=1.0,
    landing_depth=0.0,
)
STEP_TIME = 0.4
GAIT_TIME = STEP_TIME + CONFIG.contact_lead  # the foot touches down before the gait has it
LENGTH = 0.8
LEFT, RIGHT = 0, 1


def pose():
    return readings_of(state_of(leg_joints(), leg_joints()))


def foot_from_com(readings, swing, end):
    """Where a swing leg puts the toe joint, from the CoM, with a level torso. (2,), in m."""
    x = HIP_X + end.length * math.sin(end.pitch) - readings.com[0]
    below = end.length * math.cos(end.pitch) + HIP_TO_PELVIS
    y = swing.hip_y + below * math.sin(end.roll) - readings.com[1]
    return x, y


def moving(readings, vx, vy):
    """Let a pose move as a whole. In m/s."""
    put(readings, velocity=(vx, vy, 0.0), com_velocity=(vx, vy, 0.0))


class Pendulum:
    """A CoM that walks on feet put where a law says."""

    def __init__(
        self, config: WalkConfig, commanded: Commanded, velocity: tuple[float, float]
    ) -> None:
        self.law, self.commanded = placement(config), commanded
        self.coast = config.double_support
        self.readings = pose()
        self.stance = LEFT
        ankle = self.readings.legs[LEFT].ankle
        self.w = math.sqrt(GRAVITY / (self.readings.com[2] - ankle[2]))
        self.position = [-0.5 * commanded.vx * STEP_TIME, -0.12]
        self.velocity = list(velocity)

    def step(self) -> tuple[float, float]:
        """Walk from one touchdown to the next; velocity there. In m/s."""
        fall = STEP_TIME - self.coast
        cosh, sinh = math.cosh(self.w * fall), math.sinh(self.w * fall)
        for k in range(2):
            x = self.position[k] + self.velocity[k] * self.coast
            self.position[k] = x * cosh + self.velocity[k] / self.w * sinh
            self.velocity[k] = self.w * x * sinh + self.velocity[k] * cosh
        self._place()
        return self.velocity[0], self.velocity[1]

    def _place(self) -> None:
        """Touchdown now: ask where, and measure the CoM from the new foot."""
        readings = self.readings
        stance, swing = readings.legs[self.stance], readings.legs[1 - self.stance]
        moving(readings, *self.velocity)
        ankle = tuple(c - p for c, p in zip(readings.com, (*self.position, 0.0), strict=True))
        put_ankle(readings, self.stance, (ankle[0], ankle[1], stance.ankle[2]))
        ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, length=LENGTH)
        end = self.law.swing_end(readings, stance, swing, self.commanded, ahead)
        foot = foot_from_com(readings, swing, end)
        self.position = [-foot[0], -foot[1]]
        self.stance = 1 - self.stance


@pytest.mark.parametrize("speed", [-0.4, 0.0, 0.5, 1.0])
def test_gain_one_removes_a_sagittal_error_in_one_step(speed):
    walker = Pendulum(CONFIG, Commanded(vx=speed), (speed + 0.1, 0.3))
    walker.step()
    steady = walker.step()[0]
    assert walker.step()[0] == pytest.approx(steady, abs=1e-9)
    # Ground gained from touchdown to touchdown: the foot ahead of the CoM, and behind it before.
    before = walker.position[0]
    end = before
    single = STEP_TIME - CONFIG.double_support
    x = before + steady * CONFIG.double_support
    end = x * math.cosh(walker.w * single) + steady / walker.w * math.sinh(walker.w * single)
    assert (end - before) / STEP_TIME == pytest.approx(speed, abs=1e-9)


@pytest.mark.parametrize("speed", [-0.15, 0.0, 0.2])
def test_gain_one_removes_a_lateral_error_in_one_step(speed):
    config = replace(CONFIG, least_foot_distance=0.05)
    walker = Pendulum(config, Commanded(vy=speed), (0.0, 0.2))
    walker.step()
    swaying = [walker.step()[1] for _ in range(4)]
    assert swaying[0] == pytest.approx(swaying[2], abs=1e-9)
    assert swaying[1] == pytest.approx(swaying[3], abs=1e-9)
    assert swaying[0] * swaying[1] < 0.0
    # The CoM gains the same ground over two steps as the feet.
    travelled = 0.0
    for _ in range(2):
        y, vy = walker.position[1], walker.velocity[1]
        walker.step()
        fall = STEP_TIME - config.double_support
        x = y + vy * config.double_support
        sway = x * math.cosh(walker.w * fall) + vy / walker.w * math.sinh(walker.w * fall)
        travelled += sway - y
    assert travelled / (2.0 * STEP_TIME) == pytest.approx(speed, abs=1e-9)


@pytest.mark.parametrize(("vx", "added"), [(0.0, 0.2), (0.25, 0.1), (0.5, 0.0), (-0.5, 0.0)])
def test_what_is_added_to_the_gain_in_place_fades_out_with_the_commanded_speed(vx, added):
    """With more than all of an error removed it changes its sign, to that share."""
    config = replace(
        CONFIG, pendulum_gain_still=0.2, still_speed=0.5, least_foot_distance=0.05, reach_inward=0.3
    )
    walkers = [Pendulum(config, Commanded(vx=vx), (vx, 0.3 + extra)) for extra in (0.0, 0.02)]
    for walker in walkers:
        walker.step()
    first, then = (walkers[1].step()[1] - walkers[0].step()[1] for _ in range(2))
    fall = STEP_TIME - config.double_support
    w = walkers[0].w
    grown = math.cosh(w * fall) + w * config.double_support * math.sinh(w * fall)
    if added == 0.0:
        assert then == pytest.approx(0.0, abs=1e-9)
    else:
        assert then / first == pytest.approx(-added * grown, abs=0.02)


@pytest.mark.parametrize(("speed", "share"), [(-0.5, 1.0), (0.0, 1.0), (1.0, 0.6), (9.0, 0.3)])
def test_the_gains_fall_with_speed_forward(speed, share):
    """The low-passed speed counts, and for the sagittal one a push that is faster than that."""
    config = replace(CONFIG, pendulum_fade_x=0.4, pendulum_fade_y=0.4, least_foot_distance=0.05)
    readings = pose()

    def foot(config, error):
        moving(readings, 0.25 + error, -0.3 - error)
        # Touchdown is now, and with it the end of the step: nothing is left to fall.
        ahead = StepAhead(STEP_TIME, velocity=(speed, 0.0), step_time=GAIT_TIME, length=LENGTH)
        end = placement(config).swing_end(readings, *readings.legs, Commanded(), ahead)
        return foot_from_com(readings, readings.legs[RIGHT], end)

    def sagittal(velocity):
        return velocity * max(0.3, 1.0 - 0.4 * max(speed, velocity))

    shares = (sagittal(0.3) - sagittal(0.25)) / 0.05, share
    for k in range(2):
        faded, whole = (foot(c, 0.05)[k] - foot(c, 0.0)[k] for c in (config, CONFIG))
        assert faded / whole == pytest.approx(shares[k], abs=1e-6)


@pytest.mark.parametrize(("commanded", "share"), [(0.0, 0.0), (0.1, 0.5), (0.4, 1.0), (-0.4, 1.0)])
def test_a_foot_is_held_back_from_far_out_under_way_only(commanded, share):
    """Held back in the steps that follow a push while standing, too, it fell."""
    readings = pose()
    moving(readings, commanded, -0.6)

    def out(far_share, vx=commanded):
        law = replace(CONFIG, far_lean=0.2, far_share=far_share, far_most=0.4, reach_outward=0.4)
        ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, length=LENGTH)
        end = placement(law).swing_end(readings, *readings.legs, Commanded(vx=vx), ahead)
        return abs(foot_from_com(readings, readings.legs[RIGHT], end)[1])

    whole = out(1.0, 0.4) - out(0.0, 0.4)
    assert whole > 0.05
    assert (out(1.0) - out(0.0)) / whole == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize(
    ("latency", "share"), [(0.0, 0.3), (0.005, 0.65), (0.01, 1.0), (0.04, 1.0)]
)
def test_with_late_drives_a_foot_goes_all_the_way_out(latency, share):
    """Their sway is wide, and cut short it grew until it fell."""
    late = LateGains(far_within=0.01)
    assert late.placement(WalkConfig(far_share=0.3), latency).far_share == pytest.approx(share)


def test_the_foot_leads_the_end_of_a_fast_step_by_more():
    readings = pose()

    def lead(speed):
        ahead = StepAhead(0.1, 0.3, velocity=(speed, 0.0), step_time=GAIT_TIME, length=LENGTH)
        return placement(CONFIG).swing_end(readings, *readings.legs, Commanded(), ahead).lead

    assert lead(0.0) == CONFIG.contact_lead
    assert lead(-1.0) == lead(1.0) == pytest.approx(CONFIG.contact_lead + CONFIG.contact_lead_speed)
    assert lead(3.0) == lead(1.5)


def test_feet_go_farther_ahead_and_out_with_the_speed():
    offsets = {"sidestep": 0.1, "step_ahead": 0.1, "step_ahead_fast": 0.2}
    config = replace(CONFIG, least_foot_distance=0.05, **offsets)
    readings, ahead = pose(), StepAhead(STEP_TIME, step_time=GAIT_TIME, length=LENGTH)
    moving(readings, 0.0, -0.3)
    feet = [
        foot_from_com(
            readings,
            readings.legs[RIGHT],
            placement(c).swing_end(readings, *readings.legs, Commanded(vx=-0.3, vy=0.2), ahead),
        )
        for c in (config, CONFIG)
    ]
    assert feet[0][1] - feet[1][1] == pytest.approx(0.02)
    assert feet[0][0] - feet[1][0] == pytest.approx(-0.3 * (0.1 - 0.3 * 0.2))


def test_feet_in_place_are_as_wide_as_the_hips_and_the_spread():
    walker = Pendulum(CONFIG, Commanded(), (0.0, 0.3))
    for _ in range(4):
        walker.step()
    y = walker.position[1]
    before = walker.velocity[1]
    walker.step()
    single = STEP_TIME - CONFIG.double_support
    x = y + before * CONFIG.double_support
    end = x * math.cosh(walker.w * single) + before / walker.w * math.sinh(walker.w * single)
    assert abs(end - walker.position[1]) == pytest.approx(2.0 * (HIP_Y + CONFIG.foot_spread))


@pytest.mark.parametrize("law", ["pendulum", "paper"])
@pytest.mark.parametrize("swing", [LEFT, RIGHT])
@pytest.mark.parametrize("vy", [-1.0, -0.5, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("trim", [-0.1, 0.1])
def test_feet_are_never_set_closer_than_permitted(law, swing, vy, trim):
    readings = pose()
    stance_leg, swing_leg = readings.legs[1 - swing], readings.legs[swing]
    moving(readings, 0.0, vy)
    config = replace(CONFIG, law=law)
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, velocity=(1.0, vy), length=LENGTH)
    commanded = Commanded(roll_trim=trim)
    end = placement(config).swing_end(readings, stance_leg, swing_leg, commanded, ahead)
    foot = readings.com[1] + foot_from_com(readings, swing_leg, end)[1]
    apart = swing_leg.side * (foot - stance_leg.ankle[1])
    clamped = abs(end.roll) > 0.399
    assert apart > CONFIG.least_foot_distance - 1e-9 or clamped


def test_sums_add_up_the_mean_error_within_their_bound():
    law, readings, commanded = PendulumPlacement(CONFIG), pose(), Commanded(vx=0.3)
    stance, swing = readings.legs
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, length=LENGTH)

    def foot():
        end = law.swing_end(readings, stance, swing, commanded, ahead)
        return foot_from_com(readings, swing, end)[0]

    start = foot()
    law.touchdown((0.5, 0.0), (0.0, 0.0), commanded)
    assert foot() - start == pytest.approx(CONFIG.integral_x * 0.2)
    for _ in range(100):
        law.touchdown((1.5, 0.0), (0.0, 0.0), commanded)
    assert foot() - start == pytest.approx(CONFIG.integral_limit)
    law.reset()
    assert foot() == pytest.approx(start)


def test_a_robot_that_keeps_up_with_a_changing_command_adds_nothing_to_the_sums():
    """The mean velocity is that of two steps, so it follows a ramp by one of them."""
    law, readings = PendulumPlacement(CONFIG), pose()
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, length=LENGTH)

    def foot():
        end = law.swing_end(readings, *readings.legs, Commanded(), ahead)
        return foot_from_com(readings, readings.legs[RIGHT], end)

    start = foot()
    for k in range(8):
        before = 0.1 * max(0.0, k - 1.0) if k != 1 else 0.025
        law.touchdown((before, 0.5 * before), (0.0, 0.0), Commanded(vx=0.1 * k, vy=0.05 * k))
    assert foot() == pytest.approx(start, abs=1e-9)
