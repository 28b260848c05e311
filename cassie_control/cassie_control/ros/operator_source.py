"""Which operator command holds for a state, as the commands come in or stay away."""

from __future__ import annotations

import time
from collections import deque

from rclpy.node import Node

from cassie_control.ros.common import Conditions
from cassie_control.supervisor.mode_supervisor import PERIOD_TICKS
from cassie_msgs.layout import OperatorCommand, RobotState, header
from cassie_msgs.ros.fast_lane import EVERY, LaneSubscription, LaneWaiter
from cassie_msgs.ros.process import Stop

COMMAND_AGE = 0.5
"""Wall time for which a command holds when nothing waits for the next. In s."""

SCRIPT_PATIENCE = 0.3
"""Wall time that a script has to answer a state. In s."""

START_PATIENCE = 8.0
"""The same for its first answer. In s."""


class OperatorSource:
    """A person's newest command, or a script's answer to the same state.

    Also hands out the states, because some arrive while a script is waited for. If one of the
    next period does, the plant runs on the wall clock: from then on, until the next episode,
    nothing is waited for and the newest command holds.
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
        self._early: deque[bytes] = deque()
        self._answered: dict[int, OperatorCommand] = {}
        self._command = OperatorCommand()
        self._arrived = -1.0
        self._episode = -1
        self._heard = False
        self._lost = False
        self._waited_for = True

    def reset(self, episode: int) -> None:
        """A new episode: earlier answers of a script do not count."""
        self._episode = episode
        self._answered.clear()
        if self._scripted:
            self._arrived = -1.0
        self._lost = False
        self._waited_for = True

    def take_state(self) -> bytes | None:
        """The oldest state not yet taken, serialized."""
        return self._early.popleft() if self._early else self._states.take_raw()

    def at(self, seq: int) -> OperatorCommand | None:
        """The command in force at a state; None when the operator is lost. May wait for it."""
        self._take()
        if self._scripted and self._waited_for:
            if self._answers(seq):
                self._lost = False
            elif not self._lost:
                self._wait(seq)
        if not self._scripted or not self._waited_for:
            self._lost = self._arrived < 0.0 or time.monotonic() - self._arrived > COMMAND_AGE
        # Before the first command nobody is lost: the robot has no power yet.
        problem = "no operator commands any more" if self._lost and self._heard else ""
        self._conditions.set("operator", problem)
        return None if self._lost else self._command

    def _answers(self, seq: int) -> bool:
        """Whether the answer to a state is there; it is the command then.

        The loop runs on for a period before it waits for us, so the answer to the next state
        may be there as well.
        """
        self._command = self._answered.get(seq, self._command)
        for older in [key for key in self._answered if key <= seq]:
            del self._answered[older]
        return self._arrived >= 0.0 and int(self._command.seq) == seq

    def _wait(self, seq: int) -> None:
        deadline = time.monotonic() + (SCRIPT_PATIENCE if self._heard else START_PATIENCE)
        while (left := deadline - time.monotonic()) > 0.0 and not self._stop.requested:
            self._waiter.wait(left)
            self._take()
            if self._answers(seq):
                return
            if self._overtaken(seq):
                self._waited_for = False
                return
        self._lost = True

    def _overtaken(self, seq: int) -> bool:
        """Whether a state of the next period or episode is there; states are kept."""
        overtaken = False
        while (raw := self._states.take_raw()) is not None:
            self._early.append(raw)
            _, _, episode, newer = header(raw)
            overtaken = overtaken or episode != self._episode or newer > seq + PERIOD_TICKS
        return overtaken

    def _take(self) -> None:
        while (raw := self._commands.take_raw()) is not None:
            try:
                command = OperatorCommand()
                command.load(raw)
            except ValueError as error:
                self._conditions.set("operator_command", str(error))
                continue
            self._conditions.set("operator_command", "")
            if self._scripted and not self._is_ours(command):
                continue
            self._command = command
            if self._scripted:
                self._answered[int(command.seq)] = command
            self._arrived = time.monotonic()
            self._heard = True

    def _is_ours(self, command: OperatorCommand) -> bool:
        return bool(command.scripted) and int(command.episode) == self._episode
