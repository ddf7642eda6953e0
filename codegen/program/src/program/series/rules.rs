//! The rules for the coefficient of order `k`, operation by operation.
//!
//! Does not know: which operations there are in a program, which of the values are needed.

use hamel_runtime::MAX_ORDER;

use super::{Builder, Company, MINUS_ADDEND, MINUS_PRODUCT, PLAIN, Series, plain, weighted};
use crate::program::ir::{Instruction, Op, Operand};
use hamel_expr::Func;

/// Functions of a family up to this one share its rules, whichever is asked for first.
const AHEAD: u32 = 12;

impl Builder<'_> {
    pub(super) fn instruction(&mut self, instruction: &Instruction) -> Series {
        self.section = instruction.section;
        let op = instruction.op.map(|operand| self.operand(operand).first);
        let first = self.first.push(op, self.section, instruction.name.as_ref());
        if self.is_rest(instruction.op) {
            self.rests.insert(self.values.len() as u32);
            return Series { first, next: None };
        }
        let next = match instruction.op {
            Op::Add(a, b) => {
                let (a, b) = (self.operand(a), self.operand(b));
                self.add(a.next, b.next)
            }
            Op::Sub(a, b) => {
                let (a, b) = (self.operand(a), self.operand(b));
                self.subtract(a.next, b.next)
            }
            Op::Mul(a, b) => self.factors(a, b, Some(first)),
            Op::MulAdd(signs, a, b, c) => {
                let product = self.factors(a, b, None);
                let c = self.operand(c).next;
                match (signs.product, signs.addend) {
                    (false, false) => self.add(product, c),
                    (false, true) => self.subtract(product, c),
                    (true, false) => self.subtract(c, product),
                    (true, true) => {
                        let sum = self.add(product, c);
                        self.subtract(None, sum)
                    }
                }
            }
            Op::Div(a, b) => {
                let divisor = self.operand(b);
                self.quotient(a, divisor, first)
            }
            Op::Neg(a) => {
                let a = self.operand(a);
                self.subtract(None, a.next)
            }
            Op::Recip(a) => {
                let divisor = self.operand(a);
                if divisor.next.is_some() {
                    self.reciprocals.insert(self.values.len() as u32, a);
                }
                let none = Series { first, next: None };
                self.divided(none, divisor, first)
            }
            Op::Sqrt(a) => {
                let a = self.operand(a);
                self.root(a, first)
            }
            Op::Power(a, q) => {
                let a = self.operand(a);
                self.power(a, q, first)
            }
            Op::Function(f, a) => {
                let a = self.operand(a);
                self.function(f, a, first)
            }
            // Rests, see above.
            Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..) => None,
            Op::Atan2(y, x) => {
                let (y, x) = (self.operand(y), self.operand(x));
                self.angle(y, x)
            }
        };
        Series { first, next }
    }

    /// Whether a value is nothing but what rounding left out of others. It belongs to order zero alone: coefficients of
    /// higher orders are those of the formula, in which it is zero.
    fn is_rest(&self, op: Op) -> bool {
        let is = |o: Operand| matches!(o, Operand::Value(v) if self.rests.contains(&v));
        match op {
            Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..) => true,
            Op::Mul(a, b) => is(a) || is(b),
            Op::Add(a, b) | Op::Sub(a, b) => is(a) && is(b),
            Op::MulAdd(_, a, b, c) => (is(a) || is(b)) && is(c),
            Op::Neg(a) | Op::Div(a, _) => is(a),
            Op::Recip(_) | Op::Sqrt(_) | Op::Power(..) | Op::Function(..) | Op::Atan2(..) => false,
        }
    }

    /// The divisor, when an operand of the function is a reciprocal.
    fn divisor(&self, operand: Operand) -> Option<Series> {
        match operand {
            Operand::Value(v) => self.reciprocals.get(&v).map(|divisor| self.operand(*divisor)),
            _ => None,
        }
    }

    fn quotient(&mut self, a: Operand, divisor: Series, quotient: Operand) -> Option<Operand> {
        let a = self.operand(a);
        self.divided(a, divisor, quotient)
    }

    /// The coefficient of a product of operands of the function, whose value at order zero may be known.
    fn factors(&mut self, a: Operand, b: Operand, value: Option<Operand>) -> Option<Operand> {
        let (dividend, divisor) = match (self.divisor(a), self.divisor(b)) {
            (None, Some(divisor)) => (a, divisor),
            (Some(divisor), None) => (b, divisor),
            _ => {
                let (a, b) = (self.operand(a), self.operand(b));
                return self.product(a, b);
            }
        };
        let (a, b) = (self.operand(a).first, self.operand(b).first);
        let quotient = value.unwrap_or_else(|| self.at_zero(Op::Mul(a, b)));
        self.quotient(dividend, divisor, quotient)
    }

    fn product(&mut self, a: Series, b: Series) -> Option<Operand> {
        let (a_k, b_k) = match (a.next, b.next) {
            (None, None) => return None,
            (Some(a_k), None) => {
                let b_0 = self.keep(b.first);
                return Some(self.at_order(Op::Mul(b_0, a_k)));
            }
            (None, Some(b_k)) => {
                let a_0 = self.keep(a.first);
                return Some(self.at_order(Op::Mul(a_0, b_k)));
            }
            (Some(a_k), Some(b_k)) => (a_k, b_k),
        };
        let sum = self.convolution(plain(a_k), plain(b_k));
        if a_k == b_k && a.first == b.first {
            let twice = self.at_zero(Op::Add(a.first, a.first));
            let twice = self.keep(twice);
            return Some(self.at_order(Op::MulAdd(PLAIN, twice, a_k, sum)));
        }
        let (a_0, b_0) = (self.keep(a.first), self.keep(b.first));
        let half = self.at_order(Op::MulAdd(PLAIN, b_0, a_k, sum));
        Some(self.at_order(Op::MulAdd(PLAIN, a_0, b_k, half)))
    }

    /// The coefficient of `z = a / b`; `quotient` is `z_0`.
    fn divided(&mut self, a: Series, b: Series, quotient: Operand) -> Option<Operand> {
        let Some(b_k) = b.next else {
            let a_k = a.next?;
            let b_0 = self.keep(b.first);
            return Some(self.at_order(Op::Div(a_k, b_0)));
        };
        let (z_0, inverse) = (self.keep(quotient), self.reciprocal(b.first));
        let z = self.announce();
        let sum = self.convolution(plain(b_k), plain(z));
        let known = match a.next {
            Some(a_k) => self.at_order(Op::Sub(a_k, sum)),
            None => self.at_order(Op::Neg(sum)),
        };
        let rest = self.at_order(Op::MulAdd(MINUS_PRODUCT, z_0, b_k, known));
        Some(self.define(z, Op::Mul(inverse, rest)))
    }

    /// `1 / a_0`, for `next`.
    fn reciprocal(&mut self, first: Operand) -> Operand {
        let inverse = self.at_zero(Op::Recip(first));
        self.keep(inverse)
    }

    /// `z = sqrt a`.
    fn root(&mut self, a: Series, root: Operand) -> Option<Operand> {
        let a_k = a.next?;
        let twice = self.at_zero(Op::Add(root, root));
        let inverse = self.reciprocal(twice);
        let z = self.announce();
        let sum = self.convolution(plain(z), plain(z));
        let rest = self.at_order(Op::Sub(a_k, sum));
        Some(self.define(z, Op::Mul(inverse, rest)))
    }

    /// `z = a^q`.
    fn power(&mut self, a: Series, q: Operand, power: Operand) -> Option<Operand> {
        let a_k = a.next?;
        let inverse = self.reciprocal(a.first);
        let scaled = self.at_zero(Op::Mul(q, power));
        let scaled = self.keep(scaled);
        let z = self.announce();
        let one = self.mean(weighted(a_k), plain(z));
        let other = self.mean(weighted(z), plain(a_k));
        let known = self.at_order(Op::MulAdd(MINUS_ADDEND, q, one, other));
        let rest = self.at_order(Op::MulAdd(PLAIN, scaled, a_k, known));
        Some(self.define(z, Op::Mul(inverse, rest)))
    }

    fn function(&mut self, f: Func, a: Series, value: Operand) -> Option<Operand> {
        let a_k = a.next?;
        match f {
            Func::Sin => self.circular(a, a_k).0.next,
            Func::Cos => self.circular(a, a_k).1.next,
            Func::Sinh => self.hyperbolic(a, a_k).0.next,
            Func::Cosh => self.hyperbolic(a, a_k).1.next,
            Func::Exp => {
                let z_0 = self.keep(value);
                let z = self.announce();
                let sum = self.mean(weighted(a_k), plain(z));
                Some(self.define(z, Op::MulAdd(PLAIN, z_0, a_k, sum)))
            }
            Func::Ln => Some(self.integral(a_k, Series { first: a.first, next: Some(a_k) }, false)),
            Func::Atan => {
                let w = self.one_plus_square(a, a_k);
                Some(self.integral(a_k, w, false))
            }
            Func::Asin | Func::Acos => {
                let w = self.root_of_one_minus_square(a, a_k);
                Some(self.integral(a_k, w, f == Func::Acos))
            }
            Func::Tan | Func::Tanh => {
                // w = 1 +- z^2, z' = w a'.
                let one = self.constant(1);
                let square = self.at_zero(Op::Mul(value, value));
                let twice = self.at_zero(Op::Add(value, value));
                let sign = if f == Func::Tan { Op::Add } else { Op::Sub };
                let w_first = self.at_zero(sign(one, square));
                let (w_0, twice) = (self.keep(w_first), self.keep(twice));
                let w = self.announce();
                let sum = self.mean(weighted(a_k), plain(w));
                let z = self.at_order(Op::MulAdd(PLAIN, w_0, a_k, sum));
                let squares = self.convolution(plain(z), plain(z));
                let w_k = Op::MulAdd(PLAIN, twice, z, squares);
                if f == Func::Tan {
                    self.define(w, w_k);
                } else {
                    let w_k = self.at_order(w_k);
                    self.define(w, Op::Neg(w_k));
                }
                Some(z)
            }
            Func::Stumpff(k) => Some(self.stumpff(k.into(), a, a_k)),
            Func::Turn(k) => Some(self.turn(k.into(), a, a_k)),
            Func::Abs => {
                // The sign is not a number where the function has no derivative.
                let sign = self.at_zero(Op::Div(value, a.first));
                let sign = self.keep(sign);
                Some(self.at_order(Op::Mul(sign, a_k)))
            }
        }
    }

    /// `z = atan2(y, x)`.
    fn angle(&mut self, y: Series, x: Series) -> Option<Operand> {
        if y.next.is_none() && x.next.is_none() {
            return None;
        }
        let square = self.at_zero(Op::Mul(y.first, y.first));
        let w_first = self.at_zero(Op::MulAdd(PLAIN, x.first, x.first, square));
        let (of_y, of_x) = (self.product(y, y), self.product(x, x));
        let w = self.add(of_y, of_x)?;
        let inverse = self.reciprocal(w_first);
        let along_y = y.next.map(|y_k| {
            let x_0 = self.keep(x.first);
            self.at_order(Op::Mul(x_0, y_k))
        });
        let along_x = x.next.map(|x_k| {
            let y_0 = self.keep(y.first);
            self.at_order(Op::Mul(y_0, x_k))
        });
        let mut rest = self.subtract(along_y, along_x);
        if let (Some(y_k), Some(x_k)) = (y.next, x.next) {
            let (plus, minus) = (self.mean(weighted(y_k), plain(x_k)), self.mean(weighted(x_k), plain(y_k)));
            let known = self.subtract(Some(plus), Some(minus));
            rest = self.add(rest, known);
        }
        let z = self.announce();
        let sum = self.mean(weighted(z), plain(w));
        let rest = self.subtract(rest, Some(sum))?;
        Some(self.define(z, Op::Mul(inverse, rest)))
    }

    /// The coefficient of `z` with `z' w = a'`, or `z' w = -a'`.
    fn integral(&mut self, a_k: Operand, w: Series, negative: bool) -> Operand {
        let inverse = self.reciprocal(w.first);
        // Denominators of integrals vary with their argument.
        let w_k = w.next.unwrap_or(a_k);
        let z = self.announce();
        let sum = self.mean(weighted(z), plain(w_k));
        let rest = if negative {
            let sum = self.at_order(Op::Add(a_k, sum));
            self.at_order(Op::Neg(sum))
        } else {
            self.at_order(Op::Sub(a_k, sum))
        };
        self.define(z, Op::Mul(inverse, rest))
    }

    /// Series that several functions of one argument share.
    fn in_company(
        &mut self,
        company: Company,
        a: Series,
        rule: impl FnOnce(&mut Self) -> (Series, Series),
    ) -> (Series, Series) {
        if let Some(known) = self.company.get(&(company, a.first)) {
            return *known;
        }
        let series = rule(self);
        self.company.insert((company, a.first), series);
        series
    }

    /// `sin a` and `cos a`.
    fn circular(&mut self, a: Series, a_k: Operand) -> (Series, Series) {
        self.in_company(Company::Circular, a, |builder| {
            let sin = builder.at_zero(Op::Function(Func::Sin, a.first));
            let cos = builder.at_zero(Op::Function(Func::Cos, a.first));
            let (sin_0, cos_0) = (builder.keep(sin), builder.keep(cos));
            let (s, c) = (builder.announce(), builder.announce());
            let of_cos = builder.mean(weighted(a_k), plain(c));
            let of_sin = builder.mean(weighted(a_k), plain(s));
            let sin_k = builder.define(s, Op::MulAdd(PLAIN, cos_0, a_k, of_cos));
            let minus = builder.at_order(Op::MulAdd(PLAIN, sin_0, a_k, of_sin));
            let cos_k = builder.define(c, Op::Neg(minus));
            (Series { first: sin, next: Some(sin_k) }, Series { first: cos, next: Some(cos_k) })
        })
    }

    /// `sinh a` and `cosh a`.
    fn hyperbolic(&mut self, a: Series, a_k: Operand) -> (Series, Series) {
        self.in_company(Company::Hyperbolic, a, |builder| {
            let sinh = builder.at_zero(Op::Function(Func::Sinh, a.first));
            let cosh = builder.at_zero(Op::Function(Func::Cosh, a.first));
            let (sinh_0, cosh_0) = (builder.keep(sinh), builder.keep(cosh));
            let (s, c) = (builder.announce(), builder.announce());
            let of_cosh = builder.mean(weighted(a_k), plain(c));
            let of_sinh = builder.mean(weighted(a_k), plain(s));
            let sinh_k = builder.define(s, Op::MulAdd(PLAIN, cosh_0, a_k, of_cosh));
            let cosh_k = builder.define(c, Op::MulAdd(PLAIN, sinh_0, a_k, of_sinh));
            (Series { first: sinh, next: Some(sinh_k) }, Series { first: cosh, next: Some(cosh_k) })
        })
    }

    /// `c_k(a)`, from `c_k' = (k c_(k+2) - c_(k+1)) a'/2`.
    ///
    /// The derivative of a function of the family is made of the next two, and the family has no end. But the
    /// coefficient of order `n` of `c_k` takes those of order `n - 1` of the two alone, so that functions by `2 n`
    /// ahead are needed at order zero, and are constant here.
    fn stumpff(&mut self, k: u32, a: Series, a_k: Operand) -> Operand {
        let known = |builder: &Self, m: u32| builder.company.get(&(Company::Stumpff(m), a.first)).copied();
        if let Some((Series { next: Some(known), .. }, _)) = known(self, k) {
            return known;
        }
        let last = k.max(AHEAD) + 2 * MAX_ORDER as u32;
        let half = self.half();
        let mut next: [Option<Operand>; 2] = [None; 2];
        for m in (k..=last).rev() {
            if let Some((series, _)) = known(self, m) {
                next = [series.next, next[0]];
                continue;
            }
            let [one, two] = [1, 2].map(|ahead| self.stumpff_at_zero(m + ahead, a));
            let factor = self.constant(m.into());
            let own = (m + 2 <= last).then(|| {
                // (m c_(m+2) - c_(m+1))/2 at order zero, and its mean with a'.
                let slope = self.at_zero(Op::MulAdd(MINUS_ADDEND, factor, two, one));
                let slope = self.at_zero(Op::Mul(half, slope));
                let slope = self.keep(slope);
                let [one, two] = next.map(|c| c.map(|c| self.mean(weighted(a_k), plain(c))));
                let two = two.map(|two| self.at_order(Op::Mul(factor, two)));
                match self.subtract(two, one) {
                    Some(rest) => {
                        let rest = self.at_order(Op::Mul(half, rest));
                        self.at_order(Op::MulAdd(PLAIN, slope, a_k, rest))
                    }
                    None => self.at_order(Op::Mul(slope, a_k)),
                }
            });
            let series = Series { first: self.stumpff_at_zero(m, a), next: own };
            self.company.insert((Company::Stumpff(m), a.first), (series, series));
            next = [own, next[0]];
        }
        next[0].expect("the rule of a function that others follow")
    }

    fn stumpff_at_zero(&mut self, m: u32, a: Series) -> Operand {
        let order = u8::try_from(m).expect("derivatives of no equations of motion reach this far");
        self.at_zero(Op::Function(Func::Stumpff(order), a.first))
    }

    /// `tau_k(a)`, from `tau_k' = (k + 1) tau_(k+1) a'`: the coefficient of order `n` takes that of order `n - 1` of
    /// the next function, so that functions by `n` ahead are needed at order zero, and are constant here.
    fn turn(&mut self, k: u32, a: Series, a_k: Operand) -> Operand {
        let known = |builder: &Self, m: u32| builder.company.get(&(Company::Turn(m), a.first)).copied();
        if let Some((Series { next: Some(known), .. }, _)) = known(self, k) {
            return known;
        }
        let last = k.max(AHEAD) + MAX_ORDER as u32;
        let mut next = None;
        for m in (k..=last).rev() {
            if let Some((series, _)) = known(self, m) {
                next = series.next;
                continue;
            }
            let own = (m < last).then(|| {
                let ahead = self.turn_at_zero(m + 1, a);
                let factor = self.constant((m + 1).into());
                let slope = self.at_zero(Op::Mul(factor, ahead));
                let slope = self.keep(slope);
                match next {
                    Some(next) => {
                        let rest = self.mean(weighted(a_k), plain(next));
                        let rest = self.at_order(Op::Mul(factor, rest));
                        self.at_order(Op::MulAdd(PLAIN, slope, a_k, rest))
                    }
                    None => self.at_order(Op::Mul(slope, a_k)),
                }
            });
            let series = Series { first: self.turn_at_zero(m, a), next: own };
            self.company.insert((Company::Turn(m), a.first), (series, series));
            next = own;
        }
        next.expect("the rule of a function that others follow")
    }

    fn turn_at_zero(&mut self, m: u32, a: Series) -> Operand {
        let order = u8::try_from(m).expect("derivatives of no equations of motion reach this far");
        self.at_zero(Op::Function(Func::Turn(order), a.first))
    }

    /// `1 + a^2`.
    fn one_plus_square(&mut self, a: Series, a_k: Operand) -> Series {
        let shared = self.in_company(Company::OnePlusSquare, a, |builder| {
            let one = builder.constant(1);
            let square = builder.at_zero(Op::Mul(a.first, a.first));
            let first = builder.at_zero(Op::Add(one, square));
            let next = builder.product(a, Series { first: a.first, next: Some(a_k) });
            let series = Series { first, next };
            (series, series)
        });
        shared.0
    }

    /// `sqrt(1 - a^2)`.
    fn root_of_one_minus_square(&mut self, a: Series, a_k: Operand) -> Series {
        let shared = self.in_company(Company::RootOneMinusSquare, a, |builder| {
            let one = builder.constant(1);
            let square = builder.at_zero(Op::Mul(a.first, a.first));
            let radicand = builder.at_zero(Op::Sub(one, square));
            let first = builder.at_zero(Op::Sqrt(radicand));
            let square_k = builder.product(a, Series { first: a.first, next: Some(a_k) });
            let radicand_k = builder.subtract(None, square_k);
            let next = builder.root(Series { first: radicand, next: radicand_k }, first);
            let series = Series { first, next };
            (series, series)
        });
        shared.0
    }
}
