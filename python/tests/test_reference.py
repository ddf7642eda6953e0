"""Rates, energies and outputs against values made without any reduced theory."""

import json
from pathlib import Path

import numpy as np
import pytest

import pyhamel

REFERENCE = Path(__file__).parents[2] / "tests" / "reference"
#: Models whose reference names parameters and states as the default scene does.
MODELS = ["chaplygin_sleigh", "free_rigid_body", "heavy_top", "kirchhoff_body", "suslov", "veselova"]


@pytest.mark.parametrize("name", MODELS)
def test_rates_and_energies_are_those_of_the_reference(name):
    data = json.loads((REFERENCE / f"{name}.json").read_text())
    model = pyhamel.load(name)
    compared = 0
    for case in data["cases"]:
        given = {key: float(value) for key, value in case["params"].items() if key in model.params}
        at = model.with_params(**given)
        points = case["points"]
        y = np.array([[float(point["state"][key]) for key in at.state] for point in points])
        rates = np.array([[float(point["derivative"][key]) for key in at.state] for point in points])
        np.testing.assert_allclose(at.rhs(y), rates, rtol=1e-12, atol=1e-13)
        energies = [float(point["energy"]) for point in points]
        np.testing.assert_allclose(at.energy(y), energies, rtol=1e-12)
        compared += rates.size
    assert compared >= 2 * len(model.state)
