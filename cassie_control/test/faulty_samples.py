"""Recorded samples in which a channel fails, and what a monitored estimator says of them."""

from __future__ import annotations

import numpy as np
from closed_loop import PERIOD

from cassie_control.estimator.choice import make_monitored
from cassie_control.estimator.config import EstimatorConfig
from cassie_msgs.layout import Sensors

LIMITS = {"position": 0.03, "velocity": 0.3, "acceleration": 3.0}
SPIKES = {"position": 0.1, "velocity": 2.0, "acceleration": 10.0}
IN_TIME = 50  # ticks of 2 ms


def monitored():
    return make_monitored(EstimatorConfig(), PERIOD)


def samples(robot, skip):
    """Fields of the recorded samples from a tick on, a row each; they may be written."""
    raw = bytearray(b"".join(moment.sample for moment in robot.moments[skip:]))
    return np.frombuffer(raw, Sensors.DTYPE)


def spoil(rows, channel, kind, start):
    """Let a channel fail from a row on, or come so many ticks late; where it is out of bounds."""
    field, _, index = channel.partition(".")
    values = rows[field][:, int(index)]
    true, what = values.copy(), field.rpartition("_")[2]
    if kind == "off":
        values[start:] = 0.0
    elif kind == "stuck":
        values[start:] = values[start]
    elif kind == "nan":
        values[start:] = np.nan
    elif kind == "spike":
        values[start::5] += SPIKES[what]
    else:
        late = 10 if kind == "delay" else kind
        values[start:] = true[start - late : -late]
    error = np.abs(values - true)
    return np.flatnonzero(~(error <= LIMITS[what]))


def reports(rows, come=None):
    """First row of each reported channel by its name, of the rows that come."""
    core, sample, first = monitored(), Sensors(), {}
    raw, size = rows.tobytes(), Sensors.SIZE
    for k in range(len(rows)) if come is None else np.flatnonzero(come):
        sample.load(raw[k * size : (k + 1) * size])
        core.step(sample)
        for name in core.faults:
            first.setdefault(name.partition(" ")[0], k)
    return first
