"""The MuJoCo model of Cassie, made from the numbers in `cassie_gaits.robot`.

The model has the 20 coordinates of the paper, plus the bodies that close the loops: achilles rod,
heel spring, foot crank and plantar rod of each leg. Stiff equality constraints pin the rods' far
ends. Leaf springs are joint springs. Drives are plain joint torques here; gear, torque-speed
limit and delay are in `cassie_sim.drives`.
"""

from __future__ import annotations

import functools
import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.linkage import link_rotation
from cassie_gaits.names import LEG_DRIVES, LEGS
from cassie_gaits.records import FloatArray

# With softer constraints the pins separate by millimetres, which takes half of the heel spring's
# deflection.
_LOOP_SOLREF = (0.002, 1.0)
_LOOP_SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)

_GROUND, _LEFT, _RIGHT, _TORSO = 1, 2, 4, 8
_COLLIDES_WITH = {"left": _GROUND | _RIGHT, "right": _GROUND | _LEFT, "pelvis": _GROUND}
_IS = {"left": _LEFT, "right": _RIGHT, "pelvis": _TORSO}

BODY_COLOUR = (0.92, 0.55, 0.16, 1.0)
SHAPE_COLOUR = (0.35, 0.40, 0.46, 1.0)
COLOURED = ("pelvis", "hip_pitch", "shin")
"""Links with the body's colour; the others have the colour of shapes."""


def mesh_folder() -> Path | None:
    """Folder of the meshes that `example-robot-data` installs, or None without that package."""
    cmeel = importlib.util.find_spec("cmeel")
    if cmeel is None or cmeel.origin is None:
        return None
    prefix = Path(cmeel.origin).parents[1] / "cmeel.prefix"
    folder = prefix / "share/example-robot-data/robots/cassie_description/meshes"
    return folder if folder.is_dir() else None


def robot_spec(*, meshes: bool = False, gravity: float = robot.GRAVITY) -> mujoco.MjSpec:
    """Cassie on a free base, above an empty world.

    Args:
        meshes: Add the visual meshes. They make compiling slow and change no physics.
        gravity: Gravity. In m/s^2.

    Returns:
        An editable model; scenes add ground and obstacles to it.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "cassie"
    spec.compiler.degree = False
    spec.option.timestep = 1.0 / robot.ENCODER_RATE
    spec.option.gravity = [0.0, 0.0, -gravity]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = 30
    # One robot is one island: a search for further islands costs time and finds none.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    folder = mesh_folder() if meshes else None
    pelvis = _add_body(spec, spec.worldbody, robot.PELVIS, "pelvis", folder)
    pelvis.add_freejoint(name="pelvis")
    pelvis.add_site(name="imu", pos=robot.IMU_POSITION, size=[0.01, 0.01, 0.01])
    # For contacts with the ground the pelvis is a ball; its mesh is only drawn.
    _add_shape(pelvis, "pelvis", folder is None, sphere=robot.PELVIS_BALL)
    for leg in LEGS:
        _add_leg(spec, pelvis, leg, folder)
    return spec


def _add_leg(spec: mujoco.MjSpec, pelvis: mujoco.MjsBody, leg: str, folder: Path | None) -> None:
    bodies = {"pelvis": pelvis}
    for link in robot.leg_links(leg):
        body = _add_body(spec, bodies[link.parent], link, f"{leg}_{link.name}", folder)
        _add_joint(body, link, leg)
        bodies[link.name] = body
        if link.capsule is not None:
            _add_shape(body, leg, folder is None, capsule=link.capsule)
    for end, point in zip(("toe", "heel"), robot.FOOT_CONTACTS, strict=True):
        geom = bodies["toe"].add_geom(
            name=f"{leg}_{end}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[robot.SOLE_RADIUS, 0.0, 0.0],
            pos=point,
            contype=_IS[leg],
            conaffinity=_GROUND,
            rgba=SHAPE_COLOUR,
            mass=0.0,
        )
        geom.condim = 3
    bodies["toe"].add_site(name=f"{leg}_foot", pos=np.mean(robot.FOOT_CONTACTS, axis=0))
    for rod in robot.RODS:
        spec.add_equality(
            name=f"{leg}_{rod.rod}",
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=f"{leg}_{rod.rod}",
            name2=f"{leg}_{rod.target}",
            data=[rod.length] + [0.0] * 11,
            solref=_LOOP_SOLREF,
            solimp=_LOOP_SOLIMP,
        )
    for name in LEG_DRIVES:
        spec.add_actuator(
            name=f"{leg}_{name}",
            target=f"{leg}_{name}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
        )


def _add_body(
    spec: mujoco.MjSpec,
    parent: mujoco.MjsBody,
    link: robot.Link,
    name: str,
    folder: Path | None,
) -> mujoco.MjsBody:
    body = parent.add_body(name=name, pos=link.position, quat=_quaternion(link))
    body.mass = link.mass
    body.ipos = link.com
    body.fullinertia = link.inertia
    body.explicitinertial = True
    if folder is not None and link.mesh is not None:
        _add_mesh(spec, body, link, name, folder)
    return body


def _quaternion(link: robot.Link) -> FloatArray:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, link_rotation(link).ravel())
    return quaternion


def _add_joint(body: mujoco.MjsBody, link: robot.Link, leg: str) -> None:
    joint = link.joint
    if joint.kind == "fixed":
        return
    ball = joint.kind == "ball"
    added = body.add_joint(
        name=f"{leg}_{link.name}",
        type=mujoco.mjtJoint.mjJNT_BALL if ball else mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0.0, 0.0, 1.0],
    )
    added.damping = as_field(added.damping, joint.damping)
    added.stiffness = as_field(added.stiffness, joint.stiffness)
    added.armature = joint.armature
    if ball:
        return
    added.ref = joint.zero
    if joint.limits is not None:
        added.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        added.range = joint.limits


def as_field(present: npt.ArrayLike, value: float) -> float | FloatArray:
    """The value in the shape of the field in this version of MuJoCo (scalar or polynomial)."""
    if np.ndim(present) == 0:
        return value
    field: FloatArray = np.zeros(np.shape(present))
    field[0] = value
    return field


def _add_shape(
    body: mujoco.MjsBody,
    owner: str,
    visible: bool,
    *,
    sphere: tuple[float, robot.Vector] | None = None,
    capsule: tuple[float, robot.Vector, robot.Vector] | None = None,
) -> None:
    geom = body.add_geom(
        contype=_IS[owner],
        conaffinity=_COLLIDES_WITH[owner],
        condim=3,
        mass=0.0,
        group=0 if visible else 3,
        rgba=SHAPE_COLOUR,
    )
    if sphere is not None:
        geom.type = mujoco.mjtGeom.mjGEOM_SPHERE
        geom.size = [sphere[0], 0.0, 0.0]
        geom.pos = sphere[1]
    elif capsule is not None:
        geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
        geom.size = [capsule[0], 0.0, 0.0]
        geom.fromto = [*capsule[1], *capsule[2]]


def _add_mesh(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, link: robot.Link, name: str, folder: Path
) -> None:
    # Only the left meshes exist; the right ones are their mirror images.
    scale = [1.0, 1.0, 1.0]
    if name.startswith("right"):
        scale[link.mirror_axis] = -1.0
    spec.add_mesh(name=name, file=str(folder / f"{link.mesh}.stl"), scale=scale)
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        contype=0,
        conaffinity=0,
        mass=0.0,
        group=1,
        rgba=BODY_COLOUR if link.name in COLOURED else SHAPE_COLOUR,
    )


@functools.cache
def robot_model() -> mujoco.MjModel:
    """The compiled robot alone, for kinematics. Do not change it."""
    return robot_spec().compile()
