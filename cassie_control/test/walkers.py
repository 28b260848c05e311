"""Walking controllers, and states in the middle of a step."""

from __future__ import annotations

from dataclasses import replace

from robot_states import leg_joints, readings_of, state_of

from cassie_control.config import WalkConfig
from cassie_control.control.forces import carry_weight
from cassie_control.control.outputs import PITCH, ROLL
from cassie_control.control.robot import Readings
from cassie_control.control.walking import WalkingController
from cassie_control.planner.timing import LEFT
from cassie_gaits.gait_library import GaitLibrary
from cassie_gaits.gait_library_file import library_path, load_certified
from cassie_gaits.records import FloatArray
from cassie_msgs.layout import MotorCommand, RobotState


def _upright(library: GaitLibrary) -> GaitLibrary:
    """The same gaits with the torso upright all along."""
    gaits = []
    for gait in library.gaits:
        coefficients = gait.coefficients.copy()
        coefficients[:, [ROLL, PITCH]] = 0.0
        gaits.append(replace(gait, coefficients=coefficients, certificate=None))
    return replace(library, gaits=gaits)


LIBRARY = _upright(load_certified(library_path("optimized")))
CONFIG = WalkConfig()


def walking(
    stance: int = LEFT,
    period: float = 0.002,
    config: WalkConfig = CONFIG,
    state: RobotState | None = None,
) -> WalkingController:
    """A walking controller that begins a step, from standing unless a state is given."""
    core = WalkingController(config, LIBRARY, period)
    core.start(readings_of(state or state_of(leg_joints(), leg_joints())), stance)
    return core


def weight_torques(core: WalkingController, readings: Readings) -> FloatArray:
    """The part of the last command's torques that carries the weight. Shape (10,), in Nm."""
    command = MotorCommand()
    now = (core._gains, core._slope, core.timing)
    gain, slope, timing = (each.records[0] for each in now)
    robot, pairs = readings.records[0], readings.pair
    carry_weight(gain, robot, pairs, timing, slope, command.record[0])
    return command.torque


def swinging(stance: int, swing_force: float = 0.0) -> RobotState:
    """A state in the middle of a step: the stance leg carries the weight."""
    forces = (330.0, swing_force) if stance == LEFT else (swing_force, 330.0)
    return state_of(leg_joints(), leg_joints(knee=-1.3), forces=forces)
