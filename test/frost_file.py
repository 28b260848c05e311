"""This project's gaits as MATLAB tools around FROST leave theirs, for tests of the import."""

from __future__ import annotations

import numpy as np

from cassie_gaits import bezier, virtual_leg
from cassie_gaits.gait_library import OUTPUTS
from cassie_gaits.gait_library_file import library_path, load_library

LIBRARY = load_library(library_path("optimized"))


def alpha(coefficients, stance):
    """Our outputs as a FROST-style (10, 6); a level foot's toe angle, fitted."""
    row = dict(zip(OUTPUTS, coefficients, strict=True))
    phases = np.linspace(0.0, 1.0, 41)
    basis = np.array([bezier.basis(phase)[:, 0] for phase in phases])
    curves = np.array([row["swing_leg_pitch"], row["swing_leg_length"]])
    toes = [
        virtual_leg.toe_angle(0.0, 0.0, virtual_leg.hip_pitch_angle(pitch, 0.0, length))
        for pitch, length in (basis @ curves.T).tolist()
    ]
    toe = np.linalg.lstsq(basis, np.array(toes), rcond=None)[0]
    st = [np.zeros(6), row["stance_hip_yaw"], np.zeros(6), row["stance_leg_length"], np.zeros(6)]
    sw = [row["swing_leg_roll"], row["swing_hip_yaw"], *curves, toe]
    return np.array([*sw, *st] if stance == "right" else [*st, *sw])


def content(sign=1.0):
    stances = {}
    for i, name in enumerate(("right", "left")):
        halpha = np.array([alpha(gait.coefficients[i], name) for gait in LIBRARY.gaits])
        halpha[:, [2, 7]] *= sign
        stances[name] = {"HAlpha": halpha}
    speeds = np.array([[gait.vx for gait in LIBRARY.gaits], [0.0] * len(LIBRARY.gaits)])
    return {
        "RightStance": stances["right"],
        "LeftStance": stances["left"],
        "ct": np.full((1, len(LIBRARY.gaits)), 2.5),
        "Velocity": speeds,
    }
