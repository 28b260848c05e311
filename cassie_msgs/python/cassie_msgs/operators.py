"""Which operator drives: one holds the lease, every one can stop, and nothing moves unarmed.

The simulator (or the robot) decides who holds the lease and tells it with each sensor sample; the
supervisor follows it. Wall times come in as arguments, in s.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from cassie_msgs.layout import OperatorCommand, RobotMode

COMMAND_AGE = 0.5
"""Age of a command from which its operator counts as lost. In s."""

FORGOTTEN = 5.0
"""Silence after which an operator is no longer listed. In s."""

MAX_OPERATORS = 32
"""Operators that are listened to at a time; further ones are ignored."""

REQUEST_TIME = 2.0
"""For how long a request for the lease stands while the robot is not at rest yet. In s."""

STILL = 0.02
"""Commanded speed up to which it counts as none: a stick in the middle. In m/s and rad/s."""

_SPEEDS = ("vx", "vy", "yaw_rate")
_LEANS = ("com_x", "com_y")


def neutral(command: OperatorCommand) -> bool:
    """Whether no speed is asked for, nor a lean, where the robot rides."""
    riding = int(command.mode) == RobotMode.SEGWAY
    names = _SPEEDS + _LEANS if riding else _SPEEDS
    return all(abs(float(getattr(command, name))) <= STILL for name in names)


def resting(command: OperatorCommand) -> bool:
    """Whether a command lets the robot stand, or be without power."""
    moves = int(command.mode) in (RobotMode.WALK, RobotMode.SEGWAY) or not neutral(command)
    return not moves or not command.power


def without_speeds(command: OperatorCommand) -> None:
    """Take the speeds out of a command, and the leans, where the robot rides."""
    names = _SPEEDS + _LEANS if int(command.mode) == RobotMode.SEGWAY else _SPEEDS
    for name in names:
        getattr(command, name)[...] = 0.0


class Refusals:
    """What was wrong with messages of late: told once, and over once none was wrong for a while.

    Args:
        quiet: Time without a wrong message after which it is over. In s.

    Attributes:
        problem: What was wrong with the first of them; empty when it is over.
    """

    def __init__(self, quiet: float = 1.0) -> None:
        self._quiet = quiet
        self._last = -1e9
        self.problem = ""

    def refuse(self, problem: str, now: float) -> None:
        """A message was wrong."""
        self._last = now
        self.problem = self.problem or problem

    def look(self, now: float) -> str:
        """The problem that holds now."""
        if self.problem and now - self._last > self._quiet:
            self.problem = ""
        return self.problem


def sender_of(command: OperatorCommand) -> str:
    """Who speaks, as the command says it; empty if it does not, or not in printable ASCII."""
    raw = command.sender.tobytes().rstrip(b"\0")
    return raw.decode("ascii") if raw.isascii() and raw.decode("ascii").isprintable() else ""


def write_sender(command: OperatorCommand, name: str) -> None:
    """Have a command say who speaks; what does not fit is cut off in front of the process."""
    raw = name.encode("ascii", "replace")
    space = command.sender.size
    if len(raw) > space:
        head, _, tail = raw.rpartition(b"-")
        raw = head[: space - len(tail) - 1] + b"-" + tail if len(tail) < space else raw[:space]
    command.sender[:] = 0
    command.sender[: len(raw)] = np.frombuffer(raw, np.uint8)


def check(command: OperatorCommand) -> str:
    """Why a command means nothing; empty if it means something."""
    floats = command.floats
    if not np.isfinite(floats).all():
        return "a value is not finite"
    if np.abs(floats).max() > _LARGEST:
        return f"a value is beyond {_LARGEST:g}"
    if int(command.mode) > RobotMode.SEGWAY:
        return f"mode is {int(command.mode)}, must be 0 .. {int(RobotMode.SEGWAY)}"
    return ""


_LARGEST = 1e6


def key_of(writer: bytes) -> int:
    """Number that stands for a writer in a message, from the identity that DDS gives it.

    The bytes left out name vendor, host and participant; those of one machine agree in them.
    """
    return int.from_bytes(writer[4:8] + writer[12:16], "little")


@dataclass
class _Operator:
    name: str = ""
    heard: float = 0.0
    power: bool = False
    asks: bool = False
    asked: float = -1e9
    command: OperatorCommand = field(default_factory=OperatorCommand)


class Operators:
    """The operators that speak, the lease, the power switch and the arming of speeds.

    - Lease: the first operator that speaks holds it. Another one gets it by an explicit request
      (`take_over`) while the holder lets the robot rest. After a holder is silent for
      `COMMAND_AGE`, the robot stops and stands; the lease then goes to whoever lets it rest: by a
      command that asks for stand without a speed, or leaves the power off. On a Segway, which
      cannot stand at once, `take_over` without a lean is enough.
    - Power: as the holder has it. It comes on only while the holder asks for stand without a speed.
      A new holder that has it off leaves it as it is until it had it on once.
    - Emergency stop: `emergency_stop`, or power from true to false, of any operator; one that does
      not hold the lease must say who it is. After that of another operator, or by
      `emergency_stop`, power stays off until the holder switches it off and on again.
    - Arming: after a start, a new episode, a lost link or a change of the lease the speeds count
      as zero until the holder's command had them at zero.

    Of the holder's command that means nothing only a power switch that moved to off counts; of
    others' such commands nothing does.

    Args:
        scripted: Whether a script holds the lease, so that of the others just a stop counts.

    Attributes:
        power: Whether the drives shall have power.
        armed: Whether the holder's speeds count.
        stopped_by: Who stopped the robot; empty unless power waits to be switched off and on.
        refused: Why the holder's newest command was refused; empty if it was not.
        power_refused: Why power does not come on although the holder has it on; empty if it may.
    """

    def __init__(self, *, scripted: bool = False) -> None:
        self._scripted = scripted
        self._operators: dict[bytes, _Operator] = {}
        self._holder: bytes | None = None
        self.power = False
        self._reset()

    def reset(self) -> None:
        """A new episode: without power, unarmed; who holds the lease keeps it."""
        self.power = False
        self._reset()

    def _reset(self) -> None:
        self.armed = False
        self.stopped_by = self.refused = self.power_refused = ""
        self._bumpless = False  # a new holder's switch is off while the robot has power
        self._cycled = True

    def script(self, wanted: bool) -> bool:
        """Whether the drives shall have power where a script, which holds the lease, wants it."""
        if not wanted:
            self._cycled, self.stopped_by = True, ""
        self.power = wanted and self._cycled
        return self.power

    def take(self, command: OperatorCommand, writer: bytes, now: float) -> None:
        """Take in a command.

        Args:
            command: What came; copied.
            writer: Identity of who wrote it.
            now: Wall time.
        """
        operator = self._operators.get(writer)
        if operator is None:
            self._forget(now)
            if len(self._operators) >= MAX_OPERATORS:
                return
            operator = self._operators[writer] = _Operator()
        refused = check(command)
        holds = writer == self._holder
        if refused and not holds:
            return
        had_power, operator.power = operator.power, bool(command.power)
        operator.heard = now
        operator.name = sender_of(command) or operator.name or f"unknown-{writer.hex()[-8:]}"
        switched_off = had_power and not operator.power
        if holds:
            stopped = bool(command.emergency_stop)
        else:  # a message that was made at random says nothing that reads like a name
            stopped = bool(sender_of(command)) and (bool(command.emergency_stop) or switched_off)
        if stopped:
            self._stop(operator.name)
        operator.command.copy_from(command)
        if holds:
            self.refused = refused
        if refused:
            self.power = self.power and not switched_off
            return
        asks = bool(command.take_over)
        operator.asked = now if asks and not operator.asks else operator.asked
        operator.asks = asks
        self._lease(writer, operator, now)
        if writer == self._holder:
            self._switch(operator)
            self.armed = bool(command.link) and (self.armed or neutral(command))

    def command(self, now: float) -> OperatorCommand | None:
        """What the holder asks for, without its speeds while unarmed; None if it is silent.

        Owned by this object; valid until the next `take`.
        """
        holder = self._heard_holder(now)
        if holder is None:
            self.armed = False
            return None
        if not self.armed:
            without_speeds(holder.command)
        return holder.command

    @property
    def lease(self) -> int:
        """Key of who holds the lease, also while that operator is silent; 0 before the first."""
        return key_of(self._holder) if self._holder is not None else 0

    def follow(self, lease: int) -> None:
        """Let the operator of this key hold the lease, as the robot says; 0 leaves it as it is."""
        if lease in (0, self.lease):
            return
        for writer in self._operators:
            if key_of(writer) == lease:
                self._give(writer)

    def holder(self, now: float) -> str:
        """Name of who holds the lease; empty if nobody does."""
        holder = self._heard_holder(now)
        return holder.name if holder is not None else ""

    def waiting(self, now: float) -> str:
        """Who waits for the lease of an operator that is silent, and how they get it, or empty."""
        others = self.others(now)
        if self._holder is None or self._heard_holder(now) is not None or not others:
            return ""
        return f"{', '.join(others)} may drive after asking for stand without a speed"

    def others(self, now: float) -> list[str]:
        """Names of the other operators that speak."""
        return sorted(
            operator.name
            for writer, operator in self._operators.items()
            if writer != self._holder and operator.name and now - operator.heard < FORGOTTEN
        )

    @property
    def ever(self) -> bool:
        """Whether anybody has ever spoken."""
        return self._holder is not None

    def gone(self, writers: Iterable[bytes]) -> None:
        """Nodes are gone: their identities need not be remembered."""
        for writer in writers:
            if writer != self._holder:
                self._operators.pop(writer, None)

    def _heard_holder(self, now: float) -> _Operator | None:
        holder = self._operators.get(self._holder) if self._holder is not None else None
        return holder if holder is not None and now - holder.heard <= COMMAND_AGE else None

    def _lease(self, writer: bytes, operator: _Operator, now: float) -> None:
        if writer == self._holder or self._scripted:
            return
        holder = self._heard_holder(now)
        asks = operator.asks and now - operator.asked < REQUEST_TIME
        if self._holder is None:
            self._give(writer)
        elif holder is None:
            rides = int(operator.command.mode) == RobotMode.SEGWAY
            if resting(operator.command) or (asks and rides and neutral(operator.command)):
                self._give(writer)
        elif asks and resting(holder.command):
            self._give(writer)

    def _give(self, writer: bytes) -> None:
        """Have an operator hold the lease."""
        operator = self._operators[writer]
        operator.asked = -1e9  # one request is granted once
        self._holder = writer
        self.armed = False
        self.refused = ""
        self._bumpless = self.power and not operator.power

    def _stop(self, name: str) -> None:
        self.power = False
        self.stopped_by, self._cycled = name, False

    def _switch(self, holder: _Operator) -> None:
        """The holder's power switch."""
        self.power_refused = ""
        if not holder.power:
            self._cycled, self.stopped_by = True, ""
            if not self._bumpless:
                self.power = False
            return
        self._bumpless = False
        if self.power:
            return
        if not self._cycled:
            self.power_refused = f"stopped by {self.stopped_by}: switch the power off and on again"
        elif not resting(holder.command):
            self.power_refused = "power comes on only with stand asked for and without a speed"
        else:
            self.power = True

    def _forget(self, now: float) -> None:
        silent = [w for w, o in self._operators.items() if now - o.heard > FORGOTTEN]
        self.gone(silent)
