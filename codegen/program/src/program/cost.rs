//! What operations cost: the one table that counts, searches for the cheapest form, and orders of evaluation share.
//!
//! Does not know: what is counted, searched or ordered.

use super::ir::Op;

/// Instructions that a division takes the place of.
///
/// Divisions and roots occupy a unit of their own for 4 to 6 cycles (Fog, Instruction tables, Skylake to Zen 4).
pub const DIVISION: u32 = 5;
/// Instructions that a square root takes the place of.
pub const ROOT: u32 = 6;
/// Instructions that an elementary function takes the place of.
pub const CALL: u32 = 20;

/// Instructions that a step of an integrator spends on a further component of the state for each evaluation of the
/// right-hand side.
///
/// The tableau of Vern9 has 95 coefficients for 16 evaluations; four components at a time take one instruction each
/// where the target has vectors of four.
pub const STEP_OF_A_COMPONENT: u32 = 6;

/// Cycles from operands to result on current processors. Only their order of magnitude matters: terms and factors that
/// are known earlier are taken first, so another table changes results in the last bits.
pub fn latency(op: &Op) -> u32 {
    match op {
        Op::Neg(_) => 1,
        Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::MulAdd(..) => LATENCY_OF_A_SUM,
        Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..) => LATENCY_OF_AN_ERROR,
        Op::Div(..) | Op::Recip(_) => 13,
        Op::Sqrt(_) => 18,
        Op::Power(..) | Op::Function(..) | Op::Atan2(..) => 50,
    }
}

/// Cycles from operands to result of additions, multiplications, and both at once.
pub const LATENCY_OF_A_SUM: u32 = 4;

/// Cycles from operands to the rounding error of a sum or product: four sums one after the other.
pub const LATENCY_OF_AN_ERROR: u32 = 4 * LATENCY_OF_A_SUM;

/// Costs in the search for the cheapest form of polynomials, in thirds of an instruction.
///
/// A target with fused multiply-add executes one instruction for a product with its sum, other targets two: an
/// instruction counts two thirds and every floating-point operation in it one third.
pub mod thirds {
    /// An instruction, fused or not, without the floating-point operations in it.
    pub const INSTRUCTION: i64 = 2;
    /// A floating-point operation.
    pub const FLOP: i64 = 1;
    /// A division.
    pub const DIVISION: i64 = 3 * super::DIVISION as i64;
    /// A square root.
    pub const ROOT: i64 = 3 * super::ROOT as i64;
    /// An elementary function.
    pub const CALL: i64 = 3 * super::CALL as i64;
}
