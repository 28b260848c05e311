"""Estimate of the ground's slope from the feet while walking."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Robot
from cassie_control.estimator import config as estimator_config
from cassie_control.planner import timing
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.names import HIP_PITCH, KNEE, SHIN, TARSUS, TOE
from cassie_gaits.records import FloatArray, Record, Records, array

_FLAT_PHASE = 0.25  # phase from which the stance foot lies flat
_MAX_SLOPE = 0.6  # saturation of the estimated slope
_PITCH_RATE_RAMP = (0.4, 0.8)  # rad/s of pitch rate: the foot rests below, turns above
_TURN_UP_RAMP = (0.02, 0.04)  # rad of pitch since the foot lay flat: firm ground below, soft above
_MAX_FOOTHOLD_HEIGHT = 0.1  # m, saturation of a foothold's height over the ground around it
_REGULARIZATION = 0.1  # m: feet at this distance from each other count half for the slope
_FORGETTING_FACTOR = 0.95  # of the regression's sums, per step: some 20 steps count
_REGRESSION_PRIOR = 2e-4  # m^2, prior that the sole's slope is right: slope of 0.05 over 0.3 m
_SINKAGE_STEPS = 3  # steps that must all go up; on uneven ground one of three does not
_SINKAGE_DEAD_BAND = 0.01  # m, height of a step that counts as level
_MAX_SINKAGE = 0.08  # m, saturation of `GroundSlope.sinkage`


class GroundSlope(Record):
    """Slope of the ground, forward and to the left, from the stance foot and from touchdowns.

    The ground is a plane with the slopes s_x, s_y (`ahead`, `left`) through the ground around the
    stance foot; the foot itself stands h (`foothold_height`) above it. At a touchdown the new foot
    is at (x, y, z) from the old one. The error of the plane, and its use:

        e       = z - s_x x - s_y y,
        sinkage = min(e of the last three steps) - 0.01 m,    within 0 and 0.08 m,
        h      <- foothold_share (h + e - sinkage),           within +-0.1 m,
        ds      = argmin sum over the last two steps of (e - ds . (x, y))^2 + (0.1 m)^2 |ds|^2,
        s_y    <- s_y + slope_share ds_y,
        s_x    <- s_x + (1 - u) slope_share ds_x,             if the sole has shown a slope.

    Two steps tell a riser, which the same foot may climb each time, from a side slope. Feet close
    to each other count little. With h, the hips keep their height over the ground around the foot,
    and the next foot is expected on that ground. On soft ground each new foot lands higher than the
    stance foot, which has sunk. Uneven ground does not raise all of three steps.

    The stance toe gives no torque, so that the sole lies on the ground. During stance, from phase
    0.25 on and under full load, its pitch p corrects the slope ahead:

        c    = sum(predicted measured) / sum(predicted^2),    within 0 and 1,
        s_x' = k ((1 - u) c tan(p) + u min(0, s_x) - s_x) / T.

    c is the regression coefficient over some 20 steps, with a prior of 1, of the next foot's height
    z - s_y y (measured) on mean(tan(p)) x (predicted): rough ground tilts single footholds. T is
    `slope_time` if s_x falls and `slope_rise_time` if it rises. Ground that is expected too low
    costs a little speed, as the foot lands early. Ground that is expected too high lets the robot
    fall forward meanwhile. So s_x errs to the low side where footholds differ.

    A foot whose heel sinks turns up under load. k falls from 1 to 0 with the foot's pitch rate. u
    (`turned_up`) rises from 0 to 1 with the pitch since the foot lay flat: it shows no slope then,
    and an estimated rise decays.

    Walking begins with the side slope on which both feet stand, z y / (y^2 + (0.1 m)^2), and
    s_x = 0: heels that have sunk would show a wrong pitch.

    Source:
        README, Foot placement (Ground, Sole). The measured effect of each part is in DECISIONS.md,
        Walking. The paper's law has level ground.

    Attributes:
        ahead, left: Slope forward and to the left, rise over distance, heading frame.
        sinkage: How far the stance foot is expected to sink until the next touchdown. In m.
        foothold_height: Height of the stance foot over the ground around it. In m.
        sole_pitch: Pitch of the stance foot. In rad.
        sole_pitch_rate: Low-passed pitch rate of the stance foot. In rad/s.
        flat_pitch: Pitch of the stance foot when it lay flat. In rad.
        turned_up: How certain it is that the foot has turned up since it lay flat. 0..1.
        mean_sole_slope, sole_ticks: Mean slope of this stance foot's sole, and number of ticks.
        sum_predicted_squared, sum_predicted_measured: Sums of the regression, with
            `_FORGETTING_FACTOR`: squared predicted heights, and predicted times measured heights of
            the next foot. In m^2.
        last_step: Vector from the previous foothold to this one. In m.
        step_heights: Heights of the last new feet over the old ones, less the slope's, newest last.
            In m.
        slope_time, slope_rise_time, slope_share, foothold_share: See `config.WalkConfig`.
        period: Control period. In s.
    """

    ahead: float
    left: float
    sinkage: float
    foothold_height: float
    sole_pitch: float
    sole_pitch_rate: float
    flat_pitch: float
    turned_up: float
    mean_sole_slope: float
    sole_ticks: float
    sum_predicted_squared: float
    sum_predicted_measured: float
    last_step: FloatArray = array(3)
    step_heights: FloatArray = array(_SINKAGE_STEPS)
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
        names = "slope_time", "slope_rise_time", "slope_share", "foothold_share"
        self.take(config.in_force(), *names)

    def start(self) -> None:
        """Begin with level, firm ground."""
        self.ahead = self.left = self.sinkage = self.foothold_height = 0.0
        self.sole_pitch = self.sole_pitch_rate = self.flat_pitch = self.turned_up = 0.0
        self.mean_sole_slope = self.sole_ticks = 0.0
        self.sum_predicted_squared = self.sum_predicted_measured = 0.0
        self.last_step[:] = self.step_heights[:] = 0.0


@compiled
def initialize_slope(slopes: Records[GroundSlope], robots: Records[Robot]) -> None:
    """Begin with the side slope on which both feet stand; level where a foot is in the air."""
    slope, robot = slopes[0], robots[0]
    if slope.slope_time > 0.0 and robot.contact.min() >= estimator_config.ON_GROUND:
        _, y, z = robot.toe_joint[0] - robot.toe_joint[1]
        slope.left = _saturate_slope(z * y / (y * y + _REGULARIZATION * _REGULARIZATION))


@compiled
def update_in_stance(
    slopes: Records[GroundSlope], robots: Records[Robot], stance: int, phase: float
) -> None:
    """Update the slope with one tick of the stance foot's pitch.

    Args:
        slopes: Changed in place. Shape (1,).
        robots: The robot now. Shape (1,).
        stance: Number of the stance leg.
        phase: Phase of the step, in which the foot lies flat from `_FLAT_PHASE` on.
    """
    slope, robot = slopes[0], robots[0]
    if slope.slope_time <= 0.0:
        return
    q = robot.joints[stance]
    thigh_to_tarsus = q[KNEE] + q[SHIN] + q[TARSUS]  # with the springs' deflection
    pitch = virtual_leg.foot_pitch(robot.pitch, q[HIP_PITCH], q[TOE], thigh_to_tarsus)
    rate, slope.sole_pitch = (pitch - slope.sole_pitch) / slope.period, pitch
    slope.sole_pitch_rate += slope.period / timing.FOOT_RATE_TIME * (rate - slope.sole_pitch_rate)
    if phase < _FLAT_PHASE:
        slope.flat_pitch = pitch
    if robot.load[stance] < 1.0 or phase < _FLAT_PHASE:
        return
    measured = _saturate_slope(math.tan(pitch))
    slope.sole_ticks += 1.0
    slope.mean_sole_slope += (measured - slope.mean_sole_slope) / slope.sole_ticks
    measured *= max(0.0, min(1.0, _regression_coefficient(slope)))
    slope.turned_up = _ramp(pitch - slope.flat_pitch, _TURN_UP_RAMP)
    # A sole that turned up shows no slope: an estimated rise decays.
    measured += slope.turned_up * (min(0.0, slope.ahead) - measured)
    time_constant = slope.slope_rise_time if measured > slope.ahead else slope.slope_time
    at_rest = 1.0 - _ramp(abs(slope.sole_pitch_rate), _PITCH_RATE_RAMP)
    slope.ahead += at_rest * slope.period / time_constant * (measured - slope.ahead)


@compiled
def _regression_coefficient(slope: GroundSlope) -> float:
    """Regression coefficient of measured heights of the next foot on those its sole predicts."""
    coefficient: float = (slope.sum_predicted_measured + _REGRESSION_PRIOR) / (
        slope.sum_predicted_squared + _REGRESSION_PRIOR
    )
    return coefficient


@compiled
def update_at_touchdown(slopes: Records[GroundSlope], robots: Records[Robot], new: int) -> None:
    """Update the slope at a touchdown, with both feet on the ground.

    Args:
        slopes: Changed in place. Shape (1,).
        robots: The robot now. Shape (1,).
        new: Number of the leg that touches down.
    """
    slope, robot = slopes[0], robots[0]
    if slope.slope_time <= 0.0:
        return
    x = robot.toe_joint[new, 0] - robot.toe_joint[1 - new, 0]
    y = robot.toe_joint[new, 1] - robot.toe_joint[1 - new, 1]
    z = robot.toe_joint[new, 2] - robot.toe_joint[1 - new, 2]
    residual = z - slope.ahead * x - slope.left * y
    correction_ahead, correction_left = _plane_correction(slope, x, y, z)
    if slope.sole_ticks > 0.0:
        firm = 1.0 - slope.turned_up
        slope.ahead = _saturate_slope(slope.ahead + firm * slope.slope_share * correction_ahead)
    slope.left = _saturate_slope(slope.left + slope.slope_share * correction_left)
    slope.last_step[0], slope.last_step[1], slope.last_step[2] = x, y, z
    _update_sinkage(slope, residual)
    height = slope.foothold_share * (slope.foothold_height + residual - slope.sinkage)
    slope.foothold_height = max(-_MAX_FOOTHOLD_HEIGHT, min(_MAX_FOOTHOLD_HEIGHT, height))
    _update_regression(slope, slope.mean_sole_slope * x, z - slope.left * y)
    slope.mean_sole_slope = slope.sole_ticks = 0.0


@compiled
def _plane_correction(slope: GroundSlope, x: float, y: float, z: float) -> tuple[float, float]:
    """Slopes, forward and to the left, of the residuals' least-squares plane over two steps."""
    x_last, y_last, z_last = slope.last_step
    residual = z - slope.ahead * x - slope.left * y
    residual_last = z_last - slope.ahead * x_last - slope.left * y_last
    sum_xx = x * x + x_last * x_last + _REGULARIZATION * _REGULARIZATION
    sum_yy = y * y + y_last * y_last + _REGULARIZATION * _REGULARIZATION
    sum_xy = x * y + x_last * y_last
    sum_xr = x * residual + x_last * residual_last
    sum_yr = y * residual + y_last * residual_last
    determinant = sum_xx * sum_yy - sum_xy * sum_xy
    return (
        (sum_yy * sum_xr - sum_xy * sum_yr) / determinant,
        (sum_xx * sum_yr - sum_xy * sum_xr) / determinant,
    )


@compiled
def _update_sinkage(slope: GroundSlope, residual: float) -> None:
    """Update `sinkage`: if all of the last new feet landed higher, the old ones sank."""
    for k in range(_SINKAGE_STEPS - 1):
        slope.step_heights[k] = slope.step_heights[k + 1]
    slope.step_heights[_SINKAGE_STEPS - 1] = residual
    slope.sinkage = max(0.0, min(_MAX_SINKAGE, slope.step_heights.min() - _SINKAGE_DEAD_BAND))


@compiled
def _update_regression(slope: GroundSlope, predicted: float, measured: float) -> None:
    """Add a new foot's height (m), as predicted by the sole and as measured, to the sums."""
    decay = _FORGETTING_FACTOR
    slope.sum_predicted_squared = decay * slope.sum_predicted_squared + predicted * predicted
    slope.sum_predicted_measured = decay * slope.sum_predicted_measured + predicted * measured


@compiled
def step_up_height(slope: GroundSlope) -> float:
    """Height at which the stance foot landed above both feet before.

    Returns:
        In m, from 0 to `_MAX_FOOTHOLD_HEIGHT`.
    """
    last: float = slope.step_heights[_SINKAGE_STEPS - 1] - slope.sinkage
    step_down: float = min(0.0, slope.step_heights[_SINKAGE_STEPS - 2] + _SINKAGE_DEAD_BAND)
    return max(0.0, min(_MAX_FOOTHOLD_HEIGHT, last + step_down))


@compiled
def _saturate_slope(slope: float) -> float:
    return max(-_MAX_SLOPE, min(_MAX_SLOPE, slope))


@compiled
def _ramp(value: float, ends: tuple[float, float]) -> float:
    """Linear from 0 at the lower end to 1 at the upper end; constant outside."""
    low, high = ends
    return max(0.0, min(1.0, (value - low) / (high - low)))
