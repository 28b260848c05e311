"""Films: what comes out, what is refused, and that closing soon is soon."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cassie_sim.errors import SimulationError
from cassie_sim.plant import Plant, PlantConfig
from cassie_sim.video import Film, RenderError, frame_of


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(PlantConfig())


def _film(plant: Plant, path: Path) -> Film:
    try:
        return Film(plant.model, path, fps=20.0)
    except RenderError as error:
        assert "libegl1" in str(error)  # the message must name what is missing
        pytest.skip(str(error))


def test_each_snap_is_a_picture(plant: Plant, tmp_path: Path) -> None:
    imageio = pytest.importorskip("imageio.v3")
    film = _film(plant, tmp_path / "film.gif")
    for height in (0.6, 0.9, 1.2, 1.5):
        qpos = plant.data.qpos.copy()
        qpos[2] = height
        film.snap(qpos)
    film.snap(np.zeros(3))  # of another model
    film.close()
    pictures = imageio.imread(tmp_path / "film.gif", index=None)
    assert len(pictures) == 4
    assert not (pictures[0] == pictures[3]).all()


def test_closing_soon_leaves_out_what_waits(plant: Plant, tmp_path: Path) -> None:
    imageio = pytest.importorskip("imageio.v3")
    film = _film(plant, tmp_path / "film.gif")
    for _ in range(2000):
        film.snap(frame_of(plant.data))
    film.close(soon=True)
    assert 1 <= len(imageio.imread(tmp_path / "film.gif", index=None)) < 1000


@pytest.mark.parametrize(("name", "words"), [("a.txt", ".mp4, .gif"), ("no/a.mp4", "no folder")])
def test_a_wrong_path_is_refused(plant: Plant, tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        Film(plant.model, tmp_path / name, fps=20.0)
