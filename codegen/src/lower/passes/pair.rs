//! Sine and cosine of one angle stand side by side, so that one call computes both.
//!
//! Does not know: how the pair is spelled.

use std::collections::HashMap;

use crate::expr::Func;
use crate::program::{Function, Op, Operand, Program};

/// Pairs sines and cosines in every function.
pub(in crate::lower) fn pair(program: &mut Program) {
    program.functions.iter_mut().for_each(pair_in);
}

/// Moves the later one of a sine and a cosine of the same angle to the earlier one, the sine first.
fn pair_in(function: &mut Function) {
    let mut places: HashMap<Operand, [Option<usize>; 2]> = HashMap::new();
    for (k, instruction) in function.instructions.iter().enumerate() {
        match instruction.op {
            Op::Function(Func::Sin, x) => places.entry(x).or_default()[0] = Some(k),
            Op::Function(Func::Cos, x) => places.entry(x).or_default()[1] = Some(k),
            _ => (),
        }
    }
    let mut order = Vec::with_capacity(function.instructions.len());
    for (k, instruction) in function.instructions.iter().enumerate() {
        let both = match instruction.op {
            Op::Function(Func::Sin | Func::Cos, x) => places[&x],
            _ => [None; 2],
        };
        match both {
            [Some(sine), Some(cosine)] if k == sine.min(cosine) => order.extend([(sine, k), (cosine, k)]),
            [Some(_), Some(_)] => (),
            _ => order.push((k, k)),
        }
    }
    let mut moved_to = vec![0u32; function.instructions.len()];
    for (new, (old, _)) in (0u32..).zip(&order) {
        moved_to[*old] = new;
    }
    let moved = |o: Operand| match o {
        Operand::Value(v) => Operand::Value(moved_to[v as usize]),
        other => other,
    };
    let place = |(old, section_of): (usize, usize)| {
        let mut instruction = function.instructions[old].clone();
        instruction.section = function.instructions[section_of].section;
        instruction.op = instruction.op.map(moved);
        instruction
    };
    function.instructions = order.into_iter().map(place).collect();
    function.results.iter_mut().for_each(|(_, o)| *o = moved(*o));
}
