"""Loading, parameters, errors, and pickles."""

import multiprocessing
import pickle
from pathlib import Path

import numpy as np
import pytest

import pyhamel

ROOT = Path(__file__).parents[2]
BAD = ROOT / "codegen" / "tests" / "bad"

PENDULUM = """
model pendulum {
    /// Length (m)
    param l = 2 where l > 0;
    coordinate theta in angle;
    let speed = l*theta_dot;
    lagrangian = speed^2/2 + 9.81*l*cos(theta);
}
"""


def test_a_model_is_a_name_a_path_or_a_text(tmp_path):
    path = ROOT / "models" / "specs" / "heavy_top.hamel"
    named, of_file = pyhamel.load("heavy_top"), pyhamel.load(path)
    assert named.state == of_file.state == pyhamel.load(path.read_text()).state
    assert "heavy_top" in pyhamel.models()
    pendulum = pyhamel.load(PENDULUM)
    assert (pendulum.name, pendulum.scene, len(pendulum.state)) == ("pendulum", "default", 2)
    y = dict(zip(pendulum.state, (0.3, 0.0)))
    at = [y[name] for name in pendulum.state]
    rates = dict(zip(pendulum.state, pendulum.rhs(at)))
    [acceleration] = [rate for name, rate in rates.items() if name != "theta"]
    assert acceleration == pytest.approx(-9.81 / 2 * np.sin(0.3), rel=1e-14)


CHAIN = """
model chain {
    size n = 2 where n >= 1;
    coordinate x: vector(n) in real;
    lagrangian = dot(x_dot, x_dot)/2 - sum(k*x[k]^2 for k in 1..n)/2;
}
"""


def test_a_family_has_a_model_for_each_size():
    chain = pyhamel.load(CHAIN, sizes={"n": 4})
    assert len(chain.state) == 8 and len(pyhamel.load(CHAIN).state) == 4
    rates = chain.rhs(np.arange(8.0))
    assert sorted(rates[4:]) == sorted(-k * (k - 1) for k in range(1, 5))
    # The text of a model is that of the member, so that it can be restored from it.
    assert "size n = 4" in chain.text
    assert pickle.loads(pickle.dumps(chain)).state == chain.state
    with pytest.raises(pyhamel.ModelError, match="the model has no size `m`"):
        pyhamel.load(CHAIN, sizes={"m": 4})


def test_parameters_are_a_mapping_and_models_are_values():
    top = pyhamel.load("heavy_top", params={"m": 2.0})
    assert top.params["m"] == 2.0 and list(top.params)[:3] == ["I1", "I2", "I3"]
    assert dict(top.params)["g"] == 9.81
    heavier = top.with_params(m=3.0, l=0.5)
    assert (heavier.params["m"], heavier.params["l"], top.params["m"]) == (3.0, 0.5, 2.0)
    y = np.array([0.1, 0.2, 5.0, 0.0, 0.6, 0.8])
    assert not np.array_equal(top.rhs(y), heavier.rhs(y))
    assert "reconstruction" in top.scenes
    moved = top.with_scene("reconstruction")
    assert moved.scene == "reconstruction" and moved.params["m"] == 2.0 and len(moved.state) > 6
    with pytest.raises(pyhamel.InputError, match="no parameter `M`"):
        top.with_params(M=1.0)
    with pytest.raises(pyhamel.InputError, match=r"m > 0 does not hold.* for m = -1.0"):
        top.with_params(m=-1.0)


@pytest.mark.parametrize("path", sorted(BAD.glob("*.hamel")), ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore::pyhamel.ModelWarning")
def test_wrong_models_have_the_message_and_the_place_of_the_command(path, monkeypatch):
    expected = path.with_suffix(".expected").read_text()
    if not expected.startswith("error"):
        pytest.skip("a model that is warned of")
    if path.stem.startswith("matrix_fluid"):
        pytest.skip("has no equations, which is another message here")
    monkeypatch.chdir(BAD)
    with pytest.raises(pyhamel.ModelError) as caught:
        model = pyhamel.load(path.name, cache=False)
        for scene in model.scenes:
            model.with_scene(scene)
    error = caught.value
    # The command tells the problems of all scenes at once; here it is one scene that is loaded.
    assert expected.startswith(str(error).rstrip())
    first = error.diagnostics[0]
    assert first.message.splitlines()[0] in expected
    if first.line is not None:
        assert f"{first.file}:{first.line}:{first.column}" in expected


def test_unknown_names_are_said_with_those_that_exist():
    with pytest.raises(pyhamel.InputError, match=r"no model `heavy_tip`[\s\S]*heavy_top"):
        pyhamel.load("heavy_tip")
    with pytest.raises(pyhamel.InputError, match="no scene `fast`"):
        pyhamel.load("heavy_top", scene="fast")
    with pytest.raises(pyhamel.FileError, match="nowhere.hamel"):
        pyhamel.load("nowhere.hamel")
    top = pyhamel.load("heavy_top")
    with pytest.raises(pyhamel.InputError, match="last axis"):
        top.rhs(np.zeros(5))
    with pytest.raises(ValueError, match=r"states\[1\] cannot be evaluated"):
        top.rhs([[1.0] * 6, [np.nan] + [1.0] * 5])
    with pytest.raises(pyhamel.InputError, match="cannot be evaluated"):
        top.rhs([np.inf] + [1.0] * 5)


def test_warnings_of_a_model_are_warnings():
    text = PENDULUM.replace("let speed", "param unused = 1;\n    let speed")
    with pytest.warns(pyhamel.ModelWarning, match="unused"):
        pyhamel.load(text)


def test_pickles_are_the_same_model():
    top = pyhamel.load("heavy_top", scene="reconstruction").with_params(m=2.5)
    again = pickle.loads(pickle.dumps(top))
    assert (again.scene, dict(again.params)) == (top.scene, dict(top.params))
    y = np.random.default_rng(1).normal(size=len(top.state))
    assert np.array_equal(again.rhs(y), top.rhs(y))
    error = pyhamel.IntegrationError("text", 1.0, {"x": 2.0})
    assert pickle.loads(pickle.dumps(error)).state == {"x": 2.0}


def energy_of(model):
    return float(model.energy(np.array([0.1, 0.2, 5.0, 0.0, 0.6, 0.8])))


@pytest.mark.parametrize("method", ["fork", "spawn"])
# Python warns of forks with threads; that they work is what is tested.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_models_go_to_other_processes(method):
    top = pyhamel.load("heavy_top")
    top.rhs(np.ones((1000, 6)), threads=True)
    with multiprocessing.get_context(method).Pool(1) as pool:
        assert pool.map(energy_of, [top, top.with_params(m=2.0)]) == [
            energy_of(top),
            energy_of(top.with_params(m=2.0)),
        ]
        assert pool.apply(parallel_sum, (top,)) == parallel_sum(top)


def parallel_sum(model):
    return float(model.rhs(np.ones((1000, 6)), threads=True).sum())


def test_people_see_equations():
    top = pyhamel.load("heavy_top")
    assert "\\dot" in top._repr_latex_() and "<math" in top._repr_html_()
    assert "heavy_top" in top.explain() and "<!DOCTYPE html>" in top.report()
    assert "Omega1" in repr(top)


def test_a_model_is_reduced_by_its_symmetries():
    unreduced = pyhamel.load(ROOT / "models" / "unreduced" / "heavy_top.hamel")
    reduced = unreduced.reduce()
    assert reduced.dim == 3
    assert any(line.startswith("Symmetry: turn 3 of R in space; it keeps `I1*Omega1*R31") for line in reduced.report)
    assert reduced.map == {"a1": "-R32", "a2": "R31", "a3": "R33"}
    top = pyhamel.load(reduced.text)
    assert top.state == ("Omega1", "Omega2", "Omega3", "a1", "a2", "a3")
    # Both start where the attitude is the identity, and move alike.
    y0 = {"Omega1": 0.4, "Omega2": 0.2, "Omega3": 3.0}
    ends = [dict(zip(m.state, m.simulate(1.0, y0).y[-1])) for m in (top, unreduced)]
    for name in y0:
        assert ends[0][name] == pytest.approx(ends[1][name], rel=1e-6)
    with pytest.raises(pyhamel.ModelError, match="there is no group to reduce it by"):
        pyhamel.load("model m { coordinate x in real; lagrangian = x_dot^2 - x^4; }").reduce()


def test_files_of_a_scene_are_those_of_the_command(tmp_path):
    top = pyhamel.load("heavy_top")
    files = top.generate()
    shipped = (ROOT / "models/src/generated/heavy_top.rs").read_text()
    body = lambda text: text.split("\n", 1)[1]
    # The first line names the command.
    assert list(files) == ["heavy_top.rs"] and body(files["heavy_top.rs"]) == body(shipped)
    assert set(top.generate("c", tmp_path)) == {p.name for p in tmp_path.iterdir()} == {"heavy_top.h", "heavy_top.c"}
    assert (tmp_path / "heavy_top.c").read_text() == top.generate("c")["heavy_top.c"]
    with pytest.raises(pyhamel.InputError, match="no language `fortran`"):
        top.generate("fortran")
    assert "float t" in top.generate("c", precision="float")["heavy_top.h"]
    with pytest.raises(pyhamel.InputError, match="that of C and C"):
        top.generate("jax", precision="float")
    with pytest.raises(pyhamel.InputError, match="precision"):
        top.generate("c", precision="half")
    with pytest.raises(pyhamel.FileError, match="nowhere"):
        top.generate("c", tmp_path / "nowhere")


def test_formulations_are_those_of_the_table():
    found = pyhamel.load("chaplygin_sleigh").formulations()
    assert sum(one.is_own for one in found.found) == 1
    assert [one.cost for one in found.found] == sorted(one.cost for one in found.found)
    assert all(str(one.cost) in str(found) and one.title in str(found) for one in found.found)
