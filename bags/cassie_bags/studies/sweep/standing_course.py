"""The runs that rows of standing are made of: let down from the gantry, and then what is asked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Figures, Trial

HEIGHT = 0.9
"""Pelvis height at which it stands unless a row is about another. In m."""

SETTLED = 5.0
"""When it stands quietly after being let down. In s."""

AROUND = {"fore": 0.0, "left": 90.0, "aft": 180.0, "right": 270.0}
"""Directions from ahead, to the left. In deg."""

DIAGONAL = {"fore_left": 45.0, "aft_left": 135.0, "aft_right": 225.0, "fore_right": 315.0}
"""Those between them."""

_LET_DOWN = ({"t": 0.2, "height": 0.8, "speed": 0.5},)
_STILL = 0.02  # m/s


def stand(budget: Budget, end: float, seconds: float = 3.0, **words: Any) -> list[Trial]:
    """One trial for each robot, let down from the gantry and measured over its last seconds.

    Args:
        budget: How much to run.
        end: Of the run. In s.
        seconds: To measure. In s.
        words: Sections of the experiment; `height` of the pelvis, `then` steps of the operator.
    """
    height, then = words.pop("height", HEIGHT), words.pop("then", [])
    content = {
        "start": "gantry",
        "gantry": list(_LET_DOWN),
        "duration": end,
        "operator": [{"t": 0.0, "power": True, "mode": "stand", "height": height}, *then],
        **words,
    }
    window = (end - seconds, end)
    return [Trial(content, seed, window, None, budget.changes) for seed in budget.each_seed()]


def rests(figures: Figures, _: float) -> bool:
    return figures["standing"] > 0.0 and figures["end_speed"] < _STILL and not figures["stepped"]


def hardest(
    name: str,
    title: str,
    unit: str,
    target: float,
    levels: Sequence[float],
    trials: Any,
    **more: Any,
) -> Row:
    """A row whose figure is the hardest level that holds."""
    start = list(levels).index(target)
    return Row(f"stand_{name}", title, unit, target, levels, trials, start=start, **more)
