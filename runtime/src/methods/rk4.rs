//! The classical Runge-Kutta method.

use super::explicit::explicit_method;
use super::{Estimate, Tableau, c};

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
    nodes: &[c(0.0, 0.0), c(0.5, 0.0), c(0.5, 0.0), c(1.0, 0.0)],
    stages: &[&[], &[(0, c(0.5, 0.0))], &[(1, c(0.5, 0.0))], &[(2, c(1.0, 0.0))]],
    weights: &[
        (0, c(0.16666666666666666, 9.25185853854297e-18)),
        (1, c(0.3333333333333333, 1.850371707708594e-17)),
        (2, c(0.3333333333333333, 1.850371707708594e-17)),
        (3, c(0.16666666666666666, 9.25185853854297e-18)),
    ],
    estimate: Estimate::None,
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[],
};
