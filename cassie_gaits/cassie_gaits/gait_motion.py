"""Motion of a robot with rigid springs in a gait, as numbers for pictures and tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cassie_gaits import robot
from cassie_gaits.certificate import states
from cassie_gaits.certificate.certify import mirror_image, motion_that_may_break, terms
from cassie_gaits.certificate.rollout import Step, integrate
from cassie_gaits.certificate.table import foot_places
from cassie_gaits.certificate.walker import Walker, rigid_velocity, walker
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.names import LEGS
from cassie_gaits.records import FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the step on the right leg, and work of both steps.

    Attributes:
        gait: Gait of the motion.
        walker: Equations of motion.
        step: Step, integrated under the gait's torques.
        feet: Swing sole relative to the stance sole, in ground axes. Shape (n, 3), in m.
        friction: Ratio of tangential to normal ground force. Shape (n,).
        work: Absolute mechanical work of the drives in two steps. In J.
        positive_work: Positive part of that work. In J.
        distance: Path length of two steps. In m.
    """

    gait: Gait
    walker: Walker
    step: Step
    feet: FloatArray
    friction: FloatArray
    work: float
    positive_work: float
    distance: float

    @property
    def cost_of_transport(self) -> float:
        """Absolute mechanical work per weight and distance; infinite in place."""
        return self._transport(self.work)

    @property
    def positive_cost_of_transport(self) -> float:
        """Positive work per weight and distance, the cost for drives that cannot store energy."""
        return self._transport(self.positive_work)

    @property
    def torque_shares(self) -> FloatArray:
        """Ratio of each drive's largest torque in this step to its limit. (2, 5), stance, swing."""
        peaks: FloatArray = np.abs(self.step.torques).max(axis=0).reshape(2, 5) / TORQUE_LIMITS[:5]
        result: FloatArray = peaks[::-1]  # the right leg is the stance leg
        return result

    def _transport(self, work: float) -> float:
        if self.distance < 1e-6:
            return float("inf")
        return work / (robot.WEIGHT * self.distance)


def motion(gait: Gait) -> Motion:
    """Integrate a gait.

    Raises:
        GaitLibraryError: if the gait has no torques, passive motion or request, or its motion
            cannot be integrated to its end.
    """
    if gait.torques is None or gait.passive is None:
        raise GaitLibraryError("the gait has no torques or no passive motion")
    asked = terms(gait)
    with motion_that_may_break():
        equations = walker(symmetric=asked.symmetric, slope=asked.slope, payload=asked.payload)
        step = integrate(equations, gait, 0)
        powers = _powers(step)
        if asked.symmetric and mirror_image(gait):
            second = powers
        else:
            second = _powers(integrate(equations, gait, 1))
    seconds = gait.step_time / (len(step.phases) - 1)
    way = 2.0 * gait.step_time * float(np.hypot(gait.vx, gait.vy))
    forces = step.forces
    return Motion(
        gait,
        equations,
        step,
        foot_places(equations, step),
        np.hypot(forces[:, 0], forces[:, 1]) / forces[:, 2],
        seconds * float(np.abs(powers).sum() + np.abs(second).sum()),
        seconds * float(np.maximum(powers, 0.0).sum() + np.maximum(second, 0.0).sum()),
        way,
    )


def _powers(step: Step) -> FloatArray:
    """Mechanical power of each drive, with half weight at both ends. Shape (n, 10), in W."""
    rates = np.array([rigid_velocity(v)[6:] for v in step.v])
    powers: FloatArray = step.torques * rates
    powers[[0, -1]] *= 0.5
    return powers


def figures(at: Motion, count: int) -> list[dict[str, FloatArray]]:
    """Stick figures of two steps, from left to right: points of pelvis and legs.

    Args:
        at: The motion.
        count: Number of figures per step.

    Returns:
        For each figure the torso's outline (4, 3) and both legs' skeletons (7, 3), in m, in the
        world. The second step is shown as the mirror image of the first.
    """
    result = []
    foot = np.zeros(3)
    for step in range(2):
        stance, swing = states.legs(at.step.domain)
        for i in np.linspace(0, len(at.step.phases) - 1, count, endpoint=False).astype(int):
            q = at.step.q[i]
            parts = {leg: at.walker.tree.skeleton(q, leg) for leg in LEGS}
            torso = _torso(q)
            if step:
                parts = {stance: parts[swing], swing: parts[stance]}
            result.append({name: part + foot for name, part in {"torso": torso, **parts}.items()})
        foot = at.feet[-1] * np.array([1.0, 0.0, 1.0])
    return result


def _torso(q: FloatArray) -> FloatArray:
    """Outline of the pelvis as a box in the sagittal plane. Shape (4, 3)."""
    c, s = np.cos(q[4]), np.sin(q[4])
    corners = np.array([[-0.08, -0.05], [0.12, -0.05], [0.12, 0.12], [-0.08, 0.12]])
    x, z = corners.T
    return np.column_stack([q[0] + c * x + s * z, np.full(4, q[1]), q[2] - s * x + c * z])
