"""Arithmetic of the learned torques, compiled: what `torque_learning` does each tick and step."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

STANCE_HIP_PITCH, SWING_HIP_PITCH = 2, 7
"""Rows of the table."""

_BACK = 3.0  # 1/(m/s), by which the stance hip takes more of the swing hip's torques, up to all


@compiled
def _place(values: FloatArray, x: float) -> tuple[int, float]:
    """Index of the point below `x`, and the share of the way to the next; clamped."""
    last = values.size - 1
    if last == 0 or x <= values[0]:
        return 0, 0.0
    i = 0
    while i < last and values[i + 1] <= x:
        i += 1
    if i == last:
        return last - 1, 1.0
    return i, (x - values[i]) / (values[i + 1] - values[i])


@compiled
def _phase_place(points: int, phase: float) -> tuple[int, float]:
    """The same among evenly spaced phases from 0 to 1."""
    x = max(0.0, min(1.0, phase)) * (points - 1)
    i = min(points - 2, int(x))
    return i, x - i


@compiled
def _value(
    table: FloatArray, speed: tuple[int, float, int], j: int, phase: tuple[int, float]
) -> float:
    """The table's torque of a joint between its speeds and phases, each as `_place` gives it."""
    s, to_speed, after = speed
    p, to_phase = phase
    low = table[s, j, p] + to_phase * (table[s, j, p + 1] - table[s, j, p])
    high = table[after, j, p] + to_phase * (table[after, j, p + 1] - table[after, j, p])
    value: float = low + to_speed * (high - low)
    return value


@compiled
def add(
    table: FloatArray,
    speeds: FloatArray,
    now: tuple[float, float, float, float],
    loads: tuple[float, float],
    mirrored: bool,
    fresh: bool,
    added: FloatArray,
    gaps: FloatArray,
    torque: FloatArray,
) -> None:
    """Add the table's torques.

    Args:
        table: Shape (s, 10, n), in Nm.
        speeds: Shape (s,), in m/s.
        now: Phase, speed, the share that is left of the last step's torques, and that of all.
        loads: Load of the stance leg, and how far the swing foot is free.
        mirrored: Whether the right leg stands.
        fresh: Whether a step begins.
        added: What was added at the last tick, by drive; what is added now. Shape (10,), in Nm.
        gaps: What this step began away from its own torques. Shape (10,), in Nm.
        torque: Of the command. Shape (10,), in Nm.
    """
    s, to_speed = _place(speeds, now[1])
    p, to_phase = _phase_place(table.shape[2], now[0])
    after = min(s + 1, speeds.size - 1)
    carried = loads[1] * max(0.0, min(1.0, -_BACK * now[1]))
    for j in range(10):
        value = _value(table, (s, to_speed, after), j, (p, to_phase))
        stands = j < 5
        if j == STANCE_HIP_PITCH:  # takes the torso's part of what swings the leg to the ground
            value -= carried * _value(table, (s, to_speed, after), SWING_HIP_PITCH, (p, to_phase))
        if stands:
            value *= loads[0]
        else:
            value *= loads[1]
        drive = j
        if mirrored:
            drive = j + 5 if stands else j - 5
            if j % 5 < 2:
                value = -value
        if fresh:
            gaps[drive] = added[drive] - value
        value += now[2] * gaps[drive]
        added[drive] = value
        torque[drive] += now[3] * value


@compiled
def notice(
    sums: FloatArray,
    counts: FloatArray,
    weights: FloatArray,
    speeds: FloatArray,
    at: tuple[float, float, float],
    mirrored: bool,
    q: FloatArray,
    v: FloatArray,
    command: FloatArray,
    drives: IntArray,
    limits: FloatArray,
) -> None:
    """Add up the torques of the drives' loops around a phase and speed.

    Args:
        sums: Shape (s, 10, n), in Nm.
        counts: Shape (n,).
        weights: Of the speeds. Shape (s,).
        speeds: Shape (s,), in m/s.
        at: Phase, speed, and how far the swing foot is free, which is what this tick counts.
        mirrored: Whether the right leg stands.
        q, v: Of the state. Shape (20,), in rad and rad/s.
        command: Torque, position, velocity, kp and kd of the drives. Shape (50,).
        drives: Index of each drive in q. Shape (10,).
        limits: That count at most. Shape (10,), in Nm.
    """
    s, to_speed = _place(speeds, at[1])
    p, to_phase = _phase_place(counts.size, at[0])
    after = min(s + 1, speeds.size - 1)
    here, ahead = at[2] * (1.0 - to_phase), at[2] * to_phase
    weights[s] += at[2] * (1.0 - to_speed)
    weights[after] += at[2] * to_speed
    counts[p] += here
    counts[p + 1] += ahead
    for j in range(10):
        drive, sign = j, 1.0
        if mirrored:
            drive = (j + 5) % 10
            if j % 5 < 2:
                sign = -1.0
        k = drives[drive]
        loop = command[30 + drive] * (command[10 + drive] - q[k])
        loop += command[40 + drive] * (command[20 + drive] - v[k])
        loop = sign * max(-limits[j], min(limits[j], loop))
        sums[s, j, p] += loop * (1.0 - to_speed) * here
        sums[s, j, p + 1] += loop * (1.0 - to_speed) * ahead
        sums[after, j, p] += loop * to_speed * here
        sums[after, j, p + 1] += loop * to_speed * ahead


@compiled
def teach(
    table: FloatArray,
    sums: FloatArray,
    counts: FloatArray,
    weights: FloatArray,
    limits: FloatArray,
    gains: FloatArray,
    how: tuple[float, float],
) -> None:
    """Learn from a step.

    Args:
        table: Changed. Shape (s, 10, n), in Nm.
        sums, counts, weights: As `notice` left them.
        limits: Of the table. Shape (10,), in Nm.
        gains: Share of the loops' torque that is learned. Shape (10,).
        how: leak and smoothing.
    """
    leak, smoothing = how
    points = counts.size
    first, last = -1, -1
    for p in range(points):
        if counts[p] > 0.5:
            first = p if first < 0 else first
            last = p
    if first < 0:
        return
    for s in range(table.shape[0]):
        share = weights[s] / weights.sum()
        for j in range(10):
            row, gain = table[s, j], gains[j]
            before = row[0]
            for p in range(points):
                here = row[p]
                bend = before - 2.0 * here + row[min(p + 1, points - 1)]
                change = share * (0.25 * smoothing * bend - leak * here)
                if p < first or p > last:  # as where it was on one foot
                    change += share * gain * (row[first if p < first else last] - here)
                elif counts[p] > 0.5:
                    change += gain * sums[s, j, p] / counts[p]
                before = here
                row[p] = max(-limits[j], min(limits[j], here + change))
