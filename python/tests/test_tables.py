"""Motions, ensembles and families as tables and as lines on axes."""

import sys

import numpy as np
import pytest

import pyhamel

BALL = """
model ball {
    /// Height [m].
    coordinate h in real;
    lagrangian = h_dot^2/2 - 9.81*h;
    event bounce = h falling { then h_dot = -0.9*h_dot; }
    initial h = 1; initial h_dot = 0;
}
"""
SLEEPING = {"Omega1": 0, "Omega2": 0, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1}


def motion():
    return pyhamel.load("heavy_top").simulate(1.0, {"Omega3": 5.0}, samples=11, sensitivity=["l"])


def test_a_motion_is_a_table():
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    own = motion()
    table = own.to_pandas()
    assert isinstance(table, pandas.DataFrame) and table.index.name == "t"
    np.testing.assert_array_equal(table.index, own.t)
    np.testing.assert_array_equal(table[list(own.model.state)], own.y)
    np.testing.assert_array_equal(table["energy"], own.energy)
    np.testing.assert_array_equal(table["casimirs.C2"], own.outputs["casimirs"][:, 1])
    np.testing.assert_array_equal(table["d_Gamma1_d_l"], own.sensitivity["l"][:, own.model.state.index("Gamma1")])
    assert table.attrs["l"] == own.model.params["l"] and table.attrs["model"] == "heavy_top"
    assert list(table.columns) == list(own.to_xarray().data_vars)
    # A table is what a fit takes.
    fit = own.model.fit(table[["Omega1", "Gamma3"]], {"l": 0.3}, y0={"Omega3": 5.0})
    assert fit["l"] == pytest.approx(own.model.params["l"], rel=1e-6)


def test_an_ensemble_is_a_table_of_trajectories_and_times():
    pytest.importorskip("pandas")
    top = pyhamel.load("heavy_top")
    tops = top.ensemble(1.0, {"Omega3": [1.0, 5.0, 9.0]}, {"m": [1.0, 2.0, 3.0]}, samples=3)
    table = tops.to_pandas()
    assert table.index.names == ["trajectory", "t"] and len(table) == 9
    np.testing.assert_array_equal(table.loc[1, list(top.state)], tops.y[1])
    np.testing.assert_array_equal(table["energy"].unstack(), tops.energy)
    assert (table.loc[2, "m"] == 3.0).all() and table.attrs == {"model": "heavy_top", "scene": "default"}


def axes():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.close("all")
    return pyplot.subplots()[1]


def legend(drawn):
    return [text.get_text() for text in drawn.get_legend().get_texts()]


def test_a_motion_is_drawn_with_units():
    ax, own = axes(), motion()
    assert own.plot(ax=ax) is ax
    assert ax.get_xlabel() == "t [s]" and ax.get_ylabel() == ""
    assert legend(ax) == ["Omega1 [rad/s]", "Omega2 [rad/s]", "Omega3 [rad/s]", "Gamma1", "Gamma2", "Gamma3"]
    for k, line in enumerate(ax.lines):
        np.testing.assert_array_equal(line.get_xydata(), np.stack([own.t, own.y[:, k]], axis=-1))
    alone = own.plot("Omega3")
    assert alone is not ax and alone.get_ylabel() == "Omega3 [rad/s]" and alone.get_legend() is None
    both = own.plot("Omega1", "Omega2")
    assert both.get_ylabel() == "[rad/s]" and legend(both) == ["Omega1", "Omega2"]
    others = own.plot("energy", "casimirs", "d_Omega1_d_l")
    assert legend(others) == ["energy [kg·m²/s²]", "casimirs.C1", "casimirs.C2", "d_Omega1_d_l"]
    with pytest.raises(pyhamel.InputError, match=r"no column `Omega4`\n  columns: Omega1,"):
        own.plot("Omega4")


def test_events_are_marked():
    axes()
    own = pyhamel.load(BALL).simulate(3.0)
    drawn = own.plot("h")
    [marks] = drawn.collections
    assert [segment[0][0] for segment in marks.get_segments()] == [event.t for event in own.events]
    assert len(own.events) > 2 and legend(drawn) == ["h", "bounce"] and drawn.get_ylabel() == "h [m]"


def test_a_family_is_drawn_with_its_changes():
    ax = axes()
    family = pyhamel.load("heavy_top", scene="symmetric").family("Omega3", 20.0, 1.0, SLEEPING, points=20)
    assert family.plot(ax=ax) is ax and ax.get_xlabel() == "Omega3 [rad/s]" and ax.get_ylabel() == "growth [1/s]"
    stable, unstable, change = ax.lines
    threshold = family.changes[0].at.along
    shown = lambda line: line.get_xdata()[~np.isnan(line.get_ydata())]
    assert shown(stable).min() > threshold > shown(unstable)[1:].max() and unstable.get_linestyle() == "--"
    np.testing.assert_allclose(change.get_xydata(), [[threshold, 0.0]], atol=1e-5)
    assert legend(ax) == ["growth", "growth, unstable", "flutter"]
    assert legend(family.plot("Gamma3"))[0] == "Gamma3"
    with pytest.raises(pyhamel.InputError, match="no column `period`"):
        family.plot("period")


@pytest.mark.parametrize(
    "package, of",
    [
        ("pandas", lambda own: own.to_pandas()),
        ("xarray", lambda own: own.to_xarray()),
        ("matplotlib", lambda own: own.plot()),
        ("scipy", lambda own: own.model.jacobian_operator(own.y[0])),
        ("casadi", lambda own: own.model.casadi()),
        ("jax", lambda own: own.model.jax()),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_packages_that_are_missing_are_told(package, of, monkeypatch):
    own = motion()
    for name in [name for name in sys.modules if name == package or name.startswith(f"{package}.")]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(pyhamel.PackageError, match=f"{package} is not installed: pip install {package}"):
        of(own)


def test_units_are_those_of_the_model():
    units = pyhamel.load("mobile_robot", scene="controlled").units
    assert (units["t"], units["m0"], units["tau1"], units["psi1_dot"], units["x"]) == ("s", "kg", "N·m", "rad/s", "m")
    assert units["energy"] == "kg·m²/s²" and set(pyhamel.load("heavy_top").units) > {"I1", "Gamma3", "casimirs.C1"}
