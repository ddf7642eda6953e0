//! Many trajectories: lanes and threads beside one trajectory at a time, by this runtime and by `ode_solvers`.
//!
//! ```text
//! RUSTFLAGS="-C target-cpu=x86-64-v3" cargo run --release -p hamel-adapters --features ode_solvers --example throughput
//! ```
//!
//! Every way integrates the same trajectories by the method of Dormand and Prince of eighth order with the same
//! tolerances, in turn, and the fastest of all rounds counts: microseconds a trajectory of the plain loop, and how
//! often its time holds that of another way. None of the systems depends on time explicitly, which the `Dop853` of
//! `ode_solvers` 0.6.2 gets wrong. Errors are the largest ones at the end, against tolerances a thousand times tighter.

use std::time::Instant;

use hamel_adapters::Adapter;
use hamel_ensemble::{Dop853, Ensemble, F64x4, F64x8, Family, Lanes, Options, family};
use hamel_runtime::{Method, Scene};
use ode_solvers::{OutputType, SVector};
use rayon::{ThreadPool, ThreadPoolBuilder};

family! { HeavyTop, 6 = hamel_models::generated::heavy_top::Prepared }
family! { EulerDisk, 5 = hamel_models::generated::euler_disk::Prepared }
family! { ChaplyginBall, 6 = hamel_models::generated::chaplygin_ball::Prepared }
family! { TwoArmSatellite, 7 = hamel_models::generated::two_arm_satellite::Prepared }

const TRAJECTORIES: usize = 64;
const ROUNDS: usize = 200;
const RTOL: f64 = 1e-9;
const ATOL: f64 = 1e-11;

/// States at the end, and the microseconds that each took.
type Outcome<const N: usize> = (Vec<[f64; N]>, f64);

fn timed<const N: usize>(run: impl FnOnce() -> Vec<[f64; N]>) -> Outcome<N> {
    let clock = Instant::now();
    let ends = std::hint::black_box(run());
    (ends, 1e6 * clock.elapsed().as_secs_f64() / TRAJECTORIES as f64)
}

fn ensemble<F: Family<N>, L: Lanes, const N: usize>(
    pool: &ThreadPool,
    options: Options<f64>,
    params: &[Vec<f64>],
    initial: &[[f64; N]],
    end: f64,
) -> Outcome<N>
where
    Dop853: Method<f64, F::Of<f64>> + Method<L, F::Of<L>>,
{
    timed(|| {
        let ensemble = Ensemble::new(Dop853, options).with_lanes::<L>();
        let results =
            pool.install(|| ensemble.run::<F, N>(params, initial, end, &[])).expect("one parameter set");
        assert!(results.iter().all(|t| t.stop.is_none()), "{:?}", results.iter().find(|t| t.stop.is_some()));
        results.into_iter().map(|t| t.state).collect()
    })
}

fn by_ode_solvers<F: Family<N>, const N: usize>(
    params: &[Vec<f64>],
    initial: &[[f64; N]],
    end: f64,
) -> Outcome<N> {
    let scene = F::Of::<f64>::prepare(&params[0]).expect("the published values");
    timed(|| {
        let last = |y0: &[f64; N]| {
            let start = SVector::from(*y0);
            let mut solver = ode_solvers::Dop853::new(Adapter(&scene), 0.0, end, end, start, RTOL, ATOL);
            solver.set_output(OutputType::Sparse);
            solver.integrate().expect("a solution");
            solver.y_out().last().expect("the end").data.0[0]
        };
        initial.iter().map(last).collect()
    })
}

fn measure<F: Family<N>, const N: usize>(one: &ThreadPool, all: &ThreadPool, end: f64)
where
    Dop853: Method<f64, F::Of<f64>> + Method<F64x4, F::Of<F64x4>> + Method<F64x8, F::Of<F64x8>>,
{
    let info = <F::Of<f64> as Scene<f64>>::INFO;
    let params = [info.params.iter().map(|p| p.default).collect::<Vec<f64>>()];
    // Inside (0, 1): every coordinate is in its domain there.
    let initial: Vec<[f64; N]> = (0..TRAJECTORIES)
        .map(|k| std::array::from_fn(|c| 0.4 + 0.2 * ((7 * k + 3 * c) % 11) as f64 / 11.0))
        .collect();
    let options = Options::adaptive(RTOL, ATOL);
    let tighter = Options::adaptive(1e-3 * RTOL, 1e-3 * ATOL);
    let (reference, _) = ensemble::<F, f64, N>(all, tighter, &params, &initial, end);
    let mut best = [f64::INFINITY; 6];
    let mut errors = [0.0; 6];
    for _ in 0..ROUNDS {
        let outcomes = [
            ensemble::<F, f64, N>(one, options, &params, &initial, end),
            ensemble::<F, F64x4, N>(one, options, &params, &initial, end),
            ensemble::<F, F64x8, N>(one, options, &params, &initial, end),
            ensemble::<F, f64, N>(all, options, &params, &initial, end),
            ensemble::<F, F64x4, N>(all, options, &params, &initial, end),
            by_ode_solvers::<F, N>(&params, &initial, end),
        ];
        for (k, (ends, time)) in outcomes.into_iter().enumerate() {
            best[k] = best[k].min(time);
            let differences =
                ends.iter().flatten().zip(reference.iter().flatten()).map(|(x, y)| (x - y).abs());
            errors[k] = differences.fold(0.0, f64::max);
        }
    }
    print!("{:18}{:9.2}", info.model, best[0]);
    best[1..].iter().for_each(|time| print!("{:9.2}", best[0] / time));
    println!("{:10.0e}{:9.0e}{:9.0e}", errors[0], errors[1], errors[5]);
}

fn main() {
    let pool = |threads: usize| ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let (one, all) = (pool(1), pool(0));
    let threads = all.current_num_threads();
    println!("{:18}{:>9}{:^45}{:>28}", "dop853", "us", "times as fast as one at a time", "error at the end");
    println!(
        "{:18}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>9}{:>9}",
        "lanes x threads",
        "1x1",
        "4x1",
        "8x1",
        format!("1x{threads}"),
        format!("4x{threads}"),
        "ode_s.",
        "1",
        "4",
        "ode_s."
    );
    // As long as a few microseconds last; the disk before it falls flat.
    measure::<HeavyTop, 6>(&one, &all, 4.0);
    measure::<EulerDisk, 5>(&one, &all, 0.25);
    measure::<ChaplyginBall, 6>(&one, &all, 4.0);
    measure::<TwoArmSatellite, 7>(&one, &all, 1.0);
}
