//! Bicycles: two frames and two wheels, each by a rotation matrix and the place of its mass centre.
//!
//! Axes point forwards, to the right and downwards, and the ground is at zero. Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    M3, V3, body_rate, constant, cross, difference, dot, kinetic_energy, matrix, orthogonality, product, scaled,
    space_rate, sum, times, transposed, turned, vector,
};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

const REAR_WHEEL: usize = 0;
const REAR_FRAME: usize = 1;
const FRONT_FRAME: usize = 2;
const FRONT_WHEEL: usize = 3;
const N_BODIES: usize = 4;
const RIGHT: V3<f64> = [0.0, 1.0, 0.0];

/// Coordinates: place and rotation matrix of rear wheel, rear frame, front frame and front wheel. Upright and straight
/// ahead all four matrices are the identity.
pub(crate) struct Whipple {
    g: f64,
    masses: [f64; N_BODIES],
    inertias: [M3<f64>; N_BODIES],
    /// Mass centres upright, from the rear contact.
    centres: [V3<f64>; N_BODIES],
    /// A point of the steer axis, upright.
    hinge: V3<f64>,
    /// The steer axis and the two axes across it, the first forwards.
    axes: [V3<f64>; 3],
    radii: [f64; 2],
}

fn place_of<R: Real>(q: &[R], body: usize) -> V3<R> {
    vector(&q[12 * body..])
}

fn turn_of<R: Real>(q: &[R], body: usize) -> M3<R> {
    matrix(&q[12 * body + 3..])
}

impl Whipple {
    /// Where a point of a body is, by its place upright.
    fn point<R: Real>(&self, q: &[R], body: usize, upright: V3<f64>) -> V3<R> {
        let arm = difference(constant(upright), constant(self.centres[body]));
        sum(place_of(q, body), times(turn_of(q, body), arm))
    }

    /// A direction of a body in space.
    fn direction<R: Real>(q: &[R], body: usize, upright: V3<f64>) -> V3<R> {
        times(turn_of(q, body), constant(upright))
    }

    /// From the centre of a wheel to its lowest point.
    fn down<R: Real>(q: &[R], wheel: usize, radius: f64) -> V3<R> {
        let axle = Self::direction(q, wheel, RIGHT);
        let length = (R::from_f64(1.0) - axle[2] * axle[2]).sqrt();
        let along = difference(constant([0.0, 0.0, 1.0]), scaled(axle[2], axle));
        scaled(R::from_f64(radius) / length, along)
    }

    fn wheels(&self) -> [(usize, f64); 2] {
        [(REAR_WHEEL, self.radii[0]), (FRONT_WHEEL, self.radii[1])]
    }
}

impl Unreduced for Whipple {
    fn new(p: &Parameters) -> Self {
        let [w, c, lambda, r_r, r_f] = ["w", "c", "lambda", "rR", "rF"].map(|name| p.get(name));
        let wheel = |body: &str| {
            let [across, along] = ["xx", "yy"].map(|k| p.get(&format!("I{body}{k}")));
            [[across, 0.0, 0.0], [0.0, along, 0.0], [0.0, 0.0, across]]
        };
        let frame = |body: &str| {
            let [xx, yy, zz, xz] = ["xx", "yy", "zz", "xz"].map(|k| p.get(&format!("I{body}{k}")));
            [[xx, 0.0, xz], [0.0, yy, 0.0], [xz, 0.0, zz]]
        };
        let (sin, cos) = lambda.sin_cos();
        Whipple {
            g: p.get("g"),
            masses: ["mR", "mB", "mH", "mF"].map(|name| p.get(name)),
            inertias: [wheel("R"), frame("B"), frame("H"), wheel("F")],
            centres: [
                [0.0, 0.0, -r_r],
                [p.get("xB"), 0.0, p.get("zB")],
                [p.get("xH"), 0.0, p.get("zH")],
                [w, 0.0, -r_f],
            ],
            hinge: [w + c, 0.0, 0.0],
            axes: [[sin, 0.0, cos], [cos, 0.0, -sin], RIGHT],
            radii: [r_r, r_f],
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        let yaw = turned([0.0, 0.0, 1.0], random.number()).0;
        let lean = turned([1.0, 0.0, 0.0], 0.5 * random.number()).0;
        let steer = turned(self.axes[0], 0.6 * random.number()).0;
        let rear = product(yaw, lean);
        let front = product(rear, steer);
        let spin = |random: &mut Random| turned(RIGHT, random.number()).0;
        let at = [random.number(), random.number(), 0.0];
        let turns = [product(rear, spin(random)), rear, front, product(front, spin(random))];
        let hinge = sum(at, times(rear, self.hinge));
        let mut q = Vec::with_capacity(12 * N_BODIES);
        for (body, turn) in turns.into_iter().enumerate() {
            let is_front = body >= FRONT_FRAME;
            let arm = if is_front { difference(self.centres[body], self.hinge) } else { self.centres[body] };
            q.extend(if is_front { sum(hinge, times(front, arm)) } else { sum(at, times(rear, arm)) });
            q.extend(turn.into_iter().flatten());
        }
        q
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        (0..N_BODIES).fold(R::from_f64(0.0), |l, body| {
            let (m, moments) = (self.masses[body], self.inertias[body]);
            let kinetic = kinetic_energy(m, moments, place_of(v, body), turn_of(v, body));
            l + kinetic + R::from_f64(m * self.g) * place_of(q, body)[2]
        })
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut equations: Vec<R> = (0..N_BODIES).flat_map(|body| orthogonality(turn_of(q, body))).collect();
        let [steer, ahead, _] = self.axes;
        let joints = [
            (REAR_WHEEL, REAR_FRAME, self.centres[REAR_WHEEL], RIGHT, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            (FRONT_WHEEL, FRONT_FRAME, self.centres[FRONT_WHEEL], RIGHT, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            (FRONT_FRAME, REAR_FRAME, self.hinge, steer, [ahead, RIGHT]),
        ];
        for (one, other, point, axis, across) in joints {
            equations.extend(difference(self.point(q, one, point), self.point(q, other, point)));
            let axis = Self::direction(q, one, axis);
            equations.extend(across.map(|e| dot(axis, Self::direction(q, other, e))));
        }
        equations.extend(self.wheels().map(|(wheel, r)| place_of(q, wheel)[2] + Self::down(q, wheel, r)[2]));
        equations
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let slips = self.wheels().map(|(wheel, r)| {
            let spin = space_rate(turn_of(q, wheel), turn_of(v, wheel));
            let [x, y, _] = sum(place_of(v, wheel), cross(spin, Self::down(q, wheel, r)));
            [x, y]
        });
        slips.concat()
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let [steer, ahead, right] = self.axes;
        let rear = transposed(turn_of(q, REAR_FRAME));
        let down = times(rear, constant([0.0, 0.0, 1.0]));
        let rate = |body: usize| body_rate(turn_of(q, body), turn_of(v, body));
        let along = |axis: V3<f64>, x: V3<R>| dot(constant(axis), x);
        let front = times(rear, Self::direction(q, FRONT_FRAME, RIGHT));
        let vertical = [ahead, right, steer].map(|axis| along(axis, down));
        Variables::new()
            .number("steer", (-along(ahead, front)).atan2(along(right, front)))
            .number("steer_dot", along(steer, rate(FRONT_FRAME)) - along(steer, rate(REAR_FRAME)))
            .number("Omega1", along(ahead, rate(REAR_FRAME)))
            .number("wR", rate(REAR_WHEEL)[1])
            .vector("Gamma", &vertical)
    }
}
