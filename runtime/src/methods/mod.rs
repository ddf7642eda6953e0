//! Explicit Runge-Kutta methods, each a tableau of constants; the one stepping loop reads them.
//!
//! The module deliberately does not know how steps are chosen. Tableaux are in double precision, so that
//! scalars wider than `f64` do not gain accuracy beyond it.

mod dop853;
mod dopri5;
mod rk4;
mod tsit5;

pub use dop853::Dop853;
pub use dopri5::Dopri5;
pub use rk4::Rk4;
pub use tsit5::Tsit5;

/// An explicit Runge-Kutta method with continuous output.
pub trait Method: Copy {
    /// Storage of all stage derivatives: [`Tableau::n_stored`] of them.
    type Stages<V>: AsRef<[V]> + AsMut<[V]>;

    /// Coefficients of the method.
    const TABLEAU: &'static Tableau;

    /// Storage filled with copies of `zeros`.
    fn stages<V: Clone>(zeros: &V) -> Self::Stages<V>;
}

/// Coefficients of an explicit Runge-Kutta method of `s` stages with continuous output.
///
/// ```text
/// k_i   = f(t0 + c_i h, y0 + h sum_j a_ij k_j)     i = 0..s
/// y1    = y0 + h sum_i b_i k_i
/// k_s   = f(t0 + h, y1)                            k_0 of the next step
/// k_i   = f(t0 + c_i h, y0 + h sum_j a_ij k_j)     i > s, for dense output alone
/// error = h sum_i e_i k_i
/// y(x)  = y0 + x (D + (1-x) (h k_0 - D + x (2 D - h k_0 - h k_s + (1-x) h sum_i d_i(x) k_i)))
/// d_i   = d_i0 + x (d_i1 + (1-x) (d_i2 + x d_i3))
/// ```
///
/// with `x = (t - t0)/h` and `D = y1 - y0`: the cubic Hermite interpolant where there is no `d`.
/// Rows list `(j, coefficient)` of the coefficients that are not zero.
///
/// # Source
///
/// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), sections II.1, II.6, II.10.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Tableau {
    /// Name of the method in messages.
    pub name: &'static str,
    /// Order of `y1`.
    pub order: u32,
    /// Nodes `c_i`.
    pub nodes: &'static [f64],
    /// Rows `a_i`; the first is empty.
    pub stages: &'static [&'static [(usize, f64)]],
    /// Weights `b_i`.
    pub weights: &'static [(usize, f64)],
    /// Weights of the error estimate.
    pub estimate: Estimate,
    /// Nodes of the stages for dense output.
    pub dense_nodes: &'static [f64],
    /// Rows of the stages for dense output.
    pub dense_stages: &'static [&'static [(usize, f64)]],
    /// Coefficients `d_i0` to `d_i3` of dense output.
    pub dense: &'static [(usize, [f64; 4])],
}

impl Tableau {
    /// Number of stages `s`; `k_s` belongs to the next step.
    #[must_use]
    pub const fn n_stages(&self) -> usize {
        self.stages.len()
    }

    /// Number of stage derivatives to store: `s + 1` and those of dense output.
    #[must_use]
    pub const fn n_stored(&self) -> usize {
        self.stages.len() + 1 + self.dense_stages.len()
    }
}

/// Estimate of the local error of a step.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Estimate {
    /// None: the method takes fixed steps only.
    None,
    /// The difference from one embedded method.
    Embedded {
        /// The `q` of an estimate `O(h^q)`.
        order: u32,
        /// Weights `e_i`, the embedded ones subtracted from `b_i` up to a sign.
        weights: &'static [(usize, f64)],
    },
    /// Two estimates combined: `|e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2)`.
    ///
    /// # Source
    ///
    /// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.10.
    Combined {
        /// The `q` of a combined estimate `O(h^q)`.
        order: u32,
        /// Weights of the estimate of fifth order.
        fifth: &'static [(usize, f64)],
        /// Weights of the estimate of third order.
        third: &'static [(usize, f64)],
    },
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::{Dop853, Dopri5, Estimate, Method, Rk4, Tableau, Tsit5};

    const TABLEAUX: [&Tableau; 4] = [Rk4::TABLEAU, Dopri5::TABLEAU, Tsit5::TABLEAU, Dop853::TABLEAU];

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
                let density =
                    order as f64 * children.iter().map(|&child| trees[child].density).product::<f64>();
                trees.push(Tree { order, density, children });
            }
        }
        trees
    }

    #[test]
    fn numbers_of_rooted_trees_are_known() {
        let trees = rooted_trees(8);
        let counts: Vec<_> = (1..=8).map(|n| trees.iter().filter(|tree| tree.order == n).count()).collect();
        assert_eq!(counts, [1, 1, 2, 4, 9, 20, 48, 115]);
    }

    /// The rows of all stored stages, the one shared with the next step included.
    fn rows(tableau: &Tableau) -> Vec<(f64, &'static [(usize, f64)])> {
        let stages = tableau.nodes.iter().copied().zip(tableau.stages.iter().copied());
        let extra = tableau.dense_nodes.iter().copied().zip(tableau.dense_stages.iter().copied());
        stages.chain([(1.0, tableau.weights)]).chain(extra).collect()
    }

    /// Elementary weights `Phi_i` of every tree at every stage.
    fn elementary_weights(tableau: &Tableau, trees: &[Tree]) -> Vec<Vec<f64>> {
        let rows = rows(tableau);
        let mut all: Vec<Vec<f64>> = vec![];
        for tree in trees {
            let weight = |row: &[(usize, f64)]| {
                let child = |&child: &usize| row.iter().map(|&(j, a)| a * all[child][j]).sum::<f64>();
                tree.children.iter().map(child).product()
            };
            let weights = rows.iter().map(|(_, row)| weight(row)).collect();
            all.push(weights);
        }
        all
    }

    /// The largest defect of the conditions `sum_i w_i Phi_i(tree) = x^order / density` of an order.
    fn defect(
        tableau: &Tableau,
        weights: &[(usize, f64)],
        orders: core::ops::RangeInclusive<usize>,
        target: impl Fn(usize, f64) -> f64,
    ) -> f64 {
        let trees = rooted_trees(*orders.end());
        let elementary = elementary_weights(tableau, &trees);
        let defects = trees.iter().zip(&elementary).filter(|(tree, _)| orders.contains(&tree.order)).map(
            |(tree, elementary)| {
                let sum: f64 = weights.iter().map(|&(i, w)| w * elementary[i]).sum();
                (sum - target(tree.order, tree.density)).abs()
            },
        );
        defects.fold(0.0, f64::max)
    }

    #[test]
    fn rows_sum_to_nodes() {
        for tableau in TABLEAUX {
            assert_eq!(tableau.nodes.len(), tableau.stages.len());
            assert_eq!(tableau.dense_nodes.len(), tableau.dense_stages.len());
            for (index, (node, row)) in rows(tableau).into_iter().enumerate() {
                let sum: f64 = row.iter().map(|&(_, a)| a).sum();
                let size: f64 = row.iter().map(|&(_, a)| a.abs()).sum();
                let bound = 4.0 * f64::EPSILON * size.max(1.0);
                assert!((sum - node).abs() <= bound, "{} stage {index}: {sum} and {node}", tableau.name);
                assert!(row.iter().all(|&(j, _)| j < index), "{} stage {index} is explicit", tableau.name);
            }
        }
    }

    #[test]
    fn weights_satisfy_order_conditions() {
        for tableau in TABLEAUX {
            let order = tableau.order as usize;
            let exact = |_, density: f64| 1.0 / density;
            let met = defect(tableau, tableau.weights, 1..=order, exact);
            // Coefficients up to 12 (Tsit5) and 43 (Dop853), products of up to eight of them.
            assert!(met < 2e-14, "{}: {met:e}", tableau.name);
            let missed = defect(tableau, tableau.weights, order + 1..=order + 1, exact);
            assert!(missed > 1e-7, "{}: order higher than stated, {missed:e}", tableau.name);
        }
    }

    #[test]
    fn estimates_have_their_order() {
        // An estimate O(h^q) vanishes on all trees of an order below q, and not on all of the order q.
        let check = |tableau: &Tableau, weights: &[(usize, f64)], q: usize| {
            let zero = |_, _| 0.0;
            let met = defect(tableau, weights, 1..=q - 1, zero);
            assert!(met < 2e-14, "{} estimate of order {q}: {met:e}", tableau.name);
            let missed = defect(tableau, weights, q..=q, zero);
            assert!(missed > 1e-6, "{} estimate of order {q}: {missed:e}", tableau.name);
        };
        for tableau in TABLEAUX {
            match tableau.estimate {
                Estimate::None => assert_eq!(tableau.name, "rk4"),
                Estimate::Embedded { order, weights } => check(tableau, weights, order as usize),
                Estimate::Combined { order, fifth, third } => {
                    // |e5|^2 / |e3| with e5 = O(h^6) and e3 = O(h^4).
                    assert_eq!(order, 2 * 6 - 4);
                    check(tableau, fifth, 6);
                    check(tableau, third, 4);
                }
            }
        }
    }

    /// Weights of the stages in the dense output at `x`, by the formula of [`Tableau`].
    fn dense_weights(tableau: &Tableau, x: f64) -> Vec<(usize, f64)> {
        let rest = 1.0 - x;
        let mut weights = vec![0.0; tableau.n_stored()];
        let difference = x * (1.0 - rest + 2.0 * rest * x);
        for &(i, b) in tableau.weights {
            weights[i] += difference * b;
        }
        weights[0] += x * rest * (1.0 - x);
        weights[tableau.n_stages()] -= x * rest * x;
        for &(i, [d0, d1, d2, d3]) in tableau.dense {
            weights[i] += x * rest * x * rest * (d0 + x * (d1 + rest * (d2 + x * d3)));
        }
        weights.into_iter().enumerate().collect()
    }

    #[test]
    fn dense_output_satisfies_order_conditions() {
        for (tableau, order) in TABLEAUX.into_iter().zip([3, 4, 4, 7]) {
            for x in [0.1, 0.35, 0.5, 0.8, 0.95_f64] {
                let exact = |order: usize, density: f64| x.powi(order as i32) / density;
                let weights = dense_weights(tableau, x);
                let met = defect(tableau, &weights, 1..=order, exact);
                // Dop853 has dense coefficients up to 530.
                assert!(met < 1e-13, "{} at {x}: {met:e}", tableau.name);
                let missed = defect(tableau, &weights, order + 1..=order + 1, exact);
                assert!(missed > 1e-9, "{} at {x}: {missed:e}", tableau.name);
            }
        }
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
        let tableau = Tsit5::TABLEAU;
        for x in [0.2, 0.5, 0.9] {
            for ((i, weight), (square, cube)) in dense_weights(tableau, x).into_iter().zip(published) {
                let fourth = tableau.dense[i].1[0];
                let linear = if i == 0 { 1.0 } else { 0.0 };
                let expected = x * (linear + x * (square + x * (cube + x * fourth)));
                assert!((weight - expected).abs() < 1e-14, "weight {i} at {x}: {weight} and {expected}");
            }
        }
    }

    #[test]
    fn storage_fits_tableaux() {
        assert_eq!(Rk4::stages(&0.0).len(), Rk4::TABLEAU.n_stored());
        assert_eq!(Dopri5::stages(&0.0).len(), Dopri5::TABLEAU.n_stored());
        assert_eq!(Tsit5::stages(&0.0).len(), Tsit5::TABLEAU.n_stored());
        assert_eq!(Dop853::stages(&0.0).len(), Dop853::TABLEAU.n_stored());
    }
}
