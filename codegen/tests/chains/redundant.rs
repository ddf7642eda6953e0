//! How a chain moves: d'Alembert's principle for bodies in space, by rotation matrices and numbers alone.
//!
//! The velocity of every body in space is linear in the rates `y` of the joints and of the base, and its acceleration
//! is `J ydot + b`. Forces of inertia do no virtual work beside weights and reactions,
//!
//! ```text
//! sum_k J_k^T (m_k (a_k - g), I_k alpha_k + omega_k x I_k omega_k) = C^T lambda,    C ydot + c = 0
//! ```
//!
//! which is solved for `ydot` and `lambda` by Gauss elimination. Nothing is expanded, shared or reduced.
//!
//! # Source
//! Lagrange, Mecanique analytique; Featherstone 2008, Rigid body dynamics algorithms, chapters 2 and 3, for velocities
//! of joints.
//!
//! Deliberately does not know: the generator, how a chain is written as a model.

use super::drawn::{Base, Chain, Joint, Length, Restriction, V3};
use super::written::values;

type M3 = [V3; 3];

const UNIT: M3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn sum(a: V3, b: V3) -> V3 {
    [0, 1, 2].map(|i| a[i] + b[i])
}

fn scaled(s: f64, a: V3) -> V3 {
    a.map(|x| s * x)
}

fn times(m: &M3, x: V3) -> V3 {
    m.map(|row| dot(&row, &x))
}

fn product(a: &M3, b: &M3) -> M3 {
    a.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

fn transposed(a: &M3) -> M3 {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[j][i]))
}

/// The rotation about a unit vector, by Rodrigues' formula.
fn turned(n: V3, angle: f64) -> M3 {
    let (sin, cos) = angle.sin_cos();
    [0, 1, 2].map(|i| {
        [0, 1, 2].map(|j| {
            let hat = if i == j { 0.0 } else { cross(n, UNIT[j])[i] };
            cos * UNIT[i][j] + sin * hat + (1.0 - cos) * n[i] * n[j]
        })
    })
}

/// A frame that moves in space: place and attitude, velocities and accelerations of its origin.
#[derive(Clone, Copy)]
struct Frame {
    place: V3,
    attitude: M3,
    omega: V3,
    velocity: V3,
    alpha: V3,
    acceleration: V3,
}

impl Frame {
    const REST: Frame = Frame {
        place: [0.0; 3],
        attitude: UNIT,
        omega: [0.0; 3],
        velocity: [0.0; 3],
        alpha: [0.0; 3],
        acceleration: [0.0; 3],
    };

    /// The same motion seen at a point of the frame, which `arm` has in the frame's own components.
    fn at(&self, arm: V3) -> Frame {
        let arm = times(&self.attitude, arm);
        let turning = cross(self.omega, arm);
        Frame {
            place: sum(self.place, arm),
            velocity: sum(self.velocity, turning),
            acceleration: sum(self.acceleration, sum(cross(self.alpha, arm), cross(self.omega, turning))),
            ..*self
        }
    }
}

/// A state of a chain: coordinates, and rates of the base (angular velocity and velocity in its own frame) and joints.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) q: Vec<f64>,
    pub(crate) y: Vec<f64>,
}

/// Rates of the base before those of the joints.
pub(crate) fn n_base(chain: &Chain) -> usize {
    match chain.base {
        Base::Fixed => 0,
        Base::Floating { .. } => 6,
    }
}

/// The frames of the base and of all bodies.
fn frames(chain: &Chain, q: &[f64], y: &[f64], y_dot: &[f64]) -> (Frame, Vec<Frame>) {
    let n = n_base(chain);
    let mut base = Frame::REST;
    if n > 0 {
        let three = |list: &[f64], k: usize| [list[k], list[k + 1], list[k + 2]];
        base.omega = three(y, 0);
        base.velocity = three(y, 3);
        base.alpha = three(y_dot, 0);
        // The rate of a velocity in components of a frame that turns.
        base.acceleration = sum(three(y_dot, 3), cross(base.omega, base.velocity));
    }
    let mut frames: Vec<Frame> = Vec::new();
    for (k, body) in chain.bodies.iter().enumerate() {
        let (rate, bend) = (y[n + k], y_dot[n + k]);
        let before = body.parent.map_or(base, |p| frames[p]);
        let mut frame = before.at(values(&body.offset));
        for turn in &body.twist {
            frame.attitude = product(&frame.attitude, &turned(turn.axis.value, turn.angle));
        }
        match &body.joint {
            Joint::Revolute(axis) => {
                let z = times(&frame.attitude, axis.value);
                frame.alpha = sum(frame.alpha, sum(scaled(bend, z), cross(frame.omega, scaled(rate, z))));
                frame.omega = sum(frame.omega, scaled(rate, z));
                frame.attitude = product(&frame.attitude, &turned(axis.value, q[k]));
            }
            Joint::Prismatic(axis) => {
                let z = times(&frame.attitude, axis.value);
                frame = frame.at(scaled(q[k], axis.value));
                let coriolis = cross(frame.omega, scaled(2.0 * rate, z));
                frame.acceleration = sum(frame.acceleration, sum(scaled(bend, z), coriolis));
                frame.velocity = sum(frame.velocity, scaled(rate, z));
            }
        }
        frames.push(frame);
    }
    (base, frames)
}

/// The place of a point of a body; the base is at rest.
pub(crate) fn placed(chain: &Chain, q: &[f64], body: usize, point: &[Length; 3]) -> V3 {
    let zeros = vec![0.0; n_base(chain) + q.len()];
    frames(chain, q, &zeros, &zeros).1[body].at(values(point)).place
}

/// Velocities along which points must not move, with their rates.
fn restricted(chain: &Chain, frames: &[Frame]) -> Vec<[f64; 2]> {
    let rows = chain.restrictions.iter().map(|restriction| {
        let frame = frames[restriction.body()];
        let point = frame.at(values(restriction.point()));
        match restriction {
            Restriction::Loop { component, .. } => {
                [point.velocity[*component], point.acceleration[*component]]
            }
            Restriction::Wheel { axis, .. } => {
                let normal = times(&frame.attitude, axis.value);
                let turning = cross(frame.omega, normal);
                [
                    dot(&normal, &point.velocity),
                    dot(&normal, &point.acceleration) + dot(&turning, &point.velocity),
                ]
            }
        }
    });
    rows.collect()
}

fn unit(n: usize, i: usize) -> Vec<f64> {
    (0..n).map(|j| f64::from(u8::from(i == j))).collect()
}

/// Rows of the restrictions by the rates.
fn rows(chain: &Chain, q: &[f64]) -> Vec<Vec<f64>> {
    let n = n_base(chain) + q.len();
    let zeros = vec![0.0; n];
    let columns: Vec<Vec<[f64; 2]>> =
        (0..n).map(|i| restricted(chain, &frames(chain, q, &unit(n, i), &zeros).1)).collect();
    (0..chain.restrictions.len()).map(|c| columns.iter().map(|column| column[c][0]).collect()).collect()
}

/// Rates next to `y` that the restrictions allow; none where these depend on each other.
pub(crate) fn allowed(chain: &Chain, q: &[f64], y: &[f64]) -> Option<Vec<f64>> {
    let rows = rows(chain, q);
    let mut y = y.to_vec();
    for _ in 0..3 {
        let gram: Vec<Vec<f64>> =
            rows.iter().map(|a| rows.iter().map(|b| dot(a, b)).chain([dot(a, &y)]).collect()).collect();
        let (weights, _) = solved(gram)?;
        for (weight, row) in weights.iter().zip(&rows) {
            y.iter_mut().zip(row).for_each(|(y, c)| *y -= weight * c);
        }
    }
    Some(y)
}

/// A mass with its inertia about its centre, in the frame of a body.
struct Mass {
    mass: f64,
    centre: V3,
    inertia: M3,
}

fn masses(chain: &Chain) -> (Option<Mass>, Vec<Mass>) {
    let base = match &chain.base {
        Base::Fixed => None,
        Base::Floating { mass, centre, moments } => {
            let [x, y, z] = values(moments);
            let inertia = [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]];
            Some(Mass { mass: mass.value, centre: values(centre), inertia })
        }
    };
    let bodies = chain.bodies.iter().map(|body| {
        let [xx, xy, xz, yy, yz, zz] = body.inertia.each_ref().map(|q| q.value);
        let inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        Mass { mass: body.mass.value, centre: values(&body.centre), inertia }
    });
    (base, bodies.collect())
}

/// How a chain moves.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// Rates of the rates of base and joints.
    pub(crate) accelerations: Vec<f64>,
    /// Kinetic and potential.
    pub(crate) energy: f64,
    /// The condition number of the equations, by their largest row sums.
    pub(crate) condition: f64,
}

/// The motion at a state that the restrictions allow; none where the equations are singular.
pub(crate) fn motion(chain: &Chain, State { q, y }: &State) -> Option<Motion> {
    let n = y.len();
    let (base_mass, masses) = masses(chain);
    let zeros = vec![0.0; n];
    let all = |y: &[f64], y_dot: &[f64]| -> (Vec<Frame>, Vec<Frame>) {
        let (base, bodies) = frames(chain, q, y, y_dot);
        let base = base_mass.as_ref().map(|_| base);
        let centres = base_mass.iter().chain(&masses);
        let at_centres = base.into_iter().chain(bodies.iter().copied());
        (at_centres.zip(centres).map(|(frame, mass)| frame.at(mass.centre)).collect(), bodies)
    };
    let all_masses: Vec<&Mass> = base_mass.iter().chain(&masses).collect();
    let (still, bodies) = all(y, &zeros);
    let columns: Vec<Vec<Frame>> = (0..n).map(|i| all(&unit(n, i), &zeros).0).collect();
    let m = chain.restrictions.len();
    let mut matrix = vec![vec![0.0; n + m + 1]; n + m];
    let mut energy = 0.0;
    for (k, mass) in all_masses.iter().enumerate() {
        let frame = &still[k];
        let inertia = product(&product(&frame.attitude, &mass.inertia), &transposed(&frame.attitude));
        let spin = times(&inertia, frame.omega);
        let weight = [0.0, 0.0, chain.gravity.value];
        let force = scaled(mass.mass, sum(frame.acceleration, weight));
        let moment = sum(times(&inertia, frame.alpha), cross(frame.omega, spin));
        energy +=
            mass.mass * (dot(&frame.velocity, &frame.velocity) / 2.0 + chain.gravity.value * frame.place[2]);
        energy += dot(&frame.omega, &spin) / 2.0;
        for i in 0..n {
            let of_i = &columns[i][k];
            for j in 0..n {
                let of_j = &columns[j][k];
                matrix[i][j] += mass.mass * dot(&of_i.velocity, &of_j.velocity)
                    + dot(&of_i.omega, &times(&inertia, of_j.omega));
            }
            matrix[i][n + m] -= dot(&of_i.velocity, &force) + dot(&of_i.omega, &moment);
        }
    }
    let of_restrictions = rows(chain, q);
    for (c, (row, [_, rate])) in of_restrictions.iter().zip(restricted(chain, &bodies)).enumerate() {
        for i in 0..n {
            matrix[n + c][i] = row[i];
            matrix[i][n + c] = -row[i];
        }
        matrix[n + c][n + m] = -rate;
    }
    let size = |rows: &[Vec<f64>]| {
        rows.iter().map(|row| row.iter().take(n + m).map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max)
    };
    let largest = size(&matrix);
    let (accelerations, inverse) = solved(matrix)?;
    Some(Motion { accelerations: accelerations[..n].to_vec(), energy, condition: largest * inverse })
}

/// The solution of a system with its right side in the last column, and the largest row sum of the inverse; none where
/// a pivot vanishes.
fn solved(mut rows: Vec<Vec<f64>>) -> Option<(Vec<f64>, f64)> {
    let n = rows.len();
    for (i, row) in rows.iter_mut().enumerate() {
        row.extend(unit(n, i));
    }
    for k in 0..n {
        let best = (k..n).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs()))?;
        rows.swap(k, best);
        let pivot = rows[k][k];
        if pivot == 0.0 || !pivot.is_finite() {
            return None;
        }
        rows[k].iter_mut().for_each(|x| *x /= pivot);
        let row = rows[k].clone();
        for (i, other) in rows.iter_mut().enumerate() {
            if i != k {
                let factor = other[k];
                other.iter_mut().zip(&row).for_each(|(x, y)| *x -= factor * y);
            }
        }
    }
    let inverse =
        rows.iter().map(|row| row[n + 1..].iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    Some((rows.iter().map(|row| row[n]).collect(), inverse))
}
