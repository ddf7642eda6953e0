"""Noise: paths by seed and number, arrays of paths, what is refused."""

import numpy as np
import pytest

import pyhamel

KUBO = """model kubo {
    param sigma = 0.5;
    coordinate x in real;
    momentum p of x_dot;
    hamiltonian = (p^2 + x^2)/2;
    noise W: sigma*(p^2 + x^2)/2;
}"""


@pytest.fixture(scope="module")
def kubo():
    return pyhamel.load(KUBO, scene="stochastic")


def test_trajectories_are_paths(kubo):
    start = [1.0, 0.0]
    paths = kubo.ensemble(1.0, start, step=0.05, samples=5, noise_seed=4, noise_path=2, paths=3)
    assert paths.y.shape == (3, 5, 2)
    for k in range(3):
        motion = kubo.simulate(1.0, start, step=0.05, samples=5, noise_seed=4, noise_path=2 + k)
        assert np.array_equal(motion.y, paths.y[k])
    np.testing.assert_allclose(np.hypot(paths.y[..., 0], paths.y[..., 1]), 1.0, rtol=1e-13)
    assert np.ptp(paths.y[:, -1, 0]) > 0.01


def test_the_grid_is_the_path(kubo):
    def end(step):
        return kubo.simulate(1.0, [1.0, 0.0], step=step, noise_step=0.0025).y_end

    exact = end(0.0025)
    assert np.linalg.norm(end(0.01) - exact) < np.linalg.norm(end(0.1) - exact) < 0.1


def test_paths_are_written(kubo, tmp_path):
    kubo.ensemble(1.0, [1.0, 0.0], step=0.1, paths=4, out=tmp_path / "paths.csv")
    header, *rows = (tmp_path / "paths.csv").read_text().splitlines()
    end = header.split(",").index("energy")
    found = np.array([[float(x) for x in row.split(",")[end - 2 : end]] for row in rows])
    assert np.array_equal(found, kubo.ensemble(1.0, [1.0, 0.0], step=0.1, paths=4).y_end)


def test_what_has_no_answer_is_refused(kubo):
    with pytest.raises(pyhamel.InputError, match="give a step and no tolerances"):
        kubo.simulate(1.0, [1.0, 0.0])
    with pytest.raises(pyhamel.InputError, match="no multiple of the step"):
        kubo.simulate([0.0, 0.03, 1.0], [1.0, 0.0], step=0.1)
    with pytest.raises(pyhamel.InputError, match="has no noise"):
        pyhamel.load(KUBO).simulate(1.0, [1.0, 0.0], noise_seed=1)
    with pytest.raises(pyhamel.InputError, match="paths is 3"):
        kubo.ensemble(1.0, {"x": [1.0, 2.0]}, step=0.1, paths=3)
