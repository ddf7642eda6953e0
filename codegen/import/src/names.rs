//! Names of the model: as in the file where the model language has such names, and each once.
//!
//! Deliberately does not know: XML, links, joints.

use std::collections::BTreeSet;

use hamel_lang::spec::name_refusal;

/// Names that are taken.
#[derive(Clone, Debug)]
pub(crate) struct Names {
    taken: BTreeSet<String>,
}

impl Names {
    pub(crate) fn new(reserved: &[&str]) -> Names {
        Names { taken: reserved.iter().map(|name| (*name).to_owned()).collect() }
    }

    /// Takes names as they are.
    pub(crate) fn reserve(&mut self, names: impl IntoIterator<Item = String>) {
        self.taken.extend(names);
    }

    /// The name nearest to a given one such that all names around it are free, which are taken then. `around` are
    /// patterns with `*` for the name, which the language has to have itself: frames are named so.
    pub(crate) fn take(&mut self, given: &str, around: &[&str]) -> String {
        let base = word(given);
        let candidates = std::iter::once(base.clone()).chain((2..).map(|k| format!("{base}_{k}")));
        for name in candidates {
            let all: Vec<String> = around.iter().map(|pattern| pattern.replace('*', &name)).collect();
            let is_refused = std::iter::once(&name).chain(&all).any(|n| name_refusal(n).is_some());
            if !is_refused && all.iter().all(|n| !self.taken.contains(n)) {
                self.taken.extend(all);
                return name;
            }
        }
        unreachable!("finitely many names are taken")
    }
}

/// Letters, digits and underscores, a letter first.
pub(crate) fn word(given: &str) -> String {
    let name: String = given.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let name = name.trim_start_matches('_');
    match name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => name.to_owned(),
        false => format!("n{name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::Names;

    #[test]
    fn names_stay_unless_they_cannot() {
        let mut names = Names::new(&["g"]);
        assert_eq!(names.take("arm", &["*", "*_dot"]), "arm");
        assert_eq!(names.take("arm-1", &["*", "*_dot"]), "arm_1");
        assert_eq!(names.take("arm_1", &["*", "*_dot"]), "arm_1_2");
        assert_eq!(names.take("g", &["*"]), "g_2");
        assert_eq!(names.take("7", &["*"]), "n7");
        assert_eq!(names.take("pi", &["*"]), "pi_2");
        assert_eq!(names.take("else", &["E_*"]), "else_2");
        assert_eq!(names.take("arm_dot", &["*", "*_dot"]), "arm_dot_2");
        assert_eq!(names.take("", &["*"]), "n");
    }
}
