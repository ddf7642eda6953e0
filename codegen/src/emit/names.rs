//! Identifiers: legal, unique in their scope, otherwise as the model spells them.

use std::collections::BTreeSet;

/// Words that no identifier can be, and names whose patterns would mean something else than a new binding.
const RESERVED: [&str; 61] = [
    "Err", "INFO", "None", "Ok", "R", "Self", "Some", "_", "abstract", "as", "async", "await", "become",
    "box", "break", "const", "continue", "crate", "do", "dyn", "else", "enum", "extern", "false", "final",
    "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro", "match", "mod", "move", "mut",
    "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super", "trait", "true", "try",
    "type", "typeof", "union", "unsafe", "unsized", "use", "virtual", "where", "while", "yield", "core",
];

/// The names in use in one scope.
#[derive(Clone, Debug, Default)]
pub(super) struct Scope {
    used: BTreeSet<String>,
    n_temporaries: usize,
}

impl Scope {
    /// A scope in which `taken` are in use.
    pub(super) fn with(taken: &[&str]) -> Scope {
        Scope { used: taken.iter().map(|name| (*name).to_owned()).collect(), n_temporaries: 0 }
    }

    /// The identifier for `name`: `type` becomes `type_`, a second `p` becomes `p_2`.
    pub(super) fn add(&mut self, name: &str) -> String {
        let legal = legal(name);
        let mut identifier = legal.clone();
        let mut n = 1;
        while !self.used.insert(identifier.clone()) {
            n += 1;
            identifier = format!("{legal}_{n}");
        }
        identifier
    }

    /// The next of `t0`, `t1`, .. that is free; the prefix is given.
    pub(super) fn temporary(&mut self, prefix: &str) -> String {
        loop {
            let identifier = format!("{prefix}{}", self.n_temporaries);
            self.n_temporaries += 1;
            if self.used.insert(identifier.clone()) {
                return identifier;
            }
        }
    }
}

/// Replaces what cannot stand in an identifier by `_` and moves away from reserved words.
pub(super) fn legal(name: &str) -> String {
    let mut text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit()) {
        text.insert(0, 'x');
    }
    if RESERVED.contains(&text.as_str()) {
        text.push('_');
    }
    text
}

/// Whether the compiler wants another spelling for a variable, field or function of that name.
pub(super) fn is_unusual(identifier: &str) -> bool {
    let trimmed = identifier.trim_matches('_');
    trimmed.contains("__") || trimmed.contains(|c: char| c.is_ascii_uppercase())
}
