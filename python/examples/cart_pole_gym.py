"""A pendulum on a cart as an environment of Gymnasium, one or many side by side.

    pip install ./python gymnasium
    python python/examples/cart_pole_gym.py

`CartPole` is what libraries for learning take. `CartPoles` is the same for many carts: one call moves all of them,
eight in the registers of a core.
"""

from pathlib import Path

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import pyhamel

MODEL = pyhamel.load(Path(__file__).with_name("cart_pole.hamel"))
#: Place and angle at which an episode ends, and the largest force.
X_MAX, THETA_MAX, PUSH_MAX = 2.4, 0.4, 10.0
HIGH = np.array([2 * X_MAX, 2 * THETA_MAX, 20.0, 20.0])


def spaces():
    """What is observed, and what is done."""
    return gymnasium.spaces.Box(-HIGH, HIGH, dtype=np.float64), gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)


def has_fallen(y):
    """Whether an episode ends, of each state."""
    return (np.abs(y[..., 0]) > X_MAX) | (np.abs(y[..., 1]) > THETA_MAX)


class CartPole(gymnasium.Env):
    """A cart that is pushed."""

    def __init__(self, dt=0.02):
        self.observation_space, self.action_space = spaces()
        self.stepper = MODEL.stepper(dt)
        self.y = np.zeros(4)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.y[:] = self.np_random.uniform(-0.05, 0.05, 4)
        return self.y.copy(), {}

    def step(self, action):
        self.stepper.step(self.y, PUSH_MAX * np.asarray(action, dtype=np.float64), out=self.y)
        return self.y.copy(), 1.0, bool(has_fallen(self.y)), False, {}


class CartPoles(VectorEnv):
    """Many carts; one that has fallen begins again with the next step."""

    def __init__(self, num_envs, dt=0.02):
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = spaces()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.stepper = MODEL.stepper(dt)
        self.y = np.zeros((num_envs, 4))
        self.fallen = np.zeros(num_envs, dtype=bool)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.y[:] = self.np_random.uniform(-0.05, 0.05, self.y.shape)
        self.fallen[:] = False
        return self.y.copy(), {}

    def step(self, actions):
        again = self.fallen
        self.stepper.step(self.y, PUSH_MAX * np.asarray(actions, dtype=np.float64), out=self.y)
        self.y[again] = self.np_random.uniform(-0.05, 0.05, (again.sum(), 4))
        self.fallen = has_fallen(self.y)
        return self.y.copy(), np.where(again, 0.0, 1.0), self.fallen.copy(), np.zeros(self.num_envs, dtype=bool), {}


def length(policy, seed, most=500):
    """Steps until the pendulum has fallen."""
    environment = CartPole()
    y, _ = environment.reset(seed=seed)
    for k in range(most):
        y, _, has_ended, _, _ = environment.step(policy(y))
        if has_ended:
            return k + 1
    return most


if __name__ == "__main__":
    check_env(CartPole(), skip_render_check=True)
    idle = [length(lambda y: [0.0], seed) for seed in range(10)]
    held = [length(lambda y: np.clip([y @ [0.1, 3.0, 0.2, 0.6]], -1.0, 1.0), seed) for seed in range(10)]
    print(f"steps without a force: {idle}, with one: {held}")
    assert max(idle) < 200 and min(held) == 500

    carts = CartPoles(1024)
    carts.reset(seed=0)
    reward = sum(carts.step(carts.action_space.sample())[1].sum() for _ in range(100))
    print(f"{reward:.0f} steps of carts that are pushed at random")
