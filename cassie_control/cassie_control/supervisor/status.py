"""What the supervisor tells people."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_control.estimator.channels import names
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


def faults(
    fallen: bool, linked: bool, refused: str, controller_lost: bool, failed: int
) -> tuple[str, ...]:
    """What is wrong, in words.

    Args:
        fallen: Whether Cassie fell.
        linked: Whether the operator's commands arrive over a good link.
        refused: Why his command is refused, or empty.
        controller_lost: Whether the controller is silent.
        failed: Sensors' channels that fail, a bit each.
    """
    words = []
    if fallen:
        words.append("fallen: drives damp")
    if not linked:
        words.append("operator lost: stopping and standing")
    if refused:
        words.append(f"operator command refused: {refused}")
    if failed:
        words.append(f"stopping and standing without {', '.join(names(failed))}")
    if controller_lost:
        words.append("gait controller lost: drives damp")
    return tuple(words)
