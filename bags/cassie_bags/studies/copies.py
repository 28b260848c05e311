"""Runs that continue from a common beginning: each in a process that is a copy of this one."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import connection, get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar, cast

from cassie_bags.errors import RunError
from cassie_bags.studies.workers import children_without_ctrl_c
from cassie_gaits.processes import DIED, end_with_starter

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_copies(
    function: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[Result]:
    """Apply a function to items, each in a copy of this process, made when the item's turn comes.

    Args:
        function: Function that each copy applies; its exceptions are raised here.
        items: Items, one for each copy.
        jobs: Number of copies at a time.

    Yields:
        Results in the order of the items.

    Raises:
        RunError: if a copy died, as for lack of memory.
    """
    waiting = deque(enumerate(items))
    running: dict[Connection, tuple[int, BaseProcess]] = {}
    results: dict[int, Result] = {}
    try:
        for due in range(len(items)):
            while due not in results:
                while waiting and len(running) < jobs:
                    index, item = waiting.popleft()
                    receiver, process = _begin(function, item)
                    running[receiver] = (index, process)
                for ready in connection.wait(list(running)):
                    receiver = cast(Connection, ready)
                    results[running[receiver][0]] = _received(receiver)
                    _, process = running.pop(receiver)
                    process.join()
                    receiver.close()
            yield results.pop(due)
    finally:
        for _, process in running.values():
            process.kill()
            process.join()


def _begin(function: Callable[[Item], Result], item: Item) -> tuple[Connection, BaseProcess]:
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(sender, function, item), daemon=True)
    with children_without_ctrl_c():
        process.start()
    sender.close()  # so that receiving ends when the copy ends
    return receiver, process


def _received(receiver: Connection) -> Any:
    try:
        result, error = receiver.recv()
    except EOFError:
        raise RunError(DIED) from None
    if error is not None:
        raise error
    return result


def _answer(sender: Connection, function: Callable[[Item], Result], item: Item) -> None:
    end_with_starter()
    try:
        answer: tuple[Result | None, Exception | None] = (function(item), None)
    except Exception as error:
        answer = (None, error)
    sender.send(answer)
