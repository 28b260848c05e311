"""The simulator's loop: samples out, commands in, lock-step and pacing.

The loop knows neither ROS nor a clock of its own: messages go through a `Lane`, and wall time
comes from a function that it is given.

The ticks are a generator that yields where it must wait: for a command, the wall clock or an
operator. The thread that runs the loop goes on with it after each wait. Where the command of
lock-step is all that it waits for, the thread that receives the command goes on at once.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Generator, Iterator

from cassie_msgs.layout import MotorCommand, OperatorCommand, Sensors
from cassie_msgs.operators import Refusals
from cassie_msgs.schedule import REPEAT_PERIOD
from cassie_sim.command_watch import CommandWatch
from cassie_sim.lane import Lane, Report
from cassie_sim.pacing import SHORTEST_TICK, Pace, RealTimeFactor, TickTiming
from cassie_sim.plant import Plant
from cassie_sim.power_switch import PowerSwitch
from cassie_sim.requests import Requests
from cassie_sim.simulator_config import SimulatorConfig

_BROKEN_TIMEOUT = 0.02  # at 2 kHz the chain may need longer than a tick, so some ticks wait
_BROKEN_PERIOD = 0.1

Ticks = Iterator[float]
"""Ticks of the plant: yields the wall time until which to wait for a message."""

Wait = Generator[float, None, bool]
"""A part of `Ticks` with a result."""


class SimulationLoop:
    """Runs a plant tick by tick.

    - lockstep: sample k, command k, step. The physics on which no command acts yet is computed in
      parallel with command k.
    - realtime: a tick lasts a tick of wall time and uses the newest command that has come.

    Attributes:
        plant: The plant; requests may replace it.
        paused: Whether ticks wait for credit.
        credit: Number of ticks that may run although paused.
        credit_spent: Event that is set when these ticks have run.
        broken: Whether lock-step is given up because no commands come.
        times_broken: How often lock-step was given up.
        timing: Missed and late ticks, while robot time is paced by the wall clock.
    """

    MAX_CREDIT = 10_000

    def __init__(
        self,
        plant: Plant,
        lane: Lane,
        config: SimulatorConfig,
        report: Report,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.plant = plant
        self.config = config
        self.paused = config.paused
        self.credit = 0
        self.credit_spent = threading.Event()
        self.broken = False
        self.times_broken = 0
        self.stopping = False
        self.factor = RealTimeFactor()
        self.requests = Requests()
        self.switch = PowerSwitch(
            scripted=config.scripted_operator, start_timeout=config.start_timeout
        )
        self._lane, self._report, self._clock = lane, report, clock
        self._tick_s = plant.tick_ns * 1e-9
        self._pace = Pace(self._tick_s)
        self._restart = False
        self._watch = CommandWatch(lane, report, config.start_timeout, self._tick_s)
        self._refused = False
        self._refusals, self._refusals_told = Refusals(), False
        self._announced = 0.0
        self._patience_due = 0.0
        self._end = round(config.duration * config.control_rate)
        self.timing = TickTiming(self._tick_s)
        self._turn = threading.Lock()
        self._ticks: Ticks = iter(())
        self._waits_until = 0.0
        lane.on_operator = self._on_operator

    def run(self) -> None:
        """Run until the duration is over or `stop`."""
        self.begin_episode(self.plant)
        lockstep = self.config.pacing == "lockstep"
        self._ticks = self._lockstep() if lockstep else self._realtime()
        with self._lane.served(self._go_on) if lockstep else contextlib.nullcontext():
            while self._resume():
                self._lane.wait(max(0.0, self._waits_until - self._clock()))

    def _resume(self) -> bool:
        """Go on after a wait; returns whether there is something to wait for."""
        with self._turn:
            self._lane.take()
            self._serve()
            due = next(self._ticks, None)
            self._waits_until = due or 0.0
        return due is not None

    def _go_on(self) -> bool:
        """Go on in the receiving thread if the awaited command has come, for `Lane.served`.

        Returns:
            Whether the thread that runs the loop may wait on.
        """
        if not self._turn.acquire(blocking=False):
            return False
        try:
            if self.requests.pending:
                return False
            self._lane.take()
            if not self._answers(self.plant.seq):
                return True
            due = next(self._ticks, None)
            return due is not None and due >= self._waits_until
        finally:
            self._turn.release()

    def stop(self) -> None:
        """Let `run` return; wake the lane after this call."""
        self.stopping = True

    def allow(self, ticks: int) -> None:
        """Let some ticks run although paused; `credit_spent` is set when they have run."""
        self.credit = ticks
        self.credit_spent.clear()

    def begin_episode(self, plant: Plant) -> None:
        """Start over with a plant that stands at tick 0 of a new episode; credit is lost."""
        now = self._clock()
        self.plant, self.credit = plant, 0
        self.switch.reset()
        if self.broken:
            self.broken = False
            self._report("lockstep", None)
        self._watch.restart()
        self.timing.restart()
        self._restart = True
        self._pace.start(now)
        self.factor.start(0.0, now)

    def _lockstep(self) -> Ticks:
        while not self._over:
            seq = self._announce()
            yield from self._hold(seq)
            if not self.broken and not self._interrupted:
                self.plant.power(self.switch.apply(seq))
                self.plant.run_ahead()
            answered = yield from self._await_answer(seq)
            if not self._interrupted:
                self._advance(self._lane.command if answered else None)
                yield from self._keep_pace()

    def _realtime(self) -> Ticks:
        while not self._over:
            seq = self._announce()
            yield from self._hold(seq)
            rate = min(self.config.max_rate, 1.0) or 1.0
            due = self._pace.next_due(self._clock(), rate, SHORTEST_TICK)
            while not self._interrupted and (yield from self._wait_until(due)):
                pass
            if not self._interrupted:
                command = self._watch.fresh(self.plant.episode, seq)
                self.timing.tick(self._clock() - due, answered=command is not None)
                self._advance(command)

    @property
    def _over(self) -> bool:
        return self.stopping or 0 < self._end <= self.plant.seq

    def _on_operator(self, command: OperatorCommand | None, writer: bytes, problem: str) -> None:
        """Take in a command of an operator, or the problem of one that cannot be read."""
        plant, switch, now = self.plant, self.switch, self._clock()
        if command is not None:
            switch.take(command, writer, plant.episode, plant.seq, now)
            problem = switch.refused
        if problem:
            self._refusals.refuse(problem, now)

    def _tell_refusals(self, now: float) -> None:
        """Report a problem with operators' commands once, and its end once."""
        if not (self._refusals.problem or self._refusals_told):
            return
        told, self._refusals_told = self._refusals_told, bool(self._refusals.look(now))
        if told != self._refusals_told:
            self._report("operator_command", self._refusals.problem or None)

    def _complete(self, sample: Sensors) -> None:
        """Fill in the fields of a sample that are not of the robot's sensors."""
        sample.operator_lease[...] = self.switch.operators.lease
        if self.config.pacing == "realtime":
            self.timing.write(sample)

    def _announce(self) -> int:
        self._restart = False  # an episode that a request started is announced now
        plant = self.plant
        seq = plant.seq
        sample = plant.sense()
        self._complete(sample)
        self._lane.announce(sample, plant)
        self._announced = self._clock()
        self.factor.update(seq * self._tick_s, self._announced)
        self._tell_refusals(self._announced)
        return seq

    def _serve(self) -> None:
        """Run other threads' requests, with the plant in the state at which it was sampled."""
        if self.requests.pending:
            self.plant.take_back()
            self.requests.run_pending()

    @property
    def _interrupted(self) -> bool:
        return self._restart or self.stopping

    def _wait(self, deadline: float) -> Ticks:
        """Wait for a message until `deadline`; an unanswered sample is sent again meanwhile."""
        now = self._clock()
        if now - self._announced >= REPEAT_PERIOD:
            self._lane.repeat()
            self._announced = now
        yield min(deadline, self._announced + REPEAT_PERIOD)

    def _hold(self, seq: int) -> Ticks:
        """Wait while paused, and for the scripted operator if this tick needs its answer."""
        in_step = not self.broken and self.config.pacing != "realtime"
        if not self.paused and not (in_step and self.switch.awaits(seq)):
            return
        started = self._clock()
        while not self._interrupted:
            now = self._clock()
            if self.paused and not self.credit:
                started = now  # after a pause the script's time-out begins anew
                self.switch.pause(now)
            elif not (in_step and self.switch.awaits(seq)):
                break
            elif now - started >= self.switch.timeout:
                self.switch.give_up()
                self._report(
                    "operator", "the scripted operator does not answer: power stays as it is"
                )
                break
            yield from self._wait(max(started + self.switch.timeout, now))
        self._pace.start(self._clock())

    def _await_answer(self, seq: int) -> Wait:
        """Whether the command for sample `seq` comes before time-out or interruption."""
        if self.broken or self._interrupted:
            return (yield from self._await_in_real_time(seq))
        started = self._clock()
        limit = self.config.command_timeout + self._watch.start_timeout
        while not self._answers(seq):
            yield from self._wait(started + limit)
            if self._interrupted:
                return False
            silence = self._clock() - started
            if silence >= REPEAT_PERIOD:
                self._watch.missed(seq, silence)
            if silence >= limit and not self._answers(seq):
                self._break_lockstep()
                return False
        self._watch.come()
        return True

    def _await_in_real_time(self, seq: int) -> Wait:
        now = self._clock()
        due = self._pace.next_due(now, 1.0)
        if now >= self._patience_due:
            self._patience_due = now + _BROKEN_PERIOD
            due = max(due, now + _BROKEN_TIMEOUT)
        while not self._interrupted:
            waited = yield from self._wait_until(due)
            if self._answers(seq):
                self.broken = False
                self._report("lockstep", None)
                self._watch.come()
                self._pace.start(self._clock())
                return True
            if not waited:
                break
        return False

    def _wait_until(self, due: float) -> Wait:
        """Wait for a message; False if `due` was over already before this call."""
        left = due - self._clock()
        yield due
        return left > 0.0

    def _answers(self, seq: int) -> bool:
        return self._lane.command_key == (self.plant.episode, seq)

    def _break_lockstep(self) -> None:
        self.broken = True
        self.times_broken += 1
        self._pace.start(self._clock())
        self._report("lockstep", "lockstep_broken: drives damp, robot time runs on with wall time")

    def _advance(self, command: MotorCommand | None) -> None:
        """Advance the plant by a step; without a command in broken lock-step the drives damp."""
        plant = self.plant
        plant.power(self.switch.apply(plant.seq))
        if command is None and self.broken:
            plant.drives.damp()
        try:
            plant.step(command)
        except ValueError as error:
            self._refused = True
            self._report("motor_command", str(error))
        else:
            if self._refused and command is not None:
                self._refused = False
                self._report("motor_command", None)
        if self.credit:
            self.credit -= 1
            if not self.credit:
                self.credit_spent.set()

    def _keep_pace(self) -> Ticks:
        """Wait until the next tick is due; in broken lock-step the wait for answers does that."""
        if self.broken:
            return
        due = self._pace.next_due(self._clock(), self.config.max_rate)
        while due > self._clock() and not self._interrupted:
            yield due
