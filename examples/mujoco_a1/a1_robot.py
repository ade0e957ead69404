"""The Unitree A1 in MuJoCo 4: a free base, twelve DC motors that keep their own one-node temperature, a payload."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import mujoco

from a1_task import JOINTS, LEGS, TORQUE_LIMIT

TIME_STEP = 0.002  # s
FOOT_RADIUS = 0.02  # m
PACKAGE = "example-robot-data"

# The URDF has no rotor and no friction. A rotor of 1.2e-4 kg·m² behind a gear of 9.1 weighs 0.01 at the joint; the
# friction is a plausible one, not a measured one.
ARMATURE = 0.01  # kg·m²
DRY_FRICTION = 0.25  # N·m
DAMPING = 0.04  # N·m·s/rad

GREY, DARK, BLUE = (0.55, 0.57, 0.6, 1.0), (0.2, 0.21, 0.23, 1.0), (0.35, 0.45, 0.6, 1.0)


@dataclass(frozen=True)
class OneNode:
    """MuJoCo's own motor temperature: one node a joint, heated by the winding, cooled by the air.

    Args:
        winding: winding resistance at `reference` [ohm].
        torque_constant: torque at the joint per ampere [N·m/A].
        resistance: from the motor to the air [K/W].
        capacity: heat capacity of the motor [J/K].
        alpha: rise of the winding resistance [1/K].
        reference: temperature at which `winding` holds [degC].
        ambient: temperature of the air [degC].
    """

    winding: float = 0.15
    torque_constant: float = 0.84357
    resistance: float = 10.0
    capacity: float = 300.0
    alpha: float = 0.0039
    reference: float = 25.0
    ambient: float = 25.0

    @property
    def thermal(self) -> list[float]:
        """MuJoCo's `thermal="R C tau alpha Tref Tamb"`; a time constant of 0 leaves it to R and C."""
        return [self.resistance, self.capacity, 0.0, self.alpha, self.reference, self.ambient]


def a1_urdf() -> Path:
    """Where `a1.urdf` of the installed package example-robot-data lies.

    Raises:
        ModuleNotFoundError: the package is not installed.
    """
    try:
        files = metadata.distribution(PACKAGE).files or []
    except metadata.PackageNotFoundError as error:
        raise ModuleNotFoundError(f"{PACKAGE} is not installed: pip install 'lptn[robots]'", name=PACKAGE) from error
    matches = [file for file in files if file.name == "a1.urdf"]
    if not matches:
        raise ModuleNotFoundError(f"{PACKAGE} {metadata.version(PACKAGE)} holds no a1.urdf", name=PACKAGE)
    return Path(str(matches[0].locate()))


def build(motor: OneNode, payload: float = 0.0) -> mujoco.MjModel:
    """The robot on a floor, compiled.

    Args:
        motor: the twelve motors.
        payload: mass of a box on the trunk [kg].

    Returns:
        A model with one control a joint, in the order of `JOINTS`: the torque [N·m] at the reference temperature.
    """
    spec = mujoco.MjSpec.from_file(str(a1_urdf()))
    spec.compiler.discardvisual = False  # the knees and the payload are only seen, never touched
    spec.option.timestep = TIME_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    trunk = spec.body("base")
    trunk.add_freejoint(name="root")
    for joint in JOINTS:
        _motor(spec, joint, motor)
    _housings(spec)
    if payload > 0:
        _payload(trunk, payload)
    _surroundings(spec, trunk)
    return spec.compile()


def joint_geoms(model: mujoco.MjModel) -> list[int]:
    """The geom that stands for each motor, in the order of `JOINTS`."""
    return [model.geom(f"{joint}_motor").id for joint in JOINTS]


def _motor(spec: mujoco.MjSpec, joint: str, motor: OneNode) -> None:
    axis = spec.joint(f"{joint}_joint")
    axis.armature, axis.frictionloss, axis.damping[0] = ARMATURE, DRY_FRICTION, DAMPING
    actuator = spec.add_actuator(name=joint, target=axis.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_dcmotor(
        motorconst=[motor.torque_constant, motor.torque_constant],
        resistance=motor.winding,
        thermal=motor.thermal,
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_FF),
    )
    actuator.forcelimited = True
    actuator.forcerange = [-TORQUE_LIMIT, TORQUE_LIMIT]


def _housings(spec: mujoco.MjSpec) -> None:
    """Name the geoms that stand for the motors and colour the rest; the knee gets one of its own, without mass."""
    for leg in LEGS:
        hip, shoulder = spec.body(f"{leg}_hip").geoms[0], spec.body(f"{leg}_thigh_shoulder").geoms[0]
        hip.name, shoulder.name = f"{leg}_hip_motor", f"{leg}_thigh_motor"
        spec.body(f"{leg}_thigh").geoms[0].rgba = GREY
        calf = spec.body(f"{leg}_calf")
        calf.geoms[0].rgba = GREY
        foot = spec.body(f"{leg}_foot").geoms[0]
        foot.name, foot.rgba, foot.friction[0] = f"{leg}_foot", DARK, 0.9
        knee = calf.add_geom(name=f"{leg}_calf_motor", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.034, 0.022, 0])
        knee.mass, knee.contype, knee.conaffinity = 0.0, 0, 0
        knee.alt.euler = [90, 0, 0] if spec.compiler.degree else [1.5707963, 0, 0]


def _payload(trunk: mujoco.MjsBody, mass: float) -> None:
    height = 0.008 * mass + 0.01  # m, half of it
    box = trunk.add_body(name="payload", pos=[0.0, 0.0, 0.057 + height])
    geom = box.add_geom(name="payload", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.11, 0.08, height], rgba=BLUE)
    geom.mass, geom.contype, geom.conaffinity = mass, 0, 0


def _surroundings(spec: mujoco.MjSpec, trunk: mujoco.MjsBody) -> None:
    spec.body("trunk").geoms[0].rgba = DARK
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=64, height=384)
    sky.builtin = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky.rgb1, sky.rgb2 = [1.0, 1.0, 1.0], [0.9, 0.92, 0.95]
    tiles = spec.add_texture(name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256)
    tiles.builtin = mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    tiles.rgb1, tiles.rgb2 = [0.86, 0.87, 0.88], [0.94, 0.94, 0.95]
    floor = spec.add_material(name="floor", texrepeat=[2, 2], texuniform=True)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    ground = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05])
    ground.material = "floor"
    ground.friction[0] = 0.9
    light = trunk.add_light(pos=[0.5, -1.0, 2.5], dir=[-0.2, 0.4, -1.0])
    light.diffuse = [0.5] * 3
    light.mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.45] * 3, [0.45] * 3
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
