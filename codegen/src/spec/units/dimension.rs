//! Dimensions of quantities, and units as they are written in doc comments.
//!
//! A dimension is a product of rational powers of kg, m, s, A, K, mol and cd; an angle has none. Deliberately does not
//! know: models, magnitudes (a millimetre is a length).

use std::fmt;

use num_rational::Ratio;
use num_traits::{CheckedAdd as _, CheckedMul as _, One as _, Signed as _, Zero as _};

/// An exponent; products of exponents that do not fit into it belong to no quantity that anybody measures.
pub(super) type Exponent = Ratio<i64>;

/// Number of base units.
const N: usize = 7;
/// The base units, in the order of exponents.
const BASE: [&str; N] = ["kg", "m", "s", "A", "K", "mol", "cd"];
/// Units with a name: exponents of the base units.
const NAMED: &[(&str, [i64; N])] = &[
    ("g", [1, 0, 0, 0, 0, 0, 0]),
    ("t", [1, 0, 0, 0, 0, 0, 0]),
    ("min", [0, 0, 1, 0, 0, 0, 0]),
    ("h", [0, 0, 1, 0, 0, 0, 0]),
    ("d", [0, 0, 1, 0, 0, 0, 0]),
    ("Hz", [0, 0, -1, 0, 0, 0, 0]),
    ("N", [1, 1, -2, 0, 0, 0, 0]),
    ("J", [1, 2, -2, 0, 0, 0, 0]),
    ("W", [1, 2, -3, 0, 0, 0, 0]),
    ("Pa", [1, -1, -2, 0, 0, 0, 0]),
    ("bar", [1, -1, -2, 0, 0, 0, 0]),
    ("eV", [1, 2, -2, 0, 0, 0, 0]),
    ("C", [0, 0, 1, 1, 0, 0, 0]),
    ("V", [1, 2, -3, -1, 0, 0, 0]),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0]),
    ("S", [-1, -2, 3, 2, 0, 0, 0]),
    ("F", [-1, -2, 4, 2, 0, 0, 0]),
    ("H", [1, 2, -2, -2, 0, 0, 0]),
    ("Wb", [1, 2, -2, -1, 0, 0, 0]),
    ("T", [1, 0, -2, -1, 0, 0, 0]),
];
/// Units of dimension one.
const NONE: [&str; 8] = ["1", "-", "rad", "sr", "deg", "%", "\u{b0}", "turn"];
/// Names that are shown behind the base units.
const SHOWN: [&str; 10] = ["N", "J", "W", "Pa", "C", "V", "Ohm", "F", "Wb", "T"];
/// Prefixes, which change no dimension.
const PREFIXES: [&str; 14] =
    ["da", "k", "M", "G", "T", "m", "u", "\u{b5}", "\u{3bc}", "n", "p", "c", "d", "h"];

/// A product of rational powers of the base units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dimension([Exponent; N]);

impl Dimension {
    /// That of a number.
    pub(super) fn one() -> Dimension {
        Dimension([Exponent::zero(); N])
    }

    /// That of a time.
    pub(super) fn second() -> Dimension {
        Dimension::of([0, 0, 1, 0, 0, 0, 0])
    }

    fn of(exponents: [i64; N]) -> Dimension {
        Dimension(exponents.map(Exponent::from_integer))
    }

    pub(super) fn has_time(&self) -> bool {
        !self.0[2].is_zero()
    }

    pub(super) fn is_one(&self) -> bool {
        self.0.iter().all(num_traits::Zero::is_zero)
    }

    /// `self * other^power`; nothing where an exponent is too long.
    pub(super) fn times(&self, other: &Dimension, power: &Exponent) -> Option<Dimension> {
        let mut product = *self;
        for (mine, theirs) in product.0.iter_mut().zip(&other.0).filter(|(_, theirs)| !theirs.is_zero()) {
            *mine = add_product(mine, theirs, power)?;
        }
        Some(product)
    }

    /// The dimension of a unit such as `kg m^2/s`, `N m`, `1/(kg m)` or `m s^-2`; a slash divides by the next factor
    /// alone. Nothing for a text that is no unit.
    pub(super) fn parse(text: &str) -> Option<Dimension> {
        let mut rest = text.trim();
        let unit = product(&mut rest, 0)?;
        rest.is_empty().then_some(unit)
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
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
            [] => f.write_str(&above)?,
            [one] => write!(f, "{above}/{one}")?,
            several => write!(f, "{above}/({})", several.join(" "))?,
        }
        let is_same = |(_, exponents): &&(&str, [i64; N])| Dimension::of(*exponents) == *self;
        match NAMED.iter().filter(|(name, _)| SHOWN.contains(name)).find(is_same) {
            Some((name, _)) => write!(f, " ({name})"),
            None => Ok(()),
        }
    }
}

/// `a + b*c`.
pub(super) fn add_product(a: &Exponent, b: &Exponent, c: &Exponent) -> Option<Exponent> {
    a.checked_add(&b.checked_mul(c)?)
}

/// The dimension of a word.
fn word(text: &str) -> Option<Dimension> {
    let exact = |text: &str| -> Option<Dimension> {
        if NONE.contains(&text) {
            return Some(Dimension::one());
        }
        if let Some(k) = BASE.iter().position(|base| *base == text) {
            return Some(Dimension::of(std::array::from_fn(|j| i64::from(j == k))));
        }
        NAMED.iter().find(|(name, _)| *name == text).map(|(_, exponents)| Dimension::of(*exponents))
    };
    let prefixed = |prefix: &str| {
        let unit = text.strip_prefix(prefix)?;
        // `kkg` is no unit, and neither is a thousand minutes.
        let is_scalable =
            !matches!(unit, "kg" | "min" | "h" | "d" | "1" | "-" | "%" | "deg" | "\u{b0}" | "turn");
        exact(unit).filter(|_| is_scalable)
    };
    exact(text).or_else(|| PREFIXES.iter().find_map(|prefix| prefixed(prefix)))
}

/// Factors up to a closing parenthesis or the end.
fn product(rest: &mut &str, depth: usize) -> Option<Dimension> {
    let mut unit = Dimension::one();
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

fn factor(rest: &mut &str, depth: usize) -> Option<Dimension> {
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
        Some(power) => Dimension::one().times(&base, &power)?,
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
    use super::Dimension;

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
}
