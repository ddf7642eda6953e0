//! Taylor coefficients by the recurrence, with the very operations that emitted code performs.
//!
//! Does not know: the rules of the recurrence, how it is written in a language.

use std::collections::BTreeMap;

use hamel_runtime::{MAX_ORDER, Real, set_order};

use super::{Jet, ProductKind};
use crate::program::interpret::{Point, Run};
use crate::program::table::Factors;

/// Room for the series of an expansion, worth keeping from one to the next; its contents do not matter.
#[derive(Clone, Debug, Default)]
pub struct SeriesRoom<R = f64> {
    prepared: Vec<R>,
    state: Vec<R>,
    results: Vec<R>,
    coefficient: Vec<R>,
    /// Rows `a_j` and `b_j` of the convolutions, of the orders from one on.
    rows: [Vec<R>; 2],
}

/// So many zeros.
fn zeros<R: Real>(room: &mut Vec<R>, n: usize) -> &mut [R] {
    room.clear();
    room.resize(n, R::ZERO);
    room
}

impl Jet {
    /// Writes the Taylor coefficients of the solution through `(t, y)` to `out`, one state each from order zero on,
    /// with inputs that are held where `prepared` has them.
    ///
    /// Coefficients beyond [`MAX_ORDER`] are left as they are.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series<R: Real>(&self, params: &[R], prepared: &[R], t: R, y: &[R], out: &mut [&mut [R]]) {
        self.series_by(&self.program, &mut SeriesRoom::default(), (params, prepared), (t, y), None, out);
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
        known: (&[R], &[R]),
        point: (R, &[R]),
        u: &[Vec<R>],
        out: &mut [&mut [R]],
    ) {
        self.series_by(&self.program, &mut SeriesRoom::default(), known, point, Some(u), out);
    }

    /// The same by whoever runs the program of the recurrence, with the same bits; `u` is none where inputs are held.
    /// A program with contractions is interpreted, whoever runs it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series_by<R: Real>(
        &self,
        run: &dyn Run<R>,
        room: &mut SeriesRoom<R>,
        (params, prepared): (&[R], &[R]),
        (t, y): (R, &[R]),
        u: Option<&[Vec<R>]>,
        out: &mut [&mut [R]],
    ) {
        let (n, n_lanes, inputs) = (self.n_state, self.n_lanes, self.program.state.len());
        let SeriesRoom { prepared: held, state, results, coefficient, rows: [left, right] } = room;
        held.clear();
        held.extend_from_slice(prepared);
        let n_slots = self.program.prepare.slots.len();
        let hold = |held: &mut [R], order: usize| match u {
            None if order == 0 => {}
            _ => match u.and_then(|u| u.get(order)) {
                Some(u) => held[n_slots..].copy_from_slice(u),
                None => held[n_slots..].fill(R::ZERO),
            },
        };
        let mut loops = Loops::new(self);
        let state = zeros(state, inputs);
        let results = zeros(results, n + self.n_kept.max(2 * n_lanes));
        let coefficient = zeros(coefficient, n);
        left.clear();
        right.clear();
        hold(held, 0);
        state[..n].copy_from_slice(y);
        let of_first = &mut results[..n + self.n_kept];
        loops.run((Self::FIRST, run), (params, held), (0, y), Point::of_state(t, state), of_first);
        coefficient.copy_from_slice(&of_first[..n]);
        state[n + n_lanes..inputs - 2].copy_from_slice(&of_first[n..]);
        let of_next = &mut results[..n + 2 * n_lanes];
        let mut out = out.iter_mut().take(MAX_ORDER + 1);
        if let Some(first) = out.next() {
            first.copy_from_slice(y);
        }
        let last = out.len();
        for (next, k) in out.zip(1u32..) {
            next.copy_from_slice(coefficient);
            if k as usize == last {
                break;
            }
            state[..n].copy_from_slice(coefficient);
            run.convolve([left, right], &mut state[n..n + n_lanes]);
            state[inputs - 2] = R::from_f64(f64::from(k));
            state[inputs - 1] = R::ratio(1.0, f64::from(k));
            let t = if k == 1 { R::ONE } else { R::ZERO };
            hold(held, k as usize);
            let point = Point::of_state(t, state);
            loops.run((Self::NEXT, run), (params, held), (k, coefficient), point, of_next);
            left.extend_from_slice(&of_next[n..n + n_lanes]);
            right.extend_from_slice(&of_next[n + n_lanes..]);
            let scale = R::ratio(1.0, f64::from(k + 1));
            for (coefficient, derivative) in coefficient.iter_mut().zip(&of_next[..n]) {
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

    /// Runs a function at a point, with coefficients of an order: by whoever runs it, unless it has contractions.
    fn run(
        &mut self,
        (function_idx, run): (usize, &dyn Run<R>),
        (params, prepared): (&[R], &[R]),
        (order, coefficients): (u32, &[R]),
        point: Point<'_, R>,
        out: &mut [R],
    ) {
        let program = &self.jet.program;
        if program.functions[function_idx].contractions.is_empty() {
            return run.run_at(function_idx, params, prepared, point, out);
        }
        let contract = |scalars: &[R]| self.contract(order, coefficients, scalars);
        program.run_contracting(function_idx, (params, prepared), point, out, contract);
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
