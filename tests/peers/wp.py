"""Integrators in Python on the problems of `cargo xtask bench wp`, which starts this script.

    python3 tests/peers/wp.py <model>..

Prints a line `<model>;<by>;<method>;<tolerance>;<error>;<evaluations>;<steps>;<ns>` a solution; models without equations
here are passed over. Right-hand sides are vector algebra in the frame of the generated code, with parameters at run time,
and are checked against the reference points before anything is timed.
"""

import json
import pathlib
import sys
import time

import heyoka as hy

REFERENCE = pathlib.Path(__file__).resolve().parent.parent / "reference"
TOLERANCES = [f"1e-{k}" for k in range(3, 16)]
ROUNDS = 100
# Error that a right-hand side may have, relative to its largest component: rounding, amplified near singular states.
ACCURACY = 1e-13


def add(a, b):
    return [x + y for x, y in zip(a, b)]


def scale(s, a):
    return [s * x for x in a]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def diagonal(a):
    return [[a[i] if i == j else 0.0 for j in range(3)] for i in range(3)]


def times(matrix, a):
    return [dot(row, a) for row in matrix]


def about(inertia, m, s):
    """I - m [s]x^2."""
    square = dot(s, s)
    return [
        [inertia[i][j] + m * ((square if i == j else 0.0) - s[i] * s[j]) for j in range(3)] for i in range(3)
    ]


def solve(matrix, right):
    """By L D L^T, one reciprocal a pivot."""
    n = len(right)
    a, x, reciprocals = [row[:] for row in matrix], right[:], []
    for k in range(n):
        reciprocals.append(1.0 / a[k][k])
        for i in range(k + 1, n):
            factor = a[i][k] * reciprocals[k]
            for j in range(i, n):
                a[i][j] = a[j][i] = a[i][j] - factor * a[j][k] if j != k else a[i][j]
            x[i] = x[i] - factor * x[k]
            a[k][i] = factor
    x = [value * r for value, r in zip(x, reciprocals)]
    for k in reversed(range(n)):
        for i in range(k + 1, n):
            x[k] = x[k] - a[k][i] * x[i]
    return x


def heavy_top(p, s):
    omega, gamma = [s[f"Omega{i}"] for i in "123"], [s[f"Gamma{i}"] for i in "123"]
    inertia, chi = [p[f"I{i}"] for i in "123"], [p[f"chi{i}"] for i in "123"]
    momentum = [i * w for i, w in zip(inertia, omega)]
    torque = add(cross(momentum, omega), scale(p["m"] * p["g"] * p["l"], cross(gamma, chi)))
    return [t / i for t, i in zip(torque, inertia)] + cross(gamma, omega)


def euler_disk(p, s):
    sine, cosine = hy.sin(s["theta"]), hy.cos(s["theta"])
    frame = [s["theta_dot"], s["phi_dot"] * sine, s["phi_dot"] * cosine]
    omega = add(frame, [0.0, 0.0, s["psi_dot"]])
    arm = [0.0, p["r"], 0.5 * p["e"] * p["r"]]
    inertia = diagonal([p["I1"], p["I1"], p["I3"]])
    gravity = scale(-1.0 * p["M"] * p["g"], [0.0, sine, cosine])
    force = add(scale(p["M"], cross(frame, cross(omega, arm))), scale(-1.0, gravity))
    torque = scale(-1.0, add(cross(frame, times(inertia, omega)), cross(arm, force)))
    rate = solve(about(inertia, p["M"], arm), torque)
    phi_ddot = (rate[1] - s["phi_dot"] * s["theta_dot"] * cosine) / sine
    psi_ddot = rate[2] - phi_ddot * cosine + s["phi_dot"] * s["theta_dot"] * sine
    return [s["theta_dot"], s["phi_dot"], rate[0], phi_ddot, psi_ddot]


def chaplygin_ball(p, s):
    omega, gamma = [s[f"Omega{i}"] for i in "123"], [s[f"Gamma{i}"] for i in "123"]
    inertia, chi = diagonal([p[f"I{i}"] for i in "123"]), [p[f"chi{i}"] for i in "123"]
    contact = add(scale(p["r"], gamma), scale(p["l"], chi))
    velocity = add(scale(p["r"], cross(gamma, omega)), cross(omega, contact))
    torque = add(cross(times(inertia, omega), omega), scale(p["m"] * p["g"] * p["l"], cross(gamma, chi)))
    torque = add(torque, scale(-1.0 * p["m"], cross(contact, cross(omega, velocity))))
    return solve(about(inertia, p["m"], contact), torque) + cross(gamma, omega)


def two_arm_satellite(p, s):
    omega = [s[f"Omega{i}"] for i in "123"]
    inertia = diagonal([p[f"I{i}"] for i in "123"])
    matrix, torque, arms = inertia, cross(times(inertia, omega), omega), []
    for x, m, length, k, hinge, plane in [
        ("alpha", "ma", "la", "ka", [0.6, 0.0, 0.0], (0, 1)),
        ("beta", "mb", "lb", "kb", [0.0, 0.5, 0.2], (1, 2)),
    ]:
        lever, d = [0.0] * 3, [0.0] * 3
        lever[plane[0]], lever[plane[1]] = p[length] * hy.cos(s[x]), p[length] * hy.sin(s[x])
        d[plane[0]], d[plane[1]] = -1.0 * lever[plane[1]], lever[plane[0]]
        r, rate = add(hinge, lever), s[f"{x}_dot"]
        c = add(cross(omega, cross(omega, r)), scale(2.0 * rate, cross(omega, d)))
        c = add(c, scale(-1.0 * rate * rate, lever))
        b, own = scale(p[m], cross(r, d)), p[m] * p[length] * p[length]
        h = -1.0 * p[k] * s[x] - p[m] * dot(d, c)
        matrix = about(matrix, p[m], r)
        matrix = [[matrix[i][j] - b[i] * b[j] / own for j in range(3)] for i in range(3)]
        torque = add(torque, scale(-1.0, add(scale(p[m], cross(r, c)), scale(h / own, b))))
        arms.append((b, own, h))
    rate = solve(matrix, torque)
    return [s["alpha_dot"], s["beta_dot"]] + [(h - dot(b, rate)) / own for b, own, h in arms] + rate


MODELS = {f.__name__: f for f in (heavy_top, euler_disk, chaplygin_ball, two_arm_satellite)}
STATES = {
    "heavy_top": "Omega1 Omega2 Omega3 Gamma1 Gamma2 Gamma3",
    "euler_disk": "theta phi theta_dot phi_dot psi_dot",
    "chaplygin_ball": "Omega1 Omega2 Omega3 Gamma1 Gamma2 Gamma3",
    "two_arm_satellite": "alpha beta alpha_dot beta_dot Omega1 Omega2 Omega3",
}


def check(model, names, symbols, rates, params, points):
    function = hy.cfunc(rates, vars=symbols)
    for point in points:
        found = function([float(point["state"][n]) for n in names], pars=[float(x) for x in params])
        wanted = [float(point["derivative"][n]) for n in names]
        error = max(abs(x - y) for x, y in zip(found, wanted)) / max(1.0, *map(abs, wanted))
        if not error <= ACCURACY:
            raise SystemExit(f"{model}: the equations here are off by {error:e}")


def measure(model):
    file = json.loads((REFERENCE / f"{model}.json").read_text())
    case, trajectory = file["cases"][0], file["trajectories"][0]
    names, t_end = STATES[model].split(), float(trajectory["t_final"])
    symbols = [hy.expression(n) for n in names]
    params = {name: hy.par[i] for i, name in enumerate(trajectory["params"])}
    values = [float(x) for x in trajectory["params"].values()]
    rates = MODELS[model](params, dict(zip(names, symbols)))
    check(model, names, symbols, rates, [case["params"][n] for n in params], case["points"])
    start = [float(trajectory["initial"][n]) for n in names]
    end = [float(trajectory["final"][n]) for n in names]
    for tolerance in TOLERANCES:
        solver = hy.taylor_adaptive(list(zip(symbols, rates)), start, pars=values, tol=float(tolerance))

        def solution():
            solver.time = 0.0
            solver.state[:] = start
            clock = time.perf_counter_ns()
            outcome = solver.propagate_until(t_end)
            return time.perf_counter_ns() - clock, outcome

        _, outcome = solution()
        error = max(abs(x - y) / (1.0 + abs(y)) for x, y in zip(solver.state, end))
        ns = min(solution()[0] for _ in range(ROUNDS))
        print(f"{model};heyoka {hy.__version__};taylor;{tolerance};{error:e};{outcome[3]};{outcome[3]};{ns}", flush=True)


for name in sys.argv[1:]:
    if name in MODELS:
        measure(name)
