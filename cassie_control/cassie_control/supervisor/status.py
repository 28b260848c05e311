"""Status of the supervisor, for people."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cassie_control.estimator.channels import names
from cassie_msgs.layout import RobotMode


@dataclass(frozen=True)
class SupervisorStatus:
    """Status of the supervisor, for people.

    Attributes:
        mode: Mode in force from `effective_seq` of the last answer on.
        requested: Mode that the operator asks for.
        stand, walk, segway: Why that mode is refused now; empty when it would be entered.
        faults: What is wrong, in words.
        fallen: Whether Cassie fell and has not been set upright since.
        waits: What the robot waits for in the requested stand: to be let down, or for rest.
        link: Whether the operator's commands arrive over a good link.
        missed_share: Share of the last minute's control ticks without a new command. 0..1.
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
    missed_share: float = 0.0

    @property
    def readiness(self) -> str:
        """Why the requested mode is not in force, or what the robot waits for in it; or empty."""
        if self.mode == self.requested:
            return self.waits
        reasons = {
            RobotMode.STAND: self.stand,
            RobotMode.WALK: self.walk,
            RobotMode.SEGWAY: self.segway,
        }
        return reasons.get(self.requested, "")


def damped(status: SupervisorStatus, problem: str) -> SupervisorStatus:
    """The status where the supervisor cannot decide, and the drives damp."""
    return replace(
        status,
        mode=RobotMode.DAMP,
        stand=problem,
        walk=problem,
        segway=problem,
        faults=(f"drives damp: {problem}",),
    )


def faults(
    fallen: bool,
    powered: bool,
    rides: bool,
    linked: bool,
    refused: str,
    failed: int,
    missed: float,
    battery: str,
) -> tuple[str, ...]:
    """What is wrong, in words.

    Args:
        fallen: Whether Cassie fell.
        powered: Whether the drives have power.
        rides: Whether it rides a Segway, on which it brakes in place of standing.
        linked: Whether the operator's commands arrive over a good link, where they are needed.
        refused: Why the operator's command is refused, or empty.
        failed: Sensors' channels that fail, a bit each.
        missed: Share of missed control ticks if it is too large, else 0.
        battery: What is wrong with the battery, or empty.
    """
    words = []
    stops = "braking and riding on" if rides else "stopping and standing"
    if fallen:
        words.append("fallen: drives damp" if powered else "fallen")
    if not linked:
        words.append(f"operator lost: {stops}")
    if refused:
        words.append(f"operator command refused: {refused}")
    if failed:
        words.append(f"{stops} without {', '.join(names(failed))}")
    if missed:
        words.append(f"{stops}: {100.0 * missed:.0f} % of control ticks missed")
    if battery:
        words.append(battery)
    return tuple(words)
