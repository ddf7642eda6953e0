//! What conditions on parameters and the domains of coordinates say: signs of expressions, and inequalities to check.
//!
//! Does not know: constraints, algebroids.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Func, Graph, Rational, Sign, Style};
use hamel_lang::spec::{self, Model, Relation};

/// A condition that a base coordinate satisfies where the equations hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DomainCondition {
    /// As people write it, such as `theta < pi/2`.
    pub text: String,
    /// Positive inside of the domain, and only there.
    pub positive: ExprId,
}

/// The end of an interval as people write it: `3*pi/2`, not `3/2*pi`.
pub(super) fn spell_end(g: &mut Graph, end: ExprId) -> String {
    let (q, _) = g.split_coefficient(end);
    let whole = g.scale(end, &Rational::from(q.denom().clone()));
    let text = g.display(whole, Style::Plain);
    if q.is_integer() || text.contains(' ') {
        g.display(end, Style::Plain)
    } else {
        format!("{text}/{}", q.denom())
    }
}

/// Signs of sine and cosine on an open interval, where they have one.
fn turning_signs(low: f64, high: f64) -> Vec<(Func, Sign)> {
    use std::f64::consts::{FRAC_PI_2, PI};
    let mut signs = Vec::new();
    if low >= 0.0 && high <= PI {
        signs.push((Func::Sin, Sign::Positive));
    } else if low >= -PI && high <= 0.0 {
        signs.push((Func::Sin, Sign::Negative));
    }
    if low >= -FRAC_PI_2 && high <= FRAC_PI_2 {
        signs.push((Func::Cos, Sign::Positive));
    }
    signs
}

/// What the conditions on parameters and the domains of coordinates say about signs.
pub(super) fn signs(model: &mut Model) -> BTreeMap<ExprId, Sign> {
    let g = &mut model.graph;
    let mut signs = BTreeMap::new();
    for c in &model.conditions {
        let sign = match c.relation {
            Relation::Greater => Sign::Positive,
            Relation::GreaterEqual => Sign::NonNegative,
            Relation::NotEqual => Sign::NonZero,
        };
        let difference = g.sub(c.greater, c.less);
        signs.insert(difference, sign);
        // x > q with q >= 0 bounds x itself as well.
        let bound = g.as_rational(c.less).is_some_and(|q| *q >= Rational::from_integer(0.into()));
        if bound {
            signs.insert(c.greater, sign);
        }
    }
    let first_order = model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, x)| (s.domain, *x)));
    for (domain, symbol) in model.base.iter().map(|c| (c.domain, c.symbol)).chain(first_order) {
        if let spec::Domain::Interval(low, high) = domain {
            let x = g.sym(symbol);
            let (above, below) = (g.sub(x, low), g.sub(high, x));
            signs.insert(above, Sign::Positive);
            signs.insert(below, Sign::Positive);
            let none = BTreeMap::new();
            if let (Some(low), Some(high)) = (g.eval_f64(low, &none), g.eval_f64(high, &none)) {
                for (f, sign) in turning_signs(low, high) {
                    let value = g.func(f, x);
                    signs.insert(value, sign);
                }
                if low >= 0.0 {
                    signs.insert(x, Sign::Positive);
                }
            }
        }
    }
    signs
}

/// `low < x` and `x < high` for the coordinates and states of first order that live in intervals.
pub(super) fn domains(model: &mut Model) -> Vec<DomainCondition> {
    let Model { graph: g, base, first_order, .. } = model;
    let mut conditions = Vec::new();
    let base = base.iter().map(|c| (&c.name, c.domain, c.symbol));
    let first_order = first_order.iter().flat_map(|s| s.components.iter().map(|(n, x)| (n, s.domain, *x)));
    for (name, domain, symbol) in base.chain(first_order) {
        let spec::Domain::Interval(low, high) = domain else { continue };
        let x = g.sym(symbol);
        for (relation, end, sign) in [(">", low, 1), ("<", high, -1)] {
            // A fraction of pi would be computed at run time.
            let times = Rational::from(g.split_coefficient(end).0.denom().clone())
                * Rational::from_integer(sign.into());
            let positive = g.linear_combination(&[(x, times.clone()), (end, -times)]);
            conditions
                .push(DomainCondition { text: format!("{name} {relation} {}", spell_end(g, end)), positive });
        }
    }
    conditions
}
