"""Fault detection of a pair of sensors: a position and its velocity. See `faults`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES, LEG_SENSED_JOINTS, LEGS
from cassie_gaits.records import FloatArray, IntArray, Record, RecordArray, array, whole

PAIRS = 19
"""Ten drives, six joints, three axes of the IMU."""

FIRST_AXIS = 16
"""Index of the IMU's first axis among the pairs."""

DRIVE, JOINT, IMU = slice(0, 10), slice(10, FIRST_AXIS), slice(FIRST_AXIS, PAIRS)
"""Indices of the drives, the joints and the IMU's axes among the pairs."""

P, V = 0, 1
"""Channels of a pair: position and velocity."""

DELAYS = tuple(0.001 * ms for ms in range(20, 101, 2))
"""Delays that are tested; a delay between two of them fits one of these well enough. In s."""

APART_TIME = 0.3
"""Time constant with which the difference of position and integrated velocity decays. In s."""

REST_TIME = 1.0
"""Time at rest without power after which channels are accepted again. In s."""

_KEPT_TICKS = 201  # in `Pair.past`: the present one and the longest of `DELAYS` at 2 kHz
_RESPONSE_TICKS = 36  # in `Pair.steps`: the joints' velocity filter responds for 18 ms, at 2 kHz
_LATE_TIME = 0.1  # s, time constant of `Pair.late`, `leap` and `peak`
_SPIKE_TIME = 0.04  # s, time constant of `Pair.spikes`
_LATE = 0.010  # s, threshold of the estimated delay between position and velocity
_DELAYED = 0.4  # ratio to `_LATE`: threshold from which the delay's sign decides
_TIMEOUT = 0.03  # s, to find which channel of a pair is wrong
_TAIL = 2.0  # ratio to the velocity filter's delay
_SMALL_SPIKE = 0.35  # ratio of a small spike's threshold to a clear one's
_SPIKES = 1.2  # threshold of the decaying count: two spikes within `_SPIKE_TIME`
_HARDLY_A_SPIKE = 0.3  # decaying count of small spikes, below which there was no recent one
_STUCK_TICKS = 3
_FROZEN_TICKS = 15  # without a change, after which a noisy signal counts as frozen
_UNSEEN_POSITION, _UNSEEN_VELOCITY = 0.008, 0.002  # rad, thresholds of `Pair.unseen`
_SEEN_SPEED = 0.5  # rad/s, saturation of a motion that the velocity does not show
_WRONG_SPEED = 0.5  # rad/s, error from which a velocity stays rejected
_NOT_AGAIN = 0.02  # rad, error within which a rejected position may be accepted again
_UNSURE = 0.05  # relative error of the velocity filter's model where a foot is hit
_LEAP = 0.25  # ratio to `PairLimits.jump`: threshold of a leap
_LEAPT = 0.6  # ratio of a leap to `Pair.apart`, from which the leap explains it
_WORSE = 3.0  # weight of the squared residual that a delay leaves
_FADE = 0.01  # ratio to `PairLimits.evidence`: decrease of each sum per tick
_AT_ONCE = 0.25  # ratio to it: increase per tick at most; a landing lasts fewer than five ticks
_UNDECIDED = 0.5  # ratio of smaller to larger evidence, below which the larger one decides
_LARGEST = 4.0  # ratio to `PairLimits.evidence`: saturation of each sum


class Pair(Record):
    """State of the fault detection of one pair.

    The first index of `same`, `unseen`, `past`, `evidence`, `doubt`, `bad`, `life` and `trusted` is
    the channel, `P` or `V`.

    Attributes:
        position: Measured position; of an IMU axis the rotation since the start. In rad.
        velocity: Measured velocity. In rad/s.
        last_position: Position of the previous tick. In rad.
        last_velocity: Velocities of the previous ticks, newest first. In rad/s.
        steps: Changes of the position per tick, newest first. In rad.
        turns: Integrals of the velocity over a tick, newest first. In rad.
        same: Ticks for which the channel has had the same bits.
        unseen: Motion that the other channel has shown meanwhile. In rad.
        apart: Position minus integrated velocity, decaying with `APART_TIME`. In rad.
        late: Low-passed means of `apart` and velocity, their covariance, the velocity's variance.
        past: Ring buffer of the steps and turns that are compared. In rad.
        evidence: Cumulative sums for the channel's delay by each of `DELAYS`. In rad^2.
        doubt: Largest evidence of the channel. In rad^2.
        unclear: Time for which the channels have disagreed without a known cause. In s.
        guessed: 1 where a channel was rejected without a delay that explains it.
        last_step: Step of the position at the previous comparison. In rad.
        leap: Decaying peak of sudden steps of the position. In rad.
        peak: Decaying peak of the speed. In rad/s.
        spikes: Decaying counts of the velocity's clear and small spikes.
        bad: Remaining time for which the channel is rejected. In s.
        life: 0: accepted; 1: rejected; 2: rejected, but its bits change without power.
        trusted: Measurement or its replacement, for the estimator. In rad and rad/s.
    """

    position: float
    velocity: float
    last_position: float
    last_velocity: FloatArray = array(4)
    steps: FloatArray = array(_RESPONSE_TICKS)
    turns: FloatArray = array(3)
    same: IntArray = whole(2)
    unseen: FloatArray = array(2)
    apart: float
    late: FloatArray = array(4)
    past: FloatArray = array(2, _KEPT_TICKS)
    evidence: FloatArray = array(2, len(DELAYS))
    doubt: FloatArray = array(2)
    unclear: float
    guessed: int = whole()
    last_step: float
    leap: float
    peak: float
    spikes: FloatArray = array(2)
    bad: FloatArray = array(2)
    life: IntArray = whole(2)
    trusted: FloatArray = array(2)


class PairLimits(Record):
    """Limits of a healthy pair.

    Attributes:
        period: Time between samples. In s.
        hold: Time for which a channel stays rejected after its last fault. In s.
        averaged: 1 where the velocity is the mean over the period, as a gyro's.
        low, high: Range of the position. In rad.
        speed: Largest speed. In rad/s.
        still: Speed below which the pair counts as still. In rad/s.
        jump: Largest difference of a step and its turn in one tick. In rad.
        apart, apart_at_speed: Threshold of `Pair.apart`: constant, in rad, and by the speed, in s.
        spike: Threshold of the velocity's spikes. In rad/s.
        excited: Variance of the velocity from which a delay can be estimated. In (rad/s)^2.
        evidence: Threshold of the cumulative sums from which a channel is late. In rad^2.
        delay_ticks: Each of `DELAYS` in ticks.
        response_ticks: Ticks for which the velocity responds to a step of the position.
        response: Weights of the steps, newest first, in the velocity filter's response.
        position_lag, velocity_lag: Ticks by which each channel lags the other.
    """

    period: float
    hold: float
    averaged: int = whole()
    low: float
    high: float
    speed: float
    still: float
    jump: float
    apart: float
    apart_at_speed: float
    spike: float
    excited: float
    evidence: float
    delay_ticks: IntArray = whole(len(DELAYS))
    response_ticks: int = whole()
    response: FloatArray = array(_RESPONSE_TICKS)
    position_lag: int = whole()
    velocity_lag: int = whole()


@compiled
def start_pair(pair: Pair) -> None:
    """Initialise the pair with its first sample; a finite value that is not bad is trusted."""
    p, v = pair.position, pair.velocity
    pair.last_position = p if math.isfinite(p) else 0.0
    pair.last_velocity[:] = v if math.isfinite(v) else 0.0
    if pair.bad[P] == 0.0 and math.isfinite(p):
        pair.trusted[P] = p
    if pair.bad[V] == 0.0 and math.isfinite(v):
        pair.trusted[V] = v


@compiled
def look_at_pair(pair: Pair, limit: PairLimits, ticks: int, tilt: float) -> bool:
    """Compare position and velocity of a pair, and mark in `bad` which of them is wrong.

    Args:
        pair: Changed in place.
        limit: Its limits.
        ticks: Ticks since the start.
        tilt: Difference of position and integrated velocity that is no fault. In rad.

    Returns:
        Whether the position is accepted again because it was rejected by a wrong guess.
    """
    p, v, dt, hold = pair.position, pair.velocity, limit.period, limit.hold
    last = pair.last_velocity
    for kind in range(2):
        pair.bad[kind] = max(0.0, pair.bad[kind] - dt)
    if not limit.low <= p <= limit.high:
        pair.bad[P] = hold
        p = pair.last_position
    if not abs(v) <= limit.speed:
        pair.bad[V] = hold
        v = last[0]
    step, turn = p - pair.last_position, 0.5 * dt * (v + last[0])
    if limit.averaged:
        turn = dt * v
    if abs(step - turn) > limit.jump:
        # At a hard landing the position leads its filtered velocity, and neither jumps.
        sudden = abs(v - 2.0 * last[0] + last[1]) * dt > 0.5 * limit.jump
        if sudden and pair.bad[P] <= 0.0:
            pair.bad[V] = hold
            turn = step
        elif abs(step - pair.steps[0]) > limit.jump and not _is_answered(pair, limit, step, turn):
            pair.bad[P] = hold
            step = turn
    for k in range(limit.response_ticks - 1, 0, -1):
        pair.steps[k] = pair.steps[k - 1]
    for k in (2, 1):
        pair.turns[k] = pair.turns[k - 1]
    pair.steps[0], pair.turns[0] = step, turn
    pair.peak = max(abs(v), pair.peak * math.exp(-dt / _LATE_TIME))
    _count_same(pair, limit, p, v)
    _look_for_spikes(pair, limit, ticks, v)
    withdrawn = ticks > 3 and _look_apart(pair, limit, ticks, tilt)
    for k in (3, 2, 1):
        last[k] = last[k - 1]
    pair.last_position, last[0] = p, v
    return withdrawn


@compiled
def _is_answered(pair: Pair, limit: PairLimits, step: float, turn: float) -> bool:
    """Whether the velocity confirms a sudden step of the position, as when a foot is hit.

    The velocity filter's response decides between two hypotheses: the joint made this step, or it
    repeated the previous step.
    """
    expected = limit.response[0] * step  # value of `turn` under the first hypothesis
    for k in range(1, limit.response_ticks):
        expected += limit.response[k] * pair.steps[k - 1]
    otherwise = expected - limit.response[0] * (step - pair.steps[0])
    return bool(abs(turn - expected) < abs(turn - otherwise) + _UNSURE * abs(turn))


@compiled
def _count_same(pair: Pair, limit: PairLimits, p: float, v: float) -> None:
    """Find a channel that is stuck or off: its bits stay the same while its partner moves."""
    step, turn = pair.steps[0], pair.turns[0]
    most = _SEEN_SPEED * limit.period  # a single jump of the position is no motion
    now, last, moved = (
        (p, v),
        (pair.last_position, pair.last_velocity[0]),
        (turn, max(-most, min(most, step - turn))),
    )
    # A filtered velocity decays only some time after the position has stopped.
    tail = (_TAIL * limit.velocity_lag * limit.period * pair.peak, 0.0)
    unseen = (_UNSEEN_POSITION, _UNSEEN_VELOCITY)
    for kind in range(2):
        if now[kind] == last[kind]:
            pair.same[kind] += 1
            pair.unseen[kind] += moved[kind]
        else:
            pair.same[kind] = 0
            pair.unseen[kind] = 0.0
        stuck = pair.same[kind] >= _STUCK_TICKS
        stuck = stuck and abs(pair.unseen[kind]) > unseen[kind] + tail[kind]
        if stuck and pair.bad[1 - kind] <= 0.0:
            pair.bad[kind] = limit.hold


@compiled
def _look_for_spikes(pair: Pair, limit: PairLimits, ticks: int, v: float) -> None:
    """Find spikes: velocities of one tick that are off the curve through their neighbours.

    The curve is the cubic through two samples on each side. Legs that oscillate on their springs,
    with ten samples per period, stay on it. Where a foot is hit, the joint itself leaves it: the
    velocity filter's response to the position then tells that the velocity is right.
    """
    fade, last = math.exp(-limit.period / _SPIKE_TIME), pair.last_velocity
    after, spike, before = last[0], last[1], last[2]
    outer = v - last[3]
    out = abs(spike - (4.0 * (after + before) - v - last[3]) / 6.0)
    if abs(after - before) > out or abs(outer - 2.0 * (after - before)) > out:
        out = 0.0  # a step, as at a hard landing, or a neighbour's spike
    if out > _SMALL_SPIKE * limit.spike and not limit.averaged and pair.bad[P] <= 0.0:
        residual = 0.0  # of the two turns to which the velocity in question belongs
        for k in (1, 2):
            then = (ticks - k) % _KEPT_TICKS
            residual += pair.past[P, then] - pair.past[V, then]
        if abs(residual) < 0.5 * limit.period * out:
            out = 0.0  # the likelier of two hypotheses: the joint moved like this
    for k in range(2):
        bound = limit.spike * (1.0, _SMALL_SPIKE)[k]
        pair.spikes[k] = fade * pair.spikes[k] + (1.0 if out > bound else 0.0)
    if pair.spikes[0] > _SPIKES:
        pair.bad[V] = limit.hold


@compiled
def _look_apart(pair: Pair, limit: PairLimits, ticks: int, tilt: float) -> bool:
    """Compare the position with the integrated velocity; see `look_at_pair`."""
    dt, late = limit.period, pair.late
    step, turn = pair.steps[limit.velocity_lag], pair.turns[limit.position_lag]
    pair.apart = pair.apart * math.exp(-dt / APART_TIME) + step - turn
    leap = min(abs(step - turn), abs(step - pair.last_step))
    pair.leap = max(leap, pair.leap * math.exp(-dt / _LATE_TIME))
    pair.last_step = step
    apart, rate, share = pair.apart, 0.5 * (step + turn) / dt, 1.0 - math.exp(-dt / _LATE_TIME)
    late[0] += share * (apart - late[0])
    late[1] += share * (rate - late[1])
    late[2] += share * ((apart - late[0]) * (rate - late[1]) - late[2])
    late[3] += share * ((rate - late[1]) ** 2 - late[3])
    delay = late[2] / max(late[3], limit.excited)
    bound = limit.apart + limit.apart_at_speed * pair.peak + tilt
    small = 0.5 * limit.apart + tilt
    near = abs(apart) < bound and (abs(delay) < _LATE or abs(apart) < small)
    matched = _weigh_delays(pair, limit, ticks, turn)
    if matched < 0 and near:
        return False
    return _judge(pair, limit, matched)


@compiled
def _weigh_delays(pair: Pair, limit: PairLimits, ticks: int, turn: float) -> int:
    """Channel that repeats the other one's motion after one of `DELAYS`; -1 if none does.

    Cumulative sum test (Page, Biometrika 1954), for each channel and each delay. A tick adds by how
    much the delay explains the motion better than no delay does. The sum stays at or above zero:
    so samples before the delay began do not count, and the first motion after that decides.

    Args:
        pair: Changed in place.
        limit: Its limits.
        ticks: Ticks since the start.
        turn: Integral of the velocity over this tick. In rad.
    """
    step = 0.0  # value of `turn` that the position's steps predict
    for k in range(limit.response_ticks):
        step += limit.response[k] * pair.steps[k]
    # A velocity that is not filtered agrees with the newest step.
    apart = min((step - turn) ** 2, (pair.steps[0] - turn) ** 2)
    spikes = pair.spikes[1] >= _HARDLY_A_SPIKE
    leapt = pair.leap > max(_LEAP * limit.jump, _LEAPT * abs(pair.apart))
    enough = limit.evidence
    fade = _FADE * enough
    now = ticks % _KEPT_TICKS
    pair.past[P, now], pair.past[V, now] = step, turn
    if apart <= fade and pair.doubt[P] + pair.doubt[V] <= 0.0:
        return -1
    for kind in range(2):
        moved, past = (step, turn)[kind], pair.past[1 - kind]
        # At constant speed, a channel that is stuck, leaps or has spikes makes the other look late.
        silent = pair.same[1 - kind] > 0 or (spikes if kind == P else leapt)
        most, sums = 0.0, pair.evidence[kind]
        for m in range(len(DELAYS)):
            then = now - limit.delay_ticks[m]
            left = moved - past[then if then >= 0 else then + _KEPT_TICKS]
            gain = min(apart - _WORSE * left * left - fade, 0.0 if silent else _AT_ONCE * enough)
            sums[m] = max(0.0, min(sums[m] + gain, _LARGEST * enough))
            most = max(most, sums[m])
        pair.doubt[kind] = most
    for kind in range(2):
        most = pair.doubt[kind]
        if most > enough and pair.doubt[1 - kind] < _UNDECIDED * most:
            return kind
    return -1


@compiled
def _judge(pair: Pair, limit: PairLimits, matched: int) -> bool:
    """Reject the wrong channel of a pair that disagrees: the late one, or that of `_blame`.

    Args:
        pair: Changed in place.
        limit: Its limits.
        matched: The late channel; -1 if there is none.

    Returns:
        Whether the position is accepted again because it was rejected by a wrong guess.
    """
    if max(pair.bad[P], pair.bad[V]) <= 0.0:
        pair.guessed = 0
    withdrawn = matched >= 0 and pair.guessed > 0
    if withdrawn:
        pair.bad[1 - matched] = 0.0
    if pair.bad[P] > 0.0 or pair.bad[V] > 0.0:
        for kind in range(2):
            if pair.bad[kind] > 0.0:
                pair.bad[kind] = limit.hold
        return withdrawn and matched == V
    kind = matched if matched >= 0 else _blame(pair)
    if kind < 0 and pair.unclear < _TIMEOUT:
        pair.unclear += limit.period
        return False
    if kind < 0:
        kind = _guess(pair)
    pair.unclear, pair.guessed = 0.0, matched < 0
    pair.bad[kind] = limit.hold
    if kind == P:
        pair.trusted[P] = pair.position - pair.apart - pair.turns[0]
    return withdrawn and matched == V


@compiled
def _blame(pair: Pair) -> int:
    """Wrong channel of a pair that disagrees; -1 while this is unclear."""
    if pair.leap > _LEAPT * abs(pair.apart):
        return P  # also at rest, where the velocity is rightly 0
    if pair.spikes[1] >= _HARDLY_A_SPIKE:
        return V if pair.spikes[1] > 2.0 else -1  # the next spike decides
    still = (pair.same[P] >= _STUCK_TICKS, pair.same[V] >= _STUCK_TICKS)
    if still[0] != still[1]:
        return P if still[0] else V
    return -1


@compiled
def _guess(pair: Pair) -> int:
    """Likelier wrong channel: by spikes, by the evidence for delays, or by the delay's sign."""
    if pair.spikes[1] >= _HARDLY_A_SPIKE:
        return V
    if pair.doubt[P] != pair.doubt[V]:
        return P if pair.doubt[P] > pair.doubt[V] else V
    return P if pair.late[2] < -_DELAYED * _LATE * pair.late[3] else V


@compiled
def go_on(pair: Pair, limit: PairLimits, powered: int, rest: float) -> bool:
    """Replace a bad position by the integrated velocity, a bad velocity by differences.

    Args:
        pair: Changed in place.
        limit: Its limits.
        powered: Whether the robot has power.
        rest: Time for which the robot has hung or lain still without power. In s.

    Returns:
        Whether a channel is accepted again.
    """
    dt, again = limit.period, False
    if pair.bad[P] > 0.0 and pair.bad[V] > 0.0:
        # A velocity alone is of no use without a position to start from.
        pair.bad[V] = max(pair.bad[P], pair.bad[V])
    bad_p, bad_v = pair.bad[P] > 0.0, pair.bad[V] > 0.0
    for kind in range(2):
        if pair.bad[kind] > 0.0:
            if pair.life[kind] == 0:
                pair.life[kind] = 1
            elif pair.same[kind] == 0 and not powered:
                pair.life[kind] = 2
        elif pair.life[kind] > 0:
            pair.life[kind] = 0
            again = True
    if bad_v:
        follow = 1.0 - math.exp(-dt / 0.004)
        rate = pair.steps[0] / dt
        if not bad_p:
            last = pair.trusted[V] if math.isfinite(pair.trusted[V]) else rate
            pair.trusted[V] = last + follow * (rate - last)
        frozen = pair.same[V] >= _STUCK_TICKS and abs(rate) > 0.1
        wrong = frozen or abs(pair.velocity - pair.trusted[V]) >= _WRONG_SPEED
        _hold(pair, limit, V, wrong, rest > 0.0 or not (powered or bad_p))
    else:
        pair.trusted[V] = pair.velocity
    if bad_p:
        near = _NOT_AGAIN if pair.same[P] < _FROZEN_TICKS else _UNSEEN_VELOCITY
        pair.trusted[P] += dt * pair.trusted[V] if bad_v else pair.turns[0]
        wrong = abs(pair.position - pair.trusted[P]) >= near  # False for NaN
        _hold(pair, limit, P, wrong, rest > 0.0 or not (powered or bad_v))
    else:
        pair.trusted[P] = pair.position
    return again


@compiled
def _hold(pair: Pair, limit: PairLimits, kind: int, wrong: bool, borne_out: bool) -> None:
    """Keep a channel rejected while it differs from its replacement.

    After a fall the replacement may stay far off. So without power a channel whose bits change is
    accepted after `REST_TIME` unless something else contradicts it. `borne_out` says that its
    accepted partner agrees with it, or that the robot is at rest.
    """
    if borne_out and pair.life[kind] == 2:
        pair.bad[kind] = min(pair.bad[kind], REST_TIME)
    elif wrong:
        pair.bad[kind] = limit.hold


_MARGIN = 0.2  # rad beyond the stops
_JOINT_DELAY = 0.0045  # s, of the joints' velocity filter
_FASTEST = 100.0  # Hz, highest frequency to which a velocity filter's response is fitted
_SAMPLED = 0.2  # ratio to the sample rate: highest frequency that the samples resolve
_EVEN = 1e3  # weight of a constant velocity, relative to one frequency
_DRIVE_NOISE, _JOINT_NOISE = 0.2, 2.5  # weights of the encoders' noise, relative to one frequency


def set_pair_limits(period: float, attitude_delay: float, hold: float, limits: RecordArray) -> None:
    """Set the limits of each pair: values that no healthy sensor exceeds, with a margin.

    Args:
        period: Time between samples. In s.
        attitude_delay: Delay of the IMU's orientation. In s.
        hold: Time for which a channel stays rejected after its last fault. In s.
        limits: Result, records of `PairLimits`. Shape (19,).
    """
    limits["period"], limits["hold"], limits["averaged"][IMU] = period, hold, 1
    limits["low"], limits["high"] = -math.inf, math.inf
    for i, leg in enumerate(LEGS):
        links = {link.name: link for link in robot.leg_links(leg)}
        for first, names in ((5 * i, LEG_DRIVES), (10 + 3 * i, LEG_SENSED_JOINTS)):
            for k, name in enumerate(names):
                low, high = links[name].joint.limits or (-math.inf, math.inf)
                limits["low"][first + k] = low - _MARGIN
                limits["high"][first + k] = high + _MARGIN
    limits["speed"], limits["jump"] = 50.0, 0.02
    limits["still"], limits["still"][IMU] = 1.0, 0.1  # legs may swing while the robot hangs
    limits["apart"][DRIVE] = np.tile([0.004, 0.004, 0.006, 0.008, 0.008], 2)
    limits["apart"][JOINT], limits["apart"][IMU] = np.tile([0.008, 0.008, 0.01], 2), 0.005
    limits["apart_at_speed"][DRIVE] = 0.001
    limits["apart_at_speed"][JOINT] = 0.0045  # also where no filter delays the velocity
    limits["apart_at_speed"][IMU] = 0.002
    limits["spike"][DRIVE] = np.tile([0.5, 0.5, 0.6, 1.2, 5.5], 2)
    limits["spike"][JOINT], limits["spike"][IMU] = np.tile([0.9, 0.9, 1.5], 2), 0.25
    limits["excited"], limits["excited"][IMU] = 0.3**2, 0.15**2
    limits["evidence"][DRIVE] = np.tile([4e-7, 4e-7, 6e-7, 6e-7, 1.2e-6], 2)
    limits["evidence"][JOINT], limits["evidence"][IMU] = np.tile([4e-7, 8e-7, 5e-7], 2), 1e-6
    ticks = [max(1, min(_KEPT_TICKS - 1, round(delay / period))) for delay in DELAYS]
    limits["delay_ticks"] = ticks
    limits["response"][:, 0], limits["response_ticks"] = 1.0, 1  # a gyro has no filter
    for part, filters in (
        (DRIVE, (_DRIVE_NOISE, robot.DRIVE_VELOCITY_FILTER)),
        (JOINT, (_JOINT_NOISE, *robot.JOINT_VELOCITY_FILTER)),
    ):
        answer = velocity_response(period, *filters)
        limits["response"][part, : len(answer)] = answer
        limits["response_ticks"][part] = len(answer)
    limits["velocity_lag"][JOINT] = min(2, round(_JOINT_DELAY / period))
    limits["position_lag"][IMU] = min(2, round(attitude_delay / period))


def velocity_response(
    period: float, noise: float, forward: Sequence[float], back: Sequence[float] = ()
) -> FloatArray:
    """Weights with which the last steps of a position predict its filtered velocity.

    Least-squares fit to the filter's frequency response up to `_FASTEST`, which covers the
    oscillations of the legs' springs. A constant velocity is reproduced: its weight is large.

    Args:
        period: Time between samples. In s.
        noise: Weight of the encoders' noise, relative to a motion of one frequency.
        forward: Filter coefficients of the positions, newest first. In 1/s.
        back: Filter coefficients of earlier velocities, newest first; subtracted.

    Returns:
        Weights of the last steps, newest first. The weighted sum is the integral of the velocity
        over the last sample, by the trapezoidal rule. Shape (n,).
    """
    ticks = max(1, round(period * robot.ENCODER_RATE))
    samples = max(2, _RESPONSE_TICKS // ticks if back else 1 - (-len(forward) // ticks))
    frequency = np.linspace(0.0, min(_FASTEST, _SAMPLED / period), 200)[1:]
    late = np.exp(-2j * math.pi * frequency / robot.ENCODER_RATE)  # delay of one encoder tick
    velocity = sum(b * late**k for k, b in enumerate(forward))
    velocity /= 1.0 + sum(a * late**k for k, a in enumerate(back, 1))
    step = late**ticks  # delay of one sample
    answer = 0.5 * period * (1.0 + step) * velocity / (1.0 - step)
    shares = step[:, None] ** np.arange(samples)
    moments = -sum(k * b for k, b in enumerate(forward)) / robot.ENCODER_RATE
    even = moments / (1.0 + sum(back))
    between = np.diff(np.eye(samples), axis=0, prepend=0.0, append=0.0)  # an angle is in two steps
    rows = [shares.real, shares.imag, np.full((1, samples), _EVEN), noise * between]
    values = [answer.real, answer.imag, [_EVEN * even], np.zeros(samples + 1)]
    fitted: FloatArray = np.linalg.lstsq(np.vstack(rows), np.hstack(values))[0]
    return fitted
