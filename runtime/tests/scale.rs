//! Results do not depend on the scale of the state, from the least to the largest numbers of a scalar.

use hamel_runtime::{
    Differentiable, Dop853, Dopri5, DoubleDouble, Error, Failure, Gauss4, Gauss6, Gauss8, Integrator,
    Invariants, Jet, Method, Norm, Options, Projected, Real, Rk4, System, Taylor, Tsit5, Vern9,
};

/// Two oscillators that do not know of each other, `q'' = -q` and `q'' = -4 q`.
struct Two;

impl<R: Real> System<R> for Two {
    type State = [R; 4];
    fn rhs(&self, _t: R, &[q, p, r, s]: &[R; 4], dy: &mut [R; 4]) {
        *dy = [p, -q, s, -R::from_f64(4.0) * r];
    }
}

impl<R: Real> Differentiable<R> for Two {
    fn jacobian(&self, _t: R, _y: &[R; 4], jacobian: &mut [[R; 4]]) {
        let (zero, one) = (R::ZERO, R::ONE);
        jacobian.copy_from_slice(&[
            [zero, one, zero, zero],
            [-one, zero, zero, zero],
            [zero, zero, zero, one],
            [zero, zero, -R::from_f64(4.0), zero],
        ]);
    }
}

impl<R: Real> Jet<R> for Two {
    type Workspace = ();
    fn workspace(&self) {}
    fn series(&self, t: R, y: &[R; 4], (): &mut (), out: &mut [[R; 4]]) {
        let mut c = *y;
        for (k, out) in out.iter_mut().enumerate() {
            *out = c;
            let mut next = c;
            self.rhs(t, &c, &mut next);
            c = next.map(|x| x / R::from_f64((k + 1) as f64));
        }
    }
}

impl<R: Real> Invariants<R, 1> for Two {
    fn values(&self, _t: R, &[q, p, ..]: &[R; 4]) -> [R; 1] {
        [q * q + p * p]
    }
    fn gradients(&self, _t: R, &[q, p, ..]: &[R; 4], gradients: &mut [[R; 4]; 1]) {
        gradients[0] = [q + q, p + p, R::ZERO, R::ZERO];
    }
}

/// The state at `t = 5` of oscillators with these amplitudes, in units of them; with the numbers of steps.
fn run<R: Real, M: Method<R, Two>>(
    method: M,
    scales: [f64; 2],
    options: Options<R>,
    atol: f64,
) -> Result<([R; 4], u64, u64), Error> {
    let scale = [scales[0], scales[0], scales[1], scales[1]].map(R::from_f64);
    let unit = [1.0, 0.5, -0.25, 0.75].map(R::from_f64);
    let start = core::array::from_fn(|c| scale[c] * unit[c]);
    let mut solver = Integrator::new(&Two, method, R::ZERO, start, options)?;
    if atol > 0.0 {
        solver = solver.with_tolerances([options.rtol; 4], scale.map(|scale| R::from_f64(atol) * scale))?;
    }
    solver.integrate_to(R::from_f64(5.0))?;
    let end = *solver.state();
    let stats = solver.stats();
    Ok((core::array::from_fn(|c| end[c] / scale[c]), stats.steps, stats.rejected))
}

/// How results at another scale may differ.
#[derive(Clone, Copy)]
enum Agree {
    /// Bit for bit, and so the numbers of steps.
    Exactly,
    /// Relative to the amplitude.
    Within(f64),
}

fn check<R: Real, M: Method<R, Two>>(
    method: M,
    options: Options<R>,
    scales: &[[f64; 2]],
    agree: impl Fn([f64; 2]) -> Agree,
) {
    let name = M::TABLEAU.name;
    for norm in [Norm::Rms, Norm::Max] {
        for atol in [0.0, 1e-3 * options.rtol.magnitude()] {
            let options = options.with_norm(norm);
            let expected = run(method, [1.0, 1.0], options, atol).unwrap();
            for &scales in scales {
                let found = run(method, scales, options, atol)
                    .unwrap_or_else(|error| panic!("{name} {scales:?} atol {atol:e}: {error}"));
                match agree(scales) {
                    Agree::Exactly => assert_eq!(found, expected, "{name} {scales:?} {norm:?} atol {atol:e}"),
                    Agree::Within(bound) => {
                        for (found, expected) in found.0.into_iter().zip(expected.0) {
                            let off = (found - expected).magnitude();
                            assert!(off <= bound, "{name} {scales:?} {norm:?} atol {atol:e}: {off:e}");
                        }
                    }
                }
            }
        }
    }
}

/// Powers of two from `2^least` to `2^most`: of both oscillators, and of one alone.
fn powers(least: i32, most: i32) -> Vec<[f64; 2]> {
    let scale = |k: i32| 2.0_f64.powi(k);
    let all = (0..=16).map(|k| least + (most - least) * k / 16);
    all.flat_map(|k| [[scale(k), scale(k)], [scale(k), 1.0], [1.0, scale(k)], [scale(k), scale(-k)]])
        .filter(|scales| scales.iter().all(|s| (scale(least)..=scale(most)).contains(s)))
        .collect()
}

const TOLERANCE: f64 = 1e-9;

fn adaptive() -> Options<f64> {
    Options::adaptive(TOLERANCE, 0.0)
}

#[test]
fn powers_of_two_change_no_bit() {
    // Errors, of which the smallest are 1e-16 of the state, are numbers with all their digits; nothing overflows.
    let scales = powers(-900, 990);
    check(Dopri5, adaptive(), &scales, |_| Agree::Exactly);
    check(Tsit5, adaptive(), &scales, |_| Agree::Exactly);
    check(Dop853, adaptive(), &scales, |_| Agree::Exactly);
    check(Vern9, adaptive(), &scales, |_| Agree::Exactly);
    // Coefficients of the series are smaller than the state by up to 1e-20.
    check(Taylor::new(), adaptive(), &scales, |_| Agree::Exactly);
    let fixed = Options::fixed(0.05);
    check(Rk4, fixed, &scales, |_| Agree::Exactly);
    check(Gauss4::fixed_point(), fixed, &powers(-900, 990), |[a, b]| same_if(a == b));
    check(Gauss6::fixed_point(), fixed, &powers(-900, 990), |[a, b]| same_if(a == b));
    check(Gauss8::fixed_point(), fixed, &powers(-900, 990), |[a, b]| same_if(a == b));
    check(Gauss6::newton(), fixed, &powers(-900, 990), |[a, b]| same_if(a == b));
    // Squares of the state are numbers too.
    check(Projected::<_, 1>::new(Vern9), adaptive(), &powers(-400, 500), |[a, b]| same_if(a == b));
    check(Projected::<_, 1>::new(Rk4), fixed, &powers(-400, 500), |[a, b]| same_if(a == b));
}

/// Iterations stop, and projections weigh, by the largest component: the smaller ones agree to round-off.
fn same_if(is_one_scale: bool) -> Agree {
    if is_one_scale { Agree::Exactly } else { Agree::Within(1e-7) }
}

#[test]
fn amplitudes_from_1e_minus_300_to_1e300_lead_to_the_same_motion() {
    let decades = || (-300..=300).step_by(20).map(|k| 10.0_f64.powi(k));
    let scales: Vec<_> = decades().flat_map(|s| [[s, s], [s, 1.0], [1.0, s], [s, 1.0 / s]]).collect();
    let close = |_| Agree::Within(100.0 * TOLERANCE);
    check(Dopri5, adaptive(), &scales, close);
    check(Tsit5, adaptive(), &scales, close);
    check(Dop853, adaptive(), &scales, close);
    check(Vern9, adaptive(), &scales, close);
    check(Taylor::new(), adaptive(), &scales, close);
    check(Taylor::of_order(8), adaptive(), &scales, close);
    let fixed = Options::fixed(0.01);
    let to_round_off = |_| Agree::Within(1e-13);
    check(Rk4, fixed, &scales, to_round_off);
    let alike: Vec<_> = decades().map(|s| [s, s]).collect();
    check(Gauss4::fixed_point(), fixed, &alike, to_round_off);
    check(Gauss6::fixed_point(), fixed, &alike, to_round_off);
    check(Gauss8::fixed_point(), fixed, &alike, to_round_off);
    check(Gauss8::newton(), fixed, &alike, to_round_off);
    // A square that is not a number any more is no invariant to project onto.
    let small: Vec<_> = alike.iter().copied().filter(|[s, _]| *s < 1e154).collect();
    check(Projected::<_, 1>::new(Vern9), adaptive(), &small, close);
    for scale in [1e160, 1e300] {
        let infinite = run(Projected::<_, 1>::new(Vern9), [scale, scale], adaptive(), 0.0).map(|_| ());
        assert!(matches!(infinite, Err(Error::InvariantNotFinite { index: 0, .. })), "{infinite:?}");
    }
}

#[test]
fn other_scalars_have_their_own_range() {
    let narrow = Options::adaptive(1e-5_f32, 0.0);
    check(Tsit5, narrow, &powers(-90, 110), |_| Agree::Exactly);
    check(Dop853, narrow, &powers(-90, 110), |_| Agree::Exactly);
    check(Taylor::new(), narrow, &powers(-90, 110), |_| Agree::Within(1e-4));
    check(Tsit5, narrow, &powers(-120, 120), |_| Agree::Within(1e-3));
    check(Dop853, narrow, &powers(-120, 120), |_| Agree::Within(1e-3));
    check(Projected::<_, 1>::new(Tsit5), narrow, &powers(-120, 60), |_| Agree::Within(1e-3));
    let wide = Options::adaptive(DoubleDouble::from(1e-20), DoubleDouble::ZERO);
    check(Vern9, wide, &powers(-750, 990), |_| Agree::Exactly);
    check(Taylor::new(), wide, &powers(-750, 990), |_| Agree::Exactly);
    check(Vern9, wide, &powers(-900, 990), |_| Agree::Within(1e-17));
}

/// `y' = rate y`, whose solution knows no scale of time either.
struct Growth(f64);

impl System<f64> for Growth {
    type State = [f64; 1];
    fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
        dy[0] = self.0 * y[0];
    }
}

#[test]
fn the_unit_of_time_does_not_matter_either() {
    fn end<M: Method<f64, Growth>>(method: M, rate: f64) -> f64 {
        let growth = Growth(rate);
        let mut solver = Integrator::new(&growth, method, 0.0, [1.0], Options::adaptive(1e-9, 0.0)).unwrap();
        solver.integrate_to(1.0 / rate).unwrap();
        solver.state()[0]
    }
    for exponent in (-280..=280).step_by(35) {
        let rate = 10.0_f64.powi(exponent);
        for found in [end(Dopri5, rate), end(Tsit5, rate), end(Dop853, rate), end(Vern9, rate)] {
            assert!((found / 1.0_f64.exp() - 1.0).abs() < 1e-7, "1e{exponent}: {found}");
        }
    }
}

#[test]
fn a_component_may_be_zero_where_its_absolute_tolerance_is() {
    // At rest in the second oscillator.
    let start = [1e-40, 0.0, 0.0, 0.0];
    let mut solver = Integrator::new(&Two, Dop853, 0.0, start, adaptive()).unwrap();
    solver.integrate_to(5.0).unwrap();
    let end = solver.state().map(|y| y / 1e-40);
    assert!((end[0] - 5.0_f64.cos()).abs() < 1e-7 && (end[1] + 5.0_f64.sin()).abs() < 1e-7, "{end:?}");
    assert_eq!((end[2], end[3]), (0.0, 0.0));
}

#[test]
fn a_state_that_overflows_is_an_error() {
    let mut solver = Integrator::new(&Growth(1.0), Dop853, 0.0, [1e300], adaptive()).unwrap();
    let end = solver.integrate_to(100.0);
    assert!(
        matches!(end, Err(Error::Failure(Failure::NonFinite { .. }) | Error::StepTooSmall { .. })),
        "{end:?}"
    );
    assert!(
        solver.state()[0].is_finite() && (solver.state()[0] / (1e300 * solver.t().exp()) - 1.0).abs() < 1e-6
    );
}
