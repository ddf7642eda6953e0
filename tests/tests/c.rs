//! Scenes as C, compiled by the C compilers of this machine, against the interpreter, bit for bit.
//!
//! Deliberately does not know: how C is written. Without a compiler the tests say so and pass; `.ci/run` asks for one.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hamel_codegen::config::Language;
use hamel_codegen::scene::{self, BuiltScene, Start, Writing};
use hamel_codegen::spec::Model;
use hamel_expr::rational_to_f64;
use hamel_program::program::{Function, Point, Role};
use hamel_tests::at_length;
use hamel_tests::models::{build, derived, generated, model};
use hamel_tests::random::Random;

/// Points of each scene.
const N_ROUNDS: usize = 12;

/// A scene with its name in C, and numbers that go in and have to come out.
struct Case {
    prefix: String,
    built: BuiltScene,
    input: Vec<f64>,
    expected: Vec<f64>,
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
fn case(built: BuiltScene, prefix: String) -> Case {
    let program = built.program();
    let mut random = Random(20_261_123);
    let params: Vec<f64> =
        built.params().iter().map(|p| rational_to_f64(&p.default) * (1.0 + 0.05 * random.number())).collect();
    let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{prefix}: {e}"));
    let slots = &prepared[..program.prepare.slots.len()];
    let (n_inputs, has_inputs) = (program.inputs.len(), !program.inputs.is_empty());
    let mut input = params.clone();
    let mut expected = Vec::new();
    let n_vector = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0);
    for round in 0..N_ROUNDS {
        // Some angles are beyond the kernel of sine and cosine, some states outside of the domain.
        let scale = [1.0, 4.0, 4e6][round % 3];
        let mut numbers = |n: usize| (0..n).map(|_| scale * random.number()).collect::<Vec<f64>>();
        let (t, state, vector) = (numbers(1)[0], numbers(program.state.len()), numbers(n_vector));
        input.push(t);
        input.extend(&state);
        input.extend(&vector);
        // The right-hand side is asked for at others than those that are held, too.
        let (held, others) = (numbers(n_inputs), numbers(n_inputs));
        input.extend(&held);
        input.extend(&others);
        let run = |k: usize, function: &Function, inputs: &[f64]| {
            let argument = &vector[..function.argument.len()];
            let mut out = vec![0.0; function.results.len()];
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
        let mut interpreter = built.prepare(&params).unwrap_or_else(|e| panic!("{prefix}: {e}"));
        interpreter.set_inputs(&held);
        expected.push(f64::from(u8::from(interpreter.domain(t, &state).is_ok())));
        expected.push(f64::from(u8::from(interpreter.check(t, &state).is_ok())));
    }
    Case { prefix, built, input, expected }
}

/// The function of the driver for a scene.
fn driver(case: &Case) -> String {
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
    text
}

const HEAD: &str = "#include <stdio.h>\n#include <stdlib.h>\n\
static void take(double *x, int n) { if (fread(x, 8, n, stdin) != (size_t)n) { puts(\"no input\"); exit(1); } }\n\
static void give(const double *x, int n) { fwrite(x, 8, n, stdout); }\n";

/// Compiles all sources in a folder with a driver.
fn compile(compiler: &str, folder: &Path, cases: &[Case]) -> PathBuf {
    let program = folder.join(format!("all_{compiler}"));
    let mut command = Command::new(compiler);
    command.current_dir(folder).args(["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]);
    if cfg!(target_feature = "fma") {
        command.arg("-mfma");
    }
    command.arg("driver.c").args(cases.iter().map(|case| format!("{}.c", case.prefix)));
    let status = command.arg("-o").arg(&program).arg("-lm").status();
    assert!(status.as_ref().is_ok_and(|s| s.success()), "{compiler} fails: {status:?}");
    program
}

/// Writes scenes as C to a folder of this name, compiles them with every compiler and compares.
fn compare(name: &str, scenes: Vec<(BuiltScene, Option<Start>)>) {
    let compilers = compilers();
    if compilers.is_empty() {
        println!("skipped: no C compiler; install gcc or clang");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    let mut cases = Vec::new();
    for (built, initial) in scenes {
        let c =
            built.emit_c(&Writing::default(), initial).unwrap_or_else(|e| panic!("{}: {e}", built.name()));
        for (extension, text) in [("h", &c.header), ("c", &c.source)] {
            std::fs::write(folder.join(format!("{}.{extension}", c.prefix)), text).expect("a file for tests");
        }
        cases.push(case(built, c.prefix));
    }
    let mut text = HEAD.to_owned();
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
fn compare_with(compiler: &str, program: &Path, cases: &[Case]) {
    let child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let mut child = child.expect("the program starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let bytes: Vec<u8> = cases.iter().flat_map(|c| &c.input).flat_map(|x| x.to_le_bytes()).collect();
    let writer = std::thread::spawn(move || stdin.write_all(&bytes));
    let output = child.wait_with_output().expect("the program ends");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    writer.join().expect("the thread ends").expect("the program reads everything");
    let (found, _) = output.stdout.as_chunks::<8>();
    let mut found = found.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let (mut compared, mut finite) = (0, 0);
    for case in cases {
        for (k, expected) in case.expected.iter().enumerate() {
            let value = found.next().unwrap_or_else(|| panic!("{}: no number {k}", case.prefix));
            assert!(
                value.to_bits() == expected.to_bits() || value.is_nan() && expected.is_nan(),
                "{compiler}, {}, number {k} of {}: {value}, interpreted {expected}",
                case.prefix,
                case.expected.len()
            );
            compared += 1;
            finite += usize::from(value.is_finite());
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
        for function in &derived(name, scene).program.functions {
            seen.insert(function.role.name().to_owned());
            seen.extend(function.instructions.iter().map(|i| format!("{:?}", std::mem::discriminant(&i.op))));
            seen.extend(function.contractions.first().map(|_| "contraction".to_owned()));
        }
        if at_length() || seen.len() > n_seen {
            let built = build(name, scene);
            let initial = initial_state(&model(name), &built);
            scenes.push((built, initial));
        }
    }
    assert!(scenes.len() >= 10, "{}", scenes.len());
    compare("c", scenes);
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
    compare("c_inputs", scenes);
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
    compare("c_stumpff", vec![(built, None)]);
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
    compare("c_words", ["default", "derivatives"].map(|scene| (build(scene), None)).into());
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
