"""A controller whose gaits are optimized while the robot walks, in one process."""

from __future__ import annotations

from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import GaitController
from cassie_control.learning.torque_table import LearnedTorques
from cassie_gaits.gait_library import GaitLibrary
from cassie_gaits.gait_library_file import library_path, load_certified
from cassie_gaits.gait_message import conditions_of, gait_message
from cassie_gaits.optimize.single import GaitMaker
from cassie_msgs.layout import Gait, Mode, MotorCommand, RobotState, Sample

STARTS_FROM = "dense"
"""Library from whose gaits the optimizer starts; the default of its node."""


class OptimizedGaitController(GaitController):
    """The controller together with the gait optimizer, on the schedule of lock-step.

    Args:
        config, library, period, learned: As for `GaitController`.
    """

    def __init__(
        self,
        config: ControllerConfig,
        library: GaitLibrary,
        period: float,
        learned: LearnedTorques | None = None,
    ) -> None:
        self._maker = GaitMaker(load_certified(library_path(STARTS_FROM)))
        self._answer: Gait | None = None
        self._messages: list[Sample] = []
        super().__init__(config, library, period, learned)

    def reset(self) -> None:
        """Start afresh."""
        self._answer = None
        self._messages = []
        super().reset()

    def step(self, state: RobotState, mode: Mode) -> MotorCommand:
        """Set-points for one tick; before, the gait that takes effect at this tick is offered."""
        answer = self._answer
        if answer is not None and int(state.seq) == int(answer.effective_seq):
            self.offer(answer)
            self._answer = None
        command = super().step(state, mode)
        request = self.request()
        if request is not None:
            self._answer = gait_message(request, self._maker.make(conditions_of(request)))
            self._messages = [request, self._answer]
        return command

    def take_messages(self) -> list[Sample]:
        """The request of the last step and its answer; none if it made no request."""
        messages, self._messages = self._messages, []
        return messages
