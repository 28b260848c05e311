"""Node `gait_controller`: states and modes in, motor commands out."""

from __future__ import annotations

import time
from dataclasses import dataclass

from rclpy.node import Node

from cassie_control.config import ControllerConfig, LateGains
from cassie_control.control.gait_controller import GaitController
from cassie_control.guarded import GuardedController
from cassie_control.learning.torque_table import load_for_library, path_for_library
from cassie_control.ros.common import (
    LOOK_PERIOD,
    Conditions,
    LaneConfig,
    LiveConfig,
    RateCheck,
    Turns,
)
from cassie_control.ros.gait_source import GaitSource
from cassie_control.ros.mode_source import ModeSource, SubstituteMode
from cassie_control.ros.node_events import NodeEvents
from cassie_control.silence import Silence
from cassie_gaits.compiled import load_kept
from cassie_gaits.gait_library_file import default_library_path, library_path, load_certified
from cassie_msgs.layout import ControllerStatus, MotorCommand, RobotState
from cassie_msgs.ros.about import About
from cassie_msgs.ros.claim import Claim, ClaimConfig
from cassie_msgs.ros.fast_lane import (
    NEWEST_OF_ONE,
    LanePublisher,
    LaneSubscription,
    LaneWaiter,
    LocalTopic,
)
from cassie_msgs.ros.one_writer import OneWriter, WriterWatch
from cassie_msgs.ros.parameters import declare
from cassie_msgs.ros.process import Stop, run
from cassie_msgs.ros.scheduling import Scheduling
from cassie_msgs.schedule import SILENT_AFTER, START_TIMEOUT, STATUS_TICKS
from cassie_msgs.tunables import tunable

_COMPILED = ("cassie_gaits", *(f"cassie_control.{x}" for x in ("control", "planner", "learning")))

LATE = LateGains.latency
"""Latency of the drives above which /diagnostics reports it: gains change there. In s."""


@dataclass(frozen=True, kw_only=True)
class GaitControllerConfig(LaneConfig):
    """Parameters of the node, in addition to those of the controller."""

    gait_library: str = tunable(
        "", description="Gait library: a file, dense (empty) or optimized (seven gaits)", live=False
    )
    allow_uncertified: bool = tunable(
        False,
        description="Whether gaits without a valid certificate, imported or changed, are accepted",
        live=False,
    )
    learned_torques_file: str = tunable(
        "",
        description="File of learned torques (JSON); empty is the one beside the gait library",
        live=False,
    )
    gait_source: str = tunable(
        "library",
        description="Source of gaits: the library, or gait_optimizer for the estimated robot",
        choices=("library", "optimizer"),
        live=False,
    )


class GaitControllerNode(Node):
    """Answers each state with a command; a repeated state with the same command again.

    Args:
        stop: Request to end.
        states: States from an estimator of the same process; by default they are subscribed to.
    """

    def __init__(self, stop: Stop, states: LocalTopic[RobotState] | None = None) -> None:
        super().__init__("gait_controller")
        self.claim = Claim(self, "gait_controller")
        self._lane = declare(self, GaitControllerConfig())
        config = declare(self, ControllerConfig())
        gaits = default_library_path()
        if self._lane.gait_library:
            gaits = library_path(self._lane.gait_library)
        library = load_certified(gaits, allow_uncertified=self._lane.allow_uncertified)
        learned = load_for_library(gaits, self._lane.learned_torques_file)
        self._core = GaitController(config, library, self._lane.period, learned)
        self._controller = GuardedController(self._core)
        for package in _COMPILED:
            load_kept(package)
        self._scheduling = Scheduling(self.get_logger().warning)
        self._events = NodeEvents(
            self,
            (self._lane, config),
            {
                "gait_library": gaits,
                "learned_torques_file": self._lane.learned_torques_file or path_for_library(gaits),
            },
        )
        self._config = LiveConfig(self, config, self._core.configure, self._events)
        self._stop = stop
        self._conditions = Conditions(self)
        self._rate = RateCheck(self, stop, self._lane.control_rate)
        guards: list[OneWriter] = []
        self._states: LaneSubscription[RobotState] | LocalTopic[RobotState]
        if states is not None:
            self._states = states
        else:
            guards.append(OneWriter(RobotState))
            self._states = LaneSubscription(self, RobotState, qos=NEWEST_OF_ONE, guard=guards[0])
        self._commands = LanePublisher(self, MotorCommand)
        self._status = LanePublisher(self, ControllerStatus)
        self._modes = ModeSource(self, stop, self._states, self._conditions, self._lane.period)
        guards.append(self._modes.supervisor)
        publishers = [self._commands.publisher, self._status.publisher]
        self._gaits: GaitSource | None = None
        if self._lane.gait_source == "optimizer":
            self._gaits = GaitSource(self, stop, self._conditions, self._repeat_status)
            guards.append(self._gaits.optimizer)
            publishers.append(self._gaits.publisher)
        WriterWatch(self, guards, publishers, self._conditions.follow)
        self._waiter = LaneWaiter(self, [self._states])
        stop.on_request(self._waiter.wake)
        self._state = RobotState()
        self._answered = (-1, -1)
        self._reply = self._status_reply = b""
        self._silence = Silence(SILENT_AFTER, START_TIMEOUT, time.monotonic())
        self._reported: SubstituteMode | None = None
        self._unanswered = False  # whether a loaded state is left for the main thread to answer

    def loop(self) -> None:
        """Answer states until stopped, in the receiving thread if possible."""
        turns = Turns(self._answer_newest)
        with self._states.served(turns.at_once):
            while not self._stop.requested:
                turns.in_turn()
                if self._silence.lost(time.monotonic()):
                    problem = "no states: are simulator and state_estimator running?"
                    self._conditions.set("state_estimator", problem)
                self._waiter.wait(LOOK_PERIOD)

    def _answer_newest(self, may_wait: bool) -> bool:
        """Answer the newest state. If its mode has not come yet, do so only if `may_wait`."""
        while not self._stop.requested and self._take():
            state = self._state
            episode, seq = state.place
            known = episode == self._answered[0]
            if not may_wait and not (known and self._is_ready(seq)):
                self._unanswered = True
                return True
            self._answer()
            self._silence.heard(time.monotonic())
            if not may_wait:
                break  # in the receiving thread no further state can have come
        return False

    def _is_ready(self, tick: int) -> bool:
        """Whether all messages that a tick needs have come."""
        if self._gaits is not None and not self._gaits.is_ready(tick):
            return False
        return self._modes.is_ready(tick)

    def _take(self) -> bool:
        """Whether there is a state not answered yet; loads the newest one."""
        try:
            newer, self._modes.newer_state = self._modes.newer_state, None
            unanswered, self._unanswered = self._unanswered, False
            if self._states.take(self._state):
                return True
            if newer is not None:
                self._state.load(newer)
            return unanswered or newer is not None
        except ValueError as error:
            self._conditions.set("state", str(error))
            return False

    def _answer(self) -> None:
        state = self._state
        episode, seq = key = state.place
        if key == self._answered:
            self._commands.publish_raw(self._reply)
            self._status.publish_raw(self._status_reply)
            return
        if episode != self._answered[0]:
            self._begin(episode)
        self._config.update(state)
        mode = self._modes.at(seq)
        if self._modes.substitute != self._reported:
            self._report_substitute()
        if self._gaits is not None:
            self._offer(self._gaits)
        command = self._controller.step(state, mode)
        self._reply = command.to_bytes()
        self._commands.publish_raw(self._reply)
        self._answered = key
        if self._gaits is not None and (request := self._core.request()) is not None:
            self._gaits.ask(request)
        self._rate.check(episode, seq, state)
        self._scheduling.follow(bool(state.wall_paced))
        if seq % STATUS_TICKS == 0 or not self._status_reply:
            self._publish_status()  # at once for a new controller, which counts as lost until then
        self._conditions.set("state_estimator", "")
        self._conditions.set("state", self._controller.problem)

    def _offer(self, gaits: GaitSource) -> None:
        """Pass the gait of this tick, if there is one, to the core, and publish it for a replay."""
        gait = gaits.at(int(self._state.seq), wall_paced=bool(self._state.wall_paced))
        if gait is not None:
            self._core.offer(gait)
            self._events.publish(self._state, "gait", {"effective_seq": int(gait.effective_seq)})

    def _repeat_status(self) -> None:
        if self._status_reply:
            self._status.publish_raw(self._status_reply)

    def _publish_status(self) -> None:
        status = self._controller.status(self._state)
        status.supervisor_lost[...] = float(self._modes.lost)
        self._status_reply = status.to_bytes()
        late = float(status.command_latency)
        problem = f"act {1e3 * late:.0f} ms late on commands" if late > LATE else ""
        self._conditions.set("drives", problem)
        self._status.publish_raw(self._status_reply)

    def _begin(self, episode: int) -> None:
        self._controller.reset()
        self._modes.reset(episode)
        if self._gaits is not None:
            self._gaits.reset(episode)
        self._reported = None
        self._events.began(self._state)
        self.get_logger().info(f"episode {episode}")

    def _report_substitute(self) -> None:
        """Publish the mode that the controller uses instead of the mode made for this tick."""
        now, before = self._modes.substitute, self._reported
        if now is not None and now.supervisor_lost:
            content = {"node": "mode_supervisor", "since": now.effective_seq}
            self._events.publish(self._state, "lost", content)
        else:
            if before is not None and before.supervisor_lost:
                self._events.publish(self._state, "lost", {"node": None})
            late = None if now is None else now.effective_seq
            self._events.publish(self._state, "mode", {"effective_seq": late})
        self._reported = now


ABOUT = About(
    package="cassie_control",
    text="Answers each state with the set-points of the ten drives, in the mode that the "
    "supervisor commands.",
    reads=("/cassie/state", "/cassie/mode", "/cassie/gait"),
    writes=(
        "/cassie/motor_command",
        "/cassie/controller_status",
        "/cassie/gait_request",
        "/cassie/node_events",
        "/diagnostics",
    ),
    parameters=(GaitControllerConfig(), ControllerConfig(), ClaimConfig()),
)


def main() -> None:
    """Entry point of `ros2 run cassie_control gait_controller`."""
    run("gait_controller", GaitControllerNode, ABOUT)


if __name__ == "__main__":
    main()
