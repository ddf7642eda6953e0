//! Work and errors of compositions of exact flows beside other methods on Lie-Poisson systems, and what becomes of
//! their Casimirs in ten million steps.
//!
//! ```sh
//! RUSTFLAGS="-C target-cpu=x86-64-v3" cargo run --release -p hamel-models --example splitting
//! RUSTFLAGS="-C target-cpu=x86-64-v3" cargo run --release -p hamel-models --example splitting -- long
//! ```
//!
//! The first table has the largest error of the energy over 1000 units of time, relative to the energy, and the
//! processor's time that a unit takes (on Linux; the time that passes elsewhere); the second one the largest change of
//! a Casimir relative to its value after 1e7 steps.

use std::time::Instant;

use hamel_models::generated::{free_rigid_body_splitting, heavy_top_splitting, kirchhoff_body_splitting};
use hamel_runtime::{
    ExactFlows, F64x4, Gauss8, Gauss16, Integrator, Invariants, Method, Options, OverScalar, Projected,
    Scene, Splitting2, Splitting4, Splitting6, System, Vern9,
};

/// Length of the motions in the first table.
const LENGTH: f64 = 1000.0;
/// Steps in the second table.
const STEPS: u64 = 10_000_000;

/// What a run left: the largest error of the energy, of a Casimir, and nanoseconds of a unit of time.
struct Outcome {
    energy: f64,
    casimir: f64,
    ns: f64,
}

/// Nanoseconds that the program has run for, which other programs do not change as they change the time that passes.
fn run_time(since: Instant) -> f64 {
    let own = std::fs::read_to_string("/proc/self/schedstat").ok();
    let own = own.and_then(|text| text.split_whitespace().next()?.parse().ok());
    own.unwrap_or_else(|| 1e9 * since.elapsed().as_secs_f64())
}

/// Values of the invariants at a state, without the energy.
fn casimirs<S: Scene<f64>>(scene: &S, y: &S::State) -> Vec<f64> {
    let mut values = vec![0.0; S::N_INVARIANTS];
    scene.invariants_of(0.0, y, &mut values);
    let own = S::INFO.outputs.iter().find(|o| o.name == "invariants").map_or(&[][..], |o| o.components);
    let pairs = own.iter().zip(values);
    pairs.filter(|(name, _)| **name != "energy").map(|(_, value)| value).collect()
}

fn run<S: Scene<f64>, M: Method<f64, S>>(
    scene: &S,
    method: M,
    start: S::State,
    options: Options<f64>,
    steps: Option<u64>,
) -> Result<Outcome, Box<dyn std::error::Error>> {
    let energy = |y: &S::State| scene.energy_of(0.0, y).unwrap_or(f64::NAN);
    let (first, kept) = (energy(&start), casimirs(scene, &start));
    let mut solver = Integrator::new(scene, method, 0.0, start.clone(), options)?;
    let mut largest = 0.0_f64;
    let clock = Instant::now();
    let begin = run_time(clock);
    match steps {
        Some(steps) => {
            for _ in 0..steps {
                let _ = solver.step_towards(1e12)?;
            }
        }
        None => solver.integrate_to(LENGTH)?,
    }
    let ns = (run_time(clock) - begin) / solver.t();
    let errors = kept.iter().zip(casimirs(scene, solver.state()));
    let casimir = errors.fold(0.0_f64, |max, (before, after)| max.max(((after - before) / before).abs()));
    if steps.is_none() {
        // Once more, as looking at every step takes time of its own.
        let mut solver = Integrator::new(scene, method, 0.0, start, options)?;
        while !solver.step_towards(LENGTH)?.reached() {
            largest = largest.max((energy(solver.state()) / first - 1.0).abs());
        }
    }
    largest = largest.max((energy(solver.state()) / first - 1.0).abs());
    Ok(Outcome { energy: largest, casimir, ns })
}

fn measure<S, const N: usize, const K: usize>(
    name: &str,
    scene: &S,
    start: [f64; N],
    is_long: bool,
) -> Result<(), Box<dyn std::error::Error>>
where
    S: Scene<f64> + System<f64, State = [f64; N]> + ExactFlows<f64> + Invariants<f64, K> + OverScalar<F64x4>,
{
    let say = |method: &str, step: String, outcome: Outcome| {
        let Outcome { energy, casimir, ns } = outcome;
        println!("| {name} | {method} | {step} | {ns:.0} | {energy:.1e} | {casimir:.1e} |");
    };
    if is_long {
        let (h, options, steps) = ("0.05", Options::fixed(0.05), Some(STEPS));
        say("splitting2", h.into(), run(scene, Splitting2::new(), start, options, steps)?);
        say("splitting4", h.into(), run(scene, Splitting4::new(), start, options, steps)?);
        say("splitting6", h.into(), run(scene, Splitting6::new(), start, options, steps)?);
        // The energy, which steps have one near to of their own, is the last of the invariants.
        let onto_casimirs = Projected::<_, K>::onto_first(Splitting6::new(), K - 1);
        say("splitting6, projected", h.into(), run(scene, onto_casimirs, start, options, steps)?);
        say("gauss8", h.into(), run(scene, Gauss8::fixed_point(), start, options, steps)?);
        say("gauss16", h.into(), run(scene, Gauss16, start, options, steps)?);
        return Ok(());
    }
    for k in 2..=7 {
        let (h, options) = (format!("1/{}", 1 << k), Options::fixed(0.5_f64.powi(k)));
        say("splitting2", h.clone(), run(scene, Splitting2::new(), start, options, None)?);
        say("splitting4", h.clone(), run(scene, Splitting4::new(), start, options, None)?);
        say("splitting6", h.clone(), run(scene, Splitting6::new(), start, options, None)?);
        if k >= 3 {
            say("gauss8", h.clone(), run(scene, Gauss8::fixed_point(), start, options, None)?);
        }
        if (3..=5).contains(&k) {
            say("gauss16", h, run(scene, Gauss16, start, options, None)?);
        }
    }
    for k in [4, 6, 8, 10, 12] {
        let tolerance = 10.0_f64.powi(-k);
        let options = Options::adaptive(tolerance, tolerance);
        say("vern9", format!("tol 1e-{k}"), run(scene, Vern9, start, options, None)?);
        let projected = Projected::<_, K>::new(Vern9);
        say("vern9, projected", format!("tol 1e-{k}"), run(scene, projected, start, options, None)?);
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let is_long = std::env::args().nth(1).is_some_and(|word| word == "long");
    println!("| model | method | step | ns a unit of time | energy | Casimirs |\n|---|---|---|--:|--:|--:|");
    let body = free_rigid_body_splitting::Prepared::<f64>::new(&Default::default())?;
    measure::<_, 3, 2>("free_rigid_body", &body, [0.7, 2.1, 0.9], is_long)?;
    let top = heavy_top_splitting::Prepared::<f64>::new(&Default::default())?;
    measure::<_, 6, 3>("heavy_top", &top, [0.52, -0.51, 1.2, 0.0, 0.6, 0.8], is_long)?;
    let fish = kirchhoff_body_splitting::Prepared::<f64>::new(&Default::default())?;
    measure::<_, 6, 3>("kirchhoff_body", &fish, [1.04, -0.66, 0.21, 1.85, 0.46, -0.95], is_long)
}
