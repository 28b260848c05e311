"""The cores of all nodes as if paced by the wall clock: no node waits for another.

Silence, restarts and operators' commands happen in robot time here, so that a run is the same on
every machine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cassie_bags.run.cores import make_cores
from cassie_bags.run.simulate import Cores
from cassie_bags.studies.failsafes.participants import (
    CONTROLLER,
    ESTIMATOR,
    SUPERVISOR,
    SimulatedOperator,
    UnsafeError,
)
from cassie_bags.studies.run_trial import CHECK_TICKS, has_fallen
from cassie_control.estimator.config import BRIDGED
from cassie_control.guarded import (
    GuardedController,
    GuardedEstimator,
    GuardedSupervisor,
)
from cassie_control.schedule import ModeInForce
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import Mode, RobotMode, RobotState
from cassie_msgs.operators import Operators
from cassie_msgs.schedule import ANSWER_AFTER, PERIOD_TICKS
from cassie_sim import ground_truth, orders
from cassie_sim.power_switch import PowerSwitch


class WallPaced:
    """One run of the cores.

    Args:
        experiment: Experiment with robot, scene, events and the operator's commands; drawn.

    Attributes:
        plant: The simulated robot.
        person: Operator who drives.
        others: Further operators.
        silent: Names of nodes that neither receive nor send.
        drops: Function that returns at each tick whether the motor command is lost, or None.
        charge: Charge of the battery, 0..1.
        modes: Time (s) and message of each mode.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._make: Callable[[], Cores] = lambda: make_cores(experiment)
        cores = self._make()
        self.plant = cores.plant
        self.period = self.plant.tick_ns * 1e-9
        self.person = SimulatedOperator("person-1", cores.operator)
        self.others: list[SimulatedOperator] = []
        self.silent: set[str] = set()
        self.drops: Callable[[], bool] | None = None
        self.charge = 1.0
        self.modes: list[tuple[float, Mode]] = []
        self._truth = ground_truth.GroundTruth()
        self._switch = PowerSwitch(scripted=False, start_timeout=0.0)
        self._state = RobotState()
        self._missed = 0
        self.fallen = False
        for node in (ESTIMATOR, CONTROLLER, SUPERVISOR):
            self._begin(node, cores)

    @property
    def now(self) -> float:
        """Robot time. In s."""
        return float(self.plant.seq * self.period)

    @property
    def mode(self) -> RobotMode:
        """Mode that the supervisor has put in force."""
        return self._supervisor.status.mode

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults that the supervisor reports, and the reason why there is no power."""
        refused = self._operators.power_refused
        return (*self._supervisor.status.faults, *((f"no power: {refused}",) if refused else ()))

    @property
    def armed(self) -> bool:
        """Whether the speeds of the driving operator have an effect."""
        return self._operators.armed

    @property
    def powered(self) -> bool:
        """Whether the drives have power."""
        return bool(self.plant.drives.powered)

    @property
    def height(self) -> float:
        """True height of the pelvis. In m."""
        return float(self.plant.pelvis_pose[0][2])

    @property
    def torque(self) -> float:
        """Largest torque that acts now. In Nm."""
        return float(np.abs(self.plant.drives.applied).max())

    def restart(self, node: str) -> None:
        """Restart a node, without its memory."""
        self.silent.discard(node)
        self._begin(node, self._make())

    def _begin(self, node: str, cores: Cores) -> None:
        if node == ESTIMATOR:
            self._estimator = GuardedEstimator(cores.estimator, round(BRIDGED / self.period))
        elif node == CONTROLLER:
            self._controller = GuardedController(cores.controller)
            self._in_force = ModeInForce(self.period)
            self._commanded = self.plant.seq  # tick of the last command
        else:
            self._supervisor = GuardedSupervisor(cores.supervisor)
            self._operators = Operators()

    def push(self, force: tuple[float, float, float], duration: float) -> None:
        """Push the pelvis from now on, by a force (N) for a duration (s)."""
        orders.push(self.plant, "", force, duration)

    def hang_up(self) -> None:
        """Hang the robot up, well above the ground."""
        orders.move_gantry(self.plant, "hold", 1.3, 1.0)

    def let_down(self) -> None:
        """Let the robot down to the ground."""
        orders.move_gantry(self.plant, "lower", 0.82, 0.3)

    def tick(self) -> None:
        """Run one control tick."""
        plant = self.plant
        seq = plant.seq
        sample = plant.sense()
        sample.wall_paced[...] = 1
        sample.missed_ticks[...] = self._missed
        sample.battery[1] = self.charge
        sample.operator_lease[...] = self._switch.operators.lease
        if self.person.script is not None:
            self.person.script.watch(seq * plant.tick_ns, self._truth.write(plant))
        if ESTIMATOR not in self.silent:
            self._state = self._estimator.step(sample)
        if seq % PERIOD_TICKS == 0:
            self._hear(seq)
            if not {ESTIMATOR, SUPERVISOR} & self.silent:
                self._supervise()
        command = None
        if not {ESTIMATOR, CONTROLLER} & self.silent:
            command = self._controller.step(self._state, self._in_force.at(seq))
            if self.drops is not None and self.drops():
                command = None
            self._commanded = seq
        self._missed += command is None
        plant.power(self._switch.apply(seq))
        plant.step(command)
        if seq % CHECK_TICKS == 0:
            self.fallen = self.fallen or has_fallen(plant)

    def _hear(self, seq: int) -> None:
        """Send the operators' commands to the robot and to the supervisor, 50 times a second."""
        for person in (self.person, *self.others):
            if person.silent:
                continue
            command = person.command(self._state)
            self._switch.take(command, person.writer, self.plant.episode, seq, self.now)
            if SUPERVISOR not in self.silent:
                self._operators.take(command, person.writer, self.now)

    def _supervise(self) -> None:
        self._operators.follow(int(self._state.operator_lease))
        held = self._operators.command(self.now)
        silence = (self.plant.seq - self._commanded) * self.period
        mode = self._supervisor.step(self._state, held, silence > ANSWER_AFTER)
        self._in_force.table.add(mode)
        copy = Mode()
        copy.copy_from(mode)
        self.modes.append((self.now, copy))

    def run(self, duration: float, *, upright: bool = True) -> None:
        """Run for some robot time (s); `upright`: whether the robot must not fall.

        Raises:
            UnsafeError: if the robot falls although it must not.
        """
        for _ in range(round(duration / self.period)):
            self.tick()
            if upright and self.fallen:
                raise UnsafeError(f"fell at {self.now:.2f} s")

    def until(
        self, condition: Callable[[], bool], limit: float, what: str, *, upright: bool = True
    ) -> None:
        """Run until a condition holds.

        Args:
            condition: The condition.
            limit: Longest time until it holds. In s.
            what: The condition in words, for the error.
            upright: Whether the robot must not fall.

        Raises:
            UnsafeError: if the condition does not hold in time, or the robot falls.
        """
        start = self.now
        while not condition():
            if self.now - start > limit:
                raise UnsafeError(f"{what}: not within {limit:g} s; {self.describe()}")
            self.run(self.period, upright=upright)

    def hold(self, condition: Callable[[], bool], duration: float, what: str) -> None:
        """Run for some robot time (s), in which a condition has to hold at every tick.

        Args:
            condition: The condition.
            duration: Robot time. In s.
            what: The condition in words, for the error.

        Raises:
            UnsafeError: if the condition does not hold.
        """
        for _ in range(round(duration / self.period)):
            self.tick()
            if not condition():
                raise UnsafeError(f"{what}: no longer at {self.now:.2f} s; {self.describe()}")

    def describe(self) -> str:
        """The present mode, pelvis height and faults, in words."""
        return f"mode {self.mode.name.lower()}, pelvis at {self.height:.2f} m, {self.faults}"

    def peak_speeds(self, since: float) -> Mapping[str, float]:
        """Largest magnitude of each commanded speed since a time. In m/s and rad/s."""
        chosen = [mode for time, mode in self.modes if time >= since]
        return {
            name: max((abs(float(getattr(mode, name))) for mode in chosen), default=0.0)
            for name in ("vx", "vy", "yaw_rate")
        }
