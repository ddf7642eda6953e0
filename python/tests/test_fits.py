"""Fits: what SciPy finds with motions of its own, the bits of the command, every kind of data, every mistake."""

import json
import os
import pathlib
import pickle
import signal
import subprocess
import threading

import numpy as np
import pytest

import pyhamel

ROOT = pathlib.Path(__file__).parents[2]
TOP = ROOT / "docs/book/data/top.csv"
PENDULUM = ROOT / "docs/book/measured_pendulum.hamel"
OSCILLATOR = """model oscillator {
    /// Stiffness [N/m].
    param k = 4 where k > 0;
    /// Mass [kg].
    param m = 1;
    /// Length [m].
    param l = 1;
    /// Place [m].
    coordinate x in real;
    lagrangian = m*x_dot^2/2 - k*x^2/2;
    output end = 2*cos(x/l);
}"""
START = {"x": 0.3, "x_dot": -0.5}


@pytest.fixture(scope="module")
def oscillator():
    return pyhamel.load(OSCILLATOR)


@pytest.fixture(scope="module")
def program():
    """The program `hamel` of this clone, or the one that HAMEL_PROGRAM names."""
    built = [ROOT / "target" / kind / "hamel" for kind in ("debug", "release")]
    found = os.environ.get("HAMEL_PROGRAM") or max(filter(pathlib.Path.exists, built), key=os.path.getmtime, default=None)
    if found is None:
        pytest.skip("the program is not built")
    return found


def by_command(program, *arguments):
    found = subprocess.run([program, "fit", *arguments, "--json"], capture_output=True, text=True, cwd=ROOT)
    assert found.returncode == 0, found.stderr
    return json.loads(found.stdout)


def exact(k, t):
    """The place of the oscillator with m = 1."""
    w = np.sqrt(k)
    return START["x"] * np.cos(w * t) + START["x_dot"] / w * np.sin(w * t)


def noisy(n=60, sigma=0.01):
    t = np.linspace(0, 3, n)
    return {"t": t, "x": exact(5.3, t) + sigma * np.random.default_rng(1).normal(size=n)}


def test_values_and_covariances_are_those_of_scipy_along_motions_in_closed_form(oscillator):
    optimize = pytest.importorskip("scipy.optimize")
    data, sigma = noisy(), 0.01

    def residuals(p):
        k, v = p
        x = START["x"] * np.cos(np.sqrt(k) * data["t"]) + v / np.sqrt(k) * np.sin(np.sqrt(k) * data["t"])
        return (x - data["x"]) / sigma

    found = optimize.least_squares(residuals, [4.0, 0.0], jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    fit = oscillator.fit(data, ["k", "x_dot"], y0={"x": 0.3, "x_dot": 0.0}, sigma={"x": sigma})
    np.testing.assert_allclose([fit["k"], fit["x_dot"]], found.x, rtol=1e-7)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-4)
    np.testing.assert_allclose(list(fit.errors.values()), np.sqrt(np.diag(covariance)), rtol=1e-4)
    np.testing.assert_allclose(fit.residuals["x"], residuals(found.x) * sigma, atol=1e-8)
    assert fit.sum_of_squares == pytest.approx(2 * found.cost, rel=1e-8) and fit.degrees_of_freedom == 58
    assert fit.chi_square.per_freedom == pytest.approx(fit.sum_of_squares / 58)
    assert fit.fits and 0.01 < fit.chi_square.probability < 0.99
    # Without sigma, residuals stand for the errors.
    free = oscillator.fit(data, ["k", "x_dot"], y0={"x": 0.3, "x_dot": 0.0})
    np.testing.assert_allclose(free.covariance, fit.covariance * fit.chi_square.per_freedom, rtol=1e-6)
    assert free.chi_square is None


def test_the_motion_is_the_one_that_residuals_are_of(oscillator):
    data = noisy()
    fit = oscillator.fit(data, "k", y0=START)
    assert fit.model.params["k"] == fit["k"] and fit.y0.tolist() == [0.3, -0.5]
    motion = fit.model.simulate(data["t"], fit.y0, method="dop853")
    # Beside its derivatives a motion has other steps: both keep the tolerance 1e-10.
    np.testing.assert_allclose(motion["x"] - data["x"], fit.residuals["x"], atol=1e-9)
    assert fit.motion.t_end == 3.0 and fit.motion.stats["method"] == "dop853"
    np.testing.assert_allclose(fit.motion.y_end, motion.y_end, atol=1e-9)
    assert np.sqrt(np.mean(fit.residuals["x"] ** 2)) == pytest.approx(fit.rms["x"], rel=1e-12)


def test_the_command_has_the_same_bits(program):
    top = pyhamel.load("heavy_top")
    fit = top.fit(TOP, ["l", "Omega3"])
    assert fit.json == by_command(program, "heavy_top", "--data", TOP, "--free", "l,Omega3")
    fit = top.fit(
        TOP, {"l": 0.3, "Omega3": 2.5}, params={"m": 1.2}, sigma={"Omega1": 0.01, "Gamma3": 0.002},
        bounds={"l": (0.1, None)}, prior={"Omega3": (2.3, 0.5)}, restarts=2, segments=2, rtol=1e-9, atol=1e-11,
    )  # fmt: skip
    assert fit.json == by_command(
        program, "heavy_top", "--data", TOP, "--free", "l,Omega3", "--set", "l=0.3", "m=1.2", "--initial", "Omega3=2.5",
        "--sigma", "Omega1=0.01", "Gamma3=0.002", "--bounds", "l=0.1..", "--prior", "Omega3=2.3+-0.5", "--restarts", "2",
        "--segments", "2", "--rtol", "1e-9", "--atol", "1e-11",
    )  # fmt: skip
    assert len(fit.starts) == 3 and fit.chi_square is not None


def test_inputs_of_a_table_have_the_bits_of_the_command(program):
    log = np.genfromtxt(ROOT / "docs/book/data/pendulum_torque.csv", delimiter=",", skip_header=5)
    t, torque = log.T
    pendulum = pyhamel.load(PENDULUM, scene="controlled")
    fit = pendulum.fit(
        ROOT / "docs/book/data/pendulum_angle.csv", ["J", "M", "b", "c"], inputs={"t": t, "tau": torque},
        bounds={"b": (0, 1), "c": (0, 1)}, method="rk4", step=0.01,
    )  # fmt: skip
    assert fit.json == by_command(
        program, "docs/book/measured_pendulum.hamel", "--scene", "controlled", "--input",
        "docs/book/data/pendulum_torque.csv", "--data", "docs/book/data/pendulum_angle.csv", "--free", "J,M,b,c",
        "--bounds", "b=0..1", "c=0..1", "--method", "rk4", "--step", "0.01",
    )  # fmt: skip
    assert fit.motion.stats["method"] == "rk4" and "explains 99.99" in repr(fit)


def test_a_table_is_a_path_a_dictionary_or_a_frame(oscillator, tmp_path):
    data = noisy(12)
    data["x"][3] = np.nan
    expected = oscillator.fit(data, "k", y0=START)
    assert np.isnan(expected.residuals["x"][[3]]).sum() == 0 and len(expected.t) == 11
    lines = ["t,x", *(f"{t!r},{'' if np.isnan(x) else repr(float(x))}" for t, x in zip(data["t"].tolist(), data["x"]))]
    path = tmp_path / "x.csv"
    path.write_text("\n".join(lines))
    lists = {"t": data["t"].tolist(), "x": [None if np.isnan(x) else x for x in data["x"]], "note": ["a"] * 12}
    masked = {"t": data["t"], "x": np.ma.masked_invalid(data["x"])}
    for same in (path, str(path), masked, np.array(list(zip(data["t"], data["x"])), dtype=[("t", float), ("x", float)])):
        assert oscillator.fit(same, "k", y0=START).json == expected.json
    # A column of words is passed over where nobody asks for it.
    assert oscillator.fit(lists, "k", y0=START, columns="x").json == expected.json


def test_frames_of_pandas_and_xarray_are_tables(oscillator):
    pandas = pytest.importorskip("pandas")
    data = noisy(12)
    expected = oscillator.fit(data, "k", y0=START)
    frame = pandas.DataFrame(data)
    for same in (frame, frame.set_index("t"), frame.convert_dtypes()):
        assert oscillator.fit(same, "k", y0=START).json == expected.json
    missing = frame.convert_dtypes()
    missing.loc[3, "x"] = pandas.NA
    assert len(oscillator.fit(missing, "k", y0=START).t) == 11
    with pytest.raises(pyhamel.InputError, match="seconds since the first row"):
        oscillator.fit(frame.assign(t=pandas.to_datetime(frame["t"], unit="s")), "k")
    pytest.importorskip("xarray")
    motion = oscillator.with_params(k=5.0).simulate(3.0, START)
    assert oscillator.fit(motion.to_xarray(), "k", y0=START, columns=["x", "x_dot"])["k"] == pytest.approx(5.0, rel=1e-8)


def test_units_of_headers_are_converted(oscillator):
    data = noisy()
    expected = oscillator.fit(data, "k", y0=START)
    other = {"time [ms]": 1000 * data["t"], "place [mm]": 1000 * data["x"]}
    fit = oscillator.fit(other, "k", y0=START, time="time", columns={"x": "place"})
    assert fit["k"] == pytest.approx(expected["k"], rel=1e-9)
    assert fit.converted == (
        "time is in ms and was multiplied by 0.001",
        "x is in mm and was multiplied by 0.001",
    )
    np.testing.assert_allclose(fit.data["x"], data["x"], rtol=1e-14)
    with pytest.raises(pyhamel.InputError, match="column x of data is in s, which is no multiple of m"):
        oscillator.fit({"t": data["t"], "x [s]": data["x"]}, "k")


def test_a_value_at_its_bound_has_no_error(oscillator):
    fit = oscillator.fit(noisy(), ["k", "x_dot"], y0={"x": 0.3}, bounds={"k": (1, 4.5)})
    assert fit["k"] == 4.5 and fit.errors["k"] is None and fit.errors["x_dot"] > 0
    assert fit.covariance[0].tolist() == [0.0, 0.0] and "at its bound" in repr(fit)


def test_outputs_and_energies_are_columns(oscillator):
    motion = oscillator.with_params(k=5.0).simulate(3.0, START)
    data = {"t": motion.t, "end": motion.outputs["end"][:, 0], "energy": motion.energy}
    fit = oscillator.fit(data, "k", y0=START)
    assert fit["k"] == pytest.approx(5.0, rel=1e-8) and fit.columns == ("end", "energy")


def test_fits_pickle_and_show_themselves(oscillator):
    fit = oscillator.fit(noisy(), ["k", "x_dot"], y0=START, bounds={"k": (None, 10)})
    again = pickle.loads(pickle.dumps(fit))
    assert again.json == fit.json and again.svg() == fit.svg() and repr(again) == repr(fit)
    np.testing.assert_array_equal(again.residuals["x"], fit.residuals["x"])
    page = fit._repr_html_()
    assert "rms left" in page and "image/svg+xml" in page and "explains" in page
    assert repr(fit).startswith("<pyhamel.Fit of oscillator: k = 5.300 +- 0.016, x_dot = -0.")


def test_a_wrong_minimum_is_an_error_with_what_was_reached():
    top = pyhamel.load("heavy_top")
    with pytest.raises(pyhamel.FitError, match=r"combinations of l, m only(.|\n)*out of unknowns") as caught:
        top.fit(TOP, ["l", "m"])
    assert set(caught.value.reached) == {"l", "m"} and pickle.loads(pickle.dumps(caught.value)).reached
    t = np.linspace(0, 20, 200)
    wrong = {"t": t, "x": np.sign(np.sin(3 * t)) + 0.1 * t}
    with pytest.raises(pyhamel.FitError, match="explains .* % of the spread"):
        pyhamel.load(OSCILLATOR).fit(wrong, "k", y0=START)


MISTAKES = [
    (dict(unknowns="q"), "unknowns has no parameter or component of the state `q`"),
    (dict(unknowns=["k", "k"]), "unknowns has `k` twice"),
    (dict(unknowns="k", sigma={"y": 1.0}), "sigma has no column `y`"),
    (dict(unknowns="k", sigma={"x": -1.0}), "sigma gives x the standard deviation -1.0"),
    (dict(unknowns="k", sigma={"x": "much"}), "sigma of x is 'much', which is no number"),
    (dict(unknowns="k", bounds={"k": (2, 1)}), "bounds of k, .* is empty: give the smaller number first"),
    (dict(unknowns="k", bounds={"k": 3}), "give the two ends of an interval"),
    (dict(unknowns="k", bounds={"k": (5, None)}), "starts at k = 4.0: give another start with params"),
    (dict(unknowns="k", bounds={"m": (0, 5)}), "bounds has no free name `m`"),
    (dict(unknowns="k", prior={"k": (4, 1)}), "give the standard deviations of all columns, sigma"),
    (dict(unknowns="k", prior={"k": (4, 0)}), "prior of k: the standard deviation 0.0 is not positive"),
    (dict(unknowns="k", columns="y"), "has no variable `y`"),
    (dict(unknowns="k", columns={"x": "place"}), "the table has no column `place`"),
    (dict(unknowns="k", time="s"), "the table has no column `s`"),
    (dict(unknowns="k", t0=1.0), "row 0 of data is at 0.0, before the motion starts at 1.0: give an earlier t0"),
    (dict(unknowns="k", restarts=-1), "restarts is -1"),
    (dict(unknowns="k", segments=0), "segments is 0"),
    (dict(unknowns={"k": 3.0}, params={"k": 2.0}), "unknowns start k, which params gives as well"),
    (dict(unknowns="k", method="dla"), "method"),
]


@pytest.mark.parametrize("mistake, words", MISTAKES, ids=[words[:30] for _, words in MISTAKES])
def test_mistakes_are_told_in_words_of_python(oscillator, mistake, words):
    with pytest.raises(pyhamel.InputError, match=words) as caught:
        oscillator.fit(noisy(), **mistake)
    assert "--" not in str(caught.value)


def test_data_that_are_no_table_are_told(oscillator):
    data = noisy(4)
    for wrong, words in [
        (3.0, "data is a float"),
        ({"t": data["t"], "x": data["x"][:3]}, "data has 3 values of x for 4 rows"),
        ({"t": data["t"], "x": np.zeros((4, 2))}, "data has x of shape"),
        ({"t": data["t"], "x": [1.0, "much", 2.0, 3.0]}, "row 1 of data 'much' is not a finite number"),
        ({"t": data["t"], "x": [1.0, np.inf, 2.0, 3.0]}, 'row 1 of data "inf" is not a finite number'),
        ({"t": data["t"][::-1], "x": data["x"]}, "row 1 of data is at 2.0, but the line before is not earlier"),
        ({"t": [], "x": []}, "has no value"),
    ]:
        with pytest.raises(pyhamel.InputError, match=words):
            oscillator.fit(wrong, "k")
    with pytest.raises(pyhamel.FileError, match="nowhere.csv"):
        oscillator.fit("nowhere.csv", "k")


def test_progress_is_told_and_what_it_raises_is_raised(oscillator):
    told = []
    fit = oscillator.fit(noisy(), "k", y0=START, progress=lambda n, sum: told.append((n, sum)))
    assert [n for n, _ in told] == list(range(1, fit.evaluations + 1))
    assert min(sum for _, sum in told[-3:]) == pytest.approx(fit.sum_of_squares)

    def stop(n, sum):
        raise StopIteration(n)

    with pytest.raises(StopIteration, match="1"):
        oscillator.fit(noisy(), "k", y0=START, progress=stop)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_ends_a_fit(oscillator):
    t = np.array([0.0, 1e9, 1.1e9])
    threading.Timer(0.5, signal.raise_signal, [signal.SIGINT]).start()
    with pytest.raises(KeyboardInterrupt):
        oscillator.fit({"t": t, "x": np.ones(3)}, "k", y0=START)
