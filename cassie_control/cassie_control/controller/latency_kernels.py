"""Which command of the past explains the torques of the drives, compiled; see `command_latency`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_control.controller.records import RecordArray
from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]


@compiled
def weigh_rows(
    states: RecordArray,
    sent: FloatArray,
    head: int,
    known: int,
    seen: FloatArray,
    later: float,
    scale: FloatArray,
    share: float,
    errors: FloatArray,
) -> int:
    """Average what each latency leaves unexplained.

    Args:
        states: `RobotState.record`: the drives and what they report now. Shape (1,).
        sent: Ring of commands: torque, position, velocity, kp, kd of the ten drives. Shape (n, 50).
        head: Row of the newest, which answered the state before this one.
        known: How many have been sent since the record began.
        seen: Angles and rates of the drives at the last ticks, the oldest first; brought up to
            date. Shape (m, 2, 10).
        later: How much later than the oldest of them the reported torques were set. In ticks.
        scale: 1 by the largest torque of each drive. Shape (10,), in 1/Nm.
        share: Of a new value in the averages.
        errors: Averages, the last one of the reported torques themselves; changed. Shape (n + 1,).

    Returns:
        How many commands ago is explained best, or -1 while less is known than they look back.
    """
    state = states[0]
    reported = state.drive_torque
    last = seen.shape[0] - 1
    for k in range(last):
        seen[k] = seen[k + 1]
    for i in range(10):
        leg, drive = i // 5, i % 5
        joint = 6 + 7 * leg + (6 if drive == 4 else drive)
        seen[last, 0, i], seen[last, 1, i] = state.q[joint], state.v[joint]
    rows = sent.shape[0]
    if known < rows + last:
        return -1
    total = 0.0
    for i in range(10):
        total += (scale[i] * reported[i]) ** 2
    errors[rows] += share * (total - errors[rows])
    best = 0
    for row in range(rows):
        command, error = sent[(head - row) % rows], 0.0
        for i in range(10):
            angle = (1.0 - later) * seen[0, 0, i] + later * seen[1, 0, i]
            rate = (1.0 - later) * seen[0, 1, i] + later * seen[1, 1, i]
            u = command[i] + command[30 + i] * (command[10 + i] - angle)
            u += command[40 + i] * (command[20 + i] - rate)
            u = scale[i] * u
            difference = max(-1.0, min(1.0, u)) - scale[i] * reported[i]
            error += difference * difference
        errors[row] += share * (error - errors[row])
        if errors[row] < errors[best]:
            best = row
    return best
