//! The meaning of a fluid's text by arithmetic alone: its hamiltonian and its forces at a state, for matrices of any
//! size. Nothing of [`form`](super::form) is used: it is what its results are compared with.

use std::cell::RefCell;
use std::collections::BTreeMap;

use super::super::ast::{Expr, File, ItemKind, Name, Node};
use super::super::limits::MAX_DEPTH;
use super::found::{carried, momenta};
use super::model::MatrixFluid;
use super::waves::{FluidSurface, FluidWave};
use hamel_expr::rational_to_f64;

/// A number with its derivative in one direction.
type Dual = [f64; 2];

/// What an expression is at a state.
#[derive(Clone, Debug)]
enum Value {
    Number(Dual),
    /// A vector of components.
    Vector(Vec<Dual>),
    /// A matrix by its diagonal: all that a fluid has.
    Diagonal(Vec<Dual>),
}

/// What the hamiltonian and the forces of a fluid are at a state.
#[derive(Clone, Debug)]
pub struct Meaning {
    surface: FluidSurface,
    n: usize,
    /// Names of the vorticity and of carried fields, with the prefixes of their components.
    fields: Vec<(String, String)>,
    algebra: Option<String>,
    lets: BTreeMap<String, Expr>,
    params: BTreeMap<String, f64>,
    hamiltonian: Expr,
    /// Names of velocities, and forces on them.
    forces: Vec<(String, Expr)>,
}

fn times([a, da]: Dual, [b, db]: Dual) -> Dual {
    [a * b, a * db + da * b]
}

fn plus([a, da]: Dual, [b, db]: Dual) -> Dual {
    [a + b, da + db]
}

fn inverse([a, da]: Dual) -> Dual {
    [1.0 / a, -da / (a * a)]
}

impl Value {
    fn map(self, f: impl Fn(Dual) -> Dual) -> Value {
        match self {
            Value::Number(x) => Value::Number(f(x)),
            Value::Vector(list) => Value::Vector(list.into_iter().map(f).collect()),
            Value::Diagonal(list) => Value::Diagonal(list.into_iter().map(f).collect()),
        }
    }

    fn plus(self, other: Value) -> Option<Value> {
        let sums = |a: Vec<Dual>, b: Vec<Dual>| a.into_iter().zip(b).map(|(a, b)| plus(a, b)).collect();
        Some(match (self, other) {
            (Value::Number(a), Value::Number(b)) => Value::Number(plus(a, b)),
            (Value::Vector(a), Value::Vector(b)) => Value::Vector(sums(a, b)),
            (Value::Diagonal(a), Value::Diagonal(b)) => Value::Diagonal(sums(a, b)),
            _ => return None,
        })
    }

    fn times(self, other: Value) -> Option<Value> {
        let products = |a: Vec<Dual>, b: Vec<Dual>| a.into_iter().zip(b).map(|(a, b)| times(a, b)).collect();
        Some(match (self, other) {
            (Value::Number(a), other) | (other, Value::Number(a)) => other.map(|b| times(a, b)),
            (Value::Diagonal(a), Value::Diagonal(b)) => Value::Diagonal(products(a, b)),
            (Value::Diagonal(a), Value::Vector(b)) => Value::Vector(products(a, b)),
            _ => return None,
        })
    }

    fn power(self, exponent: f64) -> Option<Value> {
        let whole = exponent.abs() as u32;
        let is_small = exponent == exponent.trunc() && whole <= 64;
        let power = |x: Dual| {
            let power = (0..whole).fold([1.0, 0.0], |power, _| times(power, x));
            if exponent < 0.0 { inverse(power) } else { power }
        };
        (is_small && !matches!(self, Value::Vector(_))).then(|| self.map(power))
    }
}

impl Meaning {
    /// The meaning of a file that was read as the fluid.
    pub(super) fn of(file: File, fluid: &MatrixFluid) -> Meaning {
        let found = momenta(&file).expect("it was read as a fluid");
        let mut fields = vec![(found.names[0].text.clone(), found.labels[0].text.clone())];
        let label = |label: Option<&Name>| label.map_or(String::new(), |label| label.text.clone());
        fields
            .extend(carried(&file, &found).iter().map(|field| (field.name.text.clone(), label(field.label))));
        let algebra = found.algebra.map(str::to_owned);
        let (mut lets, mut hamiltonian, mut forces) = (BTreeMap::new(), None, Vec::new());
        for item in file.items {
            match item.kind {
                ItemKind::Let { name, value } => _ = lets.insert(name.text, value),
                ItemKind::Hamiltonian(value) => hamiltonian = Some(value),
                ItemKind::Force { name, value } => forces.push((name.text, value)),
                ItemKind::AppliedForce { on: Expr { node: Node::Name(name), .. }, value, .. } => {
                    forces.push((name, value));
                }
                _ => {}
            }
        }
        Meaning {
            surface: fluid.surface,
            n: fluid.n,
            fields,
            algebra,
            lets,
            params: fluid.params.iter().map(|p| (p.name.clone(), rational_to_f64(&p.value))).collect(),
            hamiltonian: hamiltonian.expect("it was read as a fluid"),
            forces,
        }
    }

    /// The hamiltonian at a state of matrices of the size `n`, and its derivative along a change of it: vorticity and
    /// carried fields one after the other, components in the order of the algebra. None where the text says nothing
    /// that arithmetic knows.
    pub fn hamiltonian(&self, n: usize, state: &[f64], change: &[f64]) -> Option<[f64; 2]> {
        let state = state.iter().zip(change).map(|(x, dx)| [*x, *dx]).collect();
        match self.at(n, state).value(&self.hamiltonian, 0)? {
            Value::Number(value) => Some(value),
            _ => None,
        }
    }

    /// The sum of all forces on the vorticity at a state of matrices of the size `n`.
    pub fn force(&self, n: usize, state: &[f64]) -> Option<Vec<f64>> {
        let at = self.at(n, state.iter().map(|x| [*x, 0.0]).collect());
        let mut sum = vec![0.0; at.waves.len()];
        for (velocity, force) in &self.forces {
            let name = velocity.strip_prefix("dh_d")?;
            match at.value(force, 0)? {
                Value::Vector(list) if name == self.fields[0].0 => {
                    sum.iter_mut().zip(list).for_each(|(sum, [x, _])| *sum += x);
                }
                // Forces are on the vorticity, which is the first of the fields.
                Value::Number([x, _]) => *sum.get_mut(at.place(name)?)? += x,
                _ => return None,
            }
        }
        Some(sum)
    }

    fn at(&self, n: usize, state: Vec<Dual>) -> At<'_> {
        At { meaning: self, n, waves: self.surface.waves(n), state, known: RefCell::default() }
    }
}

/// A state at which expressions have values.
struct At<'a> {
    meaning: &'a Meaning,
    n: usize,
    waves: Vec<FluidWave>,
    /// Vorticity and carried fields.
    state: Vec<Dual>,
    /// Values of definitions, each computed once.
    known: RefCell<BTreeMap<String, Value>>,
}

impl At<'_> {
    /// The place of a component.
    fn place(&self, name: &str) -> Option<usize> {
        let of_field = |(k, (_, prefix)): (usize, &(String, String))| {
            let wave = self.meaning.surface.wave(self.n, name.strip_prefix(prefix.as_str())?)?;
            Some(k * self.waves.len() + self.waves.iter().position(|other| *other == wave)?)
        };
        self.meaning.fields.iter().enumerate().find_map(of_field)
    }

    fn value(&self, expr: &Expr, depth: usize) -> Option<Value> {
        if depth > MAX_DEPTH {
            return None;
        }
        let value = |expr: &Expr| self.value(expr, depth + 1);
        let number = |expr: &Expr| match value(expr)? {
            Value::Number([x, _]) => Some(x),
            _ => None,
        };
        match &expr.node {
            Node::Number(q) => Some(Value::Number([rational_to_f64(q), 0.0])),
            Node::Name(name) => self.named(name, depth),
            Node::Neg(inside) => Some(value(inside)?.map(|[x, dx]| [-x, -dx])),
            Node::Sum(list) => {
                let mut summands = list.iter().map(|(is_negative, summand)| {
                    let sign = if *is_negative { -1.0 } else { 1.0 };
                    Some(value(summand)?.map(|[x, dx]| [sign * x, sign * dx]))
                });
                let first = summands.next()??;
                summands.try_fold(first, |sum, next| sum.plus(next?))
            }
            Node::Product(list) => {
                list.iter().try_fold(Value::Number([1.0, 0.0]), |product, (divides, factor)| {
                    let factor = value(factor)?;
                    product.times(if *divides { factor.power(-1.0)? } else { factor })
                })
            }
            Node::Power(base, exponent) => value(base)?.power(number(exponent)?),
            Node::Call(function, arguments) => match (function.text.as_str(), arguments.as_slice()) {
                ("laplacian", _) => {
                    let of = |wave: &FluidWave| [-self.meaning.surface.eigenvalue(*wave) as f64, 0.0];
                    Some(Value::Diagonal(self.waves.iter().map(of).collect()))
                }
                // Of the whole space, which is larger in the text.
                ("identity", [size]) => {
                    let n = self.meaning.n;
                    let is_whole = number(size)? == (n * n - 1) as f64;
                    is_whole.then(|| Value::Diagonal(vec![[1.0, 0.0]; self.waves.len()]))
                }
                ("dot", [a, b]) => match (value(a)?, value(b)?) {
                    (Value::Vector(a), Value::Vector(b)) => {
                        let products = a.into_iter().zip(b).map(|(a, b)| times(a, b));
                        Some(Value::Number(products.fold([0.0; 2], plus)))
                    }
                    _ => None,
                },
                _ => None,
            },
            Node::Index(..) | Node::List(_) => None,
        }
    }

    fn named(&self, name: &str, depth: usize) -> Option<Value> {
        let meaning = self.meaning;
        if let Some(k) = meaning.fields.iter().position(|(field, _)| field == name) {
            let n = self.waves.len();
            return Some(Value::Vector(self.state.get(k * n..(k + 1) * n)?.to_vec()));
        }
        if let Some(x) = meaning.params.get(name) {
            return Some(Value::Number([*x, 0.0]));
        }
        if let Some(value) = meaning.lets.get(name) {
            if let Some(known) = self.known.borrow().get(name) {
                return Some(known.clone());
            }
            let value = self.value(value, depth + 1)?;
            self.known.borrow_mut().insert(name.to_owned(), value.clone());
            return Some(value);
        }
        if Some(name) == meaning.algebra.as_deref() {
            return None;
        }
        Some(Value::Number(self.state[self.place(name)?]))
    }
}
