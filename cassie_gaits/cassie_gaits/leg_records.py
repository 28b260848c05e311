"""Records in which numbers of a leg go to compiled functions and come back: C structures of floats.

One record costs a compiled function no more to take than one array does.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

RecordArray = npt.NDArray[np.void]

LEG_TYPE = np.dtype(
    [
        ("positions", float, (7, 3)),  # of each link's frame in its parent's, in m
        ("rotations", float, (7, 3, 3)),  # the same, with the joint at its zero; columns are axes
        ("zeros", float, 7),  # in rad
        ("masses", float, 7),  # of the link with what moves along with it, in kg
        ("moments", float, (7, 3)),  # mass times centre of mass in the link's frame, in kg m
        ("swing", float, 3),  # rate of the tarsus's moment by the heel spring's angle, in kg m
        ("sole", float, 3),  # middle of the sole's centre line in the toe link, in m
        ("shin_stiffness", float),  # in Nm/rad
        ("heel_stiffness", float),
    ]
)
"""Numbers of one leg, hip_roll to toe."""

STATE_TYPE = np.dtype(
    [
        ("axes", float, (7, 3)),
        ("origins", float, (7, 3)),
        ("foot", float, 3),
        ("foot_velocity", float, 3),
        ("foot_rotation", float, (3, 3)),
        ("ankle", float, 3),
        ("ankle_jacobian", float, (3, 7)),
        ("com_moment", float, 3),
        ("com_rate", float, 3),
        ("springs", float, 2),
        ("heel_gradient", float, 2),
        ("lower_leg", float, (2, 3)),
    ]
)
"""Kinematics of one leg, see `leg_chain.LegState`."""

HEEL_LOOP_TYPE = np.dtype(
    [
        ("knee", float, 2),  # joint axes in the plane of the leg, each in its parent's frame
        ("shin", float, 2),
        ("tarsus", float, 2),
        ("knee_turn", float),  # of the frame about z from the hip pitch frame, less joint angles
        ("tarsus_turn", float),
        ("base", float, 3),  # the rod's base in the hip pitch frame, z from the knee's
        ("heel", float, 3),  # the heel spring's joint in the tarsus
        ("still", float, 3),  # tip from there: still + cosine cos(angle) + sine sin(angle)
        ("cosine", float, 3),
        ("sine", float, 3),
        ("reach", float),  # square of the tip's distance from there, less that of the rod's length
        ("branch", float),  # which of the two ways to close the loop is the spring's
    ]
)
"""The loop of the achilles rod, see `linkage.heel_loop`."""

PAIR_TYPE = np.dtype(
    [
        ("legs", LEG_TYPE, (2,)),
        ("loop", HEEL_LOOP_TYPE, (1,)),  # the same for both
        ("states", STATE_TYPE, (2,)),
        ("forces", float, (2,)),  # of the ground on each foot against gravity, in N
    ]
)
"""Both legs, left and right, see `leg_chain.LegPair`."""
