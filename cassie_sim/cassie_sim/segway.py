"""A Segway miniPRO under the robot: two wheels, platform, steering bar, and its own control.

Its figures, and where they come from:

| figure | value | source |
|---|---|---|
| mass | 12.8 kg | data sheet of the maker; wheels with hub motors 2.9 kg each are an estimate |
| tyres | 10.5 in | data sheet; radius 0.13 m under load |
| width, length | 0.548 m, 0.262 m | data sheet; the wheels' middles are 0.485 m apart |
| motors | 2 x 400 W | data sheet; 30 Nm each is what 100 kg on a slope of 15 degrees asks for |
| speed | 16 km/h | data sheet; the limiter leans the platform back from 15 km/h on |
| bar | to the knees | data sheet: 0.595 m at its shortest; its pivot's stiffness is an estimate |
| balance control | pitch PD | unknown to its riders; the gains hold a rider of 40 to 100 kg |

The balance control is hidden from the robot: nothing of it is on the control lane.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from cassie_gaits import robot
from cassie_sim.ground import GROUND_GROUP
from cassie_sim.robot_mjcf import as_field
from cassie_sim.scene_parameters import Segway

MASS = 12.8
"""Of the whole vehicle. In kg."""

WHEEL_RADIUS = 0.13
"""Of a tyre under load. In m."""

PLATFORM = WHEEL_RADIUS + 0.015
"""Height of the upper face of the platform. In m."""

AHEAD = 0.0
"""Where the axle is at the start, ahead of the pelvis of the hanging robot. In m."""

TOP_SPEED = 16.0 / 3.6
"""In m/s."""

_WHEEL_MASS, _BAR_MASS = 2.9, 0.8
_TRACK = 0.485
_TORQUE = 30.0  # Nm of one motor at low speed
_POWER = 400.0  # W of one motor
_BAR_STIFFNESS, _BAR_DAMPING = 60.0, 3.0  # Nm/rad, Nms/rad
_BAR_HEIGHT, _BAR_RADIUS = 0.42, 0.05  # of the knee pads' middle above the axle, in m
_LIMITER = 15.0 / 3.6  # m/s from which the platform leans back
_STEERING = 6.0  # rad/s of yaw by rad of the bar
_YAW_GAIN = 25.0  # Nm by rad/s of yaw rate error, both wheels
_PITCH_GAIN = 700.0  # Nm/rad under a rider of rated weight
_PITCH_DAMPING = 60.0  # Nms/rad
_RATED = 60.0 * 9.81  # N, a rider in the middle of the rated range
_HELD_UNTIL = 0.8 * robot.total_mass() * 9.81  # N on the platform for a second
_HAND = (3000.0, 300.0, 600.0, 40.0)  # N/m, Ns/m, Nm/rad, Nms/rad of who holds it till then


def add_segway(spec: mujoco.MjSpec) -> None:
    """Put the vehicle at the origin, upright on level ground."""
    chassis = spec.worldbody.add_body(name="segway", pos=[AHEAD, 0.0, WHEEL_RADIUS])
    chassis.add_freejoint(name="segway")
    mass = MASS - 2.0 * _WHEEL_MASS - _BAR_MASS
    platform = chassis.add_geom(
        name="segway_platform",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.13, 0.21, 0.015],
        mass=mass,
        contype=1,
        conaffinity=14,
        rgba=[0.15, 0.15, 0.17, 1.0],
    )
    platform.group = GROUND_GROUP
    platform.priority = 1
    platform.friction = [1.0, 0.005, 0.0001]
    platform.condim = 3
    platform.solref = [0.006, 1.0]
    for side, name in ((1.0, "left"), (-1.0, "right")):
        wheel = chassis.add_body(name=f"segway_{name}_wheel", pos=[0.0, side * 0.5 * _TRACK, 0.0])
        wheel.add_joint(
            name=f"segway_{name}_wheel", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0]
        )
        wheel.add_geom(
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=[WHEEL_RADIUS, 0.03, WHEEL_RADIUS],
            mass=_WHEEL_MASS,
            contype=8,
            conaffinity=1,
            condim=3,
            rgba=[0.05, 0.05, 0.05, 1.0],
        )
    bar = chassis.add_body(name="segway_bar", pos=[0.08, 0.0, 0.0])
    pivot = bar.add_joint(
        name="segway_bar", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[-1.0, 0.0, 0.0]
    )
    pivot.stiffness = as_field(pivot.stiffness, _BAR_STIFFNESS)
    pivot.damping = as_field(pivot.damping, _BAR_DAMPING)
    bar.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[0.015, 0.0, 0.0],
        fromto=[0.0, 0.0, 0.0, 0.0, 0.0, _BAR_HEIGHT],
        mass=_BAR_MASS,
        contype=0,
        conaffinity=0,
        rgba=[0.2, 0.2, 0.22, 1.0],
    )
    bar.add_geom(
        name="segway_knee_pads",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[_BAR_RADIUS, 0.0, 0.0],
        fromto=[-0.06, 0.0, _BAR_HEIGHT, 0.06, 0.0, _BAR_HEIGHT],
        mass=0.0,
        contype=0,
        conaffinity=6,
        friction=[0.3, 0.005, 0.0001],
        rgba=[0.1, 0.1, 0.1, 1.0],
    )


class SegwayDrive:
    """The vehicle's own control, once a control tick.

    Both wheels:  T = kp (pitch - lean) + kd pitch rate,   kp = 700 Nm/rad (load / 60 kg)^(1/2) / s
    one against the other:  25 Nm per rad/s of (6 bar angle - yaw rate) / (1 + speed),

    with s the softness of the scene, and no more than the motors have at the wheels' speed. From
    15 km/h on it leans back, 0.08 rad by m/s. The operator holds it by the bar until the robot has
    stood on it for a second.

    Args:
        settings: Of the scene.
    """

    def __init__(self, settings: Segway) -> None:
        self._softness = settings.softness
        self._stood = 0.0
        self._last = 0.0

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, time: float) -> None:
        """Set the motors' torques."""
        if time == 0.0:  # a new episode
            self._stood = self._last = 0.0
        body = model.body("segway").id
        matrix = data.xmat[body].reshape(3, 3) if time > 0.0 else np.eye(3)
        pitch = math.atan2(-matrix[2, 0], math.hypot(matrix[0, 0], matrix[1, 0]))
        dofs = model.joint("segway").dofadr[0]
        velocity, rates = data.qvel[dofs : dofs + 3], data.qvel[dofs + 3 : dofs + 6]
        heading = math.atan2(matrix[1, 0], matrix[0, 0])
        speed = math.cos(heading) * velocity[0] + math.sin(heading) * velocity[1]
        load = self._load(model, data)
        if load > _HELD_UNTIL:
            self._stood += time - self._last
        self._last = time
        self._hold(data, dofs, pitch, heading)
        gain = _PITCH_GAIN * math.sqrt(max(0.2, min(1.5, load / _RATED))) / self._softness
        lean = -0.08 * max(0.0, speed - _LIMITER)
        both = gain * (pitch - lean) + _PITCH_DAMPING * rates[1]
        bar = float(data.joint("segway_bar").qpos[0])
        turn = _STEERING * -bar / (1.0 + abs(speed))
        differ = _YAW_GAIN * (turn - rates[2])
        for sign, name in ((-1.0, "left"), (1.0, "right")):
            dof = model.joint(f"segway_{name}_wheel").dofadr[0]
            torque = 0.5 * (both + sign * differ)
            most = min(_TORQUE, _POWER / max(1.0, abs(float(data.qvel[dof]))))
            torque = max(-most, min(most, torque))
            data.qfrc_applied[dof] = torque

    def let_go(self) -> None:
        """End the operator's hold on the bar."""
        self._stood = 1.0

    def _hold(self, data: mujoco.MjData, dofs: int, pitch: float, heading: float) -> None:
        """The operator holds the bar until the robot stands on the platform."""
        force = data.qfrc_applied[dofs : dofs + 6]
        force[:] = 0.0
        if self._stood >= 1.0:
            return
        velocity, rates = data.qvel[dofs : dofs + 3], data.qvel[dofs + 3 : dofs + 6]
        x, y = data.joint("segway").qpos[:2]
        stiff, damp, turn, turn_damp = _HAND
        force[0] = -stiff * (x - AHEAD) - damp * velocity[0]
        force[1] = -stiff * y - damp * velocity[1]
        force[4] = -turn * pitch - turn_damp * rates[1]
        force[5] = -turn * heading - turn_damp * rates[2]

    @staticmethod
    def _load(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Force of whatever stands on the platform. In N."""
        platform, wrench, total = model.geom("segway_platform").id, np.zeros(6), 0.0
        for index in range(data.ncon):
            if platform in data.contact[index].geom:
                mujoco.mj_contactForce(model, data, index, wrench)
                total += float(wrench[0])
        return total
