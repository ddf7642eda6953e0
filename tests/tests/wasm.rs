//! Scenes for WebAssembly, run by Node.js: right-hand sides, energies, outputs and motions have the bits of the
//! interpreter.
//!
//! Deliberately does not know: how the modules are written. Without Node.js or the target the test says so and passes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hamel_codegen::Config;
use hamel_codegen::config::Language;
use hamel_codegen::scene::{self, BuiltScene, Scenes};
use hamel_codegen::spec::{self, Model};
use hamel_expr::rational_to_f64;
use hamel_program::program::{Point, Role};
use hamel_runtime::{Dop853, Integrator, Method, OfPositions, Options, Projected, System};
use hamel_tests::models::{Closed, Interpreted, State, model};
use hamel_tests::random::Random;

const TARGET: &str = "wasm32-unknown-unknown";
/// Points of each scene.
const N_ROUNDS: usize = 20;
const TOLERANCES: (f64, f64) = (1e-9, 1e-11);

/// What calls sine, cosine and square roots alone, which are the runtime's and the machine's own.
const SCENES: [(&str, &str); 4] = [
    ("heavy_top", "default"),
    ("snakeboard", "controlled"),
    ("rolling_disk", "default"),
    ("euler_disk", "default"),
];

/// A ball that falls, and bounces from the ground.
const BALL: &str = "model ball {
    param m = 1 where m > 0;
    param e = 3/4;
    coordinate z in real;
    lagrangian = 1/2*m*z_dot^2 - 9.81*m*z;
    event impact = z falling { then z_dot = -e*z_dot; }
    initial z = 2;
    initial z_dot = 0;
    scene bouncing { want rhs, energy, events; }
}";

/// A crank, a rod and a slider, whose guesses satisfy no equation.
const CRANK: &str = "model crank {
    param r = 0.3; param l = 0.9;
    coordinate theta in angle;
    coordinate phi in angle by r*sin(theta) + l*sin(phi) = 0;
    coordinate x in real by x = r*cos(theta) + l*cos(phi);
    lagrangian = theta_dot^2 + phi_dot^2 + x_dot^2 - 9.81*sin(theta);
    initial theta = 0.4; initial phi = 0.2; initial x = 0; initial theta_dot = 3;
    scene turning { want rhs, energy; }
}";

/// Numbers for a scene, and those that have to come out.
struct Case {
    module: String,
    input: Vec<f64>,
    expected: Vec<f64>,
    /// Numbers behind them that are known in closed form.
    exact: Vec<f64>,
}

fn is_there(program: &str, argument: &str) -> bool {
    let ran = Command::new(program).arg(argument).stdout(Stdio::null()).stderr(Stdio::null()).status();
    ran.is_ok_and(|status| status.success())
}

fn has_target() -> bool {
    let out = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    out.is_ok_and(|out| Path::new(String::from_utf8_lossy(&out.stdout).trim()).is_dir())
}

/// What the interpreter makes of the same numbers: parameters, then for each round inputs, time and state; in the end
/// the motion from the state of the model.
fn case(model: &Model, built: &BuiltScene) -> Case {
    let program = built.program();
    let mut random = Random(20_261_124);
    let mut numbers = |n: usize| (0..n).map(|_| random.number()).collect::<Vec<f64>>();
    let defaults: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let params: Vec<f64> =
        defaults.iter().zip(numbers(defaults.len())).map(|(x, r)| x * (1.0 + 0.05 * r)).collect();
    let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{}: {e}", model.name));
    let slots = &prepared[..program.prepare.slots.len()];
    let (mut input, mut expected) = (params.clone(), Vec::new());
    for _ in 0..N_ROUNDS {
        let (inputs, t, state) = (numbers(program.inputs.len()), numbers(1)[0], numbers(program.state.len()));
        input.extend(inputs.iter().chain([&t]).chain(&state));
        let prepared = [slots, &inputs].concat();
        let mut run = |role: &Role| {
            let Some(k) = program.function_idx(role) else { return };
            let mut out = vec![0.0; program.functions[k].results.len()];
            program.run_at(k, &params, &prepared, Point { t, state: &state, argument: &[] }, &mut out);
            expected.extend(out);
        };
        run(&Role::Rate);
        run(&Role::Energy);
        built.outputs().iter().for_each(|output| run(&Role::Output(output.name.clone())));
    }
    let system = Interpreted(built.prepare(&params).unwrap_or_else(|e| panic!("{}: {e}", model.name)));
    let mut exact = Vec::new();
    let start = scene::initial_state(model, built).unwrap_or_else(|e| panic!("{e}"));
    let start = start.filter(|_| program.inputs.is_empty());
    input.extend(start.iter().flatten());
    if model.name == "ball" {
        exact = bounced(&params);
    } else if let Some(start) = start {
        let options = Options::adaptive(TOLERANCES.0, TOLERANCES.1);
        match built.positions() {
            None => expected.extend(moved(&system, Dop853, start, options)),
            Some(layout) => {
                let system = Closed { interpreter: system.0, layout };
                let method = Projected::<_, 2, OfPositions>::onto_positions(Dop853);
                expected.extend(moved(&system, method, start, options));
                exact = closed();
            }
        }
    }
    Case { module: built.module_name(), input, expected, exact }
}

/// The state after two seconds.
fn moved<S: System<f64, State = State>>(
    system: &S,
    method: impl Method<f64, S>,
    start: Vec<f64>,
    options: Options<f64>,
) -> Vec<f64> {
    let mut solver = Integrator::new(system, method, 0.0, State(start), options).expect("a motion begins");
    solver.integrate_to(2.0).expect("a motion");
    solver.state().0.clone()
}

/// Where the crank is for what the driver gives.
fn closed() -> Vec<f64> {
    let (r, l, theta) = (0.5_f64, 0.8, 0.7_f64);
    let phi = std::f64::consts::PI + (r * theta.sin() / l).asin();
    vec![theta, phi, r * theta.cos() + l * phi.cos(), 1.0]
}

/// Height and velocity of the ball after two seconds, bounce by bounce.
fn bounced(params: &[f64]) -> Vec<f64> {
    let (e, g) = (params[1], 9.81_f64);
    let (mut t, mut v) = ((2.0 * 2.0 / g).sqrt(), e * (2.0 * 2.0 * g).sqrt());
    while t + 2.0 * v / g < 2.0 {
        (t, v) = (t + 2.0 * v / g, e * v);
    }
    let rest = 2.0 - t;
    vec![v * rest - g * rest * rest / 2.0, v - g * rest]
}

/// What calls one module: numbers from one file, and those that come out to another one.
const DRIVER: &str = "
import { readFileSync, writeFileSync } from 'node:fs';
const [wasm, script, input, output, rounds, rtol, atol] = process.argv.slice(2);
const { load, names } = await import(script);
const system = await load(readFileSync(wasm));
const bytes = readFileSync(input);
const given = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
let at = 0;
const take = (array) => { for (let k = 0; k < array.length; k++) array[k] = given[at++]; };
const out = [];
if (names.params.length !== system.params.length || names.state.length !== system.state.length) throw new Error('names');
const start = Float64Array.from(system.state);
take(system.params);
system.prepare();
for (let round = 0; round < Number(rounds); round++) {
  take(system.inputs);
  const t = given[at++];
  take(system.state);
  out.push(...system.rhs(t));
  const energy = system.energy(t);
  if (energy !== undefined) out.push(energy);
  const outputs = system.outputs(t);
  if (outputs.length !== names.outputs.length) throw new Error('outputs');
  out.push(...outputs);
}
if (at < given.length) {
  take(system.state);
  if (system.state.some((x, k) => !Object.is(x, start[k]))) console.log('another initial state');
  out.push(...system.integrate(0, 2, { rtol: Number(rtol), atol: Number(atol) }));
  if (system.time !== 2) throw new Error('time');
}
if (system.exports.consistent) {
  system.params.set([0.5, 0.8]);
  system.prepare();
  system.state.set([0.7, 3, 0, 1]);
  out.push(...system.consistent());
  system.params.set([3, 0.8]);
  system.prepare();
  system.state.set([1, 3, 5, 2]);
  let told = 'nothing';
  try { system.consistent(); } catch (error) { told = error.message; }
  if (!told.includes('between coordinates')) throw new Error(`a crank that is too long: ${told}`);
  if (system.state.join() !== '1,3,5,2') throw new Error(`${system.state}`);
}
system.params[0] = NaN;
let told = 'nothing';
try { system.prepare(); } catch (error) { told = error.message; }
if (!told.includes('finite')) throw new Error(`a parameter that is no number: ${told}`);
writeFileSync(output, Buffer.from(Float64Array.from(out).buffer));
";

/// Compiles the modules in a crate of their own, each as an example, and returns the folder of what came out.
fn compile(folder: &Path, modules: &[String]) -> PathBuf {
    let runtime = Path::new(env!("CARGO_MANIFEST_DIR")).join("../runtime");
    let mut manifest = format!(
        "[package]\nname = \"wasm\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n[lib]\npath = \"empty.rs\"\n\n\
         [dependencies]\nhamel-runtime = {{ path = {:?} }}\n",
        runtime.canonicalize().expect("the runtime is there")
    );
    for module in modules {
        let _ = write!(
            manifest,
            "\n[[example]]\nname = \"{module}\"\npath = \"{module}_wasm.rs\"\ncrate-type = [\"cdylib\"]\n"
        );
    }
    std::fs::write(folder.join("Cargo.toml"), manifest).expect("a manifest");
    std::fs::write(folder.join("empty.rs"), "").expect("a library");
    let target = folder.join("target");
    let out = Command::new("cargo")
        .args(["build", "--examples", "--offline", "--target", TARGET])
        .current_dir(folder)
        .env("CARGO_TARGET_DIR", &target)
        .env("RUSTFLAGS", "-D warnings")
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "1")
        .output()
        .expect("cargo starts");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    target.join(TARGET).join("debug/examples")
}

/// Runs the JavaScript of the book.
fn run_book(folder: &Path, compiled: &Path) {
    let page = include_str!("../../docs/book/wasm.md");
    let block =
        page.split_once("```js\n").and_then(|(_, rest)| rest.split_once("```")).expect("a block of js").0;
    std::fs::copy(compiled.join("heavy_top.wasm"), folder.join("heavy_top.wasm")).expect("a module");
    // The energy stays, and the time is the end.
    let check = "const drift = Math.abs(top.energy(1) - energy);\n\
        if (top.time !== 1 || !Number.isFinite(spin) || !(drift < 1e-7 * Math.abs(energy))) {\n  \
            throw new Error(`${top.time} ${spin} ${drift}`);\n}\n";
    let text = format!("{block}{check}");
    std::fs::write(folder.join("book.mjs"), text).expect("a script");
    let out = Command::new("node").current_dir(folder).arg("book.mjs").output().expect("node starts");
    assert!(out.status.success() && out.stdout.is_empty(), "{out:?}");
}

#[test]
fn scenes_in_webassembly_have_the_bits_of_the_interpreter() {
    if !is_there("node", "--version") || !has_target() {
        println!("skipped: Node.js or the target {TARGET} is not installed");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wasm");
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    let mut cases = Vec::new();
    let ball = spec::parse("ball.hamel", BALL).unwrap_or_else(|e| panic!("{e}"));
    let crank = spec::parse("crank.hamel", CRANK).unwrap_or_else(|e| panic!("{e}"));
    let models = SCENES.map(|(name, scene)| (model(name), scene));
    let own = [(&ball, "bouncing"), (&crank, "turning")];
    for (model, scene) in models.iter().map(|(model, scene)| (model, *scene)).chain(own) {
        let mut config = Config::new();
        config.language(Language::Wasm).scenes(&model.name, [scene]);
        let bundle = config.generate(std::slice::from_ref(model)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(bundle.files.len(), 3);
        for (name, text) in &bundle.files {
            std::fs::write(folder.join(name), text).expect("a file for tests");
        }
        let mut scenes = Scenes::new(model).for_language(Language::Wasm);
        let built = scenes.build_all(&[scene.to_owned()]).unwrap_or_else(|e| panic!("{e}"));
        cases.push(case(model, &built[0]));
    }
    let modules: Vec<String> = cases.iter().map(|case| case.module.clone()).collect();
    let compiled = compile(&folder, &modules);
    std::fs::write(folder.join("driver.mjs"), DRIVER).expect("a driver");
    run_book(&folder, &compiled);
    for Case { module, input, expected, exact } in &cases {
        let files = ["in", "out"].map(|ending| folder.join(format!("{module}.{ending}")));
        let bytes: Vec<u8> = input.iter().flat_map(|x| x.to_le_bytes()).collect();
        std::fs::write(&files[0], bytes).expect("numbers");
        let out = Command::new("node")
            .current_dir(&folder)
            .args(["driver.mjs".into(), compiled.join(format!("{module}.wasm"))])
            .arg(format!("./{module}.mjs"))
            .args(&files)
            .args([N_ROUNDS.to_string(), TOLERANCES.0.to_string(), TOLERANCES.1.to_string()])
            .output()
            .expect("node starts");
        assert!(out.status.success() && out.stdout.is_empty(), "{module}: {out:?}");
        let found = std::fs::read(&files[1]).expect("numbers come out");
        let found: Vec<f64> = found.as_chunks::<8>().0.iter().map(|x| f64::from_le_bytes(*x)).collect();
        assert_eq!(found.len(), expected.len() + exact.len(), "{module}");
        for (found, exact) in found[expected.len()..].iter().zip(exact) {
            // Bounces are located to rounding, and the method is exact for parabolas; equations are met to rounding.
            assert!((found - exact).abs() < 1e-12, "{module}: {found}, exactly {exact}");
        }
        for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
            let same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
            assert!(same, "{module}, number {k}: {found}, interpreted {expected}");
        }
        let finite = expected.iter().filter(|x| x.is_finite()).count();
        assert!(2 * finite > expected.len(), "{module}: {finite} of {} numbers are finite", expected.len());
        println!("{module}: {} numbers", expected.len());
    }
}
