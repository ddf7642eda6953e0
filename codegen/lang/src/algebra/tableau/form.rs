//! Quadratic functions of unknowns that are least for the values looked for, and the steps of their elimination.
//!
//! `1/2 H_ij d_i d_j + g_i d_i` is the symmetric tableau `H d + g = 0` with each entry once. An unknown that follows
//! from others, `d_p = c_pi d_i`, is substituted: `H + C^T H C`, a congruence. An unknown that is free is eliminated by
//! the minimum over it, `d = -(g + H_j d_j)/H`, one step of `L D L^T`.
//!
//! Deliberately does not know: what the unknowns are, in which order they are eliminated.
//!
//! # Source
//! Guyan 1965, Reduction of stiffness and mass matrices, AIAA Journal 3 (the congruence); Featherstone 2008, Rigid Body
//! Dynamics Algorithms, chapters 6 and 7 (the orders for bodies).

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Graph, SectionWriter};

use super::grade::Judge;

/// The unknowns that another one follows from, with their factors.
pub type Slopes = [(usize, ExprId)];

/// Names entries as they are made.
pub struct Pen<'a> {
    /// Owner of the expressions.
    pub g: &'a mut Graph,
    /// What the definitions are written with.
    pub writer: &'a mut SectionWriter,
    /// Of the unknowns.
    pub names: &'a [String],
    /// What entries of `H` and of `g` are called.
    pub stems: [&'static str; 2],
}

impl Pen<'_> {
    fn entry(&mut self, i: usize, j: usize, e: ExprId) -> ExprId {
        let name = format!("{}_{}_{}", self.stems[0], self.names[i], self.names[j]);
        self.writer.define(self.g, &name, e)
    }

    fn force(&mut self, i: usize, e: ExprId) -> ExprId {
        self.named(self.stems[1], i, e)
    }

    fn named(&mut self, stem: &str, i: usize, e: ExprId) -> ExprId {
        self.writer.define(self.g, &format!("{stem}_{}", self.names[i]), e)
    }
}

/// `d = -z - u_j d_j` of an unknown.
#[derive(Clone, Debug)]
pub struct Least {
    /// What is divided by.
    pub pivot: ExprId,
    /// `g` divided by it.
    pub z: ExprId,
    /// `H_j` divided by it.
    pub u: Vec<(usize, ExprId)>,
}

/// `1/2 H_ij d_i d_j + g_i d_i`.
#[derive(Clone, Debug, Default)]
pub struct QuadraticForm {
    /// `H_ij` for `i <= j`; others vanish.
    h: BTreeMap<(usize, usize), ExprId>,
    /// `g_i`.
    pub g: Vec<ExprId>,
}

fn key(i: usize, j: usize) -> (usize, usize) {
    (i.min(j), i.max(j))
}

impl QuadraticForm {
    /// `1/2 d^T H d + g d` of a symmetric matrix.
    pub fn new(graph: &Graph, matrix: &[Vec<ExprId>], g: Vec<ExprId>) -> QuadraticForm {
        let entries = (0..matrix.len()).flat_map(|i| (i..matrix.len()).map(move |j| (i, j)));
        let h = entries.map(|(i, j)| ((i, j), matrix[i][j])).filter(|(_, e)| *e != graph.zero()).collect();
        QuadraticForm { h, g }
    }

    /// `H_ij`; none where it is zero.
    pub fn entry(&self, i: usize, j: usize) -> Option<ExprId> {
        self.h.get(&key(i, j)).copied()
    }

    /// The unknowns whose entry with `i` is not zero, but for `i`.
    pub fn beside(&self, i: usize) -> Vec<usize> {
        let others = self.h.keys().filter_map(|(a, b)| match (*a == i, *b == i) {
            (true, false) => Some(*b),
            (false, true) => Some(*a),
            _ => None,
        });
        others.collect()
    }

    /// Adds to `H_ij`.
    pub fn increase(&mut self, g: &mut Graph, i: usize, j: usize, term: ExprId) {
        if term != g.zero() {
            let zero = g.zero();
            let entry = self.h.entry(key(i, j)).or_insert(zero);
            *entry = g.add(*entry, term);
        }
    }

    fn take(&mut self, i: usize, j: usize) -> Option<ExprId> {
        self.h.remove(&key(i, j))
    }

    /// Gives an entry its name.
    fn settle(&mut self, pen: &mut Pen<'_>, i: usize, j: usize) {
        if let Some(e) = self.entry(i, j) {
            let named = pen.entry(i, j, e);
            if named == pen.g.zero() {
                self.h.remove(&key(i, j));
            } else {
                self.h.insert(key(i, j), named);
            }
        }
    }

    /// Takes out a block of unknowns that follow from others, `d_p = c_pi d_i`: `H_ij + c_pi H_pq c_qj + c_pi H_pj +
    /// H_ip c_pj` and `g_i + c_pi g_p`.
    pub fn substitute(&mut self, pen: &mut Pen<'_>, block: &[(usize, &Slopes)]) {
        let is_in_block: BTreeSet<usize> = block.iter().map(|(p, _)| *p).collect();
        let mut cross: BTreeMap<(usize, usize), ExprId> = BTreeMap::new();
        let mut own: BTreeMap<(usize, usize), ExprId> = BTreeMap::new();
        for p in &is_in_block {
            for j in self.beside(*p) {
                if !is_in_block.contains(&j)
                    && let Some(e) = self.take(*p, j)
                {
                    cross.insert((*p, j), e);
                }
            }
        }
        for (n, (p, _)) in block.iter().enumerate() {
            for (q, _) in &block[n..] {
                if let Some(e) = self.take(*p, *q) {
                    own.insert((*p, *q), e);
                    own.insert((*q, *p), e);
                }
            }
        }
        let all = block.iter().flat_map(|(_, slopes)| slopes.iter().map(|(i, _)| *i));
        let parents: Vec<usize> = all.collect::<BTreeSet<usize>>().into_iter().collect();
        // `H_pq c_qj + H_pj`
        let mut whole: BTreeMap<(usize, usize), ExprId> = BTreeMap::new();
        for (p, _) in block {
            for j in &parents {
                let mut terms = Vec::new();
                for (q, slopes) in block {
                    let slope = slopes.iter().find(|(i, _)| i == j);
                    if let (Some((_, slope)), Some(h)) = (slope, own.get(&(*p, *q))) {
                        terms.push(pen.g.mul(*h, *slope));
                    }
                }
                terms.extend(cross.get(&(*p, *j)));
                let sum = pen.g.sum(&terms);
                whole.insert((*p, *j), pen.entry(*p, *j, sum));
            }
        }
        let mut terms: BTreeMap<(usize, usize), Vec<ExprId>> = BTreeMap::new();
        for (p, slopes) in block {
            for (i, slope) in *slopes {
                for j in parents.iter().filter(|j| *j >= i) {
                    terms.entry((*i, *j)).or_default().push(pen.g.mul(*slope, whole[&(*p, *j)]));
                }
                for ((_, j), e) in cross.range((*p, 0)..=(*p, usize::MAX)) {
                    // Those beside a parent are in `whole` on one side of the diagonal.
                    if !parents.contains(j) || j <= i {
                        terms.entry(key(*i, *j)).or_default().push(pen.g.mul(*slope, *e));
                    }
                }
            }
        }
        for ((i, j), list) in terms {
            let sum = pen.g.sum(&list);
            self.increase(pen.g, i, j, sum);
            self.settle(pen, i, j);
        }
        for i in &parents {
            let mut terms = vec![self.g[*i]];
            for (p, slopes) in block {
                if let Some((_, slope)) = slopes.iter().find(|(j, _)| j == i) {
                    terms.push(pen.g.mul(*slope, self.g[*p]));
                }
            }
            let sum = pen.g.sum(&terms);
            self.g[*i] = pen.force(*i, sum);
        }
    }

    /// Eliminates an unknown by the minimum over it; none where its pivot is not proved not to vanish identically.
    pub fn least(&mut self, pen: &mut Pen<'_>, rate: usize) -> Option<Least> {
        let pivot = self.take(rate, rate)?;
        let pivot = pen.named("D", rate, pivot);
        Judge::BLIND.grade(pen.g, pivot).filter(|(grade, _)| grade.is_proved())?;
        let inverse = pen.g.powi(pivot, -1);
        let mut row = Vec::new();
        for j in self.beside(rate) {
            let Some(e) = self.take(rate, j) else { continue };
            let u = pen.g.mul(e, inverse);
            let name = format!("U_{}_{}", pen.names[rate], pen.names[j]);
            let u = pen.writer.define(pen.g, &name, u);
            row.push((j, e, u));
        }
        for (n, (i, e, _)) in row.iter().enumerate() {
            for (j, _, u) in &row[..=n] {
                let product = pen.g.mul(*u, *e);
                let product = pen.g.neg(product);
                self.increase(pen.g, *i, *j, product);
                self.settle(pen, *i, *j);
            }
        }
        let force = pen.force(rate, self.g[rate]);
        let z = pen.g.mul(force, inverse);
        let z = pen.named("z", rate, z);
        for (i, e, _) in &row {
            let product = pen.g.mul(*e, z);
            let left = pen.g.sub(self.g[*i], product);
            self.g[*i] = pen.force(*i, left);
        }
        let u = row.into_iter().map(|(j, _, u)| (j, u)).collect();
        Some(Least { pivot, z, u })
    }
}
