"""Motions of many steps by heyoka for `cargo xtask bench drift --peers`, which starts this script.

    python3 tests/peers/drift.py <steps> <runs> <model>..

The steps are those that heyoka chooses at its default tolerance, the rounding of numbers. Every model that `equations` has
is moved `runs` times, from points of its first trajectory; others are passed over. Right-hand sides are checked against
the reference points first. Prints lines

    work <n> <what>     n pieces of work begin, each of which ends with a line `round`
    using <text>        the package with its version
    <model>;<steps>;<t>;<ns>;<name>=<value>,..      a state of a run, its first one after no steps
"""

import sys
import time

from equations import MODELS, Trajectory

FIRST = 1000


def say(line):
    print(line, flush=True)


def main():
    steps, runs = int(sys.argv[1]), int(sys.argv[2])
    problems = [Trajectory(name) for name in sys.argv[3:] if name in MODELS]
    try:
        import heyoka
    except ImportError:
        raise SystemExit("heyoka is not installed")
    say(f"using heyoka {heyoka.__version__}")
    say(f"work {len(problems)} many steps of")
    for problem in problems:
        state = [heyoka.expression(n) for n in problem.state]
        rates = problem.rates(heyoka, [heyoka.par[i] for i in range(len(problem.params))], state)
        rates = [rate if isinstance(rate, heyoka.expression) else heyoka.expression(float(rate)) for rate in rates]
        function = heyoka.cfunc(rates, state)
        problem.check(lambda params, y: function(y, pars=params))
        solver = heyoka.taylor_adaptive(list(zip(state, rates)), problem.start, pars=problem.values)

        def tell(done, ns):
            values = ",".join(f"{n}={x!r}" for n, x in zip(problem.state, map(float, solver.state)))
            say(f"{problem.model};{done};{solver.time!r};{ns};{values}")

        for run in range(runs):
            solver.time = 0.0
            solver.state[:] = problem.start
            solver.propagate_until(problem.t_end * run / runs)
            solver.time = 0.0
            tell(0, 0)
            step, then, clock = solver.step, FIRST, time.perf_counter_ns()
            for done in range(1, steps + 1):
                step()
                if done == then:
                    tell(done, time.perf_counter_ns() - clock)
                    then *= 10
        say("round")


main()
