//! What expressions of a fluid are: numbers, polynomials of the Laplacian and their inverse, their images of the
//! vorticity and of carried fields, powers of fields, and the terms of a hamiltonian.
//!
//! Does not know: items of a model.

use std::cell::RefCell;
use std::collections::BTreeMap;

use num_traits::{One, ToPrimitive, Zero};

use super::super::ast::{Expr, Node};
use super::super::limits::MAX_DEPTH;
use super::found::{Carried, Momenta};
use super::model::{FluidField, FluidTrace, MAX_FRICTION};
use super::waves::FluidWave;
use hamel_expr::Rational;

/// Most binary digits of numerator and denominator of a number, several times those of the longest that can be written:
/// definitions that square each other double them.
const MAX_BITS: u64 = 1 << 13;

/// A polynomial of the Laplacian: coefficients of its powers, the last one not zero.
pub(super) type Polynomial = Vec<Rational>;

/// A multiple of the inverse of an operator that is linear in the Laplacian, `factor (constant + Delta)^-1`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Inverse {
    pub(super) factor: Rational,
    pub(super) constant: Rational,
}

/// A function of the fields that a hamiltonian may have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Function {
    /// `dot(omega, inverse*omega)`.
    pub(super) energy: Option<Inverse>,
    /// `dot(a, polynomial*a)` of carried fields, by their numbers.
    pub(super) of_carried: BTreeMap<usize, Polynomial>,
    /// Coefficients of components of fields.
    pub(super) linear: BTreeMap<(FluidField, FluidWave), Rational>,
}

/// What an expression is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Number(Rational),
    Operator(Polynomial),
    Inverse(Inverse),
    /// An operator on a field.
    Image(FluidField, Polynomial),
    /// The inverse of an operator on the vorticity.
    Stream(Inverse),
    /// A power of the matrix of a carried field, by its coefficients.
    Star(usize, usize),
    /// A number times a trace.
    Trace(FluidTrace, Rational),
    Function(Function),
}

/// Largest power of a matrix.
pub(super) const MAX_POWER: usize = 16;

/// Names that expressions are made of.
pub(super) struct Names<'a> {
    pub(super) momenta: Momenta<'a>,
    pub(super) carried: Vec<Carried<'a>>,
    pub(super) lets: BTreeMap<&'a str, &'a Expr>,
    pub(super) params: BTreeMap<&'a str, Rational>,
    /// Forms of definitions. A definition of itself has none while it is being looked at.
    pub(super) known: RefCell<BTreeMap<&'a str, Option<Form>>>,
}

fn short(q: &Rational) -> bool {
    q.numer().bits().max(q.denom().bits()) <= MAX_BITS
}

/// The polynomial without leading zeros, unless it has a power or digits that are too many.
fn bounded(mut polynomial: Polynomial) -> Option<Polynomial> {
    while polynomial.last().is_some_and(Zero::is_zero) {
        polynomial.pop();
    }
    (polynomial.len() <= 1 + MAX_FRICTION && polynomial.iter().all(short)).then_some(polynomial)
}

fn sum(a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
    let of = |p: &Polynomial, k: usize| p.get(k).cloned().unwrap_or_else(Rational::zero);
    bounded((0..a.len().max(b.len())).map(|k| of(a, k) + of(b, k)).collect())
}

fn product(a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
    if a.is_empty() || b.is_empty() {
        return Some(Vec::new());
    }
    let mut out = vec![Rational::zero(); a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            out[i + j] += x * y;
        }
    }
    bounded(out)
}

impl Inverse {
    fn times(&self, factor: &Rational) -> Option<Inverse> {
        let factor = &self.factor * factor;
        short(&factor).then(|| Inverse { factor, constant: self.constant.clone() })
    }

    fn plus(&self, other: &Inverse) -> Option<Inverse> {
        let factor = &self.factor + &other.factor;
        (self.constant == other.constant && short(&factor))
            .then(|| Inverse { factor, constant: self.constant.clone() })
    }

    /// The inverse of an operator that is linear in the Laplacian.
    fn of(operator: &Polynomial) -> Option<Inverse> {
        match operator.as_slice() {
            [constant, slope] if !slope.is_zero() => {
                Some(Inverse { factor: slope.recip(), constant: constant / slope })
            }
            _ => None,
        }
    }

    /// The operator whose inverse it is.
    fn inverted(&self) -> Option<Polynomial> {
        (!self.factor.is_zero())
            .then(|| bounded(vec![&self.constant / &self.factor, self.factor.recip()]))
            .flatten()
    }
}

impl Function {
    fn times(self, factor: &Rational) -> Option<Function> {
        let energy = match self.energy {
            Some(energy) => Some(energy.times(factor)?),
            None => None,
        };
        let linear: BTreeMap<_, _> = self.linear.into_iter().map(|(wave, q)| (wave, q * factor)).collect();
        let scaled =
            |(k, p): (usize, Polynomial)| Some((k, bounded(p.into_iter().map(|q| q * factor).collect())?));
        let of_carried = self.of_carried.into_iter().map(scaled).collect::<Option<_>>()?;
        linear.values().all(short).then_some(Function { energy, of_carried, linear })
    }

    fn plus(mut self, other: Function) -> Option<Function> {
        self.energy = match (self.energy, other.energy) {
            (Some(a), Some(b)) => Some(a.plus(&b)?),
            (a, b) => a.or(b),
        };
        for (k, p) in other.of_carried {
            let of_field = self.of_carried.entry(k).or_default();
            *of_field = sum(of_field, &p)?;
        }
        for (wave, q) in other.linear {
            let of_wave = self.linear.entry(wave).or_insert_with(Rational::zero);
            *of_wave += q;
            if !short(of_wave) {
                return None;
            }
        }
        Some(self)
    }
}

impl Form {
    fn number(q: Rational) -> Option<Form> {
        short(&q).then_some(Form::Number(q))
    }

    fn times(self, factor: &Rational) -> Option<Form> {
        let scaled = |p: Polynomial| bounded(p.into_iter().map(|q| q * factor).collect());
        match self {
            Form::Number(q) => Form::number(q * factor),
            Form::Operator(p) => scaled(p).map(Form::Operator),
            Form::Image(field, p) => scaled(p).map(|p| Form::Image(field, p)),
            Form::Star(..) => None,
            Form::Trace(trace, q) => {
                let q = q * factor;
                short(&q).then_some(Form::Trace(trace, q))
            }
            Form::Inverse(inverse) => inverse.times(factor).map(Form::Inverse),
            Form::Stream(stream) => stream.times(factor).map(Form::Stream),
            Form::Function(function) => function.times(factor).map(Form::Function),
        }
    }

    fn plus(self, other: Form) -> Option<Form> {
        match (self, other) {
            (Form::Number(a), Form::Number(b)) => Form::number(a + b),
            (Form::Operator(a), Form::Operator(b)) => sum(&a, &b).map(Form::Operator),
            (Form::Image(of, a), Form::Image(other, b)) if of == other => {
                sum(&a, &b).map(|p| Form::Image(of, p))
            }
            (Form::Inverse(a), Form::Inverse(b)) => a.plus(&b).map(Form::Inverse),
            (Form::Stream(a), Form::Stream(b)) => a.plus(&b).map(Form::Stream),
            (Form::Function(a), Form::Function(b)) => a.plus(b).map(Form::Function),
            _ => None,
        }
    }

    fn by(self, other: Form) -> Option<Form> {
        match (self, other) {
            (Form::Number(q), form) | (form, Form::Number(q)) => form.times(&q),
            (Form::Operator(a), Form::Operator(b)) => product(&a, &b).map(Form::Operator),
            (Form::Operator(a), Form::Image(field, b)) => product(&a, &b).map(|p| Form::Image(field, p)),
            (Form::Inverse(inverse), Form::Image(FluidField::Vorticity, p)) => match p.as_slice() {
                [factor] => inverse.times(factor).map(Form::Stream),
                _ => None,
            },
            _ => None,
        }
    }

    fn power(self, exponent: &Rational) -> Option<Form> {
        let exponent = exponent.is_integer().then(|| exponent.numer().to_i32())??;
        match self {
            Form::Number(q) if exponent == -1 && !q.is_zero() => Form::number(q.recip()),
            Form::Number(q) if (0..=64).contains(&exponent) => {
                (0..exponent).try_fold(Form::Number(Rational::one()), |power, _| power.times(&q))
            }
            Form::Operator(p) if exponent == -1 => Inverse::of(&p).map(Form::Inverse),
            Form::Operator(p) if (1..=MAX_FRICTION as i32).contains(&exponent) => {
                let one = vec![Rational::one()];
                (0..exponent).try_fold(one, |power, _| product(&power, &p)).map(Form::Operator)
            }
            Form::Inverse(inverse) if exponent == -1 => inverse.inverted().map(Form::Operator),
            _ => None,
        }
    }
}

impl<'a> Names<'a> {
    /// The name of the vorticity.
    pub(super) fn vorticity(&self) -> &'a str {
        self.momenta.names.first().map_or("omega", |name| name.text.as_str())
    }

    /// What the names of components begin with.
    pub(super) fn prefix(&self) -> &'a str {
        self.momenta.labels.first().map_or("", |label| label.text.as_str())
    }

    /// The field of a name.
    pub(super) fn field(&self, name: &str) -> Option<FluidField> {
        if name == self.vorticity() {
            return Some(FluidField::Vorticity);
        }
        self.carried.iter().position(|field| field.name.text == name).map(FluidField::Carried)
    }

    /// The component of a field of a name.
    pub(super) fn component(&self, name: &str) -> Option<(FluidField, FluidWave)> {
        let labelled = self.carried.iter().enumerate().filter_map(|(k, field)| Some((k, field.label?)));
        let carried = labelled.map(|(k, label)| (FluidField::Carried(k), label.text.as_str()));
        let mut fields = std::iter::once((FluidField::Vorticity, self.prefix())).chain(carried);
        let of = |prefix: &str| self.momenta.surface.wave(self.momenta.n, name.strip_prefix(prefix)?);
        fields.find_map(|(field, prefix)| Some((field, of(prefix)?)))
    }

    pub(super) fn is_algebra(&self, expr: &Expr) -> bool {
        matches!(&expr.node, Node::Name(name) if Some(name.as_str()) == self.momenta.algebra)
    }

    /// The form of an expression, if a fluid of matrices may have it.
    pub(super) fn form(&self, expr: &Expr) -> Option<Form> {
        self.form_at(expr, 0)
    }

    fn form_at(&self, expr: &Expr, depth: usize) -> Option<Form> {
        // Definitions may be of each other; the depth of the text is bounded by the parser.
        if depth > MAX_DEPTH {
            return None;
        }
        let form = |expr: &Expr| self.form_at(expr, depth + 1);
        match &expr.node {
            Node::Number(q) => Some(Form::Number(q.clone())),
            Node::Name(name) => match self.field(name) {
                Some(field) => Some(Form::Image(field, vec![Rational::one()])),
                None => self.form_of_name(name, depth + 1),
            },
            Node::Neg(inside) => form(inside)?.times(&-Rational::one()),
            Node::Sum(list) => {
                let mut summands = list.iter().map(|(is_negative, summand)| {
                    let sign = if *is_negative { -Rational::one() } else { Rational::one() };
                    form(summand)?.times(&sign)
                });
                let first = summands.next()??;
                summands.try_fold(first, |sum, next| sum.plus(next?))
            }
            Node::Product(list) => {
                list.iter().try_fold(Form::Number(Rational::one()), |product, (divides, x)| match form(x)? {
                    Form::Number(q) if *divides => (!q.is_zero()).then(|| product.times(&q.recip()))?,
                    _ if *divides => None,
                    factor => product.by(factor),
                })
            }
            Node::Power(base, exponent) => match form(exponent)? {
                Form::Number(exponent) => form(base)?.power(&exponent),
                _ => None,
            },
            Node::Call(function, arguments) => match (function.text.as_str(), arguments.as_slice()) {
                ("laplacian", []) => Some(Form::Operator(vec![Rational::zero(), Rational::one()])),
                ("laplacian", [algebra]) if self.is_algebra(algebra) => {
                    Some(Form::Operator(vec![Rational::zero(), Rational::one()]))
                }
                ("identity", [size]) => {
                    let n = self.momenta.n;
                    let is_whole = form(size)? == Form::Number(Rational::from_integer((n * n - 1).into()));
                    is_whole.then(|| Form::Operator(vec![Rational::one()]))
                }
                ("dot", [a, b]) => self.dot(form(a)?, form(b)?),
                ("star_power" | "trace_power", [field, power]) => {
                    self.powered(&function.text, form(field)?, form(power)?)
                }
                ("star_power" | "trace_power", [algebra, field, power]) if self.is_algebra(algebra) => {
                    self.powered(&function.text, form(field)?, form(power)?)
                }
                _ => None,
            },
            Node::Index(..) | Node::List(_) => None,
        }
    }

    /// `star_power` and `trace_power` of a field.
    fn powered(&self, function: &str, field: Form, power: Form) -> Option<Form> {
        let (Form::Image(field, p), Form::Number(power)) = (field, power) else { return None };
        let power = power.is_integer().then(|| power.numer().to_usize())??;
        let is_whole = p == [Rational::one()];
        if !is_whole || !(1..=MAX_POWER).contains(&power) {
            return None;
        }
        match (function, field) {
            ("trace_power", field) => Some(Form::Trace(FluidTrace::Power(field, power), Rational::one())),
            (_, FluidField::Carried(k)) => Some(Form::Star(k, power)),
            (_, FluidField::Vorticity) => None,
        }
    }

    fn dot(&self, a: Form, b: Form) -> Option<Form> {
        // The sum over components is the mean of the product by the pairing.
        let cross = |p: &Polynomial, k: usize, power: usize| {
            let [factor] = p.as_slice() else { return None };
            let pairing = Rational::from_integer(self.momenta.surface.pairing().into());
            Some(Form::Trace(FluidTrace::Cross(k, power), factor / pairing))
        };
        match (a, b) {
            (Form::Image(FluidField::Vorticity, p), Form::Stream(stream))
            | (Form::Stream(stream), Form::Image(FluidField::Vorticity, p)) => {
                let [factor] = p.as_slice() else { return None };
                let energy = Some(stream.times(factor)?);
                Some(Form::Function(Function { energy, ..Function::default() }))
            }
            (Form::Image(FluidField::Carried(k), p), Form::Image(FluidField::Carried(other), q))
                if k == other =>
            {
                let of_carried = BTreeMap::from([(k, product(&p, &q)?)]);
                Some(Form::Function(Function { of_carried, ..Function::default() }))
            }
            (Form::Image(FluidField::Vorticity, p), Form::Star(k, power))
            | (Form::Star(k, power), Form::Image(FluidField::Vorticity, p)) => cross(&p, k, power),
            (Form::Image(FluidField::Vorticity, p), Form::Image(FluidField::Carried(k), q))
            | (Form::Image(FluidField::Carried(k), q), Form::Image(FluidField::Vorticity, p)) => {
                cross(&product(&p, &q)?, k, 1)
            }
            _ => None,
        }
    }

    /// What a parameter, a definition or a component is; a definition is looked at once however often it is used.
    fn form_of_name(&self, name: &str, depth: usize) -> Option<Form> {
        if let Some(value) = self.params.get(name) {
            return Some(Form::Number(value.clone()));
        }
        if let Some(known) = self.known.borrow().get(name) {
            return known.clone();
        }
        let Some((name, value)) = self.lets.get_key_value(name).map(|(name, value)| (*name, *value)) else {
            let linear = BTreeMap::from([(self.component(name)?, Rational::one())]);
            return Some(Form::Function(Function { linear, ..Function::default() }));
        };
        self.known.borrow_mut().insert(name, None);
        let form = self.form_at(value, depth);
        self.known.borrow_mut().insert(name, form.clone());
        form
    }
}
