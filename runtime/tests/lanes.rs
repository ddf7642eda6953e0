//! Two lanes as one scalar: each lane is integrated as if it were alone.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use hamel_runtime::{Dop853, Integrator, Method, Options, Real, Rk4, System, Tsit5, Vern9};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Pair(f64, f64);

macro_rules! operator {
    ($($operator:ident $method:ident $assign:ident $assign_method:ident;)*) => {$(
        impl $operator for Pair {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0), self.1.$method(other.1))
            }
        }
        impl $assign for Pair {
            fn $assign_method(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    )*};
}

operator! {
    Add add AddAssign add_assign;
    Sub sub SubAssign sub_assign;
    Mul mul MulAssign mul_assign;
    Div div DivAssign div_assign;
}

impl Neg for Pair {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

macro_rules! lanewise {
    ($($name:ident)*) => {$(
        fn $name(self) -> Self {
            Self(Real::$name(self.0), Real::$name(self.1))
        }
    )*};
}

impl Real for Pair {
    const ZERO: Self = Self(0.0, 0.0);
    const ONE: Self = Self(1.0, 1.0);
    fn from_f64(x: f64) -> Self {
        Self(x, x)
    }
    lanewise! { sqrt sin cos tan asin acos atan exp ln sinh cosh tanh abs }
    fn atan2(self, x: Self) -> Self {
        Self(Real::atan2(self.0, x.0), Real::atan2(self.1, x.1))
    }
    fn all_gt(self, other: Self) -> bool {
        self.0 > other.0 && self.1 > other.1
    }
    fn all_ge(self, other: Self) -> bool {
        self.0 >= other.0 && self.1 >= other.1
    }
    fn all_ne(self, other: Self) -> bool {
        self.0 != other.0 && self.1 != other.1
    }
    fn all_finite(self) -> bool {
        self.0.is_finite() && self.1.is_finite()
    }
    fn magnitude(self) -> f64 {
        let (a, b) = (Real::abs(self.0), Real::abs(self.1));
        if a.is_nan() || a > b { a } else { b }
    }
}

/// `x'' = -sin x`.
struct Pendulum;

impl<R: Real> System<R> for Pendulum {
    type State = [R; 2];
    fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
        *dy = [y[1], -y[0].sin()];
    }
}

fn alone<M: Method<f64, Pendulum>>(method: M, start: f64, options: Options<f64>) -> ([f64; 2], [f64; 2]) {
    let mut solver = Integrator::new(&Pendulum, method, 0.0, [start, 0.0], options).unwrap();
    let mut middle = [0.0; 2];
    solver.sample(4.0, [1.27], |_, y| middle = *y).unwrap();
    (middle, *solver.state())
}

fn together<M: Method<Pair, Pendulum>>(
    method: M,
    starts: Pair,
    options: Options<Pair>,
) -> ([Pair; 2], [Pair; 2]) {
    let zero = Pair::ZERO;
    let mut solver = Integrator::new(&Pendulum, method, zero, [starts, zero], options).unwrap();
    let mut middle = [zero; 2];
    solver.sample(Pair(4.0, 4.0), [Pair(1.27, 1.27)], |_, y| middle = *y).unwrap();
    (middle, *solver.state())
}

#[test]
fn fixed_steps_of_lanes_are_those_of_scalars() {
    fn check<M: Method<f64, Pendulum> + Method<Pair, Pendulum>>(method: M) {
        let first = alone(method, 0.5, Options::fixed(0.1));
        let second = alone(method, 2.5, Options::fixed(0.1));
        let both = together(method, Pair(0.5, 2.5), Options::fixed(Pair(0.1, 0.1)));
        assert_ne!(first, second);
        assert_eq!((both.0.map(|y| y.0), both.1.map(|y| y.0)), first);
        assert_eq!((both.0.map(|y| y.1), both.1.map(|y| y.1)), second);
    }
    check(Rk4);
    check(Tsit5);
    check(Dop853);
    check(Vern9);
}

#[test]
fn error_control_holds_on_every_lane() {
    let options = Options::adaptive(Pair::from_f64(1e-10), Pair::from_f64(1e-10));
    let (_, both) = together(Dop853, Pair(0.5, 2.5), options);
    for (lane, start) in [(both.map(|y| y.0), 0.5), (both.map(|y| y.1), 2.5)] {
        let (_, reference) = alone(Dop853, start, Options::adaptive(1e-13, 1e-13));
        for (y, expected) in lane.into_iter().zip(reference) {
            assert!((y - expected).abs() < 1e-9, "{y} and {expected}");
        }
    }
}
