"""Limits and conditions of the mode supervisor."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.tunables import ParameterError, tunable


@dataclass(frozen=True, kw_only=True)
class SupervisorConfig:
    """Which set-points are permitted, how fast they change, and when a mode may begin."""

    vx_forward: float = tunable(1.2, "m/s", 0.0, 2.4, "Largest speed forward")
    vx_backward: float = tunable(0.7, "m/s", 0.0, 1.5, "Largest speed backward")
    vy_limit: float = tunable(0.3, "m/s", 0.0, 0.6, "Largest speed sideways")
    yaw_rate_limit: float = tunable(0.8, "rad/s", 0.0, 1.5, "Largest turn rate")
    height_low: float = tunable(0.39, "m", 0.38, 0.9, "Lowest pelvis height")
    height_high: float = tunable(1.01, "m", 0.8, 1.05, "Largest pelvis height")
    com_x_limit: float = tunable(0.05, "m", 0.0, 0.07, "Largest CoM shift fore and aft")
    com_y_limit: float = tunable(0.06, "m", 0.0, 0.12, "Largest CoM shift sideways")
    tilt_limit: float = tunable(0.25, "rad", 0.0, 0.4, "Largest torso roll and pitch, with trims")
    trim_limit: float = tunable(0.1, "rad", 0.0, 0.2, "Largest trim")

    acceleration: float = tunable(0.3, "m/s^2", 0.05, 2.0, "Largest rate of the commanded speed")
    turn_acceleration: float = tunable(
        0.6, "rad/s^2", 0.05, 5.0, "Largest rate of the commanded turn rate"
    )
    height_rate: float = tunable(0.4, "m/s", 0.01, 1.0, "Largest rate of the commanded height")
    shift_rate: float = tunable(0.05, "m/s", 0.01, 0.5, "Largest rate of the commanded CoM shift")
    tilt_rate: float = tunable(0.2, "rad/s", 0.01, 1.0, "Largest rate of commanded tilt and trims")

    walk_roll: float = tunable(0.0, "rad", 0.0, 0.4, "Largest torso roll while walking")
    walk_pitch: float = tunable(0.2, "rad", 0.0, 0.4, "Largest torso pitch while walking")
    walk_trim: float = tunable(0.02, "rad", 0.0, 0.2, "Largest trim while walking")
    walk_height: float = tunable(0.95, "m", 0.8, 1.05, "Pelvis height at which walking begins")
    height_tolerance: float = tunable(
        0.03, "m", 0.005, 0.1, "Distance from `walk_height` within which walking begins"
    )
    stand_time: float = tunable(1.0, "s", 0.1, 10.0, "Time at rest before walking or riding begins")
    still_speed: float = tunable(0.06, "m/s", 0.01, 0.5, "CoM speed that counts as still")
    ride_forward: float = tunable(4.2, "m/s", 0.0, 4.5, "Largest speed forward on a Segway")
    ride_backward: float = tunable(1.0, "m/s", 0.0, 2.0, "Largest speed backward on a Segway")
    ride_yaw_rate: float = tunable(1.0, "rad/s", 0.0, 2.0, "Largest turn rate on a Segway")
    ride_acceleration: float = tunable(
        0.5, "m/s^2", 0.05, 2.0, "Largest rate of the speed commanded of a Segway"
    )
    ride_com_x: float = tunable(0.095, "m", 0.0, 0.1, "Largest CoM shift fore and aft on a Segway")
    ride_com_y: float = tunable(0.1, "m", 0.0, 0.12, "Largest CoM shift sideways on a Segway")
    ride_shift_rate: float = tunable(
        0.25, "m/s", 0.01, 0.5, "Largest rate of the CoM shift commanded on a Segway"
    )
    ride_height: float = tunable(0.67, "m", 0.5, 0.9, "Largest pelvis height on a Segway")
    ride_height_low: float = tunable(
        0.6,
        "m",
        0.4,
        0.9,
        "Lowest pelvis height on a Segway: the knees stay at the pads of the bar",
    )
    ride_height_rate: float = tunable(
        0.05, "m/s", 0.01, 1.0, "Largest rate of the height commanded on a Segway"
    )
    ride_tilt: float = tunable(
        0.03, "rad", 0.0, 0.4, "Largest torso roll and pitch on a Segway, with trims"
    )
    ride_stop_time: float = tunable(
        6.0, "s", 0.0, 60.0, "Time of braking before riding a Segway may end"
    )
    ride_confirm_time: float = tunable(
        2.0,
        "s",
        0.2,
        20.0,
        "Time within which the operator must ask for stand again to end riding",
    )
    weight_share: float = tunable(0.75, "", 0.1, 1.0, "Share of the weight the feet must carry")
    stop_speed: float = tunable(0.15, "m/s", 0.02, 0.5, "Mean speed below which walking may end")
    stop_time: float = tunable(1.2, "s", 0.2, 10.0, "Time of stepping in place before walking ends")
    fall_tilt: float = tunable(0.8, "rad", 0.3, 1.5, "Torso tilt that counts as a fall")
    fall_height: float = tunable(0.33, "m", 0.1, 0.6, "Pelvis height that counts as a fall")
    upright_tilt: float = tunable(
        0.3, "rad", 0.1, 0.8, "Torso tilt below which drives may do more than damp"
    )
    upright_time: float = tunable(1.0, "s", 0.1, 10.0, "Time upright that ends a fall")
    battery_low: float = tunable(0.2, "", 0.0, 1.0, "Battery charge below which there is a fault")
    battery_empty: float = tunable(
        0.1, "", 0.0, 1.0, "Battery charge below which the robot stops and sits down"
    )
    battery_margin: float = tunable(
        0.05, "", 0.0, 0.5, "Hysteresis of `battery_low` and `battery_empty`, upward"
    )
    missed_share: float = tunable(
        0.2, "", 0.0, 1.0, "Share of missed control ticks in a second from which the robot stops"
    )

    def __post_init__(self) -> None:
        """Check that bounds do not contradict each other.

        Raises:
            ParameterError: if two bounds contradict each other; the message names them.
        """
        for low, high in (
            ("height_low", "height_high"),
            ("height_low", "walk_height"),
            ("walk_height", "height_high"),
            ("ride_height_low", "ride_height"),
            ("battery_empty", "battery_low"),
            ("upright_tilt", "fall_tilt"),
        ):
            lower, upper = getattr(self, low), getattr(self, high)
            numbers = isinstance(lower, (int, float)) and isinstance(upper, (int, float))
            if numbers and lower > upper:  # another check names a value that is no number
                raise ParameterError(f"{low} = {lower:g} is above {high} = {upper:g}")
