//! What the tests of printed formulas share: a model with its derived equations at one exact point, stage data as
//! numbers, polynomial fields, and the verdict on a pair of residuals.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hamel_expr::{ExprId, Graph, Rational, SymbolId, rational_to_f64};
use hamel_lang::algebra::LieAlgebra;
use hamel_mechanics::mechanics::Equations;
use hamel_mechanics::reduction::Stages;
use num_traits::{Signed, Zero};

use crate::algebras::Transported;
use crate::draws::{Draws, one};
use crate::linear::{Rows, Vector, add_scaled, dot, int};
use crate::problem::{Evaluation, equations_of};
use crate::stages::chain_exprs;

/// The text of `models/specs/<name>.hamel`.
///
/// # Panics
/// When the file cannot be read.
pub fn spec_text(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("../models/specs/{name}.hamel"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Exact values of state variables by name.
#[derive(Clone, Debug, Default)]
pub struct Point(BTreeMap<String, Rational>);

impl Point {
    /// The point without any variable.
    pub fn new() -> Point {
        Point::default()
    }

    /// With one more number.
    pub fn with(mut self, name: &str, value: Rational) -> Point {
        self.0.insert(name.to_owned(), value);
        self
    }

    /// With the components `name1`, `name2`, .. followed by `suffix`.
    pub fn with_vector(mut self, name: &str, suffix: &str, value: &[Rational]) -> Point {
        for (k, q) in value.iter().enumerate() {
            self = self.with(&format!("{name}{}{suffix}", k + 1), q.clone());
        }
        self
    }
}

/// The equations that the generator derives, at one point.
#[derive(Debug)]
pub struct Ours {
    /// The equations.
    pub equations: Equations,
    point: Point,
    evaluation: Evaluation,
}

impl Ours {
    /// Parses, reduces and derives a model and evaluates it, parameters at their defaults.
    ///
    /// # Panics
    /// When the model has an error, the point lacks a variable, or a pivot vanishes there.
    pub fn at(text: &str, point: &Point) -> Ours {
        let equations = equations_of(text).unwrap_or_else(|e| panic!("{e}"));
        let evaluation =
            Evaluation::new(&equations, |name| point.0.get(name).cloned()).expect("no pivot vanishes");
        Ours { equations, point: point.clone(), evaluation }
    }

    /// The value of an expression.
    ///
    /// # Panics
    /// When a denominator vanishes.
    pub fn value(&mut self, e: ExprId) -> Rational {
        self.evaluation.value(e).expect("no denominator vanishes")
    }

    /// The derivative of a state variable.
    ///
    /// # Panics
    /// When there is no such variable.
    pub fn rate(&mut self, name: &str) -> Rational {
        let found = self.equations.state.iter().find(|s| s.name == name);
        let derivative = found.unwrap_or_else(|| panic!("{name} is no state variable")).derivative;
        self.value(derivative)
    }

    /// Derivatives of `name1<suffix>`, .., `name<n><suffix>`.
    pub fn rates(&mut self, name: &str, suffix: &str, n: usize) -> Vector {
        (1..=n).map(|k| self.rate(&format!("{name}{k}{suffix}"))).collect()
    }

    /// The default of a parameter.
    ///
    /// # Panics
    /// When there is no such parameter.
    pub fn param(&self, name: &str) -> Rational {
        let found = self.equations.system.params.iter().find(|p| p.name == name);
        found.unwrap_or_else(|| panic!("{name} is no parameter")).default.clone()
    }

    /// Defaults of `name1`, .., `name<n>`.
    pub fn params(&self, name: &str, n: usize) -> Vector {
        (1..=n).map(|k| self.param(&format!("{name}{k}"))).collect()
    }

    /// A variable of the point.
    ///
    /// # Panics
    /// When the point has no such variable.
    pub fn variable(&self, name: &str) -> Rational {
        self.point.0.get(name).unwrap_or_else(|| panic!("the point has no {name}")).clone()
    }

    /// Variables `name1<suffix>`, ...
    pub fn variables(&self, name: &str, suffix: &str, n: usize) -> Vector {
        (1..=n).map(|k| self.variable(&format!("{name}{k}{suffix}"))).collect()
    }

    /// The components of an output.
    ///
    /// # Panics
    /// When there is no such output.
    pub fn output(&mut self, name: &str) -> Vector {
        let found = self.equations.outputs.iter().find(|o| o.name == name);
        let components = found.unwrap_or_else(|| panic!("there is no output {name}")).components.clone();
        components.iter().map(|(_, e)| self.value(*e)).collect()
    }

    /// The energy.
    pub fn energy(&mut self) -> Rational {
        self.value(self.equations.energy)
    }

    /// `[e_a, e_b]` of the model's algebroid as a dense vector, with the sign of the action.
    pub fn frame_bracket(&mut self, a: usize, b: usize) -> Vector {
        let mut graph = self.equations.system.graph.clone();
        let sparse = self.equations.system.algebroid.bracket(&mut graph, a, b);
        let mut dense = vec![int(0); self.equations.system.algebroid.rank()];
        let mut values = BTreeMap::new();
        for p in &self.equations.system.params {
            values.insert(p.symbol, graph.rational(p.default.clone()));
        }
        for s in &self.equations.state {
            values.insert(s.symbol, graph.rational(self.point.0[&s.name].clone()));
        }
        for (c, e) in sparse {
            let value = graph.subs(e, &values).expect("no denominator vanishes");
            dense[c] = graph.as_rational(value).expect("a coefficient on the base").clone();
        }
        dense
    }

    /// The stage data of the model.
    ///
    /// # Panics
    /// When the model has no stages.
    pub fn stages(&mut self) -> StageNumbers {
        let stages = self.equations.system.stages.clone().expect("the model has stages");
        StageNumbers::new(&stages, |e| self.value(e))
    }
}

/// Stage data as numbers.
#[derive(Clone, Debug)]
pub struct StageNumbers {
    /// Adapted elements in the algebra's basis.
    pub basis: Rows,
    /// For each level its indices, and the entries `(a, b, c, value)` of quotient bracket, `a` and `b`.
    pub levels: Vec<LevelNumbers>,
}

/// A sparse bilinear form.
pub type Entries = Vec<(usize, usize, usize, Rational)>;

/// One level of [`StageNumbers`].
#[derive(Clone, Debug)]
pub struct LevelNumbers {
    /// Indices in the adapted basis.
    pub range: std::ops::Range<usize>,
    /// Bracket of the quotient.
    pub quotient: Entries,
    /// `a`.
    pub curvature: Entries,
    /// `b`.
    pub vertical: Entries,
}

/// `form(x, y)`.
pub fn bilinear(form: &Entries, x: &[Rational], y: &[Rational]) -> Vector {
    let mut value = vec![int(0); x.len()];
    for (a, b, c, q) in form {
        value[*c] += q * &x[*a] * &y[*b];
    }
    value
}

impl StageNumbers {
    /// The numbers of symbolic stage data.
    pub fn new(stages: &Stages, mut value: impl FnMut(ExprId) -> Rational) -> StageNumbers {
        let basis = stages.basis.iter().map(|row| row.iter().map(|e| value(*e)).collect()).collect();
        let mut entries = |t: &[(usize, usize, usize, ExprId)]| {
            t.iter().map(|(a, b, c, e)| (*a, *b, *c, value(*e))).collect()
        };
        let levels = stages.levels.iter().map(|l| LevelNumbers {
            range: l.range.clone(),
            quotient: entries(&l.quotient_bracket),
            curvature: entries(&l.curvature),
            vertical: entries(&l.vertical_connection),
        });
        StageNumbers { basis, levels: levels.collect() }
    }

    /// Splits an algebra along a chain of coordinate subspaces with a fixed random inner product.
    ///
    /// # Panics
    /// When the chain is none of ideals.
    pub fn split(algebra: &LieAlgebra, chain: &[Rows], draws: &mut Draws) -> StageNumbers {
        let mut g = Graph::new();
        let metric = draws.positive_definite(algebra.dim());
        let metric: Vec<Vec<ExprId>> =
            metric.iter().map(|row| row.iter().map(|q| g.rational(q.clone())).collect()).collect();
        let names = Transported::stage_names(chain);
        let ideals = chain_exprs(&mut g, chain);
        let stages = Stages::split(&mut g, &algebra.clone().into(), &names, &ideals, Some(&metric))
            .unwrap_or_else(|e| panic!("{} does not split: {e:?}", algebra.name()));
        StageNumbers::new(&stages, |e| g.as_rational(e).expect("rational data").clone())
    }

    /// The part of a vector of the adapted basis in some levels.
    pub fn part(&self, x: &[Rational], levels: std::ops::Range<usize>) -> Vector {
        let inside = |k: usize| self.levels[levels.clone()].iter().any(|l| l.range.contains(&k));
        x.iter().enumerate().map(|(k, q)| if inside(k) { q.clone() } else { int(0) }).collect()
    }

    /// The components of a vector of the adapted basis in one level.
    pub fn slot(&self, x: &[Rational], level: usize) -> Vector {
        x[self.levels[level].range.clone()].to_vec()
    }

    /// Right side of the vertical equations as S0 prints them, (20), (21), (26): level `i` keeps `beta_i` alone.
    pub fn printed_vertical(&self, eta: &[Rational], beta: &[Rational]) -> Vector {
        let mut right = vec![int(0); eta.len()];
        for level in &self.levels {
            for (a, z, c, q) in &level.quotient {
                right[*z] += q * &beta[*c] * &eta[*a];
            }
            for (a, z, c, q) in &level.vertical {
                if self.levels.iter().any(|l| l.range.contains(z) && l.range.contains(c)) {
                    right[*z] += q * &beta[*c] * &eta[*a];
                }
            }
        }
        right
    }

    /// Right side with every momentum, formula (C) of the corrected equations.
    pub fn full_vertical(&self, eta: &[Rational], beta: &[Rational]) -> Vector {
        let mut right = vec![int(0); eta.len()];
        for level in &self.levels {
            for (a, z, c, q) in &level.quotient {
                right[*z] += q * &beta[*c] * &eta[*a];
            }
            for (a, z, c, q) in &level.curvature {
                right[*z] -= q * &beta[*c] * &eta[*a];
            }
            for (a, z, c, q) in &level.vertical {
                right[*a] -= q * &beta[*c] * &eta[*z];
                right[*z] += q * &beta[*c] * &eta[*a];
            }
        }
        right
    }
}

/// `u x v`.
pub fn cross(u: &[Rational], v: &[Rational]) -> Vector {
    let term = |i: usize, j: usize| &u[i] * &v[j] - &u[j] * &v[i];
    vec![term(1, 2), term(2, 0), term(0, 1)]
}

/// `u + v`.
pub fn plus(u: &[Rational], v: &[Rational]) -> Vector {
    add_scaled(u, &int(1), v)
}

/// `u - v`.
pub fn minus(u: &[Rational], v: &[Rational]) -> Vector {
    add_scaled(u, &int(-1), v)
}

/// `s u`.
pub fn scaled(s: &Rational, u: &[Rational]) -> Vector {
    u.iter().map(|x| s * x).collect()
}

/// `diag(d) u`.
pub fn diagonal(d: &[Rational], u: &[Rational]) -> Vector {
    d.iter().zip(u).map(|(x, y)| x * y).collect()
}

/// Small fractions that are not zero, the same in every run.
pub fn generic(seed: u64, n: usize) -> Vector {
    one(seed, 4 * n).generic_vector(n)
}

/// The largest component.
pub fn size(v: &[Rational]) -> f64 {
    v.iter().map(|q| rational_to_f64(&q.abs())).fold(0.0, f64::max)
}

/// Prints both residuals, and holds the corrected formula to zero and the printed one to being wrong.
///
/// # Panics
/// When the corrected formula leaves anything, or the printed one leaves less than a hundredth.
pub fn verdict(entry: &str, printed: &[Rational], right: &[Rational]) {
    println!("{entry}: printed {:.3}, right {}", size(printed), size(right));
    assert!(right.iter().all(Zero::is_zero), "{entry}: the corrected formula leaves {right:?}");
    assert!(size(printed) > 0.01, "{entry}: the printed formula leaves only {printed:?}");
}

/// Polynomials of three variables with random coefficients, evaluated exactly at one point.
#[derive(Debug)]
pub struct Fields {
    /// Owner of the expressions.
    pub g: Graph,
    /// The variables.
    pub x: [SymbolId; 3],
    draws: Draws,
    point: Vector,
}

impl Fields {
    /// No fields yet.
    pub fn new(seed: u64) -> Fields {
        let mut g = Graph::new();
        let x = ["x", "y", "z"].map(|name| g.symbol(name));
        let mut draws = one(seed, 4000);
        let point = draws.generic_vector(3);
        Fields { g, x, draws, point }
    }

    /// A random polynomial of degree `degree` in the first `n` variables.
    pub fn scalar(&mut self, n: usize, degree: i64) -> ExprId {
        let mut terms = Vec::new();
        let top = |k: usize| if k < n { degree } else { 0 };
        for i in 0..=top(0) {
            for j in 0..=top(1) - i.min(top(1)) {
                for k in 0..=top(2) - (i + j).min(top(2)) {
                    let mut powers = Vec::new();
                    for (p, x) in [i, j, k].into_iter().zip(self.x) {
                        let x = self.g.sym(x);
                        powers.push(self.g.powi(x, p));
                    }
                    let q = self.draws.rational();
                    let monomial = self.g.product(&powers);
                    terms.push((monomial, q));
                }
            }
        }
        self.g.linear_combination(&terms)
    }

    /// Three of them.
    pub fn vector(&mut self, n: usize, degree: i64) -> Vec<ExprId> {
        (0..3).map(|_| self.scalar(n, degree)).collect()
    }

    /// A symmetric tensor.
    pub fn symmetric(&mut self, n: usize, degree: i64) -> Vec<Vec<ExprId>> {
        let mut t = vec![vec![self.g.zero(); 3]; 3];
        for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            t[i][j] = self.scalar(n, degree);
            t[j][i] = t[i][j];
        }
        t
    }

    /// `d_k e`.
    pub fn d(&mut self, k: usize, e: ExprId) -> ExprId {
        self.g.diff(e, self.x[k])
    }

    /// `a b`.
    pub fn mul(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.g.mul(a, b)
    }

    /// `curl v`.
    pub fn curl(&mut self, v: &[ExprId]) -> Vec<ExprId> {
        [(1, 2), (2, 0), (0, 1)]
            .into_iter()
            .map(|(i, j)| {
                let (a, b) = (self.d(i, v[j]), self.d(j, v[i]));
                self.g.sub(a, b)
            })
            .collect()
    }

    /// `grad f`.
    pub fn gradient(&mut self, f: ExprId) -> Vec<ExprId> {
        (0..3).map(|k| self.d(k, f)).collect()
    }

    /// `u . v`.
    pub fn dot(&mut self, u: &[ExprId], v: &[ExprId]) -> ExprId {
        let terms: Vec<ExprId> = u.iter().zip(v).map(|(a, b)| self.g.mul(*a, *b)).collect();
        self.g.sum(&terms)
    }

    /// `v . grad f`.
    pub fn along(&mut self, v: &[ExprId], f: ExprId) -> ExprId {
        let gradient = self.gradient(f);
        self.dot(v, &gradient)
    }

    /// `div v`.
    pub fn divergence(&mut self, v: &[ExprId]) -> ExprId {
        let terms: Vec<ExprId> = (0..3).map(|k| self.d(k, v[k])).collect();
        self.g.sum(&terms)
    }

    /// `(grad v)_ij = d_j v_i`.
    pub fn jacobian(&mut self, v: &[ExprId]) -> Vec<Vec<ExprId>> {
        v.iter().map(|f| self.gradient(*f)).collect()
    }

    /// `A B`.
    pub fn matmul(&mut self, a: &[Vec<ExprId>], b: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
        let columns = transposed(b);
        a.iter().map(|row| columns.iter().map(|column| self.dot(row, column)).collect()).collect()
    }

    /// `A + s B`.
    pub fn matsum(&mut self, a: &[Vec<ExprId>], s: &Rational, b: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
        let row = |g: &mut Graph, (r, t): (&Vec<ExprId>, &Vec<ExprId>)| -> Vec<ExprId> {
            r.iter().zip(t).map(|(x, y)| g.linear_combination(&[(*x, int(1)), (*y, s.clone())])).collect()
        };
        a.iter().zip(b).map(|pair| row(&mut self.g, pair)).collect()
    }

    /// `A : B`.
    pub fn pair(&mut self, a: &[Vec<ExprId>], b: &[Vec<ExprId>]) -> ExprId {
        let terms: Vec<ExprId> = a.iter().zip(b).map(|(r, t)| self.dot(r, t)).collect();
        self.g.sum(&terms)
    }

    /// The exact value at the point.
    ///
    /// # Panics
    /// When a denominator vanishes.
    pub fn at(&mut self, e: ExprId) -> Rational {
        let mut values = BTreeMap::new();
        for (x, q) in self.x.iter().zip(&self.point) {
            values.insert(*x, self.g.rational(q.clone()));
        }
        let value = self.g.subs(e, &values).expect("no denominator vanishes");
        self.g.as_rational(value).expect("polynomials have rational values").clone()
    }

    /// The exact values at the point.
    pub fn all_at(&mut self, list: &[ExprId]) -> Vector {
        list.iter().map(|e| self.at(*e)).collect()
    }
}

/// `A^T`.
pub fn transposed(a: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
    (0..a.len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
}

/// `u . D^-1 v` for the diagonal matrix `D`.
pub fn inverse_pairing(d: &[Rational], u: &[Rational], v: &[Rational]) -> Rational {
    let w: Vector = v.iter().zip(d).map(|(x, i)| x / i).collect();
    dot(u, &w)
}
