//! Runs a program with the very operations that emitted code performs, so that results agree bit for bit.
//!
//! Does not know: what a function is for, how emitted code is written.

use std::fmt;

use hamel_runtime::{Real, convolve};

use super::ir::{Constant, Function, Instruction, Literal, Op, Operand, Prepare, Program};
use super::report::Report;
use super::role::Role;
use super::table::{Factors, Products, Table};
use hamel_expr::Relation;

/// A condition on the parameters that does not hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ViolatedCondition {
    /// The condition as the model words it, or `<param> is finite`.
    pub condition: String,
    /// What it means; may be empty.
    pub meaning: String,
}

impl fmt::Display for ViolatedCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} does not hold", self.condition)?;
        if self.meaning.is_empty() { Ok(()) } else { write!(f, ": {}", self.meaning) }
    }
}

impl std::error::Error for ViolatedCondition {}

impl Constant {
    /// The constant as a scalar.
    pub fn value<R: Real>(&self) -> R {
        match self.literal() {
            Literal::Zero => R::ZERO,
            Literal::One => R::ONE,
            Literal::Number(x) => R::from_f64(x),
            Literal::Ratio(p, q) => R::ratio(p, q),
            Literal::Pi => R::from_f64(std::f64::consts::PI),
        }
    }
}

/// Whoever evaluates the functions of a program: the [`Program`] itself, operation by operation, or machine code of the
/// same operations. All have the same bits.
pub trait Run<R>: fmt::Debug + Sync {
    /// What is run.
    fn program(&self) -> &Program;

    /// What [`Program::prepare`] returns.
    ///
    /// # Errors
    /// As [`Program::prepare`].
    ///
    /// # Panics
    /// As [`Program::prepare`].
    fn prepare(&self, params: &[R]) -> Result<Vec<R>, ViolatedCondition>
    where
        R: Real,
    {
        self.program().prepare(params)
    }

    /// [`prepare`](Self::prepare) into a vector that is there.
    ///
    /// # Errors
    /// As [`Program::prepare`]; the vector is then of no account.
    ///
    /// # Panics
    /// As [`Program::prepare`].
    fn prepare_into(&self, params: &[R], prepared: &mut Vec<R>) -> Result<(), ViolatedCondition>
    where
        R: Real,
    {
        *prepared = self.prepare(params)?;
        Ok(())
    }

    /// Calls a function at a point.
    ///
    /// # Shapes
    /// params: \[n_params\], prepared: what [`Program::prepare`] returned, with other values for inputs where they
    /// have others, state: \[n_state\], argument: \[n_argument\], out: \[n_results\].
    ///
    /// # Panics
    /// When the function does not exist or a size is wrong.
    fn run_at(&self, function_idx: usize, params: &[R], prepared: &[R], point: Point<'_, R>, out: &mut [R]);

    /// [`convolve`], in whatever registers: with the same bits.
    ///
    /// # Panics
    /// As [`convolve`].
    fn convolve(&self, rows: [&[R]; 2], sums: &mut [R])
    where
        R: Real,
    {
        convolve(rows, sums);
    }
}

impl<R: Real> Run<R> for Program {
    fn program(&self) -> &Program {
        self
    }

    fn run_at(&self, function_idx: usize, params: &[R], prepared: &[R], point: Point<'_, R>, out: &mut [R]) {
        Program::run_at(self, function_idx, params, prepared, point, out);
    }
}

/// Where a function is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a, R> {
    /// Time.
    pub t: R,
    /// The state.
    pub state: &'a [R],
    /// The vector that the function takes besides, empty for most.
    pub argument: &'a [R],
}

struct Memory<'a, R> {
    constants: Vec<R>,
    params: &'a [R],
    prepared: &'a [R],
    inputs: &'a [R],
    t: R,
    state: &'a [R],
    argument: &'a [R],
    values: Vec<R>,
    /// Results of contractions.
    contracted: Vec<R>,
}

impl<R> Point<'_, R> {
    /// A point in the place of the state alone.
    pub(super) fn of_state(t: R, state: &[R]) -> Point<'_, R> {
        Point { t, state, argument: &[] }
    }
}

impl<R: Real> Memory<'_, R> {
    fn read(&self, operand: Operand) -> R {
        match operand {
            Operand::Value(i) => self.values[i as usize],
            Operand::Constant(i) => self.constants[i as usize],
            Operand::Param(i) => self.params[i as usize],
            Operand::Slot(i) => self.prepared[i as usize],
            Operand::Time => self.t,
            Operand::Input(i) => self.inputs[i as usize],
            Operand::State(i) => self.state[i as usize],
            Operand::Argument(i) => self.argument[i as usize],
            Operand::Contracted(i) => self.contracted[i as usize],
        }
    }

    fn run(&mut self, instructions: &[Instruction]) {
        self.values.reserve(instructions.len());
        for instruction in instructions {
            let value = match instruction.op {
                Op::Add(a, b) => self.read(a) + self.read(b),
                Op::Sub(a, b) => self.read(a) - self.read(b),
                Op::Mul(a, b) => self.read(a) * self.read(b),
                Op::Div(a, b) => self.read(a) / self.read(b),
                Op::Neg(a) => -self.read(a),
                Op::Recip(a) => self.read(a).recip(),
                Op::Sqrt(a) => self.read(a).sqrt(),
                Op::Power(a, q) => (self.read(q) * self.read(a).ln()).exp(),
                Op::Function(f, a) => f.of(self.read(a)),
                Op::Atan2(y, x) => self.read(y).atan2(self.read(x)),
                Op::SumError(a, b) => self.read(a).sum_error(self.read(b)),
                Op::ProductError(a, b) => self.read(a).product_error(self.read(b)),
                Op::CircleError(a, b) => self.read(a).circle_error(self.read(b)),
                Op::MulAdd(signs, a, b, c) => {
                    let signed = |negative, x: R| if negative { -x } else { x };
                    let (a, c) = (signed(signs.product, self.read(a)), signed(signs.addend, self.read(c)));
                    a.mul_add(self.read(b), c)
                }
            };
            self.values.push(value);
        }
    }
}

impl Function {
    /// The results of earlier contractions that are factors of one, among those of all.
    pub(super) fn results_of_contraction<'r, R>(&self, k: u32, contracted: &'r [R]) -> &'r [R] {
        let start = self.start_of_contraction(k as usize);
        &contracted[start..start + self.contractions[k as usize].n_results]
    }

    /// The results of all contractions at a point, from the scalars there.
    fn contract<R: Real>(&self, tables: &[Table], point: Point<'_, R>, scalars: &[R]) -> Vec<R> {
        let mut contracted = Vec::new();
        for contraction in &self.contractions {
            let mut sums = vec![R::ZERO; contraction.n_results];
            for Products { table, left, right } in &contraction.terms {
                let factors = |factors: &Factors| match factors {
                    Factors::State => point.state,
                    Factors::Argument => point.argument,
                    Factors::Scalars => scalars,
                    Factors::Contraction(k) => self.results_of_contraction(*k, &contracted),
                };
                tables[*table as usize].products().add_to(factors(left), factors(right), &mut sums);
            }
            contracted.extend(sums);
        }
        contracted
    }
}

impl Program {
    /// Computes the prepared slots, and behind them puts the inputs, held at their defaults.
    ///
    /// # Errors
    /// The first condition on the parameters that does not hold; finiteness comes first, in the order of parameters.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare<R: Real>(&self, params: &[R]) -> Result<Vec<R>, ViolatedCondition> {
        self.check_finite(params)?;
        let constants = self.constants.iter().map(Constant::value).collect();
        let mut memory = Memory {
            constants,
            params,
            prepared: &[],
            inputs: &[],
            t: R::ZERO,
            state: &[],
            argument: &[],
            values: Vec::new(),
            contracted: Vec::new(),
        };
        memory.run(&self.prepare.instructions);
        self.check_conditions(|k| {
            let condition = &self.prepare.conditions[k];
            [condition.greater, condition.less].map(|side| memory.read(side))
        })?;
        let slots = self.prepare.slots.iter().map(|slot| memory.values[slot.value as usize]);
        Ok(slots.chain(self.inputs.iter().map(|(_, held)| held.value())).collect())
    }

    /// The program whose one function computes the slots and then both sides of each condition: others compile it as
    /// they compile any function.
    pub fn preparation(&self) -> Program {
        let slots = self.prepare.slots.iter().map(|slot| Operand::Value(slot.value));
        let sides = self.prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
        let results = slots.chain(sides).enumerate().map(|(k, value)| (format!("r{k}"), value)).collect();
        let function = Function {
            role: Role::OfVariables("prepare".to_owned()),
            instructions: self
                .prepare
                .instructions
                .iter()
                .map(|i| Instruction { op: i.op, section: 0, name: None })
                .collect(),
            results,
            ..Function::default()
        };
        Program {
            params: self.params.clone(),
            time: self.time.clone(),
            inputs: Vec::new(),
            state: Vec::new(),
            constants: self.constants.clone(),
            tables: Vec::new(),
            sections: vec!["results".to_owned()],
            prepare: Prepare::default(),
            functions: vec![function],
            report: Report::default(),
        }
    }

    /// Writes what [`Program::prepare`] returns, by a [`Run`] of the [`Program::preparation`] of this program;
    /// allocates nothing once the vector is long enough.
    ///
    /// # Errors
    /// As [`Program::prepare`].
    ///
    /// # Panics
    /// As [`Program::prepare`].
    pub fn prepare_by<R: Real>(
        &self,
        run: &dyn Run<R>,
        params: &[R],
        prepared: &mut Vec<R>,
    ) -> Result<(), ViolatedCondition> {
        self.check_finite(params)?;
        let n_slots = self.prepare.slots.len();
        prepared.clear();
        prepared.resize(n_slots + 2 * self.prepare.conditions.len(), R::ZERO);
        run.run_at(0, params, &[], Point::of_state(R::ZERO, &[]), prepared);
        self.check_conditions(|k| [prepared[n_slots + 2 * k], prepared[n_slots + 2 * k + 1]])?;
        prepared.truncate(n_slots);
        prepared.extend(self.inputs.iter().map(|(_, held)| held.value::<R>()));
        Ok(())
    }

    fn check_finite<R: Real>(&self, params: &[R]) -> Result<(), ViolatedCondition> {
        assert_eq!(params.len(), self.params.len(), "number of parameters");
        match params.iter().zip(&self.params).find(|(value, _)| !value.all_finite()) {
            Some((_, name)) => {
                Err(ViolatedCondition { condition: format!("{name} is finite"), meaning: String::new() })
            }
            None => Ok(()),
        }
    }

    /// Checks the conditions, of which `sides` tells the greater and the smaller side.
    fn check_conditions<R: Real>(&self, sides: impl Fn(usize) -> [R; 2]) -> Result<(), ViolatedCondition> {
        let holds = |k: usize| {
            let [greater, less] = sides(k);
            match self.prepare.conditions[k].relation {
                Relation::Greater => greater.all_gt(less),
                Relation::GreaterEqual => greater.all_ge(less),
                Relation::NotEqual => greater.all_ne(less),
            }
        };
        match (0..self.prepare.conditions.len()).find(|k| !holds(*k)) {
            Some(k) => {
                let condition = &self.prepare.conditions[k];
                Err(ViolatedCondition {
                    condition: condition.text.clone(),
                    meaning: condition.meaning.clone(),
                })
            }
            None => Ok(()),
        }
    }

    /// Number of what [`Program::prepare`] returns.
    pub fn n_prepared(&self) -> usize {
        self.prepare.slots.len() + self.inputs.len()
    }

    /// Calls a function of time and state.
    ///
    /// # Shapes
    /// params: \[n_params\], prepared: what [`Program::prepare`] returned, state: \[n_state\], out: \[n_results\].
    ///
    /// # Panics
    /// When the function does not exist or a size is wrong.
    pub fn run<R: Real>(
        &self,
        function_idx: usize,
        params: &[R],
        prepared: &[R],
        t: R,
        state: &[R],
        out: &mut [R],
    ) {
        self.run_at(function_idx, params, prepared, Point::of_state(t, state), out);
    }

    /// Calls a function at a point.
    ///
    /// # Shapes
    /// As [`Program::run`]; argument: \[n_argument\].
    ///
    /// # Panics
    /// When the function does not exist or a size is wrong.
    pub fn run_at<R: Real>(
        &self,
        function_idx: usize,
        params: &[R],
        prepared: &[R],
        point: Point<'_, R>,
        out: &mut [R],
    ) {
        let function = &self.functions[function_idx];
        let contract = |scalars: &[R]| function.contract(&self.tables, point, scalars);
        self.run_contracting(function_idx, (params, prepared), point, out, contract);
    }

    /// Runs through the tables of a function whose straight-line code has run, and writes the results that are
    /// contractions.
    ///
    /// # Shapes
    /// scalars: those of the function, \[n_scalars\]; out: \[n_results\].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn run_tables<R: Real>(
        &self,
        function: &Function,
        point: Point<'_, R>,
        scalars: &[R],
        out: &mut [R],
    ) {
        let contracted = function.contract(&self.tables, point, scalars);
        for (slot, (_, operand)) in out.iter_mut().zip(&function.results) {
            if let Operand::Contracted(i) = operand {
                *slot = contracted[*i as usize];
            }
        }
    }

    /// Calls a function at a point; `contract` takes its scalars to the results of all of its contractions.
    ///
    /// # Panics
    /// As [`Program::run_at`].
    pub(super) fn run_contracting<R: Real>(
        &self,
        function_idx: usize,
        (params, prepared): (&[R], &[R]),
        point: Point<'_, R>,
        out: &mut [R],
        contract: impl FnOnce(&[R]) -> Vec<R>,
    ) {
        let Point { t, state, argument } = point;
        let function = &self.functions[function_idx];
        assert_eq!(params.len(), self.params.len(), "number of parameters");
        assert_eq!(prepared.len(), self.n_prepared(), "number of prepared values");
        assert_eq!(state.len(), self.state.len(), "dimension of the state");
        assert_eq!(argument.len(), function.argument.len(), "dimension of the argument");
        assert_eq!(out.len(), function.results.len(), "number of results");
        let constants = self.constants.iter().map(Constant::value).collect();
        let (values, contracted) = (Vec::new(), Vec::new());
        let (prepared, inputs) = prepared.split_at(self.prepare.slots.len());
        let mut memory =
            Memory { constants, params, prepared, inputs, t, state, argument, values, contracted };
        memory.run(&function.instructions);
        if !function.contractions.is_empty() {
            let scalars: Vec<R> = function.scalars.iter().map(|o| memory.read(*o)).collect();
            memory.contracted = contract(&scalars);
        }
        for (slot, (_, operand)) in out.iter_mut().zip(&function.results) {
            *slot = memory.read(*operand);
        }
    }
}
