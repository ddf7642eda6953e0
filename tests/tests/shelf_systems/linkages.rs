//! Linkages with closed loops in space, every joint by equations between rotation matrices and places.
//!
//! Source: Wittenburg 2008, Dynamics of multibody systems, section 5.1, for the joints by vectors of bodies.
//!
//! Deliberately does not know: the models, angles of joints but for the variables that are compared.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    M3, V3, body_rate, constant, diagonal, difference, dot, kinetic_energy, matrix, orthogonality, product,
    random_numbers, scaled, sum, times, transposed, turned, vector,
};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

const AXES: M3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// An axis of a body in space.
fn axis<R: Real>(a: M3<R>, k: usize) -> V3<R> {
    a.map(|row| row[k])
}

/// The angle of a turn about a coordinate axis.
fn angle_about<R: Real>(k: usize, a: M3<R>) -> R {
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    a[j][i].atan2(a[i][i])
}

/// The matrices of five bodies, or their rates.
fn matrices<R: Real>(q: &[R]) -> [M3<R>; 5] {
    [0, 1, 2, 3, 4].map(|k| matrix(&q[9 * k..]))
}

fn flat(a: M3<f64>) -> Vec<f64> {
    a.into_iter().flatten().collect()
}

/// Two universal joints on one shaft: driving shaft, cross, shaft, cross and driven shaft, all of which turn about
/// points at rest.
pub(crate) struct DoubleCardan {
    inertias: [M3<f64>; 5],
    bend: [f64; 2],
}

/// Torques on the driving and the driven shaft, the defaults at which scenes hold them.
const TORQUES: [f64; 2] = [1.0, -1.0];

impl DoubleCardan {
    /// Directions at rest: first axes along the driving shaft, the shaft between, the driven shaft.
    fn frame(&self, joint: usize) -> M3<f64> {
        let angle = self.bend[..joint].iter().sum();
        turned(AXES[2], angle).0
    }
}

impl Unreduced for DoubleCardan {
    fn new(p: &Parameters) -> Self {
        let (shaft, cross) = (diagonal([p.get("I"); 3]), diagonal(p.vector("C")));
        let [driving, driven] = p.vector("J").map(|moment: f64| diagonal([moment; 3]));
        DoubleCardan { inertias: [driving, cross, shaft, cross, driven], bend: p.vector("bend") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        let spin = turned(AXES[0], 3.0 * random.number()).0;
        [0, 0, 1, 1, 2].into_iter().flat_map(|joint| flat(product(self.frame(joint), spin))).collect()
    }

    fn lagrangian<R: Real>(&self, _q: &[R], v: &[R], _t: R) -> R {
        let still = [R::from_f64(0.0); 3];
        let energies = matrices(v).into_iter().zip(self.inertias);
        energies
            .fold(R::from_f64(0.0), |all, (rate, inertia)| all + kinetic_energy(0.0, inertia, still, rate))
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let bodies = matrices(q);
        let [driving, first, shaft, second, driven] = bodies;
        let mut all: Vec<R> = bodies.into_iter().flat_map(orthogonality).collect();
        // Shafts keep their directions: each is across two directions at rest.
        for (body, joint) in [(driving, 0), (shaft, 1), (driven, 2)] {
            let frame = self.frame(joint).map(constant);
            all.extend([1, 2].map(|k| dot(axis(body, 0), axis(frame, k))));
        }
        // Each pin of a cross is an axis of a yoke, across two axes of the cross.
        for (yoke, cross, pin) in
            [(driving, first, 1), (shaft, first, 2), (shaft, second, 2), (driven, second, 1)]
        {
            let others = [(pin + 1) % 3, (pin + 2) % 3];
            all.extend(others.map(|k| dot(axis(yoke, pin), axis(cross, k))));
        }
        all
    }

    /// `tau` along `e1 . body_rate`, of the driving shaft and of the driven one.
    fn force(&self, q: &[f64], _v: &[f64], _t: f64) -> Vec<f64> {
        let mut force = vec![0.0; q.len()];
        for (torque, body) in TORQUES.into_iter().zip([0, 4]) {
            let attitude = matrix(&q[9 * body..]);
            (0..3).for_each(|i| force[9 * body + 3 * i + 1] += torque * attitude[i][2]);
        }
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (bodies, rates) = (matrices(q), matrices(v));
        let relative = |a: usize, b: usize| product(transposed(bodies[a]), bodies[b]);
        // Of a turn about an axis that both bodies have.
        let spin = |a: usize, b: usize, k: usize| {
            body_rate(bodies[b], rates[b])[k]
                - times(transposed(relative(a, b)), body_rate(bodies[a], rates[a]))[k]
        };
        let bearing = self.frame(2).map(constant);
        let mut all = Variables::new()
            .number("a", angle_about(0, bodies[0]))
            .number("d", angle_about(0, product(transposed(bearing), bodies[4])))
            .number("a_dot", body_rate(bodies[0], rates[0])[0])
            .number("d_dot", body_rate(bodies[4], rates[4])[0]);
        for (name, from, to, k) in [("b1", 0, 1, 1), ("b2", 1, 2, 2), ("c1", 2, 3, 2), ("c2", 3, 4, 1)] {
            all = all
                .number(name, angle_about(k, relative(from, to)))
                .number(&format!("{name}_dot"), spin(from, to, k));
        }
        all
    }
}

/// A plate on six legs. Coordinates are matrix and place of the plate, and of each leg matrix and length.
pub(crate) struct Stewart {
    mass: f64,
    inertia: M3<f64>,
    masses: [f64; 2],
    inertias: [M3<f64>; 2],
    centre: [f64; 2],
    base: [V3<f64>; 6],
    joints: [V3<f64>; 6],
    stiffness: f64,
    damping: f64,
    length: f64,
    gravity: f64,
}

/// The force of a leg, the default at which scenes hold it.
const PUSH: f64 = 30.0;

const fn leg(k: usize) -> usize {
    12 + 10 * k
}

impl Unreduced for Stewart {
    fn new(p: &Parameters) -> Self {
        let [radius, half]: [[f64; 2]; 2] = ["radius", "half"].map(|name| p.vector(name));
        let on_circle = |circle: usize| {
            [0, 1, 2, 3, 4, 5].map(|k| {
                let side = if k % 2 == 0 { -half[circle] } else { half[circle] };
                let angle = std::f64::consts::TAU / 3.0 * ((k / 2 + 1) as f64) + side;
                [radius[circle] * angle.cos(), radius[circle] * angle.sin(), 0.0]
            })
        };
        Stewart {
            mass: p.get("m"),
            inertia: diagonal(p.vector("I")),
            masses: p.vector("mass"),
            inertias: ["J", "K"].map(|name| diagonal(p.vector(name))),
            centre: p.vector("centre"),
            base: on_circle(0),
            joints: on_circle(1),
            stiffness: p.get("k"),
            damping: p.get("c"),
            length: p.get("l0"),
            gravity: p.get("g"),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        let attitude = (0..3).fold(diagonal([1.0; 3]), |attitude, k| {
            product(attitude, turned(AXES[k], 0.3 * random.number()).0)
        });
        let shift = random_numbers(3, random);
        let place = [0.2 * shift[0], 0.2 * shift[1], 1.2 + 0.2 * shift[2]];
        let mut q = flat(attitude);
        q.extend(place);
        for (base, joint) in self.base.iter().zip(self.joints) {
            let along = difference(sum(place, times(attitude, joint)), *base);
            let length = dot(along, along).sqrt();
            // The third axis of the leg is along it.
            let tilt = turned(AXES[0], (-along[1]).atan2(along[2])).0;
            q.extend(flat(product(tilt, turned(AXES[1], (along[0] / length).asin()).0)));
            q.push(length);
        }
        q
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let number = R::from_f64;
        let mut energy = kinetic_energy(self.mass, self.inertia, vector(&v[9..]), matrix(v))
            - number(self.mass * self.gravity) * q[11];
        for k in 0..6 {
            let (attitude, rate) = (matrix(&q[leg(k)..]), matrix(&v[leg(k)..]));
            let (length, speed) = (q[leg(k) + 9], v[leg(k) + 9]);
            let beyond = length - number(self.centre[1]);
            let low = scaled(number(self.centre[0]), axis(rate, 2));
            let high = sum(scaled(speed, axis(attitude, 2)), scaled(beyond, axis(rate, 2)));
            let heights = number(self.masses[0] * self.centre[0]) + number(self.masses[1]) * beyond;
            let stretched = length - number(self.length);
            energy = energy
                + kinetic_energy(self.masses[0], self.inertias[0], low, rate)
                + kinetic_energy(self.masses[1], self.inertias[1], high, rate)
                - number(self.gravity) * heights * attitude[2][2]
                - number(0.5 * self.stiffness) * stretched * stretched;
        }
        energy
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let plate = matrix(q);
        let mut all = orthogonality(plate);
        for k in 0..6 {
            let attitude = matrix(&q[leg(k)..]);
            all.extend(orthogonality(attitude));
            // The cross of the universal joint: an axis of the leg is across one of the base.
            all.push(attitude[0][1]);
            let tip = sum(constant(self.base[k]), scaled(q[leg(k) + 9], axis(attitude, 2)));
            let joint = sum(vector(&q[9..]), times(plate, constant(self.joints[k])));
            all.extend(difference(tip, joint));
        }
        all
    }

    fn force(&self, q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let mut force = vec![0.0; q.len()];
        (0..6).map(|k| leg(k) + 9).for_each(|l| force[l] = PUSH - self.damping * v[l]);
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let plate = matrix(q);
        let mut all = Variables::new()
            .vector("Omega", &body_rate(plate, matrix(v)))
            .vector("V", &times(transposed(plate), vector(&v[9..])))
            .vector("r", &q[9..12]);
        for (i, row) in plate.iter().enumerate() {
            all = all.vector(&format!("R{}", i + 1), row);
        }
        for k in 0..6 {
            let attitude: M3<R> = matrix(&q[leg(k)..]);
            all = all
                .number(&format!("alpha{}", k + 1), attitude[2][1].atan2(attitude[1][1]))
                .number(&format!("beta{}", k + 1), attitude[0][2].atan2(attitude[0][0]))
                .number(&format!("l{}", k + 1), q[leg(k) + 9]);
        }
        all
    }
}
