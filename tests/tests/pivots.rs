//! What is divided by: finite, other than zero, and positive where it is an inertia; everything else is refused by
//! name.

use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use hamel_models::generated::{appell_machine, euler_disk_advected, extended_pose, kirchhoff_body};
use hamel_program::program::Role;
use hamel_runtime::{DoubleDouble, Dual, Error, Failure, Integrator, Options, Real, Rk4, Scene, System};
use hamel_tests::derived::Derived;
use hamel_tests::models::{derived, generated};
use hamel_tests::random::Random;

/// `mantissa 2^exponent` with the mantissa of an `f64` and an exponent without bounds: every operation rounds as `f64`
/// does where that neither overflows nor underflows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Wide {
    mantissa: f64,
    exponent: i64,
}

impl Wide {
    fn new(mantissa: f64, exponent: i64) -> Wide {
        if mantissa == 0.0 || !mantissa.is_finite() {
            return Wide { mantissa, exponent: 0 };
        }
        if mantissa.abs() < f64::MIN_POSITIVE {
            return Wide::new(mantissa * 2.0_f64.powi(200), exponent - 200);
        }
        let bits = mantissa.to_bits();
        let k = (bits >> 52 & 0x7ff) as i64 - 1023;
        Wide { mantissa: f64::from_bits(bits & !(0x7ff << 52) | 1023 << 52), exponent: exponent + k }
    }

    fn to_f64(self) -> f64 {
        let part = (self.exponent / 2).clamp(-1000, 1000) as i32;
        let rest = (self.exponent - i64::from(part)).clamp(-1000, 1000) as i32;
        self.mantissa * 2.0_f64.powi(part) * 2.0_f64.powi(rest)
    }

    fn via(self, f: impl Fn(f64) -> f64) -> Wide {
        // An angle without digits has no sine.
        if self.mantissa != 0.0 && self.exponent > 60 {
            Wide::new(f64::NAN, 0)
        } else {
            Wide::new(f(self.to_f64()), 0)
        }
    }

    fn compare(self, other: Wide) -> Option<Ordering> {
        (self - other).mantissa.partial_cmp(&0.0)
    }
}

impl Add for Wide {
    type Output = Wide;
    fn add(self, other: Wide) -> Wide {
        if self.mantissa == 0.0 {
            return other;
        }
        if other.mantissa == 0.0 {
            return self;
        }
        let (large, small) = if self.exponent >= other.exponent { (self, other) } else { (other, self) };
        let shift = large.exponent - small.exponent;
        if shift > 200 && small.mantissa.is_finite() {
            return large;
        }
        Wide::new(large.mantissa + small.mantissa * 2.0_f64.powi(-(shift.min(200) as i32)), large.exponent)
    }
}

impl Neg for Wide {
    type Output = Wide;
    fn neg(self) -> Wide {
        Wide { mantissa: -self.mantissa, ..self }
    }
}

impl Sub for Wide {
    type Output = Wide;
    fn sub(self, other: Wide) -> Wide {
        self + -other
    }
}

impl Mul for Wide {
    type Output = Wide;
    fn mul(self, other: Wide) -> Wide {
        Wide::new(self.mantissa * other.mantissa, self.exponent + other.exponent)
    }
}

impl Div for Wide {
    type Output = Wide;
    fn div(self, other: Wide) -> Wide {
        Wide::new(self.mantissa / other.mantissa, self.exponent - other.exponent)
    }
}

macro_rules! assign {
    ($($trait:ident $method:ident $operator:tt)*) => {$(
        impl $trait for Wide {
            fn $method(&mut self, other: Wide) {
                *self = *self $operator other;
            }
        }
    )*};
}

assign! { AddAssign add_assign + SubAssign sub_assign - MulAssign mul_assign * DivAssign div_assign / }

macro_rules! by_f64 {
    ($($name:ident)*) => {$(
        fn $name(self) -> Wide {
            self.via(<f64 as Real>::$name)
        }
    )*};
}

impl Real for Wide {
    const ZERO: Wide = Wide { mantissa: 0.0, exponent: 0 };
    const ONE: Wide = Wide { mantissa: 1.0, exponent: 0 };

    fn from_f64(x: f64) -> Wide {
        Wide::new(x, 0)
    }
    fn ratio(p: f64, q: f64) -> Wide {
        Wide::new(<f64 as Real>::ratio(p, q), 0)
    }
    fn sum_error(self, other: Wide) -> Wide {
        let sum = self + other;
        let part = sum - self;
        (self - (sum - part)) + (other - part)
    }
    fn product_error(self, other: Wide) -> Wide {
        let error = Real::product_error(self.mantissa, other.mantissa);
        Wide::new(error, self.exponent + other.exponent)
    }
    fn sqrt(self) -> Wide {
        let odd = self.exponent.rem_euclid(2);
        Wide::new(<f64 as Real>::sqrt(self.mantissa * 2.0_f64.powi(odd as i32)), (self.exponent - odd) / 2)
    }
    by_f64! { sin cos tan asin acos atan exp ln sinh cosh tanh }
    fn atan2(self, x: Wide) -> Wide {
        Wide::new(Real::atan2(self.to_f64(), x.to_f64()), 0)
    }
    fn abs(self) -> Wide {
        Wide { mantissa: self.mantissa.abs(), ..self }
    }
    fn all_gt(self, other: Wide) -> bool {
        self.compare(other) == Some(Ordering::Greater)
    }
    fn all_ge(self, other: Wide) -> bool {
        matches!(self.compare(other), Some(Ordering::Greater | Ordering::Equal))
    }
    fn all_ne(self, other: Wide) -> bool {
        self.compare(other) != Some(Ordering::Equal)
    }
    fn all_finite(self) -> bool {
        self.mantissa.is_finite()
    }
    fn magnitude(self) -> f64 {
        self.to_f64().abs()
    }
}

/// States of all sizes up to 1e300, some components or all of them: what `check` accepts and what is finite is right.
/// `compiled` shows that compiled scenes have the bits of these programs.
fn huge(derived: &Derived) -> (usize, usize) {
    let label = format!("{} {}", derived.model, derived.scene);
    let defaults = derived.defaults();
    let wide: Vec<Wide> = defaults.iter().map(|x| Wide::from_f64(*x)).collect();
    let scene = derived.prepare(&defaults).unwrap_or_else(|e| panic!("{label}: {e}"));
    let exact = derived.prepare_over(&wide).unwrap_or_else(|e| panic!("{label}: {e}"));
    let rate = derived.program.function(&Role::Rate).unwrap_or_else(|| panic!("{label} has no rhs"));
    let carries_errors = rate.carries_errors();
    let n = derived.state_names().len();
    let mut random = Random(77);
    let (mut compared, mut refused) = (0, 0);
    for round in 0..300 {
        let size = 10.0_f64.powi(100 + round % 201);
        let one = (random.number().abs() * n as f64) as usize;
        let mut y = vec![0.0; n];
        for (k, y) in y.iter_mut().enumerate() {
            let is_large = round % 3 == 0 || k == one || (round % 3 == 1 && random.number() > 0.0);
            *y = (0.5 + 0.45 * random.number()) * if is_large { size } else { 1.0 };
        }
        if scene.domain(0.0, &y).is_err() {
            continue;
        }
        let mut dy = vec![0.0; n];
        scene.rhs(0.0, &y, &mut dy);
        if scene.check(0.0, &y).is_err() || dy.iter().any(|x| !x.is_finite()) {
            refused += 1;
            continue;
        }
        let mut expected = vec![Wide::ZERO; n];
        let state: Vec<Wide> = y.iter().copied().map(Wide::from_f64).collect();
        exact.rhs(Wide::ZERO, &state, &mut expected);
        // Rounding errors that are carried underflow before their values do. A rate keeps the digits then that it has
        // without them: where terms as large as another rate cancel, it is known to the epsilon of these.
        let largest = expected.iter().filter(|b| b.all_finite()).map(|b| b.magnitude()).fold(0.0, f64::max);
        let unknown = if carries_errors { f64::EPSILON * largest } else { 0.0 };
        for (k, (a, b)) in dy.into_iter().zip(expected).enumerate() {
            // Angles of 1e100 have no sine to compare with, and what underflows is as good as zero.
            if !b.all_finite() || b.magnitude() < 1e-290 {
                continue;
            }
            // The operations are the same, so that nothing but overflow and underflow can differ.
            let error = (Wide::from_f64(a) - b).magnitude();
            let name = &derived.state_names()[k];
            let is_right = error < 1e-9 * b.magnitude() || error <= unknown;
            assert!(is_right, "{label}: dot_{name} = {a:e}, not {:e}, at {y:?}", b.to_f64());
            compared += 1;
        }
    }
    (compared, refused)
}

#[test]
fn huge_states_give_right_derivatives_or_are_refused() {
    let of_scene = |(name, scene)| (format!("{name} {scene}"), huge(derived(name, scene)));
    let counts: Vec<(String, (usize, usize))> = generated().into_iter().map(of_scene).collect();
    let total = |part: fn(&(usize, usize)) -> usize| counts.iter().map(|(_, n)| part(n)).sum::<usize>();
    println!("{counts:?}");
    assert!(total(|n| n.0) > 10_000 && total(|n| n.1) > 1_000, "{counts:?}");
}

#[test]
fn appell_machine_at_4e153_is_refused_instead_of_standing_still() {
    let machine: appell_machine::Prepared = appell_machine::Prepared::new(&Default::default()).unwrap();
    let at = |v: f64| [0.0, 0.0, 0.0, 1.2 * v, 1.6 * v, v];
    let mut dy = [0.0; 6];
    machine.rhs(0.0, &at(4e153), &mut dy);
    assert!(dy[3] == 0.0 && !dy[5].is_finite(), "the pivot overflows: {dy:?}");
    let failure = machine.check(1.0, &at(4e153)).unwrap_err();
    assert!(matches!(failure, Failure::PivotNotFinite { t: 1.0, .. }), "{failure}");
    assert!(failure.to_string().contains("z_dot^2 = k^2*(x_dot^2 + y_dot^2)"), "{failure}");
    let start = Integrator::new(&machine, Rk4, 0.0, at(4e153), Options::fixed(0.1)).map(|_| ());
    assert!(matches!(start, Err(Error::Failure(Failure::PivotNotFinite { t: 0.0, .. }))), "{start:?}");
    // A little slower it moves as ever: z'' = -g k^2/(1 + k^2).
    assert_eq!(machine.check(0.0, &at(1e150)), Ok(()));
    machine.rhs(0.0, &at(1e150), &mut dy);
    assert!((dy[5] + 9.81 * 0.25 / 1.25).abs() < 1e-12, "{dy:?}");
}

#[test]
fn a_flat_disk_is_refused_by_the_name_of_what_vanishes() {
    let disk: euler_disk_advected::Prepared =
        euler_disk_advected::Prepared::new(&Default::default()).unwrap();
    let failure = disk.check(0.0, &[0.3, 0.8, -6.0, 0.0, 0.0, 1.0]).unwrap_err();
    assert_eq!(failure, Failure::Singular { t: 0.0, pivot: "Gamma1^2 + Gamma2^2" });
    assert_eq!(disk.check(0.0, &[0.3, 0.8, -6.0, 0.8, 0.0, 0.6]), Ok(()));
}

#[test]
fn an_indefinite_inertia_of_kirchhoffs_body_is_refused() {
    let params = kirchhoff_body::Params { J1: 1.7e-7, C11: 47038.0, ..Default::default() };
    let error = kirchhoff_body::Prepared::new(&params).unwrap_err();
    assert_eq!(error.condition, "inertia along V1 > 0");
    assert!(error.meaning.contains("positive definite"), "{error}");
    // The same coupling is no obstacle to a body that is heavy enough.
    let heavy = kirchhoff_body::Params { M1: 1.4e16, M2: 1e9, M3: 1e9, ..params };
    assert!(kirchhoff_body::Prepared::new(&heavy).is_ok());
}

/// The largest error of an acceleration in epsilon of what relative errors of one in the inputs change it by.
fn worst_error<S, D, E, const N: usize>(params: &[f64], y: [f64; N]) -> Option<f64>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    D: Scene<DoubleDouble> + System<DoubleDouble, State = [DoubleDouble; N]>,
    E: Scene<Dual<DoubleDouble>> + System<Dual<DoubleDouble>, State = [Dual<DoubleDouble>; N]>,
{
    let scene = S::prepare(params).ok()?;
    let mut dy = [0.0; N];
    scene.rhs(0.0, &y, &mut dy);
    let exactly: Vec<DoubleDouble> = params.iter().map(|p| DoubleDouble::from_f64(*p)).collect();
    let mut expected = [DoubleDouble::ZERO; N];
    let exact = D::prepare(&exactly).unwrap_or_else(|e| panic!("accepted in f64 alone: {e}"));
    exact.rhs(DoubleDouble::ZERO, &y.map(DoubleDouble::from_f64), &mut expected);
    let mut effects = [0.0; N];
    for k in 0..params.len() + N {
        let input = |j: usize, x: f64| {
            let x = DoubleDouble::from_f64(x);
            Dual::new(x, if j == k { x } else { DoubleDouble::ZERO })
        };
        let moved: Vec<_> = params.iter().enumerate().map(|(j, p)| input(j, *p)).collect();
        let state = std::array::from_fn(|j| input(params.len() + j, y[j]));
        let mut slopes = [Dual::default(); N];
        E::prepare(&moved).unwrap().rhs(Dual::default(), &state, &mut slopes);
        effects.iter_mut().zip(slopes).for_each(|(effect, slope)| *effect += slope.derivative.magnitude());
    }
    // A component may hardly depend on what the others do: the largest effect is the measure.
    let effect = effects.into_iter().fold(0.0, f64::max);
    let errors = dy.iter().zip(expected).map(|(a, b)| (DoubleDouble::from_f64(*a) - b).magnitude());
    assert!(dy.iter().all(|x| x.is_finite()), "{params:?}");
    Some(errors.fold(0.0, f64::max) / (f64::EPSILON * effect))
}

/// The smallest pivot of a symmetric matrix beside the entry that it comes from.
fn smallest_pivot(a: &[Vec<f64>]) -> f64 {
    let n = a.len();
    let mut rest: Vec<Vec<DoubleDouble>> =
        a.iter().map(|row| row.iter().map(|x| DoubleDouble::from_f64(*x)).collect()).collect();
    let mut smallest = f64::INFINITY;
    for k in 0..n {
        let pivot = rest[k][k];
        smallest = smallest.min(
            (pivot / DoubleDouble::from_f64(a[k][k])).magnitude()
                * if pivot.all_gt(DoubleDouble::ZERO) { 1.0 } else { -1.0 },
        );
        for i in k + 1..n {
            for j in k + 1..n {
                let update = rest[i][k] * rest[k][j] / pivot;
                rest[i][j] -= update;
            }
        }
    }
    smallest
}

/// Random metrics: `scale_i scale_j r_ij` with ones on the diagonal of `r` and a random `strength` beside it, so that
/// they are definite, nearly singular or indefinite, in units between 1e-4 and 1e4.
fn metric(random: &mut Random, n: usize) -> Vec<Vec<f64>> {
    let scales: Vec<f64> = (0..n).map(|_| 10.0_f64.powf(4.0 * random.number())).collect();
    let strength = 10.0_f64.powf(-1.0 + 1.2 * random.number());
    let mut a = vec![vec![0.0; n]; n];
    for i in 0..n {
        a[i][i] = scales[i] * scales[i];
        for j in 0..i {
            a[i][j] = scales[i] * scales[j] * strength * random.number();
            a[j][i] = a[i][j];
        }
    }
    a
}

/// Accuracy of accepted metrics in epsilon of the inputs' effect: elimination without growth, of nine unknowns at most.
const BOUND: f64 = 64.0;

fn sweep<S, D, E, const N: usize>(
    n_rounds: usize,
    seed: u64,
    mut draw: impl FnMut(&mut Random) -> (Vec<Vec<f64>>, Vec<f64>),
) where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    D: Scene<DoubleDouble> + System<DoubleDouble, State = [DoubleDouble; N]>,
    E: Scene<Dual<DoubleDouble>> + System<Dual<DoubleDouble>, State = [Dual<DoubleDouble>; N]>,
{
    let mut random = Random(seed);
    let (mut accepted, mut refused, mut worst) = (0, 0, 0.0_f64);
    for _ in 0..n_rounds {
        let (matrix, params) = draw(&mut random);
        let y = std::array::from_fn(|_| random.number());
        let smallest = smallest_pivot(&matrix);
        match worst_error::<S, D, E, N>(&params, y) {
            Some(error) => {
                accepted += 1;
                worst = worst.max(error);
                assert!(smallest > 0.0, "{smallest:e} is accepted: {params:?}");
                assert!(error < BOUND, "{error} eps of the inputs' effect, pivot {smallest:e}: {params:?}");
            }
            None => {
                refused += 1;
                assert!(smallest < 1e-11, "{smallest:e} is refused: {params:?}");
            }
        }
    }
    println!("{}: {accepted} accepted, {refused} refused, worst {worst:.1} eps", S::INFO.model);
    assert!(accepted > n_rounds / 10 && refused > n_rounds / 10, "{accepted} {refused}");
}

#[test]
fn metrics_of_kirchhoffs_body_are_solved_to_all_digits_or_refused() {
    use kirchhoff_body::Prepared;
    sweep::<Prepared, Prepared<DoubleDouble>, Prepared<Dual<DoubleDouble>>, 6>(600, 1, |random| {
        let mut a = metric(random, 6);
        // J and M are diagonal.
        for block in [0, 3] {
            for i in block..block + 3 {
                (block..block + 3).filter(|j| *j != i).for_each(|j| a[i][j] = 0.0);
            }
        }
        let mut params: Vec<f64> = (0..6).map(|i| a[i][i]).collect();
        params.extend((0..3).flat_map(|i| a[i][3..].to_vec()));
        (a, params)
    });
}

#[test]
fn metrics_of_extended_poses_are_solved_to_all_digits_or_refused() {
    use extended_pose::Prepared;
    sweep::<Prepared, Prepared<DoubleDouble>, Prepared<Dual<DoubleDouble>>, 9>(200, 2, |random| {
        let a = metric(random, 9);
        let params = (0..9).flat_map(|i| a[i][i..].to_vec()).collect();
        (a, params)
    });
}
