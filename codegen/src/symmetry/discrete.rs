//! Reversal of time, reflections and scalings: told, not reduced by.
//!
//! A scaling `q_i -> c^a_i q_i`, `t -> c^b t` that multiplies the Lagrangian and the power by `c^d` maps motions to
//! motions: `X L = d L` with `X = sum a_i q_i d/dq_i + sum (a_i - b) y_i d/dy_i + b t d/dt`, linear in the exponents.
//! Only coordinates of a line are scaled. Source: Landau and Lifshitz 1976, section 10.
//!
//! Does not know: how a model is reduced.

use hamel_expr::{ExprId, Rational, SymbolId};
use hamel_lang::spec::Domain;
use num_traits::{One, Signed, Zero};

use super::setting::{Images, Setting};

/// Reflections of more coordinates together are not tried.
const MAX_REFLECTED: usize = 6;

impl Setting<'_> {
    /// Reversal, reflections and scalings, a line each.
    pub(super) fn discrete(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.is_reversible() {
            lines.push("Symmetry: reversal of time.".to_owned());
        }
        for set in self.reflections() {
            let names: Vec<&str> = set.iter().map(|i| self.model.base[*i].name.as_str()).collect();
            lines.push(format!("Symmetry: the sign of {}.", names.join(", ")));
        }
        lines.extend(self.scalings());
        lines
    }

    /// Whether `q(-t)` moves by the same equations.
    fn is_reversible(&mut self) -> bool {
        let mut images: Images = Images::new();
        for y in self.velocities.iter().copied().chain([self.model.time]) {
            let value = self.graph.sym(y);
            images.insert(y, self.graph.neg(value));
        }
        self.is_kept_by(&images)
    }

    /// Sets of coordinates whose sign the equations do not see, none a union of smaller ones.
    fn reflections(&mut self) -> Vec<Vec<usize>> {
        let coordinates: Vec<usize> = (0..self.model.base.len())
            .filter(|i| !matches!(self.model.base[*i].domain, Domain::Interval(..)))
            .take(MAX_REFLECTED)
            .collect();
        let mut subsets: Vec<usize> = (1..1usize << coordinates.len()).collect();
        subsets.sort_by_key(|s| (s.count_ones(), *s));
        let mut found: Vec<usize> = Vec::new();
        for subset in subsets {
            let of_smaller = found.iter().filter(|f| *f & subset == **f).fold(0, |all, f| all | f);
            if of_smaller == subset {
                continue;
            }
            let set: Vec<usize> =
                (0..coordinates.len()).filter(|d| subset >> d & 1 == 1).map(|d| coordinates[d]).collect();
            let mut images = Images::new();
            for i in &set {
                for symbol in [self.model.base[*i].symbol, self.velocities[*i], self.displacements[*i]] {
                    let value = self.graph.sym(symbol);
                    images.insert(symbol, self.graph.neg(value));
                }
            }
            if self.is_kept_by(&images) {
                found.push(subset);
            }
        }
        let sets = found.into_iter().map(|subset| {
            (0..coordinates.len()).filter(|d| subset >> d & 1 == 1).map(|d| coordinates[d]).collect()
        });
        sets.collect()
    }

    /// Whether Lagrangian and power are kept, and each constraint up to its sign.
    fn is_kept_by(&mut self, images: &Images) -> bool {
        let lagrangian = self.graph.sub(self.kinetic, self.potential);
        for f in [lagrangian, self.power] {
            let Ok(image) = self.graph.subs(f, images) else { return false };
            let difference = self.graph.sub(image, f);
            if !self.vanishes(difference) {
                return false;
            }
        }
        self.constraints.clone().into_iter().all(|phi| {
            let Ok(image) = self.graph.subs(phi, images) else { return false };
            let both = [self.graph.sub(image, phi), self.graph.add(image, phi)];
            both.into_iter().any(|e| self.vanishes(e))
        })
    }

    fn scalings(&mut self) -> Vec<String> {
        let real: Vec<usize> =
            (0..self.model.base.len()).filter(|i| self.model.base[*i].domain == Domain::Real).collect();
        let lagrangian = self.graph.sub(self.kinetic, self.potential);
        let zero = self.graph.zero();
        let functions = [vec![lagrangian, self.power], self.constraints.clone()].concat();
        // Degrees of the constraints are free, that of the power is the Lagrangian's.
        let mut columns: Vec<Vec<ExprId>> = Vec::new();
        for (r, phi) in functions.iter().enumerate().skip(2) {
            let mut column = vec![zero; functions.len()];
            column[r] = *phi;
            columns.push(column);
        }
        let n_free = columns.len();
        let mut of_lagrangian = vec![zero; functions.len()];
        (of_lagrangian[0], of_lagrangian[1]) = (lagrangian, self.power);
        let minus = of_lagrangian.into_iter().map(|e| self.graph.neg(e)).collect();
        columns.push(minus);
        for i in &real {
            let symbols = [self.model.base[*i].symbol, self.velocities[*i], self.displacements[*i]];
            columns.push(self.degrees(&functions, &symbols));
        }
        let velocities = self.velocities.clone();
        let of_velocities = self.degrees(&functions, &velocities);
        let of_time = self.degrees(&functions, &[self.model.time]);
        let of_both: Vec<ExprId> =
            of_time.into_iter().zip(of_velocities).map(|(t, y)| self.graph.sub(t, y)).collect();
        columns.push(of_both);
        let columns: Vec<Vec<ExprId>> =
            columns.into_iter().map(|c| c.into_iter().map(|e| self.on_groups(e)).collect()).collect();
        let mut lines = Vec::new();
        for relation in self.null_space(&columns) {
            let exponents = whole(&relation[n_free..]);
            let names = real.iter().map(|i| self.model.base[*i].name.as_str()).chain(["t"]);
            let scaled: Vec<String> = names
                .zip(&exponents[1..])
                .filter(|(_, n)| !n.is_zero())
                .map(|(name, n)| format!("{name} by {}", power(n)))
                .collect();
            if !scaled.is_empty() {
                let degree = match exponents[0].is_zero() {
                    true => "keeps the Lagrangian".to_owned(),
                    false => format!("multiplies the Lagrangian by {}", power(&exponents[0])),
                };
                lines.push(format!("Scaling: {}; it {degree}.", scaled.join(", ")));
            }
        }
        lines
    }

    /// `sum_s s d/ds` of each function.
    fn degrees(&mut self, functions: &[ExprId], symbols: &[SymbolId]) -> Vec<ExprId> {
        let images: Images = symbols.iter().map(|s| (*s, self.graph.sym(*s))).collect();
        functions.iter().map(|f| self.graph.derivative_along(*f, &images)).collect()
    }
}

/// Coprime whole numbers in the same proportions, the last that is not zero positive.
fn whole(list: &[Rational]) -> Vec<Rational> {
    let mut numbers = list.to_vec();
    for k in 0..numbers.len() {
        let denominator = Rational::from_integer(numbers[k].denom().clone());
        numbers.iter_mut().for_each(|q| *q *= &denominator);
    }
    let common = numbers.iter().fold(Rational::zero(), |a, b| {
        let (mut a, mut b) = (a, b.abs());
        while !b.is_zero() {
            let rest = &a - (&a / &b).trunc() * &b;
            (a, b) = (b, rest);
        }
        a
    });
    if common.is_zero() {
        return numbers;
    }
    let is_negative = numbers.iter().rfind(|n| !n.is_zero()).is_some_and(Signed::is_negative);
    let common = if is_negative { -common } else { common };
    numbers.into_iter().map(|n| n / &common).collect()
}

fn power(n: &Rational) -> String {
    if n.is_one() { "c".to_owned() } else { format!("c^{n}") }
}
