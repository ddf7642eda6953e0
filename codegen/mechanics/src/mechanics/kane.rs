//! Kane's form of the equations of linked bodies: `A = sum m V^T V`, `f = .. - sum m V^T a`, with partial velocities
//! `V` and accelerations `a` pushed forward part by part.
//!
//! Deliberately does not know: how parts are found, whether that is cheaper than multiplying out.
//!
//! # Source
//! Kane and Levinson 1985, Dynamics, sections 2.14 and 4.11; forward mode as Griewank and Walther 2008, section 3.1.

use std::collections::BTreeMap;

use num_traits::{One, Zero};

use crate::reduction::SolvedConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Rational, SymbolId};

use super::derive::Derivation;
use super::recursion::{Recursion, Step};
use super::squares::{Square, cross};

/// Rates of change along one direction, or along the motion at `udot = 0`, in the frames of the squares.
pub(super) struct Tangent {
    /// Of the velocities of the frame.
    pub(super) velocities: Vec<ExprId>,
    /// Of the components of the squares.
    pub(super) components: Vec<Vec<ExprId>>,
}

/// What there is at some rates `udot`.
pub(super) struct Accelerated {
    /// Accelerations of the velocities of the frame.
    pub(super) velocities: Vec<ExprId>,
    /// Accelerations of the squares times their masses, by their components.
    pub(super) forces: Vec<Vec<ExprId>>,
}

impl Derivation<'_> {
    /// The dependent velocities by recursion, if the system is to be derived along one.
    pub(super) fn velocities_by_recursion(&mut self) -> Result<Option<Recursion>, Error> {
        if self.system.formulation.recursive != Some(true) {
            return Ok(None);
        }
        let Some(mut recursion) = Recursion::new(&mut self.g, self.system) else { return Ok(None) };
        self.writer.begin("velocities by recursion");
        let zero = self.g.zero();
        recursion.values = recursion.vanishing.iter().map(|s| (*s, zero)).collect();
        for step in recursion.steps.clone() {
            match step {
                Step::Part(symbol, value) => {
                    let value = self.in_recursion(&recursion, value)?;
                    let name = self.g.name(symbol).to_owned();
                    let named = self.define(&name, value);
                    recursion.values.insert(symbol, named);
                }
                Step::Solved { alpha, coefficient, rest } => {
                    let rest = self.in_recursion(&recursion, rest)?;
                    let value = self.solved_for(rest, coefficient);
                    let name = self.names[alpha].clone();
                    let named = self.define(&name, value);
                    let velocity = self.system.velocities[alpha];
                    recursion.values.insert(velocity, named);
                    self.replacement.insert(velocity, named);
                    self.y[alpha] = named;
                }
            }
        }
        Ok(Some(recursion))
    }

    /// An expression in parts and raw velocities by their values.
    pub(super) fn in_recursion(&mut self, recursion: &Recursion, e: ExprId) -> Result<ExprId, Error> {
        let value = self.g.subs(e, &recursion.values);
        value.map_err(|_| Error::DivisionByZero { place: "the velocities of linked bodies".into() })
    }

    /// `-rest / coefficient`.
    pub(super) fn solved_for(&mut self, rest: ExprId, coefficient: ExprId) -> ExprId {
        let inverse = self.g.powi(coefficient, -1);
        let quotient = self.g.mul(rest, inverse);
        self.g.neg(quotient)
    }

    /// Pushes rates of change of the inputs forward; values get names that begin with `prefix`.
    pub(super) fn by_recursion(
        &mut self,
        recursion: &Recursion,
        prefix: &str,
        inputs: BTreeMap<SymbolId, ExprId>,
    ) -> Result<Tangent, Error> {
        let mut rates = inputs;
        for step in &recursion.steps {
            let (symbol, name, value, coefficient) = match step {
                Step::Part(symbol, value) => (*symbol, self.g.name(*symbol).to_owned(), *value, None),
                Step::Solved { alpha, coefficient, rest } => {
                    (self.system.velocities[*alpha], self.names[*alpha].clone(), *rest, Some(*coefficient))
                }
            };
            let rate = self.g.derivative_along(value, &rates);
            let mut rate = self.in_recursion(recursion, rate)?;
            if let Some(coefficient) = coefficient {
                rate = self.solved_for(rate, coefficient);
            }
            let named = self.define(&format!("{prefix}{name}"), rate);
            if named != self.g.zero() {
                rates.insert(symbol, named);
            }
        }
        let zero = self.g.zero();
        // Independent velocities of the frame are among the inputs.
        let velocities = self.system.velocities.iter();
        let velocities = velocities.map(|s| rates.get(s).copied().unwrap_or(zero)).collect();
        let mut components = Vec::with_capacity(recursion.components.len());
        for (k, square) in recursion.components.iter().enumerate() {
            let mut of_square = Vec::with_capacity(square.len());
            for (i, e) in square.iter().enumerate() {
                let rate = self.g.derivative_along(*e, &rates);
                let rate = self.in_recursion(recursion, rate)?;
                of_square.push(self.define(&format!("{prefix}v{}_{}", k + 1, i + 1), rate));
            }
            components.push(of_square);
        }
        Ok(Tangent { velocities, components })
    }

    /// Partial velocities along the rates, relative to the frames of the squares in `components`.
    fn partial_velocities(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
    ) -> Result<Vec<Tangent>, Error> {
        self.writer.begin("partial velocities by recursion");
        let mut partial = Vec::with_capacity(solved.unknowns.len());
        for (b, along) in solved.unknowns.iter().enumerate() {
            let mut direction = BTreeMap::new();
            for (unknown, row) in solved.unknowns.iter().zip(&recursion.directions.inverse) {
                if !row[b].is_zero() {
                    direction.insert(unknown.symbol, self.g.rational(row[b].clone()));
                }
            }
            partial.push(self.by_recursion(recursion, &format!("d_{}_", along.name), direction)?);
        }
        Ok(partial)
    }

    /// Accelerations at `udot = 0`, of squares times their masses.
    pub(super) fn at_rest(&mut self, recursion: &Recursion) -> Result<Accelerated, Error> {
        let names = ("lag_", "accelerations of the recursion at udot = 0");
        self.along_recursion(recursion, names, BTreeMap::new())
    }

    /// Accelerations at the rates `udot` of the unknowns, zero where none is given, of squares times their masses;
    /// values get names that begin with `prefix`, in a section under `title`.
    pub(super) fn along_recursion(
        &mut self,
        recursion: &Recursion,
        (prefix, title): (&str, &str),
        udot: BTreeMap<SymbolId, ExprId>,
    ) -> Result<Accelerated, Error> {
        self.writer.begin(title);
        let one = self.g.one();
        let base = self.system.algebroid.base().iter().copied().zip(self.rates.iter().copied());
        let moving = base.chain([(self.system.time, one)]).filter(|(_, rate)| *rate != self.g.zero());
        let moving: BTreeMap<SymbolId, ExprId> = moving.chain(udot).collect();
        let drift = self.by_recursion(recursion, prefix, moving)?;
        let mut forces = Vec::with_capacity(recursion.squares.len());
        for (k, (square, lag)) in recursion.squares.iter().zip(&drift.components).enumerate() {
            let mut v = Vec::new();
            for e in &recursion.components[k] {
                let value = self.in_recursion(recursion, *e)?;
                v.push(self.g.cancel_zero(value));
            }
            let mut frame = recursion.frames[k];
            for e in frame.iter_mut().flatten() {
                *e = self.in_recursion(recursion, *e)?;
            }
            forces.push(self.inertia_force(square, k, (&v, frame), lag));
        }
        Ok(Accelerated { velocities: drift.velocities, forces })
    }

    /// `J (dv/dx xdot + omega x v)`, or `J domega/dx xdot + omega x J omega`, with the rates `lag` at fixed velocities.
    pub(super) fn inertia_force(
        &mut self,
        square: &Square,
        k: usize,
        (v, frame): (&[ExprId], Option<[ExprId; 3]>),
        lag: &[ExprId],
    ) -> Vec<ExprId> {
        if square.is_spin()
            && let Ok(omega) = <[ExprId; 3]>::try_from(v)
        {
            let momentum = square.momentum(&mut self.g, v);
            let named = [0, 1, 2].map(|i| self.define(&format!("mu{}_{}", k + 1, i + 1), momentum[i]));
            let turned = cross(&mut self.g, omega, named);
            let forces = square.momentum(&mut self.g, lag);
            return forces.iter().zip(turned).map(|(force, turned)| self.g.add(*force, turned)).collect();
        }
        let turned = square.turned(&mut self.g, &self.y, v, frame);
        let mut accelerations = Vec::with_capacity(v.len());
        for (i, (lag, turned)) in lag.iter().zip(turned).enumerate() {
            let value = self.g.add(*lag, turned);
            accelerations.push(self.define(&format!("a{}_{}", k + 1, i + 1), value));
        }
        square.momentum(&mut self.g, &accelerations)
    }

    /// The forces of everything but the squares, without what their Hessian gives the accelerations at `rest`.
    pub(super) fn net_of_rest(&mut self, rest_hessian: &[Vec<ExprId>], rest: &Accelerated) -> Vec<ExprId> {
        let mut net = Vec::with_capacity(rest_hessian.len());
        for (alpha, row) in rest_hessian.iter().enumerate() {
            let mut terms = vec![self.forces.of_rest[alpha]];
            for (h, lag) in row.iter().zip(&rest.velocities) {
                let product = self.g.mul(*h, *lag);
                terms.push(self.g.neg(product));
            }
            net.push(self.g.sum(&terms));
        }
        net
    }

    /// The equations along the directions of the recursion, with what there is at `rest`.
    pub(super) fn kane(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        rest: &Accelerated,
    ) -> Result<Kane, Error> {
        let partial = self.partial_velocities(recursion, solved)?;
        let rest_hessian = self.hessian_of(recursion.rest)?;
        let k = solved.unknowns.len();
        self.writer.begin("mass matrix A = sum m V^T V");
        let mut mass_matrix = vec![vec![self.g.zero(); k]; k];
        for b in 0..k {
            for a in 0..=b {
                let mut terms = self.weighed(recursion, &partial[a].components, &partial[b].components);
                for (alpha, row) in rest_hessian.iter().enumerate() {
                    for (beta, h) in row.iter().enumerate() {
                        if *h != self.g.zero() {
                            let (u, v) = (partial[b].velocities[alpha], partial[a].velocities[beta]);
                            terms.push(self.g.product(&[u, *h, v]));
                        }
                    }
                }
                let sum = self.g.sum(&terms);
                let name = format!("A_{}_{}", solved.unknowns[b].name, solved.unknowns[a].name);
                mass_matrix[b][a] = self.define(&name, sum);
                mass_matrix[a][b] = mass_matrix[b][a];
            }
        }
        self.writer.begin("right side f = V^T (r - m a)");
        let mut net = self.net_of_rest(&rest_hessian, rest);
        for (alpha, force) in net.iter_mut().enumerate() {
            *force = self.define(&format!("n_{}", self.names[alpha]), *force);
        }
        let mut force = vec![self.g.zero(); k];
        let mut known: Vec<(BTreeMap<ExprId, Rational>, ExprId)> = Vec::new();
        for b in (0..k).rev() {
            let mut terms = self.inertia_along(&partial[b].components, &rest.forces, &mut known);
            terms.extend((partial[b].velocities.iter().zip(&net)).map(|(w, n)| self.g.mul(*w, *n)));
            let sum = self.g.sum(&terms);
            force[b] = self.define(&format!("f_{}", solved.unknowns[b].name), sum);
        }
        let partial = partial.into_iter().map(|p| p.velocities).collect();
        Ok(Kane { mass_matrix, force, partial })
    }

    /// Sums over the squares of `weight u . v`, one for each weight.
    fn weighed(&mut self, recursion: &Recursion, u: &[Vec<ExprId>], v: &[Vec<ExprId>]) -> Vec<ExprId> {
        let mut by_weight: BTreeMap<ExprId, Vec<ExprId>> = BTreeMap::new();
        for ((square, u), v) in recursion.squares.iter().zip(u).zip(v) {
            for (i, j, weight) in &square.masses {
                by_weight.entry(*weight).or_default().push(self.g.mul(u[*i], v[*j]));
            }
        }
        let sums = by_weight.into_iter().map(|(weight, products)| {
            let sum = self.g.sum(&products);
            self.g.mul(weight, sum)
        });
        sums.collect()
    }

    /// `-u . J a` of all squares, gathered by the partial velocities, which many bodies have in common; sums of `J a`
    /// that are `known` from other directions are used in further ones.
    fn inertia_along(
        &mut self,
        u: &[Vec<ExprId>],
        forces: &[Vec<ExprId>],
        known: &mut Vec<(BTreeMap<ExprId, Rational>, ExprId)>,
    ) -> Vec<ExprId> {
        let mut by_velocity: BTreeMap<ExprId, BTreeMap<ExprId, Rational>> = BTreeMap::new();
        for (u, force) in u.iter().flatten().zip(forces.iter().flatten()) {
            if *u != self.g.zero() && *force != self.g.zero() {
                let forces = by_velocity.entry(*u).or_default();
                *forces.entry(*force).or_insert_with(Rational::zero) += Rational::one();
            }
        }
        let mut terms = Vec::with_capacity(by_velocity.len());
        for (velocity, forces) in by_velocity {
            let mut left = forces.clone();
            let mut summands = Vec::new();
            let is_part = |inner: &BTreeMap<ExprId, Rational>, left: &BTreeMap<ExprId, Rational>| {
                inner.iter().all(|(force, n)| left.get(force) == Some(n))
            };
            while let Some((inner, sum)) =
                known.iter().filter(|(inner, _)| is_part(inner, &left)).max_by_key(|(inner, _)| inner.len())
            {
                summands.push((*sum, Rational::one()));
                left.retain(|force, _| !inner.contains_key(force));
            }
            summands.extend(left);
            let sum = self.g.linear_combination(&summands);
            let sum = self.define(&format!("ma{}", known.len() + 1), sum);
            if forces.len() > 1 {
                known.push((forces, sum));
            }
            let product = self.g.mul(velocity, sum);
            terms.push(self.g.neg(product));
        }
        terms
    }
}

/// The equations `A wdot = f` along directions, `u = B w`.
pub(super) struct Kane {
    pub(super) mass_matrix: Vec<Vec<ExprId>>,
    pub(super) force: Vec<ExprId>,
    /// Partial velocities of the frame along the rates, `[k][m]`.
    pub(super) partial: Vec<Vec<ExprId>>,
}
