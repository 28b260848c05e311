"""Random heights of hard ground."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

CELL = 0.05
"""Distance of the grid's points, unless the grain is finer than two of them. In m."""

FIELD_HALF_WIDTH = 4.0
"""To both sides. In m."""

FIELD_BASE = 1.0
"""Of ground below the lowest point. In m."""

_FADE = 0.5  # the field comes out of level ground, and goes back into it, over this length, in m


def random_heights(
    length: float, height: float, grain: float, rng: np.random.Generator
) -> FloatArray:
    """Heights over a field; zero at both ends. Shape (across, along), in m.

    White noise through a Gaussian of the width `grain`, scaled to the standard deviation
    `height` and cut at three times it.

    Args:
        length: Along the ground. In m.
        height: Standard deviation. In m.
        grain: Distance over which the height changes. In m.
        rng: For the noise.
    """
    from scipy.ndimage import gaussian_filter  # loads for half a second; few need it

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
