//! What is found out about a nonholonomic bracket and its motion: Jacobi, rank, Casimirs, an invariant measure, a
//! multiplier with which the bracket is one of Poisson.
//!
//! Does not know: how brackets are derived, how anything is shown.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use crate::reduction::StateKind;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Rational, Stage, SymbolId, Vanishing, independent_rows, rational_relations};
use hamel_lang::spec::Want;

use super::bracket::Bracket;
use super::chart::Chart;
use super::equations::{Equations, OutputKind};
use super::measure::{Density, Motion, candidates, invariant_measure, one_form, powers};

/// Whether a bracket satisfies the Jacobi identity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Jacobi {
    /// It does.
    Holds,
    /// It does not: the first three components of the state for which it fails.
    Fails([String; 3]),
    /// It could not be decided for these.
    Unknown([String; 3]),
}

/// What was found out about the bracket of [`Equations`], on the states that satisfy the constraints.
#[derive(Clone, Debug)]
pub struct BracketFacts {
    /// Owner of all expressions here, which are written in the coordinates alone.
    pub graph: Graph,
    /// Names of the components of the state that are coordinates of such states.
    pub coordinates: Vec<String>,
    /// The components that the constraints determine, by names, as functions of the coordinates.
    pub dependent: Vec<(String, ExprId)>,
    /// Whether one of these is a root of a quadratic equation: the states with the other root have it with the opposite
    /// sign in everything here.
    pub is_of_one_root: bool,
    /// The entries that do not vanish identically, by names.
    pub entries: Vec<([String; 2], ExprId)>,
    /// `R` of `z' = Pi dE + R`; empty where it vanishes.
    pub remainder: Vec<(String, ExprId)>,
    /// The Jacobi identity.
    pub jacobi: Jacobi,
    /// The rank at a general state.
    pub rank: usize,
    /// Functionally independent polynomials in base coordinates and momenta `p = dL/dy` with `Pi dC = 0`: proved.
    pub casimirs: Vec<ExprId>,
    /// The degree up to which they were looked for.
    pub degree: usize,
    /// `N(x)` with `div(N X) = 0`.
    pub measure: Density,
    /// `f(x)` for which `f Pi` satisfies the Jacobi identity, `dt = f dtau`; none where `Pi` does, or where a remainder
    /// stays.
    pub multiplier: Option<Density>,
}

/// More coordinates are not looked into.
const MAX_COORDINATES: usize = 14;
/// Polynomials of more monomials are not looked for.
const MAX_MONOMIALS: usize = 130;
/// Polynomials of a larger degree are not looked for.
const MAX_DEGREE: usize = 4;

impl BracketFacts {
    /// Finds all of it on the state without the coordinates `left_out`, of which nothing on the rest depends; on the
    /// whole state where something does.
    ///
    /// # Errors
    /// As [`Bracket::new`]; [`Error::OverBudget`]; [`Error::NoBracket`] for states of too many components.
    pub fn new(equations: &Equations, left_out: &BTreeSet<SymbolId>) -> Result<BracketFacts, Error> {
        let mut g = equations.system.graph.clone();
        g.enter(Stage::Results);
        let bracket = Bracket::new(&mut g, equations)?;
        let mut chart = Chart::new(&mut g, equations)?;
        let mut left_out = left_out.clone();
        let (mut kept, mut on) = Look::on(&mut g, equations, &chart, &bracket, &left_out)?;
        if !is_free_of(&mut g, equations, &left_out, &mut on) {
            left_out.clear();
            (kept, on) = Look::on(&mut g, equations, &chart, &bracket, &left_out)?;
        }
        chart.coordinates = kept;
        let OnCoordinates { matrix: all, rates, remainder, determinant } = on;
        chart.determinant = determinant;
        let n = chart.coordinates.len();
        if n > MAX_COORDINATES {
            let reason = format!("it is not looked into for more than {MAX_COORDINATES} coordinates");
            return Err(Error::NoBracket { reason });
        }
        let pi: Vec<Vec<ExprId>> = all.chunks(n.max(1)).map(<[ExprId]>::to_vec).collect();
        let symbols: Vec<SymbolId> = chart.coordinates.iter().map(|i| equations.state[*i].symbol).collect();
        let name = |i: usize| equations.state[i].name.clone();
        let coordinates: Vec<String> = chart.coordinates.iter().map(|i| name(*i)).collect();
        let mut look =
            Look { g: &mut g, symbols: &symbols, pi: &pi, names: &coordinates, left_out: &left_out };
        let (jacobi, jacobiators) = look.jacobi();
        let rank = independent_rows(look.g, &pi).len();
        let (casimirs, degree) = look.casimirs(equations, &chart)?;
        let is_base =
            |k: &usize| matches!(equations.system.state[chart.coordinates[*k]].0, StateKind::Base(_));
        let (base, fibre): (Vec<usize>, Vec<usize>) = (0..n).partition(is_base);
        let pairs = |list: &[usize]| list.iter().map(|k| (symbols[*k], rates[*k])).collect::<Vec<_>>();
        let (base, fibre) = (pairs(&base), pairs(&fibre));
        let motion = Motion { base: &base, fibre: &fibre };
        let mut minors = minors(look.g, equations, &chart, &bracket)?;
        minors.retain(|e| !look.g.depends_on(*e, &left_out));
        let expressions: Vec<ExprId> = pi.iter().flatten().chain(&rates).copied().collect();
        let known: Vec<ExprId> = minors.into_iter().chain([chart.determinant]).collect();
        let functions = candidates(look.g, &motion, &known, &expressions);
        let measure = invariant_measure(look.g, &motion, &functions, chart.determinant);
        let has_remainder = remainder.iter().any(|e| *e != look.g.zero());
        let multiplier = match &jacobi {
            Jacobi::Fails(_) if !has_remainder => Some(look.multiplier(&motion, &functions, &jacobiators)),
            _ => None,
        };
        let mut entries = Vec::new();
        for i in 0..n {
            for j in (i + 1..n).filter(|j| pi[i][*j] != g.zero()) {
                entries.push(([coordinates[i].clone(), coordinates[j].clone()], pi[i][j]));
            }
        }
        let remainder = match has_remainder {
            true => coordinates.iter().cloned().zip(remainder).collect(),
            false => Vec::new(),
        };
        let is_dependent =
            |i: &usize| !chart.coordinates.contains(i) && !left_out.contains(&equations.state[*i].symbol);
        let dependent: Vec<usize> = (0..equations.state.len()).filter(is_dependent).collect();
        let values: Vec<ExprId> = dependent.iter().map(|i| g.sym(equations.state[*i].symbol)).collect();
        let values = chart.whole(&mut g, &[], &values)?;
        let dependent = dependent.into_iter().map(name).zip(values).collect();
        g.within_budget()?;
        Ok(BracketFacts {
            graph: g,
            coordinates,
            dependent,
            is_of_one_root: chart.has_root,
            entries,
            remainder,
            jacobi,
            rank,
            casimirs,
            degree,
            measure,
            multiplier,
        })
    }
}

/// What is known of the coordinates, written in these alone.
struct OnCoordinates {
    /// The entries of the bracket, row by row.
    matrix: Vec<ExprId>,
    rates: Vec<ExprId>,
    remainder: Vec<ExprId>,
    /// That of the chart.
    determinant: ExprId,
}

/// Whether nothing depends on the coordinates that are left out, which are then gone from the expressions.
fn is_free_of(
    g: &mut Graph,
    equations: &Equations,
    left_out: &BTreeSet<SymbolId>,
    on: &mut OnCoordinates,
) -> bool {
    let cosines: BTreeSet<SymbolId> = equations.system.circles.iter().map(|c| c.cosine).collect();
    let origin = |x: &SymbolId| (*x, if cosines.contains(x) { g.one() } else { g.zero() });
    let origin: BTreeMap<SymbolId, ExprId> = left_out.iter().map(origin).collect();
    let OnCoordinates { matrix, rates, remainder, determinant } = on;
    let mut all = matrix.iter_mut().chain(rates).chain(remainder).chain([determinant]);
    all.all(|e| match g.subs(*e, &origin) {
        Ok(value) if g.is_equal(value, *e) => {
            *e = value;
            true
        }
        _ => false,
    })
}

/// Products of the leading pivots of each matrix that is solved with, also of those that the bracket alone solves with.
fn minors(
    g: &mut Graph,
    equations: &Equations,
    chart: &Chart,
    bracket: &Bracket,
) -> Result<Vec<ExprId>, Error> {
    let mut products: Vec<(String, ExprId)> = Vec::new();
    let mut minors = Vec::new();
    let own = bracket.sections.iter().flat_map(|s| &s.definitions);
    let own: Vec<(String, ExprId)> = own
        .filter_map(|d| {
            let (matrix, place) = g.name(d.symbol).split_once("_d")?;
            let is_pivot = ["A", "M", "S"].contains(&matrix) && place.parse::<usize>().is_ok();
            is_pivot.then(|| (format!("own {matrix}"), d.expr))
        })
        .collect();
    let of_equations = equations.pivots.iter().map(|p| (p.matrix.name.clone(), p.expr));
    let pivots: Vec<(String, ExprId)> = of_equations.chain(own).collect();
    let values: Vec<ExprId> = pivots.iter().map(|(_, e)| *e).collect();
    let values = chart.whole(g, &bracket.sections, &values)?;
    for ((matrix, _), e) in pivots.into_iter().zip(values) {
        let before = products.iter_mut().find(|(name, _)| *name == matrix);
        match before {
            Some((_, product)) => {
                *product = g.mul(*product, e);
                minors.push(*product);
            }
            None => products.push((matrix, e)),
        }
        minors.push(e);
    }
    Ok(minors)
}

/// A matrix of brackets of coordinates.
struct Look<'a> {
    g: &'a mut Graph,
    symbols: &'a [SymbolId],
    pi: &'a [Vec<ExprId>],
    names: &'a [String],
    left_out: &'a BTreeSet<SymbolId>,
}

impl Look<'_> {
    /// The places of the coordinates that are not left out, and what is known of them.
    fn on(
        g: &mut Graph,
        equations: &Equations,
        chart: &Chart,
        bracket: &Bracket,
        left_out: &BTreeSet<SymbolId>,
    ) -> Result<(Vec<usize>, OnCoordinates), Error> {
        let is_kept = |i: &usize| !left_out.contains(&equations.state[*i].symbol);
        let kept: Vec<usize> = chart.coordinates.iter().copied().filter(is_kept).collect();
        let matrix = bracket.matrix(g);
        let entries: Vec<ExprId> = kept.iter().flat_map(|i| kept.iter().map(|j| matrix[*i][*j])).collect();
        let rates: Vec<ExprId> = kept.iter().map(|i| equations.state[*i].derivative).collect();
        let remainder: Vec<ExprId> = kept.iter().map(|i| bracket.remainder[*i]).collect();
        let on = OnCoordinates {
            matrix: chart.whole(g, &bracket.sections, &entries)?,
            rates: chart.whole(g, &[], &rates)?,
            remainder: chart.whole(g, &bracket.sections, &remainder)?,
            determinant: chart.determinant,
        };
        Ok((kept, on))
    }

    /// All triples `i < j < k`.
    fn triples(&self) -> Vec<[usize; 3]> {
        let n = self.symbols.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        pairs.flat_map(|(i, j)| (j + 1..n).map(move |k| [i, j, k])).collect()
    }

    /// `sum over cyclic (i, j, k) of Pi_il v_l(jk)`, by what `v` says of a pair.
    fn cyclic(
        &mut self,
        [i, j, k]: [usize; 3],
        v: &dyn Fn(&mut Graph, usize, usize, usize) -> ExprId,
    ) -> ExprId {
        let mut terms = Vec::new();
        for (i, j, k) in [(i, j, k), (j, k, i), (k, i, j)] {
            for l in 0..self.symbols.len() {
                if self.pi[i][l] != self.g.zero() {
                    let value = v(self.g, l, j, k);
                    terms.push(self.g.mul(self.pi[i][l], value));
                }
            }
        }
        self.g.sum(&terms)
    }

    /// `sum over cyclic (i, j, k) of Pi_il d_l Pi_jk`, for all triples.
    fn jacobi(&mut self) -> (Jacobi, Vec<ExprId>) {
        let (symbols, pi) = (self.symbols, self.pi);
        let mut verdict = Jacobi::Holds;
        let mut jacobiators = Vec::new();
        for triple in self.triples() {
            let value = self.cyclic(triple, &|g, l, j, k| g.diff(pi[j][k], symbols[l]));
            jacobiators.push(value);
            let names = || triple.map(|i| self.names[i].clone());
            match (self.g.vanishing(value), &verdict) {
                (Vanishing::Zero, _) | (_, Jacobi::Fails(_)) => {}
                (Vanishing::NonZero, _) => verdict = Jacobi::Fails(names()),
                (Vanishing::Unknown, Jacobi::Holds) => verdict = Jacobi::Unknown(names()),
                (Vanishing::Unknown, Jacobi::Unknown(_)) => {}
            }
        }
        (verdict, jacobiators)
    }

    /// `f` with `J_ijk + sum over cyclic (i, j, k) of Pi_il Pi_jk d_l ln f = 0`.
    fn multiplier(&mut self, motion: &Motion<'_>, functions: &[ExprId], jacobiators: &[ExprId]) -> Density {
        let (symbols, pi) = (self.symbols, self.pi);
        let triples = self.triples();
        let mut terms = Vec::new();
        for f in functions {
            let inverse = self.g.powi(*f, -1);
            let slopes: Vec<ExprId> = symbols
                .iter()
                .map(|x| {
                    let slope = self.g.diff(*f, *x);
                    self.g.mul(slope, inverse)
                })
                .collect();
            let column: Vec<ExprId> = triples
                .iter()
                .map(|triple| self.cyclic(*triple, &|g, l, j, k| g.mul(pi[j][k], slopes[l])))
                .collect();
            terms.push(column);
        }
        match powers(self.g, functions, &terms, jacobiators) {
            Some(factors) => Density::Found { factors, exponent: None },
            None => {
                let mut rows = Vec::new();
                for triple in &triples {
                    let mut row = Vec::new();
                    for (x, _) in motion.base {
                        let (zero, one) = (self.g.zero(), self.g.one());
                        let unit = |l: usize| if symbols[l] == *x { one } else { zero };
                        row.push(self.cyclic(*triple, &|g, l, j, k| g.mul(pi[j][k], unit(l))));
                    }
                    rows.push(row);
                }
                let right: Vec<ExprId> = jacobiators.iter().map(|e| self.g.neg(*e)).collect();
                one_form(self.g, motion, &rows, &right, "f")
            }
        }
    }

    /// Casimirs that are polynomials in base coordinates and momenta, and up to which degree.
    fn casimirs(&mut self, equations: &Equations, chart: &Chart) -> Result<(Vec<ExprId>, usize), Error> {
        let mut shown = Vec::new();
        let mut values = Vec::new();
        for (kind, _) in &equations.system.state {
            let symbol = equations.system.state_symbol(*kind);
            if matches!(kind, StateKind::Base(_)) && !self.left_out.contains(&symbol) {
                let x = self.g.sym(symbol);
                shown.push(x);
                values.push(x);
            }
        }
        let momenta = equations.outputs.iter().filter(|o| o.kind == OutputKind::Group(Want::Momentum));
        for (name, e) in momenta.flat_map(|o| &o.components) {
            let symbol = self.g.symbol(name);
            shown.push(self.g.sym(symbol));
            values.push(*e);
        }
        let values = chart.whole(self.g, &[], &values)?;
        let (shown, values): (Vec<ExprId>, Vec<ExprId>) =
            shown.into_iter().zip(values).filter(|(_, e)| !self.g.depends_on(*e, self.left_out)).unzip();
        let n = values.len();
        let count = |degree: usize| (1..=degree).fold(1, |c, d| c * (n + d) / d);
        let degree = (1..=MAX_DEGREE).rev().find(|d| count(*d) - 1 <= MAX_MONOMIALS).unwrap_or(1);
        // Hamiltonian vector fields of the variables.
        let mut fields = Vec::new();
        for value in &values {
            let slopes: Vec<ExprId> = self.symbols.iter().map(|x| self.g.diff(*value, *x)).collect();
            let field: Vec<ExprId> = (self.pi.iter())
                .map(|row| {
                    let sum = self.g.dot(row, &slopes);
                    self.g.cancel_zero(sum)
                })
                .collect();
            fields.push(field);
        }
        let monomials = monomials(n, degree);
        let mut columns = Vec::new();
        for exponents in &monomials {
            let mut column = vec![Vec::new(); self.symbols.len()];
            for (k, e) in exponents.iter().enumerate().filter(|(_, e)| **e > 0) {
                let mut rest = exponents.clone();
                rest[k] -= 1;
                let slope = monomial(self.g, &values, &rest);
                let slope = self.g.scale(slope, &Rational::from_integer((*e).into()));
                for (terms, x) in column.iter_mut().zip(&fields[k]) {
                    terms.push(self.g.mul(slope, *x));
                }
            }
            columns.push(column.iter().map(|terms| self.g.sum(terms)).collect::<Vec<ExprId>>());
        }
        let mut found = Vec::new();
        let mut gradients = Vec::new();
        for relation in rational_relations(self.g, &columns) {
            let used: Vec<usize> = (0..monomials.len()).filter(|k| !relation[*k].is_zero()).collect();
            let is_proved = (0..self.symbols.len()).all(|r| {
                let terms: Vec<ExprId> =
                    used.iter().map(|k| self.g.scale(columns[*k][r], &relation[*k])).collect();
                let sum = self.g.sum(&terms);
                self.g.vanishing(sum) == Vanishing::Zero
            });
            if !is_proved {
                continue;
            }
            let mut sum_of = |of: &[ExprId]| {
                let terms: Vec<ExprId> = used
                    .iter()
                    .map(|k| {
                        let e = monomial(self.g, of, &monomials[*k]);
                        self.g.scale(e, &relation[*k])
                    })
                    .collect();
                self.g.sum(&terms)
            };
            let (casimir, value) = (sum_of(&shown), sum_of(&values));
            let gradient: Vec<ExprId> = self
                .symbols
                .iter()
                .map(|x| {
                    let slope = self.g.diff(value, *x);
                    self.g.cancel_zero(slope)
                })
                .collect();
            found.push(casimir);
            gradients.push(gradient);
        }
        let kept = independent_rows(self.g, &gradients);
        Ok((kept.into_iter().map(|k| found[k]).collect(), degree))
    }
}

/// Exponents of all monomials of `n` variables of degrees one to `degree`, by degree.
fn monomials(n: usize, degree: usize) -> Vec<Vec<u32>> {
    let mut all: Vec<Vec<u32>> = Vec::new();
    let mut last: BTreeSet<Vec<u32>> = BTreeSet::from([vec![0; n]]);
    for _ in 0..degree {
        let raised = last.iter().flat_map(|exponents| {
            (0..n).map(|k| {
                let mut raised = exponents.clone();
                raised[k] += 1;
                raised
            })
        });
        last = raised.collect();
        // The powers of the first variables come first.
        all.extend(last.iter().rev().cloned());
    }
    all
}

fn monomial(g: &mut Graph, variables: &[ExprId], exponents: &[u32]) -> ExprId {
    let powers: Vec<ExprId> = (variables.iter().zip(exponents))
        .filter(|(_, e)| **e > 0)
        .map(|(x, e)| g.powi(*x, i64::from(*e)))
        .collect();
    g.product(&powers)
}
