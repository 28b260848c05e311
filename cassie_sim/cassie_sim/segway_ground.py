"""Ground under a Segway: rolling resistance and bumps."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from cassie_gaits.records import FloatArray
from cassie_sim.ground import Surface, make_ground
from cassie_sim.height_field import FIELD_HALF_WIDTH, filtered_noise
from cassie_sim.scene_parameters import Segway
from cassie_sim.stretches import COLOURS


@dataclass(frozen=True)
class Way:
    """A kind of road surface.

    Attributes:
        rolling: Ratio of rolling resistance to weight.
        height: Standard deviation of the height. In m.
        grain: Distance over which the height changes. In m.
        colour: Name in `stretches.COLOURS`.
    """

    rolling: float
    height: float
    grain: float
    colour: str


WAYS = {
    "floor": Way(0.015, 0.0, 1.0, "concrete"),
    "sidewalk": Way(0.015, 0.002, 0.3, "concrete"),
    "grass": Way(0.04, 0.006, 0.4, "grass"),
}
"""Rolling resistance of pneumatic tyres: 0.01 on new to 0.02 on worn concrete, 0.04 to 0.08 on
medium hard soil (engineeringtoolbox.com, "Rolling Friction and Resistance"; J. Carvill, Mechanical
Engineer's Data Handbook). Heights are estimates: joints of slabs, and a mown lawn. At wavelengths
of 1 to 2 m, which shake a rider at 4 m/s with 2 to 4 Hz, the lawn has the power spectral density of
class D of ISO 8608 (1024e-6 m^3 at 0.1 cycles/m, proportional to the wavelength squared). At longer
and shorter wavelengths the lawn is smoother than that."""

_CELL = 0.1  # m, spacing of the grid's points
_START = 1.0  # m ahead of the start, where the bumps begin
_FADE = 2.0  # m over which the bumps grow from level ground
_BASE = 0.5  # m, thickness of the ground below the lowest point


def heights(settings: Segway, way: Way) -> FloatArray:
    """Heights above level ground; zero at the field's edges. Shape (across, along), in m."""
    rng = np.random.default_rng(settings.seed)
    field = filtered_noise(settings.length, way.height, way.grain, _CELL, rng) + 3.0 * way.height
    across, along = field.shape
    x, y = np.arange(along) * _CELL, np.arange(across) * _CELL
    fade_x = (np.minimum(x, x[-1] - x) / _FADE).clip(0.0, 1.0)
    fade_y = (np.minimum(y, y[-1] - y) / _FADE).clip(0.0, 1.0)
    faded: FloatArray = field * np.minimum(fade_x[None, :], fade_y[:, None])
    return faded


def add_bumps(spec: mujoco.MjSpec, settings: Segway, way: Way) -> None:
    """Add the uneven ground ahead of the start."""
    field = heights(settings, way)
    top = float(field.max())
    spec.add_hfield(
        name="way",
        size=[0.5 * settings.length, FIELD_HALF_WIDTH, top, _BASE],
        nrow=field.shape[0],
        ncol=field.shape[1],
        userdata=(field / top).ravel().tolist(),
    )
    geom = spec.worldbody.add_geom(
        name="way",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="way",
        pos=[_START + 0.5 * settings.length, 0.0, 0.0],
    )
    make_ground(spec, geom, Surface(settings.friction, 0.0, COLOURS[way.colour]))
