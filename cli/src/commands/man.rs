//! `man`: manual pages.
//!
//! Does not know: the commands.

use clap::Args;

use super::Program;
use hamel_run::error::Error;

/// Print the manual page of the program, or of a command
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  hamel man | man -l -
  hamel man simulate | man -l -")]
pub struct Arguments {
    /// Name of a command, and of its part
    pub command: Vec<String>,
}

/// The page.
///
/// # Errors
/// [`Error::UnknownCommand`].
pub fn run(program: &Program, arguments: &Arguments) -> Result<String, Error> {
    let mut command = (program.arguments)();
    // Makes usage lines start with the program's name.
    command.build();
    for name in &arguments.command {
        let found = command.find_subcommand(name).cloned();
        command = found.ok_or_else(|| Error::UnknownCommand {
            name: name.clone(),
            known: command.get_subcommands().map(|c| c.get_name().to_owned()).collect(),
        })?;
    }
    let mut text = Vec::new();
    clap_mangen::Man::new(command).render(&mut text).map_err(|e| Error::io("manual page", e))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}
