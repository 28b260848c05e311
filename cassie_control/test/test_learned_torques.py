"""Learned torques: their file, how they are added, and what teaches them."""

from __future__ import annotations

import json
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from cassie_control.config import ControllerConfig
from cassie_control.control.robot import Robot
from cassie_control.learning.torque_learning import TorqueLearning
from cassie_control.learning.torque_table import (
    JOINTS,
    LearnedTorques,
    LearnedTorquesError,
    load_for_library,
    load_torques,
    path_for_library,
    save_torques,
    zero_torques,
)
from cassie_control.planner.timing import LEFT, RIGHT
from cassie_gaits.gait_library import Provenance
from cassie_gaits.gait_library_file import default_library_path
from cassie_gaits.names import DRIVE_IN_Q
from cassie_msgs.layout import Mode, MotorCommand, RobotMode, RobotState
from cassie_msgs.tunables import replace_checked

PERIOD = 0.002
STEP = 200  # ticks
POINTS = 21


def learned(**torques: float) -> LearnedTorques:
    """Constant torques by joint, in Nm."""
    table = np.zeros((2, len(JOINTS), POINTS))
    for joint, torque in torques.items():
        table[:, JOINTS.index(joint)] = torque
    return LearnedTorques(np.array([0.0, 1.0]), table, Provenance("test", "1", "2025-01-31"))


def config(**changes: object) -> ControllerConfig:
    return replace_checked(ControllerConfig(), **changes)


class Walker:
    """Steps of 0.4 s; the drives' loops give what `wanted` (drive, phase) is away from torque."""

    def __init__(self, learning: TorqueLearning) -> None:
        self.learning = learning
        self.timing = SimpleNamespace(
            phase=0.0, stance=LEFT, steps=0, elapsed=0.0, velocity=(0.5, 0.0)
        )
        legs = [SimpleNamespace(load=1.0, contact=0.0) for _ in range(2)]
        self.robot = Robot(load=(1.0, 1.0))
        self.readings = SimpleNamespace(
            legs=legs, roll=0.0, pitch=0.0, state=RobotState(), records=self.robot.records
        )
        self.mode, self.command = Mode(), MotorCommand()
        self.mode.mode[...] = RobotMode.WALK
        self.mode.vx[...] = 0.5
        self.command.kp[:] = 100.0
        self.speed = 0.5
        self.wanted = lambda drive, phase: 0.0
        self.before = np.zeros(10)

    def tick(self) -> np.ndarray:
        """One tick; what was added, by drive."""
        timing, state = self.timing, self.readings.state
        self.robot.load[:] = [leg.load for leg in self.readings.legs]
        self.robot.contact[:] = [leg.contact for leg in self.readings.legs]
        timing.elapsed += PERIOD
        timing.phase += 1.0 / STEP
        if timing.phase > 1.0 - 1e-9:
            timing.phase = timing.elapsed = 0.0
            timing.stance = RIGHT if timing.stance == LEFT else LEFT
            timing.steps += 1
        for drive in range(10):
            error = self.wanted(drive, timing.phase) - self.before[drive]
            state.q[DRIVE_IN_Q[drive]] = -error / 100.0
        self.command.torque[:] = 0.0
        self.learning.step(timing, self.speed, self.readings, self.mode, self.command)
        self.before = self.command.torque.copy()
        return self.before

    def steps(self, count: int) -> np.ndarray:
        """Some steps; what was added at each tick. Shape (ticks, 10), in Nm."""
        return np.array([self.tick() for _ in range(count * STEP)])


def test_a_file_keeps_torques_and_where_they_come_from(tmp_path):
    path = path_for_library(tmp_path / "optimized.json.gz")
    assert path.name == "optimized.learned.json"
    save_torques(learned(swing_toe=3.0), path)
    found = load_for_library(tmp_path / "optimized.json")
    np.testing.assert_allclose(found.torques, learned(swing_toe=3.0).torques)
    assert found.provenance is not None
    assert found.provenance.tool == "test"


def test_beside_a_library_without_them_nothing_is_learned(tmp_path):
    assert not load_for_library(tmp_path / "mine.json").torques.any()
    with pytest.raises(LearnedTorquesError, match=r"gone\.json: No such file"):
        load_for_library(tmp_path / "mine.json", tmp_path / "gone.json")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda d: d.update(model_hash="0123"), "it is for model '0123', this robot is"),
        (lambda d: d.update(schema_version=2), "schema_version is 2, expected 1"),
        (lambda d: d.pop("speeds"), "speeds"),
        (lambda d: d.update(speeds=[1.0, 0.5]), "speed 0.5 follows 1, expected to rise"),
        (lambda d: d["torques"][0].pop(), "no lists of numbers of equal lengths"),
        (lambda d: d["torques"][0][2].__setitem__(3, float("nan")), "it holds NaN"),
        (lambda d: d["torques"][1][9].__setitem__(0, 46.0), "swing_toe gets 46 Nm, at most 45 Nm"),
        (lambda d: d["torques"][1][9].__setitem__(0, "a"), "no lists of numbers"),
        (lambda d: d.update(joints=["knee"]), "joints are"),
        (lambda d: d.update(provenance={}), "provenance lacks tool"),
    ],
)
def test_a_damaged_file_is_refused_in_one_line(tmp_path, change, reason):
    path = tmp_path / "x.json"
    save_torques(learned(), path)
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(LearnedTorquesError) as error:
        load_torques(path)
    assert reason in str(error.value)
    assert str(error.value).startswith(f"learned torques {path}: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff", b"[" * 100000, b"[]"])
def test_a_file_of_rubbish_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(LearnedTorquesError, match=r"^learned torques .*x\.json: [^\n]+$"):
        load_torques(path)


def test_those_that_come_with_the_package_are_for_this_robot():
    found = load_for_library(default_library_path())
    assert found.provenance is not None
    assert found.speeds[0] <= -0.5 < 1.0 <= found.speeds[-1]
    assert np.abs(found.torques).max() > 1.0


def test_steps_on_the_right_leg_get_them_mirrored():
    torques = learned(stance_hip_roll=5.0, stance_knee=7.0, swing_hip_yaw=2.0, swing_toe=1.0)
    walker = Walker(TorqueLearning(config(), torques, PERIOD))
    added = walker.steps(2)
    left, right = added[STEP // 2], added[STEP + STEP // 2]
    np.testing.assert_allclose(left, [5, 0, 0, 7, 0, 0, 2, 0, 0, 1])
    np.testing.assert_allclose(right, [0, -2, 0, 0, 1, -5, 0, 0, 7, 0])


def test_at_a_touchdown_they_go_over_without_a_jump():
    torques = learned(stance_knee=20.0, swing_knee=-10.0)
    added = Walker(TorqueLearning(config(), torques, PERIOD)).steps(3)
    assert np.abs(np.diff(added, axis=0)).max() <= 30.0 * PERIOD / 0.03 + 1e-9


def test_an_unloaded_stance_leg_and_a_foot_on_the_ground_get_none():
    walker = Walker(TorqueLearning(config(), learned(stance_knee=9.0, swing_knee=4.0), PERIOD))
    walker.readings.legs[LEFT].load = 0.0
    walker.readings.legs[RIGHT].contact = 1.0
    assert not walker.tick().any()


def test_backward_the_stance_hip_takes_what_swings_the_leg_to_the_ground():
    torques = learned(stance_hip_pitch=1.0, swing_hip_pitch=6.0)
    walker = Walker(TorqueLearning(config(), torques, PERIOD))
    middle = STEP // 2
    np.testing.assert_allclose(walker.steps(2)[middle, [2, 7]], [1.0, 6.0])
    walker.speed = -0.5
    added = walker.steps(2)
    np.testing.assert_allclose(added[middle, [2, 7]], [-5.0, 6.0])
    np.testing.assert_allclose(added[STEP + middle, [7, 2]], [-5.0, 6.0])
    walker.readings.legs[RIGHT].contact = 0.75  # only what the swing leg gets
    np.testing.assert_allclose(walker.steps(2)[middle, [2, 7]], [-0.5, 1.5])
    walker.readings.legs[LEFT].load = 0.0
    assert walker.steps(2)[middle, 2] == 0.0


def test_what_repeats_is_learned_up_to_the_leak_but_not_of_the_knee_that_carries():
    walker = Walker(TorqueLearning(config(learned_torques="learn"), zero_torques(), PERIOD))
    left = {3: 9.0, 6: 20.0, 9: -4.0}  # stance knee, swing hip yaw, swing toe
    right = {8: 9.0, 1: -20.0, 4: -4.0}
    walker.wanted = lambda drive, phase: (left if walker.timing.stance == LEFT else right).get(
        drive, 0.0
    )
    walker.steps(60)
    assert walker.learning.taught > 50
    row = walker.learning.torques[4]  # of 0.5 m/s
    c = ControllerConfig().learning
    share = c.gain / (c.gain + c.leak)
    middle = slice(5, 15)
    np.testing.assert_allclose(row[6, middle], 20.0 * share, rtol=0.05)
    np.testing.assert_allclose(row[9, middle], -4.0 * share, rtol=0.05)
    assert np.abs(np.delete(row, [6, 9], axis=0)).max() < 0.5


def test_learned_torques_stay_within_their_bound():
    changes = {"learned_torques": "learn", "learning.limit": 0.05, "learning.gain": 1.0}
    walker = Walker(TorqueLearning(config(**changes), zero_torques(), PERIOD))
    walker.wanted = lambda drive, phase: 500.0
    walker.steps(20)
    assert np.abs(walker.learning.torques[4, JOINTS.index("swing_knee")]).max() <= 0.05 * 196.0


@pytest.mark.parametrize(
    "spoil",
    [
        lambda w: w.mode.yaw_rate.__setitem__(..., 0.3),
        lambda w: w.mode.vy.__setitem__(..., 0.1),
        lambda w: w.mode.vx.__setitem__(..., 0.9),
        lambda w: setattr(w.readings, "roll", 0.3),
        lambda w: w.mode.mode.__setitem__(..., RobotMode.STAND),
    ],
    ids=["turning", "sideways", "changing speed", "stumbling", "stopping"],
)
def test_only_ordinary_steps_teach(spoil):
    walker = Walker(TorqueLearning(config(learned_torques="learn"), zero_torques(), PERIOD))
    walker.wanted = lambda drive, phase: 10.0
    spoil(walker)
    walker.steps(10)
    assert walker.learning.taught == 0
    assert not walker.learning.torques.any()


@pytest.mark.parametrize("changes", [{"learned_torques": "none"}, {"walk.law": "paper"}])
def test_the_switch_and_the_papers_law_leave_them_out(changes):
    walker = Walker(TorqueLearning(config(**changes), learned(stance_knee=9.0), PERIOD))
    assert not walker.steps(2).any()


def test_the_switch_fades_them():
    walker = Walker(TorqueLearning(config(), learned(stance_knee=10.0, swing_knee=10.0), PERIOD))
    knees = [3, 8]
    np.testing.assert_allclose(walker.steps(2)[-1, knees], 10.0)
    walker.learning.configure(config(learned_torques="none"))
    faded = walker.steps(2)[:, knees]
    assert np.abs(np.diff(faded, axis=0)).max() < 0.1
    assert not faded[-1].any()


def test_a_failed_sensor_takes_them_away_within_50_ms_until_it_is_back():
    walker = Walker(TorqueLearning(config(), learned(stance_knee=10.0), PERIOD))
    walker.steps(2)
    walker.readings.state.sensor_faults[...] = 1 << 3
    gone = walker.steps(1)
    assert not gone[round(0.052 / PERIOD) :].any()
    walker.readings.state.sensor_faults[...] = 0
    assert walker.steps(2)[-1, 3] == pytest.approx(10.0)


def test_a_tick_allocates_nothing():
    walker = Walker(TorqueLearning(config(), learned(stance_knee=9.0), PERIOD))
    walker.steps(2)
    arguments = walker.timing, 0.5, walker.readings, walker.mode, walker.command
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak()
    for _ in range(500):
        walker.learning.step(*arguments)
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert now - before < 1000
    assert peak - before < 4000
