"""The operator command that is valid at a state, by received commands and time-outs."""

from __future__ import annotations

import time
from collections import deque

from rclpy.node import Node

from cassie_control.ros.common import Conditions
from cassie_control.schedule import LEAD
from cassie_msgs.bounds import outside
from cassie_msgs.layout import OperatorCommand, RobotState, header
from cassie_msgs.operators import Operators, Refusals, sender_of
from cassie_msgs.ros.fast_lane import (
    EVERY,
    LanePublisher,
    LaneSubscription,
    LaneWaiter,
    take_from_each,
)
from cassie_msgs.ros.process import Stop
from cassie_msgs.schedule import (
    SCRIPT_AGE,
    SCRIPT_GONE,
    SCRIPT_TIMEOUT,
    effective_seq,
)

_FIRST_ANSWER = 8.0  # s of wall time, time-out of a script's first answer, below `START_TIMEOUT`
_MOST = 5  # states of a long queue that are answered


class OperatorSource:
    """The command of the person who holds the lease, or a script's answer to the same state.

    This class also provides the states, because some arrive during a wait for a script. If a state
    of the next period arrives, the plant runs on the wall clock. From then on, until the next
    episode, there are no waits and the newest command is valid.

    Attributes:
        operators: The persons who send commands. If a script is expected, they can only stop.

    Args:
        node: The supervisor.
        stop: Request to end.
        states: States that the supervisor answers.
        conditions: Gets reports of problems.
        scripted: Whether a script is expected.
    """

    def __init__(
        self,
        node: Node,
        stop: Stop,
        states: LaneSubscription[RobotState],
        conditions: Conditions,
        *,
        scripted: bool,
    ) -> None:
        self._stop = stop
        self._states = states
        self._commands = LaneSubscription(node, OperatorCommand, qos=EVERY)
        self._waiter = LaneWaiter(node, [self._commands, states])
        stop.on_request(self._waiter.wake)
        self._conditions = conditions
        self._scripted = scripted
        self.operators = Operators(scripted=scripted)
        self._refusals = Refusals()
        self._script, self._heard = b"", 0.0
        self._early: deque[bytes] = deque(maxlen=_MOST)
        self._answered: dict[int, bytes] = {}
        self._received = OperatorCommand()
        self._command = OperatorCommand()
        self._arrived = -1.0
        self._episode = -1
        self._seq = 0
        self._lost = False
        self._plant_waits = True

    def reset(self, episode: int) -> None:
        """Begin a new episode: earlier answers of a script are void; persons must arm anew."""
        self._episode = episode
        self._answered.clear()
        self.operators.reset()
        self._arrived = -1.0
        self._lost = False
        self._plant_waits = True

    def take_state(self) -> bytes | None:
        """The oldest state not yet taken, serialized; of a long queue only the last ones."""
        self._take_early()
        return self._early.popleft() if self._early else None

    def _take_early(self) -> None:
        self._early.extend(self._states.take_last(_MOST))

    def at(self, state: RobotState) -> OperatorCommand | None:
        """The command that is valid at a state; None if the operator is lost. May wait for it."""
        self._seq = int(state.seq)
        self._take()
        if self._scripted:
            command = self._of_script(self._seq)
        else:
            self.operators.follow(int(state.operator_lease))
            self.operators.power = float(state.power) > 0.5  # this node may have joined later
            command = self.operators.command(time.monotonic())
        # Before the first command no operator counts as lost: the robot has no power yet.
        ever = bool(self._script) if self._scripted else self.operators.ever
        lost = command is None and ever
        self._conditions.set("operator", "no operator commands any more" if lost else "")
        return command

    @property
    def holder(self) -> str:
        """Name of the operator who drives; empty if there is none."""
        if self._scripted:
            return "" if self._lost or self._arrived < 0.0 else sender_of(self._command)
        return self.operators.holder(time.monotonic())

    @property
    def others(self) -> list[str]:
        """Names of the other operators that send commands."""
        return self.operators.others(time.monotonic())

    @property
    def armed(self) -> bool:
        """Whether the driving operator's speeds are armed."""
        return self._scripted or self.operators.armed

    @property
    def faults(self) -> tuple[str, ...]:
        """Why the commanded power stays off, and who may take the lease of a silent operator."""
        if self._scripted:
            return ()
        refused = self.operators.power_refused
        found = (
            f"no power: {refused}" if refused else "",
            self.operators.waiting(time.monotonic()),
        )
        return tuple(word for word in found if word)

    def _of_script(self, seq: int) -> OperatorCommand | None:
        if self._plant_waits:
            if self._answers(seq):
                self._lost = False
            elif not self._lost:
                self._wait(seq)
        if not self._plant_waits:
            self._lost = self._arrived < 0.0 or time.monotonic() - self._arrived > SCRIPT_AGE
        return None if self._lost else self._command

    def _answers(self, seq: int) -> bool:
        """Whether the answer to a state has come; it is then the command.

        The loop runs on for a period before it waits for this node, so the answer to the next
        state may have come as well.
        """
        if (answer := self._answered.get(seq)) is not None:
            self._command.load(answer)
        for older in [key for key in self._answered if key <= seq]:
            del self._answered[older]
        return self._arrived >= 0.0 and int(self._command.seq) == seq

    def _wait(self, seq: int) -> None:
        deadline = time.monotonic() + (SCRIPT_TIMEOUT if self._script else _FIRST_ANSWER)
        while (left := deadline - time.monotonic()) > 0.0 and not self._stop.requested:
            self._waiter.wait(left)
            self._take()
            if self._answers(seq):
                return
            if self._next_period_began(seq):
                self._plant_waits = False
                return
        self._lost = True

    def _next_period_began(self, seq: int) -> bool:
        """Whether a state of the next period or episode has come; states are kept."""
        self._take_early()
        if not self._early:
            return False
        _, _, episode, newer = header(self._early[-1])
        return episode != self._episode or newer > effective_seq(seq)

    def _take(self) -> None:
        now = time.monotonic()
        for writer, raw in take_from_each(self._commands):
            try:
                self._received.load(raw)
            except ValueError as error:
                self._refusals.refuse(str(error), now)
            else:
                if refused := self._hear(writer):
                    self._refusals.refuse(refused, now)
        self._conditions.set("operator_command", self._refusals.look(now))

    def _hear(self, writer: bytes) -> str:
        """Take in the received command; returns why it is refused, empty if it is not."""
        command, now = self._received, time.monotonic()
        if not command.scripted:
            self.operators.take(command, writer, now)
            return ""
        if not self._scripted:
            return "it is scripted, and no script is expected (scripted_operator)"
        gone = self._lost and now - self._heard > SCRIPT_GONE
        if self._script not in (b"", writer) and not gone:
            return "another script plays already"
        if int(command.episode) != self._episode:
            return ""
        seq = int(command.seq)
        refused = outside("seq", seq, 0, self._seq + LEAD)
        if not refused:
            self._command.copy_from(command)
            self._answered[seq] = command.to_bytes()
            self._script, self._arrived, self._heard = writer, now, now
        return refused


class CommandInForce:
    """Publishes the command that the supervisor uses, on /cassie/operator_in_force.

    A script's answer to the same state is not published, as a recording has it anyway. For a state
    without a command, `effective_seq` is 0.
    """

    TOPIC = "/cassie/operator_in_force"

    def __init__(self, node: Node) -> None:
        self._publisher = LanePublisher(node, OperatorCommand, self.TOPIC)
        self._message, self._none = OperatorCommand(), OperatorCommand()

    def publish(self, command: OperatorCommand | None, state: RobotState) -> None:
        """Publish the command that is valid at a state."""
        if command is not None and command.scripted and int(command.seq) == int(state.seq):
            return
        message = self._message
        message.copy_from(self._none if command is None else command)
        message.answer(state)
        message.effective_seq[...] = 0 if command is None else effective_seq(int(state.seq))
        self._publisher.publish(message)
