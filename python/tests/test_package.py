"""Stubs, documentation, and the examples of both."""

import doctest
import importlib
import inspect
import pathlib
import re
import subprocess
import sys

import pytest

import pyhamel
from pyhamel import _hamel

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "python/README.md", ROOT / "docs/book/python.md"]


def test_every_public_name_is_documented():
    for name in pyhamel.__all__:
        if name == "__version__":
            continue
        thing = getattr(pyhamel, name)
        assert inspect.getdoc(thing), name
        if inspect.isclass(thing) and thing.__module__.startswith("pyhamel"):
            for member, value in vars(thing).items():
                if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                    assert inspect.getdoc(value), f"{name}.{member}"


def test_every_native_name_is_in_the_stub():
    stub = (pathlib.Path(_hamel.__file__).parent / "_hamel.pyi").read_text()
    for name in ("Scene", "Motion", "Stepper", "Fit"):
        body = re.search(rf"^class {name}:\n((?:    .*\n|\n)*)", stub, re.M)[1]
        known = set(re.findall(r"def (\w+)\(", body))
        assert known == {n for n in vars(getattr(_hamel, name)) if not n.startswith("_")}
    functions = set(re.findall(r"^def (\w+)\(", stub, re.M))
    assert functions == {n for n, v in vars(_hamel).items() if callable(v) and not inspect.isclass(v)}


def test_types_are_those_that_are_written():
    pytest.importorskip("mypy")
    found = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--config-file", str(ROOT / "python/pyproject.toml"), "-p", "pyhamel"],
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stdout


def test_the_stub_is_what_the_native_module_has():
    pytest.importorskip("mypy")
    found = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "pyhamel._hamel", "--mypy-config-file", str(ROOT / "python/pyproject.toml")],
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stdout + found.stderr


@pytest.mark.parametrize("module", ["pyhamel", "pyhamel._arguments", "pyhamel._model", "pyhamel._results", "pyhamel._fit", "pyhamel._linear"])
def test_examples_of_docstrings_run(module):
    assert doctest.testmod(importlib.import_module(module)).failed == 0


def test_the_notebook_runs(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.read(ROOT / "python/examples/heavy_top.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output.data for cell in notebook.cells for output in cell.get("outputs", []) if "data" in output]
    assert any("text/latex" in data for data in shown) and any("<iframe" in data.get("text/html", "") for data in shown)
    assert any("Eigenvalues of A" in data.get("text/html", "") for data in shown)
    assert "<h3>Equations of motion</h3>" in shown[-1]["text/html"] and "θ" in shown[-1]["text/plain"]


@pytest.mark.parametrize("name, package", [("cart_pole_control", "control"), ("cart_pole_gym", "gymnasium")])
def test_examples_run(name, package, tmp_path):
    pytest.importorskip(package)
    example = ROOT / f"python/examples/{name}.py"
    ran = subprocess.run([sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_every_example_is_run():
    text = pathlib.Path(__file__).read_text()
    assert all(example.stem in text for example in (ROOT / "python/examples").glob("*.*"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_examples_of_the_documentation_run(page, tmp_path, monkeypatch):
    """Blocks of Python run one after the other; lines with `# ..` behind them are compared."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.M | re.S)
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, str(page), "exec"), names)
        for line in block.splitlines():
            told = re.fullmatch(r"(\S.*?)  # (.*)", line)
            if told and "=" not in told[1].split("(")[0]:
                assert repr(eval(told[1], names)) == told[2], line
