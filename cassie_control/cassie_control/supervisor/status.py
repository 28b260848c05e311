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
        stepping: Whether she stands, yet with one foot off the ground.
        link: Whether the operator's commands arrive over a good link.
    """

    mode: RobotMode = RobotMode.OFF
    requested: RobotMode = RobotMode.STAND
    stand: str = ""
    walk: str = ""
    segway: str = ""
    faults: tuple[str, ...] = ()
    fallen: bool = False
    stepping: bool = False
    link: bool = False

    @property
    def readiness(self) -> str:
        """Why the requested mode is not in force, or stands with a step; empty when it is."""
        if self.mode == self.requested:
            return "one foot off the ground: stepping until she rests" if self.stepping else ""
        reasons = {
            RobotMode.STAND: self.stand,
            RobotMode.WALK: self.walk,
            RobotMode.SEGWAY: self.segway,
        }
        return reasons.get(self.requested, "")
