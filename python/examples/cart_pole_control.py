"""A pendulum balanced on a cart by a linear-quadratic regulator of python-control.

    pip install './python[control]'
    python python/examples/cart_pole_control.py

The linear system comes from the model, the gain from its Riccati equation, and the motion from the model again, with
all that is not linear in it.
"""

from pathlib import Path

import control
import numpy as np

import pyhamel

model = pyhamel.load(Path(__file__).with_name("cart_pole.hamel"))
upright = model.linearize({"theta": 0.0}, outputs=["x", "theta"])
assert upright.eigenvalues[0].real > 4.0  # it falls

system = upright.to_control()
gain, _, poles = control.lqr(system, np.diag([10.0, 10.0, 1.0, 1.0]), np.eye(1))
push = " ".join(f"- ({k!r})*{name}" for k, name in zip(gain[0].tolist(), upright.state))
motion = model.simulate(10.0, {"theta": 0.5}, inputs={"push": push})
print(f"poles {np.round(poles, 2)}, at the end x = {motion['x'][-1]:.1e}, theta = {motion['theta'][-1]:.1e}")
assert np.abs(motion.y_end).max() < 1e-3

# A controller that sees place and angle alone, with noise, a hundred times a second: the force is held in between.
dt = 0.01
sampled = control.c2d(system, dt)
gain = control.dlqr(sampled, np.diag([10.0, 10.0, 1.0, 1.0]), np.eye(1))[0]
observer = control.dlqe(sampled, np.eye(1), 1e-6 * np.eye(2))[0]
stepper = model.stepper(dt)
noise = np.random.default_rng(0).normal(0.0, 1e-3, (1000, 2))
y, guess = np.array([0.0, 0.2, 0.0, 0.0]), np.zeros(4)
for k in range(len(noise)):
    seen = y[:2] + noise[k]
    guess += observer @ (seen - sampled.C @ guess)
    u = -gain @ guess
    stepper.step(y, u, t=k * dt, out=y)
    guess = sampled.A @ guess + sampled.B @ u
print(f"with noise x = {y[0]:.3f}, theta = {y[1]:.3f}")
assert np.abs(y[:2]).max() < 0.05
