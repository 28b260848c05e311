"""Messages of strangers in a bag: what the run was is told as if they were not there."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from synthetic import TICK_NS, glide_messages

from cassie_bags.bag.continuity import episodes, gaps, only_episode
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import (
    GROUND_TRUTH_TOPIC,
    TYPES,
    Recording,
    from_messages,
    read_recording,
)
from cassie_bags.bag.rosbag2 import QOS_LANE
from cassie_bags.bag.summary import summarize
from cassie_bags.bag.writer import BagWriter
from cassie_bags.report.summary import summary_text
from cassie_bags.report.view import view_of_bag
from cassie_bags.run.verify import verify
from cassie_bags.signals.falls import falls
from cassie_msgs.layout import (
    SAMPLE_TYPES,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotState,
    Sample,
    Sensors,
)

Messages = dict[str, list[bytes]]

LANE = {kind.TOPIC for kind in SAMPLE_TYPES}
WALK = Path(__file__).parents[1] / "recordings" / "walk.mcap"


def two_episodes(first: float, second: float) -> Messages:
    """A walk, a reset, and a walk at another speed; for so long each (s)."""
    found: Messages = {}
    for part in (glide_messages(first, 0.3, episode=7), glide_messages(second, 0.6, episode=8)):
        for topic, list_ in part.items():
            found.setdefault(topic, []).extend(list_)
    return found


def sample(kind: type[Sample], **values: float) -> bytes:
    """A message of the lane with these fields and zeros."""
    message = kind()
    for name, value in values.items():
        getattr(message, name)[...] = value
    return message.to_bytes()


def empty_odometry(messages: Messages) -> bytes:
    """A pose with the stamp 0, as `ros2 topic pub` sends without values."""
    like = messages[GROUND_TRUTH_TOPIC][0]
    empty = bytearray(like)
    empty[4:12] = bytes(8)
    return bytes(empty)


@dataclass
class Case:
    """A message that nobody should send.

    Attributes:
        topic: Where.
        message: What, of the messages that are there.
    """

    topic: str
    message: Callable[[Messages], bytes]


FAR = 2**40

CASES = {
    "sensors of an episode to come": Case(
        Sensors.TOPIC, lambda _: sample(Sensors, episode=2**31, seq=5)
    ),
    "sensors of an episode long ago": Case(
        Sensors.TOPIC, lambda _: sample(Sensors, episode=3, seq=5)
    ),
    "sensors of a tick to come": Case(Sensors.TOPIC, lambda _: sample(Sensors, episode=8, seq=FAR)),
    "sensors of a tick beyond int64": Case(
        Sensors.TOPIC, lambda _: sample(Sensors, episode=8, seq=2**64 - 1)
    ),
    "a state of an episode to come": Case(
        RobotState.TOPIC, lambda _: sample(RobotState, episode=9, seq=1)
    ),
    "a state of a tick to come": Case(
        RobotState.TOPIC, lambda _: sample(RobotState, episode=8, seq=FAR)
    ),
    "a mode of no episode": Case(Mode.TOPIC, lambda _: sample(Mode, mode=2)),
    "a mode of a tick to come": Case(
        Mode.TOPIC, lambda _: sample(Mode, episode=8, seq=FAR, effective_seq=FAR)
    ),
    "a command of a tick to come": Case(
        MotorCommand.TOPIC, lambda _: sample(MotorCommand, episode=8, seq=FAR)
    ),
    "a script of another episode": Case(
        OperatorCommand.TOPIC, lambda _: sample(OperatorCommand, episode=12345, scripted=1, vx=9.0)
    ),
    "a pose at time 0": Case(GROUND_TRUTH_TOPIC, empty_odometry),
}


@pytest.fixture(scope="module")
def clean() -> Messages:
    return two_episodes(1.0, 1.6)


def strewn(messages: Messages, case: Case, times: int, seed: int = 1) -> Messages:
    """The same with a case's message put in at random places."""
    found = {topic: list(list_) for topic, list_ in messages.items()}
    places = random.Random(seed).sample(range(1, len(found[case.topic]) - 1), times)
    for place in sorted(places, reverse=True):
        found[case.topic].insert(place, case.message(messages))
    return found


def write(
    path: Path, messages: Messages, metadata: Mapping[str, Mapping[str, str]] = MappingProxyType({})
) -> None:
    """A bag with each topic's messages spread evenly over the run."""
    ticks = len(messages[RobotState.TOPIC])
    placed = [
        (index * ticks // len(list_) * TICK_NS, topic, raw)
        for topic, list_ in messages.items()
        for index, raw in enumerate(list_)
    ]
    with BagWriter(path) as bag:
        for name, content in metadata.items():
            bag.add_metadata(name, content)
        channels = {topic: bag.add_topic(topic, TYPES[topic], QOS_LANE) for topic in messages}
        for time, topic, raw in sorted(placed, key=itemgetter(0)):
            bag.write(channels[topic], raw, time, time)


def read(path: Path, messages: Messages) -> Recording:
    write(path, messages)
    return read_recording(path)


@pytest.mark.parametrize("times", [1, 20])
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_strangers_message_changes_nothing(
    tmp_path: Path, clean: Messages, case: Case, times: int
):
    recording = read(tmp_path / "clean.mcap", clean)
    assert recording.strays == {} and gaps(recording) == []
    path = tmp_path / "strewn.mcap"
    with_strays = read(path, strewn(clean, case, times))
    assert with_strays.strays == {case.topic: times}
    for topic, rows in {**recording.lane, **recording.stamped}.items():
        found = {**with_strays.lane, **with_strays.stamped}[topic]
        assert len(found) == len(rows) and (found == rows).all(), topic
    assert episodes(with_strays) == [7, 8]
    assert gaps(with_strays) == []
    assert falls(with_strays) == {}
    summary = summarize(path)
    assert [episode.name for episode in summary.episodes] == ["7", "8"]
    assert summary.strays == [f"{case.topic}: {times} messages"]
    assert f"{case.topic}: {times} messages of no node of this run" in summary_text(summary, {})
    shown = view_of_bag(path, "strewn")
    assert shown.track.time[-1] == pytest.approx(1.598)
    assert "Episode 8 is shown, number 2 of 2." in shown.notes
    np.testing.assert_allclose(shown.track.commanded["vx"], 0.6)


def test_each_episode_has_its_own_poses(clean: Messages):
    recording = from_messages(clean, 1.0)
    first, second = (only_episode(recording, number) for number in (7, 8))
    assert len(first.truth) == 500 and len(second.truth) == 800
    assert first.truth["position"][-1, 0] == pytest.approx(0.3 * 0.998, abs=1e-3)
    assert second.truth["position"][-1, 0] == pytest.approx(0.6 * 1.598, abs=1e-3)


def test_a_reset_soon_after_the_start_is_an_episode_of_its_own():
    """Its few stamps come again in the next: the order tells whose they are."""
    recording = from_messages(two_episodes(0.02, 1.0), 1.0).without_strays()
    assert recording.strays == {}
    assert len(only_episode(recording, 7).truth) == 10
    assert len(only_episode(recording, 8).truth) == 500


def test_a_sample_of_the_future_at_the_very_end_is_no_run(tmp_path: Path, clean: Messages):
    messages = {topic: list(list_) for topic, list_ in clean.items()}
    messages[Sensors.TOPIC].append(sample(Sensors, episode=2**31, seq=0))
    path = tmp_path / "bag.mcap"
    write(path, messages)
    assert view_of_bag(path, "bag").track.time[-1] == pytest.approx(1.598)


def test_what_came_before_the_first_sample_is_kept(clean: Messages):
    """A recorder finds the topics one after another."""
    messages = {topic: list(list_) for topic, list_ in clean.items()}
    del messages[Sensors.TOPIC][:30]
    assert from_messages(messages, 1.0).without_strays().strays == {}


def test_without_samples_nothing_is_a_strangers(clean: Messages):
    messages = {topic: list_ for topic, list_ in clean.items() if topic != Sensors.TOPIC}
    assert from_messages(messages, 1.0).without_strays().strays == {}


def test_a_bag_with_a_strangers_messages_verifies(tmp_path: Path):
    """The nodes ignored them when they ran, and so does what runs them again."""
    index = BagIndex()
    messages: Messages = {}
    for topic, *_, raw in read_messages(WALK, None, index):
        messages.setdefault(topic, []).append(raw)
    for seed, case in enumerate(CASES.values()):
        if case.topic in LANE:
            messages = strewn(messages, case, 5, seed)
    path = tmp_path / "strewn.mcap"
    write(path, messages, index.metadata)
    verification = verify(path)
    assert not verification.gaps
    assert all(len(each.recorded) for each in verification.replayed.values())
    for topic, each in verification.replayed.items():
        assert each.first_difference(topic) is None
