"""Health of computer and battery for the supervisor: missed control ticks, the charge."""

from __future__ import annotations

from collections import deque

from cassie_control.supervisor.config import SupervisorConfig
from cassie_msgs.layout import RobotState

_REPORT_WINDOW = 60.0  # s, over which the share of missed ticks is reported
_DECISION_WINDOW = 1.0  # s, over which the share of missed ticks decides


class TickLoss:
    """Share of the control ticks for which no new command came in time.

    Attributes:
        share: Share over the last minute, 0..1.
        recent: Share over the last second, 0..1.
    """

    def __init__(self, period: float) -> None:
        self._ticks: deque[tuple[int, int]] = deque(maxlen=round(_REPORT_WINDOW / period) + 1)
        self._recent: deque[tuple[int, int]] = deque(maxlen=round(_DECISION_WINDOW / period) + 1)
        self.share = self.recent = 0.0

    def step(self, state: RobotState) -> None:
        """Update with a state."""
        if not int(state.wall_paced):
            return
        now = (int(state.seq), int(state.missed_ticks))
        self._ticks.append(now)
        self._recent.append(now)
        self.share, self.recent = _missed_share(self._ticks), 0.0
        if 2 * len(self._recent) > (self._recent.maxlen or 0):  # a few ticks give no reliable share
            self.recent = _missed_share(self._recent)


def _missed_share(ticks: deque[tuple[int, int]]) -> float:
    (first, missed_before), (last, missed) = ticks[0], ticks[-1]
    return (missed - missed_before) / (last - first) if last > first else 0.0


class Battery:
    """Thresholds of the battery's charge, with hysteresis.

    Attributes:
        low: Whether the robot should stop to be charged.
        empty: Whether the robot stops and sits down; stays so until the battery is charged.
    """

    def __init__(self) -> None:
        self.low = self.empty = False

    def step(self, state: RobotState, config: SupervisorConfig) -> None:
        """Update with a state; an unknown charge changes nothing."""
        charge = float(state.battery_charge)
        if charge <= 0.0:
            return
        margin = config.battery_margin
        self.low = charge < config.battery_low + (margin if self.low else 0.0)
        self.empty = charge < config.battery_empty + (margin if self.empty else 0.0)

    def fault(self, state: RobotState) -> str:
        """What is wrong, in words; empty if nothing is."""
        percent = f"battery at {100.0 * float(state.battery_charge):.0f} %"
        if self.empty:
            return f"{percent}: stopping and sitting down"
        return f"{percent}: stop and charge it" if self.low else ""
