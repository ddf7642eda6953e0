//! Random models move as their unreduced equations say, whatever connection they are written with.
//!
//! Groups of rotations, motions of the plane and of space, Heisenberg, Bianchi types and products, up to two
//! coordinates, left and right actions, linear, affine, nonlinear and second-order constraints, virtual displacements
//! of their own, forces, advected parameters and explicit time: each model is written as text, derived, lowered and
//! run, and its accelerations are held to the Lagrange-d'Alembert equations in coordinates of the group, which share
//! nothing with the generator (`unreduced`).
//!
//! `HAMEL_RANDOM_MODELS=5000 cargo test --release -p hamel-codegen --test main random_models` draws more of them,
//! `HAMEL_RANDOM_SEED=1` others. A failure prints its seed and the text of the model.

#[path = "unreduced/mod.rs"]
mod unreduced;

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec::{self, ConnectionKind, Model};
use hamel_expr::SymbolId;
use hamel_mechanics::reduction::with_connection;
use proptest::prelude::Rng as _;
use proptest::test_runner::{RngAlgorithm, TestRng};
use unreduced::expression::{Expr, Point, Sym};
use unreduced::{Condition, Group, Matrix, Motion, System};

/// Models drawn unless asked for more.
const N_MODELS: usize = 12;

/// With more velocities a model takes seconds to lower, and is written with its group velocity alone unless more are
/// asked for.
const MAX_VELOCITIES: usize = 6;

struct Draw(TestRng);

impl Draw {
    fn new(seed: u64) -> Draw {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        Draw(TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
    }

    fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.0.next_u64() % n as u64).expect("a small number")
    }

    fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    fn one_of<T: Clone>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())].clone()
    }

    /// Tenths between `low` and `high`, not zero.
    fn tenths(&mut self, low: i64, high: i64) -> Expr {
        let width = usize::try_from(high - low).expect("an interval");
        let n = low + i64::try_from(self.below(width + 1)).expect("a small number");
        Expr::Tenths(if n == 0 { 3 } else { n })
    }

    /// A number of moderate size for a state.
    fn number(&mut self) -> f64 {
        (self.below(2001) as f64 - 1000.0) / 900.0
    }

    fn numbers(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.number()).collect()
    }
}

/// The matrix with ones (or other numbers) at some places.
fn matrix(n: usize, entries: &[(usize, usize, f64)]) -> Matrix {
    let mut m = vec![vec![0.0; n]; n];
    for (i, j, value) in entries {
        m[*i][*j] = *value;
    }
    m
}

fn so3(n: usize) -> Vec<Matrix> {
    [(2, 1), (0, 2), (1, 0)].map(|(i, j)| matrix(n, &[(i, j, 1.0), (j, i, -1.0)])).to_vec()
}

/// Brackets as text, from commutators.
fn declared(name: &str, group: &Group) -> String {
    let n = group.basis.len();
    let basis: Vec<String> = (1..=n).map(|k| format!("e{k}")).collect();
    let mut text = format!("algebra {name} {{ basis {};", basis.join(", "));
    for a in 0..n {
        for b in a + 1..n {
            let components = group.bracket(a, b);
            let terms: Vec<String> = (components.iter().enumerate())
                .map(|(c, q)| (c, q.round()))
                .inspect(|(c, q)| assert!((components[*c] - q).abs() < 1e-9, "whole structure constants"))
                .filter(|(_, q)| *q != 0.0)
                .map(|(c, q)| format!("({q})*e{}", c + 1))
                .collect();
            if !terms.is_empty() {
                text.push_str(&format!(" [e{}, e{}] = {};", a + 1, b + 1, terms.join(" + ")));
            }
        }
    }
    text + " }"
}

/// A group, with the declaration of its algebra where it has no name.
fn draw_group(draw: &mut Draw) -> (Group, String) {
    let named = |spelled: &str, basis: Vec<Matrix>| {
        (Group { spelled: spelled.to_owned(), basis, action: Vec::new(), right: false }, String::new())
    };
    let own = |basis: Vec<Matrix>| {
        let group = Group { spelled: "g".to_owned(), basis, action: Vec::new(), right: false };
        let text = declared("g", &group);
        (group, text)
    };
    let (mut group, text) = match draw.below(8) {
        0 => named("so(3)", so3(3)),
        1 => {
            let turn = matrix(3, &[(1, 0, 1.0), (0, 1, -1.0)]);
            named("se(2)", vec![turn, matrix(3, &[(0, 2, 1.0)]), matrix(3, &[(1, 2, 1.0)])])
        }
        2 => {
            let shifts = (0..3).map(|i| matrix(4, &[(i, 3, 1.0)]));
            named("se(3)", so3(4).into_iter().chain(shifts).collect())
        }
        3 => {
            named("heisenberg(1)", [(0, 1), (1, 2), (0, 2)].map(|(i, j)| matrix(3, &[(i, j, 1.0)])).to_vec())
        }
        4 => {
            let translations = [(3, 4), (5, 6)].map(|(i, j)| matrix(7, &[(i, j, 1.0)]));
            named("product(so(3), R^2)", so3(7).into_iter().chain(translations).collect())
        }
        // Bianchi VIII: sl(2).
        5 => own(vec![
            matrix(2, &[(0, 0, 1.0), (1, 1, -1.0)]),
            matrix(2, &[(0, 1, 1.0)]),
            matrix(2, &[(1, 0, 1.0)]),
        ]),
        // Bianchi I to VII: a flow on the plane and translations; the last two rows keep it faithful.
        _ => {
            let d = [0; 4].map(|_| draw.below(5) as f64 - 2.0);
            let flow = [(0, 0, d[0]), (0, 1, d[1]), (1, 0, d[2]), (1, 1, d[3]), (3, 4, 1.0)];
            own(vec![matrix(5, &flow), matrix(5, &[(0, 2, 1.0)]), matrix(5, &[(1, 2, 1.0)])])
        }
    };
    group.right = draw.chance(50);
    if draw.chance(40) {
        group.action = if group.basis[0].len() <= 4 && draw.chance(60) {
            group.basis.clone()
        } else {
            // The adjoint action.
            let n = group.basis.len();
            (0..n)
                .map(|a| {
                    let columns: Matrix = (0..n).map(|b| group.bracket(a, b)).collect();
                    (0..n).map(|i| columns.iter().map(|column| column[i]).collect()).collect()
                })
                .collect()
        };
    }
    (group, text)
}

/// What coefficients may contain.
#[derive(Clone, Copy)]
struct Allowed {
    advected: bool,
    time: bool,
}

/// A random system, and what the text needs besides.
struct Drawn {
    system: System,
    declaration: String,
    /// `A(x, t)`, `[dim G][n]`.
    connection: Vec<Vec<Expr>>,
    /// Whether the multiplier form is asked for.
    multipliers: bool,
    /// Whether the Hessian contains velocities.
    quartic: bool,
}

struct Maker<'a> {
    draw: &'a mut Draw,
    n: usize,
    n_advected: usize,
}

impl Maker<'_> {
    /// A function of place and time.
    fn field(&mut self, allowed: Allowed) -> Expr {
        let mut symbols: Vec<Sym> = (0..self.n).flat_map(|i| [Sym::X(i), Sym::X(i)]).collect();
        symbols.extend((0..self.n_advected).filter(|_| allowed.advected).map(Sym::A));
        symbols.extend(allowed.time.then_some(Sym::T));
        if symbols.is_empty() {
            return self.draw.tenths(-9, 9);
        }
        let symbol = |maker: &mut Self| Expr::Sym(maker.draw.one_of(&symbols));
        let varying = match self.draw.below(4) {
            0 => Expr::Sin(Box::new(symbol(self))),
            1 => Expr::Cos(Box::new(symbol(self))),
            2 => symbol(self).times(symbol(self)),
            _ => symbol(self),
        };
        Expr::Sum(vec![self.draw.tenths(-9, 9), self.draw.tenths(-6, 6).times(varying)])
    }

    fn coefficient(&mut self, allowed: Allowed) -> Expr {
        if self.draw.chance(35) { self.draw.tenths(-9, 9) } else { self.field(allowed) }
    }

    fn velocities(&self, dim: usize) -> Vec<Expr> {
        let base = (0..self.n).map(|i| Expr::Sym(Sym::XDot(i)));
        base.chain((0..dim).map(|k| Expr::Sym(Sym::Xi(k)))).collect()
    }

    /// A form with some coefficients, one of them along the group.
    fn form(&mut self, dim: usize, allowed: Allowed) -> Vec<Expr> {
        let mut form = vec![Expr::zero(); self.n + dim];
        let main = self.n + self.draw.below(dim);
        form[main] = self.draw.tenths(5, 15);
        if self.draw.chance(40) {
            form[main] = Expr::Sum(vec![self.draw.tenths(10, 20), self.field(allowed)]);
        }
        for _ in 0..1 + self.draw.below(2) {
            let k = self.draw.below(form.len());
            if k != main {
                form[k] = self.coefficient(allowed);
            }
        }
        form
    }
}

fn contract(form: &[Expr], velocities: &[Expr]) -> Expr {
    let is_there = |e: &Expr| !matches!(e, Expr::Tenths(0));
    let terms = form.iter().zip(velocities).filter(|(f, _)| is_there(f));
    Expr::Sum(terms.map(|(f, v)| f.clone().times(v.clone())).collect())
}

fn draw_system(draw: &mut Draw) -> Drawn {
    let (group, declaration) = draw_group(draw);
    let dim = group.basis.len();
    let n = draw.below(3);
    let n_advected = group.action.first().map_or(0, Vec::len);
    let time = draw.chance(50);
    let (metric_with_a, form_with_a) = (draw.chance(15), draw.chance(20));
    let mut maker = Maker { draw, n, n_advected };
    let fields = Allowed { advected: true, time };
    let in_metric = Allowed { advected: metric_with_a, time };
    let in_forms = Allowed { advected: form_with_a, time };
    let velocities = maker.velocities(dim);
    let mut terms: Vec<Expr> = (velocities.iter())
        .map(|v| Expr::Product(vec![maker.draw.tenths(5, 12), Expr::Square(Box::new(v.clone()))]))
        .collect();
    for _ in 0..1 + maker.draw.below(2) {
        let form = maker.form(dim, in_metric);
        let along = contract(&form, &velocities);
        terms.push(Expr::Tenths(5).times(Expr::Square(Box::new(along))));
    }
    let quartic = maker.draw.chance(12);
    if quartic {
        let square = maker.form(dim, in_metric);
        let square = Expr::Square(Box::new(contract(&square, &velocities)));
        terms.push(Expr::Tenths(1).times(Expr::Square(Box::new(square))));
    }
    if maker.draw.chance(40) {
        let k = maker.draw.below(velocities.len());
        terms.push(maker.field(fields).times(velocities[k].clone()));
    }
    terms.push(Expr::Tenths(-10).times(maker.field(fields)));
    let forces = (0..n + dim)
        .map(|k| match maker.draw.below(5) {
            0 => maker.draw.tenths(-5, 5).times(velocities[k].clone()),
            1 => maker.field(fields),
            _ => Expr::zero(),
        })
        .collect();
    // Conditions, at most as many as leave a velocity of the group.
    let n_conditions = maker.draw.below(3).min(dim - 1);
    let style = maker.draw.below(6);
    let conditions: Vec<Condition> = (0..n_conditions)
        .map(|k| {
            let form = maker.form(dim, in_forms);
            let linear = contract(&form, &velocities);
            match style {
                0 | 1 => Condition::Velocities(linear),
                2 => Condition::Velocities(Expr::Sum(vec![linear, maker.field(in_forms)])),
                3 if k == 0 => {
                    let other = maker.draw.one_of(&velocities);
                    let square = maker.draw.tenths(1, 4).times(Expr::Square(Box::new(other)));
                    Condition::Velocities(Expr::Sum(vec![linear, square, maker.draw.tenths(-9, -3)]))
                }
                4 => {
                    let rest = vec![linear, maker.field(in_forms), maker.draw.one_of(&velocities)];
                    Condition::Accelerations { form: maker.form(dim, in_forms), rest: Expr::Sum(rest) }
                }
                _ => Condition::Velocities(linear),
            }
        })
        .collect();
    let displacements = (n_conditions > 0 && maker.draw.chance(35)).then(|| {
        let turning = maker.draw.chance(15);
        let mut forms: Vec<Vec<Expr>> = (0..n_conditions).map(|_| maker.form(dim, in_forms)).collect();
        if turning {
            let k = maker.draw.below(n + dim);
            let along = maker.draw.tenths(1, 4).times(maker.draw.one_of(&velocities));
            forms[0][k] = Expr::Sum(vec![forms[0][k].clone(), along]);
        }
        forms
    });
    let connection = (0..dim)
        .map(|_| (0..n).map(|_| maker.coefficient(Allowed { advected: false, time })).collect())
        .collect();
    let multipliers = n_conditions > 0 && maker.draw.chance(20);
    let system = System { n, group, lagrangian: Expr::Sum(terms), forces, conditions, displacements };
    Drawn { system, declaration, connection, multipliers, quartic }
}

/// How a model is written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Written {
    /// With the group velocity.
    Plain,
    /// With `v = xi + A(x, t) xdot` for a connection that is given.
    Given,
    /// With a connection to be derived.
    Derived(ConnectionKind),
}

const WAYS: [Written; 5] = [
    Written::Plain,
    Written::Given,
    Written::Derived(ConnectionKind::Trivial),
    Written::Derived(ConnectionKind::Mechanical),
    Written::Derived(ConnectionKind::Nonholonomic),
];

impl Drawn {
    fn text(&self, way: Written) -> String {
        let System { n, group, .. } = &self.system;
        let dim = group.basis.len();
        let lift = |k: usize| {
            let terms = (0..*n).map(|i| self.connection[k][i].clone().times(Expr::Sym(Sym::XDot(i))));
            Expr::Sum(terms.collect())
        };
        let given = way == Written::Given;
        let mut text = format!("model random {{\n    {}\n", self.declaration);
        let names = |prefix: &str, n: usize| (1..=n).map(|k| format!("{prefix}{k}")).collect::<Vec<_>>();
        if *n > 0 {
            text.push_str(&format!("    coordinate {} in real;\n", names("x", *n).join(", ")));
        }
        text.push_str(&format!("    velocity {} in {};\n", names("y", dim).join(", "), group.spelled));
        text.push_str(if group.right { "    action right;\n" } else { "    action left;\n" });
        for k in 0..dim {
            if given {
                text.push_str(&format!("    connection y{} = {};\n", k + 1, lift(k).text()));
                text.push_str(&format!("    let w{0} = y{0} - {1};\n", k + 1, lift(k).text()));
            } else {
                text.push_str(&format!("    let w{0} = y{0};\n", k + 1));
            }
        }
        if let Written::Derived(kind) = way {
            text.push_str(&format!("    connection {};\n", kind.name()));
        }
        if let Some(size) = group.action.first().map(Vec::len) {
            let component = |i: usize| {
                let terms = group.action.iter().enumerate().flat_map(|(b, m)| {
                    let entries = m[i].iter().enumerate().filter(|(_, q)| **q != 0.0);
                    entries.map(move |(j, q)| format!("({q})*y{}*a{}", b + 1, j + 1))
                });
                let terms: Vec<String> = terms.collect();
                if terms.is_empty() { "0".to_owned() } else { terms.join(" + ") }
            };
            let components: Vec<String> = (0..size).map(component).collect();
            text.push_str(&format!("    advected a in R^{size} by [{}];\n", components.join(", ")));
        }
        text.push_str(&format!("    lagrangian = {};\n", self.system.lagrangian.text()));
        // (F_x - A^T F_xi) dx + F_xi (xi + A dx)
        for (i, force) in self.system.forces[..*n].iter().enumerate() {
            let mut terms = vec![force.clone()];
            for (k, along) in self.system.forces[*n..].iter().enumerate().filter(|_| given) {
                terms.push(Expr::Product(vec![
                    Expr::Tenths(-10),
                    self.connection[k][i].clone(),
                    along.clone(),
                ]));
            }
            text.push_str(&format!("    force x{}_dot = {};\n", i + 1, Expr::Sum(terms).text()));
        }
        for (k, force) in self.system.forces[*n..].iter().enumerate() {
            text.push_str(&format!("    force y{} = {};\n", k + 1, force.text()));
        }
        // `delta` or `ddt` of a form's velocities, of which `w = y - A xdot`.
        let applied = |function: &str, form: &[Expr]| {
            let mut terms = Vec::new();
            for (j, f) in form.iter().enumerate().filter(|(_, f)| !matches!(f, Expr::Tenths(0))) {
                let f = f.text();
                if j < *n {
                    terms.push(format!("{f}*{function}(x{}_dot)", j + 1));
                    continue;
                }
                terms.push(format!("{f}*{function}(y{})", j - n + 1));
                for i in (0..*n).filter(|_| given) {
                    let a = &self.connection[j - n][i];
                    terms.push(format!("(-{f})*{}*{function}(x{}_dot)", a.text(), i + 1));
                    if function == "ddt" {
                        let flow = (0..*n).map(|l| a.derivative(Sym::X(l)).times(Expr::Sym(Sym::XDot(l))));
                        let rate = Expr::Sum(flow.chain([a.derivative(Sym::T)]).collect());
                        terms.push(format!("(-{f})*{}*x{}_dot", rate.text(), i + 1));
                    }
                }
            }
            terms.join(" + ")
        };
        for condition in &self.system.conditions {
            match condition {
                Condition::Velocities(phi) => text.push_str(&format!("    constraint {} = 0;\n", phi.text())),
                Condition::Accelerations { form, rest } => {
                    text.push_str(&format!(
                        "    constraint {} + {} = 0;\n",
                        applied("ddt", form),
                        rest.text()
                    ));
                }
            }
        }
        for form in self.system.displacements.iter().flatten() {
            text.push_str(&format!("    virtual {} = 0;\n", applied("delta", form)));
        }
        if self.multipliers {
            text.push_str("    multipliers;\n");
        }
        let all = (1..=*n).map(|i| format!("x{i}_dot")).chain(names("w", dim));
        text.push_str(&format!("    output z = [{}];\n", all.collect::<Vec<_>>().join(", ")));
        text + "    scene check { want rhs, energy, z; }\n    scene derivatives { want rhs, jacobian, vjp; }\n}\n"
    }

    /// A random point on the conditions on velocities, by Newton's method.
    fn point(&self, draw: &mut Draw) -> Option<Point<f64>> {
        let system = &self.system;
        let dim = system.group.basis.len();
        let mut at = Point {
            x: draw.numbers(system.n),
            x_dot: draw.numbers(system.n),
            xi: draw.numbers(dim),
            a: draw.numbers(system.group.action.first().map_or(0, Vec::len)),
            t: draw.number(),
        };
        let phis: Vec<&Expr> = (system.conditions.iter())
            .filter_map(|c| match c {
                Condition::Velocities(phi) => Some(phi),
                Condition::Accelerations { .. } => None,
            })
            .collect();
        for _ in 0..30 {
            let found: Vec<(f64, Vec<f64>)> = phis.iter().map(|phi| system.residual(phi, &at)).collect();
            let size = found.iter().fold(0.0, |a: f64, (r, _)| a.max(r.abs()));
            if !size.is_finite() {
                return None;
            }
            if size < 1e-15 {
                return Some(at);
            }
            // The shortest step: w^T (w w^T)^-1 phi.
            let gram = found
                .iter()
                .map(|(_, v)| found.iter().map(|(_, w)| unreduced::dot(v, w)).collect())
                .collect();
            let inverse = unreduced::inverse(&gram)?;
            let residuals: Vec<f64> = found.iter().map(|(r, _)| *r).collect();
            for (row, (_, slopes)) in inverse.iter().zip(&found) {
                let by = unreduced::dot(row, &residuals);
                let velocities = at.x_dot.iter_mut().chain(&mut at.xi);
                velocities.zip(slopes).for_each(|(v, slope)| *v -= by * slope);
            }
        }
        Some(at).filter(|at| phis.iter().all(|phi| system.residual(phi, at).0.abs() < 1e-13))
    }
}

/// Step and weights of central differences of order eight.
const STEP: f64 = 1.0 / 64.0;
const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];

/// The derivative of `f` along the flow.
fn along_flow(t: f64, y: &[f64], dy: &[f64], f: impl Fn(f64, &[f64]) -> Vec<f64>) -> Vec<f64> {
    let mut total: Vec<f64> = f(t, y).iter().map(|_| 0.0).collect();
    for (k, weight) in WEIGHTS.iter().enumerate() {
        for sign in [1.0, -1.0] {
            let s = sign * STEP * (k + 1) as f64;
            let moved: Vec<f64> = y.iter().zip(dy).map(|(y, dy)| y + s * dy).collect();
            for (sum, value) in total.iter_mut().zip(f(t + s, &moved)) {
                *sum += sign * weight * value / STEP;
            }
        }
    }
    total
}

/// `A(x, t)` of a model, by component of the algebra and coordinate.
fn connection_at(model: &Model, at: &Point<f64>) -> Matrix {
    let Some(connection) = &model.connection else {
        return vec![vec![0.0; model.base.len()]; model.algebra.dim()];
    };
    let mut values: BTreeMap<SymbolId, f64> = BTreeMap::from([(model.time, at.t)]);
    values.extend(model.base.iter().zip(&at.x).map(|(c, x)| (c.symbol, *x)));
    let value = |e| model.graph.eval_f64(e, &values).expect("A is made of x and t");
    connection.iter().map(|row| row.iter().map(|e| value(*e)).collect()).collect()
}

/// Accelerations of both have some ten digits in common: differences of outputs lose some, and so do multipliers.
const CLOSE: f64 = 1e-8;

fn compare(what: &str, found: &[f64], expected: &[f64], scale: f64, text: &str) {
    assert_eq!(found.len(), expected.len(), "{what}\n{text}");
    for (a, b) in found.iter().zip(expected) {
        let error = (a - b).abs();
        assert!(error <= CLOSE * scale, "{what}: {found:?} instead of {expected:?}\n{text}");
    }
}

/// Holds one point of a model to the unreduced equations; false where it is refused as singular.
fn check_point(
    built: &BuiltScene,
    interpreter: &Interpreter,
    connection: &Matrix,
    (at, motion): (&Point<f64>, &Motion),
    text: &str,
) -> bool {
    let number = |name: &str, prefix: &str| name.strip_prefix(prefix)?.parse::<usize>().ok();
    let lifted: Vec<f64> =
        at.xi.iter().zip(connection).map(|(xi, row)| xi + unreduced::dot(row, &at.x_dot)).collect();
    let names = built.state_names();
    let value = |name: &String| {
        let rate = name.strip_suffix("_dot").and_then(|name| number(name, "x")).map(|i| at.x_dot[i - 1]);
        rate.or_else(|| number(name, "x").map(|i| at.x[i - 1]))
            .or_else(|| number(name, "y").map(|k| lifted[k - 1]))
            .or_else(|| number(name, "a").map(|k| at.a[k - 1]))
            .unwrap_or_else(|| panic!("what is {name}?"))
    };
    let y: Vec<f64> = names.iter().map(value).collect();
    if interpreter.check(at.t, &y).is_err() {
        return false;
    }
    let mut dy = vec![0.0; y.len()];
    interpreter.rhs(at.t, &y, &mut dy);
    let velocities: Vec<f64> = at.x_dot.iter().chain(&at.xi).copied().collect();
    let size = |list: &[f64]| list.iter().fold(1.0, |a: f64, x| a.max(x.abs()));
    compare("velocities", &interpreter.outputs(at.t, &y), &velocities, size(&velocities), text);
    let found = along_flow(at.t, &y, &dy, |t, y| interpreter.outputs(t, y));
    let scale = size(&motion.accelerations) * size(&connection.concat()) / motion.definite.min(1.0);
    compare("accelerations", &found, &motion.accelerations, scale, text);
    for (name, rate) in names.iter().zip(&dy) {
        if let Some(k) = number(name, "a") {
            compare(name, &[*rate], &[motion.advected[k - 1]], size(&motion.advected), text);
        } else if let Some(i) = number(name, "x") {
            compare(name, &[*rate], &[at.x_dot[i - 1]], size(&velocities), text);
        }
    }
    let energy = interpreter.energy(at.t, &y).expect("it is wanted");
    compare("energy", &[energy], &[motion.energy], size(&[energy]) * 10.0, text);
    let facts = &built.equations().facts;
    if facts.energy_is_conserved || facts.energy_is_conserved_on_constraint {
        let rate = along_flow(at.t, &y, &dy, |t, y| vec![interpreter.energy(t, y).expect("it is wanted")]);
        compare("rate of energy that is conserved", &rate, &[0.0], size(&[energy]) * scale, text);
    }
    true
}

#[derive(Debug, Default)]
struct Counts {
    models: usize,
    compared: BTreeMap<String, usize>,
    refused: usize,
    singular: usize,
}

/// Why a derived connection may be refused.
fn may_be_refused(drawn: &Drawn, kind: ConnectionKind, message: &str, at: &Point<f64>) -> bool {
    let system = &drawn.system;
    let advected = |e: &Expr| e.contains(&|s| matches!(s, Sym::A(_)));
    let moves = |e: &Expr| e.contains(&|s| matches!(s, Sym::XDot(_) | Sym::Xi(_)));
    let forms = system.displacements.iter().flatten().flatten();
    let through = system.conditions.iter().any(|c| match c {
        Condition::Velocities(phi) => advected(phi) || phi.contains(&|_| true) && !is_affine(phi),
        Condition::Accelerations { form, .. } => form.iter().any(advected),
    });
    let nonholonomic = kind == ConnectionKind::Nonholonomic;
    if message.contains("depends on the velocity") {
        return drawn.quartic || nonholonomic && (through || forms.clone().any(moves));
    }
    if message.contains("depends on the advected parameter") {
        return advected(&system.lagrangian) || nonholonomic && (through || forms.clone().any(advected));
    }
    if message.contains("leave all base velocities independent") && nonholonomic {
        // The forms do not determine that many velocities of the group.
        let forms = system.forms(at);
        let vertical: Matrix = forms.iter().map(|form| form[system.n..].to_vec()).collect();
        let gram = vertical.iter().map(|v| vertical.iter().map(|w| unreduced::dot(v, w)).collect()).collect();
        return unreduced::inverse(&gram).is_none_or(|m| m.iter().flatten().any(|q| q.abs() > 1e9));
    }
    false
}

/// Whether a condition has no square of a velocity.
fn is_affine(phi: &Expr) -> bool {
    match phi {
        Expr::Sum(parts) => parts.iter().all(is_affine),
        Expr::Product(parts) => parts.iter().all(is_affine),
        Expr::Square(e) => !e.contains(&|s| matches!(s, Sym::XDot(_) | Sym::Xi(_))),
        _ => true,
    }
}

/// Of so many models one has derivatives, which take longer than everything else.
const SEEDS_EACH: u64 = 8;

fn run(seed: u64, every_way: bool, counts: &mut Counts) {
    let mut draw = Draw::new(seed);
    let drawn = draw_system(&mut draw);
    let mut points = Vec::new();
    for _ in 0..12 {
        let Some(at) = drawn.point(&mut draw) else { continue };
        let motion = drawn.system.motion(&at);
        points.extend(motion.filter(|m| m.definite > 1e-3).map(|m| (at, m)));
        if points.len() == 2 {
            break;
        }
    }
    let Some((first, _)) = points.first() else { return };
    let mut compared = false;
    let several = drawn.system.n > 0 && (every_way || drawn.system.dim() <= MAX_VELOCITIES);
    for way in WAYS.into_iter().filter(|way| several || *way == Written::Plain) {
        let text = format!("seed {seed}, {way:?}\n{}", drawn.text(way));
        let model = spec::parse("random.hamel", &drawn.text(way)).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let built = match (scene::build(&model, "check"), way) {
            (Ok(built), _) => built,
            (Err(problems), Written::Derived(kind))
                if may_be_refused(&drawn, kind, &problems.to_string(), first) =>
            {
                counts.refused += 1;
                continue;
            }
            (Err(problems), _) => panic!("{problems}\n{text}"),
        };
        let connected = match way {
            Written::Derived(kind) => {
                let plain = Model { derived_connection: None, ..model.clone() };
                with_connection(&plain, kind).unwrap_or_else(|e| panic!("{e}\n{text}"))
            }
            _ => model.clone(),
        };
        // Derivatives are held to the rates where they are built.
        if seed.is_multiple_of(SEEDS_EACH) {
            scene::build(&model, "derivatives").unwrap_or_else(|e| panic!("{e}\n{text}"));
        }
        let interpreter = built.prepare(&[]).unwrap_or_else(|e| panic!("{e}\n{text}"));
        for (at, motion) in &points {
            let connection = connection_at(&connected, at);
            if check_point(&built, &interpreter, &connection, (at, motion), &text) {
                *counts.compared.entry(format!("{way:?}")).or_default() += 1;
                compared = true;
            } else {
                counts.singular += 1;
            }
        }
    }
    counts.models += usize::from(compared);
}

fn from_environment(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|text| text.parse().ok())
}

#[test]
fn random_models_move_as_their_unreduced_equations_say() {
    let asked_for = from_environment("HAMEL_RANDOM_MODELS");
    let n = asked_for.map_or(N_MODELS, |n| usize::try_from(n).expect("a number"));
    let first = from_environment("HAMEL_RANDOM_SEED").unwrap_or(0);
    let mut counts = Counts::default();
    let mut failed = Vec::new();
    for seed in first..first + n as u64 {
        // Every failure prints its seed and its text; the others go on.
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            run(seed, asked_for.is_some(), &mut counts)
        }));
        failed.extend(outcome.is_err().then_some(seed));
    }
    assert_eq!(failed, [0_u64; 0], "seeds of models that move otherwise");
    println!("{counts:?}");
    if n < N_MODELS {
        // One seed that is looked at again.
        return;
    }
    // A test that compares nothing shows nothing.
    assert!(counts.models * 10 >= n * 9, "{counts:?}");
    for (way, least) in [("Plain", 15), ("Given", 9), ("Trivial", 9), ("Mechanical", 6), ("Nonholonomic", 5)]
    {
        let found: usize =
            counts.compared.iter().filter(|(name, _)| name.contains(way)).map(|(_, n)| n).sum();
        assert!(found * 10 >= n * least, "{way}: {counts:?}");
    }
}

#[test]
fn the_unreduced_equations_are_eulers_for_a_free_body_and_tell_left_from_right() {
    let inertia = [5, 12, 20];
    let square = |(k, i): (usize, &i64)| {
        let velocity = Expr::Square(Box::new(Expr::Sym(Sym::Xi(k))));
        Expr::Product(vec![Expr::Tenths(5), Expr::Tenths(*i), velocity])
    };
    let lagrangian = Expr::Sum(inertia.iter().enumerate().map(square).collect());
    let [a, b, c] = inertia.map(|i| i as f64 / 10.0);
    for right in [false, true] {
        let group = Group { spelled: "so(3)".into(), basis: so3(3), action: Vec::new(), right };
        let lagrangian = lagrangian.clone();
        let forces = vec![Expr::zero(); 3];
        let body = System { n: 0, group, lagrangian, forces, conditions: Vec::new(), displacements: None };
        let w = vec![0.7, -0.4, 1.1];
        let at = Point { x: Vec::new(), x_dot: Vec::new(), xi: w.clone(), a: Vec::new(), t: 0.0 };
        let found = body.motion(&at).expect("a body has inertia");
        let side = if right { -1.0 } else { 1.0 };
        let expected = [(b - c) * w[1] * w[2] / a, (c - a) * w[2] * w[0] / b, (a - b) * w[0] * w[1] / c];
        for (rate, expected) in found.accelerations.iter().zip(expected) {
            assert!((rate - side * expected).abs() < 1e-14, "{found:?}");
        }
    }
    // So do the random ones, unless their group commutes or is at rest.
    let mut told = 0;
    for seed in 0..20 {
        let mut draw = Draw::new(seed);
        let mut drawn = draw_system(&mut draw);
        let Some(at) = drawn.point(&mut draw) else { continue };
        let Some(one) = drawn.system.motion(&at) else { continue };
        drawn.system.group.right ^= true;
        let other = drawn.system.motion(&at).map_or(Vec::new(), |m| m.accelerations);
        let apart = one.accelerations.iter().zip(&other).any(|(a, b)| (a - b).abs() > 1e-3);
        told += usize::from(apart);
    }
    assert!(told >= 15, "{told}");
}
