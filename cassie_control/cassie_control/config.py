"""Everything that can be tuned in the controller: one field each, with unit, range and meaning."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from cassie_msgs.tunables import tunable


@dataclass(frozen=True, kw_only=True)
class TransitionConfig:
    """Changes between standing and walking."""

    lean_time: float = tunable(0.5, "s", 0.1, 2.0, "Duration of the lean before the first step")
    lean_roll: float = tunable(0.18, "rad", 0.0, 0.2, "Roll to the left before the first step")
    recovery_step: bool = tunable(
        True, description="Step without a command when standing cannot hold a push"
    )
    recovery_margin: float = tunable(
        0.035,
        "m",
        0.01,
        0.3,
        "Distance of the capture point beyond the feet that triggers a recovery step",
    )


@dataclass(frozen=True, kw_only=True)
class StandConfig:
    """Standing."""

    kp_hip_roll: float = tunable(400.0, "Nm/rad", 0.0, 2000.0, "Hip roll stiffness")
    kp_hip_yaw: float = tunable(200.0, "Nm/rad", 0.0, 2000.0, "Hip yaw stiffness")
    kp_hip_pitch: float = tunable(
        150.0,
        "Nm/rad",
        0.0,
        2000.0,
        "Stiffness of torso pitch through each hip; of the hip pitch of a leg in the air",
    )
    kp_knee: float = tunable(350.0, "Nm/rad", 0.0, 2000.0, "Knee stiffness")
    kd_hip_roll: float = tunable(12.0, "Nms/rad", 0.0, 100.0, "Hip roll damping")
    kd_hip_yaw: float = tunable(4.0, "Nms/rad", 0.0, 100.0, "Hip yaw damping")
    kd_hip_pitch: float = tunable(
        5.0, "Nms/rad", 0.0, 100.0, "Damping of torso pitch through each hip"
    )
    kd_knee: float = tunable(12.0, "Nms/rad", 0.0, 100.0, "Knee damping")
    kd_leg_pitch: float = tunable(8.0, "Nms/rad", 0.0, 100.0, "Hip pitch damping under load")
    kp_com_x: float = tunable(
        600.0, "N/m", 0.0, 2000.0, "Forward force by CoM x error, in addition to gravity's"
    )
    kd_com_x: float = tunable(300.0, "Ns/m", 0.0, 1000.0, "Forward force by CoM x velocity")
    settled_kd_com_x: float = tunable(
        500.0,
        "Ns/m",
        0.0,
        1000.0,
        "Forward force by CoM x velocity after settling, to react to a push at once",
    )
    kp_com_y: float = tunable(
        250.0, "N/m", 0.0, 2000.0, "Sideways force by CoM y error, in addition to gravity's"
    )
    kd_com_y: float = tunable(400.0, "Ns/m", 0.0, 1000.0, "Sideways force by CoM y velocity")
    settled_kd_com_y: float = tunable(
        700.0, "Ns/m", 0.0, 1000.0, "Sideways force by CoM y velocity after settling"
    )
    settled_kp_hip_roll: float = tunable(
        700.0, "Nm/rad", 0.0, 2000.0, "Hip roll stiffness after settling"
    )
    kp_toe: float = tunable(30.0, "Nm/rad", 0.0, 500.0, "Toe stiffness of a foot in the air")
    kd_toe: float = tunable(2.0, "Nms/rad", 0.0, 50.0, "Toe damping")
    roll_length: float = tunable(
        1.0, "m/rad", 0.0, 10.0, "Leg length difference by torso roll error"
    )
    roll_rate_length: float = tunable(
        0.03, "m/(rad/s)", 0.0, 2.0, "Leg length difference by torso roll rate"
    )
    bend_gain: float = tunable(
        8.0, "", 0.0, 50.0, "Torque that bends the torso, per weight and excess of pressure"
    )
    bend_torque: float = tunable(80.0, "Nm", 0.0, 200.0, "Bound of the torque that bends the torso")
    bend_limit: float = tunable(0.35, "rad", 0.05, 1.0, "Bend at which the bending torque is 0")
    velocity_bandwidth: float = tunable(
        80.0, "1/s", 5.0, 1000.0, "Low-pass of the CoM velocity, below the springs' frequency"
    )
    settled_bandwidth: float = tunable(
        160.0,
        "1/s",
        5.0,
        1000.0,
        "Low-pass of the CoM velocity after settling, when nothing bounces",
    )
    settle_time: float = tunable(
        1.0, "s", 0.1, 10.0, "Time with both feet down and a nearly still pelvis until settled"
    )
    bias_time: float = tunable(
        1.5, "s", 0.2, 20.0, "Time constant of the CoM's correction by the centre of pressure"
    )
    height_rate: float = tunable(0.5, "m/s", 0.01, 2.0, "Greatest rate of the pelvis height")
    height_acceleration: float = tunable(
        1.5, "m/s^2", 0.1, 10.0, "Greatest acceleration of the commanded pelvis height"
    )
    height_integral: float = tunable(1.0, "1/s", 0.0, 10.0, "Leg length by integrated height error")
    height_damping: float = tunable(
        0.05, "s", 0.0, 0.3, "Leg length by vertical speed, to damp the springs' oscillation"
    )
    rise: float = tunable(
        0.13, "m", 0.0, 0.2, "How far the legs push up against a push to the edge of support"
    )
    rise_acceleration: float = tunable(
        6.0, "m/s^2", 0.5, 20.0, "Acceleration with which the legs push up"
    )
    rise_margin: float = tunable(
        0.04,
        "m",
        0.0,
        0.1,
        "Distance of the capture point inside the toes at which the legs push up",
    )


_OWN_GAINS = ("kp_com_x", "kd_com_x", "kp_com_y", "kd_com_y", "kd_hip_roll", "roll_rate_length")
"""Gains of `SegwayConfig` that take the place of those of `StandConfig`."""


@dataclass(frozen=True, kw_only=True)
class SegwayConfig:
    """Riding a Segway: gains that differ from standing, and control of speed and heading."""

    kp_com_x: float = tunable(
        200.0, "N/m", 0.0, 2000.0, "Forward force by CoM x error, in addition to gravity's"
    )
    kd_com_x: float = tunable(80.0, "Ns/m", 0.0, 1000.0, "Forward force by CoM x velocity")
    kp_com_y: float = tunable(
        125.0, "N/m", 0.0, 2000.0, "Sideways force by CoM y error, in addition to gravity's"
    )
    kd_com_y: float = tunable(200.0, "Ns/m", 0.0, 1000.0, "Sideways force by CoM y velocity")
    kd_hip_roll: float = tunable(8.0, "Nms/rad", 0.0, 100.0, "Hip roll damping")
    roll_give: float = tunable(
        0.3, "", 0.0, 1.0, "Least factor on hip roll stiffness at an excess of pressure"
    )
    roll_rate_length: float = tunable(
        0.1, "m/(rad/s)", 0.0, 2.0, "Leg length difference by torso roll rate"
    )
    lean_length: float = tunable(
        0.3, "m/rad", 0.0, 1.0, "Leg length difference by the desired roll"
    )
    fast_kd_com_y: float = tunable(
        150.0, "Ns/m", 0.0, 1000.0, "`kd_com_y` at 3 m/s and faster, where bumps come fast"
    )
    moving_time: float = tunable(
        0.3, "s", 0.05, 5.0, "Time constant of the low-pass of the ground's acceleration"
    )
    level_time: float = tunable(
        120.0, "s", 1.0, 1000.0, "Time constant with which the estimate corrects the gyro's tilt"
    )
    press_limit: float = tunable(
        0.045, "m", 0.01, 0.07, "Largest lasting centre of pressure, fore or aft of the feet"
    )
    press_more: float = tunable(
        0.02, "m", 0.0, 0.05, "Increase of `press_limit` once the ground accelerates with a lean"
    )
    press_limit_y: float = tunable(
        0.08,
        "m",
        0.01,
        0.12,
        "Largest lasting centre of pressure, sideways of the feet's middle",
    )
    press_distance: float = tunable(
        0.29,
        "m",
        0.1,
        0.4,
        "Distance of the feet below which `press_limit_y` is reduced",
    )
    kp_speed: float = tunable(
        0.04, "m/(m/s)", 0.0, 0.2, "CoM x by error of the vehicle's estimated speed"
    )
    kp_yaw_rate: float = tunable(
        0.06, "m/(rad/s)", 0.0, 0.5, "CoM y by yaw rate error, while vx or yaw_rate is not 0"
    )
    heading_gain: float = tunable(
        0.4, "1/s", 0.0, 2.0, "Yaw rate by heading error, while vx or yaw_rate is not 0"
    )
    corner: float = tunable(
        0.1, "m", 0.03, 0.3, "Bound of CoM shift back plus sideways, as shins may meet the bar"
    )
    axle_x: float = tunable(
        -0.022,
        "m",
        -0.1,
        0.1,
        "Axle ahead of the feet's middle: CoM x at which the vehicle is expected to stay at rest",
    )
    top_speed: float = tunable(
        5.5,
        "m/s",
        0.0,
        10.0,
        "Speed to which an operator's lean leads: com_x <= neutral + kp_speed (top_speed - v)",
    )
    back_speed: float = tunable(
        1.0, "m/s", 0.0, 5.0, "Speed backward to which an operator's lean leads, as top_speed"
    )

    def standing(self, stand: StandConfig) -> StandConfig:
        """Gains of standing, where those of riding replace `_OWN_GAINS`.

        A platform always moves: gains do not change as the robot settles, and no legs push up.
        """
        own = {name: getattr(self, name) for name in _OWN_GAINS}
        return replace(
            stand,
            **own,
            settled_kd_com_x=self.kd_com_x,
            settled_kd_com_y=self.kd_com_y,
            settled_kp_hip_roll=stand.kp_hip_roll,
            settled_bandwidth=stand.velocity_bandwidth,
            rise=0.0,
        )


@dataclass(frozen=True, kw_only=True)
class JointGains:
    """Position and velocity gains of one leg's drives while walking.

    Found by search, see DECISIONS.md, Gains of drives and torso by search.
    """

    kp_hip_roll: float = tunable(527.0, "Nm/rad", 0.0, 2000.0, "Hip roll stiffness")
    kp_hip_yaw: float = tunable(448.0, "Nm/rad", 0.0, 2000.0, "Hip yaw stiffness")
    kp_hip_pitch: float = tunable(361.0, "Nm/rad", 0.0, 2000.0, "Hip pitch stiffness")
    kp_knee: float = tunable(549.0, "Nm/rad", 0.0, 2000.0, "Knee stiffness")
    kp_toe: float = tunable(20.2, "Nm/rad", 0.0, 500.0, "Toe stiffness in swing")
    kd_hip_roll: float = tunable(23.7, "Nms/rad", 0.0, 100.0, "Hip roll damping")
    kd_hip_yaw: float = tunable(18.1, "Nms/rad", 0.0, 100.0, "Hip yaw damping")
    kd_hip_pitch: float = tunable(9.14, "Nms/rad", 0.0, 100.0, "Hip pitch damping")
    kd_knee: float = tunable(7.37, "Nms/rad", 0.0, 100.0, "Knee damping")
    kd_toe: float = tunable(2.08, "Nms/rad", 0.0, 50.0, "Toe damping in swing")


@dataclass(frozen=True, kw_only=True)
class LateGains:
    """Changes for drives that act late on commands, see `control.latency`."""

    latency: float = tunable(0.01, "s", 0.0, 0.1, "Latency at which gains for late drives begin")
    latency_span: float = tunable(
        0.006, "s", 0.001, 0.1, "Increase of latency over which the gains change"
    )
    thigh_track: float = tunable(9.0, "Hz", 0.5, 30.0, "`walk.thigh_track` with late drives")
    softening: float = tunable(
        220.0,
        "1/s",
        0.0,
        1000.0,
        "Gains of knees, hip and torso pitch are divided by 1 + softening * delay of the torques",
    )

    def factor(self, torque_delay: float) -> float:
        """Factor on the gains that feed the springs' oscillation where torques are late (s)."""
        return 1.0 / (1.0 + self.softening * torque_delay)

    def share(self, latency: float) -> float:
        """How far the gains are those for late drives at a latency (s), 0..1."""
        return min(1.0, max(0.0, (latency - self.latency) / self.latency_span))


@dataclass(frozen=True, kw_only=True)
class WalkConfig:
    """Walking: torso, steps and leg-angle adjustment."""

    joints: JointGains = field(default_factory=JointGains)
    kp_torso_pitch: float = tunable(
        285.0, "Nm/rad", 0.0, 2000.0, "Stiffness of torso pitch through the stance hip"
    )
    kd_torso_pitch: float = tunable(
        13.5, "Nms/rad", 0.0, 200.0, "Damping of torso pitch through the stance hip"
    )
    kp_torso_roll: float = tunable(
        446.0, "Nm/rad", 0.0, 2000.0, "Stiffness of torso roll through the stance hip"
    )
    kd_torso_roll: float = tunable(
        20.2, "Nms/rad", 0.0, 200.0, "Damping of torso roll through the stance hip"
    )
    late: LateGains = field(default_factory=LateGains)
    law: str = tunable(
        "pendulum",
        choices=("pendulum", "paper"),
        description="Leg-angle adjustment: predicted by a pendulum, or the paper's own",
    )
    touchdown_force: float = tunable(
        200.0, "N", 50.0, 400.0, "Force on the swing foot that ends a step"
    )
    earliest_touchdown: float = tunable(0.2, "s", 0.05, 0.4, "Time before which no step ends")
    latest_touchdown: float = tunable(1.5, "", 1.0, 2.0, "Phase at which a step ends anyway")
    quickest_step: float = tunable(
        0.2,
        "s",
        0.1,
        0.6,
        "Least duration of a step whose foot has no way to go; 1 - phase of it remains",
    )
    swing_time: float = tunable(
        0.1,
        "s/m",
        0.0,
        1.0,
        "Least time that remains, per distance of the swing foot from its foothold",
    )
    slowest_step: float = tunable(
        1.2, "", 1.0, 2.0, "Duration of the slowest step, to catch a fall, ratio to the gait's"
    )
    reach_inward: float = tunable(
        0.2, "m", 0.05, 0.3, "How far inside its hip the swing foot can be set down"
    )
    reach_outward: float = tunable(
        0.32, "m", 0.1, 0.4, "How far outside its hip the swing foot can be set down"
    )
    clearance: float = tunable(
        0.05,
        "m",
        0.0,
        0.15,
        "Height added to the gait's swing foot in the middle of a step",
    )
    landing_depth: float = tunable(
        0.035, "m", -0.02, 0.1, "How far below the ground the swing foot aims, to take load at once"
    )
    late_reach: float = tunable(
        0.12, "m", 0.0, 0.2, "How far the swing leg extends while touchdown is late"
    )
    late_speed: float = tunable(
        1.0, "m/s", 0.05, 2.0, "How fast the swing leg extends while touchdown is late"
    )
    level_back: float = tunable(
        0.5, "", 0.0, 1.0, "Stance leg walking backward: 0 the gait's length, 1 a level hip"
    )
    foot_spread: float = tunable(
        0.01, "m", -0.05, 0.1, "How far each foot lands outside its hip when walking in place"
    )
    friction: float = tunable(
        0.2,
        "",
        0.05,
        2.0,
        "Friction that every ground has; a step to a foot outside its cone is made quicker",
    )
    least_foot_distance: float = tunable(0.1, "m", 0.05, 0.3, "Least sideways distance of the feet")
    speed_filter: float = tunable(
        0.64,
        "Hz",
        0.05,
        10.0,
        "Cut-off of the velocity's low-pass: of gait, contact lead and laws of walking backward",
    )
    gait_speed: float = tunable(
        1.0, "m/s", 0.0, 3.0, "Largest speed ahead at which the gait library is read"
    )
    double_support: float = tunable(
        0.07, "s", 0.0, 0.2, "Time in which the weight shifts to the new foot"
    )
    contact_lead: float = tunable(
        0.04, "s", 0.0, 0.1, "Time from the swing foot's first contact to the step's end"
    )
    contact_lead_speed: float = tunable(
        0.03,
        "s/(m/s)",
        0.0,
        0.1,
        "Increase of `contact_lead` with speed fore or aft, up to 1.5 m/s",
    )
    map_gain_x: float = tunable(
        0.97, "", 0.5, 1.5, "Forward a / b of the step-to-step map in place, over the pendulum's"
    )
    map_gain_y: float = tunable(
        1.1, "", 0.5, 1.5, "Sideways a / b of the step-to-step map in place, over the pendulum's"
    )
    map_loss_x: float = tunable(
        0.5, "s/m", 0.0, 2.0, "Decrease of forward a / b with forward speed at touchdown"
    )
    map_loss_y: float = tunable(
        0.17, "s/m", 0.0, 2.0, "Decrease of sideways a / b with forward speed at touchdown"
    )
    observer_gain: float = tunable(
        0.045, "m/(m/s)", 0.0, 0.2, "Disturbance observer: foot offset by mean speed error"
    )
    observer_error: float = tunable(
        0.05,
        "m/s",
        0.0,
        0.5,
        "Disturbance observer: saturation of the speed error as the offset grows",
    )
    slope_time: float = tunable(
        0.3,
        "s",
        0.0,
        5.0,
        "Time constant of the slope ahead, by the stance foot; 0: no model of the ground",
    )
    slope_rise_time: float = tunable(
        1.0, "s", 0.1, 5.0, "`slope_time` where the foot shows more of a rise than estimated"
    )
    slope_share: float = tunable(
        0.3, "", 0.0, 1.0, "Share of the slope's error that the height of one foothold corrects"
    )
    foothold_share: float = tunable(
        0.5,
        "",
        0.0,
        1.0,
        "Share of a foothold's deviation from the slope that is the foothold's own",
    )
    hold_gain: float = tunable(
        0.4, "1/s", 0.0, 2.0, "Stepping in place: speed back to the place by distance; 0: drift"
    )
    hold_distance: float = tunable(
        0.05, "m", 0.01, 1.0, "Stepping in place: largest distance to the place that is held"
    )
    paper_kp_x: float = tunable(0.1, "rad/(m/s)", 0.0, 1.0, "The paper's law: sagittal Kp")
    paper_kd_x: float = tunable(0.4, "rad/(m/s)", 0.0, 1.0, "The paper's law: sagittal Kd")
    paper_kp_y: float = tunable(0.4, "rad/(m/s)", 0.0, 1.0, "The paper's law: lateral Kp")
    paper_kd_y: float = tunable(0.35, "rad/(m/s)", 0.0, 1.0, "The paper's law: lateral Kd")
    paper_offset: float = tunable(
        -0.01, "rad", -0.2, 0.2, "The paper's law: sagittal offset, to step in place"
    )
    paper_narrowing: float = tunable(
        0.1, "rad/(m/s)", 0.0, 0.3, "The paper's law: swing leg inward by forward speed"
    )
    heading_gain: float = tunable(0.5, "", 0.0, 2.0, "Swing hip yaw by heading error")
    yaw_limit: float = tunable(0.25, "rad", 0.0, 0.39, "Bound of swing hip yaw")
    bounce_damping: float = tunable(
        75.0, "Ns/m", 0.0, 300.0, "Force added to the carried weight by downward CoM velocity"
    )
    thigh_track: float = tunable(
        6.0, "Hz", 0.5, 30.0, "Bandwidth of the leg's track in the torso's set-points"
    )
    thigh_angle: float = tunable(
        0.5,
        "",
        0.0,
        1.0,
        "Share of the leg's tracked angle in the torso's angle set-points; 1 with late drives",
    )
    thigh_rate: float = tunable(
        0.25,
        "",
        0.0,
        1.0,
        "Share of the leg's tracked rate in the torso's rate set-points; 1 with late drives",
    )

    @property
    def as_in_paper(self) -> bool:
        """Whether walking follows the paper alone; all additions to it are left out."""
        return self.law == "paper"

    def in_force(self) -> WalkConfig:
        """The parameters that count: under the paper's law those of its omissions are 0."""
        if not self.as_in_paper:
            return self
        return replace(
            self, clearance=0.0, bounce_damping=0.0, thigh_angle=0.0, thigh_rate=0.0, slope_time=0.0
        )


@dataclass(frozen=True, kw_only=True)
class LearningConfig:
    """How feed-forward torques are learned from step to step."""

    gain: float = tunable(
        0.15, "", 0.0, 1.0, "Share of the drives' tracking torque that is learned per step"
    )
    leak: float = tunable(
        0.05, "", 0.0, 0.5, "Share forgotten per step; gain / (gain + leak) of the error is learned"
    )
    smoothing: float = tunable(
        0.2, "", 0.0, 1.0, "Low-pass along the phase at each step, 1 is (1/4, 1/2, 1/4)"
    )
    lead: float = tunable(
        0.012, "s", 0.0, 0.05, "How much earlier a torque acts than the error it is learned from"
    )
    limit: float = tunable(0.4, "", 0.0, 1.0, "Bound of learned torques over the drive's largest")


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """The gait controller."""

    learned_torques: str = tunable(
        "use",
        choices=("none", "use", "learn"),
        description="Torques learned over repeated steps: left out, added, or added and learned on",
    )
    learning: LearningConfig = field(default_factory=LearningConfig)

    walk: WalkConfig = field(default_factory=WalkConfig)
    stand: StandConfig = field(default_factory=StandConfig)
    segway: SegwayConfig = field(default_factory=SegwayConfig)
    transition: TransitionConfig = field(default_factory=TransitionConfig)
