"""Linear systems near points: against differences, against the command, and in closed loops."""

import json
import pathlib
import pickle
import subprocess
import sys

import numpy as np
import pytest

import pyhamel

ROOT = pathlib.Path(__file__).parents[2]
CART = ROOT / "python/examples/cart_pole.hamel"

DRIVEN = """
model driven {
    param k = 3;
    param c = 0.2;
    input push: vector(2) = [0.3, -0.1];
    coordinate x, z in real;
    lagrangian = x_dot^2*(1 + z^2)/2 + z_dot^2/2 - k*x^4/4;
    force x_dot = push1*cos(x) - c*x_dot;
    force z_dot = push2 + t*push1*z;
    output h = x*z_dot + push1^2;
    output far = [sin(x), push2*x, z];
    initial x = 0.4; initial z = -0.7; initial x_dot = 0.2; initial z_dot = 1.1;
}
"""


def differences(of, at, h=1e-5):
    """Central differences of fourth order, a column for each component of ``at``."""
    columns = []
    for k in range(len(at)):
        values = []
        for s in (1, -1, 2, -2):
            moved = np.array(at)
            moved[k] += s * h
            values.append(of(moved))
        columns.append((8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * h))
    return np.stack(columns, axis=-1)


def compare(linear, model, t):
    """Holds the matrices to differences of rates and outputs; rounding errors of 1e-16 / h are left."""
    rows = [row for group in linear.outputs_by_group for row in group]

    def observed(at, y):
        found = at.outputs(y, t)
        return np.concatenate([found[group][[k]] for group, k in rows]) if rows else np.empty(0)

    def held(u):
        return model.with_inputs(dict(zip(linear.inputs, u)))

    expected = {
        "A": differences(lambda y: model.rhs(y, t), linear.y),
        "B": differences(lambda u: held(u).rhs(linear.y, t), linear.u),
        "C": differences(lambda y: observed(model, y), linear.y),
        "D": differences(lambda u: observed(held(u), linear.y), linear.u),
    }
    for name, matrix in expected.items():
        scale = 1 + np.abs(matrix).max(initial=0.0)
        np.testing.assert_allclose(getattr(linear, name), matrix, rtol=0, atol=1e-9 * scale, err_msg=name)
    np.testing.assert_array_equal(linear.rates, model.rhs(linear.y, t))


def by_group(linear):
    """Where the outputs of a linear system are among those of its model."""
    places = {}
    for group, components in linear.model.output_names.items():
        places.update({name: (group, k) for k, name in enumerate(components)})
    return [[places[name]] for name in linear.outputs]


@pytest.mark.parametrize(
    "text, scene, t",
    [(DRIVEN, "default", 0.7), (CART, "default", 0.0), ("mobile_robot", "controlled", 0.0), ("snakeboard", "controlled", 0.0)],
    ids=["driven", "cart_pole", "mobile_robot", "snakeboard"],
)
def test_matrices_are_the_derivatives(text, scene, t):
    model = pyhamel.load(text, scene=scene)
    y = model.with_scene("controlled").simulate(0.5).y_end
    linear = model.linearize(y, t, inputs={name: 0.1 * k - 0.3 for k, name in enumerate(model.inputs)})
    assert linear.B.shape == (len(y), len(linear.inputs)) and linear.start is None
    linear.outputs_by_group = by_group(linear)
    compare(linear, linear.model, t)
    # Another motion has other matrices.
    with pytest.raises(AssertionError):
        name = next(iter(model.params))
        compare(linear, linear.model.with_params(**{name: model.params[name] * 1.01}), t)


def test_bits_are_those_of_the_command():
    program = ROOT / "target/debug/hamel"
    if not program.exists():
        pytest.skip("the command is not built: cargo build -p hamel")
    at = {"psi1_dot": -3.0, "theta": 0.2}
    asked = ["--at", *(f"{name}={x}" for name, x in at.items()), "--hold", "tau1=0.25", "--set", "m0=2.5", "--t", "1", "--json"]
    said = subprocess.run([program, "linearize", "mobile_robot", *asked], capture_output=True, text=True, check=True)
    command = json.loads(said.stdout)
    linear = pyhamel.load("mobile_robot", params={"m0": 2.5}).linearize(at, 1.0, inputs={"tau1": 0.25})
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(linear, name), np.reshape(command[name], getattr(linear, name).shape))
    assert (list(linear.state), list(linear.inputs), list(linear.outputs)) == tuple(command[k] for k in ("state", "inputs", "outputs"))
    assert dict(zip(linear.state, linear.y)) == command["at"] and dict(zip(linear.inputs, linear.u)) == command["hold"]
    assert [[z.real, z.imag] for z in linear.eigenvalues] == command["eigenvalues"]
    assert linear.start == command.get("start")


def riccati(a, b, q, r):
    linalg = pytest.importorskip("scipy.linalg")
    return np.linalg.solve(r, b.T @ linalg.solve_continuous_are(a, b, q, r))


def test_a_regulator_balances_a_pendulum():
    model = pyhamel.load(CART)
    upright = model.linearize({"theta": 0.0})
    assert upright.inputs == ("push",) and upright.eigenvalues[0].real == pytest.approx(np.sqrt(9.81 / 0.5 * 1.1), rel=1e-12)
    gain = riccati(upright.A, upright.B, np.diag([10.0, 10.0, 1.0, 1.0]), np.eye(1))
    push = " ".join(f"- ({k!r})*{name}" for k, name in zip(gain[0].tolist(), upright.state))
    closed = model.linearize({"theta": 0.0}, inputs={"push": push})
    # The loop is closed in the linear system as it is in the motion.
    np.testing.assert_allclose(closed.A, upright.A - upright.B @ gain, rtol=0, atol=1e-12)
    assert closed.inputs == () and closed.eigenvalues.real.max() < -1.0
    assert np.abs(model.simulate(12.0, {"theta": 0.5}, inputs={"push": push}).y_end).max() < 1e-5
    assert np.abs(model.simulate(2.0, {"theta": 0.5}).y[:, 1]).max() > 2.0


def test_a_regulator_keeps_a_robot_on_its_line():
    robot = pyhamel.load("mobile_robot", scene="controlled")
    straight = {"psi1_dot": -5.0, "psi2_dot": -5.0, "theta": 0.0, "y": 0.0}
    linear = robot.linearize(straight)
    # Wheel angles and the way along the line change nothing.
    own = [linear.state.index(name) for name in straight]
    others = [k for k in range(len(linear.state)) if k not in own]
    assert not linear.A[np.ix_(own, others)].any() and np.abs(linear.rates[own]).max() < 1e-12
    gain = riccati(linear.A[np.ix_(own, own)], linear.B[own], np.diag([1.0, 1.0, 10.0, 10.0]), np.eye(2))
    # Inputs in the text do not see coordinates of the group, but a loop does.
    stepper, line = robot.stepper(0.02), linear.y[own]
    y = linear.y + np.array([{"y": 0.5, "theta": 0.3}.get(name, 0.0) for name in linear.state])
    free = y.copy()
    for _ in range(1000):
        stepper.step(y, -gain @ (y[own] - line), out=y)
        stepper.step(free, out=free)
    assert np.abs(y[own] - line).max() < 1e-5 and np.abs(free[own] - line).max() > 1.0
    assert y[linear.state.index("x")] > 15.0


def test_eigenvalues_are_found_where_blocks_are_next_to_zeros():
    windows = pyhamel.load(ROOT / "docs/book/four_bar_windows.hamel").linearize()
    # Equations between places leave zeros twice, of which half of the digits are known.
    expected = np.sort_complex(np.linalg.eigvals(windows.A))
    np.testing.assert_allclose(np.sort(windows.eigenvalues.real), expected.real, rtol=0, atol=1e-6)
    assert windows.eigenvalues[0].real > 3.0


def test_outputs_are_chosen_by_name():
    model = pyhamel.load(DRIVEN)
    whole = model.linearize()
    assert whole.outputs == ("h", "far1", "far2", "far3") and whole.C.shape == (4, 4) and whole.D.shape == (4, 2)
    some = model.linearize(outputs=["x_dot", "far2"])
    np.testing.assert_array_equal(some.C, [np.eye(4)[some.state.index("x_dot")], whole.C[2]])
    np.testing.assert_array_equal(some.D, [[0.0, 0.0], whole.D[2]])
    assert model.linearize(outputs=[]).C.shape == (0, 4)
    with pytest.raises(pyhamel.InputError, match=r"no output `x_dt`\n  outputs and components of the state: x,"):
        model.linearize(outputs=["x_dt"])
    with pytest.raises(pyhamel.InputError, match="list of names"):
        model.linearize(outputs="h")


def test_inputs_of_a_table_are_held_at_the_time():
    model = pyhamel.load(DRIVEN)
    t = np.linspace(0, 2, 5)
    driven = model.with_inputs(t=t, push1=t**2, interpolation="linear")
    linear = driven.linearize(t=0.75)
    np.testing.assert_allclose(linear.u, [0.625, -0.1], rtol=1e-15)
    np.testing.assert_array_equal(linear.rates, driven.rhs(linear.y, 0.75))
    # A noise is no input that the default scene gives way to.
    text = "model stirred { momentum Pi in so(3); hamiltonian = Pi1^2/2 + Pi2^2/3 + Pi3^2/4; noise W: 0.2*Pi3; }"
    assert pyhamel.load(text).linearize().inputs == ()


def test_what_is_wrong_is_said_in_words_of_python():
    model = pyhamel.load(DRIVEN)
    with pytest.raises(pyhamel.InputError, match="pull"):
        model.linearize(inputs={"pull": 1.0})
    with pytest.raises(pyhamel.InputError, match="4 components"):
        model.linearize([1.0])
    with pytest.raises(pyhamel.InputError, match="finite"):
        model.linearize(inputs={"push1": np.nan})
    with pytest.raises(pyhamel.InputError, match="t is nan"):
        model.linearize(t=np.nan)
    with pytest.raises(pyhamel.InputError, match="y has no state `q`"):
        model.linearize({"q": 1.0})


def test_python_control_has_the_same_system(monkeypatch):
    linear = pyhamel.load(CART).linearize({"theta": 0.0}, outputs=["theta", "tip1"])
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "control", None)
        with pytest.raises(pyhamel.PackageError, match="control is not installed: pip install control"):
            linear.to_control()
    pytest.importorskip("control")
    system = linear.to_control()
    assert (system.state_labels, system.input_labels, system.output_labels) == (list(linear.state), ["push"], ["theta", "tip1"])
    np.testing.assert_allclose(sorted(system.poles().real), sorted(linear.eigenvalues.real), atol=1e-9)
    np.testing.assert_array_equal(system.D, linear.D)
    with pytest.raises(pyhamel.InputError, match="takes no inputs"):
        pyhamel.load("heavy_top").linearize().to_control()


def test_a_linear_system_shows_itself_and_pickles():
    linear = pyhamel.load(CART).linearize({"theta": 0.0})
    shown = linear._repr_html_()
    assert all(f"<code>{name}</code>" in shown for name in (*linear.state, "push", "tip1")) and "21.582" in shown
    again = pickle.loads(pickle.dumps(linear))
    np.testing.assert_array_equal(again.A, linear.A)
    assert repr(again) == repr(linear) and "4 states, 1 inputs, 2 outputs" in repr(linear)


@pytest.mark.parametrize("name, scene", [("heavy_top", "reconstruction"), ("snakeboard", "controlled"), ("whipple_bicycle", "default")])
def test_products_with_the_transposed_jacobian(name, scene):
    model = pyhamel.load(name, scene=scene)
    random = np.random.default_rng(3)
    y = model.simulate(0.3).y_end + 0.01 * random.normal(size=(3, len(model.state)))
    w = random.normal(size=(2, 1, len(model.state)))
    expected = np.einsum("yij,wyi->wyj", model.jacobian(y), np.broadcast_to(w, (2, *y.shape)))
    scale = np.abs(model.jacobian(y)).max()
    np.testing.assert_allclose(model.vjp(y, w), expected, rtol=1e-12, atol=1e-13 * scale)
    with pytest.raises(pyhamel.InputError, match="w is"):
        model.vjp(y, [1.0])
    with pytest.raises(pyhamel.InputError, match="cannot be evaluated"):
        model.vjp(y * np.nan, w[0])


def test_products_have_the_inputs_of_the_model():
    model = pyhamel.load(DRIVEN).with_inputs(push1=0.9)
    y, w = model.simulate(0.2).y_end, np.arange(1.0, 5.0)
    np.testing.assert_allclose(model.vjp(y, w, 0.6), w @ model.jacobian(y, 0.6), rtol=1e-13, atol=1e-14)
    t = np.linspace(0, 1, 3)
    driven = model.with_inputs(t=t, push1=t)
    np.testing.assert_allclose(driven.vjp(y, w, 0.6), w @ driven.jacobian(y, 0.6), rtol=1e-13, atol=1e-14)
    assert not np.allclose(driven.vjp(y, w, 0.6), model.vjp(y, w, 0.6))


def test_the_jacobian_is_an_operator():
    linalg = pytest.importorskip("scipy.sparse.linalg")
    model = pyhamel.load("heavy_top", scene="reconstruction")
    y = model.simulate(0.3).y_end
    operator, matrix = model.jacobian_operator(y, 0.5), model.jacobian(y, 0.5)
    assert isinstance(operator, linalg.LinearOperator) and operator.shape == matrix.shape
    v = np.random.default_rng(1).normal(size=(len(y), 2))
    for found, expected in [(operator, matrix), (operator.H, matrix.T)]:
        np.testing.assert_allclose(found @ v[:, 0], expected @ v[:, 0], rtol=0, atol=1e-13)
        np.testing.assert_allclose(found @ v, expected @ v, rtol=0, atol=1e-13)
    # A step of an implicit method without a matrix.
    shifted = linalg.LinearOperator(operator.shape, lambda v: v - 0.1 * (operator @ v))
    solved, failed = linalg.gmres(shifted, model.rhs(y, 0.5), rtol=1e-12)
    assert not failed
    np.testing.assert_allclose(solved, np.linalg.solve(np.eye(len(y)) - 0.1 * matrix, model.rhs(y, 0.5)), rtol=1e-8, atol=1e-9)
    with pytest.raises(pyhamel.InputError, match="operator is that of one state"):
        model.jacobian_operator([y, y])
