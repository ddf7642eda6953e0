//! The method of Dormand and Prince.

use super::explicit::explicit_method;
use super::{Estimate, Tableau};

explicit_method! {
    /// The method of order 5(4) of Dormand and Prince, with 6 evaluations a step.
    ///
    /// Dense output is of order 4 and needs no further evaluation.
    ///
    /// # Source
    ///
    /// Dormand and Prince, A family of embedded Runge-Kutta formulae (1980); dense output of Shampine in Hairer,
    /// Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.6.
    Dopri5, TABLEAU, 5
}

const TABLEAU: Tableau = Tableau {
    name: "dopri5",
    order: 5,
    nodes: &[0.0, 0.2, 0.3, 0.8, 0.8888888888888888, 1.0],
    stages: &[
        &[],
        &[(0, 0.2)],
        &[(0, 0.075), (1, 0.225)],
        &[(0, 0.9777777777777777), (1, -3.7333333333333334), (2, 3.5555555555555554)],
        &[
            (0, 2.9525986892242035),
            (1, -11.595793324188385),
            (2, 9.822892851699436),
            (3, -0.2908093278463649),
        ],
        &[
            (0, 2.8462752525252526),
            (1, -10.757575757575758),
            (2, 8.906422717743473),
            (3, 0.2784090909090909),
            (4, -0.2735313036020583),
        ],
    ],
    weights: &[
        (0, 0.09114583333333333),
        (2, 0.44923629829290207),
        (3, 0.6510416666666666),
        (4, -0.322376179245283),
        (5, 0.13095238095238096),
    ],
    estimate: Estimate::Embedded {
        order: 5,
        weights: &[
            (0, 0.0012326388888888888),
            (2, -0.0042527702905061394),
            (3, 0.03697916666666667),
            (4, -0.05086379716981132),
            (5, 0.0419047619047619),
            (6, -0.025),
        ],
    },
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[
        (0, &[-1.1270175653862835]),
        (2, &[2.675424484351598]),
        (3, &[-5.685526961588504]),
        (4, &[3.5219323679207912]),
        (5, &[-1.7672812570757455]),
        (6, &[2.382468931778144]),
    ],
};
