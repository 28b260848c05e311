"""Picture of a replay: recorded values, and values computed from the same data."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from cassie_bags.bag.rows import FloatArray, Rows, stamps, tick_keys
from cassie_bags.report.figures import BLUE, GREY, ORANGE, drawing
from cassie_bags.run.verify import Replayed, Verification
from cassie_gaits.names import DRIVE_IN_Q, DRIVES
from cassie_msgs.layout import MotorCommand, RobotState

_WINDOW = 2.0  # s, length of the enlarged part, from shortly before the first difference on
_BEFORE = 0.4  # s
_POSE = ("x (m)", "y (m)", "z (m)", "yaw (rad)", "pitch (rad)", "roll (rad)")


def draw(verification: Verification, path: Path) -> None:
    """Draw the torque of each drive, and the estimated pose where it differs.

    The torque is that of the command at the recorded positions and velocities.
    """
    states, commands = (verification.replayed[kind.TOPIC] for kind in (RobotState, MotorCommand))
    panels: list[tuple[str, FloatArray, FloatArray, FloatArray]] = []
    if commands.different_count() or not states.different_count():
        at, torques = _torques(states.recorded, commands)
        panels += [
            (f"{name.replace('_', ' ')} (Nm)", at, torques[0][:, i], torques[1][:, i])
            for i, name in enumerate(DRIVES)
        ]
    if states.different_count():
        at, one, other = stamps(states.recorded), states.recorded["q"], states.computed["q"]
        panels += [(name, at, one[:, i], other[:, i]) for i, name in enumerate(_POSE)]
    with drawing(path, 11.0, 0.6 + 1.25 * len(panels)) as figure:
        times = [difference.time for difference in verification.differences]
        _draw_panels(figure, panels, max(0.0, min(times, default=0.0) - _BEFORE))


def _torques(states: Rows, commands: Replayed) -> tuple[FloatArray, Sequence[FloatArray]]:
    """Robot time (s) and torque of each drive (Nm), recorded and computed. Shapes (n,), (n, 10)."""
    keys, wanted = tick_keys(states), tick_keys(commands.recorded)
    order = np.argsort(keys, kind="stable")
    places = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
    known = keys[places] == wanted
    q, v = (states[name][places[known]][:, DRIVE_IN_Q] for name in ("q", "v"))
    torques = []
    for each in (commands.recorded[known], commands.computed[known]):
        spring = each["kp"] * (each["position"] - q)
        torques.append(each["torque"] + spring + each["kd"] * (each["velocity"] - v))
    return stamps(commands.recorded[known]), torques


def _draw_panels(
    figure: Figure, panels: Sequence[tuple[str, FloatArray, FloatArray, FloatArray]], t0: float
) -> None:
    """Draw both values over the enlarged part from `t0` (s) on, and their difference."""
    axes = figure.subplots(len(panels), 2, sharex="col", squeeze=False)
    for (large, whole), (label, time, one, other) in zip(axes, panels, strict=True):
        part = (time >= t0) & (time <= t0 + _WINDOW)
        large.plot(time[part], one[part], color=BLUE, label="recorded")
        large.plot(time[part], other[part], color=ORANGE, label="computed", dashes=(4, 2))
        large.set_ylabel(label.replace(" (", "\n("))
        whole.plot(time, other - one, color=GREY, linewidth=0.7)
    for axis in axes[-1]:
        axis.set_xlabel("robot time (s)")
    axes[0, 0].set_title("recorded, and computed on the same data")
    axes[0, 1].set_title("computed minus recorded, over the whole bag")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
