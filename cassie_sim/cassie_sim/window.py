"""The plant in a window."""

from __future__ import annotations

import os
import threading

import mujoco

from cassie_sim.errors import SimulationError


class Window:
    """MuJoCo's viewer on a plant: a camera that follows the robot, panels folded (Tab, Shift+Tab).

    The mouse turns the camera about the robot and zooms.

    Raises:
        SimulationError: if there is no display.
    """

    PERIOD = 1.0 / 50.0
    CLOSING = 2.0
    """Time-out for closing the window, in wall time. In s."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise SimulationError(
                "headless = false needs a display: neither DISPLAY nor WAYLAND_DISPLAY is set"
            )
        self._shown = 0.0
        self._open(model, data)

    def show(self, model: mujoco.MjModel, data: mujoco.MjData, now: float) -> None:
        """Draw the present state, if the last picture is old enough. `now` is wall time in s."""
        if now - self._shown < self.PERIOD or not self._viewer.is_running():
            return
        self._shown = now
        if model is not self._model:  # a reset made another robot
            self.close()
            self._open(model, data)
        self._viewer.sync()

    def close(self) -> None:
        """Close the window; a viewer that still draws when Python ends would crash it."""
        self._viewer.close()
        for thread in self._threads:
            thread.join(self.CLOSING)

    def _open(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        import mujoco.viewer

        self._model = model
        others = set(threading.enumerate())
        try:
            self._viewer = mujoco.viewer.launch_passive(
                model, data, show_left_ui=False, show_right_ui=False
            )
        except Exception as error:
            raise SimulationError(f"headless = false: no window opens: {error}") from None
        self._threads = set(threading.enumerate()) - others
        with self._viewer.lock():
            follow(model, self._viewer.cam)


def follow(model: mujoco.MjModel, camera: mujoco.MjvCamera) -> None:
    """Let a camera follow the robot, from behind on its right, with the whole robot in view."""
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = model.body("pelvis").id
    camera.azimuth, camera.elevation, camera.distance = 60.0, -12.0, 2.6
