"""Kinematics of Cassie's legs with deflected springs, compiled for the control loop.

Everything is in the pelvis frame. The chain runs hip_roll, hip_yaw, hip_pitch, knee, shin,
tarsus, toe; the heel spring's deflection follows from the achilles rod (`linkage`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.leg_kernels import leg_kinematics, spring_force, update_pair
from cassie_gaits.leg_records import LEG_TYPE, PAIR_TYPE, STATE_TYPE, RecordArray
from cassie_gaits.linkage import heel_loop, link_rotation, pin_in_target
from cassie_gaits.names import LEG_JOINTS, LEGS

FloatArray = npt.NDArray[np.float64]


class LegState:
    """Result of `LegChain.update`; the arrays are reused.

    Attributes:
        axes: Joint axes. Shape (7, 3).
        origins: Origins of the links, on the joint axes. Shape (7, 3), in m.
        foot: Middle of the sole's centre line. Shape (3,), in m.
        foot_velocity: Its velocity against the pelvis. Shape (3,), in m/s.
        foot_rotation: Toe link to pelvis. Shape (3, 3).
        ankle: Toe joint. Shape (3,), in m.
        ankle_jacobian: Of the toe joint's position by the seven joints. Shape (3, 7), in m/rad.
        com_moment: Sum of mass times position over the leg's links. Shape (3,), in kg m.
        com_rate: Its rate of change against the pelvis. Shape (3,), in kg m/s.
        springs: Deflection of shin and heel spring. Shape (2,), in rad. The heel spring's is 0
            where the achilles rod does not reach, which no true angles are.
        heel_gradient: Derivative of the heel spring's deflection by shin and tarsus. Shape (2,).
        lower_leg: Derivative by shin and by tarsus of the sum of mass times position below the
            springs, when the foot keeps its attitude. Shape (2, 3), in kg m/rad.
    """

    def __init__(self) -> None:
        self.records = np.zeros(1, STATE_TYPE)
        """The same as numpy's record, for compiled functions. Shape (1,)."""
        record = self.records[0]
        self.axes: FloatArray = record["axes"]
        self.origins: FloatArray = record["origins"]
        self.foot: FloatArray = record["foot"]
        self.foot_velocity: FloatArray = record["foot_velocity"]
        self.foot_rotation: FloatArray = record["foot_rotation"]
        self.ankle: FloatArray = record["ankle"]
        self.ankle_jacobian: FloatArray = record["ankle_jacobian"]
        self.com_moment: FloatArray = record["com_moment"]
        self.com_rate: FloatArray = record["com_rate"]
        self.springs: FloatArray = record["springs"]
        self.heel_gradient: FloatArray = record["heel_gradient"]
        self.lower_leg: FloatArray = record["lower_leg"]


class LegChain:
    """Forward kinematics, centre of mass and spring forces of one leg.

    Args:
        leg: "left" or "right".
    """

    def __init__(self, leg: str) -> None:
        self._leg = _leg_record(leg)
        self._loop = heel_loop()
        self.mass = float(self._leg["masses"].sum())
        """Of the whole leg. In kg."""
        self.state = LegState()
        # The first calls load the compiled functions, or make them.
        bend = 1.2
        self.update(
            np.array([0.0, 0.0, 0.5, -bend, 0.0, bend + robot.NEUTRAL_TARSUS, -1.6]), np.zeros(7)
        )
        self.force(0.0, np.array([0.0, 0.0, 1.0]))

    def update(self, joints: FloatArray, rates: FloatArray) -> LegState:
        """Kinematics at a measured pose.

        Args:
            joints: Shape (7,), in rad.
            rates: Shape (7,), in rad/s.

        Returns:
            `state`, changed in place.
        """
        leg_kinematics(joints, rates, self._leg, self._loop, self.state.records)
        return self.state

    def force(self, toe_torque: float, up: FloatArray) -> tuple[float, float, float]:
        """Ground force on the foot in the leg's plane, from the springs of the last update.

        The springs balance the ground force and the weight below them when shin and tarsus give
        way while the foot keeps its attitude:

            J_i F = dV/dq_i + g up . d(sum of m p)/dq_i + u_toe,   i = shin, tarsus,
            V = 1/2 k_shin q5^2 + 1/2 k_heel heel(q4, q5, q6)^2

        J moves the toe joint. The toe drive balances the ground's moment about it, and the
        foot's weight: the foot counts as a mass at the toe joint. Inertia is left out, so that a
        swinging leg shows some force too.

        Args:
            toe_torque: Of the toe drive at the joint. In Nm.
            up: Unit vector against gravity in the pelvis frame. Shape (3,).

        Returns:
            Force on the foot in the pelvis frame, in N. Zero where the achilles rod does not
            reach, and where shin and tarsus are in line and so cannot tell the force.

        Source:
            The paper takes contact from the springs' deflection without a formula; its heel
            deflection q4 + q5 + q6 - 13 degrees (eq:SpringJacobian) is not used: see `linkage`.
        """
        return spring_force(self._leg, self.state.records, toe_torque, up)


class LegPair:
    """Both legs at once, in one call of compiled code.

    Attributes:
        record: All its numbers, for compiled functions, of `PAIR_TYPE`. Shape (1,).
        states: Kinematics of left and right, see `LegState`, as numpy's records. Shape (2,).
        forces: Of the ground on each foot against gravity. Shape (2,), in N.
    """

    def __init__(self) -> None:
        self.record: RecordArray = np.zeros(1, PAIR_TYPE)
        pair = self.record[0]
        pair["legs"] = np.concatenate([_leg_record(leg) for leg in LEGS])
        pair["loop"] = heel_loop()
        self.states: RecordArray = pair["states"]
        self.forces: FloatArray = pair["forces"]

    def update(
        self, joints: FloatArray, rates: FloatArray, toe_torques: FloatArray, up: FloatArray
    ) -> None:
        """Kinematics and forces (see `LegChain.force`) at a measured pose.

        Args:
            joints: Shape (2, 7), in rad.
            rates: Shape (2, 7), in rad/s.
            toe_torques: Of the toe drives at the joint. Shape (2,), in Nm.
            up: Unit vector against gravity in the pelvis frame. Shape (3,).
        """
        update_pair(joints, rates, toe_torques, up, self.record)


def _leg_record(name: str) -> RecordArray:
    """The numbers of a leg, of `LEG_TYPE`. Shape (1,).

    What hangs on a link counts with it. The heel spring gives way by a few degrees only and counts
    as fixed to the tarsus. The achilles rod is a mass at each of its ends. Foot crank, plantar
    rod, foot and tarsus are a parallelogram: the crank turns with the foot, the rod does not.
    """
    links = {link.name: link for link in robot.leg_links(name)}
    legs = np.zeros(1, LEG_TYPE)
    leg = legs[0]
    for i, joint in enumerate(LEG_JOINTS):
        link = links[joint]
        leg["positions"][i] = link.position
        leg["rotations"][i] = link_rotation(link)
        leg["zeros"][i] = link.joint.zero
        _add_mass(leg, joint, link.mass, np.array(link.com))
    _add_fixed(leg, "knee", links["knee_spring"])
    _add_fixed(leg, "tarsus", links["heel_spring"])
    _add_achilles_rod(leg, links, mirrored=name == "right")
    crank, rod = links["foot_crank"], links["plantar_rod"]
    _add_mass(leg, "tarsus", crank.mass, np.array(crank.position))
    _add_mass(leg, "tarsus", rod.mass, np.add(crank.position, rod.com))
    turning = crank.mass * np.array(crank.com) + rod.mass * np.array(rod.position)
    leg["moments"][LEG_JOINTS.index("toe")] += turning
    leg["sole"] = np.mean(np.array(robot.FOOT_CONTACTS), axis=0)
    leg["shin_stiffness"] = links["shin"].joint.stiffness
    leg["heel_stiffness"] = links["heel_spring"].joint.stiffness
    return legs


def _add_mass(leg: np.void, joint: str, mass: float, position: FloatArray) -> None:
    i = LEG_JOINTS.index(joint)
    leg["masses"][i] += mass
    leg["moments"][i] += mass * position


def _add_fixed(leg: np.void, joint: str, link: robot.Link) -> None:
    _add_mass(leg, joint, link.mass, link.position + link_rotation(link) @ link.com)


def _add_achilles_rod(leg: np.void, links: dict[str, robot.Link], *, mirrored: bool) -> None:
    rod, heel = links["achilles_rod"], links["heel_spring"]
    closure = next(closure for closure in robot.RODS if closure.rod == rod.name)
    pin = pin_in_target(closure) * (1.0, 1.0, -1.0 if mirrored else 1.0)
    axes, far = link_rotation(heel), rod.mass * rod.com[0] / closure.length
    _add_mass(leg, "hip_pitch", rod.mass - far, np.array(rod.position))
    _add_mass(leg, "tarsus", far, heel.position + axes @ pin)
    leg["swing"] = np.cross(axes[:, 2], axes @ (far * pin + heel.mass * np.array(heel.com)))
