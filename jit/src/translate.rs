//! Functions of a program as functions of Cranelift: the same operations in the same order, on one number or on two
//! side by side.
//!
//! Deliberately does not know: how code is made runnable, tables of products (the caller runs through them).

use std::collections::HashMap;

use cranelift_codegen::ir::{
    self, AbiParam, Block, BlockArg, InstBuilder, MemFlags, Type, Value, condcodes::FloatCC, types,
};
use cranelift_frontend::{FuncInstBuilder, FunctionBuilder, FunctionBuilderContext};
use hamel_expr::Func;
use hamel_program::program::{Constant, Function, Instruction, Op, Operand, Program, Signs};
use hamel_runtime::math::kernel::{BOUND, FUSED};

use crate::calls::Call;
use crate::kernel::{Step, kernel};
use crate::lanes::place_of;

/// How many numbers an operand is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Width {
    /// One number; numbers of a vector follow one another.
    One,
    /// Two lanes of so many: the next number of a vector is as many further.
    PairOf(usize),
}

impl Width {
    /// Where the code of this width is among the code of a function.
    pub(crate) fn place(self) -> usize {
        match self {
            Width::One => 0,
            Width::PairOf(lanes) => 1 + place_of(lanes),
        }
    }

    fn number(self) -> Type {
        match self {
            Width::One => types::F64,
            Width::PairOf(_) => types::F64X2,
        }
    }

    fn bits(self) -> Type {
        match self {
            Width::One => types::I64,
            Width::PairOf(_) => types::I64X2,
        }
    }

    /// Bytes from a number of a vector to the next.
    fn stride(self) -> usize {
        match self {
            Width::One => size_of::<f64>(),
            Width::PairOf(lanes) => lanes * size_of::<f64>(),
        }
    }
}

/// Pointers that a compiled function takes, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Pointer {
    State,
    Out,
    Prepared,
    Constants,
    Params,
    Time,
    Argument,
    Scalars,
}

/// Number of pointers.
pub(crate) const N_POINTERS: usize = 8;

/// The constants of a function, each as often as [`Width::PairOf`] needs, which [`Width::One`] reads as well.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub(crate) struct Twice(#[expect(dead_code, reason = "compiled code reads it")] [f64; 2]);

/// Constants by their place, in the order of first use.
#[derive(Debug, Default)]
pub(crate) struct Constants {
    /// In order of their places.
    pub(crate) values: Vec<Twice>,
    places: HashMap<u64, usize>,
}

impl Constants {
    fn place(&mut self, x: f64) -> usize {
        let values = &mut self.values;
        *self.places.entry(x.to_bits()).or_insert_with(|| {
            values.push(Twice([x; 2]));
            values.len() - 1
        })
    }
}

/// Functions that code calls, imported on first use.
pub(crate) trait Imports {
    /// The function as the function that is being compiled knows it.
    fn import(&mut self, call: Call, function: &mut ir::Function) -> ir::FuncRef;
}

/// A function that is being written.
struct Writer<'a, 'b, I> {
    builder: FunctionBuilder<'b>,
    imports: &'a mut I,
    constants: &'a mut Constants,
    numbers: &'a [Constant],
    n_slots: usize,
    width: Width,
    pointers: Vec<Value>,
    values: Vec<Value>,
    /// Sines and cosines of angles that there are.
    pairs: HashMap<Operand, (Value, Value)>,
}

/// Writes a function of a program.
pub(crate) fn translate<I: Imports>(
    function: &Function,
    program: &Program,
    width: Width,
    into: (&mut ir::Function, &mut FunctionBuilderContext),
    pointer: Type,
    imports: &mut I,
) -> Constants {
    let (target, context) = into;
    target.signature.params.extend([AbiParam::new(pointer); N_POINTERS]);
    let mut constants = Constants::default();
    let mut builder = FunctionBuilder::new(target, context);
    let entry = builder.create_block();
    builder.append_block_params_for_function_params(entry);
    builder.switch_to_block(entry);
    let pointers = builder.block_params(entry).to_vec();
    let mut writer = Writer {
        builder,
        imports,
        constants: &mut constants,
        numbers: &program.constants,
        n_slots: program.prepare.slots.len(),
        width,
        pointers,
        values: Vec::new(),
        pairs: HashMap::new(),
    };
    writer.function(function);
    writer.builder.ins().return_(&[]);
    writer.builder.seal_all_blocks();
    writer.builder.finalize();
    constants
}

/// Where values go as soon as they are known: the positions among the results and among the scalars, by instruction.
fn destinations(function: &Function) -> HashMap<u32, Vec<(Pointer, usize)>> {
    let mut known: HashMap<u32, Vec<(Pointer, usize)>> = HashMap::new();
    for (operand, destination) in outputs(function) {
        if let Operand::Value(i) = operand {
            known.entry(i).or_default().push(destination);
        }
    }
    known
}

/// What a function writes where, but for results of contractions.
pub(crate) fn outputs(function: &Function) -> impl Iterator<Item = (Operand, (Pointer, usize))> + '_ {
    let results = function.results.iter().enumerate().map(|(k, (_, o))| (*o, (Pointer::Out, k)));
    let scalars = function.scalars.iter().enumerate().map(|(k, o)| (*o, (Pointer::Scalars, k)));
    results.chain(scalars).filter(|(o, _)| !matches!(o, Operand::Contracted(_)))
}

impl<'b, I: Imports> Writer<'_, 'b, I> {
    fn function(&mut self, function: &Function) {
        let destinations = destinations(function);
        for (k, instruction) in function.instructions.iter().enumerate() {
            let value = self.instruction(&function.instructions, k, instruction.op);
            self.values.push(value);
            for (pointer, place) in destinations.get(&(k as u32)).into_iter().flatten() {
                self.store(value, *pointer, *place);
            }
        }
        for (operand, (pointer, place)) in outputs(function) {
            if !matches!(operand, Operand::Value(_)) {
                let value = self.read(operand);
                self.store(value, pointer, place);
            }
        }
    }

    fn ins<'s>(&'s mut self) -> FuncInstBuilder<'s, 'b> {
        self.builder.ins()
    }

    fn load(&mut self, pointer: Pointer, offset: usize) -> Value {
        let flags = MemFlags::trusted().with_readonly();
        let address = self.pointers[pointer as usize];
        let number = self.width.number();
        // Offsets are places of numbers in programs, whose places are 32 bits wide and far fewer.
        self.ins().load(number, flags, address, offset as i32)
    }

    fn store(&mut self, value: Value, pointer: Pointer, place: usize) {
        let address = self.pointers[pointer as usize];
        let offset = (place * self.width.stride()) as i32;
        self.ins().store(MemFlags::trusted(), value, address, offset);
    }

    fn constant(&mut self, x: f64) -> Value {
        let place = self.constants.place(x);
        self.load(Pointer::Constants, place * size_of::<Twice>())
    }

    fn read(&mut self, operand: Operand) -> Value {
        let number = |place: u32| place as usize * self.width.stride();
        match operand {
            Operand::Value(i) => self.values[i as usize],
            Operand::Constant(i) => self.constant(self.numbers[i as usize].value()),
            Operand::Param(i) => self.load(Pointer::Params, number(i)),
            Operand::Slot(i) => self.load(Pointer::Prepared, number(i)),
            // Inputs are behind the prepared numbers.
            Operand::Input(i) => self.load(Pointer::Prepared, self.n_slots * self.width.stride() + number(i)),
            Operand::Time => self.load(Pointer::Time, 0),
            Operand::State(i) => self.load(Pointer::State, number(i)),
            Operand::Argument(i) => self.load(Pointer::Argument, number(i)),
            // The verifier allows these in results alone, which are not read here.
            Operand::Contracted(_) => unreachable!("a result of a contraction as an operand"),
        }
    }

    fn instruction(&mut self, instructions: &[Instruction], k: usize, op: Op) -> Value {
        match op {
            Op::Add(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.ins().fadd(a, b)
            }
            Op::Sub(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.ins().fsub(a, b)
            }
            Op::Mul(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.ins().fmul(a, b)
            }
            Op::Div(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.ins().fdiv(a, b)
            }
            Op::Neg(a) => {
                let a = self.read(a);
                self.ins().fneg(a)
            }
            Op::Recip(a) => {
                let (one, a) = (self.constant(1.0), self.read(a));
                self.ins().fdiv(one, a)
            }
            Op::Sqrt(a) => {
                let a = self.read(a);
                self.ins().sqrt(a)
            }
            Op::Power(a, q) => {
                let (a, q) = (self.read(a), self.read(q));
                let logarithm = self.call(Call::Ln, &[a]);
                let exponent = self.ins().fmul(q, logarithm);
                self.call(Call::Exp, &[exponent])
            }
            Op::Function(Func::Sin, angle) => self.sine_and_cosine(instructions, k, angle).0,
            Op::Function(Func::Cos, angle) => self.sine_and_cosine(instructions, k, angle).1,
            Op::Function(Func::Abs, a) => {
                let a = self.read(a);
                self.ins().fabs(a)
            }
            Op::Function(function @ (Func::Stumpff(k) | Func::Turn(k)), z) => {
                let (k, z) = (self.constant(k.into()), self.read(z));
                self.call(Call::of(function), &[k, z])
            }
            Op::Function(function, a) => {
                let a = self.read(a);
                self.call(Call::of(function), &[a])
            }
            Op::Atan2(y, x) => {
                let (y, x) = (self.read(y), self.read(x));
                self.call(Call::Atan2, &[y, x])
            }
            Op::SumError(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.sum_error(a, b)
            }
            Op::ProductError(a, b) => {
                let (a, b) = (self.read(a), self.read(b));
                self.product_error(a, b)
            }
            Op::CircleError(sine, cosine) => {
                let (sine, cosine) = (self.read(sine), self.read(cosine));
                self.circle_error(sine, cosine)
            }
            Op::MulAdd(signs, a, b, c) => {
                let (a, b, c) = (self.read(a), self.read(b), self.read(c));
                self.mul_add(signs, a, b, c)
            }
        }
    }

    /// The operations of the runtime's `Real::sum_error`.
    fn sum_error(&mut self, a: Value, b: Value) -> Value {
        let sum = self.ins().fadd(a, b);
        let part = self.ins().fsub(sum, a);
        let rest = self.ins().fsub(sum, part);
        let (left, right) = (self.ins().fsub(a, rest), self.ins().fsub(b, part));
        self.ins().fadd(left, right)
    }

    /// The operations of the runtime's `Real::product_error`.
    fn product_error(&mut self, x: Value, y: Value) -> Value {
        let product = self.ins().fmul(x, y);
        let (a, c) = (self.upper_bits(x), self.upper_bits(y));
        let (b, d) = (self.ins().fsub(x, a), self.ins().fsub(y, c));
        let upper = self.ins().fmul(a, c);
        let mut sum = self.ins().fsub(upper, product);
        for (p, q) in [(a, d), (b, c), (b, d)] {
            let term = self.ins().fmul(p, q);
            sum = self.ins().fadd(sum, term);
        }
        sum
    }

    /// The operations of the runtime's `Real::circle_error`.
    fn circle_error(&mut self, sine: Value, cosine: Value) -> Value {
        let (one, half) = (self.constant(1.0), self.constant(0.5));
        let (p, q) = (self.ins().fmul(sine, sine), self.ins().fmul(cosine, cosine));
        let first = self.ins().fsub(one, q);
        let (minus_q, minus_p) = (self.ins().fneg(q), self.ins().fneg(p));
        let (of_q, of_p) = (self.sum_error(one, minus_q), self.sum_error(first, minus_p));
        let rest = self.ins().fadd(of_q, of_p);
        let (of_sine, of_cosine) = (self.product_error(sine, sine), self.product_error(cosine, cosine));
        let errors = self.ins().fadd(of_sine, of_cosine);
        let (difference, more) = (self.ins().fsub(first, p), self.ins().fsub(rest, errors));
        let sum = self.ins().fadd(difference, more);
        self.ins().fmul(sum, half)
    }

    /// The number without the lower 27 of its bits.
    fn upper_bits(&mut self, x: Value) -> Value {
        let (bits, number, flags) = (self.width.bits(), self.width.number(), MemFlags::new());
        let mask = self.ins().iconst(types::I64, !0x7ff_ffff);
        let mask = match self.width {
            Width::One => mask,
            Width::PairOf(_) => self.ins().splat(bits, mask),
        };
        let x = self.ins().bitcast(bits, flags, x);
        let upper = self.ins().band(x, mask);
        self.ins().bitcast(number, flags, upper)
    }

    /// `+-(a * b) +- c`.
    ///
    /// Rounded twice, a product of the opposite sign is one that is subtracted, bit for bit.
    fn mul_add(&mut self, signs: Signs, a: Value, b: Value, c: Value) -> Value {
        if FUSED {
            let a = if signs.product { self.ins().fneg(a) } else { a };
            let c = if signs.addend { self.ins().fneg(c) } else { c };
            return self.ins().fma(a, b, c);
        }
        let product = self.ins().fmul(a, b);
        match (signs.product, signs.addend) {
            (false, false) => self.ins().fadd(product, c),
            (false, true) => self.ins().fsub(product, c),
            (true, false) => self.ins().fsub(c, product),
            (true, true) => {
                let minus = self.ins().fneg(product);
                self.ins().fsub(minus, c)
            }
        }
    }

    /// A function of the runtime, lane by lane.
    fn call(&mut self, call: Call, arguments: &[Value]) -> Value {
        let function = self.imports.import(call, self.builder.func);
        let one = |builder: &mut FunctionBuilder<'_>, arguments: &[Value]| {
            let call = builder.ins().call(function, arguments);
            builder.inst_results(call)[0]
        };
        match self.width {
            Width::One => one(&mut self.builder, arguments),
            Width::PairOf(_) => {
                let lanes = [0, 1].map(|lane| {
                    let own: Vec<Value> =
                        arguments.iter().map(|a| self.ins().extractlane(*a, lane)).collect();
                    one(&mut self.builder, &own)
                });
                self.side_by_side(lanes)
            }
        }
    }

    /// Two numbers as one pair.
    fn side_by_side(&mut self, [first, second]: [Value; 2]) -> Value {
        let pair = self.ins().scalar_to_vector(types::F64X2, first);
        self.ins().insertlane(pair, second, 1)
    }

    /// Sine and cosine of an angle; with those of the next angle where both are needed anyway and it is known, because
    /// two numbers side by side take the time of one.
    fn sine_and_cosine(&mut self, instructions: &[Instruction], k: usize, angle: Operand) -> (Value, Value) {
        if let Some(found) = self.pairs.get(&angle) {
            return *found;
        }
        let other = match self.width {
            Width::One => self.next_angle(instructions, k, angle),
            Width::PairOf(_) => None,
        };
        let x = self.read(angle);
        let Some(other) = other else {
            let found = self.guarded(self.width, x);
            self.pairs.insert(angle, found);
            return found;
        };
        let y = self.read(other);
        let both = self.side_by_side([x, y]);
        let (sines, cosines) = self.guarded(Width::PairOf(2), both);
        let mut lane = |pair, lane| self.ins().extractlane(pair, lane);
        let (first, second) = ((lane(sines, 0), lane(cosines, 0)), (lane(sines, 1), lane(cosines, 1)));
        self.pairs.insert(angle, first);
        self.pairs.insert(other, second);
        first
    }

    /// Another angle whose sine or cosine a later instruction takes, and that is known before the one at `k`.
    fn next_angle(&self, instructions: &[Instruction], k: usize, angle: Operand) -> Option<Operand> {
        instructions[k + 1..].iter().find_map(|instruction| match instruction.op {
            Op::Function(Func::Sin | Func::Cos, other) => {
                let is_known = !matches!(other, Operand::Value(v) if v as usize >= k);
                (other != angle && is_known && !self.pairs.contains_key(&other)).then_some(other)
            }
            _ => None,
        })
    }

    /// Sine and cosine: the kernel's up to its bound, otherwise the runtime's.
    fn guarded(&mut self, width: Width, x: Value) -> (Value, Value) {
        let number = width.number();
        let [large, small, done] = [(); 3].map(|()| self.builder.create_block());
        self.builder.set_cold_block(large);
        let (sine, cosine) =
            (self.builder.append_block_param(done, number), self.builder.append_block_param(done, number));
        let size = self.ins().fabs(x);
        let bound = self.constant_of(width, BOUND);
        let beyond = self.ins().fcmp(FloatCC::GreaterThan, size, bound);
        let is_large = match width {
            Width::One => beyond,
            Width::PairOf(_) => self.ins().vany_true(beyond),
        };
        self.ins().brif(is_large, large, &[], small, &[]);

        self.builder.switch_to_block(small);
        let found = self.kernel(width, x);
        self.jump(done, found);

        self.builder.switch_to_block(large);
        let before = std::mem::replace(&mut self.width, width);
        let found = (self.call(Call::Sin, &[x]), self.call(Call::Cos, &[x]));
        self.width = before;
        self.jump(done, found);

        self.builder.switch_to_block(done);
        (sine, cosine)
    }

    fn jump(&mut self, to: Block, (sine, cosine): (Value, Value)) {
        self.ins().jump(to, &[BlockArg::Value(sine), BlockArg::Value(cosine)]);
    }

    fn constant_of(&mut self, width: Width, x: f64) -> Value {
        let before = std::mem::replace(&mut self.width, width);
        let value = self.constant(x);
        self.width = before;
        value
    }

    /// The runtime's own operations.
    fn kernel(&mut self, width: Width, x: Value) -> (Value, Value) {
        let recording = kernel();
        let mut values: Vec<Value> = Vec::with_capacity(recording.steps.len());
        for step in &recording.steps {
            let value = match *step {
                Step::Angle => x,
                Step::Constant(number) => self.constant_of(width, number),
                Step::Add(a, b) => self.ins().fadd(values[a], values[b]),
                Step::Sub(a, b) => self.ins().fsub(values[a], values[b]),
                Step::Mul(a, b) => self.ins().fmul(values[a], values[b]),
                Step::Neg(a) => self.ins().fneg(values[a]),
                Step::MulAdd(a, b, c) => self.mul_add(Signs::default(), values[a], values[b], values[c]),
                Step::TurnedSine(n, s, c) => self.turned(width, values[n], [values[s], values[c]], 0),
                Step::TurnedCosine(n, s, c) => self.turned(width, values[n], [values[c], values[s]], 1),
            };
            values.push(value);
        }
        (values[recording.sine], values[recording.cosine])
    }

    /// The first of two numbers where the number of quarter turns is even, otherwise the second; with the other sign
    /// where the number of quarter turns and `more` have the bit of two.
    fn turned(&mut self, width: Width, turns: Value, [even, odd]: [Value; 2], more: i64) -> Value {
        let bits = width.bits();
        let flags = MemFlags::new();
        let (turns, even, odd) = (
            self.ins().bitcast(bits, flags, turns),
            self.ins().bitcast(bits, flags, even),
            self.ins().bitcast(bits, flags, odd),
        );
        // All bits of the lowest one.
        let lowest = self.ins().ishl_imm(turns, 63);
        let is_odd = match width {
            Width::One => self.ins().sshr_imm(lowest, 63),
            // No shift of two signed numbers of 64 bits before AVX-512.
            Width::PairOf(_) => {
                let one = self.ins().ushr_imm(lowest, 63);
                self.ins().ineg(one)
            }
        };
        let difference = self.ins().bxor(even, odd);
        let difference = self.ins().band(difference, is_odd);
        let chosen = self.ins().bxor(even, difference);
        let turns = match (more, width) {
            (0, _) => turns,
            (_, Width::One) => self.ins().iadd_imm(turns, more),
            (_, Width::PairOf(_)) => {
                let more = self.ins().iconst(types::I64, more);
                let more = self.ins().splat(bits, more);
                self.ins().iadd(turns, more)
            }
        };
        // The bit of two as the sign.
        let sign = self.ins().ushr_imm(turns, 1);
        let sign = self.ins().ishl_imm(sign, 63);
        let chosen = self.ins().bxor(chosen, sign);
        self.ins().bitcast(width.number(), flags, chosen)
    }
}
