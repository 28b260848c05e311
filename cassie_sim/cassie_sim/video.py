"""Pictures of the plant: off screen into a file, or in a window."""

from __future__ import annotations

import ctypes
import os
import queue
import threading
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_sim.errors import SimulationError

Image = npt.NDArray[np.uint8]
FORMATS = (".mp4", ".gif")
_BACKENDS = {"egl": "libEGL.so.1", "osmesa": "libOSMesa.so.8"}
_PACKAGES = "libegl1 and libgl1-mesa-dri (or libosmesa6)"


class RenderError(SimulationError):
    """This machine cannot render."""


class Camera:
    """Renders configurations of a model off screen, with EGL or OSMesa.

    Belongs to the thread that makes it.

    Args:
        model: With or without meshes.
        width: In pixels.
        height: In pixels.
        camera: Name of a camera of the model.
        fine: Smooth edges and shadows. Without a graphics card they cost five times the
            picture itself: for single pictures.

    Raises:
        RenderError: if this machine cannot; the message names the packages.
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

    def picture(self, qpos: npt.NDArray[np.float64]) -> Image:
        """The model in a configuration. Shape (height, width, 3); a copy."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_comPos(self.model, self._data)
        mujoco.mj_camlight(self.model, self._data)
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
        """Give the graphics memory back."""
        self._context.free()
        self._gl.free()


class Film:
    """Films a plant into a file, in a thread of its own: `snap` costs the loop a copy.

    Args:
        model: What is filmed.
        path: Ends in one of `FORMATS`.
        fps: Pictures per second of the file.

    Raises:
        SimulationError: if the format is unknown or its writer is not installed.
        RenderError: if this machine cannot render.
    """

    def __init__(self, model: mujoco.MjModel, path: Path, fps: float) -> None:
        if path.suffix not in FORMATS:
            raise SimulationError(f"video = {path} must end in one of {', '.join(FORMATS)}")
        if not path.parent.is_dir():
            raise SimulationError(f"video = {path}: there is no folder {path.parent}")
        self._path, self._fps, self._model = path, fps, model
        self._frames: queue.Queue[npt.NDArray[np.float64] | None] = queue.Queue()
        self._ready: queue.Queue[Exception | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name="film", daemon=True)
        self._thread.start()
        problem = self._ready.get()
        if problem is not None:
            raise problem

    def snap(self, qpos: npt.NDArray[np.float64]) -> None:
        """Have a configuration filmed; ones of another model are left out."""
        if len(qpos) == self._model.nq:
            self._frames.put(qpos.copy())

    def close(self) -> None:
        """Film what is still waiting and finish the file."""
        self._frames.put(None)
        self._thread.join()

    def _run(self) -> None:
        try:
            camera = Camera(self._model)
            writer = _writer(self._path, self._fps)
        except Exception as error:
            self._ready.put(error)
            return
        self._ready.put(None)
        while (qpos := self._frames.get()) is not None:
            writer.append_data(camera.picture(qpos))
        writer.close()
        camera.close()


def _writer(path: Path, fps: float) -> Any:
    try:
        import imageio
    except ImportError:
        raise SimulationError(
            f"video = {path} needs the Python packages imageio and imageio-ffmpeg"
        ) from None
    if path.suffix == ".gif":
        return imageio.get_writer(path, duration=1000.0 / fps)
    return imageio.get_writer(path, fps=fps, macro_block_size=2, ffmpeg_log_level="error")


def _gl_context(width: int, height: int) -> Any:
    """A current-able OpenGL context without a window."""
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
        except Exception as error:  # the bindings raise whatever their loader raised
            problems.append(f"{backend}: {error}")
    raise RenderError(
        f"cannot render off screen ({'; '.join(problems)}): install the Debian packages {_PACKAGES}"
    )


class Window:
    """The plant in MuJoCo's viewer.

    Raises:
        SimulationError: if there is no display.
    """

    PERIOD = 1.0 / 50.0

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise SimulationError(
                "headless = false needs a display: neither DISPLAY nor WAYLAND_DISPLAY is set"
            )
        import mujoco.viewer

        try:
            self._viewer = mujoco.viewer.launch_passive(model, data)
        except Exception as error:
            raise SimulationError(f"headless = false: no window opens: {error}") from None
        self._shown = 0.0

    def show(self, now: float) -> None:
        """Draw the present state, if the last picture is old enough. `now` in s of wall time."""
        if now - self._shown >= self.PERIOD and self._viewer.is_running():
            self._shown = now
            self._viewer.sync()

    def close(self) -> None:
        """Close the window."""
        self._viewer.close()
