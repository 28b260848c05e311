"""Where the swing foot goes: a pendulum keeps its speed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from placements import StepAhead, make_placement, swing_target
from robot_states import leg_joints, put, put_toe_joint, readings_of, state_of

from cassie_control.config import WalkConfig
from cassie_control.control.robot import HIP_DOWN, HIP_X, HIP_Y
from cassie_control.planner.footstep import PendulumPlacement
from cassie_control.planner.pendulum import ahead_of_pendulum
from cassie_control.planner.placement import Commanded
from cassie_gaits.robot import GRAVITY

CONFIG = WalkConfig(
    map_gain_x=1.0,
    map_gain_y=1.0,
    map_loss_x=0.0,
    map_loss_y=0.0,
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
    below = end.length * math.cos(end.pitch) + HIP_DOWN
    y = swing.side * HIP_Y + below * math.sin(end.roll) - readings.com[1]
    return x, y


def moving(readings, vx, vy):
    """Let a pose move as a whole. In m/s."""
    put(readings, velocity=(vx, vy, 0.0), com_velocity=(vx, vy, 0.0))


class Pendulum:
    """A CoM that walks on feet put where a law says."""

    def __init__(
        self, config: WalkConfig, commanded: Commanded, velocity: tuple[float, float]
    ) -> None:
        self.law, self.commanded = make_placement(config), commanded
        self.coast = config.double_support
        self.readings = pose()
        self.stance = LEFT
        toe_joint = self.readings.legs[LEFT].toe_joint
        self.w = math.sqrt(GRAVITY / (self.readings.com[2] - toe_joint[2]))
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
        self._turn(-self.commanded.yaw_rate * STEP_TIME)
        self._place()
        return self.velocity[0], self.velocity[1]

    def _place(self) -> None:
        """Touchdown now: ask where, and measure the CoM from the new foot."""
        readings = self.readings
        stance, swing = readings.legs[self.stance], readings.legs[1 - self.stance]
        moving(readings, *self.velocity)
        toe_joint = tuple(c - p for c, p in zip(readings.com, (*self.position, 0.0), strict=True))
        put_toe_joint(readings, self.stance, (toe_joint[0], toe_joint[1], stance.toe_joint[2]))
        ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, landing_length=LENGTH)
        end = swing_target(self.law, readings, self.stance, self.commanded, ahead)
        foot = foot_from_com(readings, swing, end)
        self.position = [ahead_of_pendulum(self.commanded.vx) - foot[0], -foot[1]]
        self.stance = 1 - self.stance

    def _turn(self, angle: float) -> None:
        """See foot and velocity in a heading that has turned."""
        c, s = math.cos(angle), math.sin(angle)
        for vector in (self.position, self.velocity):
            vector[:] = c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]


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


@pytest.mark.parametrize("speed", [-0.65, 0.5, 0.85])
@pytest.mark.parametrize("rate", [-0.4, 0.4])
def test_a_turn_does_not_carry_it_to_the_side(speed, rate):
    config = replace(CONFIG, least_foot_distance=0.05)
    walker = Pendulum(config, Commanded(vx=speed, yaw_rate=rate), (speed, 0.3))
    for _ in range(6):
        walker.step()
    steps = [walker.step() for _ in range(2)]
    straight = Pendulum(CONFIG, Commanded(vx=speed), (speed, 0.3))
    for _ in range(6):
        straight.step()
    wanted = [straight.step() for _ in range(2)]
    # Of the 0.1 m/s by which the heading turns away from the velocity in every step.
    assert sum(vy for _, vy in steps) / 2 == pytest.approx(
        sum(vy for _, vy in wanted) / 2, abs=0.02
    )
    assert sum(vx for vx, _ in steps) / 2 == pytest.approx(
        sum(vx for vx, _ in wanted) / 2, abs=0.04
    )


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


@pytest.mark.parametrize(
    ("speed", "ratios"),
    [(0.0, (1.07, 1.07)), (0.5, (0.8, 0.98)), (1.0, (0.6, 0.9)), (1.6, (0.5, 0.84))],
)
def test_the_shipped_ratio_is_that_of_the_identified_map(speed, ratios):
    """By the pendulum's; the velocity at touchdown is 1.1 times the mean one.

    Ahead the law takes back a tenth less.
    """
    shipped = WalkConfig()
    ahead = shipped.map_gain_x / 0.9, shipped.map_loss_x
    sideways = shipped.map_gain_y, shipped.map_loss_y
    for (gain, loss), ratio in zip((ahead, sideways), ratios, strict=True):
        assert gain / (1.0 + loss * 1.1 * speed) == pytest.approx(ratio, abs=0.1)


def test_the_map_asks_for_less_of_an_error_the_faster_the_touchdown():
    config = replace(CONFIG, map_loss_x=0.5, map_loss_y=0.2, least_foot_distance=0.05)
    readings = pose()
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, landing_length=LENGTH)

    def out(config, vx, error):
        moving(readings, vx, -0.3 - error)
        end = swing_target(make_placement(config), readings, LEFT, Commanded(), ahead)
        return foot_from_com(readings, readings.legs[RIGHT], end)[1]

    for vx in (0.0, 0.4, -0.4):
        lossy, whole = (out(c, vx, 0.05) - out(c, vx, 0.0) for c in (config, CONFIG))
        assert lossy / whole == pytest.approx(1.0 / (1.0 + 0.2 * abs(vx)), abs=1e-6)


def test_the_foot_leads_the_end_of_a_fast_step_by_more():
    readings = pose()

    def lead(speed):
        ahead = StepAhead(
            0.1, 0.3, velocity=(speed, 0.0), step_time=GAIT_TIME, landing_length=LENGTH
        )
        law = make_placement(CONFIG)
        return swing_target(law, readings, LEFT, Commanded(), ahead).contact_lead

    assert lead(0.0) == CONFIG.contact_lead
    assert lead(-1.0) == lead(1.0) == pytest.approx(CONFIG.contact_lead + CONFIG.contact_lead_speed)
    assert lead(3.0) == lead(1.5)


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


def test_a_swing_foot_with_a_longer_way_to_go_lands_later():
    """A leg that swung forward by 0.6 m within 0.2 s lifted the other foot off the ground."""
    readings = pose()
    moving(readings, 0.0, 2.0)  # over the left foot, so that no step can be too quick
    x, y, z = readings.legs[RIGHT].toe_joint
    ahead = StepAhead(0.2, 0.2, landing_length=LENGTH)

    def remaining(back):
        put_toe_joint(readings, RIGHT, (x - back, y, z))
        return swing_target(make_placement(CONFIG), readings, LEFT, Commanded(), ahead).remaining

    assert 0.5 * CONFIG.quickest_step < remaining(0.0) < 0.5 * CONFIG.quickest_step + 0.03
    longer = remaining(1.0) - remaining(0.5)
    assert longer == pytest.approx(0.5 * CONFIG.swing_time, abs=0.005)


@pytest.mark.parametrize("law", ["pendulum", "paper"])
@pytest.mark.parametrize("swing", [LEFT, RIGHT])
@pytest.mark.parametrize("vy", [-1.0, -0.5, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("trim", [-0.1, 0.1])
def test_feet_are_never_set_closer_than_permitted(law, swing, vy, trim):
    readings = pose()
    stance_leg, swing_leg = readings.legs[1 - swing], readings.legs[swing]
    moving(readings, 0.0, vy)
    config = replace(CONFIG, law=law)
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, velocity=(1.0, vy), landing_length=LENGTH)
    commanded = Commanded(roll_trim=trim)
    end = swing_target(make_placement(config), readings, 1 - swing, commanded, ahead)
    foot = readings.com[1] + foot_from_com(readings, swing_leg, end)[1]
    apart = swing_leg.side * (foot - stance_leg.toe_joint[1])
    clamped = abs(end.roll) > 0.399
    assert apart > CONFIG.least_foot_distance - 1e-9 or clamped


def test_the_observer_takes_the_mean_error_for_a_disturbance_within_its_bound():
    law, readings, commanded = PendulumPlacement(CONFIG), pose(), Commanded(vx=0.3)
    swing = readings.legs[RIGHT]
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, landing_length=LENGTH)

    def foothold():
        end = swing_target(law, readings, LEFT, commanded, ahead)
        return foot_from_com(readings, swing, end)[0]

    start = foothold()
    law.touchdown((0.34, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(CONFIG.observer_gain * 0.04)
    for _ in range(100):
        law.touchdown((0.34, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(0.1)
    law.reset()
    assert foothold() == pytest.approx(start)


def test_what_holds_the_robot_back_is_hardly_taken_for_a_disturbance():
    """A pillar that gives way must not find the robot leaning against it."""
    law, readings, commanded = PendulumPlacement(CONFIG), pose(), Commanded(vx=0.3)
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, landing_length=LENGTH)

    def foothold():
        end = swing_target(law, readings, LEFT, commanded, ahead)
        return foot_from_com(readings, readings.legs[RIGHT], end)[0]

    start = foothold()
    most = CONFIG.observer_gain * CONFIG.observer_error
    law.touchdown((0.1, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(-most)
    # No offset would make up for an error of 1.2 m/s: a fourth as much of it is taken for one.
    for _ in range(4):
        law.touchdown((-0.9, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(-2.0 * most)
    # It has given way: forgotten by the whole error, and 2.5 times as fast by what is beyond the
    # bound, which learns the opposite as slowly as ever.
    law.touchdown((0.3 + 0.75 * CONFIG.observer_error, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(-1.25 * most)
    law.touchdown((0.3 + 1.2 * CONFIG.observer_error, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(0.25 * most)
    law.touchdown((0.6, 0.0), (0.0, 0.0), commanded)
    assert foothold() - start == pytest.approx(1.25 * most)


def test_a_robot_that_keeps_up_with_a_changing_command_shows_no_disturbance():
    """A foot acts one step later, and the mean is of two steps: it follows a ramp by two steps."""
    law, readings = PendulumPlacement(CONFIG), pose()
    ahead = StepAhead(STEP_TIME, step_time=GAIT_TIME, landing_length=LENGTH)

    def foothold():
        end = swing_target(law, readings, LEFT, Commanded(), ahead)
        return foot_from_com(readings, readings.legs[RIGHT], end)

    start = foothold()
    for k in range(8):
        before = 0.1 * max(0.0, k - 2.0) if k != 2 else 0.025
        law.touchdown((before, 0.5 * before), (0.0, 0.0), Commanded(vx=0.1 * k, vy=0.05 * k))
    assert foothold() == pytest.approx(start, abs=1e-9)
