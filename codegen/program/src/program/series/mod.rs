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
//! (Stumpff's functions and the factors of logarithms of rotations as families, each by the next: see the rules.
//! `sinh`, `cosh`, `tanh` as their circular sisters with other signs, `acos a = pi/2 - asin a`, `|a| = sign(a_0) a`).
//! So a [`Jet`] has three parts: `first`, the operations at order zero, which are those of the function itself; the
//! list of *convolutions* `S_k`, which all run in one short loop whatever they belong to, side by side in the lanes of
//! the machine's vectors; and `next`, straight-line code, used at every order, which takes the coefficients of order
//! `k` of the state and the sums `S_k` to the coefficients of order `k` of `f` and of the series that are convolved.
//! Nothing but these rows is stored, linear operations cost what they cost in the function, and the size of the code
//! does not grow with the order. What a function leaves to contractions is a part of both functions: the sums over a
//! table have the Cauchy products of the series of its factors as coefficients, for which the coefficients of all
//! orders of these factors are stored. A square takes a lane like any other product: halving its sum would break the
//! row. A quotient takes one lane, so products with a reciprocal become quotients, and the reciprocal itself often
//! drops out.
//!
//! Deliberately does not know: mechanics, step sizes, Rust.
//!
//! # Source
//!
//! Moore, Interval Analysis (1966), chapter 11; Jorba and Zou, A software package for the numerical integration of ODEs
//! by means of high-order Taylor methods (2005), section 2.

mod evaluate;
mod rules;

pub use evaluate::SeriesRoom;

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashMap;

use crate::program::edit::drop_dead;
use crate::program::ir::{Constant, Function, Instruction, Op, Operand, Program, Signs};
use crate::program::role::Role;
use crate::program::table::{Factors, Products};
use hamel_expr::Rational;
use hamel_expr::error::Error;

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
/// and the time is 1 at order one and 0 beyond in `next`, where the inputs of the scene, too, are their coefficients of
/// order k: of what is held, 0. `first` has the results `f_0` and `kept`; `next` has `f_k`
/// and the rows `a_k` and then `b_k` of the convolutions.
///
/// Both have the contractions of the right-hand side. Those of `next` are not what [`Program::run`] makes of them: with
/// factors `x` and `y` that are series, the coefficient of a product is `sum_{m=0}^k x_m y_{k-m}`, and of factors that
/// [do not change](Jet::changes) the value is the only coefficient. Results of `next` that are contracted are these
/// coefficients of order `k`.
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
    /// Whether the scalars of `next` are coefficients of order `k`; otherwise none of them changes with time, and they
    /// are values.
    pub scalars_change: bool,
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
    /// [`Error::ShapeMismatch`] when there are not as many results as components of the state, or when the function
    /// takes a vector of its own.
    pub fn new(program: &Program, function_idx: usize) -> Result<Jet, Error> {
        let rhs = &program.functions[function_idx];
        if rhs.results.len() != program.state.len() {
            return Err(Error::ShapeMismatch {
                what: format!("function {}", rhs.role),
                found: rhs.results.len(),
                expected: program.state.len(),
            });
        }
        if !rhs.argument.is_empty() {
            return Err(Error::ShapeMismatch {
                what: format!("vector of {}", rhs.role),
                found: rhs.argument.len(),
                expected: 0,
            });
        }
        let mut builder = Builder::new(program);
        for instruction in &rhs.instructions {
            let series = builder.instruction(instruction);
            builder.values.push(series);
        }
        let derivatives: Vec<Series> = rhs.results.iter().map(|(_, o)| builder.operand(*o)).collect();
        Ok(builder.finish(rhs, &derivatives))
    }

    /// Whether factors change with time, so that they have coefficients of higher orders.
    pub fn changes(&self, factors: Factors) -> bool {
        match factors {
            Factors::State | Factors::Contraction(_) => true,
            Factors::Scalars => self.scalars_change,
            Factors::Argument => false,
        }
    }

    /// How the sums over a table get their coefficients of an order above zero.
    pub fn kind(&self, products: &Products) -> ProductKind {
        match (self.changes(products.left), self.changes(products.right)) {
            (true, true) => ProductKind::Convolved,
            (false, false) => ProductKind::Constant,
            _ => ProductKind::Scaled,
        }
    }

    /// The factors whose coefficients of all orders contractions read, each once.
    pub fn convolved_factors(&self) -> BTreeSet<Factors> {
        let terms = self.program.functions[Jet::NEXT].contractions.iter().flat_map(|c| &c.terms);
        let convolved = terms.filter(|products| self.kind(products) == ProductKind::Convolved);
        convolved.flat_map(|products| [products.left, products.right]).collect()
    }
}

/// What becomes of the products of a table at the orders above zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProductKind {
    /// Both factors change: Cauchy products of their coefficients of all orders.
    Convolved,
    /// One factor changes: products of its coefficient of that order with the value of the other one.
    Scaled,
    /// No factor changes: nothing.
    Constant,
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
    /// One of Stumpff's functions.
    Stumpff(u32),
    /// One of the functions `tau_k` of logarithms of rotations.
    Turn(u32),
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
    /// Which values are what rounding left out of others: zero, but for rounding.
    rests: BTreeSet<u32>,
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
            rests: BTreeSet::new(),
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
            // `Jet::new` takes no function with a vector of its own.
            Operand::Constant(_) | Operand::Param(_) | Operand::Slot(_) | Operand::Argument(_) => {
                Series { first: operand, next: None }
            }
            // Contracted values are results alone: the coefficients of both functions have the same numbers.
            Operand::Time | Operand::State(_) | Operand::Input(_) | Operand::Contracted(_) => {
                Series { first: operand, next: Some(operand) }
            }
        }
    }

    fn constant(&mut self, value: i64) -> Operand {
        self.rational(Rational::from_integer(value.into()))
    }

    fn half(&mut self) -> Operand {
        self.rational(Rational::new(1.into(), 2.into()))
    }

    fn rational(&mut self, value: Rational) -> Operand {
        let constant = Constant::Rational(value);
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
            Operand::Value(_)
            | Operand::Time
            | Operand::State(_)
            | Operand::Input(_)
            | Operand::Contracted(_) => {
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
    fn finish(mut self, rhs: &Function, derivatives: &[Series]) -> Jet {
        self.section = (self.program.sections.len() - 1) as u32;
        let zero = self.constant(0);
        let of_order: Vec<Operand> = derivatives.iter().map(|s| s.next.unwrap_or(zero)).collect();
        let rows: Vec<[Operand; 2]> =
            (0..self.lanes.len()).map(|lane| self.lanes[lane].map(|row| self.row(row))).collect();
        let scalars: Vec<Series> = rhs.scalars.iter().map(|o| self.operand(*o)).collect();
        let scalars_change = scalars.iter().any(|s| s.next.is_some());
        let scalar_of_order =
            |s: &Series| if scalars_change { s.next.unwrap_or(zero) } else { self.keep(s.first) };
        let scalars_of_order: Vec<Operand> = scalars.iter().map(scalar_of_order).collect();
        let read_by_results = of_order.iter().chain(&scalars_of_order);
        fuse(&mut self.next.instructions, read_by_results.clone().chain(rows.as_flattened()).copied());

        // A convolution is needed when its sum is; its rows are then.
        let instructions = &self.next.instructions;
        let mut live = vec![false; instructions.len()];
        let mut live_sums = BTreeSet::new();
        let mut live_kept = BTreeSet::new();
        let mut pending: Vec<Operand> = read_by_results.copied().collect();
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
        let places = |set: &BTreeSet<u32>, first: usize| -> FxHashMap<u32, Operand> {
            set.iter().copied().zip((first..).map(|k| Operand::State(k as u32))).collect()
        };
        let (sums, kept) = (places(&live_sums, n_state), places(&live_kept, n_state + n_lanes));
        // An input that nothing live reads stays where no input is, which the rules of programs find.
        let place = |operand: Operand| match operand {
            Operand::State(i) if i >= SUMS => sums.get(&(i - SUMS)).copied().unwrap_or(operand),
            Operand::State(i) if i >= KEPT => kept.get(&(i - KEPT)).copied().unwrap_or(operand),
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
        let function = |role, instructions, scalars, results| Function {
            role,
            instructions,
            scalars,
            results,
            contractions: rhs.contractions.clone(),
            ..Function::default()
        };
        let scalars_first = scalars.iter().map(|s| s.first).collect();
        let functions = vec![
            without_dead(
                function(Role::SeriesStart, self.first.instructions, scalars_first, first_results),
                |o| o,
            ),
            without_dead(
                function(Role::SeriesStep, self.next.instructions, scalars_of_order, next_results),
                place,
            ),
        ];
        let program = Program { functions, state, constants: self.constants, ..self.program.clone() };
        Jet { program, n_state, n_lanes, n_kept, scalars_change }
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
fn without_dead(mut function: Function, place: impl Fn(Operand) -> Operand) -> Function {
    let mut outputs: Vec<Operand> = function.outputs().collect();
    drop_dead(&mut function.instructions, &mut outputs);
    function.instructions.iter_mut().for_each(|i| i.op = i.op.map(&place));
    let mut outputs = outputs.into_iter();
    function.map_outputs(|known| outputs.next().map_or(known, &place));
    function
}
