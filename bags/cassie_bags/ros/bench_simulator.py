"""The simulator node with time measurement, for the benchmark.

Usage: python -m cassie_bags.ros.bench_simulator FILE --ros-args ...
FILE (.npz) gets `sent` and `answered`: wall times (s) at which each sample was published and its
command was received, NaN without a command. `missed` is the number of ticks without a command.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from cassie_msgs.layout import Sensors
from cassie_msgs.ros.process import run
from cassie_sim.plant import Plant
from cassie_sim.ros import simulator
from cassie_sim.ros.lane import SimulatorLane


class TimedLane(SimulatorLane):
    """Records when samples are published and when their commands arrive."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self.sent: list[float] = []
        self.answered: list[float] = []  # as long as `sent`
        self._seen = self.command_key

    def announce(self, sample: Sensors, plant: Plant) -> None:
        """Record the time, then publish."""
        self.sent.append(time.perf_counter())
        self.answered.append(math.nan)
        super().announce(sample, plant)

    def take(self) -> None:
        """Take in messages, and record the time if a command came."""
        super().take()
        if self.command_key != self._seen:
            self._seen = self.command_key
            self.answered[self.command_key[1]] = time.perf_counter()


class TimedSimulator(simulator.Simulator):
    """Writes its times to a file."""

    def close(self) -> None:
        """Write the file."""
        super().close()
        lane = self._lane
        if isinstance(lane, TimedLane):
            missed = self._loop.timing.missed
            np.savez(Path(sys.argv[1]), sent=lane.sent, answered=lane.answered, missed=missed)


def main() -> None:
    """Run the node."""
    vars(simulator)["SimulatorLane"] = TimedLane
    run("simulator", TimedSimulator)


if __name__ == "__main__":
    main()
