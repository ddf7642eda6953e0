//! Scenes as C, compiled by the C compilers of this machine, against the interpreter, bit for bit.
//!
//! Deliberately does not know: how C is written. Without a compiler the tests say so and pass; `.ci/run` asks for one.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hamel_codegen::config::{Language, Precision};
use hamel_codegen::scene::{self, BuiltScene, Start, Writing};
use hamel_codegen::spec::Model;
use hamel_expr::rational_to_f64;
use hamel_program::program::{Function, Point, Role};
use hamel_runtime::Real;
use hamel_tests::at_length;
use hamel_tests::models::{build, derived, generated, model};
use hamel_tests::random::Random;

/// Points of each scene.
const N_ROUNDS: usize = 12;

/// A number of C, and of the interpreter.
trait Number: Real {
    const NAME: &'static str;
    const PRECISION: Precision;

    fn bytes(self) -> Vec<u8>;

    fn read(bytes: &[u8]) -> Self;
}

impl Number for f64 {
    const NAME: &'static str = "double";
    const PRECISION: Precision = Precision::Double;

    fn bytes(self) -> Vec<u8> {
        self.to_le_bytes().into()
    }

    fn read(bytes: &[u8]) -> Self {
        f64::from_le_bytes(bytes.try_into().expect("eight bytes"))
    }
}

impl Number for f32 {
    const NAME: &'static str = "float";
    const PRECISION: Precision = Precision::Single;

    fn bytes(self) -> Vec<u8> {
        self.to_le_bytes().into()
    }

    fn read(bytes: &[u8]) -> Self {
        f32::from_le_bytes(bytes.try_into().expect("four bytes"))
    }
}

/// A scene with its name in C, and numbers that go in and have to come out.
struct Case<R> {
    prefix: String,
    built: BuiltScene,
    input: Vec<R>,
    expected: Vec<R>,
}

fn initial_state(model: &Model, built: &BuiltScene) -> Option<Start> {
    scene::start(model, built).unwrap_or_else(|e| panic!("{e}"))
}

/// The compilers that are there.
fn compilers() -> Vec<&'static str> {
    let answers = |name: &&str| {
        let ran = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        ran.is_ok_and(|status| status.success())
    };
    ["gcc", "clang"].into_iter().filter(answers).collect()
}

/// The call of a function of a program, with its results in `out`; none where C has it under a name of its own, in
/// `outputs`.
fn call(prefix: &str, has_inputs: bool, function: &Function) -> Option<String> {
    Some(match &function.role {
        Role::Rate if has_inputs => format!("{prefix}_rhs_with(&p, t, y, u, out)"),
        Role::Rate => format!("{prefix}_rhs(&p, t, y, out)"),
        Role::Energy => format!("out[0] = {prefix}_energy(&p, t, y)"),
        Role::Signature => format!("out[0] = {prefix}_signature(&p, t, y)"),
        Role::Pivots if function.results.is_empty() => return None,
        Role::Pivots => format!("{prefix}_pivots(&p, t, y, out, out + {})", function.results.len() / 2),
        Role::Product(name) => format!("{prefix}_{name}(&p, t, y, v, out)"),
        Role::Flow(name) => format!("{prefix}_{name}(&p, v[0], y, out)"),
        Role::OfVariables(name) if name.ends_with("jacobian") => {
            format!("{prefix}_{name}_nonzeros(&p, t, v, out)")
        }
        Role::OfVariables(name) => format!("{prefix}_{name}(&p, t, v, out)"),
        Role::Domain | Role::Output(_) | Role::Points | Role::SeriesStart | Role::SeriesStep => return None,
    })
}

/// What C and the interpreter compute from the same numbers: parameters, then for each round time, state and vector.
fn case<R: Number>(built: BuiltScene, prefix: String) -> Case<R> {
    let (program, executable) = (built.program(), built.executable());
    let mut random = Random(20_261_123);
    let mut moved = |p: f64| R::from_f64(p * (1.0 + 0.05 * random.number()));
    let params: Vec<R> = built.params().iter().map(|p| moved(rational_to_f64(&p.default))).collect();
    let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{prefix}: {e}"));
    let slots = &prepared[..program.prepare.slots.len()];
    let (n_inputs, has_inputs) = (program.inputs.len(), !program.inputs.is_empty());
    let mut input = params.clone();
    let mut expected = Vec::new();
    let n_vector = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0);
    for round in 0..N_ROUNDS {
        // Some angles are beyond the kernel of sine and cosine, some states outside of the domain.
        let scale = [1.0, 4.0, 4e6][round % 3];
        let mut numbers = |n: usize| (0..n).map(|_| R::from_f64(scale * random.number())).collect::<Vec<R>>();
        let (t, state, vector) = (numbers(1)[0], numbers(program.state.len()), numbers(n_vector));
        input.push(t);
        input.extend(&state);
        input.extend(&vector);
        // The right-hand side is asked for at others than those that are held, too.
        let (held, others) = (numbers(n_inputs), numbers(n_inputs));
        input.extend(&held);
        input.extend(&others);
        let run = |k: usize, function: &Function, inputs: &[R]| {
            let argument = &vector[..function.argument.len()];
            let mut out = vec![R::ZERO; function.results.len()];
            let prepared = [slots, inputs].concat();
            program.run_at(k, &params, &prepared, Point { t, state: &state, argument }, &mut out);
            out
        };
        for (k, function) in program.functions.iter().enumerate() {
            if call(&prefix, has_inputs, function).is_some() {
                let is_rate = function.role == Role::Rate;
                expected.extend(run(k, function, if is_rate { &others } else { &held }));
                expected.extend(
                    is_rate.then(|| run(k, function, &held)).filter(|_| has_inputs).into_iter().flatten(),
                );
            }
        }
        for output in built.outputs() {
            let role = Role::Output(output.name.clone());
            let k = program.function_idx(&role).unwrap_or_else(|| panic!("{prefix}: {role}"));
            expected.extend(run(k, &program.functions[k], &held));
        }
        let mut interpreter = executable.prepare_over(&params).unwrap_or_else(|e| panic!("{prefix}: {e}"));
        interpreter.set_inputs(&held);
        let told = |is_ok: bool| if is_ok { R::ONE } else { R::ZERO };
        expected.push(told(interpreter.domain(t, &state).is_ok()));
        expected.push(told(interpreter.check(t, &state).is_ok()));
    }
    Case { prefix, built, input, expected }
}

/// The function of the driver for a scene.
fn driver<R: Number>(case: &Case<R>) -> String {
    let (prefix, program) = (&case.prefix, case.built.program());
    let n_vector = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0).max(1);
    let mut text = format!(
        "#include \"{prefix}.h\"\nvoid run_{prefix}(void) {{\n    {prefix}_params params = {prefix}_params_default();\n    \
             {prefix}_prepared p;\n    double values[{n}], t, y[{m}], v[{n_vector}];\n    \
             take(values, {n_params});\n    {prefix}_params_from_array(values, &params);\n    \
             if ({prefix}_prepare(&params, &p) != 0) {{ puts({prefix}_message({prefix}_prepare(&params, &p))); exit(1); }}\n    \
             for (int round = 0; round < {N_ROUNDS}; round++) {{\n        \
                 take(&t, 1); take(y, {n_state}); take(v, {n_argument});\n{held}",
        n = program.params.len().max(1),
        m = program.state.len().max(1),
        n_params = program.params.len(),
        n_state = program.state.len(),
        n_argument = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0),
        held = match program.inputs.len() {
            0 => String::new(),
            m => format!("        double u[{m}]; take(u, {m}); {prefix}_hold_inputs(&p, u); take(u, {m});\n"),
        },
    );
    for function in &program.functions {
        let has_inputs = !program.inputs.is_empty();
        let held =
            (has_inputs && function.role == Role::Rate).then(|| format!("{prefix}_rhs(&p, t, y, out)"));
        for call in call(prefix, has_inputs, function).into_iter().chain(held) {
            let n = function.results.len();
            let _ = writeln!(text, "        {{ double out[{}]; {call}; give(out, {n}); }}", n.max(1));
        }
    }
    let _ = write!(
        text,
        "        {{ double out[{0}_N_OUTPUTS + 1]; {prefix}_outputs(&p, t, y, out); give(out, {0}_N_OUTPUTS); }}\n        \
             {{ double ok[2] = {{{prefix}_domain(&p, t, y) == 0, {prefix}_check(&p, t, y) == 0}}; give(ok, 2); }}\n    }}\n}}\n\n",
        prefix.to_ascii_uppercase()
    );
    text.replace("double ", &format!("{} ", R::NAME))
}

const HEAD: &str = "#include <stdio.h>\n#include <stdlib.h>\n\
static void take(double *x, int n) { if (fread(x, sizeof *x, n, stdin) != (size_t)n) { puts(\"no input\"); exit(1); } }\n\
static void give(const double *x, int n) { fwrite(x, sizeof *x, n, stdout); }\n";

/// Compiles all sources in a folder with a driver.
fn compile<R: Number>(compiler: &str, folder: &Path, cases: &[Case<R>]) -> PathBuf {
    let program = folder.join(format!("all_{compiler}"));
    let mut command = Command::new(compiler);
    command.current_dir(folder).args(["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]);
    if cfg!(target_feature = "fma") {
        command.arg("-mfma");
    }
    if R::PRECISION == Precision::Single {
        command.arg("-Wdouble-promotion");
    }
    command.arg("driver.c").args(cases.iter().map(|case| format!("{}.c", case.prefix)));
    let status = command.arg("-o").arg(&program).arg("-lm").status();
    assert!(status.as_ref().is_ok_and(|s| s.success()), "{compiler} fails: {status:?}");
    program
}

/// Writes scenes as C to a folder of this name, compiles them with every compiler and compares.
fn compare<R: Number>(name: &str, scenes: Vec<(BuiltScene, Option<Start>)>) {
    let compilers = compilers();
    if compilers.is_empty() {
        println!("skipped: no C compiler; install gcc or clang");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    let mut cases: Vec<Case<R>> = Vec::new();
    let writing = Writing { precision: R::PRECISION, ..Writing::default() };
    for (built, initial) in scenes {
        let c = built.emit_c(&writing, initial).unwrap_or_else(|e| panic!("{}: {e}", built.name()));
        for (extension, text) in [("h", &c.header), ("c", &c.source)] {
            std::fs::write(folder.join(format!("{}.{extension}", c.prefix)), text).expect("a file for tests");
        }
        cases.push(case(built, c.prefix));
    }
    let mut text = HEAD.replace("double", R::NAME);
    cases.iter().for_each(|case| text.push_str(&driver(case)));
    let calls: String = cases.iter().map(|case| format!("    run_{}();\n", case.prefix)).collect();
    let _ = write!(text, "int main(void) {{\n{calls}    return 0;\n}}\n");
    std::fs::write(folder.join("driver.c"), text).expect("a file for tests");
    for compiler in compilers {
        let program = compile(compiler, &folder, &cases);
        compare_with(compiler, &program, &cases);
    }
}

/// Gives a program its numbers, and compares what comes out.
fn compare_with<R: Number>(compiler: &str, program: &Path, cases: &[Case<R>]) {
    let child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let mut child = child.expect("the program starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let bytes: Vec<u8> = cases.iter().flat_map(|c| &c.input).flat_map(|x| x.bytes()).collect();
    let writer = std::thread::spawn(move || stdin.write_all(&bytes));
    let output = child.wait_with_output().expect("the program ends");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    writer.join().expect("the thread ends").expect("the program reads everything");
    let mut found = output.stdout.chunks_exact(R::ZERO.bytes().len()).map(R::read);
    let (mut compared, mut finite) = (0, 0);
    for case in cases {
        for (k, expected) in case.expected.iter().enumerate() {
            let value = found.next().unwrap_or_else(|| panic!("{}: no number {k}", case.prefix));
            assert!(
                value.bytes() == expected.bytes() || value.all_ne(value) && expected.all_ne(*expected),
                "{compiler}, {}, number {k} of {}: {value:?}, interpreted {expected:?}",
                case.prefix,
                case.expected.len()
            );
            compared += 1;
            finite += usize::from(value.all_finite());
        }
    }
    assert!(found.next().is_none(), "{compiler}: more numbers than expected");
    assert!(2 * finite > compared, "{compiler}: {finite} of {compared} numbers are finite");
    println!("{compiler}: {} scenes, {compared} numbers, {finite} finite", cases.len());
}

/// Scenes with a function or an operation that none before them has; every scene at length.
#[test]
fn scenes_in_c_equal_the_interpreter_bit_for_bit() {
    let mut seen = BTreeSet::new();
    let mut scenes = Vec::new();
    for (name, scene) in generated() {
        let n_seen = seen.len();
        seen.extend(derived(name, scene).kinds());
        if at_length() || seen.len() > n_seen {
            let built = build(name, scene);
            let initial = initial_state(&model(name), &built);
            scenes.push((built, initial));
        }
    }
    assert!(scenes.len() >= 10, "{}", scenes.len());
    compare::<f64>("c", scenes);
}

#[test]
fn inputs_are_held_and_have_derivatives() {
    // All that reads inputs: rates, outputs, events with effects, an output alone in a scene with nothing prepared.
    let text = "model pushed {
        input u = 1/2; input y: vector(2) = [1, -2]; input inputs = 0;
        coordinate a in real; coordinate b in angle;
        lagrangian = 1/2*(a_dot^2 + b_dot^2) + cos(b);
        force a_dot = u + inputs^2; force b_dot = y[1]*a - y[2]*b_dot;
        output power = u*a_dot; output both = [u*a, y[1]*b + inputs];
        event stop = a - u falling { then a_dot = -u*a_dot; }
        scene controlled { input u, y, inputs; want rhs, energy, outputs, linearization, time_derivative, jvp, vjp; }
    }";
    let model = hamel_codegen::spec::parse("pushed", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "controlled").unwrap_or_else(|e| panic!("{e}"));
    let mut scenes = vec![(built, None)];
    for name in ["snakeboard", "mobile_robot", "two_arm_satellite"] {
        let built = build(name, "controlled");
        let initial = initial_state(&hamel_tests::models::model(name), &built);
        scenes.push((built, initial));
    }
    compare::<f64>("c_inputs", scenes);
}

/// Stumpff's functions, and a state of first order beside them.
#[test]
fn sines_of_what_may_vanish_and_states_of_first_order() {
    let text = "model soft {
        param k = 3; input u = 1/4;
        coordinate q in real; coordinate v: vector(3) in real;
        state pressure in real by pressure_dot = u - pressure*sinc(q);
        let p = [sinc(q), q*cosc(q)]; let w = spin(rot(v));
        lagrangian = dot(rate(p), rate(p)) + q_dot^2/2 + dot(w, w)/2 - k*q^2 - p[2]*pressure;
        force q_dot = pressure*cosc(v1);
        output tip = p; output axis = rot(v)*[0, 0, 1];
        let behind = rot(v)*rot(e1, q); force v_dot = -log(behind); output twist = log(behind, v);
        scene driven { input u; want energy, energy_rate, outputs, linearization, jvp; }
    }";
    let model = hamel_codegen::spec::parse("soft", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "driven").unwrap_or_else(|e| panic!("{e}"));
    compare::<f64>("c_stumpff", vec![(built, None)]);
}

#[test]
fn an_fmu_casadi_and_cpp_take_inputs() {
    let Some(compiler) = compilers().into_iter().next() else {
        println!("skipped: no C compiler; install gcc or clang");
        return;
    };
    let text = "model pushed {
        param k = 1; input u = 1/2; input w: vector(2) = [1, -2];
        coordinate a in real; coordinate b in real;
        lagrangian = 1/2*(a_dot^2 + b_dot^2);
        force a_dot = k*u + w[1]^2; force b_dot = w[1]*a - w[2]*b_dot;
        output power = u*a_dot + w[2];
        initial a = 2; initial b = 0; initial a_dot = 0; initial b_dot = 3;
        scene controlled { input u, w; want energy, outputs; }
    }";
    let model = hamel_codegen::spec::parse("pushed", text).unwrap_or_else(|e| panic!("{e}"));
    let mut scenes = scene::Scenes::new(&model).for_language(Language::Casadi);
    let built = scenes.build("controlled").unwrap_or_else(|e| panic!("{e}"));
    let (c, fmu) =
        built.emit_fmu(&Writing::default(), initial_state(&model, &built)).unwrap_or_else(|e| panic!("{e}"));
    // Time 0, states 1 to 4, rates 5 to 8, k 9, inputs 10 to 12, energy 13, power 14.
    for line in [
        "<Float64 name=\"u\" valueReference=\"10\" causality=\"input\" variability=\"continuous\" start=\"0.5\"/>",
        "<Output valueReference=\"14\" dependencies=\"3 10 12\"",
        "<ContinuousStateDerivative valueReference=\"7\" dependencies=\"10 11\"",
        "<InitialUnknown valueReference=\"7\" dependencies=\"9 10 11\"",
    ] {
        assert!(fmu.description.contains(line), "{line} is not in\n{}", fmu.description);
    }
    let driver = r#"#include <stdio.h>
#include "pushed_controlled_fmu.c"
#include "pushed_controlled_casadi.c"
int main(void) {
    const fmi3ValueReference inputs[3] = {10, 11, 12}, k[1] = {9}, of[3] = {7, 8, 14};
    const double first[3] = {5.0, 3.0, 11.0}, then[3] = {-1.0, 2.0, 4.0}, two[1] = {2.0},
        seed[3] = {1.0, 10.0, 100.0};
    double out[3];
    fmi3Instance m = fmi3InstantiateModelExchange("m", FMU_TOKEN, "", false, false, NULL, NULL);
    fmi3GetFloat64(m, inputs, 3, out, 3);
    printf("%g %g %g\n", out[0], out[1], out[2]);
    fmi3SetFloat64(m, inputs, 3, first, 3);
    fmi3EnterInitializationMode(m, false, 0.0, 0.0, false, 0.0);
    fmi3SetFloat64(m, k, 1, two, 1);
    fmi3ExitInitializationMode(m);
    fmi3GetFloat64(m, of, 3, out, 3);
    printf("%g %g %g\n", out[0], out[1], out[2]);
    fmi3EnterContinuousTimeMode(m);
    printf("%d %d\n", fmi3SetFloat64(m, inputs, 3, then, 3), fmi3SetFloat64(m, k, 1, two, 1));
    fmi3GetFloat64(m, of, 3, out, 3);
    printf("%g %g %g\n", out[0], out[1], out[2]);
    fmi3GetDirectionalDerivative(m, of, 3, inputs, 3, seed, 3, out, 3);
    printf("%g %g %g\n", out[0], out[1], out[2]);
    fmi3FreeInstance(m);
    const double y[4] = {2.0, 0.0, 0.0, 3.0};
    const double *arg[5] = {NULL, y, two, first, NULL};
    double dy[4], jacobian[4], *res[4] = {dy, NULL, NULL, NULL};
    pushed_controlled_ode(arg, res, NULL, NULL, 0);
    printf("%g %g\n", dy[2], dy[3]);
    res[0] = NULL, res[3] = jacobian;
    jac_pushed_controlled_ode(arg, res, NULL, NULL, 0);
    printf("%lld %g %g %g %g\n", pushed_controlled_ode_n_in(), jacobian[0], jacobian[1], jacobian[2], jacobian[3]);
    return 0;
}
"#;
    let in_cpp = r#"#include <cstdio>
#include "pushed_controlled.hpp"
int main() {
    auto [made, code] = pushed_controlled::System::make(pushed_controlled::params_default());
    if (!made) { return code; }
    const pushed_controlled::State y = pushed_controlled::initial();
    made->hold_inputs({5.0, 3.0, 11.0});
    std::printf("%g %g\n", made->rhs(0.0, y)[2], made->rhs_with(0.0, y, {1.0, 0.0, 0.0})[2]);
}
"#;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_fmu_inputs");
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    for (name, text) in [
        ("pushed_controlled.h", c.header.as_str()),
        ("pushed_controlled.c", &c.source),
        ("pushed_controlled.hpp", &c.cpp),
        ("pushed_controlled_casadi.c", &c.casadi),
        ("pushed_controlled_fmu.c", &fmu.source),
        ("driver.c", driver),
        ("driver.cpp", in_cpp),
    ] {
        std::fs::write(folder.join(name), text).expect("a file for tests");
    }
    let run = |command: &str, arguments: &str| {
        let output = Command::new(command).current_dir(&folder).args(arguments.split_whitespace()).output();
        let output = output.expect("a program starts");
        assert!(
            output.status.success(),
            "{command} {arguments}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let strict = "-Wall -Wextra -Werror -ffp-contract=off";
    run(compiler, &format!("{strict} -std=c99 -c pushed_controlled.c -o own.o"));
    run(compiler, &format!("{strict} -Wno-unused-parameter -std=c99 driver.c own.o -o in_c -lm"));
    // Rates of a_dot and b_dot are k u + w1^2 and a w1 - w2 b_dot, the power is u a_dot + w2.
    let found = run(folder.join("in_c").to_str().expect("a path"), "");
    let lines = ["0.5 1 -2", "19 -27 11", "0 3", "2 -8 4", "42 -280 100", "19 -27", "4 2 6 2 -3"];
    assert_eq!(found.lines().collect::<Vec<_>>(), lines);
    let cpp = if compiler == "gcc" { "g++" } else { "clang++" };
    if Command::new(cpp).arg("--version").output().is_err() {
        println!("skipped: no C++ compiler; install {cpp}");
        return;
    }
    run(cpp, &format!("{strict} -std=c++17 driver.cpp own.o -o in_cpp -lm"));
    assert_eq!(run(folder.join("in_cpp").to_str().expect("a path"), ""), "14 1\n");
}

#[test]
fn names_that_c_takes_are_renamed() {
    // Words of C and C++, macros and functions of math.h, and variables that functions have themselves.
    let text = "model words {
        /// Closes */ and opens /* comments, asks \"what??/\".
        param double = 2 where double > 0;
        param M_PI = 3; param p = 5; param fabs = 7; param linux = 2;
        coordinate y in real; coordinate register in real; coordinate t0 in (0, 4); coordinate template in angle;
        lagrangian = 1/2*double*(y_dot^2 + register_dot^2 + t0_dot^2 + template_dot^2)
            - M_PI*(y*register + sqrt(double + t0^2)) - linux*cos(template)*sin(p*y) - fabs*exp(sin(t0));
        output class = y*register; output prepare = y + t0; output message = t0*template;
        scene derivatives { want rhs, energy, outputs, jacobian, jvp, vjp, sensitivity, time_derivative; }
    }";
    let model = hamel_codegen::spec::parse("words", text).unwrap_or_else(|e| panic!("{e}"));
    let build = |scene| scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"));
    compare::<f64>("c_words", ["default", "derivatives"].map(|scene| (build(scene), None)).into());
}

/// The blocks of a language in the chapter of the book, one after the other.
fn book(language: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/book/c.md");
    let page = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let fence = format!("```{language}\n");
    let blocks = page.split(&fence).skip(1);
    blocks.filter_map(|block| block.split("```").next()).collect()
}

/// A program with these statements; what is included stands before it.
fn program_of(blocks: &str, after: &str) -> String {
    let (includes, statements): (Vec<&str>, Vec<&str>) =
        blocks.lines().partition(|line| line.starts_with('#'));
    let (includes, statements) = (includes.join("\n"), statements.join("\n    "));
    format!("#include <stdio.h>\n{includes}\nint main(void) {{\n    {statements}\n{after}}}\n")
}

#[test]
fn the_blocks_of_the_book_compile_and_run() {
    let Some(compiler) = compilers().into_iter().next() else {
        println!("skipped: no C compiler; install gcc or clang");
        return;
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_book");
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    let built = build("heavy_top", scene::DEFAULT);
    let initial = initial_state(&model("heavy_top"), &built);
    let c = built.emit_c(&Writing::default(), initial).unwrap_or_else(|e| panic!("{e}"));
    let print = "    printf(\"%.17g\\n\", dy[2]);\n    return 0;\n";
    let in_c = program_of(&book("c"), &format!("    (void)energy, (void)spin;\n{print}"));
    let in_cpp = program_of(&book("cpp"), print);
    let files = [
        ("heavy_top.h", &c.header),
        ("heavy_top.c", &c.source),
        ("heavy_top.hpp", &c.cpp),
        ("book.c", &in_c),
        ("book.cpp", &in_cpp),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).expect("a file for tests");
    }
    let run = |command: &mut Command| {
        let output = command.current_dir(&folder).output().expect("a program starts");
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    };
    let strict = ["-Wall", "-Wextra", "-Werror", "-ffp-contract=off"];
    run(Command::new(compiler).args(strict).args(["-std=c99", "-c", "heavy_top.c", "-o", "heavy_top.o"]));
    run(Command::new(compiler).args(strict).args([
        "-std=c99",
        "book.c",
        "heavy_top.o",
        "-o",
        "book_c",
        "-lm",
    ]));
    let found = run(&mut Command::new(folder.join("book_c")));
    // I3 Omega3' = (I1 - I2) Omega1 Omega2 + m g l (Gamma1 chi2 - Gamma2 chi1) = 0.048 at the initial state.
    let value: f64 = found.parse().unwrap_or_else(|e| panic!("{found}: {e}"));
    assert!((value - 0.08).abs() < 1e-15, "{value}");
    let cpp = if compiler == "gcc" { "g++" } else { "clang++" };
    if Command::new(cpp).arg("--version").output().is_err() {
        println!("skipped: no C++ compiler; install {cpp}");
        return;
    }
    run(Command::new(cpp).args(strict).args([
        "-std=c++17",
        "book.cpp",
        "heavy_top.o",
        "-o",
        "book_cpp",
        "-lm",
    ]));
    let in_cpp: f64 = run(&mut Command::new(folder.join("book_cpp"))).parse().expect("a number");
    // The state is the same, the mass is not.
    assert_eq!(in_cpp, value);
}

/// Scenes on `float`, against the interpreter over `f32`; every scene at length.
#[test]
fn scenes_in_single_precision_equal_the_interpreter_bit_for_bit() {
    let some = [
        ("heavy_top", "default"),
        ("heavy_top", "derivatives"),
        ("kirchhoff_body", "momenta"),
        ("two_arm_satellite", "controlled"),
        ("snakeboard", "controlled"),
        ("chaplygin_ball", "default"),
        ("euler_disk", "circle"),
    ];
    let built = |(name, scene): (&str, &str)| {
        let built = build(name, scene);
        let initial = initial_state(&model(name), &built);
        (built, initial)
    };
    let is_chosen = |(name, scene): &(&str, &str)| at_length() || some.contains(&(name, scene));
    let scenes: Vec<_> = generated().into_iter().filter(is_chosen).map(built).collect();
    assert!(scenes.len() >= some.len(), "{}", scenes.len());
    compare::<f32>("c_single", scenes);
}

/// A state after the step `h` of Runge and Kutta's method, by the operations of the emitted one.
fn runge_kutta(rates: impl Fn(f64, &[f64]) -> Vec<f64>, t: f64, h: f64, y: &[f64]) -> Vec<f64> {
    let moved = |by: f64, k: &[f64]| y.iter().zip(k).map(|(y, k)| y + by * k).collect::<Vec<f64>>();
    let half = 0.5 * h;
    let a = rates(t, y);
    let b = rates(t + half, &moved(half, &a));
    let c = rates(t + half, &moved(half, &b));
    let d = rates(t + h, &moved(h, &c));
    (0..y.len()).map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i])).collect()
}

/// Steps of the C of a scene from its initial state with its own parameters, until one ends the motion: the states, and
/// the message then.
fn steps(compiler: &str, model: &Model, h: f64, n: usize, precision: Precision) -> (Vec<Vec<f64>>, String) {
    let built = scene::build(model, "default").unwrap_or_else(|e| panic!("{e}"));
    let initial = initial_state(model, &built);
    let writing = Writing { precision, ..Writing::default() };
    let c = built.emit_c(&writing, initial).unwrap_or_else(|e| panic!("{e}"));
    let name = format!("c_steps_{}_{precision:?}_{compiler}", c.prefix);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    let number = if precision == Precision::Double { "double" } else { "float" };
    let (prefix, n_state) = (&c.prefix, built.program().state.len());
    let driver = format!(
        "#include <stdio.h>\n#include \"{prefix}.h\"\nint main(void) {{\n    \
             {prefix}_params params = {prefix}_params_default();\n    {prefix}_prepared p;\n    {number} y[{n_state}];\n    \
             if ({prefix}_prepare(&params, &p) != 0) return 1;\n    {prefix}_initial(y);\n    \
             for (int k = 0; k < {n}; k++) {{\n        \
                 int code = {prefix}_step(&p, ({number})(k * {h:?}), ({number}){h:?}, y, y);\n        \
                 if (code != 0) {{ puts({prefix}_message(code)); break; }}\n        \
                 for (int i = 0; i < {n_state}; i++) printf(\"%.17g \", (double)y[i]);\n        \
                 puts(\"\");\n    }}\n    return 0;\n}}\n"
    );
    let files = [
        (format!("{prefix}.h"), &c.header),
        (format!("{prefix}.c"), &c.source),
        ("driver.c".into(), &driver),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).expect("a file for tests");
    }
    let mut command = Command::new(compiler);
    command.current_dir(&folder).args([
        "-std=c99",
        "-O1",
        "-ffp-contract=off",
        "-Wall",
        "-Wextra",
        "-Werror",
    ]);
    if cfg!(target_feature = "fma") {
        command.arg("-mfma");
    }
    let status = command.args(["driver.c", &format!("{prefix}.c"), "-o", "steps", "-lm"]).status();
    assert!(status.as_ref().is_ok_and(|s| s.success()), "{compiler} fails: {status:?}");
    let output = Command::new(folder.join("steps")).output().expect("the program starts");
    let text = String::from_utf8(output.stdout).expect("text");
    let (mut states, mut told) = (Vec::new(), String::new());
    for line in text.lines() {
        match line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>() {
            Ok(state) => states.push(state),
            Err(_) => told = line.to_owned(),
        }
    }
    (states, told)
}

/// A step in C is one of Runge and Kutta's method, bit for bit, and in single precision within its digits.
#[test]
fn steps_in_c_are_those_of_runge_and_kutta() {
    let model = model("heavy_top");
    let built = build("heavy_top", "default");
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let interpreter = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let rates = |t: f64, y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        interpreter.rhs(t, y, &mut dy);
        dy
    };
    let mut y = initial_state(&model, &built).expect("an initial state").state;
    for compiler in compilers() {
        let start = y.clone();
        let (states, told) = steps(compiler, &model, 0.01, 200, Precision::Double);
        let (single, _) = steps(compiler, &model, 0.01, 200, Precision::Single);
        assert_eq!((states.len(), single.len(), told.as_str()), (200, 200, ""));
        for (k, (found, single)) in states.iter().zip(&single).enumerate() {
            y = runge_kutta(rates, k as f64 * 0.01, 0.01, &y);
            assert_eq!(&y, found, "{compiler}, step {k}");
            let off = y.iter().zip(single).fold(0.0_f64, |max, (a, b)| max.max((a - b).abs()));
            assert!(off < 2e-4, "{compiler}, step {k}: {off}");
        }
        y = start;
    }
}

/// A step over a singular point, out of the domain or to infinity is none, and leaves the state as it is.
#[test]
fn a_step_that_ends_the_motion_says_why() {
    let cases = [
        // The inertia `1 - x^2` vanishes at `t = pi/4`.
        ("1/2*(1 - x^2)*x_dot^2", "", 0.05, 15, "passes through zero"),
        ("1/2*x_dot^2", "in (-1, 0.72)", 0.05, 14, "does not hold"),
        ("1/2*x_dot^2 + exp(700*x)", "", 0.5, 0, "not finite"),
    ];
    for (lagrangian, domain, h, n, why) in cases {
        let place = if domain.is_empty() { "in real" } else { domain };
        let text =
            format!("model ends {{ coordinate x {place}; lagrangian = {lagrangian}; initial x_dot = 1; }}");
        let model = hamel_codegen::spec::parse("ends", &text).unwrap_or_else(|e| panic!("{e}"));
        for compiler in compilers() {
            let (states, told) = steps(compiler, &model, h, 100, Precision::Double);
            assert!(told.contains(why), "{text}: {told}");
            assert_eq!(states.len(), n, "{text}: {told}");
        }
    }
}
