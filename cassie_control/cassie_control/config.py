"""Everything that can be tuned in the controller: one field each, with unit, range and meaning."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from cassie_msgs.tunables import names, tunable


@dataclass(frozen=True, kw_only=True)
class TransitionConfig:
    """Between standing and walking."""

    lean_time: float = tunable(0.5, "s", 0.1, 2.0, "Lean before the first step")
    lean_roll: float = tunable(0.18, "rad", 0.0, 0.2, "Roll to the left of the lean onto one foot")
    stop_spread: float = tunable(
        0.03, "m", 0.0, 0.1, "How much farther out each foot lands before walking ends"
    )
    stop_first: float = tunable(2.0, "", 0.0, 10.0, "Steps with wider feet before walking may end")
    stop_vx: float = tunable(
        0.2, "m/s", 0.05, 1.0, "Largest CoM velocity fore or aft at the touchdown that ends walking"
    )
    stop_vy: float = tunable(
        0.35, "m/s", 0.05, 1.0, "Largest CoM velocity sideways at the touchdown that ends walking"
    )
    stop_steps: float = tunable(10.0, "", 1.0, 100.0, "Touchdowns after which walking ends anyway")
    recovery_step: bool = tunable(
        True, description="Step without being told when standing cannot hold a push"
    )
    recovery_x: float = tunable(
        0.035,
        "m",
        0.01,
        0.3,
        "Capture point ahead of the toes or behind the heels that asks for a recovery step",
    )
    recovery_y: float = tunable(
        0.03, "m", 0.01, 0.3, "Capture point outside the feet that asks for a recovery step"
    )
    recovery_height: float = tunable(
        0.8, "m", 0.4, 1.05, "Pelvis height below which it takes no recovery step"
    )
    recovery_lift: float = tunable(
        0.05, "m", 0.0, 0.15, "How much more the foot is lifted at the first recovery step"
    )
    recovery_steps: float = tunable(3.0, "", 1.0, 20.0, "Recovery steps before it stands again")
    blend_time: float = tunable(0.12, "s", 0.0, 2.0, "Blend of set-points after a change of mode")


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
    kd_toe: float = tunable(2.0, "Nms/rad", 0.0, 50.0, "Toe damping")
    roll_length: float = tunable(
        1.0, "m/rad", 0.0, 10.0, "Leg length difference by torso roll error"
    )
    roll_rate_length: float = tunable(
        0.03, "ms/rad", 0.0, 2.0, "Leg length difference by torso roll rate"
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
    height_integral: float = tunable(2.5, "1/s", 0.0, 10.0, "Leg length by height error, summed")
    height_damping: float = tunable(
        0.05, "s", 0.0, 0.3, "Leg length by vertical speed, against the bounce of the springs"
    )
    rise: float = tunable(
        0.13, "m", 0.0, 0.2, "How far the legs push up when a push brings it to the edge"
    )
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


@dataclass(frozen=True, kw_only=True)
class SegwayConfig:
    """Riding a Segway: what differs from standing there, and what keeps speed and heading."""

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
        80.0, "Nm", 0.0, 200.0, "Bound of the torque that bends the torso to the side"
    )
    roll_give: float = tunable(
        0.3, "", 0.0, 1.0, "What is left of the hip roll stiffness when it has given way"
    )
    roll_rate_length: float = tunable(
        0.1, "ms/rad", 0.0, 2.0, "Leg length difference by torso roll rate"
    )
    lean_length: float = tunable(
        0.3, "m/rad", 0.0, 1.0, "Leg length difference by the roll that is wanted"
    )
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
    corner: float = tunable(
        0.1, "m", 0.03, 0.3, "CoM back and to a side together: shins and bar are in the way"
    )
    top_speed: float = tunable(
        5.5, "m/s", 0.0, 10.0, "Speed, as it estimates it, beyond which no lean adds"
    )
    back_speed: float = tunable(
        1.0, "m/s", 0.0, 5.0, "Speed backward, as it estimates it, beyond which no lean adds"
    )

    def standing(self, stand: StandConfig) -> StandConfig:
        """Gains of standing with those of the same name that riding has.

        A platform always moves: gains do not change as the robot settles, and no legs push up.
        """
        own = {name: getattr(self, name) for name in names(StandConfig) if hasattr(self, name)}
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
    """Position and velocity gains of one leg's drives while walking."""

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
    """What it goes over to where the drives act late on commands, see `control.latency`."""

    walking_from: float = tunable(0.01, "s", 0.0, 0.1, "Latency at which walking begins to go over")
    standing_from: float = tunable(
        0.02, "s", 0.0, 0.1, "Latency at which standing begins to go over"
    )
    latency_span: float = tunable(
        0.006, "s", 0.001, 0.1, "Further latency until walking or standing has gone over"
    )
    handover: float = tunable(
        0.06, "s", 0.01, 0.2, "Time in which the weight goes from leg to leg, by the phase"
    )
    thigh_track: float = tunable(9.0, "Hz", 0.5, 30.0, "`walk.thigh_track` with late drives")
    roll_length: float = tunable(0.3, "m/rad", 0.0, 10.0, "`stand.roll_length` with late drives")
    roll_rate_length: float = tunable(
        0.06, "ms/rad", 0.0, 2.0, "`stand.roll_rate_length` with late drives"
    )

    def walking_share(self, latency: float) -> float:
        """How far walking has gone over to these at a latency (s), 0..1."""
        return min(1.0, max(0.0, (latency - self.walking_from) / self.latency_span))

    def standing(self, gains: StandConfig, latency: float) -> StandConfig:
        """Gains of standing at a latency (s)."""
        share = min(1.0, max(0.0, (latency - self.standing_from) / self.latency_span))
        return replace(
            gains,
            roll_length=gains.roll_length + share * (self.roll_length - gains.roll_length),
            roll_rate_length=gains.roll_rate_length
            + share * (self.roll_rate_length - gains.roll_rate_length),
        )


@dataclass(frozen=True, kw_only=True)
class WalkConfig:
    """Walking: torso, steps and leg-angle adjustment."""

    joints: JointGains = field(default_factory=JointGains)
    kp_torso_pitch: float = tunable(
        285.0, "Nm/rad", 0.0, 2000.0, "Torso pitch through the stance hip"
    )
    kd_torso_pitch: float = tunable(
        13.5, "Nms/rad", 0.0, 200.0, "Damping of torso pitch through the stance hip"
    )
    kp_torso_roll: float = tunable(
        446.0, "Nm/rad", 0.0, 2000.0, "Torso roll through the stance hip"
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
    earliest_touchdown: float = tunable(0.5, "", 0.1, 0.95, "Phase before which no step ends")
    latest_touchdown: float = tunable(1.5, "", 1.0, 2.0, "Phase at which a step ends anyway")
    quickest_step: float = tunable(
        0.26, "s", 0.15, 0.6, "Duration of the quickest step, to catch a fall"
    )
    slowest_step: float = tunable(
        1.2, "", 1.0, 2.0, "Duration of the slowest step, to catch a fall, over the gait's own"
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
        "How much higher than the gait's the foot swings in the middle of a step",
    )
    landing_depth: float = tunable(
        0.035, "m", -0.02, 0.1, "How far below the ground the swing foot aims, to take load at once"
    )
    late_reach: float = tunable(
        0.12, "m", 0.0, 0.2, "How far the swing leg grows while the ground is late"
    )
    late_speed: float = tunable(
        1.0, "m/s", 0.05, 2.0, "How fast the swing leg grows while the ground is late"
    )
    level_back: float = tunable(
        0.5, "", 0.0, 1.0, "Walking backward: from the gait's leg length, 0, to a level hip, 1"
    )
    foot_spread: float = tunable(
        0.01, "m", -0.05, 0.1, "How far each foot lands outside its hip when walking in place"
    )
    friction: float = tunable(
        0.2,
        "",
        0.05,
        2.0,
        "Friction cone that every ground bears; a step to a foot outside of it is made quicker",
    )
    least_foot_distance: float = tunable(
        0.12, "m", 0.05, 0.3, "Sideways distance of the feet that no step goes below"
    )
    speed_filter: float = tunable(
        0.64, "Hz", 0.05, 10.0, "Cut-off of the velocity that reads the gait library"
    )
    double_support: float = tunable(
        0.07, "s", 0.0, 0.2, "Time in which the weight goes over to the new foot"
    )
    contact_lead: float = tunable(
        0.04, "s", 0.0, 0.1, "From the swing foot's first contact to the end of the step"
    )
    contact_lead_speed: float = tunable(
        0.03,
        "s/(m/s)",
        0.0,
        0.1,
        "Increase of `contact_lead` with speed fore or aft, up to 1.5 m/s",
    )
    map_gain_x: float = tunable(
        0.97, "", 0.5, 1.5, "a / b of the step-to-step map in place ahead, by the pendulum's"
    )
    map_gain_y: float = tunable(
        1.1, "", 0.5, 1.5, "a / b of the step-to-step map in place sideways, by the pendulum's"
    )
    map_loss_x: float = tunable(
        0.5, "s/m", 0.0, 2.0, "By how much a / b ahead falls with the velocity at touchdown"
    )
    map_loss_y: float = tunable(
        0.17, "s/m", 0.0, 2.0, "By how much a / b sideways falls with the velocity ahead"
    )
    observer_gain: float = tunable(
        0.045, "m/(m/s)", 0.0, 0.2, "Disturbance observer: foot offset by a step's speed error"
    )
    observer_error: float = tunable(
        0.05,
        "m/s",
        0.0,
        0.5,
        "Disturbance observer: speed error of a step by which it grows at most",
    )
    slope_time: float = tunable(
        0.3, "s", 0.0, 5.0, "In which the ground's slope ahead follows the stance foot; 0: level"
    )
    slope_rise_time: float = tunable(
        1.0, "s", 0.1, 5.0, "`slope_time` where the foot finds more of a rise than was believed"
    )
    slope_share: float = tunable(
        0.3, "", 0.0, 1.0, "Share of the slope's error that the height of one foothold corrects"
    )
    foothold_share: float = tunable(
        0.5,
        "",
        0.0,
        1.0,
        "Share of a foothold's height off the slope that is its own, not the ground's around it",
    )
    hold_gain: float = tunable(
        0.4, "1/s", 0.0, 2.0, "Speed back to the place where it steps, by distance; 0 lets it drift"
    )
    hold_distance: float = tunable(
        0.05, "m", 0.01, 1.0, "Distance at which what pushes it takes the place along"
    )
    paper_kp_x: float = tunable(0.1, "rad/(m/s)", 0.0, 1.0, "The paper's law: sagittal Kp")
    paper_kd_x: float = tunable(0.4, "rad/(m/s)", 0.0, 1.0, "The paper's law: sagittal Kd")
    paper_kp_y: float = tunable(0.4, "rad/(m/s)", 0.0, 1.0, "The paper's law: lateral Kp")
    paper_kd_y: float = tunable(0.35, "rad/(m/s)", 0.0, 1.0, "The paper's law: lateral Kd")
    paper_offset: float = tunable(
        -0.01, "rad", -0.2, 0.2, "The paper's law: sagittal offset, so that it steps in place"
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
        6.0, "Hz", 0.5, 30.0, "Bandwidth at which the torso's set-points follow the leg"
    )
    thigh_angle: float = tunable(
        0.5,
        "",
        0.0,
        1.0,
        "Share of the followed leg in the torso's angle set-points; all of it with late drives",
    )
    thigh_rate: float = tunable(
        0.25,
        "",
        0.0,
        1.0,
        "Share of the followed leg in the torso's rate set-points; all of it with late drives",
    )

    @property
    def as_in_paper(self) -> bool:
        """Whether walking has only what the paper has; all additions to it are left out."""
        return self.law == "paper"


@dataclass(frozen=True, kw_only=True)
class LearningConfig:
    """How feed-forward torques are learned from step to step."""

    gain: float = tunable(
        0.15, "", 0.0, 1.0, "Share of the drives' own tracking torque that a step adds"
    )
    leak: float = tunable(
        0.05, "", 0.0, 0.5, "Share that a step forgets: gain / (gain + leak) of the error goes"
    )
    smoothing: float = tunable(
        0.2, "", 0.0, 1.0, "Low-pass along the phase at each step, 1 is (1/4, 1/2, 1/4)"
    )
    lead: float = tunable(
        0.012, "s", 0.0, 0.05, "How much earlier a torque acts than the error it is learned from"
    )
    limit: float = tunable(0.4, "", 0.0, 1.0, "Bound of learned torques, by the drive's largest")


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
