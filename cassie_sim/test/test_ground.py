"""Soft and slippery ground: how deep a foot sinks, and when it slips."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cassie_gaits import virtual_leg
from cassie_gaits.names import LEGS
from cassie_gaits.robot import WEIGHT
from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.errors import SimulationError
from cassie_sim.ground import soft_contact
from cassie_sim.plant import Plant, PlantConfig
from cassie_sim.poses import height_over_ground, set_drives
from cassie_sim.scenes import scene_spec

SOFT = {"start": 0.5, "uneven": 0.0}
LEG_LENGTH = 0.8


class Rig:
    """The robot with stiff drives on its feet, pelvis held upright, free to sink.

    Args:
        scene: Scene, the feet 1 m beyond its beginning.
        parameters: Of the scene.
        weight: By the robot's own.
    """

    def __init__(self, scene: str, parameters: dict, weight: float = 1.0) -> None:
        self.model = scene_spec(scene, parameters).compile()
        self.model.opt.gravity[2] *= weight
        self.data = mujoco.MjData(self.model)
        knee = virtual_leg.knee_angle(LEG_LENGTH)
        hip = virtual_leg.hip_pitch_angle(0.0, 0.0, LEG_LENGTH)
        toe = virtual_leg.toe_angle(0.0, 0.0, hip)
        self._drives = np.array([0.0, 0.0, hip, knee, toe] * 2)
        set_drives(self.model, self.data, self._drives)
        self.data.qpos[0] = 1.5
        self.data.qpos[2] += 1.0
        mujoco.mj_kinematics(self.model, self.data)
        self.data.qpos[2] -= height_over_ground(self.model, self.data)
        self._start = self.data.qpos[:3].copy()
        joints = self.model.actuator_trnid[:, 0]
        self._positions = self.model.jnt_qposadr[joints]
        self._speeds = self.model.jnt_dofadr[joints]

    def run(self, seconds: float, force: tuple = (0.0, 0.0, 0.0), hold: float = 2000.0) -> None:
        """Let it settle, the pelvis pulled by `force` (N) and held sideways by `hold` (N/m)."""
        data, pelvis = self.data, self.model.body("pelvis").id
        for _ in range(round(seconds / self.model.opt.timestep)):
            data.ctrl[:] = 2000.0 * (self._drives - data.qpos[self._positions])
            data.ctrl[:] -= 40.0 * data.qvel[self._speeds]
            pull = [hold, hold, 0.0] * (self._start - data.qpos[:3] - 0.15 * data.qvel[:3])
            data.xfrc_applied[pelvis, :3] = pull + force
            data.xfrc_applied[pelvis, 3:] = -2000.0 * data.qpos[4:7] - 200.0 * data.qvel[3:6]
            mujoco.mj_step(self.model, data)

    def pressed(self) -> list[tuple[str, float, float]]:
        """Geom, depth (m) and normal force (N) of each contact with the ground."""
        wrench, found = np.zeros(6), []
        mujoco.mj_forward(self.model, self.data)
        for index in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, index, wrench)
            contact = self.data.contact[index]
            names = [self.model.geom(g).name for g in (contact.geom1, contact.geom2)]
            name = next((n for n in names if n.startswith(LEGS)), "other")
            found.append((name, -float(contact.dist), float(wrench[0])))
        return found


def force_at(depth: float, sinking: float) -> float:
    """Static force on one end of a foot, from the law in `ground`, written down anew. In N."""

    def shape(r: float) -> float:
        d = 0.3 + 0.4 * min(1.0, r / (2.0 * sinking))
        return r * d**2 / (1.0 - d)

    return 0.5 * WEIGHT * shape(depth) / shape(sinking)


@pytest.mark.parametrize("sinking", [0.01, 0.02, 0.04])
def test_a_foot_with_the_weight_sinks_to_the_depth_asked_for(sinking):
    rig = Rig("sand", {**SOFT, "sinking": sinking}, weight=2.0)
    rig.run(3.0)
    contacts = rig.pressed()
    assert len(contacts) == 4
    for _, depth, force in contacts:
        assert force == pytest.approx(force_at(depth, sinking), rel=0.08)
    assert sum(force for *_, force in contacts) == pytest.approx(2.0 * WEIGHT, rel=0.06)
    mean = np.mean([depth for _, depth, _ in contacts])
    assert mean == pytest.approx(sinking, rel=0.2)


def test_soft_ground_gets_stiffer_with_depth():
    assert force_at(0.02, 0.02) == pytest.approx(0.5 * WEIGHT)
    assert force_at(0.01, 0.02) < 0.35 * 0.5 * WEIGHT
    assert force_at(0.04, 0.02) > 4.0 * 0.5 * WEIGHT


def test_deeper_ground_is_softer_and_damped_within_the_physics_step():
    shallow, deep = soft_contact(0.01)[0], soft_contact(0.06)[0]
    assert shallow[0] == pytest.approx(6.0 * deep[0])
    assert 0.0 < -deep[1] * 0.0005 < 1.0


def test_shoes_sink_less_than_bare_feet():
    depths = []
    for shoes in (False, True):
        rig = Rig("sand", {**SOFT, "sinking": 0.04, "shoes": shoes})
        rig.run(1.5)
        depths.append(np.mean([depth for _, depth, _ in rig.pressed()]))
    assert depths[1] < 0.5 * depths[0]


def test_the_heel_digs_in_where_the_sand_gives_way_under_it():
    rig = Rig("sand", {**SOFT, "sinking": 0.02, "heel_dig": 0.04}, weight=2.0)
    rig.run(1.5)
    by_end = {name: depth for name, depth, _ in rig.pressed()}
    for leg in LEGS:
        assert by_end[f"{leg}_heel"] > by_end[f"{leg}_toe"] + 0.01
    legs = {name for name, *_ in rig.pressed()}
    assert legs == {f"{leg}_{end}" for leg in LEGS for end in ("heel", "toe")}


def test_a_heel_digs_in_on_bumps_as_deep_as_between_them():
    """Bumps carried both ends of a foot alike, and a walking foot pitched by 12 degrees, not 30."""
    model = scene_spec("sand", {"sinking": 0.03, "heel_dig": 0.08, "uneven": 0.01}).compile()
    soft = [index for index in range(model.ngeom) if model.geom_solref[index, 0] < 0.0]
    for end, depth in (("toe", 0.03), ("heel", 0.11)):
        foot = model.geom(f"left_{end}")
        carry = [index for index in soft if model.geom_conaffinity[index] & foot.contype[0]]
        assert len(carry) > 20
        for index in carry:
            assert model.geom_solref[index] == pytest.approx(soft_contact(depth)[0])


@pytest.mark.parametrize(
    ("scene", "parameters"),
    [
        ("waxed_floor", {"friction": 0.2}),
        ("snow", {**SOFT, "friction": 0.3}),
    ],
)
@pytest.mark.parametrize("share", [0.5, 1.6])
def test_a_foot_slips_beyond_its_friction_and_not_before(scene, parameters, share):
    rig = Rig(scene, parameters)
    rig.run(0.5)
    before = rig.data.geom("left_toe").xpos[1]
    pull = share * parameters["friction"] * WEIGHT
    rig.run(0.3, force=(0.0, pull, 0.0), hold=0.0)
    moved = rig.data.geom("left_toe").xpos[1] - before
    assert moved > 0.02 if share > 1.0 else abs(moved) < 0.005


def test_soft_ground_is_refused_where_the_physics_is_too_slow_for_it():
    scenario = Scenario(scene="sand", start="standing")
    with pytest.raises(SimulationError, match="physics_rate = 500 Hz: soft ground needs 1000 Hz"):
        Plant(PlantConfig(sensors="ideal", physics_rate=500), scenario)
    plant = Plant(PlantConfig(sensors="ideal", physics_rate=1000), scenario)
    for _ in range(200):
        plant.step(None)
    assert np.abs(plant.data.qvel).max() < 20.0
