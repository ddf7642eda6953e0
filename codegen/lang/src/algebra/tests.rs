use super::*;
use hamel_expr::error::Error;
use hamel_expr::{Func, Graph, Rational, Vanishing};

fn q(n: i64) -> Rational {
    Rational::from_integer(n.into())
}

#[test]
fn named_algebras_have_the_textbook_brackets() {
    let so3 = LieAlgebra::so(3).unwrap();
    for (a, b, c) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        assert_eq!(so3.bracket(a, b), vec![(c, q(1))]);
    }
    let se2 = LieAlgebra::se(2).unwrap();
    // x' = v1 cos - v2 sin: ad_omega turns v1 into v2 and v2 into -v1.
    assert_eq!(se2.bracket(0, 1), vec![(2, q(1))]);
    assert_eq!(se2.bracket(0, 2), vec![(1, q(-1))]);
    let se3 = LieAlgebra::se(3).unwrap();
    assert_eq!(se3.dim(), 6);
    assert_eq!(se3.bracket(0, 4), vec![(5, q(1))]);
    assert_eq!(se3.blocks().iter().map(|s| s.dim).collect::<Vec<_>>(), [3, 3]);
    let h = LieAlgebra::heisenberg(2).unwrap();
    assert_eq!(h.bracket(1, 3), vec![(4, q(1))]);
}

#[test]
fn every_named_algebra_satisfies_jacobi_and_is_not_trivial() {
    let all = [
        LieAlgebra::so(4),
        LieAlgebra::so(5),
        LieAlgebra::su(2),
        LieAlgebra::su(3),
        LieAlgebra::gl(3),
        LieAlgebra::sl(3),
        LieAlgebra::se(4),
    ];
    for algebra in all {
        let algebra = algebra.unwrap();
        let copies: Vec<_> = algebra.brackets().map(|(a, b, v)| (a, b, v.to_vec())).collect();
        assert!(!copies.is_empty());
        let again = LieAlgebra::from_brackets("again", algebra.basis().to_vec(), &copies);
        assert!(again.is_ok(), "{}", algebra.name());
    }
}

#[test]
fn a_broken_jacobi_identity_names_its_triple() {
    let basis = ["e1", "e2", "e3"].map(String::from).to_vec();
    let brackets = [(0, 1, vec![(0, q(2))]), (0, 2, vec![(1, q(1))]), (1, 2, vec![])];
    let errors = LieAlgebra::from_brackets("broken", basis, &brackets).unwrap_err();
    assert_eq!(errors.len(), 1);
    let message = errors[0].to_string();
    assert!(message.starts_with("bracket [e1, e2] fails Jacobi with e3: residual 2 e2;"), "{message}");
}

#[test]
fn contradicting_brackets_are_refused() {
    let basis = ["a", "b"].map(String::from).to_vec();
    let brackets = [(0, 1, vec![(0, q(1))]), (1, 0, vec![(0, q(1))])];
    let errors = LieAlgebra::from_brackets("twice", basis.clone(), &brackets).unwrap_err();
    assert_eq!(errors, [Error::NotAntisymmetric { a: "b".into(), b: "a".into() }]);
    let consistent = [(0, 1, vec![(0, q(1))]), (1, 0, vec![(0, q(-1))])];
    assert!(LieAlgebra::from_brackets("twice", basis, &consistent).is_ok());
}

#[test]
fn representations_are_verified() {
    let so3 = LieAlgebra::so(3).unwrap();
    let adjoint = Representation::adjoint(&so3);
    let standard = Representation::standard(&so3).unwrap();
    assert_eq!(adjoint.matrix(1), standard.matrix(1));
    let mut wrong: Vec<Matrix> = (0..3).map(|a| standard.matrix(a).clone()).collect();
    wrong[2] = wrong[2].transposed();
    let error = Representation::from_matrices("rho", &so3, wrong).unwrap_err();
    assert!(matches!(error, Error::NotARepresentation { .. }), "{error}");
    let su2 = LieAlgebra::su(2).unwrap();
    let dual = Representation::coadjoint(&su2);
    let matrices = (0..3).map(|a| dual.matrix(a).clone()).collect();
    assert!(Representation::from_matrices("coadjoint", &su2, matrices).is_ok());
}

#[test]
fn semidirect_product_of_two_copies_is_se2_3() {
    let so3 = LieAlgebra::so(3).unwrap();
    let v = Representation::standard(&so3).unwrap();
    let g = LieAlgebra::semidirect(&so3, &[v.clone(), v]).unwrap();
    assert_eq!(g.dim(), 9);
    assert_eq!(g.bracket(0, 7), vec![(8, q(1))]);
    assert_eq!(g.bracket(3, 7), vec![]);
    let copies: Vec<_> = g.brackets().map(|(a, b, v)| (a, b, v.to_vec())).collect();
    assert!(LieAlgebra::from_brackets("se2_3", g.basis().to_vec(), &copies).is_ok());
}

#[test]
fn a_change_of_basis_and_back_is_the_identity() {
    let g = LieAlgebra::se(2).unwrap();
    let rows = [[1, 2, 0], [0, 1, 3], [1, 0, 1]].map(|r| r.map(q).to_vec());
    let p = Matrix::from_rows(&rows).unwrap();
    let there = g.change_basis(&p).unwrap();
    assert_ne!(there, g);
    assert_eq!(there.change_basis(&p.inverse().unwrap()).unwrap(), g);
}

#[test]
fn the_drift_of_a_frame_satisfies_jacobi_with_its_brackets() {
    // D = d/dx - sin(t) e1 - x t e2 on the line times SO(3).
    let mut g = hamel_expr::Graph::new();
    let (time, x) = (g.symbol("t"), g.symbol("x"));
    let frame = ["D", "e1", "e2", "e3"].map(str::to_owned).to_vec();
    let (t, at) = (g.sym(time), g.sym(x));
    let (s, c) = (g.func(hamel_expr::Func::Sin, t), g.func(hamel_expr::Func::Cos, t));
    let a = [s, g.mul(at, t)];
    let mut algebroid = Algebroid::new(&g, time, vec![x], frame);
    algebroid.set_anchor(0, 0, g.one());
    for (i, j, k) in [(1, 2, 3), (2, 3, 1)] {
        algebroid.set_bracket(i, j, vec![(k, g.one())]);
    }
    let minus = g.neg(g.one());
    algebroid.set_bracket(1, 3, vec![(2, minus)]);
    // [D, e_b] = -a_1 [e1, e_b] - a_2 [e2, e_b]
    let minus_a = a.map(|e| g.neg(e));
    algebroid.set_bracket(0, 1, vec![(3, a[1])]);
    algebroid.set_bracket(0, 2, vec![(3, minus_a[0])]);
    algebroid.set_bracket(0, 3, vec![(1, minus_a[1]), (2, a[0])]);
    let rates = [c, at].map(|e| g.neg(e));
    assert!(algebroid.verify(&mut g).is_err(), "without its drift");
    algebroid.set_drift(0, vec![(1, rates[0]), (2, rates[1])]);
    algebroid.verify(&mut g).unwrap_or_else(|e| panic!("{e:?}"));
    algebroid.set_drift(0, vec![(1, rates[0]), (2, at)]);
    let errors = algebroid.verify(&mut g).unwrap_err();
    assert!(
        errors.iter().all(|e| matches!(e, Error::JacobiViolated { triple, .. } if triple[0] == "d/dt")),
        "{errors:?}"
    );
}

#[test]
fn pivots_that_are_proved_not_to_vanish_come_first() {
    let mut g = Graph::new();
    let symbol = g.symbol("x");
    let x = g.sym(symbol);
    // asin x + acos x - pi/2 vanishes, which nothing here knows.
    let [asin, acos] = [Func::Asin, Func::Acos].map(|f| g.func(f, x));
    let pi = g.pi();
    let minus_quarter = g.scale(pi, &Rational::new((-1).into(), 2.into()));
    let hidden = g.sum(&[asin, acos, minus_quarter]);
    assert_eq!(g.vanishing(hidden), Vanishing::Unknown);
    let one = g.one();
    let functions = [Func::Exp, Func::Sin, Func::Cos, Func::Sinh, Func::Cosh, Func::Tanh, Func::Atan];
    let terms: Vec<_> = functions.into_iter().map(|f| g.func(f, x)).collect();
    let long = g.sum(&terms);
    assert!(g.reachable(&[long]).len() > g.reachable(&[hidden]).len());
    // [hidden, 1; long, hidden] u = [1, long]: the smaller entry of the first column is not the pivot.
    let rows = vec![vec![hidden, one], vec![long, hidden]];
    let solution = solve_symbolic(&mut g, &rows, &[vec![one], vec![long]]).unwrap();
    let values = std::collections::BTreeMap::from([(symbol, 0.3)]);
    let found: Vec<f64> = solution.iter().map(|row| g.eval_f64(row[0], &values).unwrap()).collect();
    assert!((found[0] - 1.0).abs() < 1e-12 && (found[1] - 1.0).abs() < 1e-12, "{found:?}");
}

#[test]
fn constant_brackets_of_a_large_frame_are_proved_as_numbers_and_offenders_named() {
    let mut g = Graph::new();
    let time = g.symbol("t");
    let frame: Vec<String> = (0..70).map(|k| format!("e{k}")).collect();
    let mut algebroid = Algebroid::new(&g, time, Vec::new(), frame);
    let root = g.int(2);
    let root = g.sqrt(root);
    for (a, b, c) in [(3, 40, 69), (40, 69, 3)] {
        algebroid.set_bracket(a, b, vec![(c, root)]);
    }
    let opposite = g.neg(root);
    algebroid.set_bracket(3, 69, vec![(40, opposite)]);
    let before = g.spent().expressions;
    assert_eq!(algebroid.verify(&mut g), Ok(()));
    assert_eq!(g.spent().expressions, before, "no triple was written as expressions");
    // [[e3, e40], e5] = sqrt(2) [e69, e5] is left over.
    algebroid.set_bracket(5, 69, vec![(6, root)]);
    let errors = algebroid.verify(&mut g).unwrap_err();
    assert!(errors.iter().all(|e| matches!(e, Error::JacobiViolated { .. })), "{errors:?}");
    assert!(errors.iter().any(|e| e.to_string().contains("[e3, e5]")), "{errors:?}");
}
