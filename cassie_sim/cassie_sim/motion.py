"""Ground that moves by itself: it tilts, or lifts one foot."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from cassie_sim.ground import tilt


@dataclass(frozen=True)
class GroundMotion:
    """A motion of one body of the ground at a constant rate.

    Attributes:
        body: Name of the mocap body that moves; its origin is the hinge.
        start: Time at which the motion begins. In s.
        tilt_ahead: Final rise ahead. In rad.
        tilt_left: Final rise to the left. In rad.
        lift: Final height. In m.
        duration: Duration of the motion; 0: the final state from the beginning. In s.
    """

    body: str
    start: float
    tilt_ahead: float
    tilt_left: float
    lift: float
    duration: float

    def share(self, time: float) -> float:
        """Share of the motion that is done at a time (s), 0 to 1."""
        if self.duration <= 0.0:
            return 1.0
        return min(1.0, max(0.0, (time - self.start) / self.duration))

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, time: float) -> None:
        """Set the pose of the ground at a time (s)."""
        share = self.share(time)
        index = model.body(self.body).mocapid[0]
        data.mocap_pos[index, 2] = model.body(self.body).pos[2] + share * self.lift
        data.mocap_quat[index] = tilt(share * self.tilt_ahead, share * self.tilt_left)
