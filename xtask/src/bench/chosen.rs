//! The models that are measured and the instructions to do so with: what all measurements of models are told alike.
//!
//! Deliberately does not know: what is measured.

use std::path::{Path, PathBuf};

use clap::Args;
use hamel_run::Error;
use hamel_run::repository::Repository;

use super::program::TargetCpu;

/// Which models, and for which instructions.
#[derive(Clone, Debug, Args)]
pub(crate) struct Chosen {
    /// Names of models; those of the page when none is given
    pub(super) models: Vec<String>,
    /// Instruction set to compile for [default: x86-64-v3 where this machine has it, otherwise baseline]
    #[arg(long, value_enum)]
    target_cpu: Option<TargetCpu>,
}

impl Chosen {
    /// The instruction set.
    pub(super) fn target_cpu(&self) -> TargetCpu {
        self.target_cpu.unwrap_or_else(TargetCpu::of_host)
    }

    /// The models that were named, otherwise all of a page.
    pub(super) fn or(&self, page: &[&str]) -> Vec<String> {
        if self.models.is_empty() {
            page.iter().map(|&name| name.to_owned()).collect()
        } else {
            self.models.clone()
        }
    }

    /// The command that repeats a measurement with further options.
    pub(super) fn command(&self, measurement: &str, options: &[String]) -> String {
        let mut words = vec![format!("cargo xtask bench {measurement}")];
        words.extend(self.models.iter().cloned());
        words.extend(options.iter().cloned());
        words.push(format!("--target-cpu {}", self.target_cpu().name()));
        words.join(" ")
    }

    /// A report for a terminal, after its page was written where it is about all models.
    ///
    /// # Errors
    /// That of `write`, which writes into a folder and tells the paths.
    pub(super) fn finish(
        &self,
        repository: &Repository,
        mut text: String,
        write: impl FnOnce(&Path) -> Result<Vec<PathBuf>, Error>,
    ) -> Result<String, Error> {
        if self.models.is_empty() {
            for path in write(&repository.root().join("docs/benchmarks"))? {
                text.push_str(&format!("wrote {}\n", repository.shown(&path)));
            }
        } else {
            text.push_str("docs/benchmarks is written when no models are named\n");
        }
        Ok(text)
    }
}

/// `--peers` where peers are measured, too.
pub(super) fn peers(are_measured: bool) -> Option<String> {
    are_measured.then(|| "--peers".to_owned())
}

#[cfg(test)]
mod tests {
    use super::{Chosen, TargetCpu, peers};

    #[test]
    fn a_command_repeats_what_was_chosen() {
        let chosen = Chosen { models: vec!["heavy_top".into()], target_cpu: Some(TargetCpu::Baseline) };
        let options: Vec<String> = ["--rounds 3".to_owned()].into_iter().chain(peers(true)).collect();
        let command = chosen.command("wp", &options);
        assert_eq!(command, "cargo xtask bench wp heavy_top --rounds 3 --peers --target-cpu baseline");
        assert_eq!(chosen.or(&["a", "b"]), ["heavy_top"]);
        let all = Chosen { models: Vec::new(), ..chosen };
        assert_eq!(all.or(&["a", "b"]), ["a", "b"]);
    }
}
