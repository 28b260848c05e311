"""Where MuJoCo's own functions and structures are, for compiled code that calls them."""

from __future__ import annotations

import ctypes

import mujoco


def mj_step_address() -> int:
    """Address of the `mj_step` that the `mujoco` package itself calls."""
    # A symbol is looked up in a library and in those it is linked with.
    library = ctypes.CDLL(mujoco._functions.__file__)
    return int(ctypes.cast(library.mj_step, ctypes.c_void_p).value or 0)


def addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Addresses of a model's and its data's C structures; valid as long as these live."""
    return int(model._address), int(data._address)
