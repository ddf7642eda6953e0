//! Components of a vector get the same shape and their numbers stand side by side, so that a compiler can pack them.
//!
//! Every rewrite leaves the number of operations of a function as it is. Deliberately does not know: how wide a vector
//! register is, or whether the target has one.

use std::collections::{BTreeMap, BTreeSet};

use crate::program::cost::latency;
use crate::program::edit::{is_fixed, n_uses_in, position};
use crate::program::{Function, Instruction, Op, Operand, Program};

fn slot(operand: Operand) -> Option<u32> {
    match operand {
        Operand::Slot(i) => Some(i),
        _ => None,
    }
}

/// Keeps the opposite of a prepared number that occurs in fused operations alone, if the first function that reads it
/// subtracts it or its products more often than it adds them: `a - (p x)` becomes `a + (-p) x`, at the same cost.
pub(super) fn turn_slots(program: &mut Program) {
    // Terms that are added less those that are subtracted, in the first function alone; none where there are other uses.
    let mut balances: BTreeMap<u32, Option<(usize, i32)>> = BTreeMap::new();
    let mut terms: Vec<Vec<[Option<u32>; 3]>> = Vec::new();
    for (function_idx, function) in program.functions.iter().enumerate() {
        let n_uses = n_uses_in(function);
        let mut is_in_term = vec![false; function.instructions.len()];
        let mut numbers = vec![[None; 3]; function.instructions.len()];
        for (k, instruction) in function.instructions.iter().enumerate() {
            let Op::MulAdd(signs, a, b, c) = instruction.op else { continue };
            if a == b {
                continue;
            }
            for (place, (o, negative)) in
                [(a, signs.product), (b, signs.product), (c, signs.addend)].into_iter().enumerate()
            {
                // The operand itself, or a factor of a product that is nowhere else.
                let product = position(o).map(|v| (v, &function.instructions[v]));
                let number = match product {
                    Some((v, Instruction { op: Op::Mul(p, q), name: None, .. }))
                        if n_uses[v] == 1 && p != q =>
                    {
                        is_in_term[v] = true;
                        slot(*p).or(slot(*q))
                    }
                    _ => slot(o),
                };
                let Some(i) = number else { continue };
                numbers[k][place] = number;
                if let Some((first, balance)) = balances.entry(i).or_insert(Some((function_idx, 0)))
                    && *first == function_idx
                {
                    *balance += if negative { -1 } else { 1 };
                }
            }
        }
        let others = function.instructions.iter().zip(&numbers).zip(&is_in_term);
        let others =
            others.filter(|((_, numbers), in_term)| !**in_term && numbers.iter().all(Option::is_none));
        let operands = others.flat_map(|((instruction, _), _)| instruction.op.operands());
        let results = function.results.iter().map(|(_, o)| *o);
        balances.extend(operands.chain(results).filter_map(slot).map(|i| (i, None)));
        terms.push(numbers);
    }
    let is_turned = |i: u32| {
        let named = program.prepare.slots[i as usize].name.is_some();
        !named && matches!(balances.get(&i), Some(Some((_, balance))) if *balance < 0)
    };
    let turned: BTreeSet<u32> =
        (0u32..).take(program.prepare.slots.len()).filter(|i| is_turned(*i)).collect();
    for i in &turned {
        let opposite = Op::Neg(Operand::Value(program.prepare.slots[*i as usize].value));
        let value =
            u32::try_from(program.prepare.instructions.len()).expect("fewer than 2^32 values fit in memory");
        program.prepare.instructions.push(Instruction { op: opposite, section: 0, name: None });
        program.prepare.slots[*i as usize].value = value;
    }
    for (function, terms) in program.functions.iter_mut().zip(terms) {
        for (instruction, numbers) in function.instructions.iter_mut().zip(terms) {
            if let Op::MulAdd(signs, ..) = &mut instruction.op {
                let [a, b, c] = numbers.map(|number| number.is_some_and(|i| turned.contains(&i)));
                signs.product ^= a ^ b;
                signs.addend ^= c;
            }
        }
    }
}

/// Products and quotients in the order in which their factors are there, numbers first: `x (p (y / d))` becomes
/// `((p y) x) / d`, so that nothing waits but for the factor that comes last, and the operands of all components come in
/// one order.
pub(super) fn order_factors(function: &mut Function) {
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
    function.results.iter_mut().for_each(|(_, o)| *o = position(*o).map_or(*o, |v| moved_to[v]));
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

    /// At most `n` numbers whose product is that of the factors over the divisors, those that are there first multiplied
    /// first; there are at least as many factors.
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

/// The slots that occur: those of results of the same shape place by place, the others in the order of their first use.
pub(super) fn slot_order(program: &Program) -> Vec<u32> {
    let mut order: Vec<u32> = Vec::new();
    let mut seen: BTreeSet<u32> = BTreeSet::new();
    let mut place = |i: u32| {
        if seen.insert(i) {
            order.push(i);
        }
    };
    for function in &program.functions {
        let mut lanes: BTreeMap<Vec<Leaf>, Vec<Vec<u32>>> = BTreeMap::new();
        let shapes = Shapes::of(function);
        for (_, result) in &function.results {
            let (shape, slots) = shapes.of_result(*result);
            lanes.entry(shape).or_default().push(slots);
        }
        for lanes in lanes.values().filter(|lanes| lanes.len() > 1) {
            for k in 0..lanes[0].len() {
                lanes.iter().for_each(|slots| place(slots[k]));
            }
        }
        let operands = function.instructions.iter().flat_map(|i| i.op.operands());
        operands.chain(function.results.iter().map(|(_, o)| *o)).filter_map(slot).for_each(&mut place);
    }
    order
}

/// A place in the preorder of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Leaf {
    Slot,
    Fixed,
    Input,
    /// A value that is used elsewhere too.
    Shared,
    /// An operation, its operands taken off.
    Operation(Op),
}

struct Shapes<'a> {
    function: &'a Function,
    n_uses: Vec<usize>,
}

impl Shapes<'_> {
    fn of(function: &Function) -> Shapes<'_> {
        Shapes { function, n_uses: n_uses_in(function) }
    }

    /// The operations behind a result, and the slots among their operands.
    fn of_result(&self, result: Operand) -> (Vec<Leaf>, Vec<u32>) {
        let (mut shape, mut slots) = (Vec::new(), Vec::new());
        let mut pending = vec![result];
        while let Some(o) = pending.pop() {
            shape.push(match o {
                Operand::Slot(i) => {
                    slots.push(i);
                    Leaf::Slot
                }
                Operand::Value(v) if self.n_uses[v as usize] == 1 => {
                    let op = self.function.instructions[v as usize].op;
                    pending.extend(op.operands());
                    Leaf::Operation(op.map(|_| Operand::Time))
                }
                Operand::Value(_) => Leaf::Shared,
                Operand::Constant(_) | Operand::Param(_) => Leaf::Fixed,
                Operand::Time | Operand::State(_) | Operand::Argument(_) => Leaf::Input,
            });
        }
        (shape, slots)
    }
}
