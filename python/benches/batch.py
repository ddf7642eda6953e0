"""Rates of many states from Python against the same loop in Rust, in one process, interleaved; minima of all rounds.

    python python/benches/batch.py [model] [states]

Prints nanoseconds for each state: Python with and without a new array for the result, the same loop over the same arrays
in Rust, and Rust over states that are in lanes already.
"""

import sys
import time

import numpy as np

import pyhamel

ROUNDS = 200


def main() -> None:
    model = pyhamel.load(sys.argv[1] if len(sys.argv) > 1 else "heavy_top")
    n = int(sys.argv[2]) if len(sys.argv) > 2 else 10_000
    rows = np.random.default_rng(0).normal(size=(n, len(model.state)))
    for order, y in (("rows", rows), ("columns", np.asfortranarray(rows))):
        out = np.empty_like(y)
        calls = {
            "python, out=": lambda y=y, out=out: model.rhs(y, out=out, threads=False),
            "python": lambda y=y: model.rhs(y, threads=False),
            "python, threads": lambda y=y, out=out: model.rhs(y, out=out),
        }
        best = dict.fromkeys([*calls, "rust", "rust, lanes"], float("inf"))
        for _ in range(ROUNDS):
            for name, call in calls.items():
                # Fills the caches.
                call()
                clock = time.perf_counter()
                call()
                best[name] = min(best[name], time.perf_counter() - clock)
            for name, seconds in zip(("rust", "rust, lanes"), model._native.measured(y, out, 1)):
                best[name] = min(best[name], seconds)
        for name, seconds in best.items():
            print(f"{model.name} {n} {order:8} {name:16} {1e9 * seconds / n:8.2f} ns, {best['rust'] / seconds:5.1%} of Rust")


if __name__ == "__main__":
    main()
