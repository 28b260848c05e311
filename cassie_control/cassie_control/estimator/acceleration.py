"""Fault detection of the accelerometer by the forces on the pelvis. `faults` has the reasoning."""

from __future__ import annotations

import math

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, IntArray, Record, array, whole
from cassie_gaits.vectors import cross, dot, minus

_KEPT = 192  # ticks of expected acceleration: more than the longest of `DELAYS` at 2 kHz

DELAYS = (0.02, 0.03, 0.04)
"""Delays that are tested; delays close to one of these fit it better than no delay. In s."""

_SPIKE_TIME, _SPIKES = 0.04, 3.0  # s, time constant; decaying count that bouncing soles stay below
_SHOCK = 0.05  # ratio to a spike: sum of the other two axes from which it is a shock to the robot
_FROZEN = 0.016  # s for which a noisy signal does not keep its bits; a delay begins with a freeze
_FAST, _SLOW = 0.003, 0.02  # s, time constants of the band-pass before the comparison
_POWER_TIME = 0.2  # s, time constant of `Accelerometer.power`
_CARRIED, _CARRIED_TIME, _CARRIED_SHARE = 0.5, 0.3, 0.75  # of the weight; s; of that time
_UNSURE, _NOISE = 0.5, 0.4  # share of the expected power, and (m/s^2)^2: square of one misfit
_NORMAL = 0.1  # misfits by which a delay must fit better
_DOUBT = 2.0  # weight of the misfit that a delay leaves: an external push fits neither hypothesis
_LARGEST = 2.0  # ratio to `AccelerometerLimits.late`: saturation of `Accelerometer.late`
_NEAREST = 0.005  # s, spacing of the delays that are tested for a blow
# A blow fits each delay worse than so many misfits; time in s for which the legs' response to the
# blow may look like a delay.
_BLOW, _BLOW_TIME = 4.0, 0.1
_LOAD_TIME = 5.0  # s, time constant with which the estimate of a load is forgotten
_NO_LOAD = 5.0  # s/m^2, prior information that there is no load: that of some 15 ms of walking

# Coefficients of the pelvis's acceleration, rows forward, sideways and up: the left leg's force
# times its lean forward and sideways, the force (1/kg), torques of hip pitch, knee (1/(kg m)), ...
_FORCES = (
    (0.0411, 0.0, 0.0082, 0.0, -0.0254),
    (0.0, 0.0342, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0339, -0.0611, -0.0152),
)
# ... the angular accelerations of its hip roll, yaw and pitch, and those of the pelvis (m).
_DRIVES = ((0.0, 0.0065, -0.0145), (-0.0321, 0.0, 0.0), (0.0, 0.0, -0.0084))
_PELVIS = ((0.0, -0.0267, 0.0), (0.0454, 0.0, 0.0443), (0.0, 0.0, 0.0))
_LEAST_HEIGHT = 0.4  # m


class Accelerometer(Record):
    """State of the accelerometer's fault detection; the last index is the axis, if there is one.

    Attributes:
        measured: Last measurements, newest first. In m/s^2.
        same: Ticks for which the axis has had the same bits.
        spikes: Decaying count of spikes.
        smooth: Signals after a fast and a slow low-pass: measured, expected, and the pelvis's
            angular acceleration. In m/s^2 and rad/s^2.
        load: Position of a load on the pelvis times its share of the moved mass. In m.
        evidence: Information matrix of `load`, and its product with `load`. In s/m^2 and s/m.
        expected: Ring buffer of the band-passed expected acceleration. In m/s^2.
        power: Low-passed square of the band-passed expected acceleration. In (m/s^2)^2.
        late: Time for which the axis fitted each of `DELAYS` better than none. In s.
        bad: Remaining time for which the axis is rejected. In s.
        carried: Low-passed share of time in which the feet carried the robot.
        blow: Remaining time for which the response to a blow may last. In s.
        velocities: Velocities of the ten drives and the gyro's three axes, newest first. In rad/s.
        now: Expected acceleration. In m/s^2.
    """

    measured: FloatArray = array(3, 3)
    same: IntArray = whole(3)
    spikes: FloatArray = array(3)
    smooth: FloatArray = array(6, 3)
    load: FloatArray = array(3)
    evidence: FloatArray = array(4, 3)
    expected: FloatArray = array(_KEPT, 3)
    power: FloatArray = array(3)
    late: FloatArray = array(len(DELAYS), 3)
    bad: FloatArray = array(3)
    carried: float
    blow: float
    velocities: FloatArray = array(3, 13)
    now: FloatArray = array(3)


class AccelerometerLimits(Record):
    """Limits of a healthy accelerometer.

    Attributes:
        period: Time between samples. In s.
        hold: Time for which an axis stays rejected after its last fault. In s.
        largest: Largest acceleration. In m/s^2.
        spike: Threshold of a spike. In m/s^2.
        late: Time for which a late axis fits one of `DELAYS` better than none. In s.
        weight: Weight of the robot. In N.
    """

    period: float
    hold: float
    largest: float
    spike: float
    late: float
    weight: float

    def __init__(self, period: float, hold: float) -> None:
        """Limits of the nominal robot, at a period between samples in s and a hold in s."""
        limits = {"largest": 300.0, "spike": 6.0, "late": 0.019}
        super().__init__(period, hold, weight=robot.WEIGHT, **limits)


@compiled
def push_of_legs(
    torques: FloatArray, forces: FloatArray, feet: FloatArray, expected: FloatArray
) -> None:
    """Acceleration that the legs' forces and the drives' torques give the pelvis.

    A leg's force points along the leg; hip and knee transmit it to the pelvis. The part that
    accelerates the legs themselves is not included, see `expect_acceleration`.

    Args:
        torques: Torques of the ten drives. Shape (10,), in Nm.
        forces: Forces of the feet. Shape (2,), in N.
        feet: Middle of each sole in the pelvis frame. Shape (2, 3), in m.
        expected: Result, pelvis frame. Shape (3,), in m/s^2.
    """
    for k in range(3):
        expected[k] = 0.0
    for i in range(2):
        side = 1.0 if i == 0 else -1.0  # the right leg is the mirror image of the left
        lean = forces[i] / min(feet[i, 2], -_LEAST_HEIGHT)
        pitch, knee = torques[5 * i + 2], torques[5 * i + 3]
        causes = lean * feet[i, 0], side * lean * feet[i, 1], forces[i], pitch, knee
        for j in range(5):
            expected[0] += _FORCES[0][j] * causes[j]
            expected[1] += side * _FORCES[1][j] * causes[j]
            expected[2] += _FORCES[2][j] * causes[j]


@compiled
def expect_acceleration(axes: Accelerometer, push: FloatArray, period: float) -> None:
    """Acceleration that the accelerometer must have measured one sample ago, without constants.

    Newton's law: the legs' forces on the pelvis (`push_of_legs`), less the part that accelerates
    the legs, plus the pelvis's angular acceleration times the IMU's offset from its middle. The
    coefficients were fitted to walks; they hold for changes within a step (8 to 50 Hz). They
    explain 84 to 95 % of the variance of these changes forward, 96 to 97 % sideways and 93 to 99 %
    up. This holds in four walks that they were not fitted to: a slow one, and random sticks with
    two libraries, up to a fall.

    Args:
        axes: `velocities` are of this sample and of two before; `now` is the result.
        push: Acceleration one sample ago from `push_of_legs`. Shape (3,), in m/s^2.
        period: Time between samples. In s.
    """
    v, per_time = axes.velocities, 0.5 / period
    for k in range(3):
        axes.now[k] = push[k]
        for j in range(3):
            right = v[0, 5 + j] - v[2, 5 + j]
            if j < 2:
                right = -right  # of roll and yaw
            left = v[0, j] - v[2, j]
            both = left - right if k == 1 else left + right
            axes.now[k] += _DRIVES[k][j] * per_time * both
            axes.now[k] += _PELVIS[k][j] * per_time * (v[0, 10 + j] - v[2, 10 + j])


@compiled
def look_at_acceleration(
    axes: Accelerometer,
    limit: AccelerometerLimits,
    ticks: int,
    force: float,
    trusted: bool,
) -> None:
    """Check the accelerometer's samples, and compare that of one sample ago with the expected one.

    Args:
        axes: Changed in place.
        limit: Limits of a healthy accelerometer.
        ticks: Ticks since the start.
        force: Sum of both feet's forces. In N.
        trusted: Whether all sensors behind the expected acceleration are accepted.
    """
    dt, a = limit.period, axes.measured
    stands = 1.0 if force > _CARRIED * limit.weight else 0.0
    axes.blow = max(0.0, axes.blow - dt)
    axes.carried += (1.0 - math.exp(-dt / _CARRIED_TIME)) * (stands - axes.carried)
    # The expected acceleration is wrong in a gantry, and with sensors that fail.
    known = trusted and axes.carried > _CARRIED_SHARE
    _smooth(axes, dt, ticks)
    healthy = known
    for k in range(3):
        axes.bad[k] = max(0.0, axes.bad[k] - dt)
        axes.same[k] = axes.same[k] + 1 if a[0, k] == a[1, k] else 0
        axes.spikes[k] *= math.exp(-dt / _SPIKE_TIME)
        out = abs(a[1, k] - 0.5 * (a[0, k] + a[2, k]))
        # A step, as where a push begins or ends, is no spike.
        if out > max(limit.spike, abs(a[0, k] - a[2, k])) and _alone(a, k, out):
            axes.spikes[k] += 1.0
        wrong = not abs(a[0, k]) <= limit.largest
        wrong = wrong or dt * axes.same[k] > _FROZEN - 0.5 * dt
        wrong = wrong or axes.spikes[k] > _SPIKES
        late = _late(axes, limit, ticks, k)
        if not known:
            axes.late[:, k] = 0.0
        if wrong or (late and known):
            axes.bad[k] = limit.hold
        healthy = healthy and axes.bad[k] == 0.0
    if healthy:
        _weigh(axes, dt)


@compiled
def _smooth(axes: Accelerometer, dt: float, ticks: int) -> None:
    """Update `smooth` with the signals of one sample ago."""
    a, now, v = axes.measured, axes.now, axes.velocities
    for k in range(3):
        if ticks == 0:
            axes.smooth[:4, k] = a[1, k], a[1, k], now[k], now[k]
        latest = a[1, k], now[k], 0.5 / dt * (v[0, 10 + k] - v[2, 10 + k])
        for j in range(3):
            fast, slow = axes.smooth[2 * j, k], axes.smooth[2 * j + 1, k]
            fast += (1.0 - math.exp(-dt / _FAST)) * (latest[j] - fast)
            slow += (1.0 - math.exp(-dt / _SLOW)) * (fast - slow)
            axes.smooth[2 * j, k], axes.smooth[2 * j + 1, k] = fast, slow


@compiled
def _changes(axes: Accelerometer, j: int) -> tuple[float, float, float]:
    """Band-passed acceleration: measured (0), expected (1), or the pelvis's angular one (2)."""
    fast, slow = axes.smooth[2 * j], axes.smooth[2 * j + 1]
    return fast[0] - slow[0], fast[1] - slow[1], fast[2] - slow[2]


@compiled
def _weigh(axes: Accelerometer, dt: float) -> None:
    """Estimate where a load is fixed to the pelvis, by recursive least squares.

    A mass m at r from the IMU has the pelvis's acceleration a and turns with the pelvis. M is the
    mass that the legs' forces move without the load, and a_0 its acceleration. Then
    M a_0 = M a + m (a + w' x r), and

        a = M / (M + m) a_0 - w' x load,    load = m / (M + m) r.

    The first factor only scales the expected acceleration; no delay is inferred from the scale.
    """
    measured, expected, turning = _changes(axes, 0), _changes(axes, 1), _changes(axes, 2)
    left = minus(measured, expected)
    keep = 1.0 - dt / _LOAD_TIME
    for i in range(4):
        for k in range(3):
            axes.evidence[i, k] *= keep
    for k in range(3):
        row = _turning_with(turning, k)
        weight = dt / (_UNSURE * axes.power[k] + _NOISE)
        for i in range(3):
            for j in range(3):
                axes.evidence[i, j] += weight * row[i] * row[j]
            axes.evidence[3, i] += weight * row[i] * left[k]
    x = axes.evidence[0, 0] + _NO_LOAD, axes.evidence[0, 1], axes.evidence[0, 2]
    y = axes.evidence[1, 0], axes.evidence[1, 1] + _NO_LOAD, axes.evidence[1, 2]
    z = axes.evidence[2, 0], axes.evidence[2, 1], axes.evidence[2, 2] + _NO_LOAD
    yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)
    told, whole = axes.evidence[3], dot(x, yz)
    for k in range(3):
        axes.load[k] = (told[0] * yz[k] + told[1] * zx[k] + told[2] * xy[k]) / whole


@compiled
def _turning_with(turning: tuple[float, float, float], k: int) -> tuple[float, float, float]:
    """Derivatives of -w' x load, the acceleration along axis k, by the load's coordinates."""
    if k == 0:
        return 0.0, turning[2], -turning[1]
    if k == 1:
        return -turning[2], 0.0, turning[0]
    return turning[1], -turning[0], 0.0


@compiled
def _alone(a: FloatArray, k: int, out: float) -> bool:
    """Whether axis k is off the line of its neighbour samples and the other two axes are not."""
    others = 0.0
    for i in range(3):
        if i != k and math.isfinite(a[0, i] + a[1, i] + a[2, i]):
            others += abs(a[1, i] - 0.5 * (a[0, i] + a[2, i]))
    return others < _SHOCK * out


@compiled
def _late(axes: Accelerometer, limit: AccelerometerLimits, ticks: int, k: int) -> bool:
    """Whether axis k, by enough evidence, follows the expected acceleration with a delay."""
    dt, measured = limit.period, _changes(axes, 0)[k]
    now = _changes(axes, 1)[k] + dot(_turning_with(_changes(axes, 2), k), axes.load)
    axes.expected[ticks % _KEPT, k] = now
    axes.power[k] += (1.0 - math.exp(-dt / _POWER_TIME)) * (now * now - axes.power[k])
    scale = _UNSURE * axes.power[k] + _NOISE
    misfit, late = min(1.0, (measured - now) ** 2 / scale), False
    if _unexplained(axes, ticks, dt, k, measured) > _BLOW * scale:
        axes.blow = _BLOW_TIME
    for j in range(len(DELAYS)):
        count = int(DELAYS[j] / dt + 0.5)
        before = axes.expected[(ticks - count) % _KEPT, k] if ticks >= count else now
        gain = misfit - _DOUBT * min(1.0, (measured - before) ** 2 / scale) - _NORMAL
        if axes.blow > 0.0:
            gain = min(0.0, gain)
        total = max(0.0, axes.late[j, k] + dt * gain)
        axes.late[j, k] = min(_LARGEST * limit.late, total)
        late = late or total > limit.late
    return late


@compiled
def _unexplained(axes: Accelerometer, ticks: int, dt: float, k: int, measured: float) -> float:
    """Least squared residual (m^2/s^4) of axis k over all delays from 0 to 40 ms."""
    least, late = math.inf, 0.0
    while late < DELAYS[-1] + 0.5 * dt:
        count = int(late / dt + 0.5)
        if count > ticks:
            break
        least = min(least, (measured - axes.expected[(ticks - count) % _KEPT, k]) ** 2)
        late += _NEAREST
    return least
