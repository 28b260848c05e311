"""Estimator and controller as two nodes of one process: saves a hop and two wake-ups per tick."""

from __future__ import annotations

import threading

from cassie_control.ros import gait_controller, state_estimator
from cassie_control.ros.gait_controller import GaitControllerNode
from cassie_control.ros.state_estimator import StateEstimator
from cassie_msgs.layout import RobotState
from cassie_msgs.ros.about import About
from cassie_msgs.ros.fast_lane import LocalTopic
from cassie_msgs.ros.process import Stop, run


class Stack:
    """The nodes `state_estimator` and `gait_controller`, with their topics and parameters.

    The controller gets each state from the estimator in the thread that received the sample; the
    state is published after its command. Messages and trajectories are those of two processes.
    """

    def __init__(self, stop: Stop) -> None:
        self._stop = stop
        states: LocalTopic[RobotState] = LocalTopic()
        self._controller = GaitControllerNode(stop, states)
        self._estimator = StateEstimator(stop, states)
        self.nodes = (self._estimator, self._controller)

    def loop(self) -> None:
        """Answer samples until stopped."""
        estimator = threading.Thread(target=self._estimate, name="estimator", daemon=True)
        estimator.start()
        try:
            self._controller.loop()
        finally:
            self._stop.request()
            estimator.join(timeout=1.0)
        if self._error is not None:
            raise self._error

    _error: BaseException | None = None

    def _estimate(self) -> None:
        try:
            self._estimator.loop()
        except BaseException as error:
            self._error = error
            self._stop.request(exit_code=1)


_NODES = (state_estimator.ABOUT, gait_controller.ABOUT)

ABOUT = About(
    package="cassie_control",
    text="The nodes state_estimator and gait_controller in one process: saves a hop and two "
    "wake-ups per control tick. Parameters of one node: -p NODE:NAME:=VALUE.",
    reads=[
        topic
        for about in _NODES
        for topic in dict.fromkeys(about.reads)
        if topic != RobotState.TOPIC
    ],
    writes=list(dict.fromkeys(topic for about in _NODES for topic in about.writes)),
    parameters=tuple(dict.fromkeys(config for about in _NODES for config in about.parameters)),
)


def main() -> None:
    """Entry point of `ros2 run cassie_control stack`."""
    run("stack", Stack, ABOUT)


if __name__ == "__main__":
    main()
