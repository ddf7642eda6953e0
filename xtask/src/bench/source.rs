//! Where measured numbers come from: the command that repeats them, the processor and the compiler.
//!
//! Does not know: what was measured.

use super::program::{cpu, rustc};

/// What a report says of its own origin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Source {
    /// The command that repeats it.
    pub(crate) command: String,
    /// The processor.
    pub(crate) cpu: String,
    /// The compiler.
    pub(crate) rustc: String,
}

impl Source {
    /// A command run here.
    pub(super) fn here(command: String) -> Source {
        Source { command, cpu: cpu(), rustc: rustc() }
    }

    /// For a terminal: two lines.
    pub(super) fn text(&self) -> String {
        format!("{}\n{}\n", self.command, self.machine())
    }

    /// For a page: the beginning of a sentence.
    pub(super) fn markdown(&self) -> String {
        format!("Written by `{}` on {} with {}", self.command, self.cpu, self.rustc)
    }

    /// Three lines of comment at the head of a table of comma separated values.
    pub(super) fn csv(&self) -> String {
        format!("# {}\n# {}\n# {}\n", self.command, self.cpu, self.rustc)
    }

    /// The processor and the compiler.
    pub(super) fn machine(&self) -> String {
        format!("{}, {}", self.cpu, self.rustc)
    }

    /// The source of the reports of tests.
    #[cfg(test)]
    pub(super) fn of_test(command: &str) -> Source {
        Source { command: command.into(), cpu: "a cpu".into(), rustc: "rustc 1.0".into() }
    }
}
