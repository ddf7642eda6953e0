//! Accelerations where the constraint is kept: all velocities move freely, and multipliers hold the conditions on
//! accelerations.
//!
//! Does not know: how a matrix is factored.

use std::collections::BTreeMap;

use num_traits::{One, Signed};

use crate::reduction::{AccelerationRow, AccelerationSource};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Node, Rational, SymbolId};

use super::balance::{Balance, Kept};
use super::constrained::inertias;
use super::derive::{Derivation, Motion};
use super::equations::LinearSystem;
use super::feedback::RateOfFunction;
use super::solve::{Factorisation, Pivot};

/// What accelerations are solved for by.
struct Inertia {
    factors: Factorisation,
    matrix: Vec<Vec<ExprId>>,
    /// The forces.
    drive: Vec<ExprId>,
    /// `w` and `w0` of each constraint where they are part of the matrix.
    conditions: Option<Vec<(Vec<ExprId>, ExprId)>>,
}

impl Derivation<'_> {
    /// `L_yy ydot = drive + Lambda^T lambda`, `w ydot + w0 = 0`, by `S = w L_yy^-1 Lambda^T`: the multipliers act along
    /// the one-forms `Lambda` that vanish on virtual displacements and keep the conditions on accelerations.
    ///
    /// Of a mode with the symbol `s` rows and forms have the factor `s`, and its row is
    /// `w ydot + w0 + (1 - s) lambda = 0`: the multiplier vanishes while the mode is off, and `S` gains `1 - s` on its
    /// diagonal.
    pub(super) fn solve_with_multipliers(
        &mut self,
        rows: &[AccelerationRow],
        reactions: &[Vec<ExprId>],
    ) -> Result<Motion, Error> {
        let m = self.y.len();
        let names = self.names.clone();
        let (rows, reactions) = (&self.rows_on_state(rows)?, &self.forms_on_state(reactions)?);
        let Inertia { factors, matrix: mass, drive, conditions } = self.inertia(rows)?;
        let inertia = if conditions.is_some() { "K" } else { "L_yy" };
        self.writer.begin(&format!("free acceleration {inertia}^-1 r"));
        let prefixed = |prefix: &str| names.iter().map(|n| format!("{prefix}_{n}")).collect::<Vec<_>>();
        let free = factors.solve(&mut self.g, &mut self.writer, &prefixed("free"), &drive);
        self.writer.begin(&format!("response to the multipliers {inertia}^-1 Lambda^T"));
        let mut response = Vec::new();
        for (c, form) in reactions.iter().enumerate() {
            let labels = prefixed(&format!("Z{}", c + 1));
            response.push(factors.solve(&mut self.g, &mut self.writer, &labels, form));
        }
        if let (Some(feedback), [row], [column]) =
            (&self.system.feedback, rows.as_slice(), response.as_slice())
        {
            let AccelerationSource::Servo(rest) = row.source else {
                return Err(Error::Unsupported {
                    what: "a Lyapunov function whose row is no condition on accelerations".into(),
                    possible: "a function of coordinates and velocities".into(),
                });
            };
            let of_rate = RateOfFunction { slope: &row.one_form, rest, response: column, free: &free };
            let (force, pivot) = self.force_of_actuator(feedback, &of_rate)?;
            let reactions = reactions.clone();
            return self.motion_with_force(&factors, (&free, column), reactions, (force, pivot));
        }
        let title = format!("multipliers S lambda = -(w {inertia}^-1 r + w0), S = w {inertia}^-1 Lambda^T");
        self.writer.begin(&title);
        let mut matrix = Vec::new();
        let mut right = Vec::new();
        let mut is_congruent = true;
        let (mut forms, mut offsets, mut slack) = (Vec::new(), Vec::new(), Vec::new());
        for (c, row) in rows.iter().enumerate() {
            let (form, rate) = match &conditions {
                Some(conditions) => conditions[c].clone(),
                None => self.condition(row)?,
            };
            let off = self.slack(row.mode);
            let mut entries = Vec::new();
            for (other, z) in response.iter().enumerate() {
                let mut entry = self.g.dot(&form, z);
                if other == c {
                    entry = self.g.add(entry, off);
                }
                entries.push(self.define(&format!("S_{}_{}", c + 1, other + 1), entry));
            }
            slack.push(off);
            matrix.push(entries);
            let product = self.g.dot(&form, &free);
            // S = Lambda L_yy^-1 Lambda^T where the reactions act along the constraints.
            is_congruent &= reactions.get(c) == Some(&form);
            let sum = self.g.add(product, rate);
            let value = self.g.neg(sum);
            right.push(self.define(&format!("g_{}", c + 1), value));
            forms.push(form);
            offsets.push(rate);
        }
        let labels: Vec<String> = rows.iter().map(|r| format!("lambda_{}", r.name)).collect();
        let pivot_names: Vec<String> =
            rows.iter().map(|r| format!("response to constraint {}", r.text)).collect();
        let (lambda, constraint_pivots) =
            self.solve_for_multipliers(&matrix, &right, &labels, (&pivot_names, is_congruent))?;
        self.writer.begin(&format!("accelerations ydot = {inertia}^-1 (r + Lambda^T lambda)"));
        let mut acceleration = Vec::new();
        for alpha in 0..m {
            let mut terms = vec![free[alpha]];
            for (c, z) in response.iter().enumerate() {
                terms.push(self.g.mul(z[alpha], lambda[c]));
            }
            let sum = self.g.sum(&terms);
            acceleration.push(self.define(&format!("dot_{}", names[alpha]), sum));
        }
        let mut pivots = factors.pivots(&inertias(&names), true);
        pivots.extend(constraint_pivots);
        let after = self.velocities_after_impacts((rows, reactions), &factors)?;
        let kept = Kept { rows: forms, forms: reactions.to_vec(), slack };
        let own = (self.hessian.clone(), self.forces.drive.clone());
        let balance = (self.transform.is_none()).then(|| {
            let solution = [acceleration.as_slice(), &lambda];
            let balance = self.balance_with_multipliers((&mass, &drive), (kept, &offsets), solution);
            // The forces that accelerations take do not contain the inertia of constraints.
            let given: Vec<ExprId> =
                balance.accelerations.iter().take(m).map(|(symbol, _)| self.g.sym(*symbol)).collect();
            let forces = own.0.iter().zip(&own.1).map(|(row, force)| {
                let inertial = self.g.dot(row, &given);
                self.g.sub(inertial, *force)
            });
            let forces = forces.collect();
            Box::new(Balance { forces, ..balance })
        });
        Ok(Motion {
            unknown_rates: acceleration.clone(),
            acceleration,
            multipliers: labels.into_iter().zip(lambda).collect(),
            reactions: reactions.to_vec(),
            system: Some(LinearSystem { mass_matrix: own.0, force: own.1, unknowns: names, balance }),
            pivots,
            momentum_rates: Vec::new(),
            after,
        })
    }

    /// The inertia `L_yy` and the forces `r` that accelerations are solved for by. Where some velocities have no
    /// inertia, `K = L_yy + w^T w` and `r - w^T w0` have the same solutions, as `w ydot + w0 = 0`; they have one where
    /// every velocity that the constraints allow has inertia.
    ///
    /// # Errors
    /// [`Error::SingularMassMatrix`] with a direction that the constraints allow.
    ///
    /// # Source
    /// Benzi, Golub and Liesen 2005, Numerical solution of saddle point problems, section 3.4 (augmented Lagrangian).
    fn inertia(&mut self, rows: &[AccelerationRow]) -> Result<Inertia, Error> {
        let (mut matrix, mut drive) = (self.hessian.clone(), self.forces.drive.clone());
        if let Some(transform) = &self.transform {
            return Ok(Inertia { factors: transform.factors.clone(), matrix, drive, conditions: None });
        }
        self.writer.begin("factors of L_yy");
        let error = match self.factors_of("M", &matrix) {
            Ok(factors) => return Ok(Inertia { factors, matrix, drive, conditions: None }),
            Err(error) => error,
        };
        let holds_always = rows.iter().all(|row| row.mode.is_none()) && self.system.feedback.is_none();
        if !(holds_always && matches!(error, Error::SingularMassMatrix { .. })) {
            return Err(error);
        }
        self.writer.begin("inertia with that of the constraints: K = L_yy + w^T w, r - w^T w0");
        let mut conditions = Vec::with_capacity(rows.len());
        for row in rows {
            let (form, rate) = self.condition(row)?;
            for i in 0..form.len() {
                for j in 0..form.len() {
                    let product = self.g.mul(form[i], form[j]);
                    matrix[i][j] = self.g.add(matrix[i][j], product);
                }
                let product = self.g.mul(form[i], rate);
                drive[i] = self.g.sub(drive[i], product);
            }
            conditions.push((form, rate));
        }
        for (i, force) in drive.iter_mut().enumerate() {
            for j in 0..=i {
                matrix[i][j] = self.define(&format!("K_{}_{}", i + 1, j + 1), matrix[i][j]);
                matrix[j][i] = matrix[i][j];
            }
            *force = self.define(&format!("r_{}", i + 1), *force);
        }
        self.writer.begin("factors of K");
        let factors = self.factors_of("K", &matrix)?;
        Ok(Inertia { factors, matrix, drive, conditions: Some(conditions) })
    }

    fn factors_of(&mut self, prefix: &str, matrix: &[Vec<ExprId>]) -> Result<Factorisation, Error> {
        let (g, writer, signs) = (&mut self.g, &mut self.writer, &self.system.signs);
        Factorisation::new(g, writer, prefix, matrix, &self.names, signs, &[])
    }

    /// `w` and `w0` of a condition on accelerations, without the factors that they share.
    fn condition(&mut self, row: &AccelerationRow) -> Result<(Vec<ExprId>, ExprId), Error> {
        let rate = match row.source {
            // In raw velocities, as its derivative is taken.
            AccelerationSource::Differentiated(residual) => self.drift(residual)?,
            AccelerationSource::Servo(remainder) => remainder,
        };
        Ok(match row.mode {
            Some(_) => (row.one_form.clone(), rate),
            None => self.without_common_factors(&row.one_form, rate),
        })
    }

    /// The motion at the force of an actuator, `ydot = L_yy^-1 (r + f u)`.
    ///
    /// Nothing says how its accelerations are differentiated but their definitions: what a function has from the force
    /// vanishes at rest, where the force does not.
    fn motion_with_force(
        &mut self,
        factors: &Factorisation,
        (free, column): (&[ExprId], &[ExprId]),
        reactions: Vec<Vec<ExprId>>,
        (force, pivot): ((String, ExprId), Option<Pivot>),
    ) -> Result<Motion, Error> {
        let names = self.names.clone();
        self.writer.begin("accelerations ydot = L_yy^-1 (r + f u)");
        let mut acceleration = Vec::new();
        for (name, (free, z)) in names.iter().zip(free.iter().zip(column)) {
            let along = self.g.mul(*z, force.1);
            let sum = self.g.add(*free, along);
            acceleration.push(self.define(&format!("dot_{name}"), sum));
        }
        let mut pivots = factors.pivots(&inertias(&names), true);
        pivots.extend(pivot);
        let (hessian, drive) = (self.hessian.clone(), self.forces.drive.clone());
        Ok(Motion {
            unknown_rates: acceleration.clone(),
            acceleration,
            multipliers: vec![force],
            reactions,
            system: Some(LinearSystem { mass_matrix: hessian, force: drive, unknowns: names, balance: None }),
            pivots,
            momentum_rates: Vec::new(),
            after: Vec::new(),
        })
    }

    /// `1 - s`: what the row of a constraint has on its multiplier; zero without a mode.
    pub(super) fn slack(&mut self, mode: Option<SymbolId>) -> ExprId {
        let Some(symbol) = mode else { return self.g.zero() };
        let (one, s) = (self.g.one(), self.g.sym(symbol));
        self.g.sub(one, s)
    }

    /// `w ydot + w0 = 0` without the factors that all its terms share and that change along a motion:
    /// `v vdot + x v = 0` is `vdot + x = 0`, where nothing divides by `v`.
    fn without_common_factors(&mut self, form: &[ExprId], rate: ExprId) -> (Vec<ExprId>, ExprId) {
        let mut shared: Option<BTreeMap<ExprId, Rational>> = None;
        let zero = self.g.zero();
        for e in form.iter().copied().chain([rate]).filter(|e| *e != zero) {
            for (term, _) in self.g.summands(e) {
                let factors: BTreeMap<ExprId, Rational> = match self.g.node(term) {
                    Node::Product { factors, .. } => factors.iter().cloned().collect(),
                    _ => BTreeMap::from([(term, Rational::one())]),
                };
                shared = Some(match shared {
                    None => factors,
                    Some(mut shared) => {
                        shared.retain(|base, q| match factors.get(base) {
                            Some(own) => {
                                *q = own.min(q).clone();
                                true
                            }
                            None => false,
                        });
                        shared
                    }
                });
            }
        }
        let mut shared = shared.unwrap_or_default();
        shared.retain(|base, q| q.is_positive() && self.writer.varies(&self.g, *base));
        if shared.is_empty() {
            return (form.to_vec(), rate);
        }
        let inverse: Vec<(ExprId, Rational)> = shared.into_iter().map(|(base, q)| (base, -q)).collect();
        let mut divided = |e: ExprId| {
            let terms = self.g.summands(e).into_iter().map(|(term, weight)| {
                let factors = inverse.iter().cloned().chain([(term, Rational::one())]);
                let quotient = self.g.power_product(&factors.collect::<Vec<_>>());
                (quotient.unwrap_or(term), weight)
            });
            let terms: Vec<(ExprId, Rational)> = terms.collect();
            self.g.linear_combination(&terms)
        };
        (form.iter().map(|e| divided(*e)).collect(), divided(rate))
    }

    /// `S lambda = right`; of the pivots the names are given, and whether they follow the Hessian.
    pub(super) fn solve_for_multipliers(
        &mut self,
        response: &[Vec<ExprId>],
        right: &[ExprId],
        labels: &[String],
        pivots: (&[String], bool),
    ) -> Result<(Vec<ExprId>, Vec<Pivot>), Error> {
        let solved = self.solve_linear("S", response, right, labels, labels, pivots);
        solved.map_err(|error| match error {
            Error::SingularMassMatrix { direction } => Error::NoResponse { multipliers: direction },
            other => other,
        })
    }

    /// The rates of accelerations along constraints of third order, which no velocity moves.
    pub(super) fn carried_accelerations(&mut self, motion: &Motion) -> Result<(), Error> {
        let system = self.system;
        if system.higher.carried.is_empty() {
            return Ok(());
        }
        self.writer.begin("rates of accelerations along constraints s = w ydot, from w yddot + w0 = 0");
        let accelerations = system.higher.accelerations.iter().copied();
        let values: BTreeMap<SymbolId, ExprId> =
            accelerations.zip(motion.acceleration.iter().copied()).collect();
        for carried in &system.higher.carried {
            let rate = self.replace(carried.rate)?;
            let place = || Error::DivisionByZero { place: "the rate of an acceleration".into() };
            let rate = self.g.subs(rate, &values).map_err(|_| place())?;
            let rate = self.g.cancel_zero(rate);
            let name = format!("dot_{}", self.g.name(carried.symbol));
            let named = self.define(&name, rate);
            let own = system.algebroid.base().iter().position(|x| *x == carried.symbol);
            if let Some(rate) = own.and_then(|i| self.rates.get_mut(i)) {
                *rate = named;
            }
        }
        Ok(())
    }

    /// Conditions on accelerations, with the velocities that momenta determine replaced but in residuals.
    pub(super) fn rows_on_state(&mut self, rows: &[AccelerationRow]) -> Result<Vec<AccelerationRow>, Error> {
        let mut replaced = rows.to_vec();
        if !self.system.momenta.is_empty() {
            for row in &mut replaced {
                for e in &mut row.one_form {
                    *e = self.replace(*e)?;
                }
                if let AccelerationSource::Servo(remainder) = &mut row.source {
                    *remainder = self.replace(*remainder)?;
                }
            }
        }
        Ok(replaced)
    }

    pub(super) fn forms_on_state(&mut self, forms: &[Vec<ExprId>]) -> Result<Vec<Vec<ExprId>>, Error> {
        let mut replaced = forms.to_vec();
        if !self.system.momenta.is_empty() {
            for e in replaced.iter_mut().flatten() {
                *e = self.replace(*e)?;
            }
        }
        Ok(replaced)
    }
}
