//! Which of two ways to write a number, or a function, loses fewer digits.
//!
//! What depends on parameters alone is computed once, so that the number of operations does not count: the form with
//! the least cancellation is taken. Does not know: what a number is for, how a call uses it.

use std::collections::BTreeMap;

use hamel_runtime::DoubleDouble;
use rustc_hash::FxHashMap;

use super::polynomial::{Atom, Entry, System, needed};
use crate::lower::classes::Class;
use crate::lower::source::Source;
use crate::program::Relation;
use hamel_expr::{ExprId, Fractions, Graph, Measured, Samples, Sign, SymbolId, inlined};

/// Points at which errors are measured, fewer where there are many inputs, and those drawn to find as many that the
/// conditions on the parameters allow.
const POINTS: usize = 96;
const FEWEST_POINTS: usize = 16;
const MOVED_POINTS: usize = 2048;
const DRAWN: usize = 2048;
/// With more inputs nothing is measured, and everything is kept as it is.
const MAX_INPUTS: usize = 64;
/// Relative change of an input in difference quotients.
const SHIFT: f64 = 1.0 / (1u128 << 64) as f64;
/// Errors of this many operations are not told apart.
const FEW: f64 = 16.0;
/// A number is written in another form where the largest loss shrinks by this.
const GAIN: f64 = 1.5;

/// Points, and after them the same ones with every one of the inputs moved.
struct Points {
    samples: Samples,
    n_inputs: usize,
}

impl Points {
    fn new(samples: &Samples, inputs: &[SymbolId]) -> Points {
        let n_inputs = inputs.len();
        let n = (MOVED_POINTS / (n_inputs + 1)).clamp(FEWEST_POINTS, POINTS);
        Points { samples: samples.shifted(n, inputs, SHIFT), n_inputs }
    }

    /// The largest error of all points in multiples of the effect of the inputs there, `|f| + sum_i |df/dx_i| |x_i|`;
    /// at least that of a few operations.
    fn loss(&self, values: &[Measured]) -> f64 {
        let n = self.samples.n_points() / (self.n_inputs + 1);
        values[..n].iter().enumerate().fold(FEW, |worst, (k, at)| {
            let moved = (1..=self.n_inputs).map(|i| (values[i * n + k].value - at.value).hi().abs() / SHIFT);
            let effect = at.value.hi().abs() + moved.filter(|x| x.is_finite()).sum::<f64>();
            let loss = at.error / effect;
            if loss.is_finite() { worst.max(loss) } else { worst }
        })
    }
}

/// Measures the digits that forms lose, and remembers the better form of every number.
pub(in crate::lower) struct Digits {
    fractions: Fractions,
    /// Where only parameters are moved, and where everything is.
    numbers: Points,
    states: Points,
    /// Parameter-only definitions, written in the parameters.
    values: BTreeMap<SymbolId, ExprId>,
    best: FxHashMap<ExprId, ExprId>,
    /// Terms measured so far, times points.
    n_measured: usize,
}

impl Digits {
    pub(in crate::lower) fn new(graph: &mut Graph, source: &Source<'_>) -> Digits {
        let definitions: Vec<_> = source.sections.iter().flat_map(|s| &s.definitions).copied().collect();
        let fixed = definitions.iter().filter(|d| source.classes.get(d.expr) <= Class::Param);
        let values = inlined(graph, fixed);
        let sign_of = |graph: &mut Graph, s: SymbolId| {
            let e = graph.sym(s);
            source.signs.get(&e).copied().unwrap_or(Sign::Unknown)
        };
        let inputs = source.inputs;
        let others = [inputs.time].into_iter().chain(inputs.held.iter().map(|(s, _)| *s));
        let others = others.chain(inputs.state.iter().copied());
        let others = others.chain(inputs.arguments.values().flatten().copied());
        let mut symbols: Vec<SymbolId> = inputs.params.iter().copied().chain(others).collect();
        if symbols.len() > MAX_INPUTS {
            symbols.clone_from(&inputs.params);
        }
        let signed: Vec<_> = symbols.iter().map(|s| (*s, sign_of(graph, *s))).collect();
        let mut samples = Samples::new(if signed.len() > MAX_INPUTS { 0 } else { DRAWN }, &signed);
        for condition in source.conditions.iter().filter(|c| c.relation != Relation::NotEqual) {
            let sides = graph.subs_all(&[condition.greater, condition.less], &values);
            if let Ok([greater, less]) = sides.as_deref() {
                samples.keep(graph, *greater, *less);
            }
        }
        Digits {
            fractions: Fractions::default(),
            numbers: Points::new(&samples, &inputs.params),
            states: Points::new(&samples, &symbols),
            values,
            best: FxHashMap::default(),
            n_measured: 0,
        }
    }

    /// The errors of the roots in multiples of what rounding the inputs does to their exact values, the largest of each
    /// root. None where too much was measured before.
    pub(super) fn losses(
        &mut self,
        graph: &mut Graph,
        system: &mut System,
        entries: &[Entry],
        roots: &[usize],
    ) -> Option<Vec<f64>> {
        let order = needed(system, entries, roots);
        self.n_measured +=
            self.states.samples.n_points() * order.iter().map(|k| entries[*k].value.len()).sum::<usize>();
        if system.effort.has_measured_enough_errors(self.n_measured) {
            return None;
        }
        let mut found: FxHashMap<usize, Vec<Measured>> = FxHashMap::default();
        let mut atoms: FxHashMap<u32, Vec<Measured>> = FxHashMap::default();
        for k in order {
            let mut sum: Option<Vec<Measured>> = None;
            for (m, c) in entries[k].value.iter() {
                let number = system.numbers.expr(graph, *c);
                let number = self.best(graph, number);
                let number = graph.subs(number, &self.values).ok()?;
                let mut product = self.states.samples.measure(graph, number)?.to_vec();
                for (atom, q) in m {
                    let q = f64::from(q.numerator()) / f64::from(q.denominator());
                    if !atoms.contains_key(atom) {
                        let values = self.of_atom(graph, system.atom(*atom), &found)?;
                        atoms.insert(*atom, values);
                    }
                    product.iter_mut().zip(&atoms[atom]).for_each(|(x, base)| *x = x.times(*base, q));
                }
                match &mut sum {
                    None => sum = Some(product),
                    Some(sum) => sum.iter_mut().zip(product).for_each(|(x, y)| *x = x.plus(y)),
                }
            }
            found.insert(k, sum.unwrap_or_else(|| self.zeros()));
        }
        roots.iter().map(|root| Some(self.states.loss(found.get(root)?))).collect()
    }

    /// The values of an atom, those of polynomials given.
    fn of_atom(
        &mut self,
        graph: &Graph,
        atom: Atom,
        found: &FxHashMap<usize, Vec<Measured>>,
    ) -> Option<Vec<Measured>> {
        let of = |k: u32| found.get(&(k as usize));
        Some(match atom {
            Atom::Input(e) => self.states.samples.measure(graph, e)?.to_vec(),
            Atom::Poly(k) => of(k)?.clone(),
            Atom::Function(f, k) => of(k)?.iter().map(|x| x.function(f)).collect(),
            Atom::Atan2(y, x) => of(y)?.iter().zip(of(x)?).map(|(y, x)| y.atan2(*x)).collect(),
        })
    }

    fn zeros(&self) -> Vec<Measured> {
        vec![Measured { value: DoubleDouble::from(0.0), error: 0.0 }; self.states.samples.n_points()]
    }

    /// The number in the form with the smaller errors: as it is, or with everything cancelled that cancels exactly.
    pub(in crate::lower) fn best(&mut self, graph: &mut Graph, e: ExprId) -> ExprId {
        if let Some(known) = self.best.get(&e) {
            return *known;
        }
        let best = self.better(graph, e).unwrap_or(e);
        self.best.insert(e, best);
        best
    }

    fn better(&mut self, graph: &mut Graph, e: ExprId) -> Option<ExprId> {
        let whole = graph.subs(e, &self.values).ok()?;
        let normal = self.fractions.normal(graph, whole);
        if normal == whole || !graph.fingerprints_agree(normal, e) {
            return None;
        }
        let loss = |digits: &mut Digits, e: ExprId| -> Option<f64> {
            let values = digits.numbers.samples.measure(graph, e)?.to_vec();
            Some(digits.numbers.loss(&values))
        };
        let (before, after) = (loss(self, whole)?, loss(self, normal)?);
        let gain = before / after;
        (gain >= GAIN).then_some(normal)
    }
}
