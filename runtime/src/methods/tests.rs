//! Order conditions of all tableaux, by rooted trees, to the last digit that is stored.

use std::vec;
use std::vec::Vec;

use super::{
    Constant, Dop853, Dopri5, Estimate, FixedPoint, Gauss4, Gauss6, Gauss8, Method, Midpoint, Rk4, Row,
    Tableau, Tsit5, Vern9, c,
};
use crate::system::System;
use crate::{DoubleDouble, Real};

struct Nothing;

impl System<f64> for Nothing {
    type State = [f64; 0];
    fn rhs(&self, _t: f64, _y: &[f64; 0], _dy: &mut [f64; 0]) {}
}

const fn tableau<M: Method<f64, Nothing>>() -> &'static Tableau {
    M::TABLEAU
}

const TABLEAUX: [&Tableau; 9] = [
    tableau::<Rk4>(),
    tableau::<Dopri5>(),
    tableau::<Tsit5>(),
    tableau::<Dop853>(),
    tableau::<Vern9>(),
    tableau::<Midpoint<FixedPoint>>(),
    tableau::<Gauss4<FixedPoint>>(),
    tableau::<Gauss6<FixedPoint>>(),
    tableau::<Gauss8<FixedPoint>>(),
];
const N_EXPLICIT: usize = 5;

/// A rooted tree: the index of each of its root's children in the list of all trees.
struct Tree {
    order: usize,
    density: f64,
    children: Vec<usize>,
}

/// All rooted trees up to an order, smaller ones first.
fn rooted_trees(max_order: usize) -> Vec<Tree> {
    let mut trees = vec![Tree { order: 1, density: 1.0, children: vec![] }];
    for order in 2..=max_order {
        let mut forests = vec![];
        let mut partial = vec![(vec![], order - 1)];
        // Forests are sorted by tree, so that each is met once.
        while let Some((children, left)) = partial.pop() {
            if left == 0 {
                forests.push(children);
                continue;
            }
            let smallest = children.last().copied().unwrap_or(0);
            for (next, tree) in trees.iter().enumerate().skip(smallest) {
                if tree.order <= left {
                    let mut children = children.clone();
                    children.push(next);
                    partial.push((children, left - tree.order));
                }
            }
        }
        for children in forests {
            let density = order as f64 * children.iter().map(|&child| trees[child].density).product::<f64>();
            trees.push(Tree { order, density, children });
        }
    }
    trees
}

#[test]
fn numbers_of_rooted_trees_are_known() {
    let trees = rooted_trees(10);
    let counts: Vec<_> = (1..=10).map(|n| trees.iter().filter(|tree| tree.order == n).count()).collect();
    assert_eq!(counts, [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]);
}

/// The rows of all stored stages, the one shared with the next step included.
fn rows(tableau: &Tableau) -> Vec<(Constant, Row)> {
    let stages = tableau.nodes.iter().copied().zip(tableau.stages.iter().copied());
    let extra = tableau.dense_nodes.iter().copied().zip(tableau.dense_stages.iter().copied());
    stages.chain([(c(1.0, 0.0), tableau.weights)]).chain(extra).collect()
}

fn sum<R: Real>(terms: impl Iterator<Item = R>) -> R {
    terms.fold(R::ZERO, |sum, term| sum + term)
}

/// Elementary weights `Phi_i` of every tree at every stage.
fn elementary_weights<R: Real>(tableau: &Tableau, trees: &[Tree]) -> Vec<Vec<R>> {
    let rows = rows(tableau);
    let mut all: Vec<Vec<R>> = vec![];
    for tree in trees {
        let weight = |row: Row| {
            let child = |&child: &usize| sum(row.iter().map(|&(j, a)| a.get::<R>() * all[child][j]));
            tree.children.iter().map(child).fold(R::ONE, |product, factor| product * factor)
        };
        let weights = rows.iter().map(|(_, row)| weight(row)).collect();
        all.push(weights);
    }
    all
}

/// The largest defect of the conditions `sum_i w_i Phi_i(tree) = x^order / density` of an order.
fn defect<R: Real>(
    tableau: &Tableau,
    weights: &[(usize, R)],
    orders: core::ops::RangeInclusive<usize>,
    target: impl Fn(usize, f64) -> R,
) -> f64 {
    let trees = rooted_trees(*orders.end());
    let elementary = elementary_weights::<R>(tableau, &trees);
    let defects = trees.iter().zip(&elementary).filter(|(tree, _)| orders.contains(&tree.order)).map(
        |(tree, elementary)| {
            let sum = sum(weights.iter().map(|&(i, w)| w * elementary[i]));
            (sum - target(tree.order, tree.density)).magnitude()
        },
    );
    defects.fold(0.0, f64::max)
}

fn values<R: Real>(row: Row) -> Vec<(usize, R)> {
    row.iter().map(|&(i, w)| (i, w.get())).collect()
}

#[test]
fn rows_sum_to_nodes() {
    fn check<R: Real>() {
        for (position, tableau) in TABLEAUX.into_iter().enumerate() {
            assert_eq!(tableau.nodes.len(), tableau.stages.len());
            assert_eq!(tableau.dense_nodes.len(), tableau.dense_stages.len());
            for (index, (node, row)) in rows(tableau).into_iter().enumerate() {
                let sum = sum(row.iter().map(|&(_, a)| a.get::<R>()));
                let size: f64 = row.iter().map(|&(_, a)| a.hi.abs()).sum();
                let bound = 4.0 * R::EPSILON * size.max(1.0);
                let defect = (sum - node.get()).magnitude();
                assert!(defect <= bound, "{} stage {index}: {defect:e}", tableau.name);
                let explicit = row.iter().all(|&(j, _)| j < index);
                let collocated = 0 < index && index < tableau.n_stages() && position >= N_EXPLICIT;
                assert_eq!(explicit, !collocated, "{} stage {index}", tableau.name);
            }
        }
    }
    check::<f64>();
    check::<DoubleDouble>();
}

/// Bounds on defects: sums over products of up to nine coefficients, of a size up to 12 (Tsit5), 43 (Dop853), 36
/// (Vern9); dense coefficients are up to 530 (Dop853) and 1340 (Vern9).
const ROUND_OFF: f64 = 2e-14;
const DENSE_ROUND_OFF: f64 = 1e-13;
/// The same with all digits.
const FULL_ROUND_OFF: f64 = 1e-30;

#[test]
fn weights_satisfy_order_conditions() {
    fn check<R: Real>(bound: f64) {
        for tableau in TABLEAUX {
            let order = tableau.order as usize;
            let exact = |_, density| R::ratio(1.0, density);
            let weights = values::<R>(tableau.weights);
            let met = defect(tableau, &weights, 1..=order, exact);
            assert!(met < bound, "{}: {met:e}", tableau.name);
            let missed = defect(tableau, &weights, order + 1..=order + 1, exact);
            assert!(missed > 1e-9, "{}: order higher than stated, {missed:e}", tableau.name);
        }
    }
    check::<f64>(ROUND_OFF);
    check::<DoubleDouble>(FULL_ROUND_OFF);
}

#[test]
fn first_parts_of_coefficients_do_not_satisfy_order_conditions_to_all_digits() {
    // What the second parts are for: a tableau of `f64` is wrong by round-off of `f64`, whatever the scalar.
    for tableau in TABLEAUX.into_iter().filter(|tableau| tableau.name != "rk4") {
        let first = |&(i, w): &(usize, Constant)| (i, DoubleDouble::from(w.hi));
        let weights: Vec<_> = tableau.weights.iter().map(first).collect();
        let exact = |_, density| DoubleDouble::ratio(1.0, density);
        let order = tableau.order as usize;
        let missed = defect(tableau, &weights, 1..=order, exact);
        assert!(
            missed > 1e-18 || ["midpoint", "gauss4"].contains(&tableau.name),
            "{}: {missed:e}",
            tableau.name
        );
    }
}

#[test]
fn parts_of_coefficients_do_not_overlap() {
    for tableau in TABLEAUX {
        let mut all: Vec<Constant> =
            rows(tableau).iter().flat_map(|(_, row)| row.iter().map(|x| x.1)).collect();
        all.extend(tableau.nodes.iter().chain(tableau.dense_nodes));
        all.extend(tableau.dense.iter().flat_map(|(_, row)| row.iter()));
        all.extend(tableau.error_weights().iter().flat_map(|row| row.iter().map(|x| x.1)));
        for Constant { hi, lo } in all {
            // Half a place, and a little where the first part is another author's rounding.
            assert!(lo.abs() <= 0.75 * f64::EPSILON * hi.abs(), "{}: {hi:e} {lo:e}", tableau.name);
        }
    }
}

#[test]
fn estimates_have_their_order() {
    // An estimate O(h^q) vanishes on all trees of an order below q, and not on all of the order q.
    fn check<R: Real>(tableau: &Tableau, weights: Row, q: usize, bound: f64) {
        let (zero, weights) = (|_, _| R::ZERO, values::<R>(weights));
        let met = defect(tableau, &weights, 1..=q - 1, zero);
        assert!(met < bound, "{} estimate of order {q}: {met:e}", tableau.name);
        let missed = defect(tableau, &weights, q..=q, zero);
        assert!(missed > 1e-6, "{} estimate of order {q}: {missed:e}", tableau.name);
    }
    fn check_both(tableau: &Tableau, weights: Row, q: usize) {
        check::<f64>(tableau, weights, q, ROUND_OFF);
        check::<DoubleDouble>(tableau, weights, q, FULL_ROUND_OFF);
    }
    for tableau in TABLEAUX {
        match tableau.estimate {
            Estimate::Series => panic!("{} has no stages", tableau.name),
            Estimate::None => {
                let is_collocation = tableau.name.starts_with("gauss") || tableau.name == "midpoint";
                assert!(tableau.name == "rk4" || is_collocation);
            }
            Estimate::Embedded { order, weights } => check_both(tableau, weights, order as usize),
            Estimate::Combined { order, fifth, third } => {
                // |e5|^2 / |e3| with e5 = O(h^6) and e3 = O(h^4).
                assert_eq!(order, 2 * 6 - 4);
                check_both(tableau, fifth, 6);
                check_both(tableau, third, 4);
            }
        }
    }
}

/// Weights of the stages in the dense output at `x`, by the formula of [`Tableau`].
fn dense_weights<R: Real>(tableau: &Tableau, x: R) -> Vec<(usize, R)> {
    let rest = R::ONE - x;
    let mut weights = vec![R::ZERO; tableau.n_stored() + 2];
    let difference = x * (R::ONE - rest + (rest + rest) * x);
    for &(i, b) in tableau.weights {
        weights[i] += difference * b.get();
    }
    weights[0] += x * rest * (R::ONE - x);
    weights[tableau.n_stages()] -= x * rest * x;
    for &(i, coefficients) in tableau.dense {
        let factors = [x, rest].into_iter().cycle();
        let (mut power, mut sum) = (R::ONE, R::ZERO);
        for (d, factor) in coefficients.iter().zip(factors) {
            sum += d.get::<R>() * power;
            power *= factor;
        }
        weights[i] += x * rest * x * rest * sum;
    }
    weights.into_iter().enumerate().collect()
}

#[test]
fn dense_output_satisfies_order_conditions() {
    fn check<R: Real>(bound: f64) {
        for (tableau, order) in TABLEAUX.into_iter().zip([3, 4, 4, 7, 9, 2, 4, 5, 6]) {
            for x in [0.1, 0.35, 0.55, 0.8, 0.95_f64] {
                let x = R::from_f64(x);
                let exact =
                    |order: usize, density| (0..order).fold(R::ratio(1.0, density), |product, _| product * x);
                let weights = dense_weights(tableau, x);
                let met = defect(tableau, &weights, 1..=order, exact);
                assert!(met < bound, "{} at {x:?}: {met:e}", tableau.name);
                let missed = defect(tableau, &weights, order + 1..=order + 1, exact);
                assert!(missed > 1e-9, "{} at {x:?}: {missed:e}", tableau.name);
            }
        }
    }
    check::<f64>(DENSE_ROUND_OFF);
    check::<DoubleDouble>(FULL_ROUND_OFF);
}

#[test]
fn dense_output_of_tsit5_is_the_published_interpolant() {
    // Coefficients of x^2 and x^3 of the weights; those of x^4 are in the tableau.
    let published = [
        (-2.763_706_197_274_826, 2.913_255_461_821_912_6),
        (0.1317, -0.2234),
        (3.930_296_236_894_751_6, -5.941_033_872_131_505),
        (-12.411_077_166_933_676, 30.338_188_630_282_32),
        (37.509_313_416_511_04, -88.178_904_894_766_4),
        (-27.896_526_289_197_286, 65.091_894_674_793_66),
        (1.5, -4.0),
    ];
    let tableau = tableau::<Tsit5>();
    for x in [0.2, 0.5, 0.9_f64] {
        for ((i, weight), (square, cube)) in dense_weights(tableau, x).into_iter().zip(published) {
            let fourth = tableau.dense[i].1[0].hi;
            let linear = if i == 0 { 1.0 } else { 0.0 };
            let expected = x * (linear + x * (square + x * (cube + x * fourth)));
            assert!((weight - expected).abs() < 1e-14, "weight {i} at {x}: {weight} and {expected}");
        }
    }
}
