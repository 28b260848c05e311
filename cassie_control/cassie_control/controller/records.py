"""Records in which the robot and a step of walking go to compiled functions: C structures.

Legs are left, right; vectors are in the heading frame unless said otherwise.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

RecordArray = npt.NDArray[np.void]

ROBOT_TYPE = np.dtype(
    [
        ("height", float),  # m
        ("yaw", float),  # rad
        ("pitch", float),
        ("roll", float),
        ("yaw_rate", float),  # rad/s
        ("pitch_rate", float),
        ("roll_rate", float),
        ("com", float, 3),  # from the pelvis origin, m
        ("com_from_feet", float, 3),  # from the midpoint of the feet, m
        ("com_velocity", float, 3),  # m/s
        ("velocity", float, 3),  # of the pelvis origin, m/s
        ("load", float, 2),  # 0..1
        ("force", float, 2),  # N
        ("contact", float, 2),  # 0..1
        ("joints", float, (2, 7)),  # rad
        ("ankle", float, (2, 3)),  # toe joint from the pelvis origin, m
        ("foot", float, (2, 3)),  # middle of the sole from there, m
        ("rates", float, (2, 7)),  # of the joints, rad/s
        ("tilt", float, (3, 3)),  # rotation pelvis to heading frame
        ("angular_velocity", float, 3),  # of the pelvis, pelvis frame, rad/s
    ]
)
"""What the control laws read of the robot, see `readings`."""

STEP_TYPE = np.dtype(
    [
        # Before leg-angle adjustment:
        ("stance", float),  # number of the leg
        ("phase", float),
        ("rate", float),  # of the phase, 1/s
        ("step_time", float),  # s
        ("heading", float),  # to follow, rad
        ("yaw_rate", float),  # commanded, rad/s
        # What adjustment is asked with:
        ("yaw", float),  # swing hip yaw at touchdown, rad
        ("turn", float),  # half of the turn of this step, rad
        ("rise", float),  # how much the gait's stance leg still grows, m
        ("gait_pitch", float),  # the gait's swing leg at touchdown, rad, rad, m
        ("gait_roll", float),
        ("gait_length", float),
        # What it answers, and the torso wanted:
        ("new_rate", float),  # of the phase, 1/s
        ("pitch", float),  # swing leg at touchdown, rad, rad, m
        ("roll", float),
        ("length", float),
        ("lead", float),  # s, by which the foot touches down before the step's end
        ("speed", float),  # low-passed, forward, m/s
        ("torso_roll", float),  # rad
        ("torso_pitch", float),
        ("slope_ahead", float),  # rise of the ground over distance
        ("slope_left", float),
        # Outputs of eq:h0, rad and m, in the order of `outputs`:
        ("start", float, 9),  # where this step began
        ("start_rates", float, 9),  # per s
        ("gait", float, (9, 6)),  # Bezier coefficients of this step
        ("desired", float, 9),
        ("desired_rates", float, 9),  # per s
        ("accelerations", float, 9),  # desired, per s^2
        # Of each leg, hip roll and pitch less the torso's, see `thigh_kernels`:
        ("tracked", float),  # 1 once the tracks have begun
        ("thigh", float, (2, 2)),  # rad
        ("thigh_rates", float, (2, 2)),  # rad/s
    ]
)
"""A step of walking."""

FIGURES_TYPE = np.dtype(
    [
        # Of the configuration, see `config.WalkConfig`; 0 where the paper's law leaves it out:
        *((name, float) for name in ("kp_torso_roll", "kd_torso_roll")),
        *((name, float) for name in ("kp_torso_pitch", "kd_torso_pitch")),
        *((name, float) for name in ("late_reach", "late_speed")),
        *((name, float) for name in ("level", "level_back", "swing_inertia", "bounce_damping")),
        *((name, float) for name in ("heading_gain", "yaw_limit")),
        ("straight", float),  # 1 where the swing leg's angles go the way of least effort
        ("share_force", float),  # 1 where legs carry it by their forces, 0 by their loads
        ("weight", float),  # that is fed forward, N
        ("mass", float),  # of the robot, kg
        *((name, float) for name in ("thigh_track", "thigh_angle", "thigh_rate")),
        ("period", float),  # of control, s
        ("latency", float),  # of the drives, that is allowed for, s
        ("handover", float),  # time in which the weight then goes from leg to leg, s
        ("kp", float, 5),  # of hip_roll, hip_yaw, hip_pitch, knee, toe
        ("kd", float, 5),
        # Of the robot, see `virtual_leg`, `readings` and `swing_inertia`:
        ("hip_x", float),
        ("hip_z", float),
        ("thigh", float),
        ("shin", float),
        ("knee_offset", float),
        ("hip_offset", float),
        ("toe_offset", float),
        ("neutral_tarsus", float),
        ("inertia", float, (4, 4)),
        # From a polynomial's two first and two last coefficients to the two between:
        ("least_effort", float, (2, 4)),
    ]
)
"""What the walking law takes for granted."""
