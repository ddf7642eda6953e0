//! What passes share that rewrite a program: positions, numbers of uses, and leaving out what nothing needs.
//!
//! Does not know: why anything is rewritten.

use std::collections::HashMap;

use super::ir::{Function, Instruction, Operand, Program};

/// Position of a value in its list.
pub(crate) fn position(operand: Operand) -> Option<usize> {
    match operand {
        Operand::Value(v) => Some(v as usize),
        _ => None,
    }
}

/// The value at a position of its list.
pub(crate) fn operand(position: usize) -> Operand {
    Operand::Value(u32::try_from(position).expect("no more instructions than before"))
}

/// The same in every call with the same parameters.
pub(crate) fn is_fixed(operand: Operand) -> bool {
    matches!(operand, Operand::Slot(_) | Operand::Param(_) | Operand::Constant(_))
}

/// How often each value is an operand or a result.
pub(crate) fn n_uses(instructions: &[Instruction], outputs: impl IntoIterator<Item = Operand>) -> Vec<usize> {
    let mut n_uses = vec![0; instructions.len()];
    let operands = instructions.iter().flat_map(|i| i.op.operands());
    operands.chain(outputs).filter_map(position).for_each(|v| n_uses[v] += 1);
    n_uses
}

/// How often each value of a function is an operand or a result.
pub(crate) fn n_uses_in(function: &Function) -> Vec<usize> {
    n_uses(&function.instructions, function.results.iter().map(|(_, o)| *o))
}

/// The position of an item in a list, at whose end it is put unless it is there.
pub(crate) fn placed<T: PartialEq>(list: &mut Vec<T>, item: T) -> u32 {
    let at = list.iter().position(|known| *known == item).unwrap_or_else(|| {
        list.push(item);
        list.len() - 1
    });
    u32::try_from(at).expect("fewer than 2^32 values fit in memory")
}

/// Leaves out what no output needs.
pub(crate) fn drop_dead(instructions: &mut Vec<Instruction>, outputs: &mut [Operand]) {
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

/// Leaves out slots and constants that no longer occur: slots in the given order, constants by their first use.
pub(crate) fn prune(program: &mut Program, slots: Vec<u32>) {
    fn keep(order: &mut Vec<u32>, index: &mut HashMap<u32, u32>, old: u32) -> u32 {
        *index.entry(old).or_insert_with(|| {
            order.push(old);
            u32::try_from(order.len() - 1).expect("no more than before")
        })
    }
    let slot_index: HashMap<u32, u32> = slots.iter().copied().zip(0..).collect();
    let (mut constants, mut constant_index) = (Vec::new(), HashMap::new());
    let mut kept = |o: Operand| match o {
        Operand::Slot(i) => Operand::Slot(slot_index[&i]),
        Operand::Constant(i) => Operand::Constant(keep(&mut constants, &mut constant_index, i)),
        other => other,
    };
    for function in &mut program.functions {
        for instruction in &mut function.instructions {
            instruction.op = instruction.op.map(&mut kept);
        }
        function.results.iter_mut().for_each(|(_, o)| *o = kept(*o));
    }
    for instruction in &mut program.prepare.instructions {
        instruction.op = instruction.op.map(&mut kept);
    }
    for condition in &mut program.prepare.conditions {
        (condition.greater, condition.less) = (kept(condition.greater), kept(condition.less));
    }
    let (old_slots, old_constants) = (&program.prepare.slots, &program.constants);
    let slots = slots.into_iter().map(|i| old_slots[i as usize].clone()).collect();
    let constants = constants.into_iter().map(|i| old_constants[i as usize].clone()).collect();
    (program.prepare.slots, program.constants) = (slots, constants);
}
