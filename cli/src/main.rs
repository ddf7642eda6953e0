//! Parses the arguments of `hamel` and runs the command.

mod shipped;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};
use hamel::commands::{Command, Program, generate};
use hamel_run::cache::Cache;
use hamel_run::repository::Repository;
use hamel_run::session::Session;
use hamel_run::signs;

/// Lists, explains, evaluates, integrates and generates models of mechanics with symmetry
#[derive(Parser)]
#[command(name = "hamel", version, propagate_version = false, after_help = TOP)]
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
A model is named by a path that ends in .hamel, or by the name of one that comes with the program: see hamel list.
Exit status: 0 done, 1 failed, 2 bad input.

Examples:
  hamel list
  hamel explain heavy_top
  hamel simulate heavy_top -o heavy_top.svg
  hamel new my_model
  hamel simulate my_model.hamel
  hamel generate my_model.hamel --out-dir src/generated";

#[derive(Subcommand)]
enum Task {
    #[command(flatten)]
    Shared(Box<Command>),
    // Help is that of the arguments.
    Generate(generate::Arguments),
}

fn main() -> ExitCode {
    let Cli { task, budget, size, no_cache, telling }: Cli = match hamel::arguments() {
        Ok(arguments) => arguments,
        Err(ended) => return ended,
    };
    telling.begin();
    signs::watch();
    hamel_run::interrupts::watch();
    let here = std::env::current_dir().ok();
    let session = match here.and_then(|folder| Repository::around(&folder)) {
        Some(repository) => Session::of_repository(repository),
        None => Session::of_shipped(shipped::SHIPPED),
    };
    let session = session.with_budget(budget).with_sizes(size);
    let session = if no_cache { session.anew() } else { session.with_cache(Cache::of_user()) };
    let program = Program { name: "hamel", completed: "hamel", arguments: Cli::command };
    hamel::finish(match task {
        Task::Shared(command) => command.run(&session, &program),
        Task::Generate(arguments) => generate::run(&session, &arguments),
    })
}

#[cfg(test)]
#[path = "../tests/common/pages.rs"]
mod pages;

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::{Cli, pages};

    /// Every call of `hamel` in a shell block of the documentation has arguments that the program takes.
    #[test]
    fn documented_commands_parse() {
        pages::each_command("hamel", |page, words| {
            let arguments = std::iter::once("hamel").chain(words.iter().map(String::as_str));
            if let Err(error) = Cli::try_parse_from(arguments)
                && error.use_stderr()
            {
                panic!("{}: {words:?}\n{error}", page.path.display());
            }
        });
    }
}
