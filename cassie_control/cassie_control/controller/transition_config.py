"""What can be tuned of the changes between standing and walking."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.tunables import tunable


@dataclass(frozen=True, kw_only=True)
class TransitionConfig:
    """Between standing and walking."""

    lean_time: float = tunable(0.5, "s", 0.1, 2.0, "Lean before the first step")
    lean_roll: float = tunable(0.18, "rad", 0.0, 0.2, "Roll to the left of the lean onto one foot")
    stop_spread: float = tunable(
        0.03, "m", 0.0, 0.1, "How much farther out each foot lands before walking ends"
    )
    stop_first: float = tunable(2.0, "", 0.0, 10.0, "Steps with wider feet before walking may end")
    stop_vx: float = tunable(
        0.2, "m/s", 0.05, 1.0, "Largest CoM velocity fore or aft at the touchdown that ends walking"
    )
    stop_vy: float = tunable(
        0.35, "m/s", 0.05, 1.0, "Largest CoM velocity sideways at the touchdown that ends walking"
    )
    stop_steps: float = tunable(10.0, "", 1.0, 100.0, "Touchdowns after which walking ends anyway")
    recovery_step: bool = tunable(
        True, description="Step without being told when standing cannot hold a push"
    )
    recovery_x: float = tunable(
        0.035,
        "m",
        0.01,
        0.3,
        "Capture point ahead of the toes or behind the heels that asks for a recovery step",
    )
    recovery_y: float = tunable(
        0.03, "m", 0.01, 0.3, "Capture point outside the feet that asks for a recovery step"
    )
    recovery_height: float = tunable(
        0.8, "m", 0.4, 1.05, "Pelvis height below which it takes no recovery step"
    )
    recovery_lift: float = tunable(
        0.05, "m", 0.0, 0.15, "How much more the foot is lifted at the first recovery step"
    )
    recovery_steps: float = tunable(3.0, "", 1.0, 20.0, "Recovery steps before it stands again")
    blend_time: float = tunable(0.12, "s", 0.0, 2.0, "Blend of set-points after a change of mode")
