//! The extrapolated midpoint rule on lanes, whose rows are loops of machine code where the scene has such code:
//! the right-hand side stands inside the loop.
//!
//! Every number has the bits of [`Gbs14`] on lanes: [`WideSums`] and the loops promise the bits of each operation, and
//! their order is that of the runtime.
//!
//! Does not know: scenes, how steps are chosen.

use hamel_runtime::{Error, F64x4, Gbs14, Method, Options, Step, System, Tableau};

use super::dynamics::{PreparedLanes, Several, VecState};
use super::machine::{Registers, Slopes, WideSums};

/// Number of rows.
const N_ROWS: usize = 7;

/// The weights of the rows of 2, 4, .., 14 substeps, and what each is more than in the extrapolation without the first.
const WEIGHTS: [[f64; 2]; N_ROWS] = weights();

/// `w_j = prod_(i != j) j^2/(j^2 - i^2)` and `w_j/j^2`, the nearest numbers.
const fn weights() -> [[f64; 2]; N_ROWS] {
    let (mut all, mut j) = ([[0.0; 2]; N_ROWS], 1);
    while j <= N_ROWS as i64 {
        let (mut numerator, mut denominator, mut i) = (1, 1, 1);
        while i <= N_ROWS as i64 {
            if i != j {
                numerator *= j * j;
                denominator *= j * j - i * i;
            }
            i += 1;
        }
        let weight = numerator as f64 / denominator as f64;
        all[j as usize - 1] = [weight, weight / (j * j) as f64];
        j += 1;
    }
    all
}

/// What the runtime's method says of itself, on any lanes.
const OWN: &Tableau = <Gbs14 as Method<F64x4, PreparedLanes<'static>>>::TABLEAU;
const BY_STEPS: bool = <Gbs14 as Method<F64x4, PreparedLanes<'static>>>::DENSE_BY_STEPS;

/// [`Gbs14`], where the processor has wider registers than the program was compiled for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extrapolated(WideSums);

impl Extrapolated {
    /// In these registers at most, unless the runtime's own operations are as wide.
    pub(crate) fn up_to(most: Registers) -> Option<Extrapolated> {
        WideSums::up_to(most).map(Extrapolated)
    }
}

/// What the method keeps from one step to the next.
pub(crate) struct Storage<L> {
    sums: WideSums,
    /// Of each row the last increment, and the one before behind it, the longest row first.
    rows: Vec<L>,
    /// The estimate of the error, divided by the step.
    estimate: [VecState<L>; 1],
    slope: VecState<L>,
}

/// A row of `2 half` substeps over a step, where there is no machine code for it.
fn run_row<L: Several>(
    step: &mut Step<'_, L, PreparedLanes<'_, L>>,
    half: usize,
    slope: &mut VecState<L>,
    increments: &mut [L],
) {
    let eta = step.h * L::from_f64(1.0 / (2 * half) as f64);
    let (mut t, twice) = (step.t + eta, eta + eta);
    let (even, odd) = increments.split_at_mut(slope.0.len());
    even.fill(L::ZERO);
    odd.iter_mut().zip(&step.from.slope.0).for_each(|(odd, f)| *odd = eta * *f);
    let (y, point, system) = (&step.from.state.0, &mut *step.work, step.system);
    let mut substep = |at: &[L], to: &mut [L]| {
        for ((point, at), y) in point.0.iter_mut().zip(at).zip(y) {
            *point = *y + *at;
        }
        system.rhs(t, point, slope);
        for (to, slope) in to.iter_mut().zip(&slope.0) {
            *to = twice.mul_add(*slope, *to);
        }
        t += eta;
    };
    substep(odd, even);
    for _ in 1..half {
        substep(even, odd);
        substep(odd, even);
    }
}

impl<'a, L: Several> Method<L, PreparedLanes<'a, L>> for Extrapolated
where
    Gbs14: Method<L, PreparedLanes<'a, L>>,
{
    const TABLEAU: &'static Tableau = OWN;

    const DENSE_BY_STEPS: bool = BY_STEPS;

    type Storage = Storage<L>;

    fn validate(&self, options: &Options<L>) -> Result<(), Error> {
        Method::<L, PreparedLanes<'a, L>>::validate(&Gbs14, options)
    }

    fn storage(&self, _: &PreparedLanes<'a, L>, _: L, y0: &VecState<L>, _: &Options<L>) -> Storage<L> {
        let zeros = VecState(vec![L::ZERO; y0.0.len()]);
        let rows = vec![L::ZERO; N_ROWS * 2 * y0.0.len()];
        Storage { sums: self.0, rows, estimate: [zeros.clone()], slope: zeros }
    }

    fn renew(&self, _: &mut Storage<L>, _: &PreparedLanes<'a, L>, _: L, _: &VecState<L>, _: &Options<L>) {
        // Every row of a step is computed before it is read.
    }

    fn stages(storage: &Storage<L>) -> &[VecState<L>] {
        &storage.estimate
    }

    fn stages_mut(storage: &mut Storage<L>) -> &mut [VecState<L>] {
        &mut storage.estimate
    }

    fn advance(
        &self,
        storage: &mut Storage<L>,
        step: &mut Step<'_, L, PreparedLanes<'a, L>>,
    ) -> Result<(), Error> {
        let Storage { sums, rows, estimate: [estimate], slope } = storage;
        let start = (step.from.state.0.as_slice(), step.from.slope.0.as_slice());
        if !step.system.run_rows((step.t, step.h), start, rows) {
            let n = slope.0.len();
            for (row, increments) in rows.chunks_exact_mut(2 * n.max(1)).enumerate() {
                run_row(step, N_ROWS - row, slope, increments);
            }
        }
        let from = (step.from.state.0.as_slice(), step.from.residue.0.as_slice());
        let to = (step.to.state.0.as_mut_slice(), step.to.residue.0.as_mut_slice());
        sums.extrapolate((&WEIGHTS, rows), step.h.recip(), from, to, &mut estimate.0);
        *step.rhs_evals += (N_ROWS * N_ROWS) as u64;
        Ok(())
    }

    fn mean_square_error(
        Storage { sums, estimate, .. }: &Storage<L>,
        h: L,
        rtol: &VecState<L>,
        atol: &VecState<L>,
        [a, b]: [&VecState<L>; 2],
    ) -> Option<f64> {
        let tableau = OWN;
        // The one sum is the estimate, which is stored.
        let [own] = estimate;
        let k = Slopes { n_stages: tableau.n_stages(), first: own, stored: estimate, last: own };
        let rows = (tableau.error_weights(), &k);
        let [square, _] = sums.mean_squares(rows, [&rtol.0, &atol.0], [&a.0, &b.0]);
        Some(square * (h.magnitude() * h.magnitude()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use hamel_runtime::{F64x4, F64x8, Failure, Gbs14, Method, Options, Pivot};

    use super::{Extrapolated, PreparedLanes, Registers, Several, VecState};
    use crate::cache::Cache;
    use crate::dynamics::LaneDynamics;
    use crate::interpreted::{self, Built};
    use crate::model::Checked;
    use crate::session::Session;
    use crate::wide::tests::{Pendulums, motion};

    /// Whether the method has the bits of the runtime's, adaptive and with fixed steps, in all registers.
    fn holds<L: Several>(system: &PreparedLanes<'_, L>, n: usize) -> bool
    where
        Gbs14: for<'a> Method<L, PreparedLanes<'a, L>>,
    {
        let adaptive = Options::adaptive(L::from_f64(1e-9), L::from_f64(1e-11));
        let of_all = |own: Extrapolated| {
            [adaptive, Options::fixed(L::from_f64(0.1))]
                .into_iter()
                .all(|options| motion(system, Gbs14, n, options) == motion(system, own, n, options))
        };
        [Registers::Avx, Registers::Avx512].into_iter().filter_map(Extrapolated::up_to).all(of_all)
    }

    #[test]
    fn systems_without_code_for_rows_have_the_bits_of_the_runtime() {
        for n in 1..=9 {
            let (four, eight): (PreparedLanes<'_>, PreparedLanes<'_, F64x8>) =
                (Box::new(Pendulums), Box::new(Pendulums));
            assert!(holds(&four, n) && holds(&eight, n), "{n} components");
        }
    }

    const CART: &str = "
        model cart {
            param l = 2 where l > 0;
            input push = 0.3;
            coordinate theta in angle;
            coordinate x in real;
            lagrangian = (x_dot^2 + l^2*theta_dot^2/2 + x_dot*theta_dot*cos(theta))/2 + l*cos(theta) - x^2/2
                + x*sin(3*t)/4;
            force x_dot = push;
        }
    ";

    fn cart() -> Built {
        let model = Session::of_shipped(&[]).parse("cart", CART).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        interpreted::build(&model, "controlled").unwrap_or_else(|e| panic!("{e}")).in_memory()
    }

    /// Of parameters and inputs that differ from lane to lane.
    #[test]
    fn rows_in_code_have_the_bits_of_the_runtime() {
        hold_in_code::<F64x4>();
        hold_in_code::<F64x8>();
    }

    fn hold_in_code<L: Several>()
    where
        Gbs14: for<'a> Method<L, PreparedLanes<'a, L>>,
    {
        for most in [Registers::Avx2, Registers::Avx512] {
            let scene = cart().with_registers_up_to(most);
            let values =
                [[1.5, 2.0, 2.5, 1.0, 1.1, 3.0, 1.7, 1.9], [0.1, -0.2, 0.0, 0.4, 0.3, -0.1, 0.2, 0.5]];
            let mut lanes = L::prepare(&scene, &values.map(|of| L::gather(|lane| of[lane]))).unwrap();
            assert!(holds(&lanes, 4));
            assert!(lanes.hold(&[L::from_f64(0.7)]) && holds(&lanes, 4));
            assert!(!lanes.hold(&[]), "values for no inputs are others");
            let mut increments = [L::from_f64(0.01); 16];
            let (start, slope) = ([L::from_f64(0.2); 4], [L::from_f64(0.1); 4]);
            let has_rows = lanes.run_rows((L::ZERO, L::from_f64(0.1)), (&start, &slope), &mut increments);
            assert_eq!(
                has_rows,
                crate::machine::IS_THERE && Extrapolated::up_to(most).is_some() && has_avx2()
            );
        }
    }

    /// Rows are for processors with AVX2.
    fn has_avx2() -> bool {
        #[cfg(target_arch = "x86_64")]
        return std::is_x86_feature_detected!("avx2");
        #[cfg(not(target_arch = "x86_64"))]
        false
    }

    /// Rows that say that they are done, and are not.
    struct Wrong;

    impl<L: Several> LaneDynamics<L> for Wrong {
        fn rhs(&self, t: L, y: &VecState<L>, dy: &mut VecState<L>) {
            Pendulums.rhs(t, y, dy);
        }
        fn run_rows(&self, _: (L, L), _: (&[L], &[L]), increments: &mut [L]) -> bool {
            increments.iter_mut().for_each(|x| *x += L::from_f64(1e-15));
            true
        }
        fn energy(&self, _: L, _: &VecState<L>) -> Option<L> {
            None
        }
        fn write_outputs(&self, _: L, _: &VecState<L>, _: &mut Vec<L>) {}
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

    #[test]
    fn another_row_is_found() {
        let (four, eight): (PreparedLanes<'_>, PreparedLanes<'_, F64x8>) = (Box::new(Wrong), Box::new(Wrong));
        let has_own = Extrapolated::up_to(Registers::Avx).is_some();
        assert!(!has_own || !holds(&four, 3) && !holds(&eight, 3));
    }
}
