"""Simulated rider: an operator who watches the robot on a Segway and commands its lean."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from cassie_msgs.experiment.script import Gates, RiderScript, Target
from cassie_teleop.sight import Sight

_SUM_X, _SUM_Y = 0.06, 0.08  # m, bounds of the integrated errors
_LOW_PASS_WEIGHT = 0.2  # of a new measurement of the speed, for steering
_MAX_TURN = 1.0  # rad/s, bound of the turn rate by heading error
_NS = 1e9


class Rider:
    """Leans that control speed and path, from delayed measurements.

    At each decision, v is the measured speed (noisy; low-passed for com_y) and r the turn rate from
    two measured headings. v* is a ramp towards the commanded speed, as it was `delay` plus
    `speed_wait` ago, and a* the ramp's present slope:

        com_x = lean a* + speed_gain (v* - v) + speed_sum * integral of (v* - v),
        com_y = turn_lean (1 + |v| / 2) (r* + turn_gain (r* - r) + turn_sum * integral of (r* - r)),

    The first integral is updated only while v* is constant. r* is the commanded turn rate, or
    heading_gain times the heading error, within 1 rad/s. The path through gates is a cosine of the
    distance along the heading at which the gates were commanded. There the law looks ahead:

        com_y = turn_lean (1 + |v| / 2) (k + turn_time dk/dt + turn_gain (k0 - r)
                + slope_gain * error of heading + side_gain * distance + side_sum * its integral),

    k is the path's turn rate at the place where the robot will be `turn_wait` from now, k0 the turn
    rate at its measured place.

    Args:
        script: Settings and targets of the rider.
    """

    def __init__(self, script: RiderScript) -> None:
        self._script = script
        self.period_ns = round(_NS / script.rate)
        self._delay_ns = round(_NS * script.delay)
        self.begins_ns = round(_NS * script.targets[0].t)
        self.reset()

    def reset(self) -> None:
        """Begin a new episode."""
        self._rng = np.random.default_rng(self._script.seed)
        self._look = -1
        self._next = 0
        self._target = Target(t=0.0)
        self._wanted = 0.0
        wait = self._delay_ns + round(_NS * self._script.speed_wait)
        self._before: deque[float] = deque(maxlen=1 + round(wait / self.period_ns))
        self._sums = [0.0, 0.0]
        self._last: Sight | None = None
        self._start: Sight | None = None
        self.lean = (0.0, 0.0)
        """CoM shift, forward and to the left. In m."""
        self.speed = self.turn = 0.0
        """Present set-points of speed and turn rate. In m/s and rad/s."""
        self._seen = 0.0

    def needs(self, stamp_ns: int) -> int | None:
        """Stamp of the measurement for a decision at a time; None if none is due. In ns."""
        look = stamp_ns // self.period_ns
        seen = (stamp_ns - self._delay_ns) // self.period_ns * self.period_ns
        due = look > self._look and stamp_ns >= self.begins_ns and seen >= 0
        return seen if due else None

    def decide(self, stamp_ns: int, sight: Sight) -> None:
        """Set the attributes from a measurement.

        Args:
            stamp_ns: Present time. In ns.
            sight: The measurement, `delay` old.
        """
        self._look = stamp_ns // self.period_ns
        self._take_targets(stamp_ns, sight)
        self.lean = (self._lean_x(sight), self._lean_y(sight))
        self._last = sight

    def _take_targets(self, stamp_ns: int, sight: Sight) -> None:
        targets = self._script.targets
        while self._next < len(targets) and targets[self._next].t * _NS <= stamp_ns:
            new = targets[self._next]
            self._next += 1
            if new.speed is not None:
                self.speed = new.speed
            if any(way is not None for way in (new.heading, new.turn, new.gates)):
                self._target = new
                self._start = sight

    def _lean_x(self, sight: Sight) -> float:
        c, period = self._script, self.period_ns / _NS
        seen = sight.speed + float(self._rng.uniform(-c.noise, c.noise))
        self._seen += _LOW_PASS_WEIGHT * (seen - self._seen)
        away = self.speed - self._wanted
        slows = abs(self.speed) < abs(self._wanted) or self.speed * self._wanted < 0.0
        most = (c.braking if slows else c.acceleration) * period
        step = max(-most, min(most, away))
        self._wanted += step
        self._before.append(self._wanted)
        error = self._before[0] - seen
        if self._before[0] == self._wanted:  # the lag during a ramp must not be integrated
            self._sums[0] = _bounded(self._sums[0] + c.speed_sum * period * error, _SUM_X)
        return c.lean * step / period + c.speed_gain * error + self._sums[0]

    def _lean_y(self, sight: Sight) -> float:
        c, period = self._script, self.period_ns / _NS
        rate = _wrapped(sight.heading - (self._last or sight).heading) / period
        gates = self._target.gates
        if gates is not None and self._start is not None:
            return self._through(gates, self._start, sight, rate)
        self.turn = self._turn(sight)
        error = self.turn - rate
        lean = self._lean_of_turn()
        self._sums[1] = _bounded(self._sums[1] + lean * c.turn_sum * period * error, _SUM_Y)
        return lean * (self.turn + c.turn_gain * error) + self._sums[1]

    def _lean_of_turn(self) -> float:
        """CoM y by turn rate, at the low-passed speed. In m/(rad/s)."""
        return self._script.turn_lean * (1.0 + 0.5 * abs(self._seen))

    def _turn(self, sight: Sight) -> float:
        """Set-point of the turn rate. In rad/s."""
        target = self._target
        if target.turn is not None:
            return target.turn
        error = _wrapped((target.heading or 0.0) - sight.heading)
        return _bounded(self._script.heading_gain * error, _MAX_TURN)

    def _through(self, gates: Gates, start: Sight, sight: Sight, rate: float) -> float:
        c = self._script
        cos, sin = math.cos(start.heading), math.sin(start.heading)
        dx, dy = sight.x - start.x, sight.y - start.y
        along, left = cos * dx + sin * dy, cos * dy - sin * dx
        ahead = along + (c.delay + c.turn_wait) * self._seen
        # The path's turn rate at that place, and 0.1 s later.
        step = 0.1
        turn, later = (self._seen * curvature(gates, ahead + t * self._seen) for t in (0.0, step))
        self.turn = turn
        lean, aside = self._lean_of_turn(), way(gates, along) - left
        summed = lean * c.side_sum * self.period_ns / _NS * aside
        self._sums[1] = _bounded(self._sums[1] + summed, _SUM_Y)
        wanted = turn + c.turn_time * (later - turn) / step
        wanted += c.turn_gain * (self._seen * curvature(gates, along) - rate)
        wanted += c.slope_gain * _wrapped(slope(gates, along) - sight.heading + start.heading)
        return lean * (wanted + c.side_gain * aside) + self._sums[1]


def way(gates: Gates, along: float) -> float:
    """Offset of the path through the gates to the left. In m."""
    beyond = gates.first + gates.spacing * gates.count
    if not 0.0 < along < beyond:
        return 0.0
    share = min(1.0, along / max(gates.first, 1e-3), (beyond - along) / gates.spacing)
    share *= share * (3.0 - 2.0 * share)
    return gates.offset * share * math.cos(math.pi * (along - gates.first) / gates.spacing)


def slope(gates: Gates, along: float) -> float:
    """Heading of the path, to the left. In rad."""
    step = 0.05 * gates.spacing
    return math.atan2(way(gates, along + step) - way(gates, along - step), 2.0 * step)


def curvature(gates: Gates, along: float) -> float:
    """Curvature of the path, to the left. In 1/m."""
    step = 0.05 * gates.spacing
    before, here, after = (way(gates, along + k * step) for k in (-1.0, 0.0, 1.0))
    return (before - 2.0 * here + after) / step**2


def _bounded(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
