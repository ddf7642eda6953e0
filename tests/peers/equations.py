"""Equations of motion as an expert would give them to a code generator, and the reference data they have to meet.

Newton-Euler form in the best frame, as vector algebra, parameters at run time. A model is a function `(f, p, s)` of
functions `f.sin`, `f.cos`, `f.sqrt`, parameters and state by name; it returns the rates in the order of `STATES`. It works on
symbols of any package as on floats: coefficients are whole numbers or quotients of them, and zeros stay whole numbers.

Knows no package, and nothing of how anything is measured.
"""

import json
import math
import pathlib

# Error that a right-hand side may have, relative to its largest component: rounding, amplified near singular states.
ACCURACY = 1e-13
REFERENCE = pathlib.Path(__file__).resolve().parent.parent / "reference"


def vector(names, name):
    return [names[f"{name}{i}"] for i in "123"]


def add(*vectors):
    return [sum(terms[1:], terms[0]) for terms in zip(*vectors)]


def scale(s, a):
    return [s * x for x in a]


def each(a, b):
    return [x * y for x, y in zip(a, b)]


def dot(a, b):
    first, *rest = each(a, b)
    return sum(rest, first)


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def diagonal(a):
    return [[a[i] if i == j else 0 for j in range(len(a))] for i in range(len(a))]


def about(inertia, m, s):
    """`I - m [s]x^2`."""
    matrix = [[inertia[i][j] - m * (s[i] * s[j]) for j in range(3)] for i in range(3)]
    for i, j, k in [(0, 1, 2), (1, 2, 0), (2, 0, 1)]:
        matrix[i][i] = inertia[i][i] + m * (s[j] * s[j] + s[k] * s[k])
    return matrix


def solve(matrix, right):
    """By `L D L^T`, one reciprocal a pivot; zeros of the matrix stay zeros."""
    n = len(right)
    a, x, reciprocals = [list(row) for row in matrix], list(right), []
    for k in range(n):
        reciprocals.append(1 / a[k][k])
        column = [a[i][k] for i in range(n)]
        for i in range(k + 1, n):
            factor = column[i] * reciprocals[k]
            for j in range(i, n):
                a[j][i] = a[j][i] - factor * column[j]
            x[i] = x[i] - factor * x[k]
            a[i][k] = factor
    x = each(x, reciprocals)
    for k in reversed(range(n)):
        for i in range(k + 1, n):
            x[k] = x[k] - a[i][k] * x[i]
    return x


def solve_about(inertia, m, s, right, square=None):
    """`(I - m [s]x^2) x = right` of a diagonal `I`: a diagonal and a term of rank one (Sherman and Morrison)."""
    reciprocals = [1 / (i + m * (dot(s, s) if square is None else square)) for i in inertia]
    u, x = each(reciprocals, s), each(reciprocals, right)
    return add(x, scale(m * dot(s, x) * (1 / (1 - m * dot(s, u))), u))


def heavy_top(f, p, s):
    """`I Omega' = I Omega x Omega + m g l Gamma x chi`, `Gamma' = Gamma x Omega`."""
    omega, gamma = vector(s, "Omega"), vector(s, "Gamma")
    inertia, chi = vector(p, "I"), vector(p, "chi")
    torque = add(cross(each(inertia, omega), omega), scale(p["m"] * p["g"] * p["l"], cross(gamma, chi)))
    return [t / i for t, i in zip(torque, inertia)] + cross(gamma, omega)


def kirchhoff_body(f, p, s):
    """`(Pi, P) = K (Omega, V)`, `Pi' = Pi x Omega + P x V`, `P' = P x Omega`; the diagonal block is eliminated first."""
    omega, v = vector(s, "Omega"), vector(s, "V")
    j, m = vector(p, "J"), vector(p, "M")
    c = [vector(p, f"C{i}") for i in "123"]
    transposed = [list(column) for column in zip(*c)]
    angular = [j[i] * omega[i] + dot(c[i], v) for i in range(3)]
    linear = [m[i] * v[i] + dot(transposed[i], omega) for i in range(3)]
    matrix = [d + t for d, t in zip(diagonal(m), transposed)] + [r + d for r, d in zip(c, diagonal(j))]
    rate = solve(matrix, cross(linear, omega) + add(cross(angular, omega), cross(linear, v)))
    return rate[3:] + rate[:3]


def euler_disk(f, p, s):
    """In the frame of nodes and axis, about the contact; the moments are constant there."""
    sine, cosine = f.sin(s["theta"]), f.cos(s["theta"])
    frame = [s["theta_dot"], s["phi_dot"] * sine, s["phi_dot"] * cosine]
    omega = add(frame, [0, 0, s["psi_dot"]])
    arm = [0, p["r"], p["e"] * p["r"] / 2]
    weight = p["M"] * p["g"]
    force = add(scale(p["M"], cross(frame, cross(omega, arm))), [0, weight * sine, weight * cosine])
    inertia = [p["I1"], p["I1"], p["I3"]]
    torque = add(cross(each(inertia, omega), frame), cross(force, arm))
    rate = solve(about(diagonal(inertia), p["M"], arm), torque)
    phi_ddot = (rate[1] - frame[2] * s["theta_dot"]) / sine
    psi_ddot = rate[2] - phi_ddot * cosine + frame[1] * s["theta_dot"]
    return [s["theta_dot"], s["phi_dot"], rate[0], phi_ddot, psi_ddot]


def euler_disk_advected(f, p, s):
    """With `u = (Gamma1, Gamma2, 0)/n`, `s = r u`: `s' = r w e3 x u`, `w = Gamma3 (u . Omega)/n - Omega3`."""
    omega, gamma = vector(s, "Omega"), vector(s, "Gamma")
    inertia, r = [p["I1"], p["I1"], p["I3"]], p["r"]
    reciprocal = 1 / f.sqrt(gamma[0] * gamma[0] + gamma[1] * gamma[1])
    u = [gamma[0] * reciprocal, gamma[1] * reciprocal, 0]
    turning = gamma[2] * reciprocal * (u[0] * omega[0] + u[1] * omega[1]) - omega[2]
    arm = scale(r, u)
    velocity = add(scale(r * turning, [0 - u[1], u[0], 0]), cross(omega, arm))
    force = add(scale(p["g"], gamma), cross(omega, velocity))
    torque = add(cross(each(inertia, omega), omega), scale(p["m"], cross(force, arm)))
    return solve_about(inertia, p["m"], arm, torque, r * r) + cross(gamma, omega)


def chaplygin_ball(f, p, s):
    """About the contact, from which the mass centre is at `a = r Gamma + l chi`, so that `a' + Omega x a = l Omega x chi`.

    The torque of gravity and of that acceleration is `m l (g + r |Omega|^2) Gamma x chi + m l (Omega . chi) Omega x a`.
    """
    omega, gamma = vector(s, "Omega"), vector(s, "Gamma")
    inertia, chi = vector(p, "I"), vector(p, "chi")
    arm = add(scale(p["r"], gamma), scale(p["l"], chi))
    ml = p["m"] * p["l"]
    torque = add(
        cross(each(inertia, omega), omega),
        scale(ml * (p["g"] + p["r"] * dot(omega, omega)), cross(gamma, chi)),
        scale(ml * dot(omega, chi), cross(omega, arm)),
    )
    return solve_about(inertia, p["m"], arm, torque) + cross(gamma, omega)


def snakeboard(f, p, s):
    """`(b sin^2 phi + a cos^2 phi) s' = (a - b) s phi' sin phi cos phi` with `a = m r^2`, `b = J + 2 J1`; a free rotor."""
    sine, cosine = f.sin(s["phi"]), f.cos(s["phi"])
    a, b = p["m"] * p["r"] * p["r"], p["J"] + 2 * p["J1"]
    turning = s["s"] * s["phi_dot"] * cosine
    s_dot = (a - b) * sine * turning * (1 / (b * sine * sine + a * cosine * cosine))
    return [s["psi_dot"], s["phi_dot"], 0 - (sine * s_dot + turning), 0, s_dot]


def mobile_robot(f, p, s):
    """`(m + 2 J2/R^2) v' = m0 l omega^2`, `(J + 2 J2 c^2/R^2) omega' = -m0 l omega v`, `R psi1,2' = -(v +- c omega)`."""
    r, c, m0l = p["R"], p["c"], p["m0"] * p["l"]
    v = r / 2 * (0 - s["psi1_dot"] - s["psi2_dot"])
    omega = r / 2 * (s["psi2_dot"] - s["psi1_dot"]) * (1 / c)
    common = m0l * omega * r
    forward = common * omega * (1 / ((p["m0"] + 2 * p["m1"]) * r * r + 2 * p["J2"]))
    turn = common * v * c * (1 / (p["J"] * r * r + 2 * p["J2"] * c * c))
    return [s["psi1_dot"], s["psi2_dot"], turn - forward, 0 - turn - forward]


def two_arm_satellite(f, p, s):
    """Arms first, then the body: a mass at `r` with `d = dr/dx` feels the acceleration `c`, its row is `(m l^2, b)`."""
    omega = vector(s, "Omega")
    inertia = vector(p, "I")
    locked, torque, arms = diagonal(inertia), cross(each(inertia, omega), omega), []
    for x, m, length, k, hinge, plane in [
        ("alpha", p["ma"], p["la"], p["ka"], [0.6, 0, 0], (0, 1)),
        ("beta", p["mb"], p["lb"], p["kb"], [0, 0.5, 0.2], (1, 2)),
    ]:
        lever, d = [0] * 3, [0] * 3
        lever[plane[0]], lever[plane[1]] = length * f.cos(s[x]), length * f.sin(s[x])
        d[plane[0]], d[plane[1]] = 0 - lever[plane[1]], lever[plane[0]]
        r, rate = add(hinge, lever), s[f"{x}_dot"]
        c = add(cross(omega, cross(omega, r)), scale(2 * rate, cross(omega, d)), scale(0 - rate * rate, lever))
        locked = about(locked, m, r)
        torque = add(torque, scale(m, cross(c, r)))
        arms.append((m * length * length, scale(m, cross(r, d)), 0 - k * s[x] - m * dot(d, c)))
    (own_a, b_a, force_a), (own_b, b_b, force_b) = arms
    rows = [[own_a, 0, *b_a], [0, own_b, *b_b]] + [[b_a[i], b_b[i], *locked[i]] for i in range(3)]
    return [s["alpha_dot"], s["beta_dot"]] + solve(rows, [force_a, force_b, *torque])


MODELS = {
    f.__name__: f
    for f in (
        heavy_top,
        kirchhoff_body,
        euler_disk,
        euler_disk_advected,
        chaplygin_ball,
        snakeboard,
        mobile_robot,
        two_arm_satellite,
    )
}
STATES = {
    "heavy_top": "Omega1 Omega2 Omega3 Gamma1 Gamma2 Gamma3",
    "kirchhoff_body": "Omega1 Omega2 Omega3 V1 V2 V3",
    "euler_disk": "theta phi theta_dot phi_dot psi_dot",
    "euler_disk_advected": "Omega1 Omega2 Omega3 Gamma1 Gamma2 Gamma3",
    "chaplygin_ball": "Omega1 Omega2 Omega3 Gamma1 Gamma2 Gamma3",
    "snakeboard": "psi phi psi_dot phi_dot s",
    "mobile_robot": "psi1 psi2 psi1_dot psi2_dot",
    "two_arm_satellite": "alpha beta alpha_dot beta_dot Omega1 Omega2 Omega3",
}


class Problem:
    """A model with its reference data; parameters in the order of `params`, states in that of `state`."""

    def __init__(self, model):
        file = json.loads((REFERENCE / f"{model}.json").read_text())
        self.model, self.state = model, STATES[model].split()
        case, self.trajectories = file["cases"][0], file["trajectories"]
        self.params = list(case["params"])
        self.values = self.numbers(case["params"], self.params)
        self.points = [
            (self.numbers(point["state"], self.state), self.numbers(point["derivative"], self.state))
            for point in case["points"]
        ]

    @staticmethod
    def numbers(values, names):
        return [float(values[name]) for name in names]

    def rates(self, f, params, state):
        """The rates from parameters and state in order."""
        return MODELS[self.model](f, dict(zip(self.params, params)), dict(zip(self.state, state)))

    def error(self, evaluate):
        """The largest error of `evaluate(params, state)` at the reference points, relative to the largest component."""
        worst = 0.0
        for state, wanted in self.points:
            found = list(evaluate(self.values, state))
            if len(found) != len(wanted) or not all(map(math.isfinite, found)):
                return math.inf
            error = max(abs(x - y) for x, y in zip(found, wanted))
            worst = max(worst, error / max(1.0, *map(abs, wanted)))
        return worst


class Trajectory(Problem):
    """A problem with start and end of one of its trajectories, which are counted from one on."""

    def __init__(self, model, k=1):
        super().__init__(model)
        self.k = k
        trajectory = self.trajectories[k - 1]
        self.t_end = float(trajectory["t_final"])
        self.start = self.numbers(trajectory["initial"], self.state)
        self.end = self.numbers(trajectory["final"], self.state)
        self.values = self.numbers(trajectory["params"], self.params)

    def off(self, state):
        return max(abs(x - y) / (1.0 + abs(y)) for x, y in zip(state, self.end))

    def check(self, evaluate):
        if not (error := self.error(evaluate)) <= ACCURACY:
            raise SystemExit(f"{self.model}: the equations here are off by {error:e}")
