"""Node `gait_optimizer`: gaits made while the robot walks, on request."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import Any

from rclpy.node import Node

from cassie_gaits.gait_library_file import library_path, load_certified
from cassie_gaits.gait_message import conditions_of, gait_message
from cassie_gaits.optimize.single import Answer, Conditions, GaitMaker
from cassie_msgs.layout import Gait, GaitRequest
from cassie_msgs.processes import end_within
from cassie_msgs.ros.about import About
from cassie_msgs.ros.claim import Claim, ClaimConfig
from cassie_msgs.ros.diagnostics import OK, WARN, Diagnostics
from cassie_msgs.ros.fast_lane import EVERY, LanePublisher, LaneSubscription, LaneWaiter
from cassie_msgs.ros.one_writer import OneWriter, WriterWatch
from cassie_msgs.ros.parameters import declare, on_change
from cassie_msgs.ros.process import LEAVE_TIMEOUT, Stop, run
from cassie_msgs.srv import SolveGait
from cassie_msgs.tunables import ParameterError, tunable

_LOOK_PERIOD = 0.5  # s of wall time between checks for a request to stop
BUDGET = 0.5
"""Time of solver and certificate together, above which a warning is reported. In s."""


ESTIMATED = -1.0
"""Value of a parameter for which the estimate in each request is used."""


@dataclass(frozen=True, kw_only=True)
class GaitOptimizerConfig:
    """Parameters of the node."""

    gait_library: str = tunable(
        "dense",
        description="Gait library whose gaits the solver starts from: a file, optimized or dense",
        live=False,
    )
    payload: float = tunable(
        ESTIMATED, "kg", -1.0, 30.0, "Mass on the pelvis; -1: the estimate in each request"
    )
    slope: float = tunable(
        ESTIMATED, "rad", -1.0, 0.5, "Rise of the ground ahead; -1: the estimate in each request"
    )

    def __post_init__(self) -> None:
        """Check that a payload is none below 0 but the word for the estimate.

        Raises:
            ParameterError: if it is; the message has the value.
        """
        if ESTIMATED < self.payload < 0.0:
            raise ParameterError(f"payload = {self.payload:g} kg is neither 0 .. 30 kg nor -1")


class GaitOptimizerNode(Node):
    """Answers each request with a certified gait, or with the reason why there is none.

    Args:
        stop: Request to end.
    """

    def __init__(self, stop: Stop) -> None:
        super().__init__("gait_optimizer")
        self.claim = Claim(self, "gait_optimizer")
        self._config = declare(self, GaitOptimizerConfig())
        on_change(self, lambda: self._config, self._set_config)
        library = load_certified(library_path(self._config.gait_library))
        self._maker = GaitMaker(library)
        self._stop = stop
        self._working = threading.Lock()  # a service call runs in the executor's thread
        self._diagnostics = Diagnostics(self)
        self._requests = LaneSubscription(
            self, GaitRequest, qos=EVERY, guard=(guard := OneWriter(GaitRequest))
        )
        self._gaits = LanePublisher(self, Gait)
        WriterWatch(self, [guard], [self._gaits.publisher], self._tell)
        self._waiter = LaneWaiter(self, [self._requests])
        self._prepared = False
        stop.on_request(self._waiter.wake)
        stop.on_request(self._leave)
        self._request = GaitRequest()
        self.create_service(SolveGait, "/cassie/solve_gait", self._on_solve)

    def loop(self) -> None:
        """Answer requests until stopped."""
        with self._working:
            self._maker.prepare()
        if self._stop.requested:
            return
        self._prepared = True
        self._diagnostics.set("node", OK, "ready")
        self.get_logger().info("ready")
        while not self._stop.requested:
            for raw in self._requests.take_last(1):
                self._answer(raw)
            self._waiter.wait(_LOOK_PERIOD)

    def _leave(self) -> None:
        """End the process in time although the programs are still being set up, for seconds."""
        if not self._prepared:
            end_within(LEAVE_TIMEOUT, self._stop.exit_code)

    def _answer(self, raw: bytes) -> None:
        request = self._request
        try:
            request.load(raw)
        except ValueError as error:
            self._tell("request", str(error))
            return
        self._tell("request", "")
        answer = self._make(conditions_of(request))
        self._gaits.publish(gait_message(request, answer))
        spent = answer.solve_time + answer.certify_time
        late = f"{spent:.2f} s for one gait, expected {BUDGET} s" if spent > BUDGET else ""
        self._tell("time", late)
        self._tell("gait", "" if answer.gait is not None else answer.reason)

    def _make(self, asked: Conditions) -> Answer:
        """A gait for a request; parameters may replace the request's estimates."""
        given = self._config
        if given.payload != ESTIMATED:
            asked = replace(asked, payload=given.payload)
        if given.slope != ESTIMATED:
            asked = replace(asked, slope=given.slope)
        with self._working:
            return self._maker.make(asked)

    def _on_solve(self, request: Any, response: Any) -> Any:
        numbers = (getattr(request, name) for name in ("vx", "vy", "yaw_rate", "payload", "slope"))
        with self._working:
            answer = self._maker.make(Conditions(*numbers))
        response.success, response.message = answer.gait is not None, answer.reason
        response.solve_time, response.certify_time = answer.solve_time, answer.certify_time
        if answer.gait is not None:
            response.step_time, response.cost = answer.gait.step_time, answer.gait.cost or 0.0
            response.right_stance, response.left_stance = (
                stance.ravel() for stance in answer.gait.coefficients
            )
        return response

    def _set_config(self, config: GaitOptimizerConfig) -> None:
        self._config = config

    def _tell(self, subject: str, problem: str) -> None:
        self._diagnostics.set(subject, WARN if problem else OK, problem or "ok")


ABOUT = About(
    package="cassie_gaits",
    text="Answers each request of the controller with a certified gait for the commanded speeds "
    "and the estimated robot, or with the reason why there is none. The controller sends requests "
    "if its parameter gait_source is optimizer.",
    reads=(GaitRequest.TOPIC,),
    writes=(Gait.TOPIC, "/diagnostics"),
    services=("/cassie/solve_gait",),
    parameters=(GaitOptimizerConfig(), ClaimConfig()),
)


def main() -> None:
    """Entry point of `ros2 run cassie_gaits gait_optimizer`."""
    run("gait_optimizer", GaitOptimizerNode, ABOUT)


if __name__ == "__main__":
    main()
