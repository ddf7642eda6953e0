"""A store of an ensemble, opened by xarray without a warning, has the numbers of the NPZ file beside it."""

import sys
import warnings

import numpy
import xarray

warnings.simplefilter("error")
folder = sys.argv[1]
runs = xarray.open_zarr(f"{folder}/runs.zarr")
table = numpy.load(f"{folder}/runs.npz")

assert dict(runs.sizes) == {"trajectory": 9000, "t": 3, "state": 6, "input": 2}, runs.sizes
assert list(runs.state.values) == list(table["state_names"])
assert list(runs.input.values) == list(table["input_names"])
numpy.testing.assert_array_equal(runs.y.values, table["state"])
numpy.testing.assert_array_equal(runs.energy.values, table["energy"])
numpy.testing.assert_array_equal(runs.inputs.values, table["inputs"])
numpy.testing.assert_array_equal(runs.t.values, table["t"])
assert (runs.status == 0).all() and (runs.error == "").all() and runs.stopped_y.isnull().all()
# By name, at the end, of those that arrived.
end = runs.y.sel(state="Omega1").isel(t=-1).where(runs.status == 0)
numpy.testing.assert_array_equal(end.values, table["state"][:, -1, 0])
request = runs.attrs["hamel"]
assert request["model"] == "heavy_top" and "lagrangian" in request["model_text"], request
assert len(runs.state.attrs["units"]) == 6 and runs.state.attrs["units"][0] != "", runs.state.attrs

# Statistics of the same trajectories, which make two chunks.
told = xarray.open_zarr(f"{folder}/told.zarr")
assert dict(told.sizes) == {"trajectory": 9000, "t": 3, "quantity": 7, "level": 5, "edge": 51, "bin": 50}, told.sizes
assert (told.n == 9000).all() and list(told.quantity.values)[-1] == "energy"
numpy.testing.assert_allclose(told["mean"].sel(quantity="energy"), runs.energy.mean("trajectory"), rtol=1e-12)
spread = runs.y.sel(state="Omega2").var("trajectory", ddof=1)
numpy.testing.assert_allclose(told.variance.sel(quantity="Omega2")[1:], spread[1:], rtol=1e-9)
assert (told.quantiles.sel(level=0.25) <= told.quantiles.sel(level=0.75)).all()
print("xarray reads the stores")
