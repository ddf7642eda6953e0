"""Inputs: held, by expressions, by tables."""

import pickle

import numpy as np
import pytest

import hamel

CART = """model cart { param m = 2; input push = 0.5; coordinate x in real; lagrangian = m/2*x_dot^2; force x_dot = push; }"""


@pytest.fixture(scope="module")
def cart():
    return hamel.load(CART)


def test_inputs_are_held(cart):
    assert cart.inputs == {"push": 0.5}
    held = cart.with_inputs(push=3.0)
    assert held.inputs == {"push": 3.0}
    np.testing.assert_allclose(held.rhs([1.0, 2.0]), [2.0, 1.5], rtol=1e-15)
    np.testing.assert_allclose(cart.rhs([1.0, 2.0], u={"push": 3.0}), [2.0, 1.5], rtol=1e-15)
    np.testing.assert_allclose(cart.rhs([1.0, 2.0]), [2.0, 0.25], rtol=1e-15)
    assert pickle.loads(pickle.dumps(held)).inputs == {"push": 3.0}


def test_expressions_and_tables_drive(cart):
    # x'' = t/2 from rest: x = t^3/12.
    start, t = [0.0, 0.0], np.linspace(0, 2, 9)
    for inputs in ({"push": "t"}, {"t": t, "push": t}):
        motion = cart.simulate(2.0, start, inputs=inputs)
        np.testing.assert_allclose(motion.y_end, [8 / 12, 1.0], rtol=1e-9)
    curved = cart.simulate(2.0, start, inputs={"t": t, "push": t**2}, interpolation="cubic")
    straight = cart.simulate(2.0, start, inputs={"t": t, "push": t**2})
    exact = 16 / 24
    assert abs(curved.y_end[0] - exact) < abs(straight.y_end[0] - exact)


def test_what_is_no_input_is_refused(cart):
    with pytest.raises(hamel.InputError, match="pull"):
        cart.with_inputs(pull=1.0)
    with pytest.raises(hamel.InputError, match="function"):
        cart.with_inputs(push=lambda t, y: t)
    with pytest.raises(hamel.InputError, match="`t`"):
        cart.with_inputs(push=np.ones(3))
    with pytest.raises(hamel.InputError, match="interpolation"):
        cart.with_inputs(t=[0.0, 1.0], push=[0.0, 1.0], interpolation="step")
