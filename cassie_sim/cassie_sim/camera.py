"""Off-screen rendering of the plant."""

from __future__ import annotations

import ctypes
import os
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_sim.errors import SimulationError

Image = npt.NDArray[np.uint8]
_BACKENDS = {"egl": "libEGL.so.1", "osmesa": "libOSMesa.so.8"}
PACKAGES = "libegl1 and libgl1-mesa-dri (or libosmesa6)"
"""Debian packages that rendering needs."""


class RenderError(SimulationError):
    """This machine cannot render."""


def frame_of(data: mujoco.MjData) -> npt.NDArray[np.float64]:
    """The state that a picture needs: qpos, then positions and quaternions of moving ground."""
    return np.concatenate([data.qpos, data.mocap_pos.ravel(), data.mocap_quat.ravel()])


def frame_size(model: mujoco.MjModel) -> int:
    """Length of `frame_of`."""
    return int(model.nq + 7 * model.nmocap)


class Camera:
    """Renders frames of a model off screen, with EGL or OSMesa.

    Use it only in the thread that makes it.

    Args:
        model: Model with or without meshes.
        width: Width of the picture. In pixels.
        height: Height of the picture. In pixels.
        camera: Name of a camera of the model.
        fine: Whether to render smooth edges and shadows. Without a graphics card they take five
            times as long as the picture itself, so use them for single pictures.

    Raises:
        RenderError: if this machine cannot render; the message names the packages.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int = 640,
        height: int = 480,
        camera: str = "track",
        *,
        fine: bool = False,
    ) -> None:
        self.model = model
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        model.vis.quality.offsamples = 4 if fine else 0
        self._gl = _gl_context(width, height)
        self._gl.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=2000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = fine
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._view = mujoco.MjvCamera()
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = model.camera(camera).id
        self._option = mujoco.MjvOption()
        self._data = mujoco.MjData(model)
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._pixels: Image = np.zeros((height, width, 3), np.uint8)

    def picture(self, frame: npt.NDArray[np.float64]) -> Image:
        """Picture of the model in the state `frame`. Shape (height, width, 3); a copy."""
        nq, grounds = self.model.nq, self.model.nmocap
        self._data.qpos[:] = frame[:nq]
        self._data.mocap_pos[:] = frame[nq : nq + 3 * grounds].reshape(-1, 3)
        self._data.mocap_quat[:] = frame[nq + 3 * grounds :].reshape(-1, 4)
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_comPos(self.model, self._data)
        mujoco.mj_camlight(self.model, self._data)
        # Update the camera first, as an infinite plane is drawn around the camera's last position.
        mujoco.mjv_updateCamera(self.model, self._data, self._view, self._scene)
        mujoco.mjv_updateScene(
            self.model,
            self._data,
            self._option,
            None,
            self._view,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        mujoco.mjr_render(self._viewport, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._viewport, self._context)
        return np.flipud(self._pixels).copy()

    def close(self) -> None:
        """Release the graphics memory."""
        self._context.free()
        self._gl.free()


def _gl_context(width: int, height: int) -> Any:
    """An OpenGL context without a window, which can be made current."""
    problems = []
    for backend, library in _BACKENDS.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            problems.append(f"{library} is not installed")
            continue
        try:
            os.environ["PYOPENGL_PLATFORM"] = backend
            if backend == "egl":
                from mujoco.egl import GLContext
            else:
                from mujoco.osmesa import GLContext
            return GLContext(width, height)
        except Exception as error:  # the bindings raise any error of their loader
            problems.append(f"{backend}: {error}")
    raise RenderError(
        f"cannot render off screen ({'; '.join(problems)}): install the Debian packages {PACKAGES}"
    )
