//! Long runs of the heavy top and the Chaplygin ball by Verner's method, with and without projection onto their
//! invariants:
//! `cargo run --release -p hamel-models --example projection -- 10000000`.

use hamel_models::generated::{chaplygin_ball_invariants, heavy_top_invariants};
use hamel_runtime::{Error, Integrator, Invariants, Method, Options, Projected, Scene, Vern9};

/// Prints the largest relative change of each invariant over `n_steps` steps, for every factor of ten.
fn run<const K: usize, const N: usize, S, M>(
    system: &S,
    what: &str,
    method: M,
    start: [f64; N],
    n_steps: u64,
) -> Result<(), Error>
where
    S: Scene<f64> + Invariants<f64, K, State = [f64; N]>,
    M: Method<f64, S>,
{
    let levels = system.values(0.0, &start);
    let mut solver = Integrator::new(system, method, 0.0, start, Options::fixed(0.02))?;
    let mut worst = [0.0_f64; K];
    let mut shown = 1000;
    for step in 1..=n_steps {
        let _ = solver.step_towards(f64::MAX)?;
        let values = system.values(solver.t(), solver.state());
        for (worst, (value, level)) in worst.iter_mut().zip(values.iter().zip(levels)) {
            *worst = worst.max(((value - level) / level).abs());
        }
        if step == shown || step == n_steps {
            let shown_worst = worst.map(|x| format!("{x:.1e}")).join(", ");
            println!("{} {what}, {step} steps: {shown_worst}", S::INFO.model);
            shown *= 10;
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let n_steps = std::env::args().nth(1).map_or(Ok(100_000), |n| n.parse())?;
    let top = heavy_top_invariants::Prepared::new(&Default::default())?;
    let ball = chaplygin_ball_invariants::Prepared::new(&Default::default())?;
    let (top_start, ball_start) = ([0.4, -0.3, 2.0, 0.0, 0.6, 0.8], [0.5, -1.0, 1.5, 0.0, 0.6, -0.8]);
    run(&top, "free", Vern9, top_start, n_steps)?;
    run(&top, "projected", Projected::<_, 3>::new(Vern9), top_start, n_steps)?;
    run(&ball, "free", Vern9, ball_start, n_steps)?;
    run(&ball, "projected", Projected::<_, 2>::new(Vern9), ball_start, n_steps)?;
    Ok(())
}
