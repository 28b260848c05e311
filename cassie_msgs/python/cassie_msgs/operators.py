"""Which operator drives: one holds the lease, each one can stop, and speeds must be armed.

The simulator (or the robot) decides which operator holds the lease and states it in each sensor
sample; the supervisor follows. Wall times come in as arguments, in s.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from cassie_msgs.layout import OperatorCommand, RobotMode

COMMAND_AGE = 0.5
"""Time-out of an operator: age of its newest command. In s."""

FORGOTTEN = 5.0
"""Time without a command after which an operator is no longer listed. In s."""

MAX_OPERATORS = 32
"""Largest number of operators at a time; further ones are ignored."""

REQUEST_TIME = 2.0
"""Time for which a request for the lease is valid while the robot is not at rest yet. In s."""

RIDE_STOP = 6.0
"""Time for which a Segway brakes after its operator let it rest. In s."""

STILL = 0.02
"""Dead band of commanded speeds and leans, for a stick in the middle. In m/s, rad/s and m."""

_SPEEDS = ("vx", "vy", "yaw_rate")
_LEANS = ("com_x", "com_y")


def neutral(command: OperatorCommand) -> bool:
    """Whether no speed is commanded and, in the Segway mode, no lean."""
    riding = int(command.mode) == RobotMode.SEGWAY
    names = _SPEEDS + _LEANS if riding else _SPEEDS
    return all(abs(float(getattr(command, name))) <= STILL for name in names)


def resting(command: OperatorCommand) -> bool:
    """Whether a command lets the robot stand still, or be without power."""
    moves = int(command.mode) in (RobotMode.WALK, RobotMode.SEGWAY) or not neutral(command)
    return not moves or not command.power


def without_speeds(command: OperatorCommand) -> None:
    """Set the speeds in a command to zero and, in the Segway mode, the leans."""
    names = _SPEEDS + _LEANS if int(command.mode) == RobotMode.SEGWAY else _SPEEDS
    for name in names:
        getattr(command, name)[...] = 0.0


class Refusals:
    """Holds the first problem of a series of wrong messages, for one report per series.

    Args:
        quiet: Time without a wrong message that ends a series. In s.

    Attributes:
        problem: What was wrong with the first message; empty after the series ends.
    """

    def __init__(self, quiet: float = 1.0) -> None:
        self._quiet = quiet
        self._last = -1e9
        self.problem = ""

    def refuse(self, problem: str, now: float) -> None:
        """Take in that a message was wrong at wall time `now`."""
        self._last = now
        self.problem = self.problem or problem

    def look(self, now: float) -> str:
        """The current problem; empty if there is none."""
        if self.problem and now - self._last > self._quiet:
            self.problem = ""
        return self.problem


def sender_of(command: OperatorCommand) -> str:
    """Name of the sender in a command; empty if there is none or it is not printable ASCII."""
    raw = command.sender.tobytes().rstrip(b"\0")
    return raw.decode("ascii") if raw.isascii() and raw.decode("ascii").isprintable() else ""


def write_sender(command: OperatorCommand, name: str) -> None:
    """Write the sender's name into a command. A long name is cut before its last "-"."""
    raw = name.encode("ascii", "replace")
    space = command.sender.size
    if len(raw) > space:
        head, _, tail = raw.rpartition(b"-")
        raw = head[: space - len(tail) - 1] + b"-" + tail if len(tail) < space else raw[:space]
    command.sender[:] = 0
    command.sender[: len(raw)] = np.frombuffer(raw, np.uint8)


def check(command: OperatorCommand) -> str:
    """Why a command is invalid; empty if it is valid."""
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
    """Key of a writer as a number for messages, from the writer's identity in DDS.

    The omitted bytes name vendor, host and participant; they are equal for writers of one machine.
    """
    return int.from_bytes(writer[4:8] + writer[12:16], "little")


@dataclass
class _Operator:
    """An operator's newest command, and wall times: of it, of a request, of riding. In s."""

    name: str = ""
    heard: float = 0.0
    power: bool = False
    asks: bool = False
    asked: float = -1e9
    rode: float = -1e9
    command: OperatorCommand = field(default_factory=OperatorCommand)

    def lets_rest(self, now: float) -> bool:
        """Whether the robot can rest by now: a Segway needs time to brake."""
        command = self.command
        stops = resting(command) and now - self.rode >= RIDE_STOP
        return stops or not command.power


class Operators:
    """The operators that send commands, the lease, the power switch and the arming of speeds.

    - Lease: the first operator that sends a command holds the lease. Another one gets it on request
      (`take_over`) while the holder lets the robot rest, on a Segway for `RIDE_STOP`. After
      `COMMAND_AGE` without a command of the holder, the robot stops and stands. Then the lease goes
      to an operator with a name that lets the robot rest: its command asks for stand without a
      speed, or has the power off. On a Segway, which cannot stand at once, `take_over` without a
      lean is enough.
    - Power: follows the holder's switch. Power comes on only while the holder commands the mode
      stand without a speed. While a new holder's switch is off, power does not change until that
      switch was on once.
    - Emergency stop: `emergency_stop`, or power from true to false, of any operator. An operator
      without the lease must state its name. After a stop by another operator, or by
      `emergency_stop`, power stays off until the holder switches it off and on again.
    - Arming: after a start, a new episode, a lost link or a change of the lease the speeds count
      as zero until the holder has commanded zero speeds once.

    An invalid command of the holder counts only if its power switch moved to off. Invalid commands
    of other operators are ignored.

    Args:
        scripted: Whether a script holds the lease, so that other operators can only stop.

    Attributes:
        power: Whether the drives shall have power.
        armed: Whether the holder's speeds count.
        stopped_by: Name of the operator that stopped the robot; empty unless power must be
            switched off and on.
        refused: Why the holder's newest command was refused; empty if it was not.
        power_refused: Why power stays off although the holder's switch is on; empty if it may
            come on.
    """

    def __init__(self, *, scripted: bool = False) -> None:
        self._scripted = scripted
        self._operators: dict[bytes, _Operator] = {}
        self._holder: bytes | None = None
        self.power = False
        self._reset()

    def reset(self) -> None:
        """Begin a new episode: without power, unarmed; the holder of the lease keeps it."""
        self.power = False
        self._reset()

    def _reset(self) -> None:
        self.armed = False
        self.stopped_by = self.refused = self.power_refused = ""
        self._bumpless = False  # a new holder's switch is off while the robot has power
        self._cycled = True

    def script(self, wanted: bool) -> bool:
        """Whether the drives shall have power, by the command of a script that holds the lease."""
        if not wanted:
            self._cycled, self.stopped_by = True, ""
        self.power = wanted and self._cycled
        return self.power

    def take(self, command: OperatorCommand, writer: bytes, now: float) -> None:
        """Take in a command.

        Args:
            command: The received command; it is copied.
            writer: Identity of the command's writer.
            now: Wall time. In s.
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
        else:  # random bytes seldom contain a readable name
            stopped = bool(sender_of(command)) and (bool(command.emergency_stop) or switched_off)
        if stopped:
            self._stop(operator.name)
        operator.command.copy_from(command)
        if int(command.mode) == RobotMode.SEGWAY:
            operator.rode = now
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
        """The holder's command, without speeds while unarmed; None after its time-out.

        The command is owned by this object and valid until the next `take`.
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
        """Key of the lease's holder, also after its time-out; 0 before the first operator."""
        return key_of(self._holder) if self._holder is not None else 0

    def follow(self, lease: int) -> None:
        """Give the lease to the operator of this key, as the robot states; 0 changes nothing."""
        if lease in (0, self.lease):
            return
        for writer in self._operators:
            if key_of(writer) == lease:
                self._give(writer)

    def holder(self, now: float) -> str:
        """Name of the lease's holder; empty if there is none or after its time-out."""
        holder = self._heard_holder(now)
        return holder.name if holder is not None else ""

    def waiting(self, now: float) -> str:
        """Who waits for the lease of an operator that is silent, and how they get it, or empty."""
        others = self.others(now)
        if self._holder is None or self._heard_holder(now) is not None or not others:
            return ""
        return f"{', '.join(others)} may drive after asking for stand without a speed"

    def others(self, now: float) -> list[str]:
        """Names of the other operators that send commands."""
        return sorted(
            operator.name
            for writer, operator in self._operators.items()
            if writer != self._holder and operator.name and now - operator.heard < FORGOTTEN
        )

    @property
    def ever(self) -> bool:
        """Whether any operator has ever held the lease."""
        return self._holder is not None

    def gone(self, writers: Iterable[bytes]) -> None:
        """Forget the operators of nodes that are gone."""
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
            command = operator.command
            rides = int(command.mode) == RobotMode.SEGWAY
            lets_rest = resting(command) or (asks and rides and neutral(command))
            if lets_rest and sender_of(command):
                self._give(writer)
        elif asks and holder.lets_rest(now):
            self._give(writer)

    def _give(self, writer: bytes) -> None:
        """Give the lease to an operator."""
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
        """Follow the holder's power switch."""
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
