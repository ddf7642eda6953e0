//! Instructions on lanes, before they have registers.
//!
//! Deliberately does not know: programs, registers, bytes of code.

use crate::assembler::Binary;
use crate::translate::Pointer;

/// A value: the result of an instruction, or a number of a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    Temporary(usize),
    Number(Pointer, usize),
}

/// One instruction on values.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instruction {
    Binary(Binary, usize, [Value; 2]),
    Root(usize, Value),
    /// Bits moved to the left.
    Shift(usize, Value, u8),
    /// The second where the sign bit of the third is set, otherwise the first.
    Choose(usize, [Value; 3]),
    Store(Value, Pointer, usize),
    /// Gives up where a lane of the first is larger than the second.
    Guard(usize, [Value; 2]),
}

impl Instruction {
    pub(crate) fn operands(&self) -> impl Iterator<Item = Value> {
        let (first, others): (Value, [Option<Value>; 2]) = match *self {
            Instruction::Binary(_, _, [a, b]) | Instruction::Guard(_, [a, b]) => (a, [Some(b), None]),
            Instruction::Choose(_, [a, b, c]) => (a, [Some(b), Some(c)]),
            Instruction::Root(_, a) | Instruction::Shift(_, a, _) | Instruction::Store(a, ..) => {
                (a, [None; 2])
            }
        };
        std::iter::once(first).chain(others.into_iter().flatten())
    }

    /// What it computes, if it does nothing else.
    pub(crate) fn result(&self) -> Option<usize> {
        match *self {
            Instruction::Binary(_, to, _)
            | Instruction::Root(to, _)
            | Instruction::Shift(to, ..)
            | Instruction::Choose(to, _) => Some(to),
            Instruction::Store(..) | Instruction::Guard(..) => None,
        }
    }
}

/// Instructions of rows that are alike, one of each in turn: what both read is read once.
pub(crate) fn in_turn(bodies: Vec<Vec<Instruction>>) -> Vec<Instruction> {
    let n = bodies.iter().map(Vec::len).max().unwrap_or(0);
    (0..n).flat_map(|at| bodies.iter().filter_map(move |body| body.get(at).copied())).collect()
}

/// The instructions whose results are needed.
pub(crate) fn needed(instructions: Vec<Instruction>, n_temporaries: usize) -> Vec<Instruction> {
    let mut is_used = vec![false; n_temporaries];
    let mut kept: Vec<Instruction> = Vec::with_capacity(instructions.len());
    for instruction in instructions.into_iter().rev() {
        if instruction.result().is_some_and(|result| !is_used[result]) {
            continue;
        }
        for operand in instruction.operands() {
            if let Value::Temporary(k) = operand {
                is_used[k] = true;
            }
        }
        kept.push(instruction);
    }
    kept.reverse();
    kept
}
