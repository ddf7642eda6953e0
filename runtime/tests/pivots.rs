//! Singular points on the way: fixed steps do not walk through them, adaptive ones stop at them by name, and what a
//! right-hand side divides by is finite.

use hamel_runtime::{
    Dop853, Dopri5, Error, Failure, Gauss4, Gauss6, Gauss8, Integrator, Invariants, Jet, Method, Options,
    Pivot, Projected, Real, Rk4, System, Taylor, Tsit5, Vern9,
};

const T_SINGULAR: f64 = core::f64::consts::FRAC_PI_4;

/// `1/2 (1 - x^2) x_dot^2`: `x'' = x x'^2/(1 - x^2)`, from rest at `x = 0` with speed one the motion ends at `t =
/// pi/4`, where `x = 1`: `x sqrt(1 - x^2) + asin x = 2 t`.
struct Thinning;

impl<R: Real> System<R> for Thinning {
    type State = [R; 2];

    fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
        *dy = [y[1], y[0] * y[1] * y[1] / (R::ONE - y[0] * y[0])];
    }

    fn check(&self, t: R, y: &[R; 2]) -> Result<(), Failure> {
        let mut pivots = [Pivot { name: "", value: R::ZERO, scale: R::ZERO }];
        System::pivots(self, t, y, &mut |pivot| pivots[0] = pivot);
        Pivot::verify_all(t, &pivots)
    }

    fn signature(&self, _t: R, y: &[R; 2]) -> R {
        let pivot = R::ONE - y[0] * y[0];
        pivot / pivot.abs()
    }

    fn pivots(&self, _t: R, y: &[R; 2], visit: &mut dyn FnMut(Pivot<R>)) {
        let scale = R::from_f64(4.0) * (R::ONE + y[0] * y[0]);
        visit(Pivot { name: "inertia along x_dot", value: R::ONE - y[0] * y[0], scale });
    }
}

/// By quotients of coefficients; exact enough for a few orders, which is all that is asked for.
impl Jet<f64> for Thinning {
    type Workspace = ();

    fn workspace(&self) {}

    fn series(&self, _t: f64, y: &[f64; 2], (): &mut (), out: &mut [[f64; 2]]) {
        let n = out.len();
        let (mut x, mut v, mut a) = (vec![0.0; n + 1], vec![0.0; n + 1], vec![0.0; n]);
        (x[0], v[0]) = (y[0], y[1]);
        let product = |p: &[f64], q: &[f64], k: usize| (0..=k).map(|j| p[j] * q[k - j]).sum::<f64>();
        for k in 0..n {
            let square: Vec<f64> = (0..=k).map(|j| product(&v, &v, j)).collect();
            let force = product(&x, &square, k);
            let pivot = |j: usize| if j == 0 { 1.0 - x[0] * x[0] } else { -product(&x, &x, j) };
            let rest: f64 = (1..=k).map(|j| pivot(j) * a[k - j]).sum();
            a[k] = (force - rest) / pivot(0);
            out[k] = [x[k], v[k]];
            (x[k + 1], v[k + 1]) = (v[k] / (k + 1) as f64, a[k] / (k + 1) as f64);
        }
    }
}

/// The energy, which the projection keeps.
impl Invariants<f64, 1> for Thinning {
    fn values(&self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
        [0.5 * (1.0 - y[0] * y[0]) * y[1] * y[1]]
    }

    fn gradients(&self, _t: f64, y: &[f64; 2], gradients: &mut [[f64; 2]; 1]) {
        gradients[0] = [-y[0] * y[1] * y[1], (1.0 - y[0] * y[0]) * y[1]];
    }
}

fn stopped<M: Method<f64, Thinning>>(method: M, options: Options<f64>, t_end: f64) -> (Failure, f64, f64) {
    let name = M::TABLEAU.name;
    let start = [0.0, t_end.signum()];
    let mut solver = Integrator::new(&Thinning, method, 0.0, start, options).unwrap();
    let error = solver.integrate_to(t_end).unwrap_err();
    let Error::Failure(failure) = error else { panic!("{name}: {error}") };
    (failure, solver.t(), solver.state()[0])
}

#[test]
fn fixed_steps_do_not_walk_through_a_vanishing_pivot() {
    let named_before = |(failure, t, x): (Failure, f64, f64), method: &str, latest: f64| {
        let (Failure::ChangedSign { t: after, pivot } | Failure::Singular { t: after, pivot }) = failure
        else {
            panic!("{method}: {failure}")
        };
        assert_eq!(pivot, "inertia along x_dot", "{method}");
        assert!(after.abs() >= t.abs() && after.abs() < latest + 0.1, "{method}: {after} after {t}");
        // The last state before it is in reach.
        assert!(t.abs() < latest && t.abs() > 0.5 && x.abs() < 1.0, "{method}: x = {x} at t = {t}");
    };
    let named = |outcome, method| named_before(outcome, method, T_SINGULAR + 0.1);
    for t_end in [3.0, -3.0] {
        for step in [0.1, 0.03] {
            let options = Options::fixed(step);
            // The shorter steps of this method of low order are thrown back next to the singular point once, and meet
            // it again.
            let latest = if step < 0.1 { 2.0 * T_SINGULAR - 0.5 } else { T_SINGULAR + 0.1 };
            named_before(stopped(Rk4, options, t_end), "rk4", latest);
            named(stopped(Tsit5, options, t_end), "tsit5");
            named(stopped(Dopri5, options, t_end), "dopri5");
            named(stopped(Dop853, options, t_end), "dop853");
            named(stopped(Vern9, options, t_end), "vern9");
            named(stopped(Gauss4::fixed_point(), options, t_end), "gauss4");
            named(stopped(Gauss6::fixed_point(), options, t_end), "gauss6");
            named(stopped(Gauss8::fixed_point(), options, t_end), "gauss8");
            named(stopped(Taylor::of_order(12), options, t_end), "taylor");
            named(stopped(Projected::<_, 1>::new(Vern9), options, t_end), "projected");
        }
    }
}

#[test]
fn adaptive_steps_stop_next_to_a_vanishing_pivot_and_name_it() {
    let named = |(failure, t, x): (Failure, f64, f64), method: &str| {
        let (Failure::ChangedSign { pivot, .. } | Failure::Singular { pivot, .. }) = failure else {
            panic!("{method}: {failure}")
        };
        assert_eq!(pivot, "inertia along x_dot", "{method}");
        assert!((t.abs() - T_SINGULAR).abs() < 1e-6 && x.abs() <= 1.0, "{method}: x = {x} at t = {t}");
    };
    for t_end in [3.0, -3.0] {
        for tolerance in [1e-6, 1e-10, 1e-13] {
            let options = Options::adaptive(tolerance, tolerance);
            named(stopped(Tsit5, options, t_end), "tsit5");
            named(stopped(Dopri5, options, t_end), "dopri5");
            named(stopped(Dop853, options, t_end), "dop853");
            named(stopped(Vern9, options, t_end), "vern9");
            named(stopped(Taylor::new(), options, t_end), "taylor");
            named(stopped(Projected::<_, 1>::new(Vern9), options, t_end), "projected");
        }
    }
}

/// `1/2 (1 - x)^2 x_dot^2`: the pivot vanishes without changing its sign.
struct Touching;

impl System<f64> for Touching {
    type State = [f64; 2];

    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], y[1] * y[1] / (1.0 - y[0])];
    }

    fn pivots(&self, _t: f64, y: &[f64; 2], visit: &mut dyn FnMut(Pivot<f64>)) {
        visit(Pivot { name: "mass", value: 3.0, scale: 0.0 });
        visit(Pivot { name: "inertia", value: (1.0 - y[0]) * (1.0 - y[0]), scale: 0.0 });
    }
}

#[test]
fn a_pivot_that_vanishes_without_a_change_of_sign_is_named_as_well() {
    let mut solver =
        Integrator::new(&Touching, Dop853, 0.0, [0.0, 1.0], Options::adaptive(1e-9, 1e-9)).unwrap();
    let error = solver.integrate_to(2.0).unwrap_err();
    // x = 1 - sqrt(1 - 2 t).
    assert!((solver.t() - 0.5).abs() < 1e-6, "{}", solver.t());
    assert!(matches!(error, Error::Failure(Failure::Singular { pivot: "inertia", .. })), "{error}");
}

/// `x' = x^2`, which ends at `t = 1` for no pivot's sake.
struct Blowup;

impl System<f64> for Blowup {
    type State = [f64; 1];

    fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
        dy[0] = y[0] * y[0];
    }

    fn pivots(&self, _t: f64, _y: &[f64; 1], visit: &mut dyn FnMut(Pivot<f64>)) {
        visit(Pivot { name: "mass", value: 3.0, scale: 0.0 });
    }
}

#[test]
fn a_pivot_that_does_not_vanish_is_not_blamed() {
    let mut solver = Integrator::new(&Blowup, Dop853, 0.0, [1.0], Options::adaptive(1e-9, 1e-9)).unwrap();
    let error = solver.integrate_to(2.0).unwrap_err();
    assert!(
        !matches!(error, Error::Failure(Failure::Singular { .. } | Failure::ChangedSign { .. })),
        "{error}"
    );
}

/// `x' = x`, `v' = 1/(1 + x^2)`: the denominator overflows long before `x` does.
struct Growing;

impl System<f64> for Growing {
    type State = [f64; 2];

    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[0], 1.0 / (1.0 + y[0] * y[0])];
    }

    fn check(&self, t: f64, y: &[f64; 2]) -> Result<(), Failure> {
        Pivot { name: "1 + x^2", value: 1.0 + y[0] * y[0], scale: 0.0 }.verify(t)
    }
}

#[test]
fn a_pivot_that_overflows_on_the_way_is_refused() {
    for options in [Options::fixed(0.5), Options::adaptive(1e-6, 1e-6)] {
        let mut solver = Integrator::new(&Growing, Dop853, 0.0, [1e150, 0.0], options).unwrap();
        let error = solver.integrate_to(60.0).unwrap_err();
        assert!(matches!(error, Error::Failure(Failure::PivotNotFinite { pivot: "1 + x^2", .. })), "{error}");
        assert!(solver.state()[0] <= 1.4e154, "{}", solver.state()[0]);
    }
}

#[test]
fn pivots_that_cannot_be_divided_by_are_refused() {
    let verify = |value: f64, scale: f64| Pivot { name: "p", value, scale }.verify(2.0);
    let singular = Err(Failure::Singular { t: 2.0, pivot: "p" });
    let infinite = Err(Failure::PivotNotFinite { t: 2.0, pivot: "p" });
    assert_eq!([verify(1.0, 0.0), verify(-1e-300, 0.0), verify(1e-15, 1.0)], [Ok(()); 3]);
    assert_eq!([verify(0.0, 0.0), verify(1e-17, 1.0), verify(-1e-17, 1.0)], [singular; 3]);
    // Subnormal: a number of three digits.
    assert_eq!(verify(1e-321, 0.0), singular);
    assert_eq!(
        [verify(f64::INFINITY, 0.0), verify(f64::NEG_INFINITY, 1.0), verify(f64::NAN, 0.0)],
        [infinite; 3]
    );
    assert_eq!(Pivot { name: "p", value: 1.0_f32, scale: f32::INFINITY }.verify(2.0), singular);
}

#[cfg(feature = "lanes")]
#[test]
fn one_lane_over_a_singular_point_ends_the_integration_of_all() {
    use hamel_runtime::F64x4;
    for k in 0..4 {
        let start = |k: usize| {
            let mut speed = [1e-3; 4];
            speed[k] = 1.0;
            [F64x4::splat(0.0), F64x4::new(speed)]
        };
        let mut solver =
            Integrator::new(&Thinning, Rk4, F64x4::splat(0.0), start(k), Options::fixed(F64x4::splat(0.1)))
                .unwrap();
        let error = solver.integrate_to(F64x4::splat(3.0)).unwrap_err();
        assert!(
            matches!(error, Error::Failure(Failure::ChangedSign { pivot: "inertia along x_dot", .. })),
            "lane {k}: {error}"
        );
        assert!(solver.state()[0].to_array().iter().all(|x| *x < 1.0), "lane {k}");
        let options = Options::adaptive(F64x4::splat(1e-9), F64x4::splat(1e-9));
        let mut adaptive = Integrator::new(&Thinning, Tsit5, F64x4::splat(0.0), start(k), options).unwrap();
        let error = adaptive.integrate_to(F64x4::splat(3.0)).unwrap_err();
        let pivot = "inertia along x_dot";
        let found = match error {
            Error::Failure(Failure::ChangedSign { pivot, .. } | Failure::Singular { pivot, .. }) => {
                Some(pivot)
            }
            _ => None,
        };
        assert_eq!(found, Some(pivot), "lane {k}: {error}");
    }
}

/// `x' = 1/s` or `x' = sin(s)/s` with `s = t - 1/2`: a single divisor, whose sign is a fraction of the signature.
struct Divided {
    has_pole: bool,
}

impl<R: Real> System<R> for Divided {
    type State = [R; 1];

    fn rhs(&self, t: R, _y: &[R; 1], dy: &mut [R; 1]) {
        let s = t - R::from_f64(0.5);
        *dy = [if self.has_pole { R::ONE / s } else { s.sin() / s }];
    }

    fn signature(&self, t: R, _y: &[R; 1]) -> R {
        let s = t - R::from_f64(0.5);
        R::from_f64(0.25) * s / s.abs()
    }

    fn pivots(&self, t: R, _y: &[R; 1], visit: &mut dyn FnMut(Pivot<R>)) {
        visit(Pivot { name: "mass", value: R::from_f64(3.0), scale: R::ZERO });
        visit(Pivot { name: "t - 1/2", value: t - R::from_f64(0.5), scale: R::ZERO });
    }
}

fn passed<M: Method<f64, Divided>>(method: M, options: Options<f64>, has_pole: bool) -> Result<f64, Error> {
    let system = Divided { has_pole };
    let mut solver = Integrator::new(&system, method, 0.0, [0.0], options).unwrap();
    solver.integrate_to(2.0)?;
    Ok(solver.state()[0])
}

#[test]
fn steps_stop_at_a_pole_of_a_single_divisor() {
    let named = |outcome: Result<f64, Error>, method: &str| {
        let error = outcome.expect_err(method);
        let Error::Failure(Failure::ChangedSign { pivot, .. } | Failure::Singular { pivot, .. }) = error
        else {
            panic!("{method}: {error}")
        };
        assert_eq!(pivot, "t - 1/2", "{method}");
    };
    for step in [0.3, 0.03, 0.01] {
        named(passed(Rk4, Options::fixed(step), true), "rk4");
        named(passed(Vern9, Options::fixed(step), true), "vern9");
        named(passed(Gauss8::fixed_point(), Options::fixed(step), true), "gauss8");
    }
    named(passed(Dop853, Options::adaptive(1e-3, 1e-3), true), "dop853");
}

/// Si(3/2) + Si(1/2).
const SINE_INTEGRALS: f64 = 1.324_683_531_172_119_7 + 0.493_107_418_043_066_7;

#[test]
fn steps_pass_a_single_divisor_where_the_slope_has_a_value() {
    for step in [0.3, 0.03] {
        let found = passed(Vern9, Options::fixed(step), false).unwrap();
        assert!((found - SINE_INTEGRALS).abs() < 1e-9, "{found}");
    }
    for found in [
        passed(Dop853, Options::adaptive(1e-10, 1e-10), false),
        passed(Rk4, Options::fixed(0.03), false),
        passed(Gauss8::fixed_point(), Options::fixed(0.03), false),
    ] {
        let found = found.unwrap();
        assert!((found - SINE_INTEGRALS).abs() < 1e-8, "{found}");
    }
}
