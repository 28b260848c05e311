"""Which way the drives' power switch stands, by the operators' commands."""

from __future__ import annotations

from cassie_msgs.bounds import outside
from cassie_msgs.layout import OperatorCommand
from cassie_msgs.operators import Operators
from cassie_msgs.schedule import PERIOD_TICKS, SCRIPT_GONE, SCRIPT_TIMEOUT, effective_seq


class PowerSwitch:
    """Switches at once for a person, at `effective_seq` for a script.

    A script answers state k with what holds from tick k + `PERIOD_TICKS` on. The simulator waits
    for that answer where it needs it, so that the tick at which the switch moves does not depend on
    the machine. A script that stays silent for its time-out counts as lost: nothing waits for it
    until it is heard again. The first writer of scripted commands is the script, until it is lost.

    Args:
        scripted: Whether a script is expected; then persons can only stop the robot.
        start_timeout: Wall time that the script has for its first answer. In s.

    Attributes:
        operators: Who speaks and who holds the lease.
        lost: Whether the script does not answer.
        refused: Why the newest command does not count; empty if it does.
    """

    def __init__(self, *, scripted: bool, start_timeout: float) -> None:
        self._scripted = scripted
        self._start_patience = start_timeout
        self._planned: dict[int, bool] = {}
        self._wanted = False
        self._script, self._heard = b"", 0.0
        self.operators = Operators(scripted=scripted)
        self.lost = False
        self.refused = ""

    @property
    def on(self) -> bool:
        """Whether the drives shall have power."""
        return self.operators.power

    def reset(self) -> None:
        """A new episode: power off, nothing planned."""
        self._planned.clear()
        self._wanted = False
        self.operators.reset()

    def take(
        self, command: OperatorCommand, writer: bytes, episode: int, tick: int, now: float
    ) -> None:
        """Take in a command of an operator.

        Args:
            command: What came.
            writer: Identity of who wrote it.
            episode: Present episode.
            tick: Present control tick.
            now: Wall time. In s.
        """
        self.refused = ""
        if not command.scripted:
            self.operators.take(command, writer, now)
            self.refused = self.operators.refused
        elif not self._scripted:
            self.refused = "it is scripted, and no script is expected (scripted_operator)"
        elif self._other_plays(writer, now):
            self.refused = "another script plays already"
        elif int(command.episode) == episode:
            effective = int(command.effective_seq)
            # An answer that comes late still holds, from then on; the latest is one to the state
            # just sent.
            self.refused = outside("effective_seq", effective, 0, effective_seq(tick))
            if not self.refused:
                self._planned[effective] = bool(command.power)
                self._script, self._heard = writer, now
                self.lost = False

    def _other_plays(self, writer: bytes, now: float) -> bool:
        """Whether a script other than this one plays; it does until it is gone."""
        return self._script not in (b"", writer) and now - self._heard <= SCRIPT_GONE

    def awaits(self, tick: int) -> bool:
        """Whether this tick may not run before the script has answered."""
        if not self._scripted or self.lost or tick % PERIOD_TICKS:
            return False
        # At the start the script proves that it takes part, before robot time passes.
        return (tick or PERIOD_TICKS) not in self._planned

    @property
    def timeout(self) -> float:
        """How long to wait for the script. In s."""
        return SCRIPT_TIMEOUT if self._script else self._start_patience

    def pause(self, now: float) -> None:
        """Robot time stands still: a script that plays has nothing to answer."""
        self._heard = now

    def give_up(self) -> None:
        """Wait no longer: the script did not answer within its timeout."""
        self.lost = True

    def apply(self, tick: int) -> bool:
        """Position of the switch in this tick."""
        if self._planned:
            self._wanted = self._planned.pop(tick, self._wanted)
            if self._planned and min(self._planned) < tick:  # came too late: holds from now on
                self._wanted = self._planned.pop(min(self._planned))
        if self._scripted:
            return self.operators.script(self._wanted)
        return self.operators.power
