//! Parses the arguments of `cargo xtask`: the repository's chores, and the commands of `hamel`.
//!
//! Does not know: generated code. A broken generated file can always be regenerated, because nothing here depends on
//! it.

mod bench;
mod cargo;
mod dist;
mod generate;
mod package;
mod site;
mod stress;
mod test;
mod tidy;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};
use hamel::commands::{Command, Program};
use hamel_run::Error;
use hamel_run::cache::Cache;
use hamel_run::repository::Repository;
use hamel_run::session::Session;
use hamel_run::signs;

/// The repository's chores, and the commands of `hamel`
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, propagate_version = false, after_help = TOP)]
struct Cli {
    #[command(subcommand)]
    task: Task,
    /// What generating a scene may take, as a multiple of the default limits of expressions, memory and work
    #[arg(long, global = true, value_name = "N", default_value_t = 1, hide_default_value = true)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..))]
    budget: u64,
    /// A size of a family of models, in the place of that of its file; may be repeated
    #[arg(long, global = true, value_name = "NAME=N", value_parser = hamel_run::request::sizes::assignment)]
    size: Vec<(String, i64)>,
    /// Derive everything anew, and keep nothing in the folder for caches
    #[arg(long, global = true)]
    no_cache: bool,
    #[command(flatten)]
    telling: hamel::Telling,
}

const TOP: &str = "\
The commands of hamel are here as well, without installing it: cargo xtask explain is hamel explain, and examples of their
help are written so. Models are files in models/specs and models/shelf; wherever a model is named, a path that ends in
.hamel may stand as well.
Exit status: 0 done, 1 failed, 2 bad input.

Examples:
  cargo xtask generate
  cargo xtask test
  cargo xtask simulate heavy_top -o heavy_top.svg";

#[derive(Subcommand)]
enum Task {
    // Help is that of the arguments.
    Generate(generate::Arguments),
    #[command(flatten)]
    Shared(Box<Command>),
    /// Measure the generated code beside other ways to the same numbers
    Bench {
        #[command(subcommand)]
        what: bench::Bench,
    },
    // Help is that of the arguments.
    Test(test::Arguments),
    /// Check that the crates can be published: metadata, files, and a build of what was packaged
    #[command(after_help = "\
Examples:
  cargo xtask package
  cargo xtask package --no-verify       metadata and files only")]
    Package {
        /// Do not build what was packaged
        #[arg(long)]
        no_verify: bool,
    },
    /// Check the order of modules, the lengths of files and lines
    #[command(after_help = "\
Examples:
  cargo xtask tidy
  cargo xtask tidy --wrap       long lines of comments and Markdown are broken first")]
    Tidy {
        /// Break long lines of comments and Markdown
        #[arg(long)]
        wrap: bool,
    },
    // Help is that of the arguments.
    Site(site::Arguments),
    Dist(dist::Arguments),
    Stress(stress::Arguments),
}

/// The repository that this program was started from, otherwise the one it was built in.
fn repository() -> Result<Repository, Error> {
    let started = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let built = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    started.into_iter().chain([built]).find_map(|package| Repository::around(&package)).ok_or_else(|| {
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        Error::io("models/specs: start this program with `cargo xtask` in the repository", missing)
    })
}

fn run(Cli { task, budget, size, no_cache, telling }: Cli) -> Result<String, Error> {
    telling.begin();
    let repository = repository()?;
    let session = Session::of_repository(repository.clone()).with_budget(budget).with_sizes(size);
    let session = session.with_cache(if no_cache { Cache::none() } else { Cache::of_user() });
    let program = Program { name: "cargo xtask", completed: "xtask", arguments: Cli::command };
    match task {
        Task::Shared(command) => {
            signs::watch();
            command.run(&session, &program)
        }
        Task::Generate(arguments) => generate::run(&repository, &session, &arguments),
        Task::Bench { what } => what.run(&repository, &session),
        Task::Test(arguments) => test::test(&repository, &arguments),
        Task::Package { no_verify } => package::package(&repository, !no_verify),
        Task::Tidy { wrap } => tidy::tidy(&repository, wrap),
        Task::Dist(arguments) => dist::run(&repository, &arguments),
        Task::Site(arguments) => site::run(&repository, &session, &arguments),
        Task::Stress(arguments) => stress::stress(&repository, &session, &arguments),
    }
}

fn main() -> ExitCode {
    match hamel::arguments() {
        Ok(arguments) => {
            hamel_run::interrupts::watch();
            hamel::finish(run(arguments))
        }
        Err(ended) => ended,
    }
}

#[cfg(test)]
#[path = "../../cli/tests/common/pages.rs"]
mod pages;

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::{Cli, pages};

    /// Every `cargo xtask` in a shell block of the documentation has arguments that the program takes.
    #[test]
    fn documented_commands_parse() {
        pages::each_command("cargo xtask", |page, words| {
            let arguments = std::iter::once("cargo xtask").chain(words.iter().map(String::as_str));
            if let Err(error) = Cli::try_parse_from(arguments)
                && error.use_stderr()
            {
                panic!("{}: {words:?}\n{error}", page.path.display());
            }
        });
    }
}
