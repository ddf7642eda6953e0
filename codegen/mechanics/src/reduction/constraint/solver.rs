//! Linear rows solved for some of their columns, by exact elimination with the pivots that are best to divide by.
//!
//! Does not know: where the rows come from, what their columns mean.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Sign, Style, SymbolId, Vanishing, sign_of};

use super::{ConstraintRow, Response, Unknown};

/// Rows up to which a block is solved by cofactors; larger ones by elimination with the best pivots first.
const MAX_COFACTORS: usize = 3;

/// Rows with the columns that they were solved for, and what was divided by.
type Found<'a> = (&'a mut Vec<(usize, usize)>, &'a mut Vec<(String, ExprId)>);

/// How good an expression is to divide by; smaller is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum PivotGrade {
    Constant,
    Definite,
    ParameterOnly,
    StateDependent,
    /// Not proved not to vanish identically.
    Unproved,
}

/// Rows and the columns that the model says they give.
#[derive(Clone, Copy, Default)]
pub(in crate::reduction) struct Said<'a> {
    /// All together.
    pub(in crate::reduction) together: &'a [(usize, usize)],
    /// One after the other.
    pub(in crate::reduction) in_order: &'a [(usize, usize)],
}

/// Solves linear rows for some of their columns.
pub(in crate::reduction) struct Solver<'a> {
    pub(in crate::reduction) graph: &'a mut Graph,
    /// Names of the frame velocities.
    pub(in crate::reduction) names: &'a [String],
    /// Quasi-velocities: extra columns after the frame's, never eliminated.
    pub(in crate::reduction) quasi: &'a [Unknown],
    pub(in crate::reduction) params: &'a BTreeSet<SymbolId>,
    pub(in crate::reduction) facts: &'a BTreeMap<ExprId, Sign>,
    /// Whether some row is the derivative of an equation between positions, or is said to give a velocity: velocities
    /// that are left for as many rows are then solved for together, and it is noted how they answer to the rows.
    pub(in crate::reduction) is_by_rows: bool,
}

/// Rows solved as `y_dependent = -(rest)`.
pub(in crate::reduction) struct Elimination {
    pub(in crate::reduction) dependent: Vec<usize>,
    pub(in crate::reduction) psi: Vec<Vec<ExprId>>,
    pub(in crate::reduction) psi0: Vec<ExprId>,
    pub(in crate::reduction) pivots: Vec<(String, ExprId)>,
    pub(in crate::reduction) response: Option<Box<Response>>,
}

/// Rows eliminated as far as wanted.
struct Echelon {
    table: Vec<Vec<ExprId>>,
    /// Rows and the columns they were solved for.
    solved: Vec<(usize, usize)>,
    /// Rows left over.
    open: Vec<usize>,
    pivots: Vec<(String, ExprId)>,
    /// The rows that the model gives a column for.
    given: Vec<(usize, usize)>,
    /// Whether something was divided by that can vanish on the domain.
    state_dependent: bool,
}

impl Solver<'_> {
    fn grade(&mut self, e: ExprId) -> PivotGrade {
        let size = self.graph.reachable(&[e]).len();
        self.graph.charge(2 * size);
        if self.graph.vanishing(e) == Vanishing::Unknown {
            PivotGrade::Unproved
        } else if self.graph.as_rational(e).is_some() {
            PivotGrade::Constant
        } else if sign_of(self.graph, e, self.facts).is_definite() {
            PivotGrade::Definite
        } else if self.graph.free_symbols(e).is_subset(self.params) {
            PivotGrade::ParameterOnly
        } else {
            PivotGrade::StateDependent
        }
    }

    /// Brings linear rows to the form `y = Psi u + psi0`; `None` when every choice of independent velocities would
    /// divide by something that can vanish on the domain.
    ///
    /// `wanted`: columns that the model asks to be independent. What is divided by in rows whose columns are `said` is
    /// among the pivots, and no reason for another form.
    ///
    /// # Shapes
    /// `one_form` of every row: frame velocities, then quasi-velocities.
    ///
    /// # Errors
    /// [`Error::DependentConstraint`], [`Error::InconsistentConstraint`], [`Error::NotSolvable`],
    /// [`Error::WrongNumberOfIndependent`].
    pub(in crate::reduction) fn solve(
        &mut self,
        rows: &[ConstraintRow],
        wanted: Option<&[usize]>,
        said: Said<'_>,
    ) -> Result<Option<Elimination>, Error> {
        if let Some(wanted) = wanted {
            let width = self.names.len() + self.quasi.len();
            let expected = width.saturating_sub(rows.len());
            if wanted.len() != expected {
                return Err(Error::WrongNumberOfIndependent { found: wanted.len(), expected });
            }
        }
        let is_dependent = |(_, column): &&(usize, usize)| wanted.is_none_or(|w| !w.contains(column));
        let [together, in_order] = [said.together, said.in_order]
            .map(|list| -> Vec<(usize, usize)> { list.iter().filter(is_dependent).copied().collect() });
        let said = Said { together: &together, in_order: &in_order };
        let echelon = self.echelon(rows, wanted, PivotGrade::Unproved, said)?;
        if echelon.state_dependent && wanted.is_none() {
            return Ok(None);
        }
        Ok(Some(self.solved_form(&echelon)))
    }

    /// Solves as many rows as it can without a division by something that might vanish, and returns what is left of the
    /// others on all columns.
    ///
    /// # Shapes
    /// As for [`Solver::solve`].
    ///
    /// # Errors
    /// [`Error::DependentConstraint`], [`Error::InconsistentConstraint`], [`Error::NotSolvable`].
    pub(in crate::reduction) fn solve_safely(
        &mut self,
        rows: &[ConstraintRow],
    ) -> Result<(Elimination, Vec<Vec<ExprId>>), Error> {
        let echelon = self.echelon(rows, None, PivotGrade::Definite, Said::default())?;
        let left = echelon.open.iter().map(|&row| echelon.table[row].clone()).collect();
        Ok((self.solved_form(&echelon), left))
    }

    /// Brings linear rows to the form `y = Psi u + psi0` even where every choice of dependent velocities divides by
    /// something that can vanish on the domain; such divisors are among the pivots.
    ///
    /// # Shapes
    /// As for [`Solver::solve`].
    ///
    /// # Errors
    /// [`Error::DependentConstraint`], [`Error::InconsistentConstraint`], [`Error::NotSolvable`].
    pub(in crate::reduction) fn solve_somewhere(
        &mut self,
        rows: &[ConstraintRow],
    ) -> Result<Elimination, Error> {
        let echelon = self.echelon(rows, None, PivotGrade::Unproved, Said::default())?;
        Ok(self.solved_form(&echelon))
    }

    /// Gauss elimination with the best pivots first, up to the first that is worse than `worst`.
    fn echelon(
        &mut self,
        rows: &[ConstraintRow],
        wanted: Option<&[usize]>,
        worst: PivotGrade,
        said: Said<'_>,
    ) -> Result<Echelon, Error> {
        let (m, width) = (self.names.len(), self.names.len() + self.quasi.len());
        let allowed = |column: usize| column < m && wanted.is_none_or(|w| !w.contains(&column));
        let mut table: Vec<Vec<ExprId>> =
            rows.iter().map(|r| [r.one_form.as_slice(), &[r.offset]].concat()).collect();
        if self.is_by_rows {
            let (zero, one) = (self.graph.zero(), self.graph.one());
            let n = table.len();
            for (a, row) in table.iter_mut().enumerate() {
                row.extend((0..n).map(|b| if a == b { one } else { zero }));
            }
        }
        let mut open: Vec<usize> = (0..rows.len()).collect();
        let mut solved: Vec<(usize, usize)> = Vec::new();
        let mut pivots = Vec::new();
        let mut state_dependent = false;
        self.eliminate_together(rows, said.together, &mut table, (&mut solved, &mut pivots))?;
        open.retain(|row| solved.iter().all(|(done, _)| done != row));
        let mut waiting = said.in_order;
        while !open.is_empty() {
            self.graph.within_budget()?;
            let mut best: Option<(PivotGrade, std::cmp::Reverse<usize>, usize)> = None;
            for &row in open.iter().filter(|row| waiting.iter().all(|(other, _)| other != *row)) {
                let mut vanishes = true;
                for (column, &entry) in table[row][..width].iter().enumerate() {
                    if entry == self.graph.zero() {
                        continue;
                    }
                    vanishes = false;
                    if allowed(column) && waiting.iter().all(|(_, other)| *other != column) {
                        // Later velocities are eliminated first: the state keeps the ones named first.
                        let candidate = (self.grade(entry), std::cmp::Reverse(column), row);
                        best = Some(best.map_or(candidate, |b| b.min(candidate)));
                    }
                }
                if vanishes {
                    let constraint = rows[row].text.clone();
                    let offset = table[row][width];
                    return Err(match self.graph.vanishing(offset) {
                        Vanishing::Zero => Error::DependentConstraint { constraint },
                        Vanishing::NonZero => Error::InconsistentConstraint { constraint },
                        Vanishing::Unknown => Error::Unverified {
                            claim: format!("that constraint {constraint} follows from the others"),
                            residual: self.graph.display(offset, Style::Plain),
                            component: None,
                        },
                    });
                }
            }
            if best.is_none_or(|(grade, ..)| grade > PivotGrade::Constant) && !waiting.is_empty() {
                for &(row, column) in std::mem::take(&mut waiting) {
                    self.eliminate_given(rows, (row, column), &mut table, (&mut solved, &mut pivots))?;
                    open.retain(|r| *r != row);
                }
                continue;
            }
            let Some((grade, std::cmp::Reverse(column), row)) = best else {
                return Err(self.not_solvable(rows, wanted));
            };
            if grade > worst {
                break;
            }
            if self.is_by_rows && grade >= PivotGrade::StateDependent && wanted.is_some() {
                let is_left = |column: &usize| allowed(*column) && solved.iter().all(|(_, c)| c != column);
                let columns: Vec<usize> = (0..m).filter(is_left).collect();
                if columns.len() == open.len() && (2..=MAX_COFACTORS).contains(&open.len()) {
                    self.eliminate_by_cofactors(
                        rows,
                        (&open, &columns),
                        &mut table,
                        (&mut solved, &mut pivots),
                    )?;
                    state_dependent = true;
                    open.clear();
                    break;
                }
            }
            state_dependent |= grade >= PivotGrade::StateDependent;
            if grade >= PivotGrade::ParameterOnly {
                let name = format!("coefficient of {} in {}", self.names[column], rows[row].text);
                pivots.push((name, table[row][column]));
            }
            self.eliminate(&mut table, row, column);
            open.retain(|r| *r != row);
            solved.push((row, column));
        }
        Ok(Echelon { table, solved, open, pivots, state_dependent, given: said.in_order.to_vec() })
    }

    /// Solves a row for the column that the model says it gives.
    fn eliminate_given(
        &mut self,
        rows: &[ConstraintRow],
        (row, column): (usize, usize),
        table: &mut [Vec<ExprId>],
        (solved, pivots): Found<'_>,
    ) -> Result<(), Error> {
        let entry = table[row][column];
        if self.graph.vanishing(entry) == Vanishing::Zero {
            let (constraint, velocity) = (rows[row].text.clone(), self.names[column].clone());
            return Err(Error::NotGiven { constraint, velocity });
        }
        if self.grade(entry) >= PivotGrade::ParameterOnly {
            let name = format!("coefficient of {} in {}", self.names[column], rows[row].text);
            pivots.push((name, entry));
        }
        self.eliminate(table, row, column);
        solved.push((row, column));
        Ok(())
    }

    /// Solves rows for columns that they give together: as far as it divides by what vanishes nowhere, one by one, and
    /// what is left by cofactors, which divide by the determinant alone.
    fn eliminate_together(
        &mut self,
        rows: &[ConstraintRow],
        determined: &[(usize, usize)],
        table: &mut [Vec<ExprId>],
        (solved, pivots): Found<'_>,
    ) -> Result<(), Error> {
        let (mut open, mut columns): (Vec<usize>, Vec<usize>) = determined.iter().copied().unzip();
        while !open.is_empty() {
            self.graph.within_budget()?;
            let is_by_cofactors = (2..=MAX_COFACTORS).contains(&open.len());
            let mut best: Option<(PivotGrade, usize, usize)> = None;
            for &row in &open {
                for &column in &columns {
                    let entry = table[row][column];
                    if entry != self.graph.zero() && self.graph.vanishing(entry) != Vanishing::Zero {
                        let candidate = (self.grade(entry), row, column);
                        best = Some(best.map_or(candidate, |b| b.min(candidate)));
                    }
                }
            }
            let Some((grade, row, column)) = best else {
                return Err(self.undetermined(rows, &open, &columns));
            };
            if is_by_cofactors && grade > PivotGrade::Definite {
                return self.eliminate_by_cofactors(rows, (&open, &columns), table, (solved, pivots));
            }
            if grade >= PivotGrade::ParameterOnly {
                let name = format!("coefficient of {} in {}", self.names[column], rows[row].text);
                pivots.push((name, table[row][column]));
            }
            self.eliminate(table, row, column);
            open.retain(|r| *r != row);
            columns.retain(|c| *c != column);
            solved.push((row, column));
        }
        Ok(())
    }

    /// Solves some rows for as many columns by the adjugate of their coefficients.
    fn eliminate_by_cofactors(
        &mut self,
        rows: &[ConstraintRow],
        (open, columns): (&[usize], &[usize]),
        table: &mut [Vec<ExprId>],
        (solved, pivots): Found<'_>,
    ) -> Result<(), Error> {
        let n = open.len();
        let square: Vec<Vec<ExprId>> =
            open.iter().map(|row| columns.iter().map(|column| table[*row][*column]).collect()).collect();
        let all: Vec<usize> = (0..n).collect();
        let determinant = self.minor(&square, &all, &all);
        if self.graph.vanishing(determinant) == Vanishing::Zero {
            return Err(self.undetermined(rows, open, columns));
        }
        let texts: Vec<&str> = open.iter().map(|row| rows[*row].text.as_str()).collect();
        let mut texts: Vec<&str> = texts.into_iter().collect();
        texts.dedup();
        let names: Vec<&str> = columns.iter().map(|column| self.names[*column].as_str()).collect();
        let name = format!("determinant of {} in {}", names.join(", "), texts.join(", "));
        pivots.push((name, determinant));
        let inverse = self.graph.powi(determinant, -1);
        let width = table.first().map_or(0, Vec::len);
        let mut made = vec![vec![self.graph.zero(); width]; n];
        for (i, own) in made.iter_mut().enumerate() {
            let weights: Vec<ExprId> = (0..n)
                .map(|j| {
                    let left: Vec<usize> = all.iter().copied().filter(|row| *row != j).collect();
                    let kept: Vec<usize> = all.iter().copied().filter(|column| *column != i).collect();
                    let minor = self.minor(&square, &left, &kept);
                    if (i + j) % 2 == 0 { minor } else { self.graph.neg(minor) }
                })
                .collect();
            for (column, entry) in own.iter_mut().enumerate() {
                if let Some(at) = columns.iter().position(|c| *c == column) {
                    *entry = if at == i { self.graph.one() } else { self.graph.zero() };
                    continue;
                }
                let along: Vec<ExprId> = open.iter().map(|row| table[*row][column]).collect();
                let sum = self.graph.dot(&weights, &along);
                let sum = self.graph.cancel_zero(sum);
                *entry = self.graph.mul(sum, inverse);
            }
        }
        for (row, own) in open.iter().zip(made) {
            table[*row] = own;
        }
        for (row, column) in open.iter().zip(columns) {
            // The other rows of the block have a zero there.
            self.eliminate(table, *row, *column);
            solved.push((*row, *column));
        }
        Ok(())
    }

    /// The determinant of some rows and columns, by the first row.
    fn minor(&mut self, square: &[Vec<ExprId>], rows: &[usize], columns: &[usize]) -> ExprId {
        let Some((first, below)) = rows.split_first() else { return self.graph.one() };
        let mut terms = Vec::with_capacity(columns.len());
        for (k, column) in columns.iter().enumerate() {
            let others: Vec<usize> = columns.iter().copied().filter(|other| other != column).collect();
            let minor = self.minor(square, below, &others);
            let term = self.graph.mul(square[*first][*column], minor);
            terms.push(if k % 2 == 0 { term } else { self.graph.neg(term) });
        }
        let sum = self.graph.sum(&terms);
        self.graph.cancel_zero(sum)
    }

    fn undetermined(&self, rows: &[ConstraintRow], open: &[usize], columns: &[usize]) -> Error {
        let mut equations: Vec<String> = open.iter().map(|row| rows[*row].text.clone()).collect();
        equations.dedup();
        let names = columns.iter().map(|column| self.names[*column].clone()).collect();
        Error::UndeterminedPositions { equations, names }
    }

    fn eliminate(&mut self, table: &mut [Vec<ExprId>], row: usize, column: usize) {
        let g = &mut *self.graph;
        let inverse = g.powi(table[row][column], -1);
        for entry in &mut table[row] {
            *entry = g.mul(*entry, inverse);
        }
        let pivot_row = table[row].clone();
        for (i, other) in table.iter_mut().enumerate() {
            let factor = other[column];
            if i == row || factor == g.zero() {
                continue;
            }
            for (entry, pivot) in other.iter_mut().zip(&pivot_row) {
                let product = g.mul(factor, *pivot);
                let reduced = g.sub(*entry, product);
                *entry = g.cancel_zero(reduced);
            }
        }
    }

    fn not_solvable(&mut self, rows: &[ConstraintRow], wanted: Option<&[usize]>) -> Error {
        let names = self.names;
        let wanted_columns = wanted.unwrap_or_default();
        let dependent =
            (0..names.len()).filter(|k| !wanted_columns.contains(k)).map(|k| names[k].clone()).collect();
        let possible = match wanted.is_some().then(|| self.solve(rows, None, Said::default())) {
            Some(Ok(Some(s))) => s.dependent.iter().map(|k| names[*k].clone()).collect(),
            _ => vec!["no choice on the whole domain: write `multipliers;` instead".to_owned()],
        };
        Error::NotSolvable { dependent, possible }
    }

    fn solved_form(&mut self, echelon: &Echelon) -> Elimination {
        let Echelon { table, solved, pivots, given, .. } = echelon;
        let g = &mut *self.graph;
        let (m, width) = (self.names.len(), self.names.len() + self.quasi.len());
        let mut dependent: Vec<usize> = solved.iter().map(|(_, column)| *column).collect();
        dependent.sort_unstable();
        let columns: Vec<usize> = (0..width).filter(|k| !dependent.contains(k)).collect();
        let mut psi = vec![vec![g.zero(); columns.len()]; m];
        let mut psi0 = vec![g.zero(); m];
        for (a, &k) in columns.iter().enumerate().filter(|(_, k)| **k < m) {
            psi[k][a] = g.one();
        }
        for &(row, column) in solved {
            for (a, &k) in columns.iter().enumerate() {
                psi[column][a] = g.neg(table[row][k]);
            }
            psi0[column] = g.neg(table[row][width]);
        }
        let n_rows = if self.is_by_rows && self.quasi.is_empty() { table.len() } else { 0 };
        let response = (n_rows > 0 && solved.len() == n_rows).then(|| {
            let mut by_row = vec![vec![g.zero(); n_rows]; m];
            for &(row, column) in solved {
                for (a, entry) in by_row[column].iter_mut().enumerate() {
                    *entry = g.neg(table[row][width + 1 + a]);
                }
            }
            Box::new(Response { pairs: solved.clone(), given: given.clone(), by_row })
        });
        Elimination { dependent, psi, psi0, pivots: pivots.clone(), response }
    }
}
