"""The schedule of lock-step and its time-outs, which every node keeps to.

On every `PERIOD_TICKS`-th state k a scripted operator and the supervisor publish what holds from
tick k + `PERIOD_TICKS` on. So their answers cost the loop no time, and what holds at a tick does
not depend on the machine.
"""

from __future__ import annotations

CONTROL_RATE = 500
"""Control ticks in a second of robot time, unless nodes are told another. In Hz."""

PERIOD_TICKS = 10
"""Control ticks between commands of a scripted operator and between modes, and their lead."""

GAIT_TICKS = 250
"""Control ticks between requests for a gait, and the lead of each answer: 0.5 s at 500 Hz."""

STATUS_TICKS = 5
"""Control ticks between two messages of the controller's status."""

REPEAT_PERIOD = 0.5
"""Wall time after which an unanswered sensor sample is sent again. In s."""

SILENT_AFTER = 0.8
"""Wall time without samples after which the simulator counts as lost: beyond `REPEAT_PERIOD`.
In s."""

ANSWER_AFTER = 0.7
"""Wall time without an answer to samples that come, after which a node counts as lost. In s."""

SCRIPT_TIMEOUT = 0.3
"""Wall time that a scripted operator has to answer a state, once it takes part. In s."""

SCRIPT_AGE = 0.5
"""Age of a script's newest command from which it counts as lost in real time. In s."""

SCRIPT_GONE = 3.0
"""Wall time without a word of a scripted operator, after which another one may play. A pause does
not count; a busy machine seldom holds a process up for as long. In s."""

START_TIMEOUT = 10.0
"""Wall time in which the other nodes may appear at the start. In s."""


def effective_seq(seq: int) -> int:
    """Tick from which an answer to the state of tick `seq` holds."""
    return seq + PERIOD_TICKS


def period_of(tick: int) -> int:
    """First tick of the period in which a tick lies: nothing that holds changes within it."""
    return tick - tick % PERIOD_TICKS
