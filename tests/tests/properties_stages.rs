//! Reduction by stages: what is split is rebuilt exactly, and the staged vertical equations are the unstaged ones.

use hamel_expr::{ExprId, Graph, Rational};
use hamel_lang::algebra::LieAlgebra;
use hamel_mechanics::reduction::{Stages, Tensor};
use hamel_tests::algebras::{FAMILIES, Family, Transported, ad_star, product_metric};
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::{
    Rows, Vector, add_scaled, dot, int, is_identity, product, spans, times, transposed,
};
use hamel_tests::stages::chain_exprs;
use num_traits::Zero;

const CASES: u32 = 2;
const NUMBERS: usize = 900;

fn exprs(g: &mut Graph, v: &[Rational]) -> Vec<ExprId> {
    v.iter().map(|q| g.rational(q.clone())).collect()
}

fn expr_rows(g: &mut Graph, rows: &[Vector]) -> Vec<Vec<ExprId>> {
    rows.iter().map(|row| exprs(g, row)).collect()
}

/// The exact numbers behind constant expressions.
fn numbers(g: &Graph, list: &[ExprId]) -> Vector {
    list.iter().map(|e| g.as_rational(*e).expect("rational data give rational results").clone()).collect()
}

fn split(g: &mut Graph, algebra: &LieAlgebra, chain: &[Rows], metric: &[Vector]) -> Stages {
    let metric = expr_rows(g, metric);
    let ideals = chain_exprs(g, chain);
    Stages::split(g, &algebra.clone().into(), &Transported::stage_names(chain), &ideals, Some(&metric))
        .unwrap_or_else(|errors| panic!("{} does not split: {errors:?}", algebra.name()))
}

/// Every family, every chain, random basis and inner product.
fn for_all_chains(test: impl Fn(&Family, &Transported, &[Rows], Draws)) {
    for make in FAMILIES {
        let name = make(&mut one(1, 60)).name;
        for_all(name, CASES, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            let transported = Transported::new(&family, &mut draws);
            assert!(transported.algebra.brackets().next().is_some(), "{name} is abelian");
            for chain in &transported.chains {
                test(&family, &transported, chain, draws.clone());
            }
            Ok(())
        });
    }
}

#[test]
fn rebuilt_bracket_is_the_bracket_of_the_algebra() {
    for_all_chains(|family, transported, chain, mut draws| {
        let mut g = Graph::new();
        let stages = split(&mut g, &transported.algebra, chain, &transported.metric);
        let forms: usize =
            stages.levels.iter().map(|l| l.curvature.len() + l.vertical_connection.len()).sum();
        assert!(forms > 0, "{}: neither a nor b has an entry", family.name);
        let basis: Rows = stages.basis.iter().map(|row| numbers(&g, row)).collect();
        let inverse: Rows = stages.inverse.iter().map(|row| numbers(&g, row)).collect();
        assert!(is_identity(&product(&inverse, &basis)), "{}: the inverse is none", family.name);
        let n = basis.len();
        let (x, y) = (draws.vector(n), draws.vector(n));
        let (ex, ey) = (exprs(&mut g, &x), exprs(&mut g, &y));
        let rebuilt = stages.rebuilt_bracket(&mut g, &ex, &ey);
        let rebuilt = numbers(&g, &rebuilt);
        let columns = transposed(&basis);
        let expected = transported.bracket(&times(&columns, &x), &times(&columns, &y));
        assert_eq!(times(&columns, &rebuilt), expected, "{}", family.name);
    });
}

#[test]
fn levels_are_orthogonal_complements_and_forms_are_curvature_and_quotient_bracket() {
    for_all_chains(|family, transported, chain, _| {
        let mut g = Graph::new();
        let stages = split(&mut g, &transported.algebra, chain, &transported.metric);
        let basis: Rows = stages.basis.iter().map(|row| numbers(&g, row)).collect();
        assert_eq!(stages.levels.len(), chain.len() + 1);
        for (j, level) in stages.levels.iter().enumerate() {
            let below: &[Vector] = chain.get(j).map_or(&[], Vec::as_slice);
            for k in level.range.clone() {
                assert!(j == 0 || spans(&chain[j - 1], &basis[k]), "{}: outside its stage", family.name);
                for v in below {
                    assert!(transported.inner(v, &basis[k]).is_zero(), "{}: not orthogonal", family.name);
                }
            }
            for p in level.range.clone() {
                for q in level.range.clone().filter(|q| *q > p) {
                    let vector = |tensor: &Tensor| {
                        let mut sum = vec![int(0); basis.len()];
                        for (_, _, c, value) in tensor.iter().filter(|(a, b, ..)| (*a, *b) == (p, q)) {
                            sum = add_scaled(&sum, g.as_rational(*value).expect("rational data"), &basis[*c]);
                        }
                        sum
                    };
                    let (quotient, curvature) = (vector(&level.quotient_bracket), vector(&level.curvature));
                    let bracket = transported.bracket(&basis[p], &basis[q]);
                    // [eta, eta'] = quotient part - a(eta, eta'), horizontal and vertical.
                    assert_eq!(add_scaled(&quotient, &int(-1), &curvature), bracket, "{}", family.name);
                    assert!(below.iter().all(|v| transported.inner(v, &quotient).is_zero()));
                    assert!(curvature.iter().all(Zero::is_zero) || spans(below, &curvature));
                }
            }
        }
    });
}

/// `<mu, [xi, e_k]>` for the adapted basis elements, with `xi` and `mu` in the adapted basis and its dual.
fn unstaged(transported: &Transported, basis: &[Vector], xi: &[Rational], mu: &[Rational]) -> Vector {
    let columns = transposed(basis);
    let xi = times(&columns, xi);
    let to_adapted = hamel_tests::linear::inverse(&columns).expect("adapted elements are a basis");
    basis.iter().map(|e| dot(mu, &times(&to_adapted, &transported.bracket(&xi, e)))).collect()
}

/// The short form that the paper prints: in the equation of level `i` only `beta_i` is kept.
fn printed_vertical_equations(g: &Graph, stages: &Stages, eta: &[Rational], beta: &[Rational]) -> Vector {
    let mut right = vec![int(0); eta.len()];
    let number = |e: &ExprId| g.as_rational(*e).expect("rational data").clone();
    for level in &stages.levels {
        for (a, z, c, value) in &level.quotient_bracket {
            right[*z] += number(value) * &beta[*c] * &eta[*a];
        }
        for (a, z, c, value) in &level.vertical_connection {
            if stages.level_of(*z) == stages.level_of(*c) {
                right[*z] += number(value) * &beta[*c] * &eta[*a];
            }
        }
    }
    right
}

#[test]
fn staged_vertical_equations_are_the_unstaged_ones_in_every_slot() {
    for_all_chains(|family, transported, chain, mut draws| {
        let mut g = Graph::new();
        let stages = split(&mut g, &transported.algebra, chain, &transported.metric);
        let basis: Rows = stages.basis.iter().map(|row| numbers(&g, row)).collect();
        let (xi, mu) = (draws.generic_vector(basis.len()), draws.generic_vector(basis.len()));
        let (exi, emu) = (exprs(&mut g, &xi), exprs(&mut g, &mu));
        let staged = stages.vertical_equations(&mut g, &exi, &emu);
        let expected = unstaged(transported, &basis, &xi, &mu);
        assert_eq!(numbers(&g, &staged), expected, "{}", family.name);
    });
}

#[test]
fn printed_short_equations_are_wrong_where_the_full_ones_are_right() {
    // Errata A1. A single point shows that an identity fails; three random ones make an accident impossible.
    let wrong = ["se(3)", "heisenberg(1)", "heisenberg(2)", "upper triangular 4x4", "se_2(3)", "se(2)"];
    let mut seen = Vec::new();
    for make in FAMILIES {
        for seed in [11, 12, 13] {
            let mut draws = one(seed, NUMBERS);
            let family = make(&mut draws);
            if !wrong.contains(&family.name) {
                continue;
            }
            let transported = Transported::new(&family, &mut draws);
            for chain in &transported.chains {
                let mut g = Graph::new();
                let stages = split(&mut g, &transported.algebra, chain, &transported.metric);
                let basis: Rows = stages.basis.iter().map(|row| numbers(&g, row)).collect();
                let (xi, mu) = (draws.generic_vector(basis.len()), draws.generic_vector(basis.len()));
                let expected = unstaged(&transported, &basis, &xi, &mu);
                let printed = printed_vertical_equations(&g, &stages, &xi, &mu);
                assert_ne!(printed, expected, "{} seed {seed}", family.name);
                let (exi, emu) = (exprs(&mut g, &xi), exprs(&mut g, &mu));
                let staged = stages.vertical_equations(&mut g, &exi, &emu);
                assert_eq!(numbers(&g, &staged), expected, "{} seed {seed}", family.name);
            }
            seen.push(family.name);
        }
    }
    assert_eq!(seen.len(), 3 * wrong.len());
}

/// The orthonormal named algebra, the stage data of which are known by heart.
fn named(algebra: &LieAlgebra, chain: &[Rows]) -> (Graph, Stages) {
    let mut g = Graph::new();
    let stages = split(&mut g, algebra, chain, &product_metric(algebra));
    (g, stages)
}

#[test]
fn printed_equation_of_a_body_in_a_fluid_loses_p_cross_v() {
    let se3 = LieAlgebra::se(3).unwrap();
    let chain = [(3..6).map(|k| hamel_tests::linear::unit(6, k)).collect::<Rows>()];
    let (mut g, stages) = named(&se3, &chain);
    assert_eq!(stages.levels[0].curvature, vec![], "the product metric has a = 0");
    let xi: Vector = [2, -3, 5, 7, 11, -13].map(int).to_vec();
    let mu: Vector = [1, 4, -9, 16, 25, 36].map(int).to_vec();
    let cross = |u: &[Rational], v: &[Rational]| {
        let term = |i: usize, j: usize| &u[i] * &v[j] - &u[j] * &v[i];
        vec![term(1, 2), term(2, 0), term(0, 1)]
    };
    let (omega, v, pi, p) = (&xi[..3], &xi[3..], &mu[..3], &mu[3..]);
    let force = cross(p, v);
    assert!(force.iter().all(|q| !q.is_zero()));
    let full = [add_scaled(&cross(pi, omega), &int(1), &force), cross(p, omega)].concat();
    let short = [cross(pi, omega), cross(p, omega)].concat();
    let (exi, emu) = (exprs(&mut g, &xi), exprs(&mut g, &mu));
    let staged = stages.vertical_equations(&mut g, &exi, &emu);
    assert_eq!(numbers(&g, &staged), full);
    assert_eq!(printed_vertical_equations(&g, &stages, &xi, &mu), short);
    assert_eq!(ad_star(&se3, &xi, &mu), full);
}

#[test]
fn printed_equation_of_a_charge_loses_the_lorentz_force() {
    let heisenberg = LieAlgebra::heisenberg(1).unwrap();
    let (mut g, stages) = named(&heisenberg, &[vec![hamel_tests::linear::unit(3, 2)]]);
    assert_eq!(stages.levels[0].curvature.len(), 2, "a(q, p) and a(p, q)");
    let (xi, mu) = ([2, 3, 5].map(int), [7, 11, 13].map(int));
    let (exi, emu) = (exprs(&mut g, &xi), exprs(&mut g, &mu));
    let staged = stages.vertical_equations(&mut g, &exi, &emu);
    // <mu, [xi, e_q]> = -13*3, <mu, [xi, e_p]> = 13*2.
    assert_eq!(numbers(&g, &staged), [-39, 26, 0].map(int));
    assert_eq!(printed_vertical_equations(&g, &stages, &xi, &mu), [0, 0, 0].map(int));
}

#[test]
fn short_form_of_a_direct_product_with_product_metric_is_right() {
    let algebra = LieAlgebra::product(&[LieAlgebra::so(3).unwrap(), LieAlgebra::abelian(2)]);
    let chain = [(3..5).map(|k| hamel_tests::linear::unit(5, k)).collect::<Rows>()];
    let (g, stages) = named(&algebra, &chain);
    let (xi, mu) = ([2, 3, 5, 7, 11].map(int), [1, -4, 9, 16, 25].map(int));
    let expected = ad_star(&algebra, &xi, &mu);
    assert!(expected.iter().any(|q| !q.is_zero()));
    assert_eq!(printed_vertical_equations(&g, &stages, &xi, &mu), expected);
}

/// A symmetric matrix of symbols.
fn symbolic_metric(g: &mut Graph, n: usize) -> Vec<Vec<ExprId>> {
    let mut metric = vec![vec![g.zero(); n]; n];
    for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
        let symbol = g.symbol(&format!("G{}{}", i + 1, j + 1));
        metric[i][j] = g.sym(symbol);
        metric[j][i] = metric[i][j];
    }
    metric
}

/// Splits with a generic symbolic inner product and compares, as functions of its entries and of two vectors, the
/// rebuilt bracket with the original one, and the staged equations with the unstaged ones.
fn check_symbolic(algebra: &LieAlgebra, chain: &[Rows]) {
    let mut g = Graph::new();
    let n = algebra.dim();
    let metric = symbolic_metric(&mut g, n);
    let ideals = chain_exprs(&mut g, chain);
    let stages = Stages::split(
        &mut g,
        &algebra.clone().into(),
        &Transported::stage_names(chain),
        &ideals,
        Some(&metric),
    )
    .unwrap();
    let symbols = stages.basis.iter().flatten().any(|e| !g.free_symbols(*e).is_empty());
    assert!(symbols, "the adapted basis of {} does not depend on the inner product", algebra.name());
    let mut fresh = |name: &str| -> Vec<ExprId> {
        (1..=n)
            .map(|k| {
                let symbol = g.symbol(&format!("{name}{k}"));
                g.sym(symbol)
            })
            .collect()
    };
    let (x, y, mu) = (fresh("x"), fresh("y"), fresh("mu"));
    let rebuilt = stages.rebuilt_bracket(&mut g, &x, &y);
    let into_original = |g: &mut Graph, v: &[ExprId]| -> Vec<ExprId> {
        (0..n)
            .map(|a| {
                let terms: Vec<ExprId> = (0..n).map(|k| g.mul(v[k], stages.basis[k][a])).collect();
                g.sum(&terms)
            })
            .collect()
    };
    let (old_x, old_y) = (into_original(&mut g, &x), into_original(&mut g, &y));
    let old_rebuilt = into_original(&mut g, &rebuilt);
    let mut non_zero = 0;
    for (c, &image) in old_rebuilt.iter().enumerate() {
        let mut terms = Vec::new();
        for (a, &x) in old_x.iter().enumerate() {
            for (b, &y) in old_y.iter().enumerate() {
                let q = g.rational(algebra.structure_constant(c, a, b));
                terms.push(g.product(&[q, x, y]));
            }
        }
        let original = g.sum(&terms);
        non_zero += usize::from(!g.is_zero(original));
        assert!(g.is_equal(original, image), "{}: component {c}", algebra.name());
    }
    assert!(non_zero > 0);
    let staged = stages.vertical_equations(&mut g, &x, &mu);
    for (k, &right) in staged.iter().enumerate() {
        let unit: Vec<ExprId> = (0..n).map(|i| if i == k { g.one() } else { g.zero() }).collect();
        let bracket = stages.rebuilt_bracket(&mut g, &x, &unit);
        let terms: Vec<ExprId> = bracket.iter().zip(&mu).map(|(b, m)| g.mul(*b, *m)).collect();
        let unstaged = g.sum(&terms);
        assert!(g.is_equal(unstaged, right), "{}: equation {k}", algebra.name());
    }
}

#[test]
fn symbolic_inner_product_rebuilds_the_bracket_as_an_identity() {
    let units =
        |n: usize, list: &[usize]| list.iter().map(|&k| hamel_tests::linear::unit(n, k)).collect::<Rows>();
    let se2 = LieAlgebra::se(2).unwrap();
    check_symbolic(&se2, &[units(3, &[1, 2])]);
    check_symbolic(&se2, &[units(3, &[1, 2]), units(3, &[2])]);
    let heisenberg = LieAlgebra::heisenberg(1).unwrap();
    check_symbolic(&heisenberg, &[units(3, &[2])]);
    check_symbolic(&heisenberg, &[units(3, &[1, 2]), units(3, &[2])]);
    let so3_line = LieAlgebra::product(&[LieAlgebra::so(3).unwrap(), LieAlgebra::abelian(1)]);
    check_symbolic(&so3_line, &[units(4, &[3])]);
    check_symbolic(&so3_line, &[units(4, &[0, 1, 2])]);
}
