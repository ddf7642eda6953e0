//! The factor of a fused product that is a variable comes first.
//!
//! `x.mul_add(p / q, c)` reads better than `(p / q).mul_add(x, c)`. Over the reals both are one number, and one to the
//! last bit; over dual numbers the two products of the derivative are rounded in the order of the factors. So the order
//! belongs to the program, which all that runs or writes it keeps.
//!
//! Does not know: expressions, how a language spells anything.

use crate::program::edit::{is_fixed, n_uses, n_uses_in, position};
use crate::program::{Instruction, Op, Operand, Program, completes_pair};

/// Orders the factors of every fused product.
pub(in crate::lower) fn order_receivers(program: &mut Program) {
    for function in &mut program.functions {
        let n_uses = n_uses_in(function);
        order_in(&mut function.instructions, &n_uses, |o| !is_fixed(o));
    }
    let sides = program.prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
    let outputs = sides.chain(program.prepare.slots.iter().map(|slot| Operand::Value(slot.value)));
    let n_uses = n_uses(&program.prepare.instructions, outputs);
    order_in(&mut program.prepare.instructions, &n_uses, |o| matches!(o, Operand::Param(_)));
}

/// Orders factors where `is_variable` knows which inputs are variables.
fn order_in(instructions: &mut [Instruction], n_uses: &[usize], is_variable: impl Fn(Operand) -> bool) {
    for k in 0..instructions.len() {
        let is_name = |o: Operand| match position(o) {
            Some(v) => is_bound(instructions, n_uses, v),
            None => is_variable(o),
        };
        if let Op::MulAdd(signs, a, b, c) = instructions[k].op
            && is_name(b)
            && !is_name(a)
        {
            instructions[k].op = Op::MulAdd(signs, b, a, c);
        }
    }
}

/// Whether a value is a variable where it is written: it is used more than once, has a name or is one of a pair of sine
/// and cosine.
fn is_bound(instructions: &[Instruction], n_uses: &[usize], v: usize) -> bool {
    let is_sine = v + 1 < instructions.len() && completes_pair(instructions, v + 1);
    n_uses[v] > 1 || instructions[v].name.is_some() || is_sine || completes_pair(instructions, v)
}

#[cfg(test)]
mod tests {
    use super::order_in;
    use crate::program::edit::is_fixed;
    use crate::program::{Instruction, Op, Operand, Signs};

    #[test]
    fn variables_come_before_numbers_and_formulas() {
        let signs = Signs { product: true, addend: false };
        let (slot, x) = (Operand::Slot(0), Operand::State(0));
        let op = |op| Instruction { op, section: 0, name: None };
        let mut list = vec![
            op(Op::MulAdd(signs, slot, x, slot)),
            op(Op::Mul(x, x)),
            op(Op::MulAdd(signs, Operand::Value(1), Operand::Value(0), x)),
            op(Op::MulAdd(signs, slot, Operand::Value(1), x)),
        ];
        order_in(&mut list, &[2, 1, 1, 1], |o| !is_fixed(o));
        let ops: Vec<Op> = list.iter().map(|i| i.op).collect();
        assert_eq!(ops[0], Op::MulAdd(signs, x, slot, slot));
        assert_eq!(ops[2], Op::MulAdd(signs, Operand::Value(0), Operand::Value(1), x));
        assert_eq!(ops[3], Op::MulAdd(signs, slot, Operand::Value(1), x), "a formula stays where it is");
    }
}
