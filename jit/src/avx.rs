//! Functions of a program as machine code on four or eight numbers side by side, for processors with AVX2 or AVX-512:
//! the same operations in the same order. Cranelift has registers of two numbers.
//!
//! A function is straight-line code. Its values stay in the registers as long as they are needed soonest; numbers of
//! vectors are read where they are needed, and stay in registers that are free. Where an angle is beyond the bound of
//! the kernel of sine and cosine, the code gives up, and the caller takes another way.
//!
//! Deliberately does not know: how code is made runnable, tables of products, elementary functions but sine, cosine and
//! the absolute value: a function with others has no such code.

use std::collections::HashMap;

use hamel_expr::Func;
use hamel_program::program::{Constant, Function, Op, Operand, Program, Signs};
use hamel_runtime::math::kernel::BOUND;

use crate::assembler::{Assembler, Binary, Place};
use crate::instructions::{Instruction, Value, in_turn, needed};
use crate::kernel::{Step, kernel};
use crate::lanes::Form;
use crate::translate::{Pointer, outputs};

/// A constant on every lane of the largest register.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Spread(#[expect(dead_code, reason = "compiled code reads it")] [u64; 8]);

/// Code and the constants that it reads.
pub(crate) struct Emitted {
    pub(crate) code: Vec<u8>,
    pub(crate) constants: Vec<Spread>,
}

/// The code of a function, unless it has operations that there is no code for.
pub(crate) fn emit(function: &Function, program: &Program, form: Form) -> Option<Emitted> {
    let mut writer = Writer::new(program, form);
    writer.function(function)?;
    let Writer { instructions, n_temporaries, constants, .. } = writer;
    let mut assembler = Assembler::new(form.encoding);
    let instructions = needed(instructions, n_temporaries);
    let n_slots = allocate(&mut assembler, &instructions, n_temporaries);
    Some(Emitted { code: assembler.finish(n_slots * form.encoding.n_bytes()), constants })
}

/// Bytes of a loop that the processor keeps near, beside what it works on.
const MAX_LOOP: usize = 24_000;

/// Instructions of a substep that the processor looks beyond: it works on the next row meanwhile, though that stands
/// behind. Longer substeps are written one instruction in turn.
///
/// Nanoseconds an evaluation of the right-hand side of `heavy_top`, `kirchhoff_body`, `chaplygin_ball` and
/// `two_arm_satellite` on eight lanes (AVX-512, AMD EPYC of family 25) with two rows one after the other: 10.2, 28.3,
/// 26.6, 60.3; in turn: 11.1, 26.5, 26.7, 56.6; with one row alone 14.8, 34.3, 31.9, 63.4.
const MAX_IN_SIGHT: usize = 80;

/// Code of one or two rows of the midpoint rule around a right-hand side:
///
/// ```text
/// even = 0,  odd = eta f,  even += 2 eta f(t, y + odd),  t += eta,  and then n - 1 times:
/// odd  += 2 eta f(t, y + even), t += eta,  even += 2 eta f(t, y + odd),  t += eta
/// ```
///
/// Of two rows, which do not depend on each other, the first goes on for another time.
///
/// The state is `y`, the argument `f`; the results are `even` and, behind it, `odd`, a row behind the other. The time
/// is that of two rows, and behind it `eta` and `2 eta` of each; the last pointer is the number `n`. None for functions
/// with operations that there is no code for, with tables, and for code so long that a loop gains nothing.
pub(crate) fn emit_rows(
    function: &Function,
    program: &Program,
    form: Form,
    n_rows: usize,
) -> Option<Emitted> {
    let n = program.state.len();
    if function.results.len() != n || !function.argument.is_empty() || !function.contractions.is_empty() {
        return None;
    }
    let mut writer = Writer::new(program, form);
    let (mut assembler, mut n_slots) = (Assembler::new(form.encoding), 0);
    let mut write = |rows: usize, to_even: bool, assembler: &mut Assembler| {
        let mut bodies = Vec::new();
        for row in 0..rows {
            let (even, odd) = (2 * n * row, 2 * n * row + n);
            let body = writer.substep(function, row, if to_even { (odd, even) } else { (even, odd) })?;
            bodies.push(needed(body, writer.n_temporaries));
        }
        let is_short = bodies.iter().all(|body| body.len() <= MAX_IN_SIGHT);
        let all = if is_short { bodies.concat() } else { in_turn(bodies) };
        n_slots = n_slots.max(allocate(assembler, &all, writer.n_temporaries));
        Some(())
    };
    write(n_rows, false, &mut assembler)?;
    let second = assembler.len();
    write(n_rows, true, &mut assembler)?;
    if assembler.len() > MAX_LOOP {
        return None;
    }
    assembler.end_loop();
    if n_rows > 1 {
        write(1, false, &mut assembler)?;
        write(1, true, &mut assembler)?;
    }
    let entry = entry_of_rows(n, form, n_rows);
    let code = assembler.finish_loop(n_slots * form.encoding.n_bytes(), &entry, second);
    Some(Emitted { code, constants: writer.constants })
}

/// `even = 0` and `odd = eta f` for each row.
fn entry_of_rows(n: usize, form: Form, n_rows: usize) -> Assembler {
    let (zero, slope, product) = (0, 1, 2);
    let mut entry = Assembler::new(form.encoding);
    let number = |pointer: Pointer, place: usize| Place::Number(pointer, place * form.stride());
    entry.binary(Binary::Xor, zero, zero, Place::Register(zero));
    for component in 0..n {
        entry.load(slope, number(Pointer::Argument, component));
        for row in 0..n_rows {
            let (even, odd) = (2 * n * row + component, 2 * n * row + n + component);
            entry.store(zero, number(Pointer::Out, even));
            entry.binary(Binary::Mul, product, slope, number(Pointer::Time, size_of_row(row)));
            entry.store(product, number(Pointer::Out, odd));
        }
    }
    entry
}

/// Most rows of a loop, whose times are the first numbers behind the pointer of the time.
pub(crate) const MOST_ROWS: usize = 2;

/// Where `eta` of a row is behind the pointer of the time; behind it is `2 eta`.
pub(crate) const fn size_of_row(row: usize) -> usize {
    MOST_ROWS + 2 * row
}

struct Writer<'a> {
    /// Bytes from a number of a vector to the next.
    stride: usize,
    instructions: Vec<Instruction>,
    n_temporaries: usize,
    constants: Vec<Spread>,
    places: HashMap<u64, usize>,
    numbers: &'a [Constant],
    n_slots: usize,
    values: Vec<Value>,
    /// Sines and cosines of angles that there are.
    angles: HashMap<Operand, (Value, Value)>,
    /// Where increments of the state are among the results, unless the state is taken as it stands.
    increments: Option<usize>,
    /// The components of the moved state that there are.
    moved: HashMap<u32, Value>,
    has_time: bool,
    /// Which of several rows is written.
    row: usize,
}

impl<'a> Writer<'a> {
    fn new(program: &'a Program, form: Form) -> Writer<'a> {
        Writer {
            stride: form.stride(),
            instructions: Vec::new(),
            n_temporaries: 0,
            constants: Vec::new(),
            places: HashMap::new(),
            numbers: &program.constants,
            n_slots: program.prepare.slots.len(),
            values: Vec::new(),
            angles: HashMap::new(),
            increments: None,
            moved: HashMap::new(),
            has_time: false,
            row: 0,
        }
    }

    /// `to += 2 eta f(t, y + at)` of a row, and the time after it, where it is read.
    fn substep(
        &mut self,
        function: &Function,
        row: usize,
        (at, to): (usize, usize),
    ) -> Option<Vec<Instruction>> {
        self.row = row;
        self.values.clear();
        self.angles.clear();
        self.moved.clear();
        (self.increments, self.has_time) = (Some(at), false);
        for instruction in &function.instructions {
            let value = self.instruction(instruction.op)?;
            self.values.push(value);
        }
        let stride = self.stride;
        let number = |pointer: Pointer, place: usize| Value::Number(pointer, place * stride);
        for (operand, (pointer, place)) in outputs(function) {
            let slope = self.read(operand);
            let before = number(pointer, to + place);
            let after =
                self.mul_add(Signs::default(), number(Pointer::Time, size_of_row(row) + 1), slope, before);
            self.instructions.push(Instruction::Store(after, pointer, (to + place) * stride));
        }
        if self.has_time {
            let later = self.add(number(Pointer::Time, row), number(Pointer::Time, size_of_row(row)));
            self.instructions.push(Instruction::Store(later, Pointer::Time, row * stride));
        }
        Some(std::mem::take(&mut self.instructions))
    }

    fn function(&mut self, function: &Function) -> Option<()> {
        for instruction in &function.instructions {
            let value = self.instruction(instruction.op)?;
            self.values.push(value);
        }
        for (operand, (pointer, place)) in outputs(function) {
            let value = self.read(operand);
            self.instructions.push(Instruction::Store(value, pointer, place * self.stride));
        }
        Some(())
    }

    fn new_temporary(&mut self) -> usize {
        self.n_temporaries += 1;
        self.n_temporaries - 1
    }

    fn bits(&mut self, bits: u64) -> Value {
        let constants = &mut self.constants;
        let place = *self.places.entry(bits).or_insert_with(|| {
            constants.push(Spread([bits; 8]));
            constants.len() - 1
        });
        Value::Number(Pointer::Constants, place * size_of::<Spread>())
    }

    fn constant(&mut self, x: f64) -> Value {
        self.bits(x.to_bits())
    }

    fn read(&mut self, operand: Operand) -> Value {
        let stride = self.stride;
        let number = |pointer: Pointer, place: usize| Value::Number(pointer, place * stride);
        match operand {
            Operand::Value(i) => self.values[i as usize],
            Operand::Constant(i) => self.constant(self.numbers[i as usize].value()),
            Operand::Param(i) => number(Pointer::Params, i as usize),
            Operand::Slot(i) => number(Pointer::Prepared, i as usize),
            // Inputs are behind the prepared numbers.
            Operand::Input(i) => number(Pointer::Prepared, self.n_slots + i as usize),
            Operand::Time => {
                self.has_time = true;
                number(Pointer::Time, self.row)
            }
            Operand::State(i) => match self.increments {
                None => number(Pointer::State, i as usize),
                Some(at) => {
                    let (own, by) = (number(Pointer::State, i as usize), at + i as usize);
                    if let Some(found) = self.moved.get(&i) {
                        return *found;
                    }
                    let moved = self.add(own, number(Pointer::Out, by));
                    self.moved.insert(i, moved);
                    moved
                }
            },
            Operand::Argument(i) => number(Pointer::Argument, i as usize),
            // The verifier allows these in results alone, which are not read here.
            Operand::Contracted(_) => unreachable!("a result of a contraction as an operand"),
        }
    }

    fn binary(&mut self, operation: Binary, a: Value, b: Value) -> Value {
        let to = self.new_temporary();
        self.instructions.push(Instruction::Binary(operation, to, [a, b]));
        Value::Temporary(to)
    }

    fn add(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Add, a, b)
    }

    fn sub(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Sub, a, b)
    }

    fn mul(&mut self, a: Value, b: Value) -> Value {
        self.binary(Binary::Mul, a, b)
    }

    fn neg(&mut self, a: Value) -> Value {
        let sign = self.constant(-0.0);
        self.binary(Binary::Xor, a, sign)
    }

    fn abs(&mut self, a: Value) -> Value {
        let all_but_sign = self.bits(!(1 << 63));
        self.binary(Binary::And, a, all_but_sign)
    }

    fn shift(&mut self, a: Value, bits: u8) -> Value {
        let to = self.new_temporary();
        self.instructions.push(Instruction::Shift(to, a, bits));
        Value::Temporary(to)
    }

    fn instruction(&mut self, op: Op) -> Option<Value> {
        Some(match op {
            Op::Add(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.add(a, b)
            }
            Op::Sub(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.sub(a, b)
            }
            Op::Mul(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.mul(a, b)
            }
            Op::Div(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.binary(Binary::Div, a, b)
            }
            Op::Neg(a) => {
                let a = self.read(a);
                self.neg(a)
            }
            Op::Recip(a) => {
                let (one, a) = (self.constant(1.0), self.read(a));
                self.binary(Binary::Div, one, a)
            }
            Op::Sqrt(a) => {
                let (to, a) = (self.new_temporary(), self.read(a));
                self.instructions.push(Instruction::Root(to, a));
                Value::Temporary(to)
            }
            Op::Function(Func::Sin, angle) => self.sine_and_cosine(angle).0,
            Op::Function(Func::Cos, angle) => self.sine_and_cosine(angle).1,
            Op::Function(Func::Abs, a) => {
                let a = self.read(a);
                self.abs(a)
            }
            Op::MulAdd(signs, a, b, c) => {
                let (a, b, c) = (self.read(a), self.read(b), self.read(c));
                self.mul_add(signs, a, b, c)
            }
            Op::Power(..)
            | Op::Function(..)
            | Op::Atan2(..)
            | Op::SumError(..)
            | Op::ProductError(..)
            | Op::CircleError(..) => return None,
        })
    }

    /// `+-(a * b) +- c`, rounded twice: a product of the opposite sign is one that is subtracted, bit for bit.
    fn mul_add(&mut self, signs: Signs, a: Value, b: Value, c: Value) -> Value {
        let product = self.mul(a, b);
        match (signs.product, signs.addend) {
            (false, false) => self.add(product, c),
            (false, true) => self.sub(product, c),
            (true, false) => self.sub(c, product),
            (true, true) => {
                let minus = self.neg(product);
                self.sub(minus, c)
            }
        }
    }

    fn sine_and_cosine(&mut self, angle: Operand) -> (Value, Value) {
        if let Some(found) = self.angles.get(&angle) {
            return *found;
        }
        let x = self.read(angle);
        let (size, bound) = (self.abs(x), self.constant(BOUND));
        let scratch = self.new_temporary();
        self.instructions.push(Instruction::Guard(scratch, [size, bound]));
        let recording = kernel();
        let mut values: Vec<Value> = Vec::with_capacity(recording.steps.len());
        for step in &recording.steps {
            let value = match *step {
                Step::Angle => x,
                Step::Constant(number) => self.constant(number),
                Step::Add(a, b) => self.add(values[a], values[b]),
                Step::Sub(a, b) => self.sub(values[a], values[b]),
                Step::Mul(a, b) => self.mul(values[a], values[b]),
                Step::Neg(a) => self.neg(values[a]),
                Step::MulAdd(a, b, c) => self.mul_add(Signs::default(), values[a], values[b], values[c]),
                Step::TurnedSine(n, s, c) => self.turned(values[n], [values[s], values[c]], values[n]),
                Step::TurnedCosine(n, s, c) => {
                    // One quarter turn more, in bits.
                    let one = self.bits(1);
                    let next = self.binary(Binary::AddBits, values[n], one);
                    self.turned(values[n], [values[c], values[s]], next)
                }
            };
            values.push(value);
        }
        let found = (values[recording.sine], values[recording.cosine]);
        self.angles.insert(angle, found);
        found
    }

    /// The first of two numbers where the number of quarter turns is even, otherwise the second; with the other sign
    /// where `signs` has the bit of two.
    fn turned(&mut self, turns: Value, [even, odd]: [Value; 2], signs: Value) -> Value {
        let (is_odd, to) = (self.shift(turns, 63), self.new_temporary());
        self.instructions.push(Instruction::Choose(to, [even, odd, is_odd]));
        let (moved, sign) = (self.shift(signs, 62), self.constant(-0.0));
        let sign = self.binary(Binary::And, moved, sign);
        self.binary(Binary::Xor, Value::Temporary(to), sign)
    }
}

/// Where the values are while code is written.
struct Allocation<'a> {
    assembler: &'a mut Assembler,
    /// Bytes of a register.
    n_bytes: usize,
    /// What each register has.
    contents: Vec<Option<usize>>,
    /// Numbers of vectors that nothing is written to, by their place among the values, behind the temporary ones.
    numbers: HashMap<(Pointer, usize), usize>,
    n_temporaries: usize,
    /// The register of each value.
    registers: Vec<Option<usize>>,
    /// The place of each value on the stack, once it has one.
    slots: Vec<Option<usize>>,
    n_slots: usize,
    /// Where each value is needed, the last place first.
    uses: Vec<Vec<usize>>,
}

/// Writes instructions with values in registers; how many of them are on the stack.
fn allocate(assembler: &mut Assembler, instructions: &[Instruction], n_temporaries: usize) -> usize {
    let mut uses: Vec<Vec<usize>> = vec![Vec::new(); n_temporaries];
    let mut numbers = HashMap::new();
    let written: Vec<usize> = instructions
        .iter()
        .filter_map(|instruction| match instruction {
            Instruction::Store(_, Pointer::Time, offset) => Some(*offset),
            _ => None,
        })
        .collect();
    for (at, instruction) in instructions.iter().enumerate().rev() {
        for operand in instruction.operands() {
            let k = match operand {
                Value::Temporary(k) => k,
                Value::Number(Pointer::Out | Pointer::Scalars, _) => continue,
                Value::Number(Pointer::Time, offset) if written.contains(&offset) => continue,
                Value::Number(pointer, offset) => *numbers.entry((pointer, offset)).or_insert_with(|| {
                    uses.push(Vec::new());
                    uses.len() - 1
                }),
            };
            uses[k].push(at);
        }
    }
    let encoding = assembler.encoding();
    let mut allocation = Allocation {
        n_bytes: encoding.n_bytes(),
        assembler,
        contents: vec![None; encoding.n_registers()],
        registers: vec![None; uses.len()],
        slots: vec![None; n_temporaries],
        numbers,
        n_temporaries,
        n_slots: 0,
        uses,
    };
    for (at, instruction) in instructions.iter().enumerate() {
        allocation.instruction(at, instruction);
    }
    allocation.n_slots
}

impl Allocation<'_> {
    fn instruction(&mut self, at: usize, instruction: &Instruction) {
        match *instruction {
            Instruction::Binary(operation, to, [a, b]) => {
                // A sum and a product of numbers do not depend on the order, but for the payload of NaN.
                let is_swapped =
                    operation.commutes() && self.register(a).is_none() && self.register(b).is_some();
                let (a, b) = if is_swapped { (b, a) } else { (a, b) };
                let first = self.loaded(a, &[b]);
                let second = self.place_near(b, at, &[first]);
                self.forget(at, instruction);
                let target = self.target(to, &[first, second]);
                self.assembler.binary(operation, target, first.register(), second);
            }
            Instruction::Root(to, a) => {
                let source = self.place(a);
                self.forget(at, instruction);
                let target = self.target(to, &[source]);
                self.assembler.root(target, source);
            }
            Instruction::Shift(to, a, bits) => {
                let source = self.loaded(a, &[]);
                self.forget(at, instruction);
                let target = self.target(to, &[source]);
                self.assembler.shift(target, source.register(), bits);
            }
            Instruction::Choose(to, [a, b, c]) => {
                let first = self.loaded(a, &[b, c]);
                let third = self.loaded_beside(c, &[b], &[first]);
                let second = self.place(b);
                self.forget(at, instruction);
                let target = self.target(to, &[first, second, third]);
                self.assembler.choose(target, first.register(), second, third.register());
            }
            Instruction::Store(a, pointer, offset) => {
                let source = self.loaded(a, &[]);
                self.forget(at, instruction);
                self.assembler.store(source.register(), Place::Number(pointer, offset));
            }
            Instruction::Guard(scratch, [a, b]) => {
                let first = self.loaded(a, &[b]);
                let second = self.place(b);
                self.forget(at, instruction);
                let target = self.target(scratch, &[first, second]);
                self.assembler.guard(target, first.register(), second);
                // Nobody reads the comparison again.
                self.release(scratch);
            }
        }
    }

    fn register(&self, value: Value) -> Option<usize> {
        match value {
            Value::Temporary(k) => self.registers[k],
            Value::Number(pointer, offset) => self.registers[*self.numbers.get(&(pointer, offset))?],
        }
    }

    /// Where a value is.
    fn place(&self, value: Value) -> Place {
        match value {
            Value::Number(pointer, offset) => match self.register(value) {
                Some(register) => Place::Register(register),
                None => Place::Number(pointer, offset),
            },
            Value::Temporary(k) => match (self.registers[k], self.slots[k]) {
                (Some(register), _) => Place::Register(register),
                (None, Some(slot)) => Place::Stack(slot * self.n_bytes),
                (None, None) => unreachable!("a value that is read before it is computed"),
            },
        }
    }

    /// The place of a value among all, unless it is a number that may change.
    fn index(&self, value: Value) -> Option<usize> {
        match value {
            Value::Temporary(k) => Some(k),
            Value::Number(pointer, offset) => self.numbers.get(&(pointer, offset)).copied(),
        }
    }

    /// Where an operand is; a number that is needed again goes to a register if one is free.
    fn place_near(&mut self, value: Value, at: usize, beside: &[Place]) -> Place {
        let place = self.place(value);
        let (Place::Number(..), Some(k)) = (place, self.index(value)) else { return place };
        let is_needed_again = self.uses[k].iter().any(|own| *own > at);
        let is_free = |r: &usize| self.contents[*r].is_none() && !beside.contains(&Place::Register(*r));
        let found = (0..self.contents.len()).find(is_free).filter(|_| is_needed_again);
        let Some(register) = found else { return place };
        self.assembler.load(register, place);
        self.registers[k] = Some(register);
        self.contents[register] = Some(k);
        Place::Register(register)
    }

    /// A value in a register, beside others that are kept where they are.
    fn loaded(&mut self, value: Value, keep: &[Value]) -> Place {
        self.loaded_beside(value, keep, &[])
    }

    fn loaded_beside(&mut self, value: Value, keep: &[Value], beside: &[Place]) -> Place {
        let place = self.place(value);
        if let Place::Register(_) = place {
            return place;
        }
        let mut kept: Vec<Place> = beside.to_vec();
        kept.extend(keep.iter().map(|value| self.place(*value)));
        let register = self.free(&kept);
        self.assembler.load(register, place);
        if let Some(k) = self.index(value) {
            self.registers[k] = Some(register);
            self.contents[register] = Some(k);
        }
        Place::Register(register)
    }

    /// A register for a result, which may be that of an operand that is not needed any more.
    fn target(&mut self, to: usize, operands: &[Place]) -> usize {
        let is_free = |place: &&Place| matches!(place, Place::Register(r) if self.contents[*r].is_none());
        let register = match operands.iter().find(is_free) {
            Some(Place::Register(register)) => *register,
            _ => self.free(operands),
        };
        self.registers[to] = Some(register);
        self.contents[register] = Some(to);
        register
    }

    /// A register that is free, or whose value is needed last among the others that are not kept: of a number, which is
    /// in memory anyway, or of another value, which goes to the stack.
    fn free(&mut self, kept: &[Place]) -> usize {
        let is_kept = |register: usize| kept.contains(&Place::Register(register));
        let unused = (0..self.contents.len()).find(|r| self.contents[*r].is_none() && !is_kept(*r));
        if let Some(register) = unused {
            return register;
        }
        let next_use = |register: &usize| {
            let of = |k: usize| self.uses[k].last().copied().unwrap_or(usize::MAX);
            self.contents[*register].map_or(usize::MAX, of)
        };
        // Instructions have three operands, and there are more registers.
        let is_number = |r: &usize| self.contents[*r].is_some_and(|k| k >= self.n_temporaries);
        let found =
            (0..self.contents.len()).filter(|r| !is_kept(*r)).max_by_key(|r| (is_number(r), next_use(r)));
        let register = found.expect("a register");
        if let Some(k) = self.contents[register].take() {
            self.registers[k] = None;
            if k < self.n_temporaries && self.slots[k].is_none() {
                self.slots[k] = Some(self.n_slots);
                self.n_slots += 1;
                self.assembler.store(register, self.place(Value::Temporary(k)));
            }
        }
        register
    }

    /// Forgets the operands of an instruction that no later one needs.
    fn forget(&mut self, at: usize, instruction: &Instruction) {
        for operand in instruction.operands() {
            let Some(k) = self.index(operand) else { continue };
            while self.uses[k].last() == Some(&at) {
                self.uses[k].pop();
            }
            if self.uses[k].is_empty() {
                self.release(k);
            }
        }
    }

    fn release(&mut self, k: usize) {
        if let Some(register) = self.registers[k].take() {
            self.contents[register] = None;
        }
    }
}
