"""The Unitree A1 standing in MuJoCo: inverse dynamics at rest, and forward simulation under held torques."""

from __future__ import annotations

from importlib import metadata
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from lptn.applications.load_sharing import Stance, load_body
from lptn.basics.arrays import FloatArray

LEGS = ("FR", "FL", "RR", "RL")
STEP, SETTLE, MEASURE = 0.001, 3.0, 1.0  # s
STIFFNESS, DAMPING = 60.0, 2.0  # N·m/rad, N·m·s/rad: of the drives' weak position control


def urdf() -> str:
    """Where the A1's URDF lies.

    Raises:
        ModuleNotFoundError: the package example-robot-data is not installed.
    """
    for file in metadata.distribution("example-robot-data").files or []:
        if file.name == "a1.urdf":
            return str(file.locate())
    raise ModuleNotFoundError("example-robot-data holds no a1.urdf", name="example-robot-data")


def robot(stance: Stance, floor: bool) -> tuple[Any, Any]:
    """Model and data, in the posture; on a floor that the lowest foot just touches, with the load on the trunk."""
    spec = mujoco.MjSpec.from_file(urdf())
    spec.option.timestep = STEP
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio, spec.option.noslip_iterations = 100.0, 20  # else feet that push sideways creep
    trunk = spec.body("base")
    trunk.add_freejoint(name="root")
    if stance.load > 0:
        box = trunk.add_body(name="load", pos=list(stance.load_at))
        geom = box.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0])
        geom.mass, geom.contype, geom.conaffinity = stance.load, 0, 0
    if floor:
        ground = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05])
        for name, geom in [("floor", ground), *((f"{leg}_foot", spec.body(f"{leg}_foot").geoms[0]) for leg in LEGS)]:
            geom.name, geom.friction[0] = name, 1.0
    model = spec.compile()
    data = mujoco.MjData(model)
    x, y, z, w = Rotation.from_euler("xyz", [stance.roll, stance.pitch, 0.0]).as_quat()
    data.qpos[3:7], data.qpos[7:] = [w, x, y, z], stance.angles
    mujoco.mj_forward(model, data)
    return model, data


def at_rest(stance: Stance, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What keeps the robot at rest under forces at the feet's lowest points [N], in the trunk's frame, shape (4, 3).

    Returns:
        Force and moment that are missing at the trunk, in its frame, shape (6,); torques [N·m], shape (12,).
    """
    model, data = robot(stance, floor=False)
    turn = Rotation.from_matrix(data.xmat[model.body("base").id].reshape(3, 3))
    body = load_body()
    needed = data.qfrc_bias.copy()
    jacobian = np.zeros((3, model.nv))
    for k, leg in enumerate(LEGS):
        calf = model.body(f"{leg}_calf").id
        middle = data.xpos[calf] + data.xmat[calf].reshape(3, 3) @ body.legs[k].foot
        mujoco.mj_jac(model, data, jacobian, None, middle - [0.0, 0.0, body.foot_radius], calf)
        needed -= jacobian.T @ turn.apply(forces[k])
    # A free joint's forces are in the world, its moments in the body.
    return np.concatenate([turn.inv().apply(needed[:3]), needed[3:6]]), needed[6:]


def stands(stance: Stance, torques: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Let the robot stand on a floor with these torques held, and weak position control about the posture.

    Returns:
        Mean forces of the floor on the feet [N], shape (4, 3), and mean torques [N·m], shape (12,), once it is at rest.
    """
    model, data = robot(stance, floor=True)
    feet = [model.geom(f"{leg}_foot").id for leg in LEGS]
    data.qpos[2] += load_body().foot_radius - min(float(data.geom_xpos[foot][2]) for foot in feet)
    aim = np.array(stance.angles)
    forces, applied, count = np.zeros((4, 3)), np.zeros(12), 0
    for step in range(round((SETTLE + MEASURE) / STEP)):
        held = torques + STIFFNESS * (aim - data.qpos[7:]) - DAMPING * data.qvel[6:]
        data.qfrc_applied[6:] = held
        mujoco.mj_step(model, data)
        if step * STEP >= SETTLE:
            forces, applied, count = forces + _contacts(model, data, feet), applied + held, count + 1
    turn = data.xmat[model.body("base").id].reshape(3, 3)
    return forces / count @ turn, applied / count


def _contacts(model: Any, data: Any, feet: list[int]) -> FloatArray:
    """Force of the floor on each foot in the world [N], shape (4, 3)."""
    forces, wrench = np.zeros((4, 3)), np.zeros(6)
    for number, contact in enumerate(data.contact):
        foot = next((k for k, geom in enumerate(feet) if geom in (contact.geom1, contact.geom2)), None)
        if foot is not None:
            mujoco.mj_contactForce(model, data, number, wrench)
            pushed = contact.frame.reshape(3, 3).T @ wrench[:3]
            forces[foot] += pushed if contact.geom2 == feet[foot] else -pushed
    return forces
