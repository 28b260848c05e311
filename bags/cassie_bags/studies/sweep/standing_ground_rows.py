"""Rows of standing on other ground: blocks, slopes, ground that tilts, sand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.sweep.standing_course import (
    AROUND,
    DIAGONAL,
    SETTLED,
    hardest,
    rests,
    stand,
)
from cassie_bags.studies.trial import Trial

_GENTLY = ({"t": 0.5, "height": 0.7, "speed": 0.3},)


def standing_ground_rows() -> list[Row]:
    """All rows of this module."""
    around = {**AROUND, **DIAGONAL}.items()
    leaning = [row for name, angle in around for row in (_slope(name, angle), _tilts(name, angle))]
    return [_block("left"), _block("right"), *leaning, _sinking()]


def _block(side: str) -> Row:
    return hardest(
        f"block.{side}",
        f"block under the {side} foot",
        "m",
        0.1,
        [0.04, 0.06, 0.08, 0.1, 0.12, 0.14],
        partial(_on, "block", lambda height: {"height": height, "side": side}),
        holds=rests,
    )


def _slope(name: str, angle: float) -> Row:
    return hardest(
        f"slope.{name}",
        f"slope that rises {name.replace('_', ' ')}, stood",
        "deg",
        12.0,
        [6.0, 9.0, 12.0, 15.0, 18.0],
        partial(_on, "slope", partial(_rising, angle)),
        holds=rests,
    )


def _tilts(name: str, angle: float) -> Row:
    return hardest(
        f"tilting.{name}",
        f"ground that tilts at 5 deg/s, up {name.replace('_', ' ')}",
        "deg",
        10.0,
        [5.0, 10.0, 15.0, 20.0],
        partial(_on, "tilting", partial(_tilting, angle)),
        holds=rests,
    )


def _sinking() -> Row:
    return hardest(
        "sinking.sand",
        "depth to which sand gives way under it",
        "m",
        0.06,
        [0.02, 0.04, 0.06, 0.08, 0.1],
        partial(_on, "course", _sand),
        holds=rests,
    )


def _on(scene: str, parameters: Any, budget: Budget, level: float) -> list[Trial]:
    """Standing in a scene whose parameters a level gives."""
    words = {"scene": scene, "scene_parameters": parameters(level), "gantry": list(_GENTLY)}
    return stand(budget, SETTLED + 8.0, 3.0, height=0.85, **words)


def _rising(angle_deg: float, slope_deg: float) -> Mapping[str, float]:
    """Ground that rises by so much towards an angle from ahead, from the start."""
    ahead, left = _components(angle_deg, slope_deg)
    # Only ground that rises to the side does so under its feet; some rise it must have.
    return {"rise_deg": ahead, "side_deg": left if abs(left) > 1e-3 else 1e-3}


def _tilting(angle_deg: float, slope_deg: float) -> Mapping[str, float]:
    ahead, left = _components(angle_deg, slope_deg)
    rate = 5.0 * max(abs(ahead), abs(left)) / slope_deg
    return {"rise_deg": ahead, "side_deg": left, "start": SETTLED, "rate_deg": rate}


def _components(angle_deg: float, slope_deg: float) -> tuple[float, float]:
    angle, slope = math.radians(angle_deg), math.tan(math.radians(slope_deg))
    along = (slope * math.cos(angle), slope * math.sin(angle))
    ahead, left = (math.degrees(math.atan(rise)) for rise in along)
    return ahead, left


def _sand(sinking: float) -> Mapping[str, Any]:
    return {"stretches": [{"surface": "sand", "sinking": sinking, "length": 20.0}]}
