//! What passes share that rewrite a program: positions, numbers of uses, and leaving out what nothing needs.
//!
//! Does not know: why anything is rewritten.

use std::collections::HashMap;

use super::ir::{Constant, Function, Instruction, Op, Operand, Program, Slot};
use hamel_expr::Rational;

/// Position of a value in its list.
pub fn position(operand: Operand) -> Option<usize> {
    match operand {
        Operand::Value(v) => Some(v as usize),
        _ => None,
    }
}

/// The value at a position of its list.
pub fn operand(position: usize) -> Operand {
    Operand::Value(u32::try_from(position).expect("no more instructions than before"))
}

/// The same in every call with the same parameters.
pub fn is_fixed(operand: Operand) -> bool {
    matches!(operand, Operand::Slot(_) | Operand::Param(_) | Operand::Constant(_))
}

/// How often each value is an operand or a result.
pub fn n_uses(instructions: &[Instruction], outputs: impl IntoIterator<Item = Operand>) -> Vec<usize> {
    let mut n_uses = vec![0; instructions.len()];
    let operands = instructions.iter().flat_map(|i| i.op.operands());
    operands.chain(outputs).filter_map(position).for_each(|v| n_uses[v] += 1);
    n_uses
}

/// How often each value of a function is an operand or a result.
pub fn n_uses_in(function: &Function) -> Vec<usize> {
    n_uses(&function.instructions, function.outputs())
}

/// `-operand` or `operand`.
#[derive(Clone, Copy, Debug)]
pub struct Signed {
    /// Whether the sign is turned.
    pub negative: bool,
    /// The operand without the sign.
    pub operand: Operand,
}

impl Signed {
    /// `a + b`, `a - b`, `b - a` or `-(a + b)`: whether it is negated, and the operation.
    pub fn plus(self, b: Signed) -> (bool, Op) {
        match (self.negative, b.negative) {
            (false, false) => (false, Op::Add(self.operand, b.operand)),
            (false, true) => (false, Op::Sub(self.operand, b.operand)),
            (true, false) => (false, Op::Sub(b.operand, self.operand)),
            (true, true) => (true, Op::Add(self.operand, b.operand)),
        }
    }
}

/// Constants, prepared values and slots that a rewrite needs besides those of the program: planned first, and appended
/// to the program when the rewrite is done.
#[derive(Debug, Default)]
pub struct Additions {
    constants: Vec<Constant>,
    instructions: Vec<Instruction>,
    slots: Vec<Slot>,
}

impl Additions {
    /// The constant, of the program or new.
    pub fn constant(&mut self, program: &Program, constant: Constant) -> Operand {
        Operand::Constant(placed(&program.constants, &mut self.constants, constant))
    }

    /// The rational number that an operand is; none for every other operand.
    pub fn rational<'a>(&'a self, program: &'a Program, operand: Operand) -> Option<&'a Rational> {
        let Operand::Constant(i) = operand else { return None };
        match at(&program.constants, &self.constants, i) {
            Constant::Rational(q) => Some(q),
            Constant::Pi => None,
        }
    }

    /// What the prepare part calls an operand that every call reads: a slot is a value there.
    pub fn in_prepare(&self, program: &Program, operand: Operand) -> Operand {
        match operand {
            Operand::Slot(i) => Operand::Value(at(&program.prepare.slots, &self.slots, i).value),
            other => other,
        }
    }

    /// The operation whose result is a value of the prepare part; none for every other operand.
    pub fn op(&self, program: &Program, operand: Operand) -> Option<Op> {
        let Operand::Value(v) = operand else { return None };
        Some(at(&program.prepare.instructions, &self.instructions, v).op)
    }

    /// The value of an operation in the prepare part, there already or new.
    pub fn value(&mut self, program: &Program, op: Op) -> u32 {
        let instruction = Instruction { op, section: 0, name: None };
        placed(&program.prepare.instructions, &mut self.instructions, instruction)
    }

    /// A slot that holds a value of the prepare part, there already or new.
    pub fn slot(&mut self, program: &Program, value: u32) -> Operand {
        Operand::Slot(placed(&program.prepare.slots, &mut self.slots, Slot { value, name: None }))
    }

    /// Appends everything to the program from which it was planned.
    pub fn append_to(self, program: &mut Program) {
        program.constants.extend(self.constants);
        program.prepare.instructions.extend(self.instructions);
        program.prepare.slots.extend(self.slots);
    }
}

/// The item at a position of a list and what is added to it.
fn at<'a, T>(list: &'a [T], added: &'a [T], position: u32) -> &'a T {
    let position = position as usize;
    list.get(position).unwrap_or_else(|| &added[position - list.len()])
}

/// The position of an item in a list and what is added to it, where it is put unless it is there.
fn placed<T: PartialEq>(list: &[T], added: &mut Vec<T>, item: T) -> u32 {
    let at = list.iter().chain(&*added).position(|known| *known == item).unwrap_or_else(|| {
        added.push(item);
        list.len() + added.len() - 1
    });
    u32::try_from(at).expect("fewer than 2^32 values fit in memory")
}

/// Leaves out what no output needs.
pub fn drop_dead(instructions: &mut Vec<Instruction>, outputs: &mut [Operand]) {
    let mut is_live = vec![false; instructions.len()];
    outputs.iter().filter_map(|o| position(*o)).for_each(|v| is_live[v] = true);
    for k in (0..instructions.len()).rev() {
        if is_live[k] {
            instructions[k].op.operands().filter_map(position).for_each(|v| is_live[v] = true);
        }
    }
    let mut moved_to = vec![0; instructions.len()];
    let mut kept: Vec<Instruction> = Vec::with_capacity(instructions.len());
    for (k, mut instruction) in instructions.drain(..).enumerate().filter(|(k, _)| is_live[*k]) {
        moved_to[k] = kept.len();
        instruction.op = instruction.op.map(|o| position(o).map_or(o, |v| operand(moved_to[v])));
        kept.push(instruction);
    }
    outputs.iter_mut().for_each(|o| *o = position(*o).map_or(*o, |v| operand(moved_to[v])));
    *instructions = kept;
}

/// Keeps these slots, in this order: all that the functions read.
pub fn keep_slots(program: &mut Program, slots: Vec<u32>) {
    let index: HashMap<u32, u32> = slots.iter().copied().zip(0..).collect();
    let kept = |o: Operand| match o {
        Operand::Slot(i) => Operand::Slot(index[&i]),
        other => other,
    };
    for function in &mut program.functions {
        function.instructions.iter_mut().for_each(|instruction| instruction.op = instruction.op.map(kept));
        function.map_outputs(kept);
    }
    let old = &program.prepare.slots;
    program.prepare.slots = slots.into_iter().map(|i| old[i as usize].clone()).collect();
}

/// Leaves out slots and constants that no longer occur: slots stay in the given order, constants by their first use.
pub fn prune(program: &mut Program, slots: Vec<u32>) {
    fn keep(order: &mut Vec<u32>, index: &mut HashMap<u32, u32>, old: u32) -> u32 {
        *index.entry(old).or_insert_with(|| {
            order.push(old);
            u32::try_from(order.len() - 1).expect("no more than before")
        })
    }
    keep_slots(program, slots);
    let (mut constants, mut index) = (Vec::new(), HashMap::new());
    let mut kept = |o: Operand| match o {
        Operand::Constant(i) => Operand::Constant(keep(&mut constants, &mut index, i)),
        other => other,
    };
    for function in &mut program.functions {
        for instruction in &mut function.instructions {
            instruction.op = instruction.op.map(&mut kept);
        }
        function.map_outputs(&mut kept);
    }
    for instruction in &mut program.prepare.instructions {
        instruction.op = instruction.op.map(&mut kept);
    }
    for condition in &mut program.prepare.conditions {
        (condition.greater, condition.less) = (kept(condition.greater), kept(condition.less));
    }
    let old = &program.constants;
    program.constants = constants.into_iter().map(|i| old[i as usize].clone()).collect();
}
