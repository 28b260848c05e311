"""Fault detection of a pair of sensors: a position and its velocity. See `faults`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import DRIVES, LEG_DRIVES, LEG_SENSED_JOINTS, LEGS, SENSED_JOINTS
from cassie_gaits.records import FloatArray, IntArray, Record, RecordArray, array, whole

FIRST_JOINT = len(DRIVES)
FIRST_IMU_AXIS = FIRST_JOINT + len(SENSED_JOINTS)
"""Indices of the first joint and of the IMU's first axis among the pairs; drives come first."""

PAIRS = FIRST_IMU_AXIS + 3
"""Ten drives, six joints, three axes of the IMU."""

DRIVE_PAIRS = slice(0, FIRST_JOINT)
JOINT_PAIRS = slice(FIRST_JOINT, FIRST_IMU_AXIS)
IMU_PAIRS = slice(FIRST_IMU_AXIS, PAIRS)
"""Indices of the drives, the joints and the IMU's axes among the pairs."""

P, V = 0, 1
"""Channels of a pair: position and velocity."""

PAIR_DELAYS = tuple(0.001 * ms for ms in range(10, 101, 2))
"""Delays that are tested; a delay between two of them fits one of these well enough. In s."""

RESIDUAL_TIME = 0.3
"""Time constant with which the difference of position and integrated velocity decays. In s."""

SPIKE_TIME = 0.04
"""Time constant with which counts of spikes are forgotten. In s."""

REST_TIME = 1.0
"""Time at rest without power after which channels are accepted again. In s."""

_NO_CHANNEL = -1
_ACCEPTED, _REJECTED, _RESPONSIVE = 0, 1, 2  # values of `Pair.status`
_CLEAR, _SMALL = 0, 1  # indices of `Pair.spike_counts`

# At the encoders' rate; at higher ones fewer delays are tested, and a shorter response is modelled.
# In `Pair.step_history`: the present and the longest of `PAIR_DELAYS`.
_STEP_HISTORY_TICKS = 1 + round(PAIR_DELAYS[-1] * robot.ENCODER_RATE)
_RESPONSE_TICKS = 36  # in `Pair.position_steps`: the joints' velocity filter responds for 18 ms
_VELOCITY_TICKS = 4  # in `Pair.last_velocities`: with the present one, five for the cubic

_PEAK_TIME = 0.1  # s, time constant of the decay of both peaks
_STUCK_TICKS = 3  # without a change of its bits, after which a channel may be stuck


class Pair(Record):
    """State of the fault detection of one pair.

    The first index of `unchanged_ticks`, `partner_motion`, `step_history`, `delay_sums`,
    `delay_evidence`, `rejected_for`, `status` and `output` is the channel, `P` or `V`.

    Attributes:
        position: Measured position; of an IMU axis the rotation since the start. In rad.
        velocity: Measured velocity. In rad/s.
        last_position: Position of the previous tick. In rad.
        last_velocities: Velocities of the previous ticks, newest first. In rad/s.
        position_steps: Changes of the position per tick, newest first. In rad.
        velocity_steps: Integrals of the velocity over a tick, newest first. In rad.
        unchanged_ticks: Ticks for which the channel has had the same bits.
        partner_motion: Motion that the other channel has shown meanwhile. In rad.
        residual: Position minus integrated velocity, decaying with `RESIDUAL_TIME`. In rad.
        step_history: Ring buffer of the steps of position and velocity that are compared. In rad.
        delay_sums: Cumulative sums for the channel's delay by each of `PAIR_DELAYS`. In rad^2.
        delay_evidence: Largest of the channel's cumulative sums. In rad^2.
        undecided_time: Time for which the channels have disagreed without a known cause. In s.
        provisional: 1 where a channel was rejected without a delay that explains it.
        last_position_step: Step of the position at the previous comparison. In rad.
        jump_peak: Decaying peak of the position's jumps. In rad.
        speed_peak: Decaying peak of the speed. In rad/s.
        spike_counts: Decaying counts of the velocity's clear and small spikes.
        rejected_for: Remaining time for which the channel is rejected. In s.
        status: Accepted; rejected; or rejected, but its bits change without power.
        output: Measurement or its substitute, for the estimator. In rad and rad/s.
    """

    position: float
    velocity: float
    last_position: float
    last_velocities: FloatArray = array(_VELOCITY_TICKS)
    position_steps: FloatArray = array(_RESPONSE_TICKS)
    velocity_steps: FloatArray = array(3)
    unchanged_ticks: IntArray = whole(2)
    partner_motion: FloatArray = array(2)
    residual: float
    step_history: FloatArray = array(2, _STEP_HISTORY_TICKS)
    delay_sums: FloatArray = array(2, len(PAIR_DELAYS))
    delay_evidence: FloatArray = array(2)
    undecided_time: float
    provisional: int = whole()
    last_position_step: float
    jump_peak: float
    speed_peak: float
    spike_counts: FloatArray = array(2)
    rejected_for: FloatArray = array(2)
    status: IntArray = whole(2)
    output: FloatArray = array(2)


class PairLimits(Record):
    """Limits of a healthy pair.

    Attributes:
        period: Time between samples. In s.
        peak_decay: Factor on both decaying peaks over one period.
        residual_decay: Factor on the residual over one period, by `RESIDUAL_TIME`.
        spike_decay: Factor on the counts of spikes over one period, by `SPIKE_TIME`.
        hold_time: Time for which a channel stays rejected after its last fault. In s.
        averaged: 1 where the velocity is the mean over the period, as a gyro's.
        low, high: Range of the position. In rad.
        still_speed: Speed below which the pair counts as still. In rad/s.
        residual, residual_by_speed: Threshold of `Pair.residual`: a constant, in rad, and its
            increase with the speed, in s.
        spike: Threshold of the velocity's clear spikes. In rad/s.
        evidence: Threshold of the cumulative sums from which a channel is delayed. In rad^2.
        delay_ticks: Each of `PAIR_DELAYS` in ticks.
        response_ticks: Ticks for which the velocity responds to a step of the position.
        response: Weights of the steps, newest first, in the velocity filter's response.
        position_lag, velocity_lag: Ticks by which each channel lags the other.
    """

    period: float
    peak_decay: float
    residual_decay: float
    spike_decay: float
    hold_time: float
    averaged: int = whole()
    low: float
    high: float
    still_speed: float
    residual: float
    residual_by_speed: float
    spike: float
    evidence: float
    delay_ticks: IntArray = whole(len(PAIR_DELAYS))
    response_ticks: int = whole()
    response: FloatArray = array(_RESPONSE_TICKS)
    position_lag: int = whole()
    velocity_lag: int = whole()


@compiled
def initialise_pair(pair: Pair) -> None:
    """Initialise the pair with its first sample; the output takes values that are accepted."""
    position, velocity = pair.position, pair.velocity
    pair.last_position = position if math.isfinite(position) else 0.0
    pair.last_velocities[:] = velocity if math.isfinite(velocity) else 0.0
    if pair.rejected_for[P] == 0.0 and math.isfinite(position):
        pair.output[P] = position
    if pair.rejected_for[V] == 0.0 and math.isfinite(velocity):
        pair.output[V] = velocity


@compiled
def check_pair(pair: Pair, limits: PairLimits, ticks: int, tolerance: float) -> bool:
    """Compare position and velocity of a pair, and set in `rejected_for` which of them is faulty.

    Args:
        pair: Changed in place.
        limits: Its limits.
        ticks: Ticks since the start.
        tolerance: Difference of position and integrated velocity that is no fault. In rad.

    Returns:
        Whether the position is accepted again because its rejection was a wrong decision.
    """
    for channel in range(2):
        pair.rejected_for[channel] = max(0.0, pair.rejected_for[channel] - limits.period)
    position, velocity = _check_ranges(pair, limits)
    position_step, velocity_step = _check_jumps(pair, limits, position, velocity)
    for k in range(limits.response_ticks - 1, 0, -1):
        pair.position_steps[k] = pair.position_steps[k - 1]
    for k in range(len(pair.velocity_steps) - 1, 0, -1):
        pair.velocity_steps[k] = pair.velocity_steps[k - 1]
    pair.position_steps[0], pair.velocity_steps[0] = position_step, velocity_step
    pair.speed_peak = max(abs(velocity), pair.speed_peak * limits.peak_decay)
    _detect_stuck_channel(pair, limits, position, velocity)
    _detect_spikes(pair, limits, ticks, velocity)
    reaccepted = ticks >= _VELOCITY_TICKS and _check_residual(pair, limits, ticks, tolerance)
    for k in range(_VELOCITY_TICKS - 1, 0, -1):
        pair.last_velocities[k] = pair.last_velocities[k - 1]
    pair.last_position, pair.last_velocities[0] = position, velocity
    return reaccepted


_MAX_SPEED = 50.0  # rad/s, of every joint and axis


@compiled
def _check_ranges(pair: Pair, limits: PairLimits) -> tuple[float, float]:
    """Reject values out of range or NaN; position and velocity, or the last ones in their place."""
    position, velocity = pair.position, pair.velocity
    if not limits.low <= position <= limits.high:
        pair.rejected_for[P] = limits.hold_time
        position = pair.last_position
    if not abs(velocity) <= _MAX_SPEED:
        pair.rejected_for[V] = limits.hold_time
        velocity = pair.last_velocities[0]
    return position, velocity


_JUMP = 0.02  # rad, by which the steps of position and velocity differ in one tick
_VELOCITY_JUMP = 0.5 * _JUMP  # of the velocity's second difference times the period


@compiled
def _check_jumps(
    pair: Pair, limits: PairLimits, position: float, velocity: float
) -> tuple[float, float]:
    """Reject a channel that jumps without the other one.

    A position's step is its change over the tick. A velocity's step is its integral over the tick,
    by the trapezoidal rule where the velocity is a sample, and exactly where it is a mean.

    Args:
        pair: Changed in place.
        limits: Its limits.
        position, velocity: Values of this tick, in range. In rad and rad/s.

    Returns:
        Steps of position and velocity over this tick; the step of a channel that jumps is replaced
        by its partner's. In rad.
    """
    dt, last = limits.period, pair.last_velocities
    position_step = position - pair.last_position
    velocity_step = 0.5 * dt * (velocity + last[0])
    if limits.averaged:
        velocity_step = dt * velocity
    if abs(position_step - velocity_step) > _JUMP:
        # At a hard landing the position leads its filtered velocity, and neither jumps.
        second_difference = abs(velocity - 2.0 * last[0] + last[1])
        velocity_jumps = second_difference * dt > _VELOCITY_JUMP
        position_jumps = abs(position_step - pair.position_steps[0]) > _JUMP
        if velocity_jumps and pair.rejected_for[P] <= 0.0:
            pair.rejected_for[V] = limits.hold_time
            velocity_step = position_step
        elif position_jumps and not _velocity_confirms(pair, limits, position_step, velocity_step):
            pair.rejected_for[P] = limits.hold_time
            position_step = velocity_step
    return position_step, velocity_step


_FILTER_MODEL_ERROR = 0.05  # relative, of the filter's response to a hit; 0.02 at 20 rad/s


@compiled
def _velocity_confirms(
    pair: Pair, limits: PairLimits, position_step: float, velocity_step: float
) -> bool:
    """Whether the velocity confirms a sudden step of the position, as when a foot is hit.

    The velocity filter's response decides between two hypotheses: the joint made this step, or it
    repeated the previous step.

    Args:
        pair: State of the pair.
        limits: Its limits.
        position_step: Step of the position over this tick. In rad.
        velocity_step: Integral of the velocity over this tick. In rad.
    """
    expected = limits.response[0] * position_step  # value of `velocity_step` if the joint made it
    for k in range(1, limits.response_ticks):
        expected += limits.response[k] * pair.position_steps[k - 1]
    repeated = expected - limits.response[0] * (position_step - pair.position_steps[0])
    model_error = _FILTER_MODEL_ERROR * abs(velocity_step)
    return bool(abs(velocity_step - expected) < abs(velocity_step - repeated) + model_error)


_STUCK_POSITION_MOTION = 0.008  # rad, of the velocity while the position keeps its bits
_STUCK_VELOCITY_MOTION = 0.002  # rad, of the position while the velocity keeps its bits
_STUCK_VELOCITY_SPEED = 0.5  # rad/s, saturation of the motion in `_STUCK_VELOCITY_MOTION`
_FILTER_TAIL_RATIO = 2.0  # of the time in which a filtered velocity decays to the filter's delay


@compiled
def _detect_stuck_channel(pair: Pair, limits: PairLimits, position: float, velocity: float) -> None:
    """Reject a channel that is stuck or off: its bits stay the same while its partner moves."""
    position_step, velocity_step = pair.position_steps[0], pair.velocity_steps[0]
    # A filtered velocity decays only some time after the position has stopped.
    tail = _FILTER_TAIL_RATIO * limits.velocity_lag * limits.period * pair.speed_peak
    unchanged = position == pair.last_position
    threshold = _STUCK_POSITION_MOTION + tail
    _count_unchanged(pair, limits, P, unchanged, velocity_step, threshold)
    max_step = _STUCK_VELOCITY_SPEED * limits.period  # a single jump of the position is no motion
    unexplained_step = max(-max_step, min(max_step, position_step - velocity_step))
    unchanged = velocity == pair.last_velocities[0]
    _count_unchanged(pair, limits, V, unchanged, unexplained_step, _STUCK_VELOCITY_MOTION)


@compiled
def _count_unchanged(
    pair: Pair,
    limits: PairLimits,
    channel: int,
    unchanged: bool,
    partner_step: float,
    threshold: float,
) -> None:
    """Update `unchanged_ticks` and `partner_motion` of a channel; reject it if it is stuck.

    Args:
        pair: Changed in place.
        limits: Its limits.
        channel: `P` or `V`.
        unchanged: Whether the channel has the bits of the previous tick.
        partner_step: Motion of the other channel in this tick. In rad.
        threshold: Motion of the other channel from which this one is stuck. In rad.
    """
    if unchanged:
        pair.unchanged_ticks[channel] += 1
        pair.partner_motion[channel] += partner_step
    else:
        pair.unchanged_ticks[channel] = 0
        pair.partner_motion[channel] = 0.0
    stuck = pair.unchanged_ticks[channel] >= _STUCK_TICKS
    stuck = stuck and abs(pair.partner_motion[channel]) > threshold
    if stuck and pair.rejected_for[1 - channel] <= 0.0:
        pair.rejected_for[channel] = limits.hold_time


_SMALL_SPIKE_RATIO = 0.35  # of a small spike's threshold to a clear one's
# A spike adds 1 to a count that decays with `SPIKE_TIME`.
_CLEAR_SPIKE_COUNT_LIMIT = 1.2  # of clear spikes: exceeded by two within 64 ms
_SMALL_SPIKE_COUNT_LIMIT = 2.0  # of small spikes: exceeded by three within 38 ms
_RECENT_SPIKE_COUNT = 0.3  # of small spikes: below it, there was none for 48 ms


@compiled
def _detect_spikes(pair: Pair, limits: PairLimits, ticks: int, velocity: float) -> None:
    """Count spikes of the velocity, and reject it after two clear ones in quick succession."""
    spike = _spike_size(pair, limits, ticks, velocity)
    clear = 1.0 if spike > limits.spike else 0.0
    small = 1.0 if spike > _SMALL_SPIKE_RATIO * limits.spike else 0.0
    pair.spike_counts[_CLEAR] = limits.spike_decay * pair.spike_counts[_CLEAR] + clear
    pair.spike_counts[_SMALL] = limits.spike_decay * pair.spike_counts[_SMALL] + small
    if pair.spike_counts[_CLEAR] > _CLEAR_SPIKE_COUNT_LIMIT:
        pair.rejected_for[V] = limits.hold_time


@compiled
def _spike_size(pair: Pair, limits: PairLimits, ticks: int, velocity: float) -> float:
    """Deviation of the velocity two ticks ago from its neighbours' curve; 0 if it is no spike.

    The curve is the cubic through two samples on each side. Legs that oscillate on their springs,
    with ten samples per period, stay on it. Where a foot is hit, the joint itself leaves it: the
    velocity filter's response to the position then tells that the velocity is right.
    """
    last = pair.last_velocities
    after, middle, before, oldest = last[0], last[1], last[2], last[3]
    deviation: float = abs(middle - (4.0 * (after + before) - velocity - oldest) / 6.0)
    inner, outer = after - before, velocity - oldest
    if abs(inner) > deviation or abs(outer - 2.0 * inner) > deviation:
        return 0.0  # a step, as at a hard landing, or a neighbour's spike
    large = deviation > _SMALL_SPIKE_RATIO * limits.spike
    if large and not limits.averaged and pair.rejected_for[P] <= 0.0:
        residual = 0.0  # of the two steps to which the velocity in question belongs
        for k in (1, 2):
            tick = (ticks - k) % _STEP_HISTORY_TICKS
            residual += pair.step_history[P, tick] - pair.step_history[V, tick]
        # A wrong velocity gives the residual period x deviation, a joint that moved like this 0.
        if abs(residual) < 0.5 * limits.period * deviation:
            return 0.0  # the likelier of the two hypotheses
    return deviation


@compiled
def _check_residual(pair: Pair, limits: PairLimits, ticks: int, tolerance: float) -> bool:
    """Compare the position with the integrated velocity; see `check_pair`.

    The residual is r <- r exp(-period / RESIDUAL_TIME) + position step - velocity step, each step
    as old as the other channel lags. A healthy pair has |r| < residual + residual_by_speed |speed|,
    with the decaying peak of the speed.
    """
    position_step = pair.position_steps[limits.velocity_lag]
    velocity_step = pair.velocity_steps[limits.position_lag]
    pair.residual = pair.residual * limits.residual_decay + position_step - velocity_step
    _update_jump_peak(pair, limits, position_step, velocity_step)
    delayed = _delayed_channel(pair, limits, ticks, velocity_step)
    if delayed == _NO_CHANNEL and _agrees(pair, limits, tolerance):
        pair.undecided_time = 0.0
        return False
    return _isolate_fault(pair, limits, delayed)


@compiled
def _update_jump_peak(
    pair: Pair, limits: PairLimits, position_step: float, velocity_step: float
) -> None:
    """Update the peak of the position's jumps."""
    jump = min(abs(position_step - velocity_step), abs(position_step - pair.last_position_step))
    pair.jump_peak = max(jump, pair.jump_peak * limits.peak_decay)
    pair.last_position_step = position_step


@compiled
def _agrees(pair: Pair, limits: PairLimits, tolerance: float) -> bool:
    """Whether position and integrated velocity agree within the threshold of a healthy pair."""
    threshold = limits.residual + limits.residual_by_speed * pair.speed_peak + tolerance
    return abs(pair.residual) < threshold


_JUMP_PEAK = 0.25 * _JUMP  # rad, of `Pair.jump_peak`, from which a position jumps
_JUMP_CAUSE_RATIO = 0.6  # of a jump to `Pair.residual`, from which the jump is its cause
_AMBIGUITY_RATIO = 0.5  # of smaller to larger evidence, below which the larger one decides
_ALLOWANCE_RATIO = 0.01  # to `PairLimits.evidence`: decrease of each cumulative sum per tick


@compiled
def _delayed_channel(pair: Pair, limits: PairLimits, ticks: int, velocity_step: float) -> int:
    """Channel that repeats the other one's motion after one of `PAIR_DELAYS`, or `_NO_CHANNEL`.

    Cumulative sum test (Page, Biometrika 1954), for each channel and each delay. A tick adds by how
    much the delay explains the motion better than no delay does. The sum stays at or above zero:
    so samples before the delay began do not count, and the first motion after that decides.

    Args:
        pair: Changed in place.
        limits: Its limits.
        ticks: Ticks since the start.
        velocity_step: Integral of the velocity over this tick. In rad.
    """
    expected_step = 0.0  # value of `velocity_step` that the position's steps predict
    for k in range(limits.response_ticks):
        expected_step += limits.response[k] * pair.position_steps[k]
    # A velocity that is not filtered agrees with the newest step.
    newest_step = pair.position_steps[0]
    error = min((expected_step - velocity_step) ** 2, (newest_step - velocity_step) ** 2)
    tick, evidence = ticks % _STEP_HISTORY_TICKS, pair.delay_evidence
    pair.step_history[P, tick], pair.step_history[V, tick] = expected_step, velocity_step
    if error <= _ALLOWANCE_RATIO * limits.evidence and evidence[P] + evidence[V] <= 0.0:
        return _NO_CHANNEL  # each sum would stay zero
    # At constant speed, a channel that is stuck, jumps or has spikes makes the other look delayed.
    spikes = pair.spike_counts[_SMALL] >= _RECENT_SPIKE_COUNT
    jump_threshold = max(_JUMP_PEAK, _JUMP_CAUSE_RATIO * abs(pair.residual))
    jumps = pair.jump_peak > jump_threshold
    velocity_unreliable = pair.unchanged_ticks[V] > 0 or spikes
    position_unreliable = pair.unchanged_ticks[P] > 0 or jumps
    _update_delay_sums(pair, limits, P, tick, error, velocity_unreliable)
    _update_delay_sums(pair, limits, V, tick, error, position_unreliable)
    for channel in range(2):
        larger, smaller = evidence[channel], evidence[1 - channel]
        if larger > limits.evidence and smaller < _AMBIGUITY_RATIO * larger:
            return channel
    return _NO_CHANNEL


_DELAYED_STEP_WEIGHT = 3.0  # of the squared residual that a delay leaves
_MAX_INCREASE_RATIO = 0.25  # to `evidence`: weight of a tick; a landing lasts fewer than five ticks
_SATURATION_RATIO = 4.0  # to `evidence`: saturation of each cumulative sum


@compiled
def _update_delay_sums(
    pair: Pair,
    limits: PairLimits,
    channel: int,
    tick: int,
    undelayed_error: float,
    partner_unreliable: bool,
) -> None:
    """Update the cumulative sums for a channel's delay, and the largest of them.

    With e the squared residual without a delay, e(D) that of the delay D, and E the threshold:

        S(D) <- S(D) + w (e - _DELAYED_STEP_WEIGHT e(D)) - _ALLOWANCE_RATIO E
        w = min(1, _MAX_INCREASE_RATIO E / e),   0 <= S(D) <= _SATURATION_RATIO E

    So a tick with a large error, as at a landing, has a small weight: the share of the error that
    the delay explains counts.

    Args:
        pair: Changed in place.
        limits: Its limits.
        channel: `P` or `V`.
        tick: Index of this tick in `step_history`.
        undelayed_error: Squared residual of the steps without a delay. In rad^2.
        partner_unreliable: Whether the other channel may make this one look delayed.
    """
    step, partner_steps = pair.step_history[channel, tick], pair.step_history[1 - channel]
    allowance = _ALLOWANCE_RATIO * limits.evidence
    largest_error = _MAX_INCREASE_RATIO * limits.evidence
    weight = largest_error / max(undelayed_error, largest_error)
    largest, sums = 0.0, pair.delay_sums[channel]
    for m in range(len(PAIR_DELAYS)):
        earlier = tick - limits.delay_ticks[m]
        error = step - partner_steps[earlier if earlier >= 0 else earlier + _STEP_HISTORY_TICKS]
        increase = weight * (undelayed_error - _DELAYED_STEP_WEIGHT * error * error) - allowance
        if partner_unreliable:
            increase = min(increase, 0.0)
        sums[m] = max(0.0, min(sums[m] + increase, _SATURATION_RATIO * limits.evidence))
        largest = max(largest, sums[m])
    pair.delay_evidence[channel] = largest


_DECISION_TIMEOUT = 0.03  # s, to find which channel of a pair is faulty


@compiled
def _isolate_fault(pair: Pair, limits: PairLimits, delayed: int) -> bool:
    """Reject the faulty channel of a pair that disagrees, or keep the present rejection.

    A delay decides. Other symptoms decide next, and after `_DECISION_TIMEOUT` the likelier channel
    is rejected. Such a rejection is provisional: a delay that is found later corrects it.

    Args:
        pair: Changed in place.
        limits: Its limits.
        delayed: The delayed channel, or `_NO_CHANNEL`.

    Returns:
        Whether the position is accepted again because its rejection was a wrong decision.
    """
    if max(pair.rejected_for[P], pair.rejected_for[V]) <= 0.0:
        pair.provisional = 0
    corrected = delayed != _NO_CHANNEL and pair.provisional > 0
    position_reaccepted = corrected and delayed == V
    if corrected:
        pair.rejected_for[1 - delayed] = 0.0
    if pair.rejected_for[P] > 0.0 or pair.rejected_for[V] > 0.0:
        for channel in range(2):
            if pair.rejected_for[channel] > 0.0:
                pair.rejected_for[channel] = limits.hold_time
        return position_reaccepted
    faulty = delayed if delayed != _NO_CHANNEL else _channel_with_symptom(pair)
    if faulty == _NO_CHANNEL and pair.undecided_time < _DECISION_TIMEOUT:
        pair.undecided_time += limits.period
        return False
    if faulty == _NO_CHANNEL:
        faulty = _likelier_faulty_channel(pair)
    pair.undecided_time, pair.provisional = 0.0, delayed == _NO_CHANNEL
    pair.rejected_for[faulty] = limits.hold_time
    if faulty == P:
        pair.output[P] = pair.position - pair.residual - pair.velocity_steps[0]
    return position_reaccepted


@compiled
def _channel_with_symptom(pair: Pair) -> int:
    """Channel of a pair that disagrees that jumps, has spikes or is stuck; or `_NO_CHANNEL`."""
    if pair.jump_peak > _JUMP_CAUSE_RATIO * abs(pair.residual):
        return P  # also at rest, where the velocity is rightly 0
    if pair.spike_counts[_SMALL] >= _RECENT_SPIKE_COUNT:
        # After fewer spikes, the next one decides.
        return V if pair.spike_counts[_SMALL] > _SMALL_SPIKE_COUNT_LIMIT else _NO_CHANNEL
    position_stuck = pair.unchanged_ticks[P] >= _STUCK_TICKS
    velocity_stuck = pair.unchanged_ticks[V] >= _STUCK_TICKS
    if position_stuck != velocity_stuck:
        return P if position_stuck else V
    return _NO_CHANNEL


@compiled
def _likelier_faulty_channel(pair: Pair) -> int:
    """Likelier faulty channel: by spikes, else by the evidence for delays."""
    if pair.spike_counts[_SMALL] >= _RECENT_SPIKE_COUNT:
        return V
    return P if pair.delay_evidence[P] > pair.delay_evidence[V] else V


@compiled
def substitute_rejected(pair: Pair, limits: PairLimits, powered: int, rest_time: float) -> bool:
    """Set `output`: the measurements, or a substitute for a rejected one.

    The substitute of a position is the integral of the velocity, and that of a velocity is the
    difference of the position.

    Args:
        pair: Changed in place.
        limits: Its limits.
        powered: Whether the robot has power.
        rest_time: Time for which the robot has hung or lain still without power. In s.

    Returns:
        Whether a channel is accepted again.
    """
    if pair.rejected_for[P] > 0.0 and pair.rejected_for[V] > 0.0:
        # A velocity alone is of no use without a position to start from.
        pair.rejected_for[V] = max(pair.rejected_for[P], pair.rejected_for[V])
    position_rejected, velocity_rejected = pair.rejected_for[P] > 0.0, pair.rejected_for[V] > 0.0
    reaccepted = _update_status(pair, powered)
    resting = rest_time > 0.0
    if velocity_rejected:
        confirmed = resting or not (powered or position_rejected)
        _substitute_velocity(pair, limits, position_rejected, confirmed)
    else:
        pair.output[V] = pair.velocity
    if position_rejected:
        confirmed = resting or not (powered or velocity_rejected)
        _substitute_position(pair, limits, velocity_rejected, confirmed)
    else:
        pair.output[P] = pair.position
    return reaccepted


@compiled
def _update_status(pair: Pair, powered: int) -> bool:
    """Update `status` of both channels; whether one of them is accepted again."""
    reaccepted = False
    for channel in range(2):
        if pair.rejected_for[channel] > 0.0:
            if pair.status[channel] == _ACCEPTED:
                pair.status[channel] = _REJECTED
            elif pair.unchanged_ticks[channel] == 0 and not powered:
                pair.status[channel] = _RESPONSIVE
        elif pair.status[channel] != _ACCEPTED:
            pair.status[channel] = _ACCEPTED
            reaccepted = True
    return reaccepted


_SUBSTITUTE_VELOCITY_TIME = 0.004  # s, time constant of the differentiated position
_VELOCITY_TOLERANCE = 0.5  # rad/s, error from which a velocity stays rejected
_FROZEN_VELOCITY_SPEED = 0.1  # rad/s, of the position: a velocity that does not change is wrong


@compiled
def _substitute_velocity(
    pair: Pair, limits: PairLimits, partner_rejected: bool, confirmed: bool
) -> None:
    """Set the velocity's output to the low-passed difference of the position.

    Args:
        pair: Changed in place.
        limits: Its limits.
        partner_rejected: Whether the position is rejected, too: the output then stays.
        confirmed: See `_extend_rejection`.
    """
    difference = pair.position_steps[0] / limits.period
    if not partner_rejected:
        gain = 1.0 - math.exp(-limits.period / _SUBSTITUTE_VELOCITY_TIME)
        last = pair.output[V] if math.isfinite(pair.output[V]) else difference
        pair.output[V] = last + gain * (difference - last)
    frozen = pair.unchanged_ticks[V] >= _STUCK_TICKS and abs(difference) > _FROZEN_VELOCITY_SPEED
    differs = frozen or abs(pair.velocity - pair.output[V]) >= _VELOCITY_TOLERANCE
    _extend_rejection(pair, limits, V, differs, confirmed)


_FROZEN_TICKS = 15  # without a change, after which a noisy signal counts as frozen
_POSITION_TOLERANCE = 0.02  # rad, error from which a position stays rejected
_FROZEN_POSITION_TOLERANCE = 0.002  # rad, error from which a frozen position stays rejected


@compiled
def _substitute_position(
    pair: Pair, limits: PairLimits, partner_rejected: bool, confirmed: bool
) -> None:
    """Integrate the velocity into the position's output.

    Args:
        pair: Changed in place.
        limits: Its limits.
        partner_rejected: Whether the velocity is rejected, too: its own output is then integrated.
        confirmed: See `_extend_rejection`.
    """
    frozen = pair.unchanged_ticks[P] >= _FROZEN_TICKS
    tolerance = _FROZEN_POSITION_TOLERANCE if frozen else _POSITION_TOLERANCE
    step = limits.period * pair.output[V] if partner_rejected else pair.velocity_steps[0]
    pair.output[P] += step
    differs = abs(pair.position - pair.output[P]) >= tolerance  # False for NaN
    _extend_rejection(pair, limits, P, differs, confirmed)


@compiled
def _extend_rejection(
    pair: Pair, limits: PairLimits, channel: int, differs: bool, confirmed: bool
) -> None:
    """Keep a channel rejected while it differs from its substitute.

    After a fall the substitute may stay far off. So without power a channel whose bits change is
    accepted after `REST_TIME` unless something else contradicts it.

    Args:
        pair: Changed in place.
        limits: Its limits.
        channel: `P` or `V`.
        differs: Whether the channel differs from its substitute.
        confirmed: Whether its accepted partner agrees with it, or the robot is at rest.
    """
    if confirmed and pair.status[channel] == _RESPONSIVE:
        pair.rejected_for[channel] = min(pair.rejected_for[channel], REST_TIME)
    elif differs:
        pair.rejected_for[channel] = limits.hold_time


def _joint_filter_delay() -> float:
    """Group delay of `robot.JOINT_VELOCITY_FILTER` at 0 Hz, to 0.1 ms. In s.

    With the encoder's period T and the coefficients b_k of angles and a_k of past velocities:

        T (sum of k^2 b_k / (2 sum of k b_k) - sum of k a_k / (1 + sum of a_k))

    Source:
        The filter's transfer function, expanded to first order in the frequency.
    """
    forward, back = (np.array(taps) for taps in robot.JOINT_VELOCITY_FILTER)
    k, m = np.arange(len(forward)), 1 + np.arange(len(back))
    delay = 0.5 * (k * k @ forward) / (k @ forward) - (m @ back) / (1.0 + back.sum())
    return round(float(delay) / robot.ENCODER_RATE, 4)


JOINT_FILTER_DELAY = _joint_filter_delay()

# Set by hand above what healthy sensors show in recorded walks, pushes and landings. Columns: hip
# roll, hip yaw, hip pitch, knee and toe drive; shin, tarsus and toe joint; an axis of the IMU.
_LIMITS = {
    "still_speed": ([1.0] * 5, [1.0] * 3, 0.1),  # legs swing when it hangs
    "residual": ([0.004, 0.004, 0.006, 0.008, 0.008], [0.008, 0.008, 0.01], 0.005),
    # The joints' threshold also holds for a velocity that no filter delays.
    "residual_by_speed": ([0.001] * 5, [JOINT_FILTER_DELAY] * 3, 0.002),
    "spike": ([0.5, 0.5, 0.6, 1.2, 5.5], [0.9, 0.9, 1.5], 0.25),
    "evidence": ([4e-7, 4e-7, 6e-7, 6e-7, 1.2e-6], [4e-7, 8e-7, 5e-7], 1e-6),
}


def set_pair_limits(
    period: float, attitude_delay: float, hold_time: float, limits: RecordArray
) -> None:
    """Set the limits of each pair: values that no healthy sensor exceeds, with a margin.

    Args:
        period: Time between samples. In s.
        attitude_delay: Delay of the IMU's orientation. In s.
        hold_time: Time for which a channel stays rejected after its last fault. In s.
        limits: Result, records of `PairLimits`. Shape (19,).
    """
    limits["period"], limits["hold_time"], limits["averaged"][IMU_PAIRS] = period, hold_time, 1
    limits["peak_decay"] = math.exp(-period / _PEAK_TIME)
    limits["residual_decay"] = math.exp(-period / RESIDUAL_TIME)
    limits["spike_decay"] = math.exp(-period / SPIKE_TIME)
    _set_position_ranges(limits)
    for name, (of_leg_drives, of_leg_joints, of_imu) in _LIMITS.items():
        limits[name][DRIVE_PAIRS] = np.tile(of_leg_drives, len(LEGS))
        limits[name][JOINT_PAIRS] = np.tile(of_leg_joints, len(LEGS))
        limits[name][IMU_PAIRS] = of_imu
    _set_delays(period, attitude_delay, limits)


_RANGE_MARGIN = 0.2  # rad beyond the stops


def _set_position_ranges(limits: RecordArray) -> None:
    """Set the ranges of the positions: the mechanical stops of drives and joints, with a margin."""
    limits["low"], limits["high"] = -math.inf, math.inf
    for i, leg in enumerate(LEGS):
        stops = robot.stops(leg)
        for first, names in (
            (len(LEG_DRIVES) * i, LEG_DRIVES),
            (FIRST_JOINT + len(LEG_SENSED_JOINTS) * i, LEG_SENSED_JOINTS),
        ):
            for k, name in enumerate(names):
                low, high = stops[name]
                limits["low"][first + k] = low - _RANGE_MARGIN
                limits["high"][first + k] = high + _RANGE_MARGIN


_DRIVE_NOISE_WEIGHT, _JOINT_NOISE_WEIGHT = 0.2, 2.5  # of encoders, relative to one frequency


def _set_delays(period: float, attitude_delay: float, limits: RecordArray) -> None:
    """Set the tested delays, the velocity filters' responses and the lags, all in ticks."""
    ticks = [max(1, min(_STEP_HISTORY_TICKS - 1, round(delay / period))) for delay in PAIR_DELAYS]
    limits["delay_ticks"] = ticks
    limits["response"][:, 0], limits["response_ticks"] = 1.0, 1  # a gyro has no filter
    for pairs, filters in (
        (DRIVE_PAIRS, (_DRIVE_NOISE_WEIGHT, robot.DRIVE_VELOCITY_FILTER)),
        (JOINT_PAIRS, (_JOINT_NOISE_WEIGHT, *robot.JOINT_VELOCITY_FILTER)),
    ):
        weights = velocity_response(period, *filters)
        limits["response"][pairs, : len(weights)] = weights
        limits["response_ticks"][pairs] = len(weights)
    limits["velocity_lag"][JOINT_PAIRS] = min(2, round(JOINT_FILTER_DELAY / period))
    limits["position_lag"][IMU_PAIRS] = min(2, round(attitude_delay / period))


_MAX_FREQUENCY = 100.0  # Hz, highest frequency to which a velocity filter's response is fitted
_MAX_FREQUENCY_RATIO = 0.2  # of the highest frequency that samples resolve to their rate
_CONSTANT_VELOCITY_WEIGHT = 1e3  # relative to one frequency


def velocity_response(
    period: float, noise: float, forward: Sequence[float], back: Sequence[float] = ()
) -> FloatArray:
    """Weights with which the last steps of a position predict its filtered velocity.

    Least-squares fit to the filter's frequency response up to `_MAX_FREQUENCY`, which covers the
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
    ticks = max(1, round(period * robot.ENCODER_RATE))  # of the encoder in a sample
    samples = max(2, _RESPONSE_TICKS // ticks if back else 1 - (-len(forward) // ticks))
    frequency = np.linspace(0.0, min(_MAX_FREQUENCY, _MAX_FREQUENCY_RATIO / period), 200)[1:]
    tick_delay = np.exp(-2j * math.pi * frequency / robot.ENCODER_RATE)
    velocity = sum(b * tick_delay**k for k, b in enumerate(forward))
    velocity /= 1.0 + sum(a * tick_delay**k for k, a in enumerate(back, 1))
    sample_delay = tick_delay**ticks
    response = 0.5 * period * (1.0 + sample_delay) * velocity / (1.0 - sample_delay)
    delays = sample_delay[:, None] ** np.arange(samples)
    first_moment = -sum(k * b for k, b in enumerate(forward)) / robot.ENCODER_RATE
    gain = first_moment / (1.0 + sum(back))  # of a constant velocity
    differences = np.diff(np.eye(samples), axis=0, prepend=0.0, append=0.0)  # angle: in two steps
    constant_velocity = np.full((1, samples), _CONSTANT_VELOCITY_WEIGHT)
    rows = [delays.real, delays.imag, constant_velocity, noise * differences]
    values = [
        response.real,
        response.imag,
        [_CONSTANT_VELOCITY_WEIGHT * gain],
        np.zeros(samples + 1),
    ]
    weights: FloatArray = np.linalg.lstsq(np.vstack(rows), np.hstack(values))[0]
    return weights
