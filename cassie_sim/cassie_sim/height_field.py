"""Random heights of hard ground."""

from __future__ import annotations

import numpy as np

from cassie_gaits.records import FloatArray

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
    """Heights over a field, as of `filtered_noise`; zero at both ends. Shape (across, along), in m.

    Args:
        length: Length along the ground. In m.
        height: Standard deviation of the height. In m.
        grain: Distance over which the height changes. In m.
        rng: Source of the noise.
    """
    cell = min(CELL, 0.5 * grain)
    heights = filtered_noise(length, height, grain, cell, rng)
    x = np.arange(heights.shape[1]) * cell
    faded: FloatArray = heights * (np.minimum(x, x[-1] - x) / _FADE).clip(0.0, 1.0)
    return faded


def filtered_noise(
    length: float, height: float, grain: float, cell: float, rng: np.random.Generator
) -> FloatArray:
    """White noise through a Gaussian filter of the width `grain`, as heights of a field.

    Args:
        length: Length along the ground. In m.
        height: Standard deviation of the result, which is clipped at three times this value. In m.
        grain: Distance over which the height changes. In m.
        cell: Spacing of the grid's points. In m.
        rng: Source of the noise.

    Returns:
        Heights. Shape (across, along), in m.
    """
    from scipy.ndimage import gaussian_filter  # takes half a second to load, and is seldom needed

    along = round(length / cell) + 1
    across = round(2.0 * FIELD_HALF_WIDTH / cell) + 1
    heights: FloatArray = gaussian_filter(
        rng.standard_normal((across, along)), grain / cell / 2.0, mode="reflect"
    )
    heights *= height / max(float(heights.std()), 1e-12)
    return heights.clip(-3.0 * height, 3.0 * height)
