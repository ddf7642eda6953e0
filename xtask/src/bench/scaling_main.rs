//! Times one right-hand side; compiled and run by `cargo xtask bench scaling`.
//!
//! Prints nanoseconds of a call in the fastest round, and the bits of the result.

mod scene;

use std::hint::black_box;
use std::time::{Duration, Instant};

const N: usize = scene::INFO.state.len();
const ROUNDS: usize = 40;
const ROUND: Duration = Duration::from_micros(500);

fn main() -> Result<(), hamel_runtime::ParamError> {
    let system = scene::Prepared::<f64>::new(&scene::Params::default())?;
    let y: [f64; N] = std::array::from_fn(|k| 0.5 + 0.125 * (k % 7) as f64);
    let mut dy = [0.0; N];
    let mut call = |n: u32| {
        let clock = Instant::now();
        for _ in 0..n {
            system.rhs(0.0, black_box(&y), &mut dy);
            black_box(&mut dy);
        }
        clock.elapsed()
    };
    let mut n = 1;
    while call(n) < ROUND {
        n *= 2;
    }
    let best = (0..ROUNDS).map(|_| call(n)).min().unwrap_or_default();
    println!("{}", best.as_secs_f64() * 1e9 / f64::from(n));
    let bits: Vec<String> = dy.iter().map(|x| format!("{:x}", x.to_bits())).collect();
    println!("{}", bits.join(" "));
    Ok(())
}
