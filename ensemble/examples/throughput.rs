//! Throughput of one core: four and eight lanes beside the scalar loop.
//!
//! ```text
//! RUSTFLAGS="-C target-cpu=x86-64-v3" cargo run --release -p hamel-ensemble --example throughput
//! ```
//!
//! Every way integrates the same trajectories with the same fixed steps, in turn, and the fastest of all rounds counts:
//! nanoseconds a step and trajectory, and how often the scalar loop's time holds that of the lanes.

use std::time::Instant;

use hamel_ensemble::{Dop853, Ensemble, F64x4, F64x8, Family, Lanes, Options, family};
use hamel_runtime::{Method, Scene};

family! { HeavyTop, 6 = hamel_models::generated::heavy_top::Prepared }
family! { EulerDisk, 5 = hamel_models::generated::euler_disk::Prepared }
family! { ChaplyginBall, 6 = hamel_models::generated::chaplygin_ball::Prepared }
family! { TwoArmSatellite, 7 = hamel_models::generated::two_arm_satellite::Prepared }

const TRAJECTORIES: usize = 64;
const STEPS: usize = 50;
const STEP: f64 = 1e-3;
const ROUNDS: usize = 40;

/// Nanoseconds a step and trajectory.
fn round<F: Family<N>, L: Lanes, const N: usize>(params: &[Vec<f64>], initial: &[[f64; N]]) -> f64
where
    Dop853: Method<f64, F::Of<f64>> + Method<L, F::Of<L>>,
{
    let ensemble = Ensemble::new(Dop853, Options::fixed(STEP)).with_lanes::<L>();
    let clock = Instant::now();
    let results = ensemble.run::<F, N>(params, initial, STEP * STEPS as f64, &[]);
    let seconds = clock.elapsed().as_secs_f64();
    let results = std::hint::black_box(results).expect("one parameter set");
    assert!(results.iter().all(|t| t.stop.is_none() && t.stats.steps as usize == STEPS), "{:?}", results[0]);
    1e9 * seconds / (TRAJECTORIES * STEPS) as f64
}

fn measure<F: Family<N>, const N: usize>()
where
    Dop853: Method<f64, F::Of<f64>> + Method<F64x4, F::Of<F64x4>> + Method<F64x8, F::Of<F64x8>>,
{
    let info = <F::Of<f64> as Scene<f64>>::INFO;
    let params = [info.params.iter().map(|p| p.default).collect::<Vec<f64>>()];
    // Inside (0, 1): every coordinate is in its domain there.
    let initial: Vec<[f64; N]> = (0..TRAJECTORIES)
        .map(|k| std::array::from_fn(|c| 0.4 + 0.2 * ((7 * k + 3 * c) % 11) as f64 / 11.0))
        .collect();
    let mut best = [f64::INFINITY; 3];
    for _ in 0..ROUNDS {
        best[0] = best[0].min(round::<F, f64, N>(&params, &initial));
        best[1] = best[1].min(round::<F, F64x4, N>(&params, &initial));
        best[2] = best[2].min(round::<F, F64x8, N>(&params, &initial));
    }
    let [scalar, four, eight] = best;
    println!(
        "{:18} {scalar:8.1} {four:8.1} {eight:8.1}   {:5.2} {:5.2}",
        info.model,
        scalar / four,
        scalar / eight
    );
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| {
        println!(
            "{:18} {:>8} {:>8} {:>8}   {:>5} {:>5}",
            "dop853", "scalar", "4 lanes", "8 lanes", "1:4", "1:8"
        );
        measure::<HeavyTop, 6>();
        measure::<EulerDisk, 5>();
        measure::<ChaplyginBall, 6>();
        measure::<TwoArmSatellite, 7>();
    });
}
