//! Indices of loops beside the other names of a file.
//!
//! Deliberately does not know: items.

use std::collections::BTreeSet;

use super::values::Elaboration;
use crate::spec::ast::{File, Name};
use crate::spec::diagnostic::Diagnostic;

impl Elaboration<'_> {
    /// Refuses a name that is an index somewhere and declared as something else: within the loop it would mean the
    /// index.
    pub(super) fn check_indices(&mut self, file: &File) {
        let mut seen: BTreeSet<&str> = BTreeSet::new();
        let first: Vec<&Name> =
            file.indices.iter().map(|(name, _)| name).filter(|name| seen.insert(&name.text)).collect();
        for name in first {
            let Some(place) = self.builder.place_of_name(&name.text) else { continue };
            let problem = Diagnostic::new(Some(name.span), format!("`{}` is declared twice", name.text));
            let problem = problem.with_label("again as the index of a loop").with_place(place, "here");
            self.builder.problems.push(problem.with_help("give the index another name"));
        }
    }
}
