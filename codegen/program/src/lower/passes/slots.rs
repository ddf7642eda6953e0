//! Prepared numbers of the components of a vector stand side by side, so that a compiler can pack them.
//!
//! No operation changes. Does not know: how wide a vector register is, or whether the target has one.

use std::collections::{BTreeMap, BTreeSet};

use crate::program::edit::{n_uses_in, prune};
use crate::program::{Function, Op, Operand, Program};

/// Puts slots in that order, and leaves out slots and constants that no longer occur.
pub(in crate::lower) fn order_slots(program: &mut Program) {
    let order = slot_order(program);
    prune(program, order);
}

fn slot(operand: Operand) -> Option<u32> {
    match operand {
        Operand::Slot(i) => Some(i),
        _ => None,
    }
}

/// The slots that occur: those of results of the same shape place by place, the others in the order of their first use.
fn slot_order(program: &Program) -> Vec<u32> {
    let mut order: Vec<u32> = Vec::new();
    let mut seen: BTreeSet<u32> = BTreeSet::new();
    let mut place = |i: u32| {
        if seen.insert(i) {
            order.push(i);
        }
    };
    for function in &program.functions {
        let mut lanes: BTreeMap<Vec<Leaf>, Vec<Vec<u32>>> = BTreeMap::new();
        let shapes = Shapes::of(function);
        for (_, result) in &function.results {
            let (shape, slots) = shapes.of_result(*result);
            lanes.entry(shape).or_default().push(slots);
        }
        for lanes in lanes.values().filter(|lanes| lanes.len() > 1) {
            for k in 0..lanes[0].len() {
                lanes.iter().for_each(|slots| place(slots[k]));
            }
        }
        let operands = function.instructions.iter().flat_map(|i| i.op.operands());
        operands.chain(function.outputs()).filter_map(slot).for_each(&mut place);
    }
    order
}

/// A place in the preorder of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Leaf {
    Slot,
    Fixed,
    Input,
    /// A value that is used elsewhere too.
    Shared,
    /// An operation, its operands taken off.
    Operation(Op),
}

struct Shapes<'a> {
    function: &'a Function,
    n_uses: Vec<usize>,
}

impl Shapes<'_> {
    fn of(function: &Function) -> Shapes<'_> {
        Shapes { function, n_uses: n_uses_in(function) }
    }

    /// The operations behind a result, and the slots among their operands.
    fn of_result(&self, result: Operand) -> (Vec<Leaf>, Vec<u32>) {
        let (mut shape, mut slots) = (Vec::new(), Vec::new());
        let mut pending = vec![result];
        while let Some(o) = pending.pop() {
            shape.push(match o {
                Operand::Slot(i) => {
                    slots.push(i);
                    Leaf::Slot
                }
                Operand::Value(v) if self.n_uses[v as usize] == 1 => {
                    let op = self.function.instructions[v as usize].op;
                    pending.extend(op.operands());
                    Leaf::Operation(op.map(|_| Operand::Time))
                }
                Operand::Value(_) => Leaf::Shared,
                Operand::Constant(_) | Operand::Param(_) => Leaf::Fixed,
                Operand::Time
                | Operand::Input(_)
                | Operand::State(_)
                | Operand::Argument(_)
                | Operand::Contracted(_) => Leaf::Input,
            });
        }
        (shape, slots)
    }
}
