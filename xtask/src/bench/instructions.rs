//! Executed instructions of a call, by valgrind's callgrind.
//!
//! A kernel is swept over its inputs `n` and `2 n` times; the difference is free of start and end of the program.
//!
//! Does not know: which kernels there are, times.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::ProgressBar;

use super::kernel::Kernel;

/// Sweeps of the first run; the second makes twice as many.
const SWEEPS: u64 = 50;

/// Counts with valgrind.
pub(super) struct Counter;

impl Counter {
    /// Whether valgrind can be started; otherwise why nothing is counted.
    pub(super) fn find() -> Result<Counter, String> {
        match Command::new("valgrind").arg("--version").output() {
            Ok(output) if output.status.success() => Ok(Counter),
            _ => Err("instructions are not counted: valgrind is not installed, or is not in the path".into()),
        }
    }

    /// Instructions of one call of each kernel of a program; none where it ends in an error under valgrind.
    pub(super) fn count(&self, program: &Path, kernels: &[Kernel], bar: &ProgressBar) -> Vec<Option<f64>> {
        bar.set_message("counting instructions");
        // Counts do not depend on what else runs.
        let n_threads = std::thread::available_parallelism().map_or(1, usize::from).min(kernels.len().max(1));
        let next = AtomicUsize::new(0);
        let work = || {
            let mut done = Vec::new();
            loop {
                let k = next.fetch_add(1, Ordering::Relaxed);
                let Some(kernel) = kernels.get(k) else { return done };
                done.push((k, count_one(program, kernel)));
                bar.inc(1);
            }
        };
        let mut counts = vec![None; kernels.len()];
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..n_threads).map(|_| scope.spawn(work)).collect();
            for (k, count) in threads.into_iter().filter_map(|t| t.join().ok()).flatten() {
                counts[k] = count;
            }
        });
        counts
    }
}

fn count_one(program: &Path, kernel: &Kernel) -> Option<f64> {
    let (less, n_less) = run(program, kernel, SWEEPS)?;
    let (more, n_more) = run(program, kernel, 2 * SWEEPS)?;
    Some(more.checked_sub(less)? as f64 / n_more.checked_sub(n_less)? as f64)
}

/// Instructions of the whole program, and the calls that it made.
fn run(program: &Path, kernel: &Kernel, sweeps: u64) -> Option<(u64, u64)> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["call", &sweeps.to_string(), &kernel.name()])
        .output()
        .ok()?;
    let calls = String::from_utf8_lossy(&output.stdout).trim().parse().ok()?;
    output.status.success().then_some(())?;
    Some((collected(&String::from_utf8_lossy(&output.stderr))?, calls))
}

/// The number in callgrind's line `==1== Collected : 12345`.
fn collected(said: &str) -> Option<u64> {
    let line = said.lines().find_map(|line| line.split_once("Collected :"))?;
    line.1.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_number_of_callgrind_is_found() {
        let said =
            "==7== Events    : Ir\n==7== Collected : 1530954\n==7== \n==7== I   refs:      1,530,954\n";
        assert_eq!(super::collected(said), Some(1_530_954));
        assert_eq!(super::collected("==7== Illegal instruction\n"), None);
    }
}
