//! Numbers as they are written, and their exact sums.
//!
//! Deliberately does not know: XML, robots.

/// How the text of a number stands for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// Decimal digits.
    Decimal,
    /// Decimal digits of an angle in degrees.
    Degrees,
    /// An expression, such as a multiple of pi: it becomes no parameter.
    Expression,
}

/// A number by an expression of the model language, and its rounded value.
#[derive(Clone, Debug)]
pub(crate) struct Number {
    /// As the file has it, in the grammar of the model language.
    pub(crate) text: String,
    /// For decisions; it never reaches a model. In radians.
    pub(crate) value: f64,
    pub(crate) form: Form,
}

impl Number {
    pub(crate) fn zero() -> Number {
        Number { text: "0".into(), value: 0.0, form: Form::Decimal }
    }

    pub(crate) fn one() -> Number {
        Number { text: "1".into(), value: 1.0, form: Form::Decimal }
    }

    pub(crate) fn expression(text: impl Into<String>, value: f64) -> Number {
        Number { text: text.into(), value, form: Form::Expression }
    }

    /// A decimal number: sign, digits, point, exponent. Nothing for other texts, and for numbers beyond doubles.
    pub(crate) fn decimal(written: &str) -> Option<Number> {
        let value: f64 = written.parse().ok().filter(|x: &f64| x.is_finite())?;
        let (sign, rest) = match written.strip_prefix('-') {
            Some(rest) => ("-", rest),
            None => ("", written.strip_prefix('+').unwrap_or(written)),
        };
        let (mantissa, exponent) = match rest.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, Some(exponent)),
            None => (rest, None),
        };
        if mantissa.bytes().all(|b| b == b'0' || b == b'.') {
            return Some(Number::zero());
        }
        // An underflow is no zero.
        if value == 0.0 {
            return None;
        }
        let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let whole = if whole.is_empty() { "0" } else { whole };
        let point = if part.is_empty() { String::new() } else { format!(".{part}") };
        let exponent = exponent.map(|e| format!("e{e}")).unwrap_or_default();
        Some(Number { text: format!("{sign}{whole}{point}{exponent}"), value, form: Form::Decimal })
    }

    /// The same digits as an angle in degrees.
    pub(crate) fn in_degrees(self) -> Number {
        if self.is_zero() {
            return self;
        }
        Number { value: self.value.to_radians(), form: Form::Degrees, ..self }
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.text == "0"
    }

    /// The number in an expression: degrees by pi.
    pub(crate) fn in_radians(&self) -> String {
        match self.form {
            Form::Degrees => format!("{}*pi/180", self.text),
            Form::Decimal | Form::Expression => self.text.clone(),
        }
    }

    /// The expression as a factor or a term: in parentheses where it begins with a sign or is a sum.
    pub(crate) fn factor(&self) -> String {
        let text = self.in_radians();
        match text.starts_with('-') || (self.form == Form::Expression && text.contains([' ', '/'])) {
            true => format!("({text})"),
            false => text,
        }
    }

    pub(crate) fn negative(&self) -> Number {
        if self.is_zero() {
            return self.clone();
        }
        let text = match (self.form, self.text.strip_prefix('-')) {
            (Form::Expression, _) => format!("-{}", self.factor()),
            (_, Some(text)) => text.to_owned(),
            (_, None) => format!("-{}", self.text),
        };
        Number { text, value: -self.value, form: self.form }
    }

    /// The exact sum: a decimal number, or a sum where that has more digits than fit 38.
    pub(crate) fn plus(&self, other: &Number) -> Number {
        if self.is_zero() || other.is_zero() {
            return if self.is_zero() { other.clone() } else { self.clone() };
        }
        let value = self.value + other.value;
        let exact = || {
            let (a, b) = (Digits::of(self)?, Digits::of(other)?);
            let exponent = a.exponent.min(b.exponent);
            let sum = a.at(exponent)?.checked_add(b.at(exponent)?)?;
            Some(Digits { mantissa: sum, exponent })
        };
        match exact() {
            Some(sum) => Number { text: sum.text(), value, form: Form::Decimal },
            None => Number::expression(format!("{} + {}", self.factor(), other.factor()), value),
        }
    }

    pub(crate) fn minus(&self, other: &Number) -> Number {
        self.plus(&other.negative())
    }

    /// The exact half.
    pub(crate) fn half(&self) -> Number {
        let exact = || {
            let digits = Digits::of(self)?;
            let mantissa = digits.mantissa.checked_mul(5)?;
            Some(Digits { mantissa, exponent: digits.exponent - 1 })
        };
        match exact() {
            Some(half) => Number { text: half.text(), value: self.value / 2.0, form: Form::Decimal },
            None => Number::expression(format!("{}/2", self.factor()), self.value / 2.0),
        }
    }

    /// Whether both are one number by their digits.
    pub(crate) fn equals(&self, other: &Number) -> bool {
        self.minus(other).is_zero()
    }

    /// Digits behind the point.
    pub(crate) fn n_decimals(&self) -> i32 {
        let (mantissa, exponent) = self.text.split_once('e').unwrap_or((&self.text, "0"));
        let n = mantissa.split_once('.').map_or(0, |(_, part)| part.len());
        i32::try_from(n).unwrap_or(i32::MAX).saturating_sub(exponent.parse().unwrap_or(0))
    }
}

/// `mantissa 10^exponent`.
struct Digits {
    mantissa: i128,
    exponent: i32,
}

impl Digits {
    fn of(number: &Number) -> Option<Digits> {
        if number.form != Form::Decimal {
            return None;
        }
        let (mantissa, exponent) = number.text.split_once('e').unwrap_or((&number.text, "0"));
        let exponent: i32 = exponent.parse().ok()?;
        let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let mantissa = format!("{whole}{part}").parse().ok()?;
        Some(Digits { mantissa, exponent: exponent.checked_sub(i32::try_from(part.len()).ok()?)? })
    }

    /// The mantissa for a smaller exponent.
    fn at(&self, exponent: i32) -> Option<i128> {
        let power = u32::try_from(self.exponent.checked_sub(exponent)?).ok()?;
        self.mantissa.checked_mul(10i128.checked_pow(power)?)
    }

    fn text(mut self) -> String {
        if self.mantissa == 0 {
            return "0".to_owned();
        }
        while self.mantissa % 10 == 0 && self.exponent < 0 {
            self.mantissa /= 10;
            self.exponent += 1;
        }
        let sign = if self.mantissa < 0 { "-" } else { "" };
        let digits = self.mantissa.unsigned_abs().to_string();
        let n = self.exponent.unsigned_abs() as usize;
        match self.exponent {
            0 => format!("{sign}{digits}"),
            -40..0 => {
                let digits = format!("{digits:0>width$}", width = n + 1);
                let (whole, part) = digits.split_at(digits.len() - n);
                format!("{sign}{whole}.{part}")
            }
            e => format!("{sign}{digits}e{e}"),
        }
    }
}

/// Zero as a vector is written.
pub(crate) const ZERO: &str = "[0, 0, 0]";

/// A vector of the model language.
pub(crate) fn vector(entries: &[Number]) -> String {
    let entries: Vec<String> = entries.iter().map(Number::in_radians).collect();
    format!("[{}]", entries.join(", "))
}

pub(crate) fn zeros<const N: usize>() -> [Number; N] {
    std::array::from_fn(|_| Number::zero())
}

#[cfg(test)]
mod tests {
    use super::Number;

    fn of(written: &str) -> Number {
        Number::decimal(written).unwrap()
    }

    #[test]
    fn numbers_stay_as_they_are_written() {
        for (written, text) in [
            ("0.10", "0.10"),
            ("-.5", "-0.5"),
            ("+2.", "2"),
            ("1E-3", "1e-3"),
            ("-0.000", "0"),
            ("123456789.123456789123456789", "123456789.123456789123456789"),
        ] {
            assert_eq!(of(written).text, text);
        }
        for wrong in ["", "nan", "inf", "1e999", "1e-999", "0x1", "1,5", "1.0.0", "-"] {
            assert!(Number::decimal(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn sums_and_halves_are_exact() {
        for (a, b, sum) in [
            ("0.1", "0.2", "0.3"),
            ("-0.6", "0.25", "-0.35"),
            ("1.25", "-1.250", "0"),
            ("1e-3", "2", "2.001"),
            ("1e3", "5", "1005"),
            ("0.70000000000000007", "-0.7", "0.00000000000000007"),
            ("1e300", "0.1", "1e300 + 0.1"),
        ] {
            assert_eq!(of(a).plus(&of(b)).text, sum, "{a} + {b}");
        }
        assert_eq!(of("-0.05").half().text, "-0.025");
        assert_eq!(of("3").half().text, "1.5");
        assert!(of("0.50").equals(&of(".5")) && !of("0.5").equals(&of("-0.5")));
        assert_eq!(of("-30").in_degrees().in_radians(), "-30*pi/180");
    }
}
