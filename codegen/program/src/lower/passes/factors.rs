//! Products and quotients are computed in the order in which their factors are there.
//!
//! Every rewrite leaves the number of operations of a function as it is. Does not know: expressions, how wide a vector
//! register is, or whether the target has one.

use std::collections::BTreeMap;

use crate::program::cost::latency;
use crate::program::edit::{is_fixed, n_uses_in, position};
use crate::program::{Function, Instruction, Op, Operand, Program};

/// Orders the factors of every function.
pub(in crate::lower) fn order_factors(program: &mut Program) {
    program.functions.iter_mut().for_each(order_in);
}

/// Products and quotients in the order in which their factors are there, numbers first: `x (p (y / d))` becomes `((p y)
/// x) / d`, so that nothing waits but for the factor that comes last, and the operands of all components come in one
/// order.
fn order_in(function: &mut Function) {
    let n_uses = n_uses_in(function);
    let old = std::mem::take(&mut function.instructions);
    // Part of the one product that uses it. A square stays: its series costs half of that of a product.
    let is_part = |v: usize| {
        let is_product = match old[v].op {
            Op::Mul(a, b) => a != b,
            Op::Div(..) => true,
            _ => false,
        };
        is_product && n_uses[v] == 1 && old[v].name.is_none()
    };
    let mut is_taken_up = vec![false; old.len()];
    let mut products: BTreeMap<usize, Product> = BTreeMap::new();
    for k in (0..old.len()).rev() {
        if !is_taken_up[k]
            && let Some(product) = Product::of(&old, k, is_part, &mut is_taken_up)
        {
            products.insert(k, product);
        }
    }
    let mut list = Ordered { new: Vec::with_capacity(old.len()), ready: Vec::new() };
    let mut moved_to: Vec<Operand> = Vec::with_capacity(old.len());
    for (k, Instruction { op, section, name }) in old.into_iter().enumerate() {
        let moved = |o: Operand| position(o).map_or(o, |v| moved_to[v]);
        if is_taken_up[k] {
            // Nothing but the product that took it up refers to it.
            moved_to.push(Operand::Value(u32::MAX));
            continue;
        }
        let op = match products.remove(&k) {
            Some(Product { factors, divisors }) => {
                let factors = factors.into_iter().map(moved).collect();
                let divisors = divisors.into_iter().map(moved).collect();
                match op {
                    Op::MulAdd(signs, _, _, c) => {
                        let factors = list.reduce(factors, divisors, 2, section);
                        Op::MulAdd(signs, factors[1], factors[0], moved(c))
                    }
                    _ => list.product(factors, divisors, section),
                }
            }
            None => op.map(moved),
        };
        moved_to.push(list.push(Instruction { op, section, name }));
    }
    function.map_outputs(|o| position(o).map_or(o, |v| moved_to[v]));
    function.instructions = list.new;
}

/// The factors of a product and what it is divided by.
struct Product {
    factors: Vec<Operand>,
    divisors: Vec<Operand>,
}

impl Product {
    /// The product at `k` with the parts that it takes up; none where there are no parts.
    fn of(
        old: &[Instruction],
        k: usize,
        is_part: impl Fn(usize) -> bool,
        is_taken_up: &mut [bool],
    ) -> Option<Product> {
        let (mut pending, mut divisors) = match old[k].op {
            Op::Mul(a, b) | Op::MulAdd(_, a, b, _) if a != b => (vec![b, a], Vec::new()),
            Op::Div(a, d) => (vec![a], vec![d]),
            _ => return None,
        };
        let (mut factors, mut parts) = (Vec::new(), Vec::new());
        while let Some(o) = pending.pop() {
            let Some(v) = position(o).filter(|v| is_part(*v)) else {
                factors.push(o);
                continue;
            };
            parts.push(v);
            match old[v].op {
                Op::Div(a, d) => {
                    pending.push(a);
                    divisors.push(d);
                }
                Op::Mul(a, b) => pending.extend([b, a]),
                _ => {}
            }
        }
        // The product of two numbers would be one that changes with the parameters alone.
        if parts.is_empty() || factors.iter().filter(|o| is_fixed(**o)).count() > 1 {
            return None;
        }
        parts.into_iter().for_each(|v| is_taken_up[v] = true);
        Some(Product { factors, divisors })
    }
}

/// The new instructions of a function, and when their values are there.
struct Ordered {
    new: Vec<Instruction>,
    ready: Vec<u32>,
}

impl Ordered {
    fn ready_at(&self, operand: Operand) -> u32 {
        position(operand).map_or(0, |v| self.ready[v])
    }

    fn push(&mut self, instruction: Instruction) -> Operand {
        let start = instruction.op.operands().map(|o| self.ready_at(o)).max().unwrap_or(0);
        self.ready.push(start + latency(&instruction.op));
        self.new.push(instruction);
        Operand::Value(u32::try_from(self.new.len() - 1).expect("no more instructions than before"))
    }

    /// At most `n` numbers whose product is that of the factors over the divisors, those that are there first
    /// multiplied first; there are at least as many factors.
    fn reduce(
        &mut self,
        factors: Vec<Operand>,
        mut divisors: Vec<Operand>,
        n: usize,
        section: u32,
    ) -> Vec<Operand> {
        let mut factors = factors;
        // Later factors before earlier ones, numbers before what changes.
        factors.reverse();
        factors.sort_by_key(|o| (self.ready_at(*o), !is_fixed(*o)));
        divisors.sort_by_key(|o| self.ready_at(*o));
        for divisor in divisors {
            let n_early = factors.iter().filter(|o| self.ready_at(**o) <= self.ready_at(divisor)).count();
            let early: Vec<Operand> = factors.drain(..n_early.min(factors.len() + 1 - n).max(1)).collect();
            let numerator = self.multiply(early, 1, section)[0];
            let quotient = self.push(Instruction { op: Op::Div(numerator, divisor), section, name: None });
            self.insert(&mut factors, quotient);
        }
        self.multiply(factors, n, section)
    }

    fn multiply(&mut self, mut factors: Vec<Operand>, n: usize, section: u32) -> Vec<Operand> {
        while factors.len() > n {
            let op = Op::Mul(factors[0], factors[1]);
            factors.drain(..2);
            let product = self.push(Instruction { op, section, name: None });
            self.insert(&mut factors, product);
        }
        factors
    }

    fn insert(&self, factors: &mut Vec<Operand>, factor: Operand) {
        let at = factors.partition_point(|o| self.ready_at(*o) <= self.ready_at(factor));
        factors.insert(at, factor);
    }

    /// The last operation of the product of the factors over the divisors.
    fn product(&mut self, factors: Vec<Operand>, mut divisors: Vec<Operand>, section: u32) -> Op {
        let latest = divisors.iter().enumerate().max_by_key(|(_, o)| self.ready_at(**o));
        let (waits_for, latest) = match latest {
            Some((k, o)) => (factors.iter().all(|f| self.ready_at(*f) <= self.ready_at(*o)), k),
            None => (false, 0),
        };
        if waits_for || factors.len() == 1 {
            let divisor = divisors.remove(latest);
            return Op::Div(self.reduce(factors, divisors, 1, section)[0], divisor);
        }
        let factors = self.reduce(factors, divisors, 2, section);
        Op::Mul(factors[1], factors[0])
    }
}
