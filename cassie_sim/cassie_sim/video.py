"""Films of the plant, rendered off screen by a separate process."""

from __future__ import annotations

import queue
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_sim.camera import Camera, Image, RenderError, frame_of, frame_size
from cassie_sim.errors import SimulationError

__all__ = ["FORMATS", "Camera", "Film", "Image", "RenderError", "frame_of"]

FORMATS = (".mp4", ".gif")

_AHEAD = 3  # frames in the pipe to the process, so that it can end soon on request


class Film:
    """Films a plant into a file; `snap` costs the loop a copy.

    Rendering holds Python's interpreter for tens of milliseconds, which is too long for a loop on
    the wall clock. So `cassie_sim.filming` renders in its own process.

    Args:
        model: Model that is filmed.
        path: Path of the file; it ends in one of `FORMATS`.
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
        self._size = frame_size(model)
        self._frames: queue.Queue[bytes | None] = queue.Queue()
        with tempfile.TemporaryDirectory() as folder:
            binary = Path(folder) / "model.mjb"
            mujoco.mj_saveModel(model, str(binary), None)
            self._process = subprocess.Popen(
                [sys.executable, "-m", "cassie_sim.filming", binary, path.absolute(), str(fps)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C is for this process, which ends the other
            )
            self._begin()
        self._thread = threading.Thread(target=self._feed, name="film", daemon=True)
        self._thread.start()

    def snap(self, frame: npt.NDArray[np.float64]) -> None:
        """Film a frame of `frame_of`; frames of another model are ignored."""
        if len(frame) == self._size:
            self._frames.put(frame.tobytes())

    def close(self, *, soon: bool = False) -> None:
        """Finish the file, with all waiting frames, or with only one of them if `soon`."""
        while soon and self._frames.qsize() > 1:
            self._frames.get_nowait()
        self._frames.put(None)
        self._thread.join()
        self._process.wait()

    def _begin(self) -> None:
        """Wait until the process is ready; raise its error if it cannot render."""
        assert self._process.stdout is not None
        answer = self._process.stdout.readline().decode().strip()
        if answer == "ready":
            return
        self._process.wait()
        kind, _, reason = answer.partition(" ")
        problem = reason or "the process that films ended without a word"
        raise RenderError(problem) if kind == "render" else SimulationError(problem)

    def _feed(self) -> None:
        """Send frames to the process, at most `_AHEAD` before they are done."""
        sink, done = self._process.stdin, self._process.stdout
        assert sink is not None
        assert done is not None
        waiting = 0
        try:
            while (frame := self._frames.get()) is not None:
                sink.write(frame)
                sink.flush()
                waiting += 1
                if waiting >= _AHEAD:
                    waiting -= len(done.read(1))
            sink.close()
        except BrokenPipeError:  # the process was killed: the film ends there
            pass
