"""Recorded samples in which a channel fails, and what a monitored estimator says of them."""

from __future__ import annotations

import numpy as np
from closed_loop import PERIOD

from cassie_control.errors import SensorError
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
    return _reports(monitored(), rows, range(len(rows)) if come is None else np.flatnonzero(come))


def _reports(core, rows, come):
    sample, first = Sensors(), {}
    raw, size = rows.tobytes(), Sensors.SIZE
    for k in come:
        sample.load(raw[k * size : (k + 1) * size])
        core.step(sample)
        for name in core.faults:
            first.setdefault(name.partition(" ")[0], int(k))
    return first


class Restorable:
    """State of an object, with that of all objects and arrays that it holds, to be restored."""

    def __init__(self, thing):
        self._known, self._arrays, self._attributes = {}, [], []
        self._save(thing)

    def _save(self, thing):
        if id(thing) in self._known or isinstance(thing, type):
            return
        self._known[id(thing)] = thing
        if isinstance(thing, np.ndarray):
            self._arrays.append((thing, thing.copy()))
        elif isinstance(thing, (list, tuple, dict)):
            assert isinstance(thing, tuple) or not thing or self._is_fixed(thing)
            for part in thing.values() if isinstance(thing, dict) else thing:
                self._save(part)
        elif hasattr(thing, "__dict__"):
            self._attributes.append((thing.__dict__, thing.__dict__.copy()))
            for part in thing.__dict__.values():
                self._save(part)

    @staticmethod
    def _is_fixed(container):
        """Whether a list or dictionary holds objects only, which stay where they are."""
        parts = container.values() if isinstance(container, dict) else container
        return all(isinstance(p, np.ndarray | np.generic) or hasattr(p, "__dict__") for p in parts)

    def restore(self):
        """Give everything the values that it had."""
        for array, values in self._arrays:
            array[...] = values
        for attributes, values in self._attributes:
            attributes.clear()
            attributes.update(values)


class AfterHealthyRows:
    """A monitored estimator that has had healthy rows; every failure begins with its state then."""

    def __init__(self, rows):
        self._core, self._start = monitored(), len(rows)
        self._first = _reports(self._core, rows, range(len(rows)))
        self._state = Restorable(self._core)

    def reports(self, rows):
        """Like `reports`; 0 for the reason where there is no estimate any more.

        Args:
            rows: Those that it has had, and more.
        """
        self._state.restore()
        return self._rest(rows) | self._first

    def _rest(self, rows):
        try:
            return _reports(self._core, rows, range(self._start, len(rows)))
        except SensorError as error:
            return {str(error): 0}
