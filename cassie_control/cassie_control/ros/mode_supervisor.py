"""Node `mode_supervisor`: decides the mode, limits the set-points, watches the other nodes."""

from __future__ import annotations

import time
from dataclasses import dataclass

from rclpy.node import Node

from cassie_control.guarded import GuardedSupervisor
from cassie_control.ros.common import LOOK_PERIOD, Conditions, LaneConfig, LiveConfig, RateCheck
from cassie_control.ros.node_events import NodeEvents
from cassie_control.ros.operator_source import CommandInForce, OperatorSource
from cassie_control.ros.supervisor_status import StatusTopic
from cassie_control.ros.watch import Watch
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_msgs.layout import DECIMATED_STATE, Mode, RobotState, header
from cassie_msgs.ros.about import About
from cassie_msgs.ros.claim import Claim, ClaimConfig
from cassie_msgs.ros.decimated_states import DecimatedStates
from cassie_msgs.ros.fast_lane import LanePublisher, LaneWaiter
from cassie_msgs.ros.one_writer import WriterWatch
from cassie_msgs.ros.parameters import declare
from cassie_msgs.ros.process import Stop, run
from cassie_msgs.ros.scheduling import Place, Scheduling
from cassie_msgs.schedule import PERIOD_TICKS
from cassie_msgs.tunables import tunable


@dataclass(frozen=True, kw_only=True)
class ModeSupervisorConfig(LaneConfig):
    """Parameters of the node, in addition to those of the supervisor."""

    scripted_operator: bool = tunable(
        False, description="The operator is a script that answers every 10th state", live=False
    )


class ModeSupervisorNode(Node):
    """Answers every 10th state with the mode that is valid from ten ticks later on."""

    def __init__(self, stop: Stop) -> None:
        super().__init__("mode_supervisor")
        self.claim = Claim(self, "mode_supervisor")
        self._lane = declare(self, ModeSupervisorConfig())
        config = declare(self, SupervisorConfig())
        self._core = ModeSupervisor(config, self._lane.period)
        self._supervisor = GuardedSupervisor(self._core)
        self._events = NodeEvents(self, (self._lane, config))
        self._config = LiveConfig(self, config, self._configure, self._events)
        self._reported_lost = False
        self._scheduling = Scheduling(self.get_logger().warning, Place.BESIDE)
        self._stop = stop
        self._conditions = Conditions(self)
        self._rate = RateCheck(self, stop, self._lane.control_rate)
        self._states = DecimatedStates(self)
        self._modes = LanePublisher(self, Mode)
        self._status = StatusTopic(self, self._lane.control_rate)
        self._in_force = CommandInForce(self)
        self._watch = Watch(self, self._conditions)
        self._operator = OperatorSource(
            self, stop, self._states, self._conditions, scripted=self._lane.scripted_operator
        )
        WriterWatch(
            self,
            [self._states.estimator, self._watch.controller, self._watch.simulator],
            [self._modes.publisher, self._status.publisher],
            self._conditions.follow,
        )
        self._waiter = LaneWaiter(self, [self._states])
        stop.on_request(self._waiter.wake)
        self._state = RobotState()
        self._last = (-1, -1)
        self._replies: list[bytes] = []

    def loop(self) -> None:
        """Answer states until stopped."""
        next_look = time.monotonic()
        while not self._stop.requested:
            self._waiter.wait(LOOK_PERIOD)
            self._take_states()
            now = time.monotonic()
            if now >= next_look:
                next_look = now + LOOK_PERIOD
                self._states.follow_estimator()
                if self._watch.look(now) or self._status.is_due(now):
                    self._publish_status()

    def _publish_status(self) -> None:
        faults = (*self._watch.faults, *self._operator.faults)
        self._status.publish(self._supervisor.status, self._state, self._operator, faults)

    def _take_states(self) -> None:
        while not self._stop.requested:
            raw = self._operator.take_state()
            if raw is None:
                return
            _, _, episode, seq = header(raw)
            self._watch.heard_state(time.monotonic())
            repeated = (episode, seq) == self._last
            self._last = (episode, seq)
            if repeated:
                self._repeat()
            elif seq % PERIOD_TICKS == 0:
                self._answer(raw, episode, seq)

    def _repeat(self) -> None:
        """Answer a repeated state: an answer may have been lost, or a node may be new."""
        for reply in self._replies:
            self._modes.publish_raw(reply)

    def _answer(self, raw: bytes, episode: int, seq: int) -> None:
        try:
            new_episode = episode != int(self._state.episode)
            self._state.load(raw)
        except ValueError as error:
            self._conditions.set("state", str(error))
            return
        if new_episode:
            self._begin(episode)
        self._rate.check(episode, seq, self._state)
        self._scheduling.follow(bool(self._state.wall_paced))
        operator = self._operator.at(self._state)
        self._in_force.publish(operator, self._state)
        lost = self._watch.controller_lost(time.monotonic())
        if lost != self._reported_lost:
            self._reported_lost = lost
            node = "gait_controller" if lost else None
            self._events.publish(self._state, "lost", {"node": node})
        self._config.update(self._state)
        mode = self._supervisor.step(self._state, operator, lost)
        reply = mode.to_bytes()
        self._modes.publish_raw(reply)
        self._replies = [*self._replies[-1:], reply]  # the present answer and the next one
        self._conditions.set("state", self._supervisor.problem)
        faults = (*self._watch.faults, *self._operator.faults)
        self._status.follow(seq, self._supervisor.status, self._state, self._operator, faults)

    def _begin(self, episode: int) -> None:
        self._supervisor.reset()
        self._operator.reset(episode)
        self._events.began(self._state)
        self._reported_lost = False
        self._replies.clear()
        self.get_logger().info(f"episode {episode}")

    def _configure(self, config: SupervisorConfig) -> None:
        self._core.config = config


ABOUT = About(
    package="cassie_control",
    text="Decides the robot's mode from its state and the operator's commands, limits the "
    "set-points, and watches the other nodes.",
    reads=(DECIMATED_STATE, "/cassie/operator_command", "/cassie/controller_status", "/clock"),
    writes=(
        "/cassie/mode",
        "/cassie/operator_in_force",
        "/cassie/supervisor_status",
        "/cassie/node_events",
        "/diagnostics",
    ),
    parameters=(ModeSupervisorConfig(), SupervisorConfig(), ClaimConfig()),
)


def main() -> None:
    """Entry point of `ros2 run cassie_control mode_supervisor`."""
    run("mode_supervisor", ModeSupervisorNode, ABOUT)


if __name__ == "__main__":
    main()
