"""Node `state_estimator`: sensor samples in, state estimates out."""

from __future__ import annotations

import time

from rclpy.node import Node

from cassie_control.estimator.choice import make_monitored
from cassie_control.estimator.config import BRIDGED, EstimatorConfig
from cassie_control.guarded import GuardedEstimator
from cassie_control.ros.common import (
    LOOK_PERIOD,
    Conditions,
    LaneConfig,
    LiveConfig,
    RateCheck,
    Turns,
)
from cassie_control.ros.node_events import NodeEvents
from cassie_control.ros.standard_topics import StandardTopics
from cassie_control.silence import Silence
from cassie_gaits.compiled import load_kept
from cassie_msgs.layout import DECIMATED_STATE, RobotState, Sensors
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
from cassie_msgs.schedule import PERIOD_TICKS, SILENT_AFTER, START_TIMEOUT

_REJECTED = "rejected, a substitute is used where there is one; checked anew at rest without power"


class StateEstimator(Node):
    """Answers each sensor sample with a state; a repeated sample with the same state again.

    Args:
        stop: Request to end.
        hand_on: Passes states to a controller of the same process, before other nodes get them.
    """

    def __init__(self, stop: Stop, hand_on: LocalTopic[RobotState] | None = None) -> None:
        super().__init__("state_estimator")
        self.claim = Claim(self, "state_estimator")
        self._lane = declare(self, LaneConfig())
        config = declare(self, EstimatorConfig())
        self._core = make_monitored(config, self._lane.period)
        load_kept("cassie_gaits")
        load_kept("cassie_control.estimator")
        most_missed = round(BRIDGED * self._lane.control_rate)
        self._estimator = GuardedEstimator(self._core, most_missed)
        self._hand_on = hand_on
        self._scheduling = Scheduling(self.get_logger().warning)
        self._events = NodeEvents(self, (self._lane, config))
        self._config = LiveConfig(self, config, self._configure, self._events)
        self._stop = stop
        self._conditions = Conditions(self)
        self._rate = RateCheck(self, stop, self._lane.control_rate)
        simulator = OneWriter(Sensors)
        self._samples = LaneSubscription(self, Sensors, qos=NEWEST_OF_ONE, guard=simulator)
        self._decimated = LanePublisher(self, RobotState, DECIMATED_STATE)
        self._states = LanePublisher(self, RobotState)
        publishers = [self._states.publisher, self._decimated.publisher]
        WriterWatch(self, [simulator], publishers, self._conditions.follow)
        self._standard = StandardTopics(self, self._lane.control_rate)
        self._waiter = LaneWaiter(self, [self._samples])
        stop.on_request(self._waiter.wake)
        self._sample = Sensors()
        self._state = RobotState()
        self._answered = (-1, -1)
        self._reported: tuple[str, ...] = ()
        self._starts = 0
        self._reply = b""
        self._silence = Silence(SILENT_AFTER, START_TIMEOUT, time.monotonic())

    def loop(self) -> None:
        """Answer samples until stopped, in the receiving thread."""
        turns = Turns(self._answer_newest)
        with self._samples.served(turns.at_once):
            while not self._stop.requested:
                turns.in_turn()
                if self._silence.lost(time.monotonic()):
                    problem = "no sensor samples: is the simulator running?"
                    self._conditions.set("simulator", problem)
                self._waiter.wait(LOOK_PERIOD)

    def _answer_newest(self, _: bool) -> bool:
        try:
            come = self._samples.take(self._sample)
        except ValueError as error:
            self._conditions.set("sensors", str(error))
        else:
            if come:
                self._answer()
                self._silence.heard(time.monotonic())
        return False

    def _answer(self) -> None:
        sample = self._sample
        episode, seq = key = sample.place
        if key == self._answered:
            if self._hand_on is not None:
                self._hand_on.put(self._state)
            self._states.publish_raw(self._reply)
            self._decimated.publish_raw(self._reply)
            return
        if episode != self._answered[0]:
            self._begin(episode)
        self._config.update(sample)
        self._state = state = self._estimator.step(sample)
        if self._hand_on is not None:
            self._hand_on.put(state)
        self._reply = state.to_bytes()
        self._states.publish_raw(self._reply)
        if seq % PERIOD_TICKS == 0:
            self._decimated.publish_raw(self._reply)
        self._answered = key
        self._rate.check(episode, seq, sample)
        self._scheduling.follow(bool(sample.wall_paced))
        if self._stop.requested:
            return  # no further report, which would hide the reason
        self._conditions.set("simulator", "")
        self._conditions.set("sensors", self._estimator.problem)
        if self._core.starts != self._starts:
            self._report_start()
        if self._core.faults != self._reported:
            self._report_faults(self._core.faults)
        self._standard.publish(seq, sample, state)

    def _report_faults(self, faults: tuple[str, ...]) -> None:
        """Report which channels are rejected now, and which are accepted again."""
        for channel in self._reported:
            if channel not in faults:
                self._conditions.set(channel, "")
        for channel in faults:
            self._conditions.set(channel, _REJECTED)
        self._reported = faults

    def _report_start(self) -> None:
        self._starts = self._core.starts
        self.get_logger().info("the estimate begins anew")

    def _begin(self, episode: int) -> None:
        self._estimator.reset()
        self._events.began(self._sample)
        self._starts = 0
        self.get_logger().info(f"episode {episode}")

    def _configure(self, config: EstimatorConfig) -> None:
        self._core.config = config


ABOUT = About(
    package="cassie_control",
    text="Answers each sensor sample with an estimate of the robot's state.",
    reads=("/cassie/sensors",),
    writes=(
        "/cassie/state",
        DECIMATED_STATE,
        "/imu/data",
        "/odom",
        "/tf",
        "/tf_static",
        "/cassie/node_events",
        "/diagnostics",
    ),
    parameters=(LaneConfig(), EstimatorConfig(), ClaimConfig()),
)


def main() -> None:
    """Entry point of `ros2 run cassie_control state_estimator`."""
    run("state_estimator", StateEstimator, ABOUT)


if __name__ == "__main__":
    main()
