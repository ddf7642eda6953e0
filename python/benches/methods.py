"""Time of methods on all shipped models beside the method that `auto` takes, to its error.

    python python/benches/methods.py

Motions from the models' own starts to t = 10 and t = 100, with both ends or 101 samples, at tolerances from 1e-5 to 1e-13.
For each tolerance and method: the least time of any tolerance with an error at the end of at most 1.2 times that of the
method of `auto`, in units of its time; geometric mean over the models, in brackets the tenth and the ninetieth per
cent. Errors are known where two methods at 2e-14 differ by less than a third of them; other motions are left out. Times
are those of a thread, the least of two calls and more, without deriving or compiling anything.
"""

import math
import time

import numpy as np

import pyhamel

METHODS = ("dop853", "vern9", "gbs14", "taylor")
TOLERANCES = tuple(10.0**-e for e in range(5, 14))
TOLD = (1e-6, 1e-8, 1e-10, 1e-12)
MAX_STEPS = 500_000


def seconds(call) -> float:
    """The least time of calls, until they have taken ten milliseconds."""
    least, spent, n = math.inf, 0.0, 0
    while n < 2 or (spent < 0.01 and n < 200):
        clock = time.thread_time()
        call()
        took = time.thread_time() - clock
        least, spent, n = min(least, took), spent + took, n + 1
        if took > 0.5:
            break
    return least


def reference(model, y0, t: float):
    """The last state, and how far it is known; none where it is not reached."""
    at = {"samples": 2, "rtol": 2e-14, "atol": 2e-14, "max_steps": MAX_STEPS}
    try:
        ends = [model.simulate(t, y0, method=method, **at).y_end for method in ("vern9", "gbs14")]
    except pyhamel.Error:
        return None
    return ends[0], float(np.max(np.abs(ends[1] - ends[0]) / (1 + np.abs(ends[0]))))


def measured(model, y0, t: float, samples: int, exact):
    """Error and seconds by method and tolerance, and the method of `auto` by tolerance."""
    found, taken = {}, {}
    for rtol in TOLERANCES:
        at = {"samples": samples, "rtol": rtol, "atol": 0.01 * rtol, "max_steps": MAX_STEPS}
        for method in METHODS:
            try:
                end = model.simulate(t, y0, method=method, **at).y_end
                error = float(np.max(np.abs(end - exact) / (1 + np.abs(exact))))
                found[method, rtol] = error, seconds(lambda: model.simulate(t, y0, method=method, **at))
            except pyhamel.Error:
                continue
        taken[rtol] = model.simulate(t, y0, method="auto", **at).stats["method"]
    return found, taken


def main() -> None:
    for t, samples in ((10.0, 2), (10.0, 101), (100.0, 101)):
        ratios: dict[tuple[float, str], list[float]] = {}
        for name in pyhamel.models():
            try:
                model = pyhamel.load(name)
                y0 = model.simulate(t, samples=2, max_steps=MAX_STEPS).y0
            except (pyhamel.Error, AttributeError):
                continue
            known = reference(model, y0, t)
            if known is None:
                continue
            found, taken = measured(model, y0, t, samples, known[0])
            for rtol in TOLD:
                own = found.get((taken[rtol], rtol))
                if own is None or known[1] > own[0] / 3:
                    continue
                for method in METHODS:
                    times = [s for (m, _), (error, s) in found.items() if m == method and error <= 1.2 * own[0]]
                    if times:
                        ratios.setdefault((rtol, method), []).append(min(times) / own[1])
        print(f"t = {t:g}, {samples} samples")
        for rtol in TOLD:
            told = []
            for method in METHODS:
                of = sorted(ratios.get((rtol, method), []))
                if of:
                    mean = math.exp(sum(map(math.log, of)) / len(of))
                    low, high = of[len(of) // 10], of[-1 - len(of) // 10]
                    told.append(f"{method} {mean:.2f} [{low:.2f}, {high:.2f}] of {len(of)}")
            print(f"  {rtol:.0e}: " + "; ".join(told))


if __name__ == "__main__":
    main()
