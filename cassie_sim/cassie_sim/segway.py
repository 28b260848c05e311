"""A Segway miniPRO under the robot: two wheels, platform, steering bar.

Its data, their sources, and their uncertainty:

| figure | value | source, uncertainty |
|---|---|---|
| mass | 12.8 kg | as the maker gives it (28 lb); the data sheet itself was not available |
| hub motors | 2.9 kg each | estimate for 10 in hub wheels with tyre, 0.5 kg either way |
| tyres | 10.5 in, radius 0.13 m under load | as given: 0.1334 m unloaded; 2 to 5 mm deflection |
| track | 0.485 m | width of 0.546 m as given, less a tyre's width (2.1 to 2.5 in) |
| platform | 0.015 m above the axle | photographs; 10 mm either way |
| inertia | box of 0.26 x 0.42 x 0.09 m | length as given; 30 % |
| power | 400 W each | as given: 800 W in all |
| torque | 30 Nm each | 100 kg on its rated slope of 15 degrees need 19 Nm; 20 to 40 Nm |
| no-load speed | 53 rad/s | it rolls backward at 25 km/h (electricunicycle.org, topic 7293) |
| bar | pads 0.42 m above the axle | 0.6 to 0.87 m in all as given, set to the knees |
| steering | by the knees, at a centre arm | teardown of fictiv.com; Boston Globe, 29 June 2016 |
| limiter | forward only | Boston Globe; electricunicycle.org, topic 7293 |
| pivot | 60 Nm/rad, 3 Nms/rad | estimate: some 30 N at the pads for 12 degrees; half to double |
| pads | 0.19 m apart | set to Cassie's legs, as to any rider's |
| rolling resistance | 0.015 | engineeringtoolbox.com: 0.01 to 0.02; see `segway_ground` |
| air | none | 3 N at 4 m/s, less than the uncertainty of the rolling resistance |

`segway_drive` has the vehicle's own control, which is hidden from the robot: none of its signals is
on the control lane. These data are fixed: the robot is tuned to them, they are not tuned to the
robot.
"""

from __future__ import annotations

import mujoco

from cassie_sim.ground import GROUND_GROUP, HARDER_FRICTION
from cassie_sim.robot_mjcf import as_field

MASS = 12.8
"""Mass of the whole vehicle. In kg."""

WHEEL_RADIUS = 0.13
"""Radius of a tyre under load. In m."""

PLATFORM = WHEEL_RADIUS + 0.015
"""Height of the upper face of the platform. In m."""

TRACK = 0.485
"""Distance of the wheels. In m."""

_WHEEL_MASS, _BAR_MASS = 2.9, 0.8  # kg
_BAR_STIFFNESS, _BAR_DAMPING = 60.0, 3.0  # Nm/rad, Nms/rad
_BAR_HEIGHT, _BAR_RANGE = 0.42, 0.35  # knee pads' middle above the axle, in m; in rad
_PADS, _PAD_RADIUS = 0.095, 0.02  # outer half width and radius, in m
_RED, _DARK = (0.75, 0.1, 0.1, 1.0), (0.12, 0.12, 0.13, 1.0)


def add_segway(spec: mujoco.MjSpec) -> None:
    """Put the vehicle at the origin, upright on level ground."""
    spec.option.impratio = HARDER_FRICTION
    chassis = spec.worldbody.add_body(name="segway", pos=[0.0, 0.0, WHEEL_RADIUS])
    chassis.add_freejoint(name="segway")
    chassis.add_site(name="segway_imu", size=[0.01, 0.01, 0.01])
    _add_platform(chassis)
    for side, name in ((1.0, "left"), (-1.0, "right")):
        _add_wheel(chassis, name, side)
    _add_bar(chassis)
    for name, kind in (
        ("segway_gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("segway_accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
    ):
        spec.add_sensor(
            name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="segway_imu"
        )


def _add_platform(chassis: mujoco.MjsBody) -> None:
    platform = chassis.add_geom(
        name="segway_platform",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.13, 0.21, 0.045],
        pos=[0.0, 0.0, PLATFORM - WHEEL_RADIUS - 0.045],
        mass=MASS - 2.0 * _WHEEL_MASS - _BAR_MASS,
        contype=1,
        conaffinity=14,
        rgba=_DARK,
    )
    platform.group = GROUND_GROUP
    platform.priority = 1
    platform.friction = [1.0, 0.005, 0.0001]
    platform.condim = 3
    platform.solref = [0.006, 1.0]


def _add_wheel(chassis: mujoco.MjsBody, name: str, side: float) -> None:
    wheel = chassis.add_body(name=f"segway_{name}_wheel", pos=[0.0, side * 0.5 * TRACK, 0.0])
    wheel.add_joint(
        name=f"segway_{name}_wheel", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0]
    )
    wheel.add_geom(
        name=f"segway_{name}_tyre",
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=[WHEEL_RADIUS, 0.03, WHEEL_RADIUS],
        mass=_WHEEL_MASS,
        contype=8,
        conaffinity=1,
        condim=3,
        rgba=(0.05, 0.05, 0.05, 1.0),
    )
    wheel.add_geom(  # makes the rotation visible
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.085, 0.0315, 0.012],
        mass=0.0,
        contype=0,
        conaffinity=0,
        rgba=(0.75, 0.76, 0.78, 1.0),
    )


def _add_bar(chassis: mujoco.MjsBody) -> None:
    bar = chassis.add_body(name="segway_bar", pos=[0.08, 0.0, 0.0])
    pivot = bar.add_joint(
        name="segway_bar", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[-1.0, 0.0, 0.0]
    )
    pivot.stiffness = as_field(pivot.stiffness, _BAR_STIFFNESS)
    pivot.damping = as_field(pivot.damping, _BAR_DAMPING)
    pivot.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    pivot.range = [-_BAR_RANGE, _BAR_RANGE]
    bar.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[0.015, 0.0, 0.0],
        fromto=[0.0, 0.0, 0.0, 0.0, 0.0, _BAR_HEIGHT],
        mass=_BAR_MASS,
        contype=0,
        conaffinity=0,
        rgba=_RED,
    )
    for side in (1.0, -1.0):
        bar.add_geom(
            name=f"segway_{'left' if side > 0.0 else 'right'}_pad",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[_PAD_RADIUS, 0.0, 0.0],
            fromto=[
                *(-0.12, side * (_PADS - _PAD_RADIUS), _BAR_HEIGHT),
                *(0.12, side * (_PADS - _PAD_RADIUS), _BAR_HEIGHT),
            ],
            mass=0.0,
            contype=0,
            conaffinity=6,
            friction=[0.3, 0.005, 0.0001],
            rgba=_DARK,
        )
