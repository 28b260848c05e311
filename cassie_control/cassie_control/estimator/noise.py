"""What healthy sensors say: a velocity filter's answer to its positions, and the noise left over.

The residual of a pair is the turn within a tick by its measured velocity, less the turn that the
filter must give for the measured positions. Healthy, it has two causes: errors of the encoder,
which the filter lets through, and motions that are too quick for the samples to show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot

FloatArray = npt.NDArray[np.float64]

RESPONSE_TIME = 0.018
"""For which the joints' velocity filter answers a step of the position. In s."""

_FASTEST = 100.0  # Hz, of the motions by which it is known what a velocity filter answers
_SAMPLED = 0.2  # of the rate of the samples, beyond which they do not show them
_EVEN = 1e3  # weight of an even motion, by one of these


def velocity_response(
    period: float, noise: float, forward: Sequence[float], back: Sequence[float] = ()
) -> FloatArray:
    """What the steps of a position say that the filtered velocity is.

    Fitted to the filter's answer to all motions up to `_FASTEST`, such as the legs' springs ring
    with; an even motion is expected as it is.

    Args:
        period: Between samples. In s.
        noise: Of the angles, by the size of motions of which any frequency must be expected.
        forward: Filter by positions, newest first. In 1/s.
        back: By velocities, to be taken off.

    Returns:
        Shares of the last steps, newest first, of which the sum is what the newest velocity and the
        one before it say together (trapezoidal rule). Shape (n,).
    """
    ticks = _ticks(period)
    longest = round(RESPONSE_TIME * robot.ENCODER_RATE)
    samples = max(2, longest // ticks if back else 1 - (-len(forward) // ticks))
    frequency = np.linspace(0.0, min(_FASTEST, _SAMPLED / period), 200)[1:]
    late = np.exp(-2j * math.pi * frequency / robot.ENCODER_RATE)  # by a tick of the encoders
    velocity = sum(b * late**k for k, b in enumerate(forward))
    velocity /= 1.0 + sum(a * late**k for k, a in enumerate(back, 1))
    step = late**ticks  # by a sample
    answer = 0.5 * period * (1.0 + step) * velocity / (1.0 - step)
    shares = step[:, None] ** np.arange(samples)
    moments = -sum(k * b for k, b in enumerate(forward)) / robot.ENCODER_RATE
    even = moments / (1.0 + sum(back))
    between = np.diff(np.eye(samples), axis=0, prepend=0.0, append=0.0)  # two steps, each angle
    rows = [shares.real, shares.imag, np.full((1, samples), _EVEN), noise * between]
    values = [answer.real, answer.imag, [_EVEN * even], np.zeros(samples + 1)]
    fitted: FloatArray = np.linalg.lstsq(np.vstack(rows), np.hstack(values))[0]
    return fitted


def residual_gain(
    period: float,
    response: FloatArray,
    forward: Sequence[float],
    back: Sequence[float] = (),
) -> float:
    """What of the errors of a healthy encoder is left in the residual of its pair.

    Args:
        period: Between samples. In s.
        response: By `velocity_response`. Shape (n,).
        forward: Filter by positions, newest first. In 1/s.
        back: By velocities, to be taken off.

    Returns:
        Standard deviation of the residual by that of white errors of the angle.
    """
    ticks = _ticks(period)
    count = ticks * (2 * len(response) + 8)
    position, velocity, square = np.zeros(count), np.zeros(count), 0.0
    position[0] = 1.0
    for n in range(count):
        velocity[n] = sum(b * position[n - k] for k, b in enumerate(forward) if k <= n)
        velocity[n] -= sum(a * velocity[n - k] for k, a in enumerate(back, 1) if k <= n)
    for phase in range(ticks):
        sampled, steps = velocity[phase::ticks], np.diff(position[phase::ticks], prepend=0.0)
        turn = 0.5 * period * (sampled + np.concatenate([[0.0], sampled[:-1]]))
        residual = turn - np.convolve(steps, response)[: len(steps)]
        square += float(residual @ residual)
    return math.sqrt(square)


def encoder_error(bits: int, gear: float = 1.0, noise: float = 0.0) -> float:
    """Standard deviation of an encoder's angle: rounding to counts, and noise. In rad.

    Args:
        bits: Of a turn of the encoder.
        gear: Turns of the encoder by those of the joint.
        noise: In rad.
    """
    return math.hypot(2.0 * math.pi / (2**bits * gear) / math.sqrt(12.0), noise)


def _ticks(period: float) -> int:
    """Of the encoders in a sample."""
    return max(1, round(period * robot.ENCODER_RATE))
