//! Time and error of the adaptive methods on scenes of different cost, as CSV:
//! `cargo run --release -p hamel-models --example methods`.

use std::hint::black_box;
use std::time::Instant;

use hamel_models::generated::{
    chaplygin_ball_taylor, euler_disk_taylor, heavy_top_taylor, snakeboard_taylor, two_arm_satellite_taylor,
};
use hamel_runtime::{
    Dop853, Error, F64x4, Gbs14, Integrator, Jet, Method, Options, OverScalar, Scene, System, Taylor, Tsit5,
    Vern9,
};

/// Time to reach.
const T_END: f64 = 5.0;
/// Solutions of which the fastest counts: the others were interrupted.
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
    Ok((*solver.state(), solver.stats().rhs_evals))
}

fn measure<S, const N: usize>(start: [f64; N]) -> Result<(), Box<dyn std::error::Error>>
where
    S: Scene<f64> + Jet<f64> + OverScalar<F64x4, State = [f64; N]>,
{
    let defaults: Vec<f64> = S::INFO.params.iter().map(|p| p.default).collect();
    let system = S::prepare(&defaults)?;
    let (exact, _) = solve(&system, Taylor::new(), start, 3e-15)?;
    for name in ["tsit5", "dop853", "vern9", "gbs14", "taylor"] {
        for half in 8..=28 {
            let tolerance = 10.0_f64.powf(-0.5 * f64::from(half));
            let run = || match name {
                "tsit5" => solve(&system, Tsit5, start, tolerance),
                "dop853" => solve(&system, Dop853, start, tolerance),
                "vern9" => solve(&system, Vern9, start, tolerance),
                "gbs14" => solve(&system, Gbs14, start, tolerance),
                _ => solve(&system, Taylor::new(), start, tolerance),
            };
            let (last, evaluations) = run()?;
            let distances = last.iter().zip(exact).map(|(x, y)| (x - y).abs() / (1.0 + y.abs()));
            let error = distances.fold(0.0_f64, f64::max);
            let mut us = f64::INFINITY;
            for _ in 0..ROUNDS {
                let clock = Instant::now();
                black_box(run()?);
                us = us.min(1e6 * clock.elapsed().as_secs_f64());
            }
            println!("{},{name},{tolerance:.2e},{error:.2e},{evaluations},{us:.2}", S::INFO.model);
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("model,method,tolerance,error,evaluations,us");
    measure::<snakeboard_taylor::Prepared, 5>([0.25, 0.239501, 2.639219, -0.114627, -0.068491])?;
    measure::<heavy_top_taylor::Prepared, 6>([0.4, -0.3, 2.0, 0.31, 0.21, 0.93])?;
    measure::<euler_disk_taylor::Prepared, 5>([1.1, 0.3, 0.0, 1.0, -7.0])?;
    measure::<chaplygin_ball_taylor::Prepared, 6>([0.5, -1.0, 1.5, 0.21, 0.31, -0.93])?;
    measure::<two_arm_satellite_taylor::Prepared, 7>([0.4, -0.3, 0.2, 0.5, 0.6, -0.9, 1.1])?;
    Ok(())
}
