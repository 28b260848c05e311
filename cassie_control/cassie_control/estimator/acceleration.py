"""The accelerometer against the forces on the pelvis. See `faults` for the reasoning."""

from __future__ import annotations

import math

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, IntArray, Record, array, whole
from cassie_gaits.vectors import cross, dot, minus

_KEPT = 192  # ticks of expected acceleration: more than the longest of `DELAYS` at 2 kHz

DELAYS = (0.02, 0.03, 0.04)
"""Delays that are looked for; those beside them fit one of these better than none. In s."""

_SPIKE_TIME, _SPIKES = 0.04, 3.0  # s; count, fading over it, that soles which bounce do not reach
_SHOCK = 0.05  # of a spike, that the other two axes show together where something hits the robot
_FROZEN = 0.016  # s, after which what carries noise does not keep its bits; a delay begins so
_FAST, _SLOW = 0.003, 0.02  # s, between which a signal must change to be compared
_POWER_TIME = 0.2  # s
_CARRIED, _CARRIED_TIME, _CARRIED_SHARE = 0.5, 0.3, 0.75  # of the weight; s; of that time
_UNSURE, _NOISE = 0.5, 0.4  # share of the expected power, and (m/s^2)^2, that count as a misfit
_NORMAL = 0.1  # of a misfit, by which being late must fit better
_DOUBT = 2.0  # weight of what a delay leaves unexplained itself: neither fits what pushes the robot
_LARGEST = 2.0  # of what is needed
_NEAREST = 0.005  # s, between the delays of which a blow fits none
# What fits no delay by so many misfits is a blow; for how long, in s, the legs' answer to it may
# look like a delay.
_BLOW, _BLOW_TIME = 4.0, 0.1
_LOAD_TIME = 5.0  # s, in which what was learned of a load is forgotten
_NO_LOAD = 5.0  # s/m^2, information that there is none: of some 15 ms of walking

# Acceleration of the pelvis ahead, aside and upward by the left leg's force times its lean ahead
# and aside, the force itself (1/kg), the torques of hip pitch and knee (1/(kg m)), ...
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
    """What is remembered of the accelerometer, by axis.

    Attributes:
        measured: Newest first. In m/s^2.
        same: Ticks for which it has had the same bits.
        spikes: Their fading count.
        smooth: Measured smoothed fast and slow, expected and the pelvis's angular acceleration
            likewise. In m/s^2 and rad/s^2.
        load: Place of a load in the pelvis, by its share of what the legs move there. In m.
        evidence: Information about it, and times it. In s/m^2 and s/m.
        expected: Ring of what is expected to change within a step. In m/s^2.
        power: Of that. In (m/s^2)^2.
        late: Time for which it fitted each of `DELAYS` better. In s.
        bad: Time for which it is not believed yet. In s.
        carried: Share of late in which the feet carried the robot.
        blow: Time for which the echo of one may go on. In s.
        velocities: Of the ten drives and the gyro's three axes, newest first. In rad/s.
        now: What is expected. In m/s^2.
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
    """What is normal of the accelerometer.

    Attributes:
        period: Between samples. In s.
        hold: Time that an axis stays unbelieved after it last was wrong. In s.
        largest: In m/s^2.
        spike: In m/s^2.
        late: Time for which an axis must fit one of `DELAYS` better. In s.
        weight: Of the robot. In N.
    """

    period: float
    hold: float
    largest: float
    spike: float
    late: float
    weight: float

    def __init__(self, period: float, hold: float) -> None:
        """Of the nominal robot, at a period between samples in s and a hold in s."""
        limits = {"largest": 300.0, "spike": 6.0, "late": 0.019}
        super().__init__(period, hold, weight=robot.WEIGHT, **limits)


@compiled
def push_of_legs(
    torques: FloatArray, forces: FloatArray, feet: FloatArray, expected: FloatArray
) -> None:
    """Acceleration that legs' forces and drives' torques give the pelvis.

    A leg's force leans with it; hip and knee carry it to the pelvis. What speeds up the legs
    themselves is missing, see `expect_acceleration`.

    Args:
        torques: Of the ten drives. Shape (10,), in Nm.
        forces: Of the feet. Shape (2,), in N.
        feet: Middle of each sole in the pelvis. Shape (2, 3), in m.
        expected: Result, pelvis frame. Shape (3,), in m/s^2.
    """
    for k in range(3):
        expected[k] = 0.0
    for i in range(2):
        side = 1.0 if i == 0 else -1.0  # the right leg is the left one's image
        lean = forces[i] / min(feet[i, 2], -_LEAST_HEIGHT)
        pitch, knee = torques[5 * i + 2], torques[5 * i + 3]
        causes = lean * feet[i, 0], side * lean * feet[i, 1], forces[i], pitch, knee
        for j in range(5):
            expected[0] += _FORCES[0][j] * causes[j]
            expected[1] += side * _FORCES[1][j] * causes[j]
            expected[2] += _FORCES[2][j] * causes[j]


@compiled
def expect_acceleration(axes: Accelerometer, push: FloatArray, period: float) -> None:
    """What the accelerometer must have measured one sample ago, as far as it changes in a step.

    Newton's law: what the legs' forces give the pelvis (`push_of_legs`), less what speeds up the
    legs, and what the pelvis's own turning gives the IMU beside its middle. The factors were
    fitted to walks; they hold for changes within a step (8 to 50 Hz). Of these they explain 84 to
    95 % of the variance ahead, 96 to 97 % aside and 93 to 99 % upwards in four walks that they were
    not fitted to: a slow one, and random sticks with two libraries, up to a fall. Constant parts
    are not in it.

    Args:
        axes: `velocities` are of this sample and of two before; `now` is the result.
        push: What the legs' forces gave it one sample ago. Shape (3,), in m/s^2.
        period: Between samples. In s.
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
    """Compare the accelerometer with itself, and one sample ago with what was expected.

    Args:
        axes: Changed in place.
        limit: What is normal.
        ticks: Since the start.
        force: Of both feet. In N.
        trusted: Whether all sensors that these come from are believed.
    """
    dt, a = limit.period, axes.measured
    stands = 1.0 if force > _CARRIED * limit.weight else 0.0
    axes.blow = max(0.0, axes.blow - dt)
    axes.carried += (1.0 - math.exp(-dt / _CARRIED_TIME)) * (stands - axes.carried)
    # Neither what a gantry does is expected, nor anything true of sensors that fail.
    known = trusted and axes.carried > _CARRIED_SHARE
    _smooth(axes, dt, ticks)
    healthy = known
    for k in range(3):
        axes.bad[k] = max(0.0, axes.bad[k] - dt)
        axes.same[k] = axes.same[k] + 1 if a[0, k] == a[1, k] else 0
        axes.spikes[k] *= math.exp(-dt / _SPIKE_TIME)
        out = abs(a[1, k] - 0.5 * (a[0, k] + a[2, k]))
        # A step, as where a push begins or ends, is none.
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
    """Bring `smooth` up to date: of one sample ago."""
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
    """What changes within a step of the measured (0), the expected (1), the turning (2)."""
    fast, slow = axes.smooth[2 * j], axes.smooth[2 * j + 1]
    return fast[0] - slow[0], fast[1] - slow[1], fast[2] - slow[2]


@compiled
def _weigh(axes: Accelerometer, dt: float) -> None:
    """Learn where a load is fixed to the pelvis, by recursive least squares.

    A mass m at r from the IMU takes part in the pelvis's acceleration a and turns with it. With M
    what the legs' forces move there without it, they give M a_0 = M a + m (a + w' x r), and

        a = M / (M + m) a_0 - w' x load,    load = m / (M + m) r.

    The first factor changes the expected acceleration's size alone, which no delay is taken from.
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
    """By what each coordinate of a load adds to the acceleration along axis k, -w' x load."""
    if k == 0:
        return 0.0, turning[2], -turning[1]
    if k == 1:
        return -turning[2], 0.0, turning[0]
    return turning[1], -turning[0], 0.0


@compiled
def _alone(a: FloatArray, k: int, out: float) -> bool:
    """Whether axis k is off the line of its neighbours and the other two are not."""
    others = 0.0
    for i in range(3):
        if i != k and math.isfinite(a[0, i] + a[1, i] + a[2, i]):
            others += abs(a[1, i] - 0.5 * (a[0, i] + a[2, i]))
    return others < _SHOCK * out


@compiled
def _late(axes: Accelerometer, limit: AccelerometerLimits, ticks: int, k: int) -> bool:
    """Whether axis k follows what was expected a while ago, and not by chance."""
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
    """Least square (m^2/s^4) by which axis k is off what was expected now or up to 40 ms ago."""
    least, late = math.inf, 0.0
    while late < DELAYS[-1] + 0.5 * dt:
        count = int(late / dt + 0.5)
        if count > ticks:
            break
        least = min(least, (measured - axes.expected[(ticks - count) % _KEPT, k]) ** 2)
        late += _NEAREST
    return least
