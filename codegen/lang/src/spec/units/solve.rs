//! Dimensions that are known in part: products of a known one and powers of unknown ones, and equations between them.
//!
//! Deliberately does not know: models, where an equation comes from.

use std::collections::{BTreeMap, HashMap, HashSet};

use num_traits::{One as _, ToPrimitive as _, Zero as _};

use crate::spec::unit::{Dimension, Exponent, add_product};
use hamel_expr::{ExprId, Func, Graph, Node, Rational, SymbolId};

/// `known * prod_k unknown_k ^ exponent_k`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Form {
    known: Dimension,
    unknowns: BTreeMap<usize, Exponent>,
    /// Whether an exponent was too long, so that nothing is said about it.
    is_lost: bool,
}

impl Form {
    pub(super) fn of(known: Dimension) -> Form {
        Form { known, unknowns: BTreeMap::new(), is_lost: false }
    }

    pub(super) fn one() -> Form {
        Form::of(Dimension::one())
    }

    /// `self * other^power`.
    pub(super) fn times(&self, other: &Form, power: &Exponent) -> Form {
        let lost = Form { is_lost: true, ..Form::one() };
        let Some(known) = self.known.times(&other.known, power) else { return lost };
        let mut product = Form { known, ..self.clone() };
        product.is_lost |= other.is_lost;
        for (k, exponent) in &other.unknowns {
            let entry = product.unknowns.entry(*k).or_default();
            let Some(sum) = add_product(entry, exponent, power) else { return lost };
            *entry = sum;
            if sum.is_zero() {
                product.unknowns.remove(k);
            }
        }
        product
    }

    pub(super) fn multiplied(&self, other: &Form) -> Form {
        self.times(other, &Exponent::one())
    }

    pub(super) fn divided(&self, other: &Form) -> Form {
        self.times(other, &-Exponent::one())
    }

    /// `self * other^power` for a power of an expression.
    fn times_power(&self, other: &Form, power: &Rational) -> Form {
        match (power.numer().to_i64(), power.denom().to_i64()) {
            (Some(above), Some(below)) => self.times(other, &Exponent::new(above, below)),
            _ => Form { is_lost: true, ..Form::one() },
        }
    }
}

/// Two things of different dimensions where there should be one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Mismatch {
    /// Terms of a sum.
    Terms { first: (ExprId, Dimension), other: (ExprId, Dimension) },
    /// A number that is added to a term with a dimension.
    Number { number: Rational, other: (ExprId, Dimension) },
    /// The argument of a function.
    Argument { function: Func, argument: (ExprId, Dimension) },
    /// The coordinates of a point whose angle is asked for.
    Angle { y: (ExprId, Dimension), x: (ExprId, Dimension) },
}

/// What is known of all dimensions.
#[derive(Debug, Default)]
pub(super) struct Dimensions {
    of_symbol: HashMap<SymbolId, Form>,
    /// Unknown dimensions by others.
    solved: BTreeMap<usize, Form>,
    n_unknowns: usize,
    /// Of every expression that was looked at; none for zero, which has every dimension.
    of_expr: HashMap<ExprId, Option<Form>>,
}

impl Dimensions {
    /// A dimension that nothing is known of.
    pub(super) fn unknown(&mut self) -> Form {
        self.n_unknowns += 1;
        Form { unknowns: BTreeMap::from([(self.n_unknowns, Exponent::one())]), ..Form::one() }
    }

    pub(super) fn set(&mut self, symbol: SymbolId, form: Form) {
        self.of_symbol.insert(symbol, form);
    }

    /// That of a symbol, unknown at first.
    pub(super) fn of_symbol(&mut self, symbol: SymbolId) -> Form {
        if let Some(form) = self.of_symbol.get(&symbol) {
            return form.clone();
        }
        let form = self.unknown();
        self.set(symbol, form.clone());
        form
    }

    /// With what is known by now.
    fn normal(&self, form: &Form) -> Form {
        let mut form = form.clone();
        // Each step replaces an unknown by ones that were unknown when it was solved for; there are finitely many.
        while let Some((k, exponent, value)) =
            (form.unknowns.iter()).find_map(|(k, e)| self.solved.get(k).map(|value| (*k, *e, value)))
        {
            form.unknowns.remove(&k);
            form = form.times(value, &exponent);
        }
        form
    }

    /// The dimension, where all of it is known.
    pub(super) fn known(&self, form: &Form) -> Option<Dimension> {
        let form = self.normal(form);
        (form.unknowns.is_empty() && !form.is_lost).then_some(form.known)
    }

    /// Takes two dimensions for one; false where they are known to differ.
    pub(super) fn equate(&mut self, a: &Form, b: &Form) -> bool {
        let quotient = self.normal(&a.divided(b));
        let Some((k, exponent)) = quotient.unknowns.iter().next_back().map(|(k, e)| (*k, *e)) else {
            return quotient.is_lost || quotient.known.is_one();
        };
        if quotient.is_lost {
            return true;
        }
        let mut rest = quotient;
        rest.unknowns.remove(&k);
        let value = Form::one().times(&rest, &-exponent.recip());
        self.solved.insert(k, value);
        true
    }

    /// The known dimensions of two forms that differ.
    fn shown(&self, form: &Form) -> Dimension {
        self.normal(form).known
    }

    /// The dimension of an expression, with what is wrong in it; nothing for zero. What was looked at before is not
    /// wrong again.
    pub(super) fn of(&mut self, g: &Graph, e: ExprId, wrong: &mut Vec<Mismatch>) -> Option<Form> {
        let mut pending = vec![e];
        let mut reached = Vec::new();
        let mut seen = HashSet::new();
        while let Some(e) = pending.pop() {
            if !self.of_expr.contains_key(&e) && seen.insert(e) {
                reached.push(e);
                g.node(e).for_each_operand(|operand| pending.push(operand));
            }
        }
        // Operands have smaller positions.
        reached.sort();
        for e in reached {
            let form = self.of_node(g.node(e), wrong);
            self.of_expr.insert(e, form);
        }
        self.of_expr.get(&e).cloned().flatten()
    }

    fn operand(&self, e: ExprId) -> Option<Form> {
        self.of_expr.get(&e).cloned().flatten()
    }

    fn of_node(&mut self, node: &Node, wrong: &mut Vec<Mismatch>) -> Option<Form> {
        match node {
            Node::Constant(q) => (!q.is_zero()).then(Form::one),
            Node::Pi => Some(Form::one()),
            Node::Symbol(symbol) => Some(self.of_symbol(*symbol)),
            Node::Sum { constant, terms } => {
                let mut forms = terms.iter().filter_map(|(e, _)| Some((*e, self.operand(*e)?)));
                let (first, form) = forms.next()?;
                let others: Vec<(ExprId, Form)> = forms.collect();
                for (other, of_other) in others {
                    if !self.equate(&form, &of_other) {
                        let [first, other] =
                            [(first, &form), (other, &of_other)].map(|(e, f)| (e, self.shown(f)));
                        wrong.push(Mismatch::Terms { first, other });
                        return Some(form);
                    }
                }
                if !constant.is_zero() && !self.equate(&form, &Form::one()) {
                    let other = (first, self.shown(&form));
                    wrong.push(Mismatch::Number { number: constant.clone(), other });
                }
                Some(form)
            }
            Node::Product { factors, .. } => {
                let mut product = Form::one();
                for (e, power) in factors.iter() {
                    product = product.times_power(&self.operand(*e)?, power);
                }
                Some(product)
            }
            Node::Function(Func::Abs, argument) => self.operand(*argument),
            Node::Function(function, argument) => {
                if let Some(form) = self.operand(*argument)
                    && !self.equate(&form, &Form::one())
                {
                    let argument = (*argument, self.shown(&form));
                    wrong.push(Mismatch::Argument { function: *function, argument });
                }
                Some(Form::one())
            }
            Node::Atan2(y, x) => {
                if let (Some(of_y), Some(of_x)) = (self.operand(*y), self.operand(*x))
                    && !self.equate(&of_y, &of_x)
                {
                    let [y, x] = [(*y, &of_y), (*x, &of_x)].map(|(e, form)| (e, self.shown(form)));
                    wrong.push(Mismatch::Angle { y, x });
                }
                Some(Form::one())
            }
        }
    }
}
