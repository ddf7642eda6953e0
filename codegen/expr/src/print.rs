//! Expressions as text: the model language's own spelling, Unicode for reading, LaTeX for papers, MathML for pages.

use std::collections::HashMap;

use num_traits::{One, Signed};

use super::graph::Graph;
use super::node::{ExprId, Func, Node};
use super::rational::Rational;

/// How an expression is spelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// `1/2*I1*Omega1^2`, readable by the model language.
    Plain,
    /// `½ I₁ Ω₁²`.
    Unicode,
    /// `\tfrac{1}{2} I_{1} \Omega_{1}^{2}`.
    Latex,
    /// `<msup><mi>x</mi><mn>2</mn></msup>`: the inside of a `math` element, in the presentation elements of MathML
    /// Core.
    MathMl,
}

/// How tightly a piece of text holds together.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Binding {
    Sum,
    Product,
    Power,
    Atom,
}

#[derive(Clone)]
struct Text {
    text: String,
    binding: Binding,
}

const GREEK: [(&str, &str); 36] = [
    ("alpha", "α"),
    ("beta", "β"),
    ("gamma", "γ"),
    ("delta", "δ"),
    ("epsilon", "ε"),
    ("zeta", "ζ"),
    ("eta", "η"),
    ("theta", "θ"),
    ("iota", "ι"),
    ("kappa", "κ"),
    ("lambda", "λ"),
    ("mu", "μ"),
    ("nu", "ν"),
    ("xi", "ξ"),
    ("pi", "π"),
    ("rho", "ρ"),
    ("sigma", "σ"),
    ("tau", "τ"),
    ("upsilon", "υ"),
    ("phi", "φ"),
    ("chi", "χ"),
    ("psi", "ψ"),
    ("omega", "ω"),
    ("Gamma", "Γ"),
    ("Delta", "Δ"),
    ("Theta", "Θ"),
    ("Lambda", "Λ"),
    ("Xi", "Ξ"),
    ("Pi", "Π"),
    ("Sigma", "Σ"),
    ("Upsilon", "Υ"),
    ("Phi", "Φ"),
    ("Psi", "Ψ"),
    ("Omega", "Ω"),
    ("ell", "ℓ"),
    ("hbar", "ħ"),
];

fn script(digits: &str, table: [char; 10], minus: char) -> Option<String> {
    digits
        .chars()
        .map(|c| match c {
            '-' => Some(minus),
            c => c.to_digit(10).map(|d| table[d as usize]),
        })
        .collect()
}

fn subscript(text: &str) -> Option<String> {
    script(text, ['₀', '₁', '₂', '₃', '₄', '₅', '₆', '₇', '₈', '₉'], '₋')
}

fn superscript(text: &str) -> Option<String> {
    script(text, ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'], '⁻')
}

/// Begins a name that is spelled in its style already, such as `<beta, a(eta, f)>` for people: no name of a model or of
/// a definition begins with it.
pub const SPELLED: char = '\'';

/// Spells an identifier such as `Omega1`, `theta_dot` or `p_Omega1` in a style: Ω₁, θ̇, p_Ω₁.
///
/// `dot` after a part, or in front of the first one, is a time derivative of it. `X1|phi=0` is the value of `X1` where
/// `phi` is zero. What follows [`SPELLED`] stands as it is.
pub fn identifier(name: &str, style: Style) -> String {
    if style == Style::Plain {
        return name.to_owned();
    }
    if let Some(text) = name.strip_prefix(SPELLED) {
        return text.to_owned();
    }
    if let Some((head, place)) = name.split_once('|') {
        return at_place(&identifier(head, style), place, style);
    }
    let mut parts: Vec<(&str, usize)> = Vec::new();
    let mut pending = 0;
    for part in name.split('_').filter(|part| !part.is_empty()) {
        match (part, parts.last_mut()) {
            ("dot", Some((_, dots))) => *dots += 1,
            ("dot", None) => pending += 1,
            _ => parts.push((part, std::mem::take(&mut pending))),
        }
    }
    let spelled = |(part, dots): &(&str, usize)| {
        let (stem, digits) = stem_and_digits(part);
        with_digits(dotted(letter(stem, style), *dots, style), digits, style)
    };
    let Some((first, rest)) = parts.split_first() else { return letter(name, style) };
    let tail: Vec<String> = rest.iter().map(spelled).collect();
    match (style, tail.is_empty()) {
        (_, true) => spelled(first),
        (Style::Latex, false) => {
            let (stem, digits) = stem_and_digits(first.0);
            let own = (!digits.is_empty()).then(|| digits.to_owned());
            let index: Vec<String> = own.into_iter().chain(tail).collect();
            format!("{}_{{{}}}", dotted(letter(stem, style), first.1, style), index.join(","))
        }
        (Style::MathMl, false) => {
            let (stem, digits) = stem_and_digits(first.0);
            let own = (!digits.is_empty()).then(|| format!("<mn>{digits}</mn>"));
            let index: Vec<String> = own.into_iter().chain(tail).collect();
            let stem = dotted(letter(stem, style), first.1, style);
            format!("<msub>{stem}<mrow>{}</mrow></msub>", index.join("<mo>,</mo>"))
        }
        _ => format!("{}_{}", spelled(first), tail.join(",")),
    }
}

/// A value at a place such as `phi=0,psi=0`.
fn at_place(head: &str, place: &str, style: Style) -> String {
    let equations = place.split(',').map(|equation| {
        let (name, value) = equation.split_once('=').unwrap_or((equation, ""));
        match style {
            Style::MathMl => format!("{}<mo>=</mo><mn>{value}</mn>", identifier(name, style)),
            _ => format!("{}={value}", identifier(name, style)),
        }
    });
    let equations: Vec<String> = equations.collect();
    match style {
        Style::Latex => format!("\\left.{head}\\right|_{{{}}}", equations.join(",")),
        Style::MathMl => {
            let place = equations.join("<mo>,</mo>");
            format!("<msub><mrow>{head}<mo>|</mo></mrow><mrow>{place}</mrow></msub>")
        }
        _ => format!("{head}({})", equations.join(", ")),
    }
}

fn dotted(stem: String, dots: usize, style: Style) -> String {
    match (dots, style) {
        (0, _) => stem,
        (1, Style::Latex) => format!("\\dot{{{stem}}}"),
        (_, Style::Latex) => format!("\\ddot{{{stem}}}"),
        (1, Style::MathMl) => format!("<mover accent=\"true\">{stem}<mo>˙</mo></mover>"),
        (_, Style::MathMl) => format!("<mover accent=\"true\">{stem}<mo>¨</mo></mover>"),
        (1, _) => format!("{stem}\u{307}"),
        (_, _) => format!("{stem}\u{308}"),
    }
}

fn stem_and_digits(part: &str) -> (&str, &str) {
    part.split_at(part.trim_end_matches(|c: char| c.is_ascii_digit()).len())
}

fn letter(stem: &str, style: Style) -> String {
    let greek = GREEK.iter().find(|(word, _)| *word == stem);
    match (greek, style) {
        (Some((_, letter)), Style::Unicode) => (*letter).to_owned(),
        (Some((_, letter)), Style::MathMl) => format!("<mi>{letter}</mi>"),
        (None, Style::MathMl) => {
            if stem.is_empty() {
                String::new()
            } else {
                format!("<mi>{stem}</mi>")
            }
        }
        (Some((word, _)), _) => format!("\\{word}"),
        (None, Style::Latex) if stem.chars().count() > 1 => format!("\\mathrm{{{stem}}}"),
        _ => stem.to_owned(),
    }
}

fn with_digits(stem: String, digits: &str, style: Style) -> String {
    match style {
        _ if digits.is_empty() => stem,
        Style::MathMl if stem.is_empty() => format!("<mn>{digits}</mn>"),
        _ if stem.is_empty() => digits.to_owned(),
        Style::MathMl => format!("<msub>{stem}<mn>{digits}</mn></msub>"),
        Style::Latex => format!("{stem}_{{{digits}}}"),
        _ => format!("{stem}{}", subscript(digits).unwrap_or_else(|| digits.to_owned())),
    }
}

/// Longest text of an expression: what is shared in the graph is written out each time, twice as much with every level.
const MAX_TEXT: usize = 1 << 20;
/// Bytes of all parts of one text together, after which no part is longer than [`SHORT_TEXT`].
const MAX_TEXTS: usize = 1 << 25;
const SHORT_TEXT: usize = 1 << 8;

impl Graph {
    /// The expression as text; an ellipsis stands for parts of more than a million characters.
    pub fn display(&self, e: ExprId, style: Style) -> String {
        let mut memo: HashMap<ExprId, Text> = HashMap::new();
        let mut n_bytes = 0;
        for e in self.reachable(&[e]) {
            let mut text = self.text_of(e, style, &memo);
            if text.text.len() > if n_bytes > MAX_TEXTS { SHORT_TEXT } else { MAX_TEXT } {
                let ellipsis = match style {
                    Style::Plain => "..",
                    Style::Unicode => "…",
                    Style::Latex => "\\ldots",
                    Style::MathMl => "<mo>…</mo>",
                };
                text = Text { text: ellipsis.to_owned(), binding: Binding::Atom };
            }
            n_bytes += text.text.len();
            memo.insert(e, text);
        }
        memo.remove(&e).map(|t| t.text).unwrap_or_default()
    }

    fn text_of(&self, e: ExprId, style: Style, memo: &HashMap<ExprId, Text>) -> Text {
        let atom = |text: String| Text { text, binding: Binding::Atom };
        match self.node(e) {
            Node::Constant(c) => constant_text(c, style),
            Node::Pi => atom(match style {
                Style::Plain => "pi".into(),
                Style::Unicode => "π".into(),
                Style::Latex => "\\pi".into(),
                Style::MathMl => "<mi>π</mi>".into(),
            }),
            Node::Symbol(s) => atom(identifier(self.name(*s), style)),
            Node::Sum { constant, terms } => self.sum_text(constant, terms, style, memo),
            Node::Product { coefficient, factors } => self.product_text(coefficient, factors, style, memo),
            Node::Function(Func::Stumpff(k), z) => atom(match style {
                Style::Latex => format!("c_{{{k}}}\\left({}\\right)", memo[z].text),
                Style::MathMl => format!(
                    "<mrow><msub><mi>c</mi><mn>{k}</mn></msub><mo>&#x2061;</mo>{}</mrow>",
                    parenthesised(&memo[z].text, style)
                ),
                Style::Unicode | Style::Plain => format!("stumpff{k}({})", memo[z].text),
            }),
            Node::Function(Func::Turn(k), w) => atom(match style {
                Style::Latex => format!("\\tau_{{{k}}}\\left({}\\right)", memo[w].text),
                Style::MathMl => format!(
                    "<mrow><msub><mi>τ</mi><mn>{k}</mn></msub><mo>&#x2061;</mo>{}</mrow>",
                    parenthesised(&memo[w].text, style)
                ),
                Style::Unicode | Style::Plain => format!("turn{k}({})", memo[w].text),
            }),
            Node::Function(f, a) => atom(match style {
                Style::Latex => format!("\\{}\\left({}\\right)", latex_function(f.name()), memo[a].text),
                Style::MathMl => {
                    format!(
                        "<mrow><mi>{}</mi><mo>&#x2061;</mo>{}</mrow>",
                        f.name(),
                        parenthesised(&memo[a].text, style)
                    )
                }
                _ => format!("{}({})", f.name(), memo[a].text),
            }),
            Node::Atan2(y, x) => {
                let (y, x) = (&memo[y].text, &memo[x].text);
                atom(match style {
                    Style::Latex => format!("\\operatorname{{atan2}}\\left({y},\\, {x}\\right)"),
                    Style::MathMl => {
                        let both = format!("{y}<mo>,</mo>{x}");
                        format!("<mrow><mi>atan2</mi><mo>&#x2061;</mo>{}</mrow>", parenthesised(&both, style))
                    }
                    _ => format!("atan2({y}, {x})"),
                })
            }
        }
    }

    fn sum_text(
        &self,
        constant: &Rational,
        terms: &[(ExprId, Rational)],
        style: Style,
        memo: &HashMap<ExprId, Text>,
    ) -> Text {
        // A positive term goes first when there is one, as one would write it.
        let mut ordered: Vec<&(ExprId, Rational)> = terms.iter().collect();
        ordered.sort_by_key(|(_, q)| q.is_negative());
        let mut text = String::new();
        let mut push = |piece: &str, negative: bool| {
            match (text.is_empty(), negative) {
                (true, true) => text.push_str(minus(style)),
                (true, false) => {}
                (false, true) if style == Style::MathMl => text.push_str(minus(style)),
                (false, false) if style == Style::MathMl => text.push_str("<mo>+</mo>"),
                (false, true) => text.push_str(" - "),
                (false, false) => text.push_str(" + "),
            }
            text.push_str(piece);
        };
        for (term, q) in ordered {
            let magnitude = q.abs();
            let piece = if magnitude.is_one() {
                guarded(&memo[term], Binding::Product, style)
            } else if let Node::Product { factors, .. } = self.node(*term) {
                self.product_text(&magnitude, factors, style, memo).text
            } else {
                let coefficient = constant_text(&magnitude, style);
                join(
                    &[guarded_text(&coefficient, style), guarded(&memo[term], Binding::Product, style)],
                    style,
                )
            };
            push(&piece, q.is_negative());
        }
        if *constant != Rational::from_integer(0.into()) {
            push(&constant_text(&constant.abs(), style).text, constant.is_negative());
        }
        Text { text, binding: Binding::Sum }
    }

    fn product_text(
        &self,
        coefficient: &Rational,
        factors: &[(ExprId, Rational)],
        style: Style,
        memo: &HashMap<ExprId, Text>,
    ) -> Text {
        let magnitude = coefficient.abs();
        let mut above: Vec<String> = Vec::new();
        let mut below: Vec<String> = Vec::new();
        let numerator = Rational::from_integer(magnitude.numer().clone());
        let denominator = Rational::from_integer(magnitude.denom().clone());
        let whole_fraction = factors.iter().any(|(_, q)| q.is_negative());
        if whole_fraction {
            if !numerator.is_one() {
                above.push(constant_text(&numerator, style).text);
            }
            if !denominator.is_one() {
                below.push(constant_text(&denominator, style).text);
            }
        } else if !magnitude.is_one() {
            above.push(guarded_text(&constant_text(&magnitude, style), style));
        }
        for (base, q) in factors {
            let piece = power_text(&memo[base], &q.abs(), style);
            if q.is_negative() { below.push(piece) } else { above.push(piece) }
        }
        let sign = if coefficient.is_negative() { minus(style) } else { "" };
        let numerator_text =
            if above.is_empty() { constant_text(&Rational::one(), style).text } else { join(&above, style) };
        let text = if below.is_empty() {
            numerator_text
        } else if style == Style::Latex {
            format!("\\frac{{{numerator_text}}}{{{}}}", join(&below, style))
        } else if style == Style::MathMl {
            format!("<mfrac><mrow>{numerator_text}</mrow><mrow>{}</mrow></mfrac>", join(&below, style))
        } else if below.len() == 1 {
            format!("{numerator_text}/{}", below[0])
        } else {
            format!("{numerator_text}/({})", join(&below, style))
        };
        Text {
            text: format!("{sign}{text}"),
            binding: if sign.is_empty() { Binding::Product } else { Binding::Sum },
        }
    }
}

fn latex_function(name: &str) -> String {
    match name {
        "sin" | "cos" | "tan" | "exp" | "ln" | "sinh" | "cosh" | "tanh" => name.to_owned(),
        "asin" | "acos" | "atan" => format!("arc{}", &name[1..]),
        _ => format!("operatorname{{{name}}}"),
    }
}

fn constant_text(c: &Rational, style: Style) -> Text {
    if c.is_integer() {
        let binding = if c.is_negative() { Binding::Sum } else { Binding::Atom };
        let text = match style {
            Style::MathMl => {
                format!("{}<mn>{}</mn>", if c.is_negative() { minus(style) } else { "" }, c.abs())
            }
            _ => c.to_string(),
        };
        return Text { text, binding };
    }
    let sign = if c.is_negative() { minus(style) } else { "" };
    let (n, d) = (c.numer().abs(), c.denom());
    let text = match style {
        Style::Latex => format!("{sign}\\tfrac{{{n}}}{{{d}}}"),
        Style::MathMl => format!("{sign}<mfrac><mn>{n}</mn><mn>{d}</mn></mfrac>"),
        Style::Unicode if n.is_one() && *d == 2.into() => format!("{sign}½"),
        _ => format!("{sign}{n}/{d}"),
    };
    let binding = match (style, sign.is_empty()) {
        (_, false) => Binding::Sum,
        (Style::Latex | Style::MathMl, _) => Binding::Atom,
        (Style::Unicode, _) if text == "½" => Binding::Atom,
        _ => Binding::Product,
    };
    Text { text, binding }
}

fn parenthesised(text: &str, style: Style) -> String {
    match style {
        Style::Latex => format!("\\left({text}\\right)"),
        // Parentheses grow around fractions only; without a mathematical font they grow too much around anything.
        Style::MathMl if !text.contains("<mfrac") => {
            format!("<mrow><mo stretchy=\"false\">(</mo>{text}<mo stretchy=\"false\">)</mo></mrow>")
        }
        Style::MathMl => format!("<mrow><mo>(</mo>{text}<mo>)</mo></mrow>"),
        _ => format!("({text})"),
    }
}

/// The sign in front of a negative number; in MathML also the operator between two.
fn minus(style: Style) -> &'static str {
    if style == Style::MathMl { "<mo>−</mo>" } else { "-" }
}

impl Style {
    /// A term without the minus sign that it begins with, or nothing when it begins with none.
    pub fn strip_minus(self, term: &str) -> Option<&str> {
        term.strip_prefix(minus(self))
    }

    /// One more term at the end of a sum.
    pub fn append_term(self, sum: &mut String, term: &str) {
        let (negative, rest) = match self.strip_minus(term) {
            Some(rest) => (true, rest),
            None => (false, term),
        };
        sum.push_str(match (self, negative) {
            (Style::MathMl, true) => minus(self),
            (Style::MathMl, false) => "<mo>+</mo>",
            (_, true) => " - ",
            (_, false) => " + ",
        });
        sum.push_str(rest);
    }

    /// Factors side by side.
    pub fn product(self, factors: &[String]) -> String {
        join(factors, self)
    }
}

fn guarded(piece: &Text, least: Binding, style: Style) -> String {
    if piece.binding < least { parenthesised(&piece.text, style) } else { piece.text.clone() }
}

/// A coefficient in front of other factors: `3/4` needs parentheses in Unicode only, where products are spaces.
fn guarded_text(piece: &Text, style: Style) -> String {
    let least = if style == Style::Unicode { Binding::Atom } else { Binding::Product };
    guarded(piece, least, style)
}

fn power_text(base: &Text, exponent: &Rational, style: Style) -> String {
    if exponent.is_one() {
        return guarded(base, Binding::Power, style);
    }
    let half = Rational::new(1.into(), 2.into());
    if *exponent == half {
        return match style {
            Style::Latex => format!("\\sqrt{{{}}}", base.text),
            Style::Unicode => format!("√({})", base.text),
            Style::MathMl => format!("<msqrt>{}</msqrt>", base.text),
            Style::Plain => format!("sqrt({})", base.text),
        };
    }
    let base = guarded(base, Binding::Atom, style);
    match style {
        Style::Latex => format!("{base}^{{{exponent}}}"),
        Style::MathMl => {
            format!("<msup><mrow>{base}</mrow><mrow>{}</mrow></msup>", constant_text(exponent, style).text)
        }
        Style::Unicode => match superscript(&exponent.to_string()) {
            Some(raised) => format!("{base}{raised}"),
            None => format!("{base}^({exponent})"),
        },
        Style::Plain if exponent.is_integer() => format!("{base}^{exponent}"),
        Style::Plain => format!("{base}^({exponent})"),
    }
}

fn join(pieces: &[String], style: Style) -> String {
    match style {
        Style::Plain => pieces.join("*"),
        Style::Unicode => pieces.join(" "),
        Style::Latex => pieces.join("\\, "),
        Style::MathMl => pieces.join("<mspace width=\"0.17em\"/>"),
    }
}
