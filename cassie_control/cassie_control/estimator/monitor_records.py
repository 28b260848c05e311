"""Records of the sensor monitor, for compiled functions.

A position and a velocity that belong together are a pair: ten drives, six joints, three axes of the
IMU's orientation with those of its gyro.
"""

from __future__ import annotations

import numpy as np

from cassie_control.estimator import acceleration_kernels, delay_kernels
from cassie_control.estimator.acceleration_kernels import KEPT
from cassie_control.estimator.delay_kernels import KEPT_TICKS, RESPONSE_TICKS
from cassie_control.estimator.pair_kernels import PAIRS

_DELAYS, _PAIR_DELAYS = len(acceleration_kernels.DELAYS), len(delay_kernels.DELAYS)

WATCH_TYPE = np.dtype(
    [
        ("ticks", int),  # since the start
        ("position", float, PAIRS),  # measured, rad; the IMU's: its turn since the start
        ("velocity", float, PAIRS),  # measured, rad/s
        ("last_position", float, PAIRS),
        ("last_velocity", float, (4, PAIRS)),  # newest first
        ("last_orientation", float, 4),
        ("steps", float, (RESPONSE_TICKS, PAIRS)),  # changes of position, newest first, rad
        ("turns", float, (3, PAIRS)),  # what the velocities say, newest first, rad
        ("same", int, (2, PAIRS)),  # ticks for which position and velocity had the same bits
        ("unseen", float, (2, PAIRS)),  # rad, by which the other one says that it moved meanwhile
        ("apart", float, PAIRS),  # rad, of position from integrated velocity, fading
        ("turned", float, 3),  # rad, of the IMU, fading as fast
        ("late", float, (4, PAIRS)),  # fading: means of apart and velocity, covariance, variance
        ("past", float, (2, PAIRS, KEPT_TICKS)),  # ring: steps and turns compared, rad
        ("evidence", float, (2, PAIRS, _PAIR_DELAYS)),  # rad^2: position is late, velocity is
        ("doubt", float, (2, PAIRS)),  # rad^2, the most of it
        ("unclear", float, PAIRS),  # s, for which they have been apart without a cause
        ("guessed", int, PAIRS),  # 1 where that was all there was to blame one of them by
        ("last_step", float, PAIRS),  # rad, compared last
        ("leap", float, PAIRS),  # rad, largest sudden one of the position, fading
        ("peak", float, PAIRS),  # rad/s, fading
        ("spikes", float, (2, PAIRS)),  # of the velocity, fading counts of clear and of small ones
        ("bad", float, (2, PAIRS)),  # s, for which position or velocity is not believed yet
        ("life", int, (2, PAIRS)),  # 0 believed, 1 not, 2 not but its bits change without power
        ("trusted", float, (2, PAIRS)),  # position (rad) and velocity (rad/s) to go on with
        ("orientation", float, 4),  # to go on with, x y z w
        ("acceleration", float, (3, 3)),  # measured, newest first, m/s^2
        ("same_acceleration", int, 3),
        ("acceleration_spikes", float, 3),
        ("carried", float),  # share of late in which the feet carried it
        ("smooth", float, (4, 3)),  # m/s^2, measured smoothed fast and slow, expected likewise
        ("expected", float, (KEPT, 3)),  # ring: m/s^2, what changes within a step
        ("power", float, 3),  # (m/s^2)^2, of that
        ("blow", float),  # s, for which the echo of one may go on
        ("late_acceleration", float, (_DELAYS, 3)),  # s, for which it fitted a delay better
        ("bad_acceleration", float, 3),  # s
        ("bad_torque", float, 10),  # s
        ("rest", float),  # s, for which it has hung or lain still without power
        ("powered", int),  # whether it has power
        ("used", int),  # whether it has had power since the start
        ("moved", int),  # whether, once used, it has moved since the estimate began anew
    ]
)
"""What the monitor remembers."""

LIMITS_TYPE = np.dtype(
    [
        ("period", float),  # s
        ("low", float, PAIRS),  # rad
        ("high", float, PAIRS),
        ("speed", float, PAIRS),  # rad/s
        ("still", float, PAIRS),  # rad/s, below which it counts as still
        ("jump", float, PAIRS),  # rad in one tick
        ("apart", float, PAIRS),  # rad
        ("apart_at_speed", float, PAIRS),  # s
        ("spike", float, PAIRS),  # rad/s
        ("excited", float, PAIRS),  # (rad/s)^2, from which a delay shows
        ("delay_ticks", int, _PAIR_DELAYS),  # at which motions are compared
        ("evidence", float, PAIRS),  # rad^2, enough for one of a pair to be late
        ("response_ticks", int, PAIRS),  # for which a velocity answers a step of the position
        ("response", float, (RESPONSE_TICKS, PAIRS)),  # of the velocity, by steps, newest first
        ("position_lag", int, PAIRS),  # ticks by which the position is later than the velocity
        ("velocity_lag", int, PAIRS),  # and the other way round
        ("acceleration", float),  # m/s^2
        ("acceleration_spike", float),  # m/s^2
        ("weight", float),  # of the robot, N
        ("torque", float, 10),  # of each drive, Nm
        ("late_acceleration", float, (_DELAYS, 3)),  # s, for which it must fit a delay better
        ("hold", float),  # s, that a channel stays unbelieved after it last was wrong
    ]
)
"""What is normal."""
