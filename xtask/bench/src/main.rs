//! Measures for `cargo xtask bench`; started by it, not by hand.
//!
//! ```text
//! hamel-bench list                            one line a kernel: model/scene/kind and the number of lanes
//! hamel-bench time <rounds> <kernel>..        a line `round` after each round, then
//!                                             `<kernel> <min> <median> <chain>` in ns
//! hamel-bench call <n> <kernel>               sweeps n times over the inputs and prints the number of calls
//! hamel-bench solvers                         names of the models whose integration can be timed
//! hamel-bench solve <rounds> <model> <t> <params> <initial> <final>
//!                                             `<name>=<value>` joined by commas; a line `round` after each round, then
//!                                             `<by>;<method>;<knob>;<error>;<evals>;<steps>;<ns>` a solution
//! hamel-bench fluids <rounds> <folder>        writes flows into the folder; a line `round` after each size and tolerance,
//!                                             and `<surface>;<n>;<by>;<ns>;<iterations>;<error>;<drift>`, then
//!                                             `long;<steps>;<step>;<drift>`
//! hamel-bench drift <steps> <model> <t> <params> <initial>
//!                                             `<name>=<value>` joined by commas; for each method a line `round` and
//!                                             lines `<method>;<step>;<ns>;<steps>;<rms>;<mean>;<invariants>`, the last
//!                                             of which is `-` for a scene that has none but the energy
//! hamel-bench energies <model> <params> <state>..
//!                                             `<name>=<value>` joined by commas; for each state a line with the error
//!                                             of its energy relative to that of the first one
//! hamel-bench nonholonomic <steps> <methods> <model> <params> <initial>
//!                                             methods joined by semicolons, `<name>=<value>` by commas; for each
//!                                             method and step a line `<method>;<knob>;<value>;<error>;<evals>;<ns>`
//!                                             `;<t>;<energy>;<trend>;<constraint>` whose last four are `-` for a run that did not reach its end, and the
//!                                             last one where nothing can violate it; then a line `round`
//! ```

#[cfg(any(feature = "integrators", feature = "drift", feature = "nonholonomic"))]
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

#[cfg(feature = "drift")]
use hamel_bench::drift;
#[cfg(feature = "nonholonomic")]
use hamel_bench::nonholonomic;
#[cfg(feature = "integrators")]
use hamel_bench::wp;
use hamel_bench::{Kernel, fluids, kernel, kernels};

/// How long one round of one kernel takes.
const ROUND: Duration = Duration::from_micros(400);
/// How long one round of one integration takes at least.
#[cfg(feature = "integrators")]
const ROUND_OF_SOLUTIONS: Duration = Duration::from_micros(100);

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

#[cfg(any(feature = "integrators", feature = "drift", feature = "nonholonomic"))]
fn numbers(text: &str) -> Result<BTreeMap<String, f64>, String> {
    let pair = |pair: &str| {
        let (name, value) = pair.split_once('=').ok_or(format!("{pair}: no ="))?;
        let value = value.parse::<f64>().map_err(|e| format!("{pair}: {e}"))?;
        Ok((name.to_owned(), value))
    };
    text.split(',').filter(|pair| !pair.is_empty()).map(pair).collect()
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
                println!("{kernel} {} {} {}", timing.min, timing.median, timing.chain);
            }
        }
        ["call", n, _] => {
            let mut kernels = select(&arguments[2..])?;
            let n = number(n)?;
            println!("{}", kernels[0].sweep(n));
        }
        ["fluids", rounds, folder] => {
            let rounds = u32::try_from(number(rounds)?).map_err(|e| e.to_string())?;
            fluids::measure(rounds, folder.as_ref(), |m| {
                let fluids::Measured { surface, n, tolerance, ns, iterations, error, drift } = m;
                let by = if tolerance == 0.0 { "hamel".into() } else { format!("hamel to {tolerance:e}") };
                println!("{surface};{n};{by};{ns};{iterations};{error:e};{drift:e}\nround");
            })?;
            for (steps, h, drift) in fluids::long_runs()? {
                println!("long;{steps};{h};{drift:e}\nround");
            }
        }
        #[cfg(feature = "drift")]
        ["drift", steps, model, t_end, params, initial] => {
            let t_end = t_end.parse::<f64>().map_err(|e| format!("{t_end}: {e}"))?;
            let (params, initial) = (numbers(params)?, numbers(initial)?);
            let motion = drift::Motion { model: model.to_owned(), params, initial, t_end };
            drift::measure(&motion, number(steps)?, |measured| {
                let drift::Measured { method, h, ns, errors } = measured;
                for drift::Error { steps, rms, mean, invariants } in errors {
                    let invariants =
                        invariants.map_or_else(|| "-".to_owned(), |change| format!("{change:e}"));
                    println!("{method};{h};{ns};{steps};{rms:e};{mean:e};{invariants}");
                }
                println!("round");
            })?;
        }
        #[cfg(feature = "drift")]
        ["energies", model, params, ..] => {
            let states = arguments[3..].iter().map(|s| numbers(s)).collect::<Result<Vec<_>, _>>()?;
            drift::errors(model, &numbers(params)?, &states)?.iter().for_each(|error| println!("{error:e}"));
        }
        #[cfg(feature = "nonholonomic")]
        ["nonholonomic", steps, methods, model, params, initial] => {
            let (params, initial) = (numbers(params)?, numbers(initial)?);
            let methods = methods.split(';').filter(|name| !name.is_empty()).map(str::to_owned).collect();
            let steps = number(steps)?;
            let case = nonholonomic::Case { model: model.to_owned(), params, initial, steps, methods };
            nonholonomic::measure(&case, |measured| {
                let nonholonomic::Measured { method, knob, error, evals, ns, run } = measured;
                let knob = match knob {
                    nonholonomic::Knob::Step(h) => format!("step;{h}"),
                    nonholonomic::Knob::Tolerance(tolerance) => format!("tolerance;{tolerance:e}"),
                };
                let run = match run {
                    Some(nonholonomic::Run { t, energy, trend, constraint }) => {
                        let constraint = constraint.map_or_else(|| "-".to_owned(), |c| format!("{c:e}"));
                        format!("{t};{energy:e};{trend:e};{constraint}")
                    }
                    None => "-;-;-;-".to_owned(),
                };
                println!("{method};{knob};{error:e};{evals};{ns};{run}");
            })?;
            println!("round");
        }
        #[cfg(feature = "integrators")]
        ["solvers"] => wp::MODELS.iter().for_each(|model| println!("{model}")),
        #[cfg(feature = "integrators")]
        [what @ ("solve" | "lanes"), rounds, model, t_end, params, initial, last] => {
            let t_end = t_end.parse::<f64>().map_err(|e| format!("{t_end}: {e}"))?;
            let (params, initial, last) = (numbers(params)?, numbers(initial)?, numbers(last)?);
            let problem = wp::Problem { model: model.to_owned(), params, t_end, initial };
            let mut solvers = wp::solvers(&problem)?;
            if what == "lanes" {
                solvers.keep_lanes();
            }
            let rounds = number(rounds)? as usize;
            for point in wp::time(&solvers, &last, rounds, ROUND_OF_SOLUTIONS, || println!("round"))? {
                let wp::Point { solver, knob, error, work, ns } = point;
                let wp::Solver { by, method, .. } = solvers.all[solver];
                println!("{by};{method};{knob:e};{error:e};{};{};{ns}", work.evals, work.steps);
            }
        }
        _ => return Err("started by `cargo xtask bench`, not by hand".into()),
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
