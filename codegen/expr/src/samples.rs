//! How many digits an expression loses, measured at sampled values of its symbols.
//!
//! Deliberately does not know: what an expression is for, how else it could be written.

use std::collections::BTreeMap;

use hamel_runtime::{DoubleDouble, Real};
use num_traits::{FromPrimitive, Zero};
use rustc_hash::FxHashMap;

use super::graph::Graph;
use super::node::{ExprId, Func, Node, SymbolId};
use super::random::uniform;
use super::rational::{Rational, rational_to_f64};
use super::sign::Sign;

/// Decades by which a symbol is larger or smaller than one.
const DECADES: f64 = 3.0;

/// Values that are remembered at most; beyond that nothing more is measured, so that no number takes long.
const MAX_MEASURED: usize = 4_000_000;

/// A value to 31 digits and a bound of the error that rounding every operation makes in it, in units of the roundoff.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The value.
    pub value: DoubleDouble,
    /// The bound of its error, in units of the roundoff.
    pub error: f64,
}

/// Points at which expressions are measured: symbols log-uniform within three decades of one, of the sign that is
/// known.
#[derive(Clone, Debug)]
pub struct Samples {
    points: Vec<BTreeMap<SymbolId, DoubleDouble>>,
    measured: FxHashMap<ExprId, Option<Vec<Measured>>>,
}

/// A rational number to 31 digits.
pub(super) fn long(q: &Rational) -> DoubleDouble {
    let head = rational_to_f64(q);
    let rest = Rational::from_f64(head).map_or_else(Rational::zero, |head| q - head);
    DoubleDouble::sum_of(head, rational_to_f64(&rest))
}

impl Samples {
    /// So many points, the same ones every time.
    pub fn new(n: usize, symbols: &[(SymbolId, Sign)]) -> Samples {
        let mut state = 0x5eed;
        let mut draw = |(symbol, sign): &(SymbolId, Sign)| {
            let size = 10f64.powf(DECADES * (2.0 * uniform(&mut state) - 1.0));
            let is_negative = match sign {
                Sign::Positive | Sign::NonNegative => false,
                Sign::Negative | Sign::NonPositive => true,
                Sign::NonZero | Sign::Unknown => uniform(&mut state) < 0.5,
            };
            (*symbol, DoubleDouble::from(if is_negative { -size } else { size }))
        };
        let points = (0..n).map(|_| symbols.iter().map(&mut draw).collect()).collect();
        Samples { points, measured: FxHashMap::default() }
    }

    /// Keeps only points at which `greater > less`; does nothing where one of the two has no value.
    pub fn keep(&mut self, g: &Graph, greater: ExprId, less: ExprId) {
        let values = |samples: &mut Samples, e: ExprId| -> Option<Vec<DoubleDouble>> {
            Some(samples.measure(g, e)?.iter().map(|m| m.value).collect())
        };
        let (Some(greater), Some(less)) = (values(self, greater), values(self, less)) else { return };
        let mut holds = greater.into_iter().zip(less).map(|(a, b)| (a - b).hi() > 0.0);
        self.points.retain(|_| holds.next().unwrap_or(false));
        self.measured.clear();
    }

    /// Number of points.
    pub fn n_points(&self) -> usize {
        self.points.len()
    }

    /// The first `n` points, and after them, for every symbol, the same points with its value moved by the relative
    /// `shift`.
    pub fn shifted(&self, n: usize, symbols: &[SymbolId], shift: f64) -> Samples {
        let base = &self.points[..n.min(self.points.len())];
        let mut points = base.to_vec();
        for symbol in symbols {
            points.extend(base.iter().cloned().map(|mut point| {
                point.entry(*symbol).and_modify(|x| *x *= DoubleDouble::sum_of(1.0, shift));
                point
            }));
        }
        Samples { points, measured: FxHashMap::default() }
    }

    /// Value and error at every point; none where a symbol has no value, or too much was measured before.
    pub fn measure(&mut self, g: &Graph, e: ExprId) -> Option<&[Measured]> {
        let behind = g.reachable(&[e]);
        if (self.measured.len() + behind.len()) * self.points.len() > MAX_MEASURED {
            return None;
        }
        for node in behind {
            if self.measured.contains_key(&node) {
                continue;
            }
            let own = self.of_node(g, node);
            self.measured.insert(node, own);
        }
        self.measured[&e].as_deref()
    }

    /// The values of a node at all points, whose operands have theirs. Exact numbers are rounded once for all points.
    fn of_node(&self, g: &Graph, e: ExprId) -> Option<Vec<Measured>> {
        let of = |e: &ExprId| self.measured.get(e)?.as_deref();
        let size = |x: DoubleDouble| x.hi().abs();
        let everywhere = |value: DoubleDouble, error: f64| vec![Measured { value, error }; self.points.len()];
        Some(match g.node(e) {
            Node::Constant(c) => everywhere(long(c), 0.0),
            Node::Pi => everywhere(DoubleDouble::from_f64(std::f64::consts::PI), 1.0),
            Node::Symbol(s) => {
                let at = |point: &BTreeMap<SymbolId, DoubleDouble>| {
                    Some(Measured { value: *point.get(s)?, error: 0.0 })
                };
                self.points.iter().map(at).collect::<Option<_>>()?
            }
            Node::Sum { constant, terms } => {
                let mut sums = everywhere(long(constant), 0.0);
                for (term, q) in terms {
                    let q = long(q);
                    for (sum, term) in sums.iter_mut().zip(of(term)?) {
                        let part = q * term.value;
                        sum.value += part;
                        sum.error += size(q) * term.error + size(part) + size(sum.value);
                    }
                }
                sums
            }
            Node::Product { coefficient, factors } => {
                let mut products = everywhere(long(coefficient), 0.0);
                for (base, q) in factors {
                    let q = rational_to_f64(q);
                    for (product, base) in products.iter_mut().zip(of(base)?) {
                        *product = product.times(*base, q);
                    }
                }
                products
            }
            Node::Function(f, a) => of(a)?.iter().map(|x| x.function(*f)).collect(),
            Node::Atan2(y, x) => of(y)?.iter().zip(of(x)?).map(|(y, x)| y.atan2(*x)).collect(),
        })
    }
}

impl Measured {
    /// `self base^q`.
    pub fn times(self, base: Measured, q: f64) -> Measured {
        let size = |x: DoubleDouble| x.hi().abs();
        let power = raised(base.value, q);
        let value = self.value * power;
        // Where a factor vanishes nothing is left of the errors of the others.
        let own = if q == 1.0 {
            size(self.value) * base.error
        } else {
            size(value) * q.abs() * base.error / size(base.value)
        };
        Measured { value, error: self.error * size(power) + own + q.abs().ceil() * size(value) }
    }

    /// `self + other`.
    pub fn plus(self, other: Measured) -> Measured {
        let value = self.value + other.value;
        Measured { value, error: self.error + other.error + value.hi().abs() }
    }

    /// `atan2(self, x)`.
    pub fn atan2(self, x: Measured) -> Measured {
        let size = |x: DoubleDouble| x.hi().abs();
        let value = Real::atan2(self.value, x.value);
        let square = size(self.value * self.value + x.value * x.value);
        let own = (size(x.value) * self.error + size(self.value) * x.error) / square;
        Measured { value, error: own + size(value) }
    }

    /// A function of it.
    pub fn function(self, f: Func) -> Measured {
        let size = |x: DoubleDouble| x.hi().abs();
        let (value, slope) = match f {
            Func::Sin | Func::Cos => {
                let (sine, cosine) = self.value.sin_cos();
                if f == Func::Sin { (sine, cosine) } else { (cosine, sine) }
            }
            _ => {
                let value = f.of(self.value);
                // By a difference quotient: it weighs an error and need not be exact.
                let shift = DoubleDouble::from(size(self.value) * 1e-10 + 1e-300);
                (value, (f.of(self.value + shift) - value) / shift)
            }
        };
        Measured { value, error: size(slope) * self.error + size(value) }
    }
}

fn raised(base: DoubleDouble, power: f64) -> DoubleDouble {
    let whole = power.abs().floor();
    let mut value = DoubleDouble::ONE;
    if whole > 64.0 {
        return (base.ln() * DoubleDouble::from(power)).exp();
    }
    for _ in 0..whole as u32 {
        value *= base;
    }
    let rest = power.abs() - whole;
    if rest == 0.5 {
        value *= base.sqrt();
    } else if rest > 0.0 {
        value *= (base.ln() * DoubleDouble::from(rest)).exp();
    }
    if power < 0.0 { value.recip() } else { value }
}
