//! Checks the rules of the intermediate form.
//!
//! Does not know: how programs are made, what they compute.

use std::collections::BTreeMap;

use super::edit::{is_fixed, n_uses};
use super::ir::{Function, Instruction, Literal, Op, Operand, Program};
use crate::error::Error;
use crate::expr::Func;

/// Checks that a program is complete.
///
/// Operands exist, precede their uses and are of a kind their place allows; sections ascend; constants fit an `f64`;
/// nothing is dead; nothing that depends on parameters alone is left in a function; sine and cosine of one angle follow
/// each other there.
///
/// # Errors
/// [`Error::Program`] with the first rule that is broken.
pub fn verify(program: &Program) -> Result<(), Error> {
    verify_rules(program)?;
    let fail = |reason: String| Err(Error::Program { reason });
    let prepare = &program.prepare;
    let sides = prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
    let slots = prepare.slots.iter().map(|slot| Operand::Value(slot.value));
    if let Some(dead) = unused(&prepare.instructions, slots.chain(sides)) {
        return fail(format!("value {dead} of prepare is not used"));
    }
    let mut slot_used = vec![false; prepare.slots.len()];
    for function in &program.functions {
        let name = function.role.name();
        if let Some(i) = lonely_half(&function.instructions) {
            return fail(format!("value {i} of {name} stands apart from the other half of its pair"));
        }
        for (i, instruction) in function.instructions.iter().enumerate() {
            if instruction.op.operands().all(is_fixed) {
                return fail(format!("value {i} of {name} depends on parameters alone"));
            }
        }
        let results = function.results.iter().map(|(_, o)| *o);
        if let Some(dead) = unused(&function.instructions, results.clone()) {
            return fail(format!("value {dead} of {name} is not used"));
        }
        let operands = function.instructions.iter().flat_map(|i| i.op.operands());
        for operand in operands.chain(results) {
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

/// Checks the rules that hold for a program after every pass: those of [`verify`] that say what may stand where.
///
/// # Errors
/// [`Error::Program`] with the first rule that is broken; [`Error::OutOfRange`].
pub(crate) fn verify_rules(program: &Program) -> Result<(), Error> {
    let fail = |reason: String| Err(Error::Program { reason });
    for constant in &program.constants {
        let value = constant.to_f64();
        let vanishes = value == 0.0 && !matches!(constant.literal(), Literal::Zero);
        if !value.is_finite() || vanishes {
            return Err(Error::OutOfRange { what: "a constant of the equations".into() });
        }
    }
    let prepare = &program.prepare;
    let n_values = prepare.instructions.len();
    verify_list(program, "prepare", &prepare.instructions, None)?;
    for slot in &prepare.slots {
        if slot.value as usize >= n_values {
            return fail(format!("slot holds value {}, which does not exist", slot.value));
        }
    }
    for side in prepare.conditions.iter().flat_map(|c| [c.greater, c.less]) {
        check_operand(program, "prepare", side, n_values, None)?;
    }
    for function in &program.functions {
        let name = function.role.name();
        verify_list(program, name, &function.instructions, Some(function))?;
        let mut section = 0;
        for (i, instruction) in function.instructions.iter().enumerate() {
            if instruction.section < section || instruction.section as usize >= program.sections.len() {
                return fail(format!("value {i} of {name} belongs to section {}", instruction.section));
            }
            section = instruction.section;
        }
        for (result, operand) in &function.results {
            let place = format!("{name}.{result}");
            check_operand(program, &place, *operand, function.instructions.len(), Some(function))?;
        }
    }
    Ok(())
}

/// The first value that neither another one nor an output needs.
fn unused(instructions: &[Instruction], outputs: impl Iterator<Item = Operand>) -> Option<usize> {
    n_uses(instructions, outputs).iter().position(|n| *n == 0)
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

/// Checks the operands of a list; `function` is none for the prepare part.
fn verify_list(
    program: &Program,
    place: &str,
    instructions: &[Instruction],
    function: Option<&Function>,
) -> Result<(), Error> {
    for (i, instruction) in instructions.iter().enumerate() {
        for operand in instruction.op.operands() {
            check_operand(program, place, operand, i, function)?;
        }
        if let Op::Power(_, exponent) = instruction.op
            && !matches!(exponent, Operand::Constant(_))
        {
            return Err(Error::Program {
                reason: format!("exponent of value {i} of {place} is not constant"),
            });
        }
    }
    Ok(())
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
