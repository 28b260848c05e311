"""A supervisor with a state and an operator that tests choose."""

from __future__ import annotations

from robot_states import leg_joints, state_of

from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode
from cassie_msgs.schedule import PERIOD_TICKS

CONFIG = SupervisorConfig()
PERIOD = 0.002 * PERIOD_TICKS
OFF, DAMP, STAND, WALK, SEGWAY = RobotMode


class Scene:
    """A supervisor, the state it sees and the command it gets."""

    def __init__(self) -> None:
        self.core = ModeSupervisor(CONFIG, 0.002)
        self.state = state_of(leg_joints(), leg_joints(), height=CONFIG.walk_height)
        self.operator: OperatorCommand | None = OperatorCommand()
        self.lost = False
        self.ask(power=True, link=True, height=CONFIG.walk_height, mode=int(STAND))

    def ask(self, **fields: float) -> None:
        """Set fields of the operator's command."""
        for name, value in fields.items():
            getattr(self.operator, name)[...] = value

    def run(self, duration: float = PERIOD) -> Mode:
        """The mode after some time; it is kept by the core."""
        for _ in range(max(1, round(duration / PERIOD))):
            mode = self.core.step(self.state, self.operator, self.lost)
        return mode

    @property
    def mode(self) -> RobotMode:
        """Mode that the last answer puts in force."""
        return self.core.status.mode

    @property
    def readiness(self) -> str:
        """Why the mode asked for is not in force."""
        return self.core.status.readiness
