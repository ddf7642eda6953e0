//! Logarithms of rotations and of displacements.
//!
//! Deliberately does not know: attitudes of a model, items, angular velocities.

use super::ast::Expr;
use super::diagnostic::{Help, Span};
use super::eval::{Evaluator, Weighed};
use super::shape::Shape;
use super::value::Value;
use hamel_expr::{ExprId, Func, Graph, Rational};

/// The logarithm of a rotation, with a function of its angle.
struct Logarithm {
    /// The rotation vector, or the angle of the plane.
    vector: Vec<ExprId>,
    /// `sin(theta/2)^2`.
    w: ExprId,
}

fn ratio(p: i64, q: i64) -> Rational {
    Rational::new(p.into(), q.into())
}

fn cross(g: &mut Graph, a: &[ExprId], b: &[ExprId]) -> Vec<ExprId> {
    let component = |k: usize| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (plus, minus) = (g.mul(a[i], b[j]), g.mul(a[j], b[i]));
        g.sub(plus, minus)
    };
    (0..3).map(component).collect()
}

impl Evaluator<'_> {
    /// `log(R)`: the vector `v` with `R = rot(v)` and a length below `pi`, of a rotation of the plane its angle in
    /// `(-pi, pi]`. `log(R, r)`: the twist `[v, u]` of which `[[R, r], [0, 1]]` is the exponential.
    ///
    /// ```text
    /// v = tau (R - R^T)^vee/2,  tau = theta/sin(theta) as a function of w = sin(theta/2)^2 = (3 - tr R)/4
    /// u = r - v x r/2 + c v x (v x r),  c = (2 (1 - w) tau' - tau)/(4 tau^2 (1 - w))
    /// ```
    ///
    /// # Source
    /// Murray, Li and Sastry 1994, A mathematical introduction to robotic manipulation, section 2.2 and appendix A;
    /// `tau`, whose derivatives have no division by the angle, is `hamel_runtime`'s `Real::turn`.
    pub(super) fn logarithm(&mut self, arguments: &[Expr], (name, span): (Span, Span)) -> Option<Weighed> {
        let (rotation, place) = match arguments {
            [rotation] => (rotation, None),
            [rotation, place] => (rotation, Some(place)),
            _ => {
                let message = format!("`log` takes 1 or 2 arguments, found {}", arguments.len());
                let help = "write `log(R)` with a rotation, or `log(R, r)` with a rotation and a place";
                return self.fail(span, message, help);
            }
        };
        let (value, place) = (self.eval(rotation), place.map(|place| (place, self.eval(place))));
        let (value, bits) = value?;
        let n = match value.shape() {
            Shape::Scalar => {
                let help = Help::replacing("log", "ln", "write `ln(x)` for the logarithm of a number");
                return self.fail(name, "`log` takes a rotation, found a number", help);
            }
            Shape::Matrix(n, m) if n == m && (2..=3).contains(&n) => n,
            shape => {
                let help = "a rotation has 2 or 3 rows and as many columns";
                return self.fail(rotation.span, format!("`log` takes a rotation, found {shape}"), help);
            }
        };
        self.charge(64 * n * n, span)?;
        if !self.is_rotation(&value, n) {
            let help = self.advice_for_rotation(&value, n);
            return self.fail(rotation.span, "the matrix is no rotation", help);
        }
        let logarithm = self.logarithm_of(value.entries(), n);
        // Half a turn has two vectors; of the plane the angle pi.
        let one = self.graph.one();
        let rest = self.graph.sub(one, logarithm.w);
        if (n == 3 || place.is_some()) && self.graph.is_zero(rest) {
            let help =
                "half a turn about an axis is one about the opposite axis: write the vector, `[pi, 0, 0]`";
            return self.fail(rotation.span, "a rotation by half a turn has no logarithm", help);
        }
        let Some((expr, place)) = place else {
            let found = match logarithm.vector.as_slice() {
                [angle] => Value::Scalar(*angle),
                _ => Value::Vector(logarithm.vector),
            };
            return Some((found, 2 * bits + 16));
        };
        let (place, place_bits) = place?;
        let Value::Vector(r) = &place else {
            let message = format!("the place is vector({n}), found {}", place.shape());
            return self.fail(
                expr.span,
                message,
                "write `log(R, r)` with as many components as `R` has rows",
            );
        };
        if r.len() != n {
            let message = format!("the place is vector({n}), found {}", place.shape());
            return self.fail(
                expr.span,
                message,
                "write `log(R, r)` with as many components as `R` has rows",
            );
        }
        let twist = if n == 2 { self.planar_twist(&logarithm, r) } else { self.twist(&logarithm, r) };
        let found = Value::Vector(logarithm.vector.into_iter().chain(twist).collect());
        Some((found, 4 * bits + 2 * place_bits + 32))
    }

    fn logarithm_of(&mut self, entries: &[ExprId], n: usize) -> Logarithm {
        let g = &mut *self.graph;
        let (one, at) = (g.one(), |i: usize, j: usize| entries[i * n + j]);
        if n == 2 {
            let w = g.linear_combination(&[(one, ratio(1, 2)), (at(0, 0), ratio(-1, 2))]);
            return Logarithm { vector: vec![g.atan2(at(1, 0), at(0, 0))], w };
        }
        let quarter = ratio(-1, 4);
        let trace = [(at(0, 0), quarter.clone()), (at(1, 1), quarter.clone()), (at(2, 2), quarter)];
        let mut terms = vec![(one, ratio(3, 4))];
        terms.extend(trace);
        let w = g.linear_combination(&terms);
        let factor = g.func(Func::Turn(0), w);
        let vector = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| {
            let axial = g.linear_combination(&[(at(i, j), ratio(1, 2)), (at(j, i), ratio(-1, 2))]);
            g.mul(factor, axial)
        });
        Logarithm { vector: vector.to_vec(), w }
    }

    /// `u` of space.
    fn twist(&mut self, logarithm: &Logarithm, r: &[ExprId]) -> Vec<ExprId> {
        let g = &mut *self.graph;
        let Logarithm { vector, w } = logarithm;
        let one = g.one();
        let rest = g.sub(one, *w);
        let [factor, slope] = [0, 1].map(|k| g.func(Func::Turn(k), *w));
        let above = g.mul(rest, slope);
        let above = g.linear_combination(&[(above, ratio(2, 1)), (factor, ratio(-1, 1))]);
        let square = g.powi(factor, 2);
        let below = g.mul(square, rest);
        let Ok(quotient) = g.div(above, below) else { return r.to_vec() };
        let once = cross(g, vector, r);
        let twice = cross(g, vector, &once);
        let component = |k: usize| {
            let bent = g.mul(quotient, twice[k]);
            let terms = [(r[k], ratio(1, 1)), (once[k], ratio(-1, 2)), (bent, ratio(1, 4))];
            g.linear_combination(&terms)
        };
        (0..3).map(component).collect()
    }

    /// `u` of the plane, `(h r1 + theta/2 r2, h r2 - theta/2 r1)` with `h = theta/2 cot(theta/2) = tau (1 - w)`.
    fn planar_twist(&mut self, logarithm: &Logarithm, r: &[ExprId]) -> Vec<ExprId> {
        let g = &mut *self.graph;
        let Logarithm { vector, w } = logarithm;
        let one = g.one();
        let rest = g.sub(one, *w);
        let factor = g.func(Func::Turn(0), *w);
        let along = g.mul(factor, rest);
        let half = g.scale(vector[0], &ratio(1, 2));
        let back = g.neg(half);
        [(0, 1, half), (1, 0, back)]
            .map(|(k, other, across)| {
                let (along, across) = (g.mul(along, r[k]), g.mul(across, r[other]));
                g.add(along, across)
            })
            .to_vec()
    }
}
