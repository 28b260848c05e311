"""How the ground lies, as the feet find it while walking."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Robot
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Record, Records, array

_STANDS = 0.5  # contact of a foot that stands on the ground
_SETTLED = 0.25  # phase from which the stance foot lies flat
_STEEPEST = 0.6  # of a slope that is believed
_RATE_TIME = 0.03  # s, low-pass of the stance foot's pitch rate
_TURNS = (0.4, 0.8)  # rad/s of it up to which the foot rests, and turns for certain
_TURNED_UP = (0.02, 0.04)  # rad since it settled, up to which the ground holds, or gives way
_HIGHEST = 0.1  # m, of a foothold over the ground around it, or below
_NEAR = 0.1  # m, between feet whose heights tell half of a slope
_MEMORY = 0.95  # of what the sole foretold, that is left a step later
_BELIEF = 2e-4  # m^2, that weighs as much for a sole that is right: 0.05 of slope over 0.3 m
_STEPS_UP = 3  # steps up in a row; on uneven ground there is one that is not among as many
_EVEN, _DEEPEST = 0.01, 0.08  # m of steps up that are none, and the most that is believed


class GroundSlope(Record):
    """Slope of the ground, ahead and to the left, from the stance foot and from touchdowns.

    Walking begins with the slope to the side on which both feet stand: taken for level at first,
    one of 12 degrees threw 4 of 20 robots in their first steps. What their soles show then is not
    taken over: where heels have sunk into sand they stand turned up by 0.5 rad.

    The stance toe gives no torque, so that its sole lies on the ground: its pitch is the slope
    ahead, low-passed over the time of standing on it. Both slopes follow from the heights of
    footholds, too, by a share of what the plane through the last three of them differs by. It is
    the least-squares fit to the last two steps, regularized by `_NEAR`, so that feet close to each
    other tell little. One step alone cannot tell a riser from a slope to the side: where the same
    foot climbed each riser, stairs were taken for a side slope of 0.25, and the robot fell.

    Each foothold has a height of its own over the ground around it, which is `foothold_share` of
    what the foot finds off the slope. The hips keep their height over the ground around, not over
    the foothold, and the next foot is expected there. Without, hips rose and sank with each stone:
    on hard ground of s.d. 4 cm 10 of 20 robots fell within 15 m, with it none.

    Ahead, a fall is believed within `slope_time` and a rise within `slope_rise_time`. On uneven
    ground single footholds tilt by 0.1 to 0.2 either way. A foot that expects the ground too low
    lands early, which costs a little speed; one that expects it too high lands late, and the robot
    falls ahead meanwhile: two such steps took it from 0.4 to 1.2 m/s. So the estimate leans to the
    low side where footholds differ, and is exact where they agree.

    How far a sole tells of the ground ahead is another matter on each ground. It foretells that
    the next foot, x ahead, rises by tan(pitch) x. The regression of what that foot then found on it
    is the share of the sole's slope that is believed:

        share = sum(foretold found) / sum(foretold^2),

    over the last 20 steps or so, 1 at first. Of robots 1 to 6 it was 0.93 to 0.98 on hard slopes,
    0.45 to 0.65 on rough hard ground, 0.3 on grass at 0.8 m/s and 0.13 at 1.2 m/s, whose tufts tilt
    a foot by 0.05 and more: taken for a rise it ran away.

    A foot whose heel sinks into sand turns up for as long as it is loaded, by 0.05 to 0.3 rad (on
    hard ground by 0.003, on grass by 0.015), fast at first and then ever slower. While a foot turns
    fast its pitch is no slope, nor once it has turned up: what it shows as it slows down, 0.5, was
    taken for a rise of 0.2, and it ran away. Instead a rise that was believed fades then, which
    errs to the low side, too.

    Each new foot then lands higher than the one that has sunk meanwhile, by `sunk`: the least of
    the last three numerators above. Taken for level, that ground met the swing foot early and short
    of where it had to be, and it ran away forward. Their mean would be a rise on uneven ground,
    too, where it threw two robots of four.

    Attributes:
        ahead, left: Rise over distance, heading frame.
        sunk: By how much the stance foot sinks until the next one lands. In m.
        foothold: Height of the stance foot over the ground around it. In m.
        pitch: Of the stance foot. In rad.
        rate: Its low-passed rate. In rad/s.
        settled: Its pitch when the foot lay flat. In rad.
        turned: How surely the foot has turned up since then. 0..1.
        shown, ticks: Mean slope that this stance foot has shown, and in how many periods.
        foretold, borne_out: Sums of the squares of what soles foretold, and of its products with
            what the next feet found. In m^2.
        step: To this foothold from the one before. In m.
        steps_up: By how much the last new feet landed higher than the old ones, the newest last.
            In m.
        slope_time, slope_rise_time, slope_share, foothold_share: See `config.WalkConfig`.
        period: Of control. In s.
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
        """Level ground that holds; the control period is in s."""
        super().__init__(period=period)
        self.configure(config)

    def configure(self, config: WalkConfig) -> None:
        """Take over new figures; what is believed stays. The paper's law takes it for level."""
        self.slope_time = 0.0 if config.as_in_paper else config.slope_time
        for name in ("slope_rise_time", "slope_share", "foothold_share"):
            setattr(self, name, getattr(config, name))

    def start(self) -> None:
        """Level ground that holds."""
        self.ahead = self.left = self.sunk = self.foothold = 0.0
        self.pitch = self.rate = self.settled = self.turned = 0.0
        self.shown = self.ticks = self.foretold = self.borne_out = 0.0
        self.step[:] = self.steps_up[:] = 0.0


@compiled
def begin_on(slopes: Records[GroundSlope], robots: Records[Robot]) -> None:
    """Begin with the slope to the side on which both feet stand; level where one is in the air."""
    slope, robot = slopes[0], robots[0]
    if slope.slope_time > 0.0 and robot.contact.min() >= _STANDS:
        _, y, z = robot.ankle[0] - robot.ankle[1]
        slope.left = _bounded(_slope(z, y))


@compiled
def stand_on(
    slopes: Records[GroundSlope], robots: Records[Robot], stance: int, phase: float
) -> None:
    """Take in one tick of standing on a leg."""
    slope, robot = slopes[0], robots[0]
    if slope.slope_time <= 0.0:
        return
    q = robot.joints[stance]
    # `virtual_leg.foot_pitch` with what the springs give way
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
    """By what the plane through the last three footholds differs from the slope, per axis."""
    u, v, w = slope.step
    found, before = z - slope.ahead * x - slope.left * y, w - slope.ahead * u - slope.left * v
    xx, yy, xy = x * x + u * u + _NEAR * _NEAR, y * y + v * v + _NEAR * _NEAR, x * y + u * v
    along, across = x * found + u * before, y * found + v * before
    whole = xx * yy - xy * xy
    return (yy * along - xy * across) / whole, (xx * across - xy * along) / whole


@compiled
def touch_down(slopes: Records[GroundSlope], robots: Records[Robot], new: int) -> None:
    """Take in the touchdown of a leg, with both feet on the ground."""
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
    """Each of the last new feet landed higher: the old ones had sunk by the least of it."""
    for k in range(_STEPS_UP - 1):
        slope.steps_up[k] = slope.steps_up[k + 1]
    slope.steps_up[_STEPS_UP - 1] = error
    slope.sunk = max(0.0, min(_DEEPEST, slope.steps_up.min() - _EVEN))


@compiled
def stepped_up(slope: GroundSlope) -> float:
    """By how much the stance foot landed higher than both feet before. In m, at most `_HIGHEST`."""
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
    """Of the way between two bounds: 0 below, 1 above."""
    low, high = between
    return max(0.0, min(1.0, (value - low) / (high - low)))
