"""Inputs: held, by expressions, by tables."""

import pickle

import numpy as np
import pytest

import pyhamel

CART = """model cart { param m = 2; input push = 0.5; coordinate x in real; lagrangian = m/2*x_dot^2; force x_dot = push; }"""


@pytest.fixture(scope="module")
def cart():
    return pyhamel.load(CART)


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


def test_functions_are_called_at_the_times_of_a_table(cart):
    start, t = [0.0, 0.0], np.linspace(0, 2, 41)
    # x'' = t^2/2 from rest, and cubics are exact for parabolas.
    for inputs in ({"t": t, "push": lambda t: t**2}, {"push": lambda t: t**2}):
        motion = cart.simulate(2.0, start, inputs=inputs)
        np.testing.assert_allclose(motion.y_end, [16 / 24, 8 / 6], rtol=1e-9)
    back = cart.simulate(-2.0, start, inputs={"push": lambda t: t**2})
    np.testing.assert_allclose(back.y_end, [16 / 24, -8 / 6], rtol=1e-9)
    # Held from row to row: x'' = 1/2, then -1/2.
    held = cart.simulate(2.0, start, inputs={"t": [0.0, 1.0], "push": [1.0, -1.0]}, interpolation="hold")
    np.testing.assert_allclose(held.y_end, [0.5, 0.0], atol=1e-8)


def test_series_go_from_row_to_row(cart):
    start, t = [0.0, 0.0], [0.0, 0.5, 2.0]
    # x'' = u/2 along straight lines: cubics from row to row.
    motion = cart.simulate(2.0, start, inputs={"t": t, "push": [0.0, 1.0, -2.0]}, method="taylor")
    np.testing.assert_allclose(motion.y_end, [5 / 24, -1 / 4], rtol=1e-14)
    held = cart.simulate(2.0, start, inputs={"t": [0, 1], "push": [1, -1]}, interpolation="hold", method="taylor")
    np.testing.assert_allclose(held.y_end, [0.5, 0.0], atol=1e-15)
    # A function is a cubic between the times at which it is called.
    curved = cart.simulate(2.0, start, inputs={"push": lambda t: t**2}, method="taylor")
    np.testing.assert_allclose(curved.y_end, [16 / 24, 8 / 6], rtol=1e-13)


PUSHED = """model pushed {
    input u: vector(2) = [0, 0.5];
    input K: symmetric(2) = [1, 0, 1];
    coordinate x in real;
    coordinate y in real;
    lagrangian = (x_dot^2 + y_dot^2)/2;
    force x_dot = u1 - K11*x - K12*y;
    force y_dot = u2 - K12*x - K22*y;
}"""


def test_vectors_and_matrices_are_inputs():
    pushed = pyhamel.load(PUSHED)
    state = [1.0, 2.0, 0.0, 0.0]
    held = pushed.with_inputs(u=[3.0, 4.0], K=[[1.0, 2.0], [2.0, 5.0]])
    assert held.inputs == {"u1": 3.0, "u2": 4.0, "K11": 1.0, "K12": 2.0, "K22": 5.0}
    np.testing.assert_allclose(held.rhs(state)[2:], [3.0 - 5.0, 4.0 - 12.0], rtol=1e-15)
    np.testing.assert_allclose(pushed.rhs(state, u={"u": np.ones(2)})[2:], [0.0, -1.0], atol=1e-15)
    # x'' = t, y'' = 1 - t from rest.
    t = np.array([0.0, 2.0])
    free = {"K": np.zeros((2, 2)), "t": t}
    for u in (np.stack([t, 1 - t], axis=-1), lambda t: [t, 1 - t], "[t, 1 - t]"):
        inputs = {**free, "u": u} if not isinstance(u, str) else {"u": u, "K": free["K"]}
        motion = pushed.simulate(2.0, np.zeros(4), inputs=inputs)
        np.testing.assert_allclose(motion.y_end, [4 / 3, 2 - 4 / 3, 2.0, 0.0], atol=1e-9)
    still = pushed.with_inputs(K=np.zeros((2, 2)))
    many = still.ensemble(1.0, np.zeros(4), inputs={"u": [[2.0, 0.0], [0.0, 4.0]]})
    np.testing.assert_allclose(many.y_end[:, :2], [[1.0, 0.0], [0.0, 2.0]], atol=1e-12)
    askew = [[1.0, 2.0], [3.0, 5.0]]
    for wrong, part in [({"u": [1.0]}, r"\(2,\)"), ({"K": askew}, "symmetric"), ({"K": 1.0}, r"\(2, 2\)")]:
        with pytest.raises(pyhamel.InputError, match=part):
            pushed.with_inputs(**wrong)


def test_ensembles_have_inputs_of_their_own(cart):
    driven = cart.with_scene("controlled")
    pushes = np.linspace(-1.0, 1.0, 7)
    many = driven.ensemble(2.0, [0.0, 0.0], inputs={"push": pushes})
    np.testing.assert_allclose(many.y_end[:, 0], pushes, rtol=1e-12, atol=1e-15)
    for k, push in enumerate(pushes):
        one = driven.ensemble(2.0, [0.0, 0.0], inputs={"push": push}, lanes=1)
        alone = driven.with_inputs(push=push).simulate(2.0, [0.0, 0.0], method="dop853")
        np.testing.assert_array_equal(one.y_end[0], alone.y_end)
        np.testing.assert_allclose(many.y_end[k], alone.y_end, rtol=1e-12, atol=1e-15)
    # With masses besides, and what is held already stays.
    both = driven.with_inputs(push=4.0).ensemble(2.0, [0.0, 0.0], {"m": [1.0, 2.0, 4.0]})
    np.testing.assert_allclose(both.y_end[:, 0], [8.0, 4.0, 2.0], rtol=1e-12)
    with pytest.raises(pyhamel.InputError, match="pull"):
        driven.ensemble(1.0, [0.0, 0.0], inputs={"pull": [1.0]})


def test_another_scene_keeps_inputs(cart):
    held = cart.with_inputs(push=3.0)
    assert held.with_scene("controlled").inputs == {"push": 3.0}


def test_what_is_no_input_is_refused(cart):
    with pytest.raises(pyhamel.InputError, match="pull"):
        cart.with_inputs(pull=1.0)
    with pytest.raises(pyhamel.InputError, match="function"):
        cart.with_inputs(push=lambda t, y: t)
    with pytest.raises(pyhamel.InputError, match="`t`"):
        cart.with_inputs(push=np.ones(3))
    with pytest.raises(pyhamel.InputError, match="interpolation"):
        cart.with_inputs(t=[0.0, 1.0], push=[0.0, 1.0], interpolation="step")
