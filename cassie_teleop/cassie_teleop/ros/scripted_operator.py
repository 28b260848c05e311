"""Node scripted_operator: plays a script in robot time, in lock-step with the loop."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from cassie_msgs.experiment.file import read_experiment
from cassie_msgs.layout import DECIMATED_STATE, LayoutError, OperatorCommand, RobotState, header
from cassie_msgs.ros import diagnostics, parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.ros.decimated_states import DecimatedStates
from cassie_msgs.ros.fast_lane import LanePublisher, LaneWaiter, RawSubscription
from cassie_msgs.ros.one_writer import WriterWatch
from cassie_msgs.ros.scheduling import Place, Scheduling
from cassie_msgs.schedule import PERIOD_TICKS
from cassie_msgs.tunables import ParameterError, tunable
from cassie_teleop import sight
from cassie_teleop.script import ScriptedOperator

# No message may be dropped: a rider uses messages of certain stamps.
_TRUTH = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=50 * PERIOD_TICKS
)
_SIGHT_TIMEOUT = 0.5  # s of wall time, time-out of the wait for the rider's measurement
_MOST = 5  # states of a long queue that are answered
_LOOK_PERIOD = 0.1  # s of wall time between two looks for states
_SILENCE = 1.0  # s of wall time without a state, after which that is reported


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    script: str = tunable("", description="Script or experiment file (YAML)", live=False)


class ScriptedOperatorNode(Node):
    """Answers every 10th state with the command of its time; answers a repeat from the cache."""

    def __init__(self, stop: process.Stop) -> None:
        """Read the script.

        Raises:
            ValueError: if the script is not given, or wrong.
        """
        super().__init__("scripted_operator")
        config = parameters.declare(self, Config())
        if not config.script:
            raise ParameterError("script must be given: -p script:=FILE.yaml")
        script = read_experiment(Path(config.script).expanduser(), needs=("operator",))
        self._operator = ScriptedOperator(script.operator, script.rider)
        self._stop = stop
        self._scheduling = Scheduling(self.get_logger().warning, Place.BESIDE)
        self._states = DecimatedStates(self)
        self._commands = LanePublisher(self, OperatorCommand)
        self._eyes: RawSubscription | None = None
        if self._operator.rider is not None:
            self._eyes = RawSubscription(self, Odometry, sight.TOPIC, _TRUTH)
        self._waiter = LaneWaiter(self, [self._states, *([self._eyes] if self._eyes else [])])
        stop.on_request(self._waiter.wake)
        self._diagnostics = diagnostics.Diagnostics(self)
        WriterWatch(self, [self._states.estimator], [], self._report)
        self._state = RobotState()
        self._answered = (-1, -1)
        self._reply = b""

    def loop(self) -> None:
        """Answer states until stopped."""
        heard = next_look = time.monotonic()
        while not self._stop.requested:
            self._waiter.wait(_LOOK_PERIOD)
            if time.monotonic() >= next_look:
                next_look = time.monotonic() + _LOOK_PERIOD
                self._states.follow_estimator()
            if states := self._states.take_last(_MOST):
                heard = time.monotonic()
                self._answer_all(states)
            elif time.monotonic() - heard > _SILENCE:
                message = f"no {self._states.topic} for more than {_SILENCE:g} s"
                self._diagnostics.set("script", diagnostics.STALE, message)

    def _answer_all(self, states: Sequence[bytes]) -> None:
        try:
            for raw in states:
                self._answer(raw)
        except LayoutError as error:
            self._report("script", str(error))
        else:
            self._diagnostics.set("script", diagnostics.OK, "playing")

    def _report(self, subject: str, problem: str) -> None:
        level = diagnostics.ERROR if problem else diagnostics.OK
        self._diagnostics.set(subject, level, problem or "ok")

    def _answer(self, raw: bytes) -> None:
        _, _, episode, seq = header(raw)
        if seq % PERIOD_TICKS:
            return
        if (episode, seq) != self._answered:
            if episode != self._answered[0]:
                self._operator.reset()
            self._state.load(raw)
            self._scheduling.follow(bool(self._state.wall_paced))
            self._look(self._state.stamp_ns)
            self._reply = self._operator.answer(self._state).to_bytes()
            self._answered = (episode, seq)
        self._commands.publish_raw(self._reply)

    def _look(self, stamp_ns: int) -> None:
        """Take in the rider's measurements; wait for the one that is due, up to a time-out."""
        if self._eyes is None:
            return
        deadline = time.monotonic() + _SIGHT_TIMEOUT
        while True:
            while (raw := self._eyes.take_raw()) is not None:
                self._operator.watch(sight.stamp_of(raw), raw)
            left = deadline - time.monotonic()
            if not self._operator.awaits(stamp_ns) or left <= 0.0 or self._stop.requested:
                return
            self._waiter.wait(min(left, _SILENCE))


ABOUT = About(
    package="cassie_teleop",
    text="Drives the robot by a script in robot time, in lock-step with the loop.",
    reads=(DECIMATED_STATE, "/cassie/ground_truth"),
    writes=("/cassie/operator_command", "/diagnostics"),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("scripted_operator", ScriptedOperatorNode, ABOUT)
