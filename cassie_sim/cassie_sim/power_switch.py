"""Which way the drives' power switch stands, by the operator's commands."""

from __future__ import annotations

from cassie_msgs.layout import OperatorCommand

PERIOD = 10
"""Ticks between the commands of a scripted operator, and their lead."""

PATIENCE = 0.3
"""Wall time that a scripted operator has to answer once it takes part. In s."""


class PowerSwitch:
    """Switches at once for a person, at `effective_seq` for a script.

    A script answers state k with what holds from tick k + `PERIOD` on. The simulator waits for
    that answer where it needs it, so that the tick at which the switch moves does not depend
    on the machine. A script that stays silent for its patience counts as lost: nothing waits
    for it until it is heard again.

    Args:
        scripted: Whether a script is expected.
        start_patience: Wall time that the script has for its first answer. In s.
    """

    def __init__(self, *, scripted: bool, start_patience: float) -> None:
        self._scripted = scripted
        self._start_patience = start_patience
        self._planned: dict[int, bool] = {}
        self._heard = False
        self.lost = False
        self.on = False

    def reset(self) -> None:
        """A new episode: power off, nothing planned."""
        self._planned.clear()
        self.on = False

    def take(self, command: OperatorCommand, episode: int) -> None:
        """Take in a command of the operator."""
        if not command.scripted:
            self.on = bool(command.power)
            return
        if int(command.episode) == episode:
            self._planned[int(command.effective_seq)] = bool(command.power)
            self._heard = True
            self.lost = False

    def awaits(self, tick: int) -> bool:
        """Whether this tick may not run before the script has answered."""
        if not self._scripted or self.lost or tick % PERIOD:
            return False
        # At the start the script proves that it takes part, before robot time passes.
        return (tick or PERIOD) not in self._planned

    @property
    def patience(self) -> float:
        """How long to wait for the script. In s."""
        return PATIENCE if self._heard else self._start_patience

    def give_up(self) -> None:
        """Wait no longer: the script did not answer within its patience."""
        self.lost = True

    def apply(self, tick: int) -> bool:
        """Position of the switch in this tick."""
        if self._planned:
            self.on = self._planned.pop(tick, self.on)
            if self._planned and min(self._planned) < tick:  # came too late: holds from now on
                self.on = self._planned.pop(min(self._planned))
        return self.on
