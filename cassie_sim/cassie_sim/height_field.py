"""Random heights of hard ground."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

CELL = 0.05
"""Spacing of the grid's points, unless the grain is smaller than twice this value. In m."""

FIELD_HALF_WIDTH = 4.0
"""Half of the field's width. In m."""

FIELD_BASE = 1.0
"""Thickness of the ground below the lowest point. In m."""

_FADE = 0.5  # length of the transition from and to level ground, at both ends, in m


def random_heights(
    length: float, height: float, grain: float, rng: np.random.Generator
) -> FloatArray:
    """Heights over a field; zero at both ends. Shape (across, along), in m.

    This is white noise through a Gaussian filter of the width `grain`, scaled to the standard
    deviation `height` and clipped at three times `height`.

    Args:
        length: Length along the ground. In m.
        height: Standard deviation of the height. In m.
        grain: Distance over which the height changes. In m.
        rng: Source of the noise.
    """
    from scipy.ndimage import gaussian_filter  # takes half a second to load, and is seldom needed

    cell = min(CELL, 0.5 * grain)
    along = round(length / cell) + 1
    across = round(2.0 * FIELD_HALF_WIDTH / cell) + 1
    heights: FloatArray = gaussian_filter(
        rng.standard_normal((across, along)), grain / cell / 2.0, mode="reflect"
    )
    heights *= height / max(float(heights.std()), 1e-12)
    heights = heights.clip(-3.0 * height, 3.0 * height)
    x = np.arange(along) * cell
    faded: FloatArray = heights * (np.minimum(x, x[-1] - x) / _FADE).clip(0.0, 1.0)
    return faded
