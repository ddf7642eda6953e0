"""Fluids of matrices: beside the equations of the same text, parameters, fields, what is refused."""

import numpy as np
import pytest

import pyhamel

TEXT = """model flow {{
    param b = 0.3;
    param nu = 0.1 where nu >= 0;
    algebra fluid = zeitlin_sphere(4);
    momentum q in fluid as *;
    action right;
    hamiltonian = -1/2*dot(q, laplacian(fluid)^-1*q) - b*c_1_0;
    force dh_dq = nu*laplacian(fluid)*q;
    force along dh_dc_2_0: 0.2;
    output C2 = trace_power(fluid, q, 2);
    initial s_2_1 = 2*b;
    initial c_3_2 = 0.5;
    {}
}}"""


@pytest.fixture(scope="module")
def flow():
    return pyhamel.Fluid(TEXT.format("scene default { want matrices; }"))


def test_a_fluid_moves_as_its_equations(flow):
    equations = pyhamel.load(TEXT.format(""))
    for params in ({}, {"b": 0.5, "nu": 0.02}):
        b = params.get("b", 0.3)
        expected = equations.simulate(1.0, {"s_2_1": 2 * b, "c_3_2": 0.5}, params=params, samples=5)
        motion = flow.simulate(1.0, step=0.002, params=params, samples=5, fields=True)
        np.testing.assert_allclose(motion.t, expected.t, atol=1e-15)
        names = [equations.state.index(name) for name in flow.modes]
        np.testing.assert_allclose(motion.y, expected.y[:, names], atol=1e-6)
        # All coefficients, in the order of the algebra, which is that of the equations.
        np.testing.assert_allclose(motion.fields, expected.y, atol=1e-6)
        labels = [("s" if second else "c") + f"_{l}_{m}" for l, m, second in flow.waves()]
        assert tuple(labels) == equations.state
        assert motion.casimirs["C2"][-1] != motion.casimirs["C2"][0]
    assert (flow.name, flow.n, flow.surface, flow.params) == ("flow", 4, "sphere", {"b": 0.3, "nu": 0.1})
    assert flow.modes == {"s_2_1": 0.6, "c_3_2": 0.5}


MAGNETIC = """model flow {{
    param k = 0.5;
    algebra fluid = zeitlin_sphere(3);
    momentum w in fluid as w_*;
    action right;
    advected a in fluid as a_* by ad;
    hamiltonian = -1/2*dot(w, laplacian(fluid)^-1*w) - k*dot(a, laplacian(fluid)*a);
    casimir C2 = trace_power(fluid, a, 2);
    casimir D1 = dot(w, star_power(fluid, a, 1));
    initial w_s_2_1 = 0.5;
    initial a_c_1_0 = k;
    initial a_c_2_2 = 0.3;
    {}
}}"""


def test_a_flow_carries_fields():
    flow = pyhamel.Fluid(MAGNETIC.format("scene default { want matrices; }"))
    equations = pyhamel.load(MAGNETIC.format(""))
    assert flow.carried == ["a"] and list(flow.modes) == ["w_s_2_1", "a_c_1_0", "a_c_2_2"]
    # Equations begin anywhere unless they are told.
    start = dict.fromkeys(equations.state, 0.0) | {"w_s_2_1": 0.5, "a_c_1_0": 0.5, "a_c_2_2": 0.3}
    expected = equations.simulate(1.0, start, samples=5)
    motion = flow.simulate(1.0, step=0.002, samples=5, fields=True)
    np.testing.assert_allclose(motion.fields, expected.y[:, :8], atol=1e-5)
    np.testing.assert_allclose(motion.carried["a"], expected.y[:, 8:], atol=1e-5)
    np.testing.assert_allclose(motion.y[:, 0], motion.fields[:, 5], atol=1e-15)
    for name in ("C2", "D1"):
        assert np.ptp(motion.casimirs[name]) < 1e-14
    assert np.ptp(motion.y[:, 0]) > 0.01
    assert flow.simulate(1.0, step=0.1, samples=2).carried is None


def test_wrong_questions_are_told(flow):
    with pytest.raises(pyhamel.InputError, match="mu is no parameter of the fluid"):
        flow.simulate(1.0, step=0.1, params={"mu": 1.0})
    with pytest.raises(pyhamel.InputError, match="c_9_9 is no mode of the fluid"):
        flow.simulate(1.0, {"c_9_9": 1.0}, step=0.1)
    with pytest.raises(pyhamel.ModelError, match="violate `nu >= 0`"):
        flow.simulate(1.0, step=0.1, params={"nu": -1.0})
    with pytest.raises(pyhamel.InputError, match="is no finite number"):
        flow.simulate(1.0, step=0.1, params={"nu": float("nan")})
    with pytest.raises(pyhamel.IntegrationError):
        flow.simulate(1000.0, {"s_2_1": 50.0}, step=100.0, samples=2)
    with pytest.raises(pyhamel.InputError, match="samples is 1"):
        flow.simulate(1.0, step=0.1, samples=1)
    with pytest.raises(pyhamel.InputError, match="has equations"):
        pyhamel.Fluid(TEXT.format(""))
    with pytest.raises(pyhamel.ModelError, match="pyhamel.Fluid"):
        pyhamel.load(TEXT.format("scene default { want matrices; }"))
