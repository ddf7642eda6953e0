//! Sine and cosine of one angle stand side by side, so that one call computes both, and two such pairs stand side by
//! side where both angles are known, so that one call computes the four: in one vector register, with the bits of two
//! calls (two_arm_satellite: 31 instructions less; x86-64-v3).
//!
//! Does not know: how the calls are spelled.

use std::collections::{BTreeSet, HashMap};

use crate::program::edit::position;
use crate::program::{Function, Op, Operand, Program, completes_pair};
use hamel_expr::Func;

/// Pairs sines and cosines in every function.
pub(in crate::lower) fn pair(program: &mut Program) {
    program.functions.iter_mut().for_each(pair_in);
}

/// Moves the later one of a sine and a cosine of the same angle to the earlier one, the sine first, and then each
/// second pair to the one before it.
fn pair_in(function: &mut Function) {
    let order = pairs(function);
    reorder(function, &order);
    let order = twos(function);
    reorder(function, &order);
}

/// The instructions in their new order, each with the one whose section it moves to.
type Order = Vec<(usize, usize)>;

/// The order in which sine and cosine of one angle stand side by side.
fn pairs(function: &Function) -> Order {
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
    order
}

/// The order in which a pair stands behind another one that does not decide its angle.
fn twos(function: &Function) -> Order {
    let instructions = &function.instructions;
    let is_pair = |k: usize| k + 1 < instructions.len() && completes_pair(instructions, k + 1);
    let pairs: Vec<usize> = (0..instructions.len()).filter(|k| is_pair(*k)).collect();
    let mut is_placed = vec![false; instructions.len()];
    let mut order = Vec::with_capacity(instructions.len());
    for k in 0..instructions.len() {
        if is_placed[k] {
            continue;
        }
        let others = pairs.iter().filter(|second| is_pair(k) && **second > k && !is_placed[**second]);
        let found =
            others.filter_map(|second| Some((*second, behind(function, &is_placed, k, *second)?))).next();
        let mut together = vec![k];
        if let Some((second, angle)) = found {
            together = angle;
            together.extend([k, k + 1, second, second + 1]);
        }
        for old in together {
            order.push((old, k));
            is_placed[old] = true;
        }
    }
    order
}

/// Operations of an angle that move before another pair.
const MAX_MOVED: usize = 4;

/// What is not placed yet of the angle of the pair at `second`, in order; none where the pair at `first` decides it, or
/// it is more than a short sum.
fn behind(function: &Function, is_placed: &[bool], first: usize, second: usize) -> Option<Vec<usize>> {
    let instructions = &function.instructions;
    let mut found = BTreeSet::new();
    let mut pending: Vec<usize> = instructions[second].op.operands().filter_map(position).collect();
    while let Some(k) = pending.pop() {
        if is_placed[k] || !found.insert(k) {
            continue;
        }
        let is_sum = matches!(
            instructions[k].op,
            Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::MulAdd(..) | Op::Neg(_)
        );
        if k <= first + 1 || !is_sum || found.len() > MAX_MOVED {
            return None;
        }
        pending.extend(instructions[k].op.operands().filter_map(position));
    }
    Some(found.into_iter().collect())
}

/// Puts the instructions in that order.
fn reorder(function: &mut Function, order: &Order) {
    let mut moved_to = vec![0u32; function.instructions.len()];
    for (new, (old, _)) in (0u32..).zip(order) {
        moved_to[*old] = new;
    }
    let moved = |o: Operand| match o {
        Operand::Value(v) => Operand::Value(moved_to[v as usize]),
        other => other,
    };
    let place = |&(old, section_of): &(usize, usize)| {
        let mut instruction = function.instructions[old].clone();
        instruction.section = function.instructions[section_of].section;
        instruction.op = instruction.op.map(moved);
        instruction
    };
    function.instructions = order.iter().map(place).collect();
    function.map_outputs(moved);
}
