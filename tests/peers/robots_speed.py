"""Writes `docs/benchmarks/robots.md`: times of robots' functions beside those of Pinocchio, in one run.

    pip install pin==4.1.0 cmeel-eigen==3.4.1 example-robot-data==6.0.0, and the wheel of pyhamel
    python tests/peers/robots_speed.py HAMEL TARGET_CPU [ROBOT ..]

HAMEL is the program, which writes C; the robots and how states of both tools belong together are those of `robots.py`.
Both are compiled by the same compiler with the same flags, Pinocchio from the headers of its wheel, once, and called
through a pointer. Functions of both are held to each other by `robots.py`.
"""

import importlib.metadata
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import pinocchio as pin

from chains import FLAGS, LIMITS
from robots import ROBOTS, Robot, folder

CHOSEN = ["ur5", "z1", "panda", "solo12", "anymal_c"]
N_STATES = 64
FUNCTIONS = {
    "rhs": ("forward dynamics", "`aba`"),
    "inverse_dynamics": ("inverse dynamics", "`rnea`"),
    "mass_matrix": ("mass matrix", "`crba`"),
    "gravity": ("forces at rest", "`computeGeneralizedGravity`"),
    "frame_jacobians": ("Jacobian of a frame", "`computeFrameJacobian`"),
    "jacobian": ("derivatives of forward dynamics", "`computeABADerivatives`"),
}
PAGE = pathlib.Path(__file__).parents[2] / "docs/benchmarks/robots.md"


def states(robot, file):
    """States of both tools, as `robots_speed.cpp` reads them."""
    rng = np.random.default_rng(11)
    n_own = len(robot.model.velocities)
    with open(file, "w", encoding="utf-8") as out:
        print(N_STATES, len(robot.model.state), n_own, robot.pin.nv, file=out)
        for _ in range(N_STATES):
            q, v, y = robot.random(rng)
            own = rng.uniform(-3, 3, n_own)
            for numbers in (q, v, robot.by_own @ own, y, own):
                print(*(repr(float(x)) for x in numbers), file=out)


def library(robot, program, compiler, folder):
    """The functions of hamel's C, one for each of `FUNCTIONS`, with friction and damping zero as for Pinocchio."""
    text = folder / "robot.hamel"
    text.write_text(robot.model.text, encoding="utf-8")
    subprocess.run([program, "generate", text, "--scene", "robot", "--language", "c", "--out-dir", folder, "--quiet"],
                   check=True, stdout=subprocess.DEVNULL)
    header = next(folder.glob("*_robot.h"))
    name, declared = header.stem, header.read_text(encoding="utf-8")
    lines = [f'#include "{name}.c"', f"static {name}_prepared prepared;",
             "__attribute__((constructor)) static void prepare(void) {",
             f"    {name}_params params = {name}_params_default();"]
    passive = [p for p in robot.model.params if p.startswith(("damping_", "friction_")) and p != "friction_speed"]
    lines += [f"    params.{p} = 0;" for p in passive]
    lines += [f"    {name}_prepare(&params, &prepared);", "}"]
    for function in FUNCTIONS:
        own = f"{name}_{function}_nonzeros" if f" {name}_{function}_nonzeros(" in declared else f"{name}_{function}"
        more = "a, " if function == "inverse_dynamics" else ""
        lines += [f"void of_hamel_{function}(const double *y, const double *a, double *out) {{",
                  "    (void)a;", f"    {own}(&prepared, 0, y, {more}out);", "}"]
    source, made = folder / "library.c", folder / "library.so"
    source.write_text("\n".join(lines) + "\n", encoding="utf-8")
    flags = [flag for flag in FLAGS if not flag.startswith("-std")]
    subprocess.run([compiler, "-x", "c", *flags, "-shared", "-fPIC", source, "-o", made, "-lm"], check=True)
    return made


def compiled(compiler, folder):
    """`robots_speed.cpp`, which takes some minutes."""
    include = next(p for p in map(pathlib.Path, sys.path) if (p / "cmeel.prefix/include/pinocchio").is_dir())
    include = include / "cmeel.prefix/include"
    source, made = pathlib.Path(__file__).with_suffix(".cpp"), folder / "robots_speed"
    command = [compiler, *FLAGS, *LIMITS, "-isystem", include, "-isystem", include / "eigen3", source,
               "-o", made, "-ldl", "-L", include.parent / "lib", "-lboost_serialization",
               f"-Wl,-rpath,{include.parent / 'lib'}"]
    subprocess.run(command, check=True)
    return made


def main():
    program, cpu, *names = sys.argv[1:]
    march = [] if cpu == "baseline" else [f"-march={cpu}"]
    FLAGS.extend(march)
    compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("clang++")
    said = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    place, rows = folder(), []
    with tempfile.TemporaryDirectory() as temporary:
        base = pathlib.Path(temporary)
        timing = compiled(compiler, base)
        for name in names or CHOSEN:
            own = base / name
            own.mkdir()
            path = ROBOTS[name]
            robot = Robot(place / path.removeprefix("+"), path.startswith("+"), own, n_frames=1, more="jacobian")
            robot.pin.saveToText(str(own / "model.txt"))
            states(robot, own / "states.txt")
            made = library(robot, program, compiler, own)
            told = subprocess.run([timing, own / "model.txt", own / "states.txt", made, robot.links[0]],
                                  capture_output=True, text=True, check=True).stdout
            times = {}
            for who, function, time in map(str.split, told.splitlines()):
                times[who, function] = min(float(time), times.get((who, function), np.inf))
            for function, (meaning, _) in FUNCTIONS.items():
                ours, theirs = times["hamel", function], times["pinocchio", function]
                row = f"| {name} | {robot.pin.nv} | {meaning} | {ours:.0f} | {theirs:.0f} | {ours / theirs:.2f} |"
                rows.append(row)
                print(rows[-1], flush=True)
    processor = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo", encoding="utf-8")
                      if line.startswith("model name")), platform.processor())
    PAGE.write_text(page(rows, cpu, f"{processor}, with {said}"), encoding="utf-8")


def page(rows, cpu, machine):
    """The page, by the lines of its table."""
    calls = [call for _, call in FUNCTIONS.values()]
    version = importlib.metadata.version("pin")
    return f"""# Robots

Functions of robots from URDF, of the package `example-robot-data`, beside Pinocchio {version}: C that `hamel generate`
writes for the imported model, and {", ".join(calls[:3])}, {calls[3]}, {calls[4]}
and {calls[5]}, from the headers of Pinocchio's wheel. Both are compiled by the same compiler with the
same flags and called through a pointer, on {N_STATES} states in turns. The least time of 40 rounds counts, in nanoseconds
a call on one core, and the faster one of Pinocchio's conventions (local, world).

Quadrupeds have a floating base. The second finger of Panda follows the first one: hamel eliminates it, and Pinocchio
has nine velocities. Derivatives are by all coordinates and velocities; hamel writes the entries that do not vanish, and
Pinocchio has the derivatives by forces as well, which it computes on the way.
[`tests/peers/robots.py`](../../tests/peers/robots.py) holds forces, rates, mass matrices and frames of both to each
other, to 1e-12.

Written by `python tests/peers/robots_speed.py hamel {cpu}` on {machine}.

| robot | velocities | function | hamel ns | Pinocchio ns | ratio |
|---|--:|---|--:|--:|--:|
""" + "\n".join(rows) + "\n"


if __name__ == "__main__":
    main()
