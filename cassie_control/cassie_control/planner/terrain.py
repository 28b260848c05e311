"""Estimate of the ground's slope from the feet while walking."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Robot
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Record, Records, array

_STANDS = 0.5  # contact probability of a foot that stands on the ground
_SETTLED = 0.25  # phase from which the stance foot lies flat
_STEEPEST = 0.6  # saturation of the estimated slope
_RATE_TIME = 0.03  # s, time constant of the low-pass of the stance foot's pitch rate
_TURNS = (0.4, 0.8)  # rad/s of pitch rate: the foot rests below the first, turns above the second
_TURNED_UP = (0.02, 0.04)  # rad of pitch since it settled: firm ground below, soft ground above
_HIGHEST = 0.1  # m, saturation of a foothold's height over or below the ground around it
_NEAR = 0.1  # m, regularization: feet so close to each other count half for the slope
_MEMORY = 0.95  # ratio by which the sums of predictions decay per step
_BELIEF = 2e-4  # m^2, prior that the sole's slope is right: weight of a slope of 0.05 over 0.3 m
_STEPS_UP = 3  # steps that must all go up; on uneven ground one of three does not
_EVEN, _DEEPEST = 0.01, 0.08  # m, threshold of a step up, and saturation of `GroundSlope.sunk`


class GroundSlope(Record):
    """Slope of the ground, forward and to the left, from the stance foot and from touchdowns.

    Walking begins with the side slope on which both feet stand: with level ground as the first
    estimate, a side slope of 12 degrees made 4 of 20 robots fall in their first steps. The pitch of
    the soles is not used then: where heels have sunk into sand, feet are turned up by 0.5 rad.

    The stance toe gives no torque, so that its sole lies on the ground: its pitch, low-passed
    during stance, is the slope ahead. The heights of footholds correct both slopes, by a share of
    their difference to the plane through the last three footholds. The plane is the least-squares
    fit to the last two steps, regularized by `_NEAR`, so that feet close to each other count
    little. A single step cannot distinguish a riser from a side slope: where the same foot climbed
    each riser, stairs were taken for a side slope of 0.25, and the robot fell.

    Each foothold has a height of its own over the ground around it, which is `foothold_share` of
    its deviation from the slope. The hips keep their height over the ground around the foothold,
    and the next foot is expected on that ground. Without this, hips rose and sank with each stone:
    on hard ground of s.d. 4 cm 10 of 20 robots fell within 15 m, with it none.

    The slope ahead falls with the time constant `slope_time` and rises with `slope_rise_time`. On
    uneven ground single footholds tilt by 0.1 to 0.2 either way. If the ground is expected too low,
    the foot lands early, which costs a little speed. If it is expected too high, the foot lands
    late, and the robot falls forward meanwhile: two such steps took it from 0.4 to 1.2 m/s. So the
    estimate is biased to the low side where footholds differ, and is exact where they agree.

    How well a sole predicts the ground ahead depends on the ground. The prediction is that the next
    foot, x ahead, lands higher by tan(pitch) x. The slope ahead uses a share of the sole's slope:
    the regression coefficient of what the next foot found on the prediction (`foretold`),

        share = sum(foretold found) / sum(foretold^2),

    over the last 20 steps or so, 1 at first. Of robots 1 to 6 it was 0.93 to 0.98 on hard slopes,
    0.45 to 0.65 on rough hard ground, 0.3 on grass at 0.8 m/s and 0.13 at 1.2 m/s. Tufts of grass
    tilt a foot by 0.05 and more: taken for a rise, that made the robot run away.

    A foot whose heel sinks into sand turns up for as long as it is loaded, by 0.05 to 0.3 rad (on
    hard ground by 0.003, on grass by 0.015). It turns fast at first and then ever slower. While a
    foot turns fast its pitch is no slope, nor once it has turned up. Its pitch as it slows down,
    0.5, was taken for a rise of 0.2, and the robot ran away. Instead an estimated rise then decays,
    which errs to the low side, too.

    On such ground each new foot lands higher than the sunk stance foot, by `sunk`: the least of the
    last three such heights. With level ground as the estimate, the swing foot met that ground early
    and short of its target, and the robot ran away forward. Their mean would be a rise on uneven
    ground, too, where it made two robots of four fall.

    Attributes:
        ahead, left: Slope forward and to the left, rise over distance, heading frame.
        sunk: How much the stance foot sinks until the next touchdown. In m.
        foothold: Height of the stance foot over the ground around it. In m.
        pitch: Pitch of the stance foot. In rad.
        rate: Low-passed pitch rate of the stance foot. In rad/s.
        settled: Pitch of the stance foot when it lay flat. In rad.
        turned: How certain it is that the foot has turned up since it lay flat. 0..1.
        shown, ticks: Mean slope of this stance foot's sole, and its number of periods.
        foretold, borne_out: Decaying sums of the squared predictions by soles, and of predictions
            times what the next feet found. In m^2.
        step: Vector from the previous foothold to this one. In m.
        steps_up: Heights of the last new feet over the old ones, less the slope's, newest last. In
            m.
        slope_time, slope_rise_time, slope_share, foothold_share: See `config.WalkConfig`.
        period: Control period. In s.
    """

    ahead: float
    left: float
    sunk: float
    foothold: float
    pitch: float
    rate: float
    settled: float
    turned: float
    shown: float
    ticks: float
    foretold: float
    borne_out: float
    step: FloatArray = array(3)
    steps_up: FloatArray = array(_STEPS_UP)
    slope_time: float
    slope_rise_time: float
    slope_share: float
    foothold_share: float
    period: float

    def __init__(self, config: WalkConfig, period: float) -> None:
        """Begin with level, firm ground; the control period is in s."""
        super().__init__(period=period)
        self.configure(config)

    def configure(self, config: WalkConfig) -> None:
        """Use new parameters; the estimate stays. For the paper's law the ground is level."""
        self.slope_time = 0.0 if config.as_in_paper else config.slope_time
        for name in ("slope_rise_time", "slope_share", "foothold_share"):
            setattr(self, name, getattr(config, name))

    def start(self) -> None:
        """Begin with level, firm ground."""
        self.ahead = self.left = self.sunk = self.foothold = 0.0
        self.pitch = self.rate = self.settled = self.turned = 0.0
        self.shown = self.ticks = self.foretold = self.borne_out = 0.0
        self.step[:] = self.steps_up[:] = 0.0


@compiled
def begin_on(slopes: Records[GroundSlope], robots: Records[Robot]) -> None:
    """Begin with the side slope on which both feet stand; level where a foot is in the air."""
    slope, robot = slopes[0], robots[0]
    if slope.slope_time > 0.0 and robot.contact.min() >= _STANDS:
        _, y, z = robot.ankle[0] - robot.ankle[1]
        slope.left = _bounded(_slope(z, y))


@compiled
def stand_on(
    slopes: Records[GroundSlope], robots: Records[Robot], stance: int, phase: float
) -> None:
    """Update the slope with one tick of the stance foot's pitch."""
    slope, robot = slopes[0], robots[0]
    if slope.slope_time <= 0.0:
        return
    q = robot.joints[stance]
    # `virtual_leg.foot_pitch` with the springs' deflection
    pitch = -robot.pitch + q[2] + (q[3] + q[4] + q[5]) + q[6] + virtual_leg.TOE_OFFSET
    rate, slope.pitch = (pitch - slope.pitch) / slope.period, pitch
    slope.rate += slope.period / _RATE_TIME * (rate - slope.rate)
    if phase < _SETTLED:
        slope.settled = pitch
    if robot.load[stance] < 1.0 or phase < _SETTLED:
        return
    seen = _bounded(math.tan(pitch))
    slope.ticks += 1.0
    slope.shown += (seen - slope.shown) / slope.ticks
    believed = (slope.borne_out + _BELIEF) / (slope.foretold + _BELIEF)
    seen *= max(0.0, min(1.0, believed))
    slope.turned = _share(pitch - slope.settled, _TURNED_UP)
    seen += slope.turned * (min(0.0, slope.ahead) - seen)
    time = slope.slope_rise_time if seen > slope.ahead else slope.slope_time
    rests = 1.0 - _share(abs(slope.rate), _TURNS)
    slope.ahead += rests * slope.period / time * (seen - slope.ahead)


@compiled
def _plane(slope: GroundSlope, x: float, y: float, z: float) -> tuple[float, float]:
    """Difference, per axis, of the plane through the last three footholds and the slope."""
    u, v, w = slope.step
    found, before = z - slope.ahead * x - slope.left * y, w - slope.ahead * u - slope.left * v
    xx, yy, xy = x * x + u * u + _NEAR * _NEAR, y * y + v * v + _NEAR * _NEAR, x * y + u * v
    along, across = x * found + u * before, y * found + v * before
    whole = xx * yy - xy * xy
    return (yy * along - xy * across) / whole, (xx * across - xy * along) / whole


@compiled
def touch_down(slopes: Records[GroundSlope], robots: Records[Robot], new: int) -> None:
    """Update the slope at the touchdown of a leg, with both feet on the ground."""
    slope, robot = slopes[0], robots[0]
    if slope.slope_time <= 0.0:
        return
    x = robot.ankle[new, 0] - robot.ankle[1 - new, 0]
    y = robot.ankle[new, 1] - robot.ankle[1 - new, 1]
    z = robot.ankle[new, 2] - robot.ankle[1 - new, 2]
    error = z - slope.ahead * x - slope.left * y
    ahead, left = _plane(slope, x, y, z)
    if slope.ticks > 0.0:
        holds = 1.0 - slope.turned
        slope.ahead = _bounded(slope.ahead + holds * slope.slope_share * ahead)
    slope.left = _bounded(slope.left + slope.slope_share * left)
    slope.step[0], slope.step[1], slope.step[2] = x, y, z
    _sink(slope, error)
    slope.foothold = slope.foothold_share * (slope.foothold + error - slope.sunk)
    slope.foothold = max(-_HIGHEST, min(_HIGHEST, slope.foothold))
    foretold, found = slope.shown * x, z - slope.left * y
    slope.foretold = _MEMORY * slope.foretold + foretold * foretold
    slope.borne_out = _MEMORY * slope.borne_out + foretold * found
    slope.shown = slope.ticks = 0.0


@compiled
def _sink(slope: GroundSlope, error: float) -> None:
    """Update `sunk`: where the last new feet all landed higher, the old ones sank by the least."""
    for k in range(_STEPS_UP - 1):
        slope.steps_up[k] = slope.steps_up[k + 1]
    slope.steps_up[_STEPS_UP - 1] = error
    slope.sunk = max(0.0, min(_DEEPEST, slope.steps_up.min() - _EVEN))


@compiled
def stepped_up(slope: GroundSlope) -> float:
    """Height of the stance foot's landing over both feet before. In m, at most `_HIGHEST`."""
    higher: float = slope.steps_up[_STEPS_UP - 1] - slope.sunk
    before: float = min(0.0, slope.steps_up[_STEPS_UP - 2] + _EVEN)
    return max(0.0, min(_HIGHEST, higher + before))


@compiled
def _slope(rise: float, distance: float) -> float:
    return rise * distance / (distance * distance + _NEAR * _NEAR)


@compiled
def _bounded(slope: float) -> float:
    return max(-_STEEPEST, min(_STEEPEST, slope))


@compiled
def _share(value: float, between: tuple[float, float]) -> float:
    """Linear from 0 at the lower bound to 1 at the upper one; constant outside."""
    low, high = between
    return max(0.0, min(1.0, (value - low) / (high - low)))
