"""A picture of a replay: what was recorded, and what is computed on the same data."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cassie_bags.bag.recording import stamps
from cassie_bags.report.figures import BLUE, GREY, ORANGE, STYLE
from cassie_bags.run.verify import Replayed, Verification
from cassie_gaits.names import DRIVES
from cassie_msgs.layout import MotorCommand, RobotState

_POSE = ("x", "y", "z", "yaw", "pitch", "roll")


def draw(found: Verification, path: Path) -> None:
    """Draw the drives' total set-points and the estimated pelvis, each as recorded and computed.

    Args:
        found: What came of the replay.
        path: Where to.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 13.0), layout="constrained")
        axes = figure.subplots(8, 2, sharex=True)
        commands = found.replayed[MotorCommand.TOPIC]
        for index, name in enumerate(DRIVES):
            column, row = divmod(index, 5)
            axis = axes[row, column]
            _panel(axis, commands, "torque", index, f"{name.replace('_', ' ')}\n(Nm)")
        states = found.replayed[RobotState.TOPIC]
        for index, name in enumerate(_POSE):
            column, row = divmod(index, 3)
            unit = "m" if index < 3 else "rad"
            _panel(axes[5 + row, column], states, "q", index, f"{name}\n({unit})")
        for axis in axes[-1]:
            axis.set_xlabel("robot time (s)")
        axes[0, 0].legend(loc="upper right", ncols=3)
        axes[0, 0].set_title("feed-forward torque of each drive, estimated pose of the pelvis")
        figure.savefig(path)


def _panel(axis: Axes, replayed: Replayed, name: str, index: int, label: str) -> None:
    time = stamps(replayed.recorded)
    one: npt.NDArray[np.float64] = replayed.recorded[name][:, index]
    other: npt.NDArray[np.float64] = replayed.computed[name][:, index]
    axis.plot(time, one, color=BLUE, label="recorded")
    axis.plot(time, other, color=ORANGE, label="computed", linestyle=(0, (3, 2)))
    axis.plot(time, other - one, color=GREY, label="difference", linewidth=0.7)
    axis.set_ylabel(label)
