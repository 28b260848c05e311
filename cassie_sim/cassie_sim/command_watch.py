"""Monitor of motor commands: reports once when they are missing and once when they are back."""

from __future__ import annotations

from cassie_msgs.layout import MotorCommand
from cassie_sim.lane import Lane, Report
from cassie_sim.plant import COMMAND_WATCHDOG

_NEWS_PERIOD = 1.0  # s of robot time; repeated short stops within it are reported once


class CommandWatch:
    """Records received and missed commands.

    Args:
        lane: Lane on which commands come.
        report: Called with each report.
        start_timeout: Time-out for the first command. In s.
        tick: Length of a control tick. In s.
    """

    def __init__(self, lane: Lane, report: Report, start_timeout: float, tick: float) -> None:
        self._lane, self._report = lane, report
        self._start_timeout, self._tick = start_timeout, tick
        self._ever = False
        self._silent = False
        self.restart()

    def restart(self) -> None:
        """Begin a new episode."""
        self._applied = -1
        self._last_silence = 0

    @property
    def start_timeout(self) -> float:
        """Time added to the usual time-outs of other nodes until the first command. In s."""
        return 0.0 if self._ever else self._start_timeout

    def come(self) -> None:
        """Take in that a command has come."""
        if self._silent or not self._ever:
            self._ever = True
            self._silent = False
            self._report("command", None)

    def missed(self, tick: int, silence: float) -> None:
        """Take in that the command for a tick is missing, after waiting `silence` s."""
        if self._silent or silence < self.start_timeout:
            return
        self._silent = True
        missing = self._lane.missing()
        reason = f" ({missing})" if missing else ""
        self._report("command", f"no motor command for tick {tick} since {silence:.2g} s{reason}")

    def fresh(self, episode: int, tick: int) -> MotorCommand | None:
        """The newest command, if it is new and not older than the watchdog of the drives allows.

        A command for a future tick is ignored: its sender counts ticks differently from the robot.
        """
        of, answered = self._lane.command_key
        watchdog = COMMAND_WATCHDOG / self._tick
        new = of == episode and self._applied < answered <= tick
        if new and tick - answered <= watchdog:
            self._applied = answered
            quiet_for = (tick - self._last_silence) * self._tick
            if not (self._ever and self._silent) or quiet_for > _NEWS_PERIOD:
                self.come()
            return self._lane.command
        if self._ever and tick - self._applied > watchdog:
            self._last_silence = tick
            self.missed(tick, (tick - self._applied) * self._tick)
        return None
