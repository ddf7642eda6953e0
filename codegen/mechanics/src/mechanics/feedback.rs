//! The force of an actuator that gives a function its rate: an exact division of polynomials in velocities.
//!
//! Along the motion `ydot = L_yy^-1 (r + f u)`, with `f` the one-form of the actuator,
//!
//! ```text
//! dV/dt = a + b u,    b = dV/dy L_yy^-1 f,    a = dV/dy L_yy^-1 r + dV/dx xdot + dV/dt
//! ```
//!
//! and `dV/dt = mu` is `b u = mu - a`. At rest `b` vanishes, for a function with its least value there, so that `u` is
//! a function of the state where `mu - a` is divisible by `b`: the matching condition of energy shaping, whose terms
//! of second order in the velocities are its kinetic equations, the others its potential equation.
//!
//! Does not know: what the function is for, how accelerations are solved for.
//!
//! # Source
//! Grillo, Marsden, Nair 2011, Lyapunov constraints and global asymptotic stabilization, J. Geom. Mech. 3, 145.

use std::collections::BTreeMap;

use num_traits::{One, Signed};

use crate::reduction::{Feedback, ReducedSystem};
use hamel_expr::error::Error;
use hamel_expr::{
    Definition, ExprId, Node, Polynomial, Rational, Sign, Style, SymbolId, Vanishing, inlined, sign_of,
};
use hamel_lang::algebra::tableau::{Grade, Judge, Known};

use super::derive::Derivation;
use super::equations::Decrease;
use super::solve::Pivot;

/// Characters of a remainder that are shown.
const MAX_SHOWN: usize = 300;

/// Advice about a remainder.
const MATCHING: &str =
    "choose coefficients of the function, or a rate, for which that vanishes at every state";
/// Advice about functions that are no polynomials.
const POLYNOMIAL: &str =
    "the Lagrangian is quadratic in the velocities, and the function and its rate are polynomials in them";
/// Advice about expressions without values.
const VALUES: &str = "write the function and its rate without parts that have no value";

/// The parts of the rate of a function along the motion.
pub(super) struct RateOfFunction<'a> {
    /// `dV/dy`.
    pub(super) slope: &'a [ExprId],
    /// `dV/dx xdot + dV/dt - mu`.
    pub(super) rest: ExprId,
    /// `L_yy^-1 f`.
    pub(super) response: &'a [ExprId],
    /// `L_yy^-1 r`.
    pub(super) free: &'a [ExprId],
}

impl Derivation<'_> {
    /// `u = (mu - a)/b` by name, and its divisor where that may vanish.
    ///
    /// # Errors
    /// [`Error::NoMatching`] with the remainder.
    pub(super) fn force_of_actuator(
        &mut self,
        feedback: &Feedback,
        rate: &RateOfFunction<'_>,
    ) -> Result<((String, ExprId), Option<Pivot>), Error> {
        let refused = |reason: String, help: &'static str| Error::NoMatching {
            function: feedback.function.clone(),
            force: feedback.actuator.clone(),
            reason,
            help,
        };
        let name = self.g.name(feedback.response).to_owned();
        self.writer.begin(&format!("what {} has from {}", feedback.function, feedback.actuator));
        let whole = self.g.dot(rate.slope, rate.response);
        let whole = self.g.cancel_zero(whole);
        let b = self.define(&name, whole);
        self.response = Some(b);
        // Terms with the factor b are divided at once, and it keeps its name.
        let (of_damping, others) = self.by_response(rate.rest, feedback.response);
        let damping = self.with_response(of_damping, feedback.response, b)?;
        let along = self.g.dot(rate.slope, rate.free);
        let known = self.g.add(along, others);
        let known = self.with_response(known, feedback.response, b)?;
        let definitions: Vec<Definition> = self.writer.definitions().copied().collect();
        let values = inlined(&mut self.g, &definitions);
        let spelled = self.g.subs_all(&[known, whole], &values);
        let spelled = spelled.map_err(|_| refused("it divides by zero".into(), VALUES))?;
        let [a, divisor] = spelled[..] else { return Err(refused("it has no value".into(), VALUES)) };
        if self.g.vanishing(divisor) == Vanishing::Zero {
            let reason = format!("the force does not change the rate: `{name}` is zero");
            return Err(refused(
                reason,
                "a function of the velocities whose accelerations the force changes has it",
            ));
        }
        let (quotient, pivot) = self.quotient_of(&name, [a, divisor], &refused)?;
        self.writer.begin(&format!("force {0}, for d{1}/dt", feedback.actuator, feedback.function));
        let sum = self.g.add(quotient, damping);
        let force = self.g.neg(sum);
        let force = self.define(&feedback.actuator, force);
        Ok(((format!("lambda_{}", feedback.function), force), pivot))
    }

    /// `a/b`, exactly.
    fn quotient_of(
        &mut self,
        name: &str,
        [a, b]: [ExprId; 2],
        refused: &dyn Fn(String, &'static str) -> Error,
    ) -> Result<(ExprId, Option<Pivot>), Error> {
        let free = [a, b].map(|e| self.g.free_symbols(e));
        let momenta = self.system.momenta.iter().filter_map(|m| m.symbol);
        let moving: Vec<SymbolId> = (self.system.velocities.iter().copied().chain(momenta))
            .filter(|s| free.iter().any(|free| free.contains(s)))
            .collect();
        let judge = Judge { params: Known::Written(&self.writer), signs: Some(&self.system.signs) };
        let mut best: Option<((Grade, usize), [Polynomial; 2])> = None;
        // Any of the velocities may lead: the one with the best coefficient does.
        for first in 0..moving.len().max(1) {
            let mut order = moving.clone();
            order[..(first + 1).min(moving.len())].rotate_right(1);
            let polynomials = [a, b].map(|e| Polynomial::new(&mut self.g, e, &order));
            let [Some(a), Some(b)] = polynomials else {
                let what = "it is no polynomial in the velocities, by which it could be divided";
                return Err(refused(what.into(), POLYNOMIAL));
            };
            let Some((_, leading)) = b.leading() else { continue };
            let Some(grade) = judge.grade(&mut self.g, leading) else { continue };
            if best.as_ref().is_none_or(|(least, _)| grade < *least) {
                best = Some((grade, [a, b]));
            }
        }
        let Some(((grade, _), [dividend, divisor])) = best else {
            return Err(refused(format!("it is not seen that `{name}` is not zero"), VALUES));
        };
        let divided = dividend.divided_by(&mut self.g, &divisor);
        self.g.within_budget()?;
        let division = divided.ok_or_else(|| refused("its coefficients divide by zero".into(), VALUES))?;
        if !division.remainder.is_zero() {
            // The dividend is a - mu, and the remainder of mu - a is told.
            let left = division.remainder.expression(&mut self.g);
            let left = self.g.neg(left);
            let left = shortened(&self.g.display(left, Style::Plain));
            return Err(refused(format!("the remainder of the division by `{name}` is `{left}`"), MATCHING));
        }
        let quotient = division.quotient.expression(&mut self.g);
        let product = self.g.mul(quotient, b);
        let difference = self.g.sub(product, a);
        if self.g.vanishing(difference) != Vanishing::Zero {
            let reason =
                format!("the product of the quotient with `{name}` is not proved to be the dividend");
            return Err(refused(reason, VALUES));
        }
        let (powers, leading) = divisor.leading().expect("a divisor has a leading term");
        let watched = (grade >= Grade::Parameter).then(|| {
            let monomial = divisor.monomial(&mut self.g, powers);
            let monomial = self.g.display(monomial, Style::Plain);
            let what = format!("coefficient of {monomial} in {name}");
            Pivot::of_coefficients(&what, leading)
        });
        Ok((quotient, watched))
    }

    /// A sum as that of terms with a symbol as a factor, without one of these, and of all others.
    fn by_response(&mut self, e: ExprId, symbol: SymbolId) -> (ExprId, ExprId) {
        let (mut divided, mut others) = (Vec::new(), Vec::new());
        let own = self.g.sym(symbol);
        for (term, weight) in self.g.summands(e) {
            let has_factor = match self.g.node(term) {
                Node::Product { factors, .. } => {
                    factors.iter().any(|(base, q)| *base == own && q.is_positive() && q.is_integer())
                }
                _ => term == own,
            };
            let inverse = [(term, Rational::one()), (own, -Rational::one())];
            match has_factor.then(|| self.g.power_product(&inverse)) {
                Some(Ok(quotient)) => divided.push((quotient, weight)),
                _ => others.push((term, weight)),
            }
        }
        (self.g.linear_combination(&divided), self.g.linear_combination(&others))
    }

    fn with_response(&mut self, e: ExprId, symbol: SymbolId, value: ExprId) -> Result<ExprId, Error> {
        let place = || Error::DivisionByZero { place: "the rate of the Lyapunov function".into() };
        self.g.subs(e, &BTreeMap::from([(symbol, value)])).map_err(|_| place())
    }

    /// Whether the sign of the rate is seen.
    pub(super) fn decrease(&mut self, feedback: &Feedback) -> Decrease {
        if self.g.is_zero(feedback.rate) {
            return Decrease::Conserved;
        }
        match sign_of(&self.g, feedback.rate, &self.system.signs) {
            Sign::Negative | Sign::NonPositive => Decrease::Proved,
            _ => Decrease::Unseen,
        }
    }

    /// The system with the graph of the derivation, and what a function has from the force of an actuator in the place
    /// of its symbol.
    pub(super) fn system_with_response(&mut self) -> Result<ReducedSystem, Error> {
        let mut system = ReducedSystem { graph: std::mem::take(&mut self.g), ..self.system.clone() };
        let (Some(feedback), Some(value)) = (&self.system.feedback, self.response) else { return Ok(system) };
        let values = BTreeMap::from([(feedback.response, value)]);
        let (g, list) = system.expressions_mut();
        for (_, e) in list {
            let place = || Error::DivisionByZero { place: "the rate of the Lyapunov function".into() };
            *e = g.subs(*e, &values).map_err(|_| place())?;
        }
        Ok(system)
    }
}

fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_SHOWN) {
        Some((at, _)) => format!("{} ..", &text[..at]),
        None => text.to_owned(),
    }
}
