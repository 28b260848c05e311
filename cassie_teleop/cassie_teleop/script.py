"""An operator by script: requests over the robot's time, from YAML.

A script is a list of steps, or a file with that list under `operator`, such as an
experiment:

    operator:
      - {t: 0.0, power: true, mode: stand}
      - {t: 5.0, mode: walk}
      - {t: 15.0, vx: 0.5}

A key that a step omits keeps its value; before the first step all have the defaults of `Request`.
A section `rider` beside it closes the loop: from its first target on, an operator who sees the
robot sets com_x and com_y (`cassie_teleop.rider`).
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cassie_msgs.layout import OperatorCommand, RobotState
from cassie_msgs.operators import write_sender
from cassie_msgs.schedule import PERIOD_TICKS
from cassie_msgs.strict_yaml import YamlError, read_yaml
from cassie_msgs.tunables import names, replace_checked, unknown_name
from cassie_teleop.request import Request, write
from cassie_teleop.rider import Rider
from cassie_teleop.rider_config import read_rider
from cassie_teleop.sight import Sight, see

_KEYS = ("t", *names(Request))


class ScriptError(ValueError):
    """A script cannot be read, or asks for what is not permitted."""


def read_script(path: Path) -> tuple[list[Mapping[str, Any]], Mapping[str, Any] | None]:
    """Steps of a script file, and its rider if it has one.

    Raises:
        ScriptError: if it cannot be read, is no strict YAML, or holds no list of steps.
    """
    try:
        content = read_yaml(path)
    except YamlError as error:
        raise ScriptError(f"script: {error}") from None
    rider = None
    if isinstance(content, Mapping) and "operator" in content:
        rider = content.get("rider")
        content = content["operator"]
    if not isinstance(content, list):
        raise ScriptError(f"script {path}: expected a list of steps, or one under operator")
    return content, rider


class ScriptedOperator:
    """Plays a script: the requests in force at each time.

    Raises:
        ScriptError: at construction, naming step, key, value and range.
    """

    def __init__(
        self, steps: Sequence[Mapping[str, Any]], rider: Mapping[str, Any] | None = None
    ) -> None:
        """Check all steps; `steps` as in this module's description, t ascending, in s.

        Args:
            steps: Requests by time.
            rider: As `rider_config.read_rider` takes it, or None.
        """
        self._times: list[float] = []
        self._requests = [Request()]
        for number, step in enumerate(steps):
            try:
                self._append(step)
            except ValueError as error:
                raise ScriptError(f"operator step {number}: {error}") from None
        self._command = OperatorCommand()
        write_sender(self._command, "scripted_operator")
        try:
            self.rider = Rider(read_rider(rider)) if rider is not None else None
        except ValueError as error:
            raise ScriptError(str(error)) from None
        self._sights: dict[int, Sight] = {}

    def _append(self, step: Mapping[str, Any]) -> None:
        if not isinstance(step, Mapping):
            raise ScriptError(f"expected keys and values, got {step!r}")
        for key in step:
            if key not in _KEYS:
                raise ScriptError(unknown_name(str(key), _KEYS, "key"))
        time = step.get("t")
        if isinstance(time, bool) or not isinstance(time, (int, float)):
            raise ScriptError(f"t = {time!r} is not a time in s")
        if not (math.isfinite(time) and time >= (self._times or [0.0])[-1]):
            raise ScriptError(f"t = {time:g} s is before the step ahead of it, or before 0")
        changes = {key: value for key, value in step.items() if key != "t"}
        self._requests.append(replace_checked(self._requests[-1], **changes))
        self._times.append(float(time))

    def reset(self) -> None:
        """Begin a new episode."""
        self._sights.clear()
        if self.rider is not None:
            self.rider.reset()

    def watch(self, stamp_ns: int, raw: bytes) -> None:
        """Take in the true odometry of a tick, serialized; without a rider it is not looked at.

        Raises:
            SightError: if it is no odometry.
        """
        if self.rider is not None and stamp_ns % self.rider.period_ns == 0:
            self._sights[stamp_ns] = see(raw)

    def awaits(self, stamp_ns: int) -> bool:
        """Whether the answer to the state of a time must wait for what the rider sees."""
        needed = self.rider.needs(stamp_ns) if self.rider is not None else None
        return needed is not None and needed not in self._sights

    def request(self, time_s: float) -> Request:
        """The requests in force at a time, in s since the start of the episode."""
        return self._requests[bisect.bisect_right(self._times, time_s)]

    def command(self, time_s: float) -> OperatorCommand:
        """The same as a command, without stamp, episode and seq.

        Returns:
            Owned by this object and valid until the next call.
        """
        write(self.request(time_s), self._command)
        self._command.scripted[...] = True
        return self._command

    def answer(self, state: RobotState) -> OperatorCommand:
        """The whole command that answers a state, in force `PERIOD_TICKS` ticks on.

        Returns:
            Owned by this object and valid until the next call.
        """
        command = self.command(state.stamp_ns * 1e-9)
        if self.rider is not None:
            self._ride(self.rider, state.stamp_ns, command)
        command.answer(state)
        command.effective_seq[...] = int(state.seq) + PERIOD_TICKS
        return command

    def _ride(self, rider: Rider, stamp_ns: int, command: OperatorCommand) -> None:
        """Lean as the rider does, with the newest that he has seen if that of his time is lost."""
        needed = rider.needs(stamp_ns)
        if needed is not None and self._sights:
            at = needed if needed in self._sights else max(self._sights)
            rider.decide(stamp_ns, self._sights[at])
            for stamp in [stamp for stamp in self._sights if stamp < at]:
                del self._sights[stamp]
        if stamp_ns < rider.begins_ns:
            return
        command.com_x[...], command.com_y[...] = rider.lean
        command.vx[...], command.yaw_rate[...] = rider.speed, rider.turn
