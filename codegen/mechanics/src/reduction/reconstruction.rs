//! The group equation `gdot = g xi` (left) or `gdot = xi g` (right) in coordinates.

use std::ops::Range;

use num_traits::One;

use hamel_expr::{ExprId, Func, Graph, Rational, SymbolId};
use hamel_lang::spec::group_motion::group_rates;
use hamel_lang::spec::{Configuration, Reconstruction, ReconstructionKind, Side};

use super::matrix_group::{self, MomentumInSpace};

/// A reconstructed coordinate and its rate.
#[derive(Clone, Debug)]
pub struct ReconstructedCoordinate {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// Its rate, in velocities of the frame, base coordinates and reconstructed coordinates.
    pub rate: ExprId,
    /// Whether it is a coordinate of an abelian group, whose rate is linear in the velocities.
    pub is_abelian: bool,
    /// What it is.
    pub doc: String,
}

/// Rates of the coordinates of one item.
///
/// Unit quaternions `(w, x, y, z)` turn body vectors to space: `qdot = q Omega / 2` (left), `qdot = omega q / 2`
/// (right). A planar pose is `(theta, x, y)`, a pose a quaternion and a position: `rdot = R(q) V` (left),
/// `rdot = V + omega x r` (right).
pub(super) fn rates(g: &mut Graph, item: &Reconstruction, side: Side) -> Vec<ReconstructedCoordinate> {
    let coordinates: Vec<ExprId> = item.symbols.iter().map(|s| g.sym(*s)).collect();
    let rates = match &item.kind {
        ReconstructionKind::Angle { omega } => vec![*omega],
        ReconstructionKind::Translation { v } => v.clone(),
        ReconstructionKind::Rate { rate } => rate.clone(),
        ReconstructionKind::Quaternion { omega } => quaternion_rates(g, &coordinates, omega, side),
        ReconstructionKind::PlanarPose { omega, v } => planar_rates(g, &coordinates, *omega, v, side),
        ReconstructionKind::Matrix { group, elements: _, xi } => {
            group_rates(g, group, &coordinates, xi, side)
        }
        ReconstructionKind::Pose { omega, v } => {
            let (q, r) = coordinates.split_at(4);
            let mut rates = quaternion_rates(g, q, omega, side);
            rates.extend(match side {
                Side::Left => rotated(g, q, v),
                Side::Right => {
                    let turned = cross(g, omega, r);
                    turned.iter().zip(v).map(|(a, b)| g.add(*a, *b)).collect()
                }
            });
            rates
        }
    };
    let is_abelian =
        matches!(item.kind, ReconstructionKind::Angle { .. } | ReconstructionKind::Translation { .. });
    let named = item.names.iter().zip(&item.symbols).zip(rates);
    named
        .map(|((name, symbol), rate)| ReconstructedCoordinate {
            name: name.clone(),
            symbol: *symbol,
            rate,
            is_abelian,
            doc: item.doc.clone(),
        })
        .collect()
}

/// What the coadjoint action of an item's group element makes of momenta: `Ad*_{g^-1} p` for a left action, constant
/// where nothing else breaks the symmetry; `Ad*_g p` for a right one.
///
/// A unit quaternion turns every three momenta of the algebra, `algebra` in the frame, by `|q|^2 R(q)`, whose rate
/// needs no unit length; a planar pose moves its own three. About a point in space angular momentum is constant on
/// `|q| = 1` alone, and left out.
pub(super) fn momenta_in_space(
    g: &mut Graph,
    item: &Reconstruction,
    side: Side,
    algebra: Range<usize>,
) -> Vec<MomentumInSpace> {
    let coordinates: Vec<ExprId> = item.symbols.iter().map(|s| g.sym(*s)).collect();
    match &item.kind {
        ReconstructionKind::Quaternion { .. } | ReconstructionKind::Pose { .. } => {
            let rows = turn(g, &coordinates[..4], side);
            let threes = algebra.clone().step_by(3).filter(|k| k + 3 <= algebra.end);
            let attitude = item.blocks.first().map(|(name, _)| (name.clone(), item.symbols[0]));
            let of_three = |k| MomentumInSpace {
                velocities: (k..k + 3).collect(),
                rows: rows.clone(),
                attitude: attitude.clone(),
            };
            threes.map(of_three).collect()
        }
        ReconstructionKind::PlanarPose { .. } if algebra.len() >= 3 => {
            let [theta, x, y] = [0, 1, 2].map(|k| coordinates[k]);
            let (zero, one) = (g.zero(), g.one());
            let (s, c) = (g.func(Func::Sin, theta), g.func(Func::Cos, theta));
            let back = g.neg(s);
            // The force line of a left action passes through the pose, that of a right one through the origin.
            let (pushed, rows) = match side {
                Side::Left => {
                    let ([cx, sx], [cy, sy]) = ([c, s].map(|e| g.mul(x, e)), [c, s].map(|e| g.mul(y, e)));
                    let (along, across) = (g.sub(sx, cy), g.add(cx, sy));
                    ([along, across], [[c, back], [s, c]])
                }
                Side::Right => {
                    let minus_x = g.neg(x);
                    ([y, minus_x], [[c, s], [back, c]])
                }
            };
            let rows =
                [[one, pushed[0], pushed[1]], [zero, rows[0][0], rows[0][1]], [zero, rows[1][0], rows[1][1]]];
            let rows = rows.iter().map(|row| row.to_vec()).collect();
            vec![MomentumInSpace { velocities: algebra.take(3).collect(), rows, attitude: None }]
        }
        ReconstructionKind::Matrix { group, elements, xi: _ } => {
            let elements: Vec<usize> = elements.iter().map(|a| algebra.start + a).collect();
            matrix_group::momenta_in_space(g, group, &coordinates, &elements, side)
        }
        _ => Vec::new(),
    }
}

/// Functions of an item's coordinates that a motion keeps because it stays in the group; unit quaternions are known
/// by their [`BlockKind`](super::BlockKind).
pub(super) fn group_equations(g: &mut Graph, item: &Reconstruction, side: Side) -> Vec<(String, ExprId)> {
    let ReconstructionKind::Matrix { group, .. } = &item.kind else { return Vec::new() };
    let coordinates: Vec<ExprId> = item.symbols.iter().map(|s| g.sym(*s)).collect();
    let name = item.blocks.first().map_or("", |(name, _)| name.trim_end_matches("_re"));
    matrix_group::equations(g, group, (name, &coordinates), side)
}

/// Functions of the coordinates of a configuration whose values a motion keeps because it stays in the group. Told in a
/// frame that turns, it keeps its form alone, `g M g^T = M`, and not any other value of `g M g^T`.
pub(super) fn configuration_equations(
    g: &mut Graph,
    item: &Configuration,
    side: Side,
) -> Vec<(String, ExprId)> {
    let coordinates: Vec<ExprId> = item.symbols.iter().map(|s| g.sym(*s)).collect();
    matrix_group::equations(g, &item.group, (&item.name, &coordinates), side)
}

/// `|q|^2 R(q)`, or its transpose for a right action: `(w^2 - u.u) 1 + 2 u u^T +- 2 w [u]`.
fn turn(g: &mut Graph, q: &[ExprId], side: Side) -> Vec<Vec<ExprId>> {
    let two = Rational::one() + Rational::one();
    let w = match side {
        Side::Left => q[0],
        Side::Right => g.neg(q[0]),
    };
    let squares: Vec<ExprId> = q.iter().map(|x| g.mul(*x, *x)).collect();
    let signs =
        |k: usize| (0..4).map(move |j| if j == 0 || j == k + 1 { Rational::one() } else { -Rational::one() });
    let mut rows = vec![vec![g.zero(); 3]; 3];
    for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let weighted: Vec<_> = squares.iter().copied().zip(signs(i)).collect();
        rows[i][i] = g.linear_combination(&weighted);
        let (both, turned) = (g.mul(q[i + 1], q[j + 1]), g.mul(w, q[k + 1]));
        rows[i][j] = g.linear_combination(&[(both, two.clone()), (turned, -two.clone())]);
        rows[j][i] = g.linear_combination(&[(both, two.clone()), (turned, two.clone())]);
    }
    rows
}

fn cross(g: &mut Graph, a: &[ExprId], b: &[ExprId]) -> Vec<ExprId> {
    [(1, 2), (2, 0), (0, 1)]
        .iter()
        .map(|&(i, j)| {
            let (forward, backward) = (g.mul(a[i], b[j]), g.mul(a[j], b[i]));
            g.sub(forward, backward)
        })
        .collect()
}

/// `qdot = q Omega / 2` or `omega q / 2`: the vector part is `(w omega +- u x omega) / 2`.
fn quaternion_rates(g: &mut Graph, q: &[ExprId], omega: &[ExprId; 3], side: Side) -> Vec<ExprId> {
    let half = Rational::new(1.into(), 2.into());
    let u = &q[1..4];
    let inner = g.dot(u, omega);
    let turned = match side {
        Side::Left => cross(g, u, omega),
        Side::Right => cross(g, omega, u),
    };
    let mut rates = vec![g.scale(inner, &-half.clone())];
    for k in 0..3 {
        let straight = g.mul(q[0], omega[k]);
        let sum = g.add(straight, turned[k]);
        rates.push(g.scale(sum, &half));
    }
    rates
}

fn planar_rates(g: &mut Graph, pose: &[ExprId], omega: ExprId, v: &[ExprId; 2], side: Side) -> Vec<ExprId> {
    match side {
        Side::Left => {
            let (s, c) = (g.func(Func::Sin, pose[0]), g.func(Func::Cos, pose[0]));
            let [cx, sy, sx, cy] = [(c, v[0]), (s, v[1]), (s, v[0]), (c, v[1])].map(|(a, b)| g.mul(a, b));
            vec![omega, g.sub(cx, sy), g.add(sx, cy)]
        }
        Side::Right => {
            let (wy, wx) = (g.mul(omega, pose[2]), g.mul(omega, pose[1]));
            vec![omega, g.sub(v[0], wy), g.add(v[1], wx)]
        }
    }
}

/// `R(q) v = v + 2 w (u x v) + 2 u x (u x v)` for a unit quaternion `(w, u)`.
fn rotated(g: &mut Graph, q: &[ExprId], v: &[ExprId; 3]) -> Vec<ExprId> {
    let two = Rational::one() + Rational::one();
    let once = cross(g, &q[1..4], v);
    let once: Vec<ExprId> = once.into_iter().map(|e| g.scale(e, &two)).collect();
    let twice = cross(g, &q[1..4], &once);
    (0..3)
        .map(|k| {
            let straight = g.mul(q[0], once[k]);
            g.sum(&[v[k], straight, twice[k]])
        })
        .collect()
}
