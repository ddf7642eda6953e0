//! C of a module in single precision: its text on `double` with every number and every call of `math.h` in `float`.
//!
//! Deliberately does not know: programs, items of a module.

use hamel_expr::error::Error;

/// The numbers of C and C++.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// `double`.
    #[default]
    Double,
    /// `float`, for processors that compute with it alone: the operations of a module of Rust over `f32`.
    Single,
}

/// Functions of `math.h` that have a sister for `float`, whose name ends in `f`.
const FUNCTIONS: [&str; 15] = [
    "sqrt", "fma", "fabs", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sinh",
    "cosh", "tanh",
];

/// The text in single precision. Comments, strings and whole numbers stay as they are; no name of a module is one of C.
///
/// # Errors
/// [`Error::NotSingle`].
pub(super) fn text(double: &str) -> Result<String, Error> {
    let mut single = String::with_capacity(double.len());
    let mut rest = double;
    while let Some(first) = rest.chars().next() {
        let length = token(rest, first);
        let (token, after) = rest.split_at(length);
        match token {
            "double" => single.push_str("float"),
            _ if FUNCTIONS.contains(&token) => {
                single.push_str(token);
                single.push('f');
            }
            _ if is_real(token) => single.push_str(&number(token)?),
            _ => single.push_str(token),
        }
        rest = after;
    }
    Ok(single)
}

/// Length of a comment, a string, a name, a number or of one other character, at the start of a text.
fn token(text: &str, first: char) -> usize {
    let up_to =
        |end: &str, from: usize| text[from..].find(end).map_or(text.len(), |at| from + at + end.len());
    let while_all = |is: fn(char) -> bool| text.find(|c| !is(c)).unwrap_or(text.len());
    match first {
        '/' if text.starts_with("/*") => up_to("*/", 2),
        '/' if text.starts_with("//") => up_to("\n", 2),
        '"' | '\'' => {
            let mut is_escaped = false;
            let end = text.char_indices().skip(1).find(|(_, c)| {
                let is_end = *c == first && !is_escaped;
                is_escaped = *c == '\\' && !is_escaped;
                is_end
            });
            end.map_or(text.len(), |(at, c)| at + c.len_utf8())
        }
        '0'..='9' => {
            let mut length = while_all(|c| is_word(c) || c == '.');
            let has_exponent = !text.starts_with("0x") && text[..length].ends_with('e');
            if has_exponent && text[length..].starts_with(['-', '+']) {
                length += 1 + text[length + 1..].find(|c| !is_word(c)).unwrap_or(text.len() - length - 1);
            }
            length
        }
        'a'..='z' | 'A'..='Z' | '_' => while_all(is_word),
        _ => first.len_utf8(),
    }
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Whether a token is a number with a point or an exponent.
fn is_real(token: &str) -> bool {
    token.starts_with(|c: char| c.is_ascii_digit()) && !token.starts_with("0x") && token.contains(['.', 'e'])
}

/// The number of type `float` that is nearest to one of type `double`.
fn number(double: &str) -> Result<String, Error> {
    // The text is a number of Rust as well, and NaN is none.
    let exact: f64 = double.parse().unwrap_or(f64::NAN);
    #[allow(clippy::cast_possible_truncation, reason = "rounded to the nearest one")]
    let single = exact as f32;
    if !single.is_finite() || (single == 0.0) != (exact == 0.0) {
        let becomes = if single == 0.0 { "zero" } else { "infinite" };
        return Err(Error::NotSingle { number: double.to_owned(), becomes });
    }
    Ok(format!("{single:?}f"))
}

#[cfg(test)]
mod tests {
    use super::text;

    #[test]
    fn numbers_and_calls_are_single_and_comments_stay() {
        let double = "/* a double of 1.5 */\nconst double x[2] = {0.1, 1e-7}; // sqrt(2.0)\n\
                      y = sqrt(fabs(x[0]) + 2.5e3) * 3 + 0x1e2; puts(\"double \\\" 1.0\"); double_1 = v1.x;\n";
        let single = "/* a double of 1.5 */\nconst float x[2] = {0.1f, 1e-7f}; // sqrt(2.0)\n\
                      y = sqrtf(fabsf(x[0]) + 2500.0f) * 3 + 0x1e2; puts(\"double \\\" 1.0\"); double_1 = v1.x;\n";
        assert_eq!(text(double).unwrap(), single);
    }

    /// Also `1 + 2^-24`, in the middle of two numbers.
    #[test]
    fn numbers_are_rounded_as_rust_rounds_them() {
        for x in [0.1, 1.0 / 3.0, 1.000_000_059_604_644_8, 3.402_823_5e38, 1e-45] {
            let single = text(&format!("{x:?}")).unwrap();
            let read: f32 = single.trim_end_matches('f').parse().unwrap();
            assert_eq!(read.to_bits(), (x as f32).to_bits(), "{x}");
        }
    }

    #[test]
    fn numbers_beyond_single_precision_are_refused() {
        for (x, what) in [("1e39", "infinite"), ("1e-46", "zero")] {
            let told = text(x).unwrap_err().to_string();
            assert!(told.contains(&format!("the number {x} is {what} in single precision")), "{told}");
        }
        assert_eq!(text("0.0 1.0").unwrap(), "0.0f 1.0f");
    }
}
