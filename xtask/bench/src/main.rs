//! Measures right-hand sides for `cargo xtask bench rhs`; started by it, not by hand.
//!
//! ```text
//! hamel-bench list                            one line a kernel: model/scene/kind and the number of lanes
//! hamel-bench time <rounds> <kernel>..        a line `round` after each round, then `<kernel> <min> <median>` in ns
//! hamel-bench call <n> <kernel>               sweeps n times over the inputs and prints the number of calls
//! ```

use std::process::ExitCode;
use std::time::Duration;

use hamel_bench::{Kernel, kernel, kernels};

/// How long one round of one kernel takes.
const ROUND: Duration = Duration::from_micros(400);

fn select(names: &[String]) -> Result<Vec<Kernel>, String> {
    let mut all = kernels();
    let mut take = |name: &String| {
        let k = all.iter().position(|kernel| kernel.to_string() == *name);
        k.map(|k| all.swap_remove(k)).ok_or(format!("no kernel {name}"))
    };
    names.iter().map(&mut take).collect()
}

fn number(text: &str) -> Result<u64, String> {
    text.parse().map_err(|e| format!("{text}: {e}"))
}

fn run(arguments: &[String]) -> Result<(), String> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match *words {
        ["list"] => {
            for kernel in kernels() {
                println!("{kernel} {}", kernel.lanes);
            }
        }
        ["time", rounds, _, ..] => {
            let mut kernels = select(&arguments[2..])?;
            let rounds = number(rounds)?.max(1) as usize;
            let timings = kernel::time(&mut kernels, rounds, ROUND, || println!("round"));
            for (kernel, timing) in kernels.iter().zip(timings) {
                println!("{kernel} {} {}", timing.min, timing.median);
            }
        }
        ["call", n, _] => {
            let mut kernels = select(&arguments[2..])?;
            let n = number(n)?;
            println!("{}", kernels[0].sweep(n));
        }
        _ => return Err("started by `cargo xtask bench rhs`, not by hand".into()),
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("hamel-bench: {message}");
            ExitCode::FAILURE
        }
    }
}
