//! Sums of products become fused multiplications and additions, and signs go where they cost nothing.
//!
//! Every rewrite takes operations away or leaves their number as it is. Deliberately does not know: expressions,
//! classes of values, whether the target has a fused instruction.

use std::collections::{BTreeSet, HashMap};

use num_traits::{Signed as _, Zero};

use super::number::Signed;
use super::pack;
use crate::expr::Rational;
use crate::program::cost::{LATENCY_OF_A_SUM, latency};
use crate::program::edit::{drop_dead, is_fixed, n_uses, operand, placed, position, prune};
use crate::program::{Constant, Function, Instruction, Op, Operand, Program, Signs, Slot};

/// Rewrites every function; the part that depends on parameters alone runs once and keeps its products.
pub(super) fn fuse(program: &mut Program) {
    for function_idx in 0..program.functions.len() {
        let mut function = std::mem::take(&mut program.functions[function_idx]);
        fuse_function(&mut function, program);
        program.functions[function_idx] = function;
    }
    for function_idx in 0..program.functions.len() {
        let function = &mut program.functions[function_idx];
        let mut instructions = std::mem::take(&mut function.instructions);
        let mut outputs: Vec<Operand> = function.results.iter().map(|(_, o)| *o).collect();
        absorb_signs(program, &mut instructions, &mut outputs, true);
        let function = &mut program.functions[function_idx];
        function.instructions = instructions;
        function.results.iter_mut().zip(outputs).for_each(|((_, o), new)| *o = new);
    }
    pack::turn_slots(program);
    absorb_signs_in_prepare(program);
    program.functions.iter_mut().for_each(pack::order_factors);
    let order = pack::slot_order(program);
    prune(program, order);
}

// ---- sums of products -----------------------------------------------------------------------------------------------

fn is_sum(op: &Op) -> bool {
    matches!(op, Op::Add(..) | Op::Sub(..) | Op::Neg(_))
}

fn fuse_function(function: &mut Function, program: &mut Program) {
    let old = std::mem::take(&mut function.instructions);
    let mut n_uses = vec![0usize; old.len()];
    let mut n_sums = vec![0usize; old.len()];
    for instruction in &old {
        for v in instruction.op.operands().filter_map(position) {
            n_uses[v] += 1;
            n_sums[v] += usize::from(is_sum(&instruction.op));
        }
    }
    function.results.iter().filter_map(|(_, o)| position(*o)).for_each(|v| n_uses[v] += 1);

    // A sum that one other sum uses is part of that; definitions keep their names.
    let is_part = |v: usize| is_sum(&old[v].op) && old[v].name.is_none() && n_uses[v] == 1 && n_sums[v] == 1;
    let mut sums: Vec<Option<Vec<Signed>>> = vec![None; old.len()];
    for root in 0..old.len() {
        if is_sum(&old[root].op) && !is_part(root) {
            sums[root] = Some(with_one_number(terms(&old, root, is_part), program));
        }
    }
    let is_fused = fused_products(&old, &sums, &n_uses);

    let mut fusion = Fusion { values: vec![None; old.len()], ..Fusion::default() };
    for (k, Instruction { op, section, name }) in old.iter().enumerate() {
        fusion.section = *section;
        let value = match (*op, &sums[k]) {
            (_, Some(terms)) => {
                let terms = terms.iter().map(|term| fusion.term(*term, &old, &is_fused)).collect();
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
    for (_, result) in &mut function.results {
        *result = fusion.positive(*result);
    }
    function.instructions = fusion.new;
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

/// The terms with one constant or prepared number at most: `p + (q + x)` is `(p + q) + x` once the sums are one, and `p + q`
/// belongs to the part that runs once.
fn with_one_number(terms: Vec<Signed>, program: &mut Program) -> Vec<Signed> {
    let (numbers, others): (Vec<Signed>, Vec<Signed>) = terms.iter().partition(|t| is_fixed(t.operand));
    let place = terms.iter().position(|t| is_fixed(t.operand));
    let number = numbers.iter().copied().reduce(|a, b| sum_of_numbers(a, b, program));
    match (place, number) {
        (Some(place), Some(number)) if numbers.len() > 1 => {
            let is_zero = matches!(number.operand, Operand::Constant(i)
                if program.constants[i as usize] == Constant::Rational(Rational::zero()));
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
fn sum_of_numbers(a: Signed, b: Signed, program: &mut Program) -> Signed {
    let rational = |o: Signed| match o.operand {
        Operand::Constant(i) => match &program.constants[i as usize] {
            Constant::Rational(q) => Some(if o.negative { -q } else { q.clone() }),
            Constant::Pi => None,
        },
        _ => None,
    };
    if let (Some(p), Some(q)) = (rational(a), rational(b)) {
        let sum = p + q;
        let constant = placed(&mut program.constants, Constant::Rational(sum.abs()));
        return Signed { negative: sum.is_negative(), operand: Operand::Constant(constant) };
    }
    let in_prepare = |o: Operand| match o {
        Operand::Slot(i) => Operand::Value(program.prepare.slots[i as usize].value),
        other => other,
    };
    let [a, b] = [a, b].map(|o| Signed { operand: in_prepare(o.operand), ..o });
    let (negative, op) = a.plus(b);
    let value = placed(&mut program.prepare.instructions, Instruction { op, section: 0, name: None });
    let slot = placed(&mut program.prepare.slots, Slot { value, name: None });
    Signed { negative, operand: Operand::Slot(slot) }
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
#[derive(Default)]
struct Fusion<'a> {
    /// With the name of the definition; what sums have taken up has none.
    values: Vec<Option<(Signed, Option<&'a str>)>>,
    new: Vec<Instruction>,
    ready: Vec<u32>,
    index: HashMap<Op, Operand>,
    section: u32,
}

impl Fusion<'_> {
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

    fn push(&mut self, op: Op) -> Operand {
        if let Some(known) = self.index.get(&op) {
            return *known;
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
    /// Terms that are ready first come first, unless the sum is there earlier in the order of the terms: components of a
    /// vector get the same shape that way, which lets a compiler pack them. Either order
    /// is as accurate as any: the bound `(n - 1) u sum |x_i|` of summing `n` terms one by one does not depend on it
    /// (Higham, Accuracy and Stability of Numerical Algorithms, section 4.2), and each fused term rounds once less.
    fn sum(&mut self, mut terms: Vec<Term>) -> Signed {
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

// ---- signs ----------------------------------------------------------------------------------------------------------

/// `-(a - b) = b - a`, `-(a*b + c) = -(a*b) - c`, `-((a - b)*c) = (b - a)*c`, and for a constant or prepared `p`
/// `-(p*x) = (-p)*x` and `-(p + x) = -p - x`: takes away negations of values that nothing else uses.
fn absorb_signs(
    program: &mut Program,
    instructions: &mut Vec<Instruction>,
    outputs: &mut [Operand],
    may_prepare: bool,
) {
    let mut n_uses = n_uses(instructions, outputs.iter().copied());

    let mut stands_for: Vec<usize> = (0..instructions.len()).collect();
    for k in 0..instructions.len() {
        let Op::Neg(Operand::Value(negated)) = instructions[k].op else { continue };
        let negated = stands_for[negated as usize];
        // Formulas of prepared numbers stand in the documentation: a sign change that runs once is not worth `a - (-b)` there.
        if n_uses[negated] != 1 && !may_prepare {
            continue;
        }
        // What costs nothing anywhere first; then what adds to the part that runs once.
        let n_prepared = (program.prepare.instructions.len(), program.prepare.slots.len());
        let changes = [false, may_prepare].into_iter().find_map(|may_prepare| {
            let list =
                Turning { instructions, outputs, n_uses: &n_uses, stands_for: &stands_for, may_prepare };
            let mut changes = vec![list.opposite(negated, program)?];
            if n_uses[negated] != 1 {
                changes.extend(list.in_users(negated, Some(k), program)?);
            }
            let changed: BTreeSet<usize> = changes.iter().map(|c| c.at).collect();
            (changed.len() == changes.len()).then_some(changes)
        });
        let Some(changes) = changes else {
            program.prepare.instructions.truncate(n_prepared.0);
            program.prepare.slots.truncate(n_prepared.1);
            continue;
        };
        for Change { at, op, turns } in changes {
            instructions[at].op = op;
            if turns && at != negated {
                instructions[at].name = instructions[at].name.take().map(|name| format!("minus_{name}"));
            }
        }
        // The name that the value had is that of its opposite now.
        instructions[negated].name = instructions[k].name.take();
        n_uses[negated] += n_uses[k] - 1;
        stands_for[k] = negated;
    }

    let replaced = |o: Operand| position(o).map_or(o, |v| operand(stands_for[v]));
    instructions.iter_mut().for_each(|i| i.op = i.op.map(replaced));
    outputs.iter_mut().for_each(|o| *o = replaced(*o));
    drop_dead(instructions, outputs);
}

/// The same for the part that runs once, without what is not read since signs have changed.
fn absorb_signs_in_prepare(program: &mut Program) {
    let read: BTreeSet<u32> = (program.functions.iter())
        .flat_map(|f| {
            f.instructions.iter().flat_map(|i| i.op.operands()).chain(f.results.iter().map(|(_, o)| *o))
        })
        .filter_map(|o| if let Operand::Slot(i) = o { Some(i) } else { None })
        .collect();
    let mut instructions = std::mem::take(&mut program.prepare.instructions);
    let slots = read.iter().map(|i| Operand::Value(program.prepare.slots[*i as usize].value));
    let sides = program.prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
    let mut outputs: Vec<Operand> = slots.chain(sides).collect();
    drop_dead(&mut instructions, &mut outputs);
    absorb_signs(program, &mut instructions, &mut outputs, false);
    let mut outputs = outputs.into_iter();
    for (i, new) in read.iter().zip(&mut outputs) {
        if let Operand::Value(v) = new {
            program.prepare.slots[*i as usize].value = v;
        }
    }
    for condition in &mut program.prepare.conditions {
        for (side, new) in [&mut condition.greater, &mut condition.less].into_iter().zip(&mut outputs) {
            *side = new;
        }
    }
    program.prepare.instructions = instructions;
}

/// Another operation in place of one.
struct Change {
    at: usize,
    op: Op,
    /// Whether the value gets the other sign.
    turns: bool,
}

/// Instructions whose signs are looked at.
struct Turning<'a> {
    instructions: &'a [Instruction],
    outputs: &'a [Operand],
    n_uses: &'a [usize],
    /// What each value was replaced by.
    stands_for: &'a [usize],
    may_prepare: bool,
}

impl Turning<'_> {
    /// A change of one instruction that gives the value the other sign.
    fn opposite(&self, v: usize, program: &mut Program) -> Option<Change> {
        let change = |at: usize| {
            let op = opposite(self.instructions[at].op, program, self.may_prepare)?;
            Some(Change { at, op, turns: true })
        };
        self.factors(v).into_iter().find_map(change)
    }

    /// The value and the factors of it, and theirs, that nothing else uses: the opposite of one is the opposite of all.
    fn factors(&self, root: usize) -> Vec<usize> {
        let mut factors = vec![root];
        let mut next = 0;
        while let Some(v) = factors.get(next) {
            next += 1;
            // The opposite of a definition gets a name of its own; not all of a chain of them.
            let is_open = *v == root || self.instructions[*v].name.is_none();
            if is_open && let Op::Mul(..) | Op::Div(..) | Op::Recip(_) = self.instructions[*v].op {
                factors.extend(self.operands(*v).filter(|v| self.n_uses[*v] == 1));
            }
        }
        factors
    }

    fn operands(&self, v: usize) -> impl Iterator<Item = usize> {
        let operands: Vec<Operand> = self.instructions[v].op.operands().collect();
        operands.into_iter().filter_map(position).map(|v| self.stands_for[v])
    }

    fn is_output(&self, v: usize) -> bool {
        self.outputs.iter().any(|o| position(*o).is_some_and(|o| self.stands_for[o] == v))
    }

    /// Changes that leave everything as it is when a value gets the other sign, but for one user; none where they would
    /// cost an operation.
    fn in_users(&self, v: usize, except: Option<usize>, program: &mut Program) -> Option<Vec<Change>> {
        if self.is_output(v) {
            return None;
        }
        let live = (0..self.instructions.len()).filter(|user| self.stands_for[*user] == *user);
        let mut changes = Vec::new();
        for user in live.filter(|user| Some(*user) != except && self.operands(*user).any(|o| o == v)) {
            let op = self.instructions[user].op;
            if let Some(in_user) = self.with_opposite(user, v, program) {
                changes.extend(in_user);
            } else if let Op::Mul(..) | Op::Div(..) = op
                && self.instructions[user].name.is_none()
            {
                // The product gets the other sign, too: it stands in the list so that nothing else changes it.
                changes.push(Change { at: user, op, turns: true });
                changes.extend(self.in_users(user, None, program)?);
            } else {
                return None;
            }
        }
        Some(changes)
    }

    /// Changes that leave the value of a user as it is when one of its operands gets the other sign.
    fn with_opposite(&self, user: usize, v: usize, program: &mut Program) -> Option<Vec<Change>> {
        let is = |o: Operand| position(o).is_some_and(|o| self.stands_for[o] == v);
        let op = match self.instructions[user].op {
            Op::MulAdd(Signs { product, addend }, a, b, c) => {
                Op::MulAdd(Signs { product: product ^ is(a) ^ is(b), addend: addend ^ is(c) }, a, b, c)
            }
            Op::Mul(a, b) if is(a) && is(b) => return Some(Vec::new()),
            Op::Mul(a, b) | Op::Div(a, b) => {
                let other = if is(a) { b } else { a };
                if let Some(other) = position(other).map(|o| self.stands_for[o]) {
                    let is_free = self.n_uses[other] == 1 && self.instructions[other].name.is_none();
                    return Some(vec![is_free.then(|| self.opposite(other, program)).flatten()?]);
                }
                let other = negated(program, other, self.may_prepare)?;
                match (self.instructions[user].op, is(a)) {
                    (Op::Mul(..), true) => Op::Mul(a, other),
                    (Op::Mul(..), false) => Op::Mul(other, b),
                    (_, true) => Op::Div(a, other),
                    (_, false) => Op::Div(other, b),
                }
            }
            Op::Add(a, b) if is(a) && !is(b) => Op::Sub(b, a),
            Op::Add(a, b) if is(b) && !is(a) => Op::Sub(a, b),
            Op::Sub(a, b) if is(b) && !is(a) => Op::Add(a, b),
            _ => return None,
        };
        Some(vec![Change { at: user, op, turns: false }])
    }
}

/// The operation whose value is the opposite, if it costs no more in a function.
fn opposite(op: Op, program: &mut Program, may_prepare: bool) -> Option<Op> {
    let mut negated = |o| negated(program, o, may_prepare);
    match op {
        Op::Sub(a, b) => Some(Op::Sub(b, a)),
        Op::MulAdd(Signs { product, addend }, a, b, c) => {
            Some(Op::MulAdd(Signs { product: !product, addend: !addend }, a, b, c))
        }
        Op::Mul(a, b) => match negated(a) {
            Some(a) => Some(Op::Mul(a, b)),
            None => Some(Op::Mul(a, negated(b)?)),
        },
        Op::Div(a, b) => match negated(a) {
            Some(a) => Some(Op::Div(a, b)),
            None => Some(Op::Div(a, negated(b)?)),
        },
        Op::Add(a, b) => match negated(a) {
            Some(a) => Some(Op::Sub(a, b)),
            None => Some(Op::Sub(negated(b)?, a)),
        },
        Op::Recip(_) | Op::Neg(_) | Op::Sqrt(_) | Op::Power(..) | Op::Function(..) | Op::Atan2(..) => None,
    }
}

/// The opposite of a constant, or with leave of a parameter or slot as a slot of its own.
fn negated(program: &mut Program, operand: Operand, may_prepare: bool) -> Option<Operand> {
    let original = match operand {
        Operand::Constant(i) => match &program.constants[i as usize] {
            Constant::Rational(q) => {
                let opposite = Constant::Rational(-q);
                return Some(Operand::Constant(placed(&mut program.constants, opposite)));
            }
            Constant::Pi => return None,
        },
        Operand::Slot(i) => Operand::Value(program.prepare.slots[i as usize].value),
        Operand::Param(_) => operand,
        Operand::Value(_) | Operand::Time | Operand::State(_) | Operand::Argument(_) => return None,
    };
    if !may_prepare {
        return None;
    }
    let turned = position(original).map(|v| program.prepare.instructions[v].op);
    let value = match turned {
        Some(Op::Neg(Operand::Value(value))) => value,
        _ => {
            let instruction = Instruction { op: Op::Neg(original), section: 0, name: None };
            placed(&mut program.prepare.instructions, instruction)
        }
    };
    Some(Operand::Slot(placed(&mut program.prepare.slots, Slot { value, name: None })))
}
