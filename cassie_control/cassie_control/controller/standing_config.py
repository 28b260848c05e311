"""What can be tuned of standing, on the ground and on a Segway."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.tunables import tunable


@dataclass(frozen=True, kw_only=True)
class StandConfig:
    """Standing."""

    kp_hip_roll: float = tunable(400.0, "Nm/rad", 0.0, 2000.0, "Hip roll stiffness")
    kp_hip_yaw: float = tunable(200.0, "Nm/rad", 0.0, 2000.0, "Hip yaw stiffness")
    kp_hip_pitch: float = tunable(150.0, "Nm/rad", 0.0, 2000.0, "Torso pitch through the hips")
    kp_knee: float = tunable(350.0, "Nm/rad", 0.0, 2000.0, "Knee stiffness")
    kd_hip_roll: float = tunable(12.0, "Nms/rad", 0.0, 100.0, "Hip roll damping")
    kd_hip_yaw: float = tunable(4.0, "Nms/rad", 0.0, 100.0, "Hip yaw damping")
    kd_hip_pitch: float = tunable(5.0, "Nms/rad", 0.0, 100.0, "Torso pitch damping")
    kd_knee: float = tunable(12.0, "Nms/rad", 0.0, 100.0, "Knee damping")
    kd_leg_pitch: float = tunable(8.0, "Nms/rad", 0.0, 100.0, "Hip pitch damping under load")
    kp_com_x: float = tunable(
        600.0, "N/m", 0.0, 2000.0, "Force fore and aft by CoM x error, over the weight's own"
    )
    kd_com_x: float = tunable(300.0, "Ns/m", 0.0, 1000.0, "Force fore and aft by CoM x velocity")
    settled_kd_com_x: float = tunable(
        500.0,
        "Ns/m",
        0.0,
        1000.0,
        "Force fore and aft by CoM x velocity once it has settled, to meet a push at once",
    )
    kp_com_y: float = tunable(
        250.0, "N/m", 0.0, 2000.0, "Force sideways by CoM y error, over the weight's own"
    )
    kd_com_y: float = tunable(400.0, "Ns/m", 0.0, 1000.0, "Force sideways by CoM y velocity")
    settled_kd_com_y: float = tunable(
        700.0, "Ns/m", 0.0, 1000.0, "Force sideways by CoM y velocity once it has settled"
    )
    settled_kp_hip_roll: float = tunable(
        700.0, "Nm/rad", 0.0, 2000.0, "Hip roll stiffness once it has settled"
    )
    toe_torque: float = tunable(30.0, "Nm", 0.0, 45.0, "Bound of the toe torque of one foot")
    kp_toe: float = tunable(30.0, "Nm/rad", 0.0, 500.0, "Toe stiffness of a foot in the air")
    kp_sole: float = tunable(
        30.0, "Nm/rad", 0.0, 200.0, "Toe torque that keeps a sole flat that tips over its edge"
    )
    kd_toe: float = tunable(2.0, "Nms/rad", 0.0, 50.0, "Toe damping")
    roll_length: float = tunable(
        1.0, "m/rad", 0.0, 10.0, "Leg length difference by torso roll error"
    )
    roll_rate_length: float = tunable(
        0.03, "ms/rad", 0.0, 2.0, "Leg length difference by torso roll rate"
    )
    lean_length: float = tunable(
        0.0, "m/rad", 0.0, 1.0, "Leg length difference by the roll that is wanted"
    )
    give: float = tunable(
        0.03, "m", 0.001, 1.0, "Excess pressure at which the torso's own regulation has given way"
    )
    bend_gain: float = tunable(
        8.0, "", 0.0, 50.0, "Torque over weight that bends the torso, by excess pressure"
    )
    bend_torque: float = tunable(40.0, "Nm", 0.0, 200.0, "Bound of the torque that bends the torso")
    bend_limit: float = tunable(0.55, "rad", 0.05, 1.0, "Bend of the torso at which it ends")
    roll_gain: float = tunable(
        2.0, "", 0.0, 20.0, "Sideways force by excess pressure, over the pendulum's own"
    )
    roll_torque: float = tunable(
        120.0, "Nm", 0.0, 200.0, "Bound of the torque that bends the torso to the side"
    )
    roll_limit: float = tunable(
        0.35, "rad", 0.02, 0.5, "Bend to the side at which it ends, well before the hip's stop"
    )
    roll_give: float = tunable(
        0.1, "", 0.0, 1.0, "What is left of the hip roll stiffness when it has given way"
    )
    roll_back: float = tunable(
        1.0,
        "s",
        0.001,
        5.0,
        "Time in which the hip roll stiffness comes back after it has given way",
    )
    velocity_bandwidth: float = tunable(
        80.0, "1/s", 5.0, 1000.0, "Low-pass of the CoM velocity, below the bounce of the springs"
    )
    settled_bandwidth: float = tunable(
        160.0,
        "1/s",
        5.0,
        1000.0,
        "Low-pass of the CoM velocity once it has settled and nothing bounces",
    )
    settle_time: float = tunable(
        1.0, "s", 0.1, 10.0, "Both feet down and hardly any vertical speed for so long: settled"
    )
    bias_time: float = tunable(
        1.5, "s", 0.2, 20.0, "In which the CoM is held to be where the feet press"
    )
    leg_stiffness: float = tunable(
        8000.0,
        "N/m",
        1000.0,
        100000.0,
        "Stiffness of a leg's springs: shifted weight lengthens its leg",
    )
    height_rate: float = tunable(0.5, "m/s", 0.01, 2.0, "Greatest rate of the pelvis height")
    height_acceleration: float = tunable(
        1.5, "m/s^2", 0.1, 10.0, "Greatest change of the height's rate, whatever is commanded"
    )
    height_integral: float = tunable(3.0, "1/s", 0.0, 10.0, "Leg length by height error, summed")
    height_damping: float = tunable(
        0.05, "s", 0.0, 0.3, "Leg length by vertical speed, against the bounce of the springs"
    )
    rise: float = tunable(
        0.13, "m", 0.0, 0.2, "How far the legs push up when a push brings it to the edge"
    )
    rise_rate: float = tunable(0.7, "m/s", 0.1, 2.0, "Greatest rate at which the legs push up")
    rise_acceleration: float = tunable(
        6.0, "m/s^2", 0.5, 20.0, "Change of the rate at which the legs push up"
    )
    rise_margin: float = tunable(
        0.04,
        "m",
        0.0,
        0.1,
        "Distance of the capture point inside the toes at which the legs push up",
    )
    gravity: float = tunable(1.0, "", 0.0, 1.5, "Share of the weight carried by feed-forward")


@dataclass(frozen=True, kw_only=True)
class SegwayConfig(StandConfig):
    """Riding a Segway: standing with gains of its own, and what keeps speed and heading."""

    kp_com_x: float = tunable(
        200.0, "N/m", 0.0, 2000.0, "Force fore and aft by CoM x error, over the weight's own"
    )
    kd_com_x: float = tunable(80.0, "Ns/m", 0.0, 1000.0, "Force fore and aft by CoM x velocity")
    kp_com_y: float = tunable(
        125.0, "N/m", 0.0, 2000.0, "Force sideways by CoM y error, over the weight's own"
    )
    kd_com_y: float = tunable(200.0, "Ns/m", 0.0, 1000.0, "Force sideways by CoM y velocity")
    bend_torque: float = tunable(80.0, "Nm", 0.0, 200.0, "Bound of the torque that bends the torso")
    bend_limit: float = tunable(0.35, "rad", 0.05, 1.0, "Bend of the torso at which it ends")
    kd_hip_roll: float = tunable(8.0, "Nms/rad", 0.0, 100.0, "Hip roll damping")
    roll_torque: float = tunable(
        80.0, "Nm", 0.0, 200.0, "Bound of the torque that bends it to the side"
    )
    roll_give: float = tunable(
        0.3, "", 0.0, 1.0, "What is left of the hip roll stiffness when it has given way"
    )
    settled_kd_com_x: float = tunable(
        80.0, "Ns/m", 0.0, 1000.0, "Force fore and aft by CoM x velocity once it has settled"
    )
    settled_kd_com_y: float = tunable(
        200.0, "Ns/m", 0.0, 1000.0, "Force sideways by CoM y velocity once it has settled"
    )
    settled_kp_hip_roll: float = tunable(
        400.0, "Nm/rad", 0.0, 2000.0, "Hip roll stiffness once it has settled"
    )
    settled_bandwidth: float = tunable(
        80.0, "1/s", 5.0, 1000.0, "Low-pass of the CoM velocity once it has settled"
    )
    roll_back: float = tunable(0.001, "s", 0.001, 5.0, "In which the hip roll stiffness comes back")
    rise: float = tunable(0.0, "m", 0.0, 0.2, "How far the legs push up at the edge")
    roll_rate_length: float = tunable(
        0.1, "ms/rad", 0.0, 2.0, "Leg length difference by torso roll rate"
    )
    lean_length: float = tunable(
        0.3, "m/rad", 0.0, 1.0, "Leg length difference by the roll that is wanted"
    )
    fast_roll_give: float = tunable(1.0, "", 0.0, 1.0, "roll_give at 3 m/s and faster")
    fast_kd_com_y: float = tunable(
        150.0, "Ns/m", 0.0, 1000.0, "kd_com_y at 3 m/s and faster, where bumps come fast"
    )
    moving_time: float = tunable(
        0.3, "s", 0.05, 5.0, "Low-pass of the acceleration of what Cassie stands on"
    )
    level_time: float = tunable(
        120.0, "s", 1.0, 1000.0, "For which roll and pitch are trusted to the gyro"
    )
    press_limit: float = tunable(
        0.045, "m", 0.01, 0.07, "How far from the middle of the feet they may press for long"
    )
    press_more: float = tunable(
        0.02, "m", 0.0, 0.05, "So much farther once the ground goes along with the lean"
    )
    press_limit_y: float = tunable(
        0.08,
        "m",
        0.01,
        0.12,
        "How far to the side of the middle of the feet they may press for long",
    )
    press_distance: float = tunable(
        0.29,
        "m",
        0.1,
        0.4,
        "Distance of the feet from which `press_limit_y` holds; nearer, it is less",
    )
    kp_speed: float = tunable(
        0.04, "m/(m/s)", 0.0, 0.2, "CoM x by error of the speed that Cassie itself estimates"
    )
    kp_yaw_rate: float = tunable(
        0.06, "m/(rad/s)", 0.0, 0.5, "CoM y by error of the yaw rate, while vx or yaw_rate command"
    )
    heading_gain: float = tunable(
        0.4, "1/s", 0.0, 2.0, "Yaw rate by error of the heading, while vx or yaw_rate command"
    )
    turn_limit: float = tunable(1.2, "rad/s", 0.1, 5.0, "Yaw rate beyond which no lean adds")
    turn_lean: float = tunable(
        0.05, "m/(rad/s)", 0.0, 0.2, "CoM y that turns it so fast, times 1 + speed / 2"
    )
    kp_turn: float = tunable(0.08, "m/(rad/s)", 0.0, 0.5, "CoM y back by what it turns faster")
    slow_time: float = tunable(
        0.7, "s", 0.0, 3.0, "How far ahead it is minded that it will roll backward"
    )
    corner: float = tunable(
        0.1, "m", 0.03, 0.3, "CoM back and to a side together: shins and bar are in the way"
    )
    speed_time: float = tunable(
        5.0, "s", 0.5, 1000.0, "In which the speed is taken to be the vx of who leans it"
    )
    turn_time: float = tunable(
        1.0, "s", 0.1, 1000.0, "In which a fast turn tells the speed; a slow one takes longer"
    )
    rest_speed: float = tunable(
        0.4,
        "m/s",
        0.0,
        2.0,
        "Estimated speed that counts as rest once it is told to stop",
    )
    rest_time: float = tunable(2.0, "s", 0.1, 60.0, "In which the estimate then goes to zero")
    rest_back: float = tunable(
        0.003, "m", 0.0, 0.02, "CoM x against the way it came, so that what still rolls stops"
    )
    speed_sum: float = tunable(
        0.005, "m/m", 0.0, 0.1, "CoM x by the sum of the error of the speed that it estimates"
    )
    top_speed: float = tunable(
        5.5, "m/s", 0.0, 10.0, "Speed, as it estimates it, beyond which no lean adds"
    )
    back_speed: float = tunable(1.0, "m/s", 0.0, 5.0, "The same backward")
    tilt_margin: float = tunable(
        0.02,
        "rad",
        0.0,
        0.3,
        "Tilt of the platform against the lean that is not minded",
    )
    tilt_gain: float = tunable(
        2.5, "m/rad", 0.0, 5.0, "CoM back by what it is tilted further: its limiter wants so"
    )
