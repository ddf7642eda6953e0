//! Retractions of a Lie algebra to its group, by structure constants: the inverse of the right-trivialised derivative.
//!
//! ```text
//! cay(xi) = (1 - xi/2)^-1 (1 + xi/2)     dcay^-1_xi eta = eta - [xi, eta]/2 - (xi eta xi)/4
//! exp(xi)                                dexp^-1_xi eta = sum_k B_k/k! ad_xi^k eta,   B_1 = -1/2
//! ```
//!
//! `cay` is that of matrices, and a map to the group where the algebra holds `xi eta xi`: then the coefficients of that
//! product are all that there is to know about the matrices. Linear functions of a representation move with the same
//! group element where that has the same product. `exp` is a polynomial where the algebra is nilpotent.
//!
//! Deliberately does not know: Lagrangians, discrete equations, expressions of a model.
//!
//! # Source
//! Bou-Rabee and Marsden, Hamilton-Pontryagin integrators on Lie groups, part I (2009), section 4.

use hamel_expr::{ExprId, Graph, Rational};
use hamel_lang::algebra::Matrix;
use hamel_lang::spec::Retraction;

/// A retraction of an algebra.
#[derive(Clone, Debug)]
pub struct GroupMap {
    /// Which one.
    pub retraction: Retraction,
    /// A faithful representation on which the retraction is that of matrices; empty for `exp`.
    pub matrices: Vec<Matrix>,
    /// `C^c_ab` for `a`, `b`, by `c`.
    brackets: Vec<Vec<Vec<(usize, Rational)>>>,
    /// `(e_a e_b e_c + e_c e_b e_a)/2` by elements of the algebra, of the Cayley map.
    triples: Vec<Triple>,
}

/// Three elements of the algebra, the outer ones in ascending order, with a product that does not vanish.
#[derive(Clone, Debug)]
struct Triple {
    outer: [usize; 2],
    inner: usize,
    value: Vec<(usize, Rational)>,
}

/// Largest power of `ad` in a series.
const MAX_POWER: usize = 12;

fn number(n: i64) -> Rational {
    Rational::from_integer(n.into())
}

fn is_zero(q: &Rational) -> bool {
    *q == number(0)
}

impl GroupMap {
    /// The Cayley map, for an algebra by its brackets, with known representations by linear vector fields, of which the
    /// first has to move by the same group element.
    ///
    /// `moved`: matrices of the vector fields `a' = R_b a` along the elements `e_b`, such that
    /// `[R_a, R_b] = -C^c_ab R_c`.
    ///
    /// # Errors
    /// Why the algebra has no Cayley map that is known here.
    pub fn cayley(
        brackets: Vec<Vec<Vec<(usize, Rational)>>>,
        moved: &[Matrix],
        standard: Option<&[Matrix]>,
        names: &[String],
    ) -> Result<GroupMap, String> {
        let dim = brackets.len();
        let adjoint: Vec<Matrix> = (0..dim).map(|a| adjoint(&brackets, a)).collect();
        let (mut triples, mut blocks) = (Vec::new(), Vec::new());
        for part in parts(&brackets) {
            let known = [Some(moved), standard, Some(adjoint.as_slice())];
            let faithful = known.into_iter().flatten().find(|matrices| is_faithful(matrices, &part));
            match faithful {
                Some(matrices) => {
                    triples.extend(products(matrices, &part).map_err(|[a, b, c]| {
                        let [a, b, c] = [a, b, c].map(|k| names[k].as_str());
                        format!(
                            "the Cayley map leaves the group: the algebra of its matrices does not hold \
                             {a} {b} {c} + {c} {b} {a}"
                        )
                    })?);
                    let own = |a: usize| match part.contains(&a) {
                        true => matrices[a].clone(),
                        false => Matrix::zeros(matrices[a].n_rows(), matrices[a].n_rows()),
                    };
                    blocks.push((0..dim).map(own).collect::<Vec<Matrix>>());
                }
                // Translations: all products vanish.
                None if part.len() == 1 => {
                    let own = |a: usize| {
                        let mut matrix = Matrix::zeros(2, 2);
                        if part.contains(&a) {
                            matrix.set(0, 1, number(1));
                        }
                        matrix
                    };
                    blocks.push((0..dim).map(own).collect());
                }
                None => {
                    let names: Vec<&str> = part.iter().map(|k| names[*k].as_str()).collect();
                    return Err(format!(
                        "no faithful representation of the algebra of {} is known for the Cayley map",
                        names.join(", ")
                    ));
                }
            }
        }
        let matrices = (0..dim).map(|a| beside(&blocks, a)).collect();
        let map = GroupMap { retraction: Retraction::Cayley, matrices, brackets, triples };
        map.moves(moved).map(|()| map)
    }

    /// Whether the midpoint rule moves vectors by the group element of the map.
    fn moves(&self, moved: &[Matrix]) -> Result<(), String> {
        let dim = self.brackets.len();
        for a in 0..dim {
            for b in 0..dim {
                for c in a..dim {
                    let own = symmetric_product(moved, [a, b, c]);
                    let triple = self.triples.iter().find(|t| t.outer == [a, c] && t.inner == b);
                    let by_group = triple.into_iter().flat_map(|t| &t.value);
                    let rest = by_group.fold(own, |rest, (d, q)| rest.minus(&moved[*d].scaled(q)));
                    if !rest.is_zero() {
                        return Err(
                            "advected parameters are in a representation of which the Cayley map of the \
                                    group is none"
                                .to_owned(),
                        );
                    }
                }
            }
        }
        Ok(())
    }

    /// The exponential map of a nilpotent algebra.
    ///
    /// # Errors
    /// That the algebra is not nilpotent, or its series is long.
    pub fn exponential(
        brackets: Vec<Vec<Vec<(usize, Rational)>>>,
        moved: &[Matrix],
    ) -> Result<GroupMap, String> {
        let adjoint: Vec<Matrix> = (0..brackets.len()).map(|a| adjoint(&brackets, a)).collect();
        for (matrices, what) in
            [(adjoint.as_slice(), "the algebra is not nilpotent"), (moved, MOVED_BY_SERIES)]
        {
            if !vanish_in_products(matrices) {
                return Err(format!("{what}, so that the series of the exponential map does not end"));
            }
        }
        Ok(GroupMap { retraction: Retraction::Exp, matrices: Vec::new(), brackets, triples: Vec::new() })
    }

    /// `dtau^-1_zeta` transposed times a covector.
    pub fn trivialised(&self, g: &mut Graph, zeta: &[ExprId], covector: &[ExprId]) -> Vec<ExprId> {
        match self.retraction {
            Retraction::Cayley => {
                let turned = self.coadjoint(g, zeta, covector);
                let mut terms: Vec<Vec<(ExprId, Rational)>> = Vec::new();
                for (p, ad) in covector.iter().zip(turned) {
                    terms.push(vec![(*p, number(1)), (ad, number(-1) / number(2))]);
                }
                for Triple { outer: [a, c], inner, value } in &self.triples {
                    let n = if a == c { 1 } else { 2 };
                    for (d, q) in value {
                        let product = g.product(&[zeta[*a], zeta[*c], covector[*d]]);
                        terms[*inner].push((product, q * number(-n) / number(4)));
                    }
                }
                terms.iter().map(|terms| g.linear_combination(terms)).collect()
            }
            Retraction::Exp => {
                let mut terms: Vec<Vec<(ExprId, Rational)>> =
                    covector.iter().map(|p| vec![(*p, number(1))]).collect();
                let mut power = covector.to_vec();
                for b in bernoulli_over_factorial().iter().skip(1) {
                    power = self.coadjoint(g, zeta, &power);
                    if power.iter().all(|e| *e == g.zero()) {
                        break;
                    }
                    for (terms, e) in terms.iter_mut().zip(&power) {
                        terms.push((*e, b.clone()));
                    }
                }
                terms.iter().map(|terms| g.linear_combination(terms)).collect()
            }
        }
    }

    /// `(ad_zeta)^T p`: by element `b` the pairing of `p` with `[zeta, e_b]`.
    fn coadjoint(&self, g: &mut Graph, zeta: &[ExprId], p: &[ExprId]) -> Vec<ExprId> {
        let dim = zeta.len();
        let mut result = Vec::with_capacity(dim);
        for b in 0..dim {
            let mut terms = Vec::new();
            for (a, zeta) in zeta.iter().enumerate() {
                for (c, q) in &self.brackets[a][b] {
                    terms.push((g.mul(*zeta, p[*c]), q.clone()));
                }
            }
            result.push(g.linear_combination(&terms));
        }
        result
    }

    /// Largest power of vector fields in the exponential series of what the group moves.
    pub const fn max_power() -> usize {
        MAX_POWER
    }
}

const MOVED_BY_SERIES: &str = "what the group moves is in a representation that is not nilpotent";

/// `B_k/k!` with `B_1 = -1/2`, up to the largest power: of `x/(exp(x) - 1)`.
fn bernoulli_over_factorial() -> Vec<Rational> {
    // sum_{j <= k} b_j / (k - j + 1)! = 0 for k > 0
    let mut factorials = vec![number(1)];
    for k in 1..=MAX_POWER as i64 + 1 {
        let next = factorials[factorials.len() - 1].clone() * number(k);
        factorials.push(next);
    }
    let mut b = vec![number(1)];
    for k in 1..=MAX_POWER {
        let known: Rational = b.iter().enumerate().map(|(j, b)| b / &factorials[k - j + 1]).sum();
        b.push(-known);
    }
    b
}

/// The matrix of `ad_a`: column `b` has `[e_a, e_b]`.
fn adjoint(brackets: &[Vec<Vec<(usize, Rational)>>], a: usize) -> Matrix {
    let mut matrix = Matrix::zeros(brackets.len(), brackets.len());
    for (b, value) in brackets[a].iter().enumerate() {
        value.iter().for_each(|(c, q)| matrix.set(*c, b, q.clone()));
    }
    matrix
}

/// Elements of the basis in ideals whose sum is direct: what brackets relate.
fn parts(brackets: &[Vec<Vec<(usize, Rational)>>]) -> Vec<Vec<usize>> {
    let dim = brackets.len();
    let mut part: Vec<usize> = (0..dim).collect();
    for a in 0..dim {
        for b in 0..dim {
            for (c, _) in &brackets[a][b] {
                for other in [b, *c] {
                    let (from, to) = (part[other], part[a]);
                    part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
                }
            }
        }
    }
    let mut found: Vec<Vec<usize>> = Vec::new();
    for a in 0..dim {
        match found.iter_mut().find(|own| part[own[0]] == part[a]) {
            Some(own) => own.push(a),
            None => found.push(vec![a]),
        }
    }
    found
}

/// Matrices of an element, one block after the other.
fn beside(blocks: &[Vec<Matrix>], a: usize) -> Matrix {
    let n: usize = blocks.iter().map(|block| block[a].n_rows()).sum();
    let (mut matrix, mut at) = (Matrix::zeros(n, n), 0);
    for block in blocks.iter().map(|block| &block[a]) {
        for i in 0..block.n_rows() {
            for j in 0..block.n_rows() {
                matrix.set(at + i, at + j, block.get(i, j).clone());
            }
        }
        at += block.n_rows();
    }
    matrix
}

fn entries(matrix: &Matrix) -> Vec<Rational> {
    (0..matrix.n_rows()).flat_map(|i| matrix.row(i).iter().cloned()).collect()
}

fn is_faithful(matrices: &[Matrix], part: &[usize]) -> bool {
    let rows: Vec<Vec<Rational>> = part.iter().filter_map(|a| Some(entries(matrices.get(*a)?))).collect();
    rows.len() == part.len()
        && rows.first().is_some_and(|row| !row.is_empty())
        && Matrix::from_rows(&rows).is_some_and(|m| m.rank() == part.len())
}

/// `(A B C + C B A)/2`.
fn symmetric_product(matrices: &[Matrix], [a, b, c]: [usize; 3]) -> Matrix {
    let [a, b, c] = [a, b, c].map(|k| &matrices[k]);
    let (forward, backward) = (a.times(b).times(c), c.times(b).times(a));
    forward.minus(&backward.scaled(&number(-1))).scaled(&(number(1) / number(2)))
}

/// The products of three elements of a part by its elements; the first three whose product is no element.
fn products(matrices: &[Matrix], part: &[usize]) -> Result<Vec<Triple>, [usize; 3]> {
    // Columns: the elements, then a product.
    let basis: Vec<Vec<Rational>> = part.iter().map(|a| entries(&matrices[*a])).collect();
    let n_entries = basis.first().map_or(0, Vec::len);
    let mut found = Vec::new();
    for (k, &a) in part.iter().enumerate() {
        for &b in part {
            for &c in &part[k..] {
                let product = entries(&symmetric_product(matrices, [a, b, c]));
                if product.iter().all(is_zero) {
                    continue;
                }
                let row = |i: usize| -> Vec<Rational> {
                    basis.iter().chain([&product]).map(|column| column[i].clone()).collect()
                };
                let rows: Vec<Vec<Rational>> = (0..n_entries).map(row).collect();
                let (echelon, pivots) = Matrix::from_rows(&rows).ok_or([a, b, c])?.echelon();
                if pivots.contains(&part.len()) {
                    return Err([a, b, c]);
                }
                let value = part.iter().enumerate().map(|(k, d)| (*d, echelon.get(k, part.len()).clone()));
                let value = value.filter(|(_, q)| !is_zero(q)).collect();
                found.push(Triple { outer: [a, c], inner: b, value });
            }
        }
    }
    Ok(found)
}

/// Whether all products of so many of the matrices vanish.
fn vanish_in_products(matrices: &[Matrix]) -> bool {
    let mut left: Vec<Matrix> = matrices.iter().filter(|m| !m.is_zero()).cloned().collect();
    for _ in 0..MAX_POWER {
        if left.is_empty() {
            return true;
        }
        // A basis of the span of the products is enough.
        let products: Vec<Matrix> = left.iter().flat_map(|l| matrices.iter().map(|m| l.times(m))).collect();
        let rows: Vec<Vec<Rational>> = products.iter().map(entries).collect();
        let (n, Some(all)) = (matrices[0].n_rows(), Matrix::from_rows(&rows)) else { return false };
        let (echelon, pivots) = all.echelon();
        left = (0..pivots.len())
            .map(|k| {
                let mut matrix = Matrix::zeros(n, n);
                echelon.row(k).iter().enumerate().for_each(|(e, q)| matrix.set(e / n, e % n, q.clone()));
                matrix
            })
            .collect();
    }
    left.is_empty()
}
