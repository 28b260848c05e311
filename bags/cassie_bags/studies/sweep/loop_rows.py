"""Rows of the control loop: delays, and errors of the estimator and the outputs."""

from __future__ import annotations

from cassie_bags.studies.sweep.course import (
    Budget,
    comparison,
    robots,
    steady,
    straight,
    walk,
)
from cassie_bags.studies.sweep.row import Figure, Row, at_most
from cassie_bags.studies.trial import Trial, ratio_to_reference

SPEED = 0.5
"""Walking speed of the rows about delays and the estimator. In m/s."""

TRACKED = (-0.5, 0.0, 0.5, 1.0)
"""Speeds at which tracking is measured with and without learned torques. In m/s."""


def loop_rows() -> list[Row]:
    """All rows of this module."""
    short = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0]
    return [
        _delay("torque", "torques", 3.0, short, "torque"),
        _delay("set_point", "set-points", 40.0),
        _delay("both", "set-points, and of torques by 2 ms,", 20.0, torque=0.002),
        _delay("both_3ms", "set-points, and torques by 3 ms,", 25.0, torque=0.003),
        *(_tracking(speed) for speed in TRACKED),
        _estimate("vx", "estimated velocity ahead, RMSE", "m/s", "rmse_vx"),
        _estimate("vy", "estimated velocity sideways, RMSE", "m/s", "rmse_vy"),
        _estimate("vz", "estimated velocity upwards, RMSE", "m/s", "rmse_vz"),
        _estimate("tilt", "estimated tilt, RMSE", "deg", "rmse_tilt", 0.3),
        _estimate("drift", "odometry's drift", "%", lambda f, _: 100.0 * f["odometry"], 3.0),
        _estimate_on("slippery", "at friction 0.3", 0.5, "flat", friction=0.3),
        _estimate_on("soft", "on ground that sinks in by 3 cm", 0.3, "sand", sinking=0.03),
    ]


def _delay(
    name: str,
    title: str,
    target: float,
    levels: list[float] | None = None,
    delayed: str = "set_point",
    **others: float,
) -> Row:
    def trial(budget: Budget, seed: int, delay_ms: float) -> Trial:
        window = steady(budget, SPEED, 0.5 * budget.seconds)
        delays = {delayed: 1e-3 * delay_ms} | others
        return walk(budget, seed, window, vx=SPEED, delays=delays)

    return Row(
        f"delay.{name}",
        f"delay of {title} beyond the drives' 3 ms at {SPEED:g} m/s",
        "ms",
        target,
        levels or [float(n) for n in range(5, 75, 5)],
        robots(trial),
        holds=lambda measures, _: measures["vx"] > 0.2 * SPEED,
    )


def _tracking(speed: float) -> Row:
    def trial(budget: Budget, seed: int, level: float) -> Trial:
        return comparison(seed, level, 0.25 * budget.seconds, budget.changes)

    return at_most(
        f"tracking.{speed:+g}",
        f"outputs' RMS error at {speed:g} m/s, by that without learned torques",
        "%",
        70.0,
        robots(trial),
        lambda measures, _: 100.0 * ratio_to_reference(measures),
        speed,
        holds=lambda measures, _: not measures["reference_fell"],
    )


def _estimate(name: str, title: str, unit: str, figure: Figure, target: float = 0.03) -> Row:
    title = f"{title} at {SPEED:g} m/s"
    return at_most(f"estimator.{name}", title, unit, target, straight, figure, SPEED)


def _estimate_on(name: str, where: str, speed: float, scene: str, **parameters: float) -> Row:
    def trial(budget: Budget, seed: int, vx: float) -> Trial:
        return walk(
            budget, seed, steady(budget, vx), vx=vx, scene=scene, scene_parameters=parameters
        )

    return at_most(
        f"estimator.{name}",
        f"estimated velocity at {speed:g} m/s {where}, RMSE of the worst axis",
        "m/s",
        0.03,
        robots(trial),
        lambda measures, _: max(measures[f"rmse_{axis}"] for axis in ("vx", "vy", "vz")),
        speed,
    )
