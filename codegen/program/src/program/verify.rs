//! Checks the rules of the intermediate form.
//!
//! Does not know: how programs are made, what they compute.

use std::collections::BTreeMap;

use super::edit::{is_fixed, n_uses};
use super::ir::{Function, Instruction, Literal, Op, Operand, Program};
use super::table::{Factors, Products, Table};
use hamel_expr::Func;
use hamel_expr::error::Error;

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
        if let Some(dead) = unused(&function.instructions, function.outputs()) {
            return fail(format!("value {dead} of {name} is not used"));
        }
        let operands = function.instructions.iter().flat_map(|i| i.op.operands());
        for operand in operands.chain(function.outputs()) {
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
pub fn verify_rules(program: &Program) -> Result<(), Error> {
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
        verify_tables(program, function)?;
        verify_list(program, name, &function.instructions, Some(function))?;
        let mut section = 0;
        for (i, instruction) in function.instructions.iter().enumerate() {
            if instruction.section < section || instruction.section as usize >= program.sections.len() {
                return fail(format!("value {i} of {name} belongs to section {}", instruction.section));
            }
            section = instruction.section;
        }
        for (result, operand) in &function.results {
            if let Operand::Contracted(i) = operand
                && function.contractions.iter().map(|c| c.n_results).sum::<usize>() > *i as usize
            {
                continue;
            }
            let place = format!("{name}.{result}");
            check_operand(program, &place, *operand, function.instructions.len(), Some(function))?;
        }
        for operand in &function.scalars {
            let place = format!("the scalars of {name}");
            check_operand(program, &place, *operand, function.instructions.len(), Some(function))?;
        }
        verify_contractions(program, function)?;
    }
    Ok(())
}

/// Checks that tables have the shape of what is contracted: every size of a contraction is that of a table.
fn verify_tables(program: &Program, function: &Function) -> Result<(), Error> {
    let fail = |reason: String| Err(Error::Program { reason: format!("{reason} in {}", function.role) });
    for (k, contraction) in function.contractions.iter().enumerate() {
        if contraction.terms.is_empty() && contraction.n_results > 0 {
            return fail(format!("no table, contraction {k}"));
        }
        let n_products = |p: &Products| program.tables.get(p.table as usize).map_or(0, Table::n_products);
        if contraction.terms.iter().map(n_products).sum::<usize>() != contraction.n_products {
            return fail(format!(
                "another number of products than {}, contraction {k}",
                contraction.n_products
            ));
        }
        for Products { table, .. } in &contraction.terms {
            let Some(table) = program.tables.get(*table as usize) else {
                return fail(format!("table {table} does not exist, contraction {k}"));
            };
            if let Err(reason) = table.check() {
                return fail(format!("{reason}, contraction {k}"));
            }
            if table.ends.len() != contraction.n_results {
                return fail(format!(
                    "{} sums of a table for {} results",
                    table.ends.len(),
                    contraction.n_results
                ));
            }
        }
    }
    Ok(())
}

/// Checks that every factor exists where it is read, and that every result is read by a later contraction or is one of
/// the function.
fn verify_contractions(program: &Program, function: &Function) -> Result<(), Error> {
    let fail = |reason: String| Err(Error::Program { reason: format!("{reason} in {}", function.role) });
    let mut is_read: Vec<bool> = Vec::new();
    for (k, contraction) in function.contractions.iter().enumerate() {
        is_read.resize(is_read.len() + contraction.n_results, false);
        for Products { table, left, right } in &contraction.terms {
            let table = &program.tables[*table as usize];
            for (factors, reads) in [(left, table.lefts()), (right, table.rights())] {
                let n = match factors {
                    Factors::State => program.state.len(),
                    Factors::Argument => function.argument.len(),
                    Factors::Scalars => function.scalars.len(),
                    Factors::Contraction(earlier) if (*earlier as usize) < k => {
                        function.contractions[*earlier as usize].n_results
                    }
                    Factors::Contraction(_) => 0,
                };
                let start = match factors {
                    Factors::Contraction(earlier) => Some(function.start_of_contraction(*earlier as usize)),
                    _ => None,
                };
                for i in reads {
                    if i >= n {
                        return fail(format!("factor {i} of {n} ({factors:?}), contraction {k}"));
                    }
                    if let Some(start) = start {
                        is_read[start + i] = true;
                    }
                }
            }
        }
    }
    for (_, result) in &function.results {
        if let Operand::Contracted(i) = result {
            is_read[*i as usize] = true;
        }
    }
    match is_read.iter().position(|read| !read) {
        Some(dead) => fail(format!("sum {dead} of the contractions is not used")),
        None => Ok(()),
    }
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
        Operand::Input(i) => function.is_some() && (i as usize) < program.inputs.len(),
        Operand::State(i) => function.is_some() && (i as usize) < program.state.len(),
        Operand::Argument(i) => function.is_some_and(|f| (i as usize) < f.argument.len()),
        // Nothing but a result is one: contractions come after the list.
        Operand::Contracted(_) => false,
    };
    if fits {
        Ok(())
    } else {
        Err(Error::Program { reason: format!("operand {operand:?} in {place} does not exist there") })
    }
}
