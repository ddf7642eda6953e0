//! Identifiers: legal in the target language, unique in their scope, otherwise as the model spells them.
//!
//! Does not know: any language; a dialect says which words it takes.

use std::collections::BTreeSet;

use super::dialect::Dialect;

/// Characters of the number that makes a shortened name another one.
const ROOM: usize = 8;

/// The names in use in one scope.
#[derive(Clone, Debug)]
pub(super) struct Scope {
    reserved: &'static [&'static str],
    longest: usize,
    used: BTreeSet<String>,
    n_temporaries: usize,
}

impl Scope {
    /// A scope in which `taken` are in use.
    pub(super) fn with<'n>(dialect: &impl Dialect, taken: impl IntoIterator<Item = &'n str>) -> Scope {
        let used = taken.into_iter().map(str::to_owned).collect();
        Scope { reserved: dialect.reserved(), longest: dialect.longest_name(), used, n_temporaries: 0 }
    }

    /// Marks more names as in use.
    pub(super) fn take<'n>(&mut self, names: impl IntoIterator<Item = &'n str>) {
        self.used.extend(names.into_iter().map(str::to_owned));
    }

    /// An identifier that the language has for `name`, with room for a number behind a long one.
    fn legal(&self, name: &str) -> String {
        let mut text = legal(self.reserved, name);
        text.truncate(self.longest.saturating_sub(ROOM));
        text
    }

    /// The identifier for `name`: `type` becomes `type_`, a second `p` becomes `p_2`.
    pub(super) fn add(&mut self, name: &str) -> String {
        let legal = self.legal(name);
        let mut identifier = legal.clone();
        let mut n = 1;
        while !self.used.insert(identifier.clone()) {
            n += 1;
            identifier = format!("{legal}_{n}");
        }
        identifier
    }

    /// The identifiers for several names. Those that can keep their spelling do, whatever comes before them: of
    /// `type` and `type_`, the first becomes `type__2`.
    pub(super) fn add_all<'n>(&mut self, names: impl IntoIterator<Item = &'n str>) -> Vec<String> {
        let names: Vec<&str> = names.into_iter().collect();
        let mut identifiers: Vec<Option<String>> = Vec::with_capacity(names.len());
        for name in &names {
            let keeps = self.legal(name) == *name && self.used.insert((*name).to_owned());
            identifiers.push(keeps.then(|| (*name).to_owned()));
        }
        let pairs = identifiers.into_iter().zip(names);
        pairs.map(|(identifier, name)| identifier.unwrap_or_else(|| self.add(name))).collect()
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
pub(super) fn legal(reserved: &[&str], name: &str) -> String {
    let mut text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit()) {
        text.insert(0, 'x');
    }
    if reserved.contains(&text.as_str()) {
        text.push('_');
    }
    text
}
