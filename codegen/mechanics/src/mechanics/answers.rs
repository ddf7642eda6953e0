//! Dependent velocities row by row, where constraints contain derivatives of equations between positions, or name the
//! velocities that they give.
//!
//! `C_d x + r = 0` is solved for the dependent components `x` with the rows `C` of the constraint as they are written:
//! a row whose own velocity has a number before it gives this velocity by the others, rows that name their velocities
//! follow one after the other, and only what is left is solved for together, by the matrix that reduction inverted.
//! Velocities, partial velocities and accelerations at `udot = 0` are all answers to some `r`, and share the
//! coefficients of the rows.
//!
//! Deliberately does not know: how the rows were solved, what the velocities are.

use std::collections::BTreeMap;

use crate::reduction::{KinematicConstraint, Response, SolvedConstraint};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Style, SymbolId};
use hamel_lang::algebra::tableau::{MAX_COFACTORS, Tableau, adjugate, determinant};

use super::derive::Derivation;
use super::rows::{Answered, Chain, Link, Order, Rows};

/// A velocity by others, `y_own = by y`, of a row.
pub(super) struct Direct {
    pub(super) own: usize,
    pub(super) by: Vec<(usize, ExprId)>,
}

impl Derivation<'_> {
    /// The dependent components `x` with `C_d x + r = 0`, `r` by row; each gets a name, that of its velocity after
    /// `prefix`. Other components are zero.
    fn answer(&mut self, rows: &Rows, right: &[ExprId], prefix: &str) -> Vec<ExprId> {
        let Order { direct, together } = &rows.order;
        let zero = self.g.zero();
        let mut x = vec![zero; self.y.len()];
        if !together.is_empty() {
            let mut before = vec![zero; self.y.len()];
            for pair in direct {
                before[pair.1] = rows.direct_answer(&mut self.g, *pair, right, &before);
            }
            let mut left = Vec::with_capacity(together.len());
            for (row, own) in together {
                let form = &rows.forms[*row];
                let mut terms = vec![right[*row]];
                for (coefficient, value) in form.iter().zip(&before) {
                    terms.push(self.g.mul(*coefficient, *value));
                }
                let sum = self.g.sum(&terms);
                left.push((*row, self.define(&format!("{prefix}left_{}", self.names[*own]), sum)));
            }
            match &rows.chain {
                Some(chain) => self.answer_of_chain(chain, &left, &mut x, prefix),
                None => {
                    for (_, own) in together {
                        let by_row = &rows.response.by_row[*own];
                        let terms: Vec<ExprId> =
                            left.iter().map(|(row, e)| self.g.mul(by_row[*row], *e)).collect();
                        let sum = self.g.sum(&terms);
                        x[*own] = self.define(&format!("{prefix}{}", self.names[*own]), sum);
                    }
                }
            }
        }
        for pair in direct {
            let value = rows.direct_answer(&mut self.g, *pair, right, &x);
            x[pair.1] = self.define(&format!("{prefix}{}", self.names[pair.1]), value);
        }
        x
    }

    /// The rows that give their velocity by others, the last first, as `y = c y + ..`.
    pub(super) fn direct_rows(&mut self, rows: &Rows) -> Vec<Direct> {
        let mut found = Vec::with_capacity(rows.order.direct.len());
        for (row, own) in rows.order.direct.iter().copied().rev() {
            let form = &rows.forms[row][..self.y.len()];
            let inverse = self.g.powi(form[own], -1);
            let factor = self.g.neg(inverse);
            let others = form.iter().enumerate().filter(|(alpha, e)| *alpha != own && **e != self.g.zero());
            let others: Vec<(usize, ExprId)> = others.map(|(alpha, e)| (alpha, *e)).collect();
            let by = others.into_iter().map(|(alpha, e)| (alpha, self.g.mul(factor, e)));
            found.push(Direct { own, by: by.collect() });
        }
        for Link { own, form, .. } in rows.chain.iter().flat_map(|chain| &chain.links) {
            let others = form.iter().enumerate().filter(|(_, e)| **e != self.g.zero());
            let others: Vec<(usize, ExprId)> = others.map(|(alpha, e)| (alpha, *e)).collect();
            let by = others.into_iter().map(|(alpha, e)| (alpha, self.g.neg(e))).collect();
            found.push(Direct { own: *own, by });
        }
        found
    }

    /// Writes how rows that are solved together are answered, with coefficients by names.
    fn answer_by_names(&mut self, solved: &SolvedConstraint, rows: &mut Rows) {
        let together = rows.order.together.clone();
        let n = together.len();
        if n > 0 && together.iter().all(|pair| rows.response.given.contains(pair)) {
            rows.chain = Some(self.chain_of(solved, rows));
            return;
        }
        if !(2..=MAX_COFACTORS).contains(&n) {
            return;
        }
        self.writer.begin("response of what is solved together");
        let zero = self.g.zero();
        let mut matrix = vec![vec![zero; n]; n];
        for (j, (_, column)) in together.iter().enumerate() {
            let x = rows.along(&mut self.g, *column, self.y.len());
            for (i, (row, own)) in together.iter().enumerate() {
                let sum = self.g.dot(&rows.forms[*row][..x.len()], &x);
                let name = format!("C_{}_{}", self.names[*own], self.names[*column]);
                matrix[i][j] = self.define(&name, sum);
            }
        }
        let cofactors = adjugate(&mut self.g, &matrix);
        let determinant = determinant(&mut self.g, &matrix);
        let inverse = self.g.powi(determinant, -1);
        let inverse = self.define("R", inverse);
        for (j, (_, own)) in together.iter().enumerate() {
            for (i, (row, _)) in together.iter().enumerate() {
                let product = self.g.mul(cofactors[j][i], inverse);
                let name = format!("R_{}_{}", self.names[*own], solved.rows[*row].name);
                let named = self.define(&name, product);
                rows.response.by_row[*own][*row] = self.g.neg(named);
            }
        }
    }

    /// The triangle of the rows that the model gives a velocity for, with what the direct rows give put into them.
    fn chain_of(&mut self, solved: &SolvedConstraint, rows: &Rows) -> Chain {
        self.writer.begin("rows that are solved one after the other");
        let (zero, given) = (self.g.zero(), &rows.response.given);
        let independent = solved.independent();
        let columns: Vec<usize> =
            given.iter().map(|(_, own)| *own).chain(independent.iter().copied()).collect();
        let mut combined = Vec::with_capacity(given.len());
        for &(row, own) in given {
            let mut form = vec![zero; self.y.len()];
            for &column in &columns {
                let x = rows.along(&mut self.g, column, self.y.len());
                let sum = self.g.dot(&rows.forms[row][..x.len()], &x);
                form[column] = self.define(&format!("C_{}_{}", self.names[own], self.names[column]), sum);
            }
            combined.push(form);
        }
        let mut table = Tableau::new(combined);
        let mut before = vec![Vec::new(); given.len()];
        let mut links: Vec<Link> = Vec::with_capacity(given.len());
        for (k, &(row, own)) in given.iter().enumerate() {
            let left = self.define(&format!("C_{}", self.names[own]), table.rows()[k][own]);
            let inverse = self.g.powi(left, -1);
            let scale = self.define(&format!("R_{}", self.names[own]), inverse);
            table.map_row(k, |column, entry| {
                if column == own {
                    return self.g.one();
                }
                let scaled = self.g.mul(entry, scale);
                self.define(&format!("c_{}_{}", self.names[own], self.names[column]), scaled)
            });
            let later: Vec<usize> = (k + 1..given.len()).collect();
            let factors = table.take_from(&mut self.g, (k, own), &later);
            later.iter().zip(factors).for_each(|(i, factor)| before[*i].push(factor));
            let mut form = table.rows()[k].clone();
            form[own] = zero;
            links.push(Link { row, own, before: std::mem::take(&mut before[k]), scale, form });
        }
        Chain { links }
    }

    /// The velocities of the chain with what is `left` of the right side of its rows.
    fn answer_of_chain(&mut self, chain: &Chain, left: &[(usize, ExprId)], x: &mut [ExprId], prefix: &str) {
        let mut right: Vec<ExprId> = Vec::with_capacity(chain.links.len());
        for link in &chain.links {
            let own = left.iter().find(|(row, _)| *row == link.row).map_or(self.g.zero(), |(_, e)| *e);
            let mut terms = vec![own];
            for (factor, known) in link.before.iter().zip(&right) {
                let taken = self.g.mul(*factor, *known);
                terms.push(self.g.neg(taken));
            }
            let sum = self.g.sum(&terms);
            let scaled = self.g.mul(sum, link.scale);
            right.push(self.define(&format!("{prefix}right_{}", self.names[link.own]), scaled));
        }
        for (link, right) in chain.links.iter().zip(right).rev() {
            let mut terms = vec![right];
            for (coefficient, value) in link.form.iter().zip(&*x) {
                terms.push(self.g.mul(*coefficient, *value));
            }
            let sum = self.g.sum(&terms);
            let value = self.g.neg(sum);
            x[link.own] = self.define(&format!("{prefix}{}", self.names[link.own]), value);
        }
    }

    /// Gives a dependent velocity its value.
    fn known(&mut self, alpha: usize, value: ExprId) {
        let named = self.writer.define(&mut self.g, &self.names[alpha], value);
        self.replacement.insert(self.system.velocities[alpha], named);
        self.y[alpha] = named;
    }

    /// Names for the coefficients of the rows that vary.
    fn rows_by_names(&mut self, solved: &SolvedConstraint, response: &Response) -> Rows {
        self.writer.begin("coefficients of the constraint");
        let (mut forms, mut coefficients) = (Vec::with_capacity(solved.rows.len()), Vec::new());
        let mut known: BTreeMap<ExprId, ExprId> = BTreeMap::new();
        for row in &solved.rows {
            let mut form = Vec::with_capacity(row.one_form.len());
            for e in &row.one_form {
                let (q, stem) = self.g.split_coefficient(*e);
                if !self.writer.varies(&self.g, stem) {
                    form.push(*e);
                    continue;
                }
                let named = match known.get(&stem) {
                    Some(named) => *named,
                    None => {
                        let named = self.define(&format!("k{}", coefficients.len() + 1), stem);
                        coefficients.push((named, stem));
                        known.insert(stem, named);
                        named
                    }
                };
                form.push(self.g.scale(named, &q));
            }
            forms.push(form);
        }
        let order = Order::new(&self.g, &forms, response);
        let mut rows = Rows { forms, coefficients, order, chain: None, response: response.clone() };
        self.answer_by_names(solved, &mut rows);
        rows
    }

    /// The velocities, and the partial velocities `Psi` by names.
    pub(super) fn velocities_by_rows(&mut self, solved: &SolvedConstraint, response: &Response) -> Answered {
        let rows = self.rows_by_names(solved, response);
        self.writer.begin("partial velocities Psi, row by row");
        let zero = self.g.zero();
        let independent = solved.independent();
        let mut psi = vec![vec![zero; independent.len()]; self.y.len()];
        for (a, own) in independent.iter().enumerate() {
            let right: Vec<ExprId> = rows.forms.iter().map(|form| form[*own]).collect();
            let prefix = format!("d_{}_", self.names[*own]);
            for (alpha, e) in self.answer(&rows, &right, &prefix).into_iter().enumerate() {
                psi[alpha][a] = e;
            }
            psi[*own][a] = self.g.one();
        }
        self.writer.begin("velocities y = Psi u + psi0");
        let right: Vec<ExprId> = solved.rows.iter().map(|row| row.offset).collect();
        let is_affine = right.iter().any(|e| *e != zero);
        let own = if is_affine { self.answer(&rows, &right, "psi0_") } else { vec![zero; self.y.len()] };
        for (_, alpha) in &rows.order.together {
            let mut terms = vec![own[*alpha]];
            for (slope, k) in psi[*alpha].iter().zip(&independent) {
                terms.push(self.g.mul(*slope, self.y[*k]));
            }
            let sum = self.g.sum(&terms);
            self.known(*alpha, sum);
        }
        for pair in &rows.order.direct {
            let value = rows.direct_answer(&mut self.g, *pair, &right, &self.y);
            self.known(pair.1, value);
        }
        Answered { rows, partial: psi }
    }

    /// The accelerations of dependent velocities at `udot = 0`, which answer to the rates of the rows at fixed
    /// velocities; none where the constraint is not answered row by row.
    pub(super) fn lag_of_rows(&mut self) -> Result<Option<Vec<ExprId>>, Error> {
        let answered = self.way.answered();
        let (Some(answered), KinematicConstraint::Solved(solved)) = (answered, &self.system.constraint)
        else {
            return Ok(None);
        };
        let own = &answered.rows;
        self.writer.begin("accelerations of the dependent velocities at udot = 0");
        // In one pass over what the rows share, and not from a slope for each coordinate.
        let base = self.system.algebroid.base().iter().copied().zip(self.rates.iter().copied());
        let moving = base.chain([(self.system.time, self.g.one())]);
        let moving: BTreeMap<SymbolId, ExprId> = moving.filter(|(_, rate)| *rate != self.g.zero()).collect();
        let mut of_coefficients: BTreeMap<ExprId, ExprId> = BTreeMap::new();
        for (named, value) in &own.coefficients {
            let rate = self.g.derivative_along(*value, &moving);
            let name = format!("rate_{}", self.g.display(*named, Style::Plain));
            of_coefficients.insert(*named, self.define(&name, rate));
        }
        let mut rates: Vec<ExprId> = Vec::with_capacity(solved.rows.len());
        for (row, form) in solved.rows.iter().zip(&own.forms) {
            let mut terms = vec![self.g.derivative_along(row.offset, &moving)];
            for (e, y) in form.iter().zip(self.y.clone()) {
                let (q, stem) = self.g.split_coefficient(*e);
                if let Some(rate) = of_coefficients.get(&stem) {
                    let product = self.g.mul(*rate, y);
                    terms.push(self.g.scale(product, &q));
                }
            }
            let sum = self.g.sum(&terms);
            let sum = self.replace(sum)?;
            let mut candidates = vec![self.define(&format!("rate_{}", row.name), sum)];
            if let Some(written) = row.written {
                let rate = self.g.derivative_along(written, &moving);
                let rate = self.replace(rate)?;
                let other = self.define(&format!("rate_{}", row.name), rate);
                candidates.push(other);
            }
            let n = |e: &ExprId| self.n_operations(&[rates.as_slice(), &[*e]].concat());
            let best = candidates.into_iter().min_by_key(n).unwrap_or_else(|| self.g.zero());
            rates.push(best);
        }
        Ok(Some(self.answer(own, &rates, "lag_")))
    }

    /// `lambda = -R^T E` for the reactions `E = lambda_A form_A` along the rows; `reaction` by velocity.
    pub(super) fn multipliers_by_rows(&mut self, response: &Response, reaction: &[ExprId]) -> Vec<ExprId> {
        let n = response.pairs.len();
        let mut values = Vec::with_capacity(n);
        for row in 0..n {
            let terms: Vec<ExprId> =
                response.by_row.iter().zip(reaction).map(|(r, e)| self.g.mul(r[row], *e)).collect();
            let sum = self.g.sum(&terms);
            values.push(self.g.neg(sum));
        }
        values
    }
}
