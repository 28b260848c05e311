"""The simulator's services: reset, pause, step, push, gantry, and the bar of a Segway."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any, TypeVar

from rclpy.node import Node
from std_srvs.srv import SetBool

from cassie_msgs.experiment.scenario import STARTS, Draw
from cassie_msgs.srv import Gantry, Push, Reset, Step
from cassie_sim import orders
from cassie_sim.errors import SimulationError
from cassie_sim.loop import SimulationLoop
from cassie_sim.plant import Plant

T = TypeVar("T")
_TIMEOUT = 10.0  # s; the loop runs requests between ticks and while it waits


class Services:
    """Passes each call to the loop, and answers when the loop has run it."""

    def __init__(
        self, node: Node, loop: SimulationLoop, make_plant: Callable[[Any], Plant]
    ) -> None:
        """Create the services; `make_plant` builds a plant for a changed scenario."""
        self._loop = loop
        self._make_plant = make_plant
        self._logger = node.get_logger()
        node.create_service(Reset, "/cassie/reset", self._on_reset)
        node.create_service(SetBool, "/cassie/pause", self._on_pause)
        node.create_service(Step, "/cassie/step", self._on_step)
        node.create_service(Push, "/cassie/push", self._on_push)
        node.create_service(Gantry, "/cassie/gantry", self._on_gantry)
        if loop.plant.vehicle is not None:
            node.create_service(SetBool, "/cassie/hold_bar", self._on_bar)

    def _on_reset(self, request: Any, response: Any) -> Any:
        def reset() -> str:
            response.episode = self._reset(request.start, int(request.seed))
            return f"episode {response.episode} begins"

        return self._answer(response, reset)

    def _on_pause(self, request: Any, response: Any) -> Any:
        def pause() -> str:
            self._loop.paused, self._loop.credit = bool(request.data), 0
            state = "paused" if request.data else "running"
            return f"{state} at tick {self._loop.plant.seq}"

        return self._answer(response, pause)

    def _on_step(self, request: Any, response: Any) -> Any:
        loop = self._loop

        def allow() -> str:
            if not loop.paused:
                raise SimulationError("step: the simulator is not paused")
            if not 1 <= request.ticks <= loop.MAX_CREDIT:
                raise SimulationError(f"ticks = {request.ticks} is outside 1 .. {loop.MAX_CREDIT}")
            loop.allow(int(request.ticks))
            return f"{request.ticks} ticks done"

        response = self._answer(response, allow)
        if response.success and not loop.credit_spent.wait(_TIMEOUT):
            response.success = False
            response.message = f"after {_TIMEOUT:g} s {loop.credit} ticks are still to run"
        response.seq = loop.plant.seq
        return response

    def _on_push(self, request: Any, response: Any) -> Any:
        return self._answer(
            response,
            lambda: orders.push(
                self._loop.plant, request.body, request.force.tolist(), request.duration
            ),
        )

    def _on_gantry(self, request: Any, response: Any) -> Any:
        return self._answer(
            response,
            lambda: orders.move_gantry(
                self._loop.plant, request.action, request.height, request.speed
            ),
        )

    def _on_bar(self, request: Any, response: Any) -> Any:
        return self._answer(response, lambda: orders.hold_bar(self._loop.plant, bool(request.data)))

    def _answer(self, response: Any, action: Callable[[], str]) -> Any:
        """The response, with the result or the error of `action`, which the loop runs."""
        try:
            response.message = self._loop.requests.call(action).result(timeout=_TIMEOUT)
            response.success = True
            self._logger.info(response.message)
        except (ValueError, FutureTimeout) as error:
            response.success = False
            response.message = str(error) or f"the loop did not answer within {_TIMEOUT:g} s"
            self._logger.warning(f"request refused: {response.message}")
        return response

    def _reset(self, start: str, seed: int) -> int:
        """Begin a new episode; an empty start and seed 0 keep the present values."""
        loop = self._loop
        plant, scenario = loop.plant, loop.plant.scenario
        if start and start not in STARTS:
            raise SimulationError(f"start = {start!r} is not one of {', '.join(STARTS)}")
        changed = dataclasses.replace(
            scenario,
            start=start or scenario.start,
            draw=Draw.from_seed(seed) if seed else scenario.draw,
        )
        if changed == scenario:
            plant.reset()
        else:
            episode, plant = plant.episode, self._make_plant(changed)
            plant.episode = episode
        plant.episode += 1
        loop.begin_episode(plant)
        return plant.episode
