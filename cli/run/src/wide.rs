//! Steps of explicit methods on lanes, their sums in the widest registers of the processor.
//!
//! Every number has the bits that the method itself gives: [`WideSums`] promises the bits of each operation, and their
//! order is that of the runtime.
//!
//! Does not know: scenes, how steps are chosen.

use hamel_runtime::{Error, Estimate, Method, Options, Point, Step, System, Tableau};

use super::dynamics::{PreparedLanes, Several, VecState};
use super::machine::{Registers, Slopes, WideSums};

/// An explicit method by its tableau.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wide {
    tableau: &'static Tableau,
    sums: WideSums,
}

impl Wide {
    /// The method with a tableau, in these registers at most, where the processor has wider ones than the program was
    /// compiled for.
    pub(crate) fn up_to(most: Registers, tableau: &'static Tableau) -> Option<Wide> {
        let sums = WideSums::up_to(most)?;
        Some(Wide { tableau, sums })
    }
}

/// What a method keeps from one step to the next.
pub(crate) struct Storage<L> {
    wide: Wide,
    /// Derivatives at the stages but the first.
    stages: Vec<VecState<L>>,
    /// Those at the ends of the step, for its error.
    ends: [VecState<L>; 2],
}

impl<'a, L: Several> Method<L, PreparedLanes<'a, L>> for Wide {
    const TABLEAU: &'static Tableau = Tableau::CHOSEN;

    type Storage = Storage<L>;

    fn tableau(&self) -> &'static Tableau {
        self.tableau
    }

    fn storage(&self, _: &PreparedLanes<'a, L>, _: L, y0: &VecState<L>, _: &Options<L>) -> Storage<L> {
        let zeros = VecState(vec![L::ZERO; y0.0.len()]);
        let stages = vec![zeros.clone(); self.tableau.n_stored()];
        Storage { wide: *self, stages, ends: [zeros.clone(), zeros] }
    }

    fn renew(&self, _: &mut Storage<L>, _: &PreparedLanes<'a, L>, _: L, _: &VecState<L>, _: &Options<L>) {
        // Every stage of a step is computed before it is read.
    }

    fn stages(storage: &Storage<L>) -> &[VecState<L>] {
        &storage.stages
    }

    fn stages_mut(storage: &mut Storage<L>) -> &mut [VecState<L>] {
        &mut storage.stages
    }

    fn advance(
        &self,
        storage: &mut Storage<L>,
        step: &mut Step<'_, L, PreparedLanes<'a, L>>,
    ) -> Result<(), Error> {
        let (Wide { tableau, sums }, n_stages) = (*self, self.tableau.n_stages());
        let (from, h) = (step.from, step.h);
        let (slope, y) = (&from.slope, from.state.0.as_slice());
        storage.ends[0].0.copy_from_slice(&slope.0);
        for (i, (row, node)) in tableau.stages.iter().zip(tableau.nodes).enumerate().skip(1) {
            let (known, next) = storage.stages.split_at_mut(i - 1);
            let k = Slopes { n_stages, first: slope, stored: known, last: slope };
            sums.stage((row, &k), h, y, &mut step.work.0);
            step.system.rhs(step.t + node.get::<L>() * h, step.work, &mut next[0]);
        }
        // The weights do not refer to the derivative at the end, which is not known yet.
        let k = Slopes { n_stages, first: slope, stored: &storage.stages, last: slope };
        let to = (step.to.state.0.as_mut_slice(), step.to.residue.0.as_mut_slice());
        sums.advance((tableau.weights, &k), h, (y, &from.residue.0), to);
        *step.rhs_evals += n_stages as u64 - 1;
        Ok(())
    }

    fn slope(
        &self,
        storage: &mut Storage<L>,
        system: &PreparedLanes<'a, L>,
        t: L,
        end: &mut Point<VecState<L>>,
    ) {
        system.rhs(t, &end.state, &mut end.slope);
        storage.ends[1].0.copy_from_slice(&end.slope.0);
    }

    fn mean_square_error(
        storage: &Storage<L>,
        h: L,
        rtol: &VecState<L>,
        atol: &VecState<L>,
        [a, b]: [&VecState<L>; 2],
    ) -> Option<f64> {
        let Storage { wide: Wide { tableau, sums }, stages, ends: [first, last] } = storage;
        let k = Slopes { n_stages: tableau.n_stages(), first, stored: stages, last };
        let rows = (tableau.error_weights(), &k);
        let [first, second] = sums.mean_squares(rows, [&rtol.0, &atol.0], [&a.0, &b.0]);
        let square = match tableau.estimate {
            Estimate::Embedded { .. } => first,
            Estimate::Combined { .. } if first == 0.0 => 0.0,
            Estimate::Combined { .. } => first * (first / (first + 0.01 * second)),
            _ => return None,
        };
        Some(square * (h.magnitude() * h.magnitude()))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use hamel_runtime::{
        Dop853, Dopri5, F64x4, F64x8, Failure, Integrator, Method, Options, Pivot, Rk4, Tableau, Tsit5, Vern9,
    };

    use super::{PreparedLanes, Registers, Several, VecState, Wide};
    use crate::dynamics::{BadParams, LaneDynamics};

    /// Coupled pendulums, as many as there are.
    pub(crate) struct Pendulums;

    impl<L: Several> LaneDynamics<L> for Pendulums {
        fn rhs(&self, t: L, y: &VecState<L>, dy: &mut VecState<L>) {
            let n = y.0.len();
            for k in 0..n {
                dy.0[k] = (y.0[(k + 1) % n] + t).sin() - (y.0[k] * y.0[(k + 2) % n]).sin();
            }
        }
        fn energy(&self, _: L, _: &VecState<L>) -> Option<L> {
            None
        }
        fn write_outputs(&self, _: L, _: &VecState<L>, _: &mut Vec<L>) {}
        fn set(&mut self, _: &[L]) -> Option<Result<(), BadParams>> {
            None
        }
        fn check(&self, _: L, _: &VecState<L>) -> Result<(), Failure> {
            Ok(())
        }
        fn domain(&self, _: L, _: &VecState<L>) -> Result<(), Failure> {
            Ok(())
        }
        fn signature(&self, _: L, _: &VecState<L>) -> L {
            L::ZERO
        }
        fn pivots(&self, _: L, _: &VecState<L>, _: &mut dyn FnMut(Pivot<L>)) {}
    }

    /// Some states of a motion, and the work.
    pub(crate) fn motion<'a, L: Several, M: Method<L, PreparedLanes<'a, L>>>(
        system: &PreparedLanes<'a, L>,
        method: M,
        n: usize,
        options: Options<L>,
    ) -> (Vec<Vec<L>>, hamel_runtime::Stats) {
        let start = (0..n).map(|k| L::gather(|l| 0.3 * (k as f64) - 0.17 * (l as f64))).collect();
        let mut solver = Integrator::new(system, method, L::ZERO, VecState(start), options).unwrap();
        let mut states = Vec::new();
        let times = [0.3, 0.9, 2.0].map(L::from_f64);
        solver.sample(L::from_f64(2.0), times, |_, y| states.push(y.0.clone())).unwrap();
        (states, solver.stats())
    }

    /// Whether wide sums by a tableau give the numbers of a method, in all registers.
    fn hold<L: Several>(
        n: usize,
        method: impl Method<L, PreparedLanes<'static, L>>,
        tableau: &'static Tableau,
    ) -> bool {
        let system: PreparedLanes<'static, L> = Box::new(Pendulums);
        let options = match tableau.estimate_order() {
            Some(_) => Options::adaptive(L::from_f64(1e-9), L::from_f64(1e-11)),
            None => Options::fixed(L::from_f64(0.01)),
        };
        let own = motion(&system, method, n, options);
        let holds =
            |most| Wide::up_to(most, tableau).is_none_or(|wide| motion(&system, wide, n, options) == own);
        [Registers::Avx, Registers::Avx512].into_iter().all(holds)
    }

    #[test]
    fn wide_sums_have_the_bits_of_the_runtime() {
        macro_rules! all {
            ($($method:ident)*) => {$(
                let tableau = <$method as Method<F64x4, PreparedLanes<'static>>>::TABLEAU;
                // Blocks of eight components, and every number behind them.
                for n in 1..=19 {
                    assert!(hold::<F64x4>(n, $method, tableau), "{} with {n} components", tableau.name);
                    assert!(hold::<F64x8>(n, $method, tableau), "{} with {n} components", tableau.name);
                }
            )*};
        }
        all!(Dop853 Vern9 Tsit5 Dopri5 Rk4);
    }

    /// A method whose tableau is another one is found.
    #[test]
    fn another_weight_is_found() {
        if super::WideSums::up_to(Registers::Avx).is_none() {
            return;
        }
        let own = <Dopri5 as Method<F64x4, PreparedLanes<'static>>>::TABLEAU;
        let mut weights = own.weights.to_vec();
        weights.swap(0, 1);
        weights[0].0 = own.weights[0].0;
        weights[1].0 = own.weights[1].0;
        let mut other = *own;
        other.weights = weights.leak();
        let other: &'static Tableau = Box::leak(Box::new(other));
        assert!(!hold::<F64x4>(3, Dopri5, other) && !hold::<F64x8>(3, Dopri5, other));
    }
}
