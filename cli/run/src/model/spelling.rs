//! Names and sentences as people write them.
//!
//! Does not know: models.

use hamel_expr::{Graph, Style};

/// A name as people write it, such as `Ω₁`.
pub fn spell(name: &str) -> String {
    let mut graph = Graph::new();
    let symbol = graph.symbol(name);
    let symbol = graph.sym(symbol);
    let spelled = graph.display(symbol, Style::Unicode);
    match spelled.rsplit_once('_') {
        Some((head, digits)) if !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()) => {
            const SUBSCRIPTS: [char; 10] = ['₀', '₁', '₂', '₃', '₄', '₅', '₆', '₇', '₈', '₉'];
            let second: String = digits.bytes().map(|b| SUBSCRIPTS[usize::from(b - b'0')]).collect();
            let comma = if head.ends_with(SUBSCRIPTS) { "," } else { "" };
            format!("{head}{comma}{second}")
        }
        _ => spelled,
    }
}

/// A sentence that begins with a capital letter.
pub fn upper_first(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map(|c| c.to_uppercase().chain(chars).collect()).unwrap_or_default()
}

/// A sentence that begins with a small letter.
pub fn lower_first(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map(|c| c.to_lowercase().chain(chars).collect()).unwrap_or_default()
}

/// A name in MathML.
pub fn math_ml(name: &str) -> String {
    let mut graph = Graph::new();
    let symbol = graph.symbol(name);
    let symbol = graph.sym(symbol);
    graph.display(symbol, Style::MathMl)
}

#[cfg(test)]
mod tests {
    use super::spell;

    #[test]
    fn names_are_spelled_with_subscripts() {
        let spelled = ["Omega1", "r1_2", "q_3", "psi_dot"].map(spell);
        assert_eq!(spelled, ["Ω₁", "r₁,₂", "q₃", "ψ̇"]);
    }
}
