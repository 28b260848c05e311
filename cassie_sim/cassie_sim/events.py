"""Events of a scenario in robot time: gantry moves, pushes, sensor faults, delays."""

from __future__ import annotations

import math
from collections import deque

import mujoco
import numpy as np

from cassie_gaits.records import FloatArray
from cassie_msgs.experiment.scenario import GantryMove, Push, Scenario, SensorFault
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_msgs.tunables import unknown_name
from cassie_sim.errors import SimulationError
from cassie_sim.gantry import Gantry


class Events:
    """Events of a scenario, and pushes that are requested while it runs.

    Args:
        scenario: Scenario with the events; times are robot time in s.
        model: Model in which bodies are found by name.
        physics_rate: Rate of the physics. In Hz.

    Raises:
        SimulationError: if a push names an unknown body or a fault an unknown channel.
    """

    def __init__(self, scenario: Scenario, model: mujoco.MjModel, physics_rate: int) -> None:
        self._rate = physics_rate
        self._model = model
        self._moves = scenario.gantry
        self._pushes = tuple(self._timed(push, _at(push)) for push in scenario.pushes)
        self._faults = tuple(ActiveFault(fault, physics_rate) for fault in scenario.faults)
        self._delay = round(scenario.delays.set_point * physics_rate)
        self.reset()

    def reset(self) -> None:
        """Go back to time 0, without the pushes that were requested."""
        self._next_move = 0
        self._live: list[tuple[int, int, int, FloatArray]] = list(self._pushes)
        self._pushed: set[int] = set()
        self._under_way: deque[tuple[int, MotorCommand]] = deque()
        for fault in self._faults:
            fault.reset()

    def push(self, push: Push, now: int) -> None:
        """Add a push that begins at physics step `now` plus its time."""
        start, end, body, force = self._timed(push, "push")
        self._live.append((now + start, now + end, body, force))

    def apply(self, step: int, data: mujoco.MjData, gantry: Gantry, position: FloatArray) -> None:
        """Set the external forces of a physics step and command the gantry."""
        while (
            self._next_move < len(self._moves)
            and step >= self._moves[self._next_move].t * self._rate
        ):
            _order(gantry, self._moves[self._next_move], position)
            self._next_move += 1
        if self._live or self._pushed:
            self._apply_pushes(step, data, gantry)

    def quiet_steps(self, step: int, most: int) -> int:
        """Number of physics steps from `step` on, at most `most`, until the next event.

        The first step is `step` itself, whose events `apply` has done already. The arrival of a
        command is an event, too.
        """
        return 1 if self._pushed else max(1, self._next(step + most) - step)

    def idle(self, step: int, steps: int) -> bool:
        """Whether there is no event in `steps` physics steps from `step` on."""
        return not self._pushed and self._next(step + steps) >= step + steps

    def _next(self, limit: int) -> int:
        """Physics step of the next event, at most `limit`."""
        due = limit
        if self._next_move < len(self._moves):
            due = min(due, math.ceil(self._moves[self._next_move].t * self._rate))
        for start, _, _, _ in self._live:
            due = min(due, start)
        if self._under_way:
            due = min(due, self._under_way[0][0])
        return due

    def _apply_pushes(self, step: int, data: mujoco.MjData, gantry: Gantry) -> None:
        pelvis = self._model.body("pelvis").id
        for body in self._pushed:
            data.xfrc_applied[body] = gantry.wrench if body == pelvis else 0.0
        self._pushed.clear()
        for start, end, body, force in self._live:
            if start <= step < end:
                data.xfrc_applied[body, :3] += force
                self._pushed.add(body)
        self._live = [push for push in self._live if step < push[1]]

    def spoil(self, step: int, sample: Sensors) -> None:
        """Apply the sensor faults to a sample."""
        for fault in self._faults:
            fault.spoil(step, sample)

    @property
    def delays_commands(self) -> bool:
        """Whether commands reach the drives with a delay."""
        return self._delay > 0

    def send(self, command: MotorCommand, step: int) -> None:
        """Send a motor command to the drives, with the delay, at physics step `step`."""
        if self._delay:
            copy = MotorCommand()
            copy.copy_from(command)
            command = copy
        self._under_way.append((step + self._delay, command))

    def arrived(self, step: int) -> MotorCommand | None:
        """The newest command that has arrived at physics step `step` and was not taken yet."""
        newest = None
        while self._under_way and self._under_way[0][0] <= step:
            newest = self._under_way.popleft()[1]
        return newest

    def _timed(self, push: Push, name: str) -> tuple[int, int, int, FloatArray]:
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, push.body)
        if body <= 0:  # body 0 is the world, which no force moves
            names = [self._model.body(i).name for i in range(1, self._model.nbody)]
            raise SimulationError(f"{name}: {unknown_name(push.body, names, 'body')}")
        start = round(push.t * self._rate)
        return start, start + max(1, round(push.duration * self._rate)), body, np.array(push.force)


class ActiveFault:
    """One faulty channel.

    Args:
        fault: The fault, with its channel and time.
        physics_rate: Rate of the physics. In Hz.

    Raises:
        SimulationError: if there is no such channel, or the delay is negative.
    """

    def __init__(self, fault: SensorFault, physics_rate: int) -> None:
        field, _, index = fault.channel.partition(".")
        channels = [name for name, _, _ in Sensors.LAYOUT]
        if field not in channels:
            raise SimulationError(f"{_at(fault)}: {unknown_name(field, channels, 'channel')}")
        values = getattr(Sensors(), field)
        if index and not (index.isdigit() and int(index) < values.size):
            raise SimulationError(
                f"{_at(fault)}, channel {fault.channel}: index must be 0 .. {values.size - 1}"
            )
        self._field = field
        self._index = slice(int(index), int(index) + 1) if index else slice(None)
        self._kind = fault.kind
        self._size = fault.size
        self._start = round(fault.t * physics_rate)
        self._end = self._start + fault.duration * physics_rate
        self._late = round(fault.size * physics_rate)
        if fault.kind == "delay" and fault.size < 0.0:
            raise SimulationError(
                f"{_at(fault)}, channel {fault.channel}: size = {fault.size:g} s is no delay: "
                "expected 0 s or more"
            )
        self.reset()

    def reset(self) -> None:
        """Forget the channel's past readings."""
        self._held: FloatArray | None = None
        self._history: deque[tuple[int, FloatArray]] = deque()

    def spoil(self, step: int, sample: Sensors) -> None:
        """Apply the fault to the sample of a physics step, within the fault's time."""
        values = getattr(sample, self._field).reshape(-1)[self._index]
        if self._kind == "delay":
            self._history.append((step, values.copy()))
            while len(self._history) > 1 and self._history[1][0] <= step - self._late:
                self._history.popleft()
        if not self._start <= step < self._end:
            return
        if self._held is None:
            self._held = values.copy()
        if self._kind == "off":
            values[:] = 0.0
        elif self._kind == "nan":
            values[:] = np.nan
        elif self._kind == "delay":
            values[:] = self._history[0][1]
        elif self._kind == "stuck":
            values[:] = self._held
        elif step % 20 == 0:
            values += self._size


def _at(event: Push | SensorFault) -> str:
    """Name of an event in messages: files do not need to have their events in order of time."""
    return f"{'push' if isinstance(event, Push) else 'fault'} at {event.t:g} s"


def _order(gantry: Gantry, move: GantryMove, position: FloatArray) -> None:
    if move.action == "hold":
        gantry.hold(position, move.height, move.speed)
    elif move.action == "lower":
        gantry.lower(move.height, move.speed)
    else:
        gantry.release()
