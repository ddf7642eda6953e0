//! Canonical constructors: whatever is made is flattened, merged, sorted and folded.
//!
//! Deliberately does not know: derivatives, how zeros are found that no constructor folds.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{One, Signed, ToPrimitive, Zero};

use super::arena::Arena;
use super::budget::Resource;
use super::graph::{DivisionByZero, Graph};
use super::node::{ExprId, Func, Node, content};
use super::rational::{MAX_BITS, Rational, plus, times};

impl Graph {
    /// `a + b`.
    pub fn add(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.sum(&[a, b])
    }

    /// `a - b`.
    pub fn sub(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let minus = self.neg(b);
        self.sum(&[a, minus])
    }

    /// `-a`.
    pub fn neg(&mut self, a: ExprId) -> ExprId {
        self.scale(a, &-Rational::one())
    }

    /// `a * b`.
    pub fn mul(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.product(&[a, b])
    }

    /// `a / b`.
    ///
    /// # Errors
    /// [`DivisionByZero`] when `b` is identically zero.
    pub fn div(&mut self, a: ExprId, b: ExprId) -> Result<ExprId, DivisionByZero> {
        let inverse = self.pow(b, &-Rational::one())?;
        Ok(self.mul(a, inverse))
    }

    /// `q * a`; a rational factor is distributed over a sum.
    pub fn scale(&mut self, a: ExprId, q: &Rational) -> ExprId {
        if q.is_zero() {
            return Arena::ZERO;
        }
        if q.is_one() {
            return a;
        }
        if self.meter.is_exhausted() {
            return Arena::ONE;
        }
        match self.node(a) {
            Node::Constant(c) => {
                let product = times(c, q);
                self.made_number(&product);
                self.rational(product)
            }
            Node::Sum { constant, terms } => {
                let n_terms = terms.len();
                let terms = terms.iter().map(|(e, c)| (*e, times(c, q))).collect();
                let constant = times(constant, q);
                self.charge(n_terms);
                self.intern(Node::Sum { constant, terms })
            }
            Node::Product { coefficient, factors } => {
                let (coefficient, factors) = (times(coefficient, q), factors.clone());
                self.product_node(coefficient, factors)
            }
            _ => self.product_node(q.clone(), Box::new([(a, Rational::one())])),
        }
    }

    /// The sum of any number of expressions: flattened, merged, sorted.
    pub fn sum(&mut self, summands: &[ExprId]) -> ExprId {
        let weighted: Vec<_> = summands.iter().map(|e| (*e, Rational::one())).collect();
        self.linear_combination(&weighted)
    }

    /// `sum_k a_k b_k` of lists of the same length.
    pub fn dot(&mut self, a: &[ExprId], b: &[ExprId]) -> ExprId {
        let terms: Vec<ExprId> = a.iter().zip(b).map(|(x, y)| self.mul(*x, *y)).collect();
        self.sum(&terms)
    }

    /// `sum_k q_k e_k`.
    pub fn linear_combination(&mut self, summands: &[(ExprId, Rational)]) -> ExprId {
        let mut constant = Rational::zero();
        let mut merged: BTreeMap<ExprId, Rational> = BTreeMap::new();
        for (e, q) in summands {
            if self.meter.is_exhausted() {
                return Arena::ONE;
            }
            self.charge(1);
            let Graph { arena, meter, .. } = self;
            match arena.node(*e) {
                Node::Constant(c) => {
                    constant = plus(&constant, &times(c, q));
                    meter.made_number(&constant);
                }
                Node::Sum { constant: inner, terms } => {
                    constant = plus(&constant, &times(inner, q));
                    meter.made_number(&constant);
                    meter.work(terms.len() as u64);
                    for (term, c) in terms {
                        meter.made_number(add_to(&mut merged, *term, times(c, q)));
                    }
                }
                _ => {
                    let (coefficient, monic) = self.split_coefficient(*e);
                    let total = add_to(&mut merged, monic, times(&coefficient, q));
                    self.meter.made_number(total);
                }
            }
        }
        let terms: Vec<_> = merged.into_iter().filter(|(_, c)| !c.is_zero()).collect();
        match (terms.as_slice(), constant.is_zero()) {
            ([], _) => self.rational(constant),
            ([(e, c)], true) => {
                let (e, c) = (*e, c.clone());
                self.scale(e, &c)
            }
            _ => self.intern(Node::Sum { constant, terms: terms.into() }),
        }
    }

    /// Writes `e = q * monic` with a rational `q`; sums are left alone.
    pub fn split_coefficient(&mut self, e: ExprId) -> (Rational, ExprId) {
        match self.node(e) {
            Node::Product { coefficient, factors } if !coefficient.is_one() => {
                let (coefficient, factors) = (coefficient.clone(), factors.clone());
                (coefficient, self.product_node(Rational::one(), factors))
            }
            _ => (Rational::one(), e),
        }
    }

    fn product_node(&mut self, coefficient: Rational, factors: Box<[(ExprId, Rational)]>) -> ExprId {
        match &*factors {
            [] => self.rational(coefficient),
            [(base, exponent)] if exponent.is_one() => {
                if coefficient.is_one() {
                    *base
                } else if matches!(self.node(*base), Node::Sum { .. }) {
                    self.scale(*base, &coefficient)
                } else {
                    self.intern(Node::Product { coefficient, factors })
                }
            }
            _ => self.intern(Node::Product { coefficient, factors }),
        }
    }

    /// The product of any number of expressions: flattened, exponents merged, sorted, coefficient in front.
    pub fn product(&mut self, operands: &[ExprId]) -> ExprId {
        let weighted: Vec<_> = operands.iter().map(|e| (*e, Rational::one())).collect();
        self.power_product(&weighted).expect("exponents are positive")
    }

    /// `prod_k e_k ^ q_k`.
    ///
    /// Exponents of equal bases are added, which presumes bases of non-integer powers to be positive, as square roots
    /// in a real model are.
    ///
    /// # Errors
    /// [`DivisionByZero`] for a zero base with a negative exponent.
    pub fn power_product(&mut self, operands: &[(ExprId, Rational)]) -> Result<ExprId, DivisionByZero> {
        let mut coefficient = Rational::one();
        let mut merged: BTreeMap<ExprId, Rational> = BTreeMap::new();
        let mut pending: Vec<(ExprId, Rational)> = operands.iter().rev().cloned().collect();
        loop {
            while let Some((e, q)) = pending.pop() {
                if self.meter.is_exhausted() {
                    return Ok(Arena::ONE);
                }
                self.charge(1);
                if q.is_zero() {
                    continue;
                }
                match self.node(e) {
                    Node::Constant(c) if c.is_zero() => {
                        if q.is_negative() {
                            return Err(DivisionByZero);
                        }
                        return Ok(Arena::ZERO);
                    }
                    Node::Constant(c) if q.is_integer() => {
                        let c = c.clone();
                        self.multiply(&mut coefficient, &c, &q);
                    }
                    Node::Constant(c) => {
                        if let Some(root) = exact_root(c, &q) {
                            coefficient *= root;
                        } else {
                            add_to(&mut merged, e, q);
                        }
                    }
                    Node::Product { coefficient: c, factors } if q.is_integer() => {
                        let raised = factors.iter().rev().map(|(base, power)| (*base, times(power, &q)));
                        pending.extend(raised);
                        let c = c.clone();
                        self.multiply(&mut coefficient, &c, &q);
                    }
                    Node::Sum { .. } if q.is_integer() && !self.primitive.contains(&e) => {
                        let (content, primitive) = self.primitive_part(e);
                        self.multiply(&mut coefficient, &content, &q);
                        add_to(&mut merged, primitive, q);
                    }
                    _ => _ = add_to(&mut merged, e, q),
                }
            }
            pending.extend(self.fold_absolute_values(&mut merged));
            // Merging can turn the half-integer power of a constant or product into an integer one: flatten it again.
            let reducible: Vec<ExprId> = merged
                .iter()
                .filter(|(e, q)| match self.node(**e) {
                    Node::Constant(_) => q.is_integer() || **q >= Rational::one() || q.is_negative(),
                    Node::Product { .. } => q.is_integer(),
                    Node::Sum { .. } => {
                        q.is_integer() && !self.primitive.contains(*e) && !self.is_primitive(**e)
                    }
                    _ => q.is_zero(),
                })
                .map(|(e, _)| *e)
                .collect();
            if reducible.is_empty() && pending.is_empty() {
                break;
            }
            for e in reducible {
                let Some(q) = merged.remove(&e) else { continue };
                match self.node(e).clone() {
                    Node::Constant(c) if !q.is_integer() => {
                        // 2^(3/2) = 2 * 2^(1/2): the integer part joins the coefficient.
                        let whole = q.floor();
                        coefficient *= self.integer_power(&c, &whole);
                        self.made_number(&coefficient);
                        merged.insert(e, q - whole);
                    }
                    _ => pending.push((e, q)),
                }
            }
        }
        let factors: Vec<_> = merged.into_iter().filter(|(_, q)| !q.is_zero()).collect();
        Ok(self.product_node(coefficient, factors.into()))
    }

    /// Brings absolute values beside powers of their arguments to one form: `|a|^p` for even `p` is `a^p`, and
    /// `|a|^p a^m` for other `p` is `|a|^(p + m - n) a^n`, with `n = 0` for even `m`, and otherwise 1, or -1 for
    /// `p + m < 1`. So `|a|^3/a` is `|a| a`, which has a value at `a = 0`. The signs `|a|/a` and `a/|a|` stay as they
    /// are. The factors that are left to multiply are returned.
    fn fold_absolute_values(&mut self, merged: &mut BTreeMap<ExprId, Rational>) -> Vec<(ExprId, Rational)> {
        let argument = |e: &ExprId| match self.node(*e) {
            Node::Function(Func::Abs, a) => Some((*e, *a)),
            _ => None,
        };
        let absolute: Vec<(ExprId, ExprId)> = merged.keys().filter_map(argument).collect();
        let is_even = |q: &Rational| q.is_integer() && q.numer().is_even();
        let mut raised = Vec::new();
        for (value, a) in absolute {
            let p = merged[&value].clone();
            if is_even(&p) {
                merged.remove(&value);
                raised.push((a, p));
                continue;
            }
            let (c, base) = match self.node(a) {
                Node::Sum { .. } => self.primitive_part(a),
                _ => self.split_coefficient(a),
            };
            let Some(m) = merged.get(&base).filter(|m| m.is_integer()).cloned() else { continue };
            let kept = match &p + &m {
                _ if is_even(&m) => Rational::zero(),
                total if total >= Rational::one() => Rational::one(),
                _ if m.abs().is_one() => m.clone(),
                _ => -Rational::one(),
            };
            // base^d = |a|^d c^-d for even d.
            let moved = m - &kept;
            if !moved.is_zero() {
                merged.insert(base, kept);
                merged.insert(value, p + &moved);
                raised.push((self.rational(c), -moved));
            }
        }
        raised
    }

    /// Multiplies a number by `c^q` with an integer `q`.
    fn multiply(&mut self, number: &mut Rational, c: &Rational, q: &Rational) {
        let power = self.integer_power(c, q);
        *number = times(number, &power);
        self.made_number(number);
    }

    fn is_primitive(&self, e: ExprId) -> bool {
        match self.node(e) {
            Node::Sum { constant, terms } => content(constant, terms).is_none_or(|q| q.is_one()),
            _ => true,
        }
    }

    /// Writes a sum as `q * primitive`, the primitive part having coprime integer coefficients and a positive first
    /// one.
    pub fn primitive_part(&mut self, e: ExprId) -> (Rational, ExprId) {
        let Node::Sum { constant, terms } = self.node(e) else { return (Rational::one(), e) };
        let Some(q) = content(constant, terms) else {
            self.meter.give_up(Resource::NumberBits, MAX_BITS);
            return (Rational::one(), e);
        };
        self.charge(self.node(e).n_operands());
        self.made_number(&q);
        let primitive = self.scale(e, &q.recip());
        self.primitive.insert(primitive);
        (q, primitive)
    }

    /// `a ^ n` for an integer `n`; `0 ^ n` with negative `n` is refused by [`Graph::pow`], so here `n >= 0`.
    ///
    /// # Panics
    /// When `n` is negative and `a` is identically zero.
    pub fn powi(&mut self, a: ExprId, n: i64) -> ExprId {
        self.pow(a, &Rational::from(BigInt::from(n))).expect("caller gave a negative power of zero")
    }

    /// `a ^ q`.
    ///
    /// # Errors
    /// [`DivisionByZero`] for a negative power of zero, also when only the zero test sees that `a` vanishes. What is
    /// not known to vanish may be divided by: who chooses divisors asks for [`Graph::vanishing`].
    pub fn pow(&mut self, a: ExprId, q: &Rational) -> Result<ExprId, DivisionByZero> {
        if q.is_negative() && !self.meter.is_exhausted() && self.is_zero(a) {
            return Err(DivisionByZero);
        }
        self.power_product(&[(a, q.clone())])
    }

    /// The square root.
    pub fn sqrt(&mut self, a: ExprId) -> ExprId {
        let half = Rational::new(BigInt::one(), BigInt::from(2));
        self.power_product(&[(a, half)]).expect("exponent is positive")
    }

    /// An elementary function; odd and even functions take a canonical sign, values at special points fold.
    pub fn func(&mut self, f: Func, a: ExprId) -> ExprId {
        if self.meter.is_exhausted() {
            return Arena::ONE;
        }
        if a == Arena::ZERO {
            return match f {
                Func::Cos | Func::Exp | Func::Cosh => Arena::ONE,
                Func::Acos => {
                    let pi = self.pi();
                    self.scale(pi, &Rational::new(BigInt::one(), BigInt::from(2)))
                }
                Func::Ln => self.intern(Node::Function(f, a)),
                Func::Stumpff(k) => {
                    let factorial: BigInt = (1..=k).map(BigInt::from).product();
                    self.rational(Rational::new(BigInt::one(), factorial))
                }
                Func::Turn(k) => {
                    let factor =
                        |m: u8| Rational::new(BigInt::from(2 * i32::from(m)), (2 * i32::from(m) + 1).into());
                    let value = (1..=k).fold(Rational::one(), |value, m| value * factor(m));
                    self.rational(value)
                }
                _ => Arena::ZERO,
            };
        }
        match f {
            Func::Ln if a == Arena::ONE => return Arena::ZERO,
            Func::Asin | Func::Acos => {
                if let Some(turns) = self.half_turns(f, a) {
                    let pi = self.pi();
                    return self.scale(pi, &turns);
                }
            }
            Func::Abs => {
                if let Node::Constant(c) = self.node(a) {
                    let c = c.abs();
                    return self.rational(c);
                }
            }
            Func::Tan => {
                let (s, c) = (self.func(Func::Sin, a), self.func(Func::Cos, a));
                // cos is not identically zero: its argument is not the constant pi/2 unless folded, handled by Err.
                if let Ok(t) = self.div(s, c) {
                    return t;
                }
            }
            Func::Sin | Func::Cos => {
                if let Some(value) = self.quarter_turn(f, a) {
                    return value;
                }
            }
            _ => {}
        }
        // A function undoes its inverse where that has a value.
        if let Node::Function(inner, value) = self.node(a)
            && matches!(
                (f, inner),
                (Func::Sin, Func::Asin)
                    | (Func::Cos, Func::Acos)
                    | (Func::Ln, Func::Exp)
                    | (Func::Exp, Func::Ln)
            )
        {
            return *value;
        }
        if self.leads_negative(a) {
            let mirrored = self.neg(a);
            match f {
                Func::Cos | Func::Cosh | Func::Abs => return self.func(f, mirrored),
                Func::Sin | Func::Asin | Func::Atan | Func::Sinh | Func::Tanh => {
                    let value = self.func(f, mirrored);
                    return self.neg(value);
                }
                _ => {}
            }
        }
        self.intern(Node::Function(f, a))
    }

    /// The angle of the point `(x, y)` in `(-pi, pi]`.
    ///
    /// Numbers on an axis fold. The angle of the origin has no value: it stays, and its derivatives do not exist.
    pub fn atan2(&mut self, y: ExprId, x: ExprId) -> ExprId {
        let sign = |g: &Graph, e: ExprId| g.as_rational(e).map(|c| c.signum().to_integer().to_i64());
        let quarters = match (sign(self, y), sign(self, x)) {
            (Some(Some(0)), Some(Some(1))) => return Arena::ZERO,
            (Some(Some(0)), Some(Some(-1))) => 2,
            (Some(Some(s)), Some(Some(0))) if s != 0 => s,
            _ => return self.intern(Node::Atan2(y, x)),
        };
        let pi = self.pi();
        self.scale(pi, &Rational::new(BigInt::from(quarters), BigInt::from(2)))
    }

    /// The value of an inverse function at plus and minus one, of which it has no derivative, in multiples of pi.
    fn half_turns(&self, f: Func, a: ExprId) -> Option<Rational> {
        let value = self.as_rational(a).filter(|value| value.abs().is_one())?;
        let half = Rational::new(BigInt::one(), BigInt::from(2));
        match f {
            Func::Asin => Some(value * half),
            Func::Acos => Some((Rational::one() - value) * half),
            _ => None,
        }
    }

    fn quarter_turn(&mut self, f: Func, a: ExprId) -> Option<ExprId> {
        let turns = match self.node(a) {
            Node::Pi => Rational::from(BigInt::from(2)),
            Node::Product { coefficient, factors } => match &**factors {
                [(base, q)] if q.is_one() && *self.node(*base) == Node::Pi => {
                    coefficient * Rational::from(BigInt::from(2))
                }
                _ => return None,
            },
            _ => return None,
        };
        if !turns.is_integer() {
            return None;
        }
        let n = num_integer::Integer::mod_floor(turns.numer(), &BigInt::from(4)).to_i64()?;
        let sines = [0, 1, 0, -1];
        let quarter = if f == Func::Sin { n } else { (n + 1) % 4 };
        let value = sines[quarter as usize];
        Some(self.int(value))
    }

    fn leads_negative(&self, a: ExprId) -> bool {
        match self.node(a) {
            Node::Constant(c) | Node::Product { coefficient: c, .. } => c.is_negative(),
            Node::Sum { terms, .. } => terms.first().is_some_and(|(_, c)| c.is_negative()),
            _ => false,
        }
    }
}

/// Adds to the number of an expression, and returns what it is then.
fn add_to(merged: &mut BTreeMap<ExprId, Rational>, e: ExprId, q: Rational) -> &Rational {
    match merged.entry(e) {
        Entry::Vacant(place) => place.insert(q),
        Entry::Occupied(place) => {
            let total = place.into_mut();
            *total = plus(total, &q);
            total
        }
    }
}

/// `c^q` for a non-integer `q` when it is rational.
fn exact_root(c: &Rational, q: &Rational) -> Option<Rational> {
    let degree = q.denom().to_u32()?;
    if c.is_negative() {
        return None;
    }
    let root = |n: &BigInt| {
        let r = n.nth_root(degree);
        (num_traits::Pow::pow(&r, degree) == *n).then_some(r)
    };
    let root = Rational::new(root(c.numer())?, root(c.denom())?);
    Some(num_traits::Pow::pow(&root, q.numer().to_i32()?))
}
