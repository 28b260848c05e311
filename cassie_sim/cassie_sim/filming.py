"""Renders frames from standard input into a film; see `cassie_sim.video`.

    python -m cassie_sim.filming MODEL.mjb FILM.mp4 FPS

Writes "ready", or an error message, in one line, then answers each frame with a byte.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cassie_sim.camera import Camera, RenderError, frame_size
from cassie_sim.errors import SimulationError

_NICENESS = 5  # the simulator's loop has priority


def main(arguments: list[str]) -> None:
    """Film until standard input ends."""
    os.nice(_NICENESS)
    model = mujoco.MjModel.from_binary_path(arguments[0])
    path, fps = Path(arguments[1]), float(arguments[2])
    try:
        camera = Camera(model)
        writer = _writer(path, fps)
    except RenderError as error:
        print("render", " ".join(str(error).split()), flush=True)
        return
    except (ValueError, OSError) as error:
        print("other", " ".join(str(error).split()), flush=True)
        return
    print("ready", flush=True)
    size = 8 * frame_size(model)
    while len(frame := sys.stdin.buffer.read(size)) == size:
        writer.append_data(camera.picture(np.frombuffer(frame)))
        os.write(1, b".")
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


if __name__ == "__main__":
    main(sys.argv[1:])
