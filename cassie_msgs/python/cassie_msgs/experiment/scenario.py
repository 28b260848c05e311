"""What an experiment fixes about the plant: scene, start, events, delays and the robot drawn.

A seed draws one robot out of many (`Draw.from_seed`). The drawn values stand in the scenario,
so that nothing is drawn twice and a recording tells which robot it was.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_msgs.structured import refuse_unknown, structure, structure_fields
from cassie_msgs.tunables import ParameterError, tunable

STARTS = ("gantry", "standing")
_ACTIONS = {"height": "lower", "release": "release", "hold": "hold"}
"""Action of a move by the key that people write."""

FAULT_KINDS = ("off", "stuck", "nan", "spike", "delay")

Pair = tuple[float, float]
Vector = tuple[float, float, float]
PerDrive = tuple[float, float, float, float, float, float, float, float, float, float]

_NO3 = (0.0, 0.0, 0.0)
_ZERO10 = (0.0,) * 10
_ONE10 = (1.0,) * 10


@dataclass(frozen=True, kw_only=True)
class Draw:
    """The robot that a seed stands for."""

    initial_yaw: float = tunable(0.0, "rad", -math.pi, math.pi, "Heading at the start")
    joint_offset: PerDrive = tunable(_ZERO10, "rad", -0.2, 0.2, "Offset of each drive at the start")
    torque_constant: PerDrive = tunable(
        _ONE10, "", 0.5, 1.5, "Real to nominal torque of each drive"
    )
    mass: float = tunable(1.0, "", 0.5, 1.5, "Real to nominal mass of every link")
    friction: float = tunable(1.0, "", 0.1, 2.0, "Real to nominal friction of the ground")
    attitude_bias: Pair = tunable(
        (0.0, 0.0), "rad", -0.1, 0.1, "Constant roll and pitch error of the IMU"
    )
    gyro_bias: Vector = tunable(_NO3, "rad/s", -0.1, 0.1, "Constant gyro error")
    accelerometer_bias: Vector = tunable(_NO3, "m/s^2", -1.0, 1.0, "Constant accelerometer error")
    yaw_drift: float = tunable(0.0, "rad/s", -0.01, 0.01, "Drift of the IMU's heading")
    sensor_seed: int = tunable(0, "", 0, None, "Seed of the sensor noise")

    @staticmethod
    def from_seed(seed: int) -> Draw:
        """One robot out of many.

        Initial yaw and joints within 2 degrees, torque constants 3 %, mass 2 %, friction 10 %
        (uniform); errors of attitude normal, as those of the IMU in cassie_sim.
        """
        rng = np.random.default_rng(seed)
        two_degrees = math.radians(2.0)
        gyro = math.radians(10.0) / 3600.0
        milli_g = 9.81e-3
        return Draw(
            initial_yaw=float(rng.uniform(-two_degrees, two_degrees)),
            joint_offset=_floats(rng.uniform(-two_degrees, two_degrees, 10)),
            torque_constant=_floats(rng.uniform(0.97, 1.03, 10)),
            mass=float(rng.uniform(0.98, 1.02)),
            friction=float(rng.uniform(0.9, 1.1)),
            attitude_bias=_floats(rng.normal(0.0, math.radians(0.3), 2).clip(-0.02, 0.02)),
            gyro_bias=_floats(rng.uniform(-gyro, gyro, 3)),
            accelerometer_bias=_floats(rng.uniform(-0.04 * milli_g, 0.04 * milli_g, 3)),
            yaw_drift=float(rng.uniform(-gyro, gyro)),
            sensor_seed=int(rng.integers(2**31)),
        )


def _floats(array: npt.NDArray[np.float64]) -> Any:
    return tuple(array.tolist())


@dataclass(frozen=True, kw_only=True)
class Delays:
    """Delays beyond those of the drives."""

    torque: float = tunable(0.0, "s", 0.0, 0.1, "From a set torque to its effect, beyond 3 ms")
    set_point: float = tunable(0.0, "s", 0.0, 0.2, "From a motor command to the drives")


@dataclass(frozen=True, kw_only=True)
class ModelScale:
    """Factors on the model, on top of what a seed draws."""

    mass: float = tunable(1.0, "", 0.5, 2.0, "Mass and inertia of every link")
    spring: float = tunable(1.0, "", 0.2, 5.0, "Stiffness of shin and heel springs")
    friction: float = tunable(1.0, "", 0.05, 3.0, "Friction of the ground")
    damping: float = tunable(1.0, "", 0.0, 10.0, "Viscous friction of the joints")
    armature: float = tunable(1.0, "", 0.2, 5.0, "Reflected inertia of the drives")
    torque: float = tunable(1.0, "", 0.3, 2.0, "Torque constants of the drives")


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A load fixed to the pelvis, of which the controller is not told."""

    mass: float = tunable(0.0, "kg", 0.0, 30.0, "Mass of the load; 0: there is none")
    x: float = tunable(0.0, "m", -0.3, 0.3, "Its centre ahead of the pelvis's centre of mass")
    y: float = tunable(0.0, "m", -0.3, 0.3, "Its centre left of the pelvis's centre of mass")
    z: float = tunable(0.1, "m", -0.3, 0.5, "Its centre above the pelvis's centre of mass")


@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force for a while."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "When it begins")
    duration: float = tunable(0.1, "s", 0.0005, 100.0, "How long it lasts")
    force: Vector = tunable(dataclasses.MISSING, "N", -5000.0, 5000.0, "In world axes")
    body: str = tunable("pelvis", description="Name of the body")


@dataclass(frozen=True, kw_only=True)
class GantryMove:
    """One order to the gantry: hold at a height, lower to a height and let go, or release."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "When it begins")
    action: str = tunable("lower", choices=("hold", "lower", "release"), description="What to do")
    height: float = tunable(0.9, "m", 0.2, 2.0, "Pelvis height to reach")
    speed: float = tunable(0.1, "m/s", 0.01, 1.0, "Of the winch")

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> GantryMove:
        """From its fields, or as people write it: `{t, height | release | hold, speed}`.

        Raises:
            ParameterError: naming the key, its value and what is permitted.
        """
        if "action" in mapping:
            return structure_fields(cls, mapping, where)
        refuse_unknown(mapping, ("t", *_ACTIONS, "speed"), where)
        given = [key for key in _ACTIONS if key in mapping]
        if len(given) != 1:
            raise ParameterError(f"{where}: expected one of height, release and hold")
        fields = {key: value for key, value in mapping.items() if key not in given}
        fields["action"] = _ACTIONS[given[0]]
        if given[0] != "release":
            fields["height"] = mapping[given[0]]
        elif mapping["release"] is not True:
            raise ParameterError(f"{where}.release = {mapping['release']!r} is not true")
        return structure_fields(cls, fields, where)


@dataclass(frozen=True, kw_only=True)
class SensorFault:
    """A sensor channel that fails for a while."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "When it begins")
    duration: float = tunable(1e9, "s", 0.0, None, "How long it lasts")
    channel: str = tunable(
        dataclasses.MISSING, description="Field of Sensors, with an index: drive_position.3"
    )
    kind: str = tunable(dataclasses.MISSING, choices=FAULT_KINDS, description="How it fails")
    size: float = tunable(
        1.0, "", -1e6, 1e6, description="Height of spikes, in the channel's unit; delay in s"
    )

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> SensorFault:
        """From its fields.

        Raises:
            ParameterError: naming the key, its value and what is permitted.
        """
        if mapping.get("kind") is False:  # as YAML reads an off without quotes
            mapping = {**mapping, "kind": "off"}
        return structure_fields(cls, mapping, where)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything about the plant that an experiment fixes. See the fields' classes."""

    scene: str = tunable("flat", description="Ground under the robot", live=False)
    scene_parameters: Mapping[str, Any] = field(default_factory=dict)
    start: str = tunable("gantry", choices=STARTS, description="Pose at the start", live=False)
    draw: Draw = field(default_factory=Draw)
    gantry: tuple[GantryMove, ...] = ()
    pushes: tuple[Push, ...] = ()
    faults: tuple[SensorFault, ...] = ()
    delays: Delays = field(default_factory=Delays)
    model: ModelScale = field(default_factory=ModelScale)
    payload: Payload = field(default_factory=Payload)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Scenario:
        """From its keys alone, as YAML gives them.

        Raises:
            ParameterError: naming the key's path, its value and what is permitted.
        """
        return structure(Scenario, mapping)

    def __post_init__(self) -> None:
        """Put events in the order of time."""
        for name in ("gantry", "pushes", "faults"):
            events = sorted(getattr(self, name), key=lambda event: float(event.t))
            object.__setattr__(self, name, tuple(events))
