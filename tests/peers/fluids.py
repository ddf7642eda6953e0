"""The isospectral midpoint rule in Python on the flows of `cargo xtask bench fluids --peers`, which starts this script.

    python3 tests/peers/fluids.py <folder> <n>..

Reads the flows `<folder>/<n>.txt` that the measuring program wrote. Measured are quflow, where it is installed, and the
method of quflow's `isomp_fixedpoint` with numpy (products by its BLAS) and numba (tridiagonal solutions along diagonals,
commutators), written anew: skew-Hermitian matrices, the increment of the step before as start, tolerance
`sqrt(eps) dt/hbar |W|`, at most ten iterations. One thread each. Prints lines

    work <n> <what>     n pieces of work begin, each of which ends with a line `round`
    using <text>        a package with its version
    note <text>         what is not measured, and why
    sphere;<n>;<by>;<ns>;<iterations>;<error>;<drift>    what was measured, as the measuring program says it
"""

import os

# Before numpy is loaded.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[name] = "1"

import math
import sys
import time

import numpy as np

STEPS_OF_ERROR = 16
# Seconds of a round, and how many there are: the fastest counts.
ROUND = 0.02
ROUNDS = 40
MOST = 5


class Flow:
    """A flow of the measuring program; matrices are -i times its own, so that `S' = [R, S]/hbar`."""

    def __init__(self, path):
        with open(path) as file:
            n, h, rate, steps = file.readline().split()
            numbers = np.loadtxt(file)
        self.n, self.h, self.steps_of_drift = int(n), float(h), int(steps)
        self.hbar = 1.0 / abs(float(rate))
        matrices = (numbers[:, 0] + 1j * numbers[:, 1]).reshape(2, self.n, self.n)
        self.start, self.end = -1j * matrices


def casimirs(skew):
    """Traces of powers of the Hermitian matrix."""
    w, power, traces = 1j * skew, np.eye(len(skew)), []
    for _ in range(MOST):
        power = power @ w
        traces.append(np.trace(power).real / len(w))
    return traces


def measure(flow, by, advance):
    """`advance(matrix, steps)` moves a matrix in place and returns the number of iterations, or none."""
    state = flow.start.copy()
    advance(state, STEPS_OF_ERROR)
    error = np.linalg.norm(state - flow.end) / np.linalg.norm(flow.end)
    state = flow.start.copy()
    advance(state, flow.steps_of_drift)
    before, after = casimirs(flow.start), casimirs(state)
    drift = max(abs(after[k] - before[k]) / before[1] ** (0.5 * (k + 1)) for k in range(1, MOST))

    state, steps = flow.start.copy(), 4
    fastest, iterations = math.inf, math.nan
    for _ in range(ROUNDS):
        clock = time.perf_counter()
        done = advance(state, steps)
        seconds = time.perf_counter() - clock
        fastest = min(fastest, seconds / steps)
        if done is not None:
            iterations = done / steps
        steps = max(4, min(1000, round(ROUND / fastest)))
    print(f"sphere;{flow.n};{by};{1e9 * fastest};{iterations};{error:e};{drift:e}\nround", flush=True)


def with_numpy():
    """The fixed-point iteration, written anew."""
    import numba

    @numba.njit(error_model="numpy", fastmath=True)
    def commutator(a, out):
        n = len(a)
        for i in range(n):
            out[i, i] = a[i, i] - np.conj(a[i, i])
            for j in range(i):
                out[i, j] = a[i, j] - np.conj(a[j, i])
                out[j, i] = -np.conj(out[i, j])

    @numba.njit(error_model="numpy", fastmath=True)
    def factors(n):
        """Pivots and factors of the tridiagonal matrices, that of the diagonal d in row d."""
        pivots, below = np.ones((n, n)), np.zeros((n, n))
        for d in range(n):
            for i in range(n - d):
                m = (0.5 * (n - 1) - i) * (0.5 * (n - 1) - i - d)
                pivots[d, i] = 0.5 * (n * n - 1) - 2.0 * m
                if i > 0:
                    beside = -math.sqrt(i * (n - i) * (i + d) * (n - i - d))
                    below[d, i] = beside / pivots[d, i - 1]
                    pivots[d, i] -= beside * below[d, i]
        return pivots, below

    @numba.njit(error_model="numpy", fastmath=True)
    def stream(w, pivots, below, scale, out, line):
        n = len(w)
        # Of the vorticity at the middle of a step, the part along the identity is not zero.
        trace = 0.0j
        for i in range(n):
            trace += w[i, i]
        for d in range(n):
            length = n - d
            mean = trace / n if d == 0 else 0.0j
            line[0] = w[0, d] - mean
            for i in range(1, length):
                line[i] = w[i, i + d] - mean - below[d, i] * line[i - 1]
            last = length - 1
            if d == 0:
                line[last] = 0.0
            else:
                line[last] /= pivots[d, last]
            for i in range(last - 1, -1, -1):
                line[i] = line[i] / pivots[d, i] - below[d, i + 1] * line[i + 1]
            if d == 0:
                mean = 0.0j
                for i in range(n):
                    mean += line[i]
                for i in range(n):
                    line[i] -= mean / n
            for i in range(length):
                out[i, i + d] = scale * line[i]
                out[i + d, i] = -np.conj(out[i, i + d])

    def of(flow):
        n = flow.n
        half = flow.h / (2.0 * flow.hbar)
        pivots, below = factors(n)
        d, old, middle, product, p = (np.zeros((n, n), complex) for _ in range(5))
        line = np.zeros(n, complex)

        def advance(w, steps):
            tolerance = math.sqrt(np.finfo(float).eps) * 2.0 * half * np.linalg.norm(w, np.inf)
            iterations = 0
            d.fill(0.0)
            for _ in range(steps):
                change = math.inf
                for _ in range(10):
                    iterations += 1
                    np.add(w, d, out=middle)
                    np.copyto(old, d)
                    stream(middle, pivots, below, half, p, line)
                    np.matmul(p, middle, out=product)
                    np.matmul(product, p, out=d)
                    commutator(product, product)
                    np.add(d, product, out=d)
                    np.subtract(old, d, out=old)
                    before, change = change, np.linalg.norm(old, np.inf)
                    if change <= tolerance or change >= before:
                        break
                product[...] *= 2.0
                np.add(w, product, out=w)
            return iterations

        return advance

    print(f"using numpy {np.__version__}, numba {numba.__version__}")
    return "numpy, the method of quflow's isomp_fixedpoint", of


def with_quflow():
    """quflow itself, whose Laplacian is negative: its matrices are i times those of the measuring program."""
    import quflow
    from quflow.integrators.isospectral import isomp_fixedpoint

    def of(flow):
        def advance(w, steps):
            stats = {"iterations": 0.0}
            np.negative(w, out=w)
            isomp_fixedpoint(w, flow.h, steps=steps, stats=stats)
            np.negative(w, out=w)
            return stats["iterations"] * steps if stats["iterations"] else None

        return advance

    print(f"using quflow {quflow.__version__}")
    return f"quflow {quflow.__version__}", of


def main():
    folder, *sizes = sys.argv[1:]
    flows = [Flow(os.path.join(folder, f"{n}.txt")) for n in sizes]
    for opponent in (with_numpy, with_quflow):
        try:
            by, of = opponent()
        except ImportError as error:
            print(f"note {opponent.__name__[5:]} is not measured: {error}")
            continue
        print(f"work {len(flows)} {by}", flush=True)
        for flow in flows:
            advance = of(flow)
            # Compiles what numba compiles.
            advance(flow.start.copy(), 1)
            measure(flow, by, advance)


main()
