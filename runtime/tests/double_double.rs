//! Double-double numbers against correctly rounded ones of 240 bits (crate `dashu-float`).

use dashu_float::FBig;
use hamel_runtime::{DoubleDouble, Real};

const PRECISION: usize = 240;

fn big(x: f64) -> FBig {
    FBig::try_from(x).unwrap().with_precision(PRECISION).value()
}

fn exact(x: DoubleDouble) -> FBig {
    big(x.hi()) + big(x.lo())
}

/// The relative error of a result.
fn error(value: DoubleDouble, expected: &FBig) -> f64 {
    assert!(value.all_finite(), "{value:?} for {expected}");
    ((exact(value) - expected) / expected).to_f64().value().abs()
}

/// Numbers of both signs with 106 random bits, in `[2^lowest, 2^highest)`; always the same ones.
fn numbers(lowest: i32, highest: i32) -> impl Iterator<Item = DoubleDouble> {
    (1..=150_u64).map(move |k| {
        let bits = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let unit = |bits: u64| (bits >> 11) as f64 / (1_u64 << 53) as f64;
        let span = (highest - lowest) as u64;
        let power = 2.0_f64.powi(lowest + (bits.rotate_left(23) % span) as i32);
        let sign = if bits & 1 == 0 { power } else { -power };
        DoubleDouble::sum_of(sign * (1.0 + unit(bits)), sign * (unit(bits.rotate_left(32)) - 0.5) * 1e-16)
    })
}

fn check(label: &str, bound: f64, errors: impl Iterator<Item = f64>) {
    let worst = errors.fold(0.0, f64::max);
    println!("{label}: {worst:.1e}");
    // An error of zero would say that nothing was compared.
    assert!(worst > 1e-33 && worst < bound, "{label}: {worst:e}");
}

#[test]
fn arithmetic_is_correct_to_1e_31() {
    let pairs = || numbers(-60, 60).zip(numbers(-50, 50).skip(7));
    check("+", 1e-31, pairs().map(|(x, y)| error(x + y, &(exact(x) + exact(y)))));
    check("-", 1e-31, pairs().map(|(x, y)| error(x - y, &(exact(x) - exact(y)))));
    check("*", 1e-31, pairs().map(|(x, y)| error(x * y, &(exact(x) * exact(y)))));
    check("/", 1e-31, pairs().map(|(x, y)| error(x / y, &(exact(x) / exact(y)))));
    let ratios = (1..200).map(|p| (f64::from(p * p), f64::from(7 * p + 1)));
    check("ratio", 1e-31, ratios.map(|(p, q)| error(DoubleDouble::ratio(p, q), &(big(p) / big(q)))));
    // Sums cancel to all digits, and products are split without overflow.
    let (x, y) = (DoubleDouble::sum_of(1e16, 0.3), DoubleDouble::sum_of(-1e16, 2.0_f64.powi(-60)));
    assert_eq!((x + y).hi(), 0.3 + 2.0_f64.powi(-60));
    assert!(error(DoubleDouble::from(1e305) * 0.3.into(), &(big(1e305) * big(0.3))) < 1e-31);
}

#[test]
fn functions_are_correct_to_2e_31() {
    macro_rules! functions {
        ($($name:ident: $numbers:expr;)*) => {$(
            check(stringify!($name), 2e-31, $numbers.map(|x| error(Real::$name(x), &exact(x).$name())));
        )*};
    }
    let positive = |lowest, highest| numbers(lowest, highest).map(Real::abs);
    let near_one = || numbers(-60, -1).map(|d| DoubleDouble::ONE - d.abs());
    let near_zeros = || (1..2000).step_by(7).map(|n| (f64::from(n) * std::f64::consts::FRAC_PI_2).into());
    functions! {
        sqrt: positive(-100, 100);
        sin: numbers(-60, 30);
        sin: near_zeros();
        cos: numbers(-60, 30);
        cos: near_zeros();
        tan: numbers(-60, 30);
        asin: numbers(-60, 0);
        asin: near_one();
        acos: numbers(-60, 0);
        acos: near_one();
        atan: numbers(-60, 60);
        exp: numbers(-60, 9);
        ln: positive(-900, 900);
        ln: numbers(-60, -1).map(|d| DoubleDouble::ONE + d);
        sinh: numbers(-60, 9);
        cosh: numbers(-60, 9);
        tanh: numbers(-60, 9);
    }
    let pairs = numbers(-60, 60).zip(numbers(-50, 50).skip(7));
    check("atan2", 2e-31, pairs.map(|(y, x)| error(y.atan2(x), &exact(y).atan2(&exact(x)))));
}

#[test]
fn special_values_are_those_of_f64() {
    let new = DoubleDouble::from;
    let special =
        [0.0, -0.0, 1.0, -2.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300, 1e-270, -800.0, 1e-160];
    let same = |label: &str, value: DoubleDouble, expected: f64| {
        let close = (value.hi() - expected).abs() <= 1e-15 * expected.abs();
        let equal = value.hi() == expected && value.hi().is_sign_negative() == expected.is_sign_negative();
        assert!(
            equal || close && expected != 0.0 || value.hi().is_nan() && expected.is_nan(),
            "{label}: {value:?} and {expected:e}"
        );
        assert!(!value.lo().is_nan() || value.hi().is_nan(), "{label}: {value:?}");
    };
    for x in special {
        macro_rules! functions {
            ($($name:ident)*) => {$( same(&format!("{} {x:e}", stringify!($name)), new(x).$name(), Real::$name(x)); )*};
        }
        functions! { sqrt asin acos atan exp ln sinh cosh tanh abs recip }
        if x.abs() < 1e15 || !x.is_finite() {
            functions! { sin cos tan }
        }
        for y in special {
            same(&format!("{x:e} + {y:e}"), new(x) + new(y), x + y);
            same(&format!("{x:e} - {y:e}"), new(x) - new(y), x - y);
            same(&format!("{x:e} * {y:e}"), new(x) * new(y), x * y);
            same(&format!("{x:e} / {y:e}"), new(x) / new(y), x / y);
            same(&format!("atan2 {x:e} {y:e}"), new(x).atan2(new(y)), x.atan2(y));
        }
    }
    assert!(new(1e16).sin().hi().is_nan(), "no digits are made up");
}

#[test]
fn numbers_are_ordered_by_all_their_digits() {
    let (x, y) = (DoubleDouble::ONE, DoubleDouble::sum_of(1.0, 1e-25));
    assert!(y.all_gt(x) && y.all_ge(x) && !x.all_ge(y) && x.all_ne(y) && y.all_ge(y));
    assert!(!DoubleDouble::from(f64::NAN).all_ge(x) && DoubleDouble::from(f64::NAN).all_ne(x));
    assert_eq!((-y).magnitude(), 1.0);
}

#[test]
fn numbers_are_printed_in_decimal() {
    let print = |x: f64| DoubleDouble::from(x).to_string();
    assert_eq!(print(0.1), "1.000000000000000055511151231258e-1");
    assert_eq!(print(-1e22), "-1.000000000000000000000000000000e22");
    assert_eq!(print(f64::MAX), "1.797693134862315708145274237317e308");
    assert_eq!((print(0.0), print(-0.0), print(f64::NAN)), ("0".into(), "-0".into(), "NaN".into()));
    assert_eq!(format!("{:.3} {:.0}", DoubleDouble::from(9.9999), DoubleDouble::from(26.0)), "1.000e1 3e1");
    assert_eq!(DoubleDouble::ratio(2.0, 3.0).to_string(), "6.666666666666666666666666666667e-1");
    assert_eq!(DoubleDouble::ONE.atan().to_string(), "7.853981633974483096156608458199e-1");
    // The angles of the points (3, 2), (-3, 2), (-3, -2), (3, -2).
    let [acute, obtuse] = ["5.880026035475675512456110806251e-1", "2.553590050042225687217032302654e0"];
    for (y, x, size) in [(2.0, 3.0, acute), (2.0, -3.0, obtuse), (-2.0, -3.0, obtuse), (-2.0, 3.0, acute)] {
        let angle = DoubleDouble::from(y).atan2(DoubleDouble::from(x));
        let sign = if y < 0.0 { "-" } else { "" };
        assert_eq!(angle.to_string(), format!("{sign}{size}"), "atan2({y}, {x})");
    }
}
