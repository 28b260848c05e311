"""State of the drives' power switch, by the operators' commands."""

from __future__ import annotations

from cassie_msgs.bounds import outside
from cassie_msgs.layout import OperatorCommand
from cassie_msgs.operators import Operators
from cassie_msgs.schedule import PERIOD_TICKS, SCRIPT_GONE, SCRIPT_TIMEOUT, effective_seq


class PowerSwitch:
    """Switches at once for a person, at `effective_seq` for a script.

    A script answers state k with a command that is valid from tick k + `PERIOD_TICKS` on. The
    simulator waits for that answer where it needs it, so that the tick at which the switch moves
    does not depend on the machine. A script that does not answer within its time-out counts as
    lost: the simulator does not wait for it until its next message. The first writer of scripted
    commands is the script, until it is gone for `SCRIPT_GONE`.

    Args:
        scripted: Whether a script is expected; then persons can only stop the robot.
        start_timeout: Time-out for the script's first answer, in wall time. In s.

    Attributes:
        operators: The operators and the lease.
        lost: Whether the script does not answer.
        refused: Why the newest command was refused; empty if it was not.
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
        """Begin a new episode: power off, nothing planned."""
        self._planned.clear()
        self._wanted = False
        self.operators.reset()

    def take(
        self, command: OperatorCommand, writer: bytes, episode: int, tick: int, now: float
    ) -> None:
        """Take in a command of an operator.

        Args:
            command: The received command.
            writer: Identity of the command's writer.
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
            # A late answer is still valid, from its arrival on. The newest possible answer is for
            # the state just sent.
            self.refused = outside("effective_seq", effective, 0, effective_seq(tick))
            if not self.refused:
                self._planned[effective] = bool(command.power)
                self._script, self._heard = writer, now
                self.lost = False

    def _other_plays(self, writer: bytes, now: float) -> bool:
        """Whether a script other than `writer` runs, that is, was heard within `SCRIPT_GONE`."""
        return self._script not in (b"", writer) and now - self._heard <= SCRIPT_GONE

    def awaits(self, tick: int) -> bool:
        """Whether this tick may not run before the script has answered."""
        if not self._scripted or self.lost or tick % PERIOD_TICKS:
            return False
        # At the start the script must answer before robot time passes.
        return (tick or PERIOD_TICKS) not in self._planned

    @property
    def timeout(self) -> float:
        """Time-out for the script's answer. In s."""
        return SCRIPT_TIMEOUT if self._script else self._start_patience

    def pause(self, now: float) -> None:
        """Take in that robot time is paused: the script has nothing to answer."""
        self._heard = now

    def give_up(self) -> None:
        """Take in that the script did not answer within its time-out."""
        self.lost = True

    def apply(self, tick: int) -> bool:
        """Position of the switch in this tick."""
        if self._planned:
            self._wanted = self._planned.pop(tick, self._wanted)
            if self._planned and min(self._planned) < tick:  # came too late: valid from now on
                self._wanted = self._planned.pop(min(self._planned))
        if self._scripted:
            return self.operators.script(self._wanted)
        return self.operators.power
