//! The method that is fastest for a tolerance and a cost of the right-hand side, as measured.
//!
//! The measurements are in `docs/benchmarks/methods.csv`, made by
//! `cargo run --release -p hamel-models --example methods`; a test holds the rules against them. Symplectic methods and
//! projection are for whom asks for them: what they are good at is no matter of time and error.
//!
//! Does not know: scenes, how anything is integrated.

use super::method::MethodName;

/// Costs up to which a right-hand side is cheap, in the unit of [`hamel_codegen::program::Counts::cost`]: the steps'
/// own arithmetic costs as much, and series grow with the cost faster than values.
const CHEAP: u64 = 64;

/// The fastest method at a relative tolerance. `rhs_cost` is unknown for scenes of which only the compiled code is
/// there: they are taken for costly.
pub fn choose(rtol: f64, rhs_cost: Option<u64>, has_series: bool) -> MethodName {
    let is_cheap = rhs_cost.is_some_and(|cost| cost <= CHEAP);
    if is_cheap && has_series {
        return MethodName::Taylor;
    }
    let loosest_for_ninth_order = if is_cheap { 3e-11 } else { 3e-6 };
    if rtol > loosest_for_ninth_order { MethodName::Dop853 } else { MethodName::Vern9 }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::{CHEAP, choose};
    use crate::cache::Cache;
    use crate::model::Checked;
    use crate::run::interpreted;
    use crate::run::method::MethodName;
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
        let path = format!("{}/../models/specs/{name}.hamel", env!("CARGO_MANIFEST_DIR"));
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
            for has_series in [true, false] {
                for is_cheap in [true, false] {
                    // The geometric mean over the models of the class.
                    let mut means: BTreeMap<&str, f64> = BTreeMap::new();
                    for (_, of_model) in times.iter().filter(|(m, _)| (costs[*m] <= CHEAP) == is_cheap) {
                        let usable = of_model.iter().filter(|(method, _)| has_series || **method != "taylor");
                        usable.for_each(|(method, us)| *means.entry(method).or_default() += us.ln());
                    }
                    let n = if is_cheap { n_cheap } else { costs.len() - n_cheap } as f64;
                    let chosen = choose(bound, Some(if is_cheap { CHEAP } else { CHEAP + 1 }), has_series);
                    let best = means.values().copied().fold(f64::INFINITY, f64::min);
                    let lost = ((means[chosen.name()] - best) / n).exp();
                    assert!(
                        lost < 1.2,
                        "{bound:e}, cheap {is_cheap}: {chosen:?} takes {lost:.2} of the best"
                    );
                }
            }
        }
    }

    #[test]
    fn an_unknown_cost_is_taken_for_a_high_one() {
        for rtol in [1e-4, 1e-8, 1e-13] {
            assert_eq!(choose(rtol, None, true), choose(rtol, Some(10_000), true));
        }
        assert_eq!(choose(1e-10, Some(20), true), MethodName::Taylor);
    }
}
