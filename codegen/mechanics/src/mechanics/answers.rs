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

use super::chain::{Chain, Link};
use super::derive::Derivation;

/// Which rows give their velocity by others, in an order in which these are known, and which are solved together.
struct Order {
    direct: Vec<(usize, usize)>,
    together: Vec<(usize, usize)>,
}

/// A velocity by others, `y_own = by y`, of a row.
pub(super) struct Direct {
    pub(super) own: usize,
    pub(super) by: Vec<(usize, ExprId)>,
}

impl Derivation<'_> {
    /// The order of the rows. As few as possible are solved together: those that the model says give a velocity, those
    /// whose own velocity has no number before it, and as many others as are needed where rows wait for each other.
    fn order_of_rows(&self, response: &Response) -> Order {
        let form = |row: usize| &self.forms[row];
        let is_number = |pair: &(usize, usize)| {
            let (row, own) = *pair;
            self.g.as_rational(form(row)[own]).is_some() && !response.given.contains(pair)
        };
        let (mut numbers, mut together): (Vec<_>, Vec<_>) =
            response.pairs.iter().copied().partition(is_number);
        loop {
            let (mut direct, mut waiting) = (Vec::new(), numbers.clone());
            loop {
                let is_ready = |(row, own): &(usize, usize)| {
                    let mut others = waiting.iter().filter(|(_, other)| other != own);
                    others.all(|(_, other)| form(*row)[*other] == self.g.zero())
                };
                let Some(place) = waiting.iter().position(is_ready) else { break };
                direct.push(waiting.remove(place));
            }
            match waiting.last() {
                None => return Order { direct, together },
                Some(last) => {
                    let last = *last;
                    numbers.retain(|pair| *pair != last);
                    together.push(last);
                }
            }
        }
    }

    /// The dependent components `x` with `C_d x + r = 0`, `r` by row; each gets a name, that of its velocity after
    /// `prefix`. Other components are zero.
    pub(super) fn answer(&mut self, response: &Response, right: &[ExprId], prefix: &str) -> Vec<ExprId> {
        let Order { direct, together } = self.order_of_rows(response);
        let zero = self.g.zero();
        let mut x = vec![zero; self.y.len()];
        if !together.is_empty() {
            let mut before = vec![zero; self.y.len()];
            for pair in &direct {
                before[pair.1] = self.direct_answer(*pair, right, &before);
            }
            let mut left = Vec::with_capacity(together.len());
            for (row, own) in &together {
                let form = &self.forms[*row];
                let mut terms = vec![right[*row]];
                for (coefficient, value) in form.iter().zip(&before) {
                    terms.push(self.g.mul(*coefficient, *value));
                }
                let sum = self.g.sum(&terms);
                left.push((*row, self.define(&format!("{prefix}left_{}", self.names[*own]), sum)));
            }
            match self.chain.clone() {
                Some(chain) => self.answer_of_chain(&chain, &left, &mut x, prefix),
                None => {
                    for (_, own) in &together {
                        let terms: Vec<ExprId> =
                            left.iter().map(|(row, e)| self.g.mul(response.by_row[*own][*row], *e)).collect();
                        let sum = self.g.sum(&terms);
                        x[*own] = self.define(&format!("{prefix}{}", self.names[*own]), sum);
                    }
                }
            }
        }
        for pair in &direct {
            let value = self.direct_answer(*pair, right, &x);
            x[pair.1] = self.define(&format!("{prefix}{}", self.names[pair.1]), value);
        }
        x
    }

    /// The rows that give their velocity by others, the last first, as `y = c y + ..`.
    pub(super) fn direct_rows(&mut self, response: &Response) -> Vec<Direct> {
        let Order { direct, .. } = self.order_of_rows(response);
        let mut rows = Vec::with_capacity(direct.len());
        for (row, own) in direct.into_iter().rev() {
            let form = &self.forms[row].clone()[..self.y.len()];
            let inverse = self.g.powi(form[own], -1);
            let factor = self.g.neg(inverse);
            let others = form.iter().enumerate().filter(|(alpha, e)| *alpha != own && **e != self.g.zero());
            let others: Vec<(usize, ExprId)> = others.map(|(alpha, e)| (alpha, *e)).collect();
            let by = others.into_iter().map(|(alpha, e)| (alpha, self.g.mul(factor, e)));
            rows.push(Direct { own, by: by.collect() });
        }
        for Link { own, form, .. } in self.chain.iter().flat_map(|chain| chain.links.clone()) {
            let others = form.into_iter().enumerate().filter(|(_, e)| *e != self.g.zero());
            let others: Vec<(usize, ExprId)> = others.collect();
            let by = others.into_iter().map(|(alpha, e)| (alpha, self.g.neg(e))).collect();
            rows.push(Direct { own, by });
        }
        rows
    }

    /// The response with the coefficients by names, as far as rows are solved together.
    fn response_by_names(&mut self, solved: &SolvedConstraint, response: &Response) -> Response {
        let Order { direct, together } = self.order_of_rows(response);
        let mut response = response.clone();
        let n = together.len();
        if n > 0 && together.iter().all(|pair| response.given.contains(pair)) {
            self.chain = Some(self.chain_of(solved, &response, &direct));
            return response;
        }
        if !(2..=3).contains(&n) {
            return response;
        }
        self.writer.begin("response of what is solved together");
        let zero = self.g.zero();
        let right = vec![zero; solved.rows.len()];
        let mut matrix = vec![vec![zero; n]; n];
        for (j, (_, column)) in together.iter().enumerate() {
            let mut x = vec![zero; self.y.len()];
            x[*column] = self.g.one();
            for pair in &direct {
                x[pair.1] = self.direct_answer(*pair, &right, &x);
            }
            for (i, (row, own)) in together.iter().enumerate() {
                let form = self.forms[*row][..x.len()].to_vec();
                let sum = self.g.dot(&form, &x);
                let name = format!("C_{}_{}", self.names[*own], self.names[*column]);
                matrix[i][j] = self.define(&name, sum);
            }
        }
        let minor = |d: &mut Self, i: usize, j: usize| -> ExprId {
            let rows: Vec<usize> = (0..n).filter(|k| *k != i).collect();
            let columns: Vec<usize> = (0..n).filter(|k| *k != j).collect();
            if n == 2 {
                return matrix[rows[0]][columns[0]];
            }
            let forward = d.g.mul(matrix[rows[0]][columns[0]], matrix[rows[1]][columns[1]]);
            let backward = d.g.mul(matrix[rows[0]][columns[1]], matrix[rows[1]][columns[0]]);
            d.g.sub(forward, backward)
        };
        let mut cofactors = vec![vec![zero; n]; n];
        for (i, row) in cofactors.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let value = minor(self, i, j);
                let value = self.g.cancel_zero(value);
                *entry = if (i + j) % 2 == 0 { value } else { self.g.neg(value) };
            }
        }
        let determinant = self.g.dot(&matrix[0], &cofactors[0]);
        let inverse = self.g.powi(determinant, -1);
        let inverse = self.define("R", inverse);
        for (j, (_, own)) in together.iter().enumerate() {
            for (i, (row, _)) in together.iter().enumerate() {
                let product = self.g.mul(cofactors[i][j], inverse);
                let name = format!("R_{}_{}", self.names[*own], solved.rows[*row].name);
                let named = self.define(&name, product);
                response.by_row[*own][*row] = self.g.neg(named);
            }
        }
        response
    }

    /// The triangle of the rows that the model gives a velocity for, with what the direct rows give put into them.
    fn chain_of(
        &mut self,
        solved: &SolvedConstraint,
        response: &Response,
        direct: &[(usize, usize)],
    ) -> Chain {
        self.writer.begin("rows that are solved one after the other");
        let zero = self.g.zero();
        let right = vec![zero; solved.rows.len()];
        let independent = solved.independent();
        let columns: Vec<usize> =
            response.given.iter().map(|(_, own)| *own).chain(independent.iter().copied()).collect();
        let mut links: Vec<Link> = Vec::with_capacity(response.given.len());
        for &(row, own) in &response.given {
            let mut form = vec![zero; self.y.len()];
            let raw = self.forms[row][..self.y.len()].to_vec();
            for &column in &columns {
                let mut x = vec![zero; self.y.len()];
                x[column] = self.g.one();
                for pair in direct {
                    x[pair.1] = self.direct_answer(*pair, &right, &x);
                }
                let sum = self.g.dot(&raw, &x);
                form[column] = self.define(&format!("C_{}_{}", self.names[own], self.names[column]), sum);
            }
            let mut before = Vec::with_capacity(links.len());
            for link in &links {
                let factor = form[link.own];
                before.push(factor);
                for &column in &columns {
                    let taken = self.g.mul(factor, link.form[column]);
                    form[column] = self.g.sub(form[column], taken);
                }
                form[link.own] = zero;
            }
            let left = self.define(&format!("C_{}", self.names[own]), form[own]);
            let inverse = self.g.powi(left, -1);
            let scale = self.define(&format!("R_{}", self.names[own]), inverse);
            form[own] = zero;
            for &column in &columns {
                let scaled = self.g.mul(form[column], scale);
                let name = format!("c_{}_{}", self.names[own], self.names[column]);
                form[column] = self.define(&name, scaled);
            }
            links.push(Link { row, own, before, scale, form });
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

    fn direct_answer(&mut self, (row, own): (usize, usize), right: &[ExprId], x: &[ExprId]) -> ExprId {
        let form = &self.forms[row].clone();
        let mut terms = vec![right[row]];
        for (alpha, value) in x.iter().enumerate().filter(|(alpha, _)| *alpha != own) {
            terms.push(self.g.mul(form[alpha], *value));
        }
        let sum = self.g.sum(&terms);
        let inverse = self.g.powi(form[own], -1);
        let value = self.g.mul(sum, inverse);
        self.g.neg(value)
    }

    /// Gives a dependent velocity its value.
    fn known(&mut self, alpha: usize, value: ExprId) {
        let named = self.writer.define(&mut self.g, &self.names[alpha], value);
        self.replacement.insert(self.system.velocities[alpha], named);
        self.y[alpha] = named;
    }

    /// Names for the coefficients of the rows that vary.
    fn name_coefficients(&mut self, solved: &SolvedConstraint) {
        self.writer.begin("coefficients of the constraint");
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
                        let named = self.define(&format!("k{}", self.coefficients.len() + 1), stem);
                        self.coefficients.push((named, stem));
                        known.insert(stem, named);
                        named
                    }
                };
                form.push(self.g.scale(named, &q));
            }
            self.forms.push(form);
        }
    }

    /// The velocities, and the partial velocities `Psi` by names.
    pub(super) fn velocities_by_rows(&mut self, solved: &SolvedConstraint, response: &Response) {
        self.name_coefficients(solved);
        let response = &self.response_by_names(solved, response);
        self.writer.begin("partial velocities Psi, row by row");
        let zero = self.g.zero();
        let independent = solved.independent();
        let mut psi = vec![vec![zero; independent.len()]; self.y.len()];
        for (a, own) in independent.iter().enumerate() {
            let right: Vec<ExprId> = self.forms.iter().map(|form| form[*own]).collect();
            let prefix = format!("d_{}_", self.names[*own]);
            for (alpha, e) in self.answer(response, &right, &prefix).into_iter().enumerate() {
                psi[alpha][a] = e;
            }
            psi[*own][a] = self.g.one();
        }
        self.writer.begin("velocities y = Psi u + psi0");
        let right: Vec<ExprId> = solved.rows.iter().map(|row| row.offset).collect();
        let is_affine = right.iter().any(|e| *e != zero);
        let own = if is_affine { self.answer(response, &right, "psi0_") } else { vec![zero; self.y.len()] };
        let Order { direct, together } = self.order_of_rows(response);
        for (_, alpha) in together {
            let mut terms = vec![own[alpha]];
            for (slope, k) in psi[alpha].iter().zip(&independent) {
                terms.push(self.g.mul(*slope, self.y[*k]));
            }
            let sum = self.g.sum(&terms);
            self.known(alpha, sum);
        }
        for pair in direct {
            let y = self.y.clone();
            let value = self.direct_answer(pair, &right, &y);
            self.known(pair.1, value);
        }
        self.partial = Some(psi);
        self.response = Some(response.clone());
    }

    /// The accelerations of dependent velocities at `udot = 0`, which answer to the rates of the rows at fixed
    /// velocities; none where the constraint is not answered row by row.
    pub(super) fn lag_of_rows(&mut self) -> Result<Option<Vec<ExprId>>, Error> {
        let (Some(response), KinematicConstraint::Solved(solved)) =
            (self.response.clone(), &self.system.constraint)
        else {
            return Ok(None);
        };
        self.writer.begin("accelerations of the dependent velocities at udot = 0");
        // In one pass over what the rows share, and not from a slope for each coordinate.
        let base = self.system.algebroid.base().iter().copied().zip(self.rates.iter().copied());
        let moving = base.chain([(self.system.time, self.g.one())]);
        let moving: BTreeMap<SymbolId, ExprId> = moving.filter(|(_, rate)| *rate != self.g.zero()).collect();
        let mut of_coefficients: BTreeMap<ExprId, ExprId> = BTreeMap::new();
        for (named, value) in self.coefficients.clone() {
            let rate = self.g.derivative_along(value, &moving);
            let name = format!("rate_{}", self.g.display(named, Style::Plain));
            of_coefficients.insert(named, self.define(&name, rate));
        }
        let mut rates: Vec<ExprId> = Vec::with_capacity(solved.rows.len());
        for (row, form) in solved.rows.iter().zip(self.forms.clone()) {
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
        Ok(Some(self.answer(&response, &rates, "lag_")))
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
