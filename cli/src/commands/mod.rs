//! The commands: arguments, and what is done with them.
//!
//! Does not know: how anything is computed or drawn.

pub mod check;
pub mod completions;
pub mod ensemble;
pub mod eval;
pub mod explain;
pub mod fit;
pub mod fmt;
pub mod generate;
pub mod import;
pub mod linearize;
pub mod list;
#[cfg(feature = "lsp")]
pub mod lsp;
pub mod man;
pub mod new;
pub mod options;
pub mod reduce;
pub mod report;
pub mod simulate;
pub mod trim;

use clap::Subcommand;

use hamel_run::error::Error;
use hamel_run::session::Session;

/// The program that a command belongs to: `hamel` itself, or one that has its commands beside others.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// How it is started.
    pub name: &'static str,
    /// The name that a shell completes.
    pub completed: &'static str,
    /// All its arguments.
    pub arguments: fn() -> clap::Command,
}

/// The commands that `hamel` shares with `cargo xtask`.
#[derive(Clone, Debug, Subcommand)]
#[non_exhaustive]
pub enum Command {
    #[allow(missing_docs, reason = "help is that of the arguments")]
    New(new::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Import(import::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    List(list::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Explain(explain::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Eval(eval::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Simulate(simulate::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Ensemble(ensemble::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Fit(fit::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Linearize(linearize::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Trim(trim::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Reduce(reduce::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Report(report::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Check(check::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Fmt(fmt::Arguments),
    #[cfg(feature = "lsp")]
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Lsp(lsp::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Completions(completions::Arguments),
    #[allow(missing_docs, reason = "help is that of the arguments")]
    Man(man::Arguments),
}

impl Command {
    /// Does it; what is to be printed.
    ///
    /// # Errors
    /// Everything that can be wrong with names, values, models and files.
    pub fn run(&self, session: &Session, program: &Program) -> Result<String, Error> {
        match self {
            Command::New(arguments) => new::run(session, program, arguments),
            Command::Import(arguments) => import::run(session, arguments),
            Command::List(arguments) => list::run(session, arguments),
            Command::Explain(arguments) => explain::run(session, arguments),
            Command::Eval(arguments) => eval::run(session, arguments),
            Command::Simulate(arguments) => simulate::run(session, arguments),
            Command::Ensemble(arguments) => ensemble::run(session, arguments),
            Command::Fit(arguments) => fit::run(session, arguments),
            Command::Linearize(arguments) => linearize::run(session, arguments),
            Command::Trim(arguments) => trim::run(session, arguments),
            Command::Reduce(arguments) => reduce::run(session, arguments),
            Command::Report(arguments) => report::run(session, arguments),
            Command::Check(arguments) => check::run(session, arguments),
            Command::Fmt(arguments) => fmt::run(arguments),
            #[cfg(feature = "lsp")]
            Command::Lsp(arguments) => lsp::run(arguments),
            Command::Completions(arguments) => Ok(completions::run(program, arguments)),
            Command::Man(arguments) => man::run(program, arguments),
        }
    }
}
