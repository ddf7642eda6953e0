//! Checks the rules of the intermediate form.
//!
//! Does not know: how programs are made, what they compute.

use std::collections::BTreeMap;

use super::ir::{Function, Instruction, Literal, Op, Operand, Program};
use crate::error::Error;
use crate::expr::Func;

/// Checks that a program is well formed.
///
/// Operands exist, precede their uses and are of a kind their place allows; sections ascend; nothing is dead; nothing
/// that depends on parameters alone is left in a function; sine and cosine of one angle follow each other there;
/// constants fit an `f64`.
///
/// # Errors
/// [`Error::Program`] with the first rule that is broken.
pub fn verify(program: &Program) -> Result<(), Error> {
    let fail = |reason: String| Err(Error::Program { reason });
    for constant in &program.constants {
        let value = constant.to_f64();
        let vanishes = value == 0.0 && !matches!(constant.literal(), Literal::Zero);
        if !value.is_finite() || vanishes {
            return Err(Error::OutOfRange { what: "a constant of the equations".into() });
        }
    }
    let prepare = &program.prepare;
    let mut used = verify_list(program, "prepare", &prepare.instructions, None)?;
    for slot in &prepare.slots {
        match used.get_mut(slot.value as usize) {
            Some(used) => *used = true,
            None => return fail(format!("slot holds value {}, which does not exist", slot.value)),
        }
    }
    for condition in &prepare.conditions {
        for side in [condition.greater, condition.less] {
            check_operand(program, "prepare", side, prepare.instructions.len(), None)?;
            if let Operand::Value(i) = side {
                used[i as usize] = true;
            }
        }
    }
    if let Some(dead) = used.iter().position(|used| !used) {
        return fail(format!("value {dead} of prepare is not used"));
    }
    let mut slot_used = vec![false; prepare.slots.len()];
    for function in &program.functions {
        let name = function.role.name();
        let mut used = verify_list(program, name, &function.instructions, Some(function))?;
        if let Some(i) = lonely_half(&function.instructions) {
            return fail(format!("value {i} of {name} stands apart from the other half of its pair"));
        }
        let mut section = 0;
        for (i, instruction) in function.instructions.iter().enumerate() {
            if instruction.section < section || instruction.section as usize >= program.sections.len() {
                return fail(format!("value {i} of {name} belongs to section {}", instruction.section));
            }
            section = instruction.section;
            let hoistable = |o| matches!(o, Operand::Constant(_) | Operand::Param(_) | Operand::Slot(_));
            if instruction.op.operands().all(hoistable) {
                return fail(format!("value {i} of {name} depends on parameters alone"));
            }
        }
        for (result, operand) in &function.results {
            check_operand(
                program,
                &format!("{name}.{result}"),
                *operand,
                function.instructions.len(),
                Some(function),
            )?;
            if let Operand::Value(i) = operand {
                used[*i as usize] = true;
            }
        }
        if let Some(dead) = used.iter().position(|used| !used) {
            return fail(format!("value {dead} of {name} is not used"));
        }
        let operands = function.instructions.iter().flat_map(|i| i.op.operands());
        for operand in operands.chain(function.results.iter().map(|(_, o)| *o)) {
            if let Operand::Slot(i) = operand {
                slot_used[i as usize] = true;
            }
        }
    }
    match slot_used.iter().position(|used| !used) {
        Some(dead) => fail(format!("slot {dead} is not used")),
        None => Ok(()),
    }
}

/// A sine or cosine that does not stand beside the cosine or sine of the same angle.
fn lonely_half(instructions: &[Instruction]) -> Option<usize> {
    let mut sines = BTreeMap::new();
    let mut cosines = BTreeMap::new();
    for (k, instruction) in instructions.iter().enumerate() {
        match instruction.op {
            Op::Function(Func::Sin, x) => sines.insert(x, k),
            Op::Function(Func::Cos, x) => cosines.insert(x, k),
            _ => None,
        };
    }
    let apart = |(x, sine): (&Operand, &usize)| cosines.get(x).filter(|cosine| **cosine != sine + 1).copied();
    sines.iter().find_map(apart)
}

/// Checks operands of a list and returns which values are used within it; `function` is none for the prepare part.
fn verify_list(
    program: &Program,
    place: &str,
    instructions: &[Instruction],
    function: Option<&Function>,
) -> Result<Vec<bool>, Error> {
    let mut used = vec![false; instructions.len()];
    for (i, instruction) in instructions.iter().enumerate() {
        for operand in instruction.op.operands() {
            check_operand(program, place, operand, i, function)?;
            if let Operand::Value(v) = operand {
                used[v as usize] = true;
            }
        }
        if let Op::Power(_, exponent) = instruction.op
            && !matches!(exponent, Operand::Constant(_))
        {
            return Err(Error::Program {
                reason: format!("exponent of value {i} of {place} is not constant"),
            });
        }
    }
    Ok(used)
}

fn check_operand(
    program: &Program,
    place: &str,
    operand: Operand,
    n_values: usize,
    function: Option<&Function>,
) -> Result<(), Error> {
    let fits = match operand {
        Operand::Value(i) => (i as usize) < n_values,
        Operand::Constant(i) => (i as usize) < program.constants.len(),
        Operand::Param(i) => (i as usize) < program.params.len(),
        Operand::Slot(i) => function.is_some() && (i as usize) < program.prepare.slots.len(),
        Operand::Time => function.is_some(),
        Operand::State(i) => function.is_some() && (i as usize) < program.state.len(),
        Operand::Argument(i) => function.is_some_and(|f| (i as usize) < f.argument.len()),
    };
    if fits {
        Ok(())
    } else {
        Err(Error::Program { reason: format!("operand {operand:?} in {place} does not exist there") })
    }
}
