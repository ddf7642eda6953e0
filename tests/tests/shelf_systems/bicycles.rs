//! Bicycles: two frames, two wheels and the upper body of a rider, each by a rotation matrix and the place of its mass
//! centre.
//!
//! Axes point forwards, to the right and downwards, and the ground is at zero. Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    M3, V3, body_rate, constant, cross, diagonal, difference, dot, kinetic_energy, matrix, matrix_sum,
    orthogonality, product, scaled, space_rate, sum, times, transposed, turned, vector,
};
use hamel_tests::unreduced::{Motion, Parameters, Unreduced, Variables};

use super::flying::in_space;

const REAR_WHEEL: usize = 0;
const REAR_FRAME: usize = 1;
const FRONT_FRAME: usize = 2;
const FRONT_WHEEL: usize = 3;
const UPPER_BODY: usize = 4;
const AHEAD: V3<f64> = [1.0, 0.0, 0.0];
const RIGHT: V3<f64> = [0.0, 1.0, 0.0];
const DOWN: V3<f64> = [0.0, 0.0, 1.0];

pub(crate) const RIGID: u8 = 0;
pub(crate) const WITH_VELOCITIES: u8 = 1;
const RIDDEN: u8 = 2;

/// The rider is part of the rear frame.
pub(crate) type Whipple = Bicycle<RIGID>;
/// The same, with a model that has more velocities.
pub(crate) type ByMultipliers = Bicycle<WITH_VELOCITIES>;
/// The upper body of the rider leans against the rear frame.
pub(crate) type Ridden = Bicycle<RIDDEN>;

/// Coordinates: place and rotation matrix of rear wheel, rear frame, front frame, front wheel and upper body. Upright
/// and straight ahead all matrices are the identity.
pub(crate) struct Bicycle<const KIND: u8> {
    g: f64,
    masses: Vec<f64>,
    inertias: Vec<M3<f64>>,
    /// Mass centres upright, from the rear contact.
    centres: Vec<V3<f64>>,
    /// A point of the axis of the upper body, its stiffness and damping.
    seat: (V3<f64>, f64, f64),
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

/// `m (|r|^2 - r r^T)`.
fn of_point(m: f64, r: V3<f64>) -> M3<f64> {
    let square = dot(r, r);
    let unit = [AHEAD, RIGHT, DOWN];
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m * (square * unit[i][j] - r[i] * r[j])))
}

impl<const KIND: u8> Bicycle<KIND> {
    /// Where a point of a body is, by its place upright.
    fn point<R: Real>(&self, q: &[R], body: usize, upright: V3<f64>) -> V3<R> {
        let arm = difference(constant(upright), constant(self.centres[body]));
        sum(place_of(q, body), times(turn_of(q, body), arm))
    }

    /// A direction of a body in space.
    fn direction<R: Real>(q: &[R], body: usize, upright: V3<f64>) -> V3<R> {
        times(turn_of(q, body), constant(upright))
    }

    /// Of the upper body against the rear frame.
    fn lean<R: Real>(q: &[R]) -> R {
        let right = Self::direction(q, UPPER_BODY, RIGHT);
        let along = |axis: V3<f64>| dot(Self::direction(q, REAR_FRAME, axis), right);
        along(DOWN).atan2(along(RIGHT))
    }

    /// From the centre of a wheel to its lowest point.
    fn down<R: Real>(q: &[R], wheel: usize, radius: f64) -> V3<R> {
        let axle = Self::direction(q, wheel, RIGHT);
        let length = (R::from_f64(1.0) - axle[2] * axle[2]).sqrt();
        let along = difference(constant([0.0, 0.0, 1.0]), scaled(axle[2], axle));
        scaled(R::from_f64(radius) / length, along)
    }

    /// Forces of the ground on the rear and on the front wheel, each in its frame along the axes of the model: the last
    /// multipliers are of the heights of the wheels and of what would slip.
    pub(crate) fn forces_of_ground(&self, motion: &Motion) -> [V3<f64>; 2] {
        let [.., rear_up, front_up, rear_x, rear_y, front_x, front_y] = motion.multipliers[..] else {
            panic!("a multiplier for each equation: {:?}", motion.multipliers);
        };
        let [steer, ahead, right] = self.axes;
        let in_frame = |frame: usize, force: V3<f64>| {
            let own = times(transposed(turn_of(&motion.q, frame)), force);
            [ahead, right, steer].map(|axis| dot(axis, own))
        };
        let rear = in_frame(REAR_FRAME, [rear_x, rear_y, rear_up]);
        [rear, in_frame(FRONT_FRAME, [front_x, front_y, front_up])]
    }

    fn wheels(&self) -> [(usize, f64); 2] {
        [(REAR_WHEEL, self.radii[0]), (FRONT_WHEEL, self.radii[1])]
    }
}

impl<const KIND: u8> Unreduced for Bicycle<KIND> {
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
        let mut masses = ["mR", "mB", "mH", "mF"].map(|name| p.get(name)).to_vec();
        let mut inertias = vec![wheel("R"), frame("B"), frame("H"), wheel("F")];
        let mut centres = vec![
            [0.0, 0.0, -r_r],
            [p.get("xB"), 0.0, p.get("zB")],
            [p.get("xH"), 0.0, p.get("zH")],
            [w, 0.0, -r_f],
        ];
        let mut seat = ([0.0; 3], 0.0, 0.0);
        if KIND == RIDDEN {
            let (m, upper) = (p.get("mP"), [p.get("xP"), 0.0, p.get("zP")]);
            let moments = diagonal(["IPxx", "IPyy", "IPzz"].map(|name| p.get(name)));
            let (whole, both) = (masses[REAR_FRAME], centres[REAR_FRAME]);
            let rest = whole - m;
            let centre = scaled(1.0 / rest, difference(scaled(whole, both), scaled(m, upper)));
            // About the rear contact: of both together without the upper body.
            let negative = |a: M3<f64>| a.map(|row| scaled(-1.0, row));
            let parts =
                [of_point(whole, both), negative(moments), of_point(-m, upper), of_point(-rest, centre)];
            inertias[REAR_FRAME] = parts.into_iter().fold(inertias[REAR_FRAME], matrix_sum);
            (masses[REAR_FRAME], centres[REAR_FRAME]) = (rest, centre);
            masses.push(m);
            inertias.push(moments);
            centres.push(upper);
            seat = ([0.0, 0.0, p.get("zS")], p.get("kP"), p.get("cP"));
        }
        Bicycle {
            g: p.get("g"),
            masses,
            inertias,
            centres,
            seat,
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
        let upper = product(rear, turned(AHEAD, 0.5 * random.number()).0);
        let turns = [product(rear, spin(random)), rear, front, product(front, spin(random)), upper];
        let mut q = Vec::with_capacity(12 * self.masses.len());
        for (body, turn) in turns.into_iter().enumerate().take(self.masses.len()) {
            let (joint, carried_by) = match body {
                FRONT_FRAME | FRONT_WHEEL => (self.hinge, front),
                UPPER_BODY => (self.seat.0, upper),
                _ => ([0.0; 3], rear),
            };
            let arm = times(carried_by, difference(self.centres[body], joint));
            q.extend(sum(sum(at, times(rear, joint)), arm));
            q.extend(turn.into_iter().flatten());
        }
        q
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let spring = if KIND == RIDDEN { Self::lean(q) } else { R::from_f64(0.0) };
        let spring = R::from_f64(-0.5 * self.seat.1) * spring * spring;
        (0..self.masses.len()).fold(spring, |l, body| {
            let (m, moments) = (self.masses[body], self.inertias[body]);
            let kinetic = kinetic_energy(m, moments, place_of(v, body), turn_of(v, body));
            l + kinetic + R::from_f64(m * self.g) * place_of(q, body)[2]
        })
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut equations: Vec<R> =
            (0..self.masses.len()).flat_map(|body| orthogonality(turn_of(q, body))).collect();
        let [steer, ahead, _] = self.axes;
        let joints = [
            (REAR_WHEEL, REAR_FRAME, self.centres[REAR_WHEEL], RIGHT, [AHEAD, DOWN]),
            (FRONT_WHEEL, FRONT_FRAME, self.centres[FRONT_WHEEL], RIGHT, [AHEAD, DOWN]),
            (FRONT_FRAME, REAR_FRAME, self.hinge, steer, [ahead, RIGHT]),
            (UPPER_BODY, REAR_FRAME, self.seat.0, AHEAD, [RIGHT, DOWN]),
        ];
        let joints = joints.into_iter().filter(|(one, ..)| *one < self.masses.len());
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

    fn force(&self, q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let mut force = vec![0.0; q.len()];
        if KIND == RIDDEN {
            let rate = |body: usize| body_rate(turn_of(q, body), turn_of(v, body))[0];
            let torque = -self.seat.2 * (rate(UPPER_BODY) - rate(REAR_FRAME));
            for (body, sign) in [(UPPER_BODY, 1.0), (REAR_FRAME, -1.0)] {
                let own = in_space(turn_of(q, body), [0.0; 3], scaled(sign * torque, AHEAD));
                force[12 * body..12 * (body + 1)].copy_from_slice(&own);
            }
        }
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let [steer, ahead, right] = self.axes;
        let rear = transposed(turn_of(q, REAR_FRAME));
        let down = times(rear, constant([0.0, 0.0, 1.0]));
        let rate = |body: usize| body_rate(turn_of(q, body), turn_of(v, body));
        let along = |axis: V3<f64>, x: V3<R>| dot(constant(axis), x);
        let front = times(rear, Self::direction(q, FRONT_FRAME, RIGHT));
        let vertical = [ahead, right, steer].map(|axis| along(axis, down));
        let own = [ahead, right, steer].map(|axis| along(axis, rate(REAR_FRAME)));
        let spins = [(REAR_WHEEL, REAR_FRAME), (FRONT_WHEEL, FRONT_FRAME)]
            .map(|(wheel, frame)| rate(wheel)[1] - rate(frame)[1]);
        let variables = Variables::new()
            .number("steer", (-along(ahead, front)).atan2(along(right, front)))
            .number("steer_dot", along(steer, rate(FRONT_FRAME)) - along(steer, rate(REAR_FRAME)))
            .vector("Gamma", &vertical);
        if KIND == WITH_VELOCITIES {
            let velocity = times(rear, place_of(v, REAR_WHEEL));
            let velocity = [ahead, right, steer].map(|axis| along(axis, velocity));
            let variables = variables.vector("Omega", &own).vector("V", &velocity);
            return variables.number("sR", spins[0]).number("sF", spins[1]);
        }
        let variables = variables.number("Omega1", own[0]).number("wR", rate(REAR_WHEEL)[1]);
        if KIND == RIGID {
            return variables;
        }
        variables.number("lean", Self::lean(q)).number("lean_dot", rate(UPPER_BODY)[0] - rate(REAR_FRAME)[0])
    }
}
