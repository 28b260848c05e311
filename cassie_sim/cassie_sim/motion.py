"""Ground that moves by itself: it tilts, or lifts a foot."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from cassie_sim.ground import tilt


@dataclass(frozen=True)
class GroundMotion:
    """A motion of one body of the ground at a constant rate, from a moment on.

    Attributes:
        body: Name of the mocap body that moves, its origin the hinge.
        start: When it begins. In s.
        tilt_ahead: Rise ahead in the end. In rad.
        tilt_left: Rise to the left in the end. In rad.
        lift: Height in the end. In m.
        duration: How long it takes; 0 is there from the beginning. In s.
    """

    body: str
    start: float
    tilt_ahead: float
    tilt_left: float
    lift: float
    duration: float

    def share(self, time: float) -> float:
        """How far it has come at a time (s), 0 to 1."""
        if self.duration <= 0.0:
            return 1.0
        return min(1.0, max(0.0, (time - self.start) / self.duration))

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, time: float) -> None:
        """Put the ground where it is at a time (s)."""
        share = self.share(time)
        index = model.body(self.body).mocapid[0]
        data.mocap_pos[index, 2] = model.body(self.body).pos[2] + share * self.lift
        data.mocap_quat[index] = tilt(share * self.tilt_ahead, share * self.tilt_left)
