"""Fault detection of the accelerometer by the forces on the pelvis. `faults` has the reasoning."""

from __future__ import annotations

import math

from cassie_control.estimator import pairs
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import DRIVES, HIP_PITCH, HIP_ROLL, KNEE, LEG_DRIVE_COUNT
from cassie_gaits.records import FloatArray, IntArray, Record, array, whole
from cassie_gaits.vectors import Vector, cross, dot, minus

DELAYS = (0.02, 0.03, 0.04)
"""Delays that are tested; delays close to one of these fit it better than no delay. In s."""

_HISTORY_TICKS = 161  # in `Accelerometer.expected_history`: now and the longest delay, at 4 kHz

_MEASURED, _EXPECTED, _ANGULAR = 0, 1, 2  # signals of `Accelerometer.low_passed`
_FAST, _SLOW = 0, 1  # its low-passes; their difference is the band-passed signal

_GYRO = len(DRIVES)  # index of the gyro's first axis in `Accelerometer.velocities`


class Accelerometer(Record):
    """State of the accelerometer's fault detection; the last index is the axis, if there is one.

    Attributes:
        measured: Last three measurements, newest first. In m/s^2.
        unchanged_ticks: Ticks for which the axis has had the same bits.
        spike_counts: Decaying count of spikes.
        low_passed: Signals after a fast and a slow low-pass: measured, expected, and the pelvis's
            angular acceleration. In m/s^2 and rad/s^2.
        load: Position of a load on the pelvis times its share of the moved mass. In m.
        information: Information matrix of `load`. In s/m^2.
        weighted_load: Product of `information` and `load`. In s/m.
        expected_history: Ring buffer of the band-passed expected acceleration. In m/s^2.
        last_measured: Band-passed measurement of the sample before. In m/s^2.
        power: Low-passed square of the band-passed expected acceleration. In (m/s^2)^2.
        delay_sums: Time for which the axis fitted each of `DELAYS` better than none. In s.
        rejected_for: Remaining time for which the axis is rejected. In s.
        stance_share: Low-passed share of time in which the feet carried the robot.
        velocities: Velocities of the ten drives and the gyro's three axes, newest first. In rad/s.
        expected: Expected acceleration. In m/s^2.
    """

    measured: FloatArray = array(3, 3)
    unchanged_ticks: IntArray = whole(3)
    spike_counts: FloatArray = array(3)
    low_passed: FloatArray = array(3, 2, 3)
    load: FloatArray = array(3)
    information: FloatArray = array(3, 3)
    weighted_load: FloatArray = array(3)
    expected_history: FloatArray = array(_HISTORY_TICKS, 3)
    last_measured: FloatArray = array(3)
    power: FloatArray = array(3)
    delay_sums: FloatArray = array(len(DELAYS), 3)
    rejected_for: FloatArray = array(3)
    stance_share: float
    velocities: FloatArray = array(3, len(DRIVES) + 3)
    expected: FloatArray = array(3)


# Fitted to walks, see DECISIONS.md. The rows are the pelvis's acceleration forward, to the left and
# up. The causes are those of the left leg; on the right leg everything to the left has its sign
# changed. The lean is how far the pelvis is ahead of the foot, or to its left, over the height.
_FORCE_COEFFICIENTS = (
    # force x lean forward, force x lean left, force (1/kg); hip pitch, knee torque (1/(kg m))
    (0.0411, 0.0, 0.0082, 0.0, -0.0254),
    (0.0, 0.0342, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0339, -0.0611, -0.0152),
)
_HIP_COEFFICIENTS = (
    # angular accelerations of hip roll, hip yaw, hip pitch (m)
    (0.0, 0.0065, -0.0145),
    (-0.0321, 0.0, 0.0),
    (0.0, 0.0, -0.0084),
)
_PELVIS_COEFFICIENTS = (
    # angular accelerations of the pelvis about its axes (m)
    (0.0, -0.0267, 0.0),
    (0.0454, 0.0, 0.0443),
    (0.0, 0.0, 0.0),
)
_LEFTWARD = 1  # row of these tables
_MIN_HEIGHT = 0.4  # m, of the pelvis over a foot that carries


@compiled
def acceleration_by_legs(
    torques: FloatArray, forces: FloatArray, feet: FloatArray, acceleration: FloatArray
) -> None:
    """Acceleration that the legs' forces and the drives' torques give the pelvis.

    A leg's force points along the leg; hip and knee transmit it to the pelvis. It is the sum of
    `_FORCE_COEFFICIENTS` times causes over both legs. The part that accelerates the legs themselves
    is not included, see `predict_acceleration`.

    Args:
        torques: Torques of the ten drives. Shape (10,), in Nm.
        forces: Forces of the feet. Shape (2,), in N.
        feet: Middle of each sole in the pelvis frame. Shape (2, 3), in m.
        acceleration: Result, pelvis frame. Shape (3,), in m/s^2.
    """
    for k in range(3):
        acceleration[k] = 0.0
    for i in range(2):
        side = 1.0 if i == 0 else -1.0  # the right leg is the mirror image of the left
        lean = forces[i] / min(feet[i, 2], -_MIN_HEIGHT)
        first = LEG_DRIVE_COUNT * i
        hip_pitch, knee = torques[first + HIP_PITCH], torques[first + KNEE]
        causes = lean * feet[i, 0], side * lean * feet[i, 1], forces[i], hip_pitch, knee
        for j in range(len(causes)):
            acceleration[0] += _FORCE_COEFFICIENTS[0][j] * causes[j]
            acceleration[1] += side * _FORCE_COEFFICIENTS[1][j] * causes[j]
            acceleration[2] += _FORCE_COEFFICIENTS[2][j] * causes[j]


@compiled
def predict_acceleration(accelerometer: Accelerometer, by_legs: FloatArray, period: float) -> None:
    """Acceleration that the accelerometer must have measured one sample ago, without constants.

    Newton's law: the legs' forces on the pelvis (`acceleration_by_legs`), less the part that
    accelerates the legs (`_HIP_COEFFICIENTS`), plus the pelvis's angular acceleration times the
    IMU's offset from its middle (`_PELVIS_COEFFICIENTS`). The coefficients hold for changes within
    a step (8 to 50 Hz). DECISIONS.md has the variance that they leave unexplained.

    Args:
        accelerometer: `velocities` are of this sample and of two before; `expected` is the result.
        by_legs: Acceleration one sample ago from `acceleration_by_legs`. Shape (3,), in m/s^2.
        period: Time between samples. In s.
    """
    v, per_time = accelerometer.velocities, 0.5 / period  # of central differences
    for k in range(3):
        accelerometer.expected[k] = by_legs[k]
        for j in range(HIP_ROLL, HIP_PITCH + 1):
            right = v[0, LEG_DRIVE_COUNT + j] - v[2, LEG_DRIVE_COUNT + j]
            if j != HIP_PITCH:
                right = -right  # roll and yaw of the right leg are mirrored
            left = v[0, j] - v[2, j]
            hips = left - right if k == _LEFTWARD else left + right
            pelvis = v[0, _GYRO + j] - v[2, _GYRO + j]
            accelerometer.expected[k] += _HIP_COEFFICIENTS[k][j] * per_time * hips
            accelerometer.expected[k] += _PELVIS_COEFFICIENTS[k][j] * per_time * pelvis


_STANCE_FORCE_RATIO = 0.5  # of the feet's force to the nominal weight: threshold of standing
_STANCE_TIME = 0.3  # s, time constant of `Accelerometer.stance_share`
_MIN_STANCE_SHARE = 0.75  # from which the expected acceleration is known: in steps, not in a gantry


@compiled
def check_accelerometer(
    accelerometer: Accelerometer,
    dt: float,
    hold_time: float,
    ticks: int,
    force: float,
    others_accepted: bool,
) -> None:
    """Check the accelerometer's samples, and compare that of one sample ago with the expected one.

    Args:
        accelerometer: Changed in place.
        dt: Time between samples. In s.
        hold_time: Time for which an axis stays rejected after its last fault. In s.
        ticks: Ticks since the start.
        force: Sum of both feet's forces. In N.
        others_accepted: Whether all sensors behind the expected acceleration are accepted.
    """
    standing = 1.0 if force > _STANCE_FORCE_RATIO * robot.WEIGHT else 0.0
    gain = 1.0 - math.exp(-dt / _STANCE_TIME)
    accelerometer.stance_share += gain * (standing - accelerometer.stance_share)
    # In a gantry the expected acceleration is wrong, and a cable that slackens looks like spikes.
    stands = accelerometer.stance_share > _MIN_STANCE_SHARE
    expected_known = others_accepted and stands
    _update_low_passed(accelerometer, dt, ticks)
    all_accepted = expected_known
    for k in range(3):
        accelerometer.rejected_for[k] = max(0.0, accelerometer.rejected_for[k] - dt)
        faulty = _violates_limits(accelerometer, dt, k, stands)
        delayed = _is_delayed(accelerometer, dt, ticks, k)
        if not expected_known:
            accelerometer.delay_sums[:, k] = 0.0
        if faulty or (delayed and expected_known):
            accelerometer.rejected_for[k] = hold_time
        all_accepted = all_accepted and accelerometer.rejected_for[k] == 0.0
    if all_accepted:
        _estimate_load(accelerometer, dt)


_MAX_ACCELERATION = 300.0  # m/s^2, about twice the range of a VN-100
_FROZEN_TIME = 0.016  # s for which a noisy signal does not keep its bits; a delay begins like this
_MIN_SPIKE = 6.0  # m/s^2, deviation of one sample from the line of its neighbours
_SHOCK_RATIO = 0.05  # of the other two axes' sum to a spike, from which the robot has a shock
_SPIKE_COUNT_LIMIT = 3.0  # exceeded by four spikes within 25 ms; bouncing soles stay below it


@compiled
def _violates_limits(accelerometer: Accelerometer, dt: float, k: int, stands: bool) -> bool:
    """Whether axis k is out of range, is frozen, or has spikes while the robot stands or walks."""
    a = accelerometer.measured
    unchanged_ticks, spike_counts = accelerometer.unchanged_ticks, accelerometer.spike_counts
    unchanged_ticks[k] = unchanged_ticks[k] + 1 if a[0, k] == a[1, k] else 0
    spike_counts[k] *= math.exp(-dt / pairs.SPIKE_TIME)
    deviation = _deviation(a, k)
    # A step, as where a push begins or ends, is no spike.
    threshold = max(_MIN_SPIKE, abs(a[0, k] - a[2, k]))
    if stands and deviation > threshold and _is_on_one_axis(a, k, deviation):
        spike_counts[k] += 1.0
    out_of_range = not abs(a[0, k]) <= _MAX_ACCELERATION  # NaN compares false
    frozen = dt * unchanged_ticks[k] > _FROZEN_TIME - 0.5 * dt
    return out_of_range or frozen or spike_counts[k] > _SPIKE_COUNT_LIMIT


@compiled
def _deviation(a: FloatArray, k: int) -> float:
    """Deviation of axis k, one sample ago, from the line of its neighbours, in m/s^2."""
    deviation: float = abs(a[1, k] - 0.5 * (a[0, k] + a[2, k]))
    return deviation


@compiled
def _is_on_one_axis(a: FloatArray, k: int, deviation: float) -> bool:
    """Whether axis k deviates from the line of its neighbours and the other two axes do not."""
    others = 0.0
    for i in range(3):
        if i != k and math.isfinite(a[0, i] + a[1, i] + a[2, i]):
            others += _deviation(a, i)
    return others < _SHOCK_RATIO * deviation


_FAST_TIME, _SLOW_TIME = 0.003, 0.02  # s, time constants: 8 and 53 Hz bound the band


@compiled
def _update_low_passed(accelerometer: Accelerometer, dt: float, ticks: int) -> None:
    """Update `low_passed` with the signals of one sample ago."""
    a, expected, v = accelerometer.measured, accelerometer.expected, accelerometer.velocities
    low_passed = accelerometer.low_passed
    for k in range(3):
        if ticks == 0:
            low_passed[_MEASURED, _FAST, k] = low_passed[_MEASURED, _SLOW, k] = a[1, k]
            low_passed[_EXPECTED, _FAST, k] = low_passed[_EXPECTED, _SLOW, k] = expected[k]
        angular = 0.5 / dt * (v[0, _GYRO + k] - v[2, _GYRO + k])
        latest = a[1, k], expected[k], angular
        for signal in range(3):
            fast, slow = low_passed[signal, _FAST, k], low_passed[signal, _SLOW, k]
            fast += (1.0 - math.exp(-dt / _FAST_TIME)) * (latest[signal] - fast)
            slow += (1.0 - math.exp(-dt / _SLOW_TIME)) * (fast - slow)
            low_passed[signal, _FAST, k], low_passed[signal, _SLOW, k] = fast, slow


@compiled
def _band_passed(accelerometer: Accelerometer, signal: int) -> Vector:
    """Band-passed acceleration: `_MEASURED`, `_EXPECTED`, or the pelvis's `_ANGULAR` one."""
    fast, slow = accelerometer.low_passed[signal, _FAST], accelerometer.low_passed[signal, _SLOW]
    return fast[0] - slow[0], fast[1] - slow[1], fast[2] - slow[2]


_MODEL_ERROR = 0.5  # share of the expected power: variance of the model's error
_NOISE_VARIANCE = 0.4  # (m/s^2)^2


@compiled
def _residual_variance(accelerometer: Accelerometer, k: int) -> float:
    """Variance of the residual of a healthy axis k, in (m/s^2)^2: of model and noise."""
    variance: float = _MODEL_ERROR * accelerometer.power[k] + _NOISE_VARIANCE
    return variance


_LOAD_TIME = 5.0  # s, time constant with which the estimate of a load is forgotten
_NO_LOAD_PRIOR = 5.0  # s/m^2, information that there is no load: that of some 15 ms of walking


@compiled
def _estimate_load(accelerometer: Accelerometer, dt: float) -> None:
    """Estimate where a load is fixed to the pelvis, by recursive least squares.

    A mass m at r from the IMU has the pelvis's acceleration a and turns with the pelvis. M is the
    mass that the legs' forces move without the load, and a_0 its acceleration. Then
    M a_0 = M a + m (a + w' x r), and

        a = M / (M + m) a_0 - w' x load,    load = m / (M + m) r.

    The first factor only scales the expected acceleration; no delay is inferred from the scale.
    """
    measured = _band_passed(accelerometer, _MEASURED)
    expected = _band_passed(accelerometer, _EXPECTED)
    angular = _band_passed(accelerometer, _ANGULAR)
    residual = minus(measured, expected)
    information, weighted_load = accelerometer.information, accelerometer.weighted_load
    forgetting = 1.0 - dt / _LOAD_TIME
    for k in range(3):
        for i in range(3):
            information[i, k] *= forgetting
        weighted_load[k] *= forgetting
    for k in range(3):
        row = _load_jacobian_row(angular, k)
        weight = dt / _residual_variance(accelerometer, k)
        for i in range(3):
            for j in range(3):
                information[i, j] += weight * row[i] * row[j]
            weighted_load[i] += weight * row[i] * residual[k]
    # Cramer's rule.
    x = information[0, 0] + _NO_LOAD_PRIOR, information[0, 1], information[0, 2]
    y = information[1, 0], information[1, 1] + _NO_LOAD_PRIOR, information[1, 2]
    z = information[2, 0], information[2, 1], information[2, 2] + _NO_LOAD_PRIOR
    yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)
    b, determinant = weighted_load, dot(x, yz)
    for k in range(3):
        accelerometer.load[k] = (b[0] * yz[k] + b[1] * zx[k] + b[2] * xy[k]) / determinant


@compiled
def _load_jacobian_row(angular: Vector, k: int) -> Vector:
    """Derivatives of -w' x load, the acceleration along axis k, by the load's coordinates."""
    if k == 0:
        return 0.0, angular[2], -angular[1]
    if k == 1:
        return -angular[2], 0.0, angular[0]
    return angular[1], -angular[0], 0.0


_POWER_TIME = 0.2  # s, time constant of `Accelerometer.power`
_MAX_LATENCY = 0.006  # s by which torques may act later than they are measured
_LATENCY_STEP = 0.002  # s, between the latencies that are tried
_INNOVATION_RATIO = 0.08  # of the innovations' variance to that of white noise with such residuals
_ALLOWANCE = 0.1  # normalised squared residuals by which a delay must fit better
_DELAY_SUM = 0.013  # s, threshold of the sums: healthy sensors reach 0.89 of it, see DECISIONS.md
_MAX_DELAY_SUM = 2.0 * _DELAY_SUM  # s, saturation of the sums


@compiled
def _is_delayed(accelerometer: Accelerometer, dt: float, ticks: int, k: int) -> bool:
    """Whether axis k, by enough evidence, follows the expected acceleration with a delay.

    Cumulative sum test for each delay D of `DELAYS`, as in `pairs`. With the normalised squared
    residual e(D) = min(1, (measured - expected D ago)^2 / sigma^2) and the error e_0 of a healthy
    axis (`_healthy_error`), the sum grows by dt (e_0 - e(D) - _ALLOWANCE) and stays between 0 and
    `_MAX_DELAY_SUM`.

    Args:
        accelerometer: Changed in place.
        dt: Time between samples. In s.
        ticks: Ticks since the start.
        k: Axis.
    """
    history = accelerometer.expected_history
    measured = _band_passed(accelerometer, _MEASURED)[k]
    angular = _band_passed(accelerometer, _ANGULAR)
    by_load = dot(_load_jacobian_row(angular, k), accelerometer.load)
    expected = _band_passed(accelerometer, _EXPECTED)[k] + by_load
    history[ticks % _HISTORY_TICKS, k] = expected
    gain = 1.0 - math.exp(-dt / _POWER_TIME)
    accelerometer.power[k] += gain * (expected * expected - accelerometer.power[k])
    variance = _residual_variance(accelerometer, k)
    healthy_error = min(1.0, _healthy_error(accelerometer, ticks, dt, k, measured, variance))
    accelerometer.last_measured[k] = measured
    delayed = False
    for j in range(len(DELAYS)):
        delay_ticks = int(DELAYS[j] / dt + 0.5)
        earlier = expected
        if ticks >= delay_ticks:
            earlier = history[(ticks - delay_ticks) % _HISTORY_TICKS, k]
        error = min(1.0, (measured - earlier) ** 2 / variance)
        increase = healthy_error - error - _ALLOWANCE
        total = max(0.0, accelerometer.delay_sums[j, k] + dt * increase)
        accelerometer.delay_sums[j, k] = min(_MAX_DELAY_SUM, total)
        delayed = delayed or total > _DELAY_SUM
    return delayed


@compiled
def _healthy_error(
    accelerometer: Accelerometer,
    ticks: int,
    dt: float,
    k: int,
    measured: float,
    variance: float,
) -> float:
    """Normalised squared error of axis k if it is healthy, whether the robot is pushed or not.

    A push is a step of the measured acceleration that nothing expects. After the band-pass r, the
    residual, decays like exp(-t / _SLOW_TIME), so that the innovation r(t) - exp(-dt / _SLOW_TIME)
    r(t - dt) is 0 again soon. What counts is the smaller of residual and innovation, each squared
    and over its variance, at the best latency of the torques up to `_MAX_LATENCY`.

    Args:
        accelerometer: Has the expected accelerations, and the measurement of the sample before.
        ticks: Ticks since the start.
        dt: Time between samples. In s.
        k: Axis.
        measured: Band-passed measurement. In m/s^2.
        variance: Variance of the residual. In (m/s^2)^2.
    """
    history = accelerometer.expected_history
    decay = math.exp(-dt / _SLOW_TIME)
    innovation_variance = _INNOVATION_RATIO * (1.0 - decay * decay) * variance
    least, latency = math.inf, 0.0
    while latency < _MAX_LATENCY + 0.5 * dt:
        delay_ticks = int(latency / dt + 0.5)
        if delay_ticks + 1 > ticks:
            break
        residual = measured - history[(ticks - delay_ticks) % _HISTORY_TICKS, k]
        before = history[(ticks - delay_ticks - 1) % _HISTORY_TICKS, k]
        innovation = residual - decay * (accelerometer.last_measured[k] - before)
        least = min(least, residual * residual / variance)
        least = min(least, innovation * innovation / innovation_variance)
        latency += _LATENCY_STEP
    return least
