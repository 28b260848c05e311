"""The schedule of lock-step, which every node keeps to.

On every `PERIOD_TICKS`-th state k a scripted operator and the supervisor publish what holds from
tick k + `PERIOD_TICKS` on. So their answers cost the loop no time, and what holds at a tick does
not depend on the machine.
"""

from __future__ import annotations

PERIOD_TICKS = 10
"""Control ticks between commands of a scripted operator and between modes, and their lead."""

GAIT_TICKS = 250
"""Control ticks between requests for a gait, and the lead of each answer: 0.5 s at 500 Hz."""

STATUS_TICKS = 5
"""Control ticks between two messages of the controller's status."""
