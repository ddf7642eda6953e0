//! The method that is fastest for a tolerance and a cost of the right-hand side, as measured.
//!
//! The measurements are in `docs/benchmarks/methods.csv`, made by
//! `cargo run --release -p hamel-models --example methods`; a test holds the rules against them. Symplectic methods and
//! projection are for whom asks for them: what they are good at is no matter of time and error.
//!
//! Does not know: scenes, how anything is integrated.

use super::method::MethodName;

/// Costs up to which a right-hand side is cheap, in the unit of [`hamel_program::program::Counts::cost`]: the steps'
/// own arithmetic costs as much.
const CHEAP: u64 = 64;

/// Tolerances from which on extrapolation in lanes can meet them.
const LEAST_FOR_LANES: f64 = 1e-14;

/// Tolerance from which on extrapolation is the fastest where trajectories are in the lanes and its rows are loops in
/// machine code. Microseconds of `dop853` and `gbs14` a trajectory to t = 10 on eight lanes with AVX-512, at 1e-10:
/// 19.6, 6.7 (`heavy_top`), 16.3, 9.5 (`chaplygin_ball`), 31.3, 21.1 (`two_arm_satellite`), 63.7, 41.8
/// (`double_spherical_pendulum`); at 1e-7: 10.0, 5.0; 8.7, 7.1; 15.5, 15.5; 30.1, 25.9; of the last two at 1e-6: 11.6,
/// 11.6; 23.9, 22.2; at 1e-5: 9.6, 10.4; 19.1, 19.1
/// (`hamel ensemble MODEL --spread NAME=0.01 --count 8000 --t-final 10 --threads 1 --rtol 1e-10 --method ..`).
const LOOSEST_FOR_ROWS: f64 = 1e-6;

/// What an integration is for, as far as the choice of a method depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// One trajectory, whose last state counts.
    End,
    /// One trajectory with states at times in between: each costs a method without continuous output a step.
    Samples,
    /// Several trajectories side by side, so that no lanes are left for one of them.
    Ensemble,
    /// The same where the last states count.
    EnsembleEnds,
}

impl Purpose {
    /// Of a trajectory with so many samples at equal distances, both ends included; one along which events are watched
    /// for is looked at between its steps as well.
    pub fn of(samples: usize, has_events: bool) -> Purpose {
        if samples <= 2 && !has_events { Purpose::End } else { Purpose::Samples }
    }

    /// Of trajectories side by side with so many samples each.
    pub fn of_ensemble(samples: usize) -> Purpose {
        if samples <= 2 { Purpose::EnsembleEnds } else { Purpose::Ensemble }
    }
}

/// The fastest method at a relative tolerance, whoever evaluates the scene.
///
/// Taylor series are for whom asks for them: scenes with loops over tables have them interpreted. Beside the choice for
/// motions with samples they take 0.9 of the time to the same error in the mean of the shipped models at the default
/// tolerances, and 1.4 and more on a tenth of them (`python python/benches/methods.py`, told in
/// `docs/book/integrators.md`).
pub fn choose(rtol: f64, rhs_cost: u64, purpose: Purpose) -> MethodName {
    let is_extrapolated = match purpose {
        Purpose::End => true,
        Purpose::EnsembleEnds => rtol <= LOOSEST_FOR_ROWS,
        Purpose::Samples | Purpose::Ensemble => false,
    };
    if is_extrapolated && rtol >= LEAST_FOR_LANES {
        return MethodName::Gbs14;
    }
    let loosest_for_ninth_order = if rhs_cost <= CHEAP { 3e-11 } else { 3e-6 };
    if rtol > loosest_for_ninth_order { MethodName::Dop853 } else { MethodName::Vern9 }
}

/// The method for so many steps that the errors of an energy that is conserved add up: they do with every method with
/// tolerances. A projection onto the invariants, if there are some, keeps the energy to rounding however long a motion
/// is; otherwise the method of which they are least. On `heavy_top` until 1e4, at the default tolerances, the energy
/// has moved by 9e-9 with `gbs14`, 7e-9 with `dop853`, 5e-10 with `taylor`, 2e-10 with `vern9` and 7e-16 with
/// `projected` (`hamel simulate heavy_top --t-final 10000 --method ..`).
pub fn choose_for_long(has_invariants: bool) -> MethodName {
    if has_invariants { MethodName::Projected } else { MethodName::Vern9 }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::{CHEAP, LEAST_FOR_LANES, Purpose, choose};
    use crate::cache::Cache;
    use crate::interpreted;
    use crate::method::MethodName;
    use crate::model::Checked;
    use crate::session::Session;

    const MEASURED: &str = include_str!("../../../docs/benchmarks/methods.csv");

    /// Microseconds by model and method of the fastest solution with an error of at most `bound`.
    fn fastest(bound: f64) -> BTreeMap<&'static str, BTreeMap<&'static str, f64>> {
        let mut times: BTreeMap<_, BTreeMap<_, f64>> = BTreeMap::new();
        for line in MEASURED.lines().filter(|line| !line.starts_with(['#', 'm'])) {
            let [model, method, _, error, _, us] = line.split(',').collect::<Vec<_>>()[..] else {
                panic!("{line}")
            };
            if error.parse::<f64>().unwrap() <= bound {
                let best = times.entry(model).or_default().entry(method).or_insert(f64::INFINITY);
                *best = best.min(us.parse().unwrap());
            }
        }
        times
    }

    fn rhs_cost(name: &str) -> u64 {
        let path = format!("{}/../../models/specs/{name}.hamel", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
        let model = Session::of_shipped(&[]).parse(name, &text).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        interpreted::build(&model, "taylor").unwrap_or_else(|e| panic!("{e}")).rhs_counts().cost()
    }

    #[test]
    fn the_choice_is_within_a_fifth_of_the_fastest_that_was_measured() {
        let costs: BTreeMap<&str, u64> = fastest(1.0).into_keys().map(|m| (m, rhs_cost(m))).collect();
        let n_cheap = costs.values().filter(|cost| **cost <= CHEAP).count();
        assert!(n_cheap >= 2 && costs.len() - n_cheap >= 2, "both classes are measured: {costs:?}");
        for exponent in 4..=13 {
            let bound = 10.0_f64.powi(-exponent);
            let times = fastest(bound);
            for purpose in [Purpose::End, Purpose::Samples] {
                for is_cheap in [true, false] {
                    let is_usable =
                        |method: &str| method != "taylor" && (purpose == Purpose::End || method != "gbs14");
                    // The geometric mean over the models of the class.
                    let mut means: BTreeMap<&str, f64> = BTreeMap::new();
                    for (_, of_model) in times.iter().filter(|(m, _)| (costs[*m] <= CHEAP) == is_cheap) {
                        let usable = of_model.iter().filter(|(method, _)| is_usable(method));
                        usable.for_each(|(method, us)| *means.entry(method).or_default() += us.ln());
                    }
                    let n = if is_cheap { n_cheap } else { costs.len() - n_cheap } as f64;
                    let cost = if is_cheap { CHEAP } else { CHEAP + 1 };
                    let chosen = choose(bound, cost, purpose);
                    let best = means.values().copied().fold(f64::INFINITY, f64::min);
                    let lost = ((means[chosen.name()] - best) / n).exp();
                    assert!(
                        lost < 1.2,
                        "{bound:e}, {purpose:?}, cheap {is_cheap}: {chosen:?} takes {lost:.2} of the best"
                    );
                }
            }
        }
    }

    #[test]
    fn lanes_are_taken_where_they_are_free_and_reach_the_tolerance() {
        for cost in [20, 10_000] {
            let chosen = |rtol, purpose| choose(rtol, cost, purpose);
            assert_eq!(chosen(1e-10, Purpose::of(0, false)), MethodName::Gbs14);
            assert_eq!(chosen(LEAST_FOR_LANES, Purpose::of(2, false)), MethodName::Gbs14);
            assert_ne!(chosen(1e-10, Purpose::of(3, false)), MethodName::Gbs14);
            assert_ne!(chosen(1e-10, Purpose::of(0, true)), MethodName::Gbs14);
            assert_ne!(chosen(1e-10, Purpose::of_ensemble(3)), MethodName::Gbs14);
            assert_eq!(chosen(1e-10, Purpose::of_ensemble(1)), MethodName::Gbs14);
            assert_ne!(chosen(1e-5, Purpose::of_ensemble(1)), MethodName::Gbs14);
            assert_ne!(chosen(9e-15, Purpose::of_ensemble(2)), MethodName::Gbs14);
            assert_ne!(chosen(9e-15, Purpose::End), MethodName::Gbs14);
        }
    }
}
