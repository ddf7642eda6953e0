//! A Hamiltonian as a sum of functions of commuting linear forms.
//!
//! Deliberately does not know: flows, programs.

use std::collections::{BTreeMap, BTreeSet};

use super::poisson::AffineBracket;
use hamel_expr::{ExprId, Graph, Rational, SymbolId};

/// A linear form of the state, and the derivative of a part of the Hamiltonian by its value.
#[derive(Clone, Debug)]
pub(super) struct Term {
    /// The coefficients `v` of the form `v . y`, of parameters alone.
    pub(super) form: Vec<ExprId>,
    /// A function of forms of the same piece.
    pub(super) frequency: Frequency,
}

/// The derivative of a part of the Hamiltonian by the value of a linear form.
#[derive(Clone, Copy, Debug)]
pub(super) enum Frequency {
    /// This number times the form: the part is `weight/2 (v . y)^2`.
    OfSquare(ExprId),
    /// This function of the forms of the piece.
    Value(ExprId),
}

impl Term {
    /// The derivative of the part of the Hamiltonian by the form.
    pub(super) fn rate(&self, g: &mut Graph, symbols: &[SymbolId]) -> ExprId {
        match self.frequency {
            Frequency::Value(e) => e,
            Frequency::OfSquare(weight) => {
                let y: Vec<ExprId> = symbols.iter().map(|s| g.sym(*s)).collect();
                let value = g.dot(&self.form, &y);
                g.mul(weight, value)
            }
        }
    }
}

/// A part of the Hamiltonian, a function `h` of forms that commute: `dh = sum_a frequency_a form_a`.
#[derive(Clone, Debug, Default)]
pub(super) struct Piece {
    pub(super) terms: Vec<Term>,
}

/// Sets of more components are not searched for the largest subset of commuting ones by trying all.
const MAX_TRIED: usize = 12;

/// The Hamiltonian by its derivatives: `dH/dy_i = linear_i + sum_j quadratic_ij y_j + ..`.
pub(super) struct Hamiltonian<'a> {
    pub(super) bracket: &'a AffineBracket,
    pub(super) symbols: &'a [SymbolId],
    /// `dH/dy_i`.
    slopes: Vec<ExprId>,
    linear: Vec<ExprId>,
    quadratic: Vec<Vec<ExprId>>,
    /// Components of which `H` is a function that is no polynomial of second degree.
    curved: Vec<Vec<usize>>,
}

impl<'a> Hamiltonian<'a> {
    /// The parts of a Hamiltonian with the derivatives `slopes`.
    ///
    /// # Errors
    /// The positions of two components that do not commute, of which `H` is no polynomial of second degree.
    pub(super) fn new(
        g: &mut Graph,
        bracket: &'a AffineBracket,
        symbols: &'a [SymbolId],
        slopes: Vec<ExprId>,
    ) -> Result<Hamiltonian<'a>, (usize, usize)> {
        let n = symbols.len();
        let zeros: BTreeMap<SymbolId, ExprId> = symbols.iter().map(|s| (*s, g.zero())).collect();
        let mut quadratic = vec![vec![g.zero(); n]; n];
        let mut links: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
        for i in 0..n {
            for j in i..n {
                let slope = g.diff(slopes[i], symbols[j]);
                let slope = g.cancel_zero(slope);
                let is_constant = symbols.iter().all(|x| {
                    let change = g.diff(slope, *x);
                    g.is_zero(change)
                });
                match g.subs(slope, &zeros) {
                    Ok(value) if is_constant => {
                        (quadratic[i][j], quadratic[j][i]) = (value, value);
                    }
                    _ => {
                        links[i].insert(j);
                        links[j].insert(i);
                    }
                }
            }
        }
        let curved = linked(&links);
        for set in &curved {
            for (place, i) in set.iter().enumerate() {
                for j in &set[place + 1..] {
                    if bracket.entries[*i][*j] != g.zero() {
                        return Err((*i, *j));
                    }
                }
                // Of curved sets the whole function is one part.
                for j in set {
                    quadratic[*i][*j] = g.zero();
                }
            }
        }
        let is_curved = |i: usize| curved.iter().any(|set| set.contains(&i));
        let linear = (0..n).map(|i| match g.subs(slopes[i], &zeros) {
            Ok(value) if !is_curved(i) => g.cancel_zero(value),
            _ => g.zero(),
        });
        let linear = linear.collect();
        Ok(Hamiltonian { bracket, symbols, slopes, linear, quadratic, curved })
    }

    /// The pieces, as few as are found; for each Casimir, given by its second derivatives, what times it has been
    /// left out of the Hamiltonian, which moves nothing.
    pub(super) fn pieces(
        &self,
        g: &mut Graph,
        casimirs: &[Vec<Vec<ExprId>>],
    ) -> Option<(Vec<Piece>, Vec<ExprId>)> {
        let mut factors = vec![g.zero(); casimirs.len()];
        let mut best = self.of_quadratic(g, &self.quadratic)?;
        let mut current = self.quadratic.clone();
        for (casimir, second) in casimirs.iter().enumerate() {
            let mut found = None;
            for i in (0..self.symbols.len()).rev() {
                if second[i][i] == g.zero() || current[i][i] == g.zero() {
                    continue;
                }
                let Ok(factor) = g.div(current[i][i], second[i][i]) else { continue };
                let rest = difference(g, &current, factor, second);
                let Some(pieces) = self.of_quadratic(g, &rest) else { continue };
                // What is left may vanish for some parameters, and is not divided by.
                let terms = pieces.iter().flat_map(|piece| &piece.terms);
                let divides = terms.flat_map(|term| &term.form).any(|e| g.as_rational(*e).is_none());
                if pieces.len() < best.len() && !divides {
                    best = pieces;
                    found = Some((factor, rest));
                }
            }
            if let Some((factor, rest)) = found {
                factors[casimir] = factor;
                current = rest;
            }
        }
        Some((best, factors))
    }

    /// The pieces with another quadratic part.
    fn of_quadratic(&self, g: &mut Graph, quadratic: &[Vec<ExprId>]) -> Option<Vec<Piece>> {
        let n = self.symbols.len();
        let mut terms: Vec<Vec<Term>> = Vec::new();
        for set in &self.curved {
            let others = (0..n).filter(|i| !set.contains(i)).map(|i| (self.symbols[i], g.zero()));
            let others: BTreeMap<SymbolId, ExprId> = others.collect();
            let mut own = Vec::new();
            for i in set {
                let frequency = g.subs(self.slopes[*i], &others).ok()?;
                own.push(Term { form: self.unit(g, *i), frequency: Frequency::Value(frequency) });
            }
            terms.push(own);
        }
        self.squares(g, quadratic.to_vec(), &mut terms)?;
        self.add_linear(g, &mut terms);
        let mut pieces: Vec<Piece> = Vec::new();
        for own in terms {
            let fits = |g: &mut Graph, piece: &Piece| {
                own.iter().all(|a| piece.terms.iter().all(|b| self.bracket.commute(g, &a.form, &b.form)))
            };
            match pieces.iter().position(|piece| fits(g, piece)) {
                Some(place) => pieces[place].terms.extend(own),
                None => pieces.push(Piece { terms: own }),
            }
        }
        Some(pieces)
    }

    /// The form of one component.
    fn unit(&self, g: &Graph, i: usize) -> Vec<ExprId> {
        (0..self.symbols.len()).map(|k| if k == i { g.one() } else { g.zero() }).collect()
    }

    /// The linear part: added to the frequencies of its components where these are forms already, a form of its own of
    /// the rest.
    fn add_linear(&self, g: &mut Graph, terms: &mut Vec<Vec<Term>>) {
        let mut rest = self.linear.clone();
        for i in 0..rest.len() {
            if rest[i] == g.zero() {
                continue;
            }
            let unit = self.unit(g, i);
            if let Some(term) = terms.iter_mut().flatten().find(|term| term.form == unit) {
                let rate = term.rate(g, self.symbols);
                term.frequency = Frequency::Value(g.add(rate, rest[i]));
                rest[i] = g.zero();
            }
        }
        if rest.iter().any(|e| *e != g.zero()) {
            terms.push(vec![Term { form: rest, frequency: Frequency::Value(g.one()) }]);
        }
    }

    /// Writes a quadratic form as quadratic forms of commuting components and squares of linear forms:
    ///
    /// ```text
    /// 1/2 y . Q y = 1/2 Q_pp (y_p + sum_j Q_pj/Q_pp y_j)^2 + rest without y_p
    /// ```
    ///
    /// Components are eliminated until what is left commutes.
    fn squares(
        &self,
        g: &mut Graph,
        mut quadratic: Vec<Vec<ExprId>>,
        terms: &mut Vec<Vec<Term>>,
    ) -> Option<()> {
        let n = self.symbols.len();
        loop {
            let links = (0..n).map(|i| (0..n).filter(|j| quadratic[i][*j] != g.zero()).collect());
            let links: Vec<BTreeSet<usize>> = links.collect();
            let sets = linked(&links);
            let mut open = None;
            for set in sets {
                let kept = self.commuting(g, &set);
                if kept.len() == set.len() {
                    let mut own = Vec::new();
                    for i in &set {
                        let y: Vec<ExprId> = set.iter().map(|j| g.sym(self.symbols[*j])).collect();
                        let row: Vec<ExprId> = set.iter().map(|j| quadratic[*i][*j]).collect();
                        let frequency = Frequency::Value(g.dot(&row, &y));
                        own.push(Term { form: self.unit(g, *i), frequency });
                    }
                    terms.push(own);
                    for i in &set {
                        quadratic[*i].fill(g.zero());
                    }
                } else if open.is_none() {
                    open = Some((set, kept));
                }
            }
            let Some((set, kept)) = open else { return Some(()) };
            // The one with the fewest others in its square, of those that do not commute with what is kept.
            let n_links = |i: &usize| links[*i].len();
            let has_square = |i: &&usize| quadratic[**i][**i] != g.zero();
            let first =
                set.iter().filter(|i| !kept.contains(i)).filter(has_square).min_by_key(|i| n_links(i));
            let pivot = first.or_else(|| set.iter().filter(has_square).min_by_key(|i| n_links(i)));
            match pivot.copied() {
                Some(p) => {
                    let weight = quadratic[p][p];
                    let inverse = g.powi(weight, -1);
                    let row = quadratic[p].clone();
                    let form: Vec<ExprId> = row.iter().map(|e| g.mul(*e, inverse)).collect();
                    let own: Vec<usize> = (0..n).filter(|i| row[*i] != g.zero()).collect();
                    for &i in &own {
                        for &j in &own {
                            let product = g.mul(row[i], form[j]);
                            let difference = g.sub(quadratic[i][j], product);
                            quadratic[i][j] = g.cancel_zero(difference);
                        }
                    }
                    terms.push(vec![Term { form, frequency: Frequency::OfSquare(weight) }]);
                }
                None => {
                    // Q y_i y_j = Q/4 (y_i + y_j)^2 - Q/4 (y_i - y_j)^2
                    let (i, j) = set.iter().find_map(|i| Some((*i, *links[*i].iter().next()?)))?;
                    let weight = g.scale(quadratic[i][j], &Rational::new(1.into(), 2.into()));
                    (quadratic[i][j], quadratic[j][i]) = (g.zero(), g.zero());
                    for sign in [1, -1] {
                        let mut form = self.unit(g, i);
                        form[j] = g.int(sign);
                        let weight = g.scale(weight, &Rational::from_integer(sign.into()));
                        terms.push(vec![Term { form, frequency: Frequency::OfSquare(weight) }]);
                    }
                }
            }
        }
    }

    /// A largest subset of components that commute with each other; in large sets one that is not part of a larger one.
    fn commuting(&self, g: &Graph, set: &[usize]) -> Vec<usize> {
        let commutes = |i: usize, j: usize| self.bracket.entries[i][j] == g.zero();
        if set.len() > MAX_TRIED {
            let mut kept: Vec<usize> = Vec::new();
            for i in set.iter().rev() {
                if kept.iter().all(|j| commutes(*i, *j)) {
                    kept.push(*i);
                }
            }
            return kept;
        }
        let subset = |code: usize| -> Vec<usize> {
            set.iter().enumerate().filter(|(k, _)| code >> k & 1 == 1).map(|(_, i)| *i).collect()
        };
        let is_commuting = |list: &Vec<usize>| list.iter().all(|i| list.iter().all(|j| commutes(*i, *j)));
        let subsets = (0..1_usize << set.len()).map(subset).filter(is_commuting);
        subsets.max_by_key(Vec::len).unwrap_or_default()
    }
}

/// The sets that links connect, those of one member only where it is linked with itself.
fn linked(links: &[BTreeSet<usize>]) -> Vec<Vec<usize>> {
    let mut seen = BTreeSet::new();
    let mut sets = Vec::new();
    for (start, own) in links.iter().enumerate() {
        if own.is_empty() || !seen.insert(start) {
            continue;
        }
        let (mut members, mut open) = (BTreeSet::from([start]), vec![start]);
        while let Some(i) = open.pop() {
            for k in &links[i] {
                if seen.insert(*k) {
                    members.insert(*k);
                    open.push(*k);
                }
            }
        }
        sets.push(members.into_iter().collect());
    }
    sets
}

/// `a - factor b`, with zeros where entries vanish identically.
fn difference(g: &mut Graph, a: &[Vec<ExprId>], factor: ExprId, b: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
    let entry = |g: &mut Graph, a: ExprId, b: ExprId| {
        let product = g.mul(factor, b);
        let difference = g.sub(a, product);
        g.cancel_zero(difference)
    };
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| entry(g, *a, *b)).collect()).collect()
}
