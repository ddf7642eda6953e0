//! Skew brackets on a finite-dimensional space, by structure constants.
//!
//! A Lie algebra is one for which the Jacobi identity holds; the bracket of nonholonomic mechanics, projected along a
//! constraint, need not be one. Deliberately does not know: blocks of a basis, names of algebras.

use std::collections::BTreeMap;

use hamel_expr::error::{Error, spell_vector};
use hamel_expr::{Rational, Residue, Scalar};

/// `[e_a, e_b] = sum_k q_k e_{c_k}` as `(a, b, [(c_k, q_k), ..])`.
pub type Bracket<Q = Rational> = (usize, usize, Vec<(usize, Q)>);

/// A skew-symmetric bracket `[e_a, e_b] = C^c_ab e_c`, with or without the Jacobi identity.
///
/// ```
/// use hamel_expr::Rational;
/// use hamel_lang::algebra::SkewBracket;
/// let one = || Rational::from_integer(1.into());
/// let basis = ["a", "b", "c"].map(str::to_owned).to_vec();
/// let bracket = SkewBracket::new(basis, &[(0, 1, vec![(1, one())]), (1, 2, vec![(0, one())])]).unwrap();
/// assert_eq!(bracket.jacobi_violations().len(), 1);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SkewBracket<Q = Rational> {
    pub(super) basis: Vec<String>,
    /// Non-zero brackets of pairs `a < b`, as sparse sorted vectors.
    pub(super) brackets: BTreeMap<(usize, usize), Vec<(usize, Q)>>,
}

impl<Q: Scalar> SkewBracket<Q> {
    /// A bracket by its values on a basis; pairs that are left out commute.
    ///
    /// # Errors
    /// All of [`Error::NotAntisymmetric`].
    pub fn new(basis: Vec<String>, brackets: &[Bracket<Q>]) -> Result<SkewBracket<Q>, Vec<Error>> {
        let mut errors = Vec::new();
        let mut table: BTreeMap<(usize, usize), Vec<(usize, Q)>> = BTreeMap::new();
        for (a, b, value) in brackets {
            let mut sums: BTreeMap<usize, Q> = BTreeMap::new();
            for (c, q) in value {
                let sum = sums.entry(*c).or_insert_with(Q::zero);
                *sum = sum.plus(q);
            }
            let signed = |q: Q| if a > b { q.negated() } else { q };
            let sparse: Vec<_> =
                sums.into_iter().filter(|(_, q)| !q.is_zero()).map(|(c, q)| (c, signed(q))).collect();
            let pair = (*a.min(b), *a.max(b));
            let clash = match table.get(&pair) {
                Some(before) => *before != sparse,
                None => a == b && !sparse.is_empty(),
            };
            if clash {
                errors.push(Error::NotAntisymmetric { a: basis[*a].clone(), b: basis[*b].clone() });
            } else if a != b {
                table.insert(pair, sparse);
            }
        }
        table.retain(|_, v| !v.is_empty());
        if errors.is_empty() { Ok(SkewBracket { basis, brackets: table }) } else { Err(errors) }
    }

    /// The dimension.
    pub fn dim(&self) -> usize {
        self.basis.len()
    }

    /// Names of the basis elements.
    pub fn basis(&self) -> &[String] {
        &self.basis
    }

    /// `[e_a, e_b]` as a sparse vector.
    pub fn of(&self, a: usize, b: usize) -> Vec<(usize, Q)> {
        if a <= b {
            self.brackets.get(&(a, b)).cloned().unwrap_or_default()
        } else {
            self.of(b, a).into_iter().map(|(c, q)| (c, q.negated())).collect()
        }
    }

    /// The non-zero brackets of pairs `a < b`.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize, &[(usize, Q)])> {
        self.brackets.iter().map(|((a, b), v)| (*a, *b, v.as_slice()))
    }

    /// `[x, y]` of two vectors.
    pub fn of_vectors(&self, x: &[Q], y: &[Q]) -> Vec<Q> {
        let mut result = vec![Q::zero(); self.dim()];
        for (a, b, value) in self.pairs() {
            if (x[a].is_zero() || y[b].is_zero()) && (x[b].is_zero() || y[a].is_zero()) {
                continue;
            }
            let weight = x[a].times(&y[b]).minus(&x[b].times(&y[a]));
            if weight.is_zero() {
                continue;
            }
            for (c, q) in value {
                result[*c] = result[*c].plus(&weight.times(q));
            }
        }
        result
    }

    /// The bracket with every structure constant mapped.
    pub(super) fn map<P>(&self, mut f: impl FnMut(&Q) -> P) -> SkewBracket<P> {
        let value = |(pair, value): (&(usize, usize), &Vec<(usize, Q)>)| {
            (*pair, value.iter().map(|(c, q)| (*c, f(q))).collect())
        };
        SkewBracket { basis: self.basis.clone(), brackets: self.brackets.iter().map(value).collect() }
    }

    /// The bracket of residues; none where a structure constant has none.
    fn residues(&self) -> Option<SkewBracket<Residue>> {
        let mut brackets = BTreeMap::new();
        for (pair, value) in &self.brackets {
            let image: Option<Vec<(usize, Residue)>> =
                value.iter().map(|(c, q)| Some((*c, q.residue()?))).collect();
            brackets.insert(*pair, image?);
        }
        Some(SkewBracket { basis: self.basis.clone(), brackets })
    }

    /// What keeps the bracket from being that of a Lie algebra: every triple for which the Jacobi identity fails.
    ///
    /// Residuals that vanish among residues are zero, which is found without writing one of them.
    pub fn jacobi_violations(&self) -> Vec<Error> {
        if self.residues().is_some_and(|image| image.residuals().next().is_none()) {
            return Vec::new();
        }
        let residuals = self.residuals().map(|(triple, residual)| {
            let mut dense = vec![Q::zero(); self.dim()];
            residual.into_iter().for_each(|(e, q)| dense[e] = q);
            Error::JacobiViolated {
                triple: triple.map(|k| self.basis[k].clone()),
                residual: spell_vector(&self.basis, &dense),
            }
        });
        residuals.collect()
    }

    /// Triples with the components of `[[a, b], c] + [[b, c], a] + [[c, a], b]` where they do not vanish.
    ///
    /// The sum is antisymmetric in the triple, so every non-zero `[a, b]` adds its part to the sorted triple with a
    /// sign. One first element after the other: what is kept grows with the square of the dimension.
    fn residuals(&self) -> impl Iterator<Item = ([usize; 3], BTreeMap<usize, Q>)> {
        let n = self.dim();
        // Brackets of all pairs, as that of the pair in order and whether it is the opposite of that.
        let mut table: Vec<(&[(usize, Q)], bool)> = vec![(&[], false); n * n];
        for (a, b, value) in self.pairs() {
            (table[a * n + b], table[b * n + a]) = ((value, false), (value, true));
        }
        (0..n).flat_map(move |a| {
            let mut residuals: Vec<Vec<(usize, Q)>> = vec![Vec::new(); n * n];
            let mut add = |(b, c): (usize, usize), value: &[(usize, Q)], third: usize, negative: bool| {
                for (d, q) in value {
                    let (outer, is_opposite) = table[d * n + third];
                    for (e, p) in outer {
                        let term = q.times(p);
                        let term = if negative != is_opposite { term.negated() } else { term };
                        let own = &mut residuals[b * n + c];
                        match own.iter_mut().find(|(component, _)| component == e) {
                            Some((_, sum)) => *sum = sum.plus(&term),
                            None => own.push((*e, term)),
                        }
                    }
                }
            };
            for b in a + 1..n {
                let (value, _) = table[a * n + b];
                (a + 1..b).for_each(|c| add((c, b), value, c, true));
                (b + 1..n).for_each(|c| add((b, c), value, c, false));
                (b + 1..n).for_each(|c| add((b, c), table[b * n + c].0, a, false));
            }
            let triples = residuals.into_iter().enumerate();
            triples
                .filter(|(_, residual)| residual.iter().any(|(_, q)| !q.is_zero()))
                .map(move |(k, residual)| ([a, k / n, k % n], residual.into_iter().collect()))
        })
    }
}

impl<Q> Default for SkewBracket<Q> {
    fn default() -> SkewBracket<Q> {
        SkewBracket { basis: Vec::new(), brackets: BTreeMap::new() }
    }
}
