"""Scenes as formulas of CasADi, JAX, SymPy, Octave and Julia, run by these, against the program `hamel` and reference data.

Deliberately does not know: how any of it is written. Interpreters that are not there are named and left out.
"""

import importlib.util
import json
import math
import pathlib
import random
import re
import shutil
import subprocess
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
# What the order of operations and other elementary functions make of rounding.
POINT = 1e-11
N_POINTS = 3

SOFT = """model soft {
    param k = 3; input u = 1/4;
    coordinate q in real; coordinate v: vector(3) in real;
    state pressure in real by pressure_dot = u - pressure*sinc(q);
    let p = [sinc(q), q*cosc(q)]; let w = spin(rot(v));
    lagrangian = dot(rate(p), rate(p)) + q_dot^2/2 + dot(w, w)/2 - k*q^2 - p[2]*pressure;
    force q_dot = pressure*cosc(v1);
    output tip = p; output axis = rot(v)*[0, 0, 1]; output lead = log(rot(v)*rot([1, 0, 0], q));
    event stop = q - u falling { then q_dot = -u*q_dot; }
    initial q = 1/2; initial v = [1/5, -1/3, 1/4]; initial pressure = 1; initial q_dot = 1/3;
    initial v_dot = [1/2, 1/7, -1/5];
    scene default { input u; want energy, energy_rate, outputs, linearization, jvp; }
}"""

# Words of the languages, functions that modules bring with them, a square root of a parameter and a power.
WORDS = """model words {
    param lambda = 2 where lambda > 0; param end = 3 where end != 0; param jnp = 5; param sqrt = 1/3; param zeros = 7/4;
    coordinate y in real; coordinate function in (0, 4); coordinate let in angle; coordinate muladd in real;
    lagrangian = lambda*(y_dot^2 + function_dot^2)/2 + let_dot^2*(1 + y^2)/2 + muladd_dot^2*exp(sin(y))
        - end*y*function^(2/3) - jnp*sqrt(lambda + function^2) - zeros*cos(let)*sin(sqrt*y) - abs(end)*tanh(muladd);
    output casadi = y*function; output prepare = y + let; output angle = atan2(y, function); output words = [y, let];
    initial y = 1/3; initial function = 2; initial let = 1; initial muladd = -1/2;
    initial y_dot = 1/5; initial function_dot = 1/7; initial let_dot = -1; initial muladd_dot = 2;
    scene default { want energy, outputs, jacobian; }
}"""

# So many modes that the rates are sums over tables.
FLUID = """model fluid {
    algebra g = zeitlin(9);
    momentum omega in g as *;
    action right;
    hamiltonian = -dot(omega, laplacian(g)^-1*omega);
    scene default { want energy, jvp; }
}"""


def there(language):
    """Whether the language can be run here."""
    if language in ("matlab", "julia"):
        return shutil.which({"matlab": "octave-cli", "julia": "julia"}[language]) is not None
    return importlib.util.find_spec({"casadi-expr": "casadi"}.get(language, language)) is not None


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def evaluated(hamel, argument, scene, params, states, t, options):
    """What the program computes: rates, energy and outputs by name, of each state."""
    request = json.dumps({"params": params, "states": states, "t": t})
    run = subprocess.run([hamel, "eval", argument, "--scene", scene, *options], input=request, text=True,
                         capture_output=True)
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    names, rows = found["state"], []
    for k in range(len(states)):
        row = {"rhs": found["derivatives"][k]}
        if found["energy"] is not None:
            row["energy"] = [found["energy"][k]]
        row.update({name: list(group[k].values()) for name, group in found["outputs"].items()})
        rows.append(row)
    return names, rows


def error(found, expected):
    found, expected = np.ravel(np.asarray(found, float)), np.ravel(np.asarray(expected, float))
    if found.size > expected.size:
        # The program has the entries of a matrix that do not vanish.
        found, expected = found[found != 0], expected[expected != 0]
    assert found.shape == expected.shape, f"{found.shape} is not {expected.shape}"
    both = np.isfinite(expected)
    assert np.all(np.isfinite(found[both])), f"{found} is not {expected}"
    scale = 1 + np.abs(expected[both])
    return float(np.max(np.abs(found[both] - expected[both]) / scale, initial=0.0))


def names_of(module, functions):
    """The name of each function in a module: with something behind it where its own is taken."""
    spelled = {name: [n for n in (f"{name}_", f"{name}_2", name) if n in module] for name in functions}
    return {name: found[0] for name, found in spelled.items() if found}


def by_python(language, path, cases):
    """The worst error of the functions of a module of Python."""
    module = load(path)
    number = {"casadi-expr": lambda x: np.array(__import__("casadi").DM(x)), "jax": np.asarray,
              "sympy": lambda x: np.array(getattr(x, "evalf", lambda: x)().tolist() if hasattr(x, "tolist") else [x], float)}[language]
    worst = 0.0
    for params, t, y, expected in cases:
        p = module.prepare(**params)
        for name, function in names_of(vars(module), expected).items():
            worst = max(worst, error(number(getattr(module, function)(t, y, p)), expected[name]))
    return worst


def by_octave(path, cases):
    """The same of a function file, by Octave."""
    lines = [f"addpath('{path.parent}'); m = {path.stem}();"]
    text = path.read_text()
    listed = re.findall(r"model\.(\w+) = @", text)
    order = []
    for params, t, y, expected in cases:
        lines.append("params = m.params;")
        fields = dict(zip(params, re.findall(r"list\.(\w+) =", text.split("function list = published()", 1)[1].split("end\n", 1)[0])))
        lines += [f"params.{fields[name]} = {value!r};" for name, value in params.items()]
        lines.append(f"p = m.prepare(params); y = [{'; '.join(map(repr, y))}];")
        for name, function in names_of(listed, expected).items():
            lines.append(f"printf('%.17g ', m.{function}({t!r}, y, p).'); printf('\\n');")
            order.append(expected[name])
    (path.parent / f"run_{path.stem}.m").write_text("\n".join(lines))
    run = subprocess.run(["octave-cli", "--quiet", "--no-init-file", path.parent / f"run_{path.stem}.m"],
                         capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    found = [[float(x) for x in line.split()] for line in run.stdout.splitlines()]
    assert len(found) == len(order)
    return max(error(row, expected) for row, expected in zip(found, order))


def by_julia(path, name, cases):
    """The same of a module, by Julia."""
    text = path.read_text()
    lines = [f'include("{path}")']
    order = []
    module = re.search(r"^module (\w+)", text, re.M).group(1)
    fields = re.findall(r"^    (\w+) = ", text.split("const PARAMS", 1)[1].split("\n)\n", 1)[0], re.M)
    listed = {f.rstrip("!"): f for f in re.findall(r"^function (\w+!?)\(", text, re.M)}
    for params, t, y, expected in cases:
        given = ", ".join(f"{field} = {value!r}" for field, value in zip(fields, params.values()))
        lines.append(f"p = {module}.prepare(; {given}); y = [{', '.join(map(repr, y))}]")
        for name, function in names_of(listed, expected).items():
            function, n = listed[function], len(expected[name])
            if re.search(rf"rows of \d+\.[^\"]*\"\"\"\nfunction {function}", text):
                continue  # A matrix, whose shape the test does not know.
            call = f"{module}.{function}(y, p, {t!r})"
            if function.endswith("!"):
                call = f"(out = zeros({n}); {module}.{function}(out, y, p, {t!r}); out)"
            lines.append(f"println(join({call}, ' '))")
            order.append(expected[name])
    run = subprocess.run(["julia", "--startup-file=no", "-e", "\n".join(lines)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    found = [[float(x) for x in line.split()] for line in run.stdout.splitlines()]
    return max(error(row, expected) for row, expected in zip(found, order))


LANGUAGES = ["casadi-expr", "jax", "sympy", "matlab", "julia"]


def run(language, path, cases):
    if language == "matlab":
        return by_octave(path, cases)
    if language == "julia":
        return by_julia(path, path.stem, cases)
    return by_python(language, path, cases)


def with_flipped_sign(text, function):
    """The module with the first plus of a function as minus."""
    head, mark, rest = text.partition(function)
    assert mark
    lines = rest.split("\n")
    for k, line in enumerate(lines):
        is_code = re.match(r"\s+\w+ = (let\()?", line) and not line.lstrip().startswith(("dot_", "r_"))
        is_code = is_code or re.match(r"\s+dot_\w+ = (let\(|.*(\[|p\.|muladd))", line)
        if is_code and " + " in line:
            lines[k] = line.replace(" + ", " - ", 1)
            return head + mark + "\n".join(lines)
        if is_code and "muladd(" in line:
            lines[k] = line.replace("muladd(", "muladd(-", 1)
            return head + mark + "\n".join(lines)
    raise AssertionError("no sum in the function")


def cases_of(hamel, argument, scene, names, values, params, options, drawn):
    """Points near the initial state, with what the program computes there."""
    points, t = [], 0.3
    draw = random.Random(drawn)
    for _ in range(N_POINTS):
        points.append([x + 0.2 * draw.uniform(-1, 1) * max(1.0, abs(x)) for x in values])
    scaled = {name: x * (1 + 0.05 * draw.uniform(-1, 1)) for name, x in params.items()}
    states = [dict(zip(names, y)) for y in points]
    found, rows = evaluated(hamel, argument, scene, scaled, states, t, options)
    assert found == names, (found, names)
    return [(scaled, t, y, row) for y, row in zip(points, rows)]


def check(hamel, argument, scene, folder, options=()):
    """Every language at random points; a sign that is turned around is found."""
    generated = folder / "formulas"
    generated.mkdir(exist_ok=True)
    skipped = []
    cases = None
    for language in LANGUAGES:
        if not there(language):
            skipped.append(language)
            continue
        subprocess.run([hamel, "generate", argument, "--scene", scene, "--language", language, "--out-dir", generated,
                        *options], check=True, capture_output=True)
        name = (argument.stem if hasattr(argument, "stem") else argument) + ("" if scene == "default" else f"_{scene}")
        ending = {"casadi-expr": "_casadi.py", "jax": "_jax.py", "sympy": "_sympy.py", "matlab": ".m", "julia": ".jl"}[language]
        path = generated / (name + ending)
        if not path.exists():
            # The first function of a file of MATLAB is called like no other.
            path = generated / f"{name}_2{ending}"
        if cases is None:
            module = load_lists(hamel, argument, scene, generated, name, options)
            cases = cases_of(hamel, argument, scene, *module, options, drawn=len(name))
        worst = run(language, path, cases)
        print(f"{language} {name}: {worst:.1e}")
        assert worst <= POINT, f"{language} {name}: off by {worst}"
    return skipped, cases


def load_lists(hamel, argument, scene, folder, name, options):
    """Names of the state, values that it begins at, parameters: by the module for SymPy or for JAX, as texts."""
    subprocess.run([hamel, "generate", argument, "--scene", scene, "--language", "jax", "--out-dir", folder, *options], check=True,
                   capture_output=True)
    text = (folder / f"{name}_jax.py").read_text()
    lists = {}
    for key in ("PARAMS", "STATE", "INITIAL"):
        match = re.search(rf"^{key} = ([({{].*?^[)}}])$", text, re.M | re.S)
        lists[key] = eval(match.group(1)) if match else None
    values = lists["INITIAL"] or [0.3 + 0.1 * k for k in range(len(lists["STATE"]))]
    return list(lists["STATE"]), list(values), lists["PARAMS"]


def check_fault(hamel, folder):
    """A turned sign in any language is found."""
    for language, ending, function in [("casadi-expr", "_casadi.py", "def rhs("), ("jax", "_jax.py", "def rhs("),
                                       ("sympy", "_sympy.py", "def rhs("), ("matlab", ".m", "= rhs("), ("julia", ".jl", "function rhs!(")]:
        if not there(language):
            continue
        generated = folder / "formulas"
        faulty = folder / "faulty"
        faulty.mkdir(exist_ok=True)
        values = load_lists(hamel, "heavy_top", "default", generated, "heavy_top", ())
        cases = cases_of(hamel, "heavy_top", "default", *values, (), drawn=9)
        path = faulty / f"heavy_top{ending}"
        path.write_text(with_flipped_sign((generated / f"heavy_top{ending}").read_text(), function))
        assert run(language, path, cases) > 1e-3, f"{language}: a turned sign is not found"
        print(f"{language}: a turned sign is found")


def check_derivatives(folder):
    """JAX and CasADi have derivatives of second order, by the state and by parameters; SymPy the same as formulas."""
    generated = folder / "formulas"
    y = np.array([0.4, -0.3, 2.0, 0.1, 0.6, 0.8])
    hessians = {}
    if there("jax"):
        import jax

        top = load(generated / "heavy_top_jax.py")
        energy = jax.jit(lambda y, m: top.energy(0.0, y, top.prepare(m=m)))
        hessians["jax"] = np.asarray(jax.hessian(energy)(y, 1.1))
        by_mass = jax.jacfwd(lambda m: top.rhs(0.0, y, top.prepare(m=m)))(1.1)
        assert np.all(np.isfinite(by_mass)) and np.max(np.abs(by_mass)) > 0.1
    if there("casadi-expr"):
        import casadi

        top = load(generated / "heavy_top_casadi.py")
        for kind in (casadi.SX, casadi.MX):
            x = kind.sym("y", 6)
            hessian, _ = casadi.hessian(top.energy(0.0, x, top.prepare()), x)
            hessians[kind.__name__] = np.array(casadi.DM(casadi.Function("h", [x], [hessian])(y)))
            f = top.function(kind)
            dy = np.array(f(0.0, y, list(top.PARAMS.values()))).ravel()
            assert error(dy, np.array(casadi.DM(top.rhs(0.0, y, top.prepare()))).ravel()) <= POINT
        check_optimal_control(top)
    if there("sympy"):
        import sympy

        top = load(generated / "heavy_top_sympy.py")
        t, state, params = top.symbols()
        energy = top.energy(t, state, top.prepare(**params))
        assert sympy.latex(energy)
        hessian = sympy.hessian(energy, state).subs({params[name]: value for name, value in top.PARAMS.items()})
        hessians["sympy"] = np.array(hessian.subs(dict(zip(state, y))).evalf().tolist(), float)
        # Definitions as lambdify takes them give what the whole expressions give.
        steps = top.Definitions()
        short = top.rhs(t, state, top.prepare(**params), let=steps)
        f = sympy.lambdify([t, state, list(params.values())], short, cse=lambda _: (steps, [short]))
        whole = np.array(top.rhs(0, [float(x) for x in y], top.prepare()).evalf().tolist(), float)
        assert error(f(0.0, y, [float(x) for x in top.PARAMS.values()]), whole) <= POINT
    for name, hessian in hessians.items():
        found = error(hessian, next(iter(hessians.values())))
        print(f"{name}, second derivatives: {found:.1e}")
        assert found <= POINT


def check_optimal_control(top):
    """IPOPT with its exact Hessians, which external functions do not have, brings the top to a spin by a step of Gauss."""
    import casadi

    y0, x = np.array(top.INITIAL), casadi.MX.sym("x", 6)
    middle = (x + casadi.DM(y0)) / 2
    step = x - casadi.DM(y0) - 0.01 * top.rhs(0.0, middle, top.prepare())
    solver = casadi.nlpsol("solver", "ipopt", {"x": x, "f": top.energy(0.0, x, top.prepare()), "g": step},
                           {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False})
    solution = solver(x0=y0, lbg=0, ubg=0)
    assert solver.stats()["success"] and solver.stats()["iterations"]
    energies = [float(top.energy(0.0, at, top.prepare())) for at in (y0, np.array(solution["x"]).ravel())]
    assert error(energies[1], energies[0]) <= 1e-6


def check_book(folder):
    """The blocks of the book run beside the files that they speak of; what the one for Julia names is there."""
    generated = folder / "formulas"
    text = (ROOT / "docs/book/formulas.md").read_text()
    for code in re.findall(r"```python\n(.*?)```", text, re.S):
        if all(there(name) for name in re.findall(r"^import (casadi|jax|sympy)$", code, re.M)):
            sys.path.insert(0, str(generated))
            exec(code, {})
            sys.path.remove(str(generated))
    if there("matlab"):
        code = re.search(r"```matlab\n(.*?)```", text, re.S).group(1)
        (folder / "block.m").write_text(f"addpath('{generated}');\n{code}\nassert(size(y, 2) == 6 && t(end) == 10);\n")
        subprocess.run(["octave-cli", "--quiet", "--no-init-file", folder / "block.m"], check=True)
    if there("julia"):
        module = (generated / "heavy_top.jl").read_text()
        code = re.search(r"```julia\n(.*?)```", text, re.S).group(1)
        for name in re.findall(r"heavy_top\.([\w!]+)", code.replace('"heavy_top.jl"', "")):
            assert re.search(rf"^(function|const) {name}\b", module, re.M) or f"function {name}(" in module, name


def check_conditions(folder):
    """A parameter that violates a condition, one that is not finite and one that is not there are refused."""
    for language, ending in [("casadi-expr", "_casadi.py"), ("jax", "_jax.py"), ("sympy", "_sympy.py")]:
        if not there(language):
            continue
        prepare = load(folder / "formulas" / f"heavy_top{ending}").prepare
        for kind, changes in [(ValueError, {"m": -1.0}), (ValueError, {"g": math.inf}), (TypeError, {"mass": 1.0})]:
            try:
                prepare(**changes)
            except kind:
                continue
            raise AssertionError(f"{language}: {changes} is taken")


def check_all(hamel, folder, models):
    if there("jax"):
        import jax

        jax.config.update("jax_enable_x64", True)
    for name, text in [("soft", SOFT), ("words", WORDS), ("fluid", FLUID)]:
        (folder / f"{name}.hamel").write_text(text)
    skipped = []
    for argument, scene, options in [(model, "default", ()) for model in models] + [
        (folder / "soft.hamel", "default", ()),
        (folder / "words.hamel", "default", ()),
        ("heavy_top", "derivatives", ()),
        ("snakeboard", "controlled", ()),
        (folder / "fluid.hamel", "default", ()),
    ]:
        left_out, _ = check(hamel, argument, scene, folder, options)
        skipped = left_out
    for language in skipped:
        print(f"skipped: {language} is not installed")
    check_derivatives(folder)
    check_book(folder)
    check_conditions(folder)
    check_fault(hamel, folder)
