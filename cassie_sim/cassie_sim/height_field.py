"""Hard ground of random height, by seed."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from cassie_sim.ground import Surface, make_ground
from cassie_sim.scene_parameters import Rough
from cassie_sim.stretches import Stretch, add_stretches

FloatArray = npt.NDArray[np.float64]

CELL = 0.05
"""Distance of the grid's points. In m."""

_HALF_WIDTH = 4.0
_FADE = 0.5  # the field comes out of level ground, and goes back into it, over this length, in m
_BASE = 1.0  # of ground below the lowest point, in m


def random_heights(settings: Rough) -> FloatArray:
    """Heights over the field; level at both ends. Shape (across, along), in m.

    White noise through a Gaussian of the width `grain`, scaled to the standard deviation
    `height` and cut at three times it.
    """
    along = round(settings.length / CELL) + 1
    across = round(2.0 * _HALF_WIDTH / CELL) + 1
    rng = np.random.default_rng(settings.seed)
    heights: FloatArray = gaussian_filter(
        rng.standard_normal((across, along)), settings.grain / CELL / 2.0, mode="reflect"
    )
    heights *= settings.height / max(float(heights.std()), 1e-12)
    heights = heights.clip(-3.0 * settings.height, 3.0 * settings.height)
    x = np.arange(along) * CELL
    faded: FloatArray = heights * (np.minimum(x, x[-1] - x) / _FADE).clip(0.0, 1.0)
    return faded


def add_rough(spec: mujoco.MjSpec, settings: Rough) -> None:
    """Level ground up to `start`, the field, and level ground beyond it."""
    heights = random_heights(settings)
    low, high = float(heights.min()), float(heights.max())
    span = max(high - low, 1e-6)
    spec.add_hfield(
        name="rough",
        size=[0.5 * settings.length, _HALF_WIDTH, span, _BASE],
        nrow=heights.shape[0],
        ncol=heights.shape[1],
        userdata=((heights - low) / span).ravel().tolist(),
    )
    geom = spec.worldbody.add_geom(
        name="rough",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="rough",
        pos=[settings.start + 0.5 * settings.length, 0.0, low],
    )
    make_ground(spec, geom, Surface(settings.friction))
    _add_level(spec, settings)


def _add_level(spec: mujoco.MjSpec, settings: Rough) -> None:
    """Boxes before and behind the field."""
    add_stretches(spec, (Stretch(length=settings.start, friction=settings.friction),), 0)
    half = 50.0
    geom = spec.worldbody.add_geom(
        name="beyond",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[half, 20.0, 1.0],
        pos=[settings.start + settings.length + half, 0.0, -1.0],
    )
    make_ground(spec, geom, Surface(settings.friction))
