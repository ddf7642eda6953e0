//! Measures right-hand sides of chains; compiled by one call of rustc and run by `cargo xtask bench scaling`.
//!
//! ```text
//! list                      one line a kernel: model/scene/kind and the number of lanes
//! check                     reads lines `<kernel>\t<state>..`, prints the derivative for each
//! time <rounds> <kernel>..  a line `round` after each round, then `<kernel> <min> <median> <chain>` in ns
//! call <n> <kernel>         sweeps n times over the inputs and prints the number of calls
//! ```
//!
//! Does not know: which right-hand sides there are.

mod kernel;
mod kernels;

use std::process::ExitCode;
use std::time::Duration;

use kernel::Kernel;

/// How long one round of one kernel takes.
const ROUND: Duration = Duration::from_micros(400);

fn select(names: &[String]) -> Result<Vec<Kernel>, String> {
    let mut all = kernels::kernels();
    let mut take = |name: &String| {
        let k = all.iter().position(|kernel| kernel.to_string() == *name);
        k.map(|k| all.swap_remove(k)).ok_or(format!("no kernel {name}"))
    };
    names.iter().map(&mut take).collect()
}

fn check(line: &str) -> Result<(), String> {
    let (kernel, state) = line.split_once('\t').ok_or(format!("no tab in {line}"))?;
    let kernel = select(&[kernel.to_owned()])?.remove(0);
    let state: Result<Vec<f64>, _> = state.split_whitespace().map(str::parse).collect();
    let state = state.map_err(|e| format!("{line}: {e}"))?;
    let params: Vec<f64> =
        kernel.info().map_or_else(Vec::new, |i| i.params.iter().map(|p| p.default).collect());
    let rates: Vec<String> = kernel.evaluate(&params, 0.0, &state).iter().map(f64::to_string).collect();
    println!("{}", rates.join(" "));
    Ok(())
}

fn run(arguments: &[String]) -> Result<(), String> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match *words {
        ["list"] => kernels::kernels().iter().for_each(|kernel| println!("{kernel} {}", kernel.lanes)),
        ["check"] => {
            for line in std::io::stdin().lines() {
                check(&line.map_err(|e| e.to_string())?)?;
            }
        }
        ["time", rounds, _, ..] => {
            let mut kernels = select(&arguments[2..])?;
            let rounds = rounds.parse().map_err(|e| format!("{rounds}: {e}"))?;
            let timings = kernel::time(&mut kernels, rounds, ROUND, || println!("round"));
            for (kernel, timing) in kernels.iter().zip(timings) {
                println!("{kernel} {} {} {}", timing.min, timing.median, timing.chain);
            }
        }
        ["call", n, _] => {
            let n = n.parse().map_err(|e| format!("{n}: {e}"))?;
            println!("{}", select(&arguments[2..])?[0].sweep(n));
        }
        _ => return Err("started by `cargo xtask bench scaling`, not by hand".into()),
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}
