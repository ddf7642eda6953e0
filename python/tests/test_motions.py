"""Motions, ensembles, solvers of others, and what they look like."""

import pickle

import numpy as np
import pytest

import pyhamel

START = {"Omega1": 0.4, "Omega2": -0.3, "Omega3": 2.0, "Gamma1": 0.0, "Gamma2": 0.6, "Gamma3": 0.8}


@pytest.fixture(scope="module")
def top():
    return pyhamel.load("heavy_top")


def test_a_motion_keeps_what_it_has_to(top):
    motion = top.simulate(3.0, START, samples=31)
    assert motion.t.shape == (31,) and motion.y.shape == (31, 6)
    assert motion.t[0] == 0.0 and motion.t[-1] == 3.0
    assert np.array_equal(motion.y[-1], motion.y_end) and np.array_equal(motion.y[0], list(START.values()))
    assert np.ptp(motion.energy) < 1e-8 and motion.stats["energy_drift"] < 1e-9
    np.testing.assert_allclose(np.linalg.norm(motion.y[:, 3:], axis=1), 1.0, atol=1e-9)
    assert motion.stats["method"] in pyhamel.methods() and motion.stats["method"] != "auto"
    np.testing.assert_array_equal(motion["Omega3"], motion.y[:, 2])
    np.testing.assert_allclose(motion.outputs["momentum"], top.outputs(motion.y)["momentum"], rtol=1e-15)


def test_times_are_a_time_a_span_or_an_array(top):
    end = top.simulate(2.0, START).y_end
    assert np.array_equal(top.simulate((0, 2.0), START).y_end, end)
    times = [0.0, 0.1, 0.7, 2.0]
    motion = top.simulate(times, START)
    assert motion.t.tolist() == times
    np.testing.assert_allclose(motion.y[-1], end, rtol=1e-9)
    np.testing.assert_allclose(motion.y[2], top.simulate(0.7, START).y_end, rtol=1e-7)
    back = top.simulate(-2.0, motion.y_end)
    np.testing.assert_allclose(back.y_end, list(START.values()), atol=1e-7)
    for wrong in ([1.0, 2.0], [0.0, 2.0, 1.0], [], [0.0, np.nan]):
        with pytest.raises(pyhamel.InputError):
            top.simulate(wrong, START)


def test_names_that_do_not_exist_are_refused(top):
    with pytest.raises(pyhamel.InputError, match=r"y0 has no state `Omega4`"):
        top.simulate(1.0, {"Omega4": 1.0})
    with pytest.raises(pyhamel.InputError, match="method"):
        top.simulate(1.0, START, method="euler")
    with pytest.raises(pyhamel.InputError, match="step is missing"):
        top.simulate(1.0, START, method="rk4")
    with pytest.raises(pyhamel.InputError, match="step"):
        top.simulate(1.0, START, step=0.1)
    with pytest.raises(pyhamel.InputError, match="events unknown name"):
        top.simulate(1.0, START, events=["Omega9"])


def test_the_rest_of_a_state_is_chosen_on_the_constraint():
    model = pyhamel.load("veselova")
    motion = model.simulate(1.0)
    assert len(motion.y0) == len(model.state)


def test_events_are_told(top):
    motion = top.simulate(5.0, START, events=["Omega1 rising"])
    assert motion.events
    for event in motion.events:
        assert event.name == "section1" and abs(event.y[0]) < 1e-8
        assert top.rhs(event.y)[0] > 0


def test_derivatives_of_a_motion(top):
    motion = top.simulate(1.0, START, sensitivity=["m", "Omega3"], samples=5)
    h = 1e-5
    for name in ("m", "Omega3"):
        def end(value, name=name):
            if name == "m":
                return top.simulate(1.0, START, params={"m": value}, samples=0).y_end
            return top.simulate(1.0, {**START, name: value}, samples=0).y_end

        at = top.params["m"] if name == "m" else START[name]
        central = (end(at + h) - end(at - h)) / (2 * h)
        np.testing.assert_allclose(motion.sensitivity_end[name], central, atol=1e-5)
        assert motion.sensitivity[name].shape == (5, 6)


SINGULAR = """
model attracted {
    coordinate x in real;
    lagrangian = x_dot^2/2 + x^2;
}
"""


def test_what_cannot_go_on_says_where():
    model = pyhamel.load(SINGULAR)
    with pytest.raises(pyhamel.IntegrationError) as caught:
        model.simulate(20.0, {"x": 1.0, "x_dot": 1.0}, max_steps=5)
    assert caught.value.t > 0 and set(caught.value.state) == set(model.state)
    assert "integration stopped at t = " in str(caught.value)


def test_steps_are_bounded():
    model = pyhamel.load(SINGULAR)
    start = {"x": 1.0, "x_dot": 1.0}
    assert model.simulate(1.0, start, max_step=0.01).stats["steps"] >= 100 > model.simulate(1.0, start).stats["steps"]
    with pytest.raises(pyhamel.InputError, match="max_step is 0.0: give a positive, finite time"):
        model.simulate(1.0, start, max_step=0.0)
    with pytest.raises(pyhamel.InputError, match="max_step is given together with a fixed step"):
        model.simulate(1.0, start, method="rk4", step=0.1, max_step=0.1)
    many = model.ensemble(1.0, {"x": [1.0, 2.0], "x_dot": 1.0}, max_step=0.01)
    assert np.all(np.asarray(many.steps) >= 100)


def test_motions_pickle_and_become_data_sets(top):
    xarray = pytest.importorskip("xarray")
    motion = top.simulate(1.0, START, params={"m": 2.0}, samples=11, events=["Omega1"])
    again = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(again.y, motion.y) and again.stats == motion.stats and len(again.events) == len(motion.events)
    assert again.model.params["m"] == 2.0
    data = motion.to_xarray()
    assert isinstance(data, xarray.Dataset) and data.attrs["m"] == 2.0
    np.testing.assert_array_equal(data["Gamma3"].sel(t=1.0), motion.y[-1, 5])
    assert "momentum.p_Omega1" in data


def test_a_notebook_shows_a_figure_that_moves(top):
    html = top.simulate(1.0, START)._repr_html_()
    assert "data:image/svg+xml" in html and "<iframe" in html and "motion-data" in html
    assert pyhamel.load("lotka_volterra").simulate(1.0).moving() is None


def test_a_large_ensemble_has_the_bits_of_the_command(top, tmp_path):
    zarr = pytest.importorskip("zarr")
    masses = np.linspace(1.0, 2.0, 20_003)
    masses[5] = -1.0
    many = top.ensemble(0.01, START, {"m": masses})
    top.ensemble(0.01, START, {"m": masses}, out=str(tmp_path / "tops.zarr"))
    stored = zarr.open_group(str(tmp_path / "tops.zarr"), mode="r")
    assert np.array_equal(stored["y"][:], many.y, equal_nan=True)
    assert np.array_equal(stored["steps"][:], many.steps)
    assert many.errors[5] and not many.ok[5] and many.ok.sum() == masses.size - 1


def test_an_ensemble_has_the_bits_of_simulate(top):
    spins = np.linspace(1.0, 5.0, 7)
    many = top.ensemble(1.0, {**START, "Omega3": spins}, {"m": 2.0}, lanes=1, samples=3, method="dop853")
    assert many.y.shape == (7, 3, 6) and many.ok.all() and len(many) == 7
    for k, spin in enumerate(spins):
        one = top.simulate(1.0, {**START, "Omega3": spin}, {"m": 2.0}, method="dop853", samples=3)
        assert np.array_equal(many.y[k], one.y)
    four = top.ensemble(1.0, {**START, "Omega3": spins}, {"m": 2.0}, samples=3)
    np.testing.assert_allclose(four.y, many.y, rtol=1e-7, atol=1e-8)
    assert np.array_equal(four.y, top.ensemble(1.0, {**START, "Omega3": spins}, {"m": 2.0}, samples=3, threads=1).y)
    y0 = np.tile(list(START.values()), (5, 1))
    masses = np.linspace(1, 2, 5)
    by_array = top.ensemble(0.5, y0, {"m": masses})
    assert np.array_equal(by_array.params[:, 3], masses) and by_array.y.shape == (5, 1, 6)
    np.testing.assert_array_equal(by_array["Omega1"], by_array.y[:, :, 0])


def test_a_trajectory_that_stops_leaves_the_others_alone(top):
    many = top.ensemble(1.0, START, {"m": [1.0, -1.0, 2.0]})
    assert many.ok.tolist() == [True, False, True]
    assert "m > 0 does not hold" in many.errors[1] and np.isnan(many.y[1]).all() and np.isfinite(many.y[[0, 2]]).all()
    assert "1 stopped" in repr(many)
    with pytest.raises(pyhamel.InputError, match="shapes"):
        top.ensemble(1.0, {"Omega1": [1.0, 2.0]}, {"m": [1.0, 2.0, 3.0]})
    with pytest.raises(pyhamel.InputError, match="mass"):
        top.ensemble(1.0, {}, {"mass": [1.0]})
    assert top.ensemble(1.0, START).to_xarray()["error"].item() == ""


def test_casadi_takes_a_model_and_its_derivatives(top):
    casadi = pytest.importorskip("casadi")
    f = top.casadi()
    y = casadi.MX.sym("y", 6)
    whole = casadi.Function("whole", [y], [f(0.0, y), casadi.jacobian(f(0.0, y), y)])
    at = np.array(list(START.values()))
    rates, jacobian = whole(at)
    assert np.array_equal(np.asarray(rates).ravel(), top.rhs(at))
    np.testing.assert_allclose(np.asarray(jacobian), top.jacobian(at), rtol=1e-15)
    problem = {"x": y, "ode": f(0.0, y)}
    end = casadi.integrator("end", "cvodes", problem, 0.0, 1.0, {"abstol": 1e-10, "reltol": 1e-10})(x0=at)["xf"]
    np.testing.assert_allclose(np.asarray(end).ravel(), top.simulate(1.0, START).y_end, atol=1e-6)


# Packages that JAX imports warn of each other.
@pytest.mark.filterwarnings("ignore")
def test_jax_takes_a_model_and_its_derivatives(top):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    f = top.jax()
    y = np.random.default_rng(3).normal(size=(4, 6))
    np.testing.assert_array_equal(jax.jit(f)(0.0, y[0]), top.rhs(y[0]))
    np.testing.assert_allclose(jax.jacfwd(f, argnums=1)(0.0, y[0]), top.jacobian(y[0]), rtol=1e-14)
    np.testing.assert_allclose(jax.jacrev(f, argnums=1)(0.0, y[0]), top.jacobian(y[0]), rtol=1e-14)
    np.testing.assert_array_equal(jax.vmap(f, in_axes=(None, 0))(0.0, y), top.rhs(y))
    np.testing.assert_array_equal(jax.vmap(f)(np.arange(4.0), y), top.rhs(y))


@pytest.mark.filterwarnings("ignore")
def test_diffrax_integrates_a_model(top):
    diffrax, jax = pytest.importorskip("diffrax"), pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    y0 = np.array(list(START.values()))
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(top.jax()), diffrax.Dopri8(), 0.0, 1.0, 0.01, jax.numpy.asarray(y0),
        stepsize_controller=diffrax.PIDController(rtol=1e-9, atol=1e-10),
    )  # fmt: skip
    np.testing.assert_allclose(found.ys[-1], top.simulate(1.0, START).y_end, atol=1e-7)


def test_scipy_integrates_a_model(top):
    integrate = pytest.importorskip("scipy.integrate")
    y0 = list(START.values())
    for method in ("DOP853", "Radau"):
        found = integrate.solve_ivp(top, (0, 1.0), y0, method=method, rtol=1e-9, atol=1e-11, **(
            {"jac": top.jac} if method == "Radau" else {}
        ))
        np.testing.assert_allclose(found.y[:, -1], top.simulate(1.0, y0).y_end, atol=1e-6)
    vectorised = integrate.solve_ivp(lambda t, y: top(t, y.T).T, (0, 1.0), y0, method="BDF", vectorized=True)
    assert vectorised.success


def test_mistakes_are_told_in_words_of_python(top, tmp_path):
    wire = pyhamel.load(
        "model wire { coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2; constraint x^2 + y^2 = 1; multipliers; "
        "initial x = 1; initial y = 0; initial y_dot = 1; }"
    )
    runs = str(tmp_path / "runs.zarr")
    top.ensemble(0.1, params={"m": [1.0, 2.0]}, out=runs)
    for call, words in [
        (lambda: wire.simulate(1.0, {"x": 1.0, "y": 0.0, "x_dot": 1.0}), r"another state with y0=\{name: value\}"),
        (lambda: top.simulate(1.0, START, events=["Omega9"]), "^events"),
        (lambda: top.ensemble(1.0, params={"m": [1.0, 2.0]}, threads=5000), "^threads is 5000"),
        (lambda: top.ensemble(0.1, params={"m": [1.0, 2.0]}, out=runs), "give resume=True to go on with it"),
        (lambda: top.ensemble(0.1, params={"m": [1.0, 2.0]}, out=str(tmp_path / "x.foo")), "or, with statistics, in"),
    ]:
        with pytest.raises(pyhamel.InputError, match=words) as caught:
            call()
        assert "--" not in str(caught.value)


@pytest.mark.parametrize(
    "mistake, words",
    [
        (dict(max_steps=-1), "max_steps is -1, but has to be a whole number, 0 or more"),
        (dict(max_events=1.5), "max_events is 1.5, but has to be a whole number"),
        (dict(noise_seed=-1), "noise_seed is -1"),
        (dict(noise_path=2**40), "noise_path is 1099511627776, but has to be a whole number, from 0 to 4294967295"),
        (dict(step="0.1"), "step is '0.1', but has to be a number"),
        (dict(rtol=None, atol=[1.0, 2.0]), r"atol is \[1.0, 2.0\], but has to be a number"),
        (dict(method=3), "method is 3, but has to be the name of one"),
        (dict(events="Omega1"), "events is the text 'Omega1': give a list of texts"),
        (dict(sensitivity="m"), "sensitivity is the text 'm': give a list of texts"),
    ],
)
def test_arguments_of_another_kind_are_told_by_their_names(top, mistake, words):
    with pytest.raises(pyhamel.InputError, match=words):
        top.simulate(1.0, START, **mistake)


def test_arguments_of_ensembles_and_models_are_told_by_their_names(top):
    for mistake, words in [
        (dict(threads=-1), "threads is -1"),
        (dict(samples=-1), "samples is -1"),
        (dict(max_steps="many"), "max_steps is 'many'"),
    ]:
        with pytest.raises(pyhamel.InputError, match=words):
            top.ensemble(1.0, params={"m": [1.0, 2.0]}, **mistake)
    with pytest.raises(pyhamel.InputError, match="budget is 0, but has to be a whole number, 1 or more"):
        pyhamel.load("heavy_top", budget=0)
