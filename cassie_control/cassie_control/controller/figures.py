"""What the walking law takes for granted, as compiled functions read it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_control.controller.config import WalkConfig
from cassie_control.controller.readings import HIP_X, HIP_Z, WEIGHT
from cassie_control.controller.records import FIGURES_TYPE, RecordArray
from cassie_control.controller.swing_inertia import INERTIA
from cassie_gaits import bezier, robot, virtual_leg
from cassie_gaits.names import LEG_DRIVES

FloatArray = npt.NDArray[np.float64]


def _least_effort() -> FloatArray:
    """From a polynomial's first and last two coefficients to the two between. Shape (2, 4).

    They give the least integral of the squared second derivative.
    """
    bends = np.array([bezier.basis(phase)[:, 2] for phase in np.linspace(0.0, 1.0, 41)])
    ends = bends[:, (0, 1, 4, 5)]
    result: FloatArray = -np.linalg.lstsq(bends[:, 2:4], ends, rcond=None)[0]
    return result


_LEAST_EFFORT = _least_effort()
_BESIDE_THE_PAPER = (
    *("straight", "share_force", "level", "swing_inertia"),
    *("bounce_damping", "thigh_angle", "thigh_rate"),
)


def figures(config: WalkConfig, period: float, latency: float = 0.0) -> RecordArray:
    """Figures of a configuration, of the control period (s), of the robot, and of its drives.

    They are of `records.FIGURES_TYPE`. Shape (1,).

    What the walking law has beside the paper's is left out under the paper's own. As far as the
    drives act late on commands (`latency`, in s), gains go over to those for late ones.
    """
    records = np.zeros(1, FIGURES_TYPE)
    figure = records[0]
    for name in FIGURES_TYPE.names or ():
        if hasattr(config, name):
            figure[name] = getattr(config, name)
    figure["straight"] = figure["share_force"] = 1.0
    figure["kp"] = [getattr(config.joints, f"kp_{name}") for name in LEG_DRIVES]
    figure["kd"] = [getattr(config.joints, f"kd_{name}") for name in LEG_DRIVES]
    if config.law == "paper":
        for name in _BESIDE_THE_PAPER:
            figure[name] = 0.0
    else:
        _allow_for(figure, config, latency)
    figure["period"] = period
    figure["weight"], figure["mass"] = config.gravity * WEIGHT, robot.total_mass()
    figure["hip_x"], figure["hip_z"] = HIP_X, HIP_Z
    figure["thigh"], figure["shin"] = virtual_leg.THIGH, virtual_leg.SHIN
    figure["knee_offset"], figure["hip_offset"] = virtual_leg.KNEE_OFFSET, virtual_leg.HIP_OFFSET
    figure["toe_offset"], figure["neutral_tarsus"] = virtual_leg.TOE_OFFSET, robot.NEUTRAL_TARSUS
    figure["inertia"], figure["least_effort"] = INERTIA, _LEAST_EFFORT
    return records


def _allow_for(figure: np.void, config: WalkConfig, latency: float) -> None:
    """Gains for drives that act late."""
    late, share = config.late, config.late.walking_share(latency)
    if share == 0.0:
        return
    figure["latency"], figure["handover"] = latency, late.handover
    for name in ("thigh_track", "thigh_angle", "thigh_rate"):
        figure[name] += share * (getattr(late, name) - figure[name])
