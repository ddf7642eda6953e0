//! Dimensions of quantities, and units as they are written in doc comments.
//!
//! A dimension is a product of rational powers of kg, m, s, A, K, mol and cd; an angle has none. A unit is a multiple
//! of one, and remembers its angles. Deliberately does not know: models.

use std::f64::consts::PI;
use std::fmt;

use num_rational::Ratio;
use num_traits::{CheckedAdd as _, CheckedMul as _, One as _, Signed as _, ToPrimitive as _, Zero as _};

/// An exponent; products of exponents that do not fit into it belong to no quantity that anybody measures.
pub(in crate::spec) type Exponent = Ratio<i64>;

/// Number of base units.
const N: usize = 7;
/// The base units, in the order of exponents.
const BASE: [&str; N] = ["kg", "m", "s", "A", "K", "mol", "cd"];
/// Units with a name: exponents of the base units, and how many of their product it is.
const NAMED: &[(&str, [i64; N], f64)] = &[
    ("g", [1, 0, 0, 0, 0, 0, 0], 1e-3),
    ("t", [1, 0, 0, 0, 0, 0, 0], 1e3),
    ("min", [0, 0, 1, 0, 0, 0, 0], 60.0),
    ("h", [0, 0, 1, 0, 0, 0, 0], 3600.0),
    ("d", [0, 0, 1, 0, 0, 0, 0], 86400.0),
    ("Hz", [0, 0, -1, 0, 0, 0, 0], 1.0),
    ("N", [1, 1, -2, 0, 0, 0, 0], 1.0),
    ("J", [1, 2, -2, 0, 0, 0, 0], 1.0),
    ("W", [1, 2, -3, 0, 0, 0, 0], 1.0),
    ("Pa", [1, -1, -2, 0, 0, 0, 0], 1.0),
    ("bar", [1, -1, -2, 0, 0, 0, 0], 1e5),
    ("eV", [1, 2, -2, 0, 0, 0, 0], 1.602176634e-19),
    ("C", [0, 0, 1, 1, 0, 0, 0], 1.0),
    ("V", [1, 2, -3, -1, 0, 0, 0], 1.0),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0], 1.0),
    ("S", [-1, -2, 3, 2, 0, 0, 0], 1.0),
    ("F", [-1, -2, 4, 2, 0, 0, 0], 1.0),
    ("H", [1, 2, -2, -2, 0, 0, 0], 1.0),
    ("Wb", [1, 2, -2, -1, 0, 0, 0], 1.0),
    ("T", [1, 0, -2, -1, 0, 0, 0], 1.0),
];
/// Units of dimension one: exponents of the radian, and how many of its power they are.
const NONE: [(&str, i64, f64); 8] = [
    ("1", 0, 1.0),
    ("-", 0, 1.0),
    ("%", 0, 0.01),
    ("rad", 1, 1.0),
    ("sr", 2, 1.0),
    ("deg", 1, PI / 180.0),
    ("\u{b0}", 1, PI / 180.0),
    ("turn", 1, 2.0 * PI),
];
/// Names that are shown behind the base units.
const SHOWN: [&str; 10] = ["N", "J", "W", "Pa", "C", "V", "Ohm", "F", "Wb", "T"];
/// Prefixes, which change no dimension, with what they multiply by.
const PREFIXES: [(&str, f64); 14] = [
    ("da", 10.0),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
    ("T", 1e12),
    ("m", 1e-3),
    ("u", 1e-6),
    ("\u{b5}", 1e-6),
    ("\u{3bc}", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
    ("c", 1e-2),
    ("d", 0.1),
    ("h", 1e2),
];

/// A product of rational powers of the base units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::spec) struct Dimension([Exponent; N]);

impl Dimension {
    /// That of a number.
    pub(in crate::spec) fn one() -> Dimension {
        Dimension([Exponent::zero(); N])
    }

    /// That of a time.
    pub(in crate::spec) fn second() -> Dimension {
        Dimension::of([0, 0, 1, 0, 0, 0, 0])
    }

    fn of(exponents: [i64; N]) -> Dimension {
        Dimension(exponents.map(Exponent::from_integer))
    }

    pub(in crate::spec) fn has_time(&self) -> bool {
        !self.0[2].is_zero()
    }

    pub(in crate::spec) fn is_one(&self) -> bool {
        self.0.iter().all(num_traits::Zero::is_zero)
    }

    /// `self * other^power`; nothing where an exponent is too long.
    pub(in crate::spec) fn times(&self, other: &Dimension, power: &Exponent) -> Option<Dimension> {
        let mut product = *self;
        for (mine, theirs) in product.0.iter_mut().zip(&other.0).filter(|(_, theirs)| !theirs.is_zero()) {
            *mine = add_product(mine, theirs, power)?;
        }
        Some(product)
    }

    /// The dimension of a unit as [`Measure::parse`] reads it.
    pub(in crate::spec) fn parse(text: &str) -> Option<Dimension> {
        Measure::parse(text).map(|unit| unit.dimension)
    }

    /// Exponents of the base units, where all are integers.
    pub(in crate::spec) fn exponents(&self) -> Option<[i64; N]> {
        self.0.iter().all(Exponent::is_integer).then(|| self.0.map(|e| e.to_integer()))
    }

    /// As a product of base units.
    pub(in crate::spec) fn in_base_units(&self) -> String {
        let power = |k: usize, e: &Exponent| match e {
            e if e.is_one() => BASE[k].to_owned(),
            e if e.is_integer() => format!("{}^{e}", BASE[k]),
            e => format!("{}^({e})", BASE[k]),
        };
        let above: Vec<String> =
            (0..N).filter(|k| self.0[*k].is_positive()).map(|k| power(k, &self.0[k])).collect();
        let below: Vec<String> =
            (0..N).filter(|k| self.0[*k].is_negative()).map(|k| power(k, &-self.0[k])).collect();
        let above = if above.is_empty() { "1".to_owned() } else { above.join(" ") };
        match below.as_slice() {
            [] => above,
            [one] => format!("{above}/{one}"),
            several => format!("{above}/({})", several.join(" ")),
        }
    }
}

/// A unit: a multiple of a product of powers of the base units and the radian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::spec) struct Measure {
    pub(in crate::spec) dimension: Dimension,
    /// Exponent of the radian.
    pub(in crate::spec) angle: Exponent,
    /// How many of the product it is.
    pub(in crate::spec) factor: f64,
}

impl Measure {
    /// A product of base units.
    pub(in crate::spec) fn of(dimension: Dimension) -> Measure {
        Measure { dimension, angle: Exponent::zero(), factor: 1.0 }
    }

    /// A unit such as `kg m^2/s`, `N m`, `1/(kg m)` or `m s^-2`; a slash divides by the next factor alone. Nothing for
    /// a text that is no unit.
    pub(in crate::spec) fn parse(text: &str) -> Option<Measure> {
        let mut rest = text.trim();
        let unit = product(&mut rest, 0)?;
        rest.is_empty().then_some(unit)
    }

    /// `self * other^power`; nothing where an exponent is too long.
    fn times(&self, other: &Measure, power: &Exponent) -> Option<Measure> {
        Some(Measure {
            dimension: self.dimension.times(&other.dimension, power)?,
            angle: add_product(&self.angle, &other.angle, power)?,
            factor: self.factor * other.factor.powf(power.to_f64()?),
        })
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.in_base_units())?;
        let is_same = |(_, exponents, _): &&(&str, [i64; N], f64)| Dimension::of(*exponents) == *self;
        match NAMED.iter().filter(|(name, ..)| SHOWN.contains(name)).find(is_same) {
            Some((name, ..)) => write!(f, " ({name})"),
            None => Ok(()),
        }
    }
}

/// `a + b*c`.
pub(in crate::spec) fn add_product(a: &Exponent, b: &Exponent, c: &Exponent) -> Option<Exponent> {
    a.checked_add(&b.checked_mul(c)?)
}

/// The unit of a word.
fn word(text: &str) -> Option<Measure> {
    let exact = |text: &str| -> Option<Measure> {
        if let Some((_, angle, factor)) = NONE.iter().find(|(name, ..)| *name == text) {
            let angle = Exponent::from_integer(*angle);
            return Some(Measure { dimension: Dimension::one(), angle, factor: *factor });
        }
        if let Some(k) = BASE.iter().position(|base| *base == text) {
            return Some(Measure::of(Dimension::of(std::array::from_fn(|j| i64::from(j == k)))));
        }
        let (_, exponents, factor) = NAMED.iter().find(|(name, ..)| *name == text)?;
        Some(Measure { factor: *factor, ..Measure::of(Dimension::of(*exponents)) })
    };
    let prefixed = |(prefix, times): &(&str, f64)| {
        let unit = text.strip_prefix(prefix)?;
        // `kkg` is no unit, and neither is a thousand minutes.
        let is_scalable =
            !matches!(unit, "kg" | "min" | "h" | "d" | "1" | "-" | "%" | "deg" | "\u{b0}" | "turn");
        let unit = exact(unit).filter(|_| is_scalable)?;
        Some(Measure { factor: times * unit.factor, ..unit })
    };
    exact(text).or_else(|| PREFIXES.iter().find_map(prefixed))
}

/// Factors up to a closing parenthesis or the end.
fn product(rest: &mut &str, depth: usize) -> Option<Measure> {
    let mut unit = Measure::of(Dimension::one());
    let (mut is_divided, mut is_empty) = (false, true);
    loop {
        *rest = rest.trim_start();
        if rest.is_empty() || rest.starts_with(')') {
            return (!is_empty && !is_divided).then_some(unit);
        }
        let joined = rest.strip_prefix(['*', '\u{b7}', '/']);
        if let Some(after) = joined.filter(|_| !is_empty) {
            if is_divided {
                return None;
            }
            is_divided = rest.starts_with('/');
            *rest = after.trim_start();
            if rest.is_empty() || rest.starts_with(['*', '\u{b7}', '/', ')']) {
                return None;
            }
        }
        let factor = factor(rest, depth)?;
        let sign = Exponent::from_integer(if std::mem::take(&mut is_divided) { -1 } else { 1 });
        unit = unit.times(&factor, &sign)?;
        is_empty = false;
    }
}

fn factor(rest: &mut &str, depth: usize) -> Option<Measure> {
    let base = if let Some(inside) = rest.strip_prefix('(') {
        if depth == 4 {
            return None;
        }
        *rest = inside;
        let unit = product(rest, depth + 1)?;
        *rest = rest.strip_prefix(')')?;
        unit
    } else {
        let is_end = |c: char| c.is_whitespace() || "*/^()\u{b7}\u{b2}\u{b3}".contains(c);
        let end = rest.find(is_end).unwrap_or(rest.len());
        let unit = word(&rest[..end])?;
        *rest = &rest[end..];
        unit
    };
    Some(match exponent(rest)? {
        Some(power) => Measure::of(Dimension::one()).times(&base, &power)?,
        None => base,
    })
}

/// The exponent in front of the rest; `Some(None)` where there is none.
fn exponent(rest: &mut &str) -> Option<Option<Exponent>> {
    for (mark, power) in [('\u{b2}', 2), ('\u{b3}', 3)] {
        if let Some(after) = rest.strip_prefix(mark) {
            *rest = after;
            return Some(Some(Exponent::from_integer(power)));
        }
    }
    let Some(after) = rest.strip_prefix('^') else { return Some(None) };
    let (text, after) = match after.strip_prefix('(') {
        Some(inside) => inside.split_once(')')?,
        None => {
            let end = after.char_indices().find(|(at, c)| !(c.is_ascii_digit() || (*at == 0 && *c == '-')));
            after.split_at(end.map_or(after.len(), |(at, _)| at))
        }
    };
    *rest = after;
    let small = |text: &str| text.trim().parse::<i8>().ok().map(i64::from);
    let power = match text.split_once('/') {
        Some((above, below)) => {
            let below = small(below).filter(|below| *below > 0)?;
            Exponent::new(small(above)?, below)
        }
        None => Exponent::from_integer(small(text)?),
    };
    Some(Some(power))
}

#[cfg(test)]
mod tests {
    use super::{Dimension, Measure};

    #[test]
    fn units_are_read_and_written() {
        let cases = [
            ("kg m^2", "kg m^2"),
            ("kg*m^2/s", "kg m^2/s"),
            ("N m", "kg m^2/s^2 (J)"),
            ("J", "kg m^2/s^2 (J)"),
            ("rad/s", "1/s"),
            ("1", "1"),
            ("-", "1"),
            ("m/s^2", "m/s^2"),
            ("kg·m²", "kg m^2"),
            ("1/(kg m)", "1/(kg m)"),
            ("mm", "m"),
            ("m s^-2", "m/s^2"),
            ("J/T", "m^2 A"),
            ("V/m", "kg m/(s^3 A)"),
            ("Pa s", "kg/(m s)"),
            ("m^(1/2)", "m^(1/2)"),
            ("N/m", "kg/s^2"),
            ("kN", "kg m/s^2 (N)"),
            ("rad^2", "1"),
        ];
        for (text, shown) in cases {
            assert_eq!(Dimension::parse(text).map(|d| d.to_string()).as_deref(), Some(shown), "{text}");
        }
        for text in
            ["", "SI", "0, 1", "m//s", "/s", "m/", "m)", "(m", "m^", "m^x", "kkg", "m^(1/0)", "kg m^2 of it"]
        {
            assert_eq!(Dimension::parse(text), None, "{text}");
        }
    }

    #[test]
    fn units_are_multiples_of_products_of_base_units() {
        let deg = std::f64::consts::PI / 180.0;
        for (text, exponents, angle, factor) in [
            ("rad/s", [0, 0, -1, 0, 0, 0, 0], 1, 1.0),
            ("kN m", [1, 2, -2, 0, 0, 0, 0], 0, 1e3),
            ("mm^2", [0, 2, 0, 0, 0, 0, 0], 0, 1e-6),
            ("deg/s^2", [0, 0, -2, 0, 0, 0, 0], 1, deg),
            ("km/h", [0, 1, -1, 0, 0, 0, 0], 0, 1e3 / 3600.0),
            ("1/(g min)", [-1, 0, -1, 0, 0, 0, 0], 0, 1e3 / 60.0),
            ("N m/rad", [1, 2, -2, 0, 0, 0, 0], -1, 1.0),
        ] {
            let unit = Measure::parse(text).unwrap();
            assert_eq!(unit.dimension.exponents(), Some(exponents), "{text}");
            assert_eq!((unit.angle.to_integer(), unit.angle.is_integer()), (angle, true), "{text}");
            assert!((unit.factor / factor - 1.0).abs() < 1e-15, "{text}: {}", unit.factor);
        }
        assert_eq!(Dimension::parse("m^(1/2)").unwrap().exponents(), None);
    }
}
