"""A small controller that trots, stands and lies down: forces under feet on the ground, a path for feet in the air."""

from __future__ import annotations

import mujoco
import numpy as np

from a1_robot import FOOT_RADIUS
from a1_task import LEGS, TORQUE_LIMIT, Command, FloatArray

PERIOD = 0.5  # s, one gait cycle
DUTY = 0.6  # share of the cycle that a foot stands
LIFT = 0.07  # m, how high a foot swings
OFFSETS = np.array([0.0, 0.5, 0.5, 0.0])  # diagonal legs move together
NEUTRAL = np.array([[0.1805, -0.1308], [0.1805, 0.1308], [-0.1805, -0.1308], [-0.1805, 0.1308]])  # m, under shoulders
FRONT = np.array([1.0, 1.0, -1.0, -1.0])
CLIMB = 0.12  # m/s, how fast the height may change
ACCELERATION = 0.4  # m/s², how fast the speed may change
SLIP = 0.6  # share of the normal force that the controller asks sideways, below the floor's 0.9
WEIGHTS = np.array([1.0, 1.0, 1.0, 30.0, 30.0, 10.0])  # of errors in force [1/N²] and moment [1/(N·m)²]
REGULARISATION = 1e-3

HEIGHT_GAINS = (250.0, 30.0)  # 1/s², 1/s
TRAVEL_GAINS = (8.0, 12.0)
TILT_GAINS = (220.0, 22.0)
SWING_GAINS = (500.0, 14.0)  # N/m, N·s/m
POSTURE_GAINS = (40.0, 1.5)  # N·m/rad, N·m·s/rad
STEP_GAIN = 0.12  # s, how far a foot steps ahead of a base that is too fast
TRIM_GAIN = 0.5  # 1/s, integral of the speed error
TRIM_LIMIT = 0.3  # m/s

CROUCH = 0.12  # m, the lowest base that the feet can carry
CROUCHED = np.array([0.0, 1.32, -2.64] * 4)  # rad, the joints there
LYING = np.array([-0.6, 1.32, -2.64, 0.6, 1.32, -2.64] * 2)  # rad, legs spread, the trunk on the floor
FOLD_TIME = 1.5  # s from one to the other


class Controller:
    """Joint torques from the robot's state, its command and its gait.

    Feet on the ground share the force and the moment that hold the base where it should be (least squares over the
    feet, then cut to the friction cone); feet in the air follow a path to a foothold that depends on the speed.

    Args:
        model: the robot of `a1_robot.build`.
        data: its state at the start.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model = model
        self._feet = [model.geom(f"{leg}_foot").id for leg in LEGS]
        self._base = model.body("base").id
        self._mass = float(model.body_mass.sum())
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        self._inertia = np.diag(inertia)[3:6].copy()
        self._jacobian = np.zeros((4, 3, model.nv))
        self._lift_off = np.zeros((4, 3))
        self._in_air = np.zeros(4, dtype=bool)
        self._line, self._spot = float(data.qpos[1]), float(data.qpos[0])
        self._height = float(data.qpos[2])
        self._speed = self._trim = 0.0
        self._fold = 0.0
        self._neutral = NEUTRAL
        self.phase = 0.0
        """Share of the gait cycle that has passed."""
        self.trotting = False
        """Whether the legs step."""

    @property
    def powered(self) -> bool:
        """Whether the drives are on; lying down they are not."""
        return self._fold < 1

    @property
    def height(self) -> float:
        """Where the controller holds the base [m]."""
        return self._height

    def torque(self, data: mujoco.MjData, command: Command, dt: float) -> FloatArray:
        """The torque of each joint [N·m], shape (12,), for the next `dt` seconds."""
        self._advance(data, command, dt)
        if not self.powered:
            return np.zeros(12)
        if self._fold > 0:
            return self._posture_torque(data)
        for leg, foot in enumerate(self._feet):
            mujoco.mj_jacGeom(self._model, data, self._jacobian[leg], None, foot)
        feet = data.geom_xpos[self._feet]
        torque: FloatArray = data.qfrc_bias[6:18].copy()
        standing = np.flatnonzero(~self._in_air)
        for force, leg in zip(self._ground_forces(data, feet[standing]), standing.tolist(), strict=True):
            torque[3 * leg : 3 * leg + 3] -= force @ self._leg(leg)
        for leg in np.flatnonzero(self._in_air).tolist():
            torque[3 * leg : 3 * leg + 3] += self._swing_force(data, leg, feet[leg]) @ self._leg(leg)
        return np.clip(torque, -TORQUE_LIMIT, TORQUE_LIMIT)

    def _leg(self, leg: int) -> FloatArray:
        columns: FloatArray = self._jacobian[leg][:, 6 + 3 * leg : 9 + 3 * leg]
        return columns

    # --- what to do ---------------------------------------------------------------------------

    def _advance(self, data: mujoco.MjData, command: Command, dt: float) -> None:
        self._move_height(command, dt)
        self._move_speed(data, command, dt)
        self._start_or_stop(command)
        self._neutral = NEUTRAL + np.outer(FRONT, (command.splay, 0.0)) + (command.ahead, command.left)
        if self.trotting:
            self.phase = (self.phase + dt / PERIOD) % 1.0
        in_air = ((self.phase + OFFSETS) % 1.0 >= DUTY) & self.trotting
        started = in_air & ~self._in_air
        if started.any():
            self._lift_off[started] = data.geom_xpos[self._feet][started]
        self._in_air = in_air
        if self.trotting:
            self._spot = float(data.qpos[0])

    def _move_height(self, command: Command, dt: float) -> None:
        lying = command.activity == "rest" and not self.trotting
        if lying and self._height <= CROUCH:
            self._fold = min(1.0, self._fold + dt / FOLD_TIME)
        elif self._fold > 0:
            self._fold = max(0.0, self._fold - dt / FOLD_TIME)
        else:
            target = CROUCH if lying else command.height
            self._height += float(np.clip(target - self._height, -CLIMB * dt, CLIMB * dt))

    def _move_speed(self, data: mujoco.MjData, command: Command, dt: float) -> None:
        wish = command.speed if self.trotting and command.activity == "trot" else 0.0
        self._speed += float(np.clip(wish - self._speed, -ACCELERATION * dt, ACCELERATION * dt))
        error = self._speed - float(data.qvel[0])
        trim = self._trim + TRIM_GAIN * error * dt if self.trotting else 0.0
        self._trim = float(np.clip(trim, -TRIM_LIMIT, TRIM_LIMIT))

    def _start_or_stop(self, command: Command) -> None:
        if not self.trotting:
            if command.activity == "trot" and self._height > 0.2:
                self.trotting, self.phase = True, 0.0
        elif command.activity != "trot" and abs(self._speed) < 0.02 and not self._in_air.any():
            self.trotting = False

    # --- feet on the ground -------------------------------------------------------------------

    def _ground_forces(self, data: mujoco.MjData, feet: FloatArray) -> FloatArray:
        """Force of the ground on each standing foot [N], shape (n, 3)."""
        n = len(feet)
        grasp = np.zeros((6, 3 * n))
        for k, (x, y, z) in enumerate((feet - data.subtree_com[self._base]).tolist()):
            block = slice(3 * k, 3 * k + 3)
            grasp[:3, block] = np.eye(3)
            grasp[3:, block] = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
        weighted = grasp.T * WEIGHTS
        normal = weighted @ grasp
        normal[np.diag_indices(3 * n)] += REGULARISATION
        forces = np.linalg.solve(normal, weighted @ self._wrench(data)).reshape(n, 3)
        forces[:, 2] = np.maximum(forces[:, 2], 0.0)
        bound = SLIP * forces[:, 2:3]
        forces[:, :2] = np.clip(forces[:, :2], -bound, bound)
        return forces

    def _wrench(self, data: mujoco.MjData) -> FloatArray:
        """Force and moment on the robot [N, N·m], in the world, that bring the base where it should be."""
        matrix = data.xmat[self._base]
        velocity, turning = data.qvel[:3], matrix.reshape(3, 3) @ data.qvel[3:6]
        (kz, dz), (ky, dy), (kt, dt) = HEIGHT_GAINS, TRAVEL_GAINS, TILT_GAINS
        roll, pitch, yaw = tilt(matrix)
        force = self._mass * np.array(
            [
                dy * (self._speed + self._trim - velocity[0]) + ky * (self._spot - data.qpos[0]),
                ky * (self._line - data.qpos[1]) - dy * velocity[1],
                kz * (self._height - data.qpos[2]) - dz * velocity[2],
            ]
        )
        force -= self._mass * self._model.opt.gravity
        moment = self._inertia * (-kt * np.array([roll, pitch, yaw]) - dt * turning)
        return np.concatenate([force, moment])

    # --- feet in the air ----------------------------------------------------------------------

    def _swing_force(self, data: mujoco.MjData, leg: int, foot: FloatArray) -> FloatArray:
        """Force that drives a foot along its path [N], shape (3,)."""
        part = ((self.phase + OFFSETS[leg]) % 1.0 - DUTY) / (1 - DUTY)
        rate = 1.0 / (PERIOD * (1 - DUTY))
        turn = 2 * np.pi * part
        stride = self._foothold(data, leg) - self._lift_off[leg]
        aim = self._lift_off[leg] + (part - np.sin(turn) / (2 * np.pi)) * stride
        speed = (1 - np.cos(turn)) * rate * stride
        aim[2] += LIFT * 0.5 * (1 - np.cos(turn))
        speed[2] += LIFT * np.pi * np.sin(turn) * rate
        k, d = SWING_GAINS
        return np.asarray(k * (aim - foot) + d * (speed - self._jacobian[leg] @ data.qvel))

    def _foothold(self, data: mujoco.MjData, leg: int) -> FloatArray:
        """Where a foot lands [m]: by its shoulder, half a stance ahead, and further if the base is too fast."""
        yaw = tilt(data.xmat[self._base])[2]
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = self._neutral[leg]
        velocity = data.qvel[:2]
        ahead = velocity * (PERIOD * DUTY / 2 + STEP_GAIN)
        ahead[0] -= STEP_GAIN * (self._speed + self._trim)
        position = data.qpos
        return np.array([position[0] + c * x - s * y + ahead[0], position[1] + s * x + c * y + ahead[1], FOOT_RADIUS])

    # --- lying down ---------------------------------------------------------------------------

    def _posture_torque(self, data: mujoco.MjData) -> FloatArray:
        k, d = POSTURE_GAINS
        aim = CROUCHED + self._fold * (LYING - CROUCHED)
        return np.asarray(k * (aim - data.qpos[7:19]) - d * data.qvel[6:18])


def tilt(matrix: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw [rad] of a rotation matrix, shape (9,)."""
    m = matrix
    return float(np.arctan2(m[7], m[8])), float(-np.arcsin(np.clip(m[6], -1, 1))), float(np.arctan2(m[3], m[0]))
