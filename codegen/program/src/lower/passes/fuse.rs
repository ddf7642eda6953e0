//! Sums of products become fused multiplications and additions.
//!
//! A sum is taken apart with all sums that it alone uses, terms that are opposites vanish, its constants and prepared
//! numbers become one, and its terms are added in the order in which they are there. Every rewrite takes operations
//! away or leaves their number as it is. Does not know: expressions, classes of values, whether the target has a fused
//! instruction.

use std::collections::HashMap;

use num_traits::{Signed as _, Zero};

use crate::program::cost::{LATENCY_OF_A_SUM, latency};
use crate::program::edit::{Additions, Signed, drop_dead, is_fixed, operand, position};
use crate::program::{Constant, Function, Instruction, Op, Operand, Program, Signs};

/// Fuses the sums of every function; the prepare part runs once and keeps its products.
pub(in crate::lower) fn fuse(program: &mut Program) {
    for k in 0..program.functions.len() {
        let mut additions = Additions::default();
        let function = fused(&program.functions[k], program, &mut additions);
        program.functions[k] = function;
        additions.append_to(program);
    }
}

fn is_sum(op: &Op) -> bool {
    matches!(op, Op::Add(..) | Op::Sub(..) | Op::Neg(_))
}

fn fused(function: &Function, program: &Program, additions: &mut Additions) -> Function {
    let old = function.instructions.as_slice();
    let mut n_uses = vec![0usize; old.len()];
    let mut n_sums = vec![0usize; old.len()];
    for instruction in old {
        for v in instruction.op.operands().filter_map(position) {
            n_uses[v] += 1;
            n_sums[v] += usize::from(is_sum(&instruction.op));
        }
    }
    function.outputs().filter_map(position).for_each(|v| n_uses[v] += 1);

    // A sum that one other sum uses is part of that; definitions keep their names.
    let is_part = |v: usize| is_sum(&old[v].op) && old[v].name.is_none() && n_uses[v] == 1 && n_sums[v] == 1;
    let mut sums: Vec<Option<Vec<Signed>>> = vec![None; old.len()];
    let mut vanished = Vec::new();
    for root in 0..old.len() {
        if is_sum(&old[root].op) && !is_part(root) {
            let mut terms = without_opposites(terms(old, root, is_part), &mut vanished);
            if terms.is_empty() {
                let zero = additions.constant(program, Constant::Rational(Zero::zero()));
                terms.push(Signed { negative: false, operand: zero });
            }
            sums[root] = Some(with_one_number(terms, program, additions));
        }
    }
    vanished.iter().filter_map(|o| position(*o)).for_each(|v| n_uses[v] -= 2);
    let is_fused = fused_products(old, &sums, &n_uses);

    let mut fusion = Fusion::new(old.len(), program, additions);
    for (k, Instruction { op, section, name }) in old.iter().enumerate() {
        fusion.section = *section;
        let value = match (*op, &sums[k]) {
            (_, Some(terms)) => {
                let terms = terms.iter().map(|term| fusion.term(*term, old, &is_fused)).collect();
                fusion.sum(terms)
            }
            (op, None) if is_sum(&op) || is_fused[k] => continue,
            (Op::Mul(a, b), None) => fusion.product(Op::Mul, a, b),
            (Op::Div(a, b), None) => fusion.product(Op::Div, a, b),
            (Op::Recip(a), None) => {
                let a = fusion.read(a);
                Signed { negative: a.negative, operand: fusion.push(Op::Recip(a.operand)) }
            }
            (op, None) => {
                let op = op.map(|o| fusion.positive(o));
                Signed { negative: false, operand: fusion.push(op) }
            }
        };
        fusion.values[k] = Some((value, name.as_deref()));
        if !value.negative {
            fusion.name(value.operand, name.as_deref());
        }
    }
    let mut new = Function {
        role: function.role.clone(),
        argument: function.argument.clone(),
        instructions: Vec::new(),
        scalars: function.scalars.clone(),
        contractions: function.contractions.clone(),
        results: function.results.clone(),
    };
    new.map_outputs(|o| fusion.positive(o));
    new.instructions = fusion.new;
    if !vanished.is_empty() {
        let mut outputs: Vec<Operand> = new.outputs().collect();
        drop_dead(&mut new.instructions, &mut outputs);
        let mut outputs = outputs.into_iter();
        new.map_outputs(|o| outputs.next().unwrap_or(o));
    }
    new
}

/// The terms without pairs of opposites, which are told: sums of definitions that meet here for the first time.
fn without_opposites(terms: Vec<Signed>, vanished: &mut Vec<Operand>) -> Vec<Signed> {
    let mut left: Vec<Signed> = Vec::with_capacity(terms.len());
    for term in terms {
        match left.iter().position(|t| t.operand == term.operand && t.negative != term.negative) {
            Some(place) => {
                left.remove(place);
                vanished.push(term.operand);
            }
            None => left.push(term),
        }
    }
    left
}

/// What a sum adds up, in order and with signs, looking through the sums that are part of it.
fn terms(old: &[Instruction], root: usize, is_part: impl Fn(usize) -> bool) -> Vec<Signed> {
    let mut terms = Vec::new();
    let mut pending = vec![Signed { negative: false, operand: operand(root) }];
    while let Some(Signed { negative, operand }) = pending.pop() {
        match position(operand) {
            Some(v) if v == root || is_part(v) => {
                let (a, b, minus) = match old[v].op {
                    Op::Add(a, b) => (a, Some(b), false),
                    Op::Sub(a, b) => (a, Some(b), true),
                    Op::Neg(a) => (a, None, true),
                    // The root and its parts are sums.
                    _ => continue,
                };
                // The last operand is the one that a minus belongs to.
                match b {
                    Some(b) => {
                        pending.push(Signed { negative: negative ^ minus, operand: b });
                        pending.push(Signed { negative, operand: a });
                    }
                    None => pending.push(Signed { negative: !negative, operand: a }),
                }
            }
            _ => terms.push(Signed { negative, operand }),
        }
    }
    terms
}

/// The terms with one constant or prepared number at most: `p + (q + x)` is `(p + q) + x` once the sums are one, and `p
/// + q` belongs to the part that runs once.
fn with_one_number(terms: Vec<Signed>, program: &Program, additions: &mut Additions) -> Vec<Signed> {
    let (numbers, others): (Vec<Signed>, Vec<Signed>) = terms.iter().partition(|t| is_fixed(t.operand));
    let place = terms.iter().position(|t| is_fixed(t.operand));
    let number = numbers.iter().copied().reduce(|a, b| sum_of_numbers(a, b, program, additions));
    match (place, number) {
        (Some(place), Some(number)) if numbers.len() > 1 => {
            let is_zero = additions.rational(program, number.operand).is_some_and(Zero::is_zero);
            let mut all = others;
            // What changes is left over: a sum of numbers alone is none of a function's.
            if !is_zero || all.is_empty() {
                all.insert(place, number);
            }
            all
        }
        _ => terms,
    }
}

/// The sum of two constants, parameters or slots: a constant where both are rational, otherwise a slot of its own.
fn sum_of_numbers(a: Signed, b: Signed, program: &Program, additions: &mut Additions) -> Signed {
    let rational = |o: Signed| {
        let q = additions.rational(program, o.operand)?;
        Some(if o.negative { -q } else { q.clone() })
    };
    if let (Some(p), Some(q)) = (rational(a), rational(b)) {
        let sum = p + q;
        let operand = additions.constant(program, Constant::Rational(sum.abs()));
        return Signed { negative: sum.is_negative(), operand };
    }
    let [a, b] = [a, b].map(|o| Signed { operand: additions.in_prepare(program, o.operand), ..o });
    let (negative, op) = a.plus(b);
    let value = additions.value(program, op);
    Signed { negative, operand: additions.slot(program, value) }
}

/// Which products no longer have to be values: those that only sums use, once, or twice where both sums have something
/// else to start from, so that two fused operations replace a product and two additions.
///
/// With more uses the target without fused instructions would pay more than the one with them saves.
fn fused_products(old: &[Instruction], sums: &[Option<Vec<Signed>>], n_uses: &[usize]) -> Vec<bool> {
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); old.len()];
    for (root, terms) in sums.iter().enumerate().filter_map(|(k, sum)| Some((k, sum.as_ref()?))) {
        if terms.len() > 1 {
            terms.iter().filter_map(|term| position(term.operand)).for_each(|v| users[v].push(root));
        }
    }
    let is_candidate = |v: usize| matches!(old[v].op, Op::Mul(..)) && users[v].len() == n_uses[v];
    let mut is_fused: Vec<bool> = (0..old.len()).map(|v| is_candidate(v) && n_uses[v] == 1).collect();
    for v in 0..old.len() {
        // A definition that is used in several places keeps its name.
        if !is_candidate(v) || n_uses[v] != 2 || old[v].name.is_some() {
            continue;
        }
        let starts_elsewhere = |root: &usize| {
            let mut others = sums[*root].iter().flatten().map(|term| position(term.operand));
            others.any(|o| o.is_none_or(|o| o != v && !is_fused[o]))
        };
        is_fused[v] = users[v].iter().all(starts_elsewhere);
    }
    is_fused
}

/// A term of a sum.
#[derive(Clone, Copy)]
struct Term {
    negative: bool,
    a: Operand,
    /// The other factor of a product that is not a value of its own.
    b: Option<Operand>,
    /// When the operands are there.
    ready: u32,
}

/// The new instructions of a function, and what stands for the old ones.
struct Fusion<'a> {
    program: &'a Program,
    additions: &'a mut Additions,
    /// With the name of the definition; what sums have taken up has none.
    values: Vec<Option<(Signed, Option<&'a str>)>>,
    new: Vec<Instruction>,
    ready: Vec<u32>,
    index: HashMap<Op, Operand>,
    section: u32,
}

impl<'a> Fusion<'a> {
    fn new(n: usize, program: &'a Program, additions: &'a mut Additions) -> Fusion<'a> {
        let (new, ready, index) = Default::default();
        Fusion { program, additions, values: vec![None; n], new, ready, index, section: 0 }
    }

    fn read(&self, old: Operand) -> Signed {
        let value = position(old).map(|v| self.values[v].expect("taken up by sums alone").0);
        value.unwrap_or(Signed { negative: false, operand: old })
    }

    /// The value itself, negated where only its opposite is there.
    fn positive(&mut self, old: Operand) -> Operand {
        let Signed { negative, operand } = self.read(old);
        if !negative {
            return operand;
        }
        let name = position(old).and_then(|v| self.values[v]).and_then(|(_, name)| name);
        let operand = self.push(Op::Neg(operand));
        self.name(operand, name);
        operand
    }

    /// The value of an operation. One of numbers alone, as where all else in a sum has vanished, is of the part that
    /// runs once.
    fn push(&mut self, op: Op) -> Operand {
        if let Some(known) = self.index.get(&op) {
            return *known;
        }
        if op.operands().all(is_fixed) {
            let op = op.map(|o| self.additions.in_prepare(self.program, o));
            let value = self.additions.value(self.program, op);
            return self.additions.slot(self.program, value);
        }
        let start = op.operands().map(|o| self.ready_at(o)).max().unwrap_or(0);
        let value = operand(self.new.len());
        self.ready.push(start + latency(&op));
        self.new.push(Instruction { op, section: self.section, name: None });
        self.index.insert(op, value);
        value
    }

    /// Names a value unless it has a name.
    fn name(&mut self, operand: Operand, name: Option<&str>) {
        if let Some(v) = position(operand)
            && self.new[v].name.is_none()
        {
            self.new[v].name = name.map(str::to_owned);
        }
    }

    fn ready_at(&self, operand: Operand) -> u32 {
        position(operand).map_or(0, |v| self.ready[v])
    }

    fn product(&mut self, op: fn(Operand, Operand) -> Op, a: Operand, b: Operand) -> Signed {
        let (a, b) = (self.read(a), self.read(b));
        Signed { negative: a.negative ^ b.negative, operand: self.push(op(a.operand, b.operand)) }
    }

    fn term(&self, Signed { negative, operand }: Signed, old: &[Instruction], is_fused: &[bool]) -> Term {
        match position(operand).filter(|v| is_fused[*v]).map(|v| old[v].op) {
            Some(Op::Mul(a, b)) => {
                let (a, b) = (self.read(a), self.read(b));
                let negative = negative ^ a.negative ^ b.negative;
                let ready = self.ready_at(a.operand).max(self.ready_at(b.operand));
                Term { negative, a: a.operand, b: Some(b.operand), ready }
            }
            _ => {
                let a = self.read(operand);
                let ready = self.ready_at(a.operand);
                Term { negative: negative ^ a.negative, a: a.operand, b: None, ready }
            }
        }
    }

    /// `((g + a*b) + c*d) + ..`: starts from a term that is no product if there is one, otherwise from one product.
    ///
    /// Terms that are ready first come first, unless the sum is there earlier in the order of the terms: components of
    /// a vector get the same shape that way, which lets a compiler pack them. Either order is as accurate as any: the
    /// bound `(n - 1) u sum |x_i|` of summing `n` terms one by one does not depend on it (Higham, Accuracy and
    /// Stability of Numerical Algorithms, section 4.2), and each fused term rounds once less.
    fn sum(&mut self, mut terms: Vec<Term>) -> Signed {
        for term in &mut terms {
            if let Some(b) = term.b.filter(|b| is_fixed(*b) && is_fixed(term.a)) {
                (term.a, term.b) = (self.push(Op::Mul(term.a, b)), None);
            }
        }
        let start_first = |mut terms: Vec<Term>| {
            let start = terms.iter().position(|t| t.b.is_none()).unwrap_or(0);
            terms[..=start].rotate_right(1);
            terms
        };
        let finish = |terms: &[Term]| {
            let first = terms[0].ready + if terms[0].b.is_some() { LATENCY_OF_A_SUM } else { 0 };
            terms[1..].iter().fold(first, |at, term| at.max(term.ready) + LATENCY_OF_A_SUM)
        };
        let in_order = start_first(terms.clone());
        terms.sort_by_key(|term| term.ready);
        let by_time = start_first(terms);
        let terms = if finish(&by_time) <= finish(&in_order) { by_time } else { in_order };

        let mut total: Option<Signed> = None;
        for Term { negative, a, b, .. } in terms {
            total = Some(match (total, b) {
                (None, None) => Signed { negative, operand: a },
                (None, Some(b)) => Signed { negative, operand: self.push(Op::Mul(a, b)) },
                (Some(total), None) => {
                    let (negative, op) = total.plus(Signed { negative, operand: a });
                    Signed { negative, operand: self.push(op) }
                }
                (Some(total), Some(b)) => {
                    let signs = Signs { product: negative, addend: total.negative };
                    Signed { negative: false, operand: self.push(Op::MulAdd(signs, a, b, total.operand)) }
                }
            });
        }
        total.expect("a sum has terms")
    }
}

#[cfg(test)]
mod tests {
    use super::fuse;
    use crate::program::{Function, Instruction, Op, Operand, Prepare, Program, Report, Role};

    #[test]
    fn opposites_that_meet_in_one_sum_vanish() {
        // (x y - z) - x y = -z and x y - x y = 0, as they stand where definitions have been put into one another. With
        // a parameter for z, that product and sums with parameters are of the part that runs once.
        let [xy, difference, left, twice] = [0, 1, 2, 3].map(Operand::Value);
        let [x, y, z] = [0, 1, 2].map(Operand::State);
        let [p, q] = [0, 1].map(Operand::Param);
        let product = Op::Mul(x, y);
        let (state, params) = ([0.9, 1.6, 0.35], [0.6, 1.7]);
        let number = [product, Op::Sub(xy, p), Op::Sub(difference, xy), Op::Mul(left, q)];
        let with = |ops: &[Op]| [number.as_slice(), ops].concat();
        let cases = [
            (vec![product, Op::Sub(xy, z), Op::Sub(difference, xy)], left, -state[2], 1),
            (vec![product, Op::Sub(xy, xy)], difference, 0.0, 0),
            (with(&[]), twice, -params[0] * params[1], 0),
            (with(&[Op::Add(twice, z)]), Operand::Value(4), state[2] - params[0] * params[1], 1),
            (with(&[Op::Sub(q, twice)]), Operand::Value(4), params[1] + params[0] * params[1], 0),
        ];
        for (ops, result, value, n) in cases {
            let function = Function {
                role: Role::Output("f".into()),
                instructions: (ops.into_iter())
                    .map(|op| Instruction { op, section: 0, name: None })
                    .collect(),
                results: vec![("f".into(), result)],
                ..Function::default()
            };
            let mut program = Program {
                params: ["p", "q"].map(String::from).to_vec(),
                time: "t".into(),
                inputs: Vec::new(),
                state: ["x", "y", "z"].map(String::from).to_vec(),
                constants: Vec::new(),
                tables: Vec::new(),
                sections: vec!["results".into()],
                prepare: Prepare::default(),
                functions: vec![function],
                report: Report::default(),
            };
            fuse(&mut program);
            assert_eq!(program.functions[0].instructions.len(), n);
            let mut out = [f64::NAN];
            let prepared = program.prepare(&params).unwrap();
            program.run(0, &params, &prepared, 0.4, &state, &mut out);
            assert_eq!(out, [value]);
        }
    }
}
