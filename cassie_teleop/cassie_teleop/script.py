"""An operator by script: requests over robot time.

A script is an experiment file; its sections `operator` and `rider` are played:

    operator:
      - {t: 0.0, power: true, mode: stand}
      - {t: 5.0, mode: walk}
      - {t: 15.0, vx: 0.5}

A key that a step omits keeps its value; before the first step all keys have the defaults of
`Request`. Section `rider` closes the loop: from its first target on, a simulated rider who measures
the robot's motion sets com_x and com_y (`cassie_teleop.rider`).
"""

from __future__ import annotations

import bisect
from collections.abc import Sequence

from cassie_msgs.experiment.script import OperatorStep, RiderScript
from cassie_msgs.layout import OperatorCommand, RobotState
from cassie_msgs.operators import write_sender
from cassie_msgs.request import Request, write
from cassie_msgs.schedule import effective_seq
from cassie_msgs.tunables import replace_checked
from cassie_teleop.rider import Rider
from cassie_teleop.sight import Sight, see


class ScriptedOperator:
    """Plays a script: gives the request at each time."""

    def __init__(self, steps: Sequence[OperatorStep], rider: RiderScript | None = None) -> None:
        """Begin before the first step.

        Args:
            steps: Changes of the operator, in order of time.
            rider: Settings and targets of the rider, or None without one.
        """
        self._times = [step.t for step in steps]
        self._requests = [Request()]
        for step in steps:
            self._requests.append(replace_checked(self._requests[-1], **step.changes))
        self._command = OperatorCommand()
        write_sender(self._command, "scripted_operator")
        self.rider = Rider(rider) if rider is not None else None
        self._sights: dict[int, Sight] = {}

    def reset(self) -> None:
        """Begin a new episode."""
        self._sights.clear()
        if self.rider is not None:
            self.rider.reset()

    def watch(self, stamp_ns: int, raw: bytes) -> None:
        """Take in the true odometry of a tick, serialized; without a rider it is ignored.

        Raises:
            SightError: if `raw` is no odometry.
        """
        if self.rider is not None and stamp_ns % self.rider.period_ns == 0:
            self._sights[stamp_ns] = see(raw)

    def awaits(self, stamp_ns: int) -> bool:
        """Whether the answer to the state of a time must wait for the rider's measurement."""
        needed = self.rider.needs(stamp_ns) if self.rider is not None else None
        return needed is not None and needed not in self._sights

    def request(self, time_s: float) -> Request:
        """The request at a time, in s since the start of the episode."""
        return self._requests[bisect.bisect_right(self._times, time_s)]

    def command(self, time_s: float) -> OperatorCommand:
        """The command at a time, in s, without stamp, episode and seq.

        Returns:
            The command, owned by this object and valid until the next call.
        """
        write(self.request(time_s), self._command)
        self._command.scripted[...] = True
        return self._command

    def answer(self, state: RobotState) -> OperatorCommand:
        """The whole command that answers a state, valid from `PERIOD_TICKS` ticks later on.

        Returns:
            The command, owned by this object and valid until the next call.
        """
        command = self.command(state.stamp_ns * 1e-9)
        if self.rider is not None:
            self._ride(self.rider, state.stamp_ns, command)
        command.answer(state)
        command.effective_seq[...] = effective_seq(int(state.seq))
        return command

    def _ride(self, rider: Rider, stamp_ns: int, command: OperatorCommand) -> None:
        """Set the rider's lean; if the measurement of the due time is lost, by the newest one."""
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
