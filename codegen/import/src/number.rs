//! Numbers as they are written.
//!
//! Deliberately does not know: XML, robots.

/// A number by an expression of the model language, and its rounded value.
#[derive(Clone, Debug)]
pub(crate) struct Number {
    /// As the file has it, in the grammar of the model language.
    pub(crate) text: String,
    /// For decisions; it never reaches a model.
    pub(crate) value: f64,
    /// An angle of quarter turns, whose text is a multiple of pi.
    pub(crate) is_quarter: bool,
}

impl Number {
    pub(crate) fn zero() -> Number {
        Number { text: "0".into(), value: 0.0, is_quarter: false }
    }

    pub(crate) fn one() -> Number {
        Number { text: "1".into(), value: 1.0, is_quarter: false }
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
        Some(Number { text: format!("{sign}{whole}{point}{exponent}"), value, is_quarter: false })
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.text == "0"
    }

    /// The text as a factor or a term: in parentheses where it begins with a sign.
    pub(crate) fn factor(&self) -> String {
        match self.text.starts_with('-') {
            true => format!("({})", self.text),
            false => self.text.clone(),
        }
    }

    /// Digits behind the point.
    pub(crate) fn n_decimals(&self) -> i32 {
        let (mantissa, exponent) = self.text.split_once('e').unwrap_or((&self.text, "0"));
        let n = mantissa.split_once('.').map_or(0, |(_, part)| part.len());
        i32::try_from(n).unwrap_or(i32::MAX).saturating_sub(exponent.parse().unwrap_or(0))
    }
}

/// A vector of the model language.
pub(crate) fn vector(entries: &[Number]) -> String {
    let entries: Vec<&str> = entries.iter().map(|n| n.text.as_str()).collect();
    format!("[{}]", entries.join(", "))
}

#[cfg(test)]
mod tests {
    use super::Number;

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
            assert_eq!(Number::decimal(written).unwrap().text, text);
        }
        for wrong in ["", "nan", "inf", "1e999", "1e-999", "0x1", "1,5", "1.0.0", "-"] {
            assert!(Number::decimal(wrong).is_none(), "{wrong}");
        }
    }
}
