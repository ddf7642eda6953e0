"""Arrays of any shape, order and type: the same bits, and copied only where it is said."""

import threading

import numpy as np
import pytest

import pyhamel


@pytest.fixture(scope="module")
def top():
    return pyhamel.load("heavy_top")


def states(n, seed=7):
    return np.random.default_rng(seed).normal(size=(n, 6))


@pytest.mark.parametrize("n", [1, 7, 8, 9, 16, 23, 63, 64, 65, 71, 130])
def test_a_batch_has_the_bits_of_single_states(top, n):
    y = states(n)
    single = np.array([top.rhs(row) for row in y])
    assert np.array_equal(top.rhs(y), single)
    for threads in (False, True):
        assert np.array_equal(top.rhs(y, threads=threads), single)
        assert np.array_equal(top.rhs(np.asfortranarray(y), threads=threads), single)


@pytest.mark.parametrize(
    "change",
    [
        np.asfortranarray,
        lambda y: np.repeat(y, 2, axis=0)[::2],
        lambda y: np.repeat(y, 3, axis=1)[:, ::3],
        lambda y: y[::-1][::-1],
        lambda y: y.astype(">f8"),
        lambda y: y.tolist(),
    ],
)
def test_order_strides_and_types_change_no_bit(top, change):
    y = states(21)
    assert np.array_equal(top.rhs(change(y)), top.rhs(y))
    assert np.array_equal(top.rhs(change(y), threads=True), top.rhs(y))
    assert np.array_equal(top.jacobian(change(y)), top.jacobian(y))


def test_backwards_arrays_are_read_where_they_are(top):
    y = states(9)
    assert np.array_equal(top.rhs(y[::-1]), top.rhs(y)[::-1])


def test_an_array_that_is_not_aligned_is_read(top):
    y = states(5)
    raw = np.zeros(y.nbytes + 1, dtype=np.uint8)
    shifted = raw[1:].view(np.float64).reshape(y.shape)
    shifted[...] = y
    assert not shifted.flags.aligned
    assert np.array_equal(top.rhs(shifted), top.rhs(y))


def test_axes_in_front_are_states_side_by_side(top):
    y = states(24).reshape(2, 3, 4, 6)
    flat = y.reshape(-1, 6)
    assert np.array_equal(top.rhs(y), top.rhs(flat).reshape(y.shape))
    assert top.energy(y).shape == (2, 3, 4)
    assert top.jacobian(y).shape == (2, 3, 4, 6, 6)
    assert np.array_equal(top.jacobian(y).reshape(-1, 6, 6), top.jacobian(flat))
    assert top.outputs(y)["momentum"].shape[:-1] == (2, 3, 4)
    assert top.rhs(np.empty((0, 6))).shape == (0, 6)


def test_results_are_written_to_out(top):
    y = states(10)
    for out in (np.zeros_like(y), np.zeros_like(y, order="F"), np.zeros((20, 6))[::2]):
        assert top.rhs(y, out=out) is out
        assert np.array_equal(out, top.rhs(y))
    one = np.zeros(6)
    assert top.rhs(y[0], out=one) is one
    assert np.array_equal(one, top.rhs(y)[0])
    with pytest.raises(pyhamel.InputError, match="shape"):
        top.rhs(y, out=np.zeros((9, 6)))


def test_memory_is_not_copied(top):
    import tracemalloc

    y, out = states(20000), np.empty((20000, 6))
    top.rhs(y, out=out)
    tracemalloc.start()
    top.rhs(y, out=out)
    top.rhs(np.asfortranarray(y)[::1], out=out)
    top.rhs(y[::-1], out=out)
    # The array in the order of Fortran is the test's own.
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1.2 * y.nbytes


def test_derivatives_are_those_of_the_rates(top):
    y, dy = states(4), states(4, seed=8)
    jacobian = top.jacobian(y)
    along = np.einsum("kij,kj->ki", jacobian, dy)
    np.testing.assert_allclose(top.jvp(y, dy), along, rtol=1e-12, atol=1e-12)
    h = 1e-6
    central = (top.rhs(y + h * dy) - top.rhs(y - h * dy)) / (2 * h)
    np.testing.assert_allclose(along, central, rtol=1e-7, atol=1e-7)
    by_m = top.jvp(y, np.zeros_like(y), dparams={"m": 1.0})
    m = top.params["m"]
    central = (top.with_params(m=m + h).rhs(y) - top.with_params(m=m - h).rhs(y)) / (2 * h)
    np.testing.assert_allclose(by_m, central, rtol=1e-6, atol=1e-7)


def test_forces_by_accelerations():
    satellite = pyhamel.load("two_arm_satellite", scene="dynamics")
    assert satellite.velocities == ("alpha_dot", "beta_dot", "Omega1", "Omega2", "Omega3")
    rng = np.random.default_rng(5)
    y, a = rng.normal(size=(2, 3, 7)), rng.normal(size=(3, 5))
    matrix, forces = satellite.mass_matrix(y), satellite.inverse_dynamics(y, a)
    assert matrix.shape == (2, 3, 5, 5) and forces.shape == (2, 3, 5)
    np.testing.assert_allclose(matrix, np.swapaxes(matrix, -1, -2), rtol=1e-14)
    # The rates of the motion need no forces; others need `A` times the difference.
    rates = satellite.rhs(y)[..., [satellite.state.index(u) for u in satellite.velocities]]
    np.testing.assert_allclose(satellite.inverse_dynamics(y, rates), 0.0, atol=1e-13)
    np.testing.assert_allclose(forces, np.einsum("...ij,...j->...i", matrix, a - rates), atol=1e-12)
    one = satellite.inverse_dynamics(y[1, 2], a[2])
    assert one.shape == (5,) and np.array_equal(one, forces[1, 2])


def test_forces_that_are_not_wanted_are_told():
    with pytest.raises(pyhamel.InputError, match="want inverse_dynamics;"):
        pyhamel.load("two_arm_satellite").inverse_dynamics(np.zeros(7), np.zeros(5))
    with pytest.raises(pyhamel.InputError, match="want mass_matrix;"):
        pyhamel.load("two_arm_satellite").mass_matrix(np.zeros(7))
    satellite = pyhamel.load("two_arm_satellite", scene="dynamics")
    with pytest.raises(pyhamel.InputError, match="5 components: alpha_dot"):
        satellite.inverse_dynamics(np.zeros(7), np.zeros(4))
    with pytest.raises(pyhamel.InputError, match="do not fit"):
        satellite.inverse_dynamics(np.zeros((2, 7)), np.zeros((3, 5)))
    with pytest.raises(pyhamel.InputError, match="finite"):
        satellite.inverse_dynamics(np.full(7, np.nan), np.zeros(5))


def test_the_time_has_a_derivative():
    driven = pyhamel.load("""
        model driven {
            param a = 2;
            coordinate x in real;
            lagrangian = x_dot^2/2 + a*x*sin(3*t);
        }
    """)
    y = np.array([0.3, 0.1])
    at = driven.state.index("x")
    rates = driven.jvp(y, np.zeros(2), 0.4, dt=1.0)
    assert rates[at] == 0.0
    np.testing.assert_allclose(rates[1 - at], 6 * np.cos(1.2), rtol=1e-14)


def test_threads_of_python_compute_side_by_side(top):
    y = states(50000)
    expected = top.rhs(y)
    results = [None] * 4

    def work(k):
        results[k] = top.rhs(y)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(result, expected) for result in results)


def test_a_long_call_does_not_hold_python(top):
    y = states(400000)
    out = np.empty_like(y)
    counted = 0
    done = threading.Event()

    def work():
        for _ in range(5):
            top.rhs(y, out=out, threads=False)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.wait(1e-4):
        counted += 1
    thread.join()
    # Were Python held, the five calls would leave five chances.
    assert counted > 10


def test_a_total_state_is_mapped_to_one_of_the_quotient():
    space = pyhamel.load("body_in_fluid")
    body = pyhamel.load("body_in_fluid_by_translations", scene="from_space")
    assert body.reduces == ("body_in_fluid.hamel",)
    assert body.total_state == space.state
    assert body.total_params == dict(space.params)
    rng = np.random.default_rng(7)
    turns = np.linalg.qr(rng.normal(size=(5, 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    y = np.concatenate([rng.normal(size=(5, 9)), turns.reshape(5, 9)], axis=-1)
    # The rates of the quotient are those of the total system along the map, by differences.
    changed = {"M1": 2.4, "C12": 0.1}
    moved, reduced = space.with_params(**changed), body.with_params(**body.quotient_params(changed))
    assert reduced.params["M1"] == 2.4
    h = 1e-6
    ahead, behind = (body.quotient(y + s * h * moved.rhs(y), changed) for s in (1, -1))
    np.testing.assert_allclose(reduced.rhs(body.quotient(y, changed)), (ahead - behind) / (2 * h), rtol=1e-7, atol=1e-7)
    one = body.quotient(y[0])
    assert one.shape == (15,) and np.array_equal(one, body.quotient(y)[0])
    again = pyhamel.load("body_in_fluid_by_translations").with_scene("from_space")
    assert np.array_equal(again.quotient(y), body.quotient(y))


def test_maps_that_are_not_there_are_told():
    with pytest.raises(pyhamel.InputError, match="want quotient;"):
        pyhamel.load("heavy_top").quotient(np.zeros(18))
    body = pyhamel.load("body_in_fluid_by_translations", scene="from_space")
    with pytest.raises(pyhamel.InputError, match="18 components: r1"):
        body.quotient(np.zeros(15))
    with pytest.raises(pyhamel.InputError, match="no parameter `mass`"):
        body.quotient(np.zeros(18), {"mass": 1})
