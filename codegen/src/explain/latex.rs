//! Prose and long formulas in LaTeX, as pdflatex takes them.
//!
//! Does not know: what is said.

use std::fmt::Write as _;

/// Visible characters of a line of a formula.
const WIDTH: usize = 90;
/// Rows of one environment: TeX reads all of it at once.
const ROWS: usize = 40;

/// A text in which everything stands for itself.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars().filter(|c| *c != '`') {
        match c {
            '{' | '}' | '$' => {
                out.push('\\');
                out.push(c);
            }
            '\\' => out.push_str("\\textbackslash{}"),
            c => push(&mut out, c),
        }
    }
    out
}

/// A line of sentences, formulas between dollars and commands: what is neither stands for itself.
pub(super) fn line(text: &str) -> String {
    let mut out = String::new();
    let mut is_math = false;
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '\\' => {
                out.push(c);
                // The character of a command such as `\_`, and the first of one such as `\dot`.
                out.extend(chars.next());
            }
            '$' => {
                is_math = !is_math;
                out.push(c);
            }
            c if is_math => push_math(&mut out, c),
            c => push(&mut out, c),
        }
    }
    out
}

/// A character of a text; braces, backslashes and dollars are left to the caller.
fn push(out: &mut String, c: char) {
    match c {
        '_' | '&' | '%' | '#' => {
            out.push('\\');
            out.push(c);
        }
        '^' => out.push_str("\\^{}"),
        '~' => out.push_str("\\~{}"),
        '<' | '>' | '|' => {
            let _ = write!(out, "${c}$");
        }
        c if c.is_ascii() => out.push(c),
        c => match (command(c), accent(c)) {
            (Some(command), _) => {
                let _ = write!(out, "${command}$");
            }
            (None, Some(text)) => out.push_str(text),
            (None, None) if is_latin(c) => out.push(c),
            (None, None) => {
                let _ = write!(out, "[U+{:04X}]", c as u32);
            }
        },
    }
}

fn push_math(out: &mut String, c: char) {
    match command(c) {
        Some(command) => {
            let _ = write!(out, "{{{command}}}");
        }
        None => out.push(c),
    }
}

/// Letters with accents that pdflatex has in every font.
fn is_latin(c: char) -> bool {
    matches!(c, 'À'..='Å' | 'Ç'..='Ï' | 'Ñ'..='Ö' | 'Ø'..='Ý' | 'ß'..='å' | 'ç'..='ï' | 'ñ'..='ö' | 'ø'..='ý' | 'ÿ')
        || matches!(
            c,
            'Ć' | 'ć'
                | 'Č'
                | 'č'
                | 'ě'
                | 'Ł'
                | 'ł'
                | 'ń'
                | 'ő'
                | 'ř'
                | 'Ś'
                | 'ś'
                | 'Š'
                | 'š'
                | 'ű'
                | 'ů'
                | 'ź'
                | 'Ž'
                | 'ž'
        )
}

/// Marks of punctuation as TeX spells them.
fn accent(c: char) -> Option<&'static str> {
    Some(match c {
        '\u{a0}' => "~",
        '–' => "--",
        '—' => "---",
        '‘' => "`",
        '’' => "'",
        '“' => "``",
        '”' => "''",
        '„' => ",,",
        '…' => "\\ldots{}",
        'æ' => "\\ae{}",
        '§' => "\\S{}",
        '\u{307}' | '\u{308}' => "",
        _ => return None,
    })
}

/// The command of mathematics for a character.
fn command(c: char) -> Option<&'static str> {
    Some(match c {
        'α' => "\\alpha",
        'β' => "\\beta",
        'γ' => "\\gamma",
        'δ' => "\\delta",
        'ε' => "\\varepsilon",
        'ζ' => "\\zeta",
        'η' => "\\eta",
        'θ' => "\\theta",
        'ι' => "\\iota",
        'κ' => "\\kappa",
        'λ' => "\\lambda",
        'μ' | 'µ' => "\\mu",
        'ν' => "\\nu",
        'ξ' => "\\xi",
        'π' => "\\pi",
        'ρ' => "\\rho",
        'σ' => "\\sigma",
        'τ' => "\\tau",
        'υ' => "\\upsilon",
        'φ' => "\\phi",
        'χ' => "\\chi",
        'ψ' => "\\psi",
        'ω' => "\\omega",
        'Γ' => "\\Gamma",
        'Δ' => "\\Delta",
        'Θ' => "\\Theta",
        'Λ' => "\\Lambda",
        'Ξ' => "\\Xi",
        'Π' => "\\Pi",
        'Σ' => "\\Sigma",
        'Φ' => "\\Phi",
        'Ψ' => "\\Psi",
        'Ω' => "\\Omega",
        '⁰' => "^0",
        '¹' => "^1",
        '²' => "^2",
        '³' => "^3",
        '⁴' => "^4",
        '⁵' => "^5",
        '⁶' => "^6",
        '⁷' => "^7",
        '⁸' => "^8",
        '⁹' => "^9",
        '⁻' => "^-",
        '₀' => "_0",
        '₁' => "_1",
        '₂' => "_2",
        '₃' => "_3",
        '₄' => "_4",
        '₅' => "_5",
        '₆' => "_6",
        '₇' => "_7",
        '₈' => "_8",
        '₉' => "_9",
        '·' | '⋅' => "\\cdot",
        '×' => "\\times",
        '÷' => "\\div",
        '±' => "\\pm",
        '−' => "-",
        '°' => "^\\circ",
        '√' => "\\surd",
        '∂' => "\\partial",
        '∇' => "\\nabla",
        '∫' => "\\int",
        '∞' => "\\infty",
        '∈' => "\\in",
        '⊃' => "\\supset",
        '⊂' => "\\subset",
        '⊕' => "\\oplus",
        '⊗' => "\\otimes",
        '→' => "\\to",
        '↦' => "\\mapsto",
        '≤' => "\\le",
        '≥' => "\\ge",
        '≠' => "\\ne",
        '≈' => "\\approx",
        '≡' => "\\equiv",
        '⟨' => "\\langle",
        '⟩' => "\\rangle",
        'ℝ' => "\\mathrm{R}",
        _ => return None,
    })
}

/// Formulas in rows of left and right sides, aligned at the signs of equality.
pub(super) fn aligned(rows: &[(String, String)]) -> String {
    let rows: Vec<String> =
        rows.iter().map(|(left, right)| format!("  {left} &= {}", broken(right))).collect();
    environments(&rows)
}

/// Rows in as many environments as they need.
pub(super) fn environments(rows: &[String]) -> String {
    let one = |rows: &[String]| format!("\\begin{{align*}}\n{}\n\\end{{align*}}\n", rows.join(" \\\\\n"));
    rows.chunks(ROWS).map(one).collect()
}

/// A sum over several lines where one is too long.
fn broken(formula: &str) -> String {
    let mut lines: Vec<String> = vec![String::new()];
    let mut length = 0;
    for term in terms(formula) {
        let n = visible(term);
        let is_new = length > 0 && length + n > WIDTH;
        match lines.last_mut() {
            Some(line) if !is_new => line.push_str(term),
            _ => lines.push(term.trim_start().to_owned()),
        }
        length = if is_new { n } else { length + n };
    }
    lines.join(" \\\\\n  &\\quad ")
}

/// The terms of a sum, each with the sign before it: cut where no bracket is open.
fn terms(formula: &str) -> Vec<&str> {
    let bytes = formula.as_bytes();
    let (mut cuts, mut depth) = (vec![0], 0_usize);
    for (at, byte) in bytes.iter().enumerate() {
        match byte {
            b'{' | b'(' | b'[' => depth += 1,
            b'}' | b')' | b']' => depth = depth.saturating_sub(1),
            b' ' if depth == 0
                && matches!(bytes.get(at + 1), Some(b'+' | b'-'))
                && bytes.get(at + 2) == Some(&b' ') =>
            {
                cuts.push(at);
            }
            _ => {}
        }
    }
    cuts.push(formula.len());
    cuts.windows(2).map(|w| &formula[w[0]..w[1]]).filter(|term| !term.is_empty()).collect()
}

/// About how many characters are seen of a formula: a command counts as one, braces do not.
fn visible(formula: &str) -> usize {
    let (mut n, mut is_command) = (0, false);
    for c in formula.chars() {
        match c {
            '\\' => (n, is_command) = (n + 1, true),
            c if is_command && c.is_ascii_alphabetic() => {}
            '{' | '}' | '_' | '^' | ' ' | ',' => is_command = false,
            _ => (n, is_command) = (n + 1, false),
        }
    }
    n
}

#[cfg(test)]
mod tests {
    use super::{broken, escape, line};

    #[test]
    fn everything_in_a_text_stands_for_itself() {
        assert_eq!(
            escape("a_b & {c} 5% #1 $x$ ^~\\"),
            "a\\_b \\& \\{c\\} 5\\% \\#1 \\$x\\$ \\^{}\\~{}\\textbackslash{}"
        );
        assert_eq!(escape("Poincaré: ω → `x²` < 中"), "Poincaré: $\\omega$ $\\to$ x$^2$ $<$ [U+4E2D]");
    }

    #[test]
    fn lines_keep_their_formulas_and_commands() {
        assert_eq!(
            line("p_1 is $p_{1}$, \\_ and ξ = $ξ_1$"),
            "p\\_1 is $p_{1}$, \\_ and $\\xi$ = ${\\xi}_1$"
        );
    }

    #[test]
    fn long_sums_are_broken_between_their_terms() {
        let term = "\\alpha_{1} \\left(x + y\\right) \\sin\\left(\\phi\\right)";
        assert_eq!(broken(term), term);
        let sum = [term; 12].join(" - ");
        let text = broken(&sum);
        assert!(text.matches("\\\\\n  &\\quad - ").count() >= 1, "{text}");
        assert_eq!(text.replace(" \\\\\n  &\\quad ", " "), sum);
    }
}
