//! Programs of hamel compiled in memory, by Cranelift.
//!
//! A program that `hamel-codegen` lowered runs operation by operation in its interpreter, at the speed of the processor
//! once it has been emitted as Rust and compiled. This crate is the third way: machine code of the very same operations
//! in the same order, with the runtime's own sine and cosine, there in milliseconds. Results have the bits of the
//! interpreter. Cranelift has registers of two numbers; four lanes are one register where the processor has AVX2, and
//! eight where it has AVX-512, by code that this crate writes itself.
//!
//! ```
//! use hamel_program::program::{Point, Role, Run as _};
//! use hamel_codegen::{scene, spec};
//!
//! let text = "
//!     model pendulum {
//!         param l = 2;
//!         coordinate theta in angle;
//!         let speed = l*theta_dot;
//!         lagrangian = speed^2/2 + l*cos(theta);
//!     }
//! ";
//! let model = spec::parse("pendulum.hamel", text)?;
//! let built = scene::build(&model, "default")?;
//! let compiled = hamel_jit::Compiled::new(built.program())?;
//! let prepared = built.program().prepare(&[2.0_f64])?;
//! let rates = built.program().function_idx(&Role::Rate).ok_or("a scene without rates")?;
//! let mut dy = [0.0; 2];
//! let point = Point { t: 0.0, state: &[0.3, 0.0], argument: &[] };
//! compiled.run_at(rates, &[2.0], &prepared, point, &mut dy);
//! assert!((dy[1] + 0.3_f64.sin() / 2.0).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Deliberately does not know: models, scenes, what a function is for.

mod assembler;
mod avx;
mod calls;
mod code;
mod collocation;
mod convolutions;
mod error;
mod instructions;
mod kernel;
mod lanes;
mod sums;
mod translate;

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use cranelift_codegen::isa::OwnedTargetIsa;
use hamel_program::program::{Point, Program, Run, ViolatedCondition, verify_rules};
use hamel_runtime::Real;

pub use error::Error;
pub use lanes::{Registers, Wide};
pub use sums::{Slopes, WideSums};

use code::{Code, RowsCode, Vectors, WideCode};
use lanes::{Form, LANES, place_of};
use translate::Width;

/// A program whose functions are compiled when they are first called.
///
/// A function that Cranelift refuses is interpreted: with the same bits, later.
pub struct Compiled {
    program: Program,
    isa: OwnedTargetIsa,
    /// The widest registers that code is for.
    registers: Registers,
    /// For each function: on one number, on two side by side of [`LANES`].
    functions: Vec<[OnceLock<Result<Code, Error>>; 3]>,
    /// For each function: on [`LANES`] side by side, where the processor has registers for them.
    wide: Vec<[OnceLock<Option<WideCode>>; 2]>,
    /// For each function: rows of the midpoint rule around it, likewise.
    rows: Vec<[OnceLock<Option<RowsCode>>; 2]>,
    preparation: Preparation,
}

/// The part of a program that depends on parameters alone, compiled for those who prepare many sets of parameters.
#[derive(Default)]
struct Preparation {
    /// How often it has run.
    n_runs: AtomicUsize,
    /// None where it cannot be compiled.
    compiled: OnceLock<Option<Box<Compiled>>>,
}

/// So many sets of parameters are prepared by the interpreter: to compile takes as long as some hundred of them.
const N_INTERPRETED: usize = 100;

impl std::fmt::Debug for Compiled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Compiled").field("functions", &self.functions).finish_non_exhaustive()
    }
}

impl Compiled {
    /// Takes a program to be compiled.
    ///
    /// # Errors
    /// [`Error::Program`] when the program breaks a rule of programs, [`Error::UnknownMachine`].
    pub fn new(program: &Program) -> Result<Compiled, Error> {
        verify_rules(program).map_err(|broken| Error::Program { reason: broken.to_string() })?;
        let n = program.functions.len();
        Ok(Compiled {
            program: program.clone(),
            isa: code::host()?,
            registers: Registers::of_host(),
            functions: (0..n).map(|_| Default::default()).collect(),
            wide: (0..n).map(|_| Default::default()).collect(),
            rows: (0..n).map(|_| Default::default()).collect(),
            preparation: Preparation::default(),
        })
    }

    /// The same with code for these registers at most: with the same bits, to compare.
    #[must_use]
    pub fn with_registers_up_to(self, most: Registers) -> Compiled {
        let registers = self.registers.min(most);
        let [wide, rows] = [(); 2].map(|()| self.program.functions.len());
        Compiled {
            registers,
            wide: (0..wide).map(|_| Default::default()).collect(),
            rows: (0..rows).map(|_| Default::default()).collect(),
            ..self
        }
    }

    /// Writes what [`Program::prepare`] returns, by machine code from the hundredth time on.
    fn prepared<R: Real>(&self, params: &[R], prepared: &mut Vec<R>) -> Result<(), ViolatedCondition>
    where
        Compiled: Run<R>,
    {
        let Preparation { n_runs, compiled } = &self.preparation;
        let interpret = |prepared: &mut Vec<R>| {
            *prepared = self.program.prepare(params)?;
            Ok(())
        };
        // Whichever way has the same bits, so that it does not matter which thread counts first.
        if n_runs.load(Ordering::Relaxed) < N_INTERPRETED {
            n_runs.fetch_add(1, Ordering::Relaxed);
            return interpret(prepared);
        }
        let compile = || {
            let compiled = Compiled::new(&self.program.preparation()).ok()?;
            Some(Box::new(compiled.with_registers_up_to(self.registers)))
        };
        match compiled.get_or_init(compile) {
            Some(compiled) => self.program.prepare_by(&**compiled, params, prepared),
            None => interpret(prepared),
        }
    }

    /// Compiles all functions now, on single numbers and, where `on_lanes`, on lanes.
    ///
    /// # Errors
    /// Of the first function that Cranelift refuses.
    pub fn compile(&self, on_lanes: bool) -> Result<(), Error> {
        let widths = [Width::One, Width::PairOf(LANES[0]), Width::PairOf(LANES[1])];
        let widths = if on_lanes { &widths[..] } else { &widths[..1] };
        (0..self.functions.len()).try_for_each(|k| widths.iter().try_for_each(|w| self.code(k, *w).map(drop)))
    }

    /// Whether a function runs on all lanes at once here, or in registers of four, rather than on two and two.
    ///
    /// # Panics
    /// When the function does not exist.
    pub fn is_wide<L: Wide>(&self, function_idx: usize) -> bool {
        self.wide_code(function_idx, L::WIDTH).is_some()
    }

    fn code(&self, function_idx: usize, width: Width) -> Result<&Code, Error> {
        let compile =
            || Code::compile(&self.isa, &self.program, &self.program.functions[function_idx], width);
        let code = &self.functions[function_idx][width.place()];
        code.get_or_init(compile).as_ref().map_err(Error::clone)
    }

    /// The code on so many lanes, where there is some.
    #[cold]
    fn wide_code(&self, function_idx: usize, lanes: usize) -> Option<&WideCode> {
        let function = &self.program.functions[function_idx];
        let compile = || {
            let form = Form::of(lanes, self.registers)?;
            WideCode::compile(&self.isa, &self.program, function, form).ok().flatten()
        };
        self.wide[function_idx][place_of(lanes)].get_or_init(compile).as_ref()
    }

    /// Runs rows of `2 m, .., 4, 2` substeps of the midpoint rule around a right-hand side over a step `h`, with the
    /// bits of their substeps by [`Run::run_at`], for each row with `eta = h/(2 j)`:
    ///
    /// ```text
    /// d_1 = eta f(t, y),    d_(i+1) = d_(i-1) + 2 eta f(t + i eta, y + d_i),    i = 1, .., 2 j - 1
    /// ```
    ///
    /// False, and increments of no account, where there is no such code for this function or this processor, and where
    /// an angle is too large for it.
    ///
    /// # Shapes
    /// start: `y` and `f(t, y)`, \[n\] each; increments: \[m\]\[2\]\[n\], afterwards `d_(2 j)` and `d_(2 j - 1)`, the
    /// row of the most substeps first.
    ///
    /// # Panics
    /// When the function does not exist, or a size is wrong.
    ///
    /// # Source
    /// Gragg 1965; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.9.
    pub fn run_rows<L: Wide>(
        &self,
        function_idx: usize,
        values: (&[L], &[L]),
        times: (L, L),
        start: (&[L], &[L]),
        increments: &mut [L],
    ) -> bool {
        let code = self.rows[function_idx][place_of(L::WIDTH)].get_or_init(|| {
            let form = Form::of(L::WIDTH, self.registers)?;
            RowsCode::compile(&self.isa, &self.program, &self.program.functions[function_idx], form)
                .ok()
                .flatten()
        });
        code.as_ref().is_some_and(|code| code.run(values, times, start, increments))
    }

    /// Calls a function on all lanes; whether it has answered.
    #[inline]
    fn call_wide<L: Wide>(
        &self,
        function_idx: usize,
        params: &[L],
        prepared: &[L],
        point: &Point<'_, L>,
        out: &mut [L],
    ) -> bool {
        let code = match self.wide[function_idx][place_of(L::WIDTH)].get() {
            Some(code) => code.as_ref(),
            None => self.wide_code(function_idx, L::WIDTH),
        };
        match code {
            None => false,
            Some(code) if code.has_tables() => {
                self.call_with_tables(code, function_idx, params, prepared, point, out)
            }
            Some(code) => code.call(params, prepared, point, (out, &mut [])),
        }
    }

    /// The same for a function with tables, which take longer than to make room for their factors.
    #[inline(never)]
    fn call_with_tables<L: Wide>(
        &self,
        code: &WideCode,
        function_idx: usize,
        params: &[L],
        prepared: &[L],
        point: &Point<'_, L>,
        out: &mut [L],
    ) -> bool {
        let function = &self.program.functions[function_idx];
        let mut scalars = vec![L::ZERO; function.scalars.len()];
        let has_answered = code.call(params, prepared, point, (out, &mut scalars));
        if has_answered {
            self.program.run_tables(function, *point, &scalars, out);
        }
        has_answered
    }

    /// Calls a function on lanes, two and two.
    #[inline(never)]
    fn call_pairs<L: Wide>(
        &self,
        function_idx: usize,
        params: &[L],
        prepared: &[L],
        point: Point<'_, L>,
        out: &mut [L],
    ) {
        self.call(function_idx, Width::PairOf(L::WIDTH), params, prepared, point, out, Code::call_on_lanes);
    }

    #[inline]
    fn call<R: Real>(
        &self,
        function_idx: usize,
        width: Width,
        params: &[R],
        prepared: &[R],
        point: Point<'_, R>,
        out: &mut [R],
        call: impl FnOnce(&Code, &mut Vectors<'_, R>),
    ) {
        let code = match self.functions[function_idx][width.place()].get() {
            Some(code) => code.as_ref().ok(),
            None => self.code(function_idx, width).ok(),
        };
        let Some(code) = code else {
            return self.program.run_at(function_idx, params, prepared, point, out);
        };
        let Point { t, state, argument } = point;
        if !code.has_tables() {
            return call(code, &mut Vectors { params, prepared, t, state, argument, out, scalars: &mut [] });
        }
        let function = &self.program.functions[function_idx];
        let mut scalars = vec![R::ZERO; function.scalars.len()];
        call(code, &mut Vectors { params, prepared, t, state, argument, out, scalars: &mut scalars });
        self.program.run_tables(function, point, &scalars, out);
    }
}

impl Run<f64> for Compiled {
    fn program(&self) -> &Program {
        &self.program
    }

    fn prepare(&self, params: &[f64]) -> Result<Vec<f64>, ViolatedCondition> {
        let mut prepared = Vec::new();
        self.prepared(params, &mut prepared).map(|()| prepared)
    }

    fn prepare_into(&self, params: &[f64], prepared: &mut Vec<f64>) -> Result<(), ViolatedCondition> {
        self.prepared(params, prepared)
    }

    fn run_at(
        &self,
        function_idx: usize,
        params: &[f64],
        prepared: &[f64],
        point: Point<'_, f64>,
        out: &mut [f64],
    ) {
        self.call(function_idx, Width::One, params, prepared, point, out, Code::call);
    }

    fn convolve(&self, rows: [&[f64]; 2], sums: &mut [f64]) {
        convolutions::convolve(self.registers, rows, sums);
    }
}

/// Lanes, each of which has the bits of the same call on its numbers.
impl<L: Wide> Run<L> for Compiled {
    fn program(&self) -> &Program {
        &self.program
    }

    fn prepare(&self, params: &[L]) -> Result<Vec<L>, ViolatedCondition> {
        let mut prepared = Vec::new();
        self.prepared(params, &mut prepared).map(|()| prepared)
    }

    fn prepare_into(&self, params: &[L], prepared: &mut Vec<L>) -> Result<(), ViolatedCondition> {
        self.prepared(params, prepared)
    }

    fn run_at(&self, function_idx: usize, params: &[L], prepared: &[L], point: Point<'_, L>, out: &mut [L]) {
        if !self.call_wide(function_idx, params, prepared, &point, out) {
            self.call_pairs(function_idx, params, prepared, point, out);
        }
    }
}
