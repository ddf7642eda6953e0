//! Expressions of a graph as a list of operations that any scalar runs through.
//!
//! Evaluates nodes as they stand: no constructor of the graph, no rule of rewriting and no value that the graph keeps
//! is used. Does not know: what expressions mean, where values of symbols come from.

use std::collections::{BTreeMap, HashMap};

use hamel_runtime::Real;
use num_traits::{FromPrimitive, One, ToPrimitive, Zero};

use hamel_expr::{ExprId, Func, Graph, Node, Rational, Section, SymbolId, rational_to_f64};

/// `pi`, and what the double next to it lacks.
pub(super) const PI: [f64; 2] = [std::f64::consts::PI, 1.224_646_799_147_353_2e-16];

/// A rational number to 31 digits, as two doubles.
pub(super) fn parts(q: &Rational) -> [f64; 2] {
    let hi = rational_to_f64(q);
    let rest = Rational::from_f64(hi).map_or_else(Rational::zero, |hi| q - hi);
    [hi, rational_to_f64(&rest)]
}

fn scalar<R: Real>([hi, lo]: [f64; 2]) -> R {
    R::from_parts(hi, lo)
}

/// A rational number as a scalar.
pub(super) fn rational<R: Real>(q: &Rational) -> R {
    scalar(parts(q))
}

/// An exponent: a whole number, half of one, or any other rational.
#[derive(Clone, Copy, Debug)]
enum Power {
    Whole(i64),
    /// `x^(n + 1/2)`.
    HalfBeyond(i64),
    Other([f64; 2]),
}

impl Power {
    fn of(q: &Rational) -> Power {
        let twice = q + q;
        match (q.is_integer(), twice.is_integer()) {
            (true, _) => q.to_integer().to_i64().map_or(Power::Other(parts(q)), Power::Whole),
            (false, true) => {
                q.floor().to_integer().to_i64().map_or(Power::Other(parts(q)), Power::HalfBeyond)
            }
            _ => Power::Other(parts(q)),
        }
    }

    fn raise<R: Real>(self, x: R) -> R {
        match self {
            Power::Whole(n) => whole_power(x, n),
            Power::HalfBeyond(n) => whole_power(x, n) * x.sqrt(),
            Power::Other(q) => (scalar::<R>(q) * x.ln()).exp(),
        }
    }
}

fn whole_power<R: Real>(x: R, n: i64) -> R {
    let mut value = R::ONE;
    let (mut square, mut left) = (x, n.unsigned_abs());
    while left > 0 {
        if left & 1 == 1 {
            value *= square;
        }
        left >>= 1;
        if left > 0 {
            square *= square;
        }
    }
    if n < 0 { value.recip() } else { value }
}

#[derive(Clone, Debug)]
enum Step {
    Constant([f64; 2]),
    Symbol(SymbolId),
    Sum([f64; 2], Vec<(u32, Option<[f64; 2]>)>),
    Product([f64; 2], Vec<(u32, Power)>),
    Function(Func, u32),
    Atan2(u32, u32),
}

/// Expressions in the order of their evaluation.
#[derive(Clone, Debug, Default)]
pub(super) struct Tape {
    steps: Vec<Step>,
    roots: Vec<u32>,
    defined: BTreeMap<SymbolId, u32>,
}

/// What symbols stand for.
#[derive(Clone, Debug)]
pub(super) struct Env<R> {
    values: Vec<Option<R>>,
}

impl<R: Real> Env<R> {
    pub(super) fn new() -> Env<R> {
        Env { values: Vec::new() }
    }

    pub(super) fn set(&mut self, symbol: SymbolId, value: R) {
        let at = symbol.index();
        if self.values.len() <= at {
            self.values.resize(at + 1, None);
        }
        self.values[at] = Some(value);
    }

    pub(super) fn set_all(&mut self, symbols: &[SymbolId], values: &[R]) {
        for (symbol, value) in symbols.iter().zip(values) {
            self.set(*symbol, *value);
        }
    }

    pub(super) fn get(&self, symbol: SymbolId) -> Option<R> {
        self.values.get(symbol.index()).copied().flatten()
    }

    /// The same values as other scalars.
    pub(super) fn map<S: Real>(&self, mut f: impl FnMut(R) -> S) -> Env<S> {
        Env { values: self.values.iter().map(|v| v.map(&mut f)).collect() }
    }
}

/// Evaluated expressions.
pub(super) struct Values<R> {
    /// The values of the roots, in order.
    pub(super) roots: Vec<R>,
    /// The values of definitions, by symbol.
    pub(super) defined: BTreeMap<SymbolId, R>,
}

impl Tape {
    pub(super) fn new(graph: &Graph, roots: &[ExprId]) -> Tape {
        Tape::with_definitions(graph, &[], roots)
    }

    /// Expressions that mention definitions, which stand in order.
    pub(super) fn with_definitions(graph: &Graph, sections: &[Section], roots: &[ExprId]) -> Tape {
        let mut tape = Tape::default();
        let mut places: HashMap<ExprId, u32> = HashMap::new();
        for definition in sections.iter().flat_map(|s| &s.definitions) {
            let place = tape.add(graph, &mut places, definition.expr);
            tape.defined.insert(definition.symbol, place);
        }
        tape.roots = roots.iter().map(|root| tape.add(graph, &mut places, *root)).collect();
        tape
    }

    fn add(&mut self, graph: &Graph, places: &mut HashMap<ExprId, u32>, root: ExprId) -> u32 {
        // The definition of a symbol stands before its uses, so that a node is added once.
        for e in graph.reachable(&[root]) {
            if places.contains_key(&e) {
                continue;
            }
            let of = |e: &ExprId| places[e];
            let step = match graph.node(e) {
                Node::Constant(q) => Step::Constant(parts(q)),
                Node::Pi => Step::Constant(PI),
                Node::Symbol(s) => match self.defined.get(s) {
                    Some(place) => {
                        places.insert(e, *place);
                        continue;
                    }
                    None => Step::Symbol(*s),
                },
                Node::Sum { constant, terms } => {
                    let terms = terms.iter().map(|(e, q)| (of(e), (!q.is_one()).then(|| parts(q))));
                    Step::Sum(parts(constant), terms.collect())
                }
                Node::Product { coefficient, factors } => {
                    let factors = factors.iter().map(|(e, q)| (of(e), Power::of(q)));
                    Step::Product(parts(coefficient), factors.collect())
                }
                Node::Function(f, x) => Step::Function(*f, of(x)),
                Node::Atan2(y, x) => Step::Atan2(of(y), of(x)),
            };
            places.insert(e, self.steps.len() as u32);
            self.steps.push(step);
        }
        places[&root]
    }

    /// The values of all roots and definitions.
    ///
    /// # Errors
    /// A symbol without a value that a root needs.
    pub(super) fn eval<R: Real>(&self, env: &Env<R>) -> Result<Values<R>, SymbolId> {
        let mut values: Vec<R> = Vec::with_capacity(self.steps.len());
        for step in &self.steps {
            let of = |place: &u32| values[*place as usize];
            let value = match step {
                Step::Constant(c) => scalar(*c),
                Step::Symbol(s) => env.get(*s).ok_or(*s)?,
                Step::Sum(constant, terms) => {
                    let start = if *constant == [0.0; 2] { R::ZERO } else { scalar(*constant) };
                    terms.iter().fold(start, |sum, (place, q)| match q {
                        None => sum + of(place),
                        Some(q) => sum + scalar::<R>(*q) * of(place),
                    })
                }
                Step::Product(coefficient, factors) => {
                    factors.iter().fold(scalar(*coefficient), |product: R, (place, power)| {
                        product * power.raise(of(place))
                    })
                }
                Step::Function(f, x) => f.of(of(x)),
                Step::Atan2(y, x) => of(y).atan2(of(x)),
            };
            values.push(value);
        }
        Ok(Values {
            roots: self.roots.iter().map(|place| values[*place as usize]).collect(),
            defined: self.defined.iter().map(|(symbol, place)| (*symbol, values[*place as usize])).collect(),
        })
    }
}
