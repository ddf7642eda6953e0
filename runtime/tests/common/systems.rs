//! Systems over any scalar whose motion is known, for methods that take them in lanes.

use hamel_runtime::{Invariants, OverScalar, Real, System};

/// A pendulum driven in time: `x' = v, v' = -sin x + a cos(w t)`, and `u' = x`.
#[derive(Clone, Copy)]
pub(crate) struct Driven<R> {
    pub(crate) a: R,
    pub(crate) w: R,
}

impl<R: Real> System<R> for Driven<R> {
    type State = [R; 3];
    fn rhs(&self, t: R, y: &[R; 3], dy: &mut [R; 3]) {
        *dy = [y[1], self.a * (self.w * t).cos() - y[0].sin(), y[0]];
    }
}

impl<Q: Real, R: Real> OverScalar<Q, R> for Driven<R> {
    type Over = Driven<Q>;
    fn over(&self, convert: impl Fn(R) -> Q) -> Driven<Q> {
        Driven { a: convert(self.a), w: convert(self.w) }
    }
    fn state_over(state: &[R; 3], convert: impl Fn(R) -> Q) -> [Q; 3] {
        state.map(convert)
    }
}

/// Kepler's problem, `q'' = -q/|q|^3`.
#[derive(Clone, Copy)]
pub(crate) struct Kepler;

impl<R: Real> System<R> for Kepler {
    type State = [R; 4];
    fn rhs(&self, _t: R, y: &[R; 4], dy: &mut [R; 4]) {
        let square = y[0].mul_add(y[0], y[1] * y[1]);
        let cube = (square * square.sqrt()).recip();
        *dy = [y[2], y[3], -cube * y[0], -cube * y[1]];
    }
}

impl<Q: Real, R: Real> OverScalar<Q, R> for Kepler {
    type Over = Kepler;
    fn over(&self, _convert: impl Fn(R) -> Q) -> Kepler {
        Kepler
    }
    fn state_over(state: &[R; 4], convert: impl Fn(R) -> Q) -> [Q; 4] {
        state.map(convert)
    }
}

/// The energy of Kepler's problem.
impl<R: Real> Invariants<R, 1> for Kepler {
    fn values(&self, _t: R, y: &[R; 4]) -> [R; 1] {
        let square = |a: R, b: R| a * a + b * b;
        [R::from_f64(0.5) * square(y[2], y[3]) - square(y[0], y[1]).sqrt().recip()]
    }
    fn gradients(&self, _t: R, y: &[R; 4], gradients: &mut [[R; 4]; 1]) {
        let square = y[0] * y[0] + y[1] * y[1];
        let cube = square * square.sqrt();
        gradients[0] = [y[0] / cube, y[1] / cube, y[2], y[3]];
    }
}
