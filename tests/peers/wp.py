"""Integrators in Python on the problems of `cargo xtask bench wp --peers`, which starts this script.

    python3 tests/peers/wp.py <model>..

Integrates the trajectories of every model that `equations` has; others are passed over. Right-hand sides are checked
against the reference points before anything is timed. Prints lines

    work <n> <what>     n pieces of work begin, each of which ends with a line `round`
    using <text>        a package with its version
    note <text>         what is not measured, and why
    <model>;<trajectory>;<by>;<method>;<tolerance>;<error>;<evaluations>;<steps>;<ns>    a solution
"""

import math
import sys
import time
import warnings

from equations import MODELS, Trajectory

TOLERANCES = [f"1e-{k}" for k in range(3, 16)]
ROUNDS = 100
LANES = 8


def fastest(rounds, solution):
    """Nanoseconds of the fastest of some solutions."""
    times = []
    for _ in range(rounds):
        clock = time.perf_counter_ns()
        solution()
        times.append(time.perf_counter_ns() - clock)
    return min(times)


def by_heyoka(problem, tolerance):
    """Taylor series, one trajectory and the same in every lane of a batch; the step is compiled before the clock starts."""
    import heyoka

    n_params = len(problem.params)
    state = [heyoka.expression(n) for n in problem.state]
    rates = problem.rates(heyoka, [heyoka.par[i] for i in range(n_params)], state)
    rates = [rate if isinstance(rate, heyoka.expression) else heyoka.expression(float(rate)) for rate in rates]
    function = heyoka.cfunc(rates, state)
    problem.check(lambda params, y: function(y, pars=params))
    system = list(zip(state, rates))

    solver = heyoka.taylor_adaptive(system, problem.start, pars=problem.values, tol=tolerance)

    def solution():
        solver.time = 0.0
        solver.state[:] = problem.start
        return solver.propagate_until(problem.t_end)[3]

    steps = solution()
    yield "taylor", problem.off(solver.state), steps, steps, fastest(ROUNDS, solution)

    lanes = [[x] * LANES for x in problem.start]
    batch = heyoka.taylor_adaptive_batch(
        system, lanes, pars=[[x] * LANES for x in problem.values], tol=tolerance
    )

    def solutions():
        batch.set_time(0.0)
        batch.state[:] = lanes
        batch.propagate_until(problem.t_end)

    solutions()
    steps = max(lane[3] for lane in batch.propagate_res)
    ns = fastest(ROUNDS, solutions) / LANES
    yield f"taylor in {LANES} lanes", max(map(problem.off, batch.state.T)), steps, steps, ns


def by_scipy(problem, tolerance):
    """DOP853, whose right-hand side numba compiles where it is installed."""
    import numpy
    from scipy.integrate import solve_ivp

    # SciPy replaces tolerances under this one by it.
    if tolerance < 100 * numpy.finfo(float).eps:
        return
    right = compiled(problem)
    if right is None:

        def right(t, y):
            return problem.rates(math, problem.values, y)

    problem.check(lambda params, y: right(0.0, numpy.array(y)))

    def solution():
        return solve_ivp(right, (0.0, problem.t_end), problem.start, "DOP853", rtol=tolerance, atol=tolerance)

    found = solution()
    # Two evaluations choose the first step, each further step has twelve.
    ns = fastest(ROUNDS // 10, solution)
    yield "dop853", problem.off(found.y[:, -1]), found.nfev, (found.nfev - 2) // 12, ns


def compiled(problem):
    """The right-hand side as numba compiles it from what sympy shares and prints; none where either is missing."""
    key = problem.model, problem.k
    if key not in COMPILED:
        COMPILED[key] = None
        try:
            import numba
            import numpy
            import sympy
        except ImportError:
            return None
        state = [sympy.Symbol(n, real=True) for n in problem.state]
        rates = problem.rates(sympy, problem.values, state)
        rhs = numba.njit(sympy.lambdify(state, rates, "math", cse=True))
        scope = {"rhs": rhs, "array": numpy.array}
        arguments = ", ".join(f"y[{i}]" for i in range(len(state)))
        # The zero makes floats of rates that are whole numbers.
        exec(f"def right(t, y):\n    return array(rhs({arguments})) + 0.0", scope)
        COMPILED[key] = numba.njit(scope["right"])
    return COMPILED[key]


COMPILED = {}
INTEGRATORS = {"heyoka": by_heyoka, "scipy": by_scipy}


def version(name):
    """The package with its version, or nothing."""
    try:
        return f"{name} {__import__(name).__version__}"
    except ImportError:
        return None


def say(line):
    print(line, flush=True)


def main():
    warnings.simplefilter("ignore")
    first = [Trajectory(name) for name in sys.argv[1:] if name in MODELS]
    problems = [Trajectory(p.model, k + 1) for p in first for k in range(len(p.trajectories))]
    names = {package: version(package) for package in INTEGRATORS}
    missing = [package for package, name in names.items() if not name]
    if len(missing) == len(INTEGRATORS):
        raise SystemExit(f"neither of {', '.join(missing)} is installed")
    if missing:
        say(f"note integrators of {', '.join(missing)} are not measured, for it is not installed")
    elif not (version("numba") and version("sympy")):
        say("note SciPy calls the right-hand side in Python, for numba or sympy is not installed")
    say(f"work {len(problems) * len(TOLERANCES) * (len(INTEGRATORS) - len(missing))} integrating")
    for problem in problems:
        for package, name in names.items():
            if name is None:
                continue
            if package == "scipy" and compiled(problem):
                name = f"{name} and {version('numba')}"
            rows = []
            for tolerance in TOLERANCES:
                rows += [(tolerance, *row) for row in INTEGRATORS[package](problem, float(tolerance))]
                say("round")
            # One method after the other: the report takes runs of lines for curves.
            for tolerance, method, error, evaluations, steps, ns in sorted(rows, key=lambda row: row[1]):
                say(f"{problem.model};{problem.k};{name};{method};{tolerance};{error:e};{evaluations};{steps};{ns}")


main()
