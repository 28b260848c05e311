"""The loop's rules about who waits for whom, on a fake plant, lane and clock."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import pytest
from fake_world import FakePlant, FakeWorld, ReceivingWorld

from cassie_msgs.layout import OperatorCommand, RobotMode
from cassie_sim.loop import SimulationLoop
from cassie_sim.simulator_config import SimulatorConfig

TICK = 0.002


def make(
    world: FakeWorld | None = None, ticks: int = 20, **config: Any
) -> tuple[SimulationLoop, FakePlant, FakeWorld]:
    """A loop that ends by itself after some ticks."""
    world = world or FakeWorld()
    plant = FakePlant()
    settings = replace(SimulatorConfig(), duration=ticks * TICK, max_rate=0.0, **config)
    loop = SimulationLoop(
        plant,  # type: ignore[arg-type]
        world,
        settings,
        world.report,
        clock=lambda: world.now,
    )
    return loop, plant, world


def operator(seq: int, power: bool, *, scripted: bool = True, episode: int = 7) -> OperatorCommand:
    command = OperatorCommand()
    command.episode[...] = episode
    command.seq[...] = seq
    command.effective_seq[...] = seq + 10
    command.power[...] = power
    command.scripted[...] = scripted
    return command


def test_lockstep_applies_command_k_to_tick_k() -> None:
    loop, plant, world = make()
    loop.run()
    assert plant.applied == list(range(20))
    assert world.announced == list(range(20))
    assert not world.repeats


def test_lockstep_runs_ahead_while_it_waits() -> None:
    loop, plant, _ = make()
    loop.run()
    assert all(plant.started_ahead)


def test_a_request_finds_the_plant_as_it_was_at_the_sample() -> None:
    loop, plant, world = make()
    seen: list[int] = []

    def ask() -> None:
        if plant.seq == 5:
            loop.requests.call(lambda: seen.append(plant.ahead))

    world.on_wait = ask
    loop.run()
    assert seen[0] == -1
    assert [tick for tick, ahead in enumerate(plant.started_ahead) if not ahead] == [5]


def test_the_receiving_thread_goes_on_without_waking_the_loops() -> None:
    loop, plant, world = make(ReceivingWorld(), ticks=200)
    loop.run()
    assert plant.applied == world.announced == list(range(200))
    assert all(plant.started_ahead)
    assert world.waits == 1


def test_the_receiving_thread_leaves_requests_to_the_loops() -> None:
    loop, plant, world = make(ReceivingWorld(), ticks=200)
    threads: list[int] = []

    def ask() -> None:
        if plant.seq == 50:
            loop.requests.call(lambda: threads.append(threading.get_ident()))

    world.on_receive = ask  # type: ignore[attr-defined]
    loop.run()
    assert threads == [threading.get_ident()]
    assert plant.applied == list(range(200))
    assert world.waits == 2  # type: ignore[attr-defined]


def test_the_receiving_thread_leaves_pacing_pauses_and_scripts_to_the_loops() -> None:
    world = ReceivingWorld()
    loop, plant, _ = make(world, ticks=100, scripted_operator=True)
    loop.config = replace(loop.config, max_rate=1.0)

    def script() -> None:
        world.on_operator(operator(plant.seq // 10 * 10, True), b"script", "")
        if plant.seq == 30 and world.now < 105.0:
            loop.paused = True
        elif world.now >= 105.0:
            loop.paused = False

    world.on_wait = script
    loop.run()
    assert plant.applied == list(range(100))
    assert plant.powered == [False] * 10 + [True] * 90
    assert world.times[31] - world.times[30] > 4.0
    assert world.now - world.times[31] == pytest.approx(69 * TICK, abs=1e-3)


def test_what_fails_in_the_receiving_thread_is_not_lost() -> None:
    world = ReceivingWorld()
    loop, plant, _ = make(world)

    def fail() -> None:
        if plant.seq == 5:
            plant.step = None  # type: ignore[assignment, method-assign]

    world.on_receive = fail
    with pytest.raises(TypeError):
        loop.run()


def test_realtime_keeps_wall_time_and_takes_the_newest_command() -> None:
    loop, plant, world = make(pacing="realtime")
    world.delay = 0.0031  # answers take longer than a tick
    loop.run()
    assert plant.applied == [None, None, *range(1, 19)] or plant.applied == [None, *range(19)]
    assert world.now - world.times[0] == pytest.approx(20 * TICK, abs=1e-6)


def test_a_simulator_woken_late_catches_up_and_misses_no_command() -> None:
    loop, plant, world = make(ticks=100, pacing="realtime")
    world.delay = 0.0008
    slept: list[int] = []

    def oversleep() -> None:
        if plant.seq == 20 and not slept:
            slept.append(plant.seq)
            world.now += 5.5 * TICK

    world.on_wait = oversleep
    loop.run()
    assert slept == [20]
    assert loop.timing.missed == 0
    assert plant.applied[25:] == list(range(25, 100))
    assert world.now - world.times[0] == pytest.approx(100 * TICK, abs=1e-6)


def test_realtime_runs_on_without_commands_and_reports_it_once() -> None:
    loop, plant, world = make(
        FakeWorld(lambda episode, seq: seq < 10), ticks=100, pacing="realtime"
    )
    loop.run()
    assert plant.applied[:10] == list(range(10))
    assert plant.applied[10:] == [None] * 90
    assert len([1 for name, problem in world.reports if name == "command" and problem]) == 1


def test_pace_is_the_wall_clocks_at_rate_one() -> None:
    loop, _, world = make()
    loop.config = replace(loop.config, max_rate=1.0)
    loop.run()
    assert world.now - world.times[0] == pytest.approx(20 * TICK, abs=1e-6)


def test_an_unanswered_sample_is_sent_again_every_half_second() -> None:
    asked: list[int] = []

    def third_time(episode: int, seq: int) -> bool:
        asked.append(seq)
        return seq != 5 or asked.count(5) == 3

    loop, plant, world = make(FakeWorld(third_time))
    loop.run()
    assert plant.applied == list(range(20))
    assert [t - world.times[5] for t in world.repeats] == pytest.approx([0.5, 1.0])
    assert not loop.times_broken


def test_broken_lockstep_damps_in_real_time_and_resumes_with_the_newest_seq() -> None:
    loop, plant, world = make(
        FakeWorld(lambda episode, seq: seq < 10 or seq >= 60), ticks=100, command_timeout=5.0
    )
    loop.run()
    assert plant.applied == [*range(10), *[None] * 50, *range(60, 100)]
    assert plant.damped == list(range(10, 60))
    assert world.times[11] - world.times[10] == pytest.approx(5.0)
    # Real time but for one longer wait in each 0.1 s.
    assert world.times[60] - world.times[11] == pytest.approx(49 * TICK, abs=0.05)
    assert loop.times_broken == 1
    states = [problem for name, problem in world.reports if name == "lockstep"]
    assert "lockstep_broken" in states[0]
    assert states[1:] == [None]


def test_an_answer_to_an_older_sample_does_not_mend_lockstep() -> None:
    world = FakeWorld(lambda episode, seq: seq < 5)
    loop, plant, _ = make(world, ticks=30, command_timeout=1.0)
    world.on_wait = lambda: setattr(world, "command_key", (7, 5)) if plant.seq > 6 else None
    loop.run()
    assert plant.applied == [*range(5), *[None] * 25]


def test_first_answer_has_the_start_timeout_besides() -> None:
    loop, _, world = make(FakeWorld(lambda episode, seq: False), ticks=2, start_timeout=3.0)
    loop.run()
    assert world.times[1] - world.times[0] == pytest.approx(3.0 + 5.0)


def test_a_pause_holds_the_tick_repeats_it_and_is_no_silence() -> None:
    loop, plant, world = make(paused=True)

    def resume_later() -> None:
        if world.now > 100.0 + 20.0:
            loop.paused = False

    world.on_wait = resume_later
    loop.run()
    assert len(world.repeats) == pytest.approx(40, abs=2)
    assert plant.applied == list(range(20))
    assert not loop.times_broken


def test_step_credit_runs_that_many_ticks_of_a_pause() -> None:
    loop, plant, world = make(paused=True)
    seen: list[int] = []

    def watch() -> None:
        if world.now > 101.0 and not seen:
            loop.allow(3)
            seen.append(plant.seq)
        if world.now > 110.0:
            seen.append(plant.seq)
            loop.stop()

    world.on_wait = watch
    loop.run()
    assert seen == [0, 3]
    assert loop.credit_spent.is_set()


def test_scripted_power_holds_from_its_effective_tick() -> None:
    loop, plant, world = make(ticks=40, scripted_operator=True)
    world.on_wait = lambda: world.on_operator(
        operator(plant.seq // 10 * 10, plant.seq >= 10), b"script", ""
    )
    loop.run()
    assert plant.powered == [False] * 20 + [True] * 20


def test_a_silent_script_is_waited_for_then_given_up_once() -> None:
    loop, plant, world = make(ticks=60, scripted_operator=True)
    world.on_wait = lambda: (
        world.on_operator(operator(plant.seq // 10 * 10, True), b"script", "")
        if plant.seq < 15
        else None
    )
    loop.run()
    assert plant.powered == [False] * 10 + [True] * 50
    assert [name for name, problem in world.reports if problem] == ["operator"]
    waits = [b - a for a, b in zip(world.times, world.times[1:], strict=False)]
    assert max(waits) == pytest.approx(0.3, abs=0.01)


def test_a_persons_power_switch_acts_at_the_next_tick_whatever_the_nodes_do() -> None:
    loop, plant, world = make(FakeWorld(lambda episode, seq: seq < 5), ticks=30)

    def press() -> None:
        command = operator(0, plant.seq < 8, scripted=False, episode=0)
        command.mode[...] = RobotMode.STAND
        world.on_operator(command, b"person", "")

    world.on_wait = press
    loop.run()
    assert plant.powered[1:8] == [True] * 7
    assert not any(plant.powered[9:])


def test_reset_begins_an_episode_and_old_answers_do_not_count() -> None:
    world = FakeWorld(lambda episode, seq: seq < 5 or episode == 8)
    loop, old, _ = make(world, ticks=10)
    fresh = FakePlant(episode=8)

    def reset() -> None:
        if world.now > 101.0 and loop.plant is old:  # type: ignore[comparison-overlap]
            loop.requests.call(lambda: loop.begin_episode(fresh))  # type: ignore[arg-type]

    world.on_wait = reset
    loop.run()
    assert old.applied == list(range(5))
    assert fresh.applied == list(range(10))
    assert world.announced == [*range(6), *range(10)]


def test_a_reset_in_a_pause_takes_back_the_ticks_that_were_still_to_run() -> None:
    loop, old, world = make(FakeWorld(lambda episode, seq: seq < 2 or episode == 8), paused=True)
    fresh = FakePlant(episode=8)

    def act() -> None:
        if world.now > 101.0 and loop.plant is old and not loop.credit:  # type: ignore[comparison-overlap]
            loop.allow(5)
        if world.now > 104.0 and loop.plant is old:  # type: ignore[comparison-overlap]
            loop.requests.call(lambda: loop.begin_episode(fresh))  # type: ignore[arg-type]
        if world.now > 110.0:
            loop.stop()

    world.on_wait = act
    loop.run()
    assert old.applied == [0, 1]
    assert fresh.applied == []


def test_refused_commands_are_reported_once_and_the_end_of_it_too() -> None:
    loop, plant, world = make()
    plant.refuse = True
    world.on_wait = lambda: setattr(plant, "refuse", plant.seq < 10)
    loop.run()
    reports = [problem for name, problem in world.reports if name == "motor_command"]
    assert [bool(problem) for problem in dict.fromkeys(reports)] == [True, False]


def test_a_request_that_fails_fails_for_its_caller_only() -> None:
    loop, plant, _ = make()

    def fail() -> None:
        raise ValueError("no such body")

    future = loop.requests.call(fail)
    loop.run()
    assert len(plant.applied) == 20
    with pytest.raises(ValueError, match="no such body"):
        future.result(timeout=0)
