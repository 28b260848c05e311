"""Robot time of a recording's messages: whose time is believed, and what the others get."""

from __future__ import annotations

import struct
from collections.abc import Iterable

import pytest
from synthetic import TICK_NS, glide_messages

from cassie_bags.bag.clock import CLOCK_TOPIC, RobotClock
from cassie_bags.bag.recording import GROUND_TRUTH_TOPIC
from cassie_msgs.layout import RobotState, Sensors

S = 1_000_000_000
MS = 1_000_000
ROBOT, STRANGER = b"robot", b"stranger"


def lane(stamp: int, episode: int = 7, kind: type[RobotState | Sensors] = RobotState) -> bytes:
    """A message of the control lane."""
    sample = kind()
    sample.episode[...], sample.stamp_ns = episode, stamp
    return sample.to_bytes()


def clock_message(stamp: int) -> bytes:
    """A message on /clock."""
    return struct.pack("<4xiI", *divmod(stamp, S))


class Listener:
    """Hears messages at wall times; a robot sends its own every 2 ms."""

    def __init__(self) -> None:
        self.clock = RobotClock()
        self.wall = 1_700_000_000 * S

    def robot(self, stamps: Iterable[int], episode: int = 7) -> list[int | None]:
        """Robot times of states with these stamps."""
        return [self.hear(lane(stamp, episode), ROBOT) for stamp in stamps]

    def hear(
        self, raw: bytes, writer: bytes, topic: str = RobotState.TOPIC, after: int = 2 * MS
    ) -> int | None:
        self.wall += after
        return self.clock.time_of(topic, raw, self.wall, writer)

    def clock_ticks(
        self, stamps: Iterable[int], writer: bytes = ROBOT, after: int = 10 * MS
    ) -> list[int | None]:
        """Robot times of messages on /clock."""
        return [self.hear(clock_message(stamp), writer, CLOCK_TOPIC, after) for stamp in stamps]

    @property
    def now(self) -> int:
        """Robot time of what comes now."""
        return self.clock.times_at([self.wall])[0]


@pytest.fixture
def heard() -> Listener:
    return Listener()


def every(period: int, begin: int, end: int) -> list[int]:
    return [*range(begin, end, period)]


def test_a_late_recording_begins_at_the_robots_time(heard: Listener):
    assert not heard.clock.known
    heard.robot(every(2 * MS, 30 * S, 30 * S + 6 * MS))
    assert heard.clock.known and heard.now == 30 * S + 4 * MS
    assert heard.robot([30 * S]) == [30 * S]  # one that waited for robot time


def test_the_last_message_of_an_episode_keeps_its_time_behind_the_first_of_the_next(
    heard: Listener,
):
    heard.robot([0, 0, 0])
    assert heard.robot([0, 2 * MS, 4 * MS]) == [0, 2 * MS, 4 * MS]
    assert heard.robot([0, 2 * MS], episode=8) == [4 * MS, 6 * MS]
    assert heard.robot([6 * MS]) == [6 * MS]
    assert heard.robot([9 * MS], episode=6) == [None]  # of an episode that was not heard of
    assert heard.robot([4 * MS], episode=8) == [8 * MS]


def test_a_topic_that_is_read_long_after_another_one_keeps_its_own_time():
    """A recorder was held up: 0.6 s of the ground truth got the time of the newest sample."""
    messages, clock = glide_messages(4.0), RobotClock()
    for raw in messages[RobotState.TOPIC][:3]:
        clock.time_of(RobotState.TOPIC, raw, 0)
    times = {
        topic: [clock.time_of(topic, raw, 0) for raw in messages[topic]]
        for topic in (RobotState.TOPIC, Sensors.TOPIC, GROUND_TRUTH_TOPIC)
    }
    assert times[GROUND_TRUTH_TOPIC] == times[Sensors.TOPIC]
    assert times[Sensors.TOPIC] == [tick * TICK_NS for tick in range(2000)]


def test_without_a_robot_time_runs_as_the_wall_clock_and_a_robot_makes_no_leap(heard: Listener):
    wall = heard.wall
    heard.clock.run_on_wall(wall)
    assert heard.clock.times_at([wall, wall + 2 * S]) == [0, 2 * S]
    heard.wall += 3 * S
    times = heard.robot(every(2 * MS, 30 * S, 30 * S + 10 * MS))
    assert times == [None, None, 3 * S + 6 * MS, 3 * S + 8 * MS, 3 * S + 10 * MS]
    assert heard.now == 3 * S + 10 * MS


@pytest.mark.parametrize(
    "raw",
    [
        lane(S, episode=2**31),
        lane(10**9 * S),
        lane(10**9 * S, episode=8),
        lane(0, episode=6),
        lane(10**9 * S, episode=6),
        lane(-(10**9) * S),
    ],
)
@pytest.mark.parametrize("times", [1, 20])
def test_a_stray_message_of_the_lane_moves_no_time(heard: Listener, raw: bytes, times: int):
    heard.robot([S] * 3)
    for stamp in every(2 * MS, S, 2 * S):
        assert heard.robot([stamp]) == [stamp]
        if stamp < S + times * 2 * MS:
            assert heard.hear(raw, STRANGER, after=0) is None
            assert heard.now == stamp


def test_a_stray_before_the_robot_does_not_become_its_time(heard: Listener):
    heard.hear(lane(10**9 * S, episode=2**31), STRANGER)
    assert not heard.clock.known
    assert heard.robot([0, 2 * MS, 4 * MS])[2] == 4 * MS


def test_a_robot_that_begins_beside_a_silent_stranger_is_followed(heard: Listener):
    for _ in range(3):  # as `ros2 topic pub` repeats it
        heard.hear(lane(10**9 * S, episode=2**31), STRANGER, after=S)
    assert heard.clock.known
    heard.wall += S
    times = heard.robot(every(2 * MS, 0, S))
    assert times[:2] == [None, None]
    later = [time for time in times if time is not None]
    assert later == every(2 * MS, 10**9 * S + 4 * MS, 10**9 * S + S)


def test_a_robot_that_takes_the_place_of_another_goes_on_where_it_ended(heard: Listener):
    heard.robot([S] * 3)
    heard.wall += S
    times = [heard.hear(lane(stamp, 9), b"next") for stamp in every(2 * MS, 0, 10 * MS)]
    assert times == [None, None, S + 4 * MS, S + 6 * MS, S + 8 * MS]


def test_a_stranger_that_goes_on_beside_a_robot_is_not_followed(heard: Listener):
    heard.robot([S] * 3)
    for stamp in every(2 * MS, S, 3 * S):
        assert heard.robot([stamp]) == [stamp]
        for part in range(4):
            raw = lane(10**6 * S + stamp + part, episode=2**31)
            assert heard.hear(raw, STRANGER, after=0) is None


@pytest.mark.parametrize("far", [10**9 * S, 10**6 * S])
def test_a_clock_that_jumps_once_is_no_clock(heard: Listener, far: int):
    times = heard.clock_ticks([*every(10 * MS, 0, S), far, *every(10 * MS, S, 2 * S)])
    assert [time for time in times if time is not None] == every(10 * MS, 20 * MS, 2 * S)


def test_a_clock_that_is_reset_goes_on_where_it_ended(heard: Listener):
    times = heard.clock_ticks([*every(10 * MS, 0, 2 * S), *every(10 * MS, 0, 2 * S)])
    believed = [time for time in times if time is not None]
    assert believed == sorted(believed) and len(believed) == len(times) - 4
    assert believed[-1] == pytest.approx(4 * S, abs=30 * MS)
    begin = heard.wall - 399 * 10 * MS
    assert heard.clock.times_at([begin, begin + 10 * MS]) == [0, 10 * MS]


def test_a_robots_own_clock_that_is_heard_before_its_lane_tells_the_same_time(heard: Listener):
    heard.robot([30 * S])
    heard.clock_ticks([30 * S] * 3)
    assert heard.clock.known
    assert heard.robot([30 * S, 30 * S, 30 * S + 2 * MS]) == [None, 30 * S, 30 * S + 2 * MS]


def test_another_robots_clock_beside_a_robot_moves_no_time(heard: Listener):
    """It runs twice as fast, and begins where this one is."""
    heard.robot([S] * 3)
    for stamp in every(2 * MS, S, 3 * S):
        assert heard.robot([stamp]) == [stamp]
        heard.clock_ticks([2 * stamp - S], STRANGER, after=0)
        assert heard.now == stamp


def test_messages_without_a_stamp_get_the_robots_time_at_their_receipt(heard: Listener):
    heard.robot(every(2 * MS, 0, 10 * MS))
    begin = heard.wall
    heard.robot(every(2 * MS, 10 * MS, 20 * MS))
    received = [begin + part for part in range(0, 10 * MS, MS // 2)]
    times = heard.clock.times_at(received)
    assert times == [8 * MS + part for part in range(0, 10 * MS, MS // 2)]
    assert heard.clock.times_at([heard.wall + S]) == [18 * MS]  # the robot is paused


def test_no_time_goes_back_where_a_sample_is_taken_after_others_that_came_later():
    clock, wall = RobotClock(), 10 * S

    def hear(kind: type[RobotState | Sensors], stamp: int) -> None:
        clock.time_of(kind.TOPIC, lane(stamp, kind=kind), wall + stamp, kind.TOPIC.encode())

    for kind, last in ((RobotState, 4), (Sensors, 2)):
        for tick in range(last + 1):
            hear(kind, tick * MS)
    (before,) = clock.times_at([wall + 5 * MS])
    hear(Sensors, 3 * MS)  # came before the last state
    assert min(clock.times_at([wall + 6 * MS, wall + 3 * MS + 1])) >= before
