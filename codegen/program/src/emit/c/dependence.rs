//! Which inputs each result of a function is computed from.
//!
//! Deliberately does not know: what depends on an input only in appearance; what the functions are for.

use std::collections::BTreeSet;

use crate::program::{Factors, Function, Instruction, Operand, Program};

/// Time, components of the state, parameters, and what moves the system from outside.
pub(super) type Inputs = BTreeSet<Operand>;

/// The inputs of each result of a function.
pub(super) fn of_results(program: &Program, function: &Function) -> Vec<Inputs> {
    let prepared = of_instructions(&program.prepare.instructions, &|operand| of_input(operand, &[]));
    let slots: Vec<Inputs> =
        program.prepare.slots.iter().map(|slot| prepared[slot.value as usize].clone()).collect();
    let values = of_instructions(&function.instructions, &|operand| of_input(operand, &slots));
    let of = |operand: Operand, contracted: &[Inputs]| match operand {
        Operand::Value(k) => values[k as usize].clone(),
        Operand::Contracted(k) => contracted[k as usize].clone(),
        other => of_input(other, &slots),
    };
    let scalars: Vec<Inputs> = function.scalars.iter().map(|operand| of(*operand, &[])).collect();
    let mut contracted: Vec<Inputs> = Vec::new();
    for contraction in &function.contractions {
        let mut sums = vec![Inputs::new(); contraction.n_results];
        for products in &contraction.terms {
            let table = &program.tables[products.table as usize];
            let factor = |factors: Factors, at: usize| match factors {
                Factors::State => Inputs::from([Operand::State(at as u32)]),
                Factors::Argument => Inputs::new(),
                Factors::Scalars => scalars[at].clone(),
                Factors::Contraction(k) => contracted[function.start_of_contraction(k as usize) + at].clone(),
            };
            let places: Vec<_> = table.all().collect();
            for (sum, range) in sums.iter_mut().zip(table.ranges()) {
                for place in &places[range] {
                    sum.extend(factor(products.left, place.left));
                    sum.extend(factor(products.right, place.right));
                }
            }
        }
        contracted.extend(sums);
    }
    function.results.iter().map(|(_, operand)| of(*operand, &contracted)).collect()
}

fn of_input(operand: Operand, slots: &[Inputs]) -> Inputs {
    match operand {
        Operand::Param(_) | Operand::Time | Operand::State(_) | Operand::Input(_) => Inputs::from([operand]),
        Operand::Slot(k) => slots[k as usize].clone(),
        Operand::Value(_) | Operand::Constant(_) | Operand::Argument(_) | Operand::Contracted(_) => {
            Inputs::new()
        }
    }
}

fn of_instructions(instructions: &[Instruction], input: &dyn Fn(Operand) -> Inputs) -> Vec<Inputs> {
    let mut values: Vec<Inputs> = Vec::with_capacity(instructions.len());
    for instruction in instructions {
        let mut inputs = Inputs::new();
        for operand in instruction.op.operands() {
            match operand {
                Operand::Value(k) => inputs.extend(values[k as usize].iter().copied()),
                other => inputs.extend(input(other)),
            }
        }
        values.push(inputs);
    }
    values
}
