//! Linear rows solved for some of their columns, by exact elimination with the pivots that are best to divide by.
//!
//! Does not know: where the rows come from, what their columns mean.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Sign, Style, SymbolId, Vanishing};
use hamel_lang::algebra::tableau::{Cell, Grade, Judge, Known, MAX_COFACTORS, Tableau, Tie};

use super::{ConstraintRow, Response, Unknown};

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
struct Echelon<'a> {
    rows: &'a [ConstraintRow],
    table: Tableau,
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

impl<'s> Solver<'s> {
    fn judge(&self) -> Judge<'s> {
        Judge { params: Known::Params(self.params), signs: Some(self.facts) }
    }

    /// The best of some cells of a table.
    fn best(
        &mut self,
        table: &Tableau,
        tie: Tie,
        cells: impl IntoIterator<Item = (usize, usize)>,
    ) -> Option<Cell> {
        let judge = self.judge();
        table.best(self.graph, &judge, tie, cells)
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
        let echelon = self.echelon(rows, wanted, Grade::Unproved, said)?;
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
        let echelon = self.echelon(rows, None, Grade::Definite, Said::default())?;
        let left = echelon.open.iter().map(|&row| echelon.table.rows()[row].clone()).collect();
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
        let echelon = self.echelon(rows, None, Grade::Unproved, Said::default())?;
        Ok(self.solved_form(&echelon))
    }

    /// Gauss elimination with the best pivots first, up to the first that is worse than `worst`.
    fn echelon<'a>(
        &mut self,
        rows: &'a [ConstraintRow],
        wanted: Option<&[usize]>,
        worst: Grade,
        said: Said<'_>,
    ) -> Result<Echelon<'a>, Error> {
        let (m, width) = (self.names.len(), self.names.len() + self.quasi.len());
        let allowed = |column: usize| column < m && wanted.is_none_or(|w| !w.contains(&column));
        let mut echelon = Echelon {
            rows,
            table: self.table(rows),
            solved: Vec::new(),
            open: (0..rows.len()).collect(),
            pivots: Vec::new(),
            given: said.in_order.to_vec(),
            state_dependent: false,
        };
        self.eliminate_together(&mut echelon, said.together)?;
        let mut waiting = said.in_order;
        while !echelon.open.is_empty() {
            self.graph.within_budget()?;
            let is_ready = |row: &usize| waiting.iter().all(|(other, _)| other != row);
            let is_free = |column: &usize| waiting.iter().all(|(_, other)| other != column);
            let ready: Vec<usize> = echelon.open.iter().copied().filter(is_ready).collect();
            for &row in &ready {
                self.refuse_empty(&echelon, row)?;
            }
            let columns: Vec<usize> = (0..width).filter(|k| allowed(*k) && is_free(k)).collect();
            let cells = ready.iter().flat_map(|row| columns.iter().map(|column| (*row, *column)));
            // Later velocities are eliminated first: the state keeps the ones named first.
            let best = self.best(&echelon.table, Tie::LastColumn, cells);
            if best.is_none_or(|cell| cell.grade > Grade::Number) && !waiting.is_empty() {
                for &cell in std::mem::take(&mut waiting) {
                    self.eliminate_given(&mut echelon, cell)?;
                }
                continue;
            }
            let Some(cell) = best else { return Err(self.not_solvable(rows, wanted)) };
            if cell.grade > worst {
                break;
            }
            echelon.state_dependent |= cell.grade.is_watched();
            if cell.grade.is_watched() {
                // Where no other columns are left, the determinant alone says where the rows have no solution: an
                // entry that is divided by on the way would be watched as well, and cancel.
                let is_left = |column: &usize| echelon.solved.iter().all(|(_, c)| c != column);
                let columns: Vec<usize> = (0..m).filter(|k| allowed(*k) && is_left(k)).collect();
                if columns.len() == echelon.open.len() && (2..=MAX_COFACTORS).contains(&columns.len()) {
                    if self.eliminate_by_cofactors(&mut echelon, &columns) {
                        break;
                    }
                    if self.is_by_rows && wanted.is_some() {
                        return Err(self.undetermined(&echelon, &columns));
                    }
                }
            }
            self.eliminate(&mut echelon, cell);
        }
        Ok(echelon)
    }

    /// The rows with their offsets, and with unit vectors where it is noted how velocities answer to them.
    fn table(&mut self, rows: &[ConstraintRow]) -> Tableau {
        let (zero, one) = (self.graph.zero(), self.graph.one());
        let n = if self.is_by_rows { rows.len() } else { 0 };
        let unit = |a: usize| (0..n).map(move |b| if a == b { one } else { zero });
        let with_offset = rows.iter().map(|r| r.one_form.iter().copied().chain([r.offset]));
        let rows = with_offset.enumerate().map(|(a, row)| row.chain(unit(a)).collect()).collect();
        let mut table = Tableau::new(rows);
        table.cancel_zeros(self.graph);
        table
    }

    /// Refuses a row without coefficients: it says nothing, or what cannot be.
    fn refuse_empty(&mut self, echelon: &Echelon<'_>, row: usize) -> Result<(), Error> {
        let width = self.names.len() + self.quasi.len();
        let entries = &echelon.table.rows()[row];
        if entries[..width].iter().any(|e| *e != self.graph.zero()) {
            return Ok(());
        }
        let (constraint, offset) = (echelon.rows[row].text.clone(), entries[width]);
        Err(match self.graph.vanishing(offset) {
            Vanishing::Zero => Error::DependentConstraint { constraint },
            Vanishing::NonZero => Error::InconsistentConstraint { constraint },
            Vanishing::Unknown => Error::Unverified {
                claim: format!("that constraint {constraint} follows from the others"),
                residual: self.graph.display(offset, Style::Plain),
                component: None,
            },
        })
    }

    /// Solves a row for a column; a divisor that can vanish is among the pivots.
    fn eliminate(&mut self, echelon: &mut Echelon<'_>, Cell { row, column, grade }: Cell) {
        if grade.may_vanish() {
            let name = format!("coefficient of {} in {}", self.names[column], echelon.rows[row].text);
            echelon.pivots.push((name, echelon.table.rows()[row][column]));
        }
        echelon.table.eliminate(self.graph, (row, column));
        echelon.open.retain(|r| *r != row);
        echelon.solved.push((row, column));
    }

    /// Solves a row for the column that the model says it gives.
    fn eliminate_given(
        &mut self,
        echelon: &mut Echelon<'_>,
        (row, column): (usize, usize),
    ) -> Result<(), Error> {
        let cell = self.best(&echelon.table, Tie::First, [(row, column)]).ok_or_else(|| {
            let (constraint, velocity) = (echelon.rows[row].text.clone(), self.names[column].clone());
            Error::NotGiven { constraint, velocity }
        })?;
        self.eliminate(echelon, cell);
        Ok(())
    }

    /// Solves rows for columns that they give together: as far as it divides by what vanishes nowhere, one by one, and
    /// what is left by cofactors, which divide by the determinant alone.
    fn eliminate_together(
        &mut self,
        echelon: &mut Echelon<'_>,
        determined: &[(usize, usize)],
    ) -> Result<(), Error> {
        let others = (echelon.open.iter().copied()).filter(|row| determined.iter().all(|(r, _)| r != row));
        let others: Vec<usize> = others.collect();
        let mut columns: Vec<usize> = determined.iter().map(|(_, column)| *column).collect();
        echelon.open = determined.iter().map(|(row, _)| *row).collect();
        while !echelon.open.is_empty() {
            self.graph.within_budget()?;
            let cells = echelon.open.iter().flat_map(|row| columns.iter().map(|column| (*row, *column)));
            let Some(cell) = self.best(&echelon.table, Tie::First, cells) else {
                return Err(self.undetermined(echelon, &columns));
            };
            if (2..=MAX_COFACTORS).contains(&echelon.open.len()) && cell.grade.may_vanish() {
                if !self.eliminate_by_cofactors(echelon, &columns) {
                    return Err(self.undetermined(echelon, &columns));
                }
            } else {
                self.eliminate(echelon, cell);
                columns.retain(|c| *c != cell.column);
            }
        }
        echelon.open = others;
        Ok(())
    }

    /// Solves the open rows for as many columns by the adjugate of their coefficients; whether their determinant does
    /// not vanish identically.
    fn eliminate_by_cofactors(&mut self, echelon: &mut Echelon<'_>, columns: &[usize]) -> bool {
        let determinant = echelon.table.eliminate_together(self.graph, &echelon.open, columns);
        let Some(determinant) = determinant else { return false };
        if self.judge().grade(self.graph, determinant).is_none_or(|(grade, _)| grade.may_vanish()) {
            let texts = echelon.open.iter().map(|row| echelon.rows[*row].text.as_str());
            let mut texts: Vec<&str> = texts.collect();
            texts.dedup();
            let names: Vec<&str> = columns.iter().map(|column| self.names[*column].as_str()).collect();
            let name = format!("determinant of {} in {}", names.join(", "), texts.join(", "));
            echelon.pivots.push((name, determinant));
        }
        echelon.solved.extend(echelon.open.drain(..).zip(columns.iter().copied()));
        true
    }

    fn undetermined(&self, echelon: &Echelon<'_>, columns: &[usize]) -> Error {
        let texts = echelon.open.iter().map(|row| echelon.rows[*row].text.clone());
        let mut equations: Vec<String> = texts.collect();
        equations.dedup();
        let names = columns.iter().map(|column| self.names[*column].clone()).collect();
        Error::UndeterminedPositions { equations, names }
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

    fn solved_form(&mut self, echelon: &Echelon<'_>) -> Elimination {
        let Echelon { table, solved, pivots, given, .. } = echelon;
        let table = table.rows();
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
