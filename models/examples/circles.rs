//! Time and error with angles as numbers and as points of circles within the steps, side by side, as CSV:
//! `cargo run --release -p hamel-models --example circles`.

use std::hint::black_box;
use std::time::Instant;

use hamel_models::generated::{euler_disk, euler_disk_minimal, snakeboard, two_arm_satellite};
use hamel_runtime::{
    Circles, Error, F64x4, Gbs14, Integrator, Method, OnCircles, Options, OverScalar, Scene, System, Vern9,
};

/// Time to reach.
const T_END: f64 = 5.0;
/// Solutions of which the fastest counts: the others were interrupted. All ways take turns.
const ROUNDS: u32 = 300;

type Solution<const N: usize> = Result<([f64; N], u64), Error>;

fn solve<S, M, const N: usize>(system: &S, method: M, start: [f64; N], tolerance: f64) -> Solution<N>
where
    S: System<f64, State = [f64; N]>,
    M: Method<f64, S>,
{
    let options = Options::adaptive(tolerance, tolerance);
    let mut solver = Integrator::new(system, method, 0.0, black_box(start), options)?;
    solver.integrate_to(T_END)?;
    Ok((*solver.state(), solver.stats().steps + solver.stats().rejected))
}

const WAYS: [&str; 4] = ["vern9", "vern9 on circles", "gbs14", "gbs14 on circles"];

fn measure<S, const N: usize>(start: [f64; N]) -> Result<(), Box<dyn std::error::Error>>
where
    S: Scene<f64> + Circles<f64, Inside: OverScalar<F64x4>> + OverScalar<F64x4, State = [f64; N]>,
{
    let defaults: Vec<f64> = S::INFO.params.iter().map(|p| p.default).collect();
    let system = S::prepare(&defaults)?;
    let (exact, _) = solve(&system, Vern9, start, 3e-15)?;
    for exponent in 4..=13 {
        let tolerance = 10.0_f64.powi(-exponent);
        let run = |way: usize| match way {
            0 => solve(&system, Vern9, start, tolerance),
            1 => solve(&system, OnCircles::new(Vern9), start, tolerance),
            2 => solve(&system, Gbs14, start, tolerance),
            _ => solve(&system, OnCircles::new(Gbs14), start, tolerance),
        };
        let mut us = [f64::INFINITY; WAYS.len()];
        for _ in 0..ROUNDS {
            for (way, us) in us.iter_mut().enumerate() {
                let clock = Instant::now();
                black_box(run(way)?);
                *us = us.min(1e6 * clock.elapsed().as_secs_f64());
            }
        }
        for (way, us) in us.into_iter().enumerate() {
            let (last, steps) = run(way)?;
            let distances = last.iter().zip(exact).map(|(x, y)| (x - y).abs() / (1.0 + y.abs()));
            let error = distances.fold(0.0_f64, f64::max);
            let (model, scene, way) = (S::INFO.model, S::INFO.scene, WAYS[way]);
            println!("{model},{scene},{way},{tolerance:.0e},{error:.2e},{steps},{us:.2}");
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("model,scene,method,tolerance,error,steps,us");
    measure::<euler_disk::Prepared, 5>([1.1, 0.3, 0.0, 1.0, -7.0])?;
    measure::<euler_disk_minimal::Prepared, 4>([1.1, 0.0, 1.0, -7.0])?;
    measure::<snakeboard::Prepared, 5>([0.25, 0.239501, 2.639219, -0.114627, -0.068491])?;
    measure::<two_arm_satellite::Prepared, 7>([0.4, -0.3, 0.2, 0.5, 0.6, -0.9, 1.1])?;
    Ok(())
}
