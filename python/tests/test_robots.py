"""Models of robots from their descriptions."""

from pathlib import Path

import numpy as np
import pytest

import pyhamel

ROBOTS = Path(__file__).parents[2] / "codegen" / "tests" / "robots"


def reference(name, robot):
    """States with their controls, and rates, by names."""
    for line in (ROBOTS / name).read_text().splitlines():
        own, *parts = line.split(" | ")
        if own == robot:
            pairs = ([pair.split("=") for pair in part.split()] for part in parts)
            yield tuple({key: float(value) for key, value in each} for each in pairs)


def test_rates_are_those_of_mujoco():
    with pytest.warns(pyhamel.ModelWarning, match="`timestep` of `option` is not taken"):
        text = pyhamel.import_robot(ROBOTS / "crane.xml", limits="none")
    crane = pyhamel.load(text)
    assert crane.name == "crane"
    for state, expected in reference("reference_mujoco.txt", "crane"):
        controls = {name: state.pop(name) for name in list(state) if name.startswith("ctrl_")}
        driven = crane.with_inputs(**controls)
        rates = dict(zip(driven.state, driven.rhs([state[name] for name in driven.state])))
        scale = max(map(abs, expected.values()))
        assert all(abs(rates[name] - rate) < 1e-12 * scale for name, rate in expected.items())


def test_frames_are_those_of_pinocchio():
    with pytest.warns(pyhamel.ModelWarning):
        text = pyhamel.import_robot(ROBOTS / "arm.urdf", frames=["finger", "bracket"])
    wants = "scene control { want rhs, frames, bias, gravity, mass_matrix, inverse_dynamics; }"
    arm = pyhamel.load(text.rstrip().removesuffix("}") + wants + "}", scene="control")
    assert arm.frames == ("finger", "bracket") and arm.velocities == ("shoulder_dot", "elbow_dot", "slide_dot")
    n_compared = 0
    for line in (ROBOTS / "reference_frames.txt").read_text().splitlines():
        robot, state, link, numbers = line.split(" | ")
        if robot != "arm" or link not in arm.frames:
            continue
        values = dict(pair.split("=") for pair in state.split())
        y = np.array([float(values[name]) for name in arm.state])
        numbers = np.array(numbers.split(), dtype=float)
        k = arm.frames.index(link)
        pose = arm.frame_poses(y)[k]
        np.testing.assert_allclose(pose[:3, 3], numbers[:3], atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3].ravel(), numbers[3:12], atol=1e-12)
        np.testing.assert_allclose(arm.frame_twists(y)[k], numbers[12:18], atol=1e-11)
        np.testing.assert_allclose(arm.frame_drifts(y)[k], numbers[18:], atol=1e-11)
        u = y[[arm.state.index(name) for name in arm.velocities]]
        np.testing.assert_allclose(arm.frame_jacobians(y)[k] @ u, numbers[12:18], atol=1e-11)
        n_compared += 1
    assert n_compared == 8
    y = np.random.default_rng(3).uniform(0.01, 0.04, size=(2, 3, 6))
    assert arm.frame_poses(y).shape == (2, 3, 2, 4, 4) and arm.frame_jacobians(y).shape == (2, 3, 2, 6, 3)
    np.testing.assert_allclose(arm.bias(y), arm.inverse_dynamics(y, np.zeros(3)), rtol=1e-12, atol=1e-12)
    still = y.copy()
    still[..., [arm.state.index(name) for name in arm.velocities]] = 0.0
    np.testing.assert_allclose(arm.gravity(y), arm.inverse_dynamics(still, np.zeros(3)), rtol=1e-12, atol=1e-12)
    with pytest.raises(pyhamel.InputError, match="want frame_poses;"):
        arm.with_scene("default").frame_poses(y[0, 0])


def test_mass_centre_and_momentum_of_all_bodies():
    text = pyhamel.import_robot(ROBOTS / "flyer.urdf", floating=True, frames=["rod"], bodies=True)
    wants = """scene control { want rhs, reconstruction, frames, mass_matrix, operational_space, center_of_mass,
        center_of_mass_jacobian, centroidal_momentum, centroidal_momentum_matrix; }"""
    flyer = pyhamel.load(text.rstrip().removesuffix("}") + wants + "}", scene="control")
    y = np.random.default_rng(3).uniform(0.1, 0.4, size=(2, 3, len(flyer.state)))
    quaternions = [flyer.state.index(f"attitude{c}") for c in "wxyz"]
    y[..., quaternions] /= np.linalg.norm(y[..., quaternions], axis=-1, keepdims=True)
    u = y[..., [flyer.state.index(name) for name in flyer.velocities]]
    centre, momentum = flyer.center_of_mass(y), flyer.centroidal_momentum(y)
    jacobian, matrix = flyer.center_of_mass_jacobian(y), flyer.centroidal_momentum_matrix(y)
    assert centre.shape == (2, 3, 2, 3) and jacobian.shape == (2, 3, 3, 7) and matrix.shape == (2, 3, 6, 7)
    np.testing.assert_allclose(np.einsum("...ij,...j", jacobian, u), centre[..., 1, :], atol=1e-13)
    np.testing.assert_allclose(np.einsum("...ij,...j", matrix, u), momentum, atol=1e-13)
    mass = flyer.params["mass_body"] + flyer.params["mass_rod"]
    np.testing.assert_allclose(momentum[..., 3:], mass * centre[..., 1, :], atol=1e-13)
    frames, responses = flyer.frame_jacobians(y), flyer.operational_space(y)
    inverse = np.linalg.inv(flyer.mass_matrix(y))[..., None, :, :]
    np.testing.assert_allclose(responses, frames @ inverse @ np.swapaxes(frames, -1, -2), rtol=1e-9, atol=1e-9)
    with pytest.raises(pyhamel.InputError, match="want center_of_mass;"):
        flyer.with_scene("default").center_of_mass(y[0, 0, : len(flyer.with_scene("default").state)])


def test_what_a_file_leaves_open_is_chosen():
    with pytest.warns(pyhamel.ModelWarning, match="joint `thumb` is locked at zero"):
        locked = pyhamel.import_robot(str(ROBOTS / "arm.urdf"), lock=["thumb"], limits="spring")
    assert "limit_stiffness" in locked and "let thumb" not in locked
    flyer = pyhamel.load(pyhamel.import_robot(ROBOTS / "flyer.urdf", floating=True))
    assert {"Omega1", "V3", "height"} <= set(flyer.state)
    assert np.all(np.isfinite(flyer.rhs(np.full(len(flyer.state), 0.1))))


def test_problems_are_told_with_their_place(tmp_path):
    wrong = tmp_path / "wrong.xml"
    wrong.write_text("<mujoco>\n<worldbody><body><joint type='helix'/></body></worldbody></mujoco>")
    with pytest.raises(pyhamel.ModelError, match="has the type `helix`") as raised:
        pyhamel.import_robot(wrong)
    assert raised.value.diagnostics[0].line == 2
    with pytest.raises(pyhamel.InputError, match='give "interval", "spring" or "none"'):
        pyhamel.import_robot(ROBOTS / "arm.urdf", limits="hard")
    with pytest.raises(pyhamel.FileError):
        pyhamel.import_robot(tmp_path / "none.urdf")
