"""Right-hand sides by other code generators, for `cargo xtask bench rhs --peers`, which starts this script.

    python3 tests/peers/rhs.py <folder> <native|x86-64-v3|baseline> <model>..

Generates every model that `equations` has with every package that is installed, compiles it with every compiler that is
found, checks every kernel against the reference points, and leaves the program `<folder>/peers` (`rhs.c`), which times
them; models without equations are passed over. Prints lines

    work <n> <what>     n pieces of work begin, each of which ends with a line `round`
    using <text>        a package or compiler with its version
    note <text>         what is not measured, and why

Knows nothing of hamel's own right-hand sides.
"""

import importlib.metadata
import os
import pathlib
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

from equations import MODELS, Problem

HERE = pathlib.Path(__file__).resolve().parent
# Error that a kernel may have, relative to its largest component: that of expanded determinants near singular states.
ACCURACY = 1e-11
LANES = 8
# What Rust assumes, too: nobody reads errno or floating-point exceptions. Contraction is left to the compiler.
FLAGS = ["-O3", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared"]
FAST = ["-ffast-math", "-fopenmp-simd"]


class Code:
    """Generated source: `inner` is a function of numbers that `call` calls, given its inputs and outputs as text."""

    def __init__(self, kind, language, inner, call, lanes=1, angles=()):
        self.kind, self.language, self.inner, self.call = kind, language, inner, call
        self.lanes, self.angles = lanes, angles


class Object:
    """Generated machine code with the calling convention that `rhs.c` has for it."""

    def __init__(self, kind, convention, symbol, code, lanes=1, libraries=()):
        self.kind, self.convention, self.symbol, self.code = kind, convention, symbol, code
        self.lanes, self.libraries = lanes, libraries


def inputs_of(problem, angles=()):
    return problem.params + problem.state + [name for name, _, _ in angles]


class Angles:
    """Functions of which sines and cosines become symbols of their own, so that a loop over lanes can precede them."""

    def __init__(self, f, symbol):
        self.f, self.symbol, self.found = f, symbol, {}

    def function(self, name, x):
        key = f"{name}_{x}"
        if key not in self.found:
            self.found[key] = (self.symbol(key), name, str(x))
        return self.found[key][0]

    def sin(self, x):
        return self.function("sin", x)

    def cos(self, x):
        return self.function("cos", x)

    def sqrt(self, x):
        return self.f.sqrt(x)

    def all(self):
        return [(key, name, x) for key, (_, name, x) in self.found.items()]


def scalar_and_lanes(problem, f, symbol, emit):
    """`emit(names, rates, lanes, angles)` for a call with one state, and for one with several."""
    params, state = [[symbol(n) for n in names] for names in (problem.params, problem.state)]
    yield emit(inputs_of(problem), problem.rates(f, params, state), 1, ())
    separate = Angles(f, symbol)
    rates = problem.rates(separate, params, state)
    yield emit(inputs_of(problem, separate.all()), rates, LANES, separate.all())


def by_wrenfold(problem):
    from wrenfold import code_generation, sym, type_info

    number = type_info.ScalarType(type_info.NumericType.Float)

    def described(with_angles):
        function = code_generation.FunctionDescription("rhs")
        symbols = {}

        def symbol(name):
            symbols[name] = function.add_input_argument(name, number)
            return symbols[name]

        params, state = [[symbol(n) for n in names] for names in (problem.params, problem.state)]
        names = {str(x): n for n, x in symbols.items()}
        angles = Angles(sym, symbol) if with_angles else sym
        rates = problem.rates(angles, params, state)
        for k, rate in enumerate(rates):
            function.add_output_argument(f"rate{k}", False, rate)
        found = [(key, name, names[x]) for key, name, x in angles.all()] if with_angles else []
        return code_generation.transpile(function), found

    generators = {"C++": code_generation.CppGenerator(), "Rust": code_generation.RustGenerator()}

    def call(inputs, outputs):
        return f"rhs({', '.join(inputs + outputs)});"

    function, _ = described(False)
    for language, generator in generators.items():
        yield Code(f"wrenfold {language}", language, generator.generate(function), call)
    function, angles = described(True)
    yield Code("wrenfold C++", "C++", generators["C++"].generate(function), call, LANES, angles)


def by_sympy(problem):
    import sympy
    from sympy.codegen.rewriting import create_expand_pow_optimization
    from sympy.printing.c import C99CodePrinter

    class Printer(C99CodePrinter):
        def _print_Pow(self, power):
            # A reciprocal root is a call of `pow` otherwise.
            if power.exp.is_Rational and power.exp.q == 2 and power.exp < 0:
                return f"1.0/({self._print(power.base ** -power.exp)})"
            return super()._print_Pow(power)

    expand, printer = create_expand_pow_optimization(4), Printer()

    def emit(passes):
        def with_passes(names, rates, lanes, angles):
            shared, rates = sympy.cse([sympy.sympify(rate) for rate in rates], optimizations=passes)
            lines = [f"const double {name} = {printer.doprint(expand(value))};" for name, value in shared]
            lines += [f"*rate{k} = {printer.doprint(expand(rate))};" for k, rate in enumerate(rates)]
            arguments = [f"const double {n}" for n in names] + [f"double *rate{k}" for k in range(len(rates))]
            inner = f"static inline void rhs({', '.join(arguments)}) {{\n" + "\n".join(lines) + "\n}"
            return Code(f"sympy C{', basic pass' if passes else ''}", "C", inner, call, lanes, angles)

        return with_passes

    def call(inputs, outputs):
        return f"rhs({', '.join(inputs + ['&' + x for x in outputs])});"

    for passes in (None, "basic"):
        yield from scalar_and_lanes(problem, sympy, lambda name: sympy.Symbol(name, real=True), emit(passes))


def by_casadi(problem):
    import casadi

    params, state = casadi.SX.sym("p", len(problem.params)), casadi.SX.sym("y", len(problem.state))
    rates = problem.rates(casadi, casadi.vertsplit(params), casadi.vertsplit(state))
    function = casadi.Function("rhs", [params, state], [casadi.densify(casadi.vertcat(*rates))], {"cse": True})
    generator = casadi.CodeGenerator("rhs.c", {"with_header": False})
    generator.add(function)
    # Nothing but the wrapper is exported, so that tests of pointers and calls within are left out.
    inner = "#define CASADI_SYMBOL_EXPORT static inline\n" + generator.dump()

    def call(inputs, outputs):
        return "const double *arguments[] = {p, y}; double *results[] = {dy}; rhs(arguments, results, 0, 0, 0);"

    yield Code("CasADi C", "C", inner, call)


def by_heyoka(problem):
    import heyoka

    state = [heyoka.expression(n) for n in problem.state]
    f = SimpleNamespace(sin=heyoka.sin, cos=heyoka.cos, sqrt=heyoka.sqrt)
    rates = problem.rates(f, [heyoka.par[i] for i in range(len(problem.params))], state)
    rates = [rate if isinstance(rate, heyoka.expression) else heyoka.expression(float(rate)) for rate in rates]
    libraries = sorted(pathlib.Path(heyoka.__file__).parent.parent.glob("heyoka.libs/libheyoka*.so*"))
    function = heyoka.cfunc(rates, state)
    yield Object("heyoka", "HEYOKA", "cfunc", for_target(function.llvm_states[0]), 1, libraries)
    function = heyoka.cfunc(rates, state, batch_size=LANES)
    yield Object("heyoka", "HEYOKA_STRIDED", "cfunc", function.llvm_states[2].object_code, LANES, libraries)


def for_target(module):
    """Machine code for the chosen target where llvmlite reads what heyoka wrote, otherwise heyoka's for this machine."""
    if TARGET == "native":
        return module.object_code
    try:
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        target = llvm.Target.from_default_triple()
        cpu = "x86-64" if TARGET == "baseline" else TARGET
        machine = target.create_target_machine(cpu=cpu, opt=3, reloc="pic", codemodel="small")
        # Every function says for which processor it is.
        text = re.sub(r'"(target-cpu|target-features|prefer-vector-width)"="[^"]*"', "", module.ir)
        return machine.emit_object(llvm.parse_assembly(text))
    except (ImportError, RuntimeError):
        return module.object_code


def by_symforce(problem):
    import symforce

    symforce.set_log_level("ERROR")
    import symforce.symbolic as sf
    from symforce import codegen
    from symforce.values import Values

    inputs = Values(**{name: sf.Symbol(name) for name in inputs_of(problem)})
    params, state = [[inputs[n] for n in names] for names in (problem.params, problem.state)]
    rates = problem.rates(sf, params, state)
    outputs = Values(**{f"rate{k}": sf.S(rate) for k, rate in enumerate(rates)})
    folder = OUT / "symforce" / problem.model
    made = codegen.Codegen(inputs, outputs, codegen.CppConfig(), name="rhs").generate_function(
        output_dir=folder, skip_directory_nesting=True
    )
    inner = made.generated_files[0].read_text().replace("#include <Eigen/Core>", "")

    def call(inputs, outputs):
        return f"sym::Rhs<double>({', '.join(inputs + ['&' + x for x in outputs])});"

    yield Code("SymForce C++", "C++", inner, call)


# Packages, the releases that this was written for, and what makes code of a problem with them.
GENERATORS = {
    "wrenfold": ("0.5.3", by_wrenfold),
    "sympy": ("1.14.0", by_sympy),
    "casadi": ("3.8.2", by_casadi),
    "heyoka": ("7.13.2", by_heyoka),
    "symforce": ("0.12.0", by_symforce),
}


def source(problem, code):
    """A file with one kernel, `f(p, t, y, dy)`; several lanes stand side by side, `y[component][lane]`."""
    n_params, n = len(problem.params), len(problem.state)
    if code.language == "Rust":
        inputs = [f"p[{i}]" for i in range(n_params)] + [f"y[{i}]" for i in range(n)]
        names = [f"rate{k}" for k in range(n)]
        return (
            f"#![allow(warnings)]\n{code.inner}\n#[unsafe(no_mangle)]\n"
            f"pub extern \"C\" fn kernel(p: &[f64; {n_params}], _: f64, y: &[f64; {n}], dy: &mut [f64; {n}]) {{\n"
            f"    let [{', '.join(names)}] = dy;\n    {code.call(inputs, names)}\n}}\n"
        )
    lane = f" * {code.lanes} + l" if code.lanes > 1 else ""
    inputs = [f"p[{i}]" for i in range(n_params)] + [f"y[{i}{lane}]" for i in range(n)]
    inputs += [f"{key}[l]" for key, _, _ in code.angles]
    body = code.call(inputs, [f"dy[{i}{lane}]" for i in range(n)])
    if code.lanes > 1:
        # Sine and cosine apart: gcc joins them otherwise to a call that it cannot do on several lanes.
        loop = f"_Pragma(\"omp simd\") for (int l = 0; l < {code.lanes}; l++)"
        parts = [
            f"double {key}[{code.lanes}]; {loop} {key}[l] = {name}(y[{problem.state.index(x)}{lane}]);"
            for key, name, x in code.angles
        ]
        body = "\n    ".join([*parts, f"{loop} {{ {body} }}"])
    include, linkage = ("cmath", 'extern "C" ') if code.language == "C++" else ("math.h", "")
    # Long functions are not inlined otherwise: their arguments go through memory then, and loops over lanes stay scalar.
    return (
        f"#include <{include}>\n{code.inner}\n"
        f"{linkage}__attribute__((flatten)) void kernel(\n"
        "    const double *__restrict p, double t, const double *__restrict y, double *__restrict dy\n"
        f") {{\n    (void)t;\n    {body}\n}}\n"
    )


class Kernel:
    """A compiled kernel."""

    def __init__(self, problem, kind, lanes, convention, symbol, path):
        self.problem, self.lanes = problem, lanes
        self.name = f"{problem.model}/default/{kind}" + (f"-{lanes}" if lanes > 1 else "")
        numbers = ", ".join(f"{x!r}" for x in problem.values)
        self.entry = (
            f'KERNEL("{self.name}", {convention}, {lanes}, {len(problem.state)}, "{path}", "{symbol}", {numbers})'
        )


def compilers():
    """The C compilers that are found, each with the C++ compiler beside it and its version."""
    found = {}
    # The newest clang.
    numbered = [(f"clang-{v}", f"clang++-{v}") for v in range(40, 9, -1)]
    for name, plus in [("gcc", "g++"), *numbered, ("clang", "clang++")]:
        family = name.split("-")[0]
        if family not in found and shutil.which(name) and shutil.which(plus):
            # Apple's gcc is clang.
            said = subprocess.run([name, "--version"], capture_output=True, text=True).stdout.splitlines()[0]
            if family not in ("clang", said.split()[0]):
                continue
            if wrong := run([name, *FLAGS, *MARCH, "-x", "c", os.devnull, "-o", OUT / "probe.so"]):
                note(f"{said} is not used: {wrong}")
            else:
                found[family] = (name, plus, said)
    return found


def run(command):
    """What went wrong, or nothing."""
    try:
        outcome = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    except OSError as e:
        return f"{command[0]} could not be started ({e.strerror})"
    if outcome.returncode == 0:
        return None
    said = outcome.stderr.strip().splitlines()
    # Without the path before it: the report names none.
    errors = [line.split("error:")[-1].strip() for line in said if "error" in line]
    return (errors or said or [f"{pathlib.Path(command[0]).name} failed"])[0]


def jobs(problem, code, found):
    """Compilations of a code: what each is called, its command, its kernel."""
    stem = re.sub(r"\W+", "_", f"{problem.model} {code.kind} {code.lanes}")
    if isinstance(code, Object):
        made = OUT / f"{stem}.o"
        made.write_bytes(code.code)
        library = OUT / f"{stem}.so"
        rpath = [f"-Wl,-rpath,{path.parent}" for path in code.libraries]
        command = [next(iter(found.values()))[0], "-shared", made, "-o", library, "-Wl,--as-needed"]
        command += [*code.libraries, *rpath, "-Wl,--allow-shlib-undefined", "-lm"]
        yield command, Kernel(problem, code.kind, code.lanes, code.convention, code.symbol, library)
        return
    text = OUT / f"{stem}.{ {'C': 'c', 'C++': 'cpp', 'Rust': 'rs'}[code.language] }"
    text.write_text(source(problem, code))
    if code.language == "Rust":
        library = OUT / f"{stem}_rustc.so"
        cpu = [] if TARGET == "baseline" else ["-C", f"target-cpu={TARGET}"]
        command = [RUSTC, "--edition=2024", "--crate-type=cdylib", "-Copt-level=3", "-Cpanic=abort", *cpu]
        yield command + ["-o", library, text], Kernel(problem, code.kind, 1, "PLAIN", "kernel", library)
        return
    for family, (c, plus, _) in found.items():
        library = OUT / f"{stem}_{family}.so"
        extra = [*FAST, *(["-fveclib=libmvec"] if family == "clang" else [])] if code.lanes > 1 else []
        command = [plus if code.language == "C++" else c, *FLAGS, *MARCH, *extra, text, "-o", library]
        command += ["-lmvec"] if code.lanes > 1 else []
        yield command + ["-lm"], Kernel(problem, f"{code.kind}, {family}", code.lanes, "PLAIN", "kernel", library)


def program(kernels, found):
    """Compiles the program that calls the kernels."""
    (OUT / "kernels.h").write_text("".join(f"{kernel.entry},\n" for kernel in kernels))
    made = OUT / "peers"
    command = [next(iter(found.values()))[0], "-O3", *MARCH, f"-I{OUT}", HERE / "rhs.c", "-o", made, "-ldl"]
    if said := run(command):
        raise SystemExit(f"the program that times does not compile: {said}")
    return made


def fault(program, kernel):
    """Why a kernel is not measured, or nothing."""

    def evaluate(params, state):
        line = kernel.name + "\t" + " ".join(f"{x!r}" for x in [*params, *state]) + "\n"
        outcome = subprocess.run([program, "check"], input=line, capture_output=True, text=True)
        if outcome.returncode != 0:
            raise RuntimeError(outcome.stderr.strip() or f"ended with status {outcome.returncode}")
        return map(float, outcome.stdout.split())

    try:
        error = kernel.problem.error(evaluate)
    except RuntimeError as e:
        return str(e)
    return None if error <= ACCURACY else f"off by {error:.1e} at the reference points"


def say(line):
    print(line, flush=True)


def using(text):
    say(f"using {text}")


def note(text):
    say(f"note {text}")


def in_parallel(what, work, tasks):
    say(f"work {len(tasks)} {what}")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for task, outcome in zip(tasks, pool.map(work, tasks)):
            say("round")
            yield task, outcome


def main():
    found = compilers()
    if not found:
        raise SystemExit("no C compiler: install gcc or clang")
    problems = [Problem(name) for name in MODELS if name in sys.argv[3:]]
    codes, missing = [], []
    say(f"work {len(problems) * len(GENERATORS)} generating")
    for package, (_, generate) in GENERATORS.items():
        try:
            using(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(package)
        for problem in problems:
            if package not in missing:
                try:
                    codes += [(problem, code) for code in generate(problem)]
                except Exception as e:  # Whatever a package throws, the others are measured.
                    note(f"{problem.model} by {package} is not measured: {type(e).__name__}: {str(e).splitlines()[0]}")
            say("round")
    for *_, version in found.values():
        using(version)
    if missing:
        wanted = " ".join(f"{package}=={GENERATORS[package][0]}" for package in missing)
        note(f"{', '.join(missing)} not measured, for not installed: `pip install {wanted}`")
    tasks = [job for problem, code in codes for job in jobs(problem, code, found)]
    kernels = []
    for (_, kernel), said in in_parallel("compiling", lambda task: run(task[0]), tasks):
        if said:
            note(f"{kernel.name} is not measured: {said}")
        else:
            kernels.append(kernel)
    made = program(kernels, found)
    right = []
    for kernel, said in in_parallel("checking", lambda kernel: fault(made, kernel), kernels):
        if said:
            note(f"{kernel.name} is not measured: {said}")
        else:
            right.append(kernel)
    if not right:
        raise SystemExit("no package that generates code is installed")
    program(right, found)


OUT, TARGET = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
MARCH = [] if TARGET == "baseline" else [f"-march={TARGET}"]
RUSTC = os.environ.get("RUSTC", "rustc")
OUT.mkdir(parents=True, exist_ok=True)
main()
