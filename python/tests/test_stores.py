"""Ensembles in stores: shares, processes, workers of Dask, and statistics."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import pyhamel

MASSES = np.linspace(0.5, 1.5, 20000)


def files(folder):
    """All files below a folder with their bytes."""
    found = {}
    for root, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(root, name)
            with open(path, "rb") as file:
                found[os.path.relpath(path, folder)] = file.read()
    return found


def share(model, out, part):
    """What a worker is given: all of it pickles."""
    return model.ensemble(0.5, {"Omega3": 2.0}, {"m": MASSES}, out=out, part=part, threads=1)


@pytest.fixture(scope="module")
def top():
    return pyhamel.load("heavy_top")


@pytest.fixture(scope="module")
def whole(top, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "runs.zarr"
    told = top.ensemble(0.5, {"Omega3": 2.0}, {"m": MASSES}, out=out)
    assert told.startswith("heavy_top: 20000 trajectories, 0 stopped")
    return files(out)


def test_shares_make_the_store_of_one_process(top, whole, tmp_path):
    out = tmp_path / "runs.zarr"
    assert "are left" in share(top, out, (2, 3))
    for part in ((1, 3), (3, 3)):
        share(top, out, part)
    assert files(out) == whole
    with pytest.raises(pyhamel.InputError, match="there is no part 4 of 3"):
        share(top, out, (4, 3))
    with pytest.raises(pyhamel.InputError, match="is the store of another ensemble"):
        share(top.with_params(l=0.5), out, (1, 3))
    with pytest.raises(pyhamel.InputError, match="give out"):
        top.ensemble(0.5, {}, {"m": MASSES}, part=(1, 3))


def test_a_store_has_the_numbers_of_an_ensemble(top, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    masses = MASSES[:100]
    found = top.ensemble(0.5, {"Omega3": 2.0}, {"m": masses}, samples=3)
    top.ensemble(0.5, {"Omega3": 2.0}, {"m": masses}, samples=3, out=tmp_path / "runs.zarr")
    store = xarray.open_zarr(tmp_path / "runs.zarr")
    np.testing.assert_array_equal(store.y, found.y)
    what = ["mean", "variance"]
    top.ensemble(0.5, {"Omega3": 2.0}, {"m": masses}, samples=3, out=tmp_path / "told.zarr", statistics=what)
    told = xarray.open_zarr(tmp_path / "told.zarr")
    np.testing.assert_allclose(told["mean"].sel(quantity="Omega1"), found.y[:, :, 0].mean(axis=0), atol=1e-14)
    with pytest.raises(pyhamel.InputError, match="median"):
        top.ensemble(0.5, {}, {"m": masses}, out=tmp_path / "no.zarr", statistics=["median"])


@pytest.mark.filterwarnings("ignore")
def test_workers_of_dask_make_the_store_of_one_process(top, whole, tmp_path):
    distributed = pytest.importorskip("distributed")
    out = tmp_path / "runs.zarr"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            parts = [(k, 5) for k in range(1, 6)]
            told = client.gather([client.submit(share, top, str(out), part, pure=False) for part in parts])
    assert len(told) == 5 and all("trajectories" in text for text in told)
    assert files(out) == whole


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_ends_a_motion(top):
    main = threading.main_thread().ident
    timer = threading.Timer(0.5, lambda: signal.pthread_kill(main, signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        top.simulate(1e7, {"Omega3": 20.0}, samples=2, max_steps=10**12)
    assert time.monotonic() - begun < 60.0


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("name", [None, "tops.csv", "tops.zarr"])
def test_an_interrupt_calls_an_ensemble_off(top, tmp_path, name):
    main = threading.main_thread().ident
    timer = threading.Timer(0.5, lambda: signal.pthread_kill(main, signal.SIGINT))
    timer.start()
    more = {} if name is None else {"out": tmp_path / name}
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        # About an hour.
        top.ensemble(1000.0, {"Omega3": np.linspace(10.0, 20.0, 100_000)}, samples=2, **more)
    assert time.monotonic() - begun < 60.0
    assert [path.name for path in tmp_path.iterdir()] == ([name] if name == "tops.zarr" else [])


def test_more_than_memory_holds_is_refused(top):
    with pytest.raises(pyhamel.InputError, match="there is room for .* in memory"):
        top.ensemble(1.0, {"Omega3": np.linspace(10.0, 20.0, 1000)}, samples=10**11)
