//! Signs go where they cost nothing.
//!
//! A negation is taken up by the value that is negated, by a factor of it, or by what uses it; constants and prepared
//! numbers may get the other sign. Every change is planned with everything that it takes and done when all of it is
//! possible. Does not know: expressions, classes of values, whether the target has a fused instruction.

use std::collections::{BTreeMap, BTreeSet};

use crate::program::edit::{Additions, drop_dead, keep_slots, n_uses, n_uses_in, operand, position};
use crate::program::{Constant, Instruction, Op, Operand, Program, Signs};

/// Takes negations out of every function.
pub(in crate::lower) fn absorb_in_functions(program: &mut Program) {
    for k in 0..program.functions.len() {
        let function = &mut program.functions[k];
        let mut instructions = std::mem::take(&mut function.instructions);
        let mut outputs: Vec<Operand> = function.outputs().collect();
        absorb(program, &mut instructions, &mut outputs, true);
        let function = &mut program.functions[k];
        function.instructions = instructions;
        let mut outputs = outputs.into_iter();
        function.map_outputs(|o| outputs.next().unwrap_or(o));
    }
}

/// `-(a - b) = b - a`, `-(a*b + c) = -(a*b) - c`, `-((a - b)*c) = (b - a)*c`, and for a constant or prepared `p`
/// `-(p*x) = (-p)*x` and `-(p + x) = -p - x`: takes away negations of values that nothing else uses.
fn absorb(
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
        // Formulas of prepared numbers stand in the documentation: a sign change that runs once is not worth `a - (-b)`
        // there.
        if n_uses[negated] != 1 && !may_prepare {
            continue;
        }
        // What costs nothing anywhere first; then what adds to the part that runs once.
        let planned = [false, may_prepare].into_iter().find_map(|may_prepare| {
            let list = SignChange {
                program: &*program,
                instructions,
                outputs,
                n_uses: &n_uses,
                stands_for: &stands_for,
                may_prepare,
            };
            let mut additions = Additions::default();
            let mut changes = vec![list.opposite_of(negated, &mut additions)?];
            if n_uses[negated] != 1 {
                changes.extend(list.in_users(negated, Some(k), &mut additions)?);
            }
            let changed: BTreeSet<usize> = changes.iter().map(|c| c.at).collect();
            (changed.len() == changes.len()).then_some((changes, additions))
        });
        let Some((changes, additions)) = planned else { continue };
        additions.append_to(program);
        for Change { at, op, negates } in changes {
            instructions[at].op = op;
            if negates && at != negated {
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

/// Takes negations out of the prepare part, and what no function reads since signs have changed.
pub(in crate::lower) fn absorb_in_prepare(program: &mut Program) {
    let read: BTreeSet<u32> = (program.functions.iter())
        .flat_map(|f| f.instructions.iter().flat_map(|i| i.op.operands()).chain(f.outputs()))
        .filter_map(|o| if let Operand::Slot(i) = o { Some(i) } else { None })
        .collect();
    keep_slots(program, read.into_iter().collect());
    let mut instructions = std::mem::take(&mut program.prepare.instructions);
    let slots = program.prepare.slots.iter().map(|slot| Operand::Value(slot.value));
    let sides = program.prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
    let mut outputs: Vec<Operand> = slots.chain(sides).collect();
    drop_dead(&mut instructions, &mut outputs);
    absorb(program, &mut instructions, &mut outputs, false);
    let mut outputs = outputs.into_iter();
    for (slot, new) in program.prepare.slots.iter_mut().zip(&mut outputs) {
        if let Operand::Value(v) = new {
            slot.value = v;
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
    negates: bool,
}

/// Instructions whose signs are looked at.
struct SignChange<'a> {
    program: &'a Program,
    instructions: &'a [Instruction],
    outputs: &'a [Operand],
    n_uses: &'a [usize],
    /// What each value was replaced by.
    stands_for: &'a [usize],
    may_prepare: bool,
}

impl SignChange<'_> {
    /// A change of one instruction that gives the value the other sign.
    fn opposite_of(&self, v: usize, additions: &mut Additions) -> Option<Change> {
        let change = |at: usize| {
            let op = self.opposite(self.instructions[at].op, additions)?;
            Some(Change { at, op, negates: true })
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
    fn in_users(&self, v: usize, except: Option<usize>, additions: &mut Additions) -> Option<Vec<Change>> {
        if self.is_output(v) {
            return None;
        }
        let live = (0..self.instructions.len()).filter(|user| self.stands_for[*user] == *user);
        let mut changes = Vec::new();
        for user in live.filter(|user| Some(*user) != except && self.operands(*user).any(|o| o == v)) {
            let op = self.instructions[user].op;
            if let Some(in_user) = self.with_opposite(user, v, additions) {
                changes.extend(in_user);
            } else if let Op::Mul(..) | Op::Div(..) = op
                && self.instructions[user].name.is_none()
            {
                // The product gets the other sign, too: it stands in the list so that nothing else changes it.
                changes.push(Change { at: user, op, negates: true });
                changes.extend(self.in_users(user, None, additions)?);
            } else {
                return None;
            }
        }
        Some(changes)
    }

    /// Changes that leave the value of a user as it is when one of its operands gets the other sign.
    fn with_opposite(&self, user: usize, v: usize, additions: &mut Additions) -> Option<Vec<Change>> {
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
                    return Some(vec![is_free.then(|| self.opposite_of(other, additions)).flatten()?]);
                }
                let other = self.negated(other, additions)?;
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
        Some(vec![Change { at: user, op, negates: false }])
    }

    /// The operation whose value is the opposite, if it costs no more in a function.
    fn opposite(&self, op: Op, additions: &mut Additions) -> Option<Op> {
        let mut negated = |o| self.negated(o, additions);
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
            Op::Recip(_)
            | Op::Neg(_)
            | Op::Sqrt(_)
            | Op::Power(..)
            | Op::Function(..)
            | Op::Atan2(..)
            | Op::SumError(..)
            | Op::ProductError(..)
            | Op::CircleError(..) => None,
        }
    }

    /// The opposite of a constant, or with leave of a parameter or slot as a slot of its own.
    fn negated(&self, operand: Operand, additions: &mut Additions) -> Option<Operand> {
        let program = self.program;
        if let Operand::Constant(_) = operand {
            let opposite = -additions.rational(program, operand)?;
            return Some(additions.constant(program, Constant::Rational(opposite)));
        }
        let is_prepared = matches!(operand, Operand::Slot(_) | Operand::Param(_));
        if !is_prepared || !self.may_prepare {
            return None;
        }
        let original = additions.in_prepare(program, operand);
        let value = match additions.op(program, original) {
            Some(Op::Neg(Operand::Value(value))) => value,
            _ => additions.value(program, Op::Neg(original)),
        };
        Some(additions.slot(program, value))
    }
}

/// Keeps the opposite of a prepared number that occurs in fused operations alone, if the first function that reads it
/// subtracts it or its products more often than it adds them: `a - (p x)` becomes `a + (-p) x`, at the same cost.
pub(in crate::lower) fn negate_slots(program: &mut Program) {
    // Terms that are added less those that are subtracted, in the first function alone; none where there are other
    // uses.
    let mut balances: BTreeMap<u32, Option<(usize, i32)>> = BTreeMap::new();
    let mut terms: Vec<Vec<[Option<u32>; 3]>> = Vec::new();
    for (function_idx, function) in program.functions.iter().enumerate() {
        let n_uses = n_uses_in(function);
        let mut is_in_term = vec![false; function.instructions.len()];
        let mut numbers = vec![[None; 3]; function.instructions.len()];
        for (k, instruction) in function.instructions.iter().enumerate() {
            let Op::MulAdd(signs, a, b, c) = instruction.op else { continue };
            if a == b {
                continue;
            }
            for (place, (o, negative)) in
                [(a, signs.product), (b, signs.product), (c, signs.addend)].into_iter().enumerate()
            {
                // The operand itself, or a factor of a product that is nowhere else.
                let product = position(o).map(|v| (v, &function.instructions[v]));
                let number = match product {
                    Some((v, Instruction { op: Op::Mul(p, q), name: None, .. }))
                        if n_uses[v] == 1 && p != q =>
                    {
                        is_in_term[v] = true;
                        slot(*p).or(slot(*q))
                    }
                    _ => slot(o),
                };
                let Some(i) = number else { continue };
                numbers[k][place] = number;
                if let Some((first, balance)) = balances.entry(i).or_insert(Some((function_idx, 0)))
                    && *first == function_idx
                {
                    *balance += if negative { -1 } else { 1 };
                }
            }
        }
        let others = function.instructions.iter().zip(&numbers).zip(&is_in_term);
        let others =
            others.filter(|((_, numbers), in_term)| !**in_term && numbers.iter().all(Option::is_none));
        let operands = others.flat_map(|((instruction, _), _)| instruction.op.operands());
        balances.extend(operands.chain(function.outputs()).filter_map(slot).map(|i| (i, None)));
        terms.push(numbers);
    }
    let is_negated = |i: u32| {
        let named = program.prepare.slots[i as usize].name.is_some();
        !named && matches!(balances.get(&i), Some(Some((_, balance))) if *balance < 0)
    };
    let negated: BTreeSet<u32> =
        (0u32..).take(program.prepare.slots.len()).filter(|i| is_negated(*i)).collect();
    for i in &negated {
        let opposite = Op::Neg(Operand::Value(program.prepare.slots[*i as usize].value));
        let value =
            u32::try_from(program.prepare.instructions.len()).expect("fewer than 2^32 values fit in memory");
        program.prepare.instructions.push(Instruction { op: opposite, section: 0, name: None });
        program.prepare.slots[*i as usize].value = value;
    }
    for (function, terms) in program.functions.iter_mut().zip(terms) {
        for (instruction, numbers) in function.instructions.iter_mut().zip(terms) {
            if let Op::MulAdd(signs, ..) = &mut instruction.op {
                let [a, b, c] = numbers.map(|number| number.is_some_and(|i| negated.contains(&i)));
                signs.product ^= a ^ b;
                signs.addend ^= c;
            }
        }
    }
}

fn slot(operand: Operand) -> Option<u32> {
    match operand {
        Operand::Slot(i) => Some(i),
        _ => None,
    }
}
