//! A prepared number that the right-hand side reads again gets another slot where that saves an instruction.
//!
//! Processors of the x86 family take one operand of an operation from memory: a number that one operation reads needs
//! no instruction that loads it, a number that several operations read does, and where registers run out it is stored
//! to the stack and read from there. With a slot for every read nothing is loaded or stored (`extended_pose` with
//! momenta as state: 225 instructions a call, 165 so; x86-64-v3). Where every operand is loaded, a copy that is read
//! soon after the first costs one load more, hence not every read gets one.
//!
//! No operation changes. Does not know: the target, in which order slots stand.

use std::collections::BTreeMap;

use crate::program::edit::is_fixed;
use crate::program::{Function, Op, Operand, Program, Role};

/// Reads of one number that each get a slot however close they are: all of them save the one load.
const MAX_CLOSE_READS: usize = 3;
/// Instructions after which a number has left its register: half of the registers of x86-64 hold operands meanwhile.
const FAR: usize = 8;

/// Gives reads of prepared numbers in the right-hand side slots of their own.
pub(in crate::lower) fn copy_slots(program: &mut Program) {
    let Some(rate) = program.function_idx(&Role::Rate) else { return };
    let reads = reads(&program.functions[rate]);
    let mut copied: Vec<(usize, u32)> =
        reads.iter().flat_map(|(number, reads)| to_copy(reads).into_iter().map(|at| (at, *number))).collect();
    // In the order of the reads: sum by sum.
    copied.sort_unstable();
    let slots = &mut program.prepare.slots;
    for (at, number) in copied {
        let copy = u32::try_from(slots.len()).expect("fewer than 2^32 slots fit in memory");
        slots.push(slots[number as usize].clone());
        let op = &mut program.functions[rate].instructions[at].op;
        *op = op.map(|o| if o == Operand::Slot(number) { Operand::Slot(copy) } else { o });
    }
}

/// An instruction that reads a number.
#[derive(Clone, Copy, Debug)]
struct Read {
    at: usize,
    /// Whether the operation can take it from memory.
    is_from_memory: bool,
}

/// Where each number is read, in order.
fn reads(function: &Function) -> BTreeMap<u32, Vec<Read>> {
    let mut n_reads: BTreeMap<Operand, usize> = BTreeMap::new();
    let operands = function.instructions.iter().flat_map(|i| i.op.operands());
    for operand in operands.chain(function.outputs()) {
        *n_reads.entry(operand).or_default() += 1;
    }
    // One that stands in memory and that nothing else wants in a register.
    let is_in_memory = |o: &Operand| is_fixed(*o) || (matches!(o, Operand::State(_)) && n_reads[o] == 1);
    let mut reads: BTreeMap<u32, Vec<Read>> = BTreeMap::new();
    for (at, instruction) in function.instructions.iter().enumerate() {
        let n_in_memory = instruction.op.operands().filter(is_in_memory).count();
        for operand in instruction.op.operands() {
            let Operand::Slot(number) = operand else { continue };
            let is_second = match instruction.op {
                Op::Add(..) | Op::Mul(..) | Op::MulAdd(..) => true,
                Op::Sub(_, b) | Op::Div(_, b) => b == operand,
                _ => false,
            };
            reads.entry(number).or_default().push(Read { at, is_from_memory: is_second && n_in_memory == 1 });
        }
    }
    for output in function.outputs() {
        if let Operand::Slot(number) = output {
            let at = function.instructions.len();
            reads.entry(number).or_default().push(Read { at, is_from_memory: false });
        }
    }
    reads
}

/// The instructions that read a copy.
fn to_copy(reads: &[Read]) -> Vec<usize> {
    if reads.len() <= MAX_CLOSE_READS && reads.iter().all(|read| read.is_from_memory) {
        return reads.iter().skip(1).map(|read| read.at).collect();
    }
    let far = reads.windows(2).filter(|pair| pair[1].at - pair[0].at >= FAR && pair[1].is_from_memory);
    far.map(|pair| pair[1].at).collect()
}
