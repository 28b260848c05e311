"""The plant in a window."""

from __future__ import annotations

import os

import mujoco

from cassie_sim.errors import SimulationError


class Window:
    """MuJoCo's viewer on a plant.

    Raises:
        SimulationError: if there is no display.
    """

    PERIOD = 1.0 / 50.0

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise SimulationError(
                "headless = false needs a display: neither DISPLAY nor WAYLAND_DISPLAY is set"
            )
        self._shown = 0.0
        self._open(model, data)

    def show(self, model: mujoco.MjModel, data: mujoco.MjData, now: float) -> None:
        """Draw the present state, if the last picture is old enough. `now` in s of wall time."""
        if now - self._shown < self.PERIOD or not self._viewer.is_running():
            return
        self._shown = now
        if model is not self._model:  # a reset made another robot
            self._viewer.close()
            self._open(model, data)
        self._viewer.sync()

    def close(self) -> None:
        """Close the window."""
        self._viewer.close()

    def _open(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        import mujoco.viewer

        self._model = model
        try:
            self._viewer = mujoco.viewer.launch_passive(model, data)
        except Exception as error:
            raise SimulationError(f"headless = false: no window opens: {error}") from None
