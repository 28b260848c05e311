"""What walking controls: the nine outputs of eq:h0, measured."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_control.controller.readings import LegReadings, Readings
from cassie_gaits import virtual_leg

FloatArray = npt.NDArray[np.float64]

ROLL, YAW_ST, PITCH, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW = range(9)
"""Rows of eq:h0; `cassie_gaits.gait_library.OUTPUTS` names them."""


def measure(
    readings: Readings,
    stance: LegReadings,
    swing: LegReadings,
    outputs: FloatArray,
    rates: FloatArray,
) -> None:
    """Outputs h_0 and their rates.

    Args:
        readings: The robot now.
        stance, swing: Its legs.
        outputs: Result. Shape (9,), in rad and m.
        rates: Result, their time derivatives. Shape (9,), in rad/s and m/s.

    Source:
        eq:h0 and eq:AbsoluteQuantities (README of cassie_gaits, Errata).
    """
    st, sw, st_rate, sw_rate = stance.joints, swing.joints, stance.rates, swing.rates
    outputs[:] = (
        readings.roll,
        st[1],
        readings.pitch,
        virtual_leg.length(st[3]),
        virtual_leg.roll(readings.roll, sw[0]),
        sw[1],
        virtual_leg.pitch(readings.pitch, sw[2], sw[3]),
        virtual_leg.length(sw[3]),
        virtual_leg.foot_pitch(readings.pitch, sw[2], sw[6]),
    )
    rates[:] = (
        readings.roll_rate,
        st_rate[1],
        readings.pitch_rate,
        virtual_leg.length_rate(st[3], st_rate[3]),
        readings.roll_rate + sw_rate[0],
        sw_rate[1],
        virtual_leg.pitch_rate(sw[3], readings.pitch_rate, sw_rate[2], sw_rate[3]),
        virtual_leg.length_rate(sw[3], sw_rate[3]),
        -readings.pitch_rate + sw_rate[2] + sw_rate[6],
    )
