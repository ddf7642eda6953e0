//! Numbers of operations of a program and its parts.
//!
//! Does not know: who asks, how numbers are shown in a table.

use std::fmt;
use std::ops::AddAssign;

use super::cost::{CALL, DIVISION, LATENCY_OF_A_SUM, ROOT, latency};
use super::ir::{Function, Instruction, Op, Operand, Prepare, Program, completes_pair};
use super::table::Contraction;
use hamel_expr::Func;

/// Numbers of operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Additions and subtractions, fused ones included.
    pub add: usize,
    /// Multiplications, fused ones included.
    pub mul: usize,
    /// Pairs of a multiplication and an addition that are one instruction where the target has it.
    pub fma: usize,
    /// Divisions and reciprocals.
    pub div: usize,
    /// Negations.
    pub neg: usize,
    /// Square roots.
    pub sqrt: usize,
    /// Sines, cosines, exponentials, powers and so on; sine and cosine of one angle are one.
    pub transcendental: usize,
}

impl Counts {
    fn of(instructions: &[Instruction], includes: impl Fn(&Instruction) -> bool) -> Counts {
        let mut counts = Counts::default();
        for (k, instruction) in instructions.iter().enumerate().filter(|(_, i)| includes(i)) {
            *match instruction.op {
                Op::Add(..) | Op::Sub(..) => &mut counts.add,
                Op::Mul(..) => &mut counts.mul,
                Op::MulAdd(..) => {
                    counts.add += 1;
                    counts.mul += 1;
                    &mut counts.fma
                }
                Op::Div(..) | Op::Recip(_) => &mut counts.div,
                Op::Neg(_) | Op::Function(Func::Abs, _) => &mut counts.neg,
                Op::Sqrt(_) => &mut counts.sqrt,
                Op::Function(Func::Cos, _) if completes_pair(instructions, k) => continue,
                // What the emitted functions do besides the sum or product itself, which is a value of its own.
                Op::SumError(..) => {
                    counts.add += 5;
                    continue;
                }
                Op::ProductError(..) => {
                    counts.add += 6;
                    counts.mul += 4;
                    continue;
                }
                Op::CircleError(..) => {
                    counts.add += 28;
                    counts.mul += 13;
                    continue;
                }
                Op::Power(..) | Op::Function(..) | Op::Atan2(..) => &mut counts.transcendental,
            } += 1;
        }
        counts
    }

    /// Those of a contraction: a product takes two multiplications and an addition, and the sums of each result and
    /// table, which run side by side, four additions in the end.
    fn of_contraction(contraction: &Contraction) -> Counts {
        let (n, sums) = (contraction.n_products, contraction.n_results * contraction.terms.len());
        Counts { add: n + 4 * sums, mul: 2 * n, fma: n, ..Counts::default() }
    }

    /// All operations; a fused pair counts as two.
    pub fn total(&self) -> usize {
        self.add + self.mul + self.div + self.neg + self.sqrt + self.transcendental
    }

    /// Rough cost in instructions that a processor starts one after the other: additions, multiplications, fused pairs
    /// and signs 1, divisions 5, square roots 6, calls 20.
    pub fn cost(&self) -> u64 {
        let simple = self.add + self.mul - self.fma + self.neg;
        let n_times = |n: usize, cost: u32| n as u64 * u64::from(cost);
        simple as u64
            + n_times(self.div, DIVISION)
            + n_times(self.sqrt, ROOT)
            + n_times(self.transcendental, CALL)
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Counts) {
        self.add += other.add;
        self.mul += other.mul;
        self.fma += other.fma;
        self.div += other.div;
        self.neg += other.neg;
        self.sqrt += other.sqrt;
        self.transcendental += other.transcendental;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            (self.add, "additions", "addition"),
            (self.mul, "multiplications", "multiplication"),
            (self.div, "divisions", "division"),
            (self.neg, "sign changes", "sign change"),
            (self.sqrt, "square roots", "square root"),
            (self.transcendental, "elementary functions", "elementary function"),
        ];
        let mut first = true;
        for (k, (n, many, one)) in parts.into_iter().enumerate() {
            if n > 0 {
                write!(f, "{}{n} {}", if first { "" } else { ", " }, if n == 1 { one } else { many })?;
                first = false;
            }
            if k == 1 && self.fma > 0 {
                write!(f, " ({} fused)", self.fma)?;
            }
        }
        if first { f.write_str("no operations") } else { Ok(()) }
    }
}

impl Prepare {
    /// Operations of the part that runs once.
    pub fn counts(&self) -> Counts {
        Counts::of(&self.instructions, |_| true)
    }
}

impl Function {
    /// Operations of one call.
    pub fn counts(&self) -> Counts {
        let mut counts = self.straight_counts();
        self.contractions.iter().for_each(|c| counts += Counts::of_contraction(c));
        counts
    }

    /// Operations of the straight-line code of one call.
    pub fn straight_counts(&self) -> Counts {
        Counts::of(&self.instructions, |_| true)
    }

    /// Cycles of the longest chain of operations, each on the result of the one before, on current processors; sums of
    /// a contraction as if all of it were equally long.
    pub fn latency(&self) -> u32 {
        let mut known: Vec<u32> = Vec::with_capacity(self.instructions.len());
        for instruction in &self.instructions {
            let operands = instruction.op.operands().map(|operand| match operand {
                Operand::Value(k) => known[k as usize],
                _ => 0,
            });
            known.push(operands.max().unwrap_or_default() + latency(&instruction.op));
        }
        let straight = known.into_iter().max().unwrap_or_default();
        // A quarter of the products of a sum and what adds up the four, one contraction after the other.
        let of_contraction = |c: &Contraction| c.n_products / (4 * c.n_results.max(1)) + 4;
        let n_sums: usize = self.contractions.iter().map(of_contraction).sum();
        let n_sums = u32::try_from(n_sums).unwrap_or(u32::MAX);
        straight.saturating_add(n_sums.saturating_mul(LATENCY_OF_A_SUM))
    }

    /// Operations of one call that belong to a section; contractions belong to none.
    pub fn counts_of_section(&self, section_idx: usize) -> Counts {
        Counts::of(&self.instructions, |i| i.section as usize == section_idx)
    }
}

impl Program {
    /// Rough cost of calling every function once.
    pub fn cost(&self) -> u64 {
        self.functions.iter().map(|f| f.counts().cost()).sum()
    }
}
