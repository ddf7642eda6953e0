"""Relative equilibria of models, one by one and in families."""

import pyhamel
import numpy as np
import pytest

SLEEPING = {"Omega1": 0.0, "Omega2": 0.0, "Gamma1": 0.0, "Gamma2": 0.0, "Gamma3": 1.0}


def top() -> pyhamel.Model:
    return pyhamel.load("heavy_top", scene="symmetric")


def test_a_fast_top_sleeps():
    fast = top().trim({**SLEEPING, "Omega3": 9.0})
    assert fast.verdict == "stable" and fast.energy == {"positive": 4, "negative": 0, "zero": 0}
    assert fast["Omega3"] == 9.0 and fast.residual < 1e-14
    assert np.abs(fast.model.rhs(fast.y)).max() < 1e-14
    slow = top().trim({**SLEEPING, "Omega3": 3.0})
    assert slow.verdict == "unstable" and slow.eigenvalues.real.max() > 0.5


def test_a_family_knows_where_stability_is_lost():
    family = top().family("Omega3", 20.0, 1.0, SLEEPING)
    assert family.end == "reached" and len(family) == len(family.along) == len(family.y)
    [change] = family.changes
    threshold = np.sqrt(4 * 1.3 * 1.1 * 9.81 * 0.35) / 0.6
    assert change.kind == "flutter" and change.at.along == pytest.approx(threshold, rel=1e-9)
    assert np.all(family.growth[family.along > threshold] < 1e-6)
    assert np.all(family.growth[family.along < threshold] > 1e-3)


def test_parameters_and_inputs_of_the_model_are_those_of_the_equilibrium():
    heavier = top().with_params(m=2.2)
    family = heavier.family("l", 0.2, 0.4, {**SLEEPING, "Omega3": 9.0}, points=5)
    assert family[0].model.params["m"] == 2.2
    assert [e.model.params["l"] for e in family] == pytest.approx(list(family.along))


def test_what_is_wrong_is_said_in_words_of_python():
    with pytest.raises(pyhamel.InputError, match="keep has no value `Omega4`"):
        top().trim(SLEEPING, keep=["Omega4"])
    with pytest.raises(pyhamel.InputError, match="free has no"):
        top().trim(SLEEPING, free=["Omega1"])
    with pytest.raises(pyhamel.InputError, match="give two values"):
        top().family("Omega3", 1.0, 1.0)
    with pytest.raises(pyhamel.InputError, match="list of names"):
        top().trim(SLEEPING, keep="Omega1")


def test_a_family_of_orbits_doubles_its_period():
    text = """model roessler { param a = 0.2; param b = 0.2; param c = 2.5;
        coordinate x, v, z in real;
        field x_dot = -v - z; field v_dot = x + a*v; field z_dot = b + z*(x - c);
        initial x = 4.4; initial v = -2.36; initial z = 0.42; }"""
    model = pyhamel.load(text)
    family = model.family("c", 2.5, 3.0, period=5.75, points=6)
    assert [change.kind for change in family.changes] == ["doubling"]
    assert family.changes[0].at.along == pytest.approx(2.832445, abs=1e-6)
    assert family[0].period == pytest.approx(5.748991, abs=1e-6) and "orbits" in repr(family)
    with pytest.raises(ValueError, match="above zero"):
        model.family("c", 2.5, 3.0, period=0.0)
    with pytest.raises(ValueError, match="neither free"):
        model.family("c", 2.5, 3.0, period=5.75, free=["a"])


def test_an_orbit_closes():
    pendulum = pyhamel.load("model p { coordinate q in angle; lagrangian = q_dot^2/2 + cos(q); initial q = 1; initial q_dot = 0; }")
    orbit = pendulum.orbit(6.3, keep=["energy"])
    assert orbit.period == pytest.approx(6.699998, abs=1e-3) and orbit.verdict == "rigid"
    motion = pendulum.simulate(orbit.period, orbit.y, rtol=1e-12, atol=1e-14)
    assert np.abs(motion.y_end - orbit.y).max() < 1e-9
    with pytest.raises(pyhamel.InputError, match="above zero"):
        pendulum.orbit(0.0)
