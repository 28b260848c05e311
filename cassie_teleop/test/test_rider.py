"""The operator who sees the robot: what he sees, what he asks for, and what he refuses."""

from __future__ import annotations

import math
import struct
from collections import deque

import pytest

from cassie_msgs.experiment.file import Experiment
from cassie_msgs.experiment.script import Gates, RiderScript
from cassie_msgs.layout import RobotState
from cassie_msgs.structured import structure
from cassie_msgs.tunables import ParameterError
from cassie_teleop.rider import Rider, curvature, slope, way
from cassie_teleop.script import ScriptedOperator
from cassie_teleop.sight import Sight, SightError, see

QUIET = {"noise": 0.0}


def scripted(steps: list, rider: dict) -> ScriptedOperator:
    experiment = structure(Experiment, {"operator": steps, "rider": rider})
    return ScriptedOperator(experiment.operator, experiment.rider)


def odometry(stamp_ns: int, x: float, y: float, yaw: float, forward: float) -> bytes:
    """Serialized as ROS does it, with frames `odom` and `base_link`."""
    raw = bytearray(b"\x00\x01\x00\x00")
    raw += struct.pack("<iI", *divmod(stamp_ns, 10**9))
    for name in (b"odom\0", b"base_link\0"):
        raw += bytes(-(len(raw) - 4) % 4) + struct.pack("<I", len(name)) + name
    raw += bytes(-(len(raw) - 4) % 8)
    raw += struct.pack("<7d", x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    raw += bytes(36 * 8) + struct.pack("<6d", forward, 0.0, 0.0, 0.0, 0.0, 0.0) + bytes(36 * 8)
    return bytes(raw)


def rides(rider: dict, speed: float, heading: float = 0.0, until: float = 3.0) -> list:
    """Leans over time of an operator who sees always the same."""
    operator = scripted([{"t": 0.0, "mode": "segway"}], rider)
    state, leans = RobotState(), []
    for tick in range(0, round(until * 500)):
        stamp = tick * 2_000_000
        operator.watch(stamp, odometry(stamp, 0.0, 0.0, heading, speed))
        if tick % 10 == 0:
            state.stamp_ns = stamp
            assert not operator.awaits(stamp)
            command = operator.answer(state)
            leans.append((float(command.com_x), float(command.com_y), float(command.vx)))
    return leans


def test_what_he_sees_is_what_the_odometry_says():
    seen = see(odometry(1_500_000_000, 1.0, -2.0, 0.7, 3.0))
    assert seen.stamp_ns == 1_500_000_000
    assert (seen.x, seen.y) == (1.0, -2.0)
    assert seen.heading == pytest.approx(0.7)
    assert seen.speed == pytest.approx(3.0)
    with pytest.raises(SightError, match="are no nav_msgs/msg/Odometry"):
        see(b"short")


def test_he_leans_forward_when_it_is_too_slow_and_back_when_too_fast():
    target = {"targets": [{"t": 0.0, "speed": 1.0}], **QUIET}
    assert rides(target, 0.0)[-1][0] > 0.0 > rides(target, 2.0)[-1][0]
    assert rides(target, 0.0)[-1][2] == 1.0


def test_he_leans_to_the_side_of_his_heading():
    target = {"targets": [{"t": 0.0, "speed": 0.0, "heading": 0.0}], **QUIET}
    assert rides(target, 0.0, heading=-0.3)[-1][1] > 0.0 > rides(target, 0.0, heading=0.3)[-1][1]


def test_before_his_first_target_he_keeps_his_hands_off():
    leans = rides({"targets": [{"t": 2.0, "speed": 1.0}], **QUIET}, 0.0, until=2.0)
    assert all(lean == (0.0, 0.0, 0.0) for lean in leans)


def test_the_same_seed_errs_in_the_same_way():
    def noisy(seed: int) -> list:
        return rides({"targets": [{"t": 0.0, "speed": 1.0}], "seed": seed}, 1.0)

    assert noisy(1) == noisy(1) != noisy(2)


def test_what_he_sees_is_late():
    rider = Rider(structure(RiderScript, {"targets": [{"t": 0.0, "speed": 1.0}], "delay": 0.2}))
    assert rider.needs(1_000_000_000) == 800_000_000
    rider.decide(1_000_000_000, Sight(800_000_000, 0.0, 0.0, 0.0, 0.0))
    assert rider.needs(1_090_000_000) is None
    assert rider.needs(1_100_000_000) == 900_000_000


def test_an_answer_waits_for_what_he_must_have_seen():
    operator = scripted([], {"targets": [{"t": 0.0, "speed": 1.0}]})
    operator.watch(0, odometry(0, 0.0, 0.0, 0.0, 0.0))
    assert not operator.awaits(200_000_000)
    assert operator.awaits(300_000_000)


def test_the_way_leads_through_the_gates():
    gates = Gates(first=9.0, spacing=3.0, offset=0.2, count=4)
    middles = [way(gates, 9.0 + 3.0 * index) for index in range(4)]
    assert middles == pytest.approx([0.2, -0.2, 0.2, -0.2])
    assert way(gates, 0.0) == 0.0 == way(gates, 30.0)
    assert slope(gates, 10.5) < 0.0 < curvature(gates, 12.0)


def slalom(lag: float = 1.0, answer: float = 10.5, biased: float = 0.02) -> list[float]:
    """By how much a rider misses ten gates at 2 m/s, on what turns by his lean as a Segway does.

    The turn rate is `answer` rad/s by m of CoM y, 0.22 s late, through (1 + 0.2 s) / (1 + lag s):
    the measured response of robot and Segway at that speed.
    """
    targets = [{"t": 1.0, "speed": 2.0, "heading": 0.0}, {"t": 8.0, "gates": {"count": 10}}]
    rider = Rider(structure(RiderScript, {"seed": 1, "targets": targets}))
    period, v, x, y, heading, slow, lean = 0.01, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0
    late, sights, places = deque([0.0] * 22), [], []
    for tick in range(2700):
        stamp = tick * 10_000_000
        sights.append(Sight(stamp, x, y, heading, v))
        if (seen := rider.needs(stamp)) is not None:
            rider.decide(stamp, sights[seen // 10_000_000])
        wanted = max(-0.1, min(0.1, rider.lean[1]))
        lean += max(-0.003, min(0.003, wanted - lean))
        late.append(lean)
        driven = answer * (late.popleft() - biased)
        slow += period * (driven - slow) / lag
        heading += period * (0.2 / lag * driven + (1.0 - 0.2 / lag) * slow)
        x, y = x + period * v * math.cos(heading), y + period * v * math.sin(heading)
        places.append((x, y))
    start = sights[780]
    cos, sin = math.cos(start.heading), math.sin(start.heading)
    along = [cos * (x - start.x) + sin * (y - start.y) for x, y in places]
    left = [cos * (y - start.y) - sin * (x - start.x) for x, y in places]
    gates = [next(i for i, a in enumerate(along) if a > 9.0 + 3.0 * n) for n in range(10)]
    return [left[i] - (-0.2 if n % 2 else 0.2) for n, i in enumerate(gates)]


@pytest.mark.parametrize(
    "segway",
    [{}, {"answer": 12.5}, {"answer": 8.5}, {"lag": 1.3}, {"lag": 0.75}, {"biased": -0.02}],
)
def test_he_goes_through_a_slalom_whatever_the_segway_is_like(segway):
    assert max(map(abs, slalom(**segway))) < 0.1


@pytest.mark.parametrize(
    ("rider", "message"),
    [
        ({}, "rider: targets must be given"),
        ({"targets": [{"t": 0}], "dealy": 1}, "rider: unknown key dealy: did you mean delay?"),
        ({"targets": [{"t": 0, "sped": 1}]}, "targets.0: unknown key sped: did you mean speed"),
        ({"targets": [{"t": 0, "speed": 9}]}, "targets.0.speed = 9 m/s is outside -1 .. 4.5 m/s"),
        ({"targets": [{"speed": 1}]}, "rider.targets.0.t must be given"),
        ({"targets": [{"t": 2}, {"t": 1}]}, "targets.1.t = 1 s is before targets.0.t = 2 s"),
        (
            {"targets": [{"t": 0, "turn": 1, "heading": 0}]},
            "targets.0: only one of heading",
        ),
        (
            {"targets": [{"t": 0, "gates": {"spacng": 3}}]},
            "gates: unknown key spacng: did you",
        ),
        ({"targets": [{"t": 0, "gates": 3}]}, "rider.targets.0.gates = 3 is not a mapping"),
    ],
)
def test_what_he_cannot_mean_is_refused(rider, message):
    with pytest.raises(ParameterError, match=message.replace(".", r"\.")):
        scripted([], rider)
