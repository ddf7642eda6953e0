"""Writes `docs/benchmarks/problems.md`: problems by which programs are compared, all in one run.

    pip install heyoka==7.13.2 exudyn==1.13.6
    python tests/peers/problems.py HAMEL

HAMEL is the program, built for release; models are on the shelf, `models/shelf`. Every row is the least time of several
runs in turn. hamel's time is what `hamel simulate` prints, the compilation in memory included; that of heyoka's steps
and of Exudyn's assembly is left out.
"""

import math
import pathlib
import platform
import re
import subprocess
import sys
import time
import warnings

import exudyn
import heyoka
import numpy as np
from exudyn.itemInterface import MarkerBodyPosition, ObjectGround, SensorBody
from exudyn.utilities import InertiaCuboid, InertiaMassPoint, RotationMatrixY, RotationMatrixZ

warnings.simplefilter("ignore")
ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "docs/benchmarks/problems.md"
N_RUNS = 5

# Mazzia, Magherini 2008, Test Set for Initial Value Problem Solvers.
ANDREWS = {
    "beta": 15.81077119629904, "Theta": -15.75637105984298, "gamma": 0.04082224013073101,
    "Phi": -0.5347301163226948, "delta": 0.5244099658805304, "Omega": 0.5347301163226948,
    "epsilon": 1.048080741042263,
}
PLEIADES = {
    "q11": 0.3706139143970502, "q21": 3.237284092057233, "q31": -3.222559032418324, "q41": 0.6597091455775310,
    "q51": 0.3425581707156584, "q61": 1.562172101400631, "q71": -0.7003092922212495, "q12": -3.943437585517392,
    "q22": -3.271380973972550, "q32": 5.225081843456543, "q42": -2.590612434977470, "q52": 1.198213693392275,
    "q62": -0.2429682344935824, "q72": 1.091449240428980,
}


def hamel(program, model, t_end, *options):
    """Milliseconds, final values, change of the energy."""
    command = [program, "simulate", model, "--t-final", repr(t_end), *options]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    milliseconds = float(re.search(r"evaluations, ([0-9.]+) (ms|s)\b", text)[1])
    if re.search(r"evaluations, [0-9.]+ s\b", text):
        milliseconds *= 1e3
    rows = (line.split() for line in text.splitlines())
    values = {row[0]: float(row[2]) for row in rows if len(row) == 3 and re.fullmatch(r"[-0-9.e]+", row[2])}
    change = re.search(r"(?:drift|largest change) ([0-9.e+-]+)", text)
    return milliseconds, values, float(change[1])


def initial(model):
    """The initial values of a model of the shelf, by component."""
    text = (ROOT / f"models/shelf/{model}.hamel").read_text(encoding="utf-8")
    values = {}
    for name, vector in re.findall(r"initial (\w+) = \[([^\]]*)\];", text):
        for k, entry in enumerate(vector.split(","), 1):
            base, dot = re.fullmatch(r"(q\d)(_dot)?", name).groups()
            values[f"{base}{k}{dot or ''}"] = math.prod(float(factor) for factor in entry.split("*"))
    return values


def particles(masses, gravity, dimensions, start, t_end, tol):
    """heyoka's Taylor method for gravitating bodies: milliseconds, final values, change of the energy."""
    n = len(masses)
    system = heyoka.model.nbody(n, masses=masses, Gconst=gravity)
    axes = [(f"q{k + 1}{i + 1}{dot}" if i < dimensions else None)
            for k in range(n) for dot in ("", "_dot") for i in range(3)]
    state = np.array([start.get(name, 0.0) for name in axes])
    integrator = heyoka.taylor_adaptive(system, state.copy(), tol=tol, high_accuracy=tol < 1e-16)
    energy = heyoka.cfunc([heyoka.model.nbody_energy(n, masses=masses, Gconst=gravity)], vars=[v for v, _ in system])
    best = math.inf
    for _ in range(N_RUNS):
        integrator.time = 0.0
        integrator.state[:] = state
        begun = time.perf_counter()
        integrator.propagate_until(t_end)
        best = min(best, time.perf_counter() - begun)
    before, after = energy(state)[0], energy(integrator.state)[0]
    values = {name: x for name, x in zip(axes, integrator.state) if name}
    return 1e3 * best, values, abs(after / before - 1)


def solved(system, t_end, step):
    """Milliseconds of Exudyn's generalized alpha method."""
    settings = exudyn.SimulationSettings()
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = t_end
    settings.timeIntegration.numberOfSteps = round(t_end / step)
    settings.timeIntegration.endTime = t_end
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.relativeTolerance = 1e-8
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.95
    settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = True
    # Follows its guide for constraints that depend on each other.
    settings.linearSolverType = exudyn.LinearSolverType.EigenDense
    settings.linearSolverSettings.ignoreSingularJacobian = True
    begun = time.perf_counter()
    system.SolveDynamic(settings)
    return 1e3 * (time.perf_counter() - begun)


def bricard(t_end, step):
    """Milliseconds, place of the third hinge."""
    system = exudyn.SystemContainer().AddSystem()
    rod = InertiaCuboid(density=100, sideLengths=[1, 0.1, 0.1]).Translated([0.5, 0, 0])
    hinges = [[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]]
    quarter = math.pi / 2
    frames = [np.eye(3), RotationMatrixZ(-quarter), RotationMatrixY(-quarter), RotationMatrixZ(2 * quarter),
              RotationMatrixZ(quarter)]
    ground = system.AddObject(ObjectGround())
    bodies = [ground]
    for k, (place, frame) in enumerate(zip(hinges, frames)):
        body = system.CreateRigidBody(inertia=rod, referencePosition=place, referenceRotationMatrix=frame,
                                      gravity=[0, -9.81, 0])
        axis = [float(i == (1, 2, 0)[k % 3]) for i in range(3)]
        system.CreateRevoluteJoint(bodyNumbers=[bodies[-1], body], position=place, axis=axis)
        bodies.append(body)
    system.CreateGenericJoint(bodyNumbers=[bodies[-1], ground], position=hinges[5],
                              constrainedAxes=[1, 1, 1, 0, 1, 1])
    hinge = system.AddSensor(SensorBody(bodyNumber=bodies[4], localPosition=[0, 0, 0], storeInternal=True,
                                        outputVariableType=exudyn.OutputVariableType.Position))
    system.Assemble()
    return solved(system, t_end, step), system.GetSensorValues(hinge)


def governor(t_end, step):
    """Milliseconds, height of the slider."""
    system = exudyn.SystemContainer().AddSystem()
    turning = np.array([0, 0, 2 * math.pi])
    given = {"initialAngularVelocity": turning, "gravity": [0, 0, -9.81]}
    ground = system.AddObject(ObjectGround())
    shaft = system.CreateRigidBody(inertia=InertiaCuboid(3000, [0.01, 0.01, 1]), referencePosition=[0, 0, 0.5], **given)
    slider = system.CreateRigidBody(inertia=InertiaCuboid(3000, [0.1, 0.1, 0.1]), referencePosition=[0, 0, 0.5], **given)
    system.CreateRevoluteJoint(bodyNumbers=[ground, shaft], position=[0, 0, 0], axis=[0, 0, 1])
    system.CreatePrismaticJoint(bodyNumbers=[shaft, slider], position=[0, 0, 0.5], axis=[0, 0, 1])
    arm = InertiaCuboid(3000, [1, 0.01, 0.01]) + InertiaMassPoint(5).Translated([0.5, 0, 0])
    for side in (1, -1):
        top = np.array([0.05 * side, 0, 1])
        along = np.array([side * math.cos(math.pi / 6), 0, -0.5])
        frame = np.array([[along[0], 0, -along[2]], [0, 1, 0], [along[2], 0, along[0]]])
        middle = top + along / 2
        body = system.CreateRigidBody(inertia=arm, referencePosition=middle, referenceRotationMatrix=frame,
                                      initialVelocity=np.cross(turning, middle), **given)
        system.CreateRevoluteJoint(bodyNumbers=[shaft, body], position=top, axis=[0, 1, 0])
        system.CreateSpringDamper(bodyNumbers=[slider, body], localPosition0=[0.05 * side, 0, 0],
                                  localPosition1=[0, 0, 0], referenceLength=0.5, stiffness=8e5, damping=4e4)
    height = system.AddSensor(SensorBody(bodyNumber=slider, localPosition=[0, 0, 0], storeInternal=True,
                                         outputVariableType=exudyn.OutputVariableType.Position))
    system.Assemble()
    return solved(system, t_end, step), system.GetSensorValues(height)[2]


def third_hinge(values):
    """That of `bricard_linkage`, whose frames turn about the axes 2, 3 and 1."""
    (s1, c1), (s2, c2), (s3, c3) = [(math.sin(values[q]), math.cos(values[q])) for q in ("q1", "q2", "q3")]
    x, y, z = 1 + s2 + s2 * s3, -c2 - c2 * s3, c3
    return np.array([c1 * x + s1 * z, y, c1 * z - s1 * x])


def least(run):
    """The result of the fastest of several runs."""
    return min((run() for _ in range(N_RUNS)), key=lambda result: result[0])


def farthest(values, expected):
    return max(abs(values[name] - x) for name, x in expected.items())


def rows(program):
    """`(problem, tool, method, milliseconds, error)`."""
    def tolerances(rtol):
        return "--rtol", rtol, "--atol", rtol

    name = "Andrews' squeezer, 0.03 s"
    for rtol in ("1e-8", "1e-12"):
        ms, values, _ = least(lambda: hamel(program, "andrews_squeezer", 0.03, *tolerances(rtol)))
        yield name, "hamel", f"dop853, {rtol}", ms, farthest(values, ANDREWS)

    name = "Bricard's linkage, 10 s"
    exact = third_hinge(hamel(program, "bricard_linkage", 10.0, *tolerances("1e-14"))[1])
    for rtol in ("1e-6", "1e-10"):
        ms, values, _ = least(lambda: hamel(program, "bricard_linkage", 10.0, *tolerances(rtol)))
        yield name, "hamel", f"dop853, {rtol}", ms, np.abs(third_hinge(values) - exact).max()
    for step in (0.01, 0.001):
        ms, hinge = least(lambda: bricard(10.0, step))
        yield name, "Exudyn", f"generalized alpha, {step:g} s", ms, np.abs(hinge - exact).max()

    name = "flyball governor, 10 s"
    exact = hamel(program, "flyball_governor", 10.0, *tolerances("1e-13"))[1]["s"]
    for label, options in (("dop853, 1e-6", tolerances("1e-6")), ("dop853, 1e-10", tolerances("1e-10")),
                           ("gauss8-newton, 0.02 s", ("--method", "gauss8-newton", "--step", "0.02"))):
        ms, values, _ = least(lambda: hamel(program, "flyball_governor", 10.0, *options))
        yield name, "hamel", label, ms, abs(values["s"] - exact)
    for step in (0.01, 0.001):
        ms, height = least(lambda: governor(10.0, step))
        yield name, "Exudyn", f"generalized alpha, {step:g} s", ms, abs(height - exact)

    name = "Pleiades, 3"
    for method, rtol in (("dop853", "1e-8"), ("gbs14", "1e-12"), ("dop853", "1e-13")):
        ms, values, _ = least(lambda: hamel(program, "pleiades", 3.0, "--method", method, *tolerances(rtol)))
        yield name, "hamel", f"{method}, {rtol}", ms, farthest(values, PLEIADES)
    for tol in (1e-9, 1e-15):
        ms, values, _ = particles([float(k) for k in range(1, 8)], 1.0, 2, initial("pleiades"), 3.0, tol)
        yield name, "heyoka", f"Taylor, {tol:g}", ms, farthest(values, PLEIADES)

    name = "outer solar system, 10,000 years"
    masses = [1.00000597682, 1 / 1047.355, 1 / 3501.6, 1 / 22869, 1 / 19314, 7.4074074e-9]
    for method, options in (("gbs14, 1e-12", tolerances("1e-12")), ("gauss16, 0.4 years", ("--step", "0.4"))):
        kind = method.split(",")[0]
        ms, _, change = least(lambda: hamel(program, "outer_solar_system", 1e4, "--method", kind, *options))
        yield name, "hamel", method, ms, change
    for tol in (1e-12, 1e-18):
        ms, _, change = particles(masses, (365 * 0.01720209895) ** 2, 3, initial("outer_solar_system"), 1e4, tol)
        yield name, "heyoka", f"Taylor, {tol:g}", ms, change


def processor():
    names = re.findall(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    return names[0] if names else platform.processor()


def main(program):
    lines = [f"| {problem} | {tool} | {method} | {ms:.3g} | {error:.1e} |" for problem, tool, method, ms, error in
             rows(program)]
    head = PAGE.read_text(encoding="utf-8").split("Written by")[0]
    made = f"Written by `python tests/peers/problems.py hamel` on {processor()}, with Exudyn {exudyn.__version__} and " \
           f"heyoka {heyoka.__version__}.\n"
    table = "| problem | program | method | ms | error |\n|---|---|---|--:|--:|\n" + "\n".join(lines) + "\n"
    PAGE.write_text(f"{head}{made}\n{table}", encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main(*sys.argv[1:])
