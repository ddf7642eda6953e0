//! A function `f(t, y)` as the recurrence of the Taylor coefficients of the solutions of `y' = f(t, y)`.
//!
//! With `z(t + h) = sum_k z_k h^k` every operation of the program becomes a rule for `z_k` in terms of coefficients of
//! its operands, and `(k + 1) y_{k+1} = f_k` closes the recurrence. For every operation, elementary functions included,
//! the rule is affine in the coefficients of order `k`, and what it takes from lower orders are sums of one shape,
//!
//! ```text
//! S_k = sum_{j=1}^{k-1} a_j b_{k-j}            a, b: series, or j times a series
//! ```
//!
//! ```text
//! z = a b         z_k = a_0 b_k + a_k b_0 + S_k(a, b)
//! z = a / b       z_k = (a_k - b_k z_0 - S_k(b, z)) / b_0
//! z = sqrt a      z_k = (a_k - S_k(z, z)) / (2 z_0)
//! z = exp a       z_k = a_k z_0 + S_k(j a, z) / k
//! z = ln a        z_k = (a_k - S_k(j z, a) / k) / a_0
//! z = a^q         z_k = (q a_k z_0 + (q S_k(j a, z) - S_k(j z, a)) / k) / a_0
//! z = sin a       z_k = a_k w_0 + S_k(j a, w) / k                                  w =  cos a
//! w = cos a       w_k = -(a_k z_0 + S_k(j a, z) / k)
//! z = tan a       z_k = a_k w_0 + S_k(j a, w) / k                                  w = 1 + z^2
//! z = atan a      z_k = (a_k - S_k(j z, w) / k) / w_0                              w = 1 + a^2
//! z = atan2(y, x) z_k = (x_0 y_k - y_0 x_k + (S_k(j y, x) - S_k(j x, y) - S_k(j z, w)) / k) / w_0    w = x^2 + y^2
//! z = asin a      z_k = (a_k - S_k(j z, w) / k) / w_0                              w = sqrt(1 - a^2)
//! ```
//!
//! (`sinh`, `cosh`, `tanh` as their circular sisters with other signs, `acos a = pi/2 - asin a`, `|a| = sign(a_0) a`).
//! So a [`Jet`] has three parts: `first`, the operations at order zero, which are those of the function itself; the
//! list of *convolutions* `S_k`, which all run in one short loop whatever they belong to, side by side in the lanes of
//! the machine's vectors; and `next`, straight-line code, used at every order, which takes the coefficients of order
//! `k` of the state and the sums `S_k` to the coefficients of order `k` of `f` and of the series that are convolved.
//! Nothing but these rows is stored, linear operations cost what they cost in the function, and the size of the code
//! does not grow with the order. A square takes a lane like any other product: halving its sum would break the row. A
//! quotient takes one lane, so products with a reciprocal become quotients, and the reciprocal itself often drops out.
//!
//! Deliberately does not know: mechanics, step sizes, Rust.
//!
//! # Source
//!
//! Moore, Interval Analysis (1966), chapter 11; Jorba and Zou, A software package for the numerical integration of ODEs
//! by means of high-order Taylor methods (2005), section 2.

mod rules;

use std::collections::{BTreeMap, BTreeSet};

use hamel_runtime::{Convolutions, MAX_ORDER, Real};

use crate::error::Error;
use crate::expr::Rational;
use crate::program::edit::drop_dead;
use crate::program::ir::{Constant, Function, Instruction, Op, Operand, Program, Signs};
use crate::program::role::Role;

/// The recurrence of the Taylor coefficients of the solutions of one scene's equations.
///
/// Its program has the parameters and the prepared slots of the scene, and two functions, [`Jet::FIRST`] and
/// [`Jet::NEXT`]. What they read stands in the program's state, in this order:
///
/// ```text
/// y          n_state    the state; in `next` its coefficients of order k
/// sums       n_lanes    the convolutions S_k
/// kept       n_kept     values at order zero
/// order      1          k
/// inverse    1          1/k
/// ```
///
/// and the time is 1 at order one and 0 beyond in `next`. `first` has the results `f_0` and `kept`; `next` has `f_k`
/// and the rows `a_k` and then `b_k` of the convolutions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Jet {
    /// Both functions.
    pub program: Program,
    /// Dimension of the state.
    pub n_state: usize,
    /// Number of convolutions.
    pub n_lanes: usize,
    /// Number of values at order zero that later orders read.
    pub n_kept: usize,
}

/// Where the inputs of `next` are while their numbers are not known yet.
const SUMS: u32 = 1 << 30;
const KEPT: u32 = 1 << 29;
const ORDER: Operand = Operand::State(1 << 28);
const INVERSE: Operand = Operand::State((1 << 28) + 1);
const OPEN: u32 = 1 << 27;

const PLAIN: Signs = Signs { product: false, addend: false };
const MINUS_ADDEND: Signs = Signs { product: false, addend: true };
const MINUS_PRODUCT: Signs = Signs { product: true, addend: false };

impl Jet {
    /// Position of the function of order zero.
    pub const FIRST: usize = 0;
    /// Position of the function of the other orders.
    pub const NEXT: usize = 1;

    /// The recurrence for a function of the program whose results are the derivatives of the state.
    ///
    /// # Errors
    /// [`Error::ShapeMismatch`] when there are not as many results as components of the state; [`Error::Unsupported`]
    /// for a function with contractions.
    pub fn new(program: &Program, function_idx: usize) -> Result<Jet, Error> {
        let rhs = &program.functions[function_idx];
        if rhs.results.len() != program.state.len() {
            return Err(Error::ShapeMismatch {
                what: format!("function {}", rhs.role),
                found: rhs.results.len(),
                expected: program.state.len(),
            });
        }
        if !rhs.contractions.is_empty() {
            return Err(Error::Unsupported {
                what: format!("Taylor coefficients of {}, whose sums run over tables", rhs.role),
                possible: "a method that evaluates the right-hand side, or a scene that wants `taylor`"
                    .into(),
            });
        }
        let mut builder = Builder::new(program);
        for instruction in &rhs.instructions {
            let series = builder.instruction(instruction);
            builder.values.push(series);
        }
        let derivatives: Vec<Series> = rhs.results.iter().map(|(_, o)| builder.operand(*o)).collect();
        Ok(builder.finish(&derivatives))
    }

    /// Writes the Taylor coefficients of the solution through `(t, y)` to `out`, one state each from order zero on.
    ///
    /// Coefficients beyond [`MAX_ORDER`] are left as they are.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series<R: Real>(&self, params: &[R], prepared: &[R], t: R, y: &[R], out: &mut [&mut [R]]) {
        let n = self.n_state;
        let inputs = self.program.state.len();
        let mut state = vec![R::ZERO; inputs];
        state[..n].copy_from_slice(y);
        let mut results = vec![R::ZERO; n + self.n_kept];
        self.program.run(Self::FIRST, params, prepared, t, &state, &mut results);
        state[n + self.n_lanes..inputs - 2].copy_from_slice(&results[n..]);
        let mut coefficient = results[..n].to_vec();
        let mut lanes = vec![Convolutions::<R, 1>::default(); self.n_lanes];
        let mut results = vec![R::ZERO; n + 2 * self.n_lanes];
        let mut out = out.iter_mut().take(MAX_ORDER + 1);
        if let Some(first) = out.next() {
            first.copy_from_slice(y);
        }
        for (next, k) in out.zip(1u32..) {
            next.copy_from_slice(&coefficient);
            let order = R::from_f64(f64::from(k));
            let inverse = R::ratio(1.0, f64::from(k));
            state[..n].copy_from_slice(&coefficient);
            for (sum, lane) in state[n..].iter_mut().zip(&lanes) {
                [*sum] = lane.sums();
            }
            state[inputs - 2] = order;
            state[inputs - 1] = inverse;
            let t = if k == 1 { R::ONE } else { R::ZERO };
            self.program.run(Self::NEXT, params, prepared, t, &state, &mut results);
            let (left, right) = results[n..].split_at(self.n_lanes);
            for ((lane, left), right) in lanes.iter_mut().zip(left).zip(right) {
                lane.push([*left], [*right]);
            }
            let scale = R::ratio(1.0, f64::from(k + 1));
            for (coefficient, derivative) in coefficient.iter_mut().zip(&results[..n]) {
                *coefficient = *derivative * scale;
            }
        }
    }
}

/// A series: its value at order zero, an operand of `first`, and its coefficient of order `k > 0`, one of `next`.
#[derive(Clone, Copy, Debug)]
struct Series {
    first: Operand,
    /// None where it vanishes.
    next: Option<Operand>,
}

/// Series that come in company: of the same argument, computed from each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Company {
    /// `sin a`, `cos a`.
    Circular,
    /// `sinh a`, `cosh a`.
    Hyperbolic,
    /// `1 + a^2`.
    OnePlusSquare,
    /// `sqrt(1 - a^2)`.
    RootOneMinusSquare,
}

/// A factor of a convolution: a series, by its coefficient of order `k`, or `j` times it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Row {
    coefficient: Operand,
    weighted: bool,
}

/// The series itself.
fn plain(coefficient: Operand) -> Row {
    Row { coefficient, weighted: false }
}

/// `j` times the series.
fn weighted(coefficient: Operand) -> Row {
    Row { coefficient, weighted: true }
}

/// Straight-line code in the making, in which nothing is computed twice.
#[derive(Default)]
struct List {
    instructions: Vec<Instruction>,
    index: BTreeMap<Op, u32>,
}

impl List {
    fn push(&mut self, op: Op, section: u32, name: Option<&String>) -> Operand {
        if let Some(known) = self.index.get(&op) {
            return Operand::Value(*known);
        }
        let value = u32::try_from(self.instructions.len()).expect("fewer than 2^32 values fit in memory");
        self.instructions.push(Instruction { op, section, name: name.cloned() });
        self.index.insert(op, value);
        Operand::Value(value)
    }
}

struct Builder<'p> {
    program: &'p Program,
    constants: Vec<Constant>,
    first: List,
    next: List,
    section: u32,
    /// Series of the values of the function.
    values: Vec<Series>,
    /// Which values are reciprocals, and of what.
    reciprocals: BTreeMap<u32, Operand>,
    company: BTreeMap<(Company, Operand), (Series, Series)>,
    /// Convolutions by their rows.
    lanes: Vec<[Row; 2]>,
    lane_index: BTreeMap<[Row; 2], u32>,
    /// Coefficients of order `k` that rows mention before their rule is written.
    open: Vec<Option<Operand>>,
    /// Operands of `first` that `next` reads.
    kept: Vec<Operand>,
    kept_index: BTreeMap<Operand, u32>,
}

impl<'p> Builder<'p> {
    fn new(program: &'p Program) -> Builder<'p> {
        Builder {
            program,
            constants: program.constants.clone(),
            first: List::default(),
            next: List::default(),
            section: 0,
            values: Vec::new(),
            reciprocals: BTreeMap::new(),
            company: BTreeMap::new(),
            lanes: Vec::new(),
            lane_index: BTreeMap::new(),
            open: Vec::new(),
            kept: Vec::new(),
            kept_index: BTreeMap::new(),
        }
    }

    /// The series of an operand of the function.
    fn operand(&self, operand: Operand) -> Series {
        match operand {
            Operand::Value(v) => self.values[v as usize],
            // A vector that a function takes besides the state does not change with time.
            Operand::Constant(_) | Operand::Param(_) | Operand::Slot(_) | Operand::Argument(_) => {
                Series { first: operand, next: None }
            }
            // `Jet::new` takes no function with contractions.
            Operand::Time | Operand::State(_) | Operand::Contracted(_) => {
                Series { first: operand, next: Some(operand) }
            }
        }
    }

    fn constant(&mut self, value: i64) -> Operand {
        let constant = Constant::Rational(Rational::from_integer(value.into()));
        let known = self.constants.iter().position(|c| *c == constant).unwrap_or_else(|| {
            self.constants.push(constant);
            self.constants.len() - 1
        });
        Operand::Constant(known as u32)
    }

    // ---- instructions of the two functions --------------------------------------------------------------------------

    fn at_zero(&mut self, op: Op) -> Operand {
        self.first.push(op, self.section, None)
    }

    fn at_order(&mut self, op: Op) -> Operand {
        self.next.push(op, self.section, None)
    }

    /// An operand of `first` where `next` needs it.
    fn keep(&mut self, first: Operand) -> Operand {
        match first {
            Operand::Constant(_) | Operand::Param(_) | Operand::Slot(_) | Operand::Argument(_) => first,
            Operand::Value(_) | Operand::Time | Operand::State(_) | Operand::Contracted(_) => {
                let n = self.kept.len() as u32;
                let index = *self.kept_index.entry(first).or_insert(n);
                if index == n {
                    self.kept.push(first);
                }
                Operand::State(KEPT + index)
            }
        }
    }

    /// `S_k(a, b)`.
    fn convolution(&mut self, a: Row, b: Row) -> Operand {
        let key = if a <= b { [a, b] } else { [b, a] };
        let n = self.lanes.len() as u32;
        let index = *self.lane_index.entry(key).or_insert(n);
        if index == n {
            self.lanes.push(key);
        }
        Operand::State(SUMS + index)
    }

    /// `S_k(a, b) / k`.
    fn mean(&mut self, a: Row, b: Row) -> Operand {
        let sum = self.convolution(a, b);
        self.at_order(Op::Mul(INVERSE, sum))
    }

    /// A coefficient for rows, whose rule is not written yet.
    fn announce(&mut self) -> Operand {
        self.open.push(None);
        Operand::State(OPEN + self.open.len() as u32 - 1)
    }

    /// Writes the rule of an announced coefficient.
    fn define(&mut self, announced: Operand, op: Op) -> Operand {
        let value = self.at_order(op);
        if let Operand::State(index) = announced {
            self.open[(index - OPEN) as usize] = Some(value);
        }
        value
    }

    fn add(&mut self, a: Option<Operand>, b: Option<Operand>) -> Option<Operand> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.at_order(Op::Add(a, b))),
            (a, b) => a.or(b),
        }
    }

    fn subtract(&mut self, a: Option<Operand>, b: Option<Operand>) -> Option<Operand> {
        match (a, b) {
            (Some(a), Some(b)) if a == b => None,
            (Some(a), Some(b)) => Some(self.at_order(Op::Sub(a, b))),
            (None, Some(b)) => Some(self.at_order(Op::Neg(b))),
            (a, None) => a,
        }
    }

    // ---- the two functions ------------------------------------------------------------------------------------------

    /// Fuses, drops what nothing needs, and gives the inputs their numbers.
    fn finish(mut self, derivatives: &[Series]) -> Jet {
        self.section = (self.program.sections.len() - 1) as u32;
        let zero = self.constant(0);
        let of_order: Vec<Operand> = derivatives.iter().map(|s| s.next.unwrap_or(zero)).collect();
        let rows: Vec<[Operand; 2]> =
            (0..self.lanes.len()).map(|lane| self.lanes[lane].map(|row| self.row(row))).collect();
        fuse(&mut self.next.instructions, of_order.iter().chain(rows.as_flattened()).copied());

        // A convolution is needed when its sum is; its rows are then.
        let instructions = &self.next.instructions;
        let mut live = vec![false; instructions.len()];
        let mut live_sums = BTreeSet::new();
        let mut live_kept = BTreeSet::new();
        let mut pending = of_order.clone();
        while let Some(operand) = pending.pop() {
            match operand {
                Operand::Value(v) if !std::mem::replace(&mut live[v as usize], true) => {
                    pending.extend(instructions[v as usize].op.operands());
                }
                Operand::State(i) if i >= SUMS && live_sums.insert(i - SUMS) => {
                    pending.extend(rows[(i - SUMS) as usize]);
                }
                Operand::State(i) if (KEPT..SUMS).contains(&i) => {
                    live_kept.insert(i - KEPT);
                }
                _ => {}
            }
        }
        let (n_state, n_lanes, n_kept) = (self.program.state.len(), live_sums.len(), live_kept.len());
        let position = |set: &BTreeSet<u32>, i: u32| set.range(..i).count();
        let place = |operand: Operand| match operand {
            Operand::State(i) if i >= SUMS => {
                Operand::State((n_state + position(&live_sums, i - SUMS)) as u32)
            }
            Operand::State(i) if i >= KEPT => {
                Operand::State((n_state + n_lanes + position(&live_kept, i - KEPT)) as u32)
            }
            ORDER => Operand::State((n_state + n_lanes + n_kept) as u32),
            INVERSE => Operand::State((n_state + n_lanes + n_kept + 1) as u32),
            other => other,
        };
        let names = |name: &str, n: usize| (0..n).map(|i| format!("{name}{i}")).collect::<Vec<_>>();
        let state = &self.program.state;
        let live_rows =
            |side: usize| live_sums.iter().map(|lane| rows[*lane as usize][side]).collect::<Vec<_>>();
        let next_results: Vec<(String, Operand)> = (state.iter().cloned().zip(of_order))
            .chain(names("left", n_lanes).into_iter().zip(live_rows(0)))
            .chain(names("right", n_lanes).into_iter().zip(live_rows(1)))
            .collect();
        let first_results: Vec<(String, Operand)> = (state
            .iter()
            .cloned()
            .zip(derivatives.iter().map(|s| s.first)))
        .chain(names("kept", n_kept).into_iter().zip(live_kept.iter().map(|i| self.kept[*i as usize])))
        .collect();
        let inputs = state.iter().cloned().chain(names("sum", n_lanes)).chain(names("kept", n_kept));
        let state = inputs.chain(["order".to_owned(), "inverse".to_owned()]).collect();
        let functions = vec![
            without_dead(Role::SeriesStart, self.first.instructions, first_results, |o| o),
            without_dead(Role::SeriesStep, self.next.instructions, next_results, place),
        ];
        let mut program = Program {
            functions,
            state,
            constants: self.constants,
            tables: Vec::new(),
            ..self.program.clone()
        };
        program.functions.truncate(2);
        Jet { program, n_state, n_lanes, n_kept }
    }

    /// The operand of `next` that a row takes at every order.
    fn row(&mut self, row: Row) -> Operand {
        let coefficient = match row.coefficient {
            Operand::State(i) if (OPEN..OPEN << 1).contains(&i) => {
                self.open[(i - OPEN) as usize].expect("every announced coefficient is defined")
            }
            other => other,
        };
        if row.weighted { self.at_order(Op::Mul(ORDER, coefficient)) } else { coefficient }
    }
}

/// Turns sums with a product that nothing else needs into fused operations.
fn fuse(instructions: &mut [Instruction], results: impl Iterator<Item = Operand>) {
    let mut n_uses = vec![0usize; instructions.len()];
    for operand in instructions.iter().flat_map(|i| i.op.operands()).chain(results) {
        if let Operand::Value(v) = operand {
            n_uses[v as usize] += 1;
        }
    }
    for k in 0..instructions.len() {
        let factors = |operand: Operand| match operand {
            Operand::Value(v) if n_uses[v as usize] == 1 => match instructions[v as usize].op {
                Op::Mul(a, b) => Some((a, b)),
                _ => None,
            },
            _ => None,
        };
        let fused = match instructions[k].op {
            Op::Add(x, y) => match (factors(x), factors(y)) {
                (_, Some((a, b))) => Some(Op::MulAdd(PLAIN, a, b, x)),
                (Some((a, b)), None) => Some(Op::MulAdd(PLAIN, a, b, y)),
                (None, None) => None,
            },
            Op::Sub(x, y) => match (factors(x), factors(y)) {
                (_, Some((a, b))) => Some(Op::MulAdd(MINUS_PRODUCT, a, b, x)),
                (Some((a, b)), None) => Some(Op::MulAdd(MINUS_ADDEND, a, b, y)),
                (None, None) => None,
            },
            _ => None,
        };
        if let Some(op) = fused {
            instructions[k].op = op;
        }
    }
}

/// The function without instructions that no result needs, its inputs renamed.
fn without_dead(
    role: Role,
    mut instructions: Vec<Instruction>,
    results: Vec<(String, Operand)>,
    place: impl Fn(Operand) -> Operand,
) -> Function {
    let (names, mut outputs): (Vec<String>, Vec<Operand>) = results.into_iter().unzip();
    drop_dead(&mut instructions, &mut outputs);
    instructions.iter_mut().for_each(|i| i.op = i.op.map(&place));
    let results = names.into_iter().zip(outputs.into_iter().map(place)).collect();
    Function { role, instructions, results, ..Function::default() }
}
