"""What a model writes: explanations, certificates, FMUs."""

import pickle
import shutil
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import pyhamel


def test_an_explanation_is_a_text_with_sections():
    top = pyhamel.load("heavy_top")
    text = top.explain()
    assert text.style == "text" and text.startswith("Heavy top (heavy_top") and "Ω₁" in text.sections["Equations of motion"]
    assert all(title in text and body in text for title, body in text.sections.items())
    latex = top.explain("latex")
    assert list(latex.sections) == list(text.sections) and r"\dot{\Omega}_{1}" in latex.sections["Equations of motion"]
    assert top._repr_latex_() == latex.sections["Equations of motion"]
    html = top.explain("mathml")
    ElementTree.fromstring(f"<div>{html}</div>")
    assert "<h3>Equations of motion</h3>" in html and "<math" in html and html.sections["Equations of motion"] in top._repr_html_()
    with pytest.raises(pyhamel.InputError, match="no style `markdown`"):
        top.explain("markdown")


def test_a_notebook_shows_an_explanation_typeset():
    top = pyhamel.load("heavy_top")
    text, html, latex = (top.explain(style) for style in ("text", "mathml", "latex"))
    assert text._repr_mimebundle_() == {"text/plain": str(text), "text/html": str(html)}
    assert html._repr_mimebundle_()["text/html"] == html
    assert latex._repr_mimebundle_() == {"text/plain": latex}
    again = pickle.loads(pickle.dumps(text))
    assert again == text and again.sections == text.sections and again._repr_mimebundle_() == text._repr_mimebundle_()


def test_a_certificate_says_what_was_held():
    found = pyhamel.load("heavy_top").certify(5)
    assert found.points == 5 and {"rhs", "energy"} <= set(found.held) and max(found.held.values()) < 1e-20
    assert all(name in str(found) for name in found.held) and str(found).startswith("Held to its definition at 5 points")
    with pytest.raises(pyhamel.InputError, match="1 or more"):
        pyhamel.load("heavy_top").certify(0)


def has_compiler():
    return any(shutil.which(name) for name in ("cc", "gcc", "clang"))


@pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")
@pytest.mark.filterwarnings("ignore")
def test_an_fmu_moves_as_the_model(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    validation = pytest.importorskip("fmpy.validation")
    robot = pyhamel.load("mobile_robot", scene="controlled")
    path = tmp_path / "robot.fmu"
    robot.fmu(path)
    assert not validation.validate_fmu(str(path))
    start = {"m0": 2.0, "psi1_dot": -3.0, "tau1": 0.2}
    moved = fmpy.simulate_fmu(
        str(path), fmi_type="CoSimulation", start_values=start, stop_time=2.0, output_interval=0.5, relative_tolerance=1e-10,
        output=list(robot.state),
    )  # fmt: skip
    motion = robot.simulate(2.0, {"psi1_dot": -3.0}, {"m0": 2.0}, inputs={"tau1": 0.2}, samples=5)
    np.testing.assert_allclose(moved["time"], motion.t, atol=1e-12)
    # The tolerance, over a path of a few metres and turns.
    for name in robot.state:
        np.testing.assert_allclose(moved[name], motion[name], rtol=0, atol=1e-7)
    # Other values move otherwise.
    assert np.abs(robot.simulate(2.0, samples=5)["y"] - motion["y"]).max() > 1e-2


@pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")
def test_an_fmu_is_written_in_its_place_or_not_at_all(tmp_path, monkeypatch):
    top = pyhamel.load("heavy_top")
    path = tmp_path / "top.fmu"
    path.write_text("before")
    with monkeypatch.context() as without:
        without.setenv("CC", "no_compiler_of_this_name")
        with pytest.raises(pyhamel.InputError, match="no C compiler"):
            top.fmu(path)
    assert path.read_text() == "before"
    top.fmu(path)
    assert path.read_bytes().startswith(b"PK") and [p.name for p in tmp_path.iterdir()] == ["top.fmu"]
    with pytest.raises(pyhamel.InputError, match="end in .fmu"):
        top.fmu(tmp_path / "top.zip")
    with pytest.raises(pyhamel.InputError, match="call `fmu`"):
        top.generate("fmu")
