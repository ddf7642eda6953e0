//! The group equation `gdot = g xi` (left) or `gdot = xi g` (right) in coordinates.

use num_traits::One;

use crate::expr::{ExprId, Func, Graph, Rational, SymbolId};
use crate::spec::{Reconstruction, ReconstructionKind, Side};

/// A reconstructed coordinate and its rate.
#[derive(Clone, Debug)]
pub struct ReconstructedCoordinate {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// Its rate, in velocities of the frame, base coordinates and reconstructed coordinates.
    pub rate: ExprId,
    /// What it is.
    pub doc: String,
}

/// Rates of the coordinates of one item.
///
/// Unit quaternions `(w, x, y, z)` turn body vectors to space: `qdot = q Omega / 2` (left), `qdot = omega q / 2` (right).
/// A planar pose is `(theta, x, y)`, a pose a quaternion and a position: `rdot = R(q) V` (left), `rdot = V + omega x r`
/// (right).
pub(super) fn rates(g: &mut Graph, item: &Reconstruction, side: Side) -> Vec<ReconstructedCoordinate> {
    let coordinates: Vec<ExprId> = item.symbols.iter().map(|s| g.sym(*s)).collect();
    let rates = match &item.kind {
        ReconstructionKind::Angle { omega } => vec![*omega],
        ReconstructionKind::Translation { v } => v.clone(),
        ReconstructionKind::Rate { rate } => rate.clone(),
        ReconstructionKind::Quaternion { omega } => quaternion_rates(g, &coordinates, omega, side),
        ReconstructionKind::PlanarPose { omega, v } => planar_rates(g, &coordinates, *omega, v, side),
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
    let named = item.names.iter().zip(&item.symbols).zip(rates);
    named
        .map(|((name, symbol), rate)| ReconstructedCoordinate {
            name: name.clone(),
            symbol: *symbol,
            rate,
            doc: item.doc.clone(),
        })
        .collect()
}

/// The expressions of an item.
pub(super) fn expressions_mut(kind: &mut ReconstructionKind) -> Vec<&mut ExprId> {
    match kind {
        ReconstructionKind::Angle { omega } => vec![omega],
        ReconstructionKind::Translation { v: list } | ReconstructionKind::Rate { rate: list } => {
            list.iter_mut().collect()
        }
        ReconstructionKind::Quaternion { omega } => omega.iter_mut().collect(),
        ReconstructionKind::PlanarPose { omega, v } => std::iter::once(omega).chain(v).collect(),
        ReconstructionKind::Pose { omega, v } => omega.iter_mut().chain(v).collect(),
    }
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
    let products: Vec<ExprId> = u.iter().zip(omega).map(|(a, b)| g.mul(*a, *b)).collect();
    let inner = g.sum(&products);
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
