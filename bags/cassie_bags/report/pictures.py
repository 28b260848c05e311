"""Draws all pictures of a run into a folder. Loads matplotlib and MuJoCo, which takes a while."""

from __future__ import annotations

import sys
from pathlib import Path

from cassie_bags.report.figures import draw_all
from cassie_bags.report.strip import film_of, strip
from cassie_bags.report.view import View
from cassie_sim.errors import SimulationError
from cassie_sim.video import Film


def draw(view: View, folder: Path, *, film: bool = True) -> dict[str, Path]:
    """Draw all pictures of a run; problems are reported on stderr.

    Args:
        view: View of the run.
        folder: Target folder.
        film: Whether to make a video too.

    Returns:
        The files by name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    video, reason = _film(view, folder / "video.mp4") if film else (None, None)
    try:
        files = draw_all(view, folder)
        files["strip"] = folder / "strip.png"
        reason = strip(view, files["strip"]) or reason
    finally:
        if video is not None:
            video.close()
    if video is not None:
        files["video"] = folder / "video.mp4"
    if reason is not None:
        print(f"stick figures and no video: {reason}", file=sys.stderr)
    return files


def _film(view: View, path: Path) -> tuple[Film | None, str | None]:
    """A film that a process of its own makes, and None; or None, and the reason."""
    try:
        return film_of(view, path), None
    except SimulationError as error:
        return None, str(error)
