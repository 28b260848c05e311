"""Rows of the loop itself: delays that it bears, and how well the estimator and outputs do."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from cassie_bags.studies.learn import comparison, left_over
from cassie_bags.studies.sweep.course import Budget, steady, walk
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Figures, Trial

SPEED = 0.5
"""At which these are measured. In m/s."""


TRACKED = (-0.5, 0.0, 0.5, 1.0)
"""Speeds at which tracking is measured with and without learned torques. In m/s."""


def loop_rows() -> list[Row]:
    """All rows of this module."""
    return [*_delays(), *_tracking(), *_estimates()]


def _delays() -> list[Row]:
    def trials(name: str, others: dict[str, float], budget: Budget, delay_ms: float) -> list[Trial]:
        window = steady(budget, SPEED, 0.5 * budget.seconds)
        delays = {name: 1e-3 * delay_ms} | others
        return [walk(budget, seed, window, vx=SPEED, delays=delays) for seed in budget.each_seed()]

    def row(
        key: str, name: str, title: str, target: float, levels: list[float], **others: float
    ) -> Row:
        return Row(
            f"delay.{key}",
            f"delay of {title} beyond the drives' 3 ms at {SPEED:g} m/s",
            "ms",
            target,
            levels,
            partial(trials, name, others),
            holds=lambda figures, _: figures["vx"] > 0.2 * SPEED,
            start=levels.index(target),
        )

    late = [float(n) for n in range(5, 75, 5)]
    return [
        row("torque", "torque", "torques", 3.0, [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0]),
        row("set_point", "set_point", "set-points", 40.0, late),
        row("both", "set_point", "set-points, and of torques by 2 ms,", 20.0, late, torque=0.002),
        row("both_3ms", "set_point", "set-points, and torques by 3 ms,", 25.0, late, torque=0.003),
    ]


def _tracking() -> list[Row]:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        seconds = 0.25 * budget.seconds
        return [comparison(seed, speed, seconds, budget.changes) for seed in budget.each_seed()]

    return [
        Row(
            f"tracking.{speed:+g}",
            f"outputs' RMS error at {speed:g} m/s, by that without learned torques",
            "%",
            70.0,
            (speed,),
            trials,
            holds=lambda figures, _: not figures["beside_fell"],
            figure=lambda figures, _: 100.0 * left_over(figures),
            at_least=False,
        )
        for speed in TRACKED
    ]


def _estimates() -> list[Row]:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        window = steady(budget, speed)
        return [walk(budget, seed, window, vx=speed) for seed in budget.each_seed()]

    def row(
        name: str, title: str, unit: str, target: float, figure: Callable[[Figures], float]
    ) -> Row:
        return Row(
            name,
            f"{title} at {SPEED:g} m/s",
            unit,
            target,
            (SPEED,),
            trials,
            figure=lambda figures, _: figure(figures),
            at_least=False,
        )

    axes = {"vx": "ahead", "vy": "sideways", "vz": "upwards"}
    return [
        *(
            row(
                f"estimator.{axis}",
                f"estimated velocity {word}, RMSE",
                "m/s",
                0.03,
                lambda figures, axis=axis: figures[f"rmse_{axis}"],  # type: ignore[misc]
            )
            for axis, word in axes.items()
        ),
        row("estimator.drift", "odometry's drift", "%", 3.0, lambda f: 100.0 * f["odometry"]),
    ]
