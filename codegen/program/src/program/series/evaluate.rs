//! Taylor coefficients by the recurrence, with the very operations that emitted code performs.
//!
//! Does not know: the rules of the recurrence, how it is written in a language.

use std::collections::BTreeMap;

use hamel_runtime::{Convolutions, MAX_ORDER, Real, set_order};

use super::{Jet, ProductKind};
use crate::program::interpret::Point;
use crate::program::table::Factors;

impl Jet {
    /// Writes the Taylor coefficients of the solution through `(t, y)` to `out`, one state each from order zero on,
    /// with inputs that are held where `prepared` has them.
    ///
    /// Coefficients beyond [`MAX_ORDER`] are left as they are.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series<R: Real>(&self, params: &[R], prepared: &[R], t: R, y: &[R], out: &mut [&mut [R]]) {
        let held = prepared[self.program.prepare.slots.len()..].to_vec();
        self.series_with((params, prepared), (t, y), &[held], out);
    }

    /// The same where the inputs are polynomials in time: `u` are the coefficients of each order, from zero on, and
    /// those that are not there are zero.
    ///
    /// # Shapes
    /// u: rows of \[n_inputs\].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series_with<R: Real>(
        &self,
        (params, prepared): (&[R], &[R]),
        (t, y): (R, &[R]),
        u: &[Vec<R>],
        out: &mut [&mut [R]],
    ) {
        let n = self.n_state;
        let inputs = self.program.state.len();
        let mut prepared = prepared.to_vec();
        let hold = |prepared: &mut [R], order: usize| {
            let held = &mut prepared[self.program.prepare.slots.len()..];
            match u.get(order) {
                Some(u) => held.copy_from_slice(u),
                None => held.fill(R::ZERO),
            }
        };
        hold(&mut prepared, 0);
        let mut loops = Loops::new(self);
        let mut state = vec![R::ZERO; inputs];
        state[..n].copy_from_slice(y);
        let mut results = vec![R::ZERO; n + self.n_kept];
        let contract = |scalars: &[R]| loops.contract(0, y, scalars);
        let known = (params, &prepared[..]);
        self.program.run_contracting(Self::FIRST, known, Point::of_state(t, &state), &mut results, contract);
        state[n + self.n_lanes..inputs - 2].copy_from_slice(&results[n..]);
        let mut coefficient = results[..n].to_vec();
        let mut lanes = vec![Convolutions::<R, 1>::default(); self.n_lanes];
        let mut results = vec![R::ZERO; n + 2 * self.n_lanes];
        let mut out = out.iter_mut().take(MAX_ORDER + 1);
        if let Some(first) = out.next() {
            first.copy_from_slice(y);
        }
        let last = out.len();
        for (next, k) in out.zip(1u32..) {
            next.copy_from_slice(&coefficient);
            if k as usize == last {
                break;
            }
            let order = R::from_f64(f64::from(k));
            let inverse = R::ratio(1.0, f64::from(k));
            state[..n].copy_from_slice(&coefficient);
            for (sum, lane) in state[n..].iter_mut().zip(&lanes) {
                [*sum] = lane.sums();
            }
            state[inputs - 2] = order;
            state[inputs - 1] = inverse;
            let t = if k == 1 { R::ONE } else { R::ZERO };
            let contract = |scalars: &[R]| loops.contract(k, &coefficient, scalars);
            hold(&mut prepared, k as usize);
            self.program.run_contracting(
                Self::NEXT,
                (params, &prepared),
                Point::of_state(t, &state),
                &mut results,
                contract,
            );
            let (left, right) = results[n..].split_at(self.n_lanes);
            for ((lane, left), right) in lanes.iter_mut().zip(left).zip(right) {
                lane.push([*left], [*right]);
            }
            let scale = R::ratio(1.0, f64::from(k + 1));
            for (coefficient, derivative) in coefficient.iter_mut().zip(&results[..n]) {
                *coefficient = *derivative * scale;
            }
        }
    }
}

/// The contractions of a recurrence, with the coefficients of their factors so far.
struct Loops<'j, R> {
    jet: &'j Jet,
    series: BTreeMap<Factors, Vec<[R; MAX_ORDER]>>,
}

impl<R: Real> Loops<'_, R> {
    fn new(jet: &Jet) -> Loops<'_, R> {
        let function = &jet.program.functions[Jet::NEXT];
        let n_series = |factors: Factors| match factors {
            Factors::State => jet.n_state,
            Factors::Scalars => function.scalars.len(),
            Factors::Contraction(k) => function.contractions[k as usize].n_results,
            Factors::Argument => 0,
        };
        let rows = |factors: Factors| (factors, vec![[R::ZERO; MAX_ORDER]; n_series(factors)]);
        Loops { jet, series: jet.convolved_factors().into_iter().map(rows).collect() }
    }

    fn set(&mut self, factors: Factors, order: u32, coefficients: &[R]) {
        if let Some(series) = self.series.get_mut(&factors) {
            set_order(series, order, coefficients);
        }
    }

    /// The coefficients of an order of the results of all contractions, from those of the state and the scalars.
    fn contract(&mut self, order: u32, state: &[R], scalars: &[R]) -> Vec<R> {
        let program = &self.jet.program;
        let function = &program.functions[Jet::NEXT];
        let mut contracted = Vec::new();
        self.set(Factors::State, order, state);
        self.set(Factors::Scalars, order, scalars);
        for (contraction, k) in function.contractions.iter().zip(0u32..) {
            let mut sums = vec![R::ZERO; contraction.n_results];
            for products in &contraction.terms {
                let table = program.tables[products.table as usize].products();
                let of_order = |factors: Factors| match factors {
                    Factors::State => state,
                    Factors::Scalars => scalars,
                    Factors::Contraction(k) => function.results_of_contraction(k, &contracted),
                    Factors::Argument => &[],
                };
                match self.jet.kind(products) {
                    ProductKind::Convolved if order > 0 => {
                        let [left, right] = [products.left, products.right].map(|f| &self.series[&f]);
                        table.add_convolutions_to(order, left, right, &mut sums);
                    }
                    ProductKind::Constant if order > 0 => {}
                    _ => table.add_to(of_order(products.left), of_order(products.right), &mut sums),
                }
            }
            self.set(Factors::Contraction(k), order, &sums);
            contracted.extend(sums);
        }
        contracted
    }
}
