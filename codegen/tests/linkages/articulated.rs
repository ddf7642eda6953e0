//! The articulated-body algorithm for the arm in space, written for its zeros and ones, on numbers that note what is
//! done with them.
//!
//! What depends on constants alone is not noted, nor are products by zero and by one and sums with zero: somebody who
//! writes the algorithm for one arm writes none of these. Deliberately does not know: models, what else is measured.
//!
//! # Source
//! Featherstone 2008, Rigid Body Dynamics Algorithms, table 7.1; turns about an axis as in section A.4.

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::families::Link;

thread_local! {
    static NOTED: RefCell<Vec<Operation>> = const { RefCell::new(Vec::new()) };
}

/// Where a number comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Origin {
    /// Lengths, masses and moments alone.
    Constant,
    /// Sine or cosine of an angle, or the rate of a joint.
    Input(Input, usize),
    /// The result of an operation.
    Operation(usize),
}

/// What differs from call to call, of the joint with an index.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Input {
    Sine,
    Cosine,
    Rate,
}

/// A number, where it comes from, and its sign there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Number {
    pub(crate) value: f64,
    pub(crate) origin: Origin,
    pub(crate) is_negated: bool,
}

/// `a op b`, op one of `+`, `*` and `/`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Operation {
    pub(crate) op: char,
    pub(crate) operands: [Number; 2],
}

const ZERO: Number = constant(0.0);

const fn constant(value: f64) -> Number {
    Number { value, origin: Origin::Constant, is_negated: false }
}

fn variable(value: f64, input: Input, joint: usize) -> Number {
    Number { value, origin: Origin::Input(input, joint), is_negated: false }
}

impl Number {
    fn is_constant(self) -> bool {
        matches!(self.origin, Origin::Constant)
    }

    fn is(self, value: f64) -> bool {
        self.is_constant() && self.value == value
    }

    fn computed(value: f64, op: char, operands: [Number; 2]) -> Number {
        if operands.iter().all(|n| n.is_constant()) {
            return constant(value);
        }
        let place = NOTED.with_borrow_mut(|noted| {
            noted.push(Operation { op, operands });
            noted.len() - 1
        });
        Number { value, origin: Origin::Operation(place), is_negated: false }
    }
}

impl Add for Number {
    type Output = Number;
    fn add(self, other: Number) -> Number {
        match () {
            () if self.is(0.0) => other,
            () if other.is(0.0) => self,
            () => Number::computed(self.value + other.value, '+', [self, other]),
        }
    }
}

/// Signs are part of sums and products.
impl Neg for Number {
    type Output = Number;
    fn neg(self) -> Number {
        Number { value: -self.value, is_negated: !self.is_negated, ..self }
    }
}

impl Sub for Number {
    type Output = Number;
    fn sub(self, other: Number) -> Number {
        self + -other
    }
}

impl Mul for Number {
    type Output = Number;
    fn mul(self, other: Number) -> Number {
        match () {
            () if self.is(0.0) || other.is(0.0) => ZERO,
            () if self.is(1.0) => other,
            () if other.is(1.0) => self,
            () => Number::computed(self.value * other.value, '*', [self, other]),
        }
    }
}

impl Div for Number {
    type Output = Number;
    fn div(self, other: Number) -> Number {
        Number::computed(self.value / other.value, '/', [self, other])
    }
}

type Vector = [Number; 3];
type Matrix = [[Number; 3]; 3];

fn add(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[i] + b[i])
}

fn cross(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn times(m: &Matrix, v: Vector) -> Vector {
    [0, 1, 2].map(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2])
}

fn transposed(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// The turn from the frame of a body to that of the body before: about the third axis, then the fixed one.
struct Turn {
    cos: Number,
    sin: Number,
    is_first: bool,
    is_quarter: bool,
}

impl Turn {
    fn fixed(&self, v: Vector) -> Vector {
        match (self.is_first, self.is_quarter) {
            (true, _) => v,
            (false, true) => [v[0], -v[2], v[1]],
            (false, false) => [-v[0], v[2], v[1]],
        }
    }

    fn fixed_back(&self, v: Vector) -> Vector {
        match (self.is_first, self.is_quarter) {
            (true, _) => v,
            (false, true) => [v[0], v[2], -v[1]],
            (false, false) => [-v[0], v[2], v[1]],
        }
    }

    fn to_body(&self, v: Vector) -> Vector {
        let [x, y, z] = self.fixed_back(v);
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x, z]
    }

    fn to_before(&self, [x, y, z]: Vector) -> Vector {
        self.fixed([self.cos * x - self.sin * y, self.sin * x + self.cos * y, z])
    }

    /// `R M R^T`: of the block that turns, the trace and the antisymmetric part stay.
    fn of_matrix(&self, m: &Matrix, is_symmetric: bool) -> Matrix {
        let (cos, sin) = (self.cos, self.sin);
        let difference = m[0][0] - m[1][1];
        let sum = if is_symmetric { constant(2.0) * m[0][1] } else { m[0][1] + m[1][0] };
        let t = sin * difference + cos * sum;
        let (st, ct) = (sin * t, cos * t);
        let mut r = *m;
        r[0][0] = m[0][0] - st;
        r[1][1] = m[1][1] + st;
        r[0][1] = ct - m[1][0];
        r[1][0] = if is_symmetric { r[0][1] } else { ct - m[0][1] };
        let turned = |x: Number, y: Number| (cos * x - sin * y, sin * x + cos * y);
        (r[0][2], r[1][2]) = turned(m[0][2], m[1][2]);
        (r[2][0], r[2][1]) = if is_symmetric { (r[0][2], r[1][2]) } else { turned(m[2][0], m[2][1]) };
        let rows = r.map(|row| self.fixed(row));
        let columns = transposed(&rows).map(|column| self.fixed(column));
        transposed(&columns)
    }
}

/// What is known of a body on the way back.
struct Body {
    turn: Turn,
    joint: Vector,
    /// Accelerations by the velocities.
    bias: [Vector; 2],
    /// `U`, its last entry `D` and `u` of the joint.
    column: [Vector; 2],
    divisor: Number,
    force: Number,
}

/// Accelerations of the joints, and the operations that they take besides sines and cosines.
pub(crate) fn accelerations(links: &[Link], angles: &[f64], rates: &[f64]) -> (Vec<Number>, Vec<Operation>) {
    NOTED.with_borrow_mut(Vec::clear);
    let (mut omega, mut v) = ([ZERO; 3], [ZERO; 3]);
    let mut bodies = Vec::new();
    let mut inertias = Vec::new();
    for (k, link) in links.iter().enumerate().take(angles.len()) {
        // The motion depends on the first angle in no way: gravity is along its axis.
        let (sin, cos) = angles[k].sin_cos();
        let (sin, cos) = match k {
            0 => (ZERO, constant(1.0)),
            _ => (variable(sin, Input::Sine, k), variable(cos, Input::Cosine, k)),
        };
        let turn = Turn { cos, sin, is_first: k == 0, is_quarter: link.is_quarter };
        let rate = variable(rates[k], Input::Rate, k);
        let joint = link.joint.map(constant);
        v = turn.to_body(add(v, cross(omega, joint)));
        omega = turn.to_body(omega);
        omega[2] = omega[2] + rate;
        let bias = [omega, v].map(|a| [a[1] * rate, -(a[0] * rate), ZERO]);
        // The inertia about the joint: moments, first moments, mass.
        let (mass, c) = (constant(link.mass), link.centre.map(constant));
        let first = c.map(|c| mass * c);
        let square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
        let moments: Matrix = [0, 1, 2].map(|i| {
            [0, 1, 2].map(|j| {
                let own = if i == j { constant(link.moments[i]) + mass * square } else { ZERO };
                own - first[i] * c[j]
            })
        });
        let hat: Matrix =
            [[ZERO, -first[2], first[1]], [first[2], ZERO, -first[0]], [-first[1], first[0], ZERO]];
        let diagonal = [0, 1, 2].map(|i| [0, 1, 2].map(|j| if i == j { mass } else { ZERO }));
        // omega x (I omega + h x v) + v x (omega x h) and omega x p with p = m v + omega x h.
        let off_centre = cross(omega, first);
        let momentum = add(v.map(|v| mass * v), off_centre);
        let spin = add(times(&moments, omega), cross(first, v));
        let bias_force = [add(cross(omega, spin), cross(v, off_centre)), cross(omega, momentum)];
        inertias.push(([moments, hat, diagonal], bias_force));
        let none = [ZERO; 3];
        bodies.push(Body { turn, joint, bias, column: [none; 2], divisor: ZERO, force: ZERO });
    }
    for k in (0..bodies.len()).rev() {
        let ([a, b, c], [torque, force]) = inertias[k];
        let body = &mut bodies[k];
        // The column of the joint; `b` couples turning (rows) with motion (columns).
        body.column = [[a[0][2], a[1][2], a[2][2]], b[2]];
        body.divisor = a[2][2];
        body.force = -torque[2];
        if k == 0 {
            break;
        }
        let [along, across] = body.column;
        let inverse = constant(1.0) / body.divisor;
        let scaled = [along, across].map(|half| half.map(|e| e * inverse));
        let update = |m: &Matrix, p: Vector, q: Vector, is_symmetric: bool| -> Matrix {
            let mut r = *m;
            for i in 0..3 {
                for j in 0..3 {
                    r[i][j] = if is_symmetric && j < i { r[j][i] } else { m[i][j] - p[i] * q[j] };
                }
            }
            r
        };
        let mut a = a;
        // What is left turns freely about the joint: its row and column vanish.
        for i in 0..3 {
            (a[i][2], a[2][i]) = (ZERO, ZERO);
        }
        for i in 0..2 {
            for j in i..2 {
                a[i][j] = a[i][j] - along[i] * scaled[0][j];
                a[j][i] = a[i][j];
            }
        }
        let mut b_left = update(&b, [scaled[0][0], scaled[0][1], ZERO], across, false);
        b_left[2] = [ZERO; 3];
        let c = update(&c, across, scaled[1], true);
        let z = body.force * inverse;
        let bias = body.bias;
        let torque = add(add(torque, times(&a, bias[0])), times(&b_left, bias[1]));
        let force = add(add(force, times(&transposed(&b_left), bias[0])), times(&c, bias[1]));
        // About the joint nothing is left but its own torque, which is zero.
        let torque = [torque[0] + along[0] * z, torque[1] + along[1] * z, ZERO];
        let force = [0, 1, 2].map(|i| force[i] + across[i] * z);
        // To the frame of the body before, about its own joint.
        let turn = &body.turn;
        let (a, b, c) = (turn.of_matrix(&a, true), turn.of_matrix(&b_left, false), turn.of_matrix(&c, true));
        let (torque, force) = (turn.to_before(torque), turn.to_before(force));
        let r = body.joint;
        // B + r^ C, A + r^ B^T - B r^ - r^ C r^
        let columns = transposed(&c).map(|column| cross(r, column));
        let shifted = transposed(&columns);
        let b_new: Matrix = [0, 1, 2].map(|i| [0, 1, 2].map(|j| b[i][j] + shifted[i][j]));
        let crossed = b.map(|row| cross(r, row));
        let crossed_new = b_new.map(|row| cross(r, row));
        let ([mut moments, mut hat, mut masses], [mut old_torque, mut old_force]) = inertias[k - 1];
        for i in 0..3 {
            for j in 0..3 {
                if j >= i {
                    moments[i][j] = moments[i][j] + (a[i][j] + crossed_new[i][j] + crossed[j][i]);
                    moments[j][i] = moments[i][j];
                    masses[i][j] = masses[i][j] + c[i][j];
                    masses[j][i] = masses[i][j];
                }
                hat[i][j] = hat[i][j] + b_new[i][j];
            }
        }
        old_torque = add(old_torque, add(torque, cross(r, force)));
        old_force = add(old_force, force);
        inertias[k - 1] = ([moments, hat, masses], [old_torque, old_force]);
    }
    let (mut turning, mut moving) = ([ZERO; 3], [ZERO, ZERO, constant(9.81)]);
    let mut found = Vec::new();
    for body in &bodies {
        let moved = add(moving, cross(turning, body.joint));
        moving = add(body.turn.to_body(moved), body.bias[1]);
        turning = add(body.turn.to_body(turning), body.bias[0]);
        let [along, across] = body.column;
        let terms = [0, 1, 2].map(|i| along[i] * turning[i] + across[i] * moving[i]);
        let acceleration = (body.force - (terms[0] + terms[1] + terms[2])) / body.divisor;
        turning[2] = turning[2] + acceleration;
        found.push(acceleration);
    }
    (found, NOTED.with_borrow_mut(std::mem::take))
}
