"""The Segway's own balance control, hidden from the robot on it."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from cassie_gaits import robot
from cassie_sim.scene_parameters import Segway
from cassie_sim.segway import MASS, WHEEL_RADIUS
from cassie_sim.segway_ground import WAYS

PITCH_GAIN, PITCH_DAMPING = 700.0, 60.0
"""Gains of both motors together under a rider of 60 kg. In Nm/rad and Nms/rad."""

_TORQUE, _POWER, _NO_LOAD = 30.0, 400.0, 53.0  # limits of one motor: Nm, W, rad/s
_LAG = 0.01  # s, time constant of sensor filter and motors
_CREEP = 0.2  # rad/s of a wheel, scale at which rolling resistance saturates
_LIMITER = 15.0 / 3.6  # m/s from which the platform leans back
_LEAN_BACK = 0.08  # rad per m/s beyond `_LIMITER`
_STEERING = 15.0  # rad/s of yaw per rad of the bar, at rest
_YAW_GAIN = 25.0  # Nm per rad/s of yaw rate error, both wheels
_RATED = 60.0 * robot.GRAVITY  # N, a rider within the rated range of 40 to 100 kg
_HAND = (3000.0, 300.0, 600.0, 40.0)  # N/m, Ns/m, Nm/rad, Nms/rad of the person at the bar


class SegwayDrive:
    """The vehicle's own control, once per control tick.

    Both wheels:  T = (kp (pitch - lean) + kd pitch rate) (load / 60 kg)^(1/2) / softness,
        with load / 60 kg from 0.2 to 1.5,
    one against the other:  25 Nm per rad/s of (15 bar angle / (1 + speed / 2) - yaw rate),

    through a first-order lag of 10 ms, with the torque limit of a motor at its wheel's speed w:
    min(30 Nm, 400 W / w, 60 Nm (1 - w / 53 rad/s)). From 15 km/h on the platform leans back by
    0.08 rad for each m/s, which takes a rider's weight back near 16 km/h. A robot that holds its
    CoM ahead by its toe drives goes faster. The vehicle measures pitch and rates by its own IMU,
    speed by the wheels, and load by its pads.

    The maker publishes nothing about this control. Known facts: riders of 40 to 100 kg, 16 km/h
    held by leaning back, steering that reacts to small pushes of the knee (press reviews of 2016).
    kp, kd: a rider of 75 kg who leans out by 5 cm tilts the vehicle by 3 degrees; uncertain from
    half to double, which the scene's `softness` covers. Steering: 5 cm at the knees, 7 degrees,
    give 1.8 rad/s at rest; half to double. Lag: 5 to 20 ms.

    The ground's rolling resistance on the wheels is applied here, too.

    A person holds the vehicle by the bar until `let_go` of the scene, and from `take_hold` on.
    After a call of `hold_bar`, that call decides instead.

    Args:
        settings: Settings of the scene.
    """

    def __init__(self, settings: Segway) -> None:
        self._settings = settings
        weight = (MASS + robot.MASS) * robot.GRAVITY
        self._rolling = 0.5 * WAYS[settings.surface].rolling * weight * WHEEL_RADIUS
        self._reset()

    def _reset(self) -> None:
        self._last = 0.0
        self._place = (0.0, 0.0, 0.0)
        self._held = True
        self._told: bool | None = None
        self.torques = [0.0, 0.0]
        """Torques of the left and the right motor. In Nm."""

    def hold_bar(self, held: bool) -> None:
        """Have the bar held, or released, from now on in this episode."""
        self._told = held

    @staticmethod
    def speed(data: mujoco.MjData) -> float:
        """Speed over the ground. In m/s."""
        vx, vy = data.joint("segway").qvel[:2].tolist()
        return math.hypot(vx, vy)

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, time: float) -> None:
        """Set the motors' torques.

        Args:
            model, data: The world.
            time: Robot time. In s.
        """
        if time == 0.0:  # a new episode
            self._reset()
        period, self._last = time - self._last, time
        matrix = data.xmat[model.body("segway").id].reshape(3, 3) if time > 0.0 else np.eye(3)
        pitch = math.atan2(-matrix[2, 0], math.hypot(matrix[0, 0], matrix[1, 0]))
        dofs = model.joint("segway").dofadr[0]
        _, pitch_rate, yaw_rate = data.qvel[dofs + 3 : dofs + 6].tolist()
        wheels = [model.joint(f"segway_{name}_wheel").dofadr[0] for name in ("left", "right")]
        bodies = [model.body(f"segway_{name}_wheel").id for name in ("left", "right")]
        turning = [float(data.qvel[dof]) for dof in wheels]
        speed = WHEEL_RADIUS * (0.5 * sum(turning) + pitch_rate)
        load = self._load(model, data)
        self._hold(data, dofs, pitch, math.atan2(matrix[1, 0], matrix[0, 0]), time)
        gain = math.sqrt(max(0.2, min(1.5, load / _RATED))) / self._settings.softness
        lean = -_LEAN_BACK * max(0.0, speed - _LIMITER)
        both = gain * (PITCH_GAIN * (pitch - lean) + PITCH_DAMPING * pitch_rate)
        bar = float(data.joint("segway_bar").qpos[0])
        differ = _YAW_GAIN * (_STEERING * bar / (1.0 + 0.5 * abs(speed)) - yaw_rate)
        share = 1.0 - math.exp(-period / _LAG)
        for i, sign in ((0, -1.0), (1, 1.0)):
            self.torques[i] += share * (0.5 * (both + sign * differ) - self.torques[i])
            most = strongest(abs(turning[i]))
            self.torques[i] = max(-most, min(most, self.torques[i]))
            data.qfrc_applied[wheels[i]] = self.torques[i]
            # The ground's torque on the tyre is external; the motors' torques act between bodies.
            resists = self._rolling * math.tanh((turning[i] + pitch_rate) / _CREEP)
            data.xfrc_applied[bodies[i], 3:] = -resists * matrix[:, 1]

    def _hold(
        self, data: mujoco.MjData, dofs: int, pitch: float, heading: float, time: float
    ) -> None:
        """Apply the force of a person who holds the bar at the place where it was taken."""
        force = data.qfrc_applied[dofs : dofs + 6]
        force[:] = 0.0
        x, y = data.joint("segway").qpos[:2].tolist()
        held = not self._settings.let_go <= time < self._settings.take_hold
        if self._told is not None:
            held = self._told
        if held and not self._held:
            self._place = (x, y, heading)
        self._held = held
        if not held:
            return
        velocity, rates = data.qvel[dofs : dofs + 3], data.qvel[dofs + 3 : dofs + 6]
        stiff, damp, turn, turn_damp = _HAND
        force[0] = -stiff * (x - self._place[0]) - damp * velocity[0]
        force[1] = -stiff * (y - self._place[1]) - damp * velocity[1]
        force[4] = -turn * pitch - turn_damp * rates[1]
        force[5] = -turn * (heading - self._place[2]) - turn_damp * rates[2]

    @staticmethod
    def _load(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Normal force on the platform. In N."""
        platform, wrench, total = model.geom("segway_platform").id, np.zeros(6), 0.0
        for index in range(data.ncon):
            if platform in data.contact[index].geom:
                mujoco.mj_contactForce(model, data, index, wrench)
                total += float(wrench[0])
        return total


def strongest(turning: float) -> float:
    """Largest torque of one motor, in Nm, at a speed of its wheel, in rad/s."""
    return max(
        0.0, min(_TORQUE, _POWER / max(1.0, turning), 2.0 * _TORQUE * (1.0 - turning / _NO_LOAD))
    )
