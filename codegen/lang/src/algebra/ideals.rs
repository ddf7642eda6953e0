//! Chains of ideals `g = n_0 > n_1 > ..` with coefficients that may depend on parameters, verified step by step.
//!
//! Deliberately does not know: inner products, what a chain is used for.

use hamel_expr::error::{Error, spell_vector};
use hamel_expr::{ExprId, Graph, Number, Rational, Style, Vanishing};

use super::lie::LieAlgebra;

/// One step of a chain by its name, with vectors that span it.
pub(crate) type Step<'a> = (&'a str, &'a [Vec<ExprId>]);

/// The basis of the whole algebra, which begins a chain.
pub fn whole_algebra(g: &Graph, algebra: &LieAlgebra<Number>) -> Vec<Vec<ExprId>> {
    let n = algebra.dim();
    (0..n).map(|k| (0..n).map(|i| if i == k { g.one() } else { g.zero() }).collect()).collect()
}

/// A basis of the next step of a chain: it lies in the step above, is smaller, is not zero, and `[above, next]` lies in
/// it, for all parameters at which the vectors are as independent as they are in general. Messages spell vectors in
/// `basis`.
///
/// # Errors
/// [`Error::ShapeMismatch`], [`Error::NotNested`], [`Error::EmptyStage`], [`Error::NotAnIdeal`] with the offending
/// pair, [`Error::Unverified`].
pub fn next_ideal(
    g: &mut Graph,
    algebra: &LieAlgebra<Number>,
    basis: &[String],
    (above_name, above): Step<'_>,
    (name, spanning): Step<'_>,
) -> Result<Vec<Vec<ExprId>>, Error> {
    let n = algebra.dim();
    if let Some(bad) = spanning.iter().find(|v| v.len() != n) {
        let what = format!("vector spanning stage {name}");
        return Err(Error::ShapeMismatch { what, found: bad.len(), expected: n });
    }
    let (outer, inner) = (Span::new(g, above), Span::new(g, spanning));
    let ideal: Vec<Vec<ExprId>> = inner.independent.iter().map(|k| spanning[*k].clone()).collect();
    let unverified = |claim: String, residual: String| Error::Unverified { claim, residual, component: None };
    for v in &ideal {
        let rest = outer.rest(g, v);
        match vanishing(g, &rest) {
            Vanishing::Zero => {}
            Vanishing::NonZero => {
                return Err(Error::NotNested { stage: name.to_owned(), above: above_name.to_owned() });
            }
            Vanishing::Unknown => {
                let rest = spell(g, basis, &rest);
                return Err(unverified(
                    format!("that stage {name} is contained in stage {above_name}"),
                    rest,
                ));
            }
        }
    }
    if ideal.is_empty() || inner.dim() == outer.dim() {
        return Err(Error::EmptyStage { stage: name.to_owned() });
    }
    for x in above {
        for y in &ideal {
            let bracket = bracket(g, algebra, x, y);
            let rest = inner.rest(g, &bracket);
            match vanishing(g, &rest) {
                Vanishing::Zero => {}
                Vanishing::NonZero => {
                    return Err(Error::NotAnIdeal {
                        stage: name.to_owned(),
                        above: above_name.to_owned(),
                        pair: [x, y].map(|v| spell(g, basis, v)),
                        bracket: spell(g, basis, &bracket),
                    });
                }
                Vanishing::Unknown => {
                    let rest = spell(g, basis, &rest);
                    return Err(unverified(format!("that stage {name} is an ideal of {above_name}"), rest));
                }
            }
        }
    }
    Ok(ideal)
}

/// Positions of the first vectors of a list that are linearly independent of those before.
pub fn independent_vectors(g: &mut Graph, vectors: &[Vec<ExprId>]) -> Vec<usize> {
    Span::new(g, vectors).independent
}

/// Whether a vector lies in the span of others.
pub fn lies_in(g: &mut Graph, spanning: &[Vec<ExprId>], vector: &[ExprId]) -> Vanishing {
    let rest = Span::new(g, spanning).rest(g, vector);
    vanishing(g, &rest)
}

/// `[x, y]` of two vectors.
fn bracket(g: &mut Graph, algebra: &LieAlgebra<Number>, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
    let zero = g.zero();
    let mut terms: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); x.len()];
    for (a, b, value) in algebra.brackets() {
        let are_there = |p: usize, q: usize| x[p] != zero && y[q] != zero;
        if !are_there(a, b) && !are_there(b, a) {
            continue;
        }
        let (forward, backward) = (g.mul(x[a], y[b]), g.mul(x[b], y[a]));
        let weight = g.sub(forward, backward);
        for (c, q) in value {
            terms[*c].push(g.weighted(weight, q));
        }
    }
    terms.iter().map(|list| g.linear_combination(list)).collect()
}

fn vanishing(g: &mut Graph, vector: &[ExprId]) -> Vanishing {
    let mut verdict = Vanishing::Zero;
    for e in vector {
        match g.vanishing(*e) {
            Vanishing::Zero => {}
            Vanishing::NonZero => return Vanishing::NonZero,
            Vanishing::Unknown => verdict = Vanishing::Unknown,
        }
    }
    verdict
}

fn spell(g: &mut Graph, basis: &[String], vector: &[ExprId]) -> String {
    let numbers: Option<Vec<Rational>> = vector.iter().map(|e| g.as_rational(*e).cloned()).collect();
    if let Some(numbers) = numbers {
        return spell_vector(basis, &numbers);
    }
    let there: Vec<(&String, ExprId)> =
        basis.iter().zip(vector).filter(|(_, e)| **e != g.zero()).map(|(name, e)| (name, *e)).collect();
    let mut terms = Vec::new();
    for (name, e) in there {
        let symbol = g.symbol(name);
        let element = g.sym(symbol);
        terms.push(g.mul(e, element));
    }
    let sum = g.sum(&terms);
    g.display(sum, Style::Plain)
}

/// The span of vectors, for membership tests.
struct Span {
    /// Reduced row echelon form: each row by its pivot, where it is one.
    rows: Vec<(usize, Vec<ExprId>)>,
    /// Positions of the vectors that are independent of those before.
    independent: Vec<usize>,
}

impl Span {
    fn new(g: &mut Graph, vectors: &[Vec<ExprId>]) -> Span {
        let mut span = Span { rows: Vec::new(), independent: Vec::new() };
        for (k, vector) in vectors.iter().enumerate() {
            let rest = span.rest(g, vector);
            // Numbers first: they vanish nowhere.
            let grade = |g: &Graph, e: ExprId| (g.as_rational(e).is_none(), g.reachable(&[e]).len());
            let mut best: Option<(usize, (bool, usize))> = None;
            let zero = g.zero();
            for (column, e) in rest.iter().enumerate().filter(|(_, e)| **e != zero) {
                let is_better = best.is_none_or(|(_, other)| grade(g, *e) < other);
                if is_better && g.vanishing(*e) == Vanishing::NonZero {
                    best = Some((column, grade(g, *e)));
                }
            }
            let Some((pivot, _)) = best else { continue };
            let inverse = g.powi(rest[pivot], -1);
            let row: Vec<ExprId> = rest.iter().map(|e| g.mul(*e, inverse)).collect();
            for (_, other) in &mut span.rows {
                subtract(g, other, pivot, &row);
            }
            span.rows.push((pivot, row));
            span.independent.push(k);
        }
        span
    }

    fn dim(&self) -> usize {
        self.rows.len()
    }

    /// What is left of a vector modulo the span.
    fn rest(&self, g: &mut Graph, vector: &[ExprId]) -> Vec<ExprId> {
        let mut rest = vector.to_vec();
        for (pivot, row) in &self.rows {
            subtract(g, &mut rest, *pivot, row);
        }
        rest
    }
}

/// Makes the entry of a vector at the pivot of a row zero.
fn subtract(g: &mut Graph, vector: &mut [ExprId], pivot: usize, row: &[ExprId]) {
    let factor = vector[pivot];
    if factor == g.zero() {
        return;
    }
    let zero = g.zero();
    for (entry, e) in vector.iter_mut().zip(row).filter(|(_, e)| **e != zero) {
        let product = g.mul(factor, *e);
        let difference = g.sub(*entry, product);
        *entry = g.cancel_zero(difference);
    }
}
