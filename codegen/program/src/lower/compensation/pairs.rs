//! Values of a program as unevaluated sums of two: what an operation gives, and what rounding left out of it.
//!
//! ```text
//! a + b = s + e,  a b = p + e,  a = q b + r  exactly;   (a + a') (b + b') = p + (e + a b' + a' b) + ..
//! ```
//!
//! Sources: Dekker 1971, A floating-point technique for extending the available precision; Ogita, Rump and Oishi 2005,
//! Accurate sum and dot product; Langlois 2001, Automatic linear correction of rounding errors. Does not know: which
//! values are worth it.

use std::collections::{BTreeMap, HashMap};

use num_bigint::BigInt;
use num_traits::One;

use super::loss::Weights;
use crate::program::edit::{Additions, drop_dead, is_fixed, operand, prune};
use crate::program::{Constant, Function, Instruction, Op, Operand, Prepare, Program, Signs, Slot};
use hamel_expr::{Func, Rational};

/// A value, and what it lacks to the exact one where that is known.
#[derive(Clone, Copy, Debug)]
struct Pair {
    value: Operand,
    rest: Option<Operand>,
}

impl Pair {
    fn plain(value: Operand) -> Pair {
        Pair { value, rest: None }
    }
}

/// A list of instructions under way.
struct Writer<'a> {
    new: Vec<Instruction>,
    known: HashMap<Op, Operand>,
    section: u32,
    /// The constant one, and the least number that a divisor is kept away from zero by.
    one: Operand,
    least: Operand,
    /// The part that depends on parameters alone; none while that is written itself.
    prepare: Option<&'a mut Prepare>,
}

impl<'a> Writer<'a> {
    fn new([one, least]: [Operand; 2], prepare: Option<&'a mut Prepare>) -> Writer<'a> {
        Writer { new: Vec::new(), known: HashMap::new(), section: 0, one, least, prepare }
    }

    fn push(&mut self, op: Op) -> Operand {
        if let Some(known) = self.known.get(&op) {
            return *known;
        }
        let value = match &mut self.prepare {
            Some(prepare) if op.operands().all(is_fixed) => prepared(prepare, op),
            _ => {
                self.new.push(Instruction { op, section: self.section, name: None });
                operand(self.new.len() - 1)
            }
        };
        self.known.insert(op, value);
        value
    }

    fn plus(&mut self, a: Option<Operand>, b: Option<Operand>) -> Option<Operand> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.push(Op::Add(a, b))),
            (a, b) => a.or(b),
        }
    }

    fn minus(&mut self, a: Option<Operand>, b: Option<Operand>) -> Option<Operand> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.push(Op::Sub(a, b))),
            (None, Some(b)) => Some(self.push(Op::Neg(b))),
            (a, None) => a,
        }
    }

    /// `sum + a b`.
    fn plus_product(&mut self, sum: Option<Operand>, a: Operand, b: Option<Operand>) -> Option<Operand> {
        match (sum, b) {
            (Some(sum), Some(b)) => Some(self.push(Op::MulAdd(Signs::default(), a, b, sum))),
            (None, Some(b)) => Some(self.push(Op::Mul(a, b))),
            (sum, None) => sum,
        }
    }

    /// `sum - a b`.
    fn minus_product(&mut self, sum: Option<Operand>, a: Operand, b: Option<Operand>) -> Option<Operand> {
        let signs = Signs { product: true, addend: false };
        match (sum, b) {
            (Some(sum), Some(b)) => Some(self.push(Op::MulAdd(signs, a, b, sum))),
            (None, Some(b)) => {
                let product = self.push(Op::Mul(a, b));
                Some(self.push(Op::Neg(product)))
            }
            (sum, None) => sum,
        }
    }

    fn opposite(&mut self, a: Pair) -> Pair {
        Pair { value: self.push(Op::Neg(a.value)), rest: self.minus(None, a.rest) }
    }

    /// The rounded value of a pair.
    fn rounded(&mut self, a: Pair) -> Pair {
        Pair::plain(a.rest.map_or(a.value, |rest| self.push(Op::Add(a.value, rest))))
    }

    /// The same pair, its value rounded from both.
    fn normal(&mut self, a: Pair) -> Pair {
        let Some(rest) = a.rest else { return a };
        let rest = self.push(Op::SumError(a.value, rest));
        Pair { value: self.rounded(a).value, rest: Some(rest) }
    }

    fn sum(&mut self, a: Pair, b: Pair) -> Pair {
        let value = self.push(Op::Add(a.value, b.value));
        let error = self.push(Op::SumError(a.value, b.value));
        let rests = self.plus(a.rest, b.rest);
        let sum = Pair { value, rest: self.plus(Some(error), rests) };
        // Of two rounded numbers the error is less than half a unit in the last place of the sum.
        if rests.is_some() { self.normal(sum) } else { sum }
    }

    fn difference(&mut self, a: Pair, b: Pair) -> Pair {
        let value = self.push(Op::Sub(a.value, b.value));
        let opposite = self.push(Op::Neg(b.value));
        let error = self.push(Op::SumError(a.value, opposite));
        let rests = self.minus(a.rest, b.rest);
        let difference = Pair { value, rest: self.plus(Some(error), rests) };
        if rests.is_some() { self.normal(difference) } else { difference }
    }

    fn product(&mut self, a: Pair, b: Pair) -> Pair {
        let value = self.push(Op::Mul(a.value, b.value));
        let error = self.push(Op::ProductError(a.value, b.value));
        let rest = self.plus_product(Some(error), a.value, b.rest);
        Pair { value, rest: self.plus_product(rest, b.value, a.rest) }
    }

    /// `a/b`, where `quotient` is its rounded value: `a - quotient b`, which is exact, by `b`.
    fn quotient(&mut self, quotient: Operand, a: Pair, b: Pair) -> Pair {
        let product = self.push(Op::Mul(quotient, b.value));
        let error = self.push(Op::ProductError(quotient, b.value));
        let left = self.push(Op::Sub(a.value, product));
        let left = self.push(Op::Sub(left, error));
        let left = self.plus(Some(left), a.rest);
        let left = self.minus_product(left, quotient, b.rest);
        Pair { value: quotient, rest: left.map(|left| self.push(Op::Div(left, b.value))) }
    }

    /// The root of a number, where `root` is its rounded value: `a - root^2`, which is exact, by `2 root`.
    fn root(&mut self, root: Operand, a: Pair) -> Pair {
        let square = self.push(Op::Mul(root, root));
        let error = self.push(Op::ProductError(root, root));
        let left = self.push(Op::Sub(a.value, square));
        let left = self.push(Op::Sub(left, error));
        let left = self.plus(Some(left), a.rest);
        let twice = self.push(Op::Add(root, root));
        // Nothing is left of the root of zero.
        let divisor = self.push(Op::Add(twice, self.least));
        Pair { value: root, rest: left.map(|left| self.push(Op::Div(left, divisor))) }
    }

    /// A rational number of two exact ones; other constants, whose rest nobody knows, by their value.
    fn constant(&mut self, of: Pair, quotients: &HashMap<Operand, (Operand, Operand)>) -> Pair {
        let Some((numerator, denominator)) = quotients.get(&of.value).copied() else { return of };
        let value = self.push(Op::Div(numerator, denominator));
        self.quotient(value, Pair::plain(numerator), Pair::plain(denominator))
    }

    /// The instruction with the rests of its operands, as a pair where its own rounding error counts.
    fn instruction(&mut self, op: Op, of: [Pair; 3], is_kept: bool) -> Pair {
        let [a, b, c] = of;
        match (op, is_kept) {
            (Op::Neg(_), _) => self.opposite(a),
            (Op::Add(..), true) => self.sum(a, b),
            (Op::Sub(..), true) => self.difference(a, b),
            (Op::Mul(..), true) => self.product(a, b),
            (Op::Div(..), true) => {
                let quotient = self.push(Op::Div(a.value, b.value));
                self.quotient(quotient, a, b)
            }
            (Op::Recip(_), true) => {
                let reciprocal = self.push(Op::Recip(a.value));
                let one = Pair::plain(self.one);
                self.quotient(reciprocal, one, a)
            }
            (Op::Sqrt(_), _) if is_kept || a.rest.is_some() => {
                let root = self.push(Op::Sqrt(a.value));
                let root = self.root(root, a);
                if is_kept { root } else { self.rounded(root) }
            }
            (Op::MulAdd(signs, ..), true) => {
                let product = self.product(a, b);
                match (signs.product, signs.addend) {
                    (false, false) => self.sum(product, c),
                    (false, true) => self.difference(product, c),
                    (true, false) => self.difference(c, product),
                    (true, true) => {
                        let sum = self.sum(product, c);
                        self.opposite(sum)
                    }
                }
            }
            (op, _) => {
                let mut values = of.map(|pair| pair.value).into_iter();
                let value = self.push(op.map(|_| values.next().expect("no more operands than three")));
                let rest = self.rest(op, value, of);
                self.rounded(Pair { value, rest })
            }
        }
    }

    /// What the rests of the operands add to the value of an operation.
    fn rest(&mut self, op: Op, value: Operand, [a, b, c]: [Pair; 3]) -> Option<Operand> {
        match op {
            Op::Add(..) => self.plus(a.rest, b.rest),
            Op::Sub(..) => self.minus(a.rest, b.rest),
            Op::Mul(..) => {
                let rest = self.plus_product(None, a.value, b.rest);
                self.plus_product(rest, b.value, a.rest)
            }
            Op::Div(..) => {
                let rest = self.minus_product(a.rest, value, b.rest);
                rest.map(|rest| self.push(Op::Div(rest, b.value)))
            }
            Op::Recip(_) => {
                let rest = self.minus_product(None, value, a.rest);
                rest.map(|rest| self.push(Op::Mul(rest, value)))
            }
            Op::MulAdd(signs, ..) => {
                let rest = self.plus_product(None, a.value, b.rest);
                let rest = self.plus_product(rest, b.value, a.rest);
                match (signs.product, signs.addend) {
                    (false, false) => self.plus(rest, c.rest),
                    (false, true) => self.minus(rest, c.rest),
                    (true, false) => self.minus(c.rest, rest),
                    (true, true) => {
                        let rest = self.plus(rest, c.rest);
                        self.minus(None, rest)
                    }
                }
            }
            // Of functions the value alone is taken: a rounded one.
            _ => None,
        }
    }
}

/// A slot with the result of an operation on what depends on parameters alone.
fn prepared(prepare: &mut Prepare, op: Op) -> Operand {
    let op = op.map(|o| match o {
        Operand::Slot(i) => Operand::Value(prepare.slots[i as usize].value),
        other => other,
    });
    prepare.instructions.push(Instruction { op, section: 0, name: None });
    let value = u32::try_from(prepare.instructions.len() - 1).expect("fewer than 2^32 values fit in memory");
    prepare.slots.push(Slot { value, name: None });
    Operand::Slot(u32::try_from(prepare.slots.len() - 1).expect("fewer than 2^32 slots fit in memory"))
}

/// All instructions of a list, each with the pair that stands for it.
fn written(
    old: &[Instruction],
    writer: &mut Writer<'_>,
    weights: &[(f64, [f64; 3])],
    quotients: &HashMap<Operand, (Operand, Operand)>,
    outside: impl Fn(Operand) -> Pair,
) -> Vec<Pair> {
    let mut pairs: Vec<Pair> = Vec::with_capacity(old.len());
    // Sine and cosine of an angle so far, by the angle.
    let mut circles: HashMap<Operand, [Option<usize>; 2]> = HashMap::new();
    for (at, (instruction, (own, of_operands))) in old.iter().zip(weights).enumerate() {
        writer.section = instruction.section;
        let mut of = [Pair::plain(writer.one); 3];
        for (k, o) in instruction.op.operands().enumerate() {
            let pair = match o {
                Operand::Value(v) => pairs[v as usize],
                other => outside(other),
            };
            of[k] = match o {
                _ if of_operands[k] <= 1.0 => Pair::plain(pair.value),
                Operand::Constant(_) => writer.constant(pair, quotients),
                _ => pair,
            };
        }
        let n = writer.new.len();
        let pair = writer.instruction(instruction.op, of, *own > 1.0);
        if let (Some(name), Operand::Value(v)) = (&instruction.name, pair.value)
            && v as usize >= n
        {
            writer.new[v as usize].name = Some(name.clone());
        }
        pairs.push(pair);
        let place = match instruction.op {
            Op::Function(Func::Sin, _) => 0,
            Op::Function(Func::Cos, _) => 1,
            _ => continue,
        };
        let angle = instruction.op.operands().next().unwrap_or(writer.one);
        let circle = circles.entry(angle).or_default();
        circle[place] = Some(at);
        let [Some(sine), Some(cosine)] = *circle else { continue };
        // Of an angle that is rounded itself the rest turns the point.
        let turn = of[0].rest;
        if weights[sine].0 <= 1.0 && weights[cosine].0 <= 1.0 && turn.is_none() {
            continue;
        }
        let [s, c] = [sine, cosine].map(|v| pairs[v].value);
        let error = writer.push(Op::CircleError(s, c));
        let of_sine = writer.push(Op::Mul(error, s));
        let of_cosine = writer.push(Op::Mul(error, c));
        pairs[sine].rest = match turn {
            None => Some(of_sine),
            Some(turn) => writer.plus_product(Some(of_sine), c, Some(turn)),
        };
        pairs[cosine].rest = match turn {
            None => Some(of_cosine),
            Some(turn) => writer.minus_product(Some(of_cosine), s, Some(turn)),
        };
    }
    pairs
}

/// Numerator and denominator of constants that no double holds, as constants.
fn quotients(program: &Program, additions: &mut Additions) -> HashMap<Operand, (Operand, Operand)> {
    let mut found = HashMap::new();
    for (i, constant) in (0..).zip(&program.constants) {
        let Constant::Rational(q) = constant else { continue };
        let is_short = |n: &BigInt| n.bits() <= u64::from(f64::MANTISSA_DIGITS);
        if q.denom().magnitude().count_ones() > 1 && is_short(q.numer()) && is_short(q.denom()) {
            let [p, q] = [q.numer(), q.denom()].map(|n| Constant::Rational(Rational::from(n.clone())));
            let (p, q) = (additions.constant(program, p), additions.constant(program, q));
            found.insert(Operand::Constant(i), (p, q));
        }
    }
    found
}

/// Weights of the prepare part and of the functions, by the threshold from which on an error is kept.
pub(super) struct Kept {
    pub(super) prepare: Vec<(f64, [f64; 3])>,
    /// By the position of the function; others stay as they are.
    pub(super) functions: BTreeMap<usize, Vec<(f64, [f64; 3])>>,
}

impl Kept {
    pub(super) fn new(n_prepared: usize) -> Kept {
        Kept { prepare: vec![(0.0, [0.0; 3]); n_prepared], functions: BTreeMap::new() }
    }

    /// Adds a function, whose errors are kept from a threshold on.
    pub(super) fn add(&mut self, function_idx: usize, weights: &Weights, threshold: f64) {
        let scaled = weights.own.iter().zip(&weights.operands);
        let scaled = scaled.map(|(own, operands)| (own / threshold, operands.map(|x| x / threshold)));
        let mut scaled: Vec<_> = scaled.collect();
        let own = scaled.split_off(self.prepare.len());
        for (known, (own, operands)) in self.prepare.iter_mut().zip(scaled) {
            known.0 = known.0.max(own);
            known.1.iter_mut().zip(operands).for_each(|(known, x)| *known = known.max(x));
        }
        self.functions.insert(function_idx, own);
    }
}

/// The program with the rounding errors that are kept.
pub(super) fn compensated(program: &Program, kept: &Kept) -> Program {
    let mut additions = Additions::default();
    let one = additions.constant(program, Constant::Rational(Rational::one()));
    // 2^-1000
    let least = Rational::new(One::one(), BigInt::one() << 1000);
    let numbers = [one, additions.constant(program, Constant::Rational(least))];
    let quotients = quotients(program, &mut additions);
    let mut new = program.clone();
    additions.append_to(&mut new);

    let mut writer = Writer::new(numbers, None);
    let prepared =
        written(&program.prepare.instructions, &mut writer, &kept.prepare, &quotients, Pair::plain);
    new.prepare.instructions = writer.new;
    let moved = |o: Operand| match o {
        Operand::Value(v) => prepared[v as usize].value,
        other => other,
    };
    let at = |o: Operand| match o {
        Operand::Value(v) => v,
        // The value of an instruction is one.
        _ => 0,
    };
    for slot in &mut new.prepare.slots {
        slot.value = at(moved(Operand::Value(slot.value)));
    }
    for condition in &mut new.prepare.conditions {
        (condition.greater, condition.less) = (moved(condition.greater), moved(condition.less));
    }
    // Rests of prepared numbers are prepared too.
    let rest_of = |i: u32| prepared[program.prepare.slots[i as usize].value as usize].rest;
    let mut rests: HashMap<u32, u32> = HashMap::new();
    let n_slots = program.prepare.slots.len() as u32;
    for i in (0..n_slots).filter(|i| rest_of(*i).is_some()) {
        rests.insert(i, n_slots + rests.len() as u32);
        let value = rest_of(i).map_or(0, at);
        new.prepare.slots.push(Slot { value, name: None });
    }
    for (k, weights) in &kept.functions {
        let old = &program.functions[*k];
        let mut writer = Writer::new(numbers, Some(&mut new.prepare));
        let outside = |o: Operand| match o {
            Operand::Slot(i) => Pair { value: o, rest: rests.get(&i).map(|i| Operand::Slot(*i)) },
            other => Pair::plain(other),
        };
        let pairs = written(&old.instructions, &mut writer, weights, &quotients, outside);
        let results = old.results.iter().map(|(name, o)| match *o {
            Operand::Value(v) => (name.clone(), writer.rounded(pairs[v as usize]).value),
            other => (name.clone(), other),
        });
        let mut results: Vec<(String, Operand)> = results.collect();
        let mut instructions = writer.new;
        let mut outputs: Vec<Operand> = results.iter().map(|(_, o)| *o).collect();
        drop_dead(&mut instructions, &mut outputs);
        results.iter_mut().zip(outputs).for_each(|((_, o), new)| *o = new);
        new.functions[*k] = Function { results, instructions, ..old.clone() };
    }
    new
}

/// Leaves out what no function reads.
pub(super) fn without_dead(program: &mut Program) {
    let mut is_used = vec![false; program.prepare.slots.len()];
    for function in &program.functions {
        let operands = function.instructions.iter().flat_map(|i| i.op.operands());
        for o in operands.chain(function.outputs()) {
            if let Operand::Slot(i) = o {
                is_used[i as usize] = true;
            }
        }
    }
    let slots = (0..).zip(is_used).filter_map(|(i, is_used)| is_used.then_some(i)).collect();
    prune(program, slots);
    let prepare = &mut program.prepare;
    let slots = prepare.slots.iter().map(|slot| Operand::Value(slot.value));
    let sides = prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
    let mut outputs: Vec<Operand> = slots.chain(sides).collect();
    drop_dead(&mut prepare.instructions, &mut outputs);
    let mut outputs = outputs.into_iter();
    for slot in &mut prepare.slots {
        if let Some(Operand::Value(v)) = outputs.next() {
            slot.value = v;
        }
    }
    for condition in &mut prepare.conditions {
        for side in [&mut condition.greater, &mut condition.less] {
            *side = outputs.next().unwrap_or(*side);
        }
    }
}
