"""The schedule of lock-step and its time-outs, used by every node.

On every `PERIOD_TICKS`-th state k a scripted operator and the supervisor publish an answer that is
valid from tick k + `PERIOD_TICKS` on. So their answers cost the loop no time, and which answer is
valid at a tick does not depend on the machine.
"""

from __future__ import annotations

CONTROL_RATE = 500
"""Default rate of control ticks, in robot time. In Hz."""

PERIOD_TICKS = 10
"""Control ticks between commands of a scripted operator and between modes. Each of these messages
is sent as many ticks before it becomes valid."""

GAIT_TICKS = 250
"""Control ticks between requests for a gait, and from a request until its answer becomes valid:
0.5 s at 500 Hz."""

STATUS_TICKS = 5
"""Control ticks between two messages of the controller's status."""

REPEAT_PERIOD = 0.5
"""Wall time after which an unanswered sensor sample is sent again. In s."""

SILENT_AFTER = 0.8
"""Time-out of the simulator: wall time without samples. More than `REPEAT_PERIOD`. In s."""

ANSWER_AFTER = 0.7
"""Time-out of a node: wall time without an answer while samples arrive. In s."""

SCRIPT_TIMEOUT = 0.3
"""Wall time within which a scripted operator must answer a state, once it takes part. In s."""

SCRIPT_AGE = 0.5
"""Time-out of a script in real time: age of its newest command. In s."""

SCRIPT_GONE = 3.0
"""Wall time without a message of a scripted operator, after which another script may run. A pause
does not count. A busy machine seldom delays a process by as much. In s."""

START_TIMEOUT = 10.0
"""Wall time within which the other nodes must appear at the start. In s."""


def effective_seq(seq: int) -> int:
    """Tick from which an answer to the state of tick `seq` is valid."""
    return seq + PERIOD_TICKS


def period_of(tick: int) -> int:
    """First tick of the period that contains a tick: modes and commands are constant within it."""
    return tick - tick % PERIOD_TICKS
