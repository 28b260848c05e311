"""What an experiment fixes about the plant: scene, start, events, delays and the robot drawn.

A seed determines one random robot (`Draw.from_seed`). The drawn values are stored in the scenario,
so that nothing is drawn twice and a recording contains them.
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
"""Action of a gantry move, by its key in an experiment file."""

FAULT_KINDS = ("off", "stuck", "nan", "spike", "delay")

Pair = tuple[float, float]
Vector = tuple[float, float, float]
PerDrive = tuple[float, float, float, float, float, float, float, float, float, float]

_NO3 = (0.0, 0.0, 0.0)
_ZERO10 = (0.0,) * 10
_ONE10 = (1.0,) * 10


@dataclass(frozen=True, kw_only=True)
class Draw:
    """The robot that a seed determines."""

    initial_yaw: float = tunable(0.0, "rad", -math.pi, math.pi, "Heading at the start")
    joint_offset: PerDrive = tunable(_ZERO10, "rad", -0.2, 0.2, "Offset of each drive at the start")
    torque_constant: PerDrive = tunable(
        _ONE10, "", 0.5, 1.5, "Ratio of real to nominal torque of each drive"
    )
    mass: float = tunable(1.0, "", 0.5, 1.5, "Ratio of real to nominal mass of every link")
    friction: float = tunable(1.0, "", 0.1, 2.0, "Ratio of real to nominal friction of the ground")
    attitude_bias: Pair = tunable(
        (0.0, 0.0), "rad", -0.1, 0.1, "Constant roll and pitch error of the IMU"
    )
    gyro_bias: Vector = tunable(_NO3, "rad/s", -0.1, 0.1, "Constant gyro error")
    accelerometer_bias: Vector = tunable(_NO3, "m/s^2", -1.0, 1.0, "Constant accelerometer error")
    yaw_drift: float = tunable(0.0, "rad/s", -0.01, 0.01, "Drift of the IMU's heading")
    sensor_seed: int = tunable(0, "", 0, None, "Seed of the sensor noise")

    @staticmethod
    def from_seed(seed: int) -> Draw:
        """The random robot of a seed.

        Initial yaw and joints are uniform within 2 degrees, torque constants within 3 %, mass
        within 2 %, friction within 10 %. The IMU's errors of attitude are normal and clipped, its
        other errors are uniform; their sizes are those of the IMU in cassie_sim.
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

    torque: float = tunable(
        0.0, "s", 0.0, 0.1, "Latency from a commanded torque to its effect, in addition to 3 ms"
    )
    set_point: float = tunable(0.0, "s", 0.0, 0.2, "Latency from a motor command to the drives")


@dataclass(frozen=True, kw_only=True)
class ModelScale:
    """Factors on the model, multiplied with those that a seed draws."""

    mass: float = tunable(1.0, "", 0.5, 2.0, "Factor on mass and inertia of every link")
    spring: float = tunable(1.0, "", 0.2, 5.0, "Factor on stiffness of shin and heel springs")
    friction: float = tunable(1.0, "", 0.05, 3.0, "Factor on the ground's friction")
    damping: float = tunable(1.0, "", 0.0, 10.0, "Factor on viscous friction of the joints")
    armature: float = tunable(1.0, "", 0.2, 5.0, "Factor on reflected inertia of the drives")
    torque: float = tunable(1.0, "", 0.3, 2.0, "Factor on torque constants of the drives")


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A load fixed to the pelvis, unknown to the controller."""

    mass: float = tunable(0.0, "kg", 0.0, 30.0, "Mass of the load; 0: there is none")
    x: float = tunable(0.0, "m", -0.3, 0.3, "Load's centre, ahead of the pelvis's centre of mass")
    y: float = tunable(0.0, "m", -0.3, 0.3, "Load's centre, left of the pelvis's centre of mass")
    z: float = tunable(0.1, "m", -0.3, 0.5, "Load's centre, above the pelvis's centre of mass")


@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force on one body for a limited time."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "Time at which the push begins")
    duration: float = tunable(0.1, "s", 0.0005, 100.0, "Duration of the push")
    force: Vector = tunable(dataclasses.MISSING, "N", -5000.0, 5000.0, "Force in world axes")
    body: str = tunable("pelvis", description="Name of the body that is pushed")


@dataclass(frozen=True, kw_only=True)
class GantryMove:
    """One command to the gantry: hold at a height, lower to a height and release, or release."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "Time at which the move begins")
    action: str = tunable(
        "lower", choices=("hold", "lower", "release"), description="Action of the gantry"
    )
    height: float = tunable(0.9, "m", 0.2, 2.0, "Pelvis height to reach")
    speed: float = tunable(0.1, "m/s", 0.01, 1.0, "Speed of the winch")

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> GantryMove:
        """A move, from its fields or the short form `{t, height | release | hold, speed}`.

        Raises:
            ParameterError: naming the key, its value and the permitted values.
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
    """A sensor channel that fails for a limited time."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "Time at which the fault begins")
    duration: float = tunable(1e9, "s", 0.0005, None, "Duration of the fault")
    channel: str = tunable(
        dataclasses.MISSING, description="Field of Sensors, with an index: drive_position.3"
    )
    kind: str = tunable(dataclasses.MISSING, choices=FAULT_KINDS, description="Kind of fault")
    size: float = tunable(
        1.0, "", -1e6, 1e6, description="Height of spikes, in the channel's unit; delay in s"
    )

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> SensorFault:
        """A fault, from its fields.

        Raises:
            ParameterError: naming the key, its value and the permitted values.
        """
        if mapping.get("kind") is False:  # YAML reads an unquoted off as false
            mapping = {**mapping, "kind": "off"}
        return structure_fields(cls, mapping, where)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything about the plant that an experiment fixes. The fields' classes describe it."""

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
        """A scenario, from its keys as YAML gives them.

        Raises:
            ParameterError: naming the key's path, its value and the permitted values.
        """
        return structure(Scenario, mapping)

    def __post_init__(self) -> None:
        """Sort the events by time."""
        for name in ("gantry", "pushes", "faults"):
            events = sorted(getattr(self, name), key=lambda event: float(event.t))
            object.__setattr__(self, name, tuple(events))
