//! `completions`: what a shell needs to complete arguments.
//!
//! Does not know: the commands.

use clap::Args;
use clap_complete::Shell;

use super::Program;

/// Print completions for a shell
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  source <(hamel completions bash)
  hamel completions fish > ~/.config/fish/completions/hamel.fish"
)]
pub struct Arguments {
    /// The shell
    pub shell: Shell,
}

/// The completions.
pub fn run(program: &Program, arguments: &Arguments) -> String {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut (program.arguments)(), program.completed, &mut text);
    String::from_utf8_lossy(&text).into_owned()
}
