"""What the supervisor tells people."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.layout import RobotMode


@dataclass(frozen=True)
class SupervisorStatus:
    """What the supervisor tells people.

    Attributes:
        mode: In force from `effective_seq` of the last answer on.
        requested: By the operator.
        stand, walk, segway: Why that mode is refused now; empty when it would be entered.
        faults: What is wrong, in words.
        fallen: Whether Cassie fell and has not been set upright since.
        waits: What she waits for while she stands as asked for: to be let down, or for rest.
        link: Whether the operator's commands arrive over a good link.
    """

    mode: RobotMode = RobotMode.OFF
    requested: RobotMode = RobotMode.STAND
    stand: str = ""
    walk: str = ""
    segway: str = ""
    faults: tuple[str, ...] = ()
    fallen: bool = False
    waits: str = ""
    link: bool = False

    @property
    def readiness(self) -> str:
        """Why the requested mode is not in force, or what it waits for; empty when it is."""
        if self.mode == self.requested:
            return self.waits
        reasons = {
            RobotMode.STAND: self.stand,
            RobotMode.WALK: self.walk,
            RobotMode.SEGWAY: self.segway,
        }
        return reasons.get(self.requested, "")
