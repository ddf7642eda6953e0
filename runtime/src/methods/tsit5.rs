//! The method of Tsitouras.

use super::{Estimate, Method, Tableau};

/// The method of order 5(4) of Tsitouras, with 6 evaluations a step: the one to try first.
///
/// Dense output is of order 4 and needs no further evaluation.
///
/// # Source
///
/// Tsitouras, Runge-Kutta pairs of order 5(4) satisfying only the first column simplifying assumption (2011).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tsit5;

impl Method for Tsit5 {
    type Stages<V> = [V; 7];
    const TABLEAU: &'static Tableau = &TABLEAU;

    fn stages<V: Clone>(zeros: &V) -> [V; 7] {
        core::array::from_fn(|_| zeros.clone())
    }
}

const TABLEAU: Tableau = Tableau {
    name: "tsit5",
    order: 5,
    nodes: &[0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0],
    stages: &[
        &[],
        &[(0, 0.161)],
        &[(0, -0.008480655492356989), (1, 0.335480655492357)],
        &[(0, 2.8971530571054935), (1, -6.359448489975075), (2, 4.3622954328695815)],
        &[
            (0, 5.325864828439257),
            (1, -11.748883564062828),
            (2, 7.4955393428898365),
            (3, -0.09249506636175525),
        ],
        &[
            (0, 5.86145544294642),
            (1, -12.92096931784711),
            (2, 8.159367898576159),
            (3, -0.071584973281401),
            (4, -0.028269050394068383),
        ],
    ],
    weights: &[
        (0, 0.09646076681806523),
        (1, 0.01),
        (2, 0.4798896504144996),
        (3, 1.379008574103742),
        (4, -3.290069515436081),
        (5, 2.324710524099774),
    ],
    estimate: Estimate::Embedded {
        order: 5,
        weights: &[
            (0, -0.0017800110522257714),
            (1, -0.0008164344596567469),
            (2, 0.007880878010261995),
            (3, -0.1447110071732629),
            (4, 0.5823571654525552),
            (5, -0.45808210592918697),
            (6, 0.015151515151515152),
        ],
    },
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[
        (0, [-1.0530884977290216, 0.0, 0.0, 0.0]),
        (1, [0.1017, 0.0, 0.0, 0.0]),
        (2, [2.490627285651253, 0.0, 0.0, 0.0]),
        (3, [-16.548102889244902, 0.0, 0.0, 0.0]),
        (4, [47.37952196281928, 0.0, 0.0, 0.0]),
        (5, [-34.87065786149661, 0.0, 0.0, 0.0]),
        (6, [2.5, 0.0, 0.0, 0.0]),
    ],
};
