//! Anchor, bracket and drift in another frame: built from stage forms, and by the law of transformation.
//!
//! Does not know: Lagrangians, constraints.

use crate::reduction::change::{Frame, contract, contract_column};
use crate::reduction::stages::Stages;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph};
use hamel_lang::algebra::Algebroid;

/// The algebroid in the frame that is adapted to stages, built from the stage forms and equal to the transformed one.
///
/// `of_group`: whether the action is from the right, and the connection that the model is written with.
///
/// # Errors
/// [`Error::RebuiltBracketDiffers`] for what differs.
pub(super) fn adapted(
    g: &mut Graph,
    old: &Algebroid,
    stages: &Stages,
    (frame, names): (&Frame, &[String]),
    of_group: (bool, &Option<Vec<Vec<ExprId>>>),
) -> Result<Algebroid, Error> {
    let built = Builder::new(g, old, stages, of_group).algebroid(g, names);
    let expected = transformed(g, old, frame, names);
    let pair = |a: &str, b: &str| Error::RebuiltBracketDiffers { pair: [a.to_owned(), b.to_owned()] };
    for a in 0..built.rank() {
        for i in 0..built.n_base() {
            if !g.is_equal(built.anchor(i, a), expected.anchor(i, a)) {
                return Err(pair(&names[a], g.name(built.base()[i])));
            }
        }
        let drifts = (built.drift(a).to_vec(), expected.drift(a).to_vec());
        if !are_equal(g, &drifts.0, &drifts.1) {
            return Err(pair("d/dt", &names[a]));
        }
        for b in a + 1..built.rank() {
            let (one, other) = (built.bracket(g, a, b), expected.bracket(g, a, b));
            if !are_equal(g, &one, &other) {
                return Err(pair(&names[a], &names[b]));
            }
        }
    }
    Ok(built)
}

/// Whether two sparse vectors are equal.
fn are_equal(g: &mut Graph, a: &[(usize, ExprId)], b: &[(usize, ExprId)]) -> bool {
    let value = |list: &[(usize, ExprId)], c: usize, zero: ExprId| {
        list.iter().find(|(k, _)| *k == c).map_or(zero, |(_, e)| *e)
    };
    let zero = g.zero();
    a.iter().chain(b).all(|(c, _)| g.is_equal(value(a, *c, zero), value(b, *c, zero)))
}

/// The components that do not vanish.
fn sparse(g: &mut Graph, vector: Vec<ExprId>, offset: usize) -> Vec<(usize, ExprId)> {
    let tidied: Vec<ExprId> = vector.into_iter().map(|e| g.cancel_zero(e)).collect();
    tidied.into_iter().enumerate().filter(|(_, e)| *e != g.zero()).map(|(k, e)| (offset + k, e)).collect()
}

/// The frame `(D_i, f_k)`: adapted elements `f_k`, which may depend on shape and time, and horizontal lifts
/// `D_i = d_i - A^k_i f_k` of the total connection `A`, the sum of the model's and those of the stages.
struct Builder<'a> {
    old: &'a Algebroid,
    stages: &'a Stages,
    is_right: bool,
    /// Number of base velocities.
    n: usize,
    /// `A^k_i`, by shape coordinate.
    total: Vec<Vec<ExprId>>,
    /// Of that, what the stages add.
    added: Vec<Vec<ExprId>>,
    /// `Lambda_i`: `d_i f_q = (Lambda_i)^k_q f_k`, by shape coordinate, `[q][k]`.
    turning: Vec<Vec<Vec<ExprId>>>,
    /// The same for `d/dt`.
    turning_in_time: Vec<Vec<ExprId>>,
}

impl<'a> Builder<'a> {
    fn new(
        g: &mut Graph,
        old: &'a Algebroid,
        stages: &'a Stages,
        (is_right, connection): (bool, &Option<Vec<Vec<ExprId>>>),
    ) -> Builder<'a> {
        let r = stages.basis.len();
        let n = old.rank() - r;
        let mut added = vec![vec![g.zero(); r]; n];
        for (k, row) in stages.connection.iter().flatten().enumerate() {
            row.iter().enumerate().for_each(|(i, e)| added[i][k] = *e);
        }
        let mut total = added.clone();
        for (i, vector) in total.iter_mut().enumerate() {
            let Some(rows) = connection else { break };
            let of_model: Vec<ExprId> = rows.iter().map(|row| row[i]).collect();
            for (k, e) in vector.iter_mut().enumerate() {
                let own = contract_column(g, &of_model, &stages.inverse, k);
                let sum = g.add(*e, own);
                *e = g.cancel_zero(sum);
            }
        }
        let mut turning_of = |rate: &mut dyn FnMut(&mut Graph, ExprId) -> ExprId| -> Vec<Vec<ExprId>> {
            let mut rows = Vec::new();
            for element in &stages.basis {
                let moved: Vec<ExprId> = element.iter().map(|e| rate(g, *e)).collect();
                let row = (0..r).map(|k| contract_column(g, &moved, &stages.inverse, k));
                let row: Vec<ExprId> = row.collect();
                rows.push(row.into_iter().map(|e| g.cancel_zero(e)).collect());
            }
            rows
        };
        let turning = (0..n).map(|i| turning_of(&mut |g, e| old.derivative_along(g, i, e))).collect();
        let turning_in_time = turning_of(&mut |g, e| g.diff(e, old.time()));
        Builder { old, stages, is_right, n, total, added, turning, turning_in_time }
    }

    /// `[x, y]` in the adapted basis, from the stage forms.
    fn bracket(&self, g: &mut Graph, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
        let bracket = self.stages.rebuilt_bracket(g, x, y);
        match self.is_right {
            true => bracket.into_iter().map(|e| g.neg(e)).collect(),
            false => bracket,
        }
    }

    fn element(&self, g: &Graph, q: usize) -> Vec<ExprId> {
        (0..self.stages.basis.len()).map(|k| if k == q { g.one() } else { g.zero() }).collect()
    }

    /// `Lambda x` of a vector in the adapted basis.
    fn turned(g: &mut Graph, turning: &[Vec<ExprId>], x: &[ExprId]) -> Vec<ExprId> {
        (0..x.len()).map(|k| contract_column(g, x, turning, k)).collect()
    }

    fn algebroid(&self, g: &mut Graph, names: &[String]) -> Algebroid {
        let (n, r) = (self.n, self.stages.basis.len());
        let mut built = Algebroid::new(g, self.old.time(), self.old.base().to_vec(), names.to_vec());
        built.set_almost(self.old.is_almost());
        for x in 0..self.old.n_base() {
            let of_elements: Vec<ExprId> = (0..r).map(|a| self.old.anchor(x, n + a)).collect();
            let along: Vec<ExprId> =
                self.stages.basis.iter().map(|element| contract(g, element, &of_elements)).collect();
            for (k, rho) in along.iter().enumerate() {
                built.set_anchor(x, n + k, *rho);
            }
            for i in 0..n {
                let vertical = contract(g, &self.added[i], &along);
                let rho = g.sub(self.old.anchor(x, i), vertical);
                built.set_anchor(x, i, g.cancel_zero(rho));
            }
        }
        let mut set = |g: &mut Graph, a: usize, b: usize, value: Vec<ExprId>| {
            let value = sparse(g, value, n);
            if !value.is_empty() {
                built.set_bracket(a, b, value);
            }
        };
        for p in 0..r {
            for q in p + 1..r {
                let (x, y) = (self.element(g, p), self.element(g, q));
                let value = self.bracket(g, &x, &y);
                set(g, n + p, n + q, value);
            }
        }
        for i in 0..n {
            for j in i + 1..n {
                let value = self.curvature(g, i, j).into_iter().map(|e| g.neg(e)).collect();
                set(g, i, j, value);
            }
            for q in 0..r {
                let y = self.element(g, q);
                let inner = self.bracket(g, &self.total[i], &y);
                let pairs = self.turning[i][q].iter().zip(&inner);
                let value = pairs.map(|(turned, e)| g.sub(*turned, *e)).collect();
                set(g, i, n + q, value);
            }
        }
        for i in 0..n {
            let carried = Self::turned(g, &self.turning_in_time, &self.total[i]);
            let mut drift = Vec::new();
            for (a, carried) in self.total[i].iter().zip(carried) {
                let explicit = g.diff(*a, self.old.time());
                let sum = g.add(explicit, carried);
                drift.push(g.neg(sum));
            }
            set_drift(g, &mut built, i, drift, n);
        }
        for q in 0..r {
            set_drift(g, &mut built, n + q, self.turning_in_time[q].clone(), n);
        }
        built
    }

    /// `B(d_i, d_j) = d_i A_j - d_j A_i + Lambda_i A_j - Lambda_j A_i - [A_i, A_j]`.
    fn curvature(&self, g: &mut Graph, i: usize, j: usize) -> Vec<ExprId> {
        let inner = self.bracket(g, &self.total[i], &self.total[j]);
        let forward = Self::turned(g, &self.turning[i], &self.total[j]);
        let backward = Self::turned(g, &self.turning[j], &self.total[i]);
        let mut curvature = Vec::new();
        for k in 0..inner.len() {
            let one = self.old.derivative_along(g, i, self.total[j][k]);
            let other = self.old.derivative_along(g, j, self.total[i][k]);
            let minus = [other, backward[k], inner[k]].map(|e| g.neg(e));
            curvature.push(g.sum(&[one, forward[k], minus[0], minus[1], minus[2]]));
        }
        curvature
    }
}

fn set_drift(g: &mut Graph, built: &mut Algebroid, alpha: usize, drift: Vec<ExprId>, n: usize) {
    let drift = sparse(g, drift, n);
    if !drift.is_empty() {
        built.set_drift(alpha, drift);
    }
}

/// The algebroid in another frame: `rho' = rho T`,
/// `C'^c_ab = (T^-1)^c_f (T^d_a T^e_b C^f_de + rho'_a(T^f_b) - rho'_b(T^f_a))`,
/// `N'^c_a = (T^-1)^c_f (N^f_d T^d_a + dT^f_a/dt)`.
pub(super) fn transformed(g: &mut Graph, old: &Algebroid, frame: &Frame, names: &[String]) -> Algebroid {
    let m = old.rank();
    let column = |a: usize| -> Vec<ExprId> { frame.matrix.iter().map(|row| row[a]).collect() };
    let columns: Vec<Vec<ExprId>> = (0..m).map(column).collect();
    let mut new = Algebroid::new(g, old.time(), old.base().to_vec(), names.to_vec());
    new.set_almost(old.is_almost());
    for x in 0..old.n_base() {
        let anchors: Vec<ExprId> = (0..m).map(|alpha| old.anchor(x, alpha)).collect();
        for (a, column) in columns.iter().enumerate() {
            let rho = contract(g, &anchors, column);
            new.set_anchor(x, a, g.cancel_zero(rho));
        }
    }
    let moved = |g: &mut Graph, new: &Algebroid, a: usize, column: &[ExprId]| -> Vec<ExprId> {
        column.iter().map(|e| new.derivative_along(g, a, *e)).collect()
    };
    let pairs = (0..m).flat_map(|d| (d + 1..m).map(move |e| (d, e)));
    let brackets = pairs.map(|(d, e)| (d, e, old.bracket(g, d, e)));
    let brackets: Vec<_> = brackets.filter(|(.., value)| !value.is_empty()).collect();
    for a in 0..m {
        for b in a + 1..m {
            let forward = moved(g, &new, a, &columns[b]);
            let backward = moved(g, &new, b, &columns[a]);
            let mut terms: Vec<Vec<ExprId>> = forward.into_iter().map(|e| vec![e]).collect();
            for (list, e) in terms.iter_mut().zip(backward) {
                list.push(g.neg(e));
            }
            for (d, e, value) in &brackets {
                let one = g.mul(columns[a][*d], columns[b][*e]);
                let other = g.mul(columns[a][*e], columns[b][*d]);
                let weight = g.sub(one, other);
                if weight == g.zero() {
                    continue;
                }
                for (f, c) in value {
                    terms[*f].push(g.mul(weight, *c));
                }
            }
            let vector: Vec<ExprId> = terms.iter().map(|list| g.sum(list)).collect();
            let value: Vec<ExprId> = frame.inverse.iter().map(|row| contract(g, row, &vector)).collect();
            let value = sparse(g, value, 0);
            if !value.is_empty() {
                new.set_bracket(a, b, value);
            }
        }
        let mut vector: Vec<ExprId> = columns[a].iter().map(|e| g.diff(*e, old.time())).collect();
        for (d, e) in columns[a].iter().enumerate() {
            for (f, n) in old.drift(d) {
                let turned = g.mul(*n, *e);
                vector[*f] = g.add(vector[*f], turned);
            }
        }
        let drift = frame.inverse.iter().map(|row| contract(g, row, &vector)).collect();
        set_drift(g, &mut new, a, drift, 0);
    }
    new
}
