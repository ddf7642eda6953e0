//! Shorter forms of coefficients: multiplied out, with `sin^2 + cos^2 = 1`, with angles of sums apart, or with products
//! of sines and cosines as waves of sums, where the angles of links in space leave the angles between them; each
//! proved.
//!
//! Does not know: symmetries.

use hamel_expr::{ExprId, Func, Node, Rational};
use num_traits::{One, Signed, ToPrimitive};

use super::section::Section;
use super::setting::Setting;

/// Coefficients of more terms are left as they are.
const MAX_TERMS: usize = 400;

/// Higher powers of sines and cosines are left as they are.
const MAX_POWER: i64 = 4;

/// What a function costs beside a sum or a product.
const COST_OF_FUNCTION: usize = 10;

impl Setting<'_> {
    /// A residual that is affine in the velocities, with its coefficients in the shortest of their forms.
    pub(super) fn shortened_residual(&mut self, e: ExprId, section: &Section) -> ExprId {
        let has_angles = self.graph.reachable(&[e]).into_iter().any(|n| self.is_wave(n));
        if !has_angles {
            return e;
        }
        let velocities = section.velocities().to_vec();
        let Some((slopes, offset)) = self.graph.affine_parts(e, &velocities) else { return e };
        let offset = self.shortest(offset);
        let mut terms = vec![offset];
        for (slope, y) in slopes.into_iter().zip(velocities) {
            let (slope, y) = (self.shortest(slope), self.graph.sym(y));
            terms.push(self.graph.mul(slope, y));
        }
        let sum = self.graph.sum(&terms);
        if self.weight(sum) < self.weight(e) { sum } else { e }
    }

    /// The shortest of the forms of an expression.
    fn shortest(&mut self, e: ExprId) -> ExprId {
        let mut best = e;
        let mut forms = Vec::new();
        for form in [e, self.angles_apart(e)] {
            if self.graph.n_terms_expanded(form) <= MAX_TERMS {
                forms.push(self.of_sums(form));
                forms.extend([Func::Cos, Func::Sin].map(|kept| self.by_one_function(form, kept)));
            }
        }
        for form in forms {
            if self.weight(form) < self.weight(best) && self.graph.is_equal(e, form) {
                best = form;
            }
        }
        best
    }

    fn weight(&self, e: ExprId) -> usize {
        let nodes = self.graph.reachable(&[e]);
        let weights = nodes.iter().map(|n| match self.graph.node(*n) {
            Node::Function(..) | Node::Atan2(..) => COST_OF_FUNCTION,
            Node::Sum { terms, .. } => terms.len(),
            Node::Product { factors, .. } => factors.len(),
            _ => 0,
        });
        weights.sum()
    }

    fn is_wave(&self, e: ExprId) -> bool {
        matches!(self.graph.node(e), Node::Function(Func::Sin | Func::Cos, _))
    }

    /// Products of sines and cosines as sines and cosines of sums.
    fn of_sums(&mut self, e: ExprId) -> ExprId {
        let expanded = self.graph.expand(e);
        let mut terms = Vec::new();
        for (term, weight) in self.graph.summands(expanded) {
            let factors: Vec<(ExprId, Rational)> = match self.graph.node(term) {
                Node::Product { factors, .. } => factors.to_vec(),
                _ => vec![(term, Rational::one())],
            };
            // A sum of waves, each a number times a cosine or a sine.
            let start = self.graph.zero();
            let mut waves = vec![(Rational::one(), Func::Cos, start)];
            let mut rest = vec![(term, Rational::one())];
            for (base, q) in factors {
                let n = q.to_i64().filter(|n| q.is_integer() && (1..=MAX_POWER).contains(n));
                let (Node::Function(f @ (Func::Sin | Func::Cos), argument), Some(n)) =
                    (self.graph.node(base).clone(), n)
                else {
                    continue;
                };
                rest.push((base, -q));
                for _ in 0..n {
                    waves = self.multiplied(waves, (f, argument));
                }
            }
            let Ok(rest) = self.graph.power_product(&rest) else { return e };
            for (q, f, argument) in waves {
                let wave = self.graph.func(f, argument);
                terms.push((self.graph.mul(rest, wave), q * &weight));
            }
        }
        self.graph.linear_combination(&terms)
    }

    /// Waves times a sine or a cosine.
    fn multiplied(
        &mut self,
        waves: Vec<(Rational, Func, ExprId)>,
        (f, b): (Func, ExprId),
    ) -> Vec<(Rational, Func, ExprId)> {
        let mut result = Vec::with_capacity(2 * waves.len());
        for (q, of, a) in waves {
            let half = q / Rational::from_integer(2.into());
            let (sum, difference) = (self.graph.add(a, b), self.graph.sub(a, b));
            let (wave, of_sum, of_difference) = match (of, f) {
                (Func::Cos, Func::Cos) => (Func::Cos, half.clone(), half),
                (Func::Sin, Func::Sin) => (Func::Cos, -half.clone(), half),
                (Func::Cos, _) => (Func::Sin, half.clone(), -half),
                _ => (Func::Sin, half.clone(), half),
            };
            result.extend([(of_sum, wave, sum), (of_difference, wave, difference)]);
        }
        result
    }

    /// Sines and cosines of sums by the terms' own.
    fn angles_apart(&mut self, e: ExprId) -> ExprId {
        let apart = self.graph.rebuild(e, |g, f, argument| match f {
            Func::Sin | Func::Cos => {
                let (mut sine, mut cosine) = (g.zero(), g.one());
                for (term, q) in g.summands(argument) {
                    let own = g.scale(term, &q);
                    let (s, c) = (g.func(Func::Sin, own), g.func(Func::Cos, own));
                    let [sc, cs, cc, ss] =
                        [(sine, c), (cosine, s), (cosine, c), (sine, s)].map(|(x, y)| g.mul(x, y));
                    (sine, cosine) = (g.add(sc, cs), g.sub(cc, ss));
                }
                if f == Func::Sin { sine } else { cosine }
            }
            _ => g.func(f, argument),
        });
        apart.unwrap_or(e)
    }

    /// Multiplied out, with squares of the other one of sine and cosine by the one that is kept.
    fn by_one_function(&mut self, e: ExprId, kept: Func) -> ExprId {
        let replaced = if kept == Func::Cos { Func::Sin } else { Func::Cos };
        let mut sum = self.graph.expand(e);
        // Each round takes a square out of every term.
        for _ in 0..8 {
            let mut has_changed = false;
            let mut terms = Vec::new();
            for (term, q) in self.graph.summands(sum) {
                let square = self.square_in(term, replaced);
                let Some((base, argument)) = square else {
                    terms.push((term, q));
                    continue;
                };
                has_changed = true;
                let inverse = Rational::from_integer((-2).into());
                let rest = self.graph.power_product(&[(term, Rational::one()), (base, inverse)]);
                let Ok(rest) = rest else { return e };
                let other = self.graph.func(kept, argument);
                let by_square = self.graph.product(&[rest, other, other]);
                terms.push((rest, q.clone()));
                terms.push((by_square, -q));
            }
            let next = self.graph.linear_combination(&terms);
            sum = self.graph.expand(next);
            if !has_changed {
                break;
            }
        }
        sum
    }

    /// A function of which a product has the square, with its argument.
    fn square_in(&self, term: ExprId, f: Func) -> Option<(ExprId, ExprId)> {
        let Node::Product { factors, .. } = self.graph.node(term) else { return None };
        factors.iter().find_map(|(base, q)| {
            let is_square = q.is_integer() && q.is_positive() && q.to_i64().is_some_and(|n| n >= 2);
            match self.graph.node(*base) {
                Node::Function(of, argument) if *of == f && is_square => Some((*base, *argument)),
                _ => None,
            }
        })
    }
}
