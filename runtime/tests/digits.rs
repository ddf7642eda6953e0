//! Integration with more digits than `f64`: every method reaches the tolerances that `DoubleDouble` allows.

use std::ops::ControlFlow::Continue;

use hamel_runtime::{
    Direction, Dop853, Dopri5, DoubleDouble, Gauss4, Gauss6, Gauss8, Integrator, Jet, Method, Options, Real,
    Rk4, System, Taylor, Tsit5, Vern9,
};

type Wide = DoubleDouble;

fn wide(x: f64) -> Wide {
    Wide::from(x)
}

/// The oscillator and an equation with explicit time.
///
/// ```text
/// (a, b)' = (b, -a),  c' = c cos t:  a = cos t,  b = -sin t,  c = exp(sin t)
/// ```
struct Driven;

impl System<Wide> for Driven {
    type State = [Wide; 3];
    fn rhs(&self, t: Wide, &[a, b, c]: &[Wide; 3], dy: &mut [Wide; 3]) {
        *dy = [b, -a, c * t.cos()];
    }
}

fn solution(t: Wide) -> [Wide; 3] {
    let (sine, cosine) = t.sin_cos();
    [cosine, -sine, sine.exp()]
}

fn distance(y: &[Wide; 3], expected: &[Wide; 3]) -> f64 {
    y.iter().zip(expected).map(|(&y, &e)| (y - e).magnitude()).fold(0.0, f64::max)
}

fn start<M: Method<Wide, Driven>>(method: M, options: Options<Wide>) -> Integrator<'static, Wide, Driven, M> {
    Integrator::new(&Driven, method, Wide::ZERO, solution(Wide::ZERO), options).unwrap()
}

/// Errors of steps and of dense output follow the tolerance down to `10^-most`, and numbers of steps the order.
fn check_adaptive<M: Method<Wide, Driven>>(method: M, end: f64, exponents: &[i32], order: f64) {
    let name = M::TABLEAU.name;
    let mut counts = vec![];
    for &exponent in exponents {
        let tolerance = 10.0_f64.powi(-exponent);
        let mut solver = start(method, Options::adaptive(wide(tolerance), wide(tolerance)));
        let mut worst = 0.0_f64;
        let times = (1..8_u32).map(|k| wide(end) * Wide::ratio(f64::from(k), 8.0) * wide(0.99));
        solver.sample(wide(end), times, |t, y| worst = worst.max(distance(y, &solution(t)))).unwrap();
        let error = distance(solver.state(), &solution(wide(end)));
        println!(
            "{name} 1e-{exponent}: error {error:.1e}, within {worst:.1e}, {} steps",
            solver.stats().steps
        );
        assert!(error < 100.0 * tolerance, "{name} 1e-{exponent}: {error:e}");
        // Dense output of Dop853 is of one order less than its steps.
        assert!(worst < 1e4 * tolerance, "{name} 1e-{exponent}: {worst:e}");
        assert_eq!(solver.t(), wide(end));
        counts.push((exponent, solver.stats().steps as f64));
    }
    // steps ~ tolerance^(-1/order)
    let ((first, n_first), (last, n_last)) = (counts[0], counts[counts.len() - 1]);
    let observed = f64::from(last - first) / (n_last / n_first).log10();
    assert!(
        (order * 0.85..order * 1.15).contains(&observed),
        "{name}: order {observed:.2} instead of {order}"
    );
}

#[test]
fn adaptive_methods_reach_the_tolerances_of_the_scalar() {
    check_adaptive(Dopri5, 0.2, &[18, 20, 22], 5.0);
    check_adaptive(Tsit5, 0.2, &[18, 20, 22], 5.0);
    check_adaptive(Dop853, 1.0, &[18, 20, 22, 24, 26, 28], 8.0);
    check_adaptive(Vern9, 1.0, &[18, 20, 22, 24, 26, 28], 9.0);
}

#[test]
fn fixed_steps_converge_below_the_digits_of_f64() {
    fn check<M: Method<Wide, Driven>>(method: M, n_steps: u32, order: i32, reaches: f64) {
        let name = M::TABLEAU.name;
        let error = |n: u32| {
            let mut solver = start(method, Options::fixed(Wide::ratio(1.0, f64::from(n))));
            solver.integrate_to(Wide::ONE).unwrap();
            distance(solver.state(), &solution(Wide::ONE))
        };
        let (coarse, fine) = (error(n_steps), error(2 * n_steps));
        println!("{name}: {coarse:.1e} and {fine:.1e}");
        let observed = (coarse / fine).log2();
        assert!((observed - f64::from(order)).abs() < 0.3, "{name}: order {observed}");
        assert!(fine < reaches, "{name}: {fine:e}");
    }
    check(Rk4, 2000, 4, 1e-15);
    check(Gauss4::fixed_point(), 5000, 4, 1e-18);
    check(Gauss6::fixed_point(), 1000, 6, 1e-21);
    check(Gauss8::fixed_point(), 100, 8, 1e-23);
}

#[test]
fn quadratic_invariants_are_kept_to_the_last_digit() {
    let mut solver = start(Gauss6::fixed_point(), Options::fixed(wide(0.1)));
    let mut worst = 0.0_f64;
    for k in 1..=1000 {
        solver.integrate_to(wide(0.1 * f64::from(k))).unwrap();
        let [a, b, _] = *solver.state();
        worst = worst.max((a * a + b * b - Wide::ONE).magnitude());
    }
    println!("{worst:.1e}");
    assert!(worst < 1e-29, "{worst:e}");
}

impl Jet<Wide> for Driven {
    type Workspace = ();
    fn workspace(&self) {}
    /// The exponential of a series: `k c_k = sum_j j s_j c_(k-j)`.
    fn series(&self, t: Wide, y: &[Wide; 3], (): &mut (), out: &mut [[Wide; 3]]) {
        let (sine, cosine) = t.sin_cos();
        let (mut angle, mut rates) = ([sine, cosine], vec![]);
        let mut c = *y;
        for k in 0..out.len() {
            out[k] = c;
            // The coefficients of cos t, of which c' = c cos t.
            rates.push(angle[1]);
            let sum = (0..=k).fold(Wide::ZERO, |sum, j| sum + rates[j] * out[k - j][2]);
            let n = wide((k + 1) as f64);
            angle = [angle[1] / n, -angle[0] / n];
            c = [c[1] / n, -c[0] / n, sum / n];
        }
    }
}

#[test]
fn series_reach_the_tolerances_of_the_scalar() {
    for exponent in [18, 20, 22, 24, 26, 28] {
        let tolerance = 10.0_f64.powi(-exponent);
        let mut solver = start(Taylor::new(), Options::adaptive(wide(tolerance), wide(tolerance)));
        solver.integrate_to(wide(3.0)).unwrap();
        let error = distance(solver.state(), &solution(wide(3.0)));
        println!("taylor 1e-{exponent}: error {error:.1e}, {} steps", solver.stats().steps);
        assert!(error < 100.0 * tolerance, "taylor 1e-{exponent}: {error:e}");
    }
}

#[test]
fn events_are_located_to_the_digits_of_the_scalar() {
    let mut solver = start(Vern9, Options::adaptive(wide(1e-26), wide(1e-26)));
    let mut found = vec![];
    let _ = solver
        .integrate_with_events(
            wide(2.0),
            [Direction::Either; 2],
            |t, y| [t - Wide::ratio(1.0, 3.0), y[0]],
            |event| {
                found.push(event.t);
                Continue(())
            },
        )
        .unwrap();
    let half_pi = Wide::ONE.atan() + Wide::ONE.atan();
    assert_eq!(found.len(), 2);
    let errors = [(found[0] - Wide::ratio(1.0, 3.0)).magnitude(), (found[1] - half_pi).magnitude()];
    println!("{errors:?}");
    assert!(errors[0] < 1e-30 && errors[1] < 1e-24, "{errors:?}");
}
