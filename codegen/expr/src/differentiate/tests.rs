use std::collections::BTreeMap;

use super::{Linear, Linearisation, Solved};
use crate::{Definition, ExprId, Func, Graph, Section, SectionWriter, SymbolId};

/// Definitions `p, q, s, u` over the inputs `x, y, z` and a constant `c`, with one function of each kind.
struct Fixture {
    g: Graph,
    inputs: Vec<SymbolId>,
    sections: Vec<Section>,
    roots: Vec<ExprId>,
}

fn fixture() -> Fixture {
    let mut g = Graph::new();
    let inputs: Vec<SymbolId> = ["x", "y", "z"].into_iter().map(|n| g.symbol(n)).collect();
    let constant = g.symbol("c");
    let c = g.sym(constant);
    let [x, y, z] = [0, 1, 2].map(|k| g.sym(inputs[k]));
    let mut definitions = Vec::new();
    let mut define = |g: &mut Graph, name: &str, expr: ExprId| {
        let symbol = g.define(name, expr);
        definitions.push(Definition { symbol, expr });
        g.sym(symbol)
    };
    // p = c x y + sin(x z)^2
    let xz = g.mul(x, z);
    let sine = g.func(Func::Sin, xz);
    let square = g.powi(sine, 2);
    let cxy = g.product(&[c, x, y]);
    let sum = g.add(cxy, square);
    let p = define(&mut g, "p", sum);
    // q = c + c^2, which no input moves.
    let c2 = g.powi(c, 2);
    let sum = g.add(c, c2);
    let q = define(&mut g, "q", sum);
    // s = p q / (z + q)^2
    let shifted = g.add(z, q);
    let inverse = g.powi(shifted, -2);
    let product = g.product(&[p, q, inverse]);
    let s = define(&mut g, "s", product);
    // u = sqrt(1 + y^2) exp(s) - y/s
    let y2 = g.powi(y, 2);
    let one = g.one();
    let sum = g.add(one, y2);
    let (root, exponential, quotient) = (g.sqrt(sum), g.func(Func::Exp, s), g.div(y, s).unwrap());
    let product = g.mul(root, exponential);
    let difference = g.sub(product, quotient);
    let u = define(&mut g, "u", difference);
    let last = g.mul(u, x);
    let roots = vec![u, q, last, y, s];
    let (first, second) = definitions.split_at(2);
    let section =
        |title: &str, list: &[Definition]| Section { title: title.into(), definitions: list.to_vec() };
    Fixture { g, inputs, sections: vec![section("first", first), section("second", second)], roots }
}

/// An expression with the definitions of all sections put in.
fn explicit(g: &mut Graph, sections: &[Section], roots: &[ExprId]) -> Vec<ExprId> {
    let mut values: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
    for definition in sections.iter().flat_map(|s| &s.definitions) {
        let value = g.subs(definition.expr, &values).unwrap();
        values.insert(definition.symbol, value);
    }
    g.subs_all(roots, &values).unwrap()
}

/// The definitions of the fixture with those of its derivatives.
fn with_derivatives(sections: &[Section], writer: SectionWriter) -> Vec<Section> {
    sections.iter().cloned().chain(writer.finish().0).collect()
}

fn title(of: &str) -> String {
    format!("d {of}")
}

#[test]
fn the_jacobian_is_the_matrix_of_partial_derivatives() {
    let Fixture { mut g, inputs, sections, roots } = fixture();
    let plain = explicit(&mut g, &sections, &roots);
    let mut writer = SectionWriter::new(&g, inputs.iter().copied().collect(), &[]);
    let linear = Linearisation::new(&mut g, &sections, &roots, &inputs);
    let rows = linear.jacobian(&mut g, &mut writer, |value, x| format!("d_{value}_d_{x}"), title);
    let sections = with_derivatives(&sections, writer);
    let mut n_zeros = 0;
    for (e, row) in plain.iter().zip(&rows) {
        let found = explicit(&mut g, &sections, row);
        for (x, found) in inputs.iter().zip(found) {
            let expected = g.diff(*e, *x);
            assert!(g.is_equal(found, expected));
            n_zeros += usize::from(found == g.zero());
        }
    }
    // q depends on nothing, y on itself alone.
    assert_eq!(n_zeros, 5);
    assert!(sections.iter().any(|s| s.title == "d second"));
}

#[test]
fn tangents_and_adjoints_are_products_with_the_jacobian() {
    let Fixture { mut g, inputs, sections, roots } = fixture();
    let plain = explicit(&mut g, &sections, &roots);
    let symbols = |g: &mut Graph, letter: &str, n: usize| -> Vec<ExprId> {
        let symbols: Vec<SymbolId> = (0..n).map(|k| g.symbol(&format!("{letter}{k}"))).collect();
        symbols.into_iter().map(|s| g.sym(s)).collect()
    };
    let (v, w) = (symbols(&mut g, "v", inputs.len()), symbols(&mut g, "w", roots.len()));
    let mut writer = SectionWriter::new(&g, inputs.iter().copied().collect(), &[]);
    let linear = Linearisation::new(&mut g, &sections, &roots, &inputs);
    let name = |value: &str| format!("v_{value}");
    let tangents =
        linear.forward(&mut g, &mut writer, std::slice::from_ref(&v), |value, _| name(value), title);
    let adjoints = linear.reverse(&mut g, &mut writer, &w, name, title);
    let sections = with_derivatives(&sections, writer);
    for (e, tangent) in plain.iter().zip(&tangents) {
        let terms: Vec<ExprId> = inputs
            .iter()
            .zip(&v)
            .map(|(x, v)| {
                let d = g.diff(*e, *x);
                g.mul(d, *v)
            })
            .collect();
        let (expected, found) = (g.sum(&terms), explicit(&mut g, &sections, tangent)[0]);
        assert!(g.is_equal(found, expected));
    }
    let adjoints = explicit(&mut g, &sections, &adjoints);
    for (x, found) in inputs.iter().zip(adjoints) {
        let terms: Vec<ExprId> = plain
            .iter()
            .zip(&w)
            .map(|(e, w)| {
                let d = g.diff(*e, *x);
                g.mul(d, *w)
            })
            .collect();
        let expected = g.sum(&terms);
        assert!(g.is_equal(found, expected) && found != g.zero());
    }
}

#[test]
fn a_derivative_that_cancels_costs_nothing() {
    // d/dx (sin(x)^2 + cos(x)^2) is the zero of the graph, not an expression that evaluates to it.
    let mut g = Graph::new();
    let x = g.symbol("x");
    let e = g.sym(x);
    let (sine, cosine) = (g.func(Func::Sin, e), g.func(Func::Cos, e));
    let squares = [g.powi(sine, 2), g.powi(cosine, 2)];
    let one = g.sum(&squares);
    let mut writer = SectionWriter::new(&g, [x].into(), &[]);
    let linear = Linearisation::new(&mut g, &[], &[one], &[x]);
    let rows = linear.jacobian(&mut g, &mut writer, |value, x| format!("d_{value}_d_{x}"), title);
    assert_eq!(rows, [[g.zero()]]);
    assert!(writer.finish().0.is_empty());
}

#[test]
fn the_derivative_of_a_quotient_uses_its_value() {
    // l = x/d: dl = dx/d - (l/d) dd, with the definition l itself and no square of the divisor.
    let mut g = Graph::new();
    let [x, d] = ["x", "d"].map(|n| g.symbol(n));
    let (ex, ed) = (g.sym(x), g.sym(d));
    let quotient = g.div(ex, ed).unwrap();
    let l = g.define("l", quotient);
    let value = g.sym(l);
    let partials = g.partials(quotient, value);
    let inverse = g.powi(ed, -1);
    let by_divisor = g.mul(value, inverse);
    let by_divisor = g.neg(by_divisor);
    assert_eq!(partials, [(ex, inverse), (ed, by_divisor)]);
}

/// `A = [[a, b], [c, d]]` by Cramer's rule.
struct Cramer([[ExprId; 2]; 2]);

impl Cramer {
    fn solve_by(&self, g: &mut Graph, [[p, q], [r, s]]: [[ExprId; 2]; 2], b: &[ExprId]) -> Vec<ExprId> {
        let (ps, qr) = (g.mul(p, s), g.mul(q, r));
        let determinant = g.sub(ps, qr);
        let inverse = g.powi(determinant, -1);
        let of = |g: &mut Graph, [u, x, v, y]: [ExprId; 4]| {
            let (plus, minus) = (g.mul(u, x), g.mul(v, y));
            let difference = g.sub(plus, minus);
            g.mul(difference, inverse)
        };
        vec![of(g, [s, b[0], q, b[1]]), of(g, [p, b[1], r, b[0]])]
    }
}

impl Linear for Cramer {
    fn solve(&self, g: &mut Graph, _: &mut SectionWriter, _: &[String], b: &[ExprId]) -> Vec<ExprId> {
        self.solve_by(g, self.0, b)
    }

    fn solve_transposed(
        &self,
        g: &mut Graph,
        _: &mut SectionWriter,
        _: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        let [[p, q], [r, s]] = self.0;
        self.solve_by(g, [[p, r], [q, s]], b)
    }
}

/// `[[1 + x^2, y], [x y, 2 + y^2]] u = (sin x, x + y)`, with the results `u0 u1 + x` and `u0 - u1`, and a sum of the
/// solution that the residual needs at the solution held.
#[test]
fn a_solution_is_differentiated_by_its_system() {
    let mut g = Graph::new();
    let inputs = ["x", "y"].map(|name| g.symbol(name));
    let [x, y] = inputs.map(|s| g.sym(s));
    let one = g.one();
    let two = g.add(one, one);
    let (xx, yy, xy) = (g.powi(x, 2), g.powi(y, 2), g.mul(x, y));
    let matrix = [[g.add(one, xx), y], [xy, g.add(two, yy)]];
    let force = [g.func(Func::Sin, x), g.add(x, y)];
    let cramer = Cramer(matrix);
    let values = cramer.solve_by(&mut g, matrix, &force);
    let symbols = [0, 1].map(|k| g.define(&format!("u{k}"), values[k]));
    let u = symbols.map(|s| g.sym(s));
    let section = |title: &str, list: &[(SymbolId, ExprId)]| Section {
        title: title.into(),
        definitions: list.iter().map(|(symbol, expr)| Definition { symbol: *symbol, expr: *expr }).collect(),
    };
    let sections = [section("solution", &[(symbols[0], values[0]), (symbols[1], values[1])])];
    let difference = g.sub(u[0], u[1]);
    let product = g.mul(u[0], u[1]);
    let roots = [g.add(product, x), difference];
    // r0 = (1 + x^2) u0 + y u1 - sin x, where u0 is (u0 - u1) + u1, and r1 has u1 by another name.
    let again = g.add(difference, u[1]);
    let [sum, held] = [("sum", again), ("held", u[1])].map(|(name, e)| (g.define(name, e), e));
    let [u0, u1] = [sum, held].map(|(symbol, _)| g.sym(symbol));
    let mut residual = Vec::new();
    for ((row, force), u1) in matrix.iter().zip(force).zip([u[1], u1]) {
        let terms = [g.mul(row[0], u0), g.mul(row[1], u1), g.neg(force)];
        residual.push(g.sum(&terms));
    }
    let solved = Solved {
        symbols: vec![(symbols[0], 0), (symbols[1], 1)],
        residual,
        held: section("held", &[held]),
        sections: vec![section("balance", &[sum])],
        labels: vec!["u0".into(), "u1".into()],
    };
    let plain = explicit(&mut g, &sections, &roots);
    let linear = Linearisation::with_solved(&mut g, &sections, &roots, &inputs, Some((&solved, &cramer)));
    let mut writer = SectionWriter::new(&g, inputs.into(), &[]);
    let rows = linear.jacobian(&mut g, &mut writer, |value, x| format!("d_{value}_d_{x}"), title);
    let covectors = [[one, g.zero()], [g.zero(), one]];
    let pulled = covectors.map(|w| linear.reverse(&mut g, &mut writer, &w, |v| format!("w_{v}"), title));
    let all: Vec<Section> =
        [&sections[..], std::slice::from_ref(&solved.held), &solved.sections, &writer.finish().0].concat();
    for (k, e) in plain.iter().enumerate() {
        for (j, x) in inputs.iter().enumerate() {
            let expected = g.diff(*e, *x);
            for found in [rows[k][j], pulled[k][j]] {
                let found = explicit(&mut g, &all, &[found])[0];
                assert!(found != g.zero() && g.is_equal(found, expected), "row {k}, column {j}");
            }
        }
    }
}
