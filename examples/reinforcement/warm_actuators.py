# %% [markdown]
# # Actuators that warm up, for Isaac Lab and mjlab
#
# `WarmMotors` goes with an actuator of a simulator that runs in PyTorch. It takes torque back near the joints' limits
# and warms the robots by what is left. `heat` is a module that `lptn export fitted.toml --to torch --limit 80` wrote.
#
# `python examples/reinforcement/warm_actuators.py` holds a load with 4,096 legs; `pip install 'lptn[torch]'`

# %%
from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

import torch


class WarmMotors:
    """The motors of many robots beside their actuators.

    Args:
        heat: a module that `lptn export --to torch` wrote, or `lptn.batch.functions` made.
        joints: of the actuators, in their order; all that the network has must be among them.
        robots: how many.
        seconds: of a simulator's step.
        others: inputs of the network that are neither torques nor velocities: `{"temperature.ambient": 25.0}`.
        start: coldest and hottest robot of a new episode [degC].
        errors: by which the robots' parameters scatter, shape (parameters,): `heat.STANDARD_ERRORS` of a fit, or a
            tenth of `heat.VALUES`; without them all robots are the model.
        device: of the simulator's tensors.

    Raises:
        KeyError: an input that is neither a torque nor a velocity of one of the joints, and not among `others`.
    """

    def __init__(
        self, heat: ModuleType, joints: Sequence[str], robots: int, seconds: float, others: Mapping[str, float], *,
        start: tuple[float, float] = (25.0, 25.0), errors: Sequence[float] | None = None, device: str = "cpu",
    ) -> None:  # fmt: skip
        self.heat, self.seconds, self.start, self.errors = heat, seconds, start, errors
        self.nominal = torch.tensor(heat.VALUES, device=device).tile(robots, 1)
        self.inputs = torch.zeros(robots, len(heat.INPUTS), device=device)
        moving: dict[str, dict[int, int]] = {"torque": {}, "velocity": {}, "velocity_rms": {}}
        driven = {f"{quantity}.{joint}" for quantity in moving for joint in joints}
        if lacking := [column for column in heat.INPUTS if column not in driven and column not in others]:
            raise KeyError(f"neither of {', '.join(joints)} nor among `others`: {', '.join(lacking)}")
        for number, column in enumerate(heat.INPUTS):
            quantity, _, joint = column.partition(".")
            if column in driven:
                moving[quantity][number] = list(joints).index(joint)
            else:
                self.inputs[:, number] = others[column]
        self.torques, *self.velocities = (tuple(map(list, (of.keys(), of.values()))) for of in moving.values())
        self.scaled = [list(joints).index(joint) for joint in heat.JOINTS]
        self.params, self.state = self.nominal, heat.initial(self.nominal, start[0])
        self.reset()

    @property
    def margins(self) -> torch.Tensor:
        """Limits less temperatures [K], for what a policy sees, for costs and for the end of episodes."""
        return self.heat.outputs(self.state, self.inputs, self.params)["margins"]

    def give(self, torque: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
        """What is given of a torque [N*m], shape (robots, joints), after which the motors are a step warmer."""
        scale = torch.ones_like(torque)
        scale[:, self.scaled] = self.heat.outputs(self.state, self.inputs, self.params)["torque_scale"]
        given = scale * torque
        for (numbers, joints), values in ((self.torques, given), *((of, velocity.abs()) for of in self.velocities)):
            self.inputs[:, numbers] = values[:, joints]
        self.state = self.heat.step(self.state, self.inputs, self.params, self.seconds)
        return given

    def reset(self, robots: Sequence[int] | torch.Tensor | slice | None = None) -> None:
        """Begin anew with other robots, or with some of them."""
        chosen = slice(None) if robots is None else robots
        begun = torch.zeros(len(self.nominal), 1, dtype=torch.bool, device=self.nominal.device)
        begun[chosen] = True
        drawn = self.nominal
        if self.errors is not None:
            drawn = self.heat.randomized(None, drawn, errors=torch.as_tensor(self.errors))
        self.params = torch.where(begun, drawn, self.params)
        air = torch.empty(len(drawn), device=drawn.device).uniform_(*self.start)
        fresh = zip(self.heat.initial(self.params, air), self.state, strict=True)
        self.state = self.heat.State(*(torch.where(begun, new, old) for new, old in fresh))


# %% [markdown]
# ## In a simulator
#
# Isaac Lab and mjlab were not run here: these two follow their documented signatures (Isaac Lab 2 and 3, mjlab 1.6).
# All joints of the network must be of one group of actuators.
#
# ```python
# class WarmIsaacLabActuator(isaaclab.actuators.IdealPDActuator):
#     def __init__(self, cfg, *args, **kwargs):
#         super().__init__(cfg, *args, **kwargs)
#         self.motors = WarmMotors(heat, self.joint_names, self._num_envs, cfg.seconds, cfg.others, device=self._device)
#
#     def compute(self, control_action, joint_pos, joint_vel):
#         control_action = super().compute(control_action, joint_pos, joint_vel)
#         self.applied_effort = self.motors.give(control_action.joint_efforts, joint_vel)
#         control_action.joint_efforts = self.applied_effort
#         return control_action
#
#     def reset(self, env_ids):
#         super().reset(env_ids)
#         self.motors.reset(env_ids)
#
#
# class WarmMjlabActuator(mjlab.actuator.IdealPdActuator):
#     def initialize(self, mj_model, model, data, device):
#         super().initialize(mj_model, model, data, device)
#         seconds = mj_model.opt.timestep
#         self.motors = WarmMotors(heat, self.target_names, data.nworld, seconds, self.cfg.others, device=device)
#
#     def compute(self, cmd):
#         return self.motors.give(super().compute(cmd), cmd.vel)
#
#     def reset(self, env_ids=None):
#         super().reset(env_ids)
#         self.motors.reset(env_ids)
# ```
#
# ## Held by 4,096 legs
#
# Joints bear a load; the legs differ by a tenth in each parameter.


# %%
def main(robots: int = 4096, minutes: float = 20.0, seconds: float = 1.0) -> torch.Tensor:
    """Hold a load; what is given of it at the end, shape (robots, joints)."""
    import lptn.batch
    from lptn.model.file import parse_model
    from lptn.model.model import Model
    from lptn.robots.presets import preset_text

    model = Model(parse_model(preset_text("leg"), Path("leg.toml")).network)
    heat = lptn.batch.functions(model, "torch", limits=60.0)
    errors = [0.1 * value for value in heat.VALUES]
    motors = WarmMotors(heat, heat.JOINTS, robots, seconds, {"temperature.ambient": 25.0}, errors=errors)
    load, still = torch.tensor([2.0, 3.0, 8.0]).tile(robots, 1), torch.zeros(robots, 3)
    steps, began = round(60 * minutes / seconds), time.process_time()
    for step in range(steps + 1):
        given = motors.give(load, still)
        if step % (steps // 4) == 0:
            share, hottest = (given / load).mean(dim=0).tolist(), 60.0 - motors.margins.amin()
            told = ", ".join(f"{joint} {part:.0%}" for joint, part in zip(heat.JOINTS, share, strict=True))
            print(f"{step * seconds / 60:3.0f} min: given {told} of the load; hottest {hottest:.1f} degC", flush=True)
    print(f"{robots * steps / (time.process_time() - began):.2g} robot-steps a second of CPU")
    return given


if __name__ == "__main__":
    main()
