//! Whether constraints, which a motion keeps independent, become dependent on the way of a step: the motion may go on
//! in more than one way there.
//!
//! Rows that go through such a place are turned round: made orthonormal one after the other, as many of them as are
//! lost have the opposite direction behind it. A factor that all entries of a row share turns it round and loses
//! nothing.
//!
//! The module deliberately does not know what constrains the system, or who makes the steps.

use crate::real::Real;
use crate::system::{StateVector, System};

/// Parts of a step in which rows are followed where its ends say that they have turned; each part is parted again.
const PARTS: u32 = 16;
/// Parts of a step, at most.
const MAX_PARTS: f64 = 256.0;
/// So often parts are parted.
const DEPTH: u32 = 2;
/// So far a component of the state that rows depend on moves on a part: an angle that turns a direction round and back
/// does so in many of them.
const PART: f64 = 0.25;
/// A row that is shorter than this part of its derivative by a component of the state, times the size of the state,
/// vanishes, unless a factor of it does: the square of the distance from such a place is below the residuals of
/// constraints.
const VANISHING: f64 = 1e-6;
/// A row that has become shorter by this factor on a step may vanish.
const SHRUNK: f64 = 0.98;
/// The part of a row beside those before it, below which it depends on them: reactions are in inverse proportion to it,
/// and have four digits left.
const DEPENDENT: f64 = 1e-6;
/// So far beside a state, in parts of its size, a row shows whether it vanishes with a factor alone.
const BESIDE: f64 = 1e-4;
/// The cosine above which rows around a zero of one are in one direction, that of all but a factor.
const PARALLEL: f64 = 0.9;
/// The least cosine of the angle by which the span of rows turns on a part, as a product over its directions.
const TURNED: f64 = 0.5;
/// A pivot of `A B^T + B A^T` above this part of its diagonal element tells that no direction is nearly lost.
const APART: f64 = 1e-2;
/// Where small steps from one end miss the other one by more than this part of the way, they are not the motion.
const MISSED: f64 = 0.1;

/// Rows of constraints that a motion keeps linearly independent, as generated code has them where it may lose them.
///
/// ```text
/// a_k(t, y) . v = c_k(t, y),    or    a_k = df_k/dy    of equations  f_k(t, y) = 0  between coordinates
/// ```
///
/// A system with such rows answers [`System::keeps_rank`] by [`keeps_rank`].
///
/// # Shapes
///
/// rows: no more of them than each has entries; entries for components of the state with which all are zero may be left
/// out.
pub trait IndependentRows<R: Real>: System<R> {
    /// Storage of a row.
    type Row: StateVector<R>;

    /// Storage of the rows: an array in generated code.
    type Rows: Clone + AsRef<[Self::Row]> + AsMut<[Self::Row]>;

    /// The components of the state that rows depend on.
    fn moving(&self) -> &[usize];

    /// The rows at a point.
    fn rows(&self, t: R, y: &Self::State) -> Self::Rows;
}

/// Whether the rows of a system stay independent on the way from one accepted state to the next.
///
/// The way is one of small steps by Runge and Kutta's method, or the cubic between both states with the slopes there
/// where these steps lead elsewhere. It is followed where the rows at both ends differ by more than 60 degrees, or
/// components that they depend on move far.
///
/// ```
/// use hamel_runtime::{IndependentRows, System, keeps_rank};
///
/// /// A point on `x y = 0`, two lines that cross at zero.
/// struct Cross;
///
/// impl System<f64> for Cross {
///     type State = [f64; 2];
///
///     fn rhs(&self, _t: f64, _y: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [1.0, 0.0];
///     }
/// }
///
/// // As generated code has it.
/// impl IndependentRows<f64> for Cross {
///     type Row = [f64; 2];
///     type Rows = [[f64; 2]; 1];
///
///     fn moving(&self) -> &[usize] {
///         &[0, 1]
///     }
///
///     fn rows(&self, _t: f64, &[x, y]: &[f64; 2]) -> [[f64; 2]; 1] {
///         [[y, x]]
///     }
/// }
///
/// let step = |from: f64, to: f64| keeps_rank(&Cross, (from, &[from, 0.0]), (to, &[to, 0.0]));
/// assert!(step(-0.3, -0.2) && !step(-0.1, 0.1));
/// ```
///
/// # Source
///
/// Gantmacher, The theory of matrices (1959), chapter I, section 2 (minors along a path).
pub fn keeps_rank<R: Real, S: IndependentRows<R>>(
    system: &S,
    from: (R, &S::State),
    to: (R, &S::State),
) -> bool {
    let before = system.rows(from.0, from.1);
    let mut after = system.rows(to.0, to.1);
    let (y0, y1) = (from.1.as_slice(), to.1.as_slice());
    let farthest = system.moving().iter().fold(0.0_f64, |max, &k| max.max((y1[k] - y0[k]).magnitude()));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the limits")]
    let parts = (farthest / PART).min(MAX_PARTS) as u32;
    let (first, last) = (before.as_ref(), after.as_mut());
    for k in 0..first.len() {
        let shrunk = length(&first[k]) * R::from_f64(SHRUNK);
        if length(&last[k]).all_ge(shrunk) || !vanishes(system, to, k, &last[k]) {
            continue;
        }
        if !has_factor(system, from, to, k) {
            return false;
        }
        last[k].clone_from(&first[k]);
    }
    if parts < 2 && are_near(&before, &after) {
        return true;
    }
    let mut orthonormal_rows = after.clone();
    if !orthonormal(orthonormal_rows.as_mut()).all_gt(R::from_f64(DEPENDENT)) {
        return false;
    }
    if are_turned(&before, &after) {
        return !jump(system, from, to, parts.max(PARTS), DEPTH - 1);
    }
    parts < 2 || !jump(system, from, to, parts, DEPTH - 1)
}

/// Whether rows are independent all along the straight line between both.
///
/// ```text
/// ((1 - s) A + s B) ((1 - s) A + s B)^T = (1 - s)^2 A A^T + s^2 B B^T + s (1 - s) (A B^T + B A^T)
/// ```
///
/// is positive definite where `A B^T + B A^T` is.
fn are_near<V: StateVector<R>, R: Real, Q: Clone + AsRef<[V]> + AsMut<[V]>>(a: &Q, b: &Q) -> bool {
    let (mut both, a, b) = (a.clone(), a.as_ref(), b.as_ref());
    let both = both.as_mut();
    let half = R::from_f64(0.5);
    for i in 0..a.len() {
        for j in 0..=i {
            both[i].as_mut_slice()[j] = (dot(&a[i], &b[j]) + dot(&b[i], &a[j])) * half;
        }
    }
    for k in 0..a.len() {
        let whole = both[k].as_slice()[k];
        let is_off = |row: &V| row.as_slice().iter().all(|x| *x == R::ZERO);
        if is_off(&a[k]) && is_off(&b[k]) {
            both[k].as_mut_slice()[k] = R::ONE;
            continue;
        }
        for j in 0..k {
            let (before, from) = both.split_at_mut(k);
            let (row, pivot) = (from[0].as_mut_slice(), before[j].as_slice()[j]);
            let factor = row[j] / pivot;
            for i in j + 1..k {
                row[i] -= factor * before[i].as_slice()[j];
            }
            row[k] -= factor * row[j];
        }
        if !both[k].as_slice()[k].all_gt(whole.abs() * R::from_f64(APART)) {
            return false;
        }
    }
    true
}

/// Whether rows turn round on the way from a state to another one.
fn jump<R: Real, S: IndependentRows<R>>(
    system: &S,
    from: (R, &S::State),
    to: (R, &S::State),
    parts: u32,
    depth: u32,
) -> bool {
    let h = to.0 - from.0;
    let part = |k: u32| R::ratio(f64::from(k), f64::from(parts));
    let time = |k: u32| part(k).mul_add(h, from.0);
    let small_step = |k: u32, y: &S::State| step(system, time(k), y, h * R::ratio(1.0, f64::from(parts)));
    let mut end = from.1.clone();
    for k in 0..parts {
        end = small_step(k, &end);
    }
    let distance = |a: &S::State, b: &S::State| {
        let pairs = a.as_slice().iter().zip(b.as_slice());
        pairs.fold(0.0_f64, |max, (&a, &b)| max.max((a - b).magnitude()))
    };
    // A NaN is not within it.
    let is_motion = distance(to.1, &end) <= MISSED * distance(to.1, from.1);
    let slopes = [from, to].map(|(t, y)| rate(system, t, y));
    let (mut t, mut y) = (from.0, from.1.clone());
    let mut before = system.rows(t, &y);
    for k in 1..=parts {
        let next = match is_motion {
            true => small_step(k - 1, &y),
            false => on_cubic(h, part(k), [from.1, to.1], &slopes),
        };
        let after = system.rows(time(k), &next);
        let (here, there) = ((t, &y), (time(k), &next));
        let turns = turn_round(system, (here, &before), (there, &after));
        if turns && (depth == 0 || jump(system, here, there, PARTS, depth - 1)) {
            return true;
        }
        (t, y, before) = (time(k), next, after);
    }
    false
}

/// Whether rows turn on the way from a state to one next to it, by more than a factor of theirs.
fn turn_round<R: Real, S: IndependentRows<R>>(
    system: &S,
    (here, before): ((R, &S::State), &S::Rows),
    (there, after): ((R, &S::State), &S::Rows),
) -> bool {
    if !are_turned(before, after) {
        return false;
    }
    let mut aligned = after.clone();
    for (k, (row, old)) in aligned.as_mut().iter_mut().zip(before.as_ref()).enumerate() {
        let along = dot(row, old);
        if !along.all_ge(R::ZERO) && has_factor(system, here, there, k) {
            let sign = along / along.abs();
            row.as_mut_slice().iter_mut().for_each(|x| *x *= sign);
        }
    }
    are_turned(before, &aligned)
}

/// Whether row `k` vanishes next to a state.
fn vanishes<R: Real, S: IndependentRows<R>>(
    system: &S,
    (t, y): (R, &S::State),
    k: usize,
    row: &S::Row,
) -> bool {
    let size = y.as_slice().iter().fold(1.0_f64, |max, y| max.max(y.magnitude()));
    let own = length(row);
    !system.moving().iter().all(|&at| {
        let mut beside = y.clone();
        beside.as_mut_slice()[at] += R::from_f64(BESIDE * size);
        let rows = system.rows(t, &beside);
        let pairs = rows.as_ref()[k].as_slice().iter().zip(row.as_slice());
        let change = pairs.fold(R::ZERO, |sum, (&a, &b)| (a - b).mul_add(a - b, sum)).sqrt();
        own.all_gt(change * R::from_f64(VANISHING / BESIDE))
    })
}

/// Whether row `k` has one direction all around a state, so that it vanishes with a factor alone.
fn has_factor<R: Real, S: IndependentRows<R>>(
    system: &S,
    (_, from): (R, &S::State),
    (t, y): (R, &S::State),
    k: usize,
) -> bool {
    let size = y.as_slice().iter().fold(1.0_f64, |max, y| max.max(y.magnitude()));
    let ends = from.as_slice().iter().zip(y.as_slice());
    let step = ends.fold(BESIDE * size, |max, (&a, &b)| max.max((b - a).magnitude()));
    let mut first: Option<S::Row> = None;
    for (&at, step) in system.moving().iter().flat_map(|at| [(at, step), (at, -step)]) {
        let mut beside = y.clone();
        beside.as_mut_slice()[at] += R::from_f64(step);
        let rows = system.rows(t, &beside);
        let row = &rows.as_ref()[k];
        let size = length(row);
        if !size.all_gt(R::ZERO) {
            continue;
        }
        let first = first.get_or_insert_with(|| row.clone());
        if !dot(first, row).abs().all_gt(R::from_f64(PARALLEL) * size * length(first)) {
            return false;
        }
    }
    true
}

/// Whether the span of rows turns to another one, or a direction in it turns round.
fn are_turned<V: StateVector<R>, R: Real, Q: Clone + AsRef<[V]> + AsMut<[V]>>(a: &Q, b: &Q) -> bool {
    let [mut p, mut q] = [a.clone(), b.clone()];
    let least = [orthonormal(p.as_mut()), orthonormal(q.as_mut())];
    if !least.iter().all(|least| least.all_gt(R::ZERO)) {
        return true;
    }
    // Square matrices in the place of rows, which are no shorter.
    let (p, q) = (p.as_ref(), q.as_ref());
    let (mut turn, mut both) = (a.clone(), a.clone());
    let (turn, both) = (turn.as_mut(), both.as_mut());
    let n = p.len();
    for i in 0..n {
        for j in 0..n {
            turn[i].as_mut_slice()[j] = dot(&p[i], &q[j]);
        }
        // One where a row is zero at an end.
        turn[i].as_mut_slice()[i] += R::ONE - dot(&p[i], &p[i]) * dot(&q[i], &q[i]);
    }
    for i in 0..n {
        for j in 0..n {
            both[i].as_mut_slice()[j] = turn[i].as_slice()[j] + turn[j].as_slice()[i];
        }
    }
    // Where no direction turns by a right angle, the symmetric part and the whole have positive pivots.
    let mut volume = R::ONE;
    for k in 0..n {
        let pivot = turn[k].as_slice()[k];
        if !(both[k].as_slice()[k].all_gt(R::ZERO) && pivot.all_gt(R::ZERO)) {
            return true;
        }
        volume *= pivot;
        for matrix in [&mut *turn, &mut *both] {
            let (upper, lower) = matrix.split_at_mut(k + 1);
            let row = upper[k].as_slice();
            for other in lower.iter_mut().map(StateVector::as_mut_slice) {
                let factor = other[k] / row[k];
                for (out, &x) in other[k..n].iter_mut().zip(&row[k..n]) {
                    *out -= factor * x;
                }
            }
        }
    }
    !volume.all_gt(R::from_f64(TURNED))
}

/// Makes rows orthogonal to those before them and of length one, and leaves rows of zeros, as where a mode is
/// off; gives the least part of a row that those before it do not have.
///
/// # Source
///
/// Gram and Schmidt, twice.
fn orthonormal<R: Real, V: StateVector<R>>(rows: &mut [V]) -> R {
    let tiny = R::from_f64(R::MIN_POSITIVE);
    let scale = |row: &mut V, by: R| row.as_mut_slice().iter_mut().for_each(|x| *x /= by);
    let mut least = R::ONE;
    for k in 0..rows.len() {
        let (before, from) = rows.split_at_mut(k);
        let row = &mut from[0];
        let own = length(row) + tiny;
        scale(row, own);
        // One where the row is zero, zero elsewhere.
        let missing = R::ONE - dot(row, row);
        for other in before.iter().chain(before.iter()) {
            let part = dot(row, other);
            let pairs = row.as_mut_slice().iter_mut().zip(other.as_slice());
            pairs.for_each(|(out, &x)| *out -= part * x);
        }
        let left = length(row) + missing;
        // The smaller of both on every lane.
        least = (least + left - (least - left).abs()) * R::from_f64(0.5);
        scale(row, left);
    }
    least
}

/// The derivative.
fn rate<R: Real, S: System<R>>(system: &S, t: R, y: &S::State) -> S::State {
    let mut dy = y.zeros_like();
    system.rhs(t, y, &mut dy);
    dy
}

/// A step of Runge and Kutta's method of order four.
fn step<R: Real, S: System<R>>(system: &S, t: R, y: &S::State, h: R) -> S::State {
    let half = h * R::from_f64(0.5);
    let moved = |by: R, slope: &S::State| {
        let mut to = y.clone();
        let pairs = to.as_mut_slice().iter_mut().zip(slope.as_slice());
        pairs.for_each(|(y, &slope)| *y = slope.mul_add(by, *y));
        to
    };
    let a = rate(system, t, y);
    let b = rate(system, t + half, &moved(half, &a));
    let c = rate(system, t + half, &moved(half, &b));
    let d = rate(system, t + h, &moved(h, &c));
    let mut next = y.clone();
    let slopes = a.as_slice().iter().zip(b.as_slice()).zip(c.as_slice().iter().zip(d.as_slice()));
    for (y, ((&a, &b), (&c, &d))) in next.as_mut_slice().iter_mut().zip(slopes) {
        *y += h * R::ratio(1.0, 6.0) * (a + (b + c) + (b + c) + d);
    }
    next
}

/// The state at a part of the way on the cubic between two states with their slopes.
fn on_cubic<R: Real, V: StateVector<R>>(h: R, x: R, [from, to]: [&V; 2], [first, last]: &[V; 2]) -> V {
    let mut y = from.clone();
    let ends = to.as_slice().iter().zip(first.as_slice().iter().zip(last.as_slice()));
    for (y, (&to, (&first, &last))) in y.as_mut_slice().iter_mut().zip(ends) {
        let difference = to - *y;
        let bend = difference + difference - h * (first + last);
        *y += x * (difference + (R::ONE - x) * (h * first - difference + x * bend));
    }
    y
}

fn dot<R: Real, V: StateVector<R>>(a: &V, b: &V) -> R {
    let pairs = a.as_slice().iter().zip(b.as_slice());
    pairs.fold(R::ZERO, |sum, (&a, &b)| a.mul_add(b, sum))
}

fn length<R: Real, V: StateVector<R>>(a: &V) -> R {
    dot(a, a).sqrt()
}
