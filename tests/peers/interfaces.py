"""What hamel writes for others, as these others see it: CasADi functions, FMUs and formulas against the reference data.

    python3 -m venv ~/peers && ~/peers/bin/pip install casadi fmpy jax sympy
    ~/peers/bin/python tests/peers/interfaces.py target/release/hamel

Deliberately does not know: how any of it is written. Needs a C compiler. Ends with an error where a number is wrong.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import formulas
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODELS = ["heavy_top", "euler_disk", "two_arm_satellite", "mobile_robot"]
# Derivatives at points agree to rounding; motions to what the solvers make of their tolerance of 1e-10.
POINT, MOTION = 1e-11, 2e-6


def reference(model):
    return json.loads((ROOT / "tests/reference" / f"{model}.json").read_text())


def close(what, found, expected, tolerance):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    error = np.max(np.abs(found - expected) / (1 + np.abs(expected)), initial=0.0)
    print(f"{what}: {error:.1e}")
    assert error <= tolerance, f"{what}: {found} is not {expected}"


def check_casadi(hamel, model, folder):
    import casadi

    subprocess.run([hamel, "generate", ROOT / f"models/specs/{model}.hamel", "--language", "casadi", "--scene", "default",
                    "--out-dir", folder], check=True, stdout=subprocess.DEVNULL)
    library = folder / f"{model}.so"
    subprocess.run(["cc", "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", folder / f"{model}.c",
                    folder / f"{model}_casadi.c", "-o", library, "-lm"], check=True)
    ode = casadi.external(f"{model}_ode", str(library))
    header = (folder / f"{model}.c").read_text()

    def names(which):
        text = header.split(f"{model}_{which}_names[", 1)[1].split("{", 1)[1].split("};", 1)[0]
        return [name.strip().strip('"') for name in text.split(",") if name.strip()]

    states, params = names("state"), names("param")
    case = reference(model)["cases"][0]
    p = [float(case["params"][name]) for name in params]
    checked = 0
    for point in case["points"]:
        if not set(states) <= set(point["state"]) or not set(states) <= set(point["derivative"]):
            continue
        y = [float(point["state"][name]) for name in states]
        expected = [float(point["derivative"][name]) for name in states]
        close(f"casadi {model}", np.array(ode(0.0, y, p)).ravel(), expected, POINT)
        checked += 1
    assert checked or model == "mobile_robot", f"no point of {model} was comparable"
    # The Jacobian against central differences, whose error is about 1e-9.
    y = np.array([float(case["points"][0]["state"].get(name, 0.3)) for name in states])
    jacobian = ode.jacobian()
    dy = ode(0.0, y, p)
    by_time, by_state, by_params = (np.array(casadi.DM(m)) for m in jacobian(0.0, y, p, dy))
    for found, at, call in [(by_state, y, lambda x: ode(0.0, x, p)), (by_params, np.array(p), lambda x: ode(0.0, y, x))]:
        columns = []
        for k in range(len(at)):
            h = np.zeros(len(at))
            h[k] = 1e-5 * max(1.0, abs(at[k]))
            columns.append((np.array(call(at + h)) - np.array(call(at - h))).ravel() / (2 * h[k]))
        close(f"casadi {model}, Jacobian", found, np.array(columns).T, 1e-6)
    assert np.all(np.isfinite(by_time))
    # CasADi's own graph calls it, with sparse derivatives.
    x = casadi.MX.sym("y", len(y))
    inside = casadi.Function("inside", [x], [casadi.jacobian(ode(0.0, x, p), x)])
    close(f"casadi {model}, in a graph", np.array(casadi.DM(inside(y))), by_state, 0.0)


def check_book(folder):
    """The block of the book runs beside the library that it speaks of."""
    text = (ROOT / "docs/book/c.md").read_text()
    code = text.split("```python\n", 1)[1].split("```", 1)[0].replace('"./', f'"{folder}/')
    found = {}
    exec(code, found)
    dy, jacobian = found["f"]([0.4, -0.3, 2.0, 0.0, 0.6, 0.8])
    assert dy.shape == (6, 1) and jacobian.shape == (6, 6) and jacobian.nnz() < 36


def check_fmu(hamel, model, folder):
    import fmpy
    from fmpy.validation import validate_fmu

    path = folder / f"{model}.fmu"
    subprocess.run([hamel, "generate", ROOT / f"models/specs/{model}.hamel", "--language", "fmu", "-o", path], check=True,
                   stdout=subprocess.DEVNULL)
    problems = validate_fmu(str(path))
    assert not problems, problems
    description = fmpy.read_model_description(str(path), validate=True)
    known = {variable.name for variable in description.modelVariables}
    defined = {unit.name for unit in description.unitDefinitions}
    named = {variable.unit for variable in description.modelVariables if variable.unit is not None}
    assert defined == named and "s" in defined, (defined, named)
    motion = reference(model)["trajectories"][0]
    start = {name: float(x) for source in ("params", "initial") for name, x in motion[source].items() if name in known}
    final = {name: float(x) for name, x in motion["final"].items() if name in known}
    assert final, f"{model} has no variable of the reference"
    stop = float(motion["t_final"])
    for kind in ("ModelExchange", "CoSimulation"):
        found = fmpy.simulate_fmu(str(path), fmi_type=kind, start_values=start, stop_time=stop, relative_tolerance=1e-10,
                                  output_interval=stop / 10, output=list(final), solver="CVode")
        close(f"{kind} {model}", [found[name][-1] for name in final], list(final.values()), MOTION)
    check_derivatives(path, description, start)


def check_derivatives(path, description, start):
    """Directional derivatives against central differences, and dependencies against both."""
    import fmpy
    from fmpy.fmi3 import FMU3Model

    folder = fmpy.extract(str(path))
    fmu = FMU3Model(guid=description.guid, unzipDirectory=folder, instanceName="one",
                    modelIdentifier=description.modelExchange.modelIdentifier)
    fmu.instantiate()
    numbers = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu.setFloat64([numbers[name] for name in start], list(start.values()))
    fmu.enterInitializationMode()
    states = [unknown.variable.derivative.valueReference for unknown in description.derivatives]
    unknowns = [unknown.variable.valueReference for unknown in description.derivatives + description.outputs]
    listed = {unknown.variable.valueReference: {v.valueReference for v in unknown.dependencies}
              for unknown in description.derivatives + description.outputs}
    at = np.array(fmu.getFloat64(states))
    for k, state in enumerate(states):
        h = 1e-5 * max(1.0, abs(at[k]))
        values = []
        for sign in (1, -1):
            fmu.setFloat64([state], [at[k] + sign * h])
            values.append(np.array(fmu.getFloat64(unknowns)))
        fmu.setFloat64([state], [at[k]])
        expected = (values[0] - values[1]) / (2 * h)
        found = np.array(fmu.getDirectionalDerivative(unknowns, [state], [1.0]))
        close(f"directional derivative {description.modelName}, {k}", found, expected, 1e-6)
        for unknown, value in zip(unknowns, found):
            assert value == 0 or state in listed[unknown], f"{unknown} depends on {state}"
    fmu.exitInitializationMode()
    fmu.terminate()
    fmu.freeInstance()


BALL = """model ball {
    param g = 9.81;
    coordinate z in real;
    lagrangian = 1/2*z_dot^2 - g*z;
    event impact = z falling { then z_dot = -z_dot/2; }
    initial z = 1;
    initial z_dot = 0;
}"""


def check_events(hamel, folder):
    """A ball that falls from height 1 hits the ground at t = sqrt(2/g), and half of that later is at height 1/4."""
    import fmpy

    (folder / "ball.hamel").write_text(BALL)
    path = folder / "ball.fmu"
    subprocess.run([hamel, "generate", folder / "ball.hamel", "--language", "fmu", "-o", path], check=True,
                   stdout=subprocess.DEVNULL)
    stop = 1.5 * np.sqrt(2 / 9.81)
    for kind in ("ModelExchange", "CoSimulation"):
        found = fmpy.simulate_fmu(str(path), fmi_type=kind, stop_time=stop, relative_tolerance=1e-10,
                                  output_interval=stop / 10, output=["z"], solver="CVode")
        close(f"{kind} ball", found["z"][-1], 0.25, MOTION)


def check_tunable(folder):
    """The same ball, whose weight is doubled while it falls; a parameter that is not finite is refused."""
    import fmpy
    from fmpy.fmi1 import FMICallException
    from fmpy.fmi3 import FMU3Slave

    path = str(folder / "ball.fmu")
    description = fmpy.read_model_description(path, validate=True)
    numbers = {variable.name: variable.valueReference for variable in description.modelVariables}
    assert {v.variability for v in description.modelVariables if v.causality == "parameter"} == {"tunable"}
    fmu = FMU3Slave(guid=description.guid, unzipDirectory=fmpy.extract(path), instanceName="one",
                    modelIdentifier=description.coSimulation.modelIdentifier)
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.2)
    fmu.setFloat64([numbers["g"]], [2 * 9.81])
    fmu.doStep(currentCommunicationPoint=0.2, communicationStepSize=0.1)
    expected = 1 - 9.81 * 0.2**2 / 2 - 9.81 * 0.2 * 0.1 - 2 * 9.81 * 0.1**2 / 2
    close("tuned ball", fmu.getFloat64([numbers["z"]])[0], expected, MOTION)
    try:
        fmu.setFloat64([numbers["g"]], [float("nan")])
        fmu.doStep(currentCommunicationPoint=0.3, communicationStepSize=0.1)
    except FMICallException:
        pass
    else:
        raise AssertionError("a parameter that is no number is taken")
    fmu.freeInstance()


def main():
    hamel = sys.argv[1] if len(sys.argv) > 1 else "hamel"
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for model in MODELS:
            check_casadi(hamel, model, folder)
            check_fmu(hamel, model, folder)
        check_book(folder)
        check_events(hamel, folder)
        check_tunable(folder)
        formulas.check_all(hamel, folder, MODELS)
    print("all as the reference data say")


main()
