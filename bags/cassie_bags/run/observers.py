"""Observers of a run in one process, besides its evaluation: into a bag, or to two observers."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from types import TracebackType

from cassie_bags.bag.recording import TYPES
from cassie_bags.bag.writer import QOS_LANE, BagWriter
from cassie_bags.run.provenance import metadata_of
from cassie_bags.run.simulate import Observer
from cassie_msgs.experiment.file import Experiment


class BagObserver:
    """Writes every message into a bag; the end of the `with` statement closes the bag.

    Args:
        path: The bag.
        experiment: Experiment that is run, drawn; it is written into the bag.
        topics: Topics that are written.

    Raises:
        BagError: if the bag cannot be written.
    """

    def __init__(
        self, path: Path, experiment: Experiment, topics: Collection[str] = TYPES.keys()
    ) -> None:
        self._bag = BagWriter(path)
        for name, content in metadata_of(experiment).items():
            self._bag.add_metadata(name, content)
        self._channels = {
            topic: self._bag.add_topic(topic, kind, QOS_LANE)
            for topic, kind in TYPES.items()
            if topic in topics
        }

    def __call__(self, topic: str, raw: bytes, stamp: int) -> None:
        if topic in self._channels:
            self._bag.write(self._channels[topic], raw, stamp, stamp)

    def __enter__(self) -> BagObserver:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bag.close()


def both(first: Observer, second: Observer) -> Observer:
    """An observer that passes each message on to two observers."""

    def observe(topic: str, raw: bytes, stamp: int) -> None:
        first(topic, raw, stamp)
        second(topic, raw, stamp)

    return observe
