"""States that a loop moves on."""

import threading

import numpy as np
import pytest

import pyhamel

START = np.array([0.4, -0.3, 2.0, 0.0, 0.6, 0.8])


def top():
    return pyhamel.load("heavy_top")


def board():
    return pyhamel.load("snakeboard", scene="controlled")


def test_a_step_is_the_motion_over_its_time():
    model = top()
    y = model.stepper(0.3).step(START)
    np.testing.assert_allclose(y, model.simulate(0.3, START, rtol=1e-12).y_end, rtol=0, atol=1e-8)
    fixed = model.stepper(0.3, method="rk4", step=0.01).step(START)
    assert np.array_equal(fixed, model.simulate(0.3, START, method="rk4", step=0.01).y_end)
    # One step of the whole length, unless another one is given.
    whole = model.stepper(0.3, method="rk4").step(START)
    assert np.array_equal(whole, model.simulate(0.3, START, method="rk4", step=0.3).y_end)
    back = model.stepper(-0.3).step(y)
    np.testing.assert_allclose(back, START, rtol=0, atol=1e-8)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8, 9, 13, 1003])
def test_rows_are_moved_as_single_states_are(n):
    states = START + 0.1 * np.random.default_rng(n).normal(size=(n, 6))
    stepper = top().stepper(0.05, method="rk4")
    moved = stepper.step(states)
    assert moved.shape == (n, 6) and not np.shares_memory(moved, states)
    for row, own in zip(states, moved):
        assert np.array_equal(stepper.step(row), own)
    for threads in (True, False):
        assert np.array_equal(stepper.step(states, threads=threads), moved)
    adaptive = top().stepper(0.05)
    for row, own in zip(states, adaptive.step(states)):
        np.testing.assert_allclose(adaptive.step(row), own, rtol=0, atol=1e-8)


def test_results_do_not_depend_on_threads():
    states = START + 0.1 * np.random.default_rng(7).normal(size=(20_011, 6))
    stepper = top().stepper(0.2)
    assert np.array_equal(stepper.step(states, threads=True), stepper.step(states, threads=False))


def test_states_are_moved_in_their_place():
    stepper = top().stepper(0.01)
    y = START.copy()
    assert stepper.step(y, out=y) is y
    assert np.array_equal(y, stepper.step(START))
    given, out = START.tolist(), np.empty(6)
    assert stepper.step(given, out=out) is out
    assert np.array_equal(out, y)


def test_inputs_are_held():
    model = board()
    stepper = model.stepper(0.1)
    assert stepper.inputs == ("tau1", "tau2")
    start = model.simulate(1.0).y0
    for u, held in (([0.3, -0.1], {"tau1": 0.3, "tau2": -0.1}), ({"tau2": 0.2}, {"tau2": 0.2})):
        expected = model.simulate(0.1, start, inputs=held, rtol=1e-12).y_end
        np.testing.assert_allclose(stepper.step(start, u), expected, rtol=0, atol=1e-9)
    # The model's own, before and after.
    np.testing.assert_array_equal(stepper.step(start), stepper.step(start, [0.0, 0.0]))
    states = np.tile(start, (5, 1))
    torques = np.random.default_rng(2).normal(size=(5, 2))
    # Steps of one size give each row the bits of a call of its own.
    stepper = model.stepper(0.1, method="rk4")
    moved = stepper.step(states, torques)
    for row, u, own in zip(states, torques, moved):
        np.testing.assert_array_equal(stepper.step(row, u), own)
    np.testing.assert_array_equal(stepper.step(states, torques[0])[3], stepper.step(states, {"tau": torques[0]})[3])
    assert not np.array_equal(moved[0], stepper.step(states)[0])


def test_the_default_scene_gives_way_where_there_are_inputs():
    stepper = pyhamel.load("snakeboard").stepper(0.1)
    assert stepper.inputs == ("tau1", "tau2")
    assert stepper.model.scene == "controlled"
    assert top().stepper(0.1).inputs == ()


def test_inputs_of_expressions_go_by_the_time():
    model = board().with_inputs(tau1="0.2*sin(3*t)")
    start = model.simulate(1.0).y0
    moved = model.stepper(0.1).step(model.stepper(0.1).step(start), t=0.1)
    np.testing.assert_allclose(moved, model.simulate(0.2, start).y_end, rtol=0, atol=1e-8)


def test_a_call_of_the_model_keeps_its_stepper():
    model = top()
    first = model.step(START, None, 0.02)
    kept = model._stepping[1]
    assert np.array_equal(first, model.step(START, None, 0.02)) and model._stepping[1] is kept
    assert np.array_equal(model.step(START, None, 0.02, method="rk4"), model.stepper(0.02, method="rk4").step(START))
    assert model._stepping[1] is not kept


def test_what_is_wrong_is_told():
    stepper = top().stepper(0.1)
    for call, text in (
        (lambda: stepper.step(START[:5]), "has to be"),
        (lambda: stepper.step(START.reshape(1, 1, 6)), "has to be"),
        (lambda: stepper.step(START, [1.0]), "takes no inputs"),
        (lambda: stepper.step(START, out=np.empty((6, 2))[:, 0]), "contiguous"),
        (lambda: stepper.step(START, out=np.empty(6, dtype=np.float32)), "float64"),
        (lambda: board().stepper(0.1).step(np.zeros(5), [1.0, 2.0, 3.0]), "u is of shape"),
        (lambda: board().stepper(0.1).step(np.zeros(5), {"tau3": 1.0}), "no input `tau3`"),
        (lambda: board().stepper(0.1).step(np.zeros(5), [np.nan, 0.0]), "finite"),
        (lambda: top().stepper(0.0), "dt"),
        (lambda: top().stepper(0.1, method="rk5"), "rk5"),
        (lambda: top().stepper(0.1, rtol=-1.0), "tolerance"),
    ):
        with pytest.raises(pyhamel.InputError, match=text):
            call()


FALLING = "model falling { param g = 9.81; coordinate z in (0, 1000); lagrangian = z_dot^2/2 - g*z; }"


def test_a_state_that_cannot_be_moved_stays():
    stepper = pyhamel.load(FALLING).stepper(0.1)
    states = np.array([[2.0, 0.0], [0.01, -1.0], [3.0, 0.0], [1.0, 0.0], [0.02, -1.0]])
    moved = states.copy()
    with pytest.raises(pyhamel.IntegrationError, match="state 1 of 5"):
        stepper.step(moved, out=moved)
    assert np.array_equal(moved[[1, 4]], states[[1, 4]])
    np.testing.assert_allclose(moved[[0, 2, 3], 0], states[[0, 2, 3], 0] - 9.81 * 0.1**2 / 2, rtol=0, atol=1e-12)
    with pytest.raises(pyhamel.IntegrationError) as stopped:
        stepper.step(states[1])
    assert stopped.value.state == {"z": 0.01, "z_dot": -1.0}


def test_events_that_act_are_refused():
    text = FALLING[:-1] + " event floor = z - 0.1 falling { then z_dot = -z_dot; } }"
    with pytest.raises(pyhamel.InputError, match="events"):
        pyhamel.load(text).stepper(0.1)


def test_threads_may_share_a_stepper():
    stepper = top().stepper(0.01)
    expected = START.copy()
    for _ in range(200):
        stepper.step(expected, out=expected)
    found = []

    def walk():
        y = START.copy()
        for _ in range(200):
            stepper.step(y, out=y)
        found.append(y)

    threads = [threading.Thread(target=walk) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4 and all(np.array_equal(y, expected) for y in found)
