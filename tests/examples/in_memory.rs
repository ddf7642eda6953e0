//! Right-hand sides compiled in memory beside those that rustc compiled and the interpreter, as CSV:
//! `cargo run --release -p hamel-tests --example in_memory`.
//!
//! For each scene the time to compile all of its functions, on numbers and on four lanes, and of one call of its
//! right-hand side, in nanoseconds, the fastest of several rounds in which all take turns.

use std::hint::black_box;
use std::time::Instant;

use hamel_codegen::scene::BuiltScene;
use hamel_jit::Compiled;
use hamel_program::program::{Point, Role, Run};
use hamel_runtime::{F64x4, Scene, System};
use hamel_tests::models::build;
use hamel_tests::random::Random;

/// Rounds of which the fastest counts.
const ROUNDS: usize = 60;
/// States of a sweep.
const STATES: usize = 16;

/// Nanoseconds of a call, the fastest round.
#[derive(Clone, Copy)]
struct Fastest(f64);

impl Fastest {
    fn sweep(&mut self, n: usize, mut call: impl FnMut(usize)) {
        let clock = Instant::now();
        for _ in 0..n {
            (0..STATES).for_each(&mut call);
        }
        self.0 = self.0.min(1e9 * clock.elapsed().as_secs_f64() / (n * STATES) as f64);
    }
}

fn measure<S, W, const N: usize>(built: &BuiltScene) -> Result<(), Box<dyn std::error::Error>>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<F64x4> + System<F64x4, State = [F64x4; N]>,
{
    let program = built.program();
    let mut milliseconds = [f64::INFINITY; 2];
    for _ in 0..3 {
        for (fastest, on_lanes) in milliseconds.iter_mut().zip([false, true]) {
            let clock = Instant::now();
            Compiled::new(program)?.compile(on_lanes)?;
            *fastest = fastest.min(1e3 * clock.elapsed().as_secs_f64());
        }
    }
    let compiled = Compiled::new(program)?;
    let rates = program.function_idx(&Role::Rate).ok_or("a scene without rates")?;
    let params: Vec<f64> = S::INFO.params.iter().map(|p| p.default).collect();
    let wide: Vec<F64x4> = params.iter().copied().map(F64x4::splat).collect();
    let (scene, scene_on_lanes) = (black_box(S::prepare(&params)?), black_box(W::prepare(&wide)?));
    let prepared = program.prepare(&params)?;
    let prepared_on_lanes = program.prepare(&wide)?;
    let mut random = Random(20_261_123);
    let states: Vec<[f64; N]> = (0..STATES).map(|_| [(); N].map(|()| 0.5 + 0.45 * random.number())).collect();
    let states_on_lanes: Vec<[F64x4; N]> = states.iter().map(|y| y.map(F64x4::splat)).collect();
    let (mut dy, mut dy_on_lanes) = ([0.0; N], [F64x4::splat(0.0); N]);

    let [mut jit, mut rustc, mut interpreter, mut jit_on_lanes, mut rustc_on_lanes] =
        [Fastest(f64::INFINITY); 5];
    for _ in 0..ROUNDS {
        jit.sweep(200, |k| {
            let point = Point { t: 0.0, state: &states[k], argument: &[] };
            Run::run_at(&compiled, rates, &params, &prepared, point, black_box(&mut dy));
        });
        rustc.sweep(200, |k| scene.rhs(0.0, black_box(&states[k]), black_box(&mut dy)));
        interpreter.sweep(2, |k| {
            let point = Point { t: 0.0, state: &states[k], argument: &[] };
            program.run_at(rates, &params, &prepared, point, black_box(&mut dy));
        });
        jit_on_lanes.sweep(100, |k| {
            let point = Point { t: F64x4::splat(0.0), state: &states_on_lanes[k], argument: &[] };
            compiled.run_at(rates, &wide, &prepared_on_lanes, point, black_box(&mut dy_on_lanes));
        });
        rustc_on_lanes.sweep(100, |k| {
            scene_on_lanes.rhs(
                F64x4::splat(0.0),
                black_box(&states_on_lanes[k]),
                black_box(&mut dy_on_lanes),
            );
        });
    }
    println!(
        "{},{},{},{:.2},{:.2},{:.1},{:.1},{:.1},{:.1},{:.1}",
        S::INFO.model,
        S::INFO.scene,
        program.functions[rates].instructions.len(),
        milliseconds[0],
        milliseconds[1],
        jit.0,
        rustc.0,
        interpreter.0,
        jit_on_lanes.0,
        rustc_on_lanes.0
    );
    Ok(())
}

macro_rules! measure_all {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        fn measure_every_scene(selected: impl Fn(&str, &str) -> bool) -> Result<(), Box<dyn std::error::Error>> {
            use hamel_models::generated;
            $(if selected($model, $scene) {
                measure::<generated::$module::Prepared, generated::$module::Prepared<F64x4>, $n>(
                    &build($model, $scene),
                )?;
            })*
            Ok(())
        }
    };
}

hamel_models::for_each_scene!(measure_all);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("model,scene,operations,compile_ms,compile_with_lanes_ms,jit,rustc,interpreter,jit_x4,rustc_x4");
    let names: Vec<String> = std::env::args().skip(1).collect();
    measure_every_scene(|model, _| names.is_empty() || names.iter().any(|name| name == model))
}
