"""Run every compiled function once; their machine code is kept beside the sources."""

import numpy as np

from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import GaitController
from cassie_control.estimator.choice import make_monitored
from cassie_control.estimator.config import ESTIMATORS, EstimatorConfig
from cassie_control.learning.torque_learning import update_table
from cassie_control.learning.torque_table import zero_torques
from cassie_control.planner.pendulum import PendulumState, predict_com
from cassie_gaits.gait_library_file import default_library_path, load_library
from cassie_gaits.link_frames import LinkPoses
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import Mode, RobotMode
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig

PERIOD = 0.002
TICKS = 500

library = load_library(default_library_path())
plant = Plant(PlantConfig(), Scenario(start="standing"))
estimators = [make_monitored(EstimatorConfig(estimator=name), PERIOD) for name in ESTIMATORS]
controller = GaitController(ControllerConfig(learned_torques="learn"), library, PERIOD)
mode = Mode()
mode.height[...] = 0.95
plant.power(True)
for tick in range(TICKS):
    mode.mode[...] = RobotMode.STAND if tick < TICKS // 5 else RobotMode.WALK
    sample = plant.sense()
    states = [estimator.step(sample) for estimator in estimators]
    plant.step(controller.step(states[0], mode))
LinkPoses().at(states[0].q)

learned = zero_torques()
counts, weights = np.zeros(learned.torques.shape[2]), np.zeros(len(learned.speeds))
update_table(learned.torques, learned.torques, counts, weights, np.ones(10), np.ones(10), 0.0, 0.0)
# The paper's law calls this one from Python.
predict_com(PendulumState(0.0, 0.0, 0.1, 0.1, 3.0, 0.0), 0.1)
