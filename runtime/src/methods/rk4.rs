//! The classical Runge-Kutta method.

use super::explicit::explicit_method;
use super::{Estimate, Tableau};

explicit_method! {
    /// The classical method of order 4, for fixed steps.
    ///
    /// Dense output is the cubic Hermite interpolant, with an error of order 4.
    ///
    /// # Source
    ///
    /// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), table II.1.2.
    Rk4, TABLEAU, 3
}

const TABLEAU: Tableau = Tableau {
    name: "rk4",
    order: 4,
    nodes: &[0.0, 0.5, 0.5, 1.0],
    stages: &[&[], &[(0, 0.5)], &[(1, 0.5)], &[(2, 1.0)]],
    weights: &[
        (0, 0.16666666666666666),
        (1, 0.3333333333333333),
        (2, 0.3333333333333333),
        (3, 0.16666666666666666),
    ],
    estimate: Estimate::None,
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[],
};
