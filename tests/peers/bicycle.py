"""Whipple's bicycle by other code generators: operations, and times beside hamel's C.

    hamel generate whipple_bicycle --scene moving --language c --out-dir <folder>
    hamel generate whipple_bicycle --scene moving --out-dir <folder>
    python3 tests/peers/bicycle.py [<folder>]

Where there is cargo, and the folder has hamel's Rust, this is compiled and timed as well, for one state and for four and
eight side by side.

SymPy's equations are those of its own test `physics/mechanics/tests/test_kane3.py` (Kane's method, a 6x6 system in
independent and dependent speeds), CasADi's those of hamel's model: Kane's method along three rates, each assembly in
its own frame, derivatives by automatic differentiation. Both are written out after elimination of common
subexpressions, with everything that depends on parameters alone computed beforehand, and hold the accelerations of
table 1 of Basu-Mandal, Chatterjee and Papadopoulos 2007. The linear systems are factored as `L D L^T` (CasADi) and by
elimination with pivots (SymPy), whose operations are counted as well.

Knows nothing of hamel's equations.
"""

import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time

import casadi as ca
import sympy as sp
import sympy.physics.mechanics.tests.test_kane3 as test_kane3

FLAGS = ["-O2", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"]
LAMBDA = math.pi / 10
VALUES = {
    "w": 1.02, "c": 0.08, "lambda": LAMBDA, "g": 9.81,
    "rR": 0.3, "mR": 2, "IRxx": 0.0603, "IRyy": 0.12,
    "xB": 0.3, "zB": -0.9, "mB": 85, "IBxx": 9.2, "IByy": 11, "IBzz": 2.8, "IBxz": 2.4,
    "xH": 0.9, "zH": -0.7, "mH": 4, "IHxx": 0.05892, "IHyy": 0.06, "IHzz": 0.00708, "IHxz": -0.00756,
    "rF": 0.35, "mF": 3, "IFxx": 0.1405, "IFyy": 0.28,
}
# Basu-Mandal, Chatterjee and Papadopoulos 2007, table 1, with lean, pitch and steer of Meijaard et al.; rates and
# accelerations of lean, pitch and yaw as they stand there.
LEAN = (math.pi / 2 - 0.9501292851472, -0.6068425835418, 7.8555281128244)
PITCH = (math.pi - 3.1257073014894, 0.0119185528069, -0.1205543897884)
YAW_RATE = -0.7830033527065
STEER = (-0.2311385135743, -0.4859824687093, 4.6198904039403)
REAR = (-8.9129896614890, -1.8472554144217)


class Code:
    """Statements `t = a op b` in order, as (target, operation, operands), with the names of the results."""

    def __init__(self, name):
        self.name, self.statements, self.results = name, [], []

    def split(self, state):
        """Statements of parameters alone, and those of the state."""
        moving, fixed, own = set(state), [], []
        for statement in self.statements:
            target, _, operands = statement
            if any(operand in moving for operand in operands):
                moving.add(target)
                own.append(statement)
            else:
                fixed.append(statement)
        return fixed, own

    def count(self, state):
        """Operations on values that change: sums, products, quotients and functions; signs are free."""
        return sum(operation not in ("-u", "copy") for _, operation, _ in self.split(state)[1])

    def c(self, params, state):
        """A function `prepare` of the parameters, and one of the state."""
        fixed, own = self.split(state)
        defined = {target for target, _, _ in fixed}
        used = [o for _, _, operands in own for o in operands] + self.results
        kept = [name for name in dict.fromkeys(used) if name in defined or name in params]
        write = {"-u": "-{0}", "copy": "{0}", "sq": "{0} * {0}", "inv": "1.0 / {0}"}
        write |= {op: "{0} " + op + " {1}" for op in "+-*/"}

        def lines(statements):
            for target, operation, operands in statements:
                text = write.get(operation, operation + "({0})").format(*operands)
                yield f"  const double {target} = {text};"

        read = [f"  const double {name} = {{}}[{k}];" for k, name in enumerate(params)]
        return "\n".join(
            [f"static double {self.name}_k[{max(len(kept), 1)}];"]
            + [f"static void {self.name}_prepare(const double *p) {{"]
            + [line.format("p") for line in read] + list(lines(fixed))
            + [f"  {self.name}_k[{k}] = {name};" for k, name in enumerate(kept)] + ["}"]
            + [f"__attribute__((noinline)) static void {self.name}(const double *y, double *dy) {{"]
            + [f"  const double {name} = {self.name}_k[{k}];" for k, name in enumerate(kept)]
            + [f"  const double {name} = y[{k}];" for k, name in enumerate(state)] + list(lines(own))
            + [f"  dy[{k}] = {name};" for k, name in enumerate(self.results)] + ["}"]
        )


def of_sympy(name, expressions):
    """Code of SymPy's expressions after `cse`."""
    code, n = Code(name), [0]
    replacements, reduced = sp.cse(expressions, symbols=sp.numbered_symbols(f"{name}_x"), optimizations="basic")

    def step(operation, *operands):
        n[0] += 1
        target = f"{name}_t{n[0]}"
        code.statements.append((target, operation, operands))
        return target

    def is_negative(e):
        return e.could_extract_minus_sign() and (e.is_Mul or e.is_Number)

    def written(e):
        if e.is_Symbol:
            return e.name
        if e.is_Number:
            return f"({sp.Float(e, 17)})" if e.is_negative else f"{sp.Float(e, 17)}"
        if e.is_Add:
            terms = sorted(e.args, key=is_negative)
            total = written(terms[0])
            for term in terms[1:]:
                negative = is_negative(term)
                total = step("-" if negative else "+", total, written(-term if negative else term))
            return total
        if e.is_Mul:
            coefficient, rest = e.as_coeff_Mul()
            if coefficient == -1:
                return step("-u", written(rest))
            upper, lower = [], []
            for factor in e.args:
                base, exponent = factor.as_base_exp()
                if exponent.is_Number and exponent.is_negative:
                    lower.append(base**-exponent)
                else:
                    upper.append(factor)
            total = written(upper[0]) if upper else "1.0"
            for factor in upper[1:]:
                total = step("*", total, written(factor))
            for factor in lower:
                total = step("/", total, written(factor))
            return total
        if e.is_Pow:
            base, exponent = e.args
            if exponent == sp.Rational(1, 2):
                return step("sqrt", written(base))
            if exponent.is_Number and exponent.is_negative:
                return step("inv", written(base**-exponent))
            if exponent.is_Integer:
                at = written(base)
                total = at
                for _ in range(int(exponent) - 1):
                    total = step("*", total, at)
                return total
            if exponent == sp.Rational(3, 2):
                at = written(base)
                return step("*", at, step("sqrt", at))
        if e.func in (sp.sin, sp.cos):
            return step(e.func.__name__, written(e.args[0]))
        raise NotImplementedError(e)

    for symbol, value in replacements:
        code.statements.append((symbol.name, "copy", (written(value),)))
    code.results = [written(e) for e in reduced]
    return code


def of_casadi(name, function):
    """Code of the instructions of a CasADi function."""
    unary = {ca.OP_NEG: "-u", ca.OP_SQ: "sq", ca.OP_INV: "inv", ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin",
             ca.OP_COS: "cos", ca.OP_ASSIGN: "copy"}
    binary = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
    code, work = Code(name), {}
    inputs = [[str(x) for x in ca.vertsplit(function.sx_in(i))] for i in range(function.n_in())]
    results = {}
    for k in range(function.n_instructions()):
        operation, o = function.instruction_id(k), function.instruction_output(k)
        i = function.instruction_input(k)
        target = f"{name}_t{k}"
        if operation == ca.OP_INPUT:
            work[o[0]] = inputs[i[0]][i[1]]
        elif operation == ca.OP_OUTPUT:
            results[o[1]] = work[i[0]]
        elif operation == ca.OP_CONST:
            work[o[0]] = repr(function.instruction_constant(k))
        elif operation == ca.OP_TWICE:
            code.statements.append((target, "+", (work[i[0]], work[i[0]])))
            work[o[0]] = target
        elif operation in unary:
            code.statements.append((target, unary[operation], (work[i[0]],)))
            work[o[0]] = target
        else:
            code.statements.append((target, binary[operation], (work[i[0]], work[i[1]])))
            work[o[0]] = target
    code.results = [results[k] for k in sorted(results)]
    return code


def by_sympy():
    """The mass matrix (6x6) and the right side of SymPy's own test: code, its parameters and their values."""
    source = pathlib.Path(test_kane3.__file__).read_text()
    model = re.search(r"def test_bicycle\(\):\n(.*?)(?=    # This is the start of entering)", source, re.S)[1]
    model = textwrap.dedent(model)
    values = textwrap.dedent(re.search(r"\n(    PaperRadRear .*?)(?=    # Here is the final)", source, re.S)[1])
    numbers = re.search(r"val_dict = \{(.*?g: 9.81)", source, re.S)[1]
    scope = dict(vars(test_kane3))
    start = time.time()
    exec(model, scope)
    system = scope["KM"]
    elapsed = time.time() - start
    exec(values, scope)
    values = eval("{" + numbers + "}", scope)
    q = [scope[name] for name in ("q1", "q2", "q4", "q5")]
    u = [scope[f"u{k}"] for k in (2, 3, 5, 1, 4, 6)]
    plain = {x: sp.Symbol(x.func.__name__) for x in q + u}
    start = time.time()
    expressions = [e.xreplace(plain) for e in [*system.mass_matrix, *system.forcing]]
    code = of_sympy("sympy", expressions)
    elapsed += time.time() - start
    params = [p.name for p in values]
    return code, params, [float(v) for v in values.values()], [plain[x].name for x in q + u], elapsed


def by_casadi():
    """Accelerations of steer, the rear frame about its first axis and the rear wheel: code with its parameters."""
    p = {name: ca.SX.sym(name) for name in VALUES}
    names = ["steer", "Gamma1", "Gamma2", "Gamma3", "steer_dot", "Omega1", "sR"]
    state = [ca.SX.sym(name) for name in names]
    steer, gamma = state[0], ca.vertcat(*state[1:4])
    start = time.time()
    sin, cos = ca.sin(p["lambda"]), ca.cos(p["lambda"])
    zero = ca.SX(0)
    axes = ca.vertcat(ca.horzcat(cos, 0, -sin), ca.horzcat(0, 1, 0), ca.horzcat(sin, 0, cos))
    reach = (p["w"] + p["c"]) * cos - p["rR"] * sin
    neck = ca.vertcat(reach, 0, 0)
    to_b = axes @ ca.vertcat(p["xB"], 0, p["zB"] + p["rR"])
    to_h = axes @ ca.vertcat(p["xH"], 0, p["zH"] + p["rR"]) - neck
    to_f = axes @ ca.vertcat(p["w"], 0, p["rR"] - p["rF"]) - neck

    def inertia(body):
        xx, yy, zz, xz = (p[f"I{body}{k}"] for k in ("xx", "yy", "zz", "xz"))
        return axes @ ca.vertcat(ca.horzcat(xx, 0, xz), ca.horzcat(0, yy, 0), ca.horzcat(xz, 0, zz)) @ axes.T

    def down(of, radius):
        return radius / ca.sqrt(of[0] ** 2 + of[2] ** 2) * ca.vertcat(of[0], 0, of[2])

    turn = ca.vertcat(
        ca.horzcat(ca.cos(steer), ca.sin(steer), 0), ca.horzcat(-ca.sin(steer), ca.cos(steer), 0), ca.horzcat(0, 0, 1)
    )
    gamma_f = turn @ gamma
    down_r, down_f = down(gamma, p["rR"]), down(gamma_f, p["rF"])
    # Velocities by the three rates and two that the front wheel determines, which are then solved for.
    rates, others = ca.vertcat(*state[4:]), ca.SX.sym("others", 3)
    steer_dot, s_r = rates[0], rates[2]

    def kinematics(rates, others):
        omega = ca.vertcat(rates[1], others[0], others[1])
        spin_r = omega + ca.vertcat(0, rates[2], 0)
        v = ca.cross(down_r, spin_r)
        omega_f = turn @ omega + ca.vertcat(0, 0, rates[0])
        v_n = turn @ (v + ca.cross(omega, neck))
        v_f = v_n + ca.cross(omega_f, to_f)
        spin_f = omega_f + ca.vertcat(0, others[2], 0)
        return omega, v, omega_f, v_n, v_f, spin_r, spin_f

    *_, v_f, _, spin_f = kinematics(rates, others)
    contact = v_f + ca.cross(spin_f, down_f)
    # Along the axle, along the vertical (which no rate of the front wheel changes), and along the ground.
    rows = ca.vertcat(contact[1], ca.dot(contact, gamma_f), down_f[0] * contact[2] - down_f[2] * contact[0])
    at = ca.jacobian(rows, others)
    rest = ca.substitute(rows, others, ca.SX.zeros(3))
    det = at[0, 0] * at[1, 1] - at[0, 1] * at[1, 0]
    first = -(at[1, 1] * rest[0] - at[0, 1] * rest[1]) / det
    second = -(at[0, 0] * rest[1] - at[1, 0] * rest[0]) / det
    third = -(rest[2] + at[2, 0] * first + at[2, 1] * second) / at[2, 2]
    omega, v, omega_f, v_n, v_f, spin_r, spin_f = kinematics(rates, ca.vertcat(first, second, third))
    v_b, v_h = v + ca.cross(omega, to_b), v_n + ca.cross(omega_f, to_h)
    gamma_dot = ca.cross(gamma, omega)
    positions, moving = ca.vertcat(steer, gamma), ca.vertcat(steer_dot, gamma_dot)
    matrix, force = ca.SX.zeros(3, 3), ca.SX.zeros(3)
    for mass, velocity, turning, vertical in [
        (p["mR"], v, omega, gamma), (p["mB"], v_b, omega, gamma),
        (p["mH"], v_h, omega_f, gamma_f), (p["mF"], v_f, omega_f, gamma_f),
    ]:
        along = ca.jacobian(velocity, rates)
        acceleration = ca.jtimes(velocity, positions, moving) + ca.cross(turning, velocity)
        matrix += mass * along.T @ along
        force += mass * along.T @ (p["g"] * vertical - acceleration)
    for moments, turning, frame in [
        (ca.diag(ca.vertcat(p["IRxx"], p["IRyy"], p["IRxx"])), spin_r, omega), (inertia("B"), omega, omega),
        (inertia("H"), omega_f, omega_f),
        (ca.diag(ca.vertcat(p["IFxx"], p["IFyy"], p["IFxx"])), spin_f, omega_f),
    ]:
        along = ca.jacobian(turning, rates)
        momentum = moments @ turning
        matrix += along.T @ moments @ along
        force -= along.T @ (moments @ ca.jtimes(turning, positions, moving) + ca.cross(frame, momentum))
    a = matrix
    l1, l2 = a[1, 0] / a[0, 0], a[2, 0] / a[0, 0]
    d2 = a[1, 1] - l1 * a[1, 0]
    m = a[2, 1] - l1 * a[2, 0]
    l3 = m / d2
    d3 = a[2, 2] - l2 * a[2, 0] - l3 * m
    y1 = force[0]
    y2 = force[1] - l1 * y1
    x3 = (force[2] - l2 * y1 - l3 * y2) / d3
    x2 = y2 / d2 - l3 * x3
    x1 = y1 / a[0, 0] - l1 * x2 - l2 * x3
    out = ca.cse(ca.vertcat(steer_dot, gamma_dot, x1, x2, x3))
    function = ca.Function("f", [ca.vertcat(*p.values()), ca.vertcat(*state)], [out])
    elapsed = time.time() - start
    front = ca.Function("front", [ca.vertcat(*p.values()), ca.vertcat(*state)], [ca.vertcat(first, third)])
    return of_casadi("casadi", function), list(p), list(VALUES.values()), names, elapsed, front


def in_frame():
    """The state of table 1 in the rear frame, and the rates that belong to it."""
    (lean, lean_rate, _), (pitch, pitch_rate, _) = LEAN, PITCH
    down = [-math.sin(pitch) * math.cos(lean), math.sin(lean), math.cos(pitch) * math.cos(lean)]
    omega1 = lean_rate * math.cos(pitch) + YAW_RATE * down[0]
    omega3 = lean_rate * math.sin(pitch) + YAW_RATE * down[2]
    c, s = math.cos(LAMBDA), math.sin(LAMBDA)
    gamma = [c * down[0] - s * down[2], down[1], s * down[0] + c * down[2]]
    return [STEER[0], *gamma, STEER[1], c * omega1 - s * omega3, REAR[0]]


TIMING = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
%s
enum { N = 64, CALLS = 2000, ROUNDS = 40 };
static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * t.tv_sec + t.tv_nsec;
}
typedef void (*kernel)(const double *, double *);
static double timed(kernel f, double (*y)[10]) {
  double dy[N][48];
  double start = now();
  for (int k = 0; k < CALLS; ++k) f(y[k %% N], dy[k %% N]);
  volatile double sink = dy[3][1];
  (void)sink;
  return (now() - start) / CALLS;
}
int main(void) {
  static double y[%d][N][10];
  const char *names[] = {%s};
  kernel kernels[] = {%s};
  double best[%d];
%s
  for (int k = 0; k < %d; ++k) {
    double dy[48] = {0};
    kernels[k](y[k][0], dy);
    for (int i = 0; i < 8; ++i) printf("%%.15g ", dy[i]);
    printf("\\n");
    best[k] = 1e300;
  }
  for (int r = 0; r < ROUNDS; ++r)
    for (int k = 0; k < %d; ++k) {
      double t = timed(kernels[k], y[k]);
      if (t < best[k]) best[k] = t;
    }
  for (int k = 0; k < %d; ++k) printf("%%s %%.1f\\n", names[k], best[k]);
  return 0;
}
"""

# Elimination with pivots of the 6x6 system, after SymPy's entries.
SOLVED = """
__attribute__((noinline)) static void sympy_rates(const double *y, double *dy) {
  double e[42];
  sympy(y, e);
  double a[6][7];
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) a[i][j] = e[6 * i + j];
    a[i][6] = e[36 + i];
  }
  for (int k = 0; k < 6; ++k) {
    int p = k;
    for (int i = k + 1; i < 6; ++i) if (fabs(a[i][k]) > fabs(a[p][k])) p = i;
    for (int j = k; j < 7; ++j) { double t = a[k][j]; a[k][j] = a[p][j]; a[p][j] = t; }
    double inverse = 1.0 / a[k][k];
    for (int i = k + 1; i < 6; ++i) {
      double l = a[i][k] * inverse;
      for (int j = k + 1; j < 7; ++j) a[i][j] -= l * a[k][j];
    }
    a[k][k] = inverse;
  }
  for (int i = 5; i >= 0; --i) {
    double x = a[i][6];
    for (int j = i + 1; j < 6; ++j) x -= a[i][j] * dy[j];
    dy[i] = x * a[i][i];
  }
}
"""
# What `hamel generate --language c` writes, called like the others.
OWN = """
static whipple_bicycle_moving_prepared hamel_prepared;
static void hamel_prepare(const double *p) {
  (void)p;
  whipple_bicycle_moving_params defaults = whipple_bicycle_moving_params_default();
  whipple_bicycle_moving_prepare(&defaults, &hamel_prepared);
}
__attribute__((noinline)) static void hamel_rates(const double *y, double *dy) {
  whipple_bicycle_moving_rhs(&hamel_prepared, 0.0, y, dy);
}
"""
# What `hamel generate` writes, on numbers of one and of several lanes: accelerations, then times of a state.
RUST = """
#[path = "%s"]
#[allow(warnings)]
mod bicycle;
use bicycle::{INFO, Prepared};
use hamel_runtime::{F64x4, F64x8, Real, Scene};
use std::{hint::black_box, time::Instant};

const STATE: [f64; 7] = %s;
const STATES: usize = 64;

#[inline(never)]
fn rates<R: Real, S: Scene<R, State = [R; 7]>>(scene: &S, y: &[R; 7], dy: &mut [R; 7]) {
    scene.rhs(R::ZERO, y, dy);
}

/// The acceleration of the steer, and the least time of a state in nanoseconds.
fn timed<R: Real, S: Scene<R, State = [R; 7]>>(lanes: usize) -> (R, f64) {
    let params: Vec<R> = INFO.params.iter().map(|p| R::from_f64(black_box(p.default))).collect();
    let scene = S::prepare(&params).unwrap();
    let y = vec![STATE.map(R::from_f64); STATES / lanes];
    let mut dy = vec![[R::ZERO; 7]; y.len()];
    let mut best = f64::INFINITY;
    for _ in 0..40 {
        let clock = Instant::now();
        for _ in 0..32 {
            for (y, dy) in y.iter().zip(&mut dy) {
                rates(&scene, y, dy);
            }
            black_box(&mut dy);
        }
        best = best.min(clock.elapsed().as_secs_f64() * 1e9 / (32 * STATES) as f64);
    }
    (dy[0][1], best)
}

fn main() {
    let one = timed::<f64, Prepared<f64>>(1);
    let four = timed::<F64x4, Prepared<F64x4>>(F64x4::LANES);
    let eight = timed::<F64x8, Prepared<F64x8>>(F64x8::LANES);
    println!("{:.15} {:.15} {:.15}", one.0, four.0.to_array()[3], eight.0.to_array()[7]);
    println!("{:.1} {:.1} {:.1}", one.1, four.1, eight.1);
}
"""
MANIFEST = """
[package]
name = "bicycle"
version = "0.0.0"
edition = "2024"
[dependencies]
hamel-runtime = { path = "%s", features = ["lanes"] }
[workspace]
"""
# Operations of these loops.
N_SOLVED = 6 + sum((5 - k) * (1 + 2 * (6 - k)) for k in range(6)) + sum(2 * (5 - i) + 1 for i in range(6))


def in_rust(module, state):
    """Times of a state [ns] in 1, 4 and 8 lanes, and that of compiling the module with the program around it [s]."""
    runtime = pathlib.Path(__file__).resolve().parents[2] / "runtime"
    with tempfile.TemporaryDirectory() as made:
        made = pathlib.Path(made)
        (made / "Cargo.toml").write_text(MANIFEST % runtime)
        (made / "src").mkdir()
        source = made / "src/main.rs"
        source.write_text("fn main() {}")
        environment = {**os.environ, "RUSTFLAGS": "-C target-cpu=native", "CARGO_TARGET_DIR": str(made / "target")}
        build = ["cargo", "build", "--release", "--quiet"]
        subprocess.run(build, cwd=made, env=environment, check=True)
        source.write_text(RUST % (module.resolve(), list(map(float, state))))
        start = time.time()
        subprocess.run(build, cwd=made, env=environment, check=True)
        elapsed = time.time() - start
        ran = subprocess.run([str(made / "target/release/bicycle")], check=True, capture_output=True, text=True)
    found, times = ([float(x) for x in line.split()] for line in ran.stdout.splitlines())
    assert all(abs(value - STEER[2]) < 1e-11 for value in found), found
    return times, elapsed


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None
    sympy_code, sympy_params, sympy_values, sympy_state, sympy_time = by_sympy()
    casadi_code, casadi_params, casadi_values, casadi_state, casadi_time, solved = by_casadi()
    n_sympy = sympy_code.count(sympy_state)
    solve = f"{N_SOLVED} more for the 6x6 system"
    print(f"sympy {sp.__version__}: {n_sympy} operations after cse, {solve}, {sympy_time:.1f} s")
    print(f"casadi {ca.__version__}: {casadi_code.count(casadi_state)} operations, {casadi_time:.1f} s")
    state = in_frame()
    # SymPy's axes point forwards, to the left and upwards; the steer axis points downwards in both.
    omega2, front_rate = (float(x) for x in ca.vertsplit(solved(casadi_values, state)))
    at_sympy = [0.0, LEAN[0], -PITCH[0], STEER[0], LEAN[1], -REAR[0], STEER[1], -YAW_RATE, -PITCH[1], -front_rate]
    kernels = [("sympy", "sympy_rates", at_sympy), ("casadi", "casadi", state)]
    text = sympy_code.c(sympy_params, sympy_state) + SOLVED + casadi_code.c(casadi_params, casadi_state)
    prepared = [("sympy", sympy_values), ("casadi", casadi_values)]
    if folder:
        steer, g1, g2, g3, steer_dot, omega1, s_r = state
        kernels.append(("hamel", "hamel_rates", [steer, steer_dot, omega1, s_r + omega2, g1, g2, g3]))
        prepared.append(("hamel", [0.0]))
        text += f'\n#include "{(folder / "whipple_bicycle_moving.c").resolve()}"\n' + OWN
    setup = []
    for name, values in prepared:
        setup.append(f"  {{ const double p[] = {{{', '.join(map(repr, values))}}}; {name}_prepare(p); }}")
    for k, (_, _, at) in enumerate(kernels):
        setup.append(f"  {{ const double at[] = {{{', '.join(map(repr, at))}}};")
        setup.append(f"    for (int i = 0; i < N; ++i) memcpy(y[{k}][i], at, sizeof at); }}")
    n = len(kernels)
    main_text = TIMING % (
        text, n, ", ".join(f'"{name}"' for name, _, _ in kernels), ", ".join(f for _, f, _ in kernels), n,
        "\n".join(setup), n, n, n,
    )
    with tempfile.TemporaryDirectory() as made:
        source = pathlib.Path(made) / "bicycle.c"
        source.write_text(main_text)
        binary = pathlib.Path(made) / "bicycle"
        subprocess.run([os.environ.get("CC", "gcc"), *FLAGS, str(source), "-o", str(binary), "-lm"], check=True)
        lines = subprocess.run([str(binary)], check=True, capture_output=True, text=True).stdout.splitlines()
    rows = [[float(x) for x in line.split()] for line in lines[:n]]
    # Accelerations of steer and of the rear wheel against the frame.
    found = {"sympy": (rows[0][2], -rows[0][1]), "casadi": (rows[1][4], rows[1][6])}
    for name, values in found.items():
        for value, expected in zip(values, (STEER[2], REAR[1])):
            assert abs(value - expected) < 1e-11, (name, values)
    if folder:
        assert abs(rows[2][1] - STEER[2]) < 1e-11, rows[2]
    for line in lines[n:]:
        name, ns = line.split()
        print(f"{name}: {ns} ns")
    module = folder and folder / "whipple_bicycle_moving.rs"
    if module and module.exists() and shutil.which("cargo"):
        times, elapsed = in_rust(module, kernels[2][2])
        print("hamel in Rust: {:.1f} ns, a state of 4 lanes {:.1f} ns, of 8 {:.1f} ns".format(*times))
        print(f"compiled by rustc for these three in {elapsed:.1f} s")


if __name__ == "__main__":
    main()
