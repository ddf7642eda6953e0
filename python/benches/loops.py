"""Ensembles, steps and motions of the heavy top from Python, and heyoka's batches where it is installed.

    python python/benches/loops.py

Prints microseconds of the processor, of one thread, for each trajectory, step or call: minima of rounds in which all take
turns. Trajectories differ in the mass and the first angular velocity; states of all ends are kept.
"""

import time

import numpy as np

import pyhamel

ROUNDS = 5
N = 40_000
START = np.array([0.4, -0.3, 2.0, 0.0, 0.6, 0.8])


def heyoka_batches(mass, omega):
    """Trajectories in batches of eight, with the tolerance 1e-10; none without the package."""
    try:
        import heyoka
    except ImportError:
        return None
    o, g = heyoka.make_vars("O1", "O2", "O3"), heyoka.make_vars("G1", "G2", "G3")
    inertia, chi, weight = (1.3, 1.7, 0.6), (0.0, 0.6, 0.8), heyoka.par[0] * 9.81 * 0.35

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    spun, pulled, moved = cross([inertia[k] * o[k] for k in range(3)], o), cross(g, chi), cross(g, o)
    rates = [(o[k], (spun[k] + weight * pulled[k]) / inertia[k]) for k in range(3)]
    rates += [(g[k], moved[k]) for k in range(3)]
    n = 8
    batch = heyoka.taylor_adaptive_batch(rates, np.zeros((6, n)), tol=1e-10, pars=np.ones((1, n)))
    start = np.tile(START[:, None], (1, n))

    def run(t):
        ends, found = np.full(n, t), np.empty((len(mass), 6))
        for k in range(0, len(mass), n):
            batch.set_time(0.0)
            batch.state[:] = start
            batch.state[0] = omega[k : k + n]
            batch.pars[0] = mass[k : k + n]
            batch.propagate_until(ends)
            found[k : k + n] = batch.state.T
        return found

    return run


def main() -> None:
    top = pyhamel.load("heavy_top")
    random = np.random.default_rng(1)
    mass, omega = 1.1 * (1 + 0.05 * random.normal(size=N)), random.uniform(-0.1, 0.1, size=N)
    batches = heyoka_batches(mass, omega)
    calls: dict[str, tuple[int, object]] = {}
    for t in (0.01, 1.0, 5.0):
        for method in ("dop853", "auto"):
            run = lambda t=t, method=method: top.ensemble(
                t, {"Omega1": omega}, {"m": mass}, method=method, threads=1
            )
            calls[f"ensemble, {method}, t = {t}"] = (N, run)
        if batches is not None:
            calls[f"heyoka, t = {t}"] = (N, lambda t=t: batches(t))
    for method in ("dop853", "rk4"):
        stepper = top.stepper(0.01, method=method)
        for n in (1, 64, 10_000):
            y = np.tile(START, (n, 1)) if n > 1 else START.copy()
            repeats = max(1, 2000 // n)

            def steps(stepper=stepper, y=y, repeats=repeats):
                for _ in range(repeats):
                    stepper.step(y, out=y, threads=False)

            calls[f"step of {n}, {method}"] = (n * repeats, steps)
    for name, call in (
        ("simulate, t = 1, ends", lambda: top.simulate(1.0, START, samples=2)),
        ("simulate, t = 1, 201 samples", lambda: top.simulate(1.0, START)),
    ):
        calls[name] = (200, lambda call=call: [call() for _ in range(200)])
    best = dict.fromkeys(calls, float("inf"))
    for _ in range(ROUNDS):
        for name, (n, call) in calls.items():
            clock = time.process_time()
            call()
            best[name] = min(best[name], (time.process_time() - clock) / n)
    for name, seconds in best.items():
        print(f"{name:32} {1e6 * seconds:8.3f} us")


if __name__ == "__main__":
    main()
